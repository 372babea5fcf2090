"""One fit of constants and causes: of one recording, of several, against dense least squares, and as a calibration."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import chi2

from gimbalcal.calibration import Provenance, from_dict
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.evidence.stated_noise import scale_to_scatter
from gimbalcal.diagnose.library.assemble import columns_at
from gimbalcal.diagnose.search.combine import combine_rankings
from gimbalcal.diagnose.search.fitted_causes import fit_causes
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.diagnose.verdict.agreement import inverse_of
from gimbalcal.diagnose.verdict.joint_fit import joint_fit, parts_of
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.effect import constants
from gimbalcal.effects.grids import limits
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.recording import Source
from gimbalcal.units import to_si
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose import static_plant
from tests.diagnose.plant import ARCSEC, UG, cooled, known, on, record
from tests.diagnose.small import candidate, covariance, gls, observed, rows_of, searched
from tests.golden import golden_text

CAUSES = [  # kind of the cause, its label, a size in ug or arcsec that stands far above the noise
    ("bias T", "bias_temperature:y", 30 * UG),
    ("cubic", "cubic_nonlinearity:y", 200 * UG),
    ("drift", "bias_drift:y", 150 * UG),
    ("warm-up", "warm_up:y", 3000 * UG),
    ("eccentricity", "encoder_eccentricity:inner", 20 * ARCSEC),
    ("friction", "gimbal_friction:inner", 15 * ARCSEC),
    ("tilt drift", "base_tilt_drift:north, east", 20 * ARCSEC),
    ("blunder", "position_blunder", 30 * ARCSEC),
]
PAIR = ("scale_factor_asymmetry:y", "cross_coupling:y")


def observed_of(r, label):
    return searched(scale_to_scatter(fit_baseline(view_at_known_attitude(r))), label, count=3)


def fitted(c, members):
    return joint_fit(parts_of(c, members), [c.library.candidates[i] for i in members])


def members_of(c, labels):
    return [[x.label for x in c.library.candidates].index(label) for label in labels]


@cache
def case(kind, label, size):
    r = record(np.random.default_rng(4), known(1)[kind][0], size, dwell=12)
    s = observed_of(r, label)
    return r, s, fitted(s, [candidate(s, label)]).calibration(None)


@pytest.mark.parametrize(("kind", "label", "size"), CAUSES)
def test_corrected_by_it_a_recording_lacks_nothing(kind, label, size):
    r, s, made = case(kind, label, size)
    assert s.ln_total > 10 * CLAIM
    assert made.residual.chi2 / made.residual.dof == pytest.approx(1.0, abs=0.3)  # 300 numbers: 4 sigma of 0.08
    read = from_dict(json.loads(json.dumps(made.to_dict())))  # as a file has it
    assert observed_of(read.apply(r), label).ln_total < CLAIM
    values = dict(zip((p.label for p in made.parameters), made.values, strict=True))
    if kind == "bias T":
        assert values["b_T:y"] == pytest.approx(size, abs=4 * made.sigmas[[*values].index("b_T:y")])


def test_one_recording_has_the_least_squares_of_its_rows_averaged_over_the_noise():
    """Constants and cause by one generalised least squares in each noise, whose spread is part of the covariance."""
    _, s, made = case(*CAUSES[0])
    f, o = fit_causes(s, [candidate(s, CAUSES[0][1])]), s.fit
    (turn,) = (set(u["direction"]) for u in made.unobservable)  # of the triad against the platform gimbal
    assert turn == {"misalignment:xz", "misalignment:yz", "gimbal_zero:platform"}
    A, y = np.concatenate([rows_of(o)[0], s.library.X[:, list(f.index)]], axis=1), rows_of(o)[1]
    size = np.linalg.norm(A, axis=0)
    estimates, covariances = [], []
    for p in s.projections:
        root = np.linalg.pinv(p.node.whiten(A) / size, rcond=1e-7)
        estimates.append(root @ p.node.whiten(y[:, None])[:, 0])
        covariances.append(root @ root.T)
    x, w = f.weights @ np.array(estimates), f.weights
    spread = np.array(estimates) - x
    C = np.einsum("k,kij->ij", w, covariances) + np.einsum("k,ki,kj->ij", w, spread, spread)
    scale = np.array([q.sigma for q in (*o.parameters, *s.library.candidates[0].parameters)]) / size
    seen = np.array([q.label not in turn for q in made.parameters])
    np.testing.assert_allclose(made.sigmas[seen], (np.sqrt(np.diag(C)) * scale)[seen], rtol=2e-3)
    cause = made.parameters.index(s.library.candidates[0].parameters[0])
    assert made.values[cause] == pytest.approx(x[-1] * scale[-1], abs=0.01 * made.sigmas[cause])


def test_a_constant_of_an_effect_stands_in_the_file():
    made = case(*CAUSES[3])[2]
    tau = next(row for row in made.to_dict()["parameters"] if row["name"] == "warm_up.tau")
    assert to_si(tau["value"], tau["unit"]) == pytest.approx(700, rel=0.3)
    assert tau["sigma"] > 0
    again = from_dict(made.to_dict())
    held = {p.label: x for p, x in zip(again.parameters, again.values, strict=True)}
    assert held["warm_up.tau"] == pytest.approx(to_si(tau["value"], tau["unit"]))


def test_size_and_time_constant_have_one_covariance():
    """A least-squares fit of calibration, size and lag, its column by differences, in the likeliest noise."""
    s = searched(observed(1, known(0)["lagged T"][0], 100.0, dwell=30), "bias_temperature_lagged:x", count=1)
    joint = fitted(s, [0])
    c, o, node = s.library.candidates[0], s.fit, s.projections[0].node
    ((p, tau, sigma),) = joint.chosen_constants(0)
    (size,), (sigma_of_size,) = joint.size(0)
    h = 1e-4 * tau
    ahead, here, behind = (columns_at(o, c, (("tau", tau + d),)) for d in (h, 0.0, -h))
    slope = (ahead - behind) / (2 * h) * size / c.parameters[0].sigma
    half_range = float(np.ptp(limits(constants(CATALOGUE[c.effect])[0], o.view.stimulus))) / 2
    A = node.whiten(np.concatenate([o.reduced(o.Z), here, slope * half_range], axis=1))
    C = np.linalg.pinv(A.T @ A, rcond=1e-12, hermitian=True)[-2:, -2:]
    assert sigma_of_size == pytest.approx(np.sqrt(C[0, 0]) * c.parameters[0].sigma, rel=1e-3)
    assert sigma == pytest.approx(np.sqrt(C[1, 1]) * half_range, rel=1e-3)
    assert abs(tau - 900.0) < 5 * sigma
    assert p.label.endswith("tau")


def test_what_happened_once_is_taken_off_the_recording_that_it_happened_in():
    r, _, made = case(*CAUSES[-1])
    here, there = (replace(r, source=(Source("samples.csv", digest),)) for digest in ("a", "b"))
    made = replace(made, provenance=Provenance(recordings=here.source))
    steady = replace(made, effects=tuple(e for e in made.effects if e.id != "position_blunder"))
    np.testing.assert_array_equal(made.apply(there).angles(), steady.apply(there).angles())
    assert np.abs(made.apply(here).angles() - steady.apply(here).angles()).max() > 10 * ARCSEC


def test_recordings_of_one_unit_add_up_and_those_of_two_are_told_apart():
    label = "scale_factor_asymmetry:y"
    one = [record(np.random.default_rng(3), known(1)["asymmetry"][0], 150 * UG, dwell=d) for d in (6, 8)]
    other = record(np.random.default_rng(4), known(1)["asymmetry"][0], 150 * UG, dwell=6)
    run = static_plant.record(np.random.default_rng(1))

    def together(*recordings):
        fits = [scale_to_scatter(fit_baseline(view_at_known_attitude(r))) for r in recordings]
        c = combine_rankings([searched(o, *([label] if r is not run else ["bias_drift:x"]), count=1)
                     for o, r in zip(fits, recordings, strict=True)])  # fmt: skip
        return fitted(c, members_of(c, (label,))).calibration(None)

    golden_text(together(one[0], other).outcome)
    with_run = together(one[0], run)
    assert not {"base_tilt", "polar_axis_misalignment"} & {p.effect for p in with_run.parameters}
    golden_text(with_run.outcome)


def test_an_effect_that_was_found_twice_with_other_constants_is_fitted_with_one():
    """Warm-up of two accelerometers, each with a time constant of its own to start from."""
    warm = known(1)["warm-up"][0]
    r = record(np.random.default_rng(4), lambda b: {"output": np.outer(warm(b)["output"][:, 1], [0.0, 1.0, 0.8])},
               3000 * UG, dwell=12)  # fmt: skip
    s = searched(scale_to_scatter(fit_baseline(view_at_known_attitude(r))), "warm_up:y", "warm_up:z", count=3)
    (part,) = parts_of(s, [0, 1])
    part = replace(part, constants=((("tau", 600.0),), (("tau", 900.0),)))
    joint = joint_fit([part], s.library.candidates)
    ((_, tau, sigma),) = joint.chosen_constants(0)
    y, z = (joint.size(k)[0][0] for k in (0, 1))
    assert tau == pytest.approx(700.0, abs=4 * sigma)
    assert z == pytest.approx(0.8 * y, rel=0.05)
    made = joint.calibration(None)
    assert [p.label for p in made.parameters].count("warm_up.tau") == 1
    assert made.residual.chi2 / made.residual.dof == pytest.approx(1.0, abs=0.3)


def test_without_a_cause_the_others_take_up_what_they_can():
    s = searched(observed(3, known(1)["asymmetry"][0], 150.0, dwell=6), *PAIR, count=1)
    whole = fitted(s, [0, 1])
    less = whole.without("scale_factor_asymmetry")
    assert less.causes == whole.causes[1:]
    assert "scale_factor_asymmetry" not in {p.effect for p in less.solution.parameters}
    assert less.solution.chi2 > whole.solution.chi2 + 20
    alone = fitted(s, [1])
    np.testing.assert_allclose(less.solution.x, alone.solution.x, atol=1e-3 * alone.solution.sigma.min())


@cache
def two(sizes):
    made = [observed(seed, known(1)["asymmetry"][0], x, dwell=6) for seed, x in zip((1, 2), sizes, strict=True)]
    return combine_rankings([searched(o, *PAIR, count=1) for o in made])


def stacked(c, labels):
    """Rows of both recordings stacked: a calibration of its own for each, and sizes common to both."""
    Z, X, y, V = [], [], [], []
    for s in c.searches:
        calibration, data = rows_of(s.fit)
        index = [i for label in labels for i in s.library.candidates[candidate(s, label)].variants[0].index]
        Z.append(orthonormal(calibration))
        X.append(s.library.X[:, index])
        y.append(data)
        V.append(covariance(s.projections[0].node, len(data)))
    A = np.concatenate([block_diag(*Z), np.concatenate(X)], axis=1)
    x, C = gls(A, np.concatenate(y), block_diag(*V))
    p = X[0].shape[1]
    return x[-p:], C[-p:, -p:]


@pytest.mark.parametrize("labels", [PAIR[:1], PAIR])
def test_information_of_recordings_is_that_of_their_stacked_rows(labels):
    """Where all constants of the calibration are each recording's own, sizes are those of one dense least squares."""
    c = two((150.0, 150.0))
    joint = fitted(c, members_of(c, labels))
    x, C = stacked(c, labels)
    wanted = [p for cause in joint.causes for p in cause.parameters]
    scale, sigma = np.array([p.sigma for p in wanted]), np.sqrt(np.diag(C))
    values, sigmas = (np.concatenate(x) for x in zip(*map(joint.size, range(len(labels))), strict=True))
    np.testing.assert_allclose(values / scale, x, atol=0.01 * sigma.max())
    np.testing.assert_allclose(sigmas / scale, sigma, rtol=1e-3)
    assert [part.ordinals for part in joint.parts] == [tuple(range(len(labels)))] * 2


