"""The mechanisation against motions that are known in closed form."""

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE, normal_gravity
from gimbalcal.navigate.strapdown import integrated_attitudes, radii, strapdown
from gimbalcal.rotation import exponential
from tests.estimate.systematic.table import LATITUDE, turning_unit

SILENT = {"accelerometer": 0.0, "gyroscope": 0.0, "velocity": 1e-5}
PLACE = np.array([LATITUDE, 0.3, 0.0])


def test_a_unit_that_is_turned_in_its_place_does_not_move():
    """Through fifteen turns: attitude to 1e-9 rad, velocity to 0.2 mm/s, what two samples know of sculling."""
    r = turning_unit(noise=SILENT, start=np.eye(3), stop=5.0, rate=50.0)
    dt = np.diff(r.time, prepend=0.0)
    moved = strapdown(dt, r.triad("angular_rate"), r.triad("specific_force"), np.eye(3), np.zeros(3), PLACE)
    # quarter turns end with every axis along another one
    end = moved.C_bn[-1]
    assert np.abs(np.abs(end).max(axis=1) - 1).max() < 1e-9
    assert np.abs(end - np.round(end)).max() < 1e-8
    assert np.abs(moved.velocity).max() < 2e-4
    assert np.abs((moved.position[-1] - PLACE) * [6.4e6, 6.4e6, 1]).max() < 0.01


def test_at_rest_for_an_hour_nothing_happens():
    n = 3600
    earth = EARTH_RATE * np.array([np.cos(LATITUDE), 0, -np.sin(LATITUDE)])
    g = np.array([0, 0, float(normal_gravity(LATITUDE))])
    moved = strapdown(np.ones(n), np.tile(earth, (n, 1)), np.tile(-g, (n, 1)), np.eye(3), np.zeros(3), PLACE)
    assert np.abs(moved.velocity).max() < 1e-7
    assert np.abs(moved.C_bn - np.eye(3)).max() < 1e-11


@pytest.mark.parametrize("velocity", [(200.0, 0.0, 0.0), (0.0, 250.0, 0.0), (100.0, -150.0, 0.0)])
def test_a_level_flight_keeps_its_speed(velocity):
    """Body along north, east, down: it turns with the frame, and feels Coriolis' force and gravity."""
    v, h, n = np.array(velocity), 0.01, 2000
    L, turn, force = LATITUDE, [], []
    for _ in range(n):
        RM, RN = radii(np.sin(L), 0.0)
        L += v[0] * h / RM / 2
        ie = EARTH_RATE * np.array([np.cos(L), 0, -np.sin(L)])
        en = np.array([v[1] / RN, -v[0] / RM, -v[1] * np.tan(L) / RN])
        turn.append(ie + en)
        force.append(np.cross(2 * ie + en, v) - [0, 0, float(normal_gravity(L))])
        L += v[0] * h / RM / 2
    moved = strapdown(np.full(n, h), np.array(turn), np.array(force), np.eye(3), v, PLACE)
    assert np.abs(moved.velocity - v).max() < 1e-5
    assert np.abs(moved.C_bn[-1] - np.eye(3)).max() < 1e-8
    assert moved.position[-1, 0] == pytest.approx(L, abs=1e-12)


def test_coning_is_what_two_intervals_know_of_it():
    """A cone of 1 deg at 2 Hz, 100 Hz: without the cross product of two increments it drifts by 0.2 deg in 10 s."""
    a, w, h, n = np.radians(1.0), 2 * np.pi * 2.0, 0.01, 1000
    t = h * np.arange(n + 1)
    phi = a * np.stack([np.cos(w * t), np.sin(w * t), 0 * t], axis=1)
    C = np.swapaxes(exponential(phi), -1, -2)  # body to the fixed axes
    fine = h * np.arange(64 * n + 1) / 64
    F = np.swapaxes(exponential(a * np.stack([np.cos(w * fine), np.sin(w * fine), 0 * fine], axis=1)), -1, -2)
    step = np.swapaxes(F[:-1], -1, -2) @ F[1:]
    small = np.stack([step[:, 2, 1], step[:, 0, 2], step[:, 1, 0]], axis=1)
    rate = small.reshape(n, 64, 3).sum(axis=1) / h
    end = C[0] @ integrated_attitudes(np.full(n, h), rate)[-1]
    left = np.linalg.norm(end - C[-1])
    without = C[0]
    for w_k in rate:
        without = without @ np.swapaxes(exponential(w_k * h), -1, -2)
    assert left < 0.02 * np.linalg.norm(without - C[-1])
