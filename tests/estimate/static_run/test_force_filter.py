"""Eqs. (20)-(27): filter = information form = smoother start; what the squared norm does to noise."""

import numpy as np
import pytest
from scipy.stats import chi2

from gimbalcal.estimate.static_run.force_filter import (
    NAMES,
    convergence_history,
    estimate_state,
    kalman,
    minute_means,
    observation_matrix,
    projection,
    squared_norm,
)
from tests.stimuli import G, static

X = np.array([1.1e-4, -8.6e-5, 8.2e-5, -5e-5, 1.2e-5])
SIGMA = 5e-3 / G


def rows(hours, step, seed=1):
    H = observation_matrix(static(hours, step).force / G)
    variance = SIGMA**2 * np.random.default_rng(seed + 100).uniform(0.2, 5.0, len(H))
    z = H @ X + np.random.default_rng(seed).normal(size=len(H)) * np.sqrt(variance)
    return z, H, variance


def worst(a, x, P):
    """Largest difference in units of sigma."""
    return float(np.abs((a.x - x) / a.sigma).max() + np.abs((a.P - P) / np.outer(a.sigma, a.sigma)).max())


@pytest.mark.parametrize(("hours", "step"), [(24.0, 60.0), (7.3, 20.0), (60.0, 300.0)])
def test_filter_equals_information_form(hours, step):
    z, H, variance = rows(hours, step)
    batch = estimate_state(z, H, variance)
    sequential = kalman(z, H, variance)[0]
    assert worst(batch, sequential.x, sequential.P) < 1e-9  # in units of sigma; rounding accumulates to 1e-11
    assert batch.chi2 == pytest.approx(sequential.chi2, rel=1e-9)


@pytest.mark.parametrize("sigma", [5e-4, 6.6e-6, 1e-7])
def test_filter_and_information_form_stay_equal_however_small_the_noise(sigma):
    H = observation_matrix(static(48.0, 900.0).force / G)
    z = H @ X + np.random.default_rng(9).normal(size=len(H)) * sigma
    a, b = estimate_state(z, H, sigma**2), kalman(z, H, sigma**2)[0]
    assert worst(a, b.x, b.P) < 1e-9


def test_rows_in_any_order_and_missing_rows_are_the_same_estimate():
    z, H, variance = rows(30.0, 60.0)
    whole = estimate_state(z, H, variance)
    order = np.concatenate([np.arange(i, len(z), 7) for i in (3, 0, 6, 1, 5, 2, 4)])
    shuffled = estimate_state(z[order], H[order], variance[order])
    assert worst(whole, shuffled.x, shuffled.P) < 1e-9
    keep = np.arange(len(z)) % 3 > 0
    gappy = kalman(np.where(keep, z, np.nan), H, variance)[0]
    dropped = estimate_state(z[keep], H[keep], variance[keep])
    assert worst(dropped, gappy.x, gappy.P) < 1e-9
    assert gappy.rows == dropped.rows == keep.sum()


def test_estimates_are_as_uncertain_as_claimed():
    runs, nees, misfit, dof = 200, 0.0, 0.0, 0
    for seed in range(runs):
        z, H, variance = rows(31.0, 600.0, seed)
        s = estimate_state(z, H, variance)
        nees += (s.x - X) @ np.linalg.solve(s.P, s.x - X)
        misfit, dof = misfit + s.chi2, dof + len(z) - 5
    assert chi2.ppf(0.0005, runs * 5) < nees < chi2.ppf(0.9995, runs * 5)
    assert chi2.ppf(0.0005, dof) < misfit < chi2.ppf(0.9995, dof)


def test_squared_norm_makes_a_bias_of_noise_which_projection_does_not():
    direction = np.repeat(static(24.0, 60.0).force / G, 400, axis=0)
    noise = np.random.default_rng(3).normal(size=direction.shape) * 5e-3
    force = G * direction + noise
    mean = 1.5 * SIGMA**2  # 3.9e-7
    error = SIGMA / np.sqrt(len(force))  # of a mean: 6.7e-7 / sqrt(...): compare differences, where it cancels
    printed, debiased = squared_norm(force, G), squared_norm(force, G, 5e-3)
    linear = projection(noise, direction, G)
    # printed - linear = |n|^2 / 2 g^2, whose own scatter is sqrt(3/2) sigma^2 a row
    scatter = np.sqrt(1.5) * SIGMA**2 / np.sqrt(len(force))
    assert np.mean(printed - linear) == pytest.approx(mean, abs=4 * scatter)
    assert np.mean(debiased - linear) == pytest.approx(0.0, abs=4 * scatter)
    assert mean > 300 * scatter
    assert abs(np.mean(linear)) < 4 * error
    assert np.var(printed) / SIGMA**2 == pytest.approx(1 + 1.5 * SIGMA**2, rel=4 * np.sqrt(2 / len(force)))


