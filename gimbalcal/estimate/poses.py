r"""Gyroscopes from turns between rest poses, with the direction of gravity as the only reference.

A unit in the hand, no table: the calibrated accelerometers say where down is before and after each turn, the
gyroscopes what happened between,

.. math:: \hat f_{i+1} = \prod_k \exp(-[\omega_k \Delta t \times]) \, \hat f_i, \qquad y = h(\omega)

(Tedaldi et al. 2014). Direction: physics to reading; the rates are solved from the readings for any effects of the
gyroscope stage, and derivatives are exact. The frame is that of the accelerometers, so the six misalignments hold the
rotation between the triads too. The Earth's rate is left out: 15 deg/h, below what a hand-turned unit can see.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration, Residual, Stage
from gimbalcal.correction import correct
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, parameters, with_values
from gimbalcal.errors import InputError
from gimbalcal.estimate.inter_triad import euler
from gimbalcal.forward import gyroscopes
from gimbalcal.kinematics import stimulus
from gimbalcal.number import STEP, Array
from gimbalcal.recording import Recording, dwells
from gimbalcal.units import from_si, is_raw

RATE, FORCE = "angular_rate", "specific_force"
LINEAR = ("gyro_scale_factor", "gyro_misalignment")
TERMS = (*LINEAR, "gyro_scale_nonlinearity")


@dataclass(frozen=True, eq=False)
class Turned:
    """Turns between rests: readings (m, n, 3) [rad/s] at rest level zero, steps (m, n) [s] (0 beyond the end),

    unit force before and after (m, 3), and what the hardware felt at those rows.
    """

    reading: Array
    step: Array
    before: Array
    after: Array
    stimulus: Stimulus


def gyroscopes_between_rests(
    recording: Recording, accelerometers: Calibration, terms: Sequence[str] = ()
) -> Calibration:
    """Calibrate gyroscopes against accelerometers from a recording of rests with turns between them.

    terms: gyroscope effects beside the bias (default scale factor, misalignment, scale nonlinearity); those that the
    turns do not support are declined with a sentence. Raises InputError where there are too few turns or no rates.
    """
    wanted = tuple(dict.fromkeys(terms)) or TERMS
    bad = [t for t in wanted if t not in CATALOGUE or CATALOGUE[t].stage.name != "GYROSCOPE" or t == "gyro_bias"]
    if bad:
        raise InputError(f"--terms names {bad[0]!r}, which is not a gyroscope effect that turns between rests can show")
    turned, bias, scale = turns(recording, accelerometers)
    base = tuple(t for t in wanted if t in LINEAR) or wanted[:1]
    best = fit_turns(turned, base)
    fits, declined = [(base, best)], []
    for term in (t for t in wanted if t not in base):
        candidate = fit_turns(turned, (*fits[-1][0], term))
        why = _refusal(term, best, candidate)
        if why:
            declined.append((term, why))
        else:
            best = candidate
            fits.append(((*fits[-1][0], term), best))
    return _calibration(recording, fits, declined, bias, scale)


def turns(
    recording: Recording, accelerometers: Calibration, at_rest: Sequence[Effect] = ()
) -> tuple[Turned, Array, float]:
    """Turns with readings less the rests' level, the level of all rests (k, 3) [rad/s], and rad/s per unit.

    The level of a turn is the mean of the rests before and after it; or, with `at_rest`, what these effects make a
    unit read that does not turn and feels the measured force.
    """
    stays = dwells(recording)
    if len(stays) < 6:
        raise InputError(f"{recording.title!r} holds {len(stays)} rests; turns between at least six are needed")
    there = correct(accelerometers, recording)
    y, f = recording.triad(RATE), there.triad(FORCE)
    level = np.array([y[d.rows].mean(0) for d in stays])
    down = np.array([f[d.rows].mean(0) for d in stays])
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    spans = [slice(a.stop - 1, b.start + 1) for a, b in pairwise(stays)]
    longest = max(s.stop - s.start for s in spans) - 1
    reading, step = np.zeros((len(spans), longest, 3)), np.zeros((len(spans), longest))
    force = np.zeros((len(spans), longest, 3))
    for i, span in enumerate(spans):
        rows = y[span] - (level[i] + level[i + 1]) / 2  # the bias of that minute: slow drift is not the turn's
        dt = np.diff(recording.time[span])
        reading[i, : len(dt)], step[i, : len(dt)] = (rows[1:] + rows[:-1]) / 2, dt
        force[i, : len(dt)] = f[span][1:]
    flat = reading.reshape(-1, 3)
    s = _stimulus_of(recording, flat, force.reshape(-1, 3))
    made = Turned(reading, step, down[:-1], down[1:], s)
    raw = any(is_raw(recording.units.get((RATE, a), "rad/s")) for a in "xyz")
    scale = _rough_scale(made) if raw else 1.0
    if at_rest:
        made = replace(made, reading=made.reading + _relevelled(made, level, scale, at_rest))
    return replace(made, reading=scale * made.reading), scale * level, scale


def _relevelled(turned: Turned, level: Array, scale: float, at_rest: Sequence[Effect]) -> Array:
    """What to add to the readings (m, n, 3) so that effects tell their level, not the neighbouring rests."""
    felt = gyroscopes(0 * turned.stimulus.rate, turned.stimulus, at_rest).reshape(turned.reading.shape)
    neighbours = (level[:-1] + level[1:]) / 2
    return np.where(turned.step[..., None] > 0, neighbours[:, None] - felt / scale, 0.0)


def _stimulus_of(recording: Recording, rate: Array, force: Array) -> Stimulus:
    """A stimulus of the turns' rows, without history: gyroscope effects use rate, force and temperature."""
    s = stimulus(recording.select(slice(0, 1)))
    n = len(rate)
    arrays = {k: v for k, v in vars(s).items() if isinstance(v, np.ndarray) and v.ndim}
    wide = {k: np.broadcast_to(v, (n, *v.shape[1:])) for k, v in arrays.items()}
    return s.at(**wide, covariates={}).at(rate=rate, force=force)


