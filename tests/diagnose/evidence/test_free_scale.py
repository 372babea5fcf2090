"""Evidence without a stated noise: against dense densities, numerical integrals and regression."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.stats import f as fisher
from scipy.stats import multivariate_normal

from gimbalcal.diagnose.evidence.free_scale import (
    MEMORY,
    MEMORY_PRIOR,
    SIZE_PRIOR,
    SIZES,
    Ground,
    best_evidence,
    clear,
    explained,
    first_order,
    ground,
    log_evidence,
)
from gimbalcal.effects.process import covariance
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.inference.noise import chain
from gimbalcal.number import Array


def example(size: float = 0.7, n: int = 30, C: int = 2) -> tuple[Array, Array, Array]:
    """Misfit (n, C), modelled columns (n, C, 3), candidates (n, C, 4), of which the first is in the misfit."""
    rng = np.random.default_rng(2)
    J, X = rng.standard_normal((n, C, 3)), rng.standard_normal((n, C, 4))
    return size * X[..., 0] + rng.standard_normal((n, C)), J, X


def stationary(n: int, C: int, rho: float) -> Array:
    """Covariance (n C, n C) of a first-order process of unit variance in each channel."""
    return np.kron(toeplitz(rho ** np.arange(n)), np.eye(C))


def dense(r: Array, J: Array, X: Array, rho: float, scale: float, size: float) -> float:
    """ln of the restricted likelihood: contrasts free of J, columns X with a normal prior of this size."""
    y, Z, W = r.ravel(), J.reshape(r.size, -1), X.reshape(r.size, -1)
    U, *_ = np.linalg.svd(Z)
    free = U[:, Z.shape[1] :]
    V = scale**2 * stationary(*r.shape, rho) + size**2 * W @ W.T
    return float(multivariate_normal(cov=free.T @ V @ free).logpdf(free.T @ y))


@pytest.mark.parametrize(("index", "memory"), [([0], 0), ([1, 2], 2), ([0, 3], 4)])
def test_evidence_is_the_mean_of_dense_densities_over_scales_and_sizes(index: list[int], memory: int) -> None:
    r, J, X = example()
    g = given_memory(ground(r, J, X), memory)
    with_it, without = [], []
    for scale in g.scale[g.scale > 0.2]:  # less has no weight: the misfit is five times that
        without.append(dense(r, J, X[..., :0], MEMORY[memory], scale, 0.0))
        for size, share in zip(SIZES, SIZE_PRIOR, strict=True):
            with_it.append(np.log(share) + dense(r, J, X[..., index], MEMORY[memory], scale, size))
    truth = float(logsumexp(np.array(with_it)) - logsumexp(np.array(without)))
    assert log_evidence(g, index) == pytest.approx(truth, abs=1e-4)


def test_a_memory_weighs_what_its_dense_density_says() -> None:
    """With nothing modelled the misfit is a normal vector: weights of all memories and scales are its densities."""
    r, _, X = example()
    g = ground(r, np.zeros((*r.shape, 0)), X)
    kept = g.scale > 0.6
    made = [
        np.log(p) + multivariate_normal(cov=scale**2 * stationary(*r.shape, rho)).logpdf(r.ravel())
        for rho, p in zip(MEMORY, MEMORY_PRIOR, strict=True)
        for scale in g.scale[kept]
    ]
    here = g.ln[:, kept].ravel()
    np.testing.assert_allclose(here - here[0], np.array(made) - made[0], atol=1e-8)


def test_memories_are_averaged_by_what_the_data_make_of_each() -> None:
    r, J, X = example()
    g = ground(r, J, X)
    each = np.array([log_evidence(given_memory(g, k), [0, 3]) for k in range(len(MEMORY))])
    weight = logsumexp(g.ln, axis=1)
    assert log_evidence(g, [0, 3]) == pytest.approx(float(logsumexp(each + weight) - logsumexp(weight)))
    assert sum(MEMORY_PRIOR) == pytest.approx(1.0)


def given_memory(g: Ground, k: int) -> Ground:
    """The same with one memory alone."""
    at = slice(k, k + 1)
    return Ground(g.cleared[at], g.scale, g.ln[at], g.gram[at], g.score[at])


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.96])
def test_memory_is_whitened_as_a_first_order_process(rho: float) -> None:
    """What is cleared has the chi^2 of generalised least squares under the Toeplitz covariance."""
    r, J, X = example()
    c = clear(r, J, X, rho, 1.0)
    V = stationary(*r.shape, rho)
    root = np.linalg.inv(np.linalg.cholesky(V))
    Z, y, W = root @ J.reshape(r.size, -1), root @ r.ravel(), root @ X.reshape(r.size, -1)
    P = np.eye(r.size) - Z @ np.linalg.pinv(Z)
    assert c.y @ c.y == pytest.approx(y @ P @ y)
    np.testing.assert_allclose(c.X.T @ c.X, W.T @ P @ W, atol=1e-8)
    np.testing.assert_allclose(c.X.T @ c.y, W.T @ P @ y, atol=1e-8)
    assert c.dof == r.size - 3


def test_columns_that_are_modelled_already_say_nothing() -> None:
    r, J, X = example()
    X[..., 1] = J[..., 0] - 2 * J[..., 2]
    g = ground(r, J, X)
    assert log_evidence(g, [1]) == pytest.approx(0.0, abs=1e-9)
    J[..., 1] = 3 * J[..., 0]  # a modelled column that is another one again takes no degree of freedom
    assert clear(r, J, X, 0.0, 1.0).dof == r.size - 2


def test_the_unit_of_the_misfit_does_not_matter() -> None:
    r, J, X = example()
    here, there = ground(r, J, X), ground(1e-6 * r, J, 1e-6 * X)
    assert log_evidence(there, [0]) == pytest.approx(log_evidence(here, [0]), abs=1e-9)
    assert there.best()[1] == pytest.approx(1e-6 * here.best()[1])


def test_what_columns_take_away_is_what_regression_says() -> None:
    r, J, X = example()
    g = ground(r, J, X, memory=False)
    Z, y, W = J.reshape(r.size, -1), r.ravel(), X[..., [0, 2]].reshape(r.size, -1)

    def left(A: Array) -> float:
        return float(np.sum((y - A @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2))

    assert explained(g, [0, 2]) == pytest.approx(left(Z) - left(np.concatenate([Z, W], axis=1)))
    both = ground(r, J, X)
    assert explained(both, [0, 2]) == pytest.approx(explained(both, [0, 2], both.best()[0]))
    assert explained(both, [0, 2], 0) == pytest.approx(explained(g, [0, 2]))


def test_the_best_size_is_the_largest_of_those_tried() -> None:
    r, J, X = example()
    g = ground(r, J, X)
    each = [log_evidence(g, [0], SIZES[k : k + 1], np.ones(1)) for k in range(len(SIZES))]
    assert best_evidence(g, [0]) == max(each)
    assert log_evidence(g, [0]) == pytest.approx(float(logsumexp(np.array(each) + np.log(SIZE_PRIOR))))


def test_the_scale_of_the_noise_is_found_where_it_is() -> None:
    rng = np.random.default_rng(3)
    n = 4000
    e = np.empty((n, 1))
    e[0] = rng.standard_normal()
    for k in range(1, n):
        e[k] = 0.8 * e[k - 1] + 0.6 * rng.standard_normal()
    g = ground(2.5 * e, np.ones((n, 1, 1)), e[:, :, None])
    k, scale = g.best()
    assert MEMORY[k] == 0.8
    assert scale == pytest.approx(2.5, rel=0.1)  # next value of the grid: 15 %


def test_claims_on_clean_misfits_are_rare() -> None:
    """20 to one in at most one of twenty, although scale and memory are taken from the same 40 numbers."""
    rng = np.random.default_rng(4)
    J = np.ones((40, 1, 1))
    ln = []
    for _ in range(300):
        X = rng.standard_normal((40, 1, 1))
        ln.append(log_evidence(ground(rng.standard_normal((40, 1)), J, X), [0]))
    assert np.mean(np.array(ln) > np.log(20)) < 0.05
    assert 0.2 < np.exp(ln).mean() < 2.0  # an e-value averages to one; its tail is heavy


def test_evidence_orders_causes_as_an_f_test_does() -> None:
    """One column each, of one size: the F statistic is all that the data say."""
    r, J, X = example(size=0.4)
    X = X / np.sqrt((X**2).sum(axis=(0, 1)))
    g = ground(r, J, X, memory=False)
    X_left = g.cleared[0].X
    g = ground(r, J, X / np.sqrt((X_left**2).sum(axis=0)), memory=False)
    taken = np.array([explained(g, [k]) for k in range(4)])
    rest = g.cleared[0].y @ g.cleared[0].y - taken
    p = fisher.sf(taken / (rest / (g.cleared[0].dof - 1)), 1, g.cleared[0].dof - 1)
    assert list(np.argsort(p)) == list(np.argsort([-log_evidence(g, [k]) for k in range(4)]))


@pytest.mark.parametrize("rho", [rho for rho in MEMORY if rho])
def test_memory_from_row_to_row_is_a_gauss_markov_process(rho: float) -> None:
    noise, n = first_order(rho), 12
    time = np.arange(float(n))
    V = covariance(noise, time)
    np.testing.assert_allclose(V, rho ** np.abs(time[:, None] - time), rtol=1e-10)
    L = chain(noise, time).whiten(np.eye(n))
    np.testing.assert_allclose(L @ V @ L.T, np.eye(n), atol=1e-10)
    assert chain(noise, time).log_determinant == pytest.approx((n - 1) * np.log(1 - rho**2), abs=1e-10)
