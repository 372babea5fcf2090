"""The package's navigator against Eqs. (9) to (16).

The derivations stand in east, north, up and in vectors; the package in north, east, down, its state position north and
east, velocity north and east, attitude about all three, the vertical channel held. Errors of the two rates by position
and velocity are the differentials of (11) and (12) on a sphere.
"""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np
import sympy as sp

from derivations.comparison import checks
from derivations.stimulus import attitude
from derivations.wang2019 import navigation as nav
from derivations.wang2019.package import numbers, vector
from derivations.wang2019.symbols import K2, K3, SOURCE, E, L, N, omega_ie, triangle

DYNAMICS = "wang2019.error_model._dynamics"
PROPAGATE = "wang2019.error_model.propagate"
TURN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # north, east, down to east, north, up and back
LATITUDE = 0.6
VELOCITY = np.array([70.0, -40.0, 5.0])  # m/s north, east, down
FORCE, RATE = np.array([0.4, -0.7, -9.6]), np.array([1e-3, -2e-3, 3e-3])  # body
FORCE_ERROR, RATE_ERROR = np.array([1e-3, -2e-3, 3e-3]), np.array([2e-6, 1e-6, -3e-6])
ATTITUDE = np.array([1e-3, 2e-3, -1.5e-3])
STEP = 0.5  # s


def _path(velocity: Any, times: Any) -> Any:
    """The same state at each of the times; the body turned against the navigation frame by a generic rotation."""
    from gimbalcal.wang2019.error_model import Trajectory

    n = len(times)
    C = attitude()

    def still(v: Any) -> Any:
        return np.broadcast_to(v, (n, *np.shape(v)))

    return Trajectory(np.array(times), still(C), still(velocity), still(FORCE), still(RATE), np.full(n, LATITUDE))


def _errors() -> tuple[Any, dict[Any, Any]]:
    """Symbols of the seven states, and the vectors of (9), (10) in ENU as functions of them."""
    from gimbalcal.wang2019.error_model import RADIUS

    rN, _, vN, vE, pN, pE, pD = x = sp.symbols("r_N r_E v_N v_E phi_N phi_E phi_D", real=True)
    transport = nav.transport_rate(0).subs({nav.R_M: RADIUS, nav.R_N: RADIUS})
    dL, dV = rN / RADIUS, sp.Matrix([vE, vN, 0])
    vectors = (
        (nav.dw_ie, nav.earth_rate().diff(L) * dL),
        (nav.dw_en, transport.diff(L) * dL + transport.jacobian(list(nav.V)) * dV),
        (nav.w_ie, nav.earth_rate()),
        (nav.w_en, transport),
        (nav.dV, dV),
        (nav.phi, sp.Matrix([pE, pN, -pD])),
    )
    return x, {symbol: value for pair in vectors for symbol, value in zip(*pair, strict=True)}


@cache
def _derived() -> tuple[Any, Any]:
    """F (7, 7) by (9), (10), and u (7,) from the errors of force and rate, moving."""
    from gimbalcal.earth import EARTH_RATE

    x, errors = _errors()
    C = attitude()
    values = {omega_ie: EARTH_RATE, L: LATITUDE}
    values |= dict(zip(nav.V, TURN @ VELOCITY, strict=True))
    values |= dict(zip(nav.f, TURN @ C @ FORCE, strict=True))
    values |= dict(zip(nav.df, TURN @ C @ FORCE_ERROR, strict=True))
    values |= dict(zip(nav.dw_ib, TURN @ C @ RATE_ERROR, strict=True))
    turn = sp.Matrix(TURN.astype(int).tolist())
    rates = [turn * r.subs(errors) for r in (nav.velocity_error(), nav.attitude_error())]
    total = sp.Matrix([x[2], x[3], *rates[0][:2], *rates[1]])
    return numbers(total.jacobian(x), values), numbers(total.subs(dict.fromkeys(x, 0)), values)[:, 0]


def _scaled(difference: Any) -> float:
    """Largest entry, positions over the Earth's radius: columns of position reach 1e-6 of those of attitude."""
    from gimbalcal.wang2019.error_model import RADIUS

    state = np.array([RADIUS, RADIUS, 1e3, 1e3, 1, 1, 1])  # m, m/s, rad: sizes that are alike in effect
    return float(np.abs(difference * state).max())


def dynamics(rows: slice) -> float:
    """Rows of F, moving."""
    from gimbalcal.wang2019 import error_model

    ours = error_model._dynamics(_path(VELOCITY, [0.0]))[0]
    return _scaled((ours - _derived()[0])[rows])


def driven(rows: slice) -> float:
    """F x + u of `propagate`: the odd part of a step forward and a step back is exact."""
    from gimbalcal.wang2019 import error_model

    start, ends = np.concatenate([np.zeros(4), ATTITUDE]), []
    for h in (STEP, -STEP):
        path = _path(VELOCITY, [0.0, h])
        force, rate = (np.broadcast_to(v, (2, 3)) for v in (FORCE_ERROR, RATE_ERROR))
        e = error_model.propagate(path, force, rate, ATTITUDE)
        ends.append(np.concatenate([e.position[1], e.velocity[1], e.attitude[1]]) - start)
    F, u = _derived()
    return float(np.abs((ends[0] - ends[1]) / (2 * STEP) - (F @ start + u))[rows].max())


