"""Pointing runs of one mount: judged together, and held against each other."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from gimbalcal.calibration.exchange.tpoint import as_record, tpoint_terms
from gimbalcal.diagnose import diagnose
from gimbalcal.errors import InputError
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.estimate.pointing.terms import USUAL
from gimbalcal.recording import Recording, Source
from tests.estimate.pointing.mounts import ALT_AZ, effects, run, sky


def two(change: float) -> Sequence[Recording]:
    """Two nights of 40 stars; the tilt about north changes by so many arcsec."""
    tilts = (20.0, 20.0 + change)
    there = [effects(ALT_AZ, gimbal_zero__azimuth=-500.0, base_tilt__north=t, tube_flexure=9.0) for t in tilts]
    return [run(ALT_AZ, sky(ALT_AZ, 40, k), e, 1.0, k, source=(Source(f"{k}.csv", str(k)),))
            for k, e in enumerate(there)]  # fmt: skip


def test_nights_that_share_their_terms_are_adequate_together() -> None:
    made = diagnose(two(0.0), baseline=USUAL)
    assert made.verdict == "adequate"
    assert made.in_words.endswith("The nights share their terms.")
    assert [n["stars"] for n in made.provenance["nights"]] == [40, 40]


def test_a_term_that_moves_between_nights_is_not_adequate() -> None:
    made = diagnose(two(5.0), baseline=USUAL)
    assert made.verdict != "adequate"
    assert "The terms differ between 2 nights: base tilt north by" in made.in_words
    assert {"channel": "pointing", "shape": "terms that differ from night to night"} in made.unexplained


def test_a_calibration_says_which_terms_the_model_holds() -> None:
    (night, _) = two(0.0)
    known = pointing_calibration([night])
    assert diagnose([night], known).verdict == "adequate"
    assert diagnose([night]).verdict == "missing-physics"  # zeros, collimation and squareness alone
    assert as_record(tpoint_terms(known)) == known.provenance["tpoint"]


def test_a_night_given_twice_is_refused() -> None:
    (night, _) = two(0.0)
    for judge in (diagnose, pointing_calibration):
        with pytest.raises(InputError, match="is given twice"):
            judge([night, night])
