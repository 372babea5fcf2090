"""Laws that no catalogue holds: found, written as effects, and these explain the recording."""

import json
import warnings
from dataclasses import replace
from functools import cache
from hashlib import sha256
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest
import sympy
from numpy.testing import assert_allclose

from gimbalcal import calibrate, load_effects
from gimbalcal.diagnose.entry import diagnose
from gimbalcal.diagnose.laws import law_claims
from gimbalcal.diagnose.laws.expressions import Expression, terms_of_variable
from gimbalcal.diagnose.laws.law_claims import (
    _evidence_without_clearest_groups,
    _is_cause,
    _rival_laws,
    _visible_columns,
    causes_replaced_by_a_formula,
    separating_manoeuvre,
)
from gimbalcal.diagnose.laws.law_curve import _held_out
from gimbalcal.diagnose.laws.law_file import source_text
from gimbalcal.diagnose.laws.law_problems import equal_stretches
from gimbalcal.diagnose.laws.law_search import Law, LawProblem, Place
from gimbalcal.diagnose.laws.variables import variables
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.result import LawResult, Shape
from gimbalcal.diagnose.search.ranking import is_usual, search
from gimbalcal.diagnose.search.refit import fit_baseline, start_with_baseline
from gimbalcal.diagnose.search.stepwise import result_of
from gimbalcal.diagnose.view_result import shapes_with_laws
from gimbalcal.effects import CATALOGUE, Stage
from gimbalcal.pipeline import load
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site, write
from gimbalcal.report.diagnosis_page import diagnosis_report
from gimbalcal.views.known_attitude import view_at_known_attitude
from gimbalcal.words.diagnosis_headline import headline
from tests.benchmarks import unknown_hand, unknown_mount
from tests.benchmarks.law_plants import corrected, misfit, parallactic, simulated, size_of
from tests.benchmarks.law_set import LAWS
from tests.diagnose import plant, static_plant
from tests.golden import golden_text
from tests.paths import ROOT

LAW = LawResult("angular_rate", "z", ("time",), "", "", "deg/h", "", (), {}, {}, 0.0, 0.0, 0.0, (), "", "", ())
SCHEMA = ROOT / "docs" / "schemas" / "diagnosis.schema.json"

pytestmark = pytest.mark.usefixtures("own_catalogue")


def sky(error, arcsec):
    """A run of 90 stars on an alt-azimuth mount."""
    return unknown_mount.record(5, unknown_mount.Setup(stars=90), ((error, arcsec * unknown_mount.ARCSEC),))


def explained(d, r, there):
    """chi^2 over its degrees of freedom of the calibration with the laws, whose outcome has to be empty."""
    (there / "law.py").write_text(source_text(d.laws))
    made = calibrate(r, more=load_effects(there / "law.py"))
    assert made.outcome == ""
    return made.residual.chi2 / made.residual.dof


def evaluated(d, n=200):
    """The expression of the first law, random values of its variables within the domain, and its values there."""
    law = d.laws[0].to_dict()
    e = sympy.sympify(law["expression"])
    assert {str(v) for v in e.free_symbols} == set(law["variables"]) == set(law["domain"]) == set(law["units"])
    rng = np.random.default_rng(0)
    at = {v: rng.uniform(*law["domain"][v], n) for v in law["variables"]}
    return e, at, np.asarray(sympy.lambdify(law["variables"], e)(*at.values()))


def test_a_law_of_a_mount_is_found_written_and_explains_the_run(tmp_path, command):
    r = sky(lambda k: {"readout": np.column_stack([np.cos(2 * k.inner) * np.sin(3 * k.outer), 0 * k.t])}, 40.0)
    write(r, tmp_path / "run")
    assert command("diagnose", tmp_path / "run", "--quiet", "--out", tmp_path / "d") == 1
    content = json.loads((tmp_path / "d" / "diagnosis.json").read_text())
    jsonschema.validate(content, json.loads(SCHEMA.read_text()))
    (law,) = content["laws"]
    assert (law["channel"], law["axis"]) == ("gimbal_angle", "azimuth")
    assert "cos(2*elevation)*sin(3*azimuth)" in law["form"]
    assert content["recommend"] == ""
    assert law["heldout_after"] == content["fit"]["heldout_after"] < 1.2 < law["heldout_before"]
    with_it = ("--effects", tmp_path / "d" / "law.py", "--with", law["effect"])
    assert command("calibrate", tmp_path / "run", *with_it, "--quiet", "--out", tmp_path / "c") == 0
    page = (tmp_path / "d" / "report.html").read_text()
    assert "law.py" in page


