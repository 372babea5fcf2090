"""Revolutions in a recording: found, paired, fitted, and turned into effects."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.campaign.trials import LATITUDE
from gimbalcal.earth import EARTH_RATE
from gimbalcal.estimate.gyroscopes.revolutions import as_effects, gyroscopes_from_revolutions, revolutions_of
from gimbalcal.estimate.pulses.gravity_norm import Pulses
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site
from gimbalcal.rotation import normal_to
from gimbalcal.schedule.published import REVOLUTION_AXES
from tests.golden import refused

STEP, SPEED, TURN, REST = 0.1, np.deg2rad(30.0), 24.0, 60.0  # s, rad/s, s (two revolutions), s
TRUE = Pulses(
    1 + np.array([1e-3, -2e-3, 5e-4]), np.array([2e-4, -1e-4, 3e-4]), np.zeros(3), np.array([1e-5, -2e-5, 3e-5]),
    np.array([4e-4, -3e-4, 2e-4]),
)  # fmt: skip


def earth(up, phase):
    """Earth's rate (n, 3) in a unit with axis `up` vertical, turned by `phase` about it."""
    across = normal_to(up)
    third = np.cross(up, across)
    north = np.cos(phase)[:, None] * across - np.sin(phase)[:, None] * third
    return np.asarray(EARTH_RATE * (np.cos(LATITUDE) * north + np.sin(LATITUDE) * up))


def table_run(noise, seed=0):
    """Nine axes in turn: rest, two revolutions one way, rest, back, and a quarter turn to the next axis."""
    rng = np.random.default_rng(seed)
    rates, position, k = [], [], 0
    ramp = 10  # samples to come to speed
    shape = np.concatenate(
        [np.linspace(0, 1, ramp + 2)[1:-1], np.ones(round(TURN / STEP) - ramp), np.linspace(1, 0, ramp + 2)[1:-1]]
    )
    speed = 4 * np.pi / (shape.sum() * STEP)
    for up in REVOLUTION_AXES:
        for sign in (1.0, -1.0):
            k += 1
            rates.append(earth(up, np.zeros(round(REST / STEP))))
            position.append(np.full(round(REST / STEP), k))
            phase = sign * np.cumsum(speed * shape) * STEP
            rates.append(earth(up, phase) + sign * speed * shape[:, None] * up)
            position.append(np.zeros(len(shape), dtype=int))
        k += 1
        rates += [earth(up, np.zeros(200)), np.pi / 2 / 2.0 * np.tile(normal_to(up), (20, 1))]
        position += [np.full(200, k), np.zeros(20, dtype=int)]
    w = np.concatenate(rates)
    N = TRUE.counts(w) + noise * rng.standard_normal(w.shape)
    n = len(w)
    channels = {("angular_rate", a): N[:, i] for i, a in enumerate("xyz")}
    return Recording("rotation", "table", BENCH, Site(LATITUDE, 0.0, 9.8), {"gyroscope": max(noise, 1e-9)},
                     STEP * np.arange(n), np.concatenate(position), channels)  # fmt: skip


def test_revolutions_are_found_and_quarter_turns_left_out():
    turns, pairs = revolutions_of(table_run(0.0))
    assert pairs == 9
    assert turns.angle == pytest.approx(4 * np.pi)
    assert turns.rest.shape == (1, 27, 3)


def test_truth_comes_back_within_its_uncertainty():
    expected = as_effects(np.concatenate([TRUE.K1, TRUE.K2, TRUE.bias, TRUE.E]))
    errors = []
    for seed in range(5):
        made = gyroscopes_from_revolutions(table_run(1e-5, seed))
        assert made.outcome == ""
        errors.append((made.values - expected) / made.sigmas)
    assert np.sqrt(np.mean(np.square(errors))) < 1.5  # 60 normal numbers, sigma scaled to 42 degrees of freedom


def test_correcting_with_it_gives_the_rate():
    recording = table_run(0.0)
    made = gyroscopes_from_revolutions(recording)
    w = np.linalg.norm(made.apply(recording).triad("angular_rate")[recording.position != 0], axis=1)
    # the Earth's rate at rest; products of scale and misalignment (4e-4 x 2e-3 of 7e-5) are far below
    np.testing.assert_allclose(w, EARTH_RATE, rtol=1e-3)


def test_what_is_not_revolutions_is_refused():
    made = table_run(0.0)
    with refused():
        revolutions_of(made.select(slice(0, int(np.flatnonzero(made.position == 7)[0]))))
    counted = replace(made, units={("angular_rate", a): "count" for a in "xyz"})
    with refused():
        gyroscopes_from_revolutions(counted)
