"""What the package's pulse and rotation estimators make of readings that the derivations compute.

`package_rows` compares misfits and their derivatives; here an estimate, in SI, must be the truth of which counts
follow by the inverse of (2) and (6), and a turn must be the rotation that its rates were computed from.
"""

from __future__ import annotations

from functools import cache
from math import pi
from typing import Any

import numpy as np
import sympy as sp

from derivations.comparison import checks
from derivations.readings import RATE, TURN
from derivations.stimulus import stimulus
from derivations.turning import rotation
from derivations.wang2019 import accelerometer, frames, navigation, optimisation
from derivations.wang2019.package import PARAMETERS, numbers
from derivations.wang2019.symbols import BIAS, K1, K2, K3, SOURCE, E, L, N, omega_ie, triangle

EARTH = 7.292115e-5  # rad/s, WGS-84
G0 = 9.80665  # m/s^2
FITTED = 1e-7  # relative: where Gauss and Newton end, in what decides a parameter
LABORATORY = "schedule.published"
# in SI per pulse, as Tables 2 and 3 draw them
FORCE_TRUTH = np.array([3e-6, 4e-6, 2e-6, 3e-15, -4e-15, 2e-15, -3e-21, 4e-21, 2e-21, 4e-3, -6e-3, 8e-3,
                        4e-4, -3e-4, 2e-4]) * np.r_[np.full(12, G0), np.ones(3)]  # fmt: skip
RATE_TRUTH = np.array([3e-7, 4e-7, 2e-7, 3e-17, -4e-17, 2e-17, 3e-6, -4e-6, 2e-6]) * pi / 180
RATE_TRUTH = np.r_[RATE_TRUTH, 4e-4, -3e-4, 2e-4]
SPEED = 10 * pi / 180  # rad/s


@checks(SOURCE, "Eq. (11)", where="earth.rate_at")
def earth_rate() -> float:
    """The Earth's rate, which the package has in north, east, down."""
    from gimbalcal.earth import rate_at

    derived = numbers(navigation.earth_rate(), {omega_ie: EARTH, L: 0.6})[:, 0]
    return float(np.abs(TURN @ rate_at(0.6) - derived).max() / EARTH)


# --- positions and axes of Figures 2 and 3


def _edges() -> Any:
    """Return the unit forces (12, 3) at 45 and 135 deg between two axes."""
    pairs = [(i, j) for i in range(3) for j in range(i)]
    return np.array([(a * np.eye(3)[i] + b * np.eye(3)[j]) / np.sqrt(2) for i, j in pairs for a in (1, -1)
                     for b in (1, -1)])  # fmt: skip


@cache
def _slope() -> Any:
    """Return derivatives of F of (19) by the fifteen parameters, at a perfect triad that reads u (3,) of 1 g."""
    nominal = dict.fromkeys((*K2, *K3, *BIAS, *E), 0) | dict.fromkeys(K1, 1)
    J = sp.Matrix([accelerometer.F()]).jacobian(PARAMETERS).subs(nominal)
    return sp.lambdify(N, list(J))


def _log_determinant(forces: Any) -> float:
    """Return ln det of the information of the fifteen parameters, each position weighing the same."""
    J = np.array([_slope()(*u) for u in forces], dtype=float)
    sign, value = np.linalg.slogdet(J.T @ J)
    return float(value) if sign > 0 and value > -40 else -np.inf


@cache
def _best() -> float:
    """Return the largest determinant of six faces and nine of the twelve edges, three between each pair of axes."""
    from itertools import combinations, product

    edges, faces = _edges(), np.concatenate([np.eye(3), -np.eye(3)])
    threes = [[list(three) for three in combinations(range(4 * k, 4 * k + 4), 3)] for k in range(3)]
    return max(
        _log_determinant(np.concatenate([faces, edges[[*choice[0], *choice[1], *choice[2]]]]))
        for choice in product(*threes)
    )


def _missing(directions: Any, wanted: Any) -> float:
    """Return how far the nearest direction is from each wanted one, the largest distance."""
    return float(max(np.linalg.norm(directions - w, axis=1).min() for w in wanted))


