"""Causes taken up one after the other: refits against scipy, steps in order, and nothing kept that memory explains."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares

from gimbalcal.diagnose.estimated_noise import diagnose_selected
from gimbalcal.diagnose.evidence.correlated_noise import possible_noises
from gimbalcal.diagnose.laws import law_claims
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.search import sensor_random_walks
from gimbalcal.diagnose.search import stepwise as stepwise_search
from gimbalcal.diagnose.search.ranking import log_priors, search
from gimbalcal.diagnose.search.refit import refit, start_with_baseline
from gimbalcal.diagnose.search.stepwise import (
    NEAR,
    SWAP,
    backward_eliminate,
    evidence_for,
    likeliest_after_refit,
    likeliest_missing,
    likeliest_round,
    ln_evidence,
    refine_constants,
    stepwise,
    with_causes,
)
from gimbalcal.effects import CATALOGUE, parameters, values, with_values
from gimbalcal.progress import no_progress
from gimbalcal.units import from_si
from gimbalcal.views.noise import NoiseModel
from gimbalcal.views.norm import norm
from gimbalcal.views.pointing import pointing
from tests.diagnose.plant import ARCSEC
from tests.diagnose.search.test_refit import poses
from tests.diagnose.small import causes_of, telescope


@cache
def view(north=0.0, east=0.0, bend=0.0):
    return pointing(telescope(1, north, east, bend))


@cache
def found():
    return stepwise(view(12.0, -7.0, 15.0), no_progress)


def test_a_refit_is_least_squares():
    """Parameters, covariance and what is left, against Levenberg and Marquardt on numerical derivatives."""
    v = view(12.0, -7.0)
    ps = tuple(p for i in ("gimbal_zero", "base_tilt") for p in parameters(CATALOGUE[i], v.stimulus.axis_names))
    ps = tuple(p for p in ps if p.axis != "down")  # the azimuth zero says the same
    m = refit(v, with_values((), ps, np.zeros(len(ps)), v.stimulus.axis_names), ps)

    def misfit(x):
        return v.linearised(with_values((), ps, x * ARCSEC, v.stimulus.axis_names), ())[0].ravel() / ARCSEC

    best = least_squares(misfit, np.zeros(len(ps)), method="lm")
    scale = ARCSEC
    C = np.linalg.inv(best.jac.T @ best.jac) * 2 * best.cost / (len(best.fun) - len(ps)) * scale**2
    np.testing.assert_allclose(values(m.effects, ps), best.x * scale, atol=1e-3 * np.sqrt(np.diag(C)).min())
    np.testing.assert_allclose(m.covariance, C, rtol=1e-3, atol=1e-4 * np.diag(C).max())
    assert m.rms == pytest.approx(np.sqrt(2 * best.cost / 80) * scale, rel=1e-6)
    assert {(p.effect, p.axis): x for p, x in zip(ps, best.x, strict=True)}["base_tilt", "north"] == pytest.approx(
        12.0, abs=4 * np.sqrt(np.diag(C)).max() / scale
    )


def test_a_direction_that_nothing_shows_keeps_its_prior():
    v = view()
    ps = parameters(CATALOGUE["base_tilt"]) + parameters(CATALOGUE["gimbal_zero"], v.stimulus.axis_names)
    m = refit(v, with_values((), ps, np.zeros(len(ps)), v.stimulus.axis_names), ps)
    down = [p.axis for p in ps].index("down")  # only its sum with the azimuth zero is seen
    assert np.sqrt(m.covariance[down, down]) > 0.1 * ps[down].sigma


def test_a_tilted_base_and_a_bent_tube_are_taken_up():
    c = found()
    taken = [s.cause[0].effect for s in c.steps]
    assert set(taken) == {"base_tilt", "tube_flexure"}
    rms = [c.start.rms, *(s.model.rms for s in c.steps)]
    assert rms == sorted(rms, reverse=True)
    assert c.end is c.steps[-1].model
    assert c.end.rms == pytest.approx(np.sqrt(2) * ARCSEC, rel=0.15)
    assert c.shapes == ()
    size = dict(
        zip([(p.effect, p.axis) for p in c.end.parameters], values(c.end.effects, c.end.parameters), strict=True)
    )
    sigma = dict(zip(size, np.sqrt(np.diag(c.end.covariance)), strict=True))
    for key, truth in ((("base_tilt", "north"), 12.0), (("base_tilt", "east"), -7.0)):
        assert abs(from_si(size[key], "arcsec") - truth) < 4 * from_si(sigma[key], "arcsec")


def test_the_first_step_takes_away_most():
    c = found()
    each = [with_causes(c.start, [s.cause]).rms for s in c.steps]
    assert each[0] == min(each) == c.steps[0].model.rms


def test_a_near_rival_that_leads_in_the_ranking_gives_way_to_the_cause_that_fits():
    first = start_with_baseline(view(12.0, -7.0))
    s = search(first)
    true, *others = [h for h in s.hypotheses if len(h.members) == 1 and not h.unknown(s.library.candidates)]
    cause, rival = (s.library.candidates[h.members[0]] for h in (true, others[-1]))
    for lead, expected in ((NEAR - 1, cause), (NEAR + 1, rival)):
        leading = replace(others[-1], ln_weight=true.ln_weight + lead, ln_bayes=true.ln_bayes + lead)
        ranked = replace(s, hypotheses=(leading, true))
        best = likeliest_after_refit(first, [], ranked, likeliest_round(ranked, rival), rival)
        assert [c.key for c, _ in best.causes] == [expected.key]
        assert (best.ln_odds_over > SWAP) == (expected is cause)


def test_nothing_is_taken_up_where_nothing_is_missing():
    said: list[str] = []
    for seed in range(2, 6):
        c = stepwise(pointing(telescope(seed)), said.append)
        assert (c.steps, c.shapes, said) == ((), (), [])
        assert c.end is c.start
        assert likeliest_missing(c.start).ln_total < np.log(20)


def test_no_model_is_searched_twice_for_what_it_may_lack(monkeypatch):
    """Of a clean mount: in white noise to select causes, and in all noises for what these leave."""
    asked = []

    def counting(fit, candidates=None, nodes=()):
        asked.append((fit, len(nodes or possible_noises(fit))))
        return search(fit, candidates, nodes)

    for module in (stepwise_search, sensor_random_walks, law_claims):
        monkeypatch.setattr(module, "search", counting)
    diagnosis = diagnose_selected(stepwise(pointing(telescope(2)), no_progress), no_progress)
    assert diagnosis.verdict == "adequate"
    assert [nodes for _, nodes in asked] == [1, len(possible_noises(asked[0][0]))]


def test_what_noise_with_a_memory_explains_is_not_kept():
    """A slow wander of the misfit follows a cause by chance: 20 to one in white noise is no claim in coloured noise."""
    c = found()
    without = with_causes(c.start, c.causes[:1])
    assert evidence_for(without, c.causes[1]) > np.log(20)  # a bent tube is not explained by memory
    last = with_causes(c.start, c.causes)
    assert evidence_for(last, c.causes[1]) < 1  # once it is in the model nothing is left of it


@pytest.mark.parametrize("own_scales", [False, True])
@pytest.mark.parametrize(("north", "east"), [(0.0, 0.0), (1.0, -0.7)])
def test_evidence_at_the_minimum_is_that_of_the_search(north, east, own_scales):
    """The same model by two ways: ranked at the baseline over scales and sizes, or fitted and asked at its minimum."""
    v = view(north, east)
    first = start_with_baseline(replace(v, noise=replace(v.noise, of_each_channel=own_scales), cache={}))
    s = search(first, assemble_library(first), possible_noises(first))
    every = zip(s.library.candidates, s.singles.tolist(), strict=True)
    ln = {c: ln for c, ln in every if len(c.variants) == 1 and not c.rival and not c.effect.startswith("gimbal_zero")}
    assert len(ln) > 15
    made = [ln_evidence(with_causes(first, [(c, c.variants[0])])) - ln_evidence(first) for c in ln]
    np.testing.assert_allclose(made, list(ln.values()), rtol=0.01, atol=0.1)
    assert (max(made) > 20.0) == bool(north)


def test_prior_shares_make_a_whole_of_causes_and_of_shapes():
    v = view()
    m = start_with_baseline(v)
    known = causes_of(v, m)
    share = np.exp(log_priors(known, v.kind))
    shape = np.array([bool(c.rival) for c in known])
    assert share[shape].sum() == pytest.approx(1.0)
    assert share[~shape].sum() == pytest.approx(1.0)

    def whole(effect):
        return sum(float(x) for c, x in zip(known, share, strict=True) if c.effect == effect)

    assert whole("base_tilt") == pytest.approx(10 * whole("encoder_eccentricity"))  # every mount leans
    assert whole("base_tilt") == pytest.approx(whole("refraction"))  # that has no axes
    tilt = {c.axis: x for c, x in zip(known, share, strict=True) if c.effect == "base_tilt"}
    assert tilt["north, east"] == pytest.approx(tilt["north"] + tilt["east"])  # all axes together weigh half


def test_rows_weigh_by_their_sigma():
    v = view()
    sigma = np.ones((80, 2))
    sigma[:, 1] = 4.0
    r = np.ones((80, 2, 3))
    made = NoiseModel(sigma).weighted(r)
    np.testing.assert_allclose(made[:, 0], 1.0)
    np.testing.assert_allclose(made[:, 1], 0.25)
    np.testing.assert_array_equal(v.noise.weighted(r), r)  # every star of this run has the same weight


def test_constants_between_the_values_of_a_grid_are_fitted_and_leave_no_rest():
    """A warm-up of 1333 s: at the nearest value of the grid a drift beside it would explain the rest."""
    rng = np.random.default_rng(1)
    r, tau = poses(rng.standard_normal((40, 3)), rng, 1e-5, 1e-3), 1333.0
    fade = 5 * 9.80665e-3 * np.exp(-9 * (r.time - r.time[0]) / tau)
    x = r.channels["specific_force", "x"] + fade
    warming = replace(r, time=9 * r.time, channels={**r.channels, ("specific_force", "x"): x})
    v = norm(warming, ("bias", "scale_factor", "misalignment"))
    first = start_with_baseline(v)
    known = {c.label: c for c in causes_of(v, first)}
    warm, drift = known["warm_up:x"], known["bias_drift:x"]
    (_, told), _ = made = refine_constants(first, [(warm, warm.variants[2]), (drift, drift.variants[0])])
    assert len(told.constants) == 1
    kept = backward_eliminate(first, made, no_progress)
    assert [c.label for c, _ in kept] == ["warm_up:x"]
    ((_, alone_),) = kept
    ((name, value),) = alone_.constants
    assert name == "tau"
    assert value == pytest.approx(tau, rel=0.03)
