"""Huber's weights: honest sigmas at any tail, and no weight lost to what varies smoothly."""

import numpy as np
import pytest

from gimbalcal.inference.robust import huber_weights


@pytest.mark.parametrize("rows", [3, 8, 20])
@pytest.mark.parametrize("tails", [0.0, 3.0, 5.0])
def test_weighted_means_have_the_sigma_that_is_told(rows, tails):
    rng, pulls = np.random.default_rng(1), []
    for _ in range(10):
        y = rng.standard_t(tails, (1200 // rows * rows, 3)) if tails else rng.standard_normal((1200 // rows * rows, 3))
        d = np.diff(y, 2, axis=0) / np.sqrt(6)
        found = huber_weights(y, np.arange(len(y)) // rows, np.median(np.abs(d), axis=0) / 0.6745)
        w = found.weight.reshape(-1, rows, 3)
        mean = (w * y.reshape(w.shape)).sum(axis=1) / w.sum(axis=1)
        pulls.append(np.sqrt(rows) * mean / found.of_means)
    count = sum(p.size for p in pulls)
    # heavy tails make a mean's own tails heavier, and so its scatter: 4 sigma, and 3 % for asymptotic formulas
    assert np.mean(np.square(pulls)) == pytest.approx(1.0, abs=4 * np.sqrt(2 / count) + 0.03)


def test_single_rows_have_the_sigma_that_is_told():
    y = np.random.default_rng(2).standard_t(3.0, (6000, 2))
    found = huber_weights(y, np.arange(6000) // 15, np.ones(2))
    assert np.all(np.abs((found.weight * (y / found.of_rows) ** 2).mean(axis=0) - 1) < 0.05)


def test_a_curve_inside_a_group_costs_no_weight_and_an_outlier_its_own():
    t = np.tile(np.linspace(-1, 1, 20), 6)[:, None]
    curve = 40 * t**2 - 25 * t
    found = huber_weights(curve, np.arange(120) // 20, np.ones(1))
    np.testing.assert_allclose(found.weight, 1.0, rtol=1e-9)
    curve[50] += 100.0
    found = huber_weights(curve, np.arange(120) // 20, np.ones(1))
    assert found.weight[50] == pytest.approx(0.02, rel=0.1)  # 2 sigma of its 100
    assert np.all(np.delete(found.weight, 50) > 0.99)
