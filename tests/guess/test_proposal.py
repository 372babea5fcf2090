"""Logs that nobody described: columns and units are guessed, rests found, and what cannot be guessed is asked for."""

import json
import tomllib
from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from gimbalcal.guess import proposal
from gimbalcal.guess.column_names import by_name, plain_name
from gimbalcal.guess.column_values import unit_of_force
from gimbalcal.guess.log import Guess, Log
from gimbalcal.guess.proposal import propose_recording
from gimbalcal.recording import dwells, read
from gimbalcal.rotation import exponential
from tests.golden import golden_text, refused

G, D = 9.80665, 180 / np.pi
STILL, MOVE, STEP = 150, 50, 0.02


def turned(seed=1, rests=10):
    """Time (n,), force and rate (n, 3) in SI of a unit turned by hand about one axis after the other."""
    rng = np.random.default_rng(seed)
    rate, force, u = [], [], np.array([0.0, 0, -G])
    for k in range(rests):
        axis = np.roll([1.0, 0.3, 0.1], k)
        axis /= np.linalg.norm(axis)
        speed = np.r_[np.zeros(STILL), np.pi * np.sin(np.pi * (np.arange(MOVE) + 0.5) / MOVE)]
        for w in speed:
            u = exponential(axis * w * STEP) @ u
            rate.append(axis * w)
            force.append(u)
    n = len(rate)
    f = np.array(force) + 0.003 * rng.standard_normal((n, 3))
    return np.arange(n) * STEP, f, np.array(rate) + 0.001 * rng.standard_normal((n, 3))


def table(path, columns, separator=",", before=""):
    text = pl.DataFrame(columns).write_csv(separator=separator)
    path.write_text(before + text, encoding="utf-8")
    return path


def right(path, *more, rate=0.0, gyro=True, begins=0.0):
    """The proposal is the recording that was logged, whatever units and names it was logged in."""
    t, f, w = turned()
    found = propose_recording([path, *more], rate=rate).recording
    assert len(dwells(found)) == 10
    assert len(found.time) > 0.99 * len(t)
    at = np.round((found.time - begins) / STEP).astype(int)
    np.testing.assert_allclose(found.time - begins, t[at], atol=1e-6)
    np.testing.assert_allclose(found.triad("specific_force"), f[at], atol=1e-4)
    if gyro:
        assert np.abs(found.triad("angular_rate") - w[at]).max() < (0.05 if more else 1e-4)


def test_names_with_units(tmp_path):
    t, f, w = turned()
    columns = {"Time (ms)": t * 1e3, **{f"Acc{a} [g]": f[:, i] / G for i, a in enumerate("XYZ")},
               **{f"Gyro{a}(dps)": w[:, i] * D for i, a in enumerate("XYZ")}, "note": ["x"] * len(t)}  # fmt: skip
    right(table(tmp_path / "a.csv", columns))
    assert propose_recording([tmp_path / "a.csv"]).left_out == ("note",)


def test_names_without_units_semicolons_and_dates(tmp_path):
    t, f, w = turned()
    stamps = [(datetime(2026, 5, 1, 23, 59) + timedelta(seconds=float(s))).isoformat() for s in t]  # noqa: DTZ001
    columns = {"timestamp": stamps, **{f"linear_acceleration.{a}": f[:, i] for i, a in enumerate("xyz")},
               **{f"angular_velocity.{a}": w[:, i] for i, a in enumerate("xyz")}}  # fmt: skip
    right(table(tmp_path / "b.csv", columns, ";"), begins=86340.0)


def test_no_names_at_all(tmp_path):
    t, f, w = turned()
    np.savetxt(tmp_path / "c.txt", np.column_stack([t, f, w * D]), fmt="%.6f")
    right(tmp_path / "c.txt")


def test_two_logs_on_two_clocks(tmp_path):
    t, f, w = turned()
    t2 = np.arange(0, t[-1], 0.013)
    gyro = {"t": t2, **{f"g{a}": np.interp(t2, t, w[:, i]) for i, a in enumerate("xyz")}}
    force = table(tmp_path / "acc.csv", {"t": t, **{f"a{a}": f[:, i] for i, a in enumerate("xyz")}})
    right(force, table(tmp_path / "gyr.csv", gyro))
    with refused():
        propose_recording([force, table(tmp_path / "later.csv", {**gyro, "t": t2 + 1e4})])


def test_lines_before_the_table_blanks_holes_and_milli_g(tmp_path):
    t, f, _ = turned()
    z = f[:, 2] / G * 1e3
    z[::499] = np.nan
    columns = {"time_us": t * 1e6, " acc x ": f[:, 0] / G * 1e3, " acc y ": f[:, 1] / G * 1e3, " acc z ": z}
    path = table(tmp_path / "d.log", columns, "\t", "# logger v3\nserial 1234\n")
    found = propose_recording([path])
    assert "are left out, empty in acc z" in " ".join(found.recording.remarks)
    assert {g.unit for g in found.guesses.values()} == {"us", "mg"}
    right(path, gyro=False)


