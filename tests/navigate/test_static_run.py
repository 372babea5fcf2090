"""A static run navigated: perfect without its errors, bands that agree, gaps, and the quasi-static formula."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.earth import NAUTICAL_MILE
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.navigate.navigation_errors import CHANNELS, Navigated, labels
from gimbalcal.navigate.space_stable_navigator import USUAL, Aids, InertialSite
from gimbalcal.navigate.static_run import half_difference, horizontal_distance
from gimbalcal.navigate.stationary_base import still_base
from gimbalcal.navigate.summary import NavigationInputs, summary
from gimbalcal.navigate.uncertainty import before_and_after, navigation_errors, position_uncertainty, sigma_bands
from gimbalcal.recording import Site, block_means
from gimbalcal.simulate import simulate
from tests.golden import golden_text, refused

ARCMIN = np.deg2rad(1 / 60)
TRUTH = {
    "bias": {"x": 20.0, "y": -15.0, "z": 30.0},
    "scale_factor": {"x": 40.0, "y": -30.0},
    "misalignment": {"xz": 4.0, "yz": -6.0, "zx": 5.0},
    "gimbal_zero": {"platform": 5.0, "inner": 8.0, "middle": -6.0, "outer": 4.0},
    "polar_axis_misalignment": {"equatorial_x": 4.0, "equatorial_y": -7.0},
}


@cache
def made(hours=30.0, rate=1 / 120, **more):
    return simulate({
        "format": 1, "kind": "static-run", "site": {"latitude": {"value": 40.0, "unit": "deg"}},
        "schedule": {"duration": {"value": hours, "unit": "h"}, "rate": {"value": rate, "unit": "Hz"}},
        "truth": {**TRUTH, **more},
    })  # fmt: skip


def calibration(effects, wanted=(), sigma=0.0):
    return Calibration("test", effects, wanted, sigma**2 * np.eye(len(wanted)), (), Residual(0, 0, {}))


def test_the_truth_taken_off_leaves_nothing():
    run, effects = made()
    before, after = before_and_after(run, [("truth", calibration(effects))])
    assert before.position.max() > 300
    assert after.position.max() < 0.3  # m; the step and products of errors
    assert after.largest[4:].max() < 2e-7
    assert before.largest[4:].min() > 2e-5


def test_a_constant_drift_goes_a_nautical_mile_a_day():
    run, _ = simulate({
        "format": 1, "kind": "static-run", "site": {"latitude": {"value": 40.0, "unit": "deg"}},
        "schedule": {"duration": {"value": 48.0, "unit": "h"}, "rate": {"value": 1 / 120, "unit": "Hz"}},
        "truth": {"gyro_drift": {"polar": 0.001}},
    })  # fmt: skip
    found = navigation_errors(run)
    # the platform turns eastwards under the stars: 0.001 deg/h of longitude
    assert abs(found.drift_per_day[1]) == pytest.approx(np.deg2rad(0.024), rel=0.01)
    assert found.position[-1] / NAUTICAL_MILE == pytest.approx(48 * 0.06 * np.cos(np.deg2rad(40)), rel=0.05)


def test_who_is_told_a_wrong_place_finds_the_true_one():
    """Errors are navigator minus true: put too far south it ends north of it, and put too far east in the west."""
    run, _ = simulate({
        "format": 1, "kind": "static-run", "site": {"latitude": {"value": 40.0, "unit": "deg"}},
        "schedule": {"duration": {"value": 24.0, "unit": "h"}, "rate": {"value": 1 / 300, "unit": "Hz"}}, "truth": {},
    })  # fmt: skip
    south = replace(run, site=replace(run.site, latitude=float(run.site.latitude or 0.0) - ARCMIN))
    assert navigation_errors(south).error[-1, 0] == pytest.approx(ARCMIN, rel=0.02)
    platform = run.channels["gimbal_angle", "platform"] + ARCMIN
    east = run.with_channels({("gimbal_angle", "platform"): platform})
    assert navigation_errors(east).error[-1, 1] == pytest.approx(-ARCMIN, rel=0.02)


def test_rows_that_are_means_have_lost_some_of_the_turn_of_gravity():
    """Over ten minutes gravity's equatorial part loses 8e-5 of itself, 60 ug: uncorrected some 400 m of position."""
    run, _ = simulate({
        "format": 1, "kind": "static-run", "site": {"latitude": {"value": 40.0, "unit": "deg"}},
        "schedule": {"duration": {"value": 24.0, "unit": "h"}, "rate": {"value": 1 / 60, "unit": "Hz"}}, "truth": {},
    })  # fmt: skip
    assert navigation_errors(block_means(run, 10)).position.max() < 20.0


