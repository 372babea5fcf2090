"""The numbers on a page are those that were computed: their unit, sign, sigma and place, on contents made by hand."""

import re
from dataclasses import replace
from datetime import datetime
from math import nan
from types import SimpleNamespace

import numpy as np
import pytest

from gimbalcal.at_rest import ChannelNoise, Coefficient
from gimbalcal.calibration import Calibration, Provenance, Residual, StageResult
from gimbalcal.calibration.provenance import Night, NightTerm
from gimbalcal.design.budget import BestManoeuvre, Budget
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.history.compare import CalibrationStep, ComparedCalibration, PrintedComparison, PrintedHistory
from gimbalcal.report import figures
from gimbalcal.report.chart import Bars, Chart, Line, Points, limits
from gimbalcal.report.figures import correlation
from gimbalcal.report.history_page import _parameter_chart, history_report
from gimbalcal.report.navigation_page import budget_report
from gimbalcal.report.noise_page import _chart as noise_chart
from gimbalcal.report.noise_page import _rate as told_rate
from gimbalcal.report.parameters import rows, stages
from gimbalcal.report.residuals import by_position, over_time
from gimbalcal.report.sections import innovations_by_leg, night_by_night, pointing_picture
from gimbalcal.units import to_si
from tests.estimate.pointing.mounts import ALT_AZ, run
from tests.report.example import ARCSEC, example

(BIAS, *_) = parameters(CATALOGUE["bias"])
CALIBRATED = Calibration("three-stage", with_values((), [BIAS], to_si(np.array([12.0]), "ug")),
                         (replace(BIAS, sigma=float(to_si(100.0, "ug"))),), np.eye(1) * to_si(2.0, "ug") ** 2, (),
                         Residual(0.0, 0, {}))  # fmt: skip


def points(chart, colour="", shape=""):
    return [m for m in chart.marks if isinstance(m, Points) and colour in ("", m.colour) and shape in ("", m.shape)]


# --- a calibration ----------------------------------------------------------------------------------------------------


def test_an_error_is_value_less_truth_in_sigmas_and_what_moved_in_what_is_usual():
    truth = {"bias:x": float(to_si(9.0, "ug"))}
    (row,) = rows(CALIBRATED, truth)
    assert (row["value"], row["sigma"], row["unit"]) == ("12.0", "2.0", "µg")
    assert (row["error"], row["moved_text"]) == ("+1.5 σ", "+0.12 σ")


def test_a_stage_leaves_a_share_of_what_is_usual():
    each = tuple(StageResult(name, ("bias:x",), np.zeros(1), np.array([to_si(ug, "ug")]), 1e-5)
                 for name, ug in (("coarse", 20.0), ("fine", 2.0)))  # fmt: skip
    figure = stages(replace(CALIBRATED, stages=each), None)["stage_figure"]
    assert re.findall(r"bias x: ([\d.]+) of its prior", str(figure.charts[0])) == ["0.2", "0.02"]


def test_what_is_left_of_a_position_is_measured_less_modelled_where_gravity_lay():
    made, (still, run), _ = example()
    force = still.channels["specific_force", "x"] + to_si(100.0, "ug")
    more = still.with_channels({("specific_force", "x"): force})
    one, other = (by_position(r, made.effects, made.provenance, made.readout) for r in (still, more))
    np.testing.assert_allclose(other.after - one.after, np.tile([100.0, 0, 0], (len(one.labels), 1)), atol=1e-6)
    np.testing.assert_allclose(one.gravity[0], [0, 0, 1], atol=1e-6)  # position 1: z down
    _, curves = over_time(run, ())
    for curve in curves:  # without a model all that was measured is left
        np.testing.assert_allclose(curve.fitted, 0.0, atol=1e-9)


def test_blue_is_together_and_vermilion_against_each_other():
    cells = re.findall(r'class="(c\d)"[^>]*>\s*<title>(\w with \w)', str(correlation("abc", np.array(
        [[1.0, -0.7, 0.4], [-0.7, 1.0, 0.0], [0.4, 0.0, 1.0]]))))  # fmt: skip
    assert {pair: side for side, pair in cells if pair in ("a with b", "a with c")} == {
        "a with b": "c1", "a with c": "c0"
    }  # fmt: skip


