"""The package's strapdown navigator, its error growth and its filters against the mechanisation.

Nothing is derived here. The package navigates in north, east, down and counts errors true minus reference, positions in
metres; `mechanisation` in east, north, up, computed minus true, positions in radians. An error of attitude has the same
sign in both: C_true = exp([phi x]) C is C = (1 - [phi x]) C_true to first order.

Rates are the odd part of a step forward and one back, over the step: exact but for the cube of a step of 1 ms.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from derivations import mechanisation as nav
from derivations.comparison import once
from derivations.readings import TURN
from derivations.stimulus import attitude

STEP, SHORT, LONGER = 1e-3, 1e-8, 1e-2  # s; the second where nothing is taken from one, the last among the stars
LATITUDE, HEIGHT = 0.6, 300.0
VELOCITY = np.array([70.0, -40.0, 5.0])  # m/s, east, north, up
FORCE = np.array([0.4, -0.7, -9.6])  # m/s^2, body
# sizes of states that are alike in effect: rad, m/s, m
SCALE = np.repeat([1.0, 1e3, 6.4e6], 3)
UNIT = "navigate.strapdown.strapdown"
GROWTH = "navigate.error_growth.transitions"


# --- the mechanisation itself


def mechanised() -> float:
    """Return the attitude, velocity and position of a moving unit that does not turn in n: rates."""
    from gimbalcal.navigate.strapdown import strapdown

    at = np.array([*VELOCITY, LATITUDE, 1.1, HEIGHT])
    C_dot, v_dot, p_dot = nav.true_rates(at, attitude(), np.zeros(3), FORCE)
    ends = []
    for h in (STEP, -STEP):
        start = np.array([LATITUDE, 1.1, HEIGHT])
        end = strapdown(np.array([h]), np.zeros((1, 3)), FORCE[None], TURN @ attitude(), TURN @ VELOCITY, start)
        ends.append((TURN @ end.C_bn[1], TURN @ end.velocity[1], end.position[1]))
    rates = [(a - b) / (2 * STEP) for a, b in zip(*ends, strict=True)]
    R = SCALE[-1]
    difference = (rates[0] - C_dot, (rates[1] - v_dot) / SCALE[3], (rates[2] - p_dot) * [1, 1, 1 / R])
    return float(max(np.abs(a).max() for a in difference))


def mechanised_among_the_stars() -> float:
    """Return the same of the space-stable navigator: rates of the velocity over ground and of the place, without its
    aids.

    It tells velocity and place in the middle of a step, half of what the step adds; radii are those of the derivation.
    """
    from gimbalcal.navigate.space_stable_navigator import _run_loop

    at, phase = np.array([*VELOCITY, LATITUDE, 1.1, HEIGHT]), 0.4
    s, c, S, K = np.sin(LATITUDE), np.cos(LATITUDE), np.sin(phase), np.cos(phase)
    C = np.array([[-S, K, 0], [-s * K, -s * S, c], [c * K, c * S, s]])  # platform to east, north, up
    _, v_dot, p_dot = nav.true_rates(at, C, np.zeros(3), FORCE)
    R_N = nav.radii(LATITUDE)[1]
    r = np.array([(R_N + HEIGHT) * c * K, (R_N + HEIGHT) * c * S, (R_N * (1 - nav.E2) + HEIGHT) * s])
    v = C.T @ VELOCITY + nav.OMEGA * np.array([-r[1], r[0], 0])
    place = np.array([float(nav.gravity(LATITUDE, HEIGHT)), LATITUDE, 0.0, HEIGHT, 0.0])
    ends, still = [], np.zeros((1, 2))
    for h in (LONGER, -LONGER):
        out = np.empty((1, 5))
        _run_loop(np.array([h]), FORCE[None], r, v, place, 0.0, 0.0, 0.0, still, np.array([HEIGHT]), out)
        ends.append(out[0])
    rates = (ends[0] - ends[1]) / LONGER
    size = np.array([1, 1, SCALE[-1], SCALE[3], SCALE[3]])
    wanted = np.array([p_dot[0], p_dot[1] + nav.OMEGA, p_dot[2], v_dot[1], v_dot[0]])
    return float(np.abs((rates - wanted) / size).max())


# --- error growth at rest


def _to_package() -> Any:
    """Return (9, 9) errors of the derivation to those of the package."""
    R_M, R_N = nav.radii(LATITUDE)
    metres = np.diag([R_M + HEIGHT, (R_N + HEIGHT) * np.cos(LATITUDE), 1.0])
    S = np.zeros((9, 9))
    S[:3, :3], S[3:6, 3:6], S[6:, 6:] = TURN, -TURN, -np.diag([1.0, 1.0, -1.0]) @ metres
    return S


@cache
def derived_growth() -> Any:
    """Return (9, 15) F in the package's states, and what rate and force errors true minus reference in n (NED)
    drive.
    """
    at, force = [0, 0, 0, LATITUDE, 0, HEIGHT], TURN @ np.array([0, 0, -float(nav.gravity(LATITUDE, HEIGHT))])
    F, S = nav.linearised(at, force, held=False), _to_package()
    driven = -S @ F[:, 9:] @ np.kron(np.eye(2), TURN)
    return np.hstack([S @ F[:, :9] @ np.linalg.inv(S), driven])


def _over(h: float) -> Any:
    """Return the package's transitions over one interval."""
    from gimbalcal.navigate.error_growth import transitions

    g = float(nav.gravity(LATITUDE, HEIGHT))
    C = TURN @ attitude()
    D = np.vstack([np.hstack([np.zeros((3, 3)), np.eye(3)]), np.hstack([np.eye(3), np.zeros((3, 3))])])
    return transitions(
        np.array([0, 1]), np.array([False]), np.array([h]), np.zeros((1, 3)), (C.T @ np.array([0, 0, -g]))[None],
        D[None], np.array([[4.0] * 3 + [9.0] * 3]), C[None], LATITUDE, HEIGHT, g,
    )  # fmt: skip


