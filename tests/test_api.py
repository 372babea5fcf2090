"""`import gimbalcal` and what it offers: the commands as functions, and results that show themselves."""

import contextlib
import importlib
import inspect
import json
import re
import sys
import types
from dataclasses import replace
from datetime import datetime, timedelta
from html import escape
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import polars as pl
import pytest

import gimbalcal
from gimbalcal import CATALOGUE, api
from gimbalcal.cli import main  # noqa: F401  the command line loads beside it
from gimbalcal.errors import InputError
from gimbalcal.schedule import EIGHTEEN_POSITIONS
from tests.golden import golden_text, refused
from tests.guess.test_proposal import turned
from tests.paths import CONCEALED, DATA, DEVICE, STATIC, XSENS


def test_calibrate_is_the_command(command, capsys):
    made = gimbalcal.calibrate(XSENS)
    assert made.method == "multiposition"
    command("calibrate", XSENS, "--method", "multiposition", "--json", "--quiet")
    told = json.loads(capsys.readouterr().out)
    assert [p["value"] for p in told["parameters"]] == [p["value"] for p in made.to_dict()["parameters"]]
    again = gimbalcal.calibrate([gimbalcal.read(XSENS)], terms=["bias", "scale_factor"])
    assert {p.effect for p in again.parameters} <= {"bias", "scale_factor", "gyro_bias"}
    with refused():
        gimbalcal.calibrate([])


def test_a_calibration_shows_itself():
    made = gimbalcal.calibrate(XSENS, terms=["bias", "scale_factor"])
    assert "bias x" in str(made)
    assert " ± " in str(made)
    moved = replace(made, outcome="the table stood askew")
    assert "The table stood askew" in str(moved)  # what it says is of what it holds
    assert "askew" not in str(made)
    frame = made.to_frame()
    assert frame.columns == ["effect", "name", "axis", "value", "sigma", "prior_sigma", "unit"]
    assert len(frame) == len(made.parameters)
    figure = made.plot()
    assert figure._repr_png_().startswith(b"\x89PNG")  # what a notebook asks for
    drawn = [ax for ax in figure.axes if ax.get_visible()]
    assert [ax.get_title(loc="left") for ax in drawn][:1] == [
        f"{frame['name'][0].replace('_', ' ')} [{frame['unit'][0]}]"
    ]


def test_arrays_are_corrected_as_a_recording_is():
    r = gimbalcal.read(DEVICE)
    made = gimbalcal.calibrate(r)
    assert made.method == "three-stage"
    sensors = gimbalcal.Calibration(
        "t", tuple(e for e in made.effects if e.id in ("bias", "scale_factor")), (), np.zeros((0, 0)), (), made.residual
    )
    f = r.triad("specific_force")
    out = sensors.apply({"time": r.time, "specific_force": f})
    np.testing.assert_allclose(out["specific_force"], sensors.apply(r).triad("specific_force"), rtol=1e-14)
    with refused():
        sensors.apply({"time": r.time, "specific_force": f[:, :2]})


def test_arrays_are_corrected_in_their_own_units():
    """1 g is 1 m/s^2 to whoever does not ask: a bias of 5 mg would be taken off ten times too small."""
    rng = np.random.default_rng(3)
    unit = rng.standard_normal((40, 3))
    f = 9.8 * unit / np.linalg.norm(unit, axis=1)[:, None]
    w, t, warm = 0.1 * rng.standard_normal((40, 3)), np.arange(40.0), 20 + rng.random(40)
    effects = (
        CATALOGUE["bias"](b=np.full(3, 0.05)),
        CATALOGUE["gyro_bias"](epsilon=np.full(3, 1e-3)),
        CATALOGUE["bias_temperature"](b_T=np.full(3, 1e-3)),
    )
    residual = gimbalcal.calibrate(XSENS, terms=["bias"]).residual
    made = gimbalcal.Calibration("t", effects, (), np.zeros((0, 0)), (), residual)
    want = made.apply({"time": t, "specific_force": f, "angular_rate": w, "temperature": warm})
    units = {"time": "ms", "specific_force": "mg", "angular_rate": "deg/s", "temperature": "K"}
    given = {
        "time": 1e3 * t, "specific_force": f / 9.80665e-3, "angular_rate": np.degrees(w), "temperature": warm + 273.15,
    }  # fmt: skip
    got = made.apply(given, units=units)
    np.testing.assert_allclose(got["specific_force"] * 9.80665e-3, want["specific_force"], rtol=1e-12)
    np.testing.assert_allclose(np.radians(got["angular_rate"]), want["angular_rate"], rtol=1e-12)
    for factor in (9.80665, 9.80665e-3, 1e-2):
        with refused():
            made.apply({"specific_force": f / factor, "temperature": warm})
    free = {"time": t, "specific_force": f / 9.80665, "temperature": warm}  # nearly falling, and said to be so
    little = made.apply(free, units={"specific_force": "m/s^2"})
    np.testing.assert_allclose(np.linalg.norm(little["specific_force"] + 0.05, axis=1), 0.9993, rtol=0.01)
    fast = {"specific_force": f, "angular_rate": 400 * w, "temperature": warm}
    with refused():
        made.apply(fast)
    assert made.apply(fast, units={"angular_rate": "rad/s"})["angular_rate"].max() > 35
    with refused():
        made.apply({"specific_force": f}, units={"angular_rate": "deg/s"})
    with refused():
        made.apply({"specific_force": f}, units={"specific_force": "deg"})


