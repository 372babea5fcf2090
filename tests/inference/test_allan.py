"""Allan variance against closed forms, and its coefficients against noise of known size."""

import numpy as np
import pytest

from gimbalcal.inference.allan import allan_curve, allan_law, covariance, fit


def noise(n, step, N, B, K, rng):
    """Readings (n,) of white noise N, bias instability B and random walk K, made in frequency and time."""
    size = 1 << int(np.ceil(np.log2(4 * n)))
    angle = 2 * np.pi * np.arange(size // 2 + 1) / size
    angle[0] = angle[1]
    flicker = np.fft.irfft(np.fft.rfft(rng.standard_normal(size)) * B / np.sqrt(angle), size)[:n]
    walk = np.cumsum(K * np.sqrt(step) * rng.standard_normal(n))
    return N / np.sqrt(step) * rng.standard_normal(n) + flicker + walk


def test_the_variance_is_that_of_the_definition():
    x = np.random.default_rng(1).standard_normal(40)
    c = allan_curve(x, [slice(0, 40)], 0.5)
    for m, found in zip((1, 2, 4, 8), c.variance, strict=True):
        means = np.array([x[k : k + m].mean() for k in range(40 - m + 1)])
        assert found == pytest.approx(0.5 * np.mean((means[m:] - means[:-m]) ** 2), rel=1e-12)
    assert c.tau.tolist() == [0.5, 1.0, 2.0, 4.0]


def test_stretches_are_pooled_and_never_differenced_across():
    x = np.concatenate([np.random.default_rng(2).standard_normal(64), 1e6 + np.zeros(64)])
    both, one = allan_curve(x, [slice(0, 64), slice(64, 128)], 1.0), allan_curve(x, [slice(0, 64)], 1.0)
    assert both.variance == pytest.approx(one.variance / 2)


@pytest.mark.parametrize("square", [(1.0, 0.0, 0.0), (1.0, 0.1, 0.0), (1.0, 0.0, 1e-4)])
def test_covariance_is_that_of_many_draws(square):
    rng, n = np.random.default_rng(3), 512
    draws = np.array([
        allan_curve(noise(n, 1.0, *np.sqrt(square), rng), [slice(0, n)], 1.0).variance for _ in range(1500)
    ])  # fmt: skip
    c = allan_curve(np.ones(n) * np.arange(n), [slice(0, n)], 1.0)
    C = covariance(c, np.array(square))
    assert np.sqrt(np.diag(C)) == pytest.approx(draws.std(axis=0), rel=0.15)
    assert C[1, 2] / np.sqrt(C[1, 1] * C[2, 2]) == pytest.approx(np.corrcoef(draws[:, 1:3].T)[0, 1], abs=0.1)


def test_coefficients_are_found_with_their_sigmas():
    truth = np.array([1.0, 0.09, 0.0])
    c = allan_curve(noise(20_000, 0.1, 1, 0.3, 0, np.random.default_rng(4)), [slice(0, 20_000)], 0.1)
    f = fit(c)
    assert f.first == 0
    assert f.p_value > 1e-3
    assert np.all(np.abs(f.square - truth)[:2] < 4 * np.sqrt(np.diag(f.covariance))[:2])
    assert np.sqrt(f.covariance[0, 0]) < 0.03
    assert f.square[2] == 0
    assert 0 < f.most[2] * c.tau[-1] / 3 < 4 * 0.44 * 0.09  # no more at the longest time than shows beside the floor


def test_a_filter_before_the_logger_hides_short_times_only():
    white = np.random.default_rng(5).standard_normal(40_000)
    filtered = np.convolve(white, np.ones(6) / 6, mode="valid")
    f = fit(allan_curve(filtered, [slice(0, len(filtered))], 1.0))
    assert f.first >= 3
    assert np.sqrt(f.square[0]) == pytest.approx(1.0, abs=0.05)


def test_noise_that_is_correlated_over_decades_is_no_filter():
    """Short tau that go on rising are another noise: no part of the curve is missed by a factor of three."""
    from scipy.signal import lfilter

    rng, n, step = np.random.default_rng(6), 200_000, 0.01
    x = 0.3 / np.sqrt(step) * rng.standard_normal(n) + noise(n, step, 0, 0.3, 0, rng)
    for tau in (0.05, 0.5, 5.0):
        rho = np.exp(-step / tau)
        x += lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.standard_normal(n))
    c = allan_curve(x, [slice(0, n)], step)
    f = fit(c)
    ratio = allan_law(c.tau) @ f.square / c.variance
    assert f.p_value < 1e-3
    assert 1 / 9 < ratio.min() < ratio.max() < 9


def test_white_noise_below_a_disturbance_is_not_behind_a_filter():
    """What sags for some seconds now and then adds at long tau; the white noise is what the short ones show."""
    rng, n, step = np.random.default_rng(8), 36_000, 0.01
    x = rng.standard_normal(n) / np.sqrt(step)
    sag = np.exp(-0.5 * ((np.arange(1200) - 600) * step / 1.5) ** 2)
    for start in range(1000, n - 1200, 6000):
        x[start : start + 1200] -= 25 * sag
    c = allan_curve(x, [slice(0, n)], step)
    f = fit(c)
    assert f.first == 0
    assert f.p_value < 1e-3
    assert np.sqrt(f.square[0]) == pytest.approx(1.0, abs=0.2)


def test_the_law_has_the_floor_of_a_flicker():
    assert np.sqrt(allan_law(np.array([7.0]))[0, 1]) == pytest.approx(0.664, abs=5e-4)
