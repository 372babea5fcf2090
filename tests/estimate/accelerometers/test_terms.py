"""Single terms of the stages, each against a number made another way: what the tests of whole fits do not notice."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.estimate.accelerometers.coarse import coarse
from gimbalcal.estimate.accelerometers.fine import FORCE_TERMS, NORM, PAIRS, fine, norm_rows
from gimbalcal.estimate.accelerometers.position_fit import fit_in_noise
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.schedule import FACE_POSITIONS
from gimbalcal.units import to_si
from gimbalcal.views.local import eliminate
from gimbalcal.views.positions import Noise, VisitRows, by_visit, position_parameters, view_of_positions
from tests.estimate.accelerometers.test_fine import half_squared_norm
from tests.estimate.device import ARCSEC, NOISE, PARAMETERS, SAMPLE, SITE, draw, effects, measured, outputs

NO_K = np.array([float(q.effect != "scale_nonlinearity") for q in PARAMETERS])
LABELS = [q.label for q in PARAMETERS]
WANTED = position_parameters(SPACE_STABLE, FORCE_TERMS)


def made(seed, truth_times=1.0):
    rng = np.random.default_rng(seed)
    return measured(draw(rng) * truth_times, rng)


# --- coarse -----------------------------------------------------------------------------------------------------------


def across_a_face(recording, size):
    """The recording with the two axes across the vertical of every face reading `size` [m/s^2] more."""
    channels = dict(recording.channels)
    faces = np.isin(recording.position, FACE_POSITIONS)
    for axis in "xyz":
        f = channels["specific_force", axis]
        channels["specific_force", axis] = f + size * (faces & (np.abs(f) < 1.0))
    return replace(recording, channels=channels)


def test_what_a_face_reads_across_the_vertical_takes_no_part():
    recording = made(11)
    plain, moved = (coarse(trusted_positions(r)) for r in (recording, across_a_face(recording, to_si(20.0, "ug"))))
    np.testing.assert_allclose(moved.values / plain.sigmas, plain.values / plain.sigmas, atol=1e-6)


def test_six_faces_alone_are_enough_for_scale_factors_and_biases():
    recording = made(12)
    six = coarse(trusted_positions(recording.select(np.isin(recording.position, FACE_POSITIONS))))
    every = coarse(trusted_positions(recording))
    # the other positions enter through the leans of the axes alone, in their squares
    np.testing.assert_allclose(six.values[:6] / every.sigmas[:6], every.values[:6] / every.sigmas[:6], atol=0.05)


def test_the_coarse_covariance_leaves_at_the_prior_what_is_named_and_nothing_else():
    c = coarse(trusted_positions(made(13)))
    scale = np.array([q.sigma for q in c.parameters])
    variance = np.linalg.eigvalsh(c.covariance / np.outer(scale, scale))
    assert len(c.unobservable) == 1
    assert variance[-1] == pytest.approx(1, rel=1e-3)
    assert variance[-2] < 0.1


def test_the_coarse_residual_is_that_of_the_noise_where_no_nonlinearity_is_neglected():
    chi2 = dof = 0.0
    left = []
    for seed in range(10):
        recording = made(seed, NO_K)
        c = coarse(trusted_positions(recording))
        chi2, dof = chi2 + c.residual.chi2, dof + c.residual.dof
        left += [c.residual.rms[f"specific_force:{axis}"] for axis in "xyz"]
    assert dof == 10 * (54 - 15 + 1)
    # two steps are a little worse than one least squares; 400 degrees of freedom scatter by 7 %
    assert chi2 / dof == pytest.approx(1.1, abs=0.3)
    # once the setting errors are taken out the noise of a dwell is left, and less: they take up a part of it
    assert 0.2 < np.sqrt(np.mean(np.square(left))) / (SAMPLE / np.sqrt(120)) < 1.0


# --- fine -------------------------------------------------------------------------------------------------------------


def test_equation_16_holds_where_scale_factors_are_far_from_one():
    y = made(14).triad("specific_force")
    x = np.concatenate([[0.1, -0.2, 0.05], [0.01, 0.02, -0.03], np.zeros(9)])
    scale = np.array([q.sigma for q in WANTED])
    info = norm_rows(y, np.ones(18), x, WANTED, SITE.gravity, SAMPLE)
    columns = [half_squared_norm(y, x + 1e-30j * unit).imag / 1e-30 for unit in np.eye(15)]
    exact = np.stack(columns, axis=1) / (SITE.gravity * SAMPLE) * scale
    np.testing.assert_allclose(info.rows[:, :15].T @ info.rows[:, :15], exact.T @ exact, rtol=1e-9, atol=1e-6)


def test_the_stage_tells_the_coefficients_with_their_sigmas_and_the_norm_that_is_left():
    recording = made(15)
    c = fine(trusted_positions(recording))
    stage, known = c.stages[0], [LABELS.index(label) for label in [q.label for q in WANTED[:9]]]
    np.testing.assert_array_equal(stage.values[:9], c.values[known])
    np.testing.assert_allclose(stage.sigmas[:9], c.sigmas[known], rtol=1e-9)
    x = c.values[[LABELS.index(q.label) for q in WANTED]]
    norm = np.sqrt(2 * half_squared_norm(recording.triad("specific_force"), x))
    rms = np.sqrt(np.mean((norm - SITE.gravity) ** 2))
    assert c.residual.rms[NORM] == pytest.approx(rms, rel=0.01)  # weights are equal; scale factors differ by 1e-4
    assert stage.rms == c.residual.rms[NORM]


def test_sums_keep_the_coarse_covariance_and_differences_take_that_of_the_norm():
    positions = trusted_positions(made(16))
    first = coarse(positions)
    c = fine(positions, first)
    theirs = [q.label for q in first.parameters]

    def variance(P, labels, weights):
        d = np.array([weights.get(label, 0.0) for label in labels])
        return float(d @ P @ d)

    for row, (plus, minus) in enumerate(PAIRS, start=9):
        total = {f"misalignment:{plus}": 1.0, f"misalignment:{minus}": 1.0}
        difference = total | {f"misalignment:{minus}": -1.0}
        assert variance(c.covariance, LABELS, total) == pytest.approx(
            variance(first.covariance, theirs, total), rel=1e-3
        )
        assert variance(c.covariance, LABELS, difference) == pytest.approx(c.stages[0].sigmas[row] ** 2, rel=1e-3)
    for axis in ("platform", "inner", "middle"):
        zero = {f"gimbal_zero:{axis}": 1.0}
        assert variance(c.covariance, LABELS, zero) == pytest.approx(variance(first.covariance, theirs, zero), rel=1e-9)


def test_without_a_coarse_stage_the_sums_keep_their_prior():
    c = fine(trusted_positions(made(17)))
    for plus, minus in PAIRS:
        pair = [LABELS.index(f"misalignment:{axis}") for axis in (plus, minus)]
        prior = sum(PARAMETERS[i].sigma ** 2 for i in pair)
        assert c.covariance[np.ix_(pair, pair)].sum() == pytest.approx(prior, rel=1e-3)
    zeros = [i for i, q in enumerate(PARAMETERS) if q.effect == "gimbal_zero"]
    np.testing.assert_allclose(c.sigmas[zeros], [PARAMETERS[i].sigma for i in zeros], rtol=1e-12)


# --- setting ----------------------------------------------------------------------------------------------------------


def test_a_setting_error_adds_to_the_readout_as_a_zero_of_that_gimbal_does():
    view = view_of_positions(made(18), NOISE)
    linear = by_visit(view, (), PARAMETERS, np.zeros(len(PARAMETERS)))
    for i, axis in enumerate(SPACE_STABLE.axis_names[:3]):
        np.testing.assert_allclose(linear.G[..., i], linear.J[..., LABELS.index(f"gimbal_zero:{axis}")], atol=1e-9)
    moved = view.local.evaluate((), np.full(view.local.zero_values.shape, 3 * ARCSEC)).stimulus
    np.testing.assert_array_equal(moved.readout, view.stimulus.readout + 3 * ARCSEC)
    np.testing.assert_array_equal(moved.angle, moved.readout)


def test_deviations_inside_a_dwell_are_in_sigmas_of_a_sample():
    rng = np.random.default_rng(20)
    linear = VisitRows(
        rng.standard_normal((2, 3, 4)), rng.standard_normal((2, 3)), rng.standard_normal((2, 3, 3)), np.full(2, 120.0),
        rng.standard_normal((6, 3, 4)), rng.standard_normal((6, 3)),
    )  # fmt: skip
    w = eliminate(linear, 0.02**2, 0.1**2)
    np.testing.assert_allclose(w.J_inside, linear.J_inside / 0.02)
    np.testing.assert_allclose(w.r_inside, linear.r_inside / 0.02)
    np.testing.assert_allclose(w.J, w.W @ linear.J)


def test_the_setting_errors_of_a_fit_take_up_what_the_gimbals_did():
    rng = np.random.default_rng(21)
    truth = draw(rng)
    blank, loose = measured(truth, rng), Noise(SAMPLE, 20 * ARCSEC)
    view = view_of_positions(blank, loose)
    e = 20 * ARCSEC * rng.standard_normal(view.local.zero_values.shape)
    force = {("specific_force", a): f for a, f in zip("xyz", outputs(view, effects(truth), e).T, strict=True)}
    told = view_of_positions(blank.with_channels(force), loose)
    fit = fit_in_noise(told, loose, PARAMETERS[:1], effects(truth), truth[:1])
    # turns about the force itself are not seen: two of every three directions come back, with their sign
    share = (fit.setting * e).sum() / (e * e).sum()
    assert 0.4 < share < 0.8


def test_a_start_that_is_far_off_in_one_coefficient_is_not_taken():
    view = view_of_positions(made(22), NOISE)
    wild = np.zeros(len(PARAMETERS))
    wild[0] = 2e3 * PARAMETERS[0].sigma  # a scale factor of 2
    from_nothing, from_there = (fit_in_noise(view, NOISE, PARAMETERS, (), x).fit for x in (None, wild))
    assert from_there.steps == from_nothing.steps > 0
    np.testing.assert_array_equal(from_there.solution.x, from_nothing.solution.x)


def test_a_start_that_is_near_is_taken_and_saves_steps():
    view = view_of_positions(made(23), NOISE)
    from_nothing = fit_in_noise(view, NOISE, PARAMETERS).fit
    again = fit_in_noise(view, NOISE, PARAMETERS, (), from_nothing.x).fit
    assert 0 < again.steps < from_nothing.steps
    np.testing.assert_allclose(again.solution.x, from_nothing.solution.x, atol=1e-3 * again.solution.sigma.min())


def test_poor_angles_are_aimed_at_what_the_force_shows():
    rng = np.random.default_rng(24)
    truth, poor = draw(rng), Noise(SAMPLE, np.deg2rad(3.0))
    recording, model = measured(truth, rng, setting=poor.setting), effects(truth)

    def aimed(noise):
        view = view_of_positions(recording, noise)
        return view.local.start(view, model)

    local = view_of_positions(recording, poor).local
    nowhere = local.zero_values
    before, after = (np.abs(local.evaluate(model, e).residual).max() for e in (nowhere, aimed(poor)))
    assert before > to_si(50.0, "mg")
    assert after < to_si(1.0, "mg")  # ten arcsec of 6 degrees, and the third order of those
    np.testing.assert_array_equal(aimed(NOISE), nowhere)  # good angles are believed