def softly(b):
    """A step of output y that is 0.6 degrees wide, at 23.2 degC of the plant's body."""
    return plant.on(1, np.tanh((b.body - 23.2) / 0.6))


@cache
def stepped():
    """A recording with such a step of 50 ug, and its diagnosis."""
    r = plant.record(np.random.default_rng(3), softly, 50 * plant.UG)
    return r, diagnose([r])


def test_the_calibration_of_a_diagnosis_contains_the_law(tmp_path, command, capsys):
    first, second, clean = (plant.record(np.random.default_rng(seed), softly, size * plant.UG)
                            for seed, size in ((3, 50.0), (4, 50.0), (4, 0.0)))  # fmt: skip
    for r, name in ((first, "first"), (replace(second, title="second"), "second")):
        write(r, tmp_path / name)
    before = set(CATALOGUE)
    assert command("diagnose", tmp_path / "first", "--quiet", "--out", tmp_path / "d") == 1
    assert set(CATALOGUE) == before  # a law of one recording changes nothing for the next
    made = tmp_path / "d" / "calibration.json"
    content = json.loads(made.read_text())
    (file,) = content["provenance"]["effects"]
    assert file["sha256"] == sha256((tmp_path / "d" / "law.py").read_bytes()).hexdigest()
    assert {"law_specific_force_y_a", "law_specific_force_y.x0"} <= {p["name"] for p in content["parameters"]}
    assert command("apply", tmp_path / "second", "--calibration", made, "--out", tmp_path / "no") == 2
    assert "--effects law.py" in capsys.readouterr().err
    with_it = ("--effects", tmp_path / "d" / "law.py", "--quiet", "--out")
    assert command("apply", tmp_path / "second", "--calibration", made, *with_it, tmp_path / "yes") == 0
    corrected = load([tmp_path / "yes"])[0]
    assert misfit(corrected)[0] < misfit(clean)[0] + 16 < misfit(second)[0] / 2


def laws_as_calibrated(name, sigmas):
    """The diagnosis of a law of the benchmark, each number of its law with that of the calibration in its files."""
    law, seed = LAWS[name], 289
    d = diagnose([simulated(seed, law, size_of(seed, law, sigmas))])
    (found,) = d.laws
    estimated = {e.parameter.name: e for e in d.calibration.estimates}
    each = {p.name: estimated.get(f"{found.effect}_{p.name}") or estimated[f"{found.effect}.{p.name}"]
            for p in found.parameters}  # fmt: skip
    return d, found, each


def test_a_law_and_its_calibration_have_one_set_of_numbers():
    """Sizes and constants are one fit with one covariance: a size is as uncertain as the knee lets it be."""
    _, law, calibrated = laws_as_calibrated("knee in f", 60.0)
    size, knee = law.parameters
    for p in law.parameters:
        assert_allclose((p.value, p.sigma), (calibrated[p.name].value, calibrated[p.name].sigma), rtol=1e-12)
    assert f"{size.value:.6g}" in law.expression
    assert f"{knee.value:.6g}" in law.expression
    assert size.sigma > 2 * abs(size.value) / 60  # the knee is free
    assert abs(knee.value - 0.35) < 3 * knee.sigma


def test_a_law_of_turns_adds_nothing_at_rest():
    """What it would add there is part of the bias, which the rests determine."""
    law, seed = LAWS["amplifier saturates"], 289
    r = simulated(seed, law, size_of(seed, law, 60.0))
    d, found, _ = laws_as_calibrated("amplifier saturates", 60.0)
    bias = {e.parameter.label: e for e in calibrate([r]).estimates if e.parameter.effect == "gyro_bias"}
    own = {e.parameter.label: e for e in d.calibration.estimates if e.parameter.effect == "gyro_bias"}
    for label, e in bias.items():
        assert_allclose((own[label].value, own[label].sigma), (e.value, e.sigma), rtol=1e-6)
    (width,) = (p for p in found.parameters if p.name == "w")
    assert abs(width.value - np.degrees(0.6)) < 3 * width.sigma