def at_rest(rows: slice) -> float:
    """Rows of F at rest against (15) or (16), with the feedback that they drop."""
    from gimbalcal.earth import EARTH_RATE
    from gimbalcal.wang2019 import error_model

    still = np.zeros(3)
    R = error_model.RADIUS
    values = {omega_ie: EARTH_RATE, L: LATITUDE, nav.R_M: R, nav.R_N: R}
    values |= dict(zip(nav.f, TURN @ attitude() @ FORCE, strict=True))
    unknowns = (nav.dL, nav.dV[1], nav.dV[0], nav.phi[1], nav.phi[0], nav.phi[2])
    to_state = np.diag([1 / R, 1.0, 1.0, 1.0, 1.0, -1.0])
    zero = dict.fromkeys((*nav.dV, *nav.phi, nav.dL), 0)
    rate = nav.at_rest(nav.velocity_error() if rows.start == 2 else nav.attitude_error())
    J = TURN @ numbers(rate.jacobian(unknowns).subs(zero), values) @ to_state
    derived = np.insert(J[: rows.stop - rows.start], 1, 0.0, axis=1)  # east position does nothing
    return _scaled(error_model._dynamics(_path(still, [0.0]))[0][rows] - derived)


VELOCITIES, ATTITUDES = slice(2, 4), slice(4, 7)
checks(SOURCE, "Eq. (9)", where=DYNAMICS)(partial(dynamics, slice(0, 4)))
checks(SOURCE, "Eq. (10)", where=DYNAMICS)(partial(dynamics, ATTITUDES))
checks(SOURCE, "Eq. (9)", where=PROPAGATE)(partial(driven, slice(0, 4)))
checks(SOURCE, "Eq. (10)", where=PROPAGATE)(partial(driven, ATTITUDES))
checks(SOURCE, "Eq. (15)", where=DYNAMICS)(partial(at_rest, VELOCITIES))
checks(SOURCE, "Eq. (16)", where=DYNAMICS)(partial(at_rest, ATTITUDES))


@checks(SOURCE, "Eq. (11)", where=DYNAMICS)
def earth_rate() -> float:
    """Eq. (11) from the attitude rows at rest."""
    from gimbalcal.earth import EARTH_RATE

    derived = TURN @ numbers(nav.earth_rate(), {omega_ie: EARTH_RATE, L: LATITUDE})[:, 0]
    return float(np.abs(_turning(np.zeros(3)) - derived).max() / EARTH_RATE)


@checks(SOURCE, "Eq. (12)", where=DYNAMICS)
def transport_rate() -> float:
    """Eq. (12) from the attitude rows: moving less at rest."""
    from gimbalcal.earth import EARTH_RATE
    from gimbalcal.wang2019.error_model import RADIUS

    values = {L: LATITUDE, nav.R_M: RADIUS, nav.R_N: RADIUS} | dict(zip(nav.V, TURN @ VELOCITY, strict=True))
    derived = TURN @ numbers(nav.transport_rate(0), values)[:, 0]
    return float(np.abs(_turning(VELOCITY) - _turning(np.zeros(3)) - derived).max() / EARTH_RATE)


def _turning(velocity: Any) -> Any:
    """w_in (3,) north, east, down that the attitude rows hold: phi x w = -[w x] phi."""
    from gimbalcal.wang2019 import error_model

    M = -error_model._dynamics(_path(velocity, [0.0]))[0][4:, 4:]
    return np.array([M[2, 1], M[0, 2], M[1, 0]])


def omitted(symbolic: Any, order: int) -> float:
    """What a triad misreads whose nonlinear terms are left out: computed minus true, so minus what (13), (14) add."""
    from gimbalcal.wang2019 import error_model
    from gimbalcal.wang2019.pulses import Pulses, truncated

    true = Pulses.from_vector(vector() if order == 3 else vector(*K3))
    counted = np.array([[0.7, -0.4, 0.6]])
    ours = error_model.misread(true, truncated(true, 1), true.physical(counted))[0]
    x = true.vector()
    at = dict(zip((*K2, *K3, *E, *N), (*x[3:9], *x[12:], *counted[0]), strict=True))
    return float(np.abs(ours + numbers(triangle() * symbolic, at)[:, 0]).max())


@checks(SOURCE, "Eq. (13)", where="wang2019.error_model.misread")
def omitted_force() -> float:
    """The accelerometers' second and third order."""
    return omitted(nav.omitted_force(), 3)


@checks(SOURCE, "Eq. (14)", where="wang2019.error_model.misread")
def omitted_rate() -> float:
    """The gyroscopes' second order."""
    return omitted(nav.omitted_rate(), 2)
