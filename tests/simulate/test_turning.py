"""Simulated gyroscopes: rates are those of the platform and the Earth, turns come to speed and to rest."""

from typing import Any

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.forward import angular_rate
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.platform import KNOWN
from gimbalcal.simulate import check_content, prepare, simulate
from tests.golden import refused

HOLDS = [{"inner": 0.0}, {"inner": 90.0, "middle": 40.0}, {"inner": 90.0, "middle": 40.0, "outer": -720.0},
         {"inner": 95.0, "middle": 40.0, "outer": -720.0}]  # fmt: skip


def table(**changes):
    clock = {"holds": HOLDS, "dwell": {"value": 5.0, "unit": "s"}, "rate": {"value": 100.0, "unit": "Hz"},
             "slew_rate": {"value": 60.0, "unit": "deg/s"}, "settle": {"value": 0.5, "unit": "s"}}  # fmt: skip
    return {
        "format": 1, "kind": "multi-position", "gyroscopes": True, "platform": {"name": "three-axis-table"},
        "site": {"latitude": {"value": 32.0, "unit": "deg"}}, "schedule": clock,
    } | changes  # fmt: skip


def turned(recording):
    """Rotation (n - 1, 3) [rad] from row to row of the drawing's attitude, in the platform."""
    C = recording.platform.attitude(recording.angles())
    step = C[1:] @ np.swapaxes(C[:-1], -1, -2)
    return (
        np.stack([step[:, 1, 2] - step[:, 2, 1], step[:, 2, 0] - step[:, 0, 2], step[:, 0, 1] - step[:, 1, 0]], -1) / 2
    )


def test_rates_are_the_turning_of_the_platform_and_of_the_earth():
    recording, _ = simulate(table())
    rate = recording.triad("angular_rate")
    C_np = recording.platform.attitude(recording.angles())
    earth = C_np @ (EARTH_RATE * np.array([np.cos(np.deg2rad(32)), 0.0, -np.sin(np.deg2rad(32))]))
    own = (rate - earth)[1:] + (rate - earth)[:-1]
    # a step of 10 ms at up to 60 deg/s is 0.01 rad: its sine is off by 2e-7, the trapezoid by (h^2 / 12) of the ramp
    np.testing.assert_allclose(turned(recording), own / 2 * 0.01, atol=2e-6)
    revolving = (recording.time > 15) & (recording.time < 24)
    np.testing.assert_allclose(np.linalg.norm((rate - earth)[revolving], axis=1), np.deg2rad(60), rtol=1e-12)
    still = recording.position > 0
    np.testing.assert_allclose(rate[still], earth[still], atol=1e-17)


def test_a_leaning_axis_leans_the_rate():
    platform = KNOWN["three-axis-table"]
    s = stimulus_from_readings(simulate(table())[0])
    wanted = parameters(CATALOGUE["gimbal_nonorthogonality"], platform.axis_names)
    bent = with_values((), wanted, np.full(len(wanted), 1e-3), platform.axis_names)
    rates, h = np.tile([0.3, -0.2, 1.0], (len(s.time), 1)), 1e-6
    own = angular_rate(platform, s, bent, rates) - angular_rate(platform, s, bent, 0 * rates)
    tilts = bent[0].contribution(s)
    before, now, after = (platform.attitude(s.readout + d * rates, tilts) for d in (-h, 0.0, h))
    W = (after - before) / (2 * h) @ np.swapaxes(now, -1, -2)
    # central differences of a rotation: h^2 / 6, and rounding / h
    np.testing.assert_allclose(own, -np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], -1), atol=1e-9)
    straight = angular_rate(platform, s, (), rates) - angular_rate(platform, s, (), 0 * rates)
    assert np.abs(own - straight).max() > 1e-4


def test_a_turn_comes_to_speed_and_to_rest():
    run = prepare(check_content(table()))
    assert run.table.ramp == 1.0
    time = np.arange(0.0, run.table.stop[-1], 1e-3)
    angle, rate = run.table.angles(time, run.table.true), run.table.rates(time, run.table.true)
    # the trapezoid rule over ramps of 1 s in steps of 1 ms: pi^2 h^2 / 12 of the rate
    np.testing.assert_allclose(np.diff(angle, axis=0), (rate[1:] + rate[:-1]) / 2 * 1e-3, atol=1e-8)
    np.testing.assert_allclose(angle[run.table.visit(time) == 2][0], np.deg2rad([90, 40, -720]), atol=1e-12)
    # the last move, 5 deg, is too short for 60 deg/s
    assert np.abs(rate[time > run.table.stop[2]]).max() == pytest.approx(np.deg2rad(5), rel=1e-6)


def test_a_setting_error_turns_the_gyroscopes_too():
    noisy = table(noise={"gimbal_angle": {"value": 1.0, "unit": "deg"}})
    recording, _ = simulate(noisy)
    rate = recording.triad("angular_rate")
    rows = (recording.time > 5) & (recording.time < 10)
    nominal = simulate(table())[0].triad("angular_rate")
    difference = np.trapezoid((rate - nominal)[rows], dx=0.01, axis=0)
    assert 1e-3 < np.linalg.norm(difference) < 0.2


def test_bias_is_read_and_the_accelerometers_stay_as_they_were():
    truth = {"gyro_bias": {"x": 100.0}, "gyro_g_sensitivity_rate": {"yz": 10.0}}
    with_errors, clean = simulate(table(truth=truth))[0], simulate(table())[0]
    added = with_errors.triad("angular_rate") - clean.triad("angular_rate")
    unit = np.deg2rad(1) / 3600
    np.testing.assert_allclose(added[:, 0], 100 * unit, rtol=1e-9)
    np.testing.assert_allclose(added[:, 1], 10 * unit * clean.triad("specific_force")[:, 2] / 9.80665, atol=1e-12)
    np.testing.assert_array_equal(with_errors.triad("specific_force"), clean.triad("specific_force"))


def test_a_lever_arm_shows_on_the_way_and_not_at_rest():
    difference = simulate(table(truth={"lever_arm": {"x": 30.0}}))[0].triad("specific_force")
    difference = difference - simulate(table())[0].triad("specific_force")
    recording = simulate(table())[0]
    assert np.abs(difference[recording.position > 0]).max() < 1e-6  # Earth's rate squared
    w = recording.triad("angular_rate")
    inward = np.cross(w, np.cross(w, [0.03, 0.0, 0.0]))
    revolving = (recording.time > 15) & (recording.time < 24)  # at constant rate but for the Earth's, 7e-5 rad/s
    np.testing.assert_allclose(difference[revolving], inward[revolving], atol=1e-5)
    assert np.abs(inward[revolving]).max() > 0.01


WRONG: list[dict[str, Any]] = [
    table(gyroscopes=False, truth={"gyro_bias": {"x": 1.0}}),
    table(site={}),
    table(kind="static-run"),
    table(kind="rotation", schedule={}),
    table(noise={"gyroscope": {"value": 1.0, "unit": "deg"}}),
]


@pytest.mark.parametrize("scenario", WRONG)
def test_a_bad_scenario_is_told_in_one_sentence(scenario):
    with refused():
        simulate(scenario)