@checks(SOURCE, "Eq. (25)", where=f"{LABORATORY}.FIFTEEN_POSITIONS", tolerance=1e-9)
def fifteen_positions() -> float:
    """Six faces and nine edges that determine the fifteen parameters of (25) best, three edges for each angle E."""
    from gimbalcal.schedule.published import FIFTEEN_POSITIONS

    forces = -FIFTEEN_POSITIONS.gravity_directions()
    edges = [f for f in forces if np.abs(f).max() < 0.9]
    off = max(_missing(forces, np.concatenate([np.eye(3), -np.eye(3)])), *(_missing(_edges(), [f]) for f in edges))
    return float(off + abs(len(forces) - 15) + abs(_log_determinant(forces) - _best()))


@checks(SOURCE, "Eq. (34)", where=f"{LABORATORY}.REVOLUTION_AXES")
def revolution_axes() -> float:
    """Three input axes, and those at 45 and 135 deg between each two: of either sense, as each turns both ways."""
    from gimbalcal.schedule.published import REVOLUTION_AXES

    both = np.concatenate([REVOLUTION_AXES, -REVOLUTION_AXES])
    return _missing(both, np.concatenate([np.eye(3), _edges()])) + abs(len(REVOLUTION_AXES) - 9)


# --- estimates from counts


def _inverse(truth: Any) -> Any:
    """Return the counts (3,) of a force or rate (3,) by (2) or (6): Newton, each axis by itself."""
    at = dict(zip((*K1, *K2, *K3, *BIAS, *E), truth, strict=True))
    C = numbers(triangle(), at)
    k1, k2, k3, b = (np.asarray(truth[i : i + 3]) for i in (0, 3, 6, 9))

    def counts(v: Any) -> Any:
        u = np.linalg.solve(C, v)
        n = (u - b) / k1
        for _ in range(20):
            n = n - (((k3 * n + k2) * n + k1) * n + b - u) / ((3 * k3 * n + 2 * k2) * n + k1)
        return n

    return counts


@checks(
    SOURCE,
    "Eq. (2)",
    "Eq. (18)",
    "Eq. (19)",
    where="estimate.pulses.gravity_norm.accelerometer_pulses",
    tolerance=FITTED,
)
def accelerometers_from_pulses() -> float:
    """Fifteen parameters from the counts of six faces and twelve edges, what each makes of 1 g over that."""
    from gimbalcal.estimate.pulses.gravity_norm import accelerometer_pulses

    counts = _inverse(FORCE_TRUTH)
    forces = G0 * np.concatenate([np.eye(3), -np.eye(3), _edges()])
    found = accelerometer_pulses(np.array([counts(f) for f in forces])[None], G0, 1e-6)
    n = G0 / FORCE_TRUTH[:3]
    size = np.r_[n, n**2, n**3, np.ones(3), np.full(3, G0)] / G0
    return float(np.abs((found.pulses.vector()[0] - FORCE_TRUTH) * size).max())


def _turn_counts(axis: Any, sense: float) -> Any:
    """Return integrals of N, N^2 (2, 3) over a revolution about an axis (3,), the Earth's rate across it and along."""
    truth = np.r_[RATE_TRUTH[:6], np.zeros(3), RATE_TRUTH[6:]]
    counts, across = _inverse(truth), np.cross(axis, np.roll(axis, 1) + np.array([0.3, 0.1, -0.2]))
    across /= np.linalg.norm(across)
    n = 64  # of a period of a polynomial of low degree: exact
    S = np.zeros((2, 3))
    for phase in 2 * pi * np.arange(n) / n:
        north = np.cos(phase) * across - sense * np.sin(phase) * np.cross(axis, across)
        c = counts(EARTH * (0.8 * north + 0.6 * axis) + sense * SPEED * axis)
        S += np.array([c, c**2]) / n
    return S * 2 * pi / SPEED


@checks(SOURCE, "Eq. (6)", "Eq. (27)", "Eq. (28)", "Eq. (29)", "Eq. (30)", "Eq. (35)",
        where="estimate.pulses.whole_turns.gyroscope_pulses",
        tolerance=1e-6)  # fmt: skip
