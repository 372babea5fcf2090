"""Sentences of calibrations, diagnoses, plans and campaigns, generated from results of every kind."""

import re
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.at_rest import RestNoise
from gimbalcal.calibration import AssumedNoise, Calibration, Options, Provenance, Residual
from gimbalcal.calibration.provenance import ResidualPattern
from gimbalcal.design.position_observability import observe
from gimbalcal.diagnose.answer import Curves, Diagnosis
from gimbalcal.diagnose.result import Estimate, Finding, FitSummary, Shape
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.effects.effect import constants
from gimbalcal.inference.information import Unobservable
from gimbalcal.report.campaign_page import campaign_report
from gimbalcal.report.console import findings_table, parameters_table
from gimbalcal.words.answers import campaign_answer, noise_answer, ratio_interval_by_chance
from gimbalcal.words.calibration_sentences import calibration_in_words, calibration_verdict, goodness_of_fit
from gimbalcal.words.diagnosis_headline import finding_sentence, headline, size_in_words
from gimbalcal.words.naming import (
    as_sentences,
    direction_in_words,
    leading_labels,
    least_precise_sentence,
    list_in_words,
    number_and_noun,
    typeset,
    unit_in_print,
    why_in_words,
)
from gimbalcal.words.tables import bounds_table
from tests.report.example import example
from tests.report.pages import campaign

JARGON = re.compile(r"\{|}|_|chi|p-value|directions that|statistic|\\bnan|None|null|posterior|prior|\^")
DIRECTION = {"misalignment:xz": 1.0, "gimbal_zero:platform": -1.0}


def lines(cases, in_words):
    """A line for each case: its name and its sentences."""
    return "\n".join(f"{name}: {in_words(case)}" for name, case in cases.items())


# --- calibrations -----------------------------------------------------------------------------------------------------


PAIR = [p for p in (*parameters(CATALOGUE["misalignment"]), *parameters(CATALOGUE["gimbal_zero"], ("platform",)))
        if p.label in DIRECTION]  # fmt: skip
BIASES = tuple(parameters(CATALOGUE["bias"]))
COMMON_TURN = Unobservable(DIRECTION, "a common turn")


def calibration(chi2=38.0, dof=37, *unobservable, rms=None, **changes):
    """A calibration of 18 parameters."""
    residual = Residual(chi2, dof, {} if rms is None else {"pointing:across": rms})
    made = Calibration("three-stage", (), tuple(PAIR) * 9, np.eye(18), unobservable, residual)
    return replace(made, **changes)


def of(**provenance):
    return {"provenance": Provenance(**provenance)}


SAMPLES = of(noise=AssumedNoise(accelerometer_from="samples"))
CALIBRATIONS = {
    "adequate fit": calibration(),
    "common unobservable direction": calibration(38.0, 37, COMMON_TURN),
    "one unobservable parameter": calibration(38.0, 37, Unobservable({"misalignment:xz": 1.0}, "")),
    "fewer than half observable": calibration(
        38.0, 37, Unobservable({"bias:x": 1.0, "bias:y": -1.0}, ""), parameters=BIASES
    ),
    "held, not unobservable": calibration(38.0, 37, Unobservable({"misalignment:xz": 1.0, "K3:x": 1.0}, "declined")),
    "lack of fit": calibration(9 * 37),
    "overstated noise": calibration(0.25 * 37),
    "noise of the samples": calibration(**SAMPLES),
    "noise of the samples at rest": calibration(**of(noise=AssumedNoise(from_="samples"))),
    "lack of fit, noise of the samples": calibration(9 * 37, **SAMPLES),
    "overstated noise of the samples": calibration(0.25 * 37, **SAMPLES),
    "excess scatter": calibration(**of(options=Options(excess_scatter=1e-4))),
    "noise from the residual": calibration(**of(noise=AssumedNoise(gimbal_angle_from="residual"))),
    "outcome": calibration(outcome="only five positions remain"),
    "no degrees of freedom": calibration(0.0, 0),
    "pattern of stars": calibration(
        rms=1e-5,
        **of(
            pattern=ResidualPattern("across", "hour_angle", 1e-4),
            noise=AssumedNoise(accelerometer_from="residual"),
            stars=20,
        ),
    ),
    "direction that is no star's": calibration(rms=1e-5, **of(noise=AssumedNoise(from_="residual"))),
}


