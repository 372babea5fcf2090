"""A unit that is turned from stop to stop: what its navigator does wrong names what 30 states leave out."""

import re

import numpy as np
import pytest

from gimbalcal import calibrate, diagnose, load_effects
from gimbalcal.calibration import Calibration, Residual
from gimbalcal.diagnose.laws.law_file import source_text
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.units import from_si, to_si
from gimbalcal.views.segments import turned_in_place
from tests.estimate.systematic.table import turning_unit
from tests.golden import golden_text

SHORT = {"stop": 12.0, "speed": 30.0, "ramp": 0.5, "rate": 10.0}  # 4 min


def _hiding(effect, axis, size, **more):
    wanted = [p for p in parameters(CATALOGUE[effect]) if p.axis == axis]
    return turning_unit(parameters=wanted, values=[size], **{**SHORT, **more})


def test_clean():
    d = diagnose([turning_unit(**SHORT)])
    assert d.verdict == "adequate"
    assert d.fit["chi2_reduced_before"] == pytest.approx(1, abs=0.15)
    noise = d.fit["chi2_of_samples_before"]
    assert all(0.6 < x < 1.3 for x in noise.values())


@pytest.mark.parametrize(
    ("effect", "axis", "size"),
    [
        ("gyro_g_sensitivity_rate", "zx", 1e-6),
        ("cross_coupling", "yz", 3e-5),
        ("accelerometer_lever_arm", "zz", 0.03),
        ("gyro_scale_asymmetry", "y", 3e-4),
    ],
)
def test_what_is_left_out_is_named(effect, axis, size):
    d = diagnose([_hiding(effect, axis, size, seed=3)])
    assert [(f["effect"], f["axis"]) for f in d.findings] == [(effect, axis)]
    assert d.verdict == "missing-physics"
    (told,) = [p for p in d.findings[0]["parameters"] if p["axis"] == axis]
    (unit,) = {p.unit for p in parameters(CATALOGUE[effect]) if p.axis == axis}
    assert abs(told["value"] - from_si(size, unit)) < 4 * told["sigma"]
    assert d.fit["heldout_rms_after"] < d.fit["heldout_rms_before"]


@pytest.fixture(scope="module")
def late():
    return diagnose([_hiding("gyro_latency", "", 5e-4, rate=20.0)])


def test_which_triad_is_late_is_left_open(late):
    (found,) = late.findings
    assert {found["effect"], *found["twins"]} == {"gyro_latency", "time_tag_latency"}
    assert abs(abs(found["parameters"][0]["value"]) - 0.5) < 4 * found["parameters"][0]["sigma"]


def test_the_calibration_is_that_of_the_filter_with_what_was_found(late):
    made = late.calibration
    assert {late.findings[0]["effect"], "bias", "gyro_bias"} <= {p.effect for p in made.parameters}
    assert made.residual.chi2 / made.residual.dof == pytest.approx(1, abs=0.2)


def test_a_noise_larger_than_stated_is_no_physics():
    rng = np.random.default_rng(8)
    d = diagnose([turning_unit(drift=lambda t: 3e-3 * rng.standard_normal((len(t), 3)), **SHORT)], grade="navigation")
    assert d.verdict == "adequate"
    golden_text(d.outcome)


@pytest.mark.parametrize("seed", [1, 2])
def test_gyroscopes_that_wander_are_no_physics_and_what_states_it_is_said(seed):
    """The walk adds up to 0.6 of the noise of a sample; where no noise walks it is a drift, or any smooth course."""
    r = turning_unit(seed=seed, **SHORT)
    n, lasts = len(r.time), float(np.ptp(r.time))
    walk = 0.6 * r.noise["gyroscope"] / lasts**0.5  # rad/s/sqrt(s)
    steps = walk * (lasts / n) ** 0.5 * np.random.default_rng(100 + seed).standard_normal((3, n))
    rates = {("angular_rate", a): r.channels["angular_rate", a] + np.cumsum(steps[i]) for i, a in enumerate("xyz")}
    d = diagnose([r.with_channels(rates)])
    assert (d.verdict, d.findings, d.unexplained, d.laws) == ("adequate", (), (), ())
    told = re.search(
        r"The gyroscopes wander, each by a random walk of (\S+) \+- (\S+) deg/h/sqrt\(h\); state", d.outcome
    )
    assert told is not None
    size, sigma = (float(x) for x in told.groups())
    assert abs(size - from_si(walk, "deg/h/sqrt(h)")) < 3 * sigma < 3 * size


def test_a_drift_is_none_of_a_walk():
    d = diagnose([_hiding("gyro_bias_drift", "y", to_si(8.0, "deg/h/h"), seed=3)])
    assert [(f["effect"], f["axis"]) for f in d.findings] == [("gyro_bias_drift", "y")]
    assert d.verdict == "missing-physics"


@pytest.mark.usefixtures("own_catalogue")
def test_a_law_of_no_catalogue_is_found_and_carried_by_the_filter(tmp_path):
    def wave(t):
        return 2e-3 * np.stack([0 * t, np.sin(2 * np.pi * t / 47), 0 * t], axis=-1)

    r = turning_unit(drift=wave, **SHORT)
    d = diagnose([r])
    assert d.verdict == "unexplained"
    assert d.unexplained[0]["channel"] == "specific_force y"
    (law,) = (law.to_dict() for law in d.laws)
    assert (law["channel"], law["axis"], law["variables"]) == ("specific_force", "y", ["time"])
    k = next(p for p in law["parameters"] if p["name"] == "k")
    assert abs(k["value"] - 2 * np.pi / 47) < 4 * k["sigma"] < 1e-2
    assert law["with"] == f"law_specific_force_y,k={k['value']:.9g}"
    assert d.fit["heldout_after"] < 1.2
    (tmp_path / "law.py").write_text(source_text(d.laws))
    load_effects(tmp_path / "law.py")
    assert calibrate(r, more=[law["with"]]).outcome == ""


def test_a_table_that_goes_on_tilting_is_none():
    assert turned_in_place(turning_unit(**SHORT))
    assert not turned_in_place(turning_unit(**{**SHORT, "stop": 0.0}))


def test_a_calibration_from_before_holds_what_30_states_leave_out():
    """The cross-coupling of last month, given, is no cause today; nothing else hides behind it."""
    (p,) = [p for p in parameters(CATALOGUE["cross_coupling"]) if p.axis == "yz"]
    known = Calibration(
        "systematic", with_values((), [p], np.array([3e-5])), (p,), np.array([[1e-12]]), (), Residual(0.0, 1, {})
    )
    d = diagnose([_hiding("cross_coupling", "yz", 3e-5, seed=3)], known)
    assert d.verdict == "adequate"
    assert d.findings == ()
