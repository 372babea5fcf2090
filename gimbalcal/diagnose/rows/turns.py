r"""Turns between rests as a view: gravity carried by the gyroscopes from one rest to the next, and where it is found.

What the gyroscopes read at rest is taken off, by the neighbouring rests or by what the rests were found to show; so
effects that show there are not for this view, and what grows with the rate is.

Where gravity is before and after a turn the accelerometers say, with the model that the diagnosis of the forces ended
with. What that model leaves open is no fault of a gyroscope: with A the derivative of the rows by its parameters, of
covariance P, and sigma the scatter of the turns, the rows are weighed by

.. math:: W = \left(1 + A P A^T / \sigma^2\right)^{-1/2} ,

one for a turn that the accelerometers tell well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.readout import in_si
from gimbalcal.effects import CATALOGUE, Effect, Stimulus, parameters, with_values
from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS, GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES, follows, lacking
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.gyroscopes.rests import BIAS, level_of, rests
from gimbalcal.estimate.gyroscopes.turn_fit import fit_turns, rows_of_turns
from gimbalcal.estimate.gyroscopes.turns import Turns, end_of, turns_between_rests
from gimbalcal.forward import Rows, accelerometers, linearise
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means, dwells
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import normal_to
from gimbalcal.views.core import View, absent_effect, recording_fields
from gimbalcal.views.noise import NoiseModel
from gimbalcal.views.norm import inverted

BACK = 0.01  # of the attitude's elements: gimbals that stand where they stood
FEWEST = 12  # turns: twice as many numbers, for nine parameters of the linear model and what is asked beyond
SURE = 6  # numbers that must be left of the turns to tell their scatter beside what the accelerometers leave open


def view_of_turns(
    recording: Recording, accelerometers: Calibration | None = None, at_rest: Sequence[Effect] = ()
) -> View | None:
    """The turns of a recording, across gravity; None where there are too few or nothing was logged on the way.

    accelerometers: their model, with its covariance (left out, bias, scale and misalignment by the norm of gravity);
    at_rest: effects by which the rests tell what gyroscopes read that do not turn (left out, bias and g-sensitivity).
    """
    if recording.position is None or not np.any(recording.position == 0):
        return None
    made = accelerometers or multiposition(recording, ACCELEROMETER_TERMS)
    try:
        turns, _, scale = turns_between_rests(recording, made, at_rest)
        still = rests(recording, made, scale, turns)
        level = level_of(still, True)[0]
        if not at_rest and len(level.parameters) > len(parameters(CATALOGUE[BIAS])):
            turns = turns_between_rests(recording, made, level.effects)[0]
    except InputError:
        return None
    if len(turns.before) < FEWEST:
        return None
    turns = _with_headings(turns, made.apply(recording))
    sideways = _across(turns.after)

    def across(effects: Sequence[Effect]) -> Rows:
        return rows_of_turns(turns, effects).reduced(lambda X: sideways @ X)

    try:
        linear = fit_turns(turns, GYROSCOPE_INPUT_TERMS).effects
    except InputError:  # turns that do not tell all of it apart still tell something
        linear = ()
    W = _weights(across, linear, sideways @ _left_open(recording, made, turns))

    def rows(effects: Sequence[Effect]) -> Rows:
        return rows_of_turns(turns, effects).reduced(lambda X: _weighed(W, sideways, X))

    ends = dwell_means(recording).select(turns.ends)
    s = stimulus_from_readings(ends)
    return View(
        "turns", unit="arcsec", channels=((RATE, "level"), (RATE, "tilted")), **recording_fields(ends), stimulus=s,
        label=s.position, evaluate=rows, stages=GYROSCOPE_STAGES, baseline=GYROSCOPE_INPUT_TERMS,
        gauge=_at_rest(turns.stimulus), groups=np.arange(len(turns.ends)), noise=NoiseModel(),
    )  # fmt: skip


def _weighed(W: Array, sideways: Array, X: Array) -> Array:
    """Rows (m, 2, p) across gravity of columns X (m, 3, p), weighed."""
    m = len(sideways)
    return np.asarray((W @ (sideways @ X).reshape(2 * m, -1)).reshape(m, 2, -1))


def _left_open(recording: Recording, made: Calibration, turns: Turns) -> Array:
    """What one sigma of each combination of the accelerometers' parameters does to gravity after turns (m, 3, p)."""
    wanted = tuple(p for p in made.parameters if CATALOGUE[p.effect].stage in SENSOR_STAGES)
    at = [made.parameters.index(p) for p in wanted]
    if not wanted or not len(made.covariance):
        return np.zeros((len(turns.ends), 3, 0))
    size, axes = np.linalg.eigh(made.covariance[np.ix_(at, at)])
    means = in_si(dwell_means(recording), made.readout)
    effects = [e for e in made.effects if e.stage in SENSOR_STAGES]
    s = stimulus_from_readings(means)
    s = s.at(rate=0 * s.rate)
    f, H = inverted(lambda f: accelerometers(f, s, effects), means.triad(FORCE))
    channels = tuple((FORCE, a) for a in "xyz")
    read = linearise(BENCH, s.at(force=f), effects, channels=channels, stages=SENSOR_STAGES).jacobian(wanted)
    felt = -np.linalg.solve(H, read) @ (axes * np.sqrt(np.maximum(size, 0.0)))
    length = np.linalg.norm(f, axis=1)
    u = f / length[:, None]
    tilt = (felt - u[:, :, None] * np.einsum("ki,kip->kp", u, felt)[:, None]) / length[:, None, None]
    whole = np.broadcast_to(np.eye(3), (len(turns.ends), 3, 3))
    turn = np.stack([end_of(turns.reading, replace(turns, before=whole[:, i]))[1] for i in range(3)], axis=-1)
    return np.asarray(tilt[turns.ends] - turn @ tilt[turns.ends - 1])


