"""Noise that the header does not state."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.estimate.accelerometers.position_fit import (
    HEADER,
    RESIDUAL,
    SAMPLES,
    fit_in_noise,
    fit_with_noise,
    noise_deviance,
    noise_of_positions,
)
from gimbalcal.views.positions import Noise, view_of_positions
from tests.estimate.device import ARCSEC, NOISE, PARAMETERS, SAMPLE, STATED, draw, measured


def test_header_comes_first():
    rng = np.random.default_rng(0)
    noise = noise_of_positions(measured(draw(rng), rng))
    assert (noise.accelerometer, noise.setting) == (STATED["accelerometer"], STATED["gimbal_angle"])
    assert (noise.accelerometer_from, noise.setting_from) == (HEADER, HEADER)


def test_scatter_inside_dwells_comes_second():
    rng = np.random.default_rng(1)
    means = measured(draw(rng), rng)
    wide = means.select(np.repeat(np.arange(18), 50))
    noisy = {
        k: v + (SAMPLE * rng.normal(size=900) if k[0] == "specific_force" else 0) for k, v in wide.channels.items()
    }
    noise = noise_of_positions(replace(wide, channels=noisy, noise={}, weight=np.ones(900)))
    assert noise.accelerometer_from == SAMPLES
    # 18 * 49 * 3 = 2646 degrees of freedom: 1.4 %, four sigma
    assert noise.accelerometer == pytest.approx(SAMPLE, rel=0.055)


@pytest.mark.parametrize("setting", [0.2, 1.0, 20.0, 3600.0])
def test_setting_error_comes_from_the_residual(setting):
    ratios = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        recording = measured(draw(rng), rng, setting * ARCSEC)
        stated = {"accelerometer": SAMPLE}
        noise = noise_of_positions(replace(recording, noise=stated))
        fit = fit_with_noise(view_of_positions(recording, NOISE), noise, PARAMETERS)
        assert fit.noise.setting_from == RESIDUAL
        ratios.append(fit.noise.setting / ARCSEC / setting)
    # 36 angles and 4 runs, less 11 coefficients each: about 7 % at 1 arcsec; below that the samples' noise blurs it
    assert np.median(ratios) == pytest.approx(1, rel=0.6 if setting < 1 else 0.3)


def test_both_noises_are_told_apart_by_the_norm():
    found = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        recording = replace(measured(draw(rng), rng, 10 * ARCSEC), noise={}, scatter={})
        fit = fit_with_noise(view_of_positions(recording, NOISE), noise_of_positions(recording), PARAMETERS)
        found.append((fit.noise.accelerometer / SAMPLE, fit.noise.setting / ARCSEC / 10))
    # the norm has 6 degrees of freedom a run, 24 together: 14 %; the angles have more
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(found), axis=0)), 1, atol=0.4)


def dense_deviance(p, noise):
    """-2 ln of the density of all rows, setting errors and parameters under their priors integrated out."""
    w, group = p.rows, p.view.local.group
    sigma = np.broadcast_to(np.asarray(p.view.noise.sigma), (len(group), 3))
    inside = (w.J_inside * sigma[..., None], w.r_inside * sigma) if len(w.r_inside) else (0.0, 0.0)
    J, r = w.J[group] + inside[0], w.r[group] + inside[1]
    own = (np.arange(len(w.r)) == group[:, None])[:, None, :, None] * w.G[group][:, :, None, :]
    G, A = own.reshape(r.size, -1), J.reshape(r.size, -1)
    mean, scale = (np.array([getattr(q, what) for q in p.fit.parameters]) for what in ("mean", "sigma"))
    white = (sigma.ravel() * noise.accelerometer / p.noise.accelerometer) ** 2
    V = np.diag(white) + noise.setting**2 * G @ G.T + (A * scale**2) @ A.T
    off = r.ravel() - A @ mean
    return np.linalg.slogdet(V)[1] + off @ np.linalg.solve(V, off)


@pytest.mark.parametrize("each", [1, 3])
def test_the_likelihood_of_a_noise_is_that_of_all_rows_together(each):
    rng = np.random.default_rng(5)
    means = measured(draw(rng), rng)
    rows = means.select(np.repeat(np.arange(len(means.time)), each))
    shaken = {k: v + SAMPLE * rng.normal(size=v.shape) * (k[0] == "specific_force") for k, v in rows.channels.items()}
    wanted = [replace(q, mean=0.3 * q.sigma) for q in PARAMETERS]
    view = view_of_positions(replace(rows, channels=shaken), NOISE, averaged=each == 1)
    p = fit_in_noise(view, NOISE, wanted)
    assert len(p.rows.r_inside) == len(view) * (each > 1)
    others = [Noise(SAMPLE * a, ARCSEC * b) for a, b in ((1.0, 1.0), (2.0, 1.0), (1.0, 30.0), (0.3, 4.0))]
    here, dense = (np.array([of(p, noise) for noise in others]) for of in (noise_deviance, dense_deviance))
    np.testing.assert_allclose(here - here[0], dense - dense[0], rtol=1e-6, atol=1e-4)
