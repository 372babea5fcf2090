"""Least squares under coloured noise: banded algebra against dense matrices, and the noise that is found."""

import numpy as np
import pytest
from scipy.signal import lfilter

from gimbalcal.effects.process import GaussMarkov, RandomWalk, WhiteNoise, covariance
from gimbalcal.inference.coloured import estimate_noise, least_squares


def dense(time, weight, noise):
    """V from the covariances of the processes; a walk began one median step before the first row."""
    white, *slow = noise
    before = np.append(time[0] - np.median(np.diff(time)), time)
    V = np.diag(np.diag(covariance(white, time)) / weight)
    return np.asarray(V + sum(covariance(p, before)[1:, 1:] for p in slow))


@pytest.mark.parametrize(
    "noise",
    [
        (WhiteNoise(2.0),),
        (WhiteNoise(1.0), GaussMarkov(1.7, 50.0)),
        (WhiteNoise(0.5), RandomWalk(0.1)),
        (WhiteNoise(1.0), GaussMarkov(300.0, 300.0)),
        (WhiteNoise(3.0), GaussMarkov(4.0, 0.5)),
    ],
)
def test_banded_equals_dense_on_irregular_rows(noise):
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.2, 30.0, 60))
    weight = rng.uniform(0.5, 20.0, 60)
    A, y = rng.normal(size=(60, 4)) * [1, 1e-6, 1e3, 1], rng.normal(size=(60, 2))
    V = dense(time, weight, noise)
    W = np.linalg.inv(V)
    N = A.T @ W @ A
    beta = np.linalg.solve(N, A.T @ W @ y)
    fit = least_squares(time, A, y, weight, noise)
    np.testing.assert_allclose(fit.beta, beta, rtol=1e-8)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(N), rtol=1e-8)
    r = y - A @ beta
    np.testing.assert_allclose(fit.chi2, np.einsum("ij,ik,kj->j", r, W, r), rtol=1e-8)
    expected = np.linalg.slogdet(V)[1] + np.linalg.slogdet(N)[1]
    assert fit.log_determinant == pytest.approx(expected, rel=1e-9)


def simulate(rng, n, step, kind):
    white = rng.normal(size=n)
    if kind == "gauss-markov":
        phi = np.exp(-step / 3000.0)
        drive = rng.normal(size=n) * 2 * np.sqrt(1 - phi**2)
        drive[0] = rng.normal() * 2
        return np.asarray(white + lfilter([1], [1, -phi], drive))
    if kind == "random-walk":
        return np.asarray(white + np.cumsum(rng.normal(size=n) * 0.02 * np.sqrt(step)))
    return white


@pytest.mark.parametrize("kind", ["white", "gauss-markov", "random-walk"])
def test_the_noise_is_found_by_kind_and_size(kind):
    n, step = 2000, 60.0
    time = step * np.arange(n)
    A = np.stack([np.ones(n), np.sin(7.29e-5 * time), np.cos(7.29e-5 * time)], -1)
    found = [estimate_noise(time, A, simulate(np.random.default_rng(s), n, step, kind), np.ones(n)) for s in range(6)]
    slow = {"white": WhiteNoise, "gauss-markov": GaussMarkov, "random-walk": RandomWalk}[kind]
    # BIC picks the wrong kind with probability of order 1 / n; one of six may err
    right = [noise for noise in found if isinstance(noise[-1], slow)]
    assert len(right) >= 5
    assert np.mean([noise[0].sigma for noise in right]) == pytest.approx(1.0, abs=0.03)  # 1 / sqrt(2 n) = 0.016 for one
    if kind == "gauss-markov":
        # about 40 correlation times in a run: 10 % in sigma, 30 % in tau each
        assert np.mean([noise[1].sigma for noise in right]) == pytest.approx(2.0, rel=0.15)
        assert np.mean([noise[1].tau for noise in right]) == pytest.approx(3000.0, rel=0.35)
    if kind == "random-walk":
        assert np.mean([noise[1].N for noise in right]) == pytest.approx(0.02, rel=0.15)


def test_dependent_columns_and_unknown_kinds_are_refused():
    time, A = np.arange(20.0), np.ones((20, 2))
    with pytest.raises(np.linalg.LinAlgError, match="not independent"):
        least_squares(time, A, np.ones((20, 1)), np.ones(20), (WhiteNoise(1.0),))
    with pytest.raises(ValueError, match="`kind` must be one of white, gauss-markov, random-walk, auto, got 'pink'"):
        estimate_noise(time, A[:, :1], time, np.ones(20), "pink")
