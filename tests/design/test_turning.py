"""What a schedule of turns sees: the bounds of an independent program, a dense filter, Wei's degrees, and its words."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from gimbalcal.cli import gimbalcal
from gimbalcal.design.turning import turning_experiment
from gimbalcal.design.turning_observability import observe_turning
from gimbalcal.estimate.systematic.filter_pass import VELOCITY_STATES
from gimbalcal.inference.innovations import innovations
from gimbalcal.schedule import Move, RotationSchedule
from gimbalcal.schedule.trajectory import trajectory
from tests.golden import golden_text

# Cramer-Rao sigmas of a covariance program that shares no line with this one; latitude 34.2 deg, smallest and largest
BOUNDS = {
    ("cai2016-18", "51", "seed"): {
        "gyro_bias": (5.8e-6, 6.9e-6), "gyro_scale_factor": (0.0029, 0.0036), "gyro_misalignment": (0.0016, 0.0021),
        "bias": (0.0032, 0.0036), "scale_factor": (0.0028, 0.0030), "misalignment": (0.0008, 0.0020),
        "gyro_g_sensitivity_rate": (3.5e-6, 1.2e-4), "K2": (0.0043, 0.0047), "K_c": (0.037, 0.0386),
        "accelerometer_lever_arm": (0.0118, 0.0118),
    },
    ("cai2016-18", "51", "laser"): {
        "gyro_bias": (0.0027, 0.0030), "gyro_scale_factor": (0.71, 0.72), "gyro_misalignment": (0.36, 0.36),
        "bias": (0.83, 0.84), "scale_factor": (0.135, 0.144), "misalignment": (0.21, 0.295),
        "gyro_g_sensitivity_rate": (0.0034, 0.038), "K2": (0.84, 0.84), "K_c": (1.47, 1.56),
        "accelerometer_lever_arm": (0.533, 0.535),
    },
    ("cai2016-18", "30", "laser"): {
        "gyro_bias": (0.0027, 0.0029), "gyro_scale_factor": (0.71, 0.72), "gyro_misalignment": (0.36, 0.36),
        "bias": (0.132, 0.14), "scale_factor": (0.135, 0.144), "misalignment": (0.21, 0.294),
    },
    ("wei2022-30", "30", "laser"): {
        "gyro_bias": (0.0025, 0.0028), "gyro_scale_factor": (0.48, 0.48), "gyro_misalignment": (0.26, 0.29),
        "bias": (0.14, 0.15), "scale_factor": (0.14, 0.158), "misalignment": (0.15, 0.23),
    },
}  # fmt: skip
SEED = {"rate_noise": 0.00005 / 3600 * 0.1 * 60, "force_noise": 0.1}  # of a sample at 100 Hz


@pytest.mark.parametrize(("schedule", "asked", "noise"), BOUNDS)
def test_bounds_are_those_of_an_independent_program(schedule, asked, noise):
    seen = observe_turning(schedule, 34.2, asked, **(SEED if noise == "seed" else {}))
    for name, (low, high) in BOUNDS[schedule, asked, noise].items():
        sigma = [r["sigma"] for r in seen.bounds.to_dict()["parameters"] if r["name"] == name]
        np.testing.assert_allclose([min(sigma), max(sigma)], [low, high], rtol=0.03, err_msg=name)


SHORT = RotationSchedule(
    "short", ("east", "north", "up"), (Move("x", np.pi / 2), Move("inner", -np.pi), Move("outer", 2.0)), 0.3, 1.0, 20.0
)


def test_rows_say_what_a_filter_with_the_constants_among_its_states_says():
    experiment = turning_experiment(34.0, "51", 0.002, 5.0)
    wanted, noise = experiment.wanted, experiment.noise
    made = experiment.stretches(trajectory(SHORT))
    found = made.innovations(noise)
    rows = found.rows.reshape(-1, len(wanted))
    joint = np.linalg.inv(np.eye(len(wanted)) + rows.T @ rows)
    p = len(wanted)
    P = np.zeros((9 + p, 9 + p))
    P[:9, :9], P[9:, 9:] = found.P[0], np.eye(p)
    H = np.eye(9 + p)[VELOCITY_STATES]
    R = (noise.velocity / 1e-3) ** 2 * np.eye(3)
    for Phi, Psi, Q in zip(made.Phi, made.Psi, made.Q, strict=True):
        F = np.eye(9 + p)
        F[:9, :9], F[:9, 9:] = Phi, Psi
        P = F @ P @ F.T
        P[:9, :9] += Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        A = np.eye(9 + p) - K @ H
        P = A @ P @ A.T + K @ R @ K.T
    np.testing.assert_allclose(np.sqrt(np.diag(P)[9:]), np.sqrt(np.diag(joint)), rtol=1e-6)
    D = found.D[-1]
    np.testing.assert_allclose(P[:9, :9], found.P[-1] + D @ joint @ D.T, rtol=1e-5, atol=1e-9)


def test_components_one_after_the_other_are_components_together():
    rng = np.random.default_rng(3)
    Phi, Psi = rng.standard_normal((6, 3, 3)) / 2, rng.standard_normal((6, 3, 2))
    Q = np.broadcast_to(0.1 * np.eye(3), (6, 3, 3))
    found = innovations(Phi, Psi, Q, np.array([0, 2]), np.full((6, 2), 0.3), np.ones(3))
    H, P, D, G = np.eye(3)[[0, 2]], np.eye(3), np.zeros((3, 2)), np.zeros((2, 2))
    for k in range(6):
        D, P = Phi[k] @ D + Psi[k], Phi[k] @ P @ Phi[k].T + Q[k]
        S = H @ P @ H.T + 0.3 * np.eye(2)
        G += (H @ D).T @ np.linalg.solve(S, H @ D)
        K = P @ H.T @ np.linalg.inv(S)
        D, P = D - K @ H @ D, P - K @ S @ K.T
    rows = found.rows.reshape(-1, 2)
    np.testing.assert_allclose(rows.T @ rows, G, rtol=1e-12)
    np.testing.assert_allclose(found.P[-1], P, rtol=1e-12)


def test_what_turns_about_one_axis_do_not_see_is_named():
    moves = (Move("z", np.pi), Move("z", -np.pi), Move("z", np.pi / 2))
    seen = observe_turning(RotationSchedule("flat", ("east", "north", "up"), moves), 40.0, "30")
    told = seen.to_dict()
    unseen = {label for u in told["unobservable"] for label in u["direction"]}
    assert {"gyro_scale_factor:x", "gyro_scale_factor:y"} <= unseen
    words = {s["parameter"]: s["observability"] for s in told["states"]}
    degree = {s["parameter"]: s["degree"] for s in told["states"]}
    assert degree["gyro_scale_factor:x"] < 1.2  # a wrong rate of the Earth: 0.015 deg/h, hidden in the bias
    assert words["gyro_scale_factor:z"] != "unobservable"  # in the heading, through the Earth's rate
    assert "low: " in seen.in_words


def test_wei_table_2_is_these_degrees_but_for_a_factor_of_the_gyroscopes_biases():
    published = observe_turning("wei2022-30", 30.0, "30").published
    assert published.spread["gyro_bias"] < 1.02
    assert published.spread["bias"] < 1.08
    golden_text(published["in_words"])
    assert observe_turning("wei2022-30", 30.0, "bias").published is None


def test_the_command_writes_the_contract(tmp_path):
    arguments = ["observe", "jia2014-9", "--states", "bias,gyro_bias", "--out", str(tmp_path), "--json"]
    result = CliRunner().invoke(gimbalcal, arguments, catch_exceptions=False)
    told = json.loads((tmp_path / "observability.json").read_text())
    assert json.loads(result.stdout) == told
    row = next(s for s in told["states"] if s["parameter"] == "gyro_bias:x")
    assert len(row["sigma"]) == len(row["time_s"])
    assert row["degree"] == pytest.approx(1.0 / row["sigma"][-1])  # the usual size is 1 deg/h
    assert np.all(np.diff(row["sigma"]) <= 0)
    page = (tmp_path / "report.html").read_text()
    assert "determines all six errors" in page
    assert "gyro bias" in page
