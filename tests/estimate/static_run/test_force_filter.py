"""Eqs. (20)-(27): filter = information form = smoother start; what the squared norm does to noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from gimbalcal.estimate.static_run.force_filter import (
    ForceInformation,
    ForceState,
    accumulate,
    estimate,
    observation_matrix,
    projection,
)
from gimbalcal.number import Array
from tests.estimate.static_run import sample_by_sample
from tests.stimuli import G, static

X = np.array([1.1e-4, -8.6e-5, 8.2e-5, -5e-5, 1.2e-5])
SIGMA = 5e-3 / G


def rows(hours: float, step: float, seed: int = 1) -> tuple[Array, Array, Array]:
    H = observation_matrix(static(hours, step).force / G)
    variance = SIGMA**2 * np.random.default_rng(seed + 100).uniform(0.2, 5.0, len(H))
    z = H @ X + np.random.default_rng(seed).normal(size=len(H)) * np.sqrt(variance)
    return z, H, variance


def worst(a: ForceState, x: Array, P: Array) -> float:
    """Largest difference in units of sigma."""
    return float(np.abs((a.x - x) / a.sigma).max() + np.abs((a.P - P) / np.outer(a.sigma, a.sigma)).max())


@pytest.mark.parametrize(("hours", "step"), [(24.0, 60.0), (7.3, 20.0), (60.0, 300.0)])
def test_filter_equals_information_form(hours: float, step: float) -> None:
    z, H, variance = rows(hours, step)
    batch = estimate(accumulate(z, H, variance))
    sequential = sample_by_sample.kalman(z, H, variance)
    assert worst(batch, sequential.x, sequential.P) < 1e-9  # in units of sigma; rounding accumulates to 1e-11
    assert batch.chi2 == pytest.approx(sequential.chi2, rel=1e-9)


@pytest.mark.parametrize("sigma", [5e-4, 6.6e-6, 1e-7])
def test_filter_and_information_form_stay_equal_however_small_the_noise(sigma: float) -> None:
    H = observation_matrix(static(48.0, 900.0).force / G)
    z = H @ X + np.random.default_rng(9).normal(size=len(H)) * sigma
    a, b = estimate(accumulate(z, H, sigma**2)), sample_by_sample.kalman(z, H, sigma**2)
    assert worst(a, b.x, b.P) < 1e-9


def test_pieces_in_any_order_and_missing_rows_are_the_same_estimate() -> None:
    z, H, variance = rows(30.0, 60.0)
    whole = estimate(accumulate(z, H, variance))
    parts = [accumulate(z[i::7], H[i::7], variance[i::7]) for i in (3, 0, 6, 1, 5, 2, 4)]
    pieced = estimate(ForceInformation(*(sum(terms) for terms in zip(*parts, strict=True))))
    assert worst(whole, pieced.x, pieced.P) < 1e-9
    keep = np.arange(len(z)) % 3 > 0
    gappy = sample_by_sample.kalman(np.where(keep, z, np.nan), H, variance)
    dropped = estimate(accumulate(z[keep], H[keep], variance[keep]))
    assert worst(dropped, gappy.x, gappy.P) < 1e-9
    assert gappy.rows == dropped.rows == keep.sum()


def test_estimates_are_as_uncertain_as_claimed() -> None:
    runs, nees, misfit, dof = 200, 0.0, 0.0, 0
    for seed in range(runs):
        z, H, variance = rows(31.0, 600.0, seed)
        s = estimate(accumulate(z, H, variance))
        nees += (s.x - X) @ np.linalg.solve(s.P, s.x - X)
        misfit, dof = misfit + s.chi2, dof + len(z) - 5
    assert chi2.ppf(0.0005, runs * 5) < nees < chi2.ppf(0.9995, runs * 5)
    assert chi2.ppf(0.0005, dof) < misfit < chi2.ppf(0.9995, dof)


def test_squared_norm_makes_a_bias_of_noise_which_projection_does_not() -> None:
    direction = np.repeat(static(24.0, 60.0).force / G, 400, axis=0)
    noise = np.random.default_rng(3).normal(size=direction.shape) * 5e-3
    force = G * direction + noise
    mean = 1.5 * SIGMA**2  # 3.9e-7
    error = SIGMA / np.sqrt(len(force))  # of a mean: 6.7e-7 / sqrt(...): compare differences, where it cancels
    printed, debiased = sample_by_sample.squared_norm(force, G), sample_by_sample.squared_norm(force, G, 5e-3)
    linear = projection(noise, direction, G)
    # printed - linear = |n|^2 / 2 g^2, whose own scatter is sqrt(3/2) sigma^2 a row
    scatter = np.sqrt(1.5) * SIGMA**2 / np.sqrt(len(force))
    assert np.mean(printed - linear) == pytest.approx(mean, abs=4 * scatter)
    assert np.mean(debiased - linear) == pytest.approx(0.0, abs=4 * scatter)
    assert mean > 300 * scatter
    assert abs(np.mean(linear)) < 4 * error
    assert np.var(printed) / SIGMA**2 == pytest.approx(1 + 1.5 * SIGMA**2, rel=4 * np.sqrt(2 / len(force)))


def test_squared_norm_and_projection_agree_to_first_order() -> None:
    direction = static(48.0, 600.0).force / G
    departure = 1e-4 * G * np.random.default_rng(4).normal(size=direction.shape)
    difference = sample_by_sample.squared_norm(G * direction + departure, G) - projection(departure, direction, G)
    np.testing.assert_allclose(difference, (departure**2).sum(axis=1) / (2 * G**2), rtol=1e-6)
