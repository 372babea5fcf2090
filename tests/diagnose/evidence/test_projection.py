"""The closed forms against brute force, and against each other."""

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from gimbalcal.diagnose.evidence.gram import Gram
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.projection import (
    Projection,
    any_size,
    append_columns,
    by_size,
    condition_on,
    gather_evidence,
    log_bayes,
    project,
    project_all,
    rows_like,
    stacked_rows,
)
from gimbalcal.diagnose.evidence.scale import SIZE_PRIOR, SIZES
from gimbalcal.diagnose.library.candidates import Candidate, Variant, layout_of
from gimbalcal.inference.whitening import whitening
from tests.diagnose.small import covariance


def example(seed=3, R=40, low=40):
    rng = np.random.default_rng(seed)
    Z, X = rng.standard_normal((R, 3)), rng.standard_normal((R, 5))
    y = X[:, :1] * 0.8 + rng.standard_normal((R, 1))
    root = whitening(np.ones((low, 1)), 0.5 * np.eye(low, 1), np.ones((low, 1, 1)))  # white, and a level of its own
    return Node((), {}, 1.0, 0.0, root), Z, X, y


def dense_log_bayes(node, Z, X, y, size):
    """The same number from the contrasts that are free of the calibration: a basis of what is orthogonal to Z."""
    free = null_space(Z.T)
    V = covariance(node, len(y))
    data, none = free.T @ y[:, 0], free.T @ V @ free
    with_it = none + size**2 * free.T @ X @ X.T @ free
    return multivariate_normal(cov=with_it).logpdf(data) - multivariate_normal(cov=none).logpdf(data)


@pytest.mark.parametrize("columns", [[0], [1, 2], [0, 3, 4]])
def test_evidence_is_the_ratio_of_two_normal_densities(columns):
    node, Z, X, y = example()
    p = project(node, stacked_rows(Z, X, y, len(y)))
    ln = log_bayes(p, np.array(columns), SIZES)
    for k, size in enumerate(SIZES[:7]):
        assert ln[k] == pytest.approx(dense_log_bayes(node, Z, X[:, columns], y, size), abs=1e-8)


def test_evidence_is_the_integral_over_the_coefficients():
    G, b = np.array([[2.0, 0.6], [0.6, 1.0]]), np.array([1.5, -0.4])

    def integrand(v, u):
        x = np.array([u, v])
        return np.exp(b @ x - x @ G @ x / 2 - x @ x / 2) / (2 * np.pi)

    value, _ = dblquad(integrand, -8, 8, -8, 8)
    p = Projection(Node((), {}, 1.0, 0.0, np.eye(2)), Gram.of(G), b[:, None], np.zeros(1), 0.0)
    assert log_bayes(p, np.arange(2), np.ones(1)) == pytest.approx(np.log(value), abs=1e-6)


@pytest.mark.parametrize("low", [40, 24])
def test_a_projection_grows_by_columns_as_if_they_had_been_there(low):
    node, Z, X, y = example(low=low)
    loose = Node((), {}, 1.0, 0.0, np.linspace(0.3, 1.0, low))
    few, whole = stacked_rows(Z, X[:, :3], y, low), stacked_rows(Z, X, y, low)
    before = project_all([node, loose], few)
    kept = [p.G.whole for p in before]
    for grown, old in ((project_all([node, loose], whole, before), kept), (project_all([node, loose], whole), None)):
        for k, (p, n) in enumerate(zip(grown, (node, loose), strict=True)):
            expected = project(n, whole)
            np.testing.assert_allclose(p.G.whole, expected.G.whole, atol=1e-11)
            np.testing.assert_allclose(p.b, expected.b, atol=1e-11)
            np.testing.assert_allclose([*p.misfit, p.penalty], [*expected.misfit, expected.penalty], rtol=1e-12)
            assert old is None or np.array_equal(before[k].G.whole, old[k])


