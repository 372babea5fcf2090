"""A plan to learn a law: what it shows that usual positions do not, and that the law is then found."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.design.learning import design_learning
from gimbalcal.design.rig_positions import rig_of
from gimbalcal.diagnose import diagnose
from gimbalcal.earth import G0
from gimbalcal.errors import InputError
from gimbalcal.platform import KNOWN
from gimbalcal.schedule import EIGHTEEN_POSITIONS, SCHEDULES
from gimbalcal.schedule.file import read_schedule, schedule_toml
from gimbalcal.simulate import simulate
from tests.golden import refused

RIG = rig_of("space-stable", 90.0, 1.0)


def recorded(schedule, temperature, seed):
    """Positions in which accelerometer y saturates in temperature, which no effect of the catalogue does."""
    names = schedule.platform.axis_names
    holds = [{n: float(np.rad2deg(a)) for n, a in zip(names, h.angles, strict=True)} for h in schedule.holds]
    r, _ = simulate({
        "format": 1, "kind": "multi-position", "seed": seed, "truth": {"draw": True, "factor": 0.5},
        "schedule": {"holds": holds, "dwell": {"value": schedule.holds[0].duration, "unit": "s"},
                     "rate": {"value": 0.05, "unit": "Hz"}},
        "environment": {"temperature": temperature, "thermometer_sigma": 0.01},
        "noise": {"accelerometer": {"value": 10, "unit": "ug"}, "gimbal_angle": {"value": 1, "unit": "arcsec"}},
    })  # fmt: skip
    law = 30e-6 * G0 * np.tanh((r.channels["temperature", ""] - 23.0) / 2.0)
    key = ("specific_force", "y")
    return r.with_channels({key: r.channels[key] + law})


def test_a_law_in_temperature_is_found_in_the_planned_positions_and_not_in_the_usual_ones(tmp_path):
    plan = design_learning(RIG, 18, ("temperature",))
    law = plan.law
    assert law.share > 0.3 > 0.05 > law.usual["wu2018-18"]
    (tmp_path / "schedule.toml").write_text(schedule_toml(plan.schedule) + law.toml)
    schedule = read_schedule(tmp_path / "schedule.toml")
    period = {"value": law.period, "unit": "s"}
    sine = {"shape": "sinusoid", "mean": law.mean, "amplitude": law.amplitude, "period": period}
    d = diagnose([recorded(schedule, sine, 1)])
    assert [(w.axis, w.variables, w.alternatives) for w in d.laws] == [("y", ("temperature",), ())]
    usual = replace(EIGHTEEN_POSITIONS, holds=tuple(replace(h, duration=1600.0) for h in EIGHTEEN_POSITIONS.holds))
    d = diagnose([recorded(usual, {"shape": "ramp", "mean": 15.0, "rate": 2.5}, 1)])
    assert "time" in d.recommend
    assert "temperature" in d.recommend
    assert not d.laws or d.laws[0].alternatives


def test_a_product_of_a_gimbal_and_temperature_is_imitated_less_than_in_usual_positions():
    law = design_learning(RIG, 18, ("temperature", "platform")).law
    assert law.share > 5 * law.usual["wu2018-18"]
    assert "temperature and platform" in law.in_words


def test_without_temperature_none_is_asked_for():
    law = design_learning(RIG, 12, ("platform",)).law
    assert (law.toml, law.hours, "°C" in law.in_words) == ("", 2.0, False)


@pytest.mark.parametrize("setting", [None, 5.0])
@pytest.mark.parametrize("name", [name for name, platform in KNOWN.items() if platform.axes])
def test_every_gimbal_is_compared_with_schedules_of_its_own_platform_alone(name, setting):
    """A gimbal of another platform is another axis, even where it has the same name."""
    rig = rig_of(name, 90.0, setting)
    own = {s.name for s in SCHEDULES.values() if s.platform.name == name}
    turned = np.ptp(rig.candidates(), axis=0) > 0
    for learn in np.array(rig.platform.axis_names)[turned].tolist():
        law = design_learning(rig, 4, (learn,)).law
        assert law.usual.keys() == own


@pytest.mark.parametrize("learn", [("pressure",), ("time", "time"), ("time", "platform", "inner")])
def test_variables_that_a_plan_does_not_have_are_refused(learn):
    with refused():
        design_learning(RIG, 12, learn)


@pytest.mark.parametrize(("platform", "gimbal"), [("rate-table", "table"), ("alt-az", "azimuth")])
def test_a_gimbal_that_positions_do_not_turn_is_refused(platform, gimbal):
    with pytest.raises(InputError, match=f"--learn {gimbal}: positions do not turn this gimbal"):
        design_learning(rig_of(platform, 90.0, 1.0), 8, (gimbal,))
