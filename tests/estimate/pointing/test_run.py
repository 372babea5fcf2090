"""What a mount experienced from star to star: which way it went, and whose angles hold the noise."""

import numpy as np
import pytest

from gimbalcal.diagnose.evidence.correlated_noise import possible_noises
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.search.ranking import search, selected_causes
from gimbalcal.diagnose.search.refit import start_with_baseline
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.recording import Recording
from gimbalcal.report.sections import pointing_picture
from gimbalcal.views.pointing import (
    means_of_tracking,
    on_stars,
    outlying_frames,
    pointing,
    since_turning,
    tracking_axes,
    without_jumps,
)
from tests.estimate.pointing.mounts import ALT_AZ, ARCSEC, EQUATORIAL, effects, run, sky

TURN = 2 * np.pi
SLOW = ("base_tilt", "tube_flexure", "refraction")


def logged(r, axis, low):
    """The same run with an axis logged within the turn from `low` on."""
    within = {(q, axis): np.mod(r.channels[q, axis] - low, TURN) + low for q in ("gimbal_angle", "true_angle")}
    return Recording(**{**vars(r), "channels": r.channels | within})


@pytest.mark.parametrize("low", [0.0, -np.pi, 1.0])
def test_a_move_is_told_the_way_it_went_wherever_the_log_starts_its_turn(low):
    """Backlash takes the sense of a move, which the difference of two logged angles has wrong across the wrap."""
    rng = np.random.default_rng(5)
    steps = rng.uniform(-1.2, 1.2, 60)
    readout = np.stack([rng.uniform(0.4, 1.2, 60), np.cumsum(steps)], axis=1)
    r = run(ALT_AZ, readout, effects(ALT_AZ, base_tilt__east=20.0))
    told = on_stars(logged(r, "azimuth", low)).move_angle
    assert np.array_equal(np.sign(told[1:, 1]), np.sign(steps[1:]))
    assert np.allclose(told, on_stars(r).move_angle, atol=1e-12)


def test_a_readout_of_several_turns_says_which_way_its_mount_went():
    readout = np.array([[0.0], [4.0], [-1.0], [7.0]])
    assert np.allclose(without_jumps(np.mod(readout, TURN), readout), readout)
    assert np.allclose(np.diff(without_jumps(np.mod(readout[:2], TURN), readout[:2]), axis=0), 4.0 - TURN)


@pytest.mark.parametrize("low", [0.0, -np.pi])
def test_a_mount_that_stops_at_its_wrap_went_the_long_way_round(low):
    """From 350 to 10 degrees the shorter way, again and again in one sense, would wind up its cables."""
    azimuth = np.radians(np.tile([20.0, 110.0, 200.0, 290.0, 350.0], 8) + np.arange(40)) % TURN
    azimuth = np.mod(azimuth - low, TURN) + low
    r = run(ALT_AZ, np.stack([np.full(40, 0.8), azimuth], axis=1), effects(ALT_AZ, base_tilt__east=20.0))
    told = on_stars(r).move_angle[:, 1]
    assert np.array_equal(np.sign(told[1:]), np.sign(np.diff(azimuth)))


def test_an_axis_that_creeps_goes_on_as_it_went_whatever_its_noise():
    rng = np.random.default_rng(1)
    there = np.concatenate([np.linspace(0, 0.1, 400), np.linspace(0.1, 0.05, 200)])
    way = since_turning(there + 5 * ARCSEC * rng.standard_normal(600))
    assert np.all(way[40:400] > 0)
    assert np.all(way[420:] < 0)
    assert way[-1] == pytest.approx(-0.05, rel=1e-2)


def tracking(drift=0.0, wander=0.0):
    """A mount that follows one star for an hour by its clock, with a worm; the noise is in where the star was seen.

    drift: of both axes by the end, a square in time; wander: of the declination, a random walk, by the end [arcsec].
    """
    rng = np.random.default_rng(4)
    t = np.sort(rng.uniform(0.0, 3660.0, 900))
    ideal = np.stack([np.full(900, 0.82), -0.78 + TURN * t / 86164.0], axis=1)
    r = run(EQUATORIAL, ideal, ())
    off = 8 * np.sin(144 * ideal[:, 1]) + 2 * rng.standard_normal(900)
    curve = drift * (t / t[-1]) ** 2
    walk = wander * np.cumsum(rng.standard_normal(900)) / 30 + curve
    seen = {
        ("true_angle", axis): r.channels["true_angle", axis] + ARCSEC * x
        for axis, x in {"hour_angle": off + curve, "declination": walk}.items()
        if axis == "hour_angle" or walk.any()
    }
    return Recording(**{**vars(r), "time": t, "channels": r.channels | seen})