def gyroscopes_from_revolutions() -> float:
    """Twelve parameters from nine revolutions each way and fifteen rests, what each makes of the speed over that."""
    from gimbalcal.estimate.pulses.whole_turns import Revolutions, gyroscope_pulses

    axes = [*np.eye(3), *(e for e in _edges() if e[np.flatnonzero(e)[0]] > 0)]
    one, other = (np.array([_turn_counts(a, sense) for a in axes])[None] for sense in (1.0, -1.0))
    counts = _inverse(np.r_[RATE_TRUTH[:6], np.zeros(3), RATE_TRUTH[6:]])
    rest = np.array([counts(EARTH * e) for e in (*np.eye(3), *-np.eye(3), *_edges())])[None]
    found = gyroscope_pulses(Revolutions(one, other, rest, 2 * pi / SPEED, 2 * pi, 1e-9, 1e-12))
    x = found.pulses.vector()[0][[*range(6), *range(9, 15)]]
    n = SPEED / RATE_TRUTH[:3]
    size = np.r_[n, n**2, np.ones(3), np.full(3, SPEED)] / SPEED
    return float(np.abs((x - RATE_TRUTH) * size).max())


@checks(SOURCE, "Eq. (29)", where="estimate.gyroscopes.revolutions._integrals", tolerance=1e-6)
def a_revolution_with_ramps() -> float:
    """The integral of the rate over a revolution that comes and goes smoothly: 2 pi u and the Earth's part along u."""
    from gimbalcal.estimate.gyroscopes.revolutions import _integrals

    n, T = 2000, 40.0
    t = np.linspace(0.0, T, n + 1)
    phase = 2 * pi * (t / T - np.sin(2 * pi * t / T) / (2 * pi))
    speed = 2 * pi / T * (1 - np.cos(2 * pi * t / T))
    u = np.array([2.0, -1.0, 2.0]) / 3
    earth = EARTH * np.array([0.3, -0.5, 0.8])
    C = [rotation(u, a).T for a in phase]  # components in the unit, which turns by the phase about u
    rate = np.array([w * u + c @ earth for w, c in zip(speed, C, strict=True)])
    S, _, angle = _integrals(t, rate, earth, False)
    return float(np.abs(S[0] - (2 * pi * u + u * (u @ earth) * T)).max() + abs(angle - 2 * pi))


# --- rotation between the triads


def _between() -> Any:
    """Return C_p^q of (43) at generic angles."""
    return numbers(frames.product(), dict(zip(frames.ANGLES, BETWEEN, strict=True)))


BETWEEN = np.array([0.02, -0.015, 0.03])  # rad
TURNS = [((1.0, 0.0, 0.0), 1.2), ((0.0, 1.0, 0.0), -1.7), ((0.6, 0.0, 0.8), 0.9), ((0.0, 0.6, -0.8), 2.1)]


@checks(SOURCE, "Eq. (43)", where="estimate.gyroscopes.revolutions.from_turns", tolerance=1e-9)
def between_triads() -> float:
    """The three angles from gravity before and after four turns, in p, and the turns in q."""
    from gimbalcal.estimate.gyroscopes import revolutions

    C, down = _between(), np.array([0.36, -0.48, 0.8])
    before, after, turns = [], [], []
    for axis, angle in TURNS:
        R = rotation(np.array(axis), angle).T  # of the unit, as its gyroscopes see it, components in q
        before.append(down)
        down = C.T @ R @ C @ down
        after.append(down)
        turns.append(R)
    found = revolutions.from_turns(np.array(before), np.array(after), np.array(turns), 1.0)
    return float(np.abs(found.angles - BETWEEN).max())


