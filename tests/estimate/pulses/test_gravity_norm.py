"""Accelerometers in pulses: the batch against SciPy, the derivatives, the starts, and the statistics of many runs."""

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import least_squares

from gimbalcal.campaign.trials import POSITIONS, accelerometer_truth, accelerometers, generators, tipped_directions
from gimbalcal.earth import G0
from gimbalcal.estimate.pulses import gravity_norm as pulse_fit
from gimbalcal.estimate.pulses.gravity_norm import Pulses, accelerometer_pulses, initial_scale
from gimbalcal.inference.ellipsoid import ellipsoid

SIGMA = 7e-6  # m/s^2

_H = float(np.sqrt(0.5))
FACES = tuple(tuple(sign * float(v) for v in np.eye(3)[i]) for i in range(3) for sign in (1, -1))
EDGES = (
    (_H, _H, 0.0), (_H, -_H, 0.0), (-_H, _H, 0.0), (-_H, -_H, 0.0),
    (_H, 0.0, _H), (_H, 0.0, -_H), (-_H, 0.0, _H), (-_H, 0.0, -_H),
    (0.0, _H, _H), (0.0, _H, -_H), (0.0, -_H, _H), (0.0, -_H, -_H),
)  # fmt: skip


def counts(runs, noise, visits=1):
    truth = accelerometer_truth(generators(5, range(runs)))
    rng = np.random.default_rng(5)
    positions = np.tile(POSITIONS, (visits, 1))
    force = tipped_directions(positions, 0.05 * rng.standard_normal((runs, *positions.shape))) * G0
    return truth, truth.counts(force + noise * rng.standard_normal(force.shape))


def test_noiseless_counts_give_the_truth_whatever_the_tilt():
    truth, N = counts(40, 0.0)
    fit = accelerometer_pulses(N, G0, SIGMA)
    scale = np.abs(truth.vector()).max(0)
    # 1e-9: condition number 1e2 times rounding of counts inverted to 1e-15, cubed into the third-order term
    assert np.max(np.abs(fit.pulses.vector() - truth.vector()) / scale) < 1e-9
    assert fit.converged.all()


def test_derivatives_are_those_of_the_complex_step():
    rng = np.random.default_rng(0)
    x = np.r_[np.ones(3), 0.01 * rng.standard_normal(12)][None]
    u = rng.standard_normal((1, 20, 3))
    J = pulse_fit._residuals(x, u, 1e-6, np.arange(15))[1][0]
    for k, unit in enumerate(np.eye(15)):
        numeric = pulse_fit._residuals(x + 1e-30j * unit, u, 1e-6, np.arange(15))[0][0].imag / 1e-30
        np.testing.assert_allclose(J[:, k], numeric, rtol=1e-12, atol=1e-6)  # both exact; entries are of order 1e6


def test_batch_equals_scipy_least_squares():
    _, N = counts(4, SIGMA, visits=2)  # thirty positions: a real minimum, not a root
    together = accelerometer_pulses(N, G0, SIGMA)
    free = np.arange(15)
    K0 = initial_scale(N, G0)
    for run in range(4):
        u = (N[run] * K0[run] / G0)[None]

        def residuals(x, u=u):
            return np.asarray(pulse_fit._residuals(x[None], u, SIGMA / G0, free)[0][0])

        def jacobian(x, u=u):
            return np.asarray(pulse_fit._residuals(x[None], u, SIGMA / G0, free)[1][0])

        alone = least_squares(residuals, np.r_[np.ones(3), np.zeros(12)], jacobian, method="lm", xtol=1e-15, ftol=1e-15)
        unit = np.r_[K0[run], K0[run] ** 2 / G0, K0[run] ** 3 / G0**2, np.full(3, G0), np.ones(3)]
        # both stop within 1e-6 sigma of the one minimum
        difference = (alone.x * unit - together.pulses.vector()[run]) / together.sigma[run]
        assert np.max(np.abs(difference)) < 1e-5


def test_initial_scale_is_the_global_minimum_of_its_cost():
    truth, N = counts(30, 0.0)
    K0 = initial_scale(N, G0)
    n, k = N[0], K0[0]
    slope = ((((n * k) ** 2).sum(-1) - G0**2)[:, None] * n**2).sum(0) * k  # gradient of Eq. (41)
    assert np.max(np.abs(slope * k)) < 1e-9 * G0**4  # rounding of fifteen terms of g^4
    assert np.max(np.abs(K0 / truth.K1 - 1)) < 0.05  # the linear model leaves 5e-3 g of second and third order in


def test_ellipsoid_is_exact_for_a_linear_unit():
    rng = np.random.default_rng(2)
    truth = Pulses(rng.uniform(0.5, 2, (6, 3)), np.zeros((6, 3)), np.zeros((6, 3)), rng.uniform(-0.1, 0.1, (6, 3)),
                   rng.uniform(-0.1, 0.1, (6, 3)))  # fmt: skip
    v = rng.standard_normal((6, 20, 3))
    u = truth.counts(v / np.linalg.norm(v, axis=-1, keepdims=True))
    expected = np.concatenate([truth.K1, truth.bias, truth.E], axis=-1)
    np.testing.assert_allclose(ellipsoid(u), expected, atol=1e-11)  # a linear solve of condition 1e3


def test_points_on_no_ellipsoid_are_said_to_be_so():
    flat = np.zeros((1, 12, 3))
    flat[0, :, 0] = 1.0
    assert np.isnan(ellipsoid(flat)).all()


@pytest.mark.parametrize("tilt", [3 / 3600, 3 / 60, 3.0], ids=["3 arcsec", "3 arcmin", "3 deg"])
def test_error_is_at_the_bound_for_every_turntable(tilt):
    trials = accelerometers(3, range(200), np.deg2rad(tilt))
    ratio = np.sqrt((trials.error**2).mean(0) / (trials.fit.sigma**2).mean(0))
    # rms of 200 normal errors scatters by 1/sqrt(400) = 5 %, more where the scale factor spreads it: 4 sigma
    assert np.all(np.abs(ratio - 1) < 0.25)
    assert np.max(np.abs(trials.error / trials.fit.sigma)) < 6  # 3000 normal numbers: 1e-5 to exceed
    assert trials.fit.converged.all()


def test_nine_edges_can_leave_fifteen_parameters_undetermined():
    """92 of the 220 choices are singular, whatever the noise: the figure matters, not only the count of positions."""
    singular = 0
    for chosen in combinations(range(12), 9):
        u = np.array([*FACES, *(EDGES[i] for i in chosen)])
        J = pulse_fit._residuals(np.r_[np.ones(3), np.zeros(12)][None], u[None], 1.0, np.arange(15))[1][0]
        singular += np.linalg.matrix_rank(J, tol=1e-9) < 15
    assert singular == 92
