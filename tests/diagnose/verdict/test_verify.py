"""The check on data not seen: against refits without each part, on clean noise and on a known cause."""

import numpy as np
import pytest

from gimbalcal.diagnose.search.fitted_causes import fit_causes
from gimbalcal.diagnose.verdict.verify import residual_rows, verify
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.forward import jacobian
from gimbalcal.views.known_attitude import FOLDS
from tests.diagnose.plant import known
from tests.diagnose.small import again, at_rest, candidate, clean, noises, observed, rows_of, searched

LABEL = "scale_factor_asymmetry:y"
PLANTED = observed(3, known(1)["asymmetry"][0], 300.0)


def refitted_without_each(A, y, fold):
    """Mean square of each part's prediction error over its covariance, every fit made anew."""
    A = A / np.linalg.norm(A, axis=0)
    total = 0.0
    for k in np.unique(fold):
        out = fold == k
        P = np.linalg.pinv(A[~out], rcond=1e-4)
        r = y[out] - A[out] @ (P @ y[~out])
        total += r @ np.linalg.solve(np.eye(out.sum()) + A[out] @ P @ P.T @ A[out].T, r)
    return float(total / len(y))


def test_held_out_positions_are_refits_without_each():
    s = searched(PLANTED, LABEL)
    f = fit_causes(s, (0,))
    X = f.columns()
    v = verify(f, X)
    node, o = f.projection.node, s.fit
    Z, y = (node.whiten(A) for A in (rows_of(o)[0], rows_of(o)[1][:, None]))
    both = np.concatenate([Z, node.whiten(o.reduced(X))], axis=1)
    fold = np.repeat(o.view.stimulus.position[o.view.noise.starts], 3)
    assert v.heldout_by == "position"
    assert v.heldout_before == pytest.approx(refitted_without_each(Z, y[:, 0], fold), rel=1e-6)
    assert v.heldout_after == pytest.approx(refitted_without_each(both, y[:, 0], fold), rel=1e-6)
    left = y[:, 0] - both @ np.linalg.lstsq(both, y[:, 0], rcond=1e-9)[0]
    assert v.chi2_reduced_after == pytest.approx(
        left @ left / (len(left) - np.linalg.matrix_rank(both, 1e-8)), rel=1e-6
    )
    r = left.reshape(18, 6, 3)  # six blocks in each dwell; nothing follows from one dwell to the next
    assert v.autocorrelation_after == pytest.approx((r[:, 1:] * r[:, :-1]).sum() / (r**2).sum(), abs=1e-9)
    assert v.autocorrelation_sigma == pytest.approx(1 / np.sqrt(18 * 5 * 3))


def test_prediction_of_clean_noise_is_as_good_as_stated():
    """One is what noise alone gives: 24 recordings of 324 numbers each, in the very noise that they are made of."""
    rng = np.random.default_rng(4)
    (node,) = noises(PLANTED, 1)
    design, out = searched(PLANTED, LABEL, count=1), []
    for _ in range(24):
        s = again(design, clean(PLANTED, node, rng))
        f = fit_causes(s, ())
        out.append(verify(f, f.columns()))
    four_sigmas = 4 * np.sqrt(2 / (24 * 324))
    assert np.mean([v.chi2_reduced_before for v in out]) == pytest.approx(1.0, abs=four_sigmas)
    assert np.mean([v.heldout_before for v in out]) == pytest.approx(1.0, abs=four_sigmas)


def test_prediction_is_as_good_as_noise_once_the_missing_cause_is_in():
    s = searched(PLANTED, LABEL)
    f = fit_causes(s, (0,))
    v = verify(f, f.columns())
    assert v.chi2_reduced_before > 1.5
    assert v.heldout_before > 1.5
    assert v.chi2_reduced_after == pytest.approx(1.0, abs=4 * np.sqrt(2 / 300))
    assert v.heldout_after == pytest.approx(1.0, abs=4 * np.sqrt(2 / 300))
    fit = verify(f, f.columns(), 0.1, 0.2)
    assert (fit.heldout_after, fit.scan_p_before, fit.scan_p_after) == (v.heldout_after, 0.1, 0.2)


@pytest.mark.parametrize(("name", "label"), [("blunder", "position_blunder"), ("step", "bias_step:x")])
def test_what_happens_at_one_place_or_moment_is_held_out_within_dwells(name, label):
    """No other position can predict it: a sixth of every dwell is left out, and the rest of the dwell says what it is.

    Left out with its whole position it would seem to explain nothing.
    """
    s = searched(observed(5, known(0)[name][0], 100.0), label)
    f = fit_causes(s, (0,))
    X = f.columns()
    v = verify(f, X)
    node, o = f.projection.node, s.fit
    A = node.whiten(np.concatenate([o.reduced(o.Z), o.reduced(X)], axis=1))
    y = node.whiten(rows_of(o)[1][:, None])[:, 0]
    part = np.repeat(np.tile(np.arange(6), 18), 3)
    assert v.heldout_by == "parts of each dwell"
    assert v.heldout_after == pytest.approx(refitted_without_each(A, y, part), rel=1e-6)
    assert v.heldout_after < 0.7 * v.heldout_before


def test_a_static_run_is_held_out_in_stretches_of_time():
    o = at_rest(6)
    s = searched(o, "bias_drift:x", count=1)
    f = fit_causes(s, (0,))
    X = f.columns()
    v = verify(f, X)
    n, C = o.residual.shape
    fold = np.repeat(np.arange(n) * FOLDS // n, C)
    assert v.heldout_by == "time"
    assert v.heldout_before == pytest.approx(
        refitted_without_each(o.Z.reshape(n * C, -1), o.residual.ravel(), fold), rel=1e-5
    )


@pytest.mark.parametrize("label", ["scale_factor_asymmetry:y", "encoder_two_cycle:inner"])
def test_columns_of_a_finding_are_derivatives_of_the_forward_model(label):
    s = searched(PLANTED, label)
    f = fit_causes(s, (candidate(s, label),))
    c, o = s.library.candidates[0], s.fit
    wanted = [p for p in parameters(CATALOGUE[c.effect], o.view.stimulus.axis_names) if p.axis == c.axis]
    J = jacobian(o.view.source.platform, o.view.stimulus, o.effects, wanted, o.view.kind)["specific_force"]
    whole = J * np.array([p.sigma for p in wanted]) / o.sigma[:, None]
    np.testing.assert_allclose(f.columns(), whole, atol=1e-6 * np.abs(whole).max())


def test_residual_rows_are_what_calibration_cannot_follow():
    s = searched(PLANTED, LABEL)
    f = fit_causes(s, (0,))
    X = f.columns()
    before, after = residual_rows(s.fit, X @ f.x)
    Z = s.fit.Z.reshape(before.size, -1)
    scale = np.linalg.norm(Z, axis=0) * np.linalg.norm(before)
    assert np.abs(Z.T @ before.ravel() / scale).max() < 1e-9
    taken = (before - after).ravel() - X.reshape(before.size, -1) @ f.x  # but for what the calibration takes up
    assert np.linalg.norm(taken - Z @ np.linalg.lstsq(Z, taken, rcond=1e-9)[0]) < 1e-6 * np.linalg.norm(before)
    assert (after**2).mean() < 0.9 * (before**2).mean()
