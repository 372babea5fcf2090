"""One sensor that wanders competes with drifts, and is told with what it may as well be."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.evidence.node import SINGLE_WALK
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.known_noise import compare_causes
from gimbalcal.diagnose.result import Shape
from gimbalcal.diagnose.search import sensor_random_walks
from gimbalcal.diagnose.search.ranking import Hypothesis
from gimbalcal.diagnose.search.sensor_random_walks import MAX_NATS_BEHIND, likely_wandering_noises, noise_weights
from gimbalcal.diagnose.verdict.decide import Decision
from gimbalcal.diagnose.verdict.judgement import Judgement
from gimbalcal.diagnose.verdict.random_walk import RandomWalkFinding, decide_with_walk, without_single_walks
from gimbalcal.diagnose.view_result import ViewDiagnosis
from gimbalcal.effects.process import RandomWalk
from gimbalcal.progress import no_progress
from gimbalcal.recording.kinds import MULTI_POSITION, STATIC_RUN
from gimbalcal.units import to_si
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.benchmarks import unknown_hand
from tests.diagnose import static_plant
from tests.diagnose.plant import UG, at_strength, on, record
from tests.diagnose.small import FIT
from tests.golden import golden_text

SINGLE, WEIGHTS = "single_walks_of_stated_noise", "noise_weights"
HOURS = (17 * 135 + 119) / 3600  # of the plant's timetable


def walk(b):
    """A random walk of accelerometer y that is of order one at the end."""
    steps = np.random.default_rng(6).standard_normal(len(b.t)) * np.sqrt(np.diff(b.t, prepend=b.t[0]) / b.t[-1])
    return on(1, np.cumsum(steps))


def drift(b):
    return on(1, b.t / b.t[-1])


def search_of(recording):
    return compare_causes(view_at_known_attitude(recording), None, no_progress)


def test_a_walk_of_one_accelerometer_is_no_cause_and_its_size_comes_back():
    end = 60.0  # ug, 33 times what white noise leaves of a dwell: five times the largest that all of them may walk
    r = record(np.random.default_rng(6), walk, end * UG, rows=120)
    s = search_of(r)
    d, wander = decide_with_walk(s, without_single_walks(s), CLAIM)
    assert d.verdict == "adequate"
    assert wander.axis == "y"
    assert wander.ln_odds > CLAIM
    assert wander.sigma < 0.3 * wander.walk
    assert wander.walk == pytest.approx(end / np.sqrt(HOURS), abs=2.5 * wander.sigma)
    made = diagnose([r])
    assert (made.verdict, made.findings, made.laws) == ("unexplained", (), ())
    assert made.unexplained[0] == Shape("specific_force y", "a random walk")
    assert made.mismatch[0]["axis"] == "y"
    assert made.recommend


def test_a_weak_drift_is_told_with_the_walk_that_it_may_be():
    s = search_of(at_strength(5, drift, 15.0))
    held = without_single_walks(s)
    assert abs(np.median(held.singles)) < 5  # most causes are neither seen nor spoken against
    d, wander = decide_with_walk(s, held, CLAIM)
    assert d.verdict == "not-identifiable"
    assert {d.judgements[0].cause.effect, *d.judgements[0].confounded} >= {"bias_drift"}
    assert -CLAIM < wander.ln_odds < CLAIM
    share = 1 / (1 + np.exp(wander.ln_odds))
    assert wander.share_of(d.judgements[0].probability) < share < 1


def test_a_wave_that_a_walk_could_be_is_told_by_its_formula():
    d = diagnose([at_strength(8, lambda b: on(1, np.sin(2 * np.pi * b.t / 130.0)), 60.0)])
    assert d.verdict == "unexplained"
    assert any("sin" in law.expression for law in d.laws)
    assert "wanders" not in d.outcome


def test_a_clear_drift_is_no_walk():
    s = search_of(at_strength(5, drift, 30.0))
    assert likely_wandering_noises(s) == ()
    np.testing.assert_allclose(noise_weights(s, [p.node for p in s.projections]), s.null, atol=1e-6)
    d, wander = decide_with_walk(s, without_single_walks(s), CLAIM)
    assert wander is None
    assert "bias_drift" in {d.judgements[0].cause.effect, *d.judgements[0].confounded}


def test_what_wanders_is_said():
    wander = RandomWalkFinding("x", 61.7, 8.2, 4.0, 20.0)
    view, curves = SimpleNamespace(measurement=SimpleNamespace(known_attitude=True)), SimpleNamespace()
    none = ViewDiagnosis(view, "unexplained", (), (), (), FIT, curves)
    only = none.with_walk(wander, only=True)
    golden_text(only.outcome)
    assert only.unexplained[0] == Shape("specific_force x", "a random walk")
    other = none.with_walk(wander, only=False)
    assert other.unexplained == (Shape("specific_force x", "a random walk"),)
    golden_text(other.outcome)


def of_nodes(told, **more):
    """A search in which each noise has a lone walk (axis, size) or none, and a ln evidence of nothing missing."""
    nodes = [SimpleNamespace(single_walk=a, noise={"specific_force": (RandomWalk(size),)}) for a, size, _ in told]
    o = SimpleNamespace(residual=np.zeros((4, 3)), sigma=np.array([1.0, 3.0, 9.0]) * to_si(1.0, "ug/sqrt(h)"),
                        view=SimpleNamespace(channels=tuple(("specific_force", a) for a in "xyz")))  # fmt: skip
    s = SimpleNamespace(
        projections=tuple(SimpleNamespace(node=n) for n in nodes), null=np.array([ln for *_, ln in told]), fit=o, **more
    )
    s.searches = (s,)
    return s


WALKS = [("", 0.0, 0.0), ("x", 8.0, -4.0), ("y", 1.0, np.log(1.5)), ("y", 4.0, np.log(1.5))]


def test_a_walk_is_as_large_as_its_grid_says_on_the_axis_that_is_likeliest(monkeypatch):
    s = of_nodes(WALKS)
    needed = CLAIM
    other = Decision("missing-physics", Hypothesis((0,), 9.0, 9.0), (Judgement(SimpleNamespace(), 0.8, ()),))
    answers = iter([Decision("adequate"), other])
    monkeypatch.setattr("gimbalcal.diagnose.verdict.random_walk.decide", lambda *_: next(answers))
    d, wander = decide_with_walk(s, SimpleNamespace(ln_total=1.0), needed)
    assert wander.axis == "y"
    assert wander.walk == pytest.approx(2.0 * 3.0)  # between one and four, in the noise of y
    step = np.log(SINGLE_WALK[1] / SINGLE_WALK[0])
    assert wander.sigma == pytest.approx(6.0 * np.sqrt(np.log(2.0) ** 2 + step**2 / 12), rel=0.01)
    assert wander.ln_odds == pytest.approx(np.log(3.0) - 1.0, abs=0.01)  # of three times nothing, to e times nothing
    assert d.verdict == "not-identifiable"
    shared = wander.share_of(d.judgements[0].probability)
    assert shared == pytest.approx(0.8 * np.e / (np.e + 3.0), abs=0.005)


@pytest.mark.parametrize(("ln_held", "told"), [(0.0, "adequate"), (9.0, "not-identifiable")])
def test_a_walk_twenty_times_as_likely_as_any_cause_is_told_alone(monkeypatch, ln_held, told):
    s = of_nodes([("", 0.0, 0.0), ("z", 1.0, CLAIM + 0.5)])
    other = Decision("missing-physics", Hypothesis((0,), 9.0, 9.0), (Judgement(SimpleNamespace(), 0.8, ()),))
    answers = iter([Decision("adequate"), other])
    monkeypatch.setattr("gimbalcal.diagnose.verdict.random_walk.decide", lambda *_: next(answers))
    assert decide_with_walk(s, SimpleNamespace(ln_total=ln_held), CLAIM)[0].verdict == told


@pytest.mark.parametrize(
    ("ln_total", "ln", "kept"),
    [(CLAIM - 0.1, [9.0, 8.0], []),  # nothing was found
     (9.0, [8.0, 9.0, 9.0 - MAX_NATS_BEHIND - 0.1], [1, 0]),  # likeliest first, and none that is far behind
     (9.0, [9.0 - CLAIM + 0.1], [0]), (9.0, [9.0 - CLAIM - 0.1], [])],  # a twentieth as likely as what was found
)  # fmt: skip
def test_walks_compete_with_what_was_found(monkeypatch, ln_total, ln, kept):
    walks = [SimpleNamespace(single_walk="x", k=k) for k in range(len(ln))]
    monkeypatch.setattr(sensor_random_walks, SINGLE, lambda _: walks)
    monkeypatch.setattr(sensor_random_walks, WEIGHTS, lambda *_: np.array(ln))
    s = SimpleNamespace(
        ln_total=ln_total, fit=SimpleNamespace(view=SimpleNamespace(kind=MULTI_POSITION)), null=np.zeros(1)
    )
    assert [n.k for n in likely_wandering_noises(s)] == kept


@pytest.mark.parametrize(("together", "kept"), [(8.5, [0, 1]), (9.5, [])])
def test_none_walks_alone_where_all_walking_is_likelier(monkeypatch, together, kept):
    walks = [SimpleNamespace(single_walk="x", k=0), SimpleNamespace(single_walk="", k=1)]
    monkeypatch.setattr(sensor_random_walks, SINGLE, lambda _: walks)
    monkeypatch.setattr(sensor_random_walks, WEIGHTS, lambda *_: np.array([9.0, together]))
    s = SimpleNamespace(ln_total=8.0, fit=SimpleNamespace(view=SimpleNamespace(kind=STATIC_RUN)), null=np.zeros(1))
    assert [n.k for n in likely_wandering_noises(s)] == kept


def steps(t, seed):
    """A random walk in time (n,) that is of order one at the end, of numbers that no plant of this seed draws."""
    rng = np.random.default_rng(1000 + seed)
    return np.cumsum(rng.standard_normal(len(t)) * np.sqrt(np.diff(t, prepend=t[0]) / t[-1]))


def is_a_walk(d, channel):
    """Whether this channel is told to walk, and nothing else, with its size in the words."""
    assert (d.verdict, d.findings, d.laws) == ("unexplained", (), ())
    assert d.unexplained[0] == Shape(channel, "a random walk")
    assert d.outcome
    assert d.outcome in d.in_words
    assert d.recommend
    walk, sigma = re.search(r"walk of (\S+) \+- (\S+) ", d.outcome).groups()
    return float(walk), float(sigma)


@pytest.mark.parametrize(("seed", "size"), [(2, 20.0), (5, 20.0)])
def test_an_accelerometer_of_a_static_run_walks(seed, size):
    """Also where the walks of all accelerometers that the grid has leave nothing to be found."""
    made = static_plant.record(np.random.default_rng(seed), lambda r: np.outer(steps(r.t, seed), [0, 1, 0]), size * UG)
    walk, sigma = is_a_walk(diagnose([made]), "specific_force y")
    assert walk == pytest.approx(size / np.sqrt(48), abs=3 * sigma)


def turned(seed, key, law, sigmas):
    """A unit turned by hand in which sensor y does something that is so many sigmas above noise."""
    grade = unknown_hand.TACTICAL
    s = unknown_hand.Setup(grade=grade, rests=36, gyroscopes=key == "rate", thermometer=True, minutes=10.0)

    def error(h):
        return {key: np.outer(law(h), [0, 1, 0])}

    size = sigmas / unknown_hand.strength(seed, s, error)
    return unknown_hand.record(seed, s, ((error, size),)), size


def test_an_accelerometer_turned_by_hand_walks():
    made, size = turned(4, "force", lambda h: steps(h.t, 4), 40.0)  # in g at the end
    walk, sigma = is_a_walk(diagnose([made]), "specific_force y")
    hours = (made.time[-1] - made.time[0]) / 3600
    assert walk == pytest.approx(size * unknown_hand.G / UG / np.sqrt(hours), abs=3 * sigma)


def test_a_gyroscope_turned_by_hand_walks():
    made, size = turned(4, "rate", lambda h: steps(h.t, 4), 40.0)
    d = diagnose([made])
    walk, sigma = is_a_walk(d, "angular_rate y")
    hours = (made.time[-1] - made.time[0]) / 3600
    assert walk == pytest.approx(size / unknown_hand.HOUR / np.sqrt(hours), abs=3 * sigma)
    assert "yroscope y wanders" in d.outcome


@pytest.mark.parametrize("key", ["force", "rate"])
def test_a_drift_of_a_unit_turned_by_hand_is_no_walk(key):
    d = diagnose([turned(5, key, lambda h: h.t / h.t[-1], 30.0)[0]])
    assert d.findings
    assert d.findings[0]["axis"] == "y"
    assert "drift" in d.findings[0]["effect"]
    assert not any(u["shape"] == "a random walk" for u in d.unexplained)
    assert "wanders" not in d.outcome
