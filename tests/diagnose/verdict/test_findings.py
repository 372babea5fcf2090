"""Which causes stand, and courses of one drift as one finding."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.result import Estimate, Finding
from gimbalcal.diagnose.search.refit import refit, start_with_baseline, with_constants
from gimbalcal.diagnose.search.stepwise import result_of
from gimbalcal.diagnose.verdict import findings
from gimbalcal.diagnose.verdict.findings import (
    cancelling_causes,
    confirm_causes,
    drifts_as_one,
    finding_of_view,
    impossible_causes,
    judged_in_turn,
)
from gimbalcal.diagnose.verdict.judgement import Judgement
from gimbalcal.effects.sensor_grades import GRADES
from gimbalcal.errors import InputError
from gimbalcal.progress import no_progress
from gimbalcal.units import to_si
from gimbalcal.views.core import absent_effect
from gimbalcal.views.norm import norm
from gimbalcal.views.pointing import pointing
from tests.diagnose.search.test_refit import poses
from tests.diagnose.small import causes_of, telescope
from tests.estimate.pointing.mounts import ALT_AZ, ARCSEC, run

LABELS = ("base_tilt:north, east", "tube_flexure", "encoder_two_cycle:azimuth")


def entry(effect, axis, *twins):
    return Finding(effect, axis, 0.9, 9.0, (Estimate(effect, axis, 1.0, 0.1, "ug"),), twins)


def test_two_courses_of_one_bias_are_one_drift():
    found = [entry("warm_up", "x, y"), entry("cubic_nonlinearity", "x"), entry("slow_bias_drift", "y", "bias_step")]
    one, other = drifts_as_one(found)
    assert (one.effect, one.twins) == ("warm_up", ("slow_bias_drift", "bias_step"))
    assert [p.name for p in one.parameters] == ["warm_up", "slow_bias_drift"]
    assert other.effect == "cubic_nonlinearity"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (entry("warm_up", "x"), entry("bias_drift", "z")),  # two sensors
        (entry("bias_drift", "x"), entry("gyro_bias_drift", "x")),  # two triads
        (entry("bias_drift", "x"), entry("bias_temperature", "x")),  # a thermometer tells them apart, or twins say so
    ],
)
def test_different_drifts_stay_apart(one, other):
    assert drifts_as_one([one, other]) == (one, other)


def test_what_something_else_is_likelier_to_be_is_not_named(monkeypatch):
    """The least likely cause goes first, and all others are asked again without it."""
    v = pointing(telescope(2, north=25.0, east=-9.0, bend=40.0))
    first = start_with_baseline(v)
    known = causes_of(v, first)
    tilt, bend, like = (next(c for c in known if c.label == label) for label in LABELS)
    taken = [(c, c.variants[0]) for c in (tilt, bend, like)]
    told = {tilt.key: 0.9, bend.key: 0.8, like.key: 0.01}
    monkeypatch.setattr(findings, "judged_without", lambda m, c: Judgement(c, told[c.key], (), 9.0))
    kept, verdicts = findings.confirm_causes(result_of(first, taken), no_progress)
    assert {c.key for c, _ in kept.causes} == {j.cause.key for j in verdicts} == {tilt.key, bend.key}


def test_a_cause_that_makes_held_out_rows_worse_is_not_named(monkeypatch):
    v = pointing(telescope(2, north=25.0, east=-9.0))
    first = start_with_baseline(v)
    known = causes_of(v, first)
    tilt, bend = (next(c for c in known if c.label == label) for label in LABELS[:2])
    both = result_of(first, [(c, c.variants[0]) for c in (tilt, bend)])
    sure = [Judgement(c, 0.9, (), 9.0) for c in (tilt, bend)]
    assert findings.worsening_cause(result_of(first, [(tilt, tilt.variants[0])]), sure[:1]) is None
    misfit = findings.held_out_misfit
    monkeypatch.setattr(
        findings,
        "held_out_misfit",
        lambda m, sigma: (1.5 if "tube_flexure" in {e.id for e in m.effects} else 1.0) * misfit(m, sigma),
    )
    assert findings.worsening_cause(both, sure) is bend
    monkeypatch.setattr(findings, "judged_without", lambda m, c: Judgement(c, 0.9, (), 9.0))
    kept, verdicts = findings.confirm_causes(both, no_progress)
    assert {c.key for c, _ in kept.causes} == {j.cause.key for j in verdicts} == {tilt.key}


def test_a_search_that_ends_without_inverse_gives_way_to_what_was_kept(monkeypatch):
    """Of a unit turned by hand a dead zone took the place of a refused creep, and the diagnosis ended in a refusal."""
    v = pointing(telescope(2, north=25.0, east=-9.0, n=40))
    first = start_with_baseline(v)
    tilt, like = (next(c for c in causes_of(v, first) if c.label == LABELS[k]) for k in (0, 2))

    def judged(_, c):
        if c.key == tilt.key:
            raise InputError("different forces read the same")
        return Judgement(c, 0.001, (), 9.0)

    monkeypatch.setattr(findings, "judged_without", judged)
    kept, verdicts = findings.confirm_causes(result_of(first, [(like, like.variants[0])]), no_progress)
    assert (kept.steps, verdicts) == ((), [])
    assert kept.shapes
    with pytest.raises(InputError, match="different forces"):
        findings.confirm_causes(result_of(first, [(tilt, tilt.variants[0])]), no_progress)


def test_a_strong_cause_that_is_refused_leaves_its_shape(monkeypatch):
    """A misfit far beyond the noise does not vanish with the last name for it: nothing left would be "adequate"."""
    v = pointing(telescope(2, north=25.0, east=-9.0, n=40))
    first = start_with_baseline(v)
    tilt = next(c for c in causes_of(v, first) if c.label == LABELS[0])
    monkeypatch.setattr(findings, "judged_without", lambda m, c: Judgement(c, 0.001, (), 9.0))
    kept, verdicts = findings.confirm_causes(result_of(first, [(tilt, tilt.variants[0])]), no_progress)
    assert (kept.steps, verdicts) == ((), [])
    assert kept.shapes
    assert kept.with_shapes.rms < 0.5 * first.rms


def test_what_is_likelier_than_a_refused_cause_takes_its_place(monkeypatch):
    v = pointing(telescope(2, north=25.0, east=-9.0, n=40))
    first = start_with_baseline(v)
    like = next(c for c in causes_of(v, first) if c.label == LABELS[2])
    monkeypatch.setattr(
        findings, "judged_without", lambda m, c: Judgement(c, 0.001 if c.key == like.key else 0.9, (), 9.0)
    )
    kept, verdicts = findings.confirm_causes(result_of(first, [(like, like.variants[0])]), no_progress)
    assert [j.cause.label for j in verdicts] == [LABELS[0]]
    assert kept.end.rms < 0.2 * first.rms


def elevations(law):
    """A mount whose elevation is read with an error by this law, in arcsec."""
    rng = np.random.default_rng(11)
    E, A = np.radians(rng.uniform(10, 85, 60)), rng.uniform(-3, 3, 60)
    r = run(ALT_AZ, np.stack([E, A], axis=1), (), 1.0)
    seen = {("true_angle", "elevation"): r.channels["true_angle", "elevation"] - ARCSEC * law(E)}
    return replace(r, channels=r.channels | seen)


@pytest.mark.parametrize(
    ("law", "series"),
    [
        (lambda E: 12 / np.tan(E) - 0.3 / np.tan(E) ** 3, True),  # refraction down to 10 degrees is not R cot E
        (lambda E: 12 / np.tan(E) + 6 * np.cos(E) + 5 * np.sin(2 * E), False),
    ],
)
def test_terms_of_a_series_are_no_causes(law, series):
    """-138 arcsec of two cycle and 660 of eccentricity were named beside a law of refraction of a few arcsec."""
    v = pointing(elevations(law))
    first = start_with_baseline(v)
    known = {c.label: c for c in causes_of(v, first)}
    taken = [known[label] for label in ("refraction", "encoder_two_cycle:elevation", "encoder_eccentricity:elevation")]
    c = result_of(first, [(cause, cause.variants[0]) for cause in taken])
    assert {cause.label for cause, _ in cancelling_causes(c)} == ({t.label for t in taken[1:]} if series else set())


@pytest.mark.parametrize(("memory", "impossible"), [(0.2, True), (0.02, False)])
def test_a_size_that_no_unit_has_is_no_cause(memory, impossible):
    """A creep of 477000 ug/g was named on means of a unit that hardly turned from one to the next."""
    s = 0.25 * np.arange(150)  # 14 deg from one mean to the next
    up = np.stack([np.cos(s) * np.cos(0.13 * s), np.sin(s), np.cos(s) * np.sin(0.13 * s)], axis=1)
    r, before = poses(up, np.random.default_rng(5), spoilt=1e-3), np.maximum(np.arange(150) - 2, 0)
    forces = {k: y + memory * (y[before] - y) for k, y in r.channels.items()}
    v = norm(replace(r, channels=forces, grade=GRADES["consumer"]), ("bias", "scale_factor", "misalignment"))
    first = start_with_baseline(v)
    remembers = next(c for c in causes_of(first.view, first) if c.label == "two_move_memory:x, y, z")
    c = result_of(first, [(remembers, remembers.variants[0])])
    assert [cause.effect for cause, _ in impossible_causes(c)] == ["two_move_memory"] * impossible
    if impossible:
        _, verdicts = confirm_causes(c, no_progress)
        assert "two_move_memory" not in {j.cause.effect for j in verdicts}


def test_a_cause_is_told_with_the_sizes_of_the_last_model():
    v = pointing(telescope(2, north=25.0, east=-9.0))
    first = start_with_baseline(v)
    tilt = next(c for c in causes_of(v, first) if c.label == LABELS[0])
    c = result_of(first, [(tilt, tilt.variants[0])])
    (j,) = judged_in_turn(c)
    told = finding_of_view(c.end, j)
    assert (told["effect"], told["probability"]) == ("base_tilt", 0.9)
    (north, east) = told["parameters"]
    assert abs(north["value"] - 25.0) < 4 * north["sigma"] < 4.0
    assert abs(east["value"] + 9.0) < 4 * east["sigma"] < 4.0


def test_errors_of_a_size_with_a_fitted_time_constant_are_as_large_as_its_sigma():
    """A warm-up as long as the recording: with its time constant held, errors were 3.5 of the stated sigmas (rms)."""
    tau, size, terms, pulls = 500.0, 2e-2, ("bias", "scale_factor", "misalignment"), []
    for seed in range(16):
        rng = np.random.default_rng(seed)
        r = poses(rng.standard_normal((60, 3)), rng, noise=1e-5, spoilt=1e-3)
        y = r.channels["specific_force", "y"] + size * np.exp(-(r.time - r.time[0]) / tau)
        v = norm(replace(r, channels={**r.channels, ("specific_force", "y"): y}), terms)
        cause = Candidate("warm_up", "x, y, z", v.parameters_of("warm_up"), ())
        effects = (*start_with_baseline(v).effects, absent_effect("warm_up", v.stimulus, tau=0.9 * tau))
        wanted = [p for e in (*terms, "warm_up") for p in v.parameters_of(e)]
        m = with_constants(refit(v, effects, wanted), {"warm_up"})
        told = {(p.name, p.axis): p for p in finding_of_view(m, Judgement(cause, 0.9, (), 9.0)).parameters}
        p = told[cause.parameters[1].name, "y"]
        pulls.append((to_si(p.value, p.unit) - size) / to_si(p.sigma, p.unit))
        assert told["tau", ""].sigma > 0
    assert 0.6 < np.sqrt(np.mean(np.square(pulls))) < 1.5