def test_squared_norm_and_projection_agree_to_first_order():
    direction = static(48.0, 600.0).force / G
    departure = 1e-4 * G * np.random.default_rng(4).normal(size=direction.shape)
    difference = squared_norm(G * direction + departure, G) - projection(departure, direction, G)
    np.testing.assert_allclose(difference, (departure**2).sum(axis=1) / (2 * G**2), rtol=1e-6)


def departures(x, u, noise):
    """Forces (n, 3) less ideal ones whose projection is H x: x1 along the force, the others across it, and noise."""
    return (observation_matrix(u) @ x)[:, None] * u * G + noise


def test_the_filter_of_a_run_converges_to_the_closed_form():
    """As the figures of the paper: bands that shrink, around states that end within them of the truth."""
    u = static(48.0, 15.0).force / G  # four rows a minute
    time, sigma = 15.0 * np.arange(len(u)), np.full((len(u), 3), 2e-4)
    noise = np.random.default_rng(12).normal(size=u.shape) * sigma
    stage = convergence_history(time, departures(X, u, noise), u, sigma, G)
    closed = estimate_state(projection(departures(X, u, noise), u, G), observation_matrix(u), (2e-4 / G) ** 2)
    assert stage.labels == NAMES
    assert np.abs((stage.values - closed.x) / closed.sigma).max() < 0.05
    np.testing.assert_allclose(stage.sigmas, closed.sigma, rtol=1e-3)
    assert np.abs((stage.values - X) / stage.sigmas).max() < 4
    assert "2880 means of 1 min" in stage.in_words
    assert stage.in_words.endswith("which the squares in Eq. (20) explain")
    h = stage.history
    np.testing.assert_array_equal(h.values[-1], stage.values)
    assert np.all(np.diff(h.sigmas, axis=0) <= 1e-12)
    a_day = int(np.searchsorted(h.time, 86164.0))
    assert np.all(h.sigmas[a_day] < 1.5 * stage.sigmas)  # one turn of the Earth separates all five, two halve P
    assert np.all(h.sigmas[a_day // 2] > 5 * stage.sigmas)  # half a turn does not
    inside = np.abs(h.values[a_day:] - X) < 3 * h.sigmas[a_day:]
    assert inside.mean() > 0.95
    assert stage.rms == pytest.approx(2e-4 / 2, rel=0.1)


def test_the_squares_of_eq_20_are_counted_and_a_disagreement_is_said(monkeypatch):
    u = static(24.0, 60.0).force / G
    time, sigma = 60.0 * np.arange(len(u)), np.full((len(u), 3), 1e-5)
    large = X * 10  # a scale factor of 1100 ppm: the squares of Eq. (20) are 6e-7, many sigma of so little noise
    departure = departures(large, u, np.random.default_rng(2).normal(size=u.shape) * sigma)
    stage = convergence_history(time, departure, u, sigma, G)
    difference = float(stage.in_words.split("at most ")[1].split(" of")[0])
    assert difference > 3
    assert stage.in_words.endswith("which the squares in Eq. (20) explain")
    monkeypatch.setattr(
        f"{convergence_history.__module__}.estimate_state", lambda *rows: estimate_state(*rows)._replace(x=2 * large)
    )
    assert "filter and closed form disagree" in convergence_history(time, departure, u, sigma, G).in_words


def test_the_mean_that_noise_gives_to_eq_20_is_taken_off():
    """Of so much noise in each row its square would be five sigmas of a state."""
    u = static(48.0, 15.0).force / G
    time, sigma = 1e5 + 15.0 * np.arange(len(u)), np.full((len(u), 3), 0.3)
    noise = np.random.default_rng(13).normal(size=u.shape) * sigma
    stage = convergence_history(time, departures(X, u, noise), u, sigma, G)
    assert np.abs((stage.values - X) / stage.sigmas).max() < 4
    assert 0 < stage.history.time[0] < 60  # from the first row on


def test_minute_means_keep_the_information_of_their_rows():
    z, H, variance = rows(10.0, 10.0)
    time, mean, mean_H, mean_variance = minute_means(10.0 * np.arange(len(z)), z, H, variance)
    assert len(mean) == 600
    np.testing.assert_allclose(np.diff(time), 60.0)
    a, b = (
        estimate_state(z, H, variance),
        estimate_state(mean, mean_H, mean_variance),
    )
    assert np.abs((a.x - b.x) / a.sigma).max() < 0.02
    np.testing.assert_allclose(a.sigma, b.sigma, rtol=1e-4)
