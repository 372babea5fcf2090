r"""How well the constants of a unit are seen on a path: the covariance of a Kalman filter, from derived blocks only.

At rest on the ground the nine navigation errors obey dx/dt = F x + B(t) p + noise with F constant (V = 0, f^n up) and
B(t) = C(t) d(dw, df)/dp at the true rate and force; p are constants. Velocity is known to be zero once a second. Noise
is white in rate and force. Nothing is linearised further, so the covariance is the Cramer-Rao bound of everything that
sees the same velocities.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from derivations import mechanisation as nav
from derivations.turning import Path

READ_OUT = 1.0  # s
VELOCITY = 1e-5  # m/s, how still: of a filter on a pier


@dataclass(frozen=True)
class Noise:
    """White: of rate [rad/s/sqrt(Hz)] and force [m/s^2/sqrt(Hz)]."""

    rate: float
    force: float


def transition(latitude: float, dt: float) -> tuple[Any, Any]:
    """Return the phi (9, 9) over dt and its integral (9, 9), by series; F dt is 1e-2 at most."""
    F = nav.linearised([0, 0, 0, latitude, 0, 0], [0, 0, float(nav.gravity(latitude, 0.0))], held=False)[:, :9]
    Phi, integral, term = np.eye(9), dt * np.eye(9), np.eye(9)
    for n in range(1, 8):
        term = term @ F * dt / n
        Phi = Phi + term
        integral = integral + term * dt / (n + 1)
    return Phi, integral


def sigmas(
    path: Path, latitude: float, columns: Callable[[Any, Any], Any], prior: Any, noise: Noise, still: float = VELOCITY
) -> Any:
    """Return (p,) one standard deviation of each constant after the path, in units of its prior sigma.

    columns: rate (n, 3) and force (n, 3) in b to (n, 6, p) derivatives of what gyroscopes and accelerometers read too
    much. prior (p,) in their units; still [m/s]: one sigma of the velocity that is known to be zero.
    """
    Phi, driven = _driven(path, latitude, columns, prior)
    return _filter(Phi, driven, path.dt, noise, still)


NAVIGATION = (*(f"phi_{a}" for a in "ENU"), *(f"dV_{a}" for a in "ENU"), "dL", "dlambda", "dh")
STATE_SIZES = np.array([1e-3] * 3 + [1e-2] * 3 + [1e-6] * 2 + [1.0])  # rad, m/s, rad, m
NO_SIGNAL = 1e-9  # of the largest singular value of the rows, states in their sizes: rounding leaves 1e-12


def unobserved(path: Path, latitude: float, columns: Callable[[Any, Any], Any], sizes: Any) -> Any:
    """Return a basis (k, 9 + p) of what velocities without noise do not determine, in units of the states' sizes.

    The rows are the velocities once a second by the nine errors at the start and the p constants.
    """
    Phi, driven = _driven(path, latitude, columns, sizes)
    size = 9 + driven.shape[-1]
    every, now = round(READ_OUT / path.dt), np.eye(9, size)
    rows: Any = np.zeros((0, size))
    now[:, :9] *= STATE_SIZES
    kept: list[Any] = []
    for k, G in enumerate(driven, start=1):
        now = Phi @ now
        now[:, 9:] += G
        if k % every == 0:
            kept.append(now[3:6].copy())
            if len(kept) == 200:
                rows, kept = np.linalg.qr(np.concatenate([rows, *kept]), mode="r"), []
    _, s, Vt = np.linalg.svd(np.concatenate([rows, *kept]))
    return Vt[s < NO_SIGNAL * s[0]]


def _driven(path: Path, latitude: float, columns: Callable[[Any, Any], Any], sizes: Any) -> tuple[Any, Any]:
    """Return the transition (9, 9) of a step, and what constants of these sizes (p,) add in each (n, 9, p)."""
    g = np.array([0, 0, float(nav.gravity(latitude, 0.0))])
    w_in = nav.earth_in_n(np.float64(latitude))
    force, rate = np.swapaxes(path.C, 1, 2) @ g, path.rate + np.swapaxes(path.C, 1, 2) @ w_in
    read = columns(rate, force) * np.asarray(sizes)
    B = np.zeros((len(force), 9, read.shape[-1]))
    B[:, :3], B[:, 3:6] = -path.C @ read[:, :3], path.C @ read[:, 3:]
    Phi, integral = transition(latitude, path.dt)
    return Phi, integral @ B


def _filter(Phi: Any, driven: Any, dt: float, noise: Noise, still: float) -> Any:
    """Return the covariance recursion in blocks; constants have no dynamics."""
    p = driven.shape[-1]
    Q = np.diag([noise.rate**2 * dt] * 3 + [noise.force**2 * dt] * 3 + [0.0] * 3)
    xx, xp, pp = np.diag([0.0175**2] * 3 + [still**2] * 3 + [1e-16] * 2 + [1e-6]), np.zeros((9, p)), np.eye(p)
    every = round(READ_OUT / dt)
    for k, G in enumerate(driven, start=1):
        side = Phi @ xp
        cross = side @ G.T
        spread = G @ pp
        xx = Phi @ xx @ Phi.T + cross + cross.T + spread @ G.T + Q
        xx = (xx + xx.T) / 2  # rounding would grow
        xp = side + spread
        if k % every == 0:
            velocity_rows = np.concatenate([xx[3:6], xp[3:6]], axis=1)
            half = np.linalg.inv(np.linalg.cholesky(velocity_rows[:, 3:6] + still**2 * np.eye(3))) @ velocity_rows
            nav_, constant = half[:, :9], half[:, 9:]
            xx, xp, pp = xx - nav_.T @ nav_, xp - nav_.T @ constant, pp - constant.T @ constant
    return np.sqrt(np.diagonal(pp))


@cache
def of_density(value: float, hertz: float) -> float:
    """Return the white density of a noise per sample."""
    return float(value / np.sqrt(hertz))
