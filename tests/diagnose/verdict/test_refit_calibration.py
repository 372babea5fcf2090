"""A diagnosis ends in a calibration: what it corrects is explained, and it is the fit of the rows it came from."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gimbalcal.calibration import Provenance, from_dict
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.evidence.stated_noise import scale_to_scatter
from gimbalcal.diagnose.search.combine import combine
from gimbalcal.diagnose.search.fitted_causes import JointCovariance, fit_causes
from gimbalcal.diagnose.verdict.pooled_sizes import CommonSizes, causes_by_recording, common_sizes
from gimbalcal.diagnose.verdict.refit_calibration import calibrated, sized_causes_of
from gimbalcal.recording import Source
from gimbalcal.units import to_si
from gimbalcal.views.known_attitude import fit_baseline, view_at_known_attitude
from tests.diagnose import static_plant
from tests.diagnose.plant import ARCSEC, UG, known, record
from tests.diagnose.small import candidate, searched
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


def observed_of(r, label):
    return searched(scale_to_scatter(fit_baseline(view_at_known_attitude(r))), label, count=3)


def calibration_with(c, members):
    """The calibration of all recordings of a ranking with these causes."""
    each = causes_by_recording(c, members)
    found = sized_causes_of(common_sizes(each, [c.library.candidates[i] for i in members]))
    return calibrated([(p.search.fit, p.fit.projection.node, p.ordinals) for p in each], found, "")[0]


@cache
def case(kind, label, size):
    r = record(np.random.default_rng(4), known(1)[kind][0], size, dwell=12)
    s = observed_of(r, label)
    return r, s, calibration_with(s, [candidate(s, label)])


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


def test_the_causes_have_the_sizes_that_were_told_and_the_others_go_with_them():
    _, s, made = case(*CAUSES[0])
    f = fit_causes(s, [candidate(s, CAUSES[0][1])])
    p = s.library.candidates[f.members[0]].parameters[0]
    at = made.parameters.index(p)
    assert made.values[at] == pytest.approx(f.x[0] * p.sigma)
    assert made.sigmas[at] == pytest.approx(np.sqrt(f.covariance[0, 0]) * p.sigma)
    # constants and cause from the same rows by one least squares, in the noise that is likeliest
    node, o = f.projection.node, s.fit
    A = np.concatenate([node.whiten(o.reduced(o.Z)), node.whiten(s.library.X[:, list(f.index)])], axis=1)
    C = np.linalg.pinv(A.T @ A, rcond=1e-13, hermitian=True)
    scale = np.array([q.sigma for q in o.parameters])
    (turn,) = (set(u["direction"]) for u in made.unobservable)  # of the triad against the platform gimbal
    assert turn == {"misalignment:xz", "misalignment:yz", "gimbal_zero:platform"}
    seen = np.array([q.label not in turn for q in o.parameters])
    # the size of the cause is averaged over the noise, which widens what goes with it: bias y by 3 %
    np.testing.assert_allclose((made.sigmas[:-1] / scale)[seen], np.sqrt(np.diag(C))[:-1][seen], rtol=5e-2)


def test_a_constant_of_an_effect_stands_in_the_file():
    made = case(*CAUSES[3])[2]
    tau = next(row for row in made.to_dict()["parameters"] if row["name"] == "warm_up.tau")
    assert to_si(tau["value"], tau["unit"]) == pytest.approx(700, rel=0.3)
    assert tau["sigma"] > 0
    again = from_dict(made.to_dict())
    held = {p.label: x for p, x in zip(again.parameters, again.values, strict=True)}
    assert held["warm_up.tau"] == pytest.approx(to_si(tau["value"], tau["unit"]))


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
        c = combine([searched(o, *([label] if r is not run else ["bias_drift:x"]), count=1)
                     for o, r in zip(fits, recordings, strict=True)])  # fmt: skip
        return calibration_with(c, [next(i for i, x in enumerate(c.library.candidates) if x.label == label)])

    golden_text(together(one[0], other).outcome)
    with_run = together(one[0], run)
    assert not {"base_tilt", "polar_axis_misalignment"} & {p.effect for p in with_run.parameters}
    golden_text(with_run.outcome)


def test_an_effect_that_was_found_twice_with_other_constants_is_fitted_with_one():
    """Warm-up of two accelerometers, each with a time constant of its own."""
    warm = known(1)["warm-up"][0]
    r = record(np.random.default_rng(4), lambda b: {"output": np.outer(warm(b)["output"][:, 1], [0.0, 1.0, 0.8])},
               3000 * UG, dwell=12)  # fmt: skip
    s = searched(scale_to_scatter(fit_baseline(view_at_known_attitude(r))), "warm_up:y", "warm_up:z", count=3)
    f = fit_causes(s, [0, 1])
    causes = tuple(s.library.candidates[m] for m in f.members)
    scale = np.array([p.sigma for c in causes for p in c.parameters])
    joint = JointCovariance((), f.covariance * np.outer(scale, scale))
    one, other = (("tau", 700.0, 10.0),), (("tau", 900.0, 10.0),)
    made = calibrated(
        [(s.fit, f.projection.node, (0, 1))], sized_causes_of(CommonSizes(causes, f.x, (one, other), joint)), ""
    )[0]
    values = dict(zip((p.label for p in made.parameters), made.values, strict=True))
    assert values["warm_up.tau"] == pytest.approx(700.0)
    assert values["warm_up:z"] == pytest.approx(0.8 * values["warm_up:y"], rel=0.05)
    assert made.residual.chi2 / made.residual.dof == pytest.approx(1.0, abs=0.3)