def test_arrays_of_a_unit_that_counts():
    r = gimbalcal.read(XSENS)
    made = gimbalcal.calibrate(r, terms=["bias", "scale_factor", "misalignment"])
    arrays = {"time": r.time, "specific_force": r.triad("specific_force")}
    out = made.apply(arrays, units={"specific_force": "count"})
    np.testing.assert_allclose(np.linalg.norm(out["specific_force"], axis=1), 9.80665, atol=4e-3)
    np.testing.assert_array_equal(out["specific_force"], made.apply(r).triad("specific_force"))
    with refused():
        made.apply(arrays)


def test_diagnose_is_a_function_and_a_package():
    found = gimbalcal.diagnose(CONCEALED)
    assert found.verdict == "missing-physics"
    told = str(found).splitlines()
    assert "Next: use the calibration.json" in str(found)
    assert f"{100 * found.findings[0]['probability']:.3g} %" in told[0]
    golden_text(told[0])
    golden_text(told[-1])
    assert repr(found) == str(found)
    assert str(replace(found, in_words="Nothing of that.")).endswith("In numbers: Nothing of that.")
    assert "_" not in str(found.calibration).partition("\n\n")[0]  # names as the page has them, no ids
    frame = found.to_frame()
    assert frame["effect"][0] == found.findings[0]["effect"]
    assert len(found.plot().axes) == len(found.curves.channels)
    assert found.plot()._repr_png_().startswith(b"\x89PNG")
    assert gimbalcal.diagnose.Diagnosis is type(found)


def test_a_frame_without_words_is_guessed_as_a_log_is():
    t, f, w = turned()
    forces = {f"a{a} (g)": f[:, i] / 9.80665 for i, a in enumerate("xyz")}
    rates = {f"gyro_{a}": np.degrees(w[:, i]) for i, a in enumerate("xyz")}
    frame = {"timestamp_ms": 1e3 * t, **forces, **rates, "note": ["no number"] * len(t)}
    for given in (frame, pl.DataFrame(frame)):
        r = gimbalcal.from_frame(given, title="imu", site={"latitude": (48.0, "deg")})
        np.testing.assert_allclose(r.triad("angular_rate"), w, atol=1e-9)
        np.testing.assert_allclose(r.triad("specific_force"), f, atol=1e-9)
        assert r.site.latitude == pytest.approx(np.radians(48.0))
        assert "gyro_x is taken for angular rate x [deg/s]" in str(r)
        assert "left out: note" in str(r)
    dated = pl.DataFrame(frame).with_columns(
        timestamp_ms=(np.datetime64("2026-11-18T05:00") + np.round(1e9 * t).astype("timedelta64[ns]"))
    )
    np.testing.assert_allclose(np.diff(gimbalcal.from_frame(dated).time), np.diff(t), atol=1e-6)
    with refused():
        gimbalcal.from_frame(frame, noise={"accelerometer": (1.0, "ug")})
    with refused():
        gimbalcal.calibrate(pl.DataFrame(frame))
    with refused():
        gimbalcal.from_frame({"time": t, "price": f[:, 0], "rain": w[:, 0]})