# --- charts -----------------------------------------------------------------------------------------------------------


def test_a_chart_has_room_for_the_bars_of_its_points_both_ways():
    low, high = limits(Chart((Points(np.zeros(1), np.zeros(1), spread=np.ones(1)),)))[1]
    assert low < -1
    assert high > 1


def test_on_a_sky_seen_from_below_east_is_left_and_across_is_left_of_the_way_up():
    """Stars in the east and in the north at 45 deg; azimuth grows through east, which is across."""
    chart = figures.sky(*(np.array(v) for v in ([90.0, 0.0], [45.0, 45.0], [1.0, 1.0], [0.0, 0.0])), "arcsec", "ab")
    (star,) = points(chart, "c0")
    np.testing.assert_allclose([star.x, star.y], [[-0.5, 0.0], [0.0, 0.5]], atol=1e-12)
    (arrow,) = [m for m in chart.marks if isinstance(m, Line) and m.colour == "c1"]
    moved = np.array([[arrow.x[k + 1] - arrow.x[k], arrow.y[k + 1] - arrow.y[k]] for k in (0, 3)])
    np.testing.assert_allclose(moved / 0.17, [[0.0, -1.0], [-1.0, 0.0]], atol=1e-12)  # on to the south, and to the east


def test_the_first_bar_is_on_top_under_its_own_name():
    chart = figures.tornado(["longest", "short"], np.array([5.0, 1.0]), np.array([2.0, 0.5]), "m")
    planned = next(m for m in chart.marks if isinstance(m, Bars))
    assert dict(zip(planned.x.tolist(), planned.high, strict=True)) == {1.0: 5.0, 0.0: 1.0}
    assert list(chart.y_names) == ["short", "longest"]
    by_name = figures.dots_by_name(["first", "second"], {"one": np.array([0.1, 0.2])}, "σ", "of its prior")
    (dots,) = points(by_name)
    assert dict(zip(dots.y.tolist(), dots.x, strict=True)) == {1.0: 0.1, 0.0: 0.2}
    assert list(by_name.y_names) == ["second", "first"]


@pytest.mark.parametrize(("residual", "longest"), [(10.0, 30.0), (0.1, 3.0)])
def test_a_bar_ends_at_three_times_what_is_left_or_three_usual_sigmas(residual, longest):
    left = residual * np.array([1.0, -0.5, 0.2])
    panel = figures.Panel("x", "µg", np.arange(3.0), "position", left, left, np.array([1.0, 1.0, 1000.0]))
    (dots,) = points(figures.before_after([panel])[0])
    assert dots.spread.tolist() == [1.0, 1.0, pytest.approx(longest)]


def test_rings_are_turns_and_stand_where_their_innovations_do():
    z = np.arange(9.0).reshape(3, 3)
    rings = points(innovations_by_leg(["stop 1", "turn 1", "stop 2"], z), shape="ring")
    assert [r.y.tolist() for r in rings] == [[3.0], [4.0], [5.0]]
    np.testing.assert_allclose([r.x[0] for r in rings], [0.8, 1.0, 1.2])


# --- the history of a unit --------------------------------------------------------------------------------------------

DATES = [f"{year}-03-01T00:00:00+00:00" for year in (2024, 2025, 2026)]
COURSE = PrintedHistory(
    "bias", "x", "bias", "ug", (0, 1, 2), (100.0, 130.0, 115.0), (3.0, 4.0, 3.0), 0.0, 7.5, 2.0, (1,), (), "2027-01-01"
)


