r"""Gyroscopes in pulses from whole revolutions both ways, and from rest: Wang et al. (2019), section 4.2.

Direction: pulses to rate. Over a whole revolution at constant speed the Earth's rate across the axis averages out, so
with S1, S2 the integrals of N and N^2 over one revolution of duration t and angle theta about the unknown axis u,

.. math::
    C (K_1 (S_1^+ - S_1^-) + K_2 (S_2^+ - S_2^-)) &= 2 \theta u                                    & (29) \\
    C (K_1 (S_1^+ + S_1^-) + K_2 (S_2^+ + S_2^-) + 2 \varepsilon t) &= 2 t (\omega_{ie} \cdot u) u  & (27) + (28)

The paper keeps the norm of the first (Eq. (30)). An even nonlinearity all but cancels in it: S_2^+ - S_2^- is of the
order of the Earth's rate or of K_2 itself, so K_2 is badly determined. The second line holds it in full and needs no
angle either: its component along u holds the unknown Earth rate and is dropped, the two across u must vanish.
Rest positions give the bias through the norm of the Earth's rate, Eq. (35).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.estimate.pulses.gravity_norm import PulseFit, in_si, initial_scale, unit_lower_triangular
from gimbalcal.inference.ellipsoid import ellipsoid
from gimbalcal.inference.levenberg import minimise
from gimbalcal.number import Array

FREE_ORDINALS = np.r_[0:6, 9:15]  # K1, K2, bias, E of the fifteen: Eq. (6) has no cubic term


@dataclass(frozen=True)
class Revolutions:
    """What r units counted in k sets of revolutions both ways, and in m rest positions.

    clockwise, counterclockwise (r, k, 2, 3): integrals of N [pulse] and of N^2 [pulse^2/s] over `duration` [s], the
    time of `angle` [rad], a whole number of revolutions; rest (r, m, 3): mean counts [pulse/s].
    sigma_angle [rad]: noise of the integrated rate along one axis in one sense; sigma_rest [rad/s]: of a rest mean.
    """

    clockwise: Array
    counterclockwise: Array
    rest: Array
    duration: float
    angle: float
    sigma_angle: float
    sigma_rest: float


def gyroscope_pulses(counted: Revolutions, *, both_senses: bool = True, guess: Array | None = None) -> PulseFit:
    """Fit Eq. (6) to revolutions and rest: K1, K2, bias and misalignment (K3 stays zero) with their covariance.

    both_senses=False uses only the differences, Eq. (30), as the paper does. The starts are Eq. (42) and the ellipsoid
    through the differences; `guess` (3,) or (r, 3) [rad/pulse] replaces both by given scale factors.
    """
    difference = counted.clockwise - counted.counterclockwise
    K0 = (
        initial_scale(difference[:, :, 0], 2 * counted.angle)
        if guess is None
        else np.broadcast_to(guess, _shape(counted))
    )
    speed = counted.angle / counted.duration
    data = _in_units_of_angle(counted, K0, speed)

    def model(x: Array, runs: Array) -> tuple[Array, Array]:
        return _residuals(x, tuple(d[runs] for d in data), counted, both_senses)

    plain = np.tile(np.r_[np.ones(3), np.zeros(9)], (len(K0), 1))
    minimum = minimise(model, plain)
    if guess is None:
        half = data[0][:, :, 0] / 2
        second = ellipsoid(np.concatenate([half, -half], axis=1))
        usable = np.isfinite(second).all(-1)
        start = plain.copy()
        start[usable, :3], start[usable, 9:] = second[usable, :3], second[usable, 6:]
        minimum = minimum.better(minimise(model, start))
    one = np.ones_like(K0)
    return in_si(minimum, FREE_ORDINALS, [K0, K0**2 / speed, one, speed * one, one])


def _shape(counted: Revolutions) -> tuple[int, int]:
    return len(counted.rest), 3


def _in_units_of_angle(counted: Revolutions, K0: Array, speed: float) -> tuple[Array, Array, Array]:
    """Difference and sum (r, k, 3 bases, 3) of the two senses in units of the angle, rest (r, m, 3, 3) of the speed.

    The three bases multiply K1, K2 and the bias; at a rough scale of K0 the first is of order one.
    """
    unit = np.stack([K0, K0**2 / speed], axis=1)[:, None] / counted.angle
    minus = (counted.clockwise - counted.counterclockwise) * unit
    plus = (counted.clockwise + counted.counterclockwise) * unit
    n = counted.rest * K0[:, None] / speed
    one = np.ones_like(minus[:, :, :1])
    return (
        np.concatenate([minus, 0 * one], axis=2),
        np.concatenate([plus, 2 * one], axis=2),
        np.stack([n, n**2, np.ones_like(n)], axis=2),
    )


def _vectors_of_bases(x: Array, bases: Array) -> tuple[Array, Array]:
    """Vectors (r, k, 3) in the orthogonal frame and derivatives (r, k, 3, 12) from bases (r, k, 3, 3), x (r, 12)."""
    C = unit_lower_triangular(x[:, 9:])
    w = np.einsum("rbj,rkbj->rkj", x[:, :9].reshape(-1, 3, 3), bases)
    J = np.zeros((*w.shape, 12))
    J[..., :9] = (C[:, None, :, None, :] * bases[:, :, None]).reshape(*w.shape, 9)
    J[..., 1, 9], J[..., 2, 10], J[..., 2, 11] = w[..., 0], w[..., 0], w[..., 1]
    return w @ np.swapaxes(C, -1, -2), J


def _residuals(x: Array, data: tuple[Array, ...], counted: Revolutions, both_senses: bool) -> tuple[Array, Array]:
    """Whitened misfits (r, n) and exact derivatives (r, n, 12): Eq. (30), the cross components, Eq. (35)."""
    sigma = np.sqrt(2) * counted.sigma_angle / counted.angle
    D, JD = _vectors_of_bases(x, data[0])
    length = (D**2).sum(-1)
    rows = [((length - 4) / (4 * sigma), np.einsum("rki,rkip->rkp", D, JD) / (2 * sigma))]  # Eq. (30) / (4 theta sigma)
    if both_senses:
        S, JS = _vectors_of_bases(x, data[1])
        rows += _part_across(S, JS, D, JD, length, sigma)
    W, JW = _vectors_of_bases(x, data[2])
    speed = counted.angle / counted.duration
    earth, noise = EARTH_RATE / speed, counted.sigma_rest / speed
    rest = ((W**2).sum(-1) - earth**2) / (2 * earth * noise)  # Eq. (35)
    rows.append((rest, np.einsum("rki,rkip->rkp", W, JW) / (earth * noise)))
    return np.concatenate([r for r, _ in rows], axis=1), np.concatenate([J for _, J in rows], axis=1)


def _part_across(S: Array, JS: Array, D: Array, JD: Array, length: Array, sigma: float) -> list[tuple[Array, Array]]:
    """Part of S across D, S - D (S.D)/(D.D), component by component, over sigma; three rows of rank two."""
    share = (S * D).sum(-1) / length
    d_dot = np.einsum("rki,rkip->rkp", D, JS) + np.einsum("rki,rkip->rkp", S, JD)
    d_share = (d_dot - 2 * share[..., None] * np.einsum("rki,rkip->rkp", D, JD)) / length[..., None]
    cross = S - D * share[..., None]
    J = JS - JD * share[..., None, None] - D[..., None] * d_share[..., None, :]
    return [(cross[..., i] / sigma, J[..., i, :] / sigma) for i in range(3)]
