"""The error budget: parts that add up, twins that cost nothing, manoeuvres that shorten bars, refusals."""

from functools import cache

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.design.budget import budget
from gimbalcal.design.planned_calibration import planned_calibration
from gimbalcal.earth import normal_gravity
from gimbalcal.effects import with_values
from gimbalcal.inference.information import solve
from gimbalcal.navigate.stationary_base import still_base
from gimbalcal.navigate.uncertainty import navigation_errors, usual_references
from gimbalcal.pipeline import three_stage
from gimbalcal.recording import Site
from gimbalcal.simulate import load, simulate
from gimbalcal.simulate.scenario import find
from tests.golden import golden_text, refused


@cache
def of(*scenarios, more=()):
    return budget(scenarios, (6.0, 24.0), more)


def test_what_is_only_known_in_a_sum_that_position_asks_for_costs_nothing():
    """The triad turned about z with the platform gimbal's zero: 69 arcsec each, and no reading or position depends."""
    rows = {r["parameter"]: r for r in of("wu2018-18").to_list()}
    assert rows["gimbal_zero:platform"]["sigma"] > 60
    assert rows["gimbal_zero:platform"]["position_error_m_after_h"]["24"] < 0.2
    assert rows["misalignment:zy"]["position_error_m_after_h"]["24"] > 10


def test_bars_are_in_order_and_none_is_longer_than_the_whole():
    made = of("wu2018-18")
    parts = [r["position_error_m_after_h"]["24"] for r in made.to_list()[:-1]]
    assert parts == sorted(parts, reverse=True)
    assert parts[0] <= made.whole[-1] * (1 + 1e-9)
    assert np.all(np.diff(made.whole) >= 0)
    np.testing.assert_allclose(made.share, made.parts[-1] ** 2 / made.whole[-1] ** 2)


def test_a_manoeuvre_shortens_its_bar_and_a_day_at_rest_most():
    made = of("wu2018-18")
    for part, m in zip(made.parts[-1], made.manoeuvres, strict=True):
        assert m.to_m < part
    assert made.manoeuvres[int(made.order[0])].what == "a run of 24 h at rest"
    assert of("wu2018-18", "wu2018-static").whole[-1] < 0.1 * made.whole[-1]


def test_a_drift_that_nobody_measures_is_the_largest_bar_and_grows():
    made = of("wu2018-18", more=("gyro_drift",))
    first = made.to_list()[0]
    assert first["parameter"].startswith("gyro_drift")
    grown = first["position_error_m_after_h"]
    assert grown["24"] > 2.5 * grown["6"]
    # 0.005 deg/h of prior for a day: 0.12 deg, about one Earth radius of them
    assert 0.4 < grown["24"] / (np.deg2rad(0.12) * 6.38e6) < 1.2


SCENARIO = """
format = 1
kind = "multi-position"
site = { latitude = { value = 40.0, unit = "deg" } }
[truth]
draw = true
factor = 0.2
[schedule]
name = "wu2018-18"
dwell = { value = 1.0, unit = "min" }
rate = { value = 0.1, unit = "Hz" }
[noise]
accelerometer = { value = 10.0, unit = "ug" }
gimbal_angle = { value = 1.0, unit = "arcsec" }
"""


def test_the_budget_is_what_happens(tmp_path):
    """Units simulated, calibrated and navigated: their rms position error is the whole bar, within chance."""
    (tmp_path / "s.toml").write_text(SCENARIO)
    L = np.deg2rad(40.0)
    base = still_base(6.0, Site(L, 0.0, float(normal_gravity(L))))
    squares = []
    for seed in range(10):
        device, truth = simulate(tmp_path / "s.toml", seed)
        read = Calibration("truth", truth, (), np.zeros((0, 0)), (), Residual(0, 0, {})).corrupt(base)
        squares.append(navigation_errors(read, three_stage([device])).position ** 2)
    whole = budget([tmp_path / "s.toml"], (6.0,)).whole[-1]
    # 2 axes of 10 units: 20 squares, a third of their mean
    assert np.sqrt(np.mean(squares, axis=0).max()) == pytest.approx(whole, rel=0.33)