def test_the_turns_tell_a_unit_that_numbers_do_not(tmp_path):
    t, f, w = turned()
    columns = {"t": t, **{f"a{a}": f[:, i] for i, a in enumerate("xyz")},
               **{f"gyro_{a}": w[:, i] * D / 10 for i, a in enumerate("xyz")}}  # fmt: skip
    slow = {**columns, "t": t * 10}  # up to 18 deg/s, which could be rad/s by its size
    found = propose_recording([table(tmp_path / "slow.csv", slow)])
    assert {g.unit for g in found.guesses.values() if g.quantity == "angular_rate"} == {"deg/s"}
    golden_text(found.guesses["gyro_x"].why)


@pytest.mark.parametrize(("unit", "range_ratio"), [("g", 0.25), ("m/s^2", 2.0)])
def test_forces_read_in_another_range_are_counts_with_a_scale(tmp_path, unit, range_ratio):
    """Those of a telephone without gravity are not: they have no constant length."""
    t, f, w = turned()
    read = f / (G if unit == "g" else 1.0) * range_ratio
    columns = {
        "t": t,
        **{f"a{a}": read[:, i] for i, a in enumerate("xyz")},
        "gx": w[:, 0],
        "gy": w[:, 1],
        "gz": w[:, 2],
    }
    found = propose_recording([table(tmp_path / "r.csv", columns)])
    assert {g.unit for g in found.guesses.values() if g.quantity == "specific_force"} == {"count"}
    golden_text(found.guesses["ax"].why)
    stated = {name.replace("a", "acc_") + f" [{unit}]" * name.startswith("a"): x for name, x in columns.items()}
    with refused():
        propose_recording([table(tmp_path / "s.csv", stated)])
    shaken = np.random.default_rng(1).standard_normal((3, 500))
    shaken *= range_ratio * (1.0 if unit == "g" else G) / np.median(np.linalg.norm(shaken, axis=0))
    assert unit_of_force(list(shaken))[0] != "count"


@pytest.mark.parametrize(("scale", "offset"), [(300.0, 2048.0), (104.0, 505.0)])
def test_counts_of_a_converter_have_an_offset_that_no_bias_is(tmp_path, scale, offset):
    """Their length is near a thousand, as gravity is in mg, and differs from attitude to attitude."""
    t, f, w = turned()
    read = np.round(offset + scale * f / G)
    columns = {"t": t, **{f"a{a}": read[:, i] for i, a in enumerate("xyz")},
               **{f"g{a}": np.round(370 + 60 * w[:, i]) for i, a in enumerate("xyz")}}  # fmt: skip
    found = propose_recording([table(tmp_path / "adc.csv", columns)])
    assert {found.guesses[f"a{a}"].unit for a in "xyz"} == {"count"}
    walk = np.where(t[:, None] > t[-1] / 2, 0.4 * np.random.default_rng(1).standard_normal(f.shape), 0.003)
    assert unit_of_force(list((walk + np.array([0.0, 0.2, -0.97])).T))[0] == "g"  # half at rest, half in motion
    still = np.round(read[:200] - read[:200].mean(axis=0) + [580.0, 570.0, 570.0])
    assert unit_of_force(list(still.T))[0] == "mg"  # at rest the steps of a converter lie on a small sphere