def _rough_scale(turned: Turned) -> float:
    """Common rad/s per count at which the turns fit gravity best: a scan, as nothing else says how long a turn was."""
    largest = np.median((np.linalg.norm(turned.reading, axis=-1) * turned.step).sum(1))
    guesses = np.geomspace(0.2, 20, 60) / largest  # a median turn between 0.2 and 20 rad, 8 % apart
    misfit = [np.mean(_end(g * turned.reading, turned)[0] ** 2) for g in guesses]
    return float(guesses[int(np.argmin(misfit))])


def _exponential(phi: Array) -> Array:
    """exp(-[phi x]) (..., 3, 3): frame rotations by phi (..., 3) [rad]."""
    a2 = (phi**2).sum(-1)[..., None, None]
    a = np.sqrt(a2)
    small = a2 < 1e-12  # beyond, series and closed form agree to rounding
    safe = np.where(small, 1.0, a)
    X = _cross(phi)
    s = np.where(small, 1 - a2 / 6, np.sin(safe) / safe)
    c = np.where(small, 0.5 - a2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) - s * X + c * (X @ X))


def _left(phi: Array) -> Array:
    """Derivative of the rotation vector at the end by phi (..., 3, 3): left Jacobian of SO(3) at -phi."""
    a2 = (phi**2).sum(-1)[..., None, None]
    a = np.sqrt(a2)
    small = a2 < 1e-8  # (1 - cos a)/a^2 loses 1e-8 here, the series 1e-9
    safe = np.where(small, 1.0, a)
    X = _cross(phi)
    c = np.where(small, 0.5 - a2 / 24, (1 - np.cos(safe)) / safe**2)
    d = np.where(small, 1 / 6 - a2 / 120, (safe - np.sin(safe)) / safe**3)
    return np.asarray(np.eye(3) - c * X + d * (X @ X))


def _cross(v: Array) -> Array:
    x, y, z = np.moveaxis(v, -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack(r, -1) for r in ((o, -z, y), (z, o, -x), (-y, x, o))], axis=-2)


