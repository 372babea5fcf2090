from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.answer import Curves
from gimbalcal.diagnose.result import Shift
from gimbalcal.report.diagnosis_page import diagnosis_report, on_the_sky, panels
from tests.report.pages import DIAGNOSIS, FIT, MISMATCH, curves


def test_changes_of_the_calibration_by_the_findings_are_listed():
    moved = (Shift("bias", "y", -34.6, 2.7, "ug", -12.84),)
    page = diagnosis_report(replace(DIAGNOSIS, fit=replace(FIT, calibration_moved=moved)))
    assert "−34.6" in page
    assert "± 2.7" in page
    assert "−12.8 σ" in page


@pytest.mark.parametrize("verdict", ["adequate", "missing-physics", "unexplained", "not-identifiable"])
def test_every_verdict_makes_a_page_that_escapes(verdict):
    hostile = (replace(MISMATCH, in_words="<script>alert(1)</script>"),)
    page = diagnosis_report(replace(DIAGNOSIS, verdict=verdict, mismatch=hostile), title="<b>rig</b>")
    assert "<script>alert" not in page
    assert "<b>rig" not in page
    assert "16.2" in page
    assert "78 % probable; 24.1 σ" in page


def test_one_thing_has_one_name():
    page = diagnosis_report(DIAGNOSIS)
    assert "K3" not in page
    assert page.count("cubic nonlinearity") >= 2


def test_positions_and_times_are_means_in_sigmas_of_one_row():
    by_position, over_time = panels(curves(), [MISMATCH])
    assert (by_position.name, by_position.x_label, by_position.unit) == ("specific force y", "position", "σ")
    assert (over_time.x_label, over_time.x[-1]) == ("time [h]", pytest.approx(359 / 60, rel=0.01))
    assert by_position.before[3] == 2.0
    assert by_position.sigma == pytest.approx(np.full(18, 1 / np.sqrt(20)), rel=0.03)  # one row of 20 is not finite
    assert np.flatnonzero(by_position.before).tolist() == [3]
    assert over_time.x.size == 240
    assert np.isfinite(over_time.before).all()


def test_residuals_stand_in_their_unit_over_what_they_may_follow():
    bare = curves()
    warm = np.linspace(15.0, 25.0, 360)
    known = replace(bare, sigma=np.full((360, 2), 5.0), units=("ug", "ug"), against={"temperature [°C]": warm})
    by_position, _, by_temperature = panels(known, [MISMATCH])
    assert by_position.unit == "µg"
    assert by_position.before[3] == 10.0  # two sigmas of 5 ug
    assert by_position.sigma == pytest.approx(np.full(18, 5 / np.sqrt(20)), rel=0.03)
    assert by_temperature.x_label == "temperature [°C]"
    assert (by_temperature.x[0], by_temperature.x[-1]) == pytest.approx((15.0, 25.0), abs=0.1)


def test_without_a_located_mismatch_the_largest_channel_is_drawn():
    assert panels(curves(), [])[0].name == "specific force x"
    assert len(panels(curves(positions=1), [])) == 1


def test_where_nothing_was_added_the_residual_is_drawn_once():
    fits = replace(curves(), after=curves().before)
    (first, *_) = panels(fits, [])
    assert not first.changed
    page = diagnosis_report(replace(DIAGNOSIS, verdict="adequate", findings=(), mismatch=(), curves=fits))
    assert "Measured minus model, as calibrated. The rms" in page
    assert " → " not in page[page.index("<figure") : page.index("<figcaption")]


def test_stars_are_drawn_on_the_sky_before_and_after():
    around, up = np.linspace(0, 350, 36), np.linspace(20, 80, 36)
    left = np.stack([np.sin(around), np.cos(around)], axis=1)
    at = (("pointing", "across"), ("pointing", "along"))
    seen = Curves(np.arange(36.0), np.arange(36), at, 9 * left, left, np.ones((36, 2)), ("arcsec", "arcsec"),
                  {"azimuth [°]": around, "elevation [°]": up})  # fmt: skip
    before, after = on_the_sky(seen)
    assert before.title.startswith("before, zenith in the middle; longest 9")
    assert after.title.startswith("after, zenith in the middle; longest 1")
    assert on_the_sky(replace(seen, against={})) == on_the_sky(curves()) == []
