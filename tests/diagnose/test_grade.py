"""Sizes follow the grade of the unit: MEMS on a table and in the hand, judged and calibrated by what MEMS do."""

import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.methods import calibrate
from gimbalcal.pipeline import three_stage
from tests.diagnose.grade_plant import DRIFTS, PATTERNS, of_force, on_gimbals, record
from tests.diagnose.small import telescope
from tests.golden import refused
from tests.paths import XSENS

UG = 9.80665e-6
COURSES = {"bias_drift", "warm_up", "slow_bias_drift"}


def bent(r):
    return PATTERNS["quadratic_nonlinearity"](r, 1)


def drift(name, axis):
    return of_force(axis, DRIFTS[name])


def test_a_calibration_of_mems_on_a_table_is_not_held_back_by_what_navigation_units_have():
    """2 mg/g^2 came out as 37 +- 30 ug/g^2 and chi^2 as 50 times its degrees of freedom, at 30 ug/g^2 beforehand."""
    made = three_stage([on_gimbals(3, "consumer", of_force(1, bent), 2000.0, setting=60.0)])
    (i,) = [k for k, p in enumerate(made.parameters) if p.label == "scale_nonlinearity:y"]
    assert made.outcome == ""
    assert abs(made.values[i] * 9.80665**2 / UG - 2000.0) < 3 * made.sigmas[i] * 9.80665**2 / UG
    assert made.provenance["options"]["grade"]["name"] == "consumer"


def test_a_grade_that_is_named_counts_and_is_told():
    r = on_gimbals(3, "navigation", setting=1.0)
    for name in ("", "consumer"):
        made = three_stage([r], grade=name)
        told = made.provenance["options"]["grade"]
        assert told["name"] == (name or "navigation")
        assert ("--grade" in told["from"]) == bool(name)
        (p,) = [p for p in made.parameters if p.label == "bias:x"]
        assert p.sigma == pytest.approx(500 * UG * (100 if name else 1))
    d = diagnose([r], grade="consumer")
    assert d.provenance["grade"] == told
    assert d.verdict == "adequate"


def test_a_mems_unit_on_a_table_that_lacks_nothing():
    assert diagnose([on_gimbals(1, "consumer", setting=60.0)]).verdict == "adequate"


@pytest.mark.parametrize(
    ("name", "thermometer"), [("bias_drift", False), ("warm_up short", False), ("warm_up long", True)]
)
def test_a_drift_of_mems_stands_among_what_looks_like_it(name, thermometer):
    d = diagnose([record(21, "consumer", drift(name, 1), 5000.0, thermometer=thermometer, gyros=False)])
    assert d.provenance["grade"]["name"] in ("industrial", "consumer")
    named = [{f["effect"], *f["twins"]} for f in d.findings if "y" in f["axis"]]
    assert any(name.split(maxsplit=1)[0] in each for each in named)


def test_a_bias_that_walks_is_noise_with_a_memory_or_a_drift_and_no_other_cause_alone():
    d = diagnose([record(28, "consumer", drift("slow_bias_drift", 0), 4000.0, thermometer=False, gyros=False)])
    assert all({f["effect"], *f["twins"]} & COURSES for f in d.findings)
    assert all("time" in u["shape"] or u["shape"] == "a random walk" for u in d.unexplained)


def test_sizes_that_were_found_are_those_that_were_put_in():
    d = diagnose([record(5, "tactical", of_force(2, lambda r: PATTERNS["cross_coupling"](r, 2)), 400.0, gyros=False)])
    (f,) = d.findings
    assert (f["effect"], f["axis"]) == ("cross_coupling", "z")
    assert d.provenance["grade"]["name"] == "tactical"


def test_what_has_no_grade_refuses_one():
    with refused():
        diagnose([telescope(1)], grade="tactical")
    with refused():
        diagnose([on_gimbals(1, "navigation")], grade="best")
    with refused():
        calibrate([XSENS], "multiposition", grade="tactical")