def test_answers_of_calibrations(golden):
    golden(
        "sentences/calibration", lines(CALIBRATIONS, lambda c: f"[{calibration_verdict(c)}] {calibration_in_words(c)}")
    )


def test_held_parameters_are_not_counted_as_unobservable():
    assert CALIBRATIONS["held, not unobservable"].null_directions == ()


@pytest.mark.parametrize(
    ("chi2", "dof", "expected"),
    [
        (1.05**2 * 100_000, 100_000, "fits"),  # highly significant, and too small to act on
        (1.3**2 * 10, 10, "fits"),  # large, and chance does that once in seven
        (1.3**2 * 1000, 1000, "misfit"),
    ],
)
def test_lack_of_fit_is_both_significant_and_large(chi2, dof, expected):
    assert goodness_of_fit(chi2, dof)[2] == expected


# --- diagnoses --------------------------------------------------------------------------------------------------------

WARM = Finding("bias_temperature", "y", 0.9, 44.0, (Estimate("b_T", "y", 14.83, 0.34, "ug/degC"),))
TWIN = replace(WARM, twins=("bias_drift",), separate_by="Warm it and let it cool.")
SATURATION = Finding(
    "soft_saturation", "x, y, z", 0.9, 20.0,
    (*(Estimate("saturation", a, v, 1.0, "mg/g^2") for a, v in zip("xyz", (-9.0, 5.0, 0.4), strict=True)),
     Estimate("soft_saturation.f_0", "", 3.0, 34.0, "m/s^2")),
    twins=("dead_zone",),
)  # fmt: skip
TWO_UNITS = ("the 2 sessions do not share their constants: a does not agree (bias:z by +35 mg). The positions scatter "
             "by 0.11 m/s^2, and `gimbalcal diagnose` looks for what the model misses")  # fmt: skip


def finding(effect, value=-12.3):
    """A finding of an effect on its first axis, with all its parameters and constants."""
    cls = CATALOGUE[effect]
    own = parameters(cls, ("inner",))
    sizes = [Estimate(p.name, p.axis, value, 0.4, p.unit) for p in own if p.axis == own[0].axis]
    fixed = [Estimate(c.name, "", 7.0, 0.1, c.metadata["unit"]) for c in constants(cls)]
    return Finding(effect, own[0].axis, 0.9, 20.0, (*sizes, *fixed))


def fit(chi2=1.06):
    return FitSummary(chi2_reduced_before=chi2, chi2_reduced_after=1.0, heldout_before=chi2, heldout_after=1.0,
                      noise={})  # fmt: skip


def diagnosis(verdict, *findings, **more):
    shapes = (Shape("specific_force z", "grows with the square root of time"),)
    made = Diagnosis(verdict, (), findings, shapes if verdict == "unexplained" else (), fit())
    return replace(made, **more)


DIAGNOSES = {
    "adequate": diagnosis("adequate"),
    "adequate, in units of the noise": diagnosis("adequate", fit=fit(4.0)),
    "adequate without gyroscopes": diagnosis(
        "adequate", provenance={"notes": ["The gyroscopes were not analysed: that takes 6 dwells, not 2."]}
    ),
    "adequate with an outcome": diagnosis("adequate", outcome="the residuals are 2.1 times the noise"),
    "missing physics": diagnosis("missing-physics", WARM),
    "missing physics with an outcome": diagnosis("missing-physics", WARM, outcome="bias drift y is far from usual"),
    "two units": diagnosis("missing-physics", WARM, outcome=TWO_UNITS, provenance={"sessions": [{}, {}]}),
    "all axes": diagnosis("missing-physics", SATURATION),
    "four causes": diagnosis("missing-physics", *[replace(WARM, axis=a) for a in ("y", "x", "z")], TWIN),
    "not identifiable": diagnosis("not-identifiable", TWIN),
    "many confounded causes": diagnosis(
        "not-identifiable", replace(WARM, twins=("bias_drift", "warm_up", "bias_step"))
    ),
    "unexplained": diagnosis("unexplained"),
    "unexplained with an outcome": diagnosis("unexplained", unexplained=(), outcome="position 9 is mis-set"),
    "constants that differ": diagnosis(
        "unexplained",
        outcome="the 2 recordings differ",
        unexplained=(Shape("", "constants that differ"),),
    ),
}  # fmt: skip