def _weights(across: Callable[[Sequence[Effect]], Rows], linear: Sequence[Effect], A: Array) -> Array:
    """W (2m, 2m) of the module docstring about a linear model, A (m, 2, p) by what the accelerometers leave open."""
    rows = across(linear)
    r = rows.residual.ravel()
    A = A.reshape(len(r), -1)
    J = rows.jacobian([p for i in GYROSCOPE_INPUT_TERMS for p in parameters(CATALOGUE[i])]).reshape(len(r), -1)
    both = np.concatenate([J / np.linalg.norm(J, axis=0), A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)], axis=1)
    columns = both if both.shape[1] + SURE <= len(r) else both[:, : J.shape[1]]
    U, S, _ = np.linalg.svd(columns, full_matrices=False)
    U = U[:, S > 1e-9 * S.max()]
    variance = float(((r - U @ (U.T @ r)) ** 2).sum()) / max(len(r) - U.shape[1], 1)
    V, a, _ = np.linalg.svd(A / np.sqrt(max(variance, 1e-300)), full_matrices=False)
    return np.asarray(np.eye(len(r)) - (V * (1 - 1 / np.sqrt(1 + a**2))) @ V.T)


def _with_headings(turns: Turns, recording: Recording) -> Turns:
    """Whole revolutions as gimbals tell them: gravity says nothing of a turn about it, so north stands for it there.

    The gimbals came back, so a constant error of theirs cancels.
    """
    if not recording.platform.axes:
        return turns
    stays = dwells(recording)
    C_np = recording.platform.attitude(np.array([recording.angles()[d.rows].mean(0) for d in stays]))
    start, end = C_np[turns.ends - 1], C_np[turns.ends]
    back = np.linalg.norm(end - start, axis=(1, 2)) < BACK
    turn = np.linalg.norm((turns.reading * turns.step[..., None]).sum(1), axis=1)
    whole = (back & (turn > np.pi))[:, None]
    return replace(
        turns, before=np.where(whole, start[:, :, 0], turns.before),
        after=np.where(whole, end[:, :, 0], turns.after),
    )  # fmt: skip


def _across(down: Array) -> Array:
    """Two unit vectors (m, 2, 3) across each of `down` (m, 3)."""
    first = normal_to(down)
    return np.stack([first, np.cross(down, first)], axis=1)


def _at_rest(s: Stimulus) -> frozenset[tuple[str, str]]:
    """Parameters of gyroscopes that show where nothing turns: the rests before and after have taken them off."""
    still = s.at(rate=0 * s.rate)
    out = set()
    for cls in CATALOGUE.values():
        if cls.stage in GYROSCOPE_STAGES and not cls.spans_rows and not lacking(cls, s.carries):
            followed = next(iter(s.covariates)) if follows(cls) == "" else ""
            none = absent_effect(cls.id, s, followed)
            for p in parameters(cls, s.axis_names):
                effect = with_values([none], (p,), np.array([p.sigma]), s.axis_names)[0]
                if np.any(effect.contribution(still) != 0):
                    out.add((p.effect, p.axis))
    return frozenset(out)
