"""What a cause costs if it is left out: a drift a nautical mile, an absorbed bias nothing, and silence elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal import diagnose
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.cost import _with_daily_swing, with_cost
from gimbalcal.diagnose.result import Finding
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.estimate.extra_effects import extra_effects
from gimbalcal.estimate.systematic.calibrate import systematic
from gimbalcal.navigate.stationary_base import still_base
from gimbalcal.pipeline import three_stage
from gimbalcal.recording import Site
from gimbalcal.simulate import simulate
from gimbalcal.words.diagnosis_sentences import cost_in_words
from tests.diagnose.small import FIT
from tests.estimate.systematic.table import turning_unit
from tests.golden import golden_text

PLACE = {"latitude": {"value": 40.0, "unit": "deg"}}
NOISE = {"accelerometer": {"value": 3.0, "unit": "ug"}, "gimbal_angle": {"value": 0.3, "unit": "arcsec"},
         "attitude": {"value": 0.3, "unit": "arcsec"}}  # fmt: skip


def static_run(truth):
    return simulate({
        "format": 1, "kind": "static-run", "site": PLACE, "noise": NOISE,
        "truth": {"draw": True, "factor": 0.2, **truth},
        "schedule": {"duration": {"value": 24.0, "unit": "h"}, "rate": {"value": 1 / 300, "unit": "Hz"}},
        "environment": {"temperature": {"shape": "ramp", "mean": 20.0, "rate": 0.2}},
    }, 5)[0]  # fmt: skip


def diagnosed(recording, *words):
    """A diagnosis that has found these effects, with their refit."""
    made = three_stage([recording], more=extra_effects(words, [recording], ()))
    effects = [w.partition(":")[0].partition(",")[0] for w in words]

    def without(effect):
        others = [w for w, e in zip(words, effects, strict=True) if e != effect]
        return three_stage([recording], more=extra_effects(others, [recording], ()))

    findings = tuple(named(e, "x") for e in effects)
    return Diagnosis("missing-physics", (), findings, (), FIT, calibration=made, without=without)


def named(effect, axis):
    return Finding(effect, axis, 0.9, 10.0, ())


def test_a_drift_left_out_costs_what_it_drifts():
    run = static_run({"gyro_drift": {"polar": 0.002}})
    (found,) = with_cost([run], diagnosed(run, "gyro_drift")).findings
    cost = found["cost"]
    # 0.048 deg at 40 deg N are 2.2 n mile; the fit of 24 h spreads half of it over the platform's turn
    assert 0.8 < cost["without_nmi"] < 2.4
    assert cost["with_nmi"] < 0.05
    assert cost["hours"] == pytest.approx(24, abs=0.1)
    golden_text(cost["in_words"])


def test_what_the_others_take_up_costs_nothing():
    run = static_run({"case_rotation_residue": {"A": {"polar": 1.0}}})
    (found,) = with_cost([run], diagnosed(run, "case_rotation_residue,period=8")).findings
    golden_text(found["cost"]["in_words"])


def test_of_positions_a_still_base_is_navigated_through_the_recorded_temperatures():
    device = simulate({
        "format": 1, "kind": "multi-position", "site": PLACE, "noise": NOISE,
        "schedule": {"name": "wu2018-18", "dwell": {"value": 1.0, "unit": "min"}, "rate": {"value": 0.1, "unit": "Hz"}},
        "truth": {"draw": True, "factor": 0.2, "bias_temperature": {"x": 20.0}},
        "environment": {"temperature": {"shape": "ramp", "mean": 20.0, "rate": 10.0}},
    }, 5)[0]  # fmt: skip
    (found,) = with_cost([device], diagnosed(device, "bias_temperature:x")).findings
    # 20 ug/degC over 3 degC: 30 ug either way are 190 m
    assert 0.05 < found["cost"]["without_nmi"] < 0.3
    assert 0 < found["cost"]["with_nmi"] < 0.5 * found["cost"]["without_nmi"]


def test_a_still_base_warms_and_cools_once_a_day_through_what_was_recorded():
    base = still_base(24.0, Site(latitude=0.7))
    logged = replace(base, channels={("temperature", ""): np.linspace(20.0, 30.0, len(base.time))})
    swung = _with_daily_swing(base, [logged])
    hours, degrees = swung.time / 3600, swung.channels["temperature", ""]
    assert np.interp([0.0, 6.0, 12.0, 18.0, 24.0], hours, degrees) == pytest.approx([25.0, 30.0, 25.0, 20.0, 25.0])
    assert (degrees.min(), degrees.max()) == pytest.approx((20.0, 30.0))


def test_where_no_navigator_can_be_run_nothing_is_said():
    run = static_run({"gyro_drift": {"polar": 0.002}})
    found = diagnosed(run, "gyro_drift")
    assert with_cost([run, run], found).findings[0].cost is None
    nothing = Diagnosis("adequate", (), (), (), FIT)
    assert with_cost([run], nothing) is nothing


def test_of_a_unit_turned_in_its_place_a_still_unit_is_navigated():
    """30 states take a g-sensitivity for a bias, which is wrong as soon as the unit stands still."""
    wanted = [p for p in parameters(CATALOGUE["gyro_g_sensitivity_rate"]) if p.axis == "yz"]
    run = turning_unit(parameters=wanted, values=[1e-6], stop=12.0, speed=30.0, ramp=0.5, rate=10.0, seed=3)
    made = systematic(run, "30", more=extra_effects(("gyro_g_sensitivity_rate:yz",), [run], ()))
    d = Diagnosis("missing-physics", (), (named("gyro_g_sensitivity_rate", "yz"),), (), FIT, calibration=made,
                  without=lambda _: systematic(run, "30"))  # fmt: skip
    (found,) = with_cost([run], d).findings
    cost = found["cost"]
    assert cost["hours"] == pytest.approx(24, abs=0.2)
    assert cost["without_nmi"] > 1.0  # 0.2 deg/h
    assert cost["with_nmi"] > 0
    golden_text(cost["in_words"])


@pytest.mark.parametrize(
    ("known", "left_out", "raw", "words"),
    [
        (4.9, 1.0, None, "off by up to 1 n mile if it is left out, less than the 4.9 n mile (one sigma)"),
        (
            1e-5,
            2e-3,
            None,
            "off by up to 3.7 m if it is left out; with it in the calibration 0.019 m (one sigma) stay open",
        ),
        (
            0.03,
            20.0,
            3.5,
            "20 n mile if it is left out, 0.03 n mile with it in the calibration, only 3.5 n mile without",
        ),
    ],
)
def test_a_cost_reads_as_what_it_is(known, left_out, raw, words):
    assert words in cost_in_words(24.0, known, left_out, raw)


def test_a_static_run_from_end_to_end():
    """A residue of the case rotation at 8 min: located, named, its size, and what it costs; nothing, as it is fast."""
    run = simulate({
        "format": 1, "kind": "static-run", "site": PLACE, "noise": NOISE,
        "truth": {"draw": True, "factor": 0.2, "case_rotation_residue": {"A": {"polar": 1.5}, "period": 8.0}},
        "schedule": {"duration": {"value": 10.0, "unit": "h"}, "rate": {"value": 1 / 150, "unit": "Hz"}},
    }, 5)[0]  # fmt: skip
    told = diagnose([run])
    assert told.verdict == "missing-physics"
    assert any("period of 8" in m["in_words"] for m in told.mismatch)
    (found,) = told.findings
    assert found["effect"] == "case_rotation_residue"
    sine = next(p for p in found["parameters"] if (p["name"], p["axis"]) == ("case_rotation_sin", "polar"))
    assert sine["value"] == pytest.approx(1.5, abs=4 * sine["sigma"])
    assert found["cost"]["without_nmi"] == pytest.approx(found["cost"]["with_nmi"], rel=0.1)
    assert found["cost"]["uncalibrated_nmi"] > found["cost"]["with_nmi"]