def test_recordings_and_results_print_themselves_and_calibrations_are_read_again(tmp_path):
    r = gimbalcal.read(XSENS)
    assert str(r).startswith("multi-position recording 'Xsens")
    assert f"{len(r.time)} rows" in str(r)
    assert "specific_force x y z" in repr(r)
    assert len(str(r)) < 2000
    made = gimbalcal.calibrate(r, terms=["bias", "scale_factor"])
    made.write(str(tmp_path / "calibration.json"))
    again = gimbalcal.read_calibration(str(tmp_path / "calibration.json"))
    assert str(again) == str(made)
    with refused():
        gimbalcal.read(tmp_path / "calibration.json")
    (tmp_path / "log.csv").write_text("t,ax\n")
    with refused():
        gimbalcal.calibrate(tmp_path / "log.csv")
    with refused():
        made.apply(np.zeros((3, 3)))
    found = gimbalcal.diagnose(CONCEALED)
    found.write(str(tmp_path / "diagnosis.json"))
    assert json.loads((tmp_path / "diagnosis.json").read_text()) == found.to_dict()
    r.write(str(tmp_path / "again"))
    np.testing.assert_array_equal(gimbalcal.read(tmp_path / "again").triad("specific_force"), r.triad("specific_force"))


def test_the_package_shows_its_names_and_each_has_complete_types():
    names = dir(gimbalcal)
    assert names == sorted(gimbalcal.__all__)
    commands = ("calibrate", "diagnose", "navigate", "next_step", "noise", "observe", "simulate")
    for name in names:
        assert getattr(gimbalcal, name) is not None
    for name in commands:
        function = getattr(api, name)
        hints = get_type_hints(function)
        assert set(hints) == {*inspect.signature(function).parameters, "return"}
        assert Any not in hints.values()
    assert (Path(gimbalcal.__file__).parent / "py.typed").exists()


def test_pages_use_the_public_names():
    pages = [*(DATA.parent / "docs").glob("*.md"), *(DATA.parent / "docs" / "tutorials").glob("*.md")]
    used = {n for p in pages for n in re.findall(r"\bgimbalcal\.(\w+)\(", p.read_text(encoding="utf-8"))}
    assert {"calibrate", "diagnose", "from_arrays", "from_frame", "read_calibration", "navigate", "observe"} <= used
    assert used <= set(gimbalcal.__all__)


def test_a_frame_is_corrected_in_its_own_units_and_keeps_what_else_it_holds():
    t, f, w = turned()
    forces = {f"a{a} (g)": f[:, i] / 9.80665 for i, a in enumerate("xyz")}
    rates = {f"gyro_{a}": np.degrees(w[:, i]) for i, a in enumerate("xyz")}
    frame = pl.DataFrame({"note": ["as logged"] * len(t), "timestamp_ms": 1e3 * t, **forces, **rates})
    residual = gimbalcal.calibrate(XSENS, terms=["bias"]).residual
    effects = (
        CATALOGUE["bias"](b=np.array([0.05, -0.03, 0.02])),
        CATALOGUE["gyro_scale_factor"](s=np.array([1e-3, -2e-3, 0.0])),
    )
    made = gimbalcal.Calibration("t", effects, (), np.zeros((0, 0)), (), residual)
    want = made.apply({"time": t, "specific_force": f, "angular_rate": w})
    described = {"timestamp_ms": "time [ms]", **{name: f"specific_force {name[1]} [g]" for name in forces}}
    described |= {name: f"angular_rate {name[-1]} [deg/s]" for name in rates}
    frames = [frame]
    with contextlib.suppress(ImportError):
        frames.append(importlib.import_module("pandas").DataFrame(frame.to_dict(as_series=False)))
    for given in frames:
        for columns in (None, described):
            got = made.apply(given, columns=columns)
            assert type(got) is type(given)
            assert list(got.columns) == list(given.columns)
            assert list(got["note"]) == list(given["note"])
            for i, a in enumerate("xyz"):
                np.testing.assert_allclose(9.80665 * np.asarray(got[f"a{a} (g)"]), want["specific_force"][:, i], 1e-12)
                np.testing.assert_allclose(np.radians(got[f"gyro_{a}"]), want["angular_rate"][:, i], 1e-9, 1e-15)
            np.testing.assert_array_equal(np.asarray(given["ax (g)"]), forces["ax (g)"])  # the given one is as it was
    assert made.apply(frame.head(1)).shape == (1, 8)
    with refused():
        made.apply(frame, columns={"ax": "specific_force x [g]"})
    with refused():
        made.apply(frame, units={"specific_force": "g"})
    with refused():
        made.apply(frame.select("note", "timestamp_ms"))
    holed = frame.with_columns(
        pl.when(pl.int_range(pl.len()) == 4).then(None).otherwise(pl.col("ay (g)")).alias("ay (g)")
    )
    with refused():
        made.apply(holed, columns={name: f"specific_force {name[1]} [g]" for name in forces})


