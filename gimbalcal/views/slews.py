r"""Slews as a view: the delay of the sensors with respect to the motion of the unit.

The motion is that of the readouts of the gimbals; for a unit in the hand, the gyroscopes carry gravity from the rest
before the turn. Each slew, with some of the rests at both ends, is one row: of the misfit X of its samples, as a delay,

.. math:: \delta t = \frac{p^T X}{p^T p}, \qquad p = (1 - Q Q^T) \, T

with T what a second of delay does, :math:`\dot f` to the force and, to the attitude that the gyroscopes add up, the
rate. Q spans the errors that are not delays: an initial error of the attitude, or one that grows with time, constants,
scale and misalignment of gyroscopes, and the force of a lever, which a hand changes from turn to turn. So errors that
act at rest or from rest to rest are excluded, and the scatter from slew to slew gives the sigma of a delay. A channel
that is late by more than that is shifted, by cubics through its samples, before the rest is estimated.

What all slews have in common in addition to a delay is systematic: a hand moves a unit sideways in the sense in which
it turns it, and cubics are inexact between samples. For rows y of a channel, of sigma s_k, with c the common part,

.. math:: y' = S \left(1 + c^2 \, a a^T\right)^{-1/2} S^{-1} \, y, \qquad S = \mathrm{diag}(s_k), \; a_k = 1 / s_k .
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, parameters, parameters_of_effects, values
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES
from gimbalcal.effects.history import integral, slope
from gimbalcal.errors import InputError
from gimbalcal.forward import Rows, linearise, rate_of_chain
from gimbalcal.inference.algebra import orthonormal_columns
from gimbalcal.kinematics import ideal_force, stimulus_from_readings, stimulus_from_truth
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means, dwells
from gimbalcal.recording.dwell import moves_between_dwells, rests_are_means
from gimbalcal.recording.kinds import ROTATION
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import exponential, mean_rates
from gimbalcal.views.core import Measurement, View, recording_fields
from gimbalcal.views.noise import NoiseModel

MIN_SLEWS = 6  # slews: their scatter tells how well a delay is known
ROWS = 6  # on the way: fewer do not tell how a slew goes
REST_SHARE = 0.5  # of the slew's rows, from the rest at each end: a delay shows there too
MAX_SMOOTHED_ROWS = 9  # rows of readouts that a parabola smooths at most, and an eighth of the slew
LATENCIES = ("time_tag_latency", "gyro_latency", "readout_latency")
MIN_POWER_LEFT = 1e-3  # of the power of T that Q must leave
MIN_RELATIVE_SIZE = 1e-3  # of the size of p of the best slew
MIN_DELAY_SIGMAS = 3.0  # sigmas of a delay that is worth a shift
MIN_GRAVITY_SHARE = 0.05  # of gravity, by which a slew moves it
HAND = 5e-3  # s, that all turns by one hand may have in common: 9 ms in MPU-9150, 1.5 and 3 ms in a BMI160, a phone
SAMPLED = 2e-3  # of a step, the same for gimbals: 8e-4 in revolutions at 10 Hz
MAX_BENDING_SHARE = 5e-3  # of a delay: 3e-3 of 200 ms where slews of 60 deg/s take up their speed in 75 ms
ROUNDS = 3  # of shifts: each leaves what is left times the delay over the slew
SLEWS = Measurement(
    "slews", "ms", "slews", channels="the delay of the sensors in slews",
    channel="the delay of the {axis} in slews", timing=True,
)  # fmt: skip

Slew = tuple[NDArray[np.int64], int]
"""Rows of a slew with some of the adjacent rests, and the ordinal of the rest after."""


@dataclass(frozen=True, eq=False)
class SlewMotion:
    """N rows of all slews: number of the row and of its slew, turn C (N, 3, 3) from a frame at rest, rate, stimulus."""

    row: NDArray[np.int64]
    slew: NDArray[np.int64]
    C: Array
    rate: Array
    stimulus: Stimulus
    axes: Array  # (N, 3, k) of the gimbals, in the frame at rest

    @property
    def spans(self) -> list[slice]:
        """The rows of each slew."""
        edges = np.flatnonzero(np.diff(self.slew, prepend=-1, append=-1))
        return [slice(int(a), int(b)) for a, b in pairwise(edges)]


def slews(recording: Recording) -> list[Slew] | str:
    """Return rows of each slew with some of the adjacent rests, and the ordinal of the rest after; or why none."""
    visits = dwells(recording)
    if recording.position is None or not np.any(recording.position == 0):
        return "no rows between positions were logged"
    if rests_are_means(recording):
        return "the rests come as means, and a delay shows where they end"
    out = []
    for k, move in enumerate(moves_between_dwells(recording), start=1):
        a, b = visits[k - 1 : k + 1]
        n = b.start - a.stop
        if n < ROWS or move.paused:
            continue
        aside = max(2, round(REST_SHARE * n))
        first, last = max(a.start, a.stop - aside), min(b.stop, b.start + aside)
        out.append((np.arange(first, last), k))
    return out if len(out) >= MIN_SLEWS else f"fewer than {MIN_SLEWS} slews have {ROWS} rows or more"


def on_gimbals(recording: Recording, moves: Sequence[Slew]) -> SlewMotion:
    """Return the motion by the readouts, smoothed."""
    row = np.concatenate([r for r, _ in moves])
    slew = np.concatenate([np.full(len(r), i) for i, (r, _) in enumerate(moves)])
    angle = np.concatenate([_smoothed_angles(recording.angles()[r]) for r, _ in moves])
    part = recording.select(row)
    turned = {("gimbal_angle", a): angle[:, i] for i, a in enumerate(part.platform.axis_names)}
    part = part.with_channels(turned)
    speed = slope(angle, part.time, slew)
    C = part.platform.attitude(angle)
    s = stimulus_from_truth(part, ideal_force(part, angle), np.zeros((len(row), 3))).at(visit=slew)
    axes = np.stack([rate_of_chain(part.platform, s, (), e) for e in np.eye(angle.shape[1])], axis=-1)
    rate = np.einsum("nik,nk->ni", axes, speed)
    s = s.at(rate=rate)
    return SlewMotion(row, slew, C, rate, s, np.swapaxes(C, -1, -2) @ axes)


def _smoothed_angles(angle: Array) -> Array:
    """Readouts (n, k) of one slew through parabolas: even about each row, so that nothing comes early or late."""
    from scipy.signal import savgol_filter

    size = min(MAX_SMOOTHED_ROWS, len(angle) // 8) | 1
    return angle if size < 5 else np.asarray(savgol_filter(angle, size, 2, axis=0, mode="nearest"))


def by_hand(recording: Recording, moves: Sequence[Slew]) -> SlewMotion:
    """Return the motion by calibrated gyroscopes, less their reading at rest, from the rest before each turn."""
    visits, y, f = dwells(recording), recording.triad(RATE), recording.triad(FORCE)
    row = np.concatenate([r for r, _ in moves])
    slew = np.concatenate([np.full(len(r), i) for i, (r, _) in enumerate(moves)])
    level = np.array([y[d.rows].mean(0) for d in visits])
    rate = np.concatenate([y[r] - (level[k - 1] + level[k]) / 2 for r, k in moves])
    turned, force = [], []
    for i, (r, k) in enumerate(moves):
        phi = np.sum(mean_rates(recording.time[r], rate[slew == i]), axis=0) * np.diff(recording.time[r])[:, None]
        C = [np.eye(3)]
        for step in exponential(phi):
            C.append(step @ C[-1])
        turned.append(np.array(C))
        down = f[visits[k - 1].rows].mean(0)
        force.append(turned[-1] @ (down / np.linalg.norm(down) * recording.site.gravity))
    s = stimulus_from_truth(recording.select(row), np.concatenate(force), rate).at(visit=slew)
    return SlewMotion(row, slew, np.concatenate(turned), rate, s, np.zeros((len(row), 3, 0)))


def view_of_slews(
    recording: Recording, calibration: Calibration, gyro: Sequence[Effect] = (), means: bool = False
) -> View | str:
    """Return the slews of a recording, or why they do not determine a delay.

    calibration: of accelerometers and mount, from the rests; gyro: of the gyroscopes, from turns; means: whether
    force and rate are said to be means over the interval before a row, which lag by half of it.
    """
    gimballed = bool(recording.platform.axes)
    moves = slews(recording)
    if isinstance(moves, str):
        return moves
    if not gimballed and not (recording.has(RATE) and recording.has(FORCE)):
        return "neither readouts nor gyroscopes say how the unit turned"
    here = {e.id for e in calibration.effects}
    try:
        both = (*calibration.effects, *(e for e in gyro if e.id not in here))
        recording = replace(calibration, effects=both).apply(recording)
    except InputError as problem:
        return str(problem)
    read = tuple(q for q in (FORCE, RATE) if recording.has(q) and not recording.counted(q))
    late = tuple(q for q in read if gimballed or q == FORCE)
    if not late or (not gimballed and RATE not in read):
        return "the sensors count, and a delay shows in SI"
    motion = on_gimbals(recording, moves) if gimballed else by_hand(recording, moves)
    if FORCE in late and _slews_with_moving_force(motion) < MIN_SLEWS:  # as on a table that turns about the vertical
        read = late = tuple(q for q in late if q != FORCE)
        if not late:
            return f"fewer than {MIN_SLEWS} slews move gravity"
    onto = _Onto(motion, read, late, gimballed)
    onto = replace(onto, kept=tuple(np.flatnonzero(onto.usable()).tolist()))
    if len(onto.kept) < MIN_SLEWS:
        return f"fewer than {MIN_SLEWS} slews are fast and long enough"
    base, sigma = _shifted_home(onto, recording)
    if means and gimballed:
        base = replace(base, residual=base.residual + recording.step / 2)
    known = parameters_of_effects(i for i in LATENCIES if CATALOGUE[i].stage in base.seen)
    step = recording.step
    offset = np.abs(np.average(base.residual, axis=0, weights=1 / sigma**2))
    M = _less_common(sigma, np.hypot(SAMPLED * step if gimballed else HAND, MAX_BENDING_SHARE * offset))
    # T is a second of delay, whatever slopes of coarse rows make of it: 1 or -1, or 0
    J = np.einsum("ckl,lcp->kcp", M, np.round(base.jacobian(known)))
    base = replace(base, residual=np.einsum("ckl,lc->kc", M, base.residual))

    labels = [p.label for p in known]

    def columns(_: Effect, wanted: Sequence[Parameter]) -> Array:  # a delay is short compared with a slew
        return J[..., [labels.index(p.label) for p in wanted]]

    def rows(effects: Sequence[Effect]) -> Rows:
        residual = base.residual - J @ values(effects, known)
        return replace(base, effects=tuple(effects), residual=residual, fixed_columns=columns)

    ends = dwell_means(recording).select(np.array([moves[k][1] for k in onto.kept]))
    channels = tuple((q, "force" if q == FORCE else "rate") for q in late)
    names = recording.platform.axis_names
    others = ((i, p.axis) for i, cls in CATALOGUE.items() if i not in LATENCIES for p in parameters(cls, names))
    s = stimulus_from_readings(ends)
    return View(
        SLEWS, channels=channels, **recording_fields(replace(ends, kind=ROTATION)), stimulus=s,
        label=s.position, evaluate=rows, stages=frozenset(base.seen), baseline=(),
        gauge=frozenset(others), groups=np.arange(len(sigma)), noise=NoiseModel(sigma),
    )  # fmt: skip


def _slews_with_moving_force(motion: SlewMotion) -> int:
    """Slews in which the force moves, so that it can come late."""
    force = motion.stimulus.force
    return sum(
        bool(np.ptp(force[s], axis=0).max() > MIN_GRAVITY_SHARE * np.linalg.norm(force[s][0])) for s in motion.spans
    )


def channel_delays(v: View) -> dict[str, tuple[float, float]]:
    """Return the delay of each channel of slews with one sigma [s], whatever the others are."""
    out = {}
    for c, (_, axis) in enumerate(v.channels):
        (p,) = parameters(CATALOGUE["time_tag_latency" if axis == "force" else "gyro_latency"])
        r, J = v.linearised((), (p,))
        y, x = r[:, c] * v.weight[:, c], J[:, c, 0] * v.weight[:, c]
        size = float(x @ y / (x @ x))
        out[axis] = -size, float(np.sqrt(((y - size * x) ** 2).sum() / (len(y) - 1) / (x @ x)))
    return out


def _shifted_home(onto: _Onto, recording: Recording) -> tuple[Rows, Array]:
    """The rows at channels shifted by the mean delay, with that delay in the residual, and their sigma (m, C) [s]."""
    at, shifted = np.zeros(len(onto.late)), recording
    for _ in range(ROUNDS):
        samples = onto.samples(shifted)
        rows, sigma = samples.reduced(onto.delays), onto.scatter(samples.residual)
        w = 1 / sigma**2
        mean = (w * rows.residual).sum(0) / w.sum(0)
        spread = np.sqrt((w * (rows.residual - mean) ** 2).sum(0) / w.sum(0) / (len(w) - 1))
        if np.all(np.abs(mean) < MIN_DELAY_SIGMAS * spread):
            break
        at = at + mean
        shifted = _shifted_recording(recording, dict(zip(onto.late, at, strict=True)))
    return replace(rows, residual=rows.residual + at), _scaled_sigmas(sigma, rows.residual)


def _shifted_recording(recording: Recording, by: dict[str, float]) -> Recording:
    """The recording with quantities as they were `by` [s] earlier than their rows, through cubics."""
    from scipy.interpolate import CubicSpline

    t = recording.time
    if np.any(np.diff(t) <= 0):
        return recording
    then = {q: np.clip(t - d, t[0], t[-1]) for q, d in by.items()}
    moved = {k: CubicSpline(t, x)(then[k[0]]) for k, x in recording.channels.items() if k[0] in by}
    return recording.with_channels(moved)


@dataclass(frozen=True, eq=False)
class _Onto:
    """What turns columns of N samples into delays of slews."""

    motion: SlewMotion
    read: tuple[str, ...]  # quantities that are predicted
    late: tuple[str, ...]  # of these, whose delay is asked for
    gimballed: bool
    kept: tuple[int, ...] = ()

    def samples(self, recording: Recording) -> Rows:
        """Samples: force, rate, and the attitude (rotation in the frame at rest) that an angle of a gimbal adds."""
        m = self.motion
        keys = [(q, a) for q in self.read for a in "xyz"]
        here = recording.select(m.row)
        y = np.concatenate([here.triad(q) for q in self.read], axis=1)
        stages = {*(SENSOR_STAGES if FORCE in self.read else ()), *(GYROSCOPE_STAGES if RATE in self.read else ())}
        stages |= {Stage.ENCODER} if self.gimballed else set()
        platform = recording.platform if self.gimballed else BENCH
        rows = linearise(platform, m.stimulus, (), channels=keys, read=y, stages=stages)
        residual = np.concatenate([rows.residual, 0 * m.rate], axis=1)
        if not self.gimballed:
            residual[:, 3:] = 0.0  # the rates are what carries gravity: what is left is left of the force

        @cache
        def sensitivity(stage: Stage) -> Array:
            S = rows.sensitivity(stage)
            turned = m.axes if stage is Stage.ENCODER else np.zeros((len(S), 3, S.shape[2]))
            return np.concatenate([S, turned], axis=1)

        return replace(rows, residual=residual, sensitivity=sensitivity)

    def delays(self, X: Array) -> Array:
        """Columns (N, 3 q + 3, p) of samples to delays (m, C, p)."""
        spans = self.motion.spans
        out = []
        for i in self.kept:
            responses = [self._along(q, spans[i]) for q in self.late]
            parts = zip(responses, self._misfits(X[spans[i]], spans[i]), strict=True)
            out.append([np.tensordot(p, x, 2) / max(float((p * p).sum()), 1e-300) for (p, _, _), x in parts])
        return np.array(out)

    def _misfits(self, X: Array, span: slice) -> list[Array]:
        """Return what stands against T, (n, 3, p) for each of `late`, of the samples of a slew (n, 3 q + 3, p)."""
        m = self.motion
        out = []
        rate = X[:, 3 * self.read.index(RATE) :][:, :3] if RATE in self.read else 0 * X[:, :3]
        back = np.swapaxes(m.C[span], -1, -2)
        carried = integral(back @ rate, m.stimulus.time[span]) + X[:, -3:]
        for q in self.late:
            if q == RATE:
                out.append(carried)
            elif self.gimballed:
                out.append(X[:, :3])
            else:
                out.append(X[:, :3] + np.cross(m.C[span] @ carried, m.stimulus.force[span][:, :, None], axis=1))
        return out

    def _along(self, quantity: str, span: slice) -> tuple[Array, Array, float]:
        """p (n, 3) of the module docstring, the basis Q (3 n, q), and the share of T that it leaves."""
        m = self.motion
        time, w, f = m.stimulus.time[span], m.rate[span], m.stimulus.force[span]
        path = integral(np.linalg.norm(w, axis=1), time)
        path = path / max(path[-1], 1e-300)
        each = np.broadcast_to(np.eye(3), (len(w), 3, 3))
        if quantity == RATE:
            T = np.einsum("nji,nj->ni", m.C[span], w)
            back = np.swapaxes(m.C[span], -1, -2)
            linear = (back[:, :, :, None] * w[:, None, None, :]).reshape(len(w), 3, 9)  # scale and misalignment
            ramp = (time - time[0])[:, None, None] * each  # the Earth
            Q = [each, ramp, integral(back, time), integral(linear, time)]
        else:
            T = slope(f, time, 0 * m.slew[span])
            tilted = np.cross(m.C[span], f[:, :, None], axis=1)  # by a turn about each axis of the frame at rest
            faster = slope(w, time, 0 * m.slew[span])
            lever = np.stack([np.cross(faster, e) + np.cross(w, np.cross(w, e)) for e in np.eye(3)], axis=-1)
            Q = [each, tilted, path[:, None, None] * tilted, lever]
        columns = np.concatenate(Q, axis=-1).reshape(3 * len(w), -1)
        U = orthonormal_columns(columns, 1e-6)
        t = T.ravel()
        p = t - U @ (U.T @ t)
        return p.reshape(T.shape), U, float(p @ p) / max(float(t @ t), 1e-300)

    def usable(self) -> NDArray[np.bool_]:
        """Return which slews determine a delay: the unit turned, and not only as other causes would have it."""
        along = ([self._along(q, s) for q in self.late] for s in self.motion.spans)
        power = np.array([[np.linalg.norm(p) * (share > MIN_POWER_LEFT) for p, _, share in each] for each in along])
        return np.asarray(np.all(power > MIN_RELATIVE_SIZE * power.max(axis=0), axis=1))

    def scatter(self, residual: Array) -> Array:
        """Sigma (m, C) [s] of each delay, by what is left of its samples, residual (N, ...)."""
        spans, out = self.motion.spans, []
        for i in self.kept:
            parts = self._misfits(residual[spans[i], :, None], spans[i])
            row = []
            for q, x in zip(self.late, parts, strict=True):
                p, U, _ = self._along(q, spans[i])
                remainder = x.ravel() - U @ (U.T @ x.ravel())
                remainder = remainder - p.ravel() * (p.ravel() @ remainder) / (p**2).sum()
                row.append(np.linalg.norm(remainder) / np.sqrt(remainder.size) / np.linalg.norm(p))
            out.append(row)
        sigma = np.array(out)
        return np.maximum(sigma, 0.3 * np.median(sigma, axis=0))  # no slew counts for more than ten others


def _less_common(sigma: Array, common: Array) -> Array:
    """The matrices (C, m, m) of the module docstring for rows of sigma (m, C) [s] and a common part (C,) [s]."""
    a = common[:, None] / sigma.T
    size = np.linalg.norm(a, axis=1)[:, None, None]
    W = np.eye(len(sigma)) - (1 - 1 / np.sqrt(1 + size**2)) * a[:, :, None] * a[:, None, :] / size**2
    return np.asarray(sigma.T[:, :, None] * W / sigma.T[:, None, :])


def _scaled_sigmas(sigma: Array, delay: Array) -> Array:
    """Sigmas (m, C) so that the delays of each channel scatter by them about their mean."""
    w = 1 / sigma**2
    mean = (w * delay).sum(0) / w.sum(0)
    return np.asarray(sigma * np.sqrt((w * (delay - mean) ** 2).sum(0) / (len(delay) - 1)))
