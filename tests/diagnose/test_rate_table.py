"""Gyroscopes on a rate table: what their readings at steady rates lack against the angles of the table."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from gimbalcal.diagnose.entry import diagnose
from gimbalcal.diagnose.laws.law_file import source_text
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.loading import temporarily_loaded
from gimbalcal.errors import InputError
from gimbalcal.pipeline import load
from gimbalcal.recording import write
from gimbalcal.units import from_si, to_si
from gimbalcal.words.diagnosis_headline import headline
from tests.estimate.gyroscopes.test_rate_table import run
from tests.paths import ROOT
from tests.stimuli import static

pytestmark = pytest.mark.usefixtures("own_catalogue")


def with_temperature(r, added=0.0):
    """A recording whose temperature swings, and the rate about z with `added` [rad/s per K^2 and rad/s] to it."""
    T = 23 + 4 * np.sin(2 * np.pi * r.time / (0.8 * r.time[-1]) + 0.4)
    w = np.gradient(r.channels["gimbal_angle", "table"], r.time)
    z = r.channels["angular_rate", "z"] + added * w * (T - 24) ** 2
    return replace(r, channels={**r.channels, ("angular_rate", "z"): z, ("temperature", ""): T}), T


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_clean_table_is_adequate_and_what_it_does_not_turn_about_is_not_estimated(axis):
    d = diagnose([run(axis, 11)])
    assert d.verdict == "adequate"
    scales = {p.axis for p in d.calibration.parameters if p.effect == "gyro_scale_factor"}
    assert scales == {axis}


def test_an_asymmetry_of_the_scale_is_named_with_a_sigma_that_holds():
    error = []
    for seed in range(10):
        (finding,) = diagnose([run("z", 300 + seed, asymmetry=2e-4)]).findings
        assert (finding.effect, finding.axis) == ("gyro_scale_asymmetry", "z")
        (size,) = finding.parameters
        error.append((size.value - 200.0) / size.sigma)
    assert 0.5 < np.sqrt(np.mean(np.square(error))) < 1.6


def test_a_law_of_rate_and_temperature_is_found_and_calibrated():
    r, _ = with_temperature(run("z", 21), added=3e-5)
    d = diagnose([r])
    assert d.verdict == "unexplained"
    assert {v for law in d.laws for v in law.variables} == {"rate_z", "temperature"}
    assert any(p.effect == "law_angular_rate_z" for p in d.calibration.parameters)
    assert d.calibration.residual.rms["angular_rate"] < 1.3 * clean_rms(21)


def with_added(r, axis, value):
    """Return a recording with `value` [rad/s] of the time and the angle of the table added to a gyroscope."""
    key = ("angular_rate", axis)
    return r.with_channels({key: r.channels[key] + value(r.time, r.channels["gimbal_angle", "table"])})


@pytest.mark.parametrize(("waves", "seed"), [(1, 22), (8, 23)])
def test_a_pattern_in_the_angle_of_the_table_is_found(waves, seed):
    """The table turns many times in a stretch of steady turning."""
    size = 5e-3 * np.pi / 180
    (law,) = diagnose([with_added(run("z", seed), "x", lambda _, a: size * np.cos(waves * a + 0.4))]).laws
    assert (law.axis, law.variables) == ("x", ("table",))
    amplitude = np.hypot(*[p.value for p in law.parameters]) * np.pi / 648000
    assert amplitude == pytest.approx(size, rel=0.15)


def test_an_event_within_a_stretch_is_found_where_it_begins():
    r = with_added(run("z", 24), "y", lambda t, _: 2e-2 * np.pi / 180 * (t > 60) * np.exp(-np.maximum(t - 60, 0) / 20))
    (law,) = diagnose([r]).laws
    assert (law.axis, law.variables) == ("y", ("time",))
    assert float(law.expression.split("time - ")[1].split(")")[0]) == pytest.approx(60, abs=2)


@pytest.mark.parametrize("seed", [0, 7])
def test_rates_that_are_not_set_as_commanded_are_no_formula(seed):
    """Each stretch of the table is off by three standard errors of its mean, in all gyroscopes independently."""
    r = run("z", 40_000 + seed)
    w = np.gradient(r.channels["gimbal_angle", "table"], r.time)
    stretch = np.cumsum(np.abs(np.diff(np.round(w, 3), prepend=w[0])) > 0.02)
    rates = {}
    for i, axis in enumerate("xyz"):
        x, white = r.channels["angular_rate", axis], np.random.default_rng(seed + 1000 * i).standard_normal
        scatter = 1.05 * np.median(np.abs(np.diff(r.channels["angular_rate", "z"])))
        rates["angular_rate", axis] = (
            x + (3 * scatter * white(stretch[-1] + 1) / np.sqrt(np.bincount(stretch)))[stretch]
        )
    d = diagnose([r.with_channels(rates)])
    assert (d.verdict, d.findings, d.laws) == ("adequate", (), ())


@pytest.mark.parametrize("seed", [9, 21])
def test_a_slow_random_walk_of_all_gyroscopes_is_no_drift(seed):
    r = run("z", 70_000 + seed)
    walk = np.cumsum(np.random.default_rng(seed).standard_normal((3, len(r.time))), axis=1) / len(r.time) ** 0.5
    rates = {
        ("angular_rate", a): r.channels["angular_rate", a] + 2e-3 * np.pi / 180 * walk[i] for i, a in enumerate("xyz")
    }
    assert diagnose([r.with_channels(rates)]).verdict == "adequate"


def clean_rms(seed):
    """The residual of the same table without the law, SI."""
    d = diagnose([run("z", seed)])
    return float(np.sqrt(np.mean([x**2 for x in d.calibration.residual.rms.values()])))


def test_mountings_are_diagnosed_jointly():
    d = diagnose([run(axis, 31 + k) for k, axis in enumerate("xyz")])
    assert d.verdict == "adequate"
    assert {p.axis for p in d.calibration.parameters if p.effect == "gyro_scale_factor"} == {"x", "y", "z"}
    (finding,) = diagnose([run(axis, 31 + k, asymmetry=3e-4) for k, axis in enumerate("xyz")]).findings
    assert finding.effect == "gyro_scale_asymmetry"


def test_a_mounting_that_is_given_twice_is_refused(tmp_path):
    r = run("z", 41)
    with pytest.raises(InputError, match="given twice"):
        diagnose([r, r])
    write(r, tmp_path / "one")
    write(r, tmp_path / "two")
    with pytest.raises(InputError, match="given twice"):
        diagnose(list(load([tmp_path / "one", tmp_path / "two"])))


def test_accelerometers_on_a_table_are_said_not_to_be_analysed():
    r = run("z", 43, force=True)
    d = diagnose([r])
    assert "The accelerometers were not analysed" in d.in_words
    with pytest.raises(InputError, match="gyroscopes alone"):
        diagnose([r], baseline=["bias", "scale_factor"])


def test_a_table_that_stands_is_refused_with_what_to_do():
    r = run("z", 5)
    still = replace(r, channels={k: 0 * v if k[0] == "gimbal_angle" else v for k, v in r.channels.items()})
    with pytest.raises(InputError, match="turn it at steady rates"):
        diagnose([still])


def test_a_law_without_a_closed_form_is_a_table_with_a_band():
    """A wave in the rate, in print, as law.py adds it, and in a sentence."""
    r = run("z", 25)
    w = np.gradient(r.channels["gimbal_angle", "table"], r.time)
    d = diagnose([with_added(r, "z", lambda _t, _a: 8e-4 * np.sin(w / np.radians(12.0)))])
    (law,) = d.to_dict()["laws"]
    jsonschema.validate(d.to_dict(), json.loads((ROOT / "docs/schemas/diagnosis.schema.json").read_text()))
    assert (law["expression"], law["form"], law["variables"]) == ("table", "table(rate_z)", ["rate_z"])
    table = law["parameters"]
    assert len(table["knots"]) == len(table["values"]) == len(table["sigma"]) >= 4
    assert (table["values"][0], table["sigma"][0], table["unit"]) == (0.0, 0.0, "deg/h")
    assert [table["knots"][0], table["knots"][-1]] == law["domain"]["rate_z"]
    rate = np.zeros((50, 3))
    rate[:, 2] = np.radians(np.linspace(1.2 * table["knots"][0], 1.2 * table["knots"][-1], 50))
    with temporarily_loaded("law.py", source_text(d.laws)) as (effect,):
        slopes = {p.name: np.array([to_si(p.value, p.unit)]) for p in d.laws[0].parameters}
        added = CATALOGUE[effect](**slopes).contribution(replace(static(step=48 * 3600 / len(rate)), rate=rate))[:, 2]
    stated = np.interp(np.degrees(rate[:, 2]), table["knots"], table["values"])
    assert from_si(added, "deg/h") == pytest.approx(stated, abs=1e-6 * np.ptp(stated))
    assert "a function of rate z without a closed form: 0 °/h at −" in headline(d)


def test_constants_of_a_law_are_sought_where_rates_of_a_table_are_not_mixed():
    """A torquer whose error grows with the power 1.4 of the rate, of which the scale factor takes the most part."""
    r = run("z", 28)
    w = np.degrees(np.gradient(r.channels["gimbal_angle", "table"], r.time))
    (law,) = diagnose([with_added(r, "z", lambda _t, _a: 3e-6 * np.sign(w) * np.abs(w) ** 1.4)]).laws
    (power,) = [p for p in law.parameters if p.name == "p"]
    assert law.form == "a*sign(rate_z)*Abs(rate_z)**p"
    assert power.value == pytest.approx(1.4, abs=0.1)
