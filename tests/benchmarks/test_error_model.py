"""Error propagation: Schuler's closed forms, alignment, superposition, and motions that fit together."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE, G0
from gimbalcal.estimate.pulses.gravity_norm import Pulses
from gimbalcal.rotation import cross_matrix
from tests.benchmarks.error_model import RADIUS, aligned, misread, propagate
from tests.benchmarks.motions import at_rest, drive, swing

SCHULER = np.sqrt(G0 / RADIUS)
NONE = np.zeros(3)


def constant(path, v):
    return np.broadcast_to(np.array(v), (len(path.time), 3))


def test_a_force_error_swings_with_schulers_period():
    path = at_rest(1.4, step=5.0)
    a = 1e-4
    made = propagate(path, constant(path, (a, 0, 0)), constant(path, (0, 0, 0)), NONE)
    expected = a / SCHULER**2 * (1 - np.cos(SCHULER * path.time))
    # the Earth's turn bends the swing by w_ie t sin L = 0.2 rad in 1.4 h, seen to second order
    np.testing.assert_allclose(made.position[:, 0], expected, atol=0.05 * expected.max())


def test_a_rate_error_grows_as_schulers_loop_lets_it():
    path = at_rest(0.5, step=2.0)
    e = 1e-7
    made = propagate(path, constant(path, (0, 0, 0)), constant(path, (0, e, 0)), NONE)
    t = path.time
    expected = e * RADIUS * (t - np.sin(SCHULER * t) / SCHULER)
    assert abs(abs(made.position[-1, 0]) / expected[-1] - 1) < 0.02  # half an hour of Earth's turn: 0.13 rad squared


def test_alignment_hides_a_constant_force_error():
    path = at_rest(2.0, step=5.0)
    force, rate = constant(path, (1e-4, -2e-4, 0)), constant(path, (0, 0, 0))
    hidden, open_ = propagate(path, force, rate), propagate(path, force, rate, NONE)
    assert hidden.largest < 0.1 * open_.largest  # in 2 h the Earth turns the hidden tilt by w_ie t sin L = 0.28 rad
    assert np.max(np.abs(aligned(path, force, rate)[:2])) == pytest.approx(2e-4 / G0)


def test_errors_add():
    path = drive(0.2)
    rng = np.random.default_rng(0)
    a, b = (1e-4 * rng.standard_normal((len(path.time), 3)) for _ in range(2))
    both = propagate(path, a + b, 1e-3 * (a - b)).position
    each = propagate(path, a, 1e-3 * a).position + propagate(path, b, -1e-3 * b).position
    np.testing.assert_allclose(both, each, atol=1e-12 * np.abs(both).max() * len(path.time))  # rounding of a sum


@pytest.mark.parametrize(
    ("path", "size"), [(drive(0.3, 0.05), 2e-4), (swing(2.0, 0.0005), 3e-3)], ids=["drive", "swing"]
)
def test_motions_obey_kinematics(path, size):
    """C_dot = C [w_ib x] - [w_in x] C and V_dot = f - (2 w_ie + w_en) x V + g along the whole motion."""
    C_dot = np.gradient(path.C_bn, path.time, axis=0)
    L = path.latitude
    w_ie = EARTH_RATE * np.stack([np.cos(L), 0 * L, -np.sin(L)], -1)
    N, E, _ = path.velocity.T
    w_en = np.stack([E, -N, -E * np.tan(L)], -1) / RADIUS
    kinematic = path.C_bn @ cross_matrix(path.rate) - cross_matrix(w_ie + w_en) @ path.C_bn
    # differences of neighbours: (2 pi f)^3 h^2 a / 6 of the swing, and the corners of the bend's second derivative
    assert np.max(np.abs(C_dot - kinematic)[2:-2]) < size * np.max(np.abs(path.rate))
    f = np.einsum("nij,nj->ni", path.C_bn, path.force)
    V_dot = f - np.cross(2 * w_ie + w_en, path.velocity) + np.array([0, 0, G0])
    np.testing.assert_allclose(np.gradient(path.velocity, path.time, axis=0), V_dot, atol=1e-12)


def test_a_triad_corrected_as_it_is_makes_no_error():
    path = drive(0.05)
    one = np.ones(3)
    true = Pulses(2e-6 * G0 * one, -1e-15 * G0 * one, 5e-21 * G0 * one, 1e-2 * G0 * one, 4e-4 * one)
    assert np.max(np.abs(misread(true, true, path.force))) < 1e-12  # rounding of 10 m/s^2
    left_out = misread(true, replace(true, K2=0 * true.K2, K3=0 * true.K3), path.force)
    N = true.counts(path.force)
    np.testing.assert_allclose(left_out[:, 0], -(true.K2 * N**2 + true.K3 * N**3)[:, 0], rtol=0, atol=1e-14)