def test_headlines_of_diagnoses(golden):
    golden("sentences/diagnosis", lines(DIAGNOSES, headline))
    for name, content in DIAGNOSES.items():
        text = re.sub(r"`[^`]*`", "", headline(content))
        assert not JARGON.search(text), text
        assert "Next: " in text or name.startswith(("adequate", "constants")), text


def test_an_outcome_is_added_to_the_headline_of_what_was_found():
    assert headline(DIAGNOSES["missing physics with an outcome"]).startswith(headline(DIAGNOSES["missing physics"]))


@pytest.mark.parametrize(("unit", "sigma", "size"), [("ug", 50.0, "1.5 mg"), ("arcsec", 40.0, "20 arcmin")])
def test_the_size_of_a_misfit_is_given_in_the_unit_of_the_readings(unit, sigma, size):
    before = np.array([[0.0, 1.0], [0.0, -30.0]])
    channels = (("specific_force", "x"), ("specific_force", "y"))
    curves = Curves(np.arange(2.0), np.ones(2), channels, before, 0 * before, np.full((2, 2), sigma), (unit, unit))
    assert f"off by up to {size}." in headline(replace(DIAGNOSES["missing physics"], curves=curves))


def test_every_effect_has_a_sentence_with_its_size_and_a_next_step(golden):
    for effect in CATALOGUE:
        text = finding_sentence(finding(effect))
        assert CATALOGUE[effect].says
        assert re.search(r"12\.3|17\.4|1230", text), text  # alone, a sine with its cosine, in percent
        assert not JARGON.search(text), text
        assert len(text) < 170
        step = headline(diagnosis("missing-physics", finding(effect))).partition("Next: ")[2]
        assert f"--with {effect}" in step or "time stamps" in step or "leave position 7 out" in step
    golden("sentences/findings", lines({e: finding(e) for e in sorted(CATALOGUE)}, finding_sentence))


def sized(effect, *sizes, axis=""):
    """A finding of sizes: axis, value, sigma, unit."""
    return Finding(effect, axis, 0.9, 20.0, tuple(Estimate(effect, *size) for size in sizes))


@pytest.mark.parametrize(
    ("sizes", "words"),
    [
        ([("", 0.0123, 0.0004, "1")], "1.23 ± 0.04 %"),
        ([(a, v, 1.0, "arcsec") for a, v in zip("xyz", (3, -50, 9), strict=True)],
         "−50.0 ± 1.0 arcsec (y), 9.0 ± 1.0 arcsec (z) and one smaller"),
        ([("y", -1.0, 18.0, "ug/degC")], "at most 37 µg per °C"),
    ],
)  # fmt: skip
def test_sizes_of_a_finding(sizes, words):
    assert size_in_words(sized("base_tilt", *sizes)) == words


@pytest.mark.parametrize(("value", "sense"), [(3.2, "later"), (-3.2, "earlier")])
def test_the_sign_of_a_delay(value, sense):
    assert f"3.20 ± 0.10 ms {sense}" in finding_sentence(sized("readout_latency", ("", value, 0.1, "ms")))


def test_a_plain_number_that_counts_is_no_share():
    assert "%" not in finding_sentence(finding("periodic_worm_error"))  # 144 teeth were "14400 %"


def test_an_effect_of_a_user_needs_no_sentence(monkeypatch):
    monkeypatch.setitem(CATALOGUE, "my_own", type("MyOwn", (CATALOGUE["bias_temperature"],), {"says": ""}))
    assert finding_sentence(replace(WARM, effect="my_own")).startswith("My own y ")


# --- tables of the console --------------------------------------------------------------------------------------------


