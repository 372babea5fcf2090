"""Trials of suspected input errors: the simplest correction that suffices is named, else the simplest of the best."""

import numpy as np
import pytest

from gimbalcal.checks.input_errors import Correction, in_other_units, scale_correction, successful_trials
from gimbalcal.effects.effect import TRIAD
from gimbalcal.errors import InputError
from tests.checks.test_table import multi_position

MISFITS = {"a": 3.0, "b": 1.05, "c": 1.0, "d": 0.2, "e": 0.1}


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({}, "e"),
        ({"sufficient": 0.5}, "d"),
        ({"sufficient": 0.5, "most": 3}, "de"),
        ({"sufficient": 1.0, "most": 2}, "cd"),
        ({"tolerance": 2.0}, "d"),
        ({"tolerance": 11.0}, "b"),
        ({"tolerance": np.inf}, "a"),
    ],
)
def test_the_first_that_suffices_or_the_first_of_the_best(options, named):
    tried: list[str] = []

    def misfit(candidate):
        tried.append(candidate)
        return MISFITS[candidate]

    found = successful_trials(MISFITS, misfit, **options)
    assert "".join(t.candidate for t in found) == named
    assert [t.misfit for t in found] == [MISFITS[name] for name in named]
    assert tried == list(MISFITS)[: len(tried)]
    assert len(tried) == (list(MISFITS).index(named[-1]) + 1 if "sufficient" in options else len(MISFITS))


def test_a_correction_under_which_a_recording_is_refused_does_not_agree():
    def misfit(candidate):
        if candidate in "de":
            raise InputError("no")
        return MISFITS[candidate]

    assert [t.candidate for t in successful_trials(MISFITS, misfit)] == ["c"]
    assert successful_trials("de", misfit) == successful_trials([], misfit) == ()
    assert [t.candidate for t in successful_trials("ab", lambda _: np.nan)] == ["a"]


def test_units_are_those_that_the_columns_do_not_state():
    words = "they are in {unit}, not in {stated}"
    corrections = list(in_other_units("angular_rate", TRIAD, ["deg/s"] * 3, words))
    assert "they are in rad/s, not in deg/s" in [c.words for c in corrections]
    factor = next(c for c in corrections if "in rad/s" in c.words).factor("angular_rate")
    assert factor == pytest.approx(180 / np.pi, rel=1e-12)
    assert not list(in_other_units("angular_rate", TRIAD, ["deg/s", "rad/s"], words))
    assert not list(in_other_units("angular_rate", TRIAD, ["count"] * 3, words))


def test_a_correction_changes_channels_scatter_clock_and_place_alone():
    recording = multi_position()
    correction = scale_correction("specific_force", ("y",), -2.0, "")
    assert correction.reversed("specific_force") == ("y",)
    assert correction.factor("specific_force") == -2.0
    other = Correction("", matrices=correction.matrices, clock=60.0, latitude=0.5).corrected(recording)
    for axis, factor in (("x", 1.0), ("y", -2.0), ("z", 1.0)):
        key = ("specific_force", axis)
        np.testing.assert_array_equal(other.channels[key], factor * recording.channels[key])
        assert other.scatter.get(key, 0.0) == abs(factor) * recording.scatter.get(key, 0.0)
    np.testing.assert_array_equal(other.time, 60 * recording.time)
    assert (other.site.latitude, other.site.gravity) == (0.5, recording.site.gravity)
