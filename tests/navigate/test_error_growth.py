"""Transitions against numerical linearisation of the mechanisation itself."""

import numpy as np

from gimbalcal.earth import normal_gravity
from gimbalcal.navigate.error_growth import transitions
from gimbalcal.navigate.strapdown import radii, strapdown
from gimbalcal.rotation import exponential
from tests.estimate.systematic.table import LATITUDE, turning_unit

G = float(normal_gravity(LATITUDE))
SILENT = {"accelerometer": 0.0, "gyroscope": 0.0, "velocity": 1e-5}


def _stretch(rows):
    r = turning_unit(noise=SILENT, start=np.eye(3), stop=5.0)
    dt = np.diff(r.time, prepend=0.0)
    start = strapdown(dt, r.triad("angular_rate"), r.triad("specific_force"), np.eye(3), np.zeros(3), [LATITUDE, 0, 0])
    return dt[rows], r.triad("angular_rate")[rows], r.triad("specific_force")[rows], start.C_bn[rows.start]


def _errors(end, reference, RM, RN):
    """True minus reference: attitude, velocity, position in metres."""
    R = end.C_bn[-1] @ reference.C_bn[-1].T
    phi = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    d = end.position[-1] - reference.position[-1]
    place = np.array([d[0] * RM, d[1] * RN * np.cos(LATITUDE), -d[2]])
    return np.concatenate([phi, end.velocity[-1] - reference.velocity[-1], place])


def test_transition_is_the_derivative_of_navigation_by_where_it_starts():
    dt, w, f, C = _stretch(slice(100, 180))  # four seconds, half at rest and half turning
    RM, RN = radii(np.sin(LATITUDE), 0.0)
    D, q = np.zeros((80, 6, 0)), np.zeros((80, 6))
    made = transitions([0, 80], np.ones(80), dt, w, f, D, q, C[None], LATITUDE, 0, G)
    place, still = np.array([LATITUDE, 0.0, 0.0]), np.zeros(3)
    at_rest = strapdown(dt, w, f, C, still, place)
    # central differences; what 4 s make of 1 rad, 1 m/s, 1 m, times 1e-5, and rounding of the numerical side
    size = np.repeat([1e-3, 1.0, 1e3], 3)
    tolerance = np.repeat([[1e-5, 1e-11, 1e-15], [4e-4, 1e-5, 1e-10], [8e-4, 4e-5, 1e-5]], 3, axis=0)
    for i in range(9):
        ends = []
        for x in (size[i] * np.eye(9)[i], -size[i] * np.eye(9)[i]):
            moved = place + np.array([x[6] / RM, x[7] / (RN * np.cos(LATITUDE)), -x[8]])
            ends.append(_errors(strapdown(dt, w, f, exponential(-x[:3]) @ C, x[3:6], moved), at_rest, RM, RN))
        column = (ends[0] - ends[1]) / (2 * size[i])
        assert np.all(np.abs(made.Phi[0, :, i] - column) < tolerance[:, i // 3]), i


def test_response_is_the_derivative_by_what_the_sensors_read():
    dt, w, f, C = _stretch(slice(100, 180))
    D = np.eye(6)[None]  # six biases
    made = transitions([0, 80], np.ones(80), dt, w, f, D, np.zeros((80, 6)), C[None], LATITUDE, 0, G, np.zeros(80))
    place = np.array([LATITUDE, 0.0, 0.0])
    RM, RN = radii(np.sin(LATITUDE), 0.0)
    at_rest = strapdown(dt, w, f, C, np.zeros(3), place)
    for i, size in enumerate(np.repeat([1e-3, 1e-6], 3)):
        e = size * np.eye(6)[i]
        column = _errors(strapdown(dt, w + e[3:], f + e[:3], C, np.zeros(3), place), at_rest, RM, RN) / size
        assert np.abs(made.Psi[0, :, i] - column).max() < 1e-3 * np.abs(column).max(), i


def test_noise_of_samples_adds_up_to_random_walks():
    dt, w, f, C = _stretch(slice(0, 60))
    q = np.tile([1e-6] * 3 + [1e-12] * 3, (60, 1))
    made = transitions([0, 60], np.ones(60), dt, w, f, np.zeros((60, 6, 0)), q, C[None], LATITUDE, 0, G)
    h, n = dt[0], 60
    assert np.allclose(np.diag(made.Q[0])[:3], n * 1e-12 * h**2, rtol=1e-6)
    tilt = G**2 * 1e-12 * h**2 * sum((h * (n - j - 0.5)) ** 2 for j in range(n))  # of horizontal axes
    assert np.allclose(np.diag(made.Q[0])[3:6], n * 1e-6 * h**2 + np.array([tilt, tilt, 0.0]), rtol=1e-3)


def test_intervals_of_a_group_are_as_many_of_their_own_and_noise_may_be_left_out():
    dt, w, f, C = _stretch(slice(100, 180))
    rng = np.random.default_rng(3)
    D, q = rng.standard_normal((8, 6, 4)), np.full((80, 6), 1e-6)
    group = np.arange(80) // 10
    first = [0, 37, 80]  # an update within a group
    place = (np.stack([C, C]), LATITUDE, 0, G)
    grouped = transitions(first, np.ones(80), dt, w, f, D, q, *place, group)
    single = transitions(first, np.ones(80), dt, w, f, D[group], q, *place)
    bare = transitions(first, np.ones(80), dt, w, f, D, q[:0], *place, group)
    for a, b in zip(grouped, single, strict=True):
        assert np.allclose(a, b, rtol=1e-12, atol=1e-14 * np.abs(b).max())
    assert not bare.Q.any()
    assert all(np.array_equal(a, b) for a, b, name in zip(grouped, bare, grouped._fields, strict=True) if name != "Q")
