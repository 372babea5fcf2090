"""Pointing runs of one mount: judged together, and held against each other."""

from dataclasses import replace

import numpy as np

from gimbalcal.calibration.exchange.tpoint_model import printed, tpoint_terms
from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.result import Shape
from gimbalcal.estimate.pointing.fit import USUAL_TERMS
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.platform import Axis, Platform
from gimbalcal.recording import Source
from tests.estimate.pointing.mounts import ALT_AZ, ARCSEC, effects, run, sky
from tests.golden import golden_text, refused


def two(change):
    """Two nights of 40 stars; the tilt about north changes by so many arcsec."""
    tilts = (20.0, 20.0 + change)
    there = [effects(ALT_AZ, gimbal_zero__azimuth=-500.0, base_tilt__north=t, tube_flexure=9.0) for t in tilts]
    return [run(ALT_AZ, sky(ALT_AZ, 40, k), e, 1.0, k, source=(Source(f"{k}.csv", str(k)),))
            for k, e in enumerate(there)]  # fmt: skip


def test_nights_that_share_their_terms_are_adequate_together():
    made = diagnose(two(0.0), baseline=USUAL_TERMS)
    assert made.verdict == "adequate"
    golden_text(made.in_words)
    assert "how long passed between the sessions is not recorded" in made.in_words.lower()
    assert [n["stars"] for n in made.provenance["nights"]] == [40, 40]


def test_a_term_that_moves_between_nights_is_not_adequate():
    made = diagnose(two(5.0), baseline=USUAL_TERMS)
    assert made.verdict != "adequate"
    golden_text(made.in_words)
    golden_text(made.outcome)
    assert not [f for f in made.findings if "drift" in f["effect"]]  # across a time that nobody recorded
    assert Shape("pointing", "terms that differ from night to night") in made.unexplained


def test_a_calibration_says_which_terms_the_model_holds():
    (night, _) = two(0.0)
    known = pointing_calibration([night])
    assert diagnose([night], known).verdict == "adequate"
    assert diagnose([night]).verdict == "missing-physics"  # zeros, collimation and squareness alone
    assert printed(tpoint_terms(known)) == known.provenance.tpoint


def test_a_night_given_twice_is_refused():
    (night, _) = two(0.0)
    for judge in (diagnose, pointing_calibration):
        with refused():
            judge([night, night])


def servo(reach):
    """A pan-tilt head whose gears are off by 1 % and 0.4 %, moved up to so far [rad] to either side."""
    head = Platform("pan-tilt", (Axis("tilt", "y"), Axis("pan", "z")))
    rng = np.random.default_rng(5)
    at = np.stack([rng.uniform(-0.5, 1.0, 60), rng.uniform(-reach, reach, 60)], axis=1)
    gears = {"encoder_scale_factor__pan": 0.01 / ARCSEC, "encoder_scale_factor__tilt": -0.004 / ARCSEC}
    return run(head, at, effects(head, gimbal_zero__pan=2000.0, **gears), 60.0)


def test_a_gear_is_named_where_the_axis_is_no_whole_circle():
    made = diagnose([servo(1.5)])
    assert {f["effect"] for f in made.findings} == {"encoder_scale_factor"}
    sizes = {p["axis"]: (p["value"], p["sigma"]) for p in made.findings[0]["parameters"]}
    assert abs(sizes["pan"][0] - 10000.0) < 4 * sizes["pan"][1]
    assert "encoder_scale_factor" not in str(diagnose([servo(3.1)]).findings)  # a circle on its axis closes


def test_stars_without_a_clock_are_diagnosed():
    (night, _) = two(0.0)
    assert diagnose([replace(night, time=0 * night.time)], baseline=USUAL_TERMS).verdict == "adequate"