def test_a_radian_is_shorter_along_the_meridian_at_the_equator():
    at = InertialSite(0.0, 0.0, 9.78, 0.0)
    north, east = np.zeros((1, 7)), np.zeros((1, 7))
    north[0, 0] = east[0, 1] = 1e-6
    assert horizontal_distance(north, at) == pytest.approx(6.335439)  # m, WGS 84
    assert horizontal_distance(east, at) == pytest.approx(6.378137)


def test_position_is_told_in_nautical_miles_at_its_largest_at_the_end_and_rms():
    miles = np.array([0.0, 4.0, 3.0])
    runs = [
        Navigated(name, np.arange(3.0), np.zeros((3, 7)), k * miles * 1852.0) for name, k in (("none", 1), ("a", 2))
    ]
    first, second = summary(runs, Aids(), NavigationInputs()).position
    assert (first.max_nmi, first.end_nmi) == pytest.approx((4.0, 3.0))
    assert first.rms_nmi == pytest.approx(5 / np.sqrt(3))
    assert (first.improvement_percent, second.improvement_percent) == (None, -100.0)


def test_bands_by_propagation_and_by_samples_agree():
    run, effects = made()
    wanted = tuple(
        p for e in ("bias", "misalignment", "gimbal_zero") for p in parameters(CATALOGUE[e], run.platform.axis_names)
    )
    sigma = np.array([p.sigma for p in wanted]) * 0.02
    known = replace(calibration(effects, wanted), covariance=np.diag(sigma**2))
    (_, linear), (_, sampled) = sigma_bands(run.select(slice(0, None, 9)), known, Aids(), 40, 3)
    ratio = sampled.max(0) / linear.max(0)
    assert np.all(np.abs(ratio - 1) < 3 / np.sqrt(2 * 40)), ratio
    place = InertialSite(np.deg2rad(40.0), 0.0, 9.8, 0.0)
    largest = horizontal_distance(sampled, place).max()
    assert position_uncertainty(run.select(slice(0, None, 9)), known) == pytest.approx(largest, rel=3 / np.sqrt(2 * 40))
    np.testing.assert_array_less(1e-9, linear.max(0))


def test_runs_that_hardly_differ_are_told_apart_as_if_each_was_navigated():
    base = still_base(24.0, Site(latitude=np.deg2rad(40.0)))
    wanted = [p for e in ("bias", "gimbal_zero", "polar_axis_misalignment")
              for p in parameters(CATALOGUE[e], base.platform.axis_names)]  # fmt: skip
    pairs = []
    for p in wanted:
        readings = [
            calibration(with_values((), [p], np.array([way * 0.05 * p.sigma]), base.platform.axis_names)).corrupt(base)
            for way in (1, -1)
        ]
        pairs.append((readings[0], readings[1]))
    expected = np.stack([(navigation_errors(a).error - navigation_errors(b).error) / 2 for a, b in pairs], axis=-1)
    size = np.abs(expected).max(axis=(0, 2))[:, None]
    np.testing.assert_allclose(half_difference(pairs, USUAL) / size, expected / size, rtol=0, atol=1e-7)


def test_a_bias_that_is_not_known_is_as_uncertain_as_it_leads_astray():
    base = still_base(24.0, Site(latitude=np.deg2rad(40.0)))
    (bias,) = (p for p in parameters(CATALOGUE["bias"]) if p.axis == "y")
    known = calibration(with_values((), [bias], np.array([0.0]), base.platform.axis_names), (bias,), 3e-4)
    off = replace(known, effects=with_values((), [bias], np.array([3e-4]), base.platform.axis_names))
    assert position_uncertainty(base, known) == pytest.approx(
        navigation_errors(off.corrupt(base)).position.max(), rel=1e-3
    )


