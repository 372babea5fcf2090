r"""Turns between dwells: gravity carried by the gyroscopes from one dwell to the next, and where it is.

The dwells tell the level that a turn starts from, so that effects that show at rest are not for this view, and what
grows with the rate is; the accelerometers, calibrated, the direction of gravity f in the frame that the gyroscopes are
referred to. With P the rotation that they sweep (`views.swept_rotations`), the rows are the misfit across gravity,

.. math:: r = E_{i+1} \, (\hat f_{i+1} - P \hat f_i) , \qquad
          \frac{\partial r}{\partial \phi} = - E_{i+1} \, [P \hat f_i \times]

(Tedaldi et al. 2014). What the accelerometers' model leaves open of f is no fault of a gyroscope: one sigma of each
combination of its parameters is a nuisance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.readout import in_si
from gimbalcal.checks.column_checks import at_end_of_range
from gimbalcal.effects import CATALOGUE, Effect, Stimulus
from gimbalcal.effects.baseline_effects import GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES
from gimbalcal.errors import InputError, number_of
from gimbalcal.forward import Rows, accelerometers, gyroscopes, linearise
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means, dwells
from gimbalcal.recording.dwell import moves_between_dwells
from gimbalcal.recording.record import FORCE, FORCES, RATE
from gimbalcal.rotation import composed_rotation, cross_matrix, exponential, mean_rates, normal_to
from gimbalcal.views.core import Measurement, View, gyroscope_parameters_without, nuisance, recording_fields
from gimbalcal.views.noise import NoiseModel
from gimbalcal.views.norm import inverted
from gimbalcal.views.swept_rotations import Sweeps, swept_rotation, swept_rows

MIN_TURN = 0.02  # rad that a gyroscope sweeps in some turn; white noise of 1 deg/sqrt(h) makes 0.002 in a minute
MAX_ATTITUDE_CHANGE = 0.01  # of the attitude's elements: gimbals that stand where they stood
TURNS = Measurement(
    "turns", "arcsec", "turns", channels="the direction of gravity after the turns",
    channel="the direction of gravity after a turn, {axis}", acts_on=(RATE,), patterns=frozenset({"orientation"}),
    law_suffix="_turning",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Turns(Sweeps):
    """Turns between dwells: readings less their level at rest, and the unit force before and after (m, 3).

    `ends` (m,) is the index of the dwell after each turn, as turns in which the clock paused or a gyroscope read the
    end of its range, `clipped` of `logged` ones, are left out unless there is no other; `means` are of all dwells, and
    so are `level` (k, 3) [rad/s] and C_np by gimbals, `attitude` (k, 3, 3). scale: rad/s per unit of the readings;
    accelerometers: the calibration by which gravity is found at the rests.
    """

    before: Array
    after: Array
    ends: NDArray[np.int64]
    means: Recording
    level: Array
    scale: float
    attitude: Array | None
    clipped: int
    logged: int
    accelerometers: Calibration

    def levelled(self, at_rest: Sequence[Effect]) -> Turns:
        """Return the turns with another level: what effects make a unit read that feels the force and does not turn."""
        felt = gyroscopes(0 * self.stimulus.rate, self.stimulus, at_rest).reshape(self.reading.shape)
        before = (self.level[self.ends - 1] + self.level[self.ends])[:, None] / 2
        return replace(self, reading=self.reading + np.where(self.step[..., None] > 0, before - felt, 0.0))


def turns_between_rests(recording: Recording, accelerometers: Calibration) -> Turns:
    """Return the turns; the level of each is the mean of the rests before and after it.

    From sample to sample the readings make the rotation vectors of `mean_rates`.
    """
    visits = dwells(recording)
    if len(visits) < 6:
        raise InputError(
            f"{recording.title!r} holds {number_of(len(visits), 'rest')}; turns between at least six are needed"
        )
    there = accelerometers.apply(recording)
    y, f = recording.triad(RATE), there.triad(FORCE)
    level, down = (
        np.array([np.average(x[d.rows], axis=0, weights=recording.weight[d.rows]) for d in visits]) for x in (y, f)
    )
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    every = moves_between_dwells(recording)
    logged = np.flatnonzero([not m.paused for m in every]) + 1
    if not len(logged):
        raise InputError(f"{recording.title!r} has no rows between its rests: log the turns too, for the gyroscopes")
    clipped = at_end_of_range([*y.T])
    whole = np.array([k for k in logged if not clipped[every[k - 1].rows].any()], dtype=np.int64)
    ends = whole if len(whole) else logged
    spans = [every[k - 1].rows for k in ends]
    longest = max(s.stop - s.start for s in spans) - 1
    reading, step = np.zeros((len(spans), longest, 3)), np.zeros((len(spans), longest))
    bend, swing, force = 0 * reading, 0 * reading, 0 * reading
    for i, span in enumerate(spans):
        rows = y[span] - (level[ends[i] - 1] + level[ends[i]]) / 2  # slow drift of the bias is not the turn's
        dt = np.diff(recording.time[span])
        step[i, : len(dt)] = dt
        reading[i, : len(dt)], bend[i, : len(dt)], swing[i, : len(dt)] = mean_rates(recording.time[span], rows)
        force[i, : len(dt)] = f[span][1:]
    flat = reading.reshape(-1, 3)
    s = _stimulus_of(recording, spans, flat, force.reshape(-1, 3))
    read = there.angles()
    angles = np.array([read[d.rows].mean(0) for d in visits])
    attitude = there.platform.attitude(angles) if there.platform.axes else None
    means, lost, n = dwell_means(recording), len(logged) - len(whole), len(logged)
    turns = Turns(
        reading, step, s, down[ends - 1], down[ends], ends, means, level, 1.0, attitude, lost, n, accelerometers
    )
    scale = _rough_scale(turns) if recording.counted(RATE) else 1.0
    return replace(turns, reading=scale * (reading + bend) + scale**2 * swing, level=scale * level, scale=scale)


def turns_on_record(recording: Recording) -> bool:
    """Return whether the turns between rests were logged; a single row marked 0 in a table of rests is not a turn."""
    if recording.position is None:
        return False
    return bool(np.count_nonzero(recording.position == 0) >= max(len(dwells(recording)) - 1, 1))


def logged_turns(recording: Recording) -> bool:
    """Return whether a turn between two rests was logged from end to end."""
    if not turns_on_record(recording):
        return False
    return any(not m.paused for m in moves_between_dwells(recording))


def _stimulus_of(recording: Recording, spans: Sequence[slice], rate: Array, force: Array) -> Stimulus:
    """A stimulus of the turns' rows, without history: rate, force, time, temperature and covariates.

    The rate that was read, less its level at rest, is used as the true one, and the calibrated force as the force.
    """
    s = stimulus_from_readings(recording.select(slice(spans[0].start, spans[0].start + 1)))
    n = len(rate)
    logged = {"time": recording.elapsed, "temperature": recording.channels.get(("temperature", ""))}
    if recording.restarts:
        logged["running"] = recording.time - recording.time[0]
    rows = {k: _rows_of(v, spans, n) for k, v in logged.items() if v is not None}
    followed = {k: _rows_of(v, spans, n) for k, v in stimulus_from_readings(recording).covariates.items()}
    return s.held(n).at(covariates=followed, rate=rate, force=force, **rows)


def _rows_of(x: Array, spans: Sequence[slice], n: int) -> Array:
    """Values (n,) of a channel on the steps of the turns; the last one stands where a turn is shorter than others."""
    steps = n // len(spans)
    return np.concatenate([np.pad(x[span][1:], (0, steps - len(x[span]) + 1), mode="edge") for span in spans])


def _rough_scale(turns: Turns) -> float:
    """Return the common rad/s per count at which the turns fit gravity best, by a scan, as no angle is known."""
    largest = np.median((np.linalg.norm(turns.reading, axis=-1) * turns.step).sum(1))
    guesses = np.geomspace(0.2, 20, 60) / largest  # a median turn between 0.2 and 20 rad, in steps of 8 %
    phi = turns.reading * turns.step[..., None]
    turned = (apply_matrix(composed_rotation(exponential(g * phi)), turns.before) for g in guesses)
    misfit = [np.mean((turns.after - f) ** 2) for f in turned]
    return float(guesses[int(np.argmin(misfit))])


def gravity_after_turns(turns: Turns, known: Sequence[Effect] | None = None) -> View:
    """Return the view of gravity after each turn.

    known: effects of the gyroscopes with which what the accelerometers leave open of gravity is carried through the
    turns, as nuisances; None without these.
    """
    ends, first = turns.means.select(turns.ends), normal_to(turns.after)
    across = np.stack([first, np.cross(turns.after, first)], axis=1)
    N = np.zeros((len(first), 2, 0)) if known is None else across @ _left_open(turns, known)

    def rows(effects: Sequence[Effect]) -> Rows:
        P, turned = swept_rows(turns, effects)
        predicted = apply_matrix(P, turns.before)
        carried = turned.reduced(lambda X: across @ cross_matrix(predicted) @ X)
        return replace(carried, residual=apply_matrix(across, turns.after - predicted), nuisance=N)

    s = stimulus_from_readings(ends)
    return View(
        TURNS, channels=((RATE, "level"), (RATE, "tilted")), **recording_fields(ends), stimulus=s,
        label=s.position, evaluate=rows, stages=GYROSCOPE_STAGES, baseline=GYROSCOPE_INPUT_TERMS,
        gauge=_not_shown(turns), groups=np.arange(len(turns.ends)), noise=NoiseModel(),
        nuisances=tuple(nuisance("accelerometers", str(k + 1), "1", 1.0) for k in range(N.shape[-1])),
    )  # fmt: skip


def _left_open(turns: Turns, known: Sequence[Effect]) -> Array:
    """Derivative (m, 3, p) of predicted gravity by one sigma of each combination of the accelerometers' parameters."""
    calibration = turns.accelerometers
    wanted = tuple(p for p in calibration.parameters if CATALOGUE[p.effect].stage in SENSOR_STAGES)
    at = [calibration.parameters.index(p) for p in wanted]
    if not wanted or not len(calibration.covariance):
        return np.zeros((len(turns.ends), 3, 0))
    size, axes = np.linalg.eigh(calibration.covariance[np.ix_(at, at)])
    means = in_si(turns.means, calibration.readout)
    effects = [e for e in calibration.effects if e.stage in SENSOR_STAGES]
    s = stimulus_from_readings(means)
    s = s.at(rate=0 * s.rate)
    f, H = inverted(lambda f: accelerometers(f, s, effects), means.triad(FORCE))
    read = linearise(BENCH, s.at(force=f), effects, channels=FORCES, stages=SENSOR_STAGES).jacobian(wanted)
    felt = -np.linalg.solve(H, read) @ (axes * np.sqrt(np.maximum(size, 0.0)))
    length = np.linalg.norm(f, axis=1)
    u = f / length[:, None]
    tilt = (felt - u[:, :, None] * np.einsum("ki,kip->kp", u, felt)[:, None]) / length[:, None, None]
    return np.asarray(swept_rotation(turns, known) @ tilt[turns.ends - 1] - tilt[turns.ends])


