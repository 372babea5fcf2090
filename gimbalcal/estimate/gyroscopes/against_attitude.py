r"""A moving gyroscope triad against an attitude reference: camera, Vicon, a better unit.

Over an interval the gyroscopes make the rotation P, the reference from its attitude C at both ends Q; its stamps are
late by tau, and its body frame is turned to the gyroscopes' by M,

.. math:: P(\theta) = (1 - [\epsilon \times]) \, M Q(\tau) M^T , \qquad Q(\tau) = C(t_1 + \tau) \, C(t_0 + \tau)^T .

theta are bias, scale factors and non-orthogonality, physics to reading; the mounting takes every rotation of the whole
triad. The reference's noise is white, so neighbouring intervals share an error: in axes of the reference, where it
does not turn, the covariance of epsilon is the tridiagonal 2, -1, and the rows are whitened by its Cholesky factor.
To first order epsilon changes by (A - 1) mu with the mounting, A = M Q M^T, and by (A w_0 - w_1) tau with the lag.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration, Readout, Residual, StageResult
from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.gyroscopes.reference import Reference, reference_of
from gimbalcal.estimate.gyroscopes.revolutions import triangle
from gimbalcal.forward import Rows, gyroscopes, linearise
from gimbalcal.inference.levenberg import minimise
from gimbalcal.inversion import invert
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording
from gimbalcal.recording.dwell import PAUSED
from gimbalcal.recording.record import RATE
from gimbalcal.rotation import exponential, left_jacobian, mean_rates, small_rotation_vector
from gimbalcal.units import from_si

INTERVAL_S = 0.5  # s; long enough that the reference's noise is little of a turn, short enough for a wrist's motion
MAX_INTERVALS = 1200  # intervals; of a longer log they are longer
MIN_INTERVALS = 20
MAX_TIMES_NAMED = 3  # times that are named
MIRROR_RATIO = 2.0  # times that a mirrored triad must fit better than a turned one to be called mirrored
MAX_SIGMA = 0.05  # one sigma of a scale factor, an angle [rad] or the lag [s]: beyond, the motion shows too little


@dataclass(frozen=True, eq=False)
class _Intervals:
    """Readings (m, n, 3) [rad/s] and steps (m, n) [s] of intervals, their ends (m, 2) [s], and the rate there."""

    reading: Array
    step: Array
    ends: Array
    edge: Array  # (m, 2, 3) rate that is read at both ends
    time: Array  # (m, n)


def gyroscopes_against_attitude(recording: Recording) -> Calibration:
    """Calibrate gyroscopes against the attitude that was logged beside them, with its lag and how it is mounted.

    Raises InputError without rates in a unit with a scale, without an attitude, for a triad that is mirrored to the
    reference, and for motion that does not tell the unknowns apart.
    """
    if recording.counted(RATE):
        raise InputError(f"{recording.title!r} reads rates in counts; give a nominal scale, in rad/s or deg/s")
    y, time = recording.triad(RATE), recording.time
    known = reference_of(recording)
    lag = _first_lag(time, y, known)
    M = _first_mounting(recording, time, y, known, lag)
    cut = _intervals(time, y, known, lag)
    if len(cut.ends) < MIN_INTERVALS:
        raise InputError(
            f"{recording.title!r} holds {amount(len(cut.ends), 'interval')} of {INTERVAL_S:g} s in which rates and "
            f"attitude were logged; at least {MIN_INTERVALS} are needed"
        )
    wanted = triangle_of_first_order()
    scale = np.array([*(p.sigma for p in wanted), 0.1, 0.1, 0.1, 0.1])
    x = np.zeros(len(scale))
    for _ in range(3):  # the mounting is small about the last one

        def model(x: Array, _: Array, M: Array = M, lag: float = lag) -> tuple[Array, Array]:
            r, J = _rows(recording, cut, known, wanted, x[0] * scale, M, lag)
            return r[None], (J * scale)[None]

        found = minimise(model, np.concatenate([x[:-4], np.zeros(4)])[None] / scale, gain=1e-9)
        x = found.x[0] * scale
        M, lag = exponential(x[-4:-1]) @ M, lag + float(x[-1])
        if np.linalg.norm(x[-4:-1]) < 1e-3:
            break
    made = _calibration(recording, wanted, x, found.jacobian[0], float(2 * found.cost[0]), scale, M, lag, len(cut.ends))
    return replace(made, provenance={**made.provenance, "limits": _left_out(known)})


def _left_out(known: Reference) -> list[str]:
    """Name the attitudes that took no part, in a list; empty where all did."""
    if not known.gone:
        return []
    at = ", ".join(f"{t:.10g}" for t in known.gone[:MAX_TIMES_NAMED])
    which = (
        f"at {at} s"
        if len(known.gone) <= MAX_TIMES_NAMED
        else f"at {at} s and {len(known.gone) - MAX_TIMES_NAMED} more times"
    )
    return [f"the attitude {which} leaps away for a row or two and back: left out"]


def triangle_of_first_order() -> tuple[Parameter, ...]:
    """Bias, scale factors, and the three misalignments that a rotation of the triad leaves."""
    return tuple(p for p in triangle() if p.effect != "gyro_scale_nonlinearity")


def _rows(
    recording: Recording,
    cut: _Intervals,
    known: Reference,
    wanted: tuple[Parameter, ...],
    x: Array,
    M: Array,
    lag: float,
) -> tuple[Array, Array]:
    """Whitened epsilon (3 m,) and its derivative (3 m, p + 4) by the effects, the mounting and the lag."""
    effects = with_values((), wanted, x[: len(wanted)])
    P, turned = _swept(recording, cut, effects)
    M, lag = exponential(x[-4:-1]) @ M, lag + float(x[-1])
    C0, C1 = (known.at(cut.ends[:, i] + lag) for i in (0, 1))
    A = M @ (C1 @ np.swapaxes(C0, -1, -2)) @ M.T
    epsilon = small_rotation_vector(P @ np.swapaxes(A, -1, -2))
    w0, w1 = (cut.edge[:, i] - x[:3] for i in (0, 1))  # less the bias; scale errors are second order here
    J = np.concatenate([turned.jacobian(wanted), A - np.eye(3), (apply_matrix(A, w0) - w1)[..., None]], axis=-1)
    to_world = np.swapaxes(M @ C1, -1, -2)
    follows = np.abs(cut.ends[1:, 0] - cut.ends[:-1, 1]) < 1e-9
    L = _whitener(follows)
    m = len(epsilon)
    rows = np.concatenate([apply_matrix(to_world, epsilon)[..., None], to_world @ J], axis=-1)
    white = np.linalg.solve(L, rows.reshape(m, -1)).reshape(3 * m, -1)
    return white[:, 0], white[:, 1:]


def _whitener(follows: Array) -> Array:
    """Cholesky factor (m, m) of the covariance of differences of white noise, whose neighbours share an end."""
    m = len(follows) + 1
    V = 2.0 * np.eye(m)
    at = np.flatnonzero(follows)
    V[at, at + 1] = V[at + 1, at] = -1.0
    return np.linalg.cholesky(V)


def _swept(recording: Recording, cut: _Intervals, effects: tuple[Effect, ...]) -> tuple[Array, Rows]:
    """Rotation P (m, 3, 3) of each interval, and how its rotation vector answers what effects add to the readings."""
    m, n = cut.step.shape
    flat = cut.reading.reshape(-1, 3)
    still = replace(recording.select(slice(0, 1)), platform=BENCH, position=None)
    s = stimulus_from_truth(still, np.zeros((1, 3)), flat[:1]).held(m * n)
    s = s.at(rate=flat, time=cut.time.ravel() - recording.time[0])
    w, D, _ = invert(lambda rate: gyroscopes(rate, s, effects), flat)
    phi = w.reshape(m, n, 3) * cut.step[..., None]
    C = exponential(phi)
    tail, P = np.empty_like(C), np.broadcast_to(np.eye(3), (m, 3, 3))
    for k in range(n - 1, -1, -1):
        tail[:, k] = P
        P = P @ C[:, k]
    moved = -(tail @ left_jacobian(phi) @ np.linalg.inv(D).reshape(m, n, 3, 3)) * cut.step[..., None, None]
    read = linearise(BENCH, s.at(rate=w), effects, channels=[(RATE, a) for a in "xyz"], stages=GYROSCOPE_STAGES)
    answer = {
        k: np.moveaxis(moved @ R.reshape(m, n, 3, 3), 1, 2).reshape(m, 3, 3 * n) for k, R in read.sensitivity.items()
    }
    channels = tuple((RATE, a) for a in "xyz")
    return P, Rows(BENCH, read.kind, read.stimulus, read.effects, channels, np.zeros((m, 3)), read.seen, answer)


def _first_lag(time: Array, y: Array, known: Reference) -> float:
    """Lag [s] at which the sizes of both rates go together best; the size does not ask how they are mounted."""
    step = max(float(np.median(np.diff(time))), 0.002)
    begin, end = max(time[0], known.time[0]), min(time[-1], known.time[-1])
    if end - begin < 10 * INTERVAL_S:
        raise InputError(
            f"rates and attitude have {max(end - begin, 0.0):.3g} s in common; log both over a minute or more"
        )
    grid = np.arange(begin, end, step)
    mine = np.interp(grid, time, np.linalg.norm(y, axis=1))
    theirs = np.interp(grid, *known.rate_size())
    most = min(round(2.0 / step), len(grid) // 4)
    a, b = mine - mine.mean(), theirs - theirs.mean()
    inner = a[most : len(a) - most]
    match = [
        float(inner @ b[most + k : len(b) - most + k]) / (np.linalg.norm(b[most + k : len(b) - most + k]) + 1e-300)
        for k in range(-most, most + 1)
    ]
    return (int(np.argmax(match)) - most) * step


def _first_mounting(recording: Recording, time: Array, y: Array, known: Reference, lag: float) -> Array:
    """M (3, 3) from the rates of both (Wahba's problem); InputError for a triad that only a mirror would fit."""
    at, w = known.rates()
    inside = (at - lag > time[0]) & (at - lag < time[-1])
    mine = np.stack([np.interp(at[inside] - lag, time, y[:, i]) for i in range(3)], axis=1)
    a, b = mine - mine.mean(0), w[inside] - w[inside].mean(0)
    U, _, Vt = np.linalg.svd(a.T @ b)
    handed = float(np.sign(np.linalg.det(U @ Vt)))
    proper, mirrored = (U @ np.diag([1.0, 1.0, d]) @ Vt for d in (handed, -handed))
    if handed < 0:
        left = [float(np.linalg.norm(a - b @ R.T)) for R in (proper, mirrored)]
        if left[0] > MIRROR_RATIO * left[1]:
            raise InputError(
                f"the rates of {recording.title!r} are a mirror image of the attitude's: one axis counts backwards, "
                "or two are interchanged; correct axis or sign in [columns]"
            )
    return proper


def _intervals(time: Array, y: Array, known: Reference, lag: float) -> _Intervals:
    """Intervals that begin and end at samples of the gyroscopes, with the reference on both ends and no pause in it."""
    dt = np.diff(time)
    step = float(np.median(dt))
    length = max(INTERVAL_S, 2 * known.step, (time[-1] - time[0]) / MAX_INTERVALS)
    n = max(2, round(length / step))
    spans = [slice(k, k + n + 1) for k in range(0, len(time) - n, n)]
    good = [
        s for s in spans
        if dt[s.start : s.stop - 1].max() <= PAUSED * step and known.covers(time[s.start] + lag, time[s.stop - 1] + lag)
    ]  # fmt: skip
    reading, steps, when = np.zeros((len(good), n, 3)), np.zeros((len(good), n)), np.zeros((len(good), n))
    for i, s in enumerate(good):
        mean, bend, coning = mean_rates(time[s], y[s])
        reading[i], steps[i], when[i] = mean + bend + coning, np.diff(time[s]), time[s][1:]
    ends = np.array([[time[s.start], time[s.stop - 1]] for s in good]).reshape(-1, 2)
    edge = np.array([[y[s.start], y[s.stop - 1]] for s in good]).reshape(-1, 2, 3)
    return _Intervals(reading, steps, ends, edge, when)


def _calibration(
    recording: Recording, wanted: tuple[Parameter, ...], x: Array, J: Array, square: float, scale: Array,
    M: Array, lag: float, m: int,
) -> Calibration:  # fmt: skip
    from gimbalcal import __version__

    dof = max(3 * m - len(x), 1)
    R = np.asarray(np.linalg.qr(J, mode="r"))
    dark = bool(np.abs(np.diag(R)).min() <= 1e-12 * np.abs(np.diag(R)).max())
    inverse = np.full(R.shape, np.inf) if dark else np.linalg.inv(R) @ np.linalg.inv(R).T
    covariance = square / dof * inverse * np.outer(scale, scale)
    sigma, n = np.sqrt(np.diag(covariance)), len(wanted)
    if not np.all(sigma[3:] < MAX_SIGMA):  # of all but the bias
        raise InputError(
            f"the motion of {recording.title!r} does not tell scale, mounting and lag apart: turn it about all three "
            "axes, to and fro"
        )
    noise = float(np.sqrt(square / dof))
    reference = {
        "lag_ms": float(from_si(lag, "ms")), "lag_sigma_ms": float(from_si(sigma[-1], "ms")),
        "mounting": M.tolist(), "mounting_sigma_arcmin": [float(from_si(s, "arcmin")) for s in sigma[-4:-1]],
        "noise_arcmin": float(from_si(noise, "arcmin")), "intervals": m,
    }  # fmt: skip
    angle = float(np.degrees(np.arccos(np.clip((np.trace(M) - 1) / 2, -1, 1))))
    words = (
        f"{m} intervals; the attitude is late by {from_si(lag, 'ms'):.3g} +- {from_si(sigma[-1], 'ms'):.2g} ms and its "
        f"frame turned by {angle:.3g} deg; each attitude scatters by {from_si(noise, 'arcmin'):.2g} arcmin"
    )
    return Calibration(
        "attitude", with_values((), wanted, x[:n]), wanted, covariance[:n, :n], (),
        Residual(float(dof), dof, {"attitude": noise}),
        provenance={"recordings": recording.files, "version": __version__,
                    "options": {"direction": "physics to reading", "reference": reference, "in_words": words,
                                "frame": "x along the first input axis, y in the plane of the first two"}},
        stages=(StageResult("against the attitude", tuple(p.label for p in wanted), x[:n], sigma[:n], noise, words),),
        readout=Readout(gimbals=recording.platform.axis_names),
    )  # fmt: skip
