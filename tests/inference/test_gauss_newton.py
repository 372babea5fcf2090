"""Damped Gauss-Newton steps where rows leave a direction to its prior."""

from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from gimbalcal.effects import Parameter
from gimbalcal.inference.gauss_newton import gauss_newton
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE, Information, Solution, information
from gimbalcal.number import Array

AXES = ("x", "y", "z")
WANTED = tuple(Parameter("bias", "bias", "b", axis, k, "1", 1.0) for k, axis in enumerate(AXES))
FAR = 30.0  # prior sigmas that a fit of another model followed noise to


def _linearise(x: Array, seen: list[int]) -> Information:
    """Rows that determine x and y; z moves them by 0.2 of their noise for each sigma of its prior, and curves."""
    t = np.linspace(0, 1, 40)
    model = np.stack([50 * t * x[0], 80 * t**2 * x[1] + 0.03 * x[2] * np.cos(3 * t) + 0.001 * x[2] ** 2 * t], axis=1)
    J = np.zeros((40, 2, 3))
    J[:, 0, 0], J[:, 1, 1] = 50 * t, 80 * t**2
    J[:, 1, 2] = 0.03 * np.cos(3 * t) + 0.002 * x[2] * t
    y = np.stack([50 * t * 0.4, 80 * t**2 * -0.2 + 0.03 * FAR * np.cos(3 * t)], axis=1)
    seen.append(1)
    return information(J, (y - model + J @ x).ravel(), WANTED)


def test_what_rows_do_not_determine_returns_to_its_prior_at_once() -> None:
    """A direction that lies many prior sigmas off, where chi^2 is lower, does not halve every step of the others."""
    seen: list[int] = []

    def arrived(_: int, x: Array, solution: Solution) -> bool:
        return bool(np.all(np.abs(solution.x - x) <= 1e-3 * solution.sigma))

    start = np.array([0.4, -0.2, FAR])
    m = gauss_newton(lambda x: _linearise(x, seen), start, None, MIN_SIGNAL_TO_NOISE, True, arrived, lambda _: False)
    assert m.steps
    assert len(seen) <= 5
    np.testing.assert_allclose(m.solution.x[2], 0.0, atol=0.1)
    np.testing.assert_allclose(m.solution.x[0], 0.4, atol=1e-6)


def test_constants_within_bounds_never_raise_chi2() -> None:
    """Two constants that rows hardly distinguish reach the least squares within their bounds.

    Their step is far longer than the room they have. Each by itself at its nearer end, they would raise chi^2.
    """
    t = np.linspace(0, 1, 60)
    J = np.stack([40 * np.exp(-t), 40 * np.exp(-1.02 * t), t], axis=1)
    y = J @ np.array([3.0, -2.9, 0.2]) + 0.1 * np.cos(9 * t)
    bounds = np.array([[-1.0, -1.0, -np.inf], [1.0, 0.5, np.inf]])

    def arrived(_: int, x: Array, solution: Solution) -> bool:
        return bool(np.all(np.abs(solution.x - x) <= 1e-9))

    wide = tuple(replace(p, sigma=1e6) for p in WANTED)
    start = np.array([0.3, -0.1, 0.0])
    m = gauss_newton(lambda _: information(J, y, wide), start, bounds, 1e-9, True, arrived, lambda _: False)
    expected = lsq_linear(J, y, bounds=(bounds[0], bounds[1]), tol=1e-14).x
    assert m.steps
    np.testing.assert_allclose(m.solution.x, expected, atol=1e-6)


def test_a_step_beyond_the_range_of_the_model_is_shortened() -> None:
    """The root of a length that may not be negative: the first step leads there."""
    t = np.linspace(0.5, 1.5, 30)

    def linearise(x: Array) -> Information:
        model = np.sqrt(x[0] * t)
        J = np.stack([t / (2 * model), 0 * t, 0 * t], axis=1)
        return information(J, np.sqrt(0.04 * t) - model + J @ x, tuple(replace(p, sigma=1e3) for p in WANTED))

    def arrived(_: int, x: Array, solution: Solution) -> bool:
        return bool(np.all(np.abs(solution.x - x) <= 1e-9))

    start = np.array([4.0, 0.0, 0.0])
    m = gauss_newton(linearise, start, None, 1e-9, True, arrived, lambda _: False)
    assert m.steps
    np.testing.assert_allclose(m.solution.x[0], 0.04, rtol=1e-6)


def test_an_iteration_that_gains_next_to_nothing_ends_without_having_converged() -> None:
    """Rows that turn much faster than their derivative says, and leave a misfit that no parameter explains."""
    t, seen = np.linspace(0.5, 1.5, 30), list[int]()

    def linearise(x: Array) -> Information:
        seen.append(1)
        model, J = np.append(t * x[0], 0.0), np.zeros((31, 3))
        J[:30, 0] = t / 150
        return information(J, np.append(t * 5.0, 1e3) - model + J @ x, tuple(replace(p, sigma=1e6) for p in WANTED))

    def arrived(_: int, x: Array, solution: Solution) -> bool:
        return bool(np.all(np.abs(solution.x - x) <= 1e-9))

    m = gauss_newton(linearise, np.zeros(3), None, 1e-9, True, arrived, lambda _: False)
    assert not m.steps
    assert 0 < m.x[0] <= 10.0
    assert len(seen) < 40