def _end(rate: Array, turned: Turned) -> tuple[Array, Array, Array]:
    """Misfit (m, 3) of gravity after each turn, gravity predicted (m, 3), and products (m, n, 3, 3) to the end."""
    phi = rate * turned.step[..., None]
    C = _exponential(phi)
    tail = np.empty_like(C)
    P = np.broadcast_to(np.eye(3), (len(C), 3, 3))
    for k in range(C.shape[1] - 1, -1, -1):
        tail[:, k] = P
        P = P @ C[:, k]
    predicted = (P @ turned.before[..., None])[..., 0]
    return turned.after - predicted, predicted, tail


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A fit of turns: parameters, estimate, covariance scaled to the scatter, misfits (m, 3), and what to judge by."""

    parameters: tuple[Parameter, ...]
    x: Array
    covariance: Array
    misfit: Array
    dof: int
    condition: float
    left_out: float

    @property
    def rms(self) -> float:
        """Misfit of gravity's direction [rad], per component across gravity."""
        return float(np.sqrt((self.misfit**2).sum() / (2 * len(self.misfit))))


def fit_turns(turned: Turned, terms: Sequence[str]) -> PoseFit:
    wanted = tuple(p for t in terms for p in parameters(CATALOGUE[t]))
    m = len(turned.before)
    if 2 * m < len(wanted):
        raise InputError(f"{m} turns say {2 * m} things and {len(wanted)} parameters are asked for: turn more often")
    scale = np.array([p.sigma for p in wanted])
    x = np.zeros(len(wanted))
    r, J = _linear(turned, wanted, x)
    damping = 1e-3
    for _ in range(60):
        A = J * scale
        size = np.sqrt((A**2).sum(0))
        rows = np.concatenate([A / size, np.sqrt(damping) * np.eye(len(x))])
        step = np.linalg.lstsq(rows, np.concatenate([r, 0 * x]), rcond=None)[0] / size * scale
        r1, J1 = _linear(turned, wanted, x + step)
        if (r1**2).sum() <= (r**2).sum():
            gain = (r**2).sum() - (r1**2).sum()
            x, r, J, damping = x + step, r1, J1, damping / 10
            if gain <= 1e-14 * (r**2).sum():
                break
        else:
            damping *= 10
            if damping > 1e10:
                break
    return _judged(wanted, x, r, J, m)


def _judged(wanted: tuple[Parameter, ...], x: Array, r: Array, J: Array, m: int) -> PoseFit:
    size = np.sqrt((J**2).sum(0))
    Q, R = np.linalg.qr(J / np.where(size > 0, size, 1.0))
    dof = 2 * m - len(x)
    variance = (r**2).sum() / max(dof, 1)
    inverse = np.linalg.inv(R) / size[:, None]
    left = np.concatenate([
        np.linalg.lstsq(np.eye(3) - q @ q.T, e, rcond=1e-9)[0]
        for q, e in zip(Q.reshape(m, 3, -1), r.reshape(m, 3), strict=True)
    ])  # fmt: skip
    return PoseFit(
        wanted, x, variance * inverse @ inverse.T, r.reshape(m, 3), dof, float(np.linalg.cond(R)),
        float(np.sqrt((left**2).sum() / (2 * m))),
    )  # fmt: skip


def _linear(turned: Turned, wanted: Sequence[Parameter], x: Array) -> tuple[Array, Array]:
    """Misfit (3 m,) and derivative (3 m, p) of the prediction."""
    rate, slope = _rates(turned, wanted, x)
    misfit, predicted, tail = _end(rate, turned)
    moved = tail @ _left(rate * turned.step[..., None])
    turn = np.einsum("mkij,mkjp,mk->mip", moved, slope, turned.step, optimize=True)
    return misfit.ravel(), (_cross(predicted) @ turn).reshape(misfit.size, -1)


