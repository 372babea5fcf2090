"""Simulated recordings say exactly what the scenario put in."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gimbalcal.simulate.folder as folder_module
import gimbalcal.simulate.simulation as run_module
from gimbalcal.effects import CATALOGUE, parameters, values
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.errors import InputError
from gimbalcal.forward import jacobian, predict
from gimbalcal.inference.information import information, solve
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.recording import dwells, read
from gimbalcal.simulate import check_content, simulate, simulate_to
from gimbalcal.simulate.scenario import QuantityHistory
from gimbalcal.simulate.simulation import sample_path
from tests.golden import refused
from tests.paths import DEVICE, ROOT, STATIC

TEN_S = {"value": 10.0, "unit": "s"}
ONE_HZ = {"value": 1.0, "unit": "Hz"}
ARCSEC = np.pi / 648000


def device(**changes):
    return {
        "format": 1,
        "kind": "multi-position",
        "site": {"latitude": {"value": 40.0, "unit": "deg"}},
        "schedule": {"name": "wu2018-18", "dwell": TEN_S, "rate": ONE_HZ},
        "truth": {"draw": True, "factor": 0.3},
    } | changes


def static(**changes):
    clock = {"duration": {"value": 6.0, "unit": "h"}, "rate": {"value": 0.02, "unit": "Hz"}}
    return device(kind="static-run", schedule=clock) | changes


def residual(scenario, seed=1):
    recording, truth = simulate(scenario, seed)
    h = predict(recording.platform, stimulus_from_angles(recording), truth, recording.kind)
    y = {"specific_force": recording.triad("specific_force")}
    if recording.kind == "static-run":
        names = ("roll", "pitch", "yaw")
        y |= {"gimbal_angle": recording.angles(), "attitude_error": recording.triad("attitude_error", names)}
    wrapped = {k: (v - h[k] + np.pi) % (2 * np.pi) - np.pi for k, v in y.items()}
    return {k: v - h[k] if k == "specific_force" else wrapped[k] for k, v in y.items()}


def test_without_noise_a_recording_is_the_prediction():
    assert np.abs(residual(device())["specific_force"]).max() == 0
    left = residual(static())
    # the stimulus of a static run takes S_t from the readouts, which the drawn gimbal zeros shift by up to 2e-4 rad
    zero = parameters(CATALOGUE["gimbal_zero"], ("platform",))[0].sigma
    assert np.abs(left["specific_force"]).max() < 9.9 * 4 * 0.3 * zero


def test_a_static_run_of_a_perfect_platform_is_equation_19():
    recording, _ = simulate(static(truth={}))
    angle = recording.channels["gimbal_angle", "platform"]
    L = np.deg2rad(40.0)
    ideal = [np.cos(angle) * np.cos(L), np.sin(angle) * np.cos(L), np.sin(L) + 0 * angle]
    f = recording.triad("specific_force") / recording.site.gravity
    np.testing.assert_allclose(f, np.stack(ideal, -1), atol=1e-12)  # rounding of a day of radians
    np.testing.assert_allclose(recording.triad("attitude_error", ("roll", "pitch", "yaw")), 0, atol=1e-12)


def test_noise_is_as_stated_and_setting_errors_stay_within_a_dwell():
    noise = {"accelerometer": {"value": 20.0, "unit": "ug"}, "gimbal_angle": {"value": 30.0, "unit": "arcsec"}}
    recording, truth = simulate(device(noise=noise, schedule={"name": "wu2018-18"}), 3)  # 600 rows per dwell
    r = (
        recording.triad("specific_force")
        - predict(recording.platform, stimulus_from_angles(recording), truth)["specific_force"]
    )
    within = np.array([r[d.rows].std(axis=0) for d in dwells(recording)])
    sigma = 20e-6 * 9.80665
    # 600 samples: a standard deviation is known to 2.9 %; the mean of 54 to 0.4 %
    assert np.mean(within) == pytest.approx(sigma, rel=0.02)
    means = np.array([r[d.rows].mean(axis=0) for d in dwells(recording)])
    across = np.sqrt(np.mean(np.sum(means**2, axis=1))) / recording.site.gravity
    # three independent gimbal errors turn f by about sqrt(2) x 30 arcsec; 18 positions know it to 20 %
    assert across == pytest.approx(np.sqrt(2) * 30 * ARCSEC, rel=0.4)
    assert recording.noise == pytest.approx({"accelerometer": sigma, "gimbal_angle": 30 * ARCSEC})


def test_a_fit_of_the_truth_is_consistent_with_its_covariance():
    recording, truth = simulate(device(noise={"accelerometer": {"value": 20.0, "unit": "ug"}}), 4)
    wanted = tuple(
        p for i in BASELINE["multi-position"] for p in parameters(CATALOGUE[i], recording.platform.axis_names)
    )
    s, x, sigma = stimulus_from_angles(recording), values(truth, wanted), 20e-6 * 9.80665
    J = jacobian(recording.platform, s, truth, wanted)["specific_force"] / sigma
    h = predict(recording.platform, s, truth)["specific_force"]
    found = solve(information(J, (recording.triad("specific_force") - h) / sigma, wanted))
    pull = J.reshape(-1, len(wanted)) @ found.x
    rank = len(wanted) - len(found.unobservable)
    assert abs(pull @ pull - rank) < 4 * np.sqrt(2 * rank)  # chi^2 of `rank` degrees of freedom
    assert abs(found.chi2 - found.dof) < 4 * np.sqrt(2 * found.dof)
    assert x.any()


def test_a_seed_is_the_same_recording_and_another_seed_is_not():
    scenario = device(noise={"accelerometer": {"value": 20.0, "unit": "ug"}})
    one, again, other = (simulate(scenario, seed)[0].triad("specific_force") for seed in (5, 5, 6))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


def test_blocks_join_without_a_seam(monkeypatch):
    """Effects that remember give the same rows whether the run is made at once or in pieces."""
    scenario = static(
        truth={"gyro_g_sensitivity": {"xx": 0.02, "yz": 0.01}, "bias_temperature_lagged": {"x": 10.0, "tau": 0.5}},
        environment={"temperature": {"shape": "ramp", "rate": 1.0}},
    )
    whole = simulate(scenario)[0].triad("specific_force")
    monkeypatch.setattr(run_module, "BLOCK_ROWS", 100)
    pieces = simulate(scenario)[0].triad("specific_force")
    # the past is kept once a minute: trapezoid error (Earth rate x 60 s)^2 / 12 of 0.02 deg/h/g over 6 h
    np.testing.assert_allclose(pieces, whole, atol=1e-8)
    moved = device(truth={"post_move_creep": {"x": 30.0}, "accelerometer_hysteresis": {"y": 9.0}})
    pieces = simulate(moved)[0].triad("specific_force")
    monkeypatch.undo()
    assert np.array_equal(pieces, simulate(moved)[0].triad("specific_force"))


def test_slews_take_time_and_are_recorded_on_request():
    clock = {"name": "wu2018-18", "dwell": TEN_S, "rate": ONE_HZ, "slew_rate": {"value": 9.0, "unit": "deg/s"}}
    still, _ = simulate(device(schedule=clock | {"settle": {"value": 0.0, "unit": "s"}}))
    first = dwells(still)
    # position 2 is 45 deg away: 5 s at 9 deg/s after 10 s of dwell
    assert still.time[first[1].start] == 15.0
    moving, _ = simulate(device(schedule=clock | {"record_slews": True, "settle": {"value": 0.0, "unit": "s"}}))
    assert np.any(moving.position == 0)
    row = int(np.flatnonzero(moving.time == 12.0)[0])
    assert np.rad2deg(moving.channels["gimbal_angle", "inner"][row]) == pytest.approx(18.0)
    assert len(dwells(moving)) == 18


def test_faults_show_where_they_were_put():
    clean, _ = simulate(device(truth={}))
    shift = {"position": 8, "gimbal": "inner", "angle": {"value": 60.0, "unit": "arcsec"}}
    faults = {"drop": [3], "blunders": [shift], "interchange": [[4, 10]]}
    faulty, _ = simulate(device(truth={}, faults=faults))
    assert clean.position is not None
    assert set(clean.position) - set(faulty.position) == {3}
    keep = clean.select(clean.position != 3)
    np.testing.assert_array_equal(keep.angles(), faulty.angles())  # readouts tell nothing
    off = np.abs(keep.triad("specific_force") - faulty.triad("specific_force")).max(axis=1)
    assert set(faulty.position[off > 1e-9]) == {4, 8, 10}
    eight = off[faulty.position == 8].max()
    assert eight == pytest.approx(9.8 * 60 * ARCSEC * np.sqrt(0.5), rel=0.01)  # each channel's share at 45 deg


@pytest.mark.parametrize("tau", [-1.0, 0.0, 1e4])
def test_a_true_constant_lies_in_its_range(tau):
    with pytest.raises(InputError, match=r"truth\.warm_up\.tau: .* is outside its range; give .* h$"):
        simulate(device(truth={"warm_up": {"w": {"y": 40.0}, "tau": tau}}))


def test_quantisation_leaves_whole_steps():
    recording, _ = simulate(device(faults={"quantisation": {"value": 1.0, "unit": "mg"}}))
    codes = recording.triad("specific_force") / 9.80665e-3
    np.testing.assert_allclose(codes, np.round(codes), atol=1e-9)


def test_truth_is_set_by_axis_by_parameter_and_by_draw():
    truth = {
        "bias": {"x": 100.0},
        "warm_up": {"w": {"y": 40.0}, "tau": 0.5},
        "encoder_eccentricity": {"A": {"middle": 3.0}, "eccentricity_cos": {"middle": 2.0}},
        "cubic_nonlinearity": {"draw": True, "sigma": 7.0},
    }
    made = {e.id: e for e in simulate(device(truth=truth))[1]}
    assert made["bias"].b == pytest.approx([100e-6 * 9.80665, 0, 0])
    assert made["warm_up"].w == pytest.approx([0, 40e-6 * 9.80665, 0])
    assert made["warm_up"].tau == 1800.0
    assert made["encoder_eccentricity"].B[2] == pytest.approx(2 * ARCSEC)
    assert np.all(made["cubic_nonlinearity"].K3)


WRONG: list[dict[str, Any]] = [
    device(kind="swing"),
    device(noise={"accelerometer": 1.0}),
    device(noise={"accelerometer": {"value": 1.0, "unit": "deg"}}),
    device(noise={"gyro": {"value": 1.0, "unit": "deg/h"}}),
    device(schedule={"name": "wu"}),
    device(schedule={"name": "wu2018-18", "dwell": {"value": -1, "unit": "s"}}),
    device(schedule={"holds": [{"roll": 3.0}]}),
    static(site={}),
    device(site={"latitude": {"value": 91.0, "unit": "deg"}}),
    device(truth={"biass": {"x": 1.0}}),
    device(truth={"bias": {"u": 1.0}}),
    device(truth={"bias": {"x": "big"}}),
    device(truth={"bias_temperature": {"x": 1.0}}),
    device(truth={"gyro_drift": {"polar": 1.0}}),
    device(truth={"pressure": {"x": 1.0}}),
    device(faults={"interchange": [[1, 19]]}),
    device(schedule={"name": "wu2018-18", "dwell": {"value": 1e7, "unit": "min"}}),
    static(schedule={"duration": {"value": 11 * 8766.0, "unit": "h"}}),
    device(environment={"temperature": {"shape": "table", "time_h": [0.0]}}),
    device(platform={"name": "bench"}),
]


@pytest.mark.parametrize("scenario", WRONG)
def test_a_bad_scenario_is_told_in_one_sentence(scenario):
    with refused():
        simulate(check_content(scenario))


def test_a_folder_is_written_whole_with_its_truth(tmp_path):
    truth = simulate_to("demo", tmp_path / "run", seed=3)
    back = read(tmp_path / "run")
    expected, _ = simulate("demo", 3)
    assert json.loads((tmp_path / "run" / "truth.json").read_text()) == truth
    cubic = next(p for p in truth["parameters"] if p["name"] == "K3" and p["axis"] == "x")
    assert cubic["value"] == pytest.approx(60.0)
    assert cubic["unit"] == "ug/g^3"
    np.testing.assert_allclose(back.triad("specific_force"), expected.triad("specific_force"), atol=1e-9)
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


def test_a_long_run_is_written_in_blocks_as_parquet(tmp_path, monkeypatch):
    monkeypatch.setattr(run_module, "BLOCK_ROWS", 500)
    monkeypatch.setattr(folder_module, "MIN_PARQUET_ROWS", 800)
    text = Path(run_module.__file__).parents[1].joinpath("scenarios", "wu2018-static.toml").read_text()
    (tmp_path / "s.toml").write_text(text.replace("rate = { value = 1.0", "rate = { value = 0.02"))
    simulate_to(tmp_path / "s.toml", tmp_path / "run")
    back = read(tmp_path / "run")
    expected, _ = simulate(tmp_path / "s.toml")
    assert len(back.time) == 1728
    np.testing.assert_allclose(back.triad("specific_force"), expected.triad("specific_force"), atol=1e-12)


def test_a_scenario_that_is_not_there_is_told_with_those_that_are(tmp_path):
    with refused():
        simulate_to("nothing", tmp_path / "run")
    (tmp_path / "bad.toml").write_text("kind = ")
    with pytest.raises(InputError, match=r"bad\.toml, line 1: .* not valid TOML"):
        simulate_to(tmp_path / "bad.toml", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_temperature_walks_by_the_root_of_time():
    walk = sample_path(QuantityHistory(shape="random-walk", walk=2.0), 3600.0 * 4000, np.random.default_rng(3))
    for hours in (1, 16):
        steps = np.diff(walk(3600.0 * np.arange(0, 4001, hours)))
        assert np.std(steps) == pytest.approx(2.0 * np.sqrt(hours), rel=4 / np.sqrt(2 * len(steps)))


def test_a_covariate_acts_and_is_logged():
    around = {"covariates": {"supply_voltage": {"shape": "ramp", "mean": 5.0, "rate": 1.0}}}
    recording, _ = simulate(device(truth={"supply_voltage": {"k": {"x": 10.0}}}, environment=around))
    volts = recording.channels["covariate", "supply_voltage"]
    bare, _ = simulate(device(truth={}))
    felt = recording.channels["specific_force", "x"] - bare.channels["specific_force", "x"]
    np.testing.assert_allclose(felt, 10e-6 * 9.80665 * (volts - volts.mean()), atol=1e-14)


def test_the_scenario_in_the_documentation_runs():
    page = (ROOT / "docs" / "scenarios.md").read_text()
    content = tomllib.loads(page.split("```toml\n")[1].split("```")[0])
    recording, truth = simulate(content | {"schedule": content["schedule"] | {"dwell": TEN_S}})
    assert {e.id for e in truth} >= {"cubic_nonlinearity", "warm_up", "cross_coupling", "bias"}
    assert recording.position is not None
    assert set(recording.position) == set(range(1, 19)) - {3}


def test_the_truths_of_one_unit_agree_in_both_kinds_of_recording():
    """The platform gimbal's zero of the unit that ships was +24 arcsec at 18 positions and -24 arcsec at rest."""
    told = [json.loads((f / "truth.json").read_text())["parameters"] for f in (DEVICE, STATIC)]
    by_label = [{(p["name"], p["axis"]): p["value"] for p in parameters} for parameters in told]
    common = set(by_label[0]) & set(by_label[1])
    assert ("gimbal_zero", "platform") in common
    assert [by_label[0][k] for k in sorted(common)] == [by_label[1][k] for k in sorted(common)]


def test_a_static_run_that_ships_is_what_its_scenario_says_now():
    """A sense of the zeros that is not the one of its samples would move the readout by 48 arcsec."""
    made, there = simulate(STATIC / "scenario.toml")[0], read(STATIC)
    for key, values_there in there.channels.items():
        close = (made.channels[key] - values_there + np.pi) % (2 * np.pi) - np.pi if key[0] == "gimbal_angle" else None
        left = made.channels[key] - values_there if close is None else close
        np.testing.assert_allclose(left, 0, atol=1e-12, err_msg=str(key))  # rounding of days of radians


def test_a_disk_without_room_is_told_before_the_work(tmp_path, monkeypatch):
    free = folder_module.shutil.disk_usage(tmp_path)._replace(free=1000)
    monkeypatch.setattr(folder_module, "MIN_PARQUET_ROWS", 100)
    monkeypatch.setattr(folder_module.shutil, "disk_usage", lambda path: free)
    with refused():
        simulate_to("demo", tmp_path / "made")
    assert not list(tmp_path.iterdir())