@pytest.mark.parametrize(("sizes", "alike"), [((150.0, 150.0), True), ((150.0, -150.0), False)])
def test_agreement_is_chi2_of_the_difference(sizes, alike):
    c = two(sizes)
    joint = fitted(c, members_of(c, PAIR[:1]))
    (x1, x2), (v1, v2) = [p.fit.x[0] for p in joint.parts], [p.fit.covariance[0, 0] for p in joint.parts]
    a = joint.agreement_on(0)
    assert a.combinations == 1
    assert a.rise == pytest.approx((x1 - x2) ** 2 / (v1 + v2), rel=1e-2, abs=0.02)
    assert a.p_value == pytest.approx(chi2.sf(a.rise, 1), rel=1e-9)
    assert (a.p_value > 1e-3) is alike


def test_one_recording_has_nobody_to_disagree_with():
    s = two((150.0, 150.0)).searches[0]
    joint = fitted(s, [candidate(s, PAIR[0])])
    assert (joint.agreement_on(0).combinations, joint.agreement_on(0).p_value) == (0, 1.0)
    assert joint.between is None


def test_without_members_it_is_the_calibration_alone():
    c = two((150.0, 150.0))
    joint = fitted(c, [])
    assert {p.effect for p in joint.solution.parameters} <= set(c.searches[0].fit.view.baseline)
    assert [(part.ordinals, part.fit.index) for part in joint.parts] == [((), ())] * 2


