"""A unit that a schedule turns: its readings are means over their intervals, whatever the interval."""

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE
from gimbalcal.recording import read
from gimbalcal.rotation import exponential
from gimbalcal.schedule import ROTATIONS
from gimbalcal.schedule.file import rotation_toml
from gimbalcal.schedule.trajectory import trajectory
from gimbalcal.simulate import check_content, load, prepare, simulate, simulate_to
from gimbalcal.simulate.turned import nodes
from tests.golden import refused

LATITUDE = np.deg2rad(34.2)


def unit(**changes):
    """Four turns in half a minute, with errors that act on rate, acceleration, force, temperature and time."""
    degrees = [("x", 90.0), ("outer", -120.0), ("inner", 45.0), ("y", 3.0)]
    clock = {
        "moves": [{"axis": axis, "angle": {"value": angle, "unit": "deg"}} for axis, angle in degrees],
        "start": {"x": "north", "y": "west", "z": "up"},
        "dwell": {"value": 2.0, "unit": "s"},
        "slew_rate": {"value": 20.0, "unit": "deg/s"},
        "rate": {"value": 10.0, "unit": "Hz"},
        "start_sigma": {"value": 1.0, "unit": "deg"},
    }
    truth = {
        "bias": {"x": 200.0},
        "misalignment": {"xy": 180.0},
        "gyro_scale_factor": {"z": 300.0},
        "gyro_g_sensitivity_rate": {"xz": 1.0},
        "quadratic_nonlinearity": {"y": 300.0},
        "cross_coupling": {"zx": 300.0},
        "accelerometer_lever_arm": {"xx": 20.0, "yy": -30.0, "zz": 10.0},
        "lever_arm": {"y": 40.0},
        "bias_temperature": {"z": 30.0},
    }
    return {
        "format": 1,
        "kind": "rotation",
        "site": {"latitude": {"value": 34.2, "unit": "deg"}},
        "schedule": clock | changes.pop("schedule", {}),
        "truth": truth,
        "environment": {"temperature": {"shape": "ramp", "rate": 600.0}},
        "noise": {"gimbal_angle": {"value": 1.0, "unit": "arcmin"}},
    } | changes


def readings(**changes):
    made, _ = simulate(unit(**changes))
    return np.hstack([made.triad("specific_force"), made.triad("angular_rate")])


def at(hertz, **more):
    return {"schedule": {"rate": {"value": hertz, "unit": "Hz"}, **more}}


def test_a_reading_is_the_mean_of_the_shorter_ones_in_it():
    slow, fast = readings(), readings(**at(70.0))
    means = fast[: 7 * len(slow)].reshape(-1, 7, 6).mean(axis=1)
    np.testing.assert_allclose(slow, means, rtol=0, atol=2e-9)  # 0.2 ng, 0.4 mdeg/h; readings are of order 10 and 0.3
    np.testing.assert_allclose(np.diff(means - slow, axis=0)[-15:], 0, atol=1e-12)  # at rest


def test_instants_are_what_means_become_as_the_interval_shrinks():
    made, _ = simulate(unit(**at(10.0, rates="instant")))
    instant = np.hstack([made.triad("specific_force"), made.triad("angular_rate")])
    short = readings(**at(2000.0))
    around = (short[199::200] + short[200::200])[: len(instant) - 1] / 2
    corners = prepare(check_content(unit())).path.corners
    away = np.abs(made.time[:-1, None] - corners).min(axis=1) > 0.01
    np.testing.assert_allclose(instant[:-1][away], around[away], atol=3e-7)  # (w h)^2 g / 6 of 0.5 ms
    assert made.instant


def test_rates_integrate_to_the_attitudes_of_the_schedule():
    clean = {"truth": {}, "noise": {}, "schedule": {"start_sigma": {"value": 0.0, "unit": "deg"}, "moves": [],
             "name": "wei2022-30", "dwell": None, "slew_rate": None, "start": {}}}  # fmt: skip
    made, _ = simulate(unit(**clean))
    rate, force = made.triad("angular_rate"), made.triad("specific_force")
    C = exponential(-rate * 0.1)
    while len(C) > 1:
        C = np.concatenate([C[0:-1:2] @ C[1::2], C[len(C) - len(C) % 2 :]])
    start = ROTATIONS["wei2022-30"].attitudes()[0]
    turned = trajectory(ROTATIONS["wei2022-30"]).duration * EARTH_RATE
    earth = exponential(turned * np.array([np.cos(LATITUDE), 0, -np.sin(LATITUDE)]))
    np.testing.assert_allclose(
        C[0], start.T @ earth.T @ start, atol=5e-7
    )  # coning within 0.1 s at 10 deg/s and the Earth
    np.testing.assert_allclose(force[[0, -1]], [[made.site.gravity, 0, 0]] * 2, atol=1e-12)
    assert len(rate) == round(10 * trajectory(ROTATIONS["wei2022-30"]).duration)


def test_each_axis_is_set_anew_and_errors_do_not_add_up():
    moves = [{"axis": "inner", "angle": {"value": 90.0, "unit": "deg"}} for _ in range(200)]
    short = {"dwell": {"value": 0.1, "unit": "s"}, "slew_rate": {"value": 900.0, "unit": "deg/s"}, "moves": moves}
    run = prepare(check_content(unit(schedule=short)))
    error = np.cumsum(run.path.angle - np.pi / 2) * 180 / np.pi * 60
    assert 0.8 < error.std() < 1.2
    assert abs(error[-50:].mean()) < 0.6


