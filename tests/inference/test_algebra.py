"""Linear algebra that several estimators share, against scipy's."""

import numpy as np
from scipy.linalg import block_diag

from gimbalcal.inference.algebra import block_diagonal


def test_blocks_of_any_shape_stand_along_the_diagonal():
    rng = np.random.default_rng(0)
    for shapes in ([(2, 2), (3, 3)], [(4, 1), (2, 0), (3, 5)], [(1, 3)]):
        blocks = [rng.standard_normal(shape) for shape in shapes]
        np.testing.assert_array_equal(block_diagonal(blocks), block_diag(*blocks))