@once
def _grown() -> tuple[Any, Any, Any]:
    """Return F (9, 9) of the package, its response (9, 6) to rate and force errors, noise (9, 9) over the square of a
    step.
    """
    F = (_over(STEP).Phi[0] - _over(-STEP).Phi[0]) / (2 * STEP)
    one, other = _over(SHORT), _over(-SHORT)
    return F, (one.Psi[0] - other.Psi[0]) / (2 * SHORT), (one.Q[0] + other.Q[0]) / 2 / SHORT**2


def growth(row: int, column: int) -> float:
    """Return a block (3, 3) of F at rest, states in sizes that are alike; row, column 1 to 3."""
    i, j = slice(3 * row - 3, 3 * row), slice(3 * column - 3, 3 * column)
    difference: Any = (_grown()[0] - derived_growth()[:, :9])[i, j]
    return float(np.abs(difference * SCALE[j] / SCALE[i, None]).max())


def ends_of_growth() -> float:
    """Return how far the reference goes in one interval with a force of its own: a h in velocity, a h^2/2 in place.

    The place is in metres north, east, down. The Coriolis force of 1 m/s leaves 1e-4 m/s after a second.
    """
    from gimbalcal.navigate.error_growth import transitions

    g, push = float(nav.gravity(LATITUDE, HEIGHT)), np.array([0.3, -0.5, 0.2])
    C, h = TURN @ attitude(), 1.0
    force = C.T @ (np.array([0, 0, -g]) + push)
    earth = C.T @ TURN @ nav.earth_in_n(np.float64(LATITUDE))
    end = transitions(
        np.array([0, 1]), np.array([False]), np.array([h]), (earth * h)[None], (force * h)[None], np.zeros((1, 6, 1)),
        np.zeros((1, 6)), C[None], LATITUDE, HEIGHT, g,
    )  # fmt: skip
    return float(max(np.abs(end.velocity[0] - push * h).max(), np.abs(end.displacement[0] - push * h**2 / 2).max()))


def all_growth() -> float:
    """Return all of F."""
    return max(growth(i, j) for i in (1, 2, 3) for j in (1, 2, 3))


def driven() -> float:
    """Return what errors of rate and force in the body make of attitude and velocity: plus and minus C."""
    wanted = derived_growth()[:6, 9:] @ np.kron(np.eye(2), TURN @ attitude())
    return float(np.abs(_grown()[1][:6] - wanted).max())