def test_what_the_calibration_does_not_see_is_said():
    drifting = of("wu2018-18", more=("gyro_drift",))
    golden_text(drifting.in_words)
    assert {drifting.parameters[i].effect for i in drifting.unseen} == {"gyro_drift"}
    assert of("wu2018-18").unseen == ()


def test_coloured_noise_of_turns_is_refused_and_not_left_out(tmp_path):
    path = tmp_path / "s.toml"
    text = find("wei2022-30").read_text()
    path.write_text(text.replace("[noise]", '[noise]\ngyroscope_flicker = { value = 0.001, unit = "deg/h" }'))
    with refused():
        budget([path])
    path.write_text(text.replace("0.002", "0.0"))
    with refused():
        budget([path])


@cache
def of_turns(*scenarios, hours=12.0):
    return budget(scenarios, (hours,), states="30")


def test_of_turns_drift_about_the_pole_is_all_of_it():
    """The Earth turns below an axis that is wrong by what drifts about the pole, which aligning does not take up."""
    made = of_turns("wei2022-30", "wei2022-static", hours=24.0)
    sigma = {p.label: s for p, s in zip(made.parameters, made.sigma, strict=True)}
    L = np.deg2rad(30.0)
    # y points north and z up; after a day, when what goes round with the Earth is back, on the parallel
    about = np.hypot(np.cos(L) * sigma["gyro_bias:y"], np.sin(L) * sigma["gyro_bias:z"])
    assert made.whole[-1] == pytest.approx(about * 24 * 3600 * 6.38e6 * np.cos(L), rel=0.05)
    assert [r["parameter"] for r in made.to_list()[:2]] == ["gyro_bias:y", "gyro_bias:z"]
    # x points east: the attitude takes it up, and what it took comes back as it swings
    assert made.parts[-1][made.order[0]] > 500 * made.parts[-1][[p.label for p in made.parameters].index("gyro_bias:x")]


def test_how_the_unit_stands_says_which_bias_counts(tmp_path):
    turned = tmp_path / "s.toml"
    text = find("wei2022-static").read_text()
    turned.write_text(text.replace('x = "east", y = "north", z = "up"', 'x = "north", y = "west", z = "up"'))
    assert of_turns("wei2022-30", str(turned)).to_list()[0]["parameter"] == "gyro_bias:x"


def test_of_turns_a_second_session_adds_its_information():
    one, two = of_turns("wei2022-30"), of_turns("wei2022-30", "wei2022-30")
    assert two.whole[-1] == pytest.approx(one.whole[-1] / np.sqrt(2), rel=0.02)
    for part, m in zip(one.parts[-1], one.manoeuvres, strict=True):
        assert m.to_m <= part
        assert m["hours"] > 0


def test_of_turns_it_is_one_sigma_of_navigations_with_that_covariance():
    """Sensors wrong by draws from what the turns leave, navigated at rest: their rms, within chance of 20 draws."""
    made = of_turns("wei2022-30")
    plan = planned_calibration([("wei2022-30", load("wei2022-30"))], "30", (), 12.0)
    P, run = solve(plan.information).covariance, plan.base
    rng = np.random.default_rng(1)
    drawn = rng.multivariate_normal(np.zeros(len(P)), P, 20, method="eigh")
    far = []
    for x in drawn:
        effects = with_values((), made.parameters, x)
        read = Calibration("drawn", effects, (), np.zeros((0, 0)), (), Residual(0, 0, {})).corrupt(run)
        far.append(navigation_errors(read, None, usual_references(read)).position ** 2)
    assert np.sqrt(np.mean(far, axis=0).max()) == pytest.approx(made.whole[-1], rel=0.33)
