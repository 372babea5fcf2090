"""Slews: delays between readouts, forces and rates come back from a plant apart, and where there is none, none does."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.diagnose.estimated_noise import judged_diagnosis
from gimbalcal.diagnose.search.stepwise import stepwise
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.progress import no_progress
from gimbalcal.recording import Recording
from gimbalcal.views.core import View
from gimbalcal.views.slews import channel_delays, view_of_slews
from tests.diagnose.turned_plant import ARCSEC, DEG, G, Unit, gimballed, turned
from tests.estimate.gyroscopes.test_rate_table import RATES, run

IDEAL = Calibration("nothing", (), (), np.zeros((0, 0)), (), Residual(0.0, 0, {}))
QUICK: dict[str, Any] = {"speed": 30 * DEG, "hz": 50.0, "dwell": 4.0, "ramp": 0.3}
SLOW: dict[str, Any] = {"speed": 3 * DEG, "hz": 10.0, "dwell": 6.0}


def seen(r):
    v = view_of_slews(r, IDEAL)
    assert isinstance(v, View), v
    return v


def told(r):
    v = seen(r)
    return judged_diagnosis(stepwise(v, no_progress), no_progress)


def unit(**more):
    return Unit(linear=0.0, **more)


@pytest.mark.parametrize(
    ("late", "effect", "value"),
    [
        ({"readout": 0.05}, "readout_latency", 50.0),
        ({"force": 0.2}, "time_tag_latency", -200.0),
        ({"rate": 0.002}, "gyro_latency", -2.0),
    ],
)
@pytest.mark.parametrize("motion", [QUICK, SLOW], ids=["30 deg/s", "3 deg/s"])
def test_what_is_late_is_named_by_how_much(late, effect, value, motion):
    t = told(gimballed(1, unit(late=late), **motion))
    if motion is SLOW and abs(value) < 5:
        assert channel_delays(t.view)["rate"][1] > 1e-4  # a tenth of the delay is left to chance: nothing need be named
        assert not t.findings or t.findings[0]["effect"] == effect
        return
    assert [f["effect"] for f in t.findings] == [effect]
    assert t.findings[0]["twins"] == []
    (p,) = t.findings[0]["parameters"]
    assert abs(p["value"] - value) < 4 * p["sigma"]
    assert p["sigma"] < 0.008 * abs(value) + (0.1 if motion is QUICK else 0.5)


@pytest.mark.parametrize(
    "more",
    [{}, {"noise": (1e-4 * G, 3e-3 * DEG, 36 * ARCSEC)}, {"shakes": 0.05}, {"jitter": 0.2}, {"lever": (0.05, 0.02, 0)}],
    ids=["plain", "noise of the readouts", "shaking table", "jitter", "lever"],
)
@pytest.mark.parametrize("motion", [QUICK, SLOW], ids=["30 deg/s", "3 deg/s"])
def test_what_is_in_time_is_left_alone(more, motion):
    t = told(gimballed(2, unit(**more), **motion))
    assert t.verdict == "adequate"
    for value, sigma in channel_delays(t.view).values():
        assert abs(value) < 4 * sigma  # once in fifteen thousand


def test_errors_that_rests_and_turns_show_are_no_delay():
    """Bias, scale and misalignment of 1 % in both triads, uncorrected: a percent of a quarter turn is 150 ms of it."""
    late = channel_delays(seen(gimballed(3, Unit(late={"rate": 0.01}), **QUICK)))
    assert late["rate"][0] == pytest.approx(0.01, abs=5e-4)
    assert abs(late["force"][0]) < 1e-3


def test_each_effect_is_a_second_of_its_channel():
    v = seen(gimballed(4, unit(), **QUICK))
    ps = [p for i in ("time_tag_latency", "gyro_latency", "readout_latency") for p in parameters(CATALOGUE[i])]
    force, rate, readout = np.moveaxis(v.evaluate(()).jacobian(ps), -1, 0)
    np.testing.assert_allclose(force[:, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(rate[:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(readout, force + rate, rtol=1e-12)
    assert np.all(readout > 0)


def test_a_hand_is_no_delay_but_fifty_milliseconds_are():
    """Both triads of a unit in the hand, which pushes it by 0.3 m/s^2 while it turns it."""
    for late in (0.0, 0.05):
        r = turned(5, unit(late={"rate": late}), latitude=None)
        v = seen(r)
        value, sigma = channel_delays(v)["force"]
        assert abs(value + late) < 3 * sigma
        assert sigma < 0.008
        findings = judged_diagnosis(stepwise(v, no_progress), no_progress).findings
        assert [set(f["twins"]) | {f["effect"]} for f in findings] == [{"time_tag_latency", "gyro_latency"}] * (
            late > 0
        )


def test_what_cannot_be_judged_says_why():
    r = gimballed(6, unit(), **QUICK)
    assert view_of_slews(r.select(r.position > 0), IDEAL) == "no rows between positions were logged"
    few = r.select((r.position > 0) | (np.arange(len(r.time)) % 40 == 0))
    assert "have 6 rows or more" in str(view_of_slews(few, IDEAL))
    hand = turned(6, unit())
    bare = replace(hand, channels={k: x for k, x in hand.channels.items() if k[0] == "specific_force"})
    assert "say how the unit turned" in str(view_of_slews(bare, IDEAL))


def test_a_force_that_no_slew_moves_has_no_delay():
    """A table turns about the vertical: the delay of the rate is asked for, of the force it is noise over zero."""
    r = run("z", noise=1e-3 * DEG)
    block = np.concatenate([np.ones(250), np.zeros(600)])
    position = np.concatenate([k * block for k in range(1, 1 + len(RATES))]).astype(int)
    force = np.array([0.0, 0.0, -9.81]) + 1e-2 * np.random.default_rng(1).standard_normal((len(r.time), 3))
    channels = {**r.channels, **{("specific_force", a): force[:, i] for i, a in enumerate("xyz")}}
    level = Recording("multi-position", "table", r.platform, r.site, {}, r.time, position, channels)
    v = seen(level)
    assert [q for q, _ in v.channels] == ["angular_rate"]
    late, sigma = channel_delays(v)["rate"]
    assert abs(late) < 5 * sigma + 1e-3
    without = {k: x for k, x in channels.items() if k[0] != "angular_rate"}
    bare = Recording("multi-position", "table", r.platform, r.site, {}, r.time, position, without)
    assert view_of_slews(bare, IDEAL) == "fewer than 6 slews move gravity"