def test_no_covariance_no_band():
    run, effects = made()
    few = run.select(slice(0, 120))
    (_, linear), (_, sampled) = sigma_bands(few, calibration(effects), Aids(), 2, 1)
    assert not linear.any()
    assert not sampled.any()


def test_gaps_are_filled_in_axes_that_turn_with_the_earth():
    run, _ = made()
    whole = navigation_errors(run)
    kept = np.ones(len(run.time), dtype=bool)
    kept[200:260] = False  # two hours
    holed = navigation_errors(run.select(kept))
    np.testing.assert_allclose(holed.error[:, :2], whole.error[kept, :2], atol=3e-6)  # 15 m of 900


def test_the_quasi_static_formula_is_what_the_navigator_does_slowly():
    """Eq. (28) puts the measured force where the navigator has its vertical: alike but for swing and lag."""
    run, _ = made()
    attitude = -np.stack([run.channels["attitude_error", a] for a in ("roll", "pitch", "yaw")], axis=-1)
    later = run.time > 12 * 3600
    for damping, off in ((0.5, 0.09), (0.1, 0.05)):
        found = navigation_errors(run, aids=Aids(damping=damping)).error[:, 4:]
        size = np.ptp(attitude[later], axis=0).max()
        assert np.abs(found - attitude)[later].max() < off * size
    assert np.abs(found - attitude)[~later].max() > 0.12 * size  # the swing at the start


@pytest.mark.parametrize(("hours", "rate"), [(6.0, 1.0), (6.0, 1 / 300)])
def test_the_spacing_of_rows_does_not_matter(hours, rate):
    run, _ = made(hours, rate)
    usual, _ = made(hours, 1 / 10)
    a, b = navigation_errors(run), navigation_errors(usual)
    at = np.interp(a.time, b.time, b.position)
    np.testing.assert_allclose(a.position[5:], at[5:], atol=1.0)  # of 700 m


def test_the_content_has_every_channel_for_every_calibration():
    run, effects = made()
    runs = before_and_after(run, [("truth", calibration(effects))], samples=1)
    told = summary(runs, Aids(), NavigationInputs()).to_dict()
    assert [c["name"] for c in told["channels"]] == [name for name, _ in CHANNELS] * 2
    assert told["channels"][0]["improvement_percent"] is None
    assert all(99 < c["improvement_percent"] <= 100 for c in told["channels"][7:])
    golden_text(told["in_words"])


def test_without_gimbals_there_is_no_attitude():
    run, _ = made()
    bare = replace(run, channels={k: v for k, v in run.channels.items() if k[0] != "gimbal_angle"})
    found = navigation_errors(bare)
    assert np.isfinite(found.error[:, :4]).all()
    assert len(summary([found], Aids(), NavigationInputs()).channels) == 4


def test_what_cannot_be_navigated_is_refused():
    run, _ = made()
    for wrong in (
        replace(run, kind="multi-position"),
        replace(run, site=replace(run.site, latitude=None)),
        replace(run, site=replace(run.site, latitude=np.pi / 2)),
        run.select(slice(0, 2)),
        replace(run, channels={k: v for k, v in run.channels.items() if k != ("specific_force", "y")}),
    ):
        with refused():
            navigation_errors(wrong)


def test_calibrations_are_called_by_file_or_folder():
    assert labels([Path("a/calibration.json"), Path("b/calibration.json")]) == ["a", "b"]
    assert labels([Path("two.json"), Path("three.json")]) == ["two", "three"]
    assert labels([Path("x/two.json"), Path("y/two.json")]) == ["x/two.json", "y/two.json"]


def test_drift_is_a_slope_and_rms_is_rms():
    t = np.arange(0.0, 86400.0, 60.0)
    error = np.outer(t / 86400, np.arange(1.0, 8.0))
    found = Navigated("line", t, error, 0 * t)
    np.testing.assert_allclose(found.drift_per_day, np.arange(1.0, 8.0))
    np.testing.assert_allclose(found.rms, np.arange(1.0, 8.0) / np.sqrt(3), rtol=1e-3)
