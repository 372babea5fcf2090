"""One accelerometer that wanders competes with drifts, and is told with what it may as well be."""

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.known_noise import searched
from gimbalcal.diagnose.search.lone_walk import wandering
from gimbalcal.diagnose.verdict.wander import Wander, decided, steady, with_wander
from gimbalcal.effects.baseline import BASELINE
from gimbalcal.pipeline import silent
from tests.diagnose.plant import UG, at_strength, on, record

HOURS = (17 * 135 + 119) / 3600  # of the plant's timetable


def walk(b):
    """A random walk of accelerometer y that is of order one at the end."""
    steps = np.random.default_rng(6).standard_normal(len(b.t)) * np.sqrt(np.diff(b.t, prepend=b.t[0]) / b.t[-1])
    return on(1, np.cumsum(steps))


def drift(b):
    return on(1, b.t / b.t[-1])


def search_of(recording):
    return searched(recording, None, BASELINE["multi-position"], silent)


def test_a_walk_of_one_accelerometer_is_no_cause_and_its_size_comes_back():
    end = 60.0  # ug, 33 times what white noise leaves of a dwell: five times the largest that all of them may walk
    s = search_of(record(np.random.default_rng(6), walk, end * UG))
    d, wander = decided(s, steady(s), CLAIM)
    assert d.verdict == "adequate"
    assert wander.axis == "y"
    assert wander.ln_odds > CLAIM
    assert wander.sigma < 0.3 * wander.walk
    assert wander.walk == pytest.approx(end / np.sqrt(HOURS), abs=2.5 * wander.sigma)
    made = diagnose([record(np.random.default_rng(6), walk, end * UG)])
    assert (made.verdict, made.findings, made.laws) == ("unexplained", (), ())
    assert made.unexplained[0] == {"channel": "specific_force y", "shape": "a random walk"}
    assert made.mismatch[0]["axis"] == "y"
    assert made.recommend


def test_a_weak_drift_is_told_with_the_walk_that_it_may_be():
    s = search_of(at_strength(5, drift, 15.0))
    d, wander = decided(s, steady(s), CLAIM)
    assert d.verdict == "not-identifiable"
    assert {s.library.candidates[i].effect for i in (*d.hypothesis.members, *d.confounded[0])} >= {"bias_drift"}
    assert -CLAIM < wander.ln_odds < CLAIM
    share = 1 / (1 + np.exp(wander.ln_odds))
    assert d.probability[0] < share < 1


def test_a_wave_that_a_walk_could_be_is_told_by_its_formula():
    d = diagnose([at_strength(8, lambda b: on(1, np.sin(2 * np.pi * b.t / 130.0)), 60.0)])
    assert d.verdict == "unexplained"
    assert any("sin" in law.entry["expression"] for law in d.laws)
    assert "wanders" not in d.outcome


def test_a_clear_drift_is_no_walk():
    s = search_of(at_strength(5, drift, 30.0))
    assert wandering(s) == ()
    d, wander = decided(s, steady(s), CLAIM)
    assert wander is None
    assert "bias_drift" in {s.library.candidates[i].effect for i in (*d.hypothesis.members, *d.confounded[0])}


def test_what_wanders_is_said():
    wander = Wander("x", 61.7, 8.2, 4.0, 20.0)
    alone = with_wander(Diagnosis("unexplained", (), (), (), {}, {}, "No cause."), wander, alone=True)
    words = "accelerometer x wanders, a random walk of 61.7 +- 8.2 ug/sqrt(h)"
    assert alone.outcome == f"A{words[1:]}: no cause and no formula is as likely"
    assert alone.unexplained[0] == {"channel": "specific_force x", "shape": "a random walk"}
    beside = with_wander(Diagnosis("not-identifiable", (), (), (), {}, {}, "A drift or a step."), wander)
    assert beside.unexplained == ({"channel": "specific_force x", "shape": "a random walk"},)
    assert beside.in_words == f"A drift or a step. It may as well be that {words}."
