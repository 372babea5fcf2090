"""A moving gyroscope against an attitude: truth comes back with honest sigmas, and so do lag and mounting."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gimbalcal.estimate.gyroscopes.against_attitude import gyroscopes_against_attitude
from gimbalcal.platform import BENCH, Axis, Platform
from gimbalcal.recording import Recording, Site, read, write
from gimbalcal.rotation import exponential, frame_rotation
from gimbalcal.views.attitude import reference_of
from tests.golden import golden_text, refused

RATE, NOISE, LAG = 100.0, np.radians(0.1), 0.045
BIAS, SF = np.radians([0.8, -0.5, 0.3]), np.array([1.004, 0.997, 1.002])
MOUNTED = frame_rotation("z", np.radians(80.0)) @ frame_rotation("x", np.radians(-25.0))


def motion(t, seed):
    """Rates (n, 3) [rad/s] of a wrist."""
    rng = np.random.default_rng(seed)
    f, phase = np.array([0.23, 0.61, 1.3])[:, None, None], rng.uniform(0, 6, (3, 1, 3))
    return np.asarray(
        (np.array([1.2, 0.8, 0.4])[:, None, None] * np.sin(2 * np.pi * f * t[None, :, None] + phase)).sum(0)
    )


@cache
def turned(seed, length, axes):
    """Rates (n, 3) [rad/s] of such a motion about some axes, and attitudes (n, 3, 3), two a row of the log."""
    fine = np.arange(0, length + 1, 0.5 / RATE)
    w = motion(fine, seed) * np.isin(list("xyz"), list(axes))
    steps = exponential((w[1:] + w[:-1]) / 2 * np.diff(fine)[:, None])
    C = [frame_rotation("x", 0.4)]
    for step in steps:
        C.append(step @ C[-1])
    return w, np.array(C)


@cache
def recording(seed=1, length=40.0, every=4, mirror=False, axes="xyz", walk=0.0):
    """A unit in the hand, its attitude in every fourth row, `LAG` late and seen from a frame of its own.

    walk: random walk [rad/sqrt(s)] of the reference's angle.
    """
    rng = np.random.default_rng(100 + seed)
    w, C = turned(seed, length, axes)
    time = 0.5 / RATE * np.arange(len(w))[200:-200:2]  # one second in, so that the late attitude was there too
    rates = w[200:-200:2] / SF + BIAS + 1e-3 * rng.standard_normal((len(time), 3))
    late = 200 + 2 * np.arange(len(time)) - round(LAG * RATE * 2)
    body = np.swapaxes(MOUNTED, 0, 1) @ C[late]  # the reference's frame: M^T times the sensors'
    body = exponential(NOISE * rng.standard_normal((len(time), 3))) @ body
    body = body @ exponential(walk / np.sqrt(RATE) * np.cumsum(rng.standard_normal((len(time), 3)), axis=0))
    q = Rotation.from_matrix(np.swapaxes(body, -1, -2)).as_quat()
    q[np.arange(len(q)) % every > 0] = np.nan
    if mirror:
        rates[:, 1] *= -1
    channels = {("angular_rate", a): rates[:, i] for i, a in enumerate("xyz")}
    channels |= {("attitude", a): q[:, i] for i, a in enumerate(("qx", "qy", "qz", "qw"))}
    units = {key: "rad/s" if key[0] == "angular_rate" else "1" for key in channels}
    return Recording("rotation", "wrist", BENCH, Site(), {}, time, None, channels, units=units)


@cache
def made(seed=1):
    return gyroscopes_against_attitude(recording(seed))


@pytest.mark.parametrize("seed", range(1, 4))
def test_truth_comes_back_within_its_uncertainty(seed):
    c = made(seed)
    truth = np.concatenate([BIAS, SF - 1, np.zeros(3)])
    off = (c.values - truth) / c.sigmas
    assert len(off) == 9
    assert np.sqrt(np.mean(off**2)) < 2.0
    assert np.abs(off).max() < 4.0
    assert c.sigmas[:3].max() < np.radians(0.015)  # the attitude scatters by 0.1 deg, over 40 s
    assert c.sigmas[3:].max() < 3e-3


@pytest.mark.parametrize("walk", [0.0, 3e-4, 3e-3])
def test_sigmas_hold_where_the_reference_wanders(walk):
    """Ten records of ninety errors together: one sigma of their rms is 7.5 %, and 0.07 rad/h^(1/2) is a poor camera."""
    truth = np.concatenate([BIAS, SF - 1, np.zeros(3)])
    fits = [gyroscopes_against_attitude(recording(seed, walk=walk)) for seed in range(20, 30)]
    off = np.array([(c.values - truth) / c.sigmas for c in fits])
    assert 0.85 < np.sqrt(np.mean(off**2)) < 1.15
    assert all(c.provenance["thirds"]["p_value"] > 1e-3 for c in fits)


def test_lag_mounting_and_noise_are_told():
    told = made().provenance["options"]["reference"]
    assert told["lag_ms"] == pytest.approx(1e3 * round(LAG * RATE * 2) / RATE / 2, abs=4 * told["lag_sigma_ms"])
    assert told["lag_sigma_ms"] < 1.0
    np.testing.assert_allclose(told["mounting"], MOUNTED, atol=4e-3)
    assert told["noise_arcmin"] == pytest.approx(np.degrees(NOISE) * 60, rel=0.2)
    golden_text(made().stages[0].in_words)


def test_the_angles_of_a_rig_are_a_reference():
    """A table that moves all the time, for which the method of steady rates names this one."""
    whole, rig = recording(every=1), Platform("own", (Axis("inner", "x"), Axis("middle", "y"), Axis("outer", "z")))
    C = reference_of(whole).C
    roll, pitch, yaw = Rotation.from_matrix(np.swapaxes(C, -1, -2)).as_euler("ZYX").T[::-1]
    channels = {k: x for k, x in whole.channels.items() if k[0] == "angular_rate"}
    for axis, angle in zip(rig.axis_names, (roll, pitch, yaw), strict=True):
        channels["gimbal_angle", axis] = np.unwrap(angle)
    units = {key: "rad/s" if key[0] == "angular_rate" else "rad" for key in channels}
    on_a_rig = replace(whole, platform=rig, channels=channels, units=units)
    np.testing.assert_allclose(reference_of(on_a_rig).C, C, atol=1e-9)


def test_what_is_corrected_agrees_with_the_attitude():
    there = made().apply(recording())
    again = gyroscopes_against_attitude(there)
    assert np.all(np.abs(again.values) < 1e-3 * again.sigmas + 1e-6)


def test_it_goes_through_a_folder_with_empty_cells_and_euler_angles(tmp_path):
    whole = recording()
    write(whole, tmp_path / "rec")
    back = read(tmp_path / "rec")
    assert len(back.time) == len(whole.time)  # rows without an attitude stay
    np.testing.assert_allclose(reference_of(back).C, reference_of(whole).C, atol=1e-12)
    C = reference_of(whole).C
    angles = np.full((len(whole.time), 3), np.nan)
    angles[::4] = np.stack(
        [np.arctan2(C[:, 1, 2], C[:, 2, 2]), -np.arcsin(C[:, 0, 2]), np.arctan2(C[:, 0, 1], C[:, 0, 0])], axis=1
    )
    channels = {k: v for k, v in whole.channels.items() if k[0] != "attitude"}
    channels |= {("attitude", a): angles[:, i] for i, a in enumerate(("roll", "pitch", "yaw"))}
    euler = Recording("rotation", "wrist", BENCH, Site(), {}, whole.time, None, channels)
    np.testing.assert_allclose(reference_of(euler).C, C, atol=1e-9)


def test_the_command_calibrates_and_tells_the_lag(tmp_path, command, capsys):
    write(recording(), tmp_path / "rec")
    out = tmp_path / "out"
    assert command("calibrate", tmp_path / "rec", "--method", "attitude", "--out", out) == 0
    shown = capsys.readouterr()
    assert "the attitude is late by 4" in shown.err
    assert json.loads((out / "calibration.json").read_text())["method"] == "attitude"
    assert "late by 4" in (out / "report.html").read_text()
    assert command("calibrate", tmp_path / "rec", "--method", "attitude", "--terms", "gyro_bias") == 2


def test_what_cannot_be_told_is_refused():
    with refused():
        gyroscopes_against_attitude(recording(mirror=True, length=15.0))
    with refused():
        gyroscopes_against_attitude(recording(axes="x", length=15.0))
    whole = recording()
    rates = Recording("rotation", "r", BENCH, Site(), {}, whole.time, None,
                      {k: v for k, v in whole.channels.items() if k[0] != "attitude"})  # fmt: skip
    with refused():
        gyroscopes_against_attitude(rates)


@pytest.mark.parametrize(
    ("old", "new"), [('axis = "qw"', 'axis = "yaw"'), ('axis = "qw", unit = "1"', 'axis = "qw", unit = "deg"')]
)
def test_slips(tmp_path, old, new):
    write(recording(), tmp_path / "rec")
    path = tmp_path / "rec" / "recording.toml"
    path.write_text(path.read_text().replace(old, new))
    with refused():
        read(tmp_path / "rec")


def test_an_attitude_that_leaps_away_takes_no_part_and_is_told():
    r = recording()
    rows = np.flatnonzero(np.isfinite(r.channels["attitude", "qx"]))
    bad = r.channels["attitude", "qx"].copy()
    k = rows[len(rows) // 2]
    bad[k] += 0.05
    found = gyroscopes_against_attitude(r.with_channels({("attitude", "qx"): bad}))
    assert np.abs((found.values - made().values) / made().sigmas).max() < 1.0
    (told,) = found.provenance["limits"]
    golden_text(told)
    assert all(made(seed).provenance["limits"] == [] for seed in range(1, 4))