def test_a_clock_of_dates_corrects_a_frame_as_a_clock_of_seconds_does():
    effects = (CATALOGUE["bias"](b=np.array([0.05, -0.03, 0.02])),)
    residual = gimbalcal.calibrate(XSENS, terms=["bias"]).residual
    made = gimbalcal.Calibration("t", effects, (), np.zeros((0, 0)), (), residual)
    t, f = np.arange(30.0), np.tile([0.1, 0.2, 9.8], (30, 1))
    frame = pl.DataFrame({"time": t, **{f"acc_{a}": f[:, i] for i, a in enumerate("xyz")}})
    columns = {"time": "time [s]", **{f"acc_{a}": f"specific_force {a}" for a in "xyz"}}
    want = made.apply(frame, columns=columns)
    stamp = pl.Series("time", [datetime(2026, 11, 18) + timedelta(seconds=x) for x in t])  # noqa: DTZ001  it names no zone
    clocks = (stamp, stamp.dt.replace_time_zone("Europe/Berlin"), stamp.dt.time(), stamp.dt.to_string("iso:strict"))
    for clock in clocks:
        for described in (None, columns):
            got = made.apply(frame.with_columns(clock), columns=described)
            np.testing.assert_allclose(got["acc_x"], want["acc_x"], rtol=1e-12)
    with refused():
        made.apply(frame.with_columns(pl.lit("noon").alias("time")), columns=columns)
    with refused():
        made.apply(frame.with_columns(pl.lit("9.8 m/s^2").alias("acc_x")), columns=columns)
    with refused():
        made.apply(frame.lazy(), columns=columns)


def test_one_name_or_file_is_a_sequence_of_it(tmp_path):
    device = gimbalcal.read(DEVICE)
    one = gimbalcal.next_step(device, separate="cubic_nonlinearity:z", most=1)
    assert one.separate == ("cubic_nonlinearity:z",)
    named, given = (gimbalcal.next_step(device, reach=x, most=1).target for x in ("wu2018-18", EIGHTEEN_POSITIONS))
    np.testing.assert_array_equal(named, given)
    missing = str(tmp_path / "cal.json")
    with pytest.raises(InputError, match="cal"):
        gimbalcal.navigate(STATIC, missing)


def test_tables_are_frames_of_polars_or_of_pandas(monkeypatch):
    made = gimbalcal.calibrate(XSENS, terms=["bias"])
    with refused():
        made.to_frame("arrow")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with refused():
        made.to_frame("pandas")
    fake = types.SimpleNamespace(DataFrame=dict)
    monkeypatch.setitem(sys.modules, "pandas", fake)
    assert made.to_frame("pandas")["axis"] == ["x", "y", "z"]


def test_plans_noise_and_navigation_are_functions_and_show_themselves():
    """In a notebook: the text of the console and a drawing."""
    simulated, truth = gimbalcal.simulate("demo", seed=3)
    assert {e.id for e in truth} >= {"bias", "scale_factor"}
    static = STATIC
    made = gimbalcal.calibrate([simulated])
    navigation = gimbalcal.navigate(static, {"mine": made}, samples=2)
    assert [p.calibration for p in navigation.position] == ["none", "mine"]
    series = navigation.to_frame()
    assert series["position"].max() == pytest.approx(navigation.position[1].max_nmi, rel=1e-3)
    assert series["position, none"].max() == pytest.approx(navigation.position[0].max_nmi, rel=1e-3)
    schedule = gimbalcal.observe(gimbalcal.EIGHTEEN_POSITIONS, angle_sigma=1.0)
    turns = gimbalcal.observe("jia2014-9", states="bias,gyro_bias")
    noise = gimbalcal.noise(static)
    assert noise.to_frame()["coefficient"][0] == "white_noise"
    assert "accelerometer = {" in str(noise)
    following = gimbalcal.next_step(simulated)
    assert following.to_frame()["seconds"][0] == following.steps[0].seconds
    shown = (
        simulated,
        made,
        navigation,
        schedule,
        turns,
        noise,
        following,
        gimbalcal.diagnose(CONCEALED),
    )
    for result in shown:
        page = result._repr_html_()
        assert page.startswith("<pre")
        assert escape(str(result)) in page
        assert page.rstrip().endswith("</svg>")
        assert len(result.to_frame()) > 2 or result is shown[-1]
    read_again = replace(shown[-1], curves=None)  # nothing to draw, so only the text
    assert "<svg" not in read_again._repr_html_()
    with refused():
        gimbalcal.observe("jia2014-9", candidates=["cross_coupling"])