def test_where_a_law_jumps_has_the_sigma_of_the_diagnosis():
    """No fit follows a jump: its instants are held in the calibration, where each has sigma zero."""
    _, law, calibrated = laws_as_calibrated("square wave in t", 60.0)
    for p in law.parameters[1:]:
        assert calibrated[p.name].sigma == 0.0
        assert p.value == calibrated[p.name].value
        assert p.sigma > 0.0


def test_a_law_scales_with_what_is_felt():
    """A large scale factor at the reference of the temperature, of which the law is a part, changes no coefficient."""
    law, seed = LAWS["spring softens by T squared"], 58
    size = size_of(seed, law, 60.0)
    (found,) = diagnose([simulated(seed, law, size)]).laws
    assert found.form == "a*force_x*(temperature - 20) + b*force_x*(temperature - 20)**2"
    _, square = found.parameters
    assert abs(square.value - 1e6 * size) < 2 * square.sigma
    assert square.sigma < 0.03 * square.value


def test_the_curve_of_a_law_goes_through_what_the_recording_shows():
    d = stepped()[1]
    (law,) = d.laws
    c = law.curve
    assert c.x_label == "temperature [degC]"
    noise = np.std(c.observed - c.law)
    truth = 50 * np.tanh((c.x - 23.2) / 0.6)  # the thermometer reads the body of the plant with an offset
    assert np.corrcoef(c.law, truth)[0, 1] > 0.99
    assert abs(np.mean(c.observed - c.law)) < 5 * noise / np.sqrt(len(c.x))
    assert np.all(c.sigma < 0.1 * np.ptp(c.law))
    assert "curve" not in law.to_dict()
    assert "formula for specific force y" in diagnosis_report(d)
    assert np.nanstd(c.predicted - c.law) < 0.2 * np.std(c.law)
    assert np.isfinite(c.predicted).mean() > 0.7


