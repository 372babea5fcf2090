"""Gyroscopes from revolutions and rest: exactness, derivatives, the bound, and what the paper's cost cannot see."""

import numpy as np
import pytest

from gimbalcal.campaign.trials import generators, gyroscope_revolutions, gyroscope_truth, gyroscopes
from gimbalcal.estimate.pulses import whole_turns as rotations
from gimbalcal.estimate.pulses.gravity_norm import initial_scale
from gimbalcal.estimate.pulses.whole_turns import FREE_ORDINALS


def test_derivatives_are_those_of_the_complex_step():
    rngs = generators(1, range(2))
    turns = gyroscope_revolutions(gyroscope_truth(rngs), rngs, 0.01)
    K0 = initial_scale((turns.clockwise - turns.counterclockwise)[:, :, 0], 2 * turns.angle)
    data = rotations._in_units_of_angle(turns, K0, turns.angle / turns.duration)
    x = np.tile(np.r_[np.ones(3), np.full(9, 1e-3)], (2, 1))
    r, J = rotations._residuals(x, data, turns, True)
    size = np.abs(J).max()
    for k, unit in enumerate(np.eye(12)):
        step = 1e-7
        up, down = (rotations._residuals(x + s * step * unit, data, turns, True)[0] for s in (1, -1))
        # central difference: the cost is quartic at most, so 1e-7 leaves 1e-14 of curvature and 1e-9 of rounding
        assert np.max(np.abs((up - down) / (2 * step) - J[..., k])) < 1e-7 * size
    assert r.shape == (2, 9 * 4 + 15)


@pytest.mark.parametrize("tilt", [3 / 3600, 3.0], ids=["3 arcsec", "3 deg"])
def test_error_is_at_the_bound_and_every_run_is_global(tilt):
    trials = gyroscopes(2, range(200), np.deg2rad(tilt))
    error, sigma = trials.error[:, FREE_ORDINALS], trials.fit.sigma[:, FREE_ORDINALS]
    ratio = np.sqrt((error**2).mean(0) / (sigma**2).mean(0))
    assert np.all(np.abs(ratio - 1) < 0.25)  # rms of 200 normal errors: 5 %, five sigma
    assert np.max(np.abs(error / sigma)) < 6  # 2400 normal numbers: 1e-5 to exceed; a local minimum is off by 1e3
    # nine rotations of three determined components, fifteen rests, twelve unknowns: thirty degrees of freedom
    assert trials.fit.chi2.mean() == pytest.approx(30, abs=5 * np.sqrt(2 * 30 / 200))


def test_difference_of_the_senses_hardly_sees_the_second_order():
    """Eq. (30) loses K2 by two orders of magnitude and more against turning both ways and looking across the axis."""
    both, difference = (gyroscopes(4, range(50), 1e-5, both_senses=b) for b in (True, False))
    gain = difference.fit.sigma[:, 3:6] / both.fit.sigma[:, 3:6]
    assert np.median(gain) > 100
    assert np.median(np.abs(difference.error[:, 3:6])) > 50 * np.median(np.abs(both.error[:, 3:6]))