def test_white_noise_of_a_density_is_the_same_at_any_rate():
    noise = {"accelerometer_density": {"value": 5.0, "unit": "ug/sqrt(Hz)"},
             "gyroscope_density": {"value": 0.002, "unit": "deg/sqrt(h)"},
             "gyroscope_random_walk": {"value": 0.01, "unit": "deg/h/sqrt(h)"},
             "velocity": {"value": 0.01, "unit": "mm/s"}}  # fmt: skip
    made, _ = simulate(unit(noise=noise, truth={}, **at(100.0)))
    assert made.noise["velocity"] == 1e-5
    assert made.noise["gyroscope"] == pytest.approx(np.deg2rad(0.002) / 60 * 10)
    assert made.noise["accelerometer"] == pytest.approx(5e-6 * 9.80665 * 10)
    assert np.std(made.triad("specific_force")[:190, 2]) == pytest.approx(made.noise["accelerometer"], rel=0.2)


def test_a_place_quivers_as_the_header_says():
    """Velocities a second apart are independent, with that sigma; nothing adds up."""
    quiet = {"noise": {}, "truth": {}}
    still = {"noise": {"velocity": {"value": 1.0, "unit": "mm/s"}}, "truth": {}}
    schedule = {"dwell": {"value": 500.0, "unit": "s"}, "moves": [], "name": "wei2022-30"}
    made = [readings(**case, schedule=schedule) for case in (still, quiet)]
    added = (made[0] - made[1])[:, :3]
    assert np.all(made[0][:, 3:] == made[1][:, 3:])
    rests = [slice(10 * (a + 5), 10 * (a + 495)) for a in (0, 510, 1020)]  # no turn in these: 10 Hz, 90 deg at 20 deg/s
    v = np.concatenate([np.cumsum(added[rows] * 0.1, axis=0)[::10] for rows in rests])
    v = np.concatenate([part - part.mean(axis=0) for part in np.split(v, 3)])
    assert v.std(axis=0) == pytest.approx([1e-3] * 3, rel=0.1)
    assert np.abs(np.mean(v[1:] * v[:-1], axis=0)).max() < 0.1e-6


def test_a_folder_and_a_schedule_file(tmp_path):
    (tmp_path / "schedule.toml").write_text(rotation_toml(ROTATIONS["jia2014-9"]))
    content = unit(**at(5.0, moves=[], start={}, file=str(tmp_path / "schedule.toml")))
    made, _ = simulate(content)
    assert made.time[-1] == pytest.approx(trajectory(ROTATIONS["jia2014-9"]).duration - 7 * 100 - 200 + 9 * 2 - 8 * 4.5)
    scenario = tmp_path / "s.toml"
    scenario.write_text(
        """format = 1
        kind = "rotation"
        site = { latitude = { value = 30, unit = "deg" } }
        schedule = { name = "cai2016-18", rate = { value = 1, unit = "Hz" } }
        [noise]
        accelerometer = { value = 1, unit = "ug" }
        gyroscope = { value = 0.001, unit = "deg/h" }
        """
    )
    simulate_to(scenario, tmp_path / "out")
    assert len(read(tmp_path / "out").time) == 3870


@pytest.mark.parametrize("name", ["cai2016-18", "wei2022-30"])
def test_the_papers_simulations_ship(name):
    run = prepare(load(name))
    assert {e.id for e in run.effects} >= {"bias", "scale_factor", "misalignment", "gyro_bias", "gyro_misalignment"}
    assert run.path is not None


@pytest.mark.parametrize(
    "changes",
    [
        {"kind": "multi-position"},
        {"schedule": {"name": "cai2016-18"}},
        {"schedule": {"moves": [], "name": "cai"}},
        {"schedule": {"start": {"x": "north", "y": "up", "z": "north"}}},
        {"schedule": {"start": {"x": "north"}}},
        {"truth": {"accelerometer_hysteresis": {"x": 1.0}}},
    ],
)  # fmt: skip
def test_a_scenario_that_cannot_be_is_refused(changes):
    with refused():
        simulate(unit(**changes))


def test_no_two_instants_are_one_where_corners_fall_on_rows():
    path = trajectory(ROTATIONS["cai2016-18"])
    time = np.arange(1, 38701) * 0.1  # every corner is a row's end, but for rounding
    at = nodes(path, time, 0.1, False)
    assert np.diff(at.time).min() > 1e-3
    np.testing.assert_allclose(at.means(np.ones(len(at.time))), 1.0, rtol=1e-14)
    np.testing.assert_allclose(at.means(at.time), time - 0.05, rtol=1e-13)


def test_a_simulation_without_noise_is_no_clipped_sensor_and_a_frozen_one_is_told(tmp_path):
    scenario, quiet = tmp_path / "s.toml", 'schedule = { name = "wei2022-30", rate = { value = 5, unit = "Hz" } }\n'
    head = 'format = 1\nkind = "rotation"\nsite = { latitude = { value = 30, unit = "deg" } }\n' + quiet
    scenario.write_text(head)
    simulate_to(scenario, tmp_path / "out")
    assert len(read(tmp_path / "out").time) == 17270
    scenario.write_text(head + 'noise = { gyroscope = { value = 1, unit = "deg/h" } }\n')
    simulate_to(scenario, tmp_path / "noisy")
    lines = (tmp_path / "noisy" / "samples.csv").read_text().splitlines()
    frozen = [",".join([*line.split(",")[:5], "0.5", *line.split(",")[6:]]) for line in lines[2000:14000]]
    (tmp_path / "noisy" / "samples.csv").write_text("\n".join([*lines[:2000], *frozen, *lines[14000:]]))
    with refused():
        read(tmp_path / "noisy")