def test_a_long_log_is_tried_by_means_and_proposed_whole(tmp_path, monkeypatch):
    t, f, w = turned()
    path = table(tmp_path / "log.csv", {"t": 1000 * t, "ax": f[:, 0], "ay": f[:, 1], "az": f[:, 2], "gx": w[:, 0],
                                        "gy": w[:, 1], "gz": w[:, 2]})  # fmt: skip
    whole = propose_recording([path])
    monkeypatch.setattr(proposal, "MAX_TRIAL_ROWS", len(t) // 3)
    again = propose_recording([path])
    assert again.guesses == whole.guesses
    assert again.notes == whole.notes
    assert len(again.recording.time) == len(t)
    np.testing.assert_array_equal(again.recording.position, whole.recording.position)


def test_means_of_successive_rows_leave_out_what_is_not_there():
    guesses = {"t": Guess("time", "", "s", ""), "f": Guess("specific_force", "x", "g", "")}
    log = Log({"t": np.arange(7.0), "f": np.array([1.0, np.nan, 3.0, np.nan, np.nan, np.nan, 9.0])}, guesses)
    few = log.thinned(3, 5)
    np.testing.assert_array_equal(few.columns["t"], [0.0, 3.0])
    np.testing.assert_array_equal(few.columns["f"], [2.0, np.nan])
    assert log.thinned(7, 5) is log
    assert len(log.thinned(1, 2).columns["t"]) == 3


def test_a_log_without_a_clock_is_asked_for_its_rate(tmp_path):
    _, f, _ = turned()
    path = table(tmp_path / "e.csv", {f"a{a}": f[:, i] for i, a in enumerate("xyz")})
    with refused():
        propose_recording([path])
    right(path, rate=50.0, gyro=False)


def test_a_log_without_gravity_and_its_sign_are_said(tmp_path):
    t, f, w = turned()
    columns = {"t": t, **{f"w{a}": w[:, i] for i, a in enumerate("xyz")}}
    linear = {f"Linear Acceleration {a} (m/s^2)": 0.01 * f[:, i] for i, a in enumerate("xyz")}
    with refused():
        propose_recording([table(tmp_path / "phone.csv", {**columns, **linear})])
    whole = {f"a{a}": f[:, i] for i, a in enumerate("xyz")}
    golden_text(propose_recording([table(tmp_path / "unit.csv", {**columns, **whole})]).notes["signs"])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a,b\n1,2\n",
        "t,ax,ay\n" + "".join(f"{k},1,2\n" for k in range(50)),
        "t,pos,ax,ay,az\n" + "".join(f"{k / 50},0,0,0,9.8\n" for k in range(900)),
    ],
)
def test_what_cannot_be_guessed_is_said(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with refused():
        propose_recording([path])


def test_names_of_many_loggers():
    said = {
        "accelerometer_x": ("specific_force", "x", ""), "GyroZ(dps)": ("angular_rate", "z", "deg/s"),
        "AccY (mg)": ("specific_force", "y", "mg"), "wx [rad/s]": ("angular_rate", "x", "rad/s"),
        "Temperature_C": ("temperature", "", "degC"), "gtemp": ("temperature", "", "degC"),
        "IMUTemp2 (K)": ("temperature", "", "K"), "meas.t": ("time", "", ""),
        "AngVX": ("angular_rate", "x", ""), "gFx": ("specific_force", "x", ""),
        "timestamp_ns": ("time", "", "ns"),
        "inner_deg": ("gimbal_angle", "inner", "deg"),
        "gyro_y_raw": ("angular_rate", "y", "count"), "acc_z_m/s^2": ("specific_force", "z", "m/s^2"),
        "pos": ("position", "", ""),
    }  # fmt: skip
    for name, wanted in said.items():
        g = by_name(name)
        assert g is not None, name
        assert (g.quantity, g.axis, g.unit) == wanted, name
    assert all(
        by_name(name) is None for name in ("mag_x", "note", "quality", "battery", "attempt", "s_x", "TID", "temp_raw")
    )
    assert plain_name("Acc_X [m/s^2]") == "acc_x_m_s2"


def test_the_command_writes_a_recording_that_can_be_corrected(command, capsys, tmp_path):
    t, f, w = turned()
    columns = {
        "time": t,
        **{f"a{a}": f[:, i] for i, a in enumerate("xyz")},
        **{f"w{a}": w[:, i] for i, a in enumerate("xyz")},
    }
    log, out = table(tmp_path / "imu.csv", columns), tmp_path / "out"
    assert command("new", log, "--out", out, "--json", "--quiet") == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["rests"], told["kind"]) == (10, "multi-position")
    assert sorted(p.name for p in out.iterdir()) == ["recording.toml", "rests.html", "samples.csv"]
    header = (out / "recording.toml").read_text()
    assert header.count("by its name") == 7
    assert tomllib.loads(header)["columns"]["gyro_x"]["unit"] == "rad/s"
    assert len(dwells(read(out))) == 10
    assert command("new", tmp_path / "none.csv") == 2


@pytest.mark.parametrize(("count", "zero"), [(3, 0.0), (5, 0.0), (6, 0.0), (6, 32768.0)])
def test_fewer_attitudes_than_a_calibration_takes_are_enough_for_noise(tmp_path, count, zero):
    """Counts about the middle of a converter's range all point one way."""
    rng = np.random.default_rng(4)
    faces = np.concatenate([np.eye(3), -np.eye(3)])[:count]
    f = np.concatenate([np.r_[np.tile(G * u, (300, 1)), rng.normal(0, G / 2, (60, 3))] for u in faces])
    f += rng.normal(0, 0.02, f.shape)
    f = np.round(zero + 400 * f) if zero else f
    log = table(tmp_path / "a.csv", {"t": 0.01 * np.arange(len(f)), **{f"a{a}": f[:, i] for i, a in enumerate("xyz")}})
    found = propose_recording([log])
    assert len(dwells(found.recording)) == count
    assert ("enough for `gimbalcal noise`" in found.notes["kind"]) == (count < 6)