def test_what_a_law_predicts_is_fitted_to_the_other_rows():
    """Rows that are left out by additions of any size are the rows that a fit to the others never sees."""
    o = fit_baseline(view_at_known_attitude(plant.record(np.random.default_rng(4), dwell=20)))
    block, seen = o.view.noise.block, variables(o.rows.seen[Stage.ACCELEROMETER])
    place = Place("specific_force", "z", seen, o.view.stimulus, block, lambda X: X[:, None, :])
    follows = next(v for v in seen if v.name == "force_x")
    law = Law((place,), Expression((terms_of_variable(follows, o.view.stimulus, ("x^3",))[0],)), 50.0, ())
    n, rng = len(block), np.random.default_rng(5)
    B, one = law.expression.columns, np.ones((n, 1))
    y = 2 * B[:, 0] + np.std(B) * rng.standard_normal(n)
    Q = one / np.sqrt(n)
    g = LawProblem([place], lambda X: X.reshape(-1, X.shape[-1]), Q, y - Q @ (Q.T @ y), None, (n, 1))
    x = np.linalg.lstsq(g.remainder(B), g.y, rcond=None)[0]
    predicted = _held_out(law, x[None], True, g)[0]
    rank = np.argsort(np.argsort(np.bincount(block, follows.x) / np.bincount(block)))
    part = (rank * 5 // len(rank))[block]
    assert set(part) == set(range(5))
    changed = []
    for k in range(5):
        elsewhere, value = part != k, B @ x
        size = np.linalg.lstsq(np.concatenate([B, one], axis=1)[elsewhere], y[elsewhere], rcond=None)[0][:1]
        moved = B @ size + np.mean((value - B @ size)[elsewhere])
        assert_allclose(predicted[part == k], moved[part == k], rtol=1e-9, atol=1e-9 * np.std(B))
        changed.append(abs(float(size[0] - x[0])))
    assert max(changed) > 0.01


def test_a_law_is_flagged_where_it_is_extrapolated():
    r, d = stepped()
    calibration = d.calibration
    assert calibration.apply(r).remarks == r.remarks
    warmer = {**r.channels, ("temperature", ""): r.channels["temperature", ""] + 10}
    (remark,) = calibration.apply(replace(r, channels=warmer)).remarks[len(r.remarks) :]
    assert "extrapolates law_specific_force_y: temperature from 3" in remark


def test_a_strong_law_is_no_random_walk():
    """A bump of 12 sigmas of a row in time: a walk may have made it, of 27 numbers where the bump has four."""
    bump = lambda b: plant.on(1, np.exp(-(((b.t - 1300.0) / 170.0) ** 2)))  # noqa: E731
    d = diagnose([plant.record(np.random.default_rng(376), bump, 208 * plant.UG, rows=120)])
    (law,) = d.laws
    assert law.known_effects == ()
    assert {p.name: p.value for p in law.parameters} == pytest.approx({"a": 208, "x0": 1300, "w": 170}, rel=0.05)
    assert "wanders" not in d.outcome


def test_what_follows_the_temperature_in_any_way_is_predicted(tmp_path):
    """A law of the temperature of no particular form is told by a formula or a table that predicts a second run."""
    knots, values = np.linspace(20.0, 26.5, 9), np.array([0.0, 1.0, -1.2, 0.4, 1.1, -0.3, -1.0, 0.9, 0.0])
    free = lambda b: plant.on(2, np.interp(b.body, knots, values))  # noqa: E731
    first, second, clean = (plant.record(np.random.default_rng(seed), free, size * plant.UG, rows=120)
                            for seed, size in ((3, 60.0), (4, 60.0), (4, 0.0)))  # fmt: skip
    d = diagnose([first])
    (law,) = d.laws
    assert law.variables == ("temperature",)
    left, whole = (misfit(r)[0] - misfit(clean)[0] for r in (corrected(second, [law.to_dict()]), second))
    assert left < 0.1 * whole
    assert explained(d, first, tmp_path) < 1.3


def test_a_cause_is_not_sure_where_formulas_are_likelier():
    """A preamplifier that saturates is much like an odd quadratic, and a hyperbolic tangent fits it better."""
    made = unknown_hand.Setup(thermometer=True, rests=44)

    def tanh(h):
        return {"force": np.outer(np.tanh(2 * h.f[:, 0]), [1.0, 0, 0])}

    seed = 696
    size = 30 / unknown_hand.strength(seed, made, tanh)
    d = diagnose([unknown_hand.record(seed, made, ((tanh, size),))])
    assert not [f for f in d.findings if f.probability >= 0.5]


def test_what_is_on_between_two_instants_is_found_to_a_row():
    relay = lambda b: plant.on(2, 1.0 * ((b.t > 1500.0) & (b.t < 1860.0)))  # noqa: E731
    (law,) = diagnose([plant.record(np.random.default_rng(5), relay, 75 * plant.UG, rows=120)]).laws
    assert law.form.startswith("a*(Heaviside(time - 1")
    e, t = sympy.sympify(law.expression), sympy.Symbol("time")
    on = [float(e.subs(t, x)) for x in (1480.0, 1515.0, 1845.0, 1895.0)]
    assert np.abs(on) == pytest.approx([0.0, 75.0, 75.0, 0.0], rel=0.1, abs=0.1)


def test_what_acts_on_two_axes_is_two_laws(tmp_path):
    r = sky(lambda k: {"tilt": np.column_stack([np.cos(3 * k.azimuth), np.sin(3 * k.azimuth)])}, 10.0)
    d = diagnose([r])
    assert [law.axis for law in d.laws] == ["elevation", "azimuth"]
    assert explained(d, r, tmp_path) < 1.2


def test_a_wave_and_its_period_are_found_in_18_positions(tmp_path):
    wave = lambda b: plant.on(1, np.sin(2 * np.pi * b.t / 660.0 + 1))  # noqa: E731
    r = plant.record(np.random.default_rng(3), wave, 4e-4, rows=120)
    d = diagnose([r])
    assert d.verdict == "unexplained"
    law = d.laws[0].to_dict()
    k = next(p for p in law["parameters"] if p["name"] == "k")
    assert law["axis"] == "y"
    assert abs(k["value"] - 2 * np.pi / 660) < 4 * k["sigma"] < 4e-4
    _, at, found = evaluated(d)
    truth = 4e-4 / plant.UG * np.sin(2 * np.pi * at["time"] / 660 + 1)
    assert np.abs(found - truth).max() < 0.15 * np.abs(truth).max()
    assert d.fit["chi2_reduced_after"] < 1.1 < d.fit["chi2_reduced_before"]
    assert explained(d, r, tmp_path) < 1.1


def test_a_threshold_is_found_in_a_static_run(tmp_path):
    r = static_plant.record(np.random.default_rng(3), lambda r: np.outer(r.T > 23, [1.0, 0, 0]), 17 * plant.UG)
    d = diagnose([replace(r, title='a "day" \\ """ with\nquotes {x}')])
    e, _, _ = evaluated(d)
    (step,) = e.atoms(sympy.Heaviside)
    T = next(iter(e.free_symbols))
    assert str(T) == "temperature"
    assert sympy.solve(step.args[0], T)[0] == pytest.approx(23.0, abs=0.05)
    assert explained(d, r, tmp_path) < 1.1


def test_a_law_of_the_field_that_turns_is_one_of_the_parallactic_angle(tmp_path):
    """The angle between the vertical and the hour circle, by an independent solution of the triangle at the star."""
    r = sky(lambda k: {"readout": np.column_stack([0 * k.t, np.sin(2 * parallactic(k) + 0.7)])}, 12.0)
    d = diagnose([r])
    (law,) = d.laws
    assert (law.axis, law.variables) == ("elevation", ("parallactic_angle",))
    assert "2*parallactic_angle" in law.form
    assert explained(d, r, tmp_path) < 1.2


def test_what_is_on_in_working_hours_is_no_walk_of_the_sensor():
    """The force holds the first harmonic of a day, so that higher ones have to lead to the wave that is switched."""
    on = lambda r: np.outer(np.abs(np.mod(r.t / 3600.0, 24.0) - 12.5) < 4.5, [1.0, 0, 0])  # noqa: E731
    d = diagnose([static_plant.record(np.random.default_rng(5), on, 17 * plant.UG)])
    (law,) = d.laws
    assert law.axis == "x"
    assert law.form.startswith("a*sign(cos(")
    assert any("time" in own for own in (law.form, *law.alternatives))


def test_an_instant_is_told_to_a_row():
    r = static_plant.record(
        np.random.default_rng(106), lambda r: np.outer((r.t > 100000) * r.ideal[:, 0], [0, 0, 1.0]), 19 * plant.UG
    )
    law = diagnose([r]).laws[0].to_dict()
    (step,) = sympy.sympify(law["expression"]).atoms(sympy.Heaviside)
    assert law["form"] == f"a*force_x*{step}"
    assert sympy.solve(step.args[0])[0] == pytest.approx(100000, abs=600)


def test_a_law_of_all_axes_has_one_form_and_a_size_for_each(tmp_path):
    sizes = (25.0, -17.5, 12.5)
    waves = lambda b: {"output": np.outer(np.sin(2 * np.pi * b.body / 1.3), sizes)}  # noqa: E731
    r = plant.record(np.random.default_rng(8), waves, plant.UG, rows=120)
    d = diagnose([r])
    assert d.verdict == "unexplained"
    assert [law.axis for law in d.laws] == ["x", "y", "z"]
    assert {(law.form, law.effect, law.with_) for law in d.laws} == {
        ("a*cos(k*temperature + phi)", "law_specific_force", "law_specific_force")
    }
    T = np.linspace(*d.laws[0].domain["temperature"], 50)
    for law, size in zip(d.laws, sizes, strict=True):
        value = sympy.lambdify("temperature", sympy.sympify(law.expression))(T)
        assert np.abs(value - size * np.sin(2 * np.pi * T / 1.3)).max() < 0.2 * abs(size)
        assert np.nanstd(law.curve.observed - law.curve.law) < 22  # a sample has 20 ug of noise
    assert source_text(d.laws).count("class ") == 1
    assert explained(d, r, tmp_path) < 1.1


def test_a_law_of_all_gyroscopes_is_found_in_noise_of_unknown_scale():
    """Rates follow the temperature of a chamber, in noise of unknown scale and memory."""
    rng = np.random.default_rng(4)
    T = np.linspace(0.0, 65.0, 29)
    rate = 250 * np.outer(np.tanh((T - 30.0) / 15.0), [0.5, -1.0, 0.7]) + 30 * rng.standard_normal((29, 3))
    channels = {("angular_rate", a): rate[:, i] * np.pi / 648000 for i, a in enumerate("xyz")}
    channels |= {("specific_force", a): np.full(29, 9.81 * (a == "z")) for a in "xyz"}
    channels["temperature", ""] = T
    r = Recording("multi-position", "chamber", BENCH, Site(), {}, 240.0 * np.arange(29), np.arange(1, 30), channels)
    for effect in [i for i in CATALOGUE if i.startswith("gyro_bias_")]:
        del CATALOGUE[effect]
    d = diagnose([r], baseline=("gyro_bias",))
    assert d.verdict == "unexplained"
    assert [law.axis for law in d.laws] == ["x", "y", "z"]


def test_recordings_of_one_unit_have_one_law():
    def error(r):
        return np.outer(np.abs(r.ideal[:, 0]) * (r.T - 20), [0, 1.0, 0])

    r = static_plant.record(np.random.default_rng(16), error, 14 * plant.UG)
    first = np.arange(len(r.time)) < len(r.time) // 2
    d = diagnose([r.select(first), r.select(~first)])
    assert d.verdict == "unexplained"
    (law,) = (law.to_dict() for law in d.laws)
    assert law["form"] == "a*Abs(force_x)*(temperature - 20)"
    (size,) = law["parameters"]
    assert abs(size["value"] - 14 / (9.80146 / 9.80665)) < 4 * size["sigma"] < 3
    assert d.fit["chi2_reduced_after"] < 1.1 < d.fit["chi2_reduced_before"]
    assert [row["heldout_after"] < row["heldout_before"] for row in d.fit["recordings"]] == [True, True]


def test_a_law_of_another_size_in_each_recording_is_none():
    r = static_plant.record(
        np.random.default_rng(16),
        lambda r: np.outer(np.abs(r.ideal[:, 0]) * (r.T - 20) * np.where(r.t < 86400, 1, 0.4), [0, 1.0, 0]),
        14 * plant.UG,
    )
    first = np.arange(len(r.time)) < len(r.time) // 2
    d = diagnose([r.select(first), r.select(~first)])
    assert d.verdict == "unexplained"
    assert d.laws == ()
    golden_text(d.recommend)


def test_what_tells_a_law_from_the_next_is_taken_from_the_menu():
    r = plant.record(np.random.default_rng(4), dwell=20)
    o = fit_baseline(view_at_known_attitude(r))
    place = Place(
        "specific_force",
        "z",
        variables(o.rows.seen[Stage.ACCELEROMETER]),
        o.view.stimulus,
        o.view.noise.block,
        lambda X: X,
    )
    x, *follows = (next(v for v in place.variables if v.name == n) for n in ("force_x", "time", "temperature"))

    def law(v):
        plain = [terms_of_variable(v, o.view.stimulus, ("x",))[0] for v in (x, v)]
        return Law((place,), Expression(tuple(plain)).referred().without([0]), 50.0, ())

    time, warm = map(law, follows)
    told = separating_manoeuvre(o, warm, np.array([30 * plant.UG / plant.G]), time)
    golden_text(told)
    assert separating_manoeuvre(o, warm, np.array([1e-3 * plant.UG / plant.G]), time).startswith(
        "No manoeuvre of the menu"
    )


def test_a_law_that_leaves_no_rest_takes_the_place_of_a_cause_that_does(tmp_path):
    r = static_plant.record(
        np.random.default_rng(18), lambda r: np.outer(r.ideal[:, 1] * np.exp(-r.t / 15000), [1.0, 0, 0]), 76 * plant.UG
    )
    d = diagnose([r])  # much like a warm-up, which leaves a rest
    assert d.verdict == "unexplained"
    assert not d.findings
    law = d.laws[0].to_dict()
    tau = next(p for p in law["parameters"] if p["name"] == "tau2")
    assert law["form"] == "a*force_y*exp(-time/tau2)"
    assert abs(tau["value"] - 15000) < 4 * tau["sigma"] < 9000
    assert explained(d, r, tmp_path) < 1.1


def test_what_has_a_name_keeps_it_beside_a_law(tmp_path):
    """The cube of a cosine is the cosine, which eccentricity has, and its third harmonic."""
    r = sky(lambda k: {"readout": np.column_stack([np.cos(k.outer) ** 3, 0 * k.t])}, 16.0)
    d = diagnose([r])
    (law,) = (law.to_dict() for law in d.laws)
    assert law["form"] == "a*cos(3*azimuth) + b*sin(3*azimuth)"
    a, b = law["parameters"]
    assert abs(a["value"] + 4.0) < 5 * a["sigma"] < 2 or abs(a["value"] - 4.0) < 5 * a["sigma"] < 2
    assert abs(b["value"]) < 4 * b["sigma"]
    assert law["known_effects"] == ["encoder_eccentricity:azimuth"]
    (tmp_path / "law.py").write_text(source_text(d.laws))
    load_effects(tmp_path / "law.py")
    made = calibrate(r, more=[*law["known_effects"], law["with"]])
    assert made.outcome == ""
    told = headline(d)
    golden_text(told)


def test_none_is_named_where_nothing_small_fits():
    rng = np.random.default_rng(2)
    steps = rng.standard_normal(18)
    d = diagnose([plant.record(rng, lambda b: plant.on(0, steps[b.visit]), 3e-4, rows=120)])
    assert d.verdict == "unexplained"
    assert not d.laws
    assert d.recommend
    assert d.to_dict()["laws"] == []


def test_the_calibration_with_a_law_is_of_the_rows_that_were_diagnosed():
    r = sky(lambda k: {"readout": np.column_stack([np.cos(2 * k.inner) * np.sin(3 * k.outer), 0 * k.t])}, 40.0)
    elevation = r.channels["gimbal_angle", "elevation"].copy()
    elevation[33] += 4000 * unknown_mount.ARCSEC  # one star that is not the one it is taken for
    d = diagnose([replace(r, channels={**r.channels, ("gimbal_angle", "elevation"): elevation})])
    clean = diagnose([r]).calibration
    assert d.laws
    assert "was omitted" in d.in_words
    for name, rms in clean.residual.rms.items():
        assert d.calibration.residual.rms[name] < 1.2 * rms


def test_a_given_calibration_stays_in_the_model_with_a_law():
    def cubic(b):
        return 8 * np.outer(b.ideal[:, 2] ** 3, [0.0, 0.0, 1.0])

    def both(b):
        return {"output": cubic(b) + np.outer(np.tanh((b.body - 23.2) / 0.6), [0.0, 1.0, 0.0])}

    def recorded(seed, error):
        return plant.record(np.random.default_rng(seed), error, 50 * plant.UG, unit=np.random.default_rng(77))

    known = calibrate(recorded(4, lambda b: {"output": cubic(b)}), more=["cubic_nonlinearity:z"])
    d = diagnose([recorded(3, both)], calibration=known)
    effects = {p.effect for p in d.calibration.parameters}
    assert {"cubic_nonlinearity", "law_specific_force_y"} <= effects
    assert d.calibration.residual.chi2 < 1.1 * d.calibration.residual.dof


def test_a_column_that_shows_in_no_row_is_not_visible():
    """A threshold that no row passes adds nothing anywhere: its norm is zero."""
    o = fit_baseline(view_at_known_attitude(plant.record(np.random.default_rng(1), None, 0.0)))
    columns = np.zeros((*o.residual.shape, 2))
    columns[..., 1] = np.random.default_rng(2).standard_normal(o.residual.shape)
    assert _visible_columns(o, columns) == 1


def bare_mount():
    """Return the fit of a mount without errors before anything is sought."""
    mount = unknown_mount.record(3, unknown_mount.Setup())
    return start_with_baseline(mount.kind.view_of(mount, ()).without_nuisances())


def test_a_formula_that_spans_a_cause_is_no_rival_of_it():
    """The cause and something beside it, not something in its place, as what holds none of it would be."""
    made = search(bare_mount())
    (name,) = (c.key for c in made.library.candidates if c.effect == "tube_flexure")
    (index,) = (v.index for c in made.library.candidates if c.key == name for v in c.variants)
    own = made.fit.expanded(made.library.X[:, list(index)])
    other = made.fit.residual[:, :, None]  # all that there is to explain

    def rivals(columns):
        return _rival_laws(made, [SimpleNamespace(columns=columns)], {name})

    assert not rivals(own)
    assert not rivals(np.concatenate([own, other], axis=2))
    assert rivals(other)
    nearly = own + 1e-3 * np.std(own) * np.random.default_rng(2).standard_normal(own.shape)
    assert not rivals(nearly)
    each = (SimpleNamespace(columns=x) for x in (nearly, other, np.concatenate([own, other], axis=2)))
    assert [_is_cause(made, law, name) for law in each] == [True, False, False]


def test_a_law_that_two_stars_show_is_none():
    """Without the two stars that show it most nothing is left of it; what every star shows stays."""
    quiet = search(bare_mount())
    (index,) = (v.index for c in quiet.library.candidates if c.effect == "tube_flexure" for v in c.variants)
    sag = quiet.fit.expanded(quiet.library.X[:, list(index)])
    own = quiet.fit.residual + 2 * np.std(quiet.fit.residual) / np.std(sag) * sag[..., 0]
    own[[7, 20], 0] += 10 * np.std(quiet.fit.residual)
    made = search(replace(quiet.fit, residual=own))
    stars = np.zeros_like(sag)
    stars[[7, 20], 0] = 1.0
    followed, everywhere = (
        _evidence_without_clearest_groups(made, SimpleNamespace(columns=x, evidence=20.0, cost=10.0))
        for x in (stars, sag)
    )
    assert followed < 0
    assert everywhere > 10


def test_causes_that_every_rig_has_are_not_compared_with_formulas(monkeypatch):
    """No formula takes their place; formulas in what they leave say nothing of them."""
    o = bare_mount()
    usual = [c for c in assemble_library(o).candidates if is_usual(c, "pointing")]
    monkeypatch.setattr(law_claims, "search", None)
    assert usual
    assert causes_replaced_by_a_formula(result_of(o, ()), usual) == ((), frozenset())


def test_a_law_of_rates_at_rest_is_in_the_model_of_the_turns():
    """Without it the turns show the same law again, and two laws of one sensor correct it twice."""
    law = LAWS["rotor unbalance squared"]
    d = diagnose([simulated(766, law, size_of(766, law, 60.0))])
    assert "turns" in d.fit["views"]
    assert [(w.effect, set(w.variables)) for w in d.laws] == [("law_angular_rate_y", {"force_x", "force_z"})]


def test_stretches_of_rows_end_where_a_group_ends():
    block = equal_stretches(10, 3, np.array([0, 0, 1, 1, 1, 1, 1, 1, 1, 2]))
    assert block.tolist() == [0, 0, 1, 1, 2, 2, 2, 3, 3, 4]
    assert equal_stretches(10, 3).tolist() == [0, 0, 0, 0, 1, 1, 1, 2, 2, 2]


def test_a_shape_that_names_what_a_formula_follows_is_kept():
    law = replace(LAW, axis="z", variables=("time",))
    smooth, other = Shape("angular_rate z", "a smooth function of time"), Shape("angular_rate x", "a pattern in time")
    assert shapes_with_laws((smooth, other), [law]) == (smooth, other)
    of_rate = replace(law, variables=("rate_z",))
    assert shapes_with_laws((smooth, other), [of_rate]) == (Shape("angular_rate z", "a function of rate z"), other)
    assert shapes_with_laws((), [of_rate]) == (Shape("angular_rate z", "a function of rate z"),)


def test_a_law_of_a_mount_is_calibrated_with_the_terms_of_every_mount():
    """The tube bends in the model of the mount anyway; a negative power is finite on a platform without the axis."""
    law, seed = LAWS["strange refraction"], 375
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        d = diagnose([simulated(seed, law, size_of(seed, law, 60.0))])
    assert "tube_flexure" in {f.effect for f in d.findings}
    assert "tube_flexure" not in d.laws[0].known_effects
    assert d.laws[0].effect in {p.effect for p in d.calibration.parameters}