def _rates(turned: Turned, wanted: Sequence[Parameter], x: Array) -> tuple[Array, Array]:
    """Rates (m, n, 3) that give the readings, and their derivatives (m, n, 3, p): Newton and implicit function."""
    y, s = turned.reading.reshape(-1, 3), turned.stimulus
    effects: tuple[Effect, ...] = with_values((), wanted, x)
    w = y.copy()
    for _ in range(20):
        D = np.stack([gyroscopes(w + 1j * STEP * u, s, effects).imag / STEP for u in np.eye(3)], axis=-1)
        step = np.linalg.solve(D, (y - gyroscopes(w, s, effects))[..., None])[..., 0]
        w = w + step
        if np.max(np.abs(step)) < 1e-13:  # rad/s; a turn of 10 s then closes to 1e-12 rad
            break
    by = [gyroscopes(w, s, with_values((), wanted, x + 1j * STEP * u)).imag / STEP for u in np.eye(len(x))]
    slope = -np.linalg.solve(D, np.stack(by, axis=-1))
    return w.reshape(turned.reading.shape), slope.reshape(*turned.reading.shape, len(x))


def _refusal(term: str, without: PoseFit, candidate: PoseFit) -> str:
    mine = [i for i, p in enumerate(candidate.parameters) if p.effect == term]
    sigma = np.sqrt(np.diag(candidate.covariance))[mine]
    ratio = float(np.max(np.abs(candidate.x[mine]) / sigma))
    if candidate.left_out <= without.left_out:
        return ""
    return (
        f"{term} declined: turns left out are predicted worse with it ({without.left_out:.2g} -> "
        f"{candidate.left_out:.2g} rad), no coefficient exceeds {ratio:.1f} sigma "
        f"(condition number {without.condition:.0f} -> {candidate.condition:.0f})"
    )


def _calibration(
    recording: Recording, fits: Sequence[tuple[tuple[str, ...], PoseFit]], declined: Sequence[tuple[str, str]],
    level: Array, scale: float,
) -> Calibration:  # fmt: skip
    from gimbalcal import __version__

    best = fits[-1][1]
    bias = parameters(CATALOGUE["gyro_bias"])
    wanted = (*bias, *best.parameters)
    x = np.concatenate([level.mean(0), best.x])
    covariance = np.zeros((len(x), len(x)))
    covariance[:3, :3] = np.diag(level.var(0, ddof=1) / len(level))
    covariance[3:, 3:] = best.covariance
    options: dict[str, Any] = {
        "direction": "physics to reading", "condition": best.condition, "leave_one_out_rms": best.left_out,
        "declined": dict(declined), "frame": "accelerometers",
        "inter_triad_arcsec": [float(from_si(a, "arcsec")) for a in _inter_triad(best)],
    }  # fmt: skip
    if scale != 1.0:
        options["gyro_nominal"] = {"scale": scale}
    stages = tuple(
        Stage(" + ".join(terms), tuple(p.label for p in f.parameters), f.x, np.sqrt(np.diag(f.covariance)), f.rms,
              f"gravity after {len(f.misfit)} turns; condition number {f.condition:.0f}, {f.left_out:.2g} rad left out")
        for terms, f in fits
    )  # fmt: skip
    return Calibration(
        "poses", with_values((), wanted, x), wanted, covariance,
        tuple({"direction": {p.label: 1.0 for p in parameters(CATALOGUE[t])}, "why": why} for t, why in declined),
        Residual(float(best.dof), best.dof, {"gravity_direction": best.rms}),
        provenance={"recordings": [{"path": s.path, "sha256": s.sha256} for s in recording.source],
                    "version": __version__, "options": options},
        stages=stages,
    )  # fmt: skip


def _inter_triad(fit: PoseFit) -> Array:
    """alpha, beta, gamma [rad] of C_p^q, Eq. (43): the rotation that is left when Eq. (8) has taken the triangle."""
    by = {(p.effect, p.axis): v for p, v in zip(fit.parameters, fit.x, strict=True)}
    M = np.eye(3)
    for i, a in enumerate("xyz"):
        for j, b in enumerate("xyz"):
            M[i, j] += by.get(("gyro_scale_factor", a), 0.0) if a == b else by.get(("gyro_misalignment", a + b), 0.0)
    # omega^p = M^-1 y = C_q^p (C_g^q K) y: orthogonal times lower triangular, by QR of the matrix read backwards
    Q, R = np.linalg.qr(np.linalg.inv(M)[:, ::-1])
    C_pq = (Q * np.sign(np.diag(R)))[:, ::-1]
    return euler(C_pq.T)
