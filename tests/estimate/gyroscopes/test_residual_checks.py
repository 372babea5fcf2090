"""Gyroscopes that their model does not explain are told, and with them the whole calibration."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.estimate.gyroscopes.between_rests import LINEAR
from gimbalcal.estimate.gyroscopes.residual_checks import turn_sigma
from gimbalcal.estimate.unit import inertial_unit
from gimbalcal.views.turns import turns_between_rests
from tests.estimate.gyroscopes.test_between_rests import TRUTH, hand
from tests.golden import golden_text

NOISE = 2e-3
RATE = "angular_rate"
TERMS = ("bias", *LINEAR)


@cache
def turned(count=24):
    made = hand(TRUTH, NOISE, count)
    noise = {"gyroscope": NOISE, "accelerometer": 1e-6}
    return replace(made, noise=noise, scatter={(RATE, a): NOISE for a in "xyz"})


def with_rates(y):
    return turned().with_channels({(RATE, a): y[:, i] for i, a in enumerate("xyz")})


def calibrated(recording):
    return inertial_unit(recording, TERMS)


def test_gyroscopes_that_their_model_explains_are_not_complained_of():
    made = calibrated(turned())
    assert made.outcome == ""
    turns = turns_between_rests(turned(), made)
    stated = turn_sigma(turns, np.zeros((1, 3)))
    assert made.residual.rms["gravity_direction"] == pytest.approx(stated, rel=0.4)  # 48 numbers, 9 of them fitted


def test_a_level_that_differs_from_rest_to_rest_is_told():
    p = np.asarray(turned().position)
    y = turned().triad(RATE) + 5e-3 * np.where(p % 2 > 0, 1.0, 0.0)[:, None] * (p > 0)[:, None] * np.array([0, 1, 0])
    golden_text(calibrated(with_rates(y)).outcome)


def test_turns_that_the_gyroscopes_missed_are_told():
    y = turned().triad(RATE)
    clipped = np.clip(y, -0.6, 0.6)  # rad/s: the range of the gyroscopes
    made = calibrated(with_rates(clipped))
    golden_text(made.outcome)


def test_turns_that_miss_gravity_by_degrees_show_no_size():
    """Rates of other turns, as where rows on the way are missing: scale factors and misalignments would be any."""
    late = np.roll(turned().triad(RATE), 30, axis=0)[:, [1, 2, 0]] * [1, -1, 1]
    made = calibrated(with_rates(late))
    assert "with any bias, scale factor and misalignment" in made.outcome
    assert {p.effect for p in made.parameters} == {"bias", "gyro_bias"}
    assert all("left out" in u.why for u in made.unobservable if "gyro_scale_factor:x" in u.direction)


def test_rows_that_are_too_far_apart_to_follow_a_turn_are_told():
    """A row in two seconds, and rows that are dense, but those of other turns."""
    late = with_rates(np.roll(turned().triad(RATE), 30, axis=0)[:, [1, 2, 0]] * [1, -1, 1])
    slow = turned().select(np.arange(0, len(turned().time), 50))
    told = [("too few (the unit turns by up to" in calibrated(each).outcome) for each in (slow, late)]
    assert told == [True, False]


def test_counts_have_no_size_by_turns_that_miss_gravity():
    late = with_rates(1e4 * np.roll(turned().triad(RATE), 30, axis=0)[:, [1, 2, 0]] * [1, -1, 1])
    counted = replace(late, units={**late.units, **{(RATE, a): "count" for a in "xyz"}})
    with pytest.raises(InputError, match="what a count of the rates is"):
        calibrated(counted)
    assert inertial_unit(counted).outcome.startswith("The gyroscopes are not calibrated: after the turns gravity")


def test_turns_in_which_a_gyroscope_clips_are_left_out():
    y = turned().triad(RATE)
    limit = 0.8 * np.abs(y).max()  # few turns are as fast
    made, whole = calibrated(with_rates(np.clip(y, -limit, limit))), calibrated(turned())
    assert "which are left out" in made.outcome
    assert "times its rate" not in made.outcome
    at = [i for i, p in enumerate(made.parameters) if p.effect == "gyro_scale_factor"]
    same = [next(k for k, q in enumerate(whole.parameters) if q.label == made.parameters[i].label) for i in at]
    assert np.all(np.abs(made.values[at] - whole.values[same]) < 4 * made.sigmas[at])


def test_one_odd_rest_hides_no_turn_that_was_missed():
    y = np.clip(turned().triad(RATE), -0.6, 0.6)
    y[np.asarray(turned().position) == 5] += np.radians(5.0)
    golden_text(calibrated(with_rates(y)).outcome)


def test_a_gyroscope_that_does_not_follow_its_rate_is_told():
    y = turned().triad(RATE) * np.array([1.0, 1.0, 0.0]) + 1e-4 * np.random.default_rng(0).standard_normal((1, 3))
    y[:, 2] += 1e-4 * np.random.default_rng(1).standard_normal(len(y))
    assert "gyroscope" in calibrated(with_rates(y)).outcome


def test_half_of_a_rate_is_the_range_and_no_scale_error():
    half = turned().triad(RATE) * np.array([1.0, 1.0, 0.5])
    said = calibrated(with_rates(half)).outcome
    assert float(said.split("gyroscope z reads ")[1].split()[0]) == pytest.approx(0.5, rel=0.02)
    golden_text(said)


def test_an_axis_that_leans_by_thirty_degrees_is_told():
    M = np.eye(3) + np.array([[0, 0, 0], [0.6, 0, 0], [0, 0, 0]])
    said = calibrated(with_rates(turned().triad(RATE) @ M.T)).outcome
    assert float(said.split("gyroscope y reads ")[1].split()[0]) == pytest.approx(0.6, abs=0.02)
    golden_text(said)


def test_gyroscopes_two_of_which_read_nothing_have_no_size():
    made = hand(TRUTH, NOISE, 8)
    still = replace(made, noise={"gyroscope": NOISE})
    one = {**made.channels, **{(RATE, a): 0 * made.channels[RATE, a] for a in "xy"}}
    calibration = inertial_unit(replace(still, channels=one))
    assert "after the turns gravity is missed" in calibration.outcome.lower()
    assert "gyro_scale_factor" not in {p.effect for p in calibration.parameters}
