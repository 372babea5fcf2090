"""Products of columns of which half are stored are those of the whole matrix, before and after others are taken off."""

import numpy as np

from gimbalcal.diagnose.evidence.gram import Gram
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.projection import Projection, condition_on


def products(seed=0):
    A = np.random.default_rng(seed).standard_normal((12, 7))
    A[:, 5] = 2 * A[:, 1]  # two causes that are alike
    return A.T @ A


def test_every_product_is_that_of_the_matrix():
    G = products()
    half = Gram.of(G)
    assert half.triangles[0].size == 28
    np.testing.assert_array_equal(half.whole, G)
    np.testing.assert_array_equal(half.diagonal, np.diag(G))
    index = np.array([[4, 0], [2, 6]])
    np.testing.assert_array_equal(half.block(index), G[index[:, :, None], index[:, None, :]])
    np.testing.assert_array_equal(half.with_all(np.array([3, 1])), G[:, [3, 1]])


def test_what_columns_in_the_model_leave_is_schurs_complement_one_after_the_other():
    G, size = products(), 30.0
    b = np.random.default_rng(1).standard_normal((7, 1))
    p = Projection(Node((), {}, 1.0, 0.0, np.eye(2)), Gram.of(G), b, np.array([50.0]), 0.0)
    first, then = np.array([1, 5]), np.array([0])
    made = condition_on(condition_on(p, first, size), then, size)
    both = [1, 5, 0]
    S = np.linalg.inv(G[np.ix_(both, both)] + np.eye(3) / size**2)
    np.testing.assert_allclose(made.G.whole, G - G[:, both] @ S @ G[both], atol=1e-9)
    np.testing.assert_allclose(made.b, b - G[:, both] @ S @ b[both], atol=1e-9)
    np.testing.assert_allclose(made.misfit, 50.0 - (b[both].T @ S @ b[both])[0], atol=1e-9)
    determinant = np.linalg.slogdet(np.eye(3) + size**2 * G[np.ix_(both, both)])[1]
    np.testing.assert_allclose(made.penalty, determinant, rtol=1e-9)
