"""The error budget: parts that add up, twins that cost nothing, manoeuvres that shorten bars, refusals."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.design.budget import Budget, budget, still_base
from gimbalcal.earth import normal_gravity
from gimbalcal.errors import InputError
from gimbalcal.navigate.run import navigated
from gimbalcal.pipeline import three_stage
from gimbalcal.recording import Site
from gimbalcal.simulate import simulate


@cache
def of(*scenarios: str, more: tuple[str, ...] = ()) -> Budget:
    return budget(scenarios, (6.0, 24.0), more)


def test_what_is_only_known_in_a_sum_that_position_asks_for_costs_nothing() -> None:
    """The triad turned about z with the platform gimbal's zero: 69 arcsec each, and no reading or position depends."""
    rows = {r["parameter"]: r for r in of("wu2018-18").to_list()}
    assert rows["gimbal_zero:platform"]["sigma"] > 60
    assert rows["gimbal_zero:platform"]["position_error_m_after_h"]["24"] < 0.2
    assert rows["misalignment:zy"]["position_error_m_after_h"]["24"] > 10


def test_bars_are_in_order_and_none_is_longer_than_the_whole() -> None:
    made = of("wu2018-18")
    parts = [r["position_error_m_after_h"]["24"] for r in made.to_list()]
    assert parts == sorted(parts, reverse=True)
    assert parts[0] <= made.whole[-1] * (1 + 1e-9)
    assert np.all(np.diff(made.whole) >= 0)
    np.testing.assert_allclose(made.share, made.parts[-1] ** 2 / made.whole[-1] ** 2)


def test_a_manoeuvre_shortens_its_bar_and_a_day_at_rest_most() -> None:
    made = of("wu2018-18")
    for part, m in zip(made.parts[-1], made.manoeuvres, strict=True):
        assert m["to_m"] < part
    assert made.manoeuvres[int(made.order[0])]["what"] == "a run of 24 h at rest"
    assert of("wu2018-18", "wu2018-static").whole[-1] < 0.1 * made.whole[-1]


def test_a_drift_that_nobody_measures_is_the_largest_bar_and_grows() -> None:
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


def test_the_budget_is_what_happens(tmp_path: Path) -> None:
    """Units simulated, calibrated and navigated: their rms position error is the whole bar, within chance."""
    (tmp_path / "s.toml").write_text(SCENARIO)
    L = np.deg2rad(40.0)
    base = still_base(6.0, Site(L, 0.0, float(normal_gravity(L))))
    squares = []
    for seed in range(10):
        device, truth = simulate(tmp_path / "s.toml", seed)
        read = Calibration("truth", truth, (), np.zeros((0, 0)), (), Residual(0, 0, {})).corrupt(base)
        squares.append(navigated(read, three_stage([device])).position ** 2)
    whole = budget([tmp_path / "s.toml"], (6.0,)).whole[-1]
    # 2 axes of 10 units: 20 squares, a third of their mean
    assert np.sqrt(np.mean(squares, axis=0).max()) == pytest.approx(whole, rel=0.33)


def test_what_has_no_budget_is_refused() -> None:
    for scenarios, sentence in (
        (["turned-unit"], "has no budget yet"),
        (["nowhere"], "nowhere"),
    ):
        with pytest.raises(InputError, match=sentence):
            budget(scenarios)
    with pytest.raises(InputError, match="no effect of that name"):
        budget(["wu2018-18"], more=("bias_temperature",))
