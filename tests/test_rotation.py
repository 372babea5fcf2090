"""Rotations of frames, against SciPy, against each other and against fine integration."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gimbalcal import rotation
from gimbalcal.number import complex_step

angles = st.floats(-7, 7)


@given(a=angles, direction=st.sampled_from("xyz"))
def test_frame_rotation_is_orthogonal_and_its_own_inverse_at_minus_the_angle(a, direction):
    C = rotation.frame_rotation(direction, a)
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(rotation.frame_rotation(direction, -a), C.T, atol=0)
    assert np.linalg.det(C) == pytest.approx(1, abs=1e-14)


def test_frame_rotation_is_passive():
    # turning the frame by +90 deg about z makes the old x axis the new -y axis
    np.testing.assert_allclose(rotation.frame_rotation("z", np.pi / 2) @ [1, 0, 0], [0, -1, 0], atol=1e-16)


def test_tilt_rotation_to_first_order_is_minus_the_cross_product():
    v = np.array([2e-9, -1e-9, 3e-9])
    f = np.array([1.0, 2.0, -3.0])
    np.testing.assert_allclose(rotation.tilt_rotation(v) @ f - f, -np.cross(v, f), atol=1e-15)


@pytest.mark.parametrize("size", [0.0, 3e-7, 0.9e-6, 1.1e-6, 1e-4, 1.0, 3.1, 9.0])
def test_exponential_is_a_passive_rotation_by_the_vector(size):
    phi = size * np.array([0.6, -0.48, 0.64])
    np.testing.assert_allclose(rotation.exponential(phi), Rotation.from_rotvec(-phi).as_matrix(), atol=4e-16)


@pytest.mark.parametrize("size", [1e-6, 0.9e-4, 1.1e-4, 0.3, 2.5])
def test_left_jacobian_moves_the_end_of_a_rotation(size):
    phi, h = size * np.array([0.6, -0.48, 0.64]), 1e-6
    for unit in np.eye(3):
        there, back = (rotation.exponential(phi + s * h * unit) for s in (1, -1))
        moved = rotation.small_rotation_vector(there @ back.T) / (2 * h)
        np.testing.assert_allclose(rotation.left_jacobian(phi) @ unit, moved, atol=2e-10)  # 1e-16 / h


def test_cross_matrix_multiplies_to_the_cross_product():
    v, w = np.random.default_rng(1).standard_normal((2, 5, 3))
    np.testing.assert_allclose((rotation.cross_matrix(v) @ w[..., None])[..., 0], np.cross(v, w), atol=1e-15)


def test_small_rotation_vector_is_that_of_a_tilt():
    tilt = np.array([2e-9, -1e-9, 3e-9])
    found = complex_step(lambda v: rotation.small_rotation_vector(rotation.tilt_rotation(v)), tilt)
    np.testing.assert_allclose(found, np.eye(3), atol=1e-8)


def test_mean_rates_are_right_to_the_fifth_order_in_the_step():
    def rate(t):
        return np.stack([0.8 * np.sin(2 * t), 0.7 * np.cos(3 * t), 0.5 * np.sin(t + 1)], axis=-1)

    def end(steps):
        t = np.linspace(0.0, 2.0, steps + 1)
        C = np.eye(3)
        mean, bend, coning = rotation.mean_rates(t, rate(t))
        for dt, w in zip(np.diff(t), mean + bend + coning, strict=True):
            C = rotation.exponential(w * dt) @ C
        return C

    exact = end(6400)
    error = [np.abs(end(n) - exact).max() for n in (50, 100, 200)]
    assert error[0] < 3e-5  # inside, local error dt^5; the slopes at both ends are of first order, error dt^3
    assert all(first / second > 6 for first, second in pairwise(error))


@pytest.mark.parametrize("n", [1, 2, 7, 8])
def test_rotations_one_after_the_other_are_composed_with_the_last_on_the_left(n):
    C = rotation.exponential(np.random.default_rng(n).standard_normal((3, n, 3)))
    one_by_one = np.broadcast_to(np.eye(3), (3, 3, 3))
    for k in range(n):
        one_by_one = C[:, k] @ one_by_one
    np.testing.assert_allclose(rotation.composed_rotation(C), one_by_one, atol=1e-14)


@pytest.mark.parametrize("handed", [1, -1])
def test_rotation_between_vectors_is_the_nearest_of_its_hand(handed):
    rng = np.random.default_rng(3)
    a, R = rng.standard_normal((20, 3)), rotation.exponential(rng.standard_normal(3))
    R = R * handed  # of three components, -1 mirrors
    np.testing.assert_allclose(rotation.rotation_between(a, a @ R.T, handed), R, atol=1e-14)
    other = rotation.rotation_between(a, a @ R.T, -handed)
    assert np.linalg.det(other) == pytest.approx(-handed)
    noisy = a @ R.T + 0.01 * rng.standard_normal(a.shape)
    assert Rotation.from_matrix(handed * rotation.rotation_between(a, noisy, handed)).approx_equal(
        Rotation.align_vectors(handed * noisy, a)[0], 1e-12
    )


def test_normal_is_a_unit_vector_across():
    u = np.concatenate([np.eye(3), np.random.default_rng(2).standard_normal((5, 3))])
    n = rotation.normal_to(u)
    np.testing.assert_allclose(np.linalg.norm(n, axis=-1), 1, atol=1e-15)
    np.testing.assert_allclose((u * n).sum(-1), 0, atol=1e-15)
