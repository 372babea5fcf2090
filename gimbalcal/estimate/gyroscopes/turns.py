r"""Turns between rests: what the gyroscopes read on the way, and where down was before and after.

The rests tell the level that a turn starts from; the accelerometers, calibrated, the direction of gravity in the frame
that the gyroscopes are referred to. Rotations are frame rotations, exp(-[phi x]) for a rotation vector phi [rad].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration import Calibration
from gimbalcal.effects import Effect, Stimulus
from gimbalcal.errors import InputError, amount
from gimbalcal.forward import gyroscopes
from gimbalcal.inversion import invert
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwells
from gimbalcal.recording.dwell import PAUSED, usual_step
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import exponential, mean_rates


@dataclass(frozen=True, eq=False)
class Turns:
    """Turns between rests, and what the hardware felt at their rows.

    Readings (m, n, 3) [rad/s] at rest level zero, steps (m, n) [s] (0 beyond the end), unit force before and after
    (m, 3); `ends` (m,) is the index of the rest after each turn, as turns in which the clock paused are left out.
    """

    reading: Array
    step: Array
    before: Array
    after: Array
    stimulus: Stimulus
    ends: NDArray[np.int64]


def turns_between_rests(
    recording: Recording, accelerometers: Calibration, at_rest: Sequence[Effect] = ()
) -> tuple[Turns, Array, float]:
    """Turns with readings less the rests' level, the level of all rests (k, 3) [rad/s], and rad/s per unit.

    The level of a turn is the mean of the rests before and after it; or, with `at_rest`, what these effects make a
    unit read that does not turn and feels the measured force. From sample to sample the readings make the rotation
    vectors of `mean_rates`.
    """
    stays = dwells(recording)
    if len(stays) < 6:
        raise InputError(
            f"{recording.title!r} holds {amount(len(stays), 'rest')}; turns between at least six are needed"
        )
    there = accelerometers.apply(recording)
    y, f = recording.triad(RATE), there.triad(FORCE)
    level, down = (
        np.array([np.average(x[d.rows], axis=0, weights=recording.weight[d.rows]) for d in stays]) for x in (y, f)
    )
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    every = [slice(a.stop - 1, b.start + 1) for a, b in pairwise(stays)]
    ends = np.flatnonzero([not paused(recording, span) for span in every]) + 1
    if not len(ends):
        raise InputError(f"{recording.title!r} has no rows between its rests: log the turns too, for the gyroscopes")
    spans = [every[k - 1] for k in ends]
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
    made = Turns(reading, step, down[ends - 1], down[ends], s, ends)
    raw = recording.counted(RATE)
    scale = _rough_scale(made) if raw else 1.0
    if at_rest:
        made = replace(made, reading=made.reading + _relevelled(made, level, scale, at_rest))
    return replace(made, reading=scale * (made.reading + bend) + scale**2 * swing), scale * level, scale


def turns_on_record(recording: Recording) -> bool:
    """Return whether there is a row for each turn on the way; a row of a table of rests that is marked 0 is none."""
    if recording.position is None:
        return False
    return bool(np.count_nonzero(recording.position == 0) >= max(len(dwells(recording)) - 1, 1))


def logged_turns(recording: Recording) -> bool:
    """Return whether a turn between two rests was logged from end to end."""
    if not turns_on_record(recording):
        return False
    return any(not paused(recording, slice(a.stop - 1, b.start + 1)) for a, b in pairwise(dwells(recording)))


def paused(recording: Recording, span: slice) -> bool:
    """Return whether the clock pauses between two rests, so that nobody knows how the unit turned meanwhile."""
    return bool(np.any(np.diff(recording.time[span]) > PAUSED * usual_step(recording)))


def _relevelled(turns: Turns, level: Array, scale: float, at_rest: Sequence[Effect]) -> Array:
    """Return the correction of the readings (m, n, 3) for a level by effects instead of the neighbouring rests."""
    felt = gyroscopes(0 * turns.stimulus.rate, turns.stimulus, at_rest).reshape(turns.reading.shape)
    neighbours = (level[turns.ends - 1] + level[turns.ends]) / 2
    return np.where(turns.step[..., None] > 0, neighbours[:, None] - felt / scale, 0.0)


def _stimulus_of(recording: Recording, spans: Sequence[slice], rate: Array, force: Array) -> Stimulus:
    """A stimulus of the turns' rows, without history: rate, force, time, temperature and covariates.

    The rate that was read, less its level at rest, stands for the true one, and the calibrated force for the force.
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
    """Common rad/s per count at which the turns fit gravity best: a scan, as nothing else says how long a turn was."""
    largest = np.median((np.linalg.norm(turns.reading, axis=-1) * turns.step).sum(1))
    guesses = np.geomspace(0.2, 20, 60) / largest  # a median turn between 0.2 and 20 rad, 8 % apart
    misfit = [np.mean(end_of(g * turns.reading, turns)[0] ** 2) for g in guesses]
    return float(guesses[int(np.argmin(misfit))])


def turned(turns: Turns, effects: Sequence[Effect]) -> Array:
    """Return the rotation of the frame in each turn (m, 3, 3), with these effects of the gyroscopes."""
    m, n = turns.step.shape
    rate, _, _ = invert(lambda w: gyroscopes(w, turns.stimulus, effects), turns.reading.reshape(-1, 3))
    C = exponential(rate.reshape(m, n, 3) * turns.step[..., None])
    out = np.broadcast_to(np.eye(3), (m, 3, 3))
    for k in range(n):
        out = C[:, k] @ out
    return np.asarray(out)


def end_of(rate: Array, turns: Turns) -> tuple[Array, Array, Array]:
    """Misfit (m, 3) of gravity after each turn, gravity predicted (m, 3), and products (m, n, 3, 3) to the end."""
    phi = rate * turns.step[..., None]
    C = exponential(phi)
    tail = np.empty_like(C)
    P = np.broadcast_to(np.eye(3), (len(C), 3, 3))
    for k in range(C.shape[1] - 1, -1, -1):
        tail[:, k] = P
        P = P @ C[:, k]
    predicted = (P @ turns.before[..., None])[..., 0]
    return turns.after - predicted, predicted, tail