def test_a_direction_without_information_stays_without():
    C = np.array([[4.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(inverse_of(C), [[0.25, 0.0], [0.0, 0.0]])
    assert inverse_of(np.zeros((0, 0))).shape == (0, 0)


def test_a_lag_is_common_and_surer_together():
    label = "bias_temperature_lagged:x"
    made = [observed(seed, lambda b: on(0, cooled(b, 750.0)), 200.0, dwell=30) for seed in (3, 4)]
    searches = [searched(o, label, count=1) for o in made]
    both = fitted(combine_rankings(searches), [0])
    alone = [fitted(s, [0]) for s in searches]
    ((_, value, sigma),) = both.chosen_constants(0)
    assert abs(value - 750.0) < 3.5 * sigma
    scale = np.array([1e-6, 100.0])  # of a size and a lag, the last two parameters: their information adds
    each = [np.linalg.inv(one.solution.covariance[-2:, -2:] / np.outer(scale, scale)) for one in alone]
    C = np.linalg.inv(sum(each))
    assert sigma == pytest.approx(100.0 * np.sqrt(C[1, 1]), rel=0.1)
    lags = [one.chosen_constants(0)[0][1] for one in alone]
    assert min(lags) <= value <= max(lags)


def steps(b):
    """Steps of two accelerometers at two visits."""
    return {"output": np.stack([b.visit >= 6, b.visit >= 12, 0 * b.visit], axis=-1).astype(float)}


def test_causes_of_one_effect_keep_constants_of_their_own_where_one_cannot_hold_both():
    r = record(np.random.default_rng(4), steps, 150 * UG, dwell=30)
    s = searched(scale_to_scatter(fit_baseline(view_at_known_attitude(r))), "bias_step:x", "bias_step:y", count=1)
    joint = fitted(s, [0, 1])
    assert joint.differing == {"bias_step"}
    for k, visit in ((0, 6), (1, 12)):
        (x,), (sigma,) = joint.size(k)
        assert x == pytest.approx(150 * UG, abs=4 * sigma)
        ((_, epoch, _),) = joint.chosen_constants(k)
        assert epoch == pytest.approx(r.time[r.position == visit + 1][0], abs=60)
    assert "was found with several constants" in joint.calibration(None).outcome


@pytest.mark.parametrize(
    ("kind", "label", "size"), [("bias T", "bias_temperature:y", 3e3), ("warm-up", "warm_up:y", 3e4)]
)
def test_a_cause_of_hundreds_of_sigmas_leaves_nothing(kind, label, size):
    _, _, made = case(kind, label, size * UG)
    assert made.residual.chi2 / made.residual.dof == pytest.approx(1.0, abs=0.3)
    assert made.residual.rms["specific_force:y"] == pytest.approx(made.residual.rms["specific_force:x"], rel=0.3)
    small = case(*next(one for one in CAUSES if one[1] == label))[2]
    bias = [c.values[[p.label for p in c.parameters].index("bias:y")] for c in (made, small)]
    assert bias[0] == pytest.approx(bias[1], abs=10 * UG + 0.002 * size * UG)


def test_recordings_with_a_large_cause_are_linearised_where_each_is():
    made = [record(np.random.default_rng(4), known(1)["bias T"][0], 3000 * UG, dwell=d) for d in (12, 16)]
    fits = [scale_to_scatter(fit_baseline(view_at_known_attitude(r))) for r in made]
    joint = fitted(combine_rankings([searched(o, "bias_temperature:y", count=1) for o in fits]), [0])
    for x, sigma in (joint.size(0), joint.size_by(0, 0), joint.size_by(1, 0)):
        assert x[0] == pytest.approx(3000 * UG, abs=4 * sigma[0])
    assert joint.agreement_on(0).p_value > 1e-3
