"""The published schedule."""

import numpy as np

from gimbalcal.schedule import EIGHTEEN_POSITIONS, FACE_POSITIONS

ROOT = np.sqrt(0.5)
# Wu et al. (2018), Table 1, the three right-hand columns at zero offsets, in g; the scan prints some of these as
# garbled digits: derivations/ tells them apart.
GRAVITY = [
    (0, 0, 1), (0, ROOT, ROOT), (0, 1, 0), (ROOT, ROOT, 0), (1, 0, 0), (ROOT, 0, ROOT),
    (0, 0, -1), (0, -ROOT, -ROOT), (0, -1, 0), (-ROOT, -ROOT, 0), (-1, 0, 0), (-ROOT, 0, -ROOT),
    (0, ROOT, -ROOT), (-ROOT, ROOT, 0), (-ROOT, 0, ROOT), (0, -ROOT, ROOT), (ROOT, -ROOT, 0), (ROOT, 0, -ROOT),
]  # fmt: skip


def test_the_18_positions_turn_gravity_as_table_1_prints_it():
    np.testing.assert_allclose(EIGHTEEN_POSITIONS.gravity_directions(), GRAVITY, atol=1e-15)


def test_face_positions_put_one_axis_along_the_vertical():
    faces = EIGHTEEN_POSITIONS.gravity_directions()[np.array(FACE_POSITIONS) - 1]
    np.testing.assert_allclose(np.abs(faces).max(axis=1), 1, atol=1e-15)
    assert len({tuple(np.round(f).astype(int)) for f in faces}) == 6