def test_without_room_everything_is_projected_again():
    node, Z, X, y = example()
    few, wide = stacked_rows(Z, X[:, :3], y, 40), np.random.default_rng(1).standard_normal((40, 230))
    rows = stacked_rows(Z, np.concatenate([X[:, :3], wide], axis=1), y, 40)
    (made,) = project_all([node], rows, project_all([node], few))
    np.testing.assert_allclose(made.G.whole, project(node, rows).G.whole, atol=1e-11)


def test_rows_fewer_than_columns_have_the_products_of_more():
    node, Z, X, y = example()
    loose, wide = Node((), {}, 1.0, 0.0, np.linspace(0.3, 1.0, 40)), np.random.default_rng(1).standard_normal((40, 60))
    X = np.concatenate([X, wide], axis=1)
    first, whole = stacked_rows(Z, X[:, :45], y, 40), stacked_rows(Z, X, y, 40)
    for made in (
        project_all([node, loose], whole),
        project_all([node, loose], whole, project_all([node, loose], first)),
    ):
        for p, n in zip(made, (node, loose), strict=True):
            assert p.G.columns is not None
            some = [0, 3, 44, 45, 64]
            expected = project(n, stacked_rows(Z, X[:, some], y, 40))
            assert expected.G.columns is None
            np.testing.assert_allclose(p.G.block(np.array(some)), expected.G.whole, atol=1e-11)
            np.testing.assert_allclose(p.b[some], expected.b, atol=1e-11)
            np.testing.assert_allclose([*p.misfit, p.penalty], [*expected.misfit, expected.penalty], rtol=1e-12)
            size, given = 3.0, np.array([1, 4])
            left, wanted = (condition_on(q, at, size).G for q, at in ((p, np.array(some)[given]), (expected, given)))
            np.testing.assert_allclose(left.block(np.array(some)), wanted.whole, atol=1e-11)


def test_all_noises_at_once_are_each_of_them():
    node, Z, X, y = example()
    rows = stacked_rows(Z, X, y, 40)
    every = [project(n, rows) for n in (node, Node((), {}, 1.0, 0.0, np.linspace(0.3, 1.0, 40)))]
    spans = [[(0,), (2,)], [(1, 2)], [(4, 3)], [(0, 1, 4)]]
    layout = layout_of([Candidate("", "", (), tuple(Variant((), i, 0.5) for i in span), "") for span in spans])
    both = gather_evidence(every, layout)
    for k, p in enumerate(every):
        for j, span in enumerate(spans):
            share = layout.log_share[layout.starts[j] :][: len(span)]
            ln = share + [any_size(p, np.array(i)) for i in span]
            assert both[k, j] == pytest.approx(np.logaddexp.reduce(ln), abs=1e-12)
            largest = max(log_bayes(p, np.array(i), p.scale.any_size).max() for i in span)
            assert by_size(p, layout)[j].max() == pytest.approx(largest, abs=1e-12)


