"""Damped least squares of many runs at once."""

import numpy as np

from gimbalcal.inference.levenberg import covariance_at_minimum, minimise

T = np.linspace(0.0, 2.0, 9)
TRUTH = np.array([[2.0, -1.0], [0.5, 0.3], [-3.0, -2.0]])


def decay(x, runs, y):
    """Misfit of a exp(b t) and its derivatives."""
    e = np.exp(x[:, 1:] * T)
    return x[:, :1] * e - y[runs], np.stack([e, x[:, :1] * T * e], axis=-1)


def test_runs_settle_each_at_its_own_minimum():
    y = TRUTH[:, :1] * np.exp(TRUTH[:, 1:] * T)
    found = minimise(lambda x, runs: decay(x, runs, y), np.tile([1.0, 0.0], (3, 1)))
    assert found.converged.all()
    np.testing.assert_allclose(found.x, TRUTH, rtol=1e-10)


def test_at_the_minimum_the_gradient_vanishes_and_a_gain_ends_earlier():
    rng = np.random.default_rng(1)
    y = TRUTH[:, :1] * np.exp(TRUTH[:, 1:] * T) + 0.1 * rng.standard_normal((3, 9))

    def model(x, runs):
        return decay(x, runs, y)

    found, early = (minimise(model, np.tile([1.0, 0.0], (3, 1)), gain=g) for g in (0.0, 1e-6))
    r, J = model(found.x, np.arange(3))
    np.testing.assert_allclose(np.einsum("rmp,rm->rp", J, r), 0, atol=1e-9)
    assert early.converged.all()
    assert np.all(early.steps <= found.steps)
    assert early.steps.sum() < found.steps.sum()
    sigma = np.sqrt(np.diagonal(covariance_at_minimum(found.jacobian), axis1=1, axis2=2))
    assert np.all(np.abs(early.x - found.x) < 1e-2 * sigma)


def test_a_step_that_is_refused_says_that_the_model_bends():
    """A start without damping is for models that are nearly linear: one refusal, not six, tells that this is not."""
    tried: list[float] = []

    def model(x, _):
        tried.append(float(x[0, 0]))
        return np.arctan(x) + 0 * x, 1 / (1 + x[..., None] ** 2)

    found = minimise(model, np.array([[3.0]]), damping=1e-9)
    assert abs(found.x[0, 0]) < 1e-10
    assert tried[1] < -3.0  # without damping the first step goes too far
    assert len(tried) < 16


def test_the_better_of_two_starts_is_kept_run_by_run():
    def model(x, _):
        return (x**2 - 1) + 0.1 * x, 2 * x[..., None] + 0.1  # roots of x^2 + 0.1 x - 1: both are exact minima

    def tilted(x, runs):
        r, J = model(x, runs)
        return np.concatenate([r, 0.1 * (x - 1)], axis=1), np.concatenate([J, np.full_like(J, 0.1)], axis=1)

    left, right = (minimise(tilted, np.array([[start]])) for start in (-2.0, 2.0))
    assert left.x[0, 0] < 0 < right.x[0, 0]
    assert left.better(right).x[0, 0] == right.better(left).x[0, 0] == right.x[0, 0]


def test_a_direction_that_nothing_tells_has_an_infinite_variance():
    C = covariance_at_minimum(np.array([[[1.0, 0.0], [1.0, 0.0], [2.0, 0.0]]]))
    assert np.isinf(C[0, 1, 1])
    assert abs(C[0, 0, 0] - 1 / 6) < 1e-15
