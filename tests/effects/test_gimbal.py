"""Errors of angle encoders: what a second read head, a worm and a schedule of 45 degree steps make of them."""

import numpy as np

from tests.effects.stimulus import GIMBALS, given, made

ARCSEC = np.pi / 648000
ONE = [ARCSEC, 0, 0, 0]  # on the first gimbal


def at(effect, angle):
    """Angle minus readout (m,) [rad] of the first gimbal at these angles."""
    angles = np.zeros((len(angle), len(GIMBALS)))
    angles[:, 0] = angle
    return effect.contribution(given().at(angle=angles, readout=angles))[:, 0]


ROUND = np.linspace(-np.pi, np.pi, 97)


def test_opposite_read_heads_cancel_odd_harmonics_and_double_even_ones():
    for order in (3.0, 4.0, 5.0, 6.0):
        harmonic = made("encoder_harmonic", A=ONE, B=[0.5 * ARCSEC, 0, 0, 0], order=order)
        both = at(harmonic, ROUND) + at(harmonic, ROUND + np.pi)
        expected = 0 * ROUND if order % 2 else 2 * at(harmonic, ROUND)
        np.testing.assert_allclose(both, expected, atol=1e-19)
    centred = made("encoder_eccentricity", A=ONE)
    np.testing.assert_allclose(at(centred, ROUND) + at(centred, ROUND + np.pi), 0, atol=1e-20)


def test_on_steps_of_45_degrees_a_fifth_harmonic_reads_as_a_third():
    steps, between = np.arange(8) * np.pi / 4, np.arange(8) * np.pi / 4 + 0.3
    third = made("encoder_harmonic", A=[-ARCSEC, 0, 0, 0], B=ONE, order=3.0)
    fifth = made("encoder_harmonic", A=ONE, B=ONE, order=5.0)
    np.testing.assert_allclose(at(third, steps), at(fifth, steps), atol=1e-19)
    assert np.abs(at(third, between) - at(fifth, between)).max() > 0.5 * ARCSEC


def test_an_error_once_per_line_comes_back_with_every_line_and_is_its_amplitude_over_root_two():
    cyclic = made("encoder_cyclic_error", A=ONE, lines=360.0)
    scan = np.linspace(0, np.deg2rad(1.0), 8, endpoint=False)  # eight steps over one line, as the design asks
    np.testing.assert_allclose(at(cyclic, scan + np.deg2rad(17.0)), at(cyclic, scan), atol=1e-17)
    np.testing.assert_allclose(np.sqrt(np.mean(at(cyclic, scan) ** 2)), ARCSEC / np.sqrt(2), rtol=1e-12)


def test_a_worm_of_180_teeth_has_the_period_of_479_seconds_that_observers_know():
    worm = made("periodic_worm_error", A=ONE, teeth=180.0)
    time = np.linspace(0, 86164.0905, 36001)  # a sidereal day of tracking
    error = at(worm, 2 * np.pi * time / time[-1])
    up = time[1:][(error[:-1] < 0) & (error[1:] >= 0)]
    np.testing.assert_allclose(np.diff(up).mean(), 478.69, atol=0.03)  # 86164.09 s / 180
    assert len(up) in {179, 180}


def test_a_two_cycle_does_not_see_a_half_turn():
    twice = made("encoder_two_cycle", A=ONE, B=ONE)
    np.testing.assert_allclose(at(twice, ROUND + np.pi), at(twice, ROUND), atol=1e-19)
    np.testing.assert_allclose(at(twice, ROUND + np.pi / 2), -at(twice, ROUND), atol=1e-19)