@pytest.mark.parametrize("low", [0, 20, 40])
def test_columns_may_be_appended_to_rows(low):
    _, Z, X, y = example()
    X = np.concatenate([X[:, :2], Z[:, :1], X[:, 2:], X[:, :1] * X[:, 1:2]], axis=1)  # the third is all absorbed
    made, whole = append_columns(stacked_rows(Z, X[:, :4], y, low), X[:, :4], X[:, 4:]), stacked_rows(Z, X, y, low)
    assert (made.q, made.P) == (whole.q, whole.P)
    np.testing.assert_allclose(made.low, whole.low, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(made.high, whole.high, rtol=1e-11, atol=1e-11)


def test_rows_that_stay_white_may_be_kept_as_their_gram_matrix():
    _, Z, X, y = example()
    half = 20
    root, whole = np.full(half, 0.7), np.r_[np.full(half, 0.7), np.ones(half)]
    a = project(Node((), {}, 1.0, 0.0, root), stacked_rows(Z, X, y, half))
    b = project(Node((), {}, 1.0, 0.0, whole), stacked_rows(Z, X, y, 40))
    np.testing.assert_allclose(a.G.whole, b.G.whole, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(a.b, b.b, rtol=1e-10, atol=1e-10)
    assert a.misfit == pytest.approx(b.misfit)


def test_a_second_cause_given_the_first_is_the_pair():
    node, Z, X, y = example()
    p = project(node, stacked_rows(Z, X, y, len(y)))
    size = 1.0
    one = np.array([size])
    both = log_bayes(p, np.arange(2), one)
    first = log_bayes(p, np.arange(1), one)
    given = condition_on(p, np.array([0]), size)
    second = log_bayes(given, np.array([1]), one)
    assert first + second == pytest.approx(both)


def test_columns_that_are_one_column_and_huge_are_given_as_one():
    node, Z, X, y = example()
    X[:, :2] = 1e10 * X[:, :1]
    p = project(node, stacked_rows(Z, X, y, len(y)))
    both, one = condition_on(p, np.array([0, 1]), 1.0), condition_on(p, np.array([0]), 1.0)
    assert both.misfit == pytest.approx(one.misfit)
    assert np.isfinite(both.b).all()


def test_columns_that_are_not_in_the_library_are_scored_alike():
    node, Z, X, y = example()
    rows = stacked_rows(Z, X, y, len(y))
    p = project(node, rows)
    made = project(p.node, rows_like(rows, X[:, 1:3]))
    np.testing.assert_allclose(made.G.whole, p.G.whole[1:3, 1:3], atol=1e-10)
    np.testing.assert_allclose(made.b, p.b[1:3], atol=1e-10)


def test_variants_share_the_prior_by_their_weights():
    node, Z, X, y = example()
    p = project(node, stacked_rows(Z, X, y, len(y)))
    c = Candidate("", "", (), (Variant((), (0,), 1.0), Variant((), (1,), 3.0)))
    one, two = (any_size(p, np.array([k])) for k in (0, 1))
    assert gather_evidence([p], layout_of([c]))[0, 0] == pytest.approx(np.log(0.25 * np.exp(one) + 0.75 * np.exp(two)))


def test_under_no_effect_the_scores_have_their_gram_matrix_as_covariance():
    """With the calibration profiled out under coloured noise, b is N(0, G): what every tail probability rests on."""
    node, Z, X, _ = example()
    draws = 2000
    y = node.colour(np.random.default_rng(0).standard_normal((40, draws)))
    p = project(node, stacked_rows(Z, X, y, 40))
    scale = np.sqrt(np.outer(p.G.diagonal, p.G.diagonal))
    np.testing.assert_allclose(np.cov(p.b) / scale, p.G.whole / scale, atol=5 * np.sqrt(2 / draws))
    np.testing.assert_allclose(p.b.mean(axis=1) / np.sqrt(p.G.diagonal), 0, atol=5 / np.sqrt(draws))


@pytest.mark.parametrize("G", [0.01, 1.0, 50.0])
def test_under_no_effect_the_bayes_factor_averages_to_one(G):
    """The defining property of an e-value, E[BF] = 1, and what follows from it by Markov's inequality."""

    def mean(b):
        s2 = SIZES**2
        return np.log(SIZE_PRIOR @ np.exp(0.5 * (s2 * b**2 / (1 + s2 * G) - np.log1p(s2 * G))))

    def weighed(b):
        p = Projection(Node((), {}, 1.0, 0.0, np.eye(1)), Gram.of(np.array([[G]])), np.array([[b]]), np.zeros(1), 0.0)
        ln = float(any_size(p, np.arange(1)))
        return np.exp(ln - b**2 / G / 2) / np.sqrt(2 * np.pi * G)

    end = 12 * np.sqrt(G * (1 + SIZES[-1] ** 2 * G))
    points = end * np.array([-0.1, -0.01, -1e-3, 0, 1e-3, 0.01, 0.1])
    value, _ = quad(weighed, -end, end, points=points, limit=500)
    assert value == pytest.approx(1.0, abs=1e-6)
    b = np.sqrt(G) * np.random.default_rng(1).standard_normal(20000)
    ln = np.array([mean(x) for x in b])
    assert np.mean(ln >= np.log(20)) < 1 / 20