def test_tables_of_the_console(golden):
    calibration, _, _ = example()
    held = Unobservable({"misalignment:up": 1.0, "cubic_nonlinearity:x": 1.0}, "declined")
    two = tuple(Estimate("b_T", a, 14.83, 0.34, "ug/degC") for a in "xy")
    tables = [
        parameters_table(calibration),
        parameters_table(replace(calibration, unobservable=(held,))),
        findings_table([replace(WARM, parameters=two), sized("bias", ("x", 0.0123, 0.0004, "1"))]),
        bounds_table(observe("wu2018-18")),
    ]
    golden("console/tables", "\n\n".join(tables))
    assert tables[0].count(" ± ") == len(calibration.parameters)


# --- plans, noise, campaigns ------------------------------------------------------------------------------------------


def test_a_plan_names_four_kinds_of_parameters_and_counts_the_rest():
    kinds = ["bias", "scale_factor", "misalignment", "quadratic_nonlinearity", "gyro_bias"]
    assert "more in the report" not in least_precise_sentence([(k, 1.0, "1") for k in kinds[:4]])
    assert least_precise_sentence([(k, 1.0, "1") for k in kinds]).endswith("; 1 more in the report.")


def test_headlines_of_noise(golden):
    cases = {f"{s:.0f} s": RestNoise(1, "random walk below 3 ug", 1, s, s, 1.0, {}, (), ()) for s in (600.0, 7200.0)}
    golden("sentences/noise", lines(cases, noise_answer))


def test_headlines_of_campaigns(golden):
    cases = {
        "honest": campaign(), "few runs": campaign(4, 1.5), "large errors": campaign(ratio=1.6),
        "offset": campaign(mean=0.5), "failed runs": campaign(failed=3),
        "no estimate": replace(campaign(failed=200), parameters=()),
    }  # fmt: skip
    golden("sentences/campaign", lines(cases, campaign_answer))
    classes = {name: re.findall(r'class="answer (\w+)"', campaign_report(c)) for name, c in cases.items()}
    assert [name for name, found in classes.items() if found == ["fits"]] == ["honest", "few runs"]


def test_the_interval_of_chance_is_wider_for_few_runs_and_many_parameters():
    assert (
        ratio_interval_by_chance(10, 5)[0]
        < ratio_interval_by_chance(100, 5)[0]
        < 1
        < ratio_interval_by_chance(100, 5)[1]
        < ratio_interval_by_chance(100, 50)[1]
        < ratio_interval_by_chance(10, 50)[1]
    )


# --- names, units, directions -----------------------------------------------------------------------------------------


def test_a_direction_starts_with_its_largest_weight_and_omits_negligible_ones():
    direction = {"bias:x": 0.5, "scale_factor:y": -1.0, "bias:z": 0.001}
    assert direction_in_words(direction) == "scale factor y − 0.50 bias x"
    assert leading_labels(direction) == ["scale_factor:y", "bias:x"]
    assert leading_labels({}) == []


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: number_and_noun(0, "direction"), "no directions"),
        (lambda: number_and_noun(13, "axis", "axes"), "13 axes"),
        (lambda: list_in_words([]), ""),
        (lambda: list_in_words(["a"]), "a"),
        (lambda: unit_in_print("deg/sqrt(h)"), "°/√h"),
        (lambda: as_sentences("the calibration leaves 3 m\nnot seen: bias:x"),
         "The calibration leaves 3 m.\nNot seen: bias x."),
        (lambda: typeset("1.03e+03 ug/sqrt(Hz), 2.5e-07 m/s^2"), "1030 µg/√Hz, 2.5·10⁻⁷ m/s²"),
        (lambda: typeset("-n 200, 2026-11-22, x=-1, from -0.5 deg/h to 3 deg"),
         "-n 200, 2026-11-22, x=-1, from −0.5 °/h to 3°"),
        (lambda: why_in_words(Unobservable({"bias:x": 1.0, "misalignment:xy": 0.3},
                                            "+1 bias:x +0.3 misalignment:xy leave it")),
         "+1 bias x +0.3 misalignment xy leave it."),
        (lambda: why_in_words(Unobservable({"K3:x": 1.0},
                                            "cubic_nonlinearity is left out: its sigma is 3 ug/g^3 (a.inter_triad)")),
         "Cubic nonlinearity is left out: its sigma is 3 µg/g³ (a.inter_triad)."),
    ],
)  # fmt: skip
def test_names_numbers_and_units_are_typeset(call, text):
    assert call() == text