def noise() -> float:
    """Return noise of a step: variances 9 of the three rates and 4 of the three forces, through the same columns."""
    B = derived_growth()[:6, 9:] @ np.kron(np.eye(2), TURN @ attitude())
    wanted = B @ np.diag([9.0] * 3 + [4.0] * 3) @ B.T
    return float(np.abs(_grown()[2][:6, :6] - wanted).max() / 9)


# --- filter and smoother


@cache
def _example() -> dict[str, Any]:
    """Return three epochs, two moving states and one constant, generic."""
    rng = np.random.default_rng(5)
    K, m, p = 3, 2, 1
    Phi = np.eye(m) + 0.3 * rng.standard_normal((K, m, m))
    half = rng.standard_normal((K, m, m))
    return {
        "Phi": Phi, "Psi": rng.standard_normal((K, m, p)), "Q": half @ np.swapaxes(half, 1, 2) + 0.1 * np.eye(m),
        "z": rng.standard_normal((K, 1)), "R": np.full((K, 1), 0.5), "x": np.array([0.2, -0.3]),
        "theta": np.array([0.4]), "S": np.triu(rng.standard_normal((3, 3))) + 2 * np.eye(3),
    }  # fmt: skip


@cache
def joint_solution() -> tuple[Any, Any]:
    """Return means (K + 1, 3) and covariances (K + 1, 3, 3) of moving states and constant from all data at once."""
    e = _example()
    K = len(e["Phi"])
    size = 2 * (K + 1) + 1
    N, y = np.zeros((size, size)), np.zeros(size)

    def at(k: int) -> list[int]:
        return [2 * k, 2 * k + 1, size - 1]

    first = np.linalg.inv(e["S"] @ e["S"].T)
    N[np.ix_(at(0), at(0))] += first
    y[at(0)] += first @ np.concatenate([e["x"], e["theta"]])
    for k in range(K):
        A = np.zeros((2, size))
        A[:, at(k + 1)[:2]], A[:, at(k)[:2]], A[:, -1:] = np.eye(2), -e["Phi"][k], -e["Psi"][k]
        N += A.T @ np.linalg.inv(e["Q"][k]) @ A
        N[2 * k + 2, 2 * k + 2] += 1 / e["R"][k, 0]
        y[2 * k + 2] += e["z"][k, 0] / e["R"][k, 0]
    C = np.linalg.inv(N)
    x = C @ y
    return np.array([x[at(k)] for k in range(K + 1)]), np.array([C[np.ix_(at(k), at(k))] for k in range(K + 1)])


def _filtered() -> Any:
    """Return the example filtered, its covariance by square roots."""
    from gimbalcal.inference import square_root_filter

    e = _example()
    root = square_root_filter.roots(e["Q"])
    return square_root_filter.filter(
        e["Phi"], e["Psi"], root, np.zeros((3, 2)), e["z"], np.array([0]), e["R"], e["x"], e["theta"], e["S"]
    )


def square_root_filter() -> float:
    """Return the last epoch of the filter of a few states together with constants: mean and covariance."""
    f = _filtered()
    means, spreads = joint_solution()
    mean = np.concatenate([f.x[-1], f.theta[-1]])
    return float(max(np.abs(mean - means[-1]).max(), np.abs(f.factor @ f.factor.T - spreads[-1]).max()))


def adjoint_smoother() -> float:
    """Return the moving states at every epoch."""
    from gimbalcal.inference import adjoint

    e, f = _example(), _filtered()
    return float(np.abs(adjoint.smooth(e["Phi"], e["Psi"], np.array([0]), f) - joint_solution()[0][:, :2]).max())


def adjoint_covariance() -> float:
    """Return covariances of the moving states at every epoch, the constants treated separately."""
    from gimbalcal.inference import adjoint, square_root_filter

    e, observed = _example(), np.array([0])
    root, none = square_root_filter.roots(e["Q"]), np.zeros((3, 2, 0))
    known = square_root_filter.filter(
        e["Phi"], none, root, np.zeros((3, 2)), e["z"], observed, e["R"], e["x"], np.zeros(0), e["S"][:2, :2]
    )
    before = e["S"][:2, 2:] @ np.linalg.inv(e["S"][2:, 2:])
    covariance = adjoint.covariance(e["Phi"], e["Psi"], observed, known, before, _filtered().factor[2:, 2:])
    return float(np.abs(covariance - joint_solution()[1][:, :2, :2]).max())
