r"""Linear error equations of a navigator: Wang et al. (2019), Eqs. (9) and (10), with the feedback that (16) drops.

.. math::
    \delta\dot V &= f \times \varphi + \delta V \times (2 \omega_{ie} + \omega_{en})
                    + V \times (2 \delta\omega_{ie} + \delta\omega_{en}) + \delta f \\
    \dot\varphi  &= \varphi \times \omega_{in} + \delta\omega_{ie} + \delta\omega_{en} - \delta\omega_{ib} \\
    \delta\dot r &= \delta V

Errors are computed minus true, the frame is north, east, down, the computed frame is (1 - [phi x]) times the true one.
The vertical channel is held (by a barometer, say): height and vertical velocity have no error.
"""

from dataclasses import dataclass

import numpy as np

from gimbalcal.earth import EARTH_RATE, SEMI_MAJOR_AXIS
from gimbalcal.estimate.pulses.gravity_norm import Pulses
from gimbalcal.number import Array
from gimbalcal.rotation import cross_matrix

RADIUS = SEMI_MAJOR_AXIS  # m; one radius for both directions: 0.7 % of the feedback


@dataclass(frozen=True)
class Trajectory:
    """True motion at n instants.

    time (n,) [s]; C_bn (n, 3, 3) body to navigation; velocity (n, 3) [m/s] north, east, down; force and rate (n, 3) in
    the body [m/s^2, rad/s], against the inertial frame; latitude (n,) [rad].
    """

    time: Array
    C_bn: Array
    velocity: Array
    force: Array
    rate: Array
    latitude: Array


@dataclass(frozen=True)
class NavigationError:
    """time (n,) s; position (n, 2) m north and east; velocity (n, 2) m/s; attitude (n, 3) rad: computed minus true."""

    time: Array
    position: Array
    velocity: Array
    attitude: Array

    @property
    def largest(self) -> float:
        """Largest horizontal position error [m]."""
        return float(np.max(np.linalg.norm(self.position, axis=1)))


def misread(true: Pulses, used: Pulses, v: Array) -> Array:
    """Error (n, 3) of a force or rate v (n, 3) that the triad `true` reads in pulses and the model `used` converts."""
    return np.asarray(used.physical(true.counts(v)) - v)


def aligned(path: Trajectory, force_error: Array, rate_error: Array) -> Array:
    r"""Attitude error (3,) [rad] that a navigator starts with when it levels and gyrocompasses at the first instant.

    .. math:: \varphi_E = -\delta f_N / g, \quad \varphi_N = \delta f_E / g, \quad
              \varphi_D = (\delta\omega_E + \varphi_N \omega_D) / \omega_N

    so that neither the velocity nor the east axis moves at first. A constant force error north stays hidden only until
    the Earth has turned its tilt.
    """
    f, w = path.C_bn[0] @ force_error[0], path.C_bn[0] @ rate_error[0]
    g = float(np.linalg.norm(path.force[0]))
    north, down = EARTH_RATE * np.cos(path.latitude[0]), -EARTH_RATE * np.sin(path.latitude[0])
    phi_N = f[1] / g
    return np.array([phi_N, -f[0] / g, (w[1] + phi_N * down) / north])


def propagate(
    path: Trajectory, force_error: Array, rate_error: Array, attitude: Array | None = None
) -> NavigationError:
    """Errors along a trajectory from sensor errors (n, 3) in the body [m/s^2, rad/s].

    It starts without errors of position and velocity and with `attitude` (3,) [rad] (default `aligned`). The state is
    position north, east [m]; velocity north, east [m/s]; phi north, east, down [rad]. Second order in the step.
    """
    F, u = _dynamics(path), np.zeros((len(path.time), 7))
    u[:, 2:4] = np.einsum("nij,nj->ni", path.C_bn, force_error)[:, :2]
    u[:, 4:] = -np.einsum("nij,nj->ni", path.C_bn, rate_error)
    dt = np.diff(path.time)
    F_mid, u_mid = (F[1:] + F[:-1]) / 2, (u[1:] + u[:-1]) / 2
    h = dt[:, None, None]
    step = np.eye(7) + h * F_mid + h**2 / 2 * F_mid @ F_mid
    push = np.einsum("nij,nj->ni", h * np.eye(7) + h**2 / 2 * F_mid, u_mid)
    x = np.zeros((len(path.time), 7))
    x[0, 4:] = aligned(path, force_error, rate_error) if attitude is None else attitude
    for k in range(len(dt)):
        x[k + 1] = step[k] @ x[k] + push[k]
    return NavigationError(path.time, x[:, :2], x[:, 2:4], x[:, 4:])


def _dynamics(path: Trajectory) -> Array:
    """F (n, 7, 7) of the state of `propagate`."""
    L, R = path.latitude, RADIUS
    s, c, t = np.sin(L), np.cos(L), np.tan(L)
    N, E, D = path.velocity.T
    f = np.einsum("nij,nj->ni", path.C_bn, path.force)
    zero = np.zeros_like(L)
    w_ie = EARTH_RATE * np.stack([c, zero, -s], axis=-1)
    w_en = np.stack([E / R, -N / R, -E * t / R], axis=-1)
    # errors of the two rates by position and velocity: columns r_N, r_E, V_N, V_E
    d_ie, d_en = np.zeros((len(L), 3, 4)), np.zeros((len(L), 3, 4))
    d_ie[:, 0, 0], d_ie[:, 2, 0] = -EARTH_RATE * s / R, -EARTH_RATE * c / R
    d_en[:, 2, 0] = -E / (R * c) ** 2
    d_en[:, 0, 3], d_en[:, 1, 2], d_en[:, 2, 3] = 1 / R, -1 / R, -t / R
    F = np.zeros((len(L), 7, 7))
    F[:, 0, 2] = F[:, 1, 3] = 1
    F[:, 2:4, 4:] = cross_matrix(f)[:, :2]
    F[:, 2:4, :4] = (cross_matrix(np.stack([N, E, D], -1)) @ (2 * d_ie + d_en))[:, :2]
    F[:, 2:4, 2:4] += -cross_matrix(2 * w_ie + w_en)[:, :2, :2]  # dV x w = -w x dV
    F[:, 4:, 4:] = -cross_matrix(w_ie + w_en)  # phi x w = -w x phi
    F[:, 4:, :4] = d_ie + d_en
    return F
