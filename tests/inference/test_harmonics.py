"""Harmonic fits: unbiased with gaps, irregular rows and part periods; as uncertain as they claim."""

import numpy as np
import pytest
from scipy.stats import chi2

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects.process import WhiteNoise
from gimbalcal.inference.harmonics import columns, fourier, labels
from tests.golden import refused
from tests.inference.test_coloured import simulate

TRUTH = np.array([0.3, -1.2, 0.8, 0.05, -0.4])  # mean, 1s, 1c, 2s, 2c


def grid(hours, step=60.0, phase=1.1):
    time = np.arange(0.0, 3600 * hours, step)
    return time, phase + EARTH_RATE * time


@pytest.mark.parametrize("hours", [11.0, 24.0, 30.7, 48.0, 72.0])
@pytest.mark.parametrize("drift", [0, 1, 2])
def test_exact_on_noise_free_rows_with_gaps_drift_and_part_periods(hours, drift):
    rng = np.random.default_rng(1)
    time, angle = grid(hours)
    keep = np.sort(rng.permutation(len(time))[: len(time) * 2 // 3])
    keep = keep[(keep < 100) | (keep > 250)]
    y = columns(angle, (0, 1, 2)) @ TRUTH
    y += sum(0.7 / j * ((time - time[keep][[0, -1]].mean()) / 1e5) ** j for j in range(1, drift + 1))
    found = fourier(time[keep], angle[keep], y[keep], drift=drift, noise="white")
    # 11 h with a parabola has condition 1e3; its square times rounding is 1e-10. A square also shifts the mean.
    np.testing.assert_allclose(found.value[1:], TRUTH[1:], atol=1e-9)
    assert found.labels == ("0", "1s", "1c", "2s", "2c") == labels((0, 1, 2))
    np.testing.assert_allclose(found.at(angle[:3]), columns(angle[:3], (0, 1, 2)) @ found.value)


def test_not_finite_rows_are_gaps():
    time, angle = grid(30)
    y = columns(angle, (0, 1, 2)) @ TRUTH
    y[200:400] = np.nan
    np.testing.assert_allclose(fourier(time, angle, y, noise="white").value, TRUTH, atol=1e-10)


@pytest.mark.parametrize("kind", ["white", "gauss-markov", "random-walk"])
def test_errors_are_as_large_as_claimed(kind):
    time, angle = grid(37.3, 120.0)
    time, angle = np.delete(time, slice(300, 420)), np.delete(angle, slice(300, 420))
    clean = columns(angle, (0, 1, 2)) @ TRUTH
    runs, nees, z = 60, 0.0, []
    for seed in range(runs):
        noise = np.delete(simulate(np.random.default_rng(seed), 1119, 120.0, kind), slice(300, 420))
        h = fourier(time, angle, clean + noise[: len(time)], noise=kind)
        e = (h.value - TRUTH)[1:]  # a walk has no mean level but where it starts
        nees += e @ np.linalg.solve(h.covariance[1:, 1:], e)
        z.append(e / h.sigma[1:])
    # 99.9 % bounds; an estimated (rho, tau) adds a few per cent, taken as a tenth of dof
    assert chi2.ppf(0.0005, runs * 4) * 0.9 < nees < chi2.ppf(0.9995, runs * 4) * 1.1
    assert np.abs(np.mean(z, axis=0)).max() < 4 / np.sqrt(runs)  # unbiased at 4 sigma of the mean


def test_white_weights_would_claim_too_much_under_coloured_noise():
    time, angle = grid(48.0, 120.0)
    y = simulate(np.random.default_rng(3), len(time), 120.0, "gauss-markov")
    assert fourier(time, angle, y, noise="white").sigma[1] < 0.4 * fourier(time, angle, y).sigma[1]


def test_known_sigma_and_weights_give_the_textbook_covariance():
    time, angle = grid(48.0)
    y = np.random.default_rng(4).normal(size=len(time)) * 0.1
    h = fourier(time, angle, y, weight=np.full(len(time), 25.0), drift=0, noise=(WhiteNoise(0.5),))
    A = columns(angle, (0, 1, 2))
    np.testing.assert_allclose(h.covariance, 0.5**2 / 25 * np.linalg.inv(A.T @ A), rtol=1e-9)
    assert chi2.ppf(0.0005, h.dof) < h.chi2 < chi2.ppf(0.9995, h.dof)


def test_mean_of_whole_days_and_an_fft_bin_are_biased_where_the_fit_is_not():
    time, angle = grid(24.0)  # a solar day: 3 min 56 s longer than a sidereal one
    y = columns(angle, (0, 1, 2)) @ TRUTH
    bin_ = 2 * np.mean(y * np.exp(-2j * np.pi * time / 86400.0))
    exact = (TRUTH[2] - 1j * TRUTH[1]) * np.exp(1j * angle[0])
    assert abs(bin_ - exact) > 5e-3  # the price of the bin, as a share of amplitudes of order 1
    h = fourier(time, angle, y, drift=0, noise="white")
    assert abs((h["1c"] - 1j * h["1s"]) - (TRUTH[2] - 1j * TRUTH[1])) < 1e-12


def test_too_short_a_run_is_told():
    time, angle = grid(0.5, 1.0)
    with refused():
        fourier(time, angle, np.random.default_rng(5).normal(size=len(time)), noise="white")
    with refused():
        fourier(time[:5], angle[:5], time[:5])
