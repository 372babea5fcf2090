"""Causes of a view: what is not in the model yet, as derivatives of its misfit; shapes in the misfit's own size."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.library.assemble import (
    assemble_library,
    available_effects,
    constants_of,
    free_rows,
    misfit_powers,
    orthonormal_basis,
    orthonormal_or_zero,
)
from gimbalcal.diagnose.library.shapes import shapes_of
from gimbalcal.diagnose.search.refit import start_with_baseline
from gimbalcal.effects import CATALOGUE, parameters, zero_effect
from gimbalcal.effects.sensor_grades import GRADES
from gimbalcal.number import Array
from gimbalcal.views.norm import norm
from gimbalcal.views.pointing import pointing
from tests.diagnose.small import telescope, turned

STARS = pointing(telescope(1, north=12.0))
MODEL = start_with_baseline(STARS)
FOUND = assemble_library(MODEL)
KNOWN, X = FOUND.candidates, FOUND.X
HANDS = norm(turned(1))


def test_a_cause_is_what_the_model_does_not_hold():
    fitted = {(p.effect, p.field, p.axis) for p in MODEL.parameters}
    for c in KNOWN:
        assert not {(p.effect, p.field, p.axis) for p in c.parameters} & fitted
    effects = {c.effect for c in KNOWN if not c.rival}
    assert effects <= set(available_effects(STARS))
    assert {"base_tilt", "tube_flexure"} <= effects
    assert "bias_drift" not in effects  # of accelerometers


def test_columns_are_what_one_prior_sigma_adds():
    c = next(c for c in KNOWN if c.effect == "base_tilt" and c.axis == "north, east")
    (v,) = c.variants
    made = zero_effect(CATALOGUE["base_tilt"], STARS.stimulus.axis_names)
    J = STARS.noise_free([*MODEL.effects, made]).jacobian(
        c.parameters
    )  # where the model is on the stars, not the readouts
    columns = MODEL.expanded(X[:, list(v.index)])
    np.testing.assert_allclose(columns, J * [p.sigma for p in c.parameters])
    E = STARS.stimulus.true_angle[:, 0]
    # about north a tilt shows whole on the horizon and not at the zenith, whichever way it is told
    size = np.linalg.norm(columns, axis=(1, 2)) / c.parameters[0].sigma
    assert size[np.argmin(E)] > 0.9
    assert np.all(np.isfinite(X))


def test_axes_that_the_rows_cannot_show_are_left_out():
    assert {p.axis for p in STARS.parameters_of("base_tilt")} == {"north", "east"}
    made = HANDS.parameters_of("misalignment")
    assert len(made) == 3  # a triangle: three of six turn the unit as a whole
    (catalogue,) = {p.sigma for p in made}
    assert catalogue == pytest.approx(parameters(CATALOGUE["misalignment"])[0].sigma)


def test_sizes_are_those_of_the_grade_and_a_drift_is_as_fast_as_the_recording_is_short():
    low = replace(HANDS, grade=GRADES["consumer"])
    for effect, times in (("misalignment", 30.0), ("bias", 100.0), ("quadratic_nonlinearity", 100.0)):
        for p, q in zip(low.parameters_of(effect), HANDS.parameters_of(effect), strict=True):
            assert p.sigma == pytest.approx(times * q.sigma)
    (p, *_), (q, *_) = low.parameters_of("bias_drift"), parameters(CATALOGUE["bias_drift"])
    assert p.sigma == pytest.approx(100 * q.sigma * 3600 / np.ptp(HANDS.stimulus.time))


def test_shapes_are_as_large_as_the_misfit():
    blocks: list[Array] = [np.zeros((80, 2, 4))]
    made = shapes_of(
        STARS, MODEL.residual, orthonormal_basis(MODEL.jacobian), blocks, free_rows(STARS, MODEL.parameters)
    )
    rms = np.sqrt(np.mean(MODEL.residual**2))
    columns = np.concatenate(blocks, axis=-1)
    assert {c.effect for c in made} >= {"unknown time"}
    assert {c.axis for c in made} == {"across", "along"}
    for c in made:
        at = list(c.variants[0].index)
        assert min(at) >= 4
        k = ("across", "along").index(c.axis)
        np.testing.assert_allclose(np.sqrt((columns[:, k, at] ** 2).mean(axis=0)), rms)
        assert np.abs(columns[:, 1 - k, at]).max() == 0.0


def test_no_shape_has_more_than_half_as_many_columns_as_there_are_rows_to_test_it_with():
    blocks: list[Array] = [np.zeros((80, 2, 4))]
    made = shapes_of(STARS, MODEL.residual, orthonormal_basis(MODEL.jacobian), blocks, 6)
    assert {len(c.variants[0].index) for c in made} == {2, 3}


def test_an_effect_of_the_model_keeps_its_constants():
    effect = next(
        i for i in available_effects(STARS) if constants_of(zero_effect(CATALOGUE[i], STARS.stimulus.axis_names))
    )
    made = zero_effect(CATALOGUE[effect], STARS.stimulus.axis_names)
    known = assemble_library(replace(MODEL, effects=(*MODEL.effects, made))).candidates
    assert {v.constants for c in known if c.effect == effect for v in c.variants} == {constants_of(made)}


def test_a_scan_ranks_by_what_least_squares_takes_away():
    rng = np.random.default_rng(3)
    X, y = rng.standard_normal((5, 12, 2, 3)), rng.standard_normal((12, 2))
    X[2, ..., 1] = 2 * X[2, ..., 0]  # spans less than it has columns
    X[3, ..., 2] = 0.0
    taken = [y.ravel() @ A @ np.linalg.lstsq(A, y.ravel(), rcond=None)[0] for A in X.reshape(5, 24, 3)]
    np.testing.assert_allclose(misfit_powers(np.stack([orthonormal_or_zero(x) for x in X]), y), taken)
