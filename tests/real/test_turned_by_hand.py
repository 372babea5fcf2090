"""Real units turned by hand, motion included: the systematic filter against a calibration from rests and turns."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gimbalcal.calibration.correction import correct
from gimbalcal.estimate.systematic.calibrate import systematic
from gimbalcal.estimate.unit import inertial_unit
from gimbalcal.units import to_si
from tests.golden import golden_text
from tests.real.recordings import recording

WANDER = {"xsens": (200, 60), "mikoff": (2000, 80)}  # flicker of both triads, ug and deg/h, as the innovations ask for
LATITUDE = np.radians(45.4)


@cache
def in_the_hand(name):
    """The recording as its rests and turns calibrate it, for a navigator: what remains to be found is nothing."""
    made = recording(name)
    return replace(
        correct(inertial_unit(made), made), kind="rotation", position=None, site=replace(made.site, latitude=LATITUDE)
    )


def found(name, wandering=True, latitude=LATITUDE):
    made = in_the_hand(name)
    force, rate = WANDER[name]
    noise = {"accelerometer_flicker": to_si(force, "ug"), "gyroscope_flicker": to_si(rate, "deg/h")}
    site = replace(made.site, latitude=latitude)
    return systematic(replace(made, noise=noise if wandering else {}, site=site), "30")


@pytest.mark.parametrize("name", ["xsens", "mikoff"])
def test_what_rests_and_turns_taught_is_found_again_with_every_sample_of_the_motion(name):
    c = found(name)
    assert c.outcome == ""
    assert np.sqrt(np.mean((c.values / c.sigmas) ** 2)) < 1.3  # 21 numbers; the other calibration has its errors too
    by_hand, north = c.provenance["limits"]
    assert by_hand == "a hand turned the unit and carried it along, so its velocity is taken as zero at the stops alone"
    assert north.endswith("these gyroscopes hardly see the Earth turn")


def test_biases_that_wander_are_asked_for():
    c = found("xsens", wandering=False)
    golden_text(c.outcome)


def test_the_latitude_does_not_matter_where_north_is_not_seen():
    here, there = found("xsens"), found("xsens", latitude=0.0)
    assert np.abs((here.values - there.values) / here.sigmas).max() < 0.3
