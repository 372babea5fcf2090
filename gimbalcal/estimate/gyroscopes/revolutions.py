r"""A recording of revolutions both ways and of rests, to the gyroscopes' calibration: Wang et al. (2019), section 4.2.

A turn between two rests is a revolution when its angle is a whole number of circles within `MAX_REVOLUTION_ERROR`; two
neighbours about one axis in opposite senses are a pair. Everything else that moved is left out. The fit is that of
`estimate.pulses.whole_turns.gyroscope_pulses`, pulses to rate; the calibration is returned as effects, physics to
reading,

.. math:: M = (C K_1)^{-1}, \quad s_i = 1 / M_{ii} - 1, \quad b = -\varepsilon / K_1, \quad K = -K_2 / K_1

the last to first order in K2, and with the angles of Eq. (5) of Wu et al. (2018) below the diagonal of M.

The rotation between the accelerometers' frame p and the gyroscopes' frame q is that of Eq. (43). After Zhang et al.
(2010), the paper's reference [9]: turn the unit from rest to rest; the gyroscopes say by which rotation R^q, the
accelerometers where gravity was before and after, and both must be one turn of one body,

.. math:: C_p^q f_2^p = R^q \, C_p^q f_1^p .

A whole revolution brings gravity back and says nothing here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import DIRECTION, Calibration, Options, Provenance, Readout, Residual
from gimbalcal.effects import CATALOGUE, Parameter, parameters, parameters_of_effects, with_values
from gimbalcal.effects.effect import MISALIGNMENT_AXES
from gimbalcal.effects.gyroscope import of_rate_matrix, rate_matrix
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.gyroscopes.residual_checks import MAX_RATE_SCATTER_RATIO
from gimbalcal.estimate.pulses.gravity_norm import PulseFit, Pulses, unit_lower_triangular
from gimbalcal.estimate.pulses.whole_turns import FREE_ORDINALS, Revolutions, gyroscope_pulses
from gimbalcal.inference.algebra import block_diagonal
from gimbalcal.inference.information import Unobservable
from gimbalcal.inference.levenberg import minimise
from gimbalcal.number import Array, apply_matrix, arcsin, arctan2, complex_step
from gimbalcal.recording import Recording, dwells
from gimbalcal.recording.dwell import moves_between_dwells
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import exponential, frame_rotation, mean_rates
from gimbalcal.units import from_si

MAX_REVOLUTION_ERROR = 0.05  # of a revolution: scale errors of low-cost units reach 3 %
ITERATIONS = 3  # the bias enters the Earth's share of the ramps, a few percent of it: each round takes that factor off
MAX_PAIR_COSINE = -0.99  # cosine between the axes of a pair
EFFECTS = ("gyro_bias", "gyro_scale_factor", "gyro_misalignment", "gyro_scale_nonlinearity")
LOWER_TRIANGLE = ("yz", "zx", "zy")  # angles of Eq. (5) of Wu et al. (2018) that a lower triangle holds


def gyroscopes_from_revolutions(recording: Recording) -> Calibration:
    """Bias, scale factor, misalignment (triangle) and second order of three gyroscopes from one recording.

    Raises InputError for readings in counts, fewer than six pairs of revolutions, or no rests.
    """
    bias = np.zeros(3)
    for _ in range(ITERATIONS):
        revolutions, used = revolutions_of(recording, bias)
        fit = gyroscope_pulses(revolutions)
        bias = fit.pulses.bias[0]
    calibration = _calibration(revolutions, fit, used, recording.sigma("gyroscope") is not None)
    origin = replace(calibration.provenance, recordings=recording.source)
    return replace(calibration, provenance=origin, readout=Readout(gimbals=recording.platform.axis_names))


def revolutions_of(recording: Recording, bias: Array | None = None) -> tuple[Revolutions, int]:
    """The pairs of revolutions and the rests of a recording, readings in rad/s as pulses/s, and how many pairs.

    bias (3,) [rad/s]: what turns the readings at rest into the Earth's rate, to take out what the ramps leave of it.
    """
    if recording.counted(RATE):
        raise InputError(f"{recording.title!r} reads rates in counts; give a nominal scale, in rad/s or deg/s")
    visits = dwells(recording)
    y = recording.triad(RATE)
    earth = [y[d.rows].mean(0) + (0.0 if bias is None else bias) for d in visits]
    between = zip(moves_between_dwells(recording), earth, strict=False)
    moved = [_integrals(recording.time[m.rows], y[m.rows], e, m.paused) for m, e in between]
    pairs = _opposite_pairs(moved)
    if len(pairs) < 6:
        raise InputError(
            f"{recording.title!r} holds {number_of(len(pairs), 'pair')} of whole revolutions, one each way "
            "about one axis between rests; at least six pairs about different axes are needed "
            "(nine: gimbalcal.schedule.published.REVOLUTION_AXES)"
        )
    rest = np.array([y[d.rows].mean(0) for d in visits])
    sigma = recording.sigma("gyroscope") or 1e-6
    step = recording.step
    first = [moved[i] for i, _ in pairs]
    duration = float(np.mean([t for _, t, _ in first]))
    angle = float(np.mean([a for _, _, a in first]))
    shortest = min(d.stop - d.start for d in visits)
    scaled = [
        np.stack([_scaled_revolution(moved[k], angle, duration) for k in side]) for side in zip(*pairs, strict=True)
    ]
    noise = sigma * np.sqrt(duration * step), sigma / np.sqrt(shortest)
    return Revolutions(scaled[0][None], scaled[1][None], rest[None], duration, angle, *noise), len(pairs)


Moved = tuple[Array, float, float]
"""Integrals of N and N^2 (2, 3), time [s], angle [rad]: whole revolutions, or nan."""


def _integrals(time: Array, rows: Array, earth: Array, interrupted: bool) -> Moved:
    """Trapezoids over a move, and the whole number of revolutions that it is, if it is one.

    The Earth's rate across the axis would average out at constant speed; what it leaves while the speed comes and goes
    is integrated along the measured phase, from `earth` (3,) [rad/s] before the move, and taken off.
    """
    dt = np.diff(time)
    both = np.stack([rows, rows**2], axis=1)
    S = ((both[1:] + both[:-1]) / 2 * dt[:, None, None]).sum(0)
    angle = float(np.linalg.norm(S[0]))
    whole = round(angle / (2 * np.pi))
    if whole < 1 or interrupted or abs(angle / (2 * np.pi) - whole) >= MAX_REVOLUTION_ERROR * whole:
        return S, float(dt.sum()), float("nan")
    u = S[0] / angle
    along = rows @ u
    phase = np.concatenate([[0.0], np.cumsum((along[1:] + along[:-1]) / 2 * dt)]) * (2 * np.pi * whole / angle)
    across = earth - u * (u @ earth)
    projected = np.cos(phase)[:, None] * across - np.sin(phase)[:, None] * np.cross(u, across)
    S[0] -= ((projected[1:] + projected[:-1]) / 2 * dt[:, None]).sum(0)
    return S, float(dt.sum()), 2 * np.pi * whole


def _opposite_pairs(moved: Sequence[Moved]) -> list[tuple[int, int]]:
    """Neighbouring revolutions about one axis in opposite senses, each used once."""
    out, k = [], 0
    while k + 1 < len(moved):
        (a, _, first), (b, _, second) = moved[k], moved[k + 1]
        cosine = a[0] @ b[0] / max(float(np.linalg.norm(a[0]) * np.linalg.norm(b[0])), 1e-300)
        if first == second and cosine < MAX_PAIR_COSINE:
            out.append((k, k + 1))
            k += 2
        else:
            k += 1
    return out


def _scaled_revolution(one: Moved, angle: float, duration: float) -> Array:
    """A revolution brought to the common angle and duration: shares of its own, which leaves the equations true."""
    S, t, own = one
    if abs(t / duration - 1) > 0.1 or abs(own / angle - 1) > 1e-9:
        raise InputError(
            "the revolutions differ in length: turn all by the same angle at the same speed, as each pair must share "
            "angle and time"
        )
    return S


def as_effects(x: Array) -> Array:
    """Values of the effects (12,) [SI] from K1, K2, bias, E (12,) of the pulse model; float or complex."""
    triad = Pulses(x[0:3], x[3:6], 0 * x[0:3], x[6:9], x[9:12])
    s, beta = of_rate_matrix(np.linalg.inv(unit_lower_triangular(triad.E) * triad.K1[None, :]))
    below = [beta[MISALIGNMENT_AXES.index(axis)] for axis in LOWER_TRIANGLE]
    return np.concatenate([-triad.bias / triad.K1, s, below, -triad.K2 / triad.K1])


def triangular_parameters() -> tuple[Parameter, ...]:
    """The parameters in the order of `as_effects`; of the misalignments those that a rotation of the triad leaves."""
    return tuple(
        p for p in parameters_of_effects(EFFECTS) if p.effect != "gyro_misalignment" or p.axis in LOWER_TRIANGLE
    )


def _outcome(converged: bool, noise_is_known: bool, times: float) -> str:
    if not converged:
        return "the fit did not settle: the revolutions do not determine the triad"
    if not noise_is_known or times <= MAX_RATE_SCATTER_RATIO:
        return ""
    return f"revolutions and rests are off by {times:.2g} times what the noise of the gyroscopes explains"


def _calibration(revolutions: Revolutions, fit: PulseFit, pairs: int, noise_is_known: bool) -> Calibration:
    x = fit.pulses.vector()[0][FREE_ORDINALS]
    J = complex_step(as_effects, x)  # a change of variables, pulses to rate into physics to reading
    dof = 3 * pairs + revolutions.rest.shape[1] - 12
    chi2 = float(fit.chi2[0])
    scale = max(1.0, chi2 / max(dof, 1))
    covariance = scale * J @ fit.covariance[0][np.ix_(FREE_ORDINALS, FREE_ORDINALS)] @ J.T
    wanted = triangular_parameters()
    excess = float(np.sqrt(chi2 / max(dof, 1)))
    options = Options(
        direction=DIRECTION, pairs=pairs, rests=int(revolutions.rest.shape[1]),
        turned_each_way=revolutions.angle / (2 * np.pi), scatter_over_noise=excess,
        frame="x along the first input axis, y in the plane of the first two",
    )  # fmt: skip
    return Calibration(
        "revolutions",
        with_values((), wanted, as_effects(x)),
        wanted,
        covariance,
        (Unobservable({"gyro_misalignment:xz": 1.0, "gyro_misalignment:yz": 1.0},
                      "a rotation of the whole triad changes no norm and no angle: turns between rests, with the "
                      "accelerometers, show it"),),
        Residual(chi2, dof, {RATE: float(revolutions.sigma_angle / revolutions.duration * np.sqrt(scale))}),
        outcome=_outcome(bool(fit.converged[0]), noise_is_known, excess),
        provenance=Provenance(options=options),
    )  # fmt: skip


MIN_GRAVITY_CHANGE = 0.1  # of its direction: a turn that moves it less, a whole revolution, says nothing of the triads


@dataclass(frozen=True)
class InterTriad:
    """alpha, beta, gamma (3,) [rad] of Eq. (43) with their covariance [rad^2] and the rms misfit of the pairs [rad]."""

    angles: Array
    covariance: Array
    rms: float


def triad_rotation(angles: Array) -> Array:
    """C_p^q = Ry(gamma) Rx(beta) Rz(alpha) of Eq. (43) from (..., 3) [rad]."""
    a = np.asarray(angles)
    return np.asarray(frame_rotation("y", a[..., 2]) @ frame_rotation("x", a[..., 1]) @ frame_rotation("z", a[..., 0]))


def euler_angles(C: Array) -> Array:
    """alpha, beta, gamma (3,) [rad] of a rotation matrix, the inverse of `triad_rotation` for |beta| < pi/2."""
    return np.array([arctan2(-C[1, 0], C[1, 1]), arcsin(C[1, 2]), arctan2(-C[0, 2], C[2, 2])])


def from_turns(before: Array, after: Array, turns: Array, sigma: float) -> InterTriad:
    """Estimate the rotation from unit force before and after (m, 3) in p and the turns R^q (m, 3, 3) between.

    sigma [rad]: error of one pair per component. Raises InputError where the turns do not determine the rotation.
    """

    def misfit(x: Array) -> Array:
        C = triad_rotation(x)
        return (apply_matrix(C, after) - apply_matrix(turns @ C, before)).ravel()

    # rotations of two frames against each other are no rows of the forward model: the derivative is by the angles
    minimum = minimise(lambda x, _: (misfit(x[0])[None], complex_step(misfit, x[0])[None]), np.zeros((1, 3)))
    J = minimum.jacobian[0]
    if np.linalg.svd(J, compute_uv=False)[-1] < 1e-6 * np.sqrt(len(before)):  # turns of order one give order one
        raise InputError(
            "these turns do not determine the rotation between the triads: turn about two axes that are not "
            "vertical, by angles that are not whole revolutions"
        )
    rms = float(np.sqrt(2 * minimum.cost[0] / J.shape[0]))
    return InterTriad(minimum.x[0], sigma**2 * np.linalg.inv(J.T @ J), rms)


def rotation_between_triads(gyroscopes: Calibration, recording: Recording, accelerometers: Calibration) -> InterTriad:
    """Estimate C_p^q from the turns between dwells that change the direction of gravity in the unit.

    The sigma follows from the residuals of the turns. Raises InputError where fewer than three turns do.
    """
    rate = gyroscopes.apply(recording).triad(RATE)
    force = accelerometers.apply(recording).triad(FORCE)
    rests = dwells(recording)
    down = np.array([force[d.rows].mean(0) for d in rests])
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    between = moves_between_dwells(recording)
    changes = np.linalg.norm(np.diff(down, axis=0), axis=1) > MIN_GRAVITY_CHANGE
    used = [i for i, m in enumerate(between) if changes[i] and not m.paused]
    if len(used) < 3:
        raise InputError(
            f"gravity is moved by {number_of(len(used), 'turn')}; three or more tell how the triads lie to each other"
        )
    turns = np.array(
        [_turn_relative_to_earth(recording.time, rate, between[i].rows, rate[rests[i].rows].mean(0)) for i in used]
    )
    fit = from_turns(down[used], down[[i + 1 for i in used]], turns, sigma=1.0)  # scaled by its residuals below
    # each turn has three residuals of rank two
    sigma = fit.rms * np.sqrt(3 * len(used) / max(2 * len(used) - 3, 1))
    return replace(fit, covariance=sigma**2 * fit.covariance)


def _turn_relative_to_earth(time: Array, rate: Array, span: slice, earth: Array) -> Array:
    """Return R^q (3, 3) of one turn relative to the Earth, whose rate (3,) [rad/s] is known before it."""
    t, C = time[span], np.eye(3)
    mean, bend, coning = mean_rates(t, rate[span])
    for dt, w in zip(np.diff(t), mean + bend + coning, strict=True):
        C = exponential((w - C @ earth) * dt) @ C
    return C


def in_accelerometer_frame(gyroscopes: Calibration, lie: InterTriad) -> Calibration:
    r"""Return the gyroscopes referred to the accelerometers' frame, with six misalignments instead of three.

    .. math:: y = M \omega^q + \dots = (M C_p^q) \, \omega^p + \dots , \quad M \text{ physics to reading}
    """
    order = parameters_of_effects(EFFECTS)
    labels = [p.label for p in gyroscopes.parameters]
    linear = [[p.label for p in parameters(CATALOGUE[i])] for i in ("gyro_scale_factor", "gyro_misalignment")]
    n = len(labels)

    def referred(x: Array) -> Array:
        own = dict(zip(labels, x[:n], strict=True))
        s, beta = (np.array([own.get(label, 0.0) for label in of]) for of in linear)
        new = np.concatenate(of_rate_matrix(rate_matrix(s, beta) @ triad_rotation(x[n:])))
        own |= dict(zip([*linear[0], *linear[1]], new, strict=True))
        return np.array([own[p.label] for p in order])

    x = np.concatenate([gyroscopes.values, lie.angles])
    J = complex_step(referred, x)  # a change of variables from one frame to the other
    covariance = block_diagonal([gyroscopes.covariance, lie.covariance])
    angles, sigmas = (
        tuple(float(from_si(a, "arcsec")) for a in rad) for rad in (lie.angles, np.sqrt(np.diag(lie.covariance)))
    )
    origin = gyroscopes.provenance.with_options(
        frame="accelerometers", inter_triad_arcsec=angles, inter_triad_sigma_arcsec=sigmas
    )
    effects, P = with_values((), order, referred(x)), J @ covariance @ J.T
    return replace(gyroscopes, effects=effects, parameters=order, covariance=P, unobservable=(), provenance=origin)
