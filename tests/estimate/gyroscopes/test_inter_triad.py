"""The rotation between the triads, from turns between rests."""

import numpy as np
import pytest

from gimbalcal.estimate.gyroscopes.revolutions import from_turns, triad_rotation
from gimbalcal.number import apply_matrix
from gimbalcal.rotation import frame_rotation
from tests.golden import refused

ANGLES = np.array([-14.72, 0.0039, -4.84]) / 60 * np.pi / 180  # Wang et al. (2019), Table 4


def directions(m, seed):
    v = np.random.default_rng(seed).standard_normal((m, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def turns(m, noise, seed):
    rng = np.random.default_rng(seed)
    before = directions(m, seed)
    R = np.stack([frame_rotation("xyz"[i % 3], rng.uniform(0.5, 2.5)) for i in range(m)])
    C = triad_rotation(ANGLES)
    after = apply_matrix(C.T @ R @ C, before)
    return before + noise * rng.standard_normal((m, 3)), after + noise * rng.standard_normal((m, 3)), R


def test_turns_give_the_rotation_exactly():
    found = from_turns(*turns(6, 0.0, 1), sigma=1e-5)
    np.testing.assert_allclose(found.angles, ANGLES, atol=1e-14)  # Gauss-Newton to rounding


def test_scatter_is_as_predicted():
    sigma = 1e-5
    errors = []
    for seed in range(100):
        found = from_turns(*turns(12, sigma / np.sqrt(2), seed), sigma=sigma)
        errors.append((found.angles - ANGLES) / np.sqrt(np.diag(found.covariance)))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1, abs=0.17)  # 300 normal numbers: 4 %, four sigma


def test_what_does_not_determine_it_is_refused():
    before, _, _ = turns(4, 0.0, 2)
    whole = np.broadcast_to(np.eye(3), (4, 3, 3))
    with refused():
        from_turns(before, before, whole, 1e-5)
