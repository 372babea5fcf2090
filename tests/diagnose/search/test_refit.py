"""Fits of a view: at a minimum, no worse than where they began, with the covariance of what the rows see."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.search.ranking import projections_of
from gimbalcal.diagnose.search.refit import (
    constants_with_sigma,
    fitted_columns,
    refit,
    start_with_baseline,
    with_columns,
)
from gimbalcal.effects import values, with_values
from gimbalcal.inference.algebra import orthonormal_columns
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site
from gimbalcal.views.core import absent_effect
from gimbalcal.views.norm import norm
from gimbalcal.views.pointing import pointing
from tests.diagnose.small import telescope

G = 9.80665


def poses(up, rng, noise=1e-4, spoilt=5e-2):
    """One mean of each attitude of a unit with constants of several per cent."""
    f = G * up / np.linalg.norm(up, axis=1, keepdims=True)
    y = f @ (np.eye(3) + spoilt * rng.standard_normal((3, 3))).T + spoilt * G * rng.standard_normal(3)
    y += noise * G * rng.standard_normal(y.shape)
    n = len(y)
    channels = {("specific_force", a): y[:, i] for i, a in enumerate("xyz")}
    where = np.arange(1, n + 1)
    return Recording("multi-position", "poses", BENCH, Site(None, 0.0, G), {}, 10.0 * where, where, channels)


@pytest.mark.parametrize("seed", range(4))
def test_a_fit_ends_where_no_direction_that_is_seen_leads_down(seed):
    """Eleven rests of constants of five per cent: undamped steps ended at 427 mg on such a recording."""
    rng = np.random.default_rng(seed)
    v = norm(poses(rng.standard_normal((11, 3)), rng), ("bias", "scale_factor", "misalignment"))
    m = start_with_baseline(v)
    assert m.rms < 1e-3 * G
    scale = np.array([p.sigma for p in m.parameters])
    A = m.jacobian.reshape(m.residual.size, -1) * scale
    U, S, _ = np.linalg.svd(A, full_matrices=False)
    slope = U[:, S > 0.01 * np.sqrt(np.mean(m.residual**2))].T @ m.residual.ravel()
    assert np.abs(slope).max() < 1e-2 * np.linalg.norm(m.residual)


def test_no_fit_is_worse_than_where_it_began():
    rng = np.random.default_rng(7)
    v = norm(poses(rng.standard_normal((30, 3)), rng), ("bias", "scale_factor"))
    wanted = tuple(p for i in ("bias", "scale_factor", "misalignment") for p in v.parameters_of(i))
    began = with_values((), wanted, 0.3 * rng.standard_normal(len(wanted)) * [p.sigma for p in wanted])
    before = v.evaluate(began).residual
    assert (refit(v, began, wanted).residual ** 2).sum() <= (before**2).sum()


def test_errors_are_as_large_as_the_covariance_says():
    pulls = []
    for seed in range(30):
        v = pointing(telescope(seed, north=12.0, east=-7.0), ("gimbal_zero", "axis_collimation", "base_tilt"))
        m = start_with_baseline(v)
        tilt = [i for i, p in enumerate(m.parameters) if p.effect == "base_tilt"]
        off = values(m.effects, m.parameters)[tilt] - np.array([12.0, -7.0]) * np.pi / 648000
        pulls.append(off @ np.linalg.solve(m.covariance[np.ix_(tilt, tilt)], off))
    assert 0.6 < np.mean(pulls) / 2 < 1.6  # chi^2 of two: its mean scatters by 18 %


def test_columns_of_no_effect_are_fitted_beside_those_of_the_model():
    v = pointing(telescope(3))
    m = start_with_baseline(v)
    X = np.zeros((*m.residual.shape, 1))
    X[:, 1, 0] = np.sin(5 * v.stimulus.readout[:, 1])
    after = with_columns(m, X)
    assert np.abs(np.einsum("nc,ncp->p", after.residual, after.jacobian)).max() < 1e-9 * np.linalg.norm(m.residual)
    assert after.jacobian.shape[-1] == m.jacobian.shape[-1] + 1
    assert after.parameters == m.parameters


def test_columns_are_fitted_in_the_scales_that_remain_with_them():
    """A wave of 20 arcsec in one channel is no noise of this channel once it is fitted."""
    v = pointing(telescope(3))
    v = replace(v, noise=replace(v.noise, of_each_channel=True), cache={})
    X = np.zeros((len(v), 2, 1))
    X[:, 1, 0] = np.sin(5 * v.stimulus.readout[:, 1])
    m = start_with_baseline(v)
    m = with_columns(replace(m, residual=m.residual + 1e-4 * X[..., 0]), X[..., :0])
    assert max(m.view.noise.scales) > 5
    made, x, C = fitted_columns(m, X)
    assert made.view.noise.scales == ()
    Q = orthonormal_columns(m.jacobian.reshape(m.residual.size, -1))
    left = X.ravel() - Q @ (Q.T @ X.ravel())
    assert x[0] == pytest.approx(left @ m.residual.ravel() / (left @ left), rel=1e-6)
    assert np.sqrt(C[0, 0]) == pytest.approx(made.rms / np.sqrt(2) / np.linalg.norm(left), rel=0.1)


def test_columns_of_what_is_not_in_the_model_hold_no_noise_of_the_readings():
    """Faces alone: what a saturation near one g makes of them is a constant, whatever their readings scatter."""
    rng = np.random.default_rng(5)
    faces = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (4, 1))
    v = norm(poses(faces, rng, 1e-3, 0.0), ("bias", "scale_factor"))
    m = start_with_baseline(v)
    wanted = v.parameters_of("cubic_nonlinearity")
    quiet, read = v.noise_free(m.effects).jacobian(wanted), v.evaluate(m.effects).jacobian(wanted)
    y = m.residual / np.linalg.norm(m.residual)

    def copied(X):
        (p,) = projections_of(m, m.reduced(X), memory=False)
        return float(np.sqrt(p.explained(range(X.shape[-1])) / p.misfit[0]))

    assert copied(read) > 0.9
    assert copied(quiet) < 0.5
    assert y.shape == (24, 1)


def test_a_constant_that_nothing_determines_is_not_told():
    """What order a worm has shows by its amplitude: without one there is nothing to tell, and no sigma of zero."""
    v = pointing(telescope(1, n=200))
    m = start_with_baseline(v)
    wanted = v.parameters_of("periodic_worm_error")[:2]
    for size, count in ((0.0, 0), (20.0, 1)):
        none = absent_effect("periodic_worm_error", v.stimulus)
        worm = with_values([none], wanted[:1], np.array([size * np.pi / 648000]), v.stimulus.axis_names)
        told = constants_with_sigma(replace(m, effects=(*m.effects, *worm)), "periodic_worm_error")
        assert len(told) == count
        assert all(0 < sigma < np.inf for _, _, sigma in told)
