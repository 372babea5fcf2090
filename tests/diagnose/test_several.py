"""The diagnosis of several recordings: what belongs together, whose numbers are told, and each alone in words."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.of_recording import baseline_of
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.platform import KNOWN
from tests.diagnose import static_plant
from tests.diagnose.plant import UG, known, on, record
from tests.diagnose.small import telescope
from tests.golden import golden_text, refused

BASE = ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero")


@cache
def told():
    """A table with an asymmetry far above its noise, and another day of 18 positions without it."""
    made = [record(np.random.default_rng(seed), known(1)["asymmetry"][0], x * UG, dwell=2, hide=("temperature",))
            for seed, x in ((1, 0.0), (2, 800.0))]  # fmt: skip
    return diagnose(made, baseline=BASE)


def test_the_recording_that_is_off_most_leads():
    d = told()
    assert d.mismatch[0]["recording"] == 2
    golden_text(d.mismatch[0]["in_words"])
    assert np.max(np.abs(d.curves.before)) > 3  # its picture
    assert [r["recording"] for r in d.fit["recordings"]] == [1, 2]
    scan = [r["scan_p_before"] for r in d.fit["recordings"]]
    assert scan[1] < 1e-3 < scan[0]
    both = -np.expm1(2 * np.log1p(-scan[1]))  # the smaller of two: 1 - (1 - p)^2
    assert d.fit["scan_p_before"] == pytest.approx(both, rel=1e-6, abs=0.0)


def test_numbers_of_all_are_means_by_their_degrees_of_freedom():
    d = told()
    each = [r["chi2_reduced_before"] for r in d.fit["recordings"]]
    assert d.fit["chi2_reduced_before"] == pytest.approx(np.mean(each), rel=1e-6)  # the same rows and constants
    assert d.fit["heldout_before"] == pytest.approx(np.mean([r["heldout_before"] for r in d.fit["recordings"]]))


def test_each_alone_is_told_in_words():
    d = told()
    alone = [r["alone"] for r in d.fit["recordings"]]
    golden_text(alone[0]["in_words"])
    assert alone[0]["verdict"] == "adequate"
    golden_text(d.in_words)
    assert d.in_words.endswith(f"{alone[0]['in_words']}; recording 2: {alone[1]['in_words']}.")
    assert alone[0]["ln_bayes_factor"] < alone[0]["ln_bayes_factor_needed"] <= alone[1]["ln_bayes_factor"]


def test_the_model_of_each_holds_what_it_can_of_what_was_asked():
    table, rest = record(np.random.default_rng(1), dwell=2), static_plant.record(np.random.default_rng(1))
    asked = ("bias", "scale_factor", "polar_axis_misalignment")
    assert baseline_of(rest, [table, rest], asked) == asked
    assert baseline_of(table, [table, rest], asked) == ("bias", "scale_factor")
    assert baseline_of(table, [table, rest], ("polar_axis_misalignment",)) == BASELINE["multi-position"]
    assert set(baseline_of(rest, [table, rest], ())) == set(BASELINE["static-run"])


def test_what_is_of_another_unit_or_kind_is_refused():
    r = record(np.random.default_rng(1), dwell=2)
    for other in (telescope(1), replace(r, platform=KNOWN["bench"]), replace(r, platform=KNOWN["three-axis-table"]), r):
        with refused():
            diagnose([r, other])


@pytest.mark.parametrize(("law", "size", "shown"), [(lambda b: np.sin(2 * b.T), 12.0, "a random walk"),
                                                    (lambda b: b.T - 20, 40.0, "bias temperature")])  # fmt: skip
def test_two_recordings_never_say_less_than_one(law, size, shown):
    """A law in one recording, and none in the other: alone the first lacks something, and so do both together."""
    first = record(
        np.random.default_rng(40), lambda b: on(1, law(b)), size * UG, rows=48, unit=np.random.default_rng(5)
    )
    second = record(np.random.default_rng(50), rows=48, unit=np.random.default_rng(5))
    assert diagnose([first]).verdict != "adequate"
    both = diagnose([first, second])
    assert both.verdict != "adequate"
    assert shown in both.in_words or shown in str(both.unexplained)
