"""Charts: what is drawn where, and the SVG that it becomes."""

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from gimbalcal.report import figures
from gimbalcal.report.chart import Chart, Line, Points, Words, envelope, limits, log_ticks, tick_words, ticks
from gimbalcal.report.figures import correlation
from gimbalcal.report.svg import svg
from gimbalcal.words.rounding import sensible_time

RNG = np.random.default_rng(7)


def points(chart):
    return [m for m in chart.marks if isinstance(m, Points)]


def test_residuals_have_units_on_every_chart_and_circle_what_is_far():
    after = RNG.normal(size=(18, 3))
    after[4, 1] = 20.0
    names = [str(i) for i in range(1, 19)]
    charts = figures.residuals_by_position(names, 100 * after, after, np.ones((18, 3)), "xyz", "µg")
    assert [c.y_label for c in charts] == ["[µg]"] * 6
    circled = [m.x.tolist() for c in charts for m in points(c) if m.shape == "ring"]
    assert circled == [[4.0]]
    assert points(charts[3])[0].names[4] == "position 5, y: +20.0 µg"


def test_titles_give_the_rms():
    before, after = np.full((6, 1), 280.0), np.array([[3.0], [-3.0]] * 3)
    first, second = figures.residuals_by_position(list("123456"), before, after, None, ["|f| − g"], "µg")
    assert "280 µg rms" in first.title
    assert "3.00 µg rms" in second.title


@pytest.mark.parametrize(("low", "high"), [(-0.31, 0.94), (0.0, 1e-9), (-4e5, 3e6), (17.2, 22.8), (-1e-30, 1e-30)])
def test_ticks_are_round_and_within(low, high):
    at = ticks(low, high)
    assert 2 <= len(at) <= 8
    assert low - 1e-9 * (high - low) <= at[0]
    assert at[-1] <= high + 1e-9 * (high - low)
    assert len(set(tick_words(at))) == len(at)  # no two of them read alike


def test_logarithmic_ticks_are_powers_with_parts_between_where_few():
    assert [w for _, w in log_ticks(-2.0, 3.0)] == ["0.01", "0.1", "1", "10", "100", "1000"]
    assert [w for _, w in log_ticks(0.0, 1.0)] == ["1", "2", "5", "10"]
    assert [w for _, w in log_ticks(-7.5, 0.5)] == ["10⁻⁶", "10⁻⁴", "0.01", "1"]


@pytest.mark.parametrize(("seconds", "unit"), [(40, "s"), (1000, "min"), (86400, "h"), (30 * 86400, "days")])
def test_time_is_told_in_a_unit_that_a_person_reads(seconds, unit):
    assert sensible_time(np.array([0.0, seconds]))[1] == unit


def test_a_spike_of_a_long_curve_is_drawn():
    y = np.zeros(100_000)
    y[31_337] = 5.0
    x, drawn = envelope(np.arange(100_000.0), y)
    assert len(drawn) <= 1200
    assert drawn.max() == 5.0
    assert abs(x[drawn.argmax()] - 31_337) < 500


def test_every_mark_lies_within_its_frame_and_equal_charts_are_equal_text():
    x = np.linspace(-3.0, 9.0, 40)
    chart = Chart((Points(x, np.sin(x), spread=np.full(40, 0.3)), Line(x, 2 * np.cos(x), "c1", "model")), "t", "x", "y")
    text = svg(chart)
    assert text == svg(chart)
    left, top, wide, high = map(float, re.search(r'data-axes="([^"]*)"', text)[1].split()[4:8])
    for circle in ET.fromstring(text).iter("circle"):
        assert left <= float(circle.attrib["cx"]) <= left + wide
        assert top <= float(circle.attrib["cy"]) <= top + high


def test_what_a_user_named_is_escaped_in_a_chart():
    chart = Chart((Points(np.zeros(1), np.zeros(1), names=["<script>"], label='"&'),), "<b>", "<i>", x_names=["<u>"])
    ET.fromstring(svg(chart))
    assert not re.search("<(script|b|i|u)>", svg(chart))


def test_empty_constant_and_missing_values_are_drawn():
    for y in (np.array([]), np.full(3, 7.0), np.array([1.0, np.nan, np.inf]), np.zeros(3)):
        x = np.arange(float(y.size))
        for log in (False, True):
            assert "nan" not in svg(Chart((Points(x, y), Line(x, y)), log_y=log)).replace("data-name", "")


def test_correlation_writes_strong_values_into_their_cells():
    matrix = np.array([[1.0, -0.72, 0.1], [-0.72, 1.0, 0.0], [0.1, 0.0, 1.0]])
    text = str(correlation("abc", matrix))
    assert re.findall(r'class="in"[^>]*>([^<]*)<', text) == ["−.7", "−.7"]
    assert "a with b: −0.72" in text
    assert "b with c" not in text


def test_letters_of_many_correlations_fit_their_rows():
    for count in (3, 30, 90):
        text = str(correlation([f"bias {i}" for i in range(count)], np.eye(count)))
        letter = float(re.search(r"font-size:([\d.]+)px", text)[1])
        cell = float(re.search(r'rect [^>]*width="([\d.]+)"', text)[1])
        assert letter < cell + 1


def test_stages_may_leave_a_parameter_out():
    chart = figures.dots_by_name(
        ["bias x", "K x"], {"coarse": np.array([0.1, np.nan]), "joint": np.array([0.01, 0.5])}, "σ", "of its prior σ"
    )
    assert chart.log_x
    assert [m.label for m in points(chart)] == ["coarse", "joint"]
    assert svg(chart).count("<circle") == 2  # one in the legend, one known
    assert limits(chart)[0][0] < -2


def test_what_is_left_over_time_is_measured_minus_fitted():
    t = np.linspace(0, 24, 50)
    _, rest = figures.over_time(t, [figures.Curve("roll", "arcsec", np.sin(t) + 2.0, np.sin(t), 0.5)])
    assert points(rest)[0].y == pytest.approx(np.full(50, 2.0), abs=1e-12)  # rounding of a sum of two doubles
    assert "2.00 arcsec" in rest.title


def test_positions_on_the_equator_are_drawn_once():
    gravity = np.array([[0, 0, 1.0], [1.0, 0, 0], [0, 0, -1.0], [1.0, 0, -1e-9]])
    _, up, down = figures.schedule(["1", "2", "3", "4"], np.zeros((4, 2)), ("inner", "outer"), gravity)
    assert [m.words for m in up.marks if isinstance(m, Words)] == [["1", "2,4"]]
    assert [m.words for m in down.marks if isinstance(m, Words)] == [["3"]]


def test_arrows_on_the_sky_point_where_the_star_was_seen():
    """A star in the south at 45 deg, off along: its arrow goes up to the zenith; off across: to the side."""
    for across, along, direction in ((0.0, 1.0, (0.0, 1.0)), (1.0, 0.0, (1.0, 0.0))):
        chart = figures.sky(*(np.array([v]) for v in (180.0, 45.0, across, along)), "arcsec", ["star 1"])
        (arrow,) = [m for m in chart.marks if isinstance(m, Line) and m.colour == "c1"]
        moved = np.array([arrow.x[1] - arrow.x[0], arrow.y[1] - arrow.y[0]])
        assert moved / np.linalg.norm(moved) == pytest.approx(direction, abs=1e-12)
