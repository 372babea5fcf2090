"""Linear algebra that several estimators share, against scipy's."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import nnls

from gimbalcal.inference.algebra import block_diagonal, nonnegative_least_squares


def test_blocks_of_any_shape_stand_along_the_diagonal():
    rng = np.random.default_rng(0)
    for shapes in ([(2, 2), (3, 3)], [(4, 1), (2, 0), (3, 5)], [(1, 3)]):
        blocks = [rng.standard_normal(shape) for shape in shapes]
        np.testing.assert_array_equal(block_diagonal(blocks), block_diag(*blocks))


@pytest.mark.parametrize("seed", range(20))
def test_least_squares_without_negative_sizes_are_those_of_scipy(seed):
    rng = np.random.default_rng(seed)
    A, y = rng.standard_normal((9, 3)) * [1.0, 1e-6, 1e6], rng.standard_normal(9)
    size, left = nonnegative_least_squares(A, y)
    expected, expected_left = nnls(A, y)
    assert size == pytest.approx(expected, rel=1e-9, abs=0)
    assert left == pytest.approx(expected_left)


def test_least_squares_of_a_negative_size_alone_are_zero():
    size, left = nonnegative_least_squares(-np.ones((4, 1)), np.ones(4))
    assert size.tolist() == [0.0]
    assert left == 2.0