def with_headings(turns: Turns) -> Turns:
    """Return turns whose whole revolutions are as gimbals tell them: gravity says nothing of a turn about it.

    North stands for it there; the gimbals came back, so a constant error of theirs cancels.
    """
    if turns.attitude is None:
        return turns
    start, end = turns.attitude[turns.ends - 1], turns.attitude[turns.ends]
    back = np.linalg.norm(end - start, axis=(1, 2)) < MAX_ATTITUDE_CHANGE
    turn = np.linalg.norm((turns.reading * turns.step[..., None]).sum(1), axis=1)
    whole = (back & (turn > np.pi))[:, None]
    return replace(
        turns, before=np.where(whole, start[:, :, 0], turns.before), after=np.where(whole, end[:, :, 0], turns.after)
    )


def _not_shown(turns: Turns) -> frozenset[tuple[str, str]]:
    """Parameters of gyroscopes that turns do not show: those that show at rest, and of axes about which none is made.

    The dwells before and after a turn have taken off what shows at rest. About an axis without a turn a gyroscope reads
    noise: as a regressor that would explain itself, by a scale factor of -1.
    """
    s, shape = turns.stimulus, turns.reading.shape
    swept_angle = np.abs(np.cumsum(turns.reading * turns.step[..., None], axis=1)).max(axis=(0, 1))
    turned = s.at(rate=np.where(swept_angle > MIN_TURN, s.rate.reshape(shape), 0.0).reshape(-1, 3))
    still = s.at(rate=0 * s.rate)

    def shown(effect: Effect) -> bool:
        return not np.any(effect.contribution(still) != 0) and bool(np.any(effect.contribution(turned) != 0))

    return gyroscope_parameters_without(s, shown)
