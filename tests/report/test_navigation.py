"""The page of a systematic calibration."""

import copy
from dataclasses import replace

import numpy as np

from gimbalcal.estimate.systematic.calibrate import systematic
from gimbalcal.report.calibration_page import calibration_report
from gimbalcal.report.sections import innovations_by_leg, navigation_facts, navigation_pictures, sigma_over_time
from gimbalcal.words.calibration_sentences import navigation_checks
from tests.estimate.systematic.table import turning_unit
from tests.golden import page_text


def test_the_page_of_a_systematic_calibration(golden):
    recording = turning_unit(stop=10.0)
    c = systematic(recording, "30")
    origin = replace(c.provenance, recordings=(), created="2026-11-22T10:00:00+00:00")
    golden("pages/systematic", page_text(calibration_report(replace(c, provenance=origin), (recording,))))
    n = copy.deepcopy(dict(c.residual.navigation))
    changed = replace(c, residual=replace(c.residual, navigation=n))
    n["nis"]["ratio"], n["nees"]["position"], n["rejected"], n["whiteness"]["lag_one"] = 4.0, 40.0, 2, 0.5
    worse = navigation_checks(changed)
    n["nis"]["ratio"], n["rejected"], n["whiteness"]["lag_one"] = 0.2, 400, -0.5
    golden("sentences/navigator", "\n".join(c["sentence"] for c in worse + navigation_checks(changed)))
    without = replace(c, residual=replace(c.residual, navigation={}))
    assert navigation_pictures(without) == navigation_facts(without) == navigation_checks(without) == []


def test_each_effect_has_a_panel():
    groups = {("bias", "µg"): {"x": [3.0, 1.0], "y": [2.0, 1.0]}, ("gyro bias", "°/h"): {"x": [1.0, 0.1]}}
    drawn = sigma_over_time(np.array([0.0, 600.0]), groups)
    assert [c.title for c in drawn] == ["bias  [µg]", "gyro bias  [°/h]"]
    assert [c.x_label for c in drawn] == ["time [min]"] * 2
    assert len(drawn[0].marks) == 2
    legs = innovations_by_leg(["stop 1", "turn 1", "stop 2"], np.zeros((3, 3)))
    assert legs.y_label == "innovation [σ]"
