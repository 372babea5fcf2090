"""Evidence without a stated noise: against dense densities, numerical integrals and regression."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.stats import multivariate_normal

from gimbalcal.diagnose.evidence.correlated_noise import (
    MEMORY,
    MEMORY_PRIOR,
    SINGLE_WALKS,
    first_order,
    noises_of_unknown_scale,
    single_walks,
)
from gimbalcal.diagnose.evidence.node import SINGLE_WALK_PRIOR_AT_REST
from gimbalcal.diagnose.evidence.projection import any_size, condition_on, log_bayes, project, stacked_rows
from gimbalcal.diagnose.evidence.scale import _DENSITY, SIZES, STATED, Free
from gimbalcal.effects.process import covariance
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.inference.noise_processes import chain

n, C = 30, 2


def example(size=0.7):
    """Misfit (n C,), modelled columns (n C, 3), candidates (n C, 4), of which the first is in the misfit."""
    rng = np.random.default_rng(2)
    J, X = rng.standard_normal((n * C, 3)), rng.standard_normal((n * C, 4))
    return size * X[:, 0] + rng.standard_normal(n * C), J, X


def projections(r, J, X, sample=0.0):
    Q = np.linalg.qr(J)[0]
    rows = stacked_rows(Q, X, r[:, None], len(r), Free(len(r) - Q.shape[1], sample))
    return tuple(project(node, rows) for node in noises_of_unknown_scale(len(r) // C, C))


def stationary(rho):
    """Covariance (n C, n C) of a first-order process of unit variance in each channel."""
    return np.kron(toeplitz(rho ** np.arange(n)), np.eye(C))


def dense(r, J, W, rho, scale, size):
    """ln of the restricted likelihood: contrasts free of J, columns W with a normal prior of this size."""
    U, *_ = np.linalg.svd(J)
    free = U[:, J.shape[1] :]
    V = scale**2 * stationary(rho) + size**2 * W @ W.T
    return float(multivariate_normal(cov=free.T @ V @ free).logpdf(free.T @ r))


@pytest.mark.parametrize(("index", "memory"), [([0], 0), ([1, 2], 2), ([0, 3], 4)])
def test_evidence_is_the_mean_of_dense_densities_over_scales_and_sizes(index, memory):
    """Prior densities: of ln(size) a chain of straight lines between NEAR_SIZES, of ln(scale) flat."""
    r, J, X = example()
    p = projections(r, J, X)[memory]
    scales, sizes = np.geomspace(0.6, 6, 40), np.geomspace(2e-2, 300, 60)
    share = np.interp(np.log(sizes), *_DENSITY)
    share = share / share.sum()
    assert share[(sizes > 0.55) & (sizes < 1.8)].sum() == pytest.approx(0.25, abs=0.03)  # that of size one
    without = logsumexp(np.array([dense(r, J, X[:, :0], MEMORY[memory], s, 0.0) for s in scales]))
    each = [np.log(q) + dense(r, J, X[:, index], MEMORY[memory], s, size)
            for s in scales for size, q in zip(sizes, share, strict=True) if q > 0]  # fmt: skip
    truth = float(logsumexp(np.array(each)) - without)
    assert float(any_size(p, np.array(index))) == pytest.approx(truth, abs=0.06)


def test_a_memory_weighs_what_its_dense_density_says():
    """With nothing modelled the misfit is a normal vector: each memory weighs what its densities do over all scales."""
    r, _, X = example()
    rows = stacked_rows(np.zeros((len(r), 0)), X, r[:, None], len(r), Free(len(r)))
    found = np.array([np.log(node.prior) + project(node, rows).log_likelihood()[0]
                      for node in noises_of_unknown_scale(n, C)])  # fmt: skip
    made = [
        np.log(q) + logsumexp(np.array([multivariate_normal(cov=s**2 * stationary(rho)).logpdf(r)
                                        for s in np.geomspace(0.5, 40, 200)]))
        for rho, q in zip(MEMORY, MEMORY_PRIOR, strict=True)
    ]  # fmt: skip
    np.testing.assert_allclose(found - found[0], np.array(made) - made[0], atol=1e-6)
    assert sum(MEMORY_PRIOR) == pytest.approx(1.0)


def test_a_second_cause_given_the_first_is_the_pair():
    """Ratios of sizes to the noise, not sizes, are what is integrated over: conditioning is exact at any scale."""
    p = projections(*example())[2]
    one = np.array([3.0])
    both, first = log_bayes(p, np.array([0, 1]), one), log_bayes(p, np.array([0]), one)
    assert first + log_bayes(condition_on(p, np.array([0]), 3.0), np.array([1]), one) == pytest.approx(both)


def test_columns_that_are_modelled_already_say_nothing():
    r, J, X = example()
    X[:, 1] = J[:, 0] - 2 * J[:, 2]
    assert float(any_size(projections(r, J, X)[0], np.array([1]))) == pytest.approx(0.0, abs=0.02)


def test_what_columns_take_away_is_what_regression_says():
    r, J, X = example()
    p = projections(r, J, X)[0]

    def left(A):
        return float(np.sum((r - A @ np.linalg.lstsq(A, r, rcond=None)[0]) ** 2))

    assert p.explained([0, 2]) == pytest.approx(left(J) - left(np.concatenate([J, X[:, [0, 2]]], axis=1)))
    assert p.explained([2], [0]) == pytest.approx(p.explained([0, 2]) - p.explained([0]))
    assert float(p.scale.sigma(p.misfit[0])) == pytest.approx(np.sqrt(left(J) / (len(r) - 3)))


def test_the_scatter_of_the_samples_says_what_the_scale_seldom_is():
    """Less than the samples scatter by exp(-1) costs 1 / 0.3, more by e costs one."""
    free, told = Free(40), Free(40, 2.0)
    cost = [float(told.log_likelihood(40 * s**2) - free.log_likelihood(40 * s**2)) for s in (2 / np.e, 2.0, 2 * np.e)]
    assert cost == pytest.approx([-1 / 0.3, 0.0, -1.0])
    assert Free(40, 2.0, 0.5).log_likelihood(np.array(160.0)) < told.log_likelihood(np.array(160.0))  # half is new


def test_a_prior_of_sizes_is_whole_at_any_scale():
    for sigma in (0.01, 0.3, 1.0):
        left = np.full(len(Free.sizes), 50 * sigma**2)
        assert np.exp(Free(50).log_prior(left)).sum() == pytest.approx(1.0, abs=0.02)
    assert np.exp(STATED.log_prior(np.zeros(len(SIZES)))).sum() == pytest.approx(1.0)


def test_claims_on_clean_misfits_are_rare():
    """20 to one in at most one of twenty, although scale and memory are taken from the same 40 numbers."""
    rng = np.random.default_rng(4)
    ln = []
    for _ in range(300):
        rows = stacked_rows(
            np.full((40, 1), 40**-0.5), rng.standard_normal((40, 1)), rng.standard_normal((40, 1)), 40, Free(39)
        )
        made = [project(node, rows) for node in noises_of_unknown_scale(40, 1)]
        null = np.array([np.log(p.node.prior) + p.log_likelihood()[0] for p in made])
        each = np.array([float(any_size(p, np.array([0]))) for p in made])
        ln.append(float(logsumexp(null + each) - logsumexp(null)))
    assert np.mean(np.array(ln) > np.log(20)) < 0.05
    assert 0.2 < np.exp(ln).mean() < 2.0  # an e-value averages to one; its tail is heavy


@pytest.mark.parametrize("rho", [rho for rho in MEMORY if rho])
def test_memory_from_row_to_row_is_a_gauss_markov_process(rho):
    noise, m = first_order(rho), 12
    time = np.arange(float(m))
    V = covariance(noise, time)
    np.testing.assert_allclose(V, rho ** np.abs(time[:, None] - time), rtol=1e-10)
    L = chain(noise, time).whiten(np.eye(m))
    np.testing.assert_allclose(L @ V @ L.T, np.eye(m), atol=1e-10)
    assert chain(noise, time).log_determinant == pytest.approx((m - 1) * np.log(1 - rho**2), abs=1e-10)


def seen_by_turning():
    """How three sensors that wander show in the norm of 14 attitudes, and the noises of it."""
    H = np.random.default_rng(3).standard_normal((14, 1, 3))
    H /= np.linalg.norm(H, axis=2, keepdims=True)
    return H, noises_of_unknown_scale(14, 1, H)


def test_sensors_that_wander_show_in_a_norm_as_each_attitude_turns_them():
    """A bias that lasts changes sign with the attitude: the norm does not remember what its sensors do."""
    H, made = seen_by_turning()
    assert sum(node.prior for node in made) == pytest.approx(1.0)
    apart = np.abs(np.subtract.outer(np.arange(14), np.arange(14)))
    for node in made[len(MEMORY) :]:
        told = dict(node.name)
        a, rho = told["share"], told["memory"]
        V = (1 - a) * np.eye(14) + a * rho**apart * (H[:, 0] @ H[:, 0].T)
        L = node.whiten(np.eye(14))
        np.testing.assert_allclose(L @ V @ L.T, np.eye(14), atol=1e-9)
        np.testing.assert_allclose(node.colour(np.eye(14)) @ L, np.eye(14), atol=1e-9)
        assert node.logdet == pytest.approx(np.linalg.slogdet(V)[1])
        assert node.fresh == pytest.approx(1 - a * rho**2)


def test_each_group_of_rows_may_have_an_offset_of_its_own():
    """A table turns at the same rate in all rows of a stretch, and at another than commanded."""
    H, group = np.ones((7, 1, 1)), np.array([0, 0, 0, 1, 1, 2, 2])
    made = noises_of_unknown_scale(7, 1, H, group)[len(noises_of_unknown_scale(7, 1, H)) :]
    assert sum(node.prior for node in made) == pytest.approx(0.2)
    for node in made:
        a = dict(node.name)["share"]
        V = (1 - a) * np.eye(7) + a * np.equal.outer(group, group)
        L = node.whiten(np.eye(7))
        np.testing.assert_allclose(L @ V @ L.T, np.eye(7), atol=1e-3)  # the memory within a group is 0.9999
    assert noises_of_unknown_scale(7, 1, H, np.arange(7))[-1].name == noises_of_unknown_scale(7, 1, H)[-1].name


def test_one_sensor_that_walks_alone_is_a_walk_beside_what_all_of_them_wander():
    H, _ = seen_by_turning()
    rng = np.random.default_rng(5)
    time, weight = np.cumsum(rng.uniform(10, 200, 14)), rng.uniform(0.3, 1.0, (14, 1))
    asked = (("z", 25.0, 0.0, 0.0), ("x", 10.0, 0.95, 0.4), ("z", 2.5, 0.8, 0.9))
    made = single_walks(H, weight, time, "specific_force", asked)
    assert [node.single_walk for node in made] == ["z", "x", "z"]
    apart = np.abs(np.subtract.outer(np.arange(14), np.arange(14)))
    since = time - time[0]
    for node, (axis, walk, rho, share) in zip(made, asked, strict=True):
        h = weight[:, 0] * H[:, 0, "xyz".index(axis)]
        alone = walk**2 * np.outer(h, h) * np.minimum.outer(since, since) / since[-1]
        V = (1 - share) * np.eye(14) + share * rho**apart * (H[:, 0] @ H[:, 0].T) + alone
        L = node.whiten(np.eye(14))
        np.testing.assert_allclose(L @ V @ L.T, np.eye(14), atol=1e-9)
        assert node.logdet == pytest.approx(np.linalg.slogdet(V)[1])
        assert node.noise["specific_force"][0].N == pytest.approx(walk / np.sqrt(since[-1]))
    every = single_walks(H, weight, time, "specific_force", SINGLE_WALKS)
    assert sum(node.prior for node in every) == pytest.approx(3 * SINGLE_WALK_PRIOR_AT_REST)


def test_a_noise_half_white_and_half_with_a_memory_is_no_drift():
    """40 rests of three gyroscopes: no single memory is like it, and one in seven was a cause where it has to be."""
    rng = np.random.default_rng(8)
    m = 40
    V = np.linalg.cholesky(0.5 * stationary_of(m, 0.0) + 0.5 * stationary_of(m, 0.8))
    drift = (np.arange(m) / m - 0.5)[:, None] * np.eye(3)[0]
    seen = np.broadcast_to(np.eye(3), (m, 3, 3))
    claims = np.zeros(2)
    for _ in range(60):
        r = (V @ rng.standard_normal((m, 3))).ravel()
        Q = np.kron(np.ones((m, 1)), np.eye(3)) / np.sqrt(m)
        rows = stacked_rows(Q, 10 * drift.reshape(-1, 1), r[:, None], 3 * m, Free(3 * m - 3))
        for i, nodes in enumerate((noises_of_unknown_scale(m, 3), noises_of_unknown_scale(m, 3, seen))):
            p = [project(node, rows) for node in nodes]
            null = np.array([np.log(q.node.prior) + q.log_likelihood()[0] for q in p])
            each = np.array([float(any_size(q, np.array([0]))) for q in p])
            claims[i] += logsumexp(null + each) - logsumexp(null) > np.log(20)
    assert claims[1] < claims[0] / 2
    assert claims[1] <= 3


def stationary_of(m, rho):
    """Covariance (m, m) of a first-order process of unit variance."""
    return np.asarray(toeplitz(rho ** np.arange(m)))