def test_patterns_of_a_run_that_tracks_are_no_copies_of_its_misfit():
    """Beside a drift, which follows the clock, a tilt that follows a noisy hour angle would be that noise."""
    v = pointing(tracking(), ("gimbal_zero", "gimbal_zero_drift"))
    m = start_with_baseline(v)
    s = search(m, assemble_library(m), possible_noises(m))
    every = s.library.candidates
    slow = [h for h in s.hypotheses if all(every[i].effect in SLOW or every[i].axis == "along" for i in h.members)]
    assert len(slow) > 5
    assert max(h.ln_bayes for h in slow) < CLAIM
    assert any(every[i].effect == "periodic_worm_error" for i in s.hypotheses[0].members)


def test_from_star_to_star_nothing_says_whose_angles_hold_the_noise():
    assert not tracking_axes(run(ALT_AZ, sky(ALT_AZ), (), noise=20.0)).any()


def test_a_worm_shows_beside_a_curved_drift_and_a_declination_that_walks():
    """Each axis has a noise of its own; what curves in both, for whatever reason, is no term of the mount."""
    r = means_of_tracking(tracking(drift=40.0, wander=60.0))
    assert len(r.time) < 450
    m = start_with_baseline(pointing(r, ("gimbal_zero", "gimbal_zero_drift")))
    s = search(m, assemble_library(m), possible_noises(m))
    every, best = s.library.candidates, int(np.argmax(s.singles))
    assert every[best].label == "periodic_worm_error:hour_angle"
    ((_, variant),) = selected_causes(s, (best,))
    assert abs(variant.constants[0][1] - 144) <= 1
    terms = [s.singles[i] for i, c in enumerate(every) if c.effect in SLOW]
    assert max(terms, default=0.0) < 0.1


def test_frames_that_a_gust_threw_off_are_outliers_and_heavy_tails_are_none():
    r = tracking(drift=40.0, wander=60.0)
    assert not outlying_frames(r).any()
    off = np.zeros(900)
    off[[10, 11, 12, 500]] = 20.0, 60.0, -40.0, 30.0
    key = ("true_angle", "hour_angle")
    thrown = r.with_channels({key: r.channels[key] + ARCSEC * off})
    assert np.flatnonzero(outlying_frames(thrown)).tolist() == [10, 11, 12, 500]
    tails = 3 * np.random.default_rng(5).standard_t(3, 900)
    heavy = r.with_channels({key: r.channels[key] + ARCSEC * tails})
    assert np.count_nonzero(outlying_frames(heavy)) < 9
    assert not outlying_frames(run(ALT_AZ, sky(ALT_AZ), (), noise=20.0)).any()


def test_an_axis_that_was_not_read_is_no_channel():
    v = pointing(tracking(), ("gimbal_zero",))
    assert [axis for _, axis in v.channels] == ["across"]
    assert v.read_gimbals == ("hour_angle",)


def test_the_picture_of_a_mount_that_tracks_has_the_directions_of_its_view():
    """Its declination was not read: one channel, on a mount of two axes."""
    r = tracking()
    drawn = pointing_picture([r], pointing_calibration([r], ("gimbal_zero:hour_angle",)))
    assert "each star, across the plane of the innermost axis: with the zeros alone" in drawn.caption
    assert len(drawn.charts) == 2  # the one direction over both axes, and no chart of the sky


def test_stars_show_the_first_term_of_a_worm_and_a_log_of_guiding_all_of_them():
    """Harmonics of a tooth are sought only where rows follow the angle: sixty stars cannot show ten sizes of one."""
    stars = pointing_calibration(
        [run(ALT_AZ, sky(ALT_AZ), (), noise=5.0)], more=["periodic_worm_error:azimuth,teeth=144"]
    )
    assert [p.field for p in stars.parameters if p.effect == "periodic_worm_error"] == ["A", "B", "teeth"]
    guided = pointing_calibration(
        [tracking()], terms=["gimbal_zero"], more=["periodic_worm_error:hour_angle,teeth=144"]
    )
    assert len([p for p in guided.parameters if p.effect == "periodic_worm_error"]) == 11  # with teeth
