"""Terms of a mount that tracks, in frames whose noise has a memory."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.errors import InputError
from gimbalcal.estimate.pointing.fit import fit_terms
from gimbalcal.estimate.pointing.mount import by_night, pointing_calibration
from gimbalcal.importers.tpoint import equatorial
from gimbalcal.recording import Recording, Site
from gimbalcal.views.core import absent_effect
from gimbalcal.views.pointing import pointing
from tests.estimate.pointing.mounts import ARCSEC
from tests.stimuli import remembering

LATITUDE, TEETH, SIZE, RUNS = 0.9, 180, 2.0, 12
MOUNT = equatorial(LATITUDE)


def guided(seed, memory, worm=SIZE):
    """45 min of frames of 3 s: a worm of so many arcsec, 0.3 arcsec of white noise and 1 arcsec with a memory."""
    rng, n = np.random.default_rng(seed), 900
    t = 3.0 * np.arange(n)
    hour, slow = 7.292115e-5 * t - 0.5, remembering(rng.standard_normal(n), memory)
    west = worm * np.sin(TEETH * hour) + slow + 0.3 * rng.standard_normal(n)
    channels = {("gimbal_angle", "hour_angle"): hour, ("gimbal_angle", "declination"): np.full(n, 0.4),
                ("true_angle", "hour_angle"): hour + west * ARCSEC,
                ("true_angle", "declination"): 0.4 + 0.5 * ARCSEC * rng.standard_normal(n)}  # fmt: skip
    return Recording("pointing", "log", MOUNT, Site(LATITUDE, 0.0, 9.81), {}, t, None, channels)


def worm(r):
    """Sine and cosine of the worm and their sigmas, arcsec."""
    view = pointing(r)
    every = parameters(CATALOGUE["periodic_worm_error"], MOUNT.axis_names)
    wanted = [p for p in every if p.axis == "hour_angle" and p.name in ("worm_sin", "worm_cos")]
    fitted = fit_terms([view], wanted, absent=[absent_effect("periodic_worm_error", view.stimulus, "", teeth=TEETH)])
    return fitted.x / ARCSEC, fitted.sigmas / ARCSEC


@pytest.mark.parametrize(("memory", "least"), [(0.0, 0.04), (0.9, 0.14)])
def test_sigmas_of_a_worm_are_its_errors_whatever_the_memory_of_the_noise(memory, least):
    x, sigma = (np.array(part) for part in zip(*(worm(guided(k, memory)) for k in range(RUNS)), strict=True))
    error = (np.abs(x) - [SIZE, 0.0]) * np.sign(x)
    assert np.sqrt(np.mean((error / sigma) ** 2)) == pytest.approx(1.0, abs=0.4)  # 24 numbers: 0.14 of one sigma
    assert least < sigma.mean() < 1.5 * least


def test_an_axis_without_noise_has_no_weight_beyond_its_least_sigma():
    r = guided(1, 0.9)
    still = {**r.channels, ("true_angle", "declination"): r.channels["gimbal_angle", "declination"]}
    x, sigma = worm(r)
    other, wider = worm(replace(r, channels=still))
    np.testing.assert_allclose(other, x, atol=0.1)
    np.testing.assert_allclose(wider, sigma, rtol=0.2)


def zeros(*runs):
    """Zeros of both axes; the rows of each axis say next to nothing of the zero of the other."""
    views = [pointing(r) for r in runs]
    return fit_terms(views, parameters(CATALOGUE["gimbal_zero"], MOUNT.axis_names)[:2])


def test_a_zero_is_as_uncertain_as_the_memory_of_its_own_axis_makes_it():
    each = [zeros(guided(k, 0.9, worm=0.0)) for k in range(RUNS)]
    z = np.array([f.x / f.sigmas for f in each])
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.4
    assert np.median([f.sigmas[1] / f.sigmas[0] for f in each]) > 4


def test_nights_without_a_change_agree_whatever_the_memory_of_their_frames():
    for k in range(6):
        nights = by_night(zeros(guided(2 * k, 0.9, worm=0.0), guided(2 * k + 1, 0.9, worm=0.0)), None)
        assert nights.probability > 1e-3
        assert not nights.moved


def test_nights_with_readings_of_other_axes_are_not_one_calibration():
    """Without guiding the log of a night has the declination that the mount was sent to, and no reading of it."""
    both, r = guided(1, 0.0), guided(2, 0.0)
    unread = r.with_channels({("true_angle", "declination"): r.channels["gimbal_angle", "declination"]})
    with pytest.raises(InputError, match="of pointing across and along; calibrate them one at a time"):
        pointing_calibration([both, replace(unread, title="unguided")])