def test_the_page_of_a_history_tells_the_last_change_and_where_it_jumped():
    made = tuple(ComparedCalibration(d, d, "three-stage", "") for d in DATES)
    page = history_report(PrintedComparison(
        unit="u", in_words="It moved.", agree=False, common_gravity_sigma_ppm=0.0, due="2027-01-01",
        steps=(CalibrationStep(0, 1, 36.0, 1, 2e-9, False),), calibrations=made, parameters=(COURSE,),
    ))  # fmt: skip
    text = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page))
    assert "2.0 years" in text
    assert "115.0 ± 3.0" in text
    assert "−15 ± 5 −3.0" in text.replace("−15.0 ± 5.0", "−15 ± 5")
    assert "jump by 2025-03-01; due 2027-01-01" in text


def test_the_picture_of_a_course_has_two_sigmas_and_its_drift():
    chart = _parameter_chart(COURSE, [datetime.fromisoformat(d) for d in DATES], "bias x")
    dots, odd = points(chart)[:2]
    assert (dots.y.tolist(), dots.spread.tolist()) == ([100.0, 115.0], [6.0, 6.0])
    assert (odd.y.tolist(), odd.spread.tolist()) == ([130.0], [8.0])
    (line,) = [m for m in chart.marks if isinstance(m, Line)]
    assert line.y[-1] - line.y[0] == pytest.approx(2 * 7.5, rel=1e-3)
    w = np.array(COURSE.sigmas) ** -2.0
    assert np.average(line.y, weights=w) == pytest.approx(np.average(COURSE.values, weights=w))


# --- noise, nights, a budget ------------------------------------------------------------------------------------------


def test_a_chart_of_noise_has_averaging_time_below():
    none = Coefficient(nan, nan, 1.0, "ug")
    one = ChannelNoise("specific_force", "x", "", none, none, none, "ug", (1.0, 10.0), (5.0, 2.0), (0.1, 0.1),
                       (5.0, 2.0), 1.0, 1.0, 1, 0.5)  # fmt: skip
    (dots,) = points(noise_chart([one], "specific_force"))
    assert (dots.x.tolist(), dots.y.tolist()) == ([1.0, 10.0], [5.0, 2.0])
    assert (told_rate(50.0), told_rate(0.01)) == ("50 Hz", "every 100 s")


def test_a_night_tells_its_terms_and_how_they_changed():
    first = NightTerm(10.0, 1.0, "arcsec")
    second = NightTerm(4.0, 1.0, "arcsec", change=-6.0, change_sigma=2.0)
    nights = tuple(Night(t, 0.0, 9, 2.0, {"base_tilt:north": term}) for t, term in (("a", first), ("b", second)))
    told = night_by_night(replace(CALIBRATED, provenance=Provenance(nights=nights, same_terms_every_night=0.01)))
    (row,) = told["night_rows"]
    assert (row["cells"], row["changes"]) == (["10.0 ± 1.0", "4.0 ± 1.0"], ["−6.0 ± 2.0"])


def test_the_picture_of_a_mount_tells_how_far_stars_were_off_on_the_sky():
    angles = np.random.default_rng(3).uniform([0.3, 0.0], [1.3, 6.0], (30, 2))
    r = run(ALT_AZ, angles, ())
    low = r.channels["true_angle", "elevation"] + 30 * ARCSEC
    off = r.with_channels({("true_angle", "elevation"): low})
    told = pointing_picture([off], SimpleNamespace(effects=())).alt
    assert "30.0 arcsec with all terms" in told  # of which there are none
    before = told.partition(": ")[2].partition(" arcsec on the sky with zeros alone")[0]
    assert "⁻" in before or float(before) < 1e-3  # the zero of the elevation takes it all


def test_a_budget_tells_shares_in_per_cent_and_long_bars_in_kilometres():
    wanted = parameters(CATALOGUE["bias"])[:2]
    made = Budget("plan", (6.0, 24.0), wanted, np.array([p.sigma for p in wanted]) / 10, np.array([900.0, 20100.0]),
                  np.array([[800.0, 50.0], [20000.0, 2000.0]]), np.array([0.985, 0.015]),
                  (BestManoeuvre("turn it over", 1.0, 500.0),) * 2)  # fmt: skip
    page = budget_report(made)
    assert "98.5 %" in page
    assert "1.5 %" in page
    assert "position in 24 h [km]" in page