@checks(SOURCE, "Eq. (43)", where="estimate.gyroscopes.revolutions._turn_relative_to_earth", tolerance=1e-6)
def turn_relative_to_earth() -> float:
    """A turn whose rates hold the Earth's: the rotation of the Earth's axes in the unit."""
    from gimbalcal.estimate.gyroscopes.revolutions import _turn_relative_to_earth

    u, earth = np.array([0.6, 0.0, 0.8]), EARTH * np.array([0.3, -0.5, 0.8])
    t = np.linspace(0.0, 4.0, 801)
    phase = 1.3 * (t / 4 - np.sin(2 * pi * t / 4) / (2 * pi))
    speed = 1.3 / 4 * (1 - np.cos(2 * pi * t / 4))
    C = [rotation(u, a).T for a in phase]
    rate = np.array([w * u + c @ earth for w, c in zip(speed, C, strict=True)])
    return float(np.abs(_turn_relative_to_earth(t, rate, slice(None), earth) - C[-1]).max())


@checks(SOURCE, "Eq. (43)", where="estimate.gyroscopes.revolutions.in_accelerometer_frame", tolerance=1e-9)
def referred() -> float:
    """What gyroscopes referred to the accelerometers' frame read, against M C_p^q of the rate."""
    from gimbalcal.calibration import Calibration, Residual
    from gimbalcal.effects import with_values
    from gimbalcal.estimate.gyroscopes import revolutions
    from gimbalcal.estimate.gyroscopes.revolutions import triangular_parameters as own
    from gimbalcal.forward import gyroscopes as read

    wanted = own()
    x = np.array([{"gyro_scale_factor": 2e-3, "gyro_misalignment": 1e-3}.get(p.effect, 0.0) for p in wanted])
    made = Calibration("revolutions", with_values((), wanted, x), wanted, np.eye(len(x)), (), Residual(1.0, 1, {}))
    lie = revolutions.InterTriad(BETWEEN, np.eye(3), 0.0)
    moved = revolutions.in_accelerometer_frame(made, lie)
    s = stimulus(np.zeros((1, 3)), (9.8, 0.6))
    ours = read(RATE, s, moved.effects)
    direct = read(RATE @ _between().T, s, made.effects)
    return float(np.abs(ours - direct).max())


# --- what is solved for, and how


@checks(SOURCE, "Eq. (37)", where="estimate.pulses.gravity_norm._free_ordinals")
def solved_for_by_gravity() -> float:
    """How many of the parameters of (37) the fit does not solve for, and how many it does besides."""
    from gimbalcal.estimate.pulses.gravity_norm import _free_ordinals

    ours = {PARAMETERS[i] for i in _free_ordinals(3)}
    return float(len(ours ^ set(optimisation.cases()["Eq. (37)"].derived)))


@checks(SOURCE, "Eq. (38)", "Eq. (39)", where="estimate.pulses.whole_turns.FREE_ORDINALS")
def solved_for_by_turns() -> float:
    """The same of (38) and (39) together, which the package solves at once."""
    from gimbalcal.estimate.pulses.whole_turns import FREE_ORDINALS

    derived = {s for item in ("Eq. (38)", "Eq. (39)") for s in optimisation.cases()[item].derived}
    return float(len({PARAMETERS[i] for i in FREE_ORDINALS} ^ derived))


@checks(SOURCE, "Eq. (1)", "Eq. (40)", where="inference.levenberg.minimise", tolerance=1e-10)
def minimum() -> float:
    """The minimum of a quadratic, and of Rosenbrock's valley, against where the gradient vanishes."""
    from gimbalcal.inference.levenberg import minimise

    A, y = np.array([[2.0, 1.0], [0.5, -1.0], [1.0, 3.0]]), np.array([1.0, -2.0, 0.5])
    plain = minimise(lambda x, _: ((A @ x[0] - y)[None], A[None]), np.zeros((1, 2))).x[0]

    def valley(x: Any, _: Any) -> tuple[Any, Any]:
        a, b = x[0]
        return np.array([[1 - a, 10 * (b - a**2)]]), np.array([[[-1.0, 0.0], [-20 * a, 10.0]]])

    bent = minimise(valley, np.array([[-1.2, 1.0]])).x[0]
    return float(max(np.abs(plain - np.linalg.solve(A.T @ A, A.T @ y)).max(), np.abs(bent - 1).max()))
