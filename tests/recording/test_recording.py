"""The recording folder: what is read, what is refused and in which words, and that writing loses nothing."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gimbalcal.earth import G0, normal_gravity
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import BENCH, SPACE_STABLE, SPACE_STABLE_INERTIAL, Axis, Platform
from gimbalcal.recording import Recording, Site, dwells, read, write
from gimbalcal.recording.scatter import pooled

HEADER = """\
format = 1
kind = "multi-position"
title = "two positions"
samples = "samples.csv"

[site]
latitude = { value = 40.0, unit = "deg" }
gravity  = { value = 9.80146, unit = "m/s^2" }

[platform]
name = "space-stable"

[noise]
accelerometer = { value = 100.0, unit = "ug" }

[columns]
time_s   = { quantity = "time", unit = "s" }
position = { quantity = "position" }
accel_x  = { quantity = "specific_force", axis = "x", unit = "g" }
accel_y  = { quantity = "specific_force", axis = "y", unit = "g" }
accel_z  = { quantity = "specific_force", axis = "z", unit = "g" }
middle   = { quantity = "gimbal_angle", axis = "middle", unit = "deg" }
temp     = { quantity = "temperature", unit = "K" }
"""
NAMES = ["time_s", "position", "accel_x", "accel_y", "accel_z", "middle", "temp"]
DWELL = 40


def rows(seed: int = 1) -> Array:
    """Two dwells of 40 s at 1 Hz: z down, then x up; 100 ug of noise."""
    rng = np.random.default_rng(seed)
    time = np.concatenate([np.arange(DWELL), 100 + np.arange(DWELL)])
    position = np.repeat([1, 2], DWELL)
    force = np.repeat([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], DWELL, axis=0) + 1e-4 * rng.standard_normal((2 * DWELL, 3))
    middle = np.repeat([0.0, 90.0], DWELL)
    return np.column_stack([time, position, force.round(7), middle, np.full(2 * DWELL, 295.15)])


def text(table: Array, names: list[str] = NAMES) -> str:
    return "\n".join([",".join(names), *(",".join(repr(float(v)) for v in row) for row in table)]) + "\n"


def folder(path: Path, header: str = HEADER, samples: str | None = None) -> Path:
    """A recording folder on disk."""
    target = path / "rec"
    target.mkdir(exist_ok=True)
    (target / "recording.toml").write_text(header, encoding="utf-8")
    (target / "samples.csv").write_text(text(rows()) if samples is None else samples, encoding="utf-8")
    return target


def refusal(path: Path, header: str = HEADER, samples: str | None = None) -> str:
    """The sentence with which the recording is refused, less the path of the folder."""
    target = folder(path, header, samples)
    with pytest.raises(InputError) as caught:
        read(target)
    return str(caught.value).replace(f"{target}/", "")


def changed(row: int, column: str, value: float | str) -> str:
    """The samples with one cell changed (row from 0)."""
    lines = text(rows()).splitlines()
    cells = lines[row + 1].split(",")
    cells[NAMES.index(column)] = str(value)
    lines[row + 1] = ",".join(cells)
    return "\n".join(lines) + "\n"


# --- what is read ---------------------------------------------------------------------------------------------------


def test_everything_comes_out_in_si(tmp_path: Path) -> None:
    target = folder(tmp_path)
    recording = read(target)
    table = rows()
    assert recording.kind == "multi-position"
    assert recording.title == "two positions"
    assert recording.platform == SPACE_STABLE
    assert recording.site == Site(np.radians(40.0), 0.0, 9.80146)
    assert recording.noise == {"accelerometer": pytest.approx(100e-6 * G0)}
    np.testing.assert_array_equal(recording.time, table[:, 0])
    np.testing.assert_allclose(recording.triad("specific_force"), table[:, 2:5] * G0, rtol=1e-15)
    np.testing.assert_allclose(recording.angles()[:, 2], np.radians(table[:, 5]), rtol=1e-15)
    np.testing.assert_array_equal(recording.angles()[:, [0, 1, 3]], 0.0)  # axes that were not logged
    np.testing.assert_allclose(recording.channels["temperature", ""], 22.0, rtol=1e-12)
    assert recording.units["specific_force", "x"] == "g"
    assert recording.has("temperature")
    assert not recording.has("angular_rate")
    assert [(d.position, d.start, d.stop) for d in dwells(recording)] == [(1, 0, 40), (2, 40, 80)]
    assert np.all(recording.weight == 1.0)
    assert recording.remarks == ()


def test_a_sensor_that_counts_backwards(tmp_path: Path) -> None:
    header = HEADER.replace('axis = "z", unit = "g"', 'axis = "z", unit = "g", sign = -1')
    right = read(folder(tmp_path))
    backwards = read(folder(tmp_path, header))
    z = ("specific_force", "z")
    np.testing.assert_array_equal(backwards.channels[z], -right.channels[z])
    assert backwards.scatter[z] == right.scatter[z]
    for sign in ("2", "true", '"-"'):
        assert "the sign of column 'accel_z' is" in refusal(tmp_path, header.replace("sign = -1", f"sign = {sign}"))


def test_sources_carry_their_digest(tmp_path: Path) -> None:
    target = folder(tmp_path)
    source = {Path(s.path).name: s.sha256 for s in read(target).source}
    for name in ("recording.toml", "samples.csv"):
        assert source[name] == hashlib.sha256((target / name).read_bytes()).hexdigest()


def test_gravity_from_latitude_where_it_is_absent(tmp_path: Path) -> None:
    header = re.sub(r"gravity .*\n", 'height = { value = 60.0, unit = "m" }\n', HEADER)
    site = read(folder(tmp_path, header)).site
    assert site.gravity == pytest.approx(float(normal_gravity(np.radians(40.0), 60.0)), rel=1e-15)


def test_standard_gravity_is_remarked(tmp_path: Path) -> None:
    header = re.sub(r"(gravity|latitude) .*\n", "", HEADER)
    recording = read(folder(tmp_path, header))
    assert recording.site.gravity == G0
    assert "neither gravity nor latitude is given in [site]; standard gravity 9.80665 m/s^2" in recording.remarks[0]


def test_numpy_scalar_in_the_header_is_read_with_a_remark(tmp_path: Path) -> None:
    header = HEADER.replace("value = 100.0, unit", "value = np.float64(1e2), unit")
    recording = read(folder(tmp_path, header))
    assert recording.noise["accelerometer"] == pytest.approx(100e-6 * G0)
    assert "line 14: a NumPy scalar was printed where a number belongs" in recording.remarks[0]


def test_a_static_run_of_the_space_stable_platform_reads_inertial_angles(tmp_path: Path) -> None:
    header = HEADER.replace("multi-position", "static-run")
    assert read(folder(tmp_path, header)).platform == SPACE_STABLE_INERTIAL


def test_axes_spelled_out(tmp_path: Path) -> None:
    axes = """\
name = "own"
[[platform.axes]]
name = "middle"
direction = "y"
sign = -1
offset = { value = 90.0, unit = "deg" }
"""
    header = HEADER.replace('name = "space-stable"\n', axes)
    assert read(folder(tmp_path, header)).platform == Platform("own", (Axis("middle", "y", -1, np.pi / 2),))


def test_comments_blank_ends_and_other_columns_do_not_matter(tmp_path: Path) -> None:
    lines = text(rows()).splitlines()
    noted = ["# logged by hand", lines[0] + ",note", *(line + ",ok" for line in lines[1:]), "", ""]
    np.testing.assert_array_equal(
        read(folder(tmp_path, samples="\n".join(noted))).triad("specific_force"),
        read(folder(tmp_path)).triad("specific_force"),
    )


def test_csv_and_parquet_are_the_same(tmp_path: Path) -> None:
    recording = read(folder(tmp_path))
    again = read(write(recording, tmp_path / "parquet", samples="rows.parquet"))
    for key, values in recording.channels.items():
        np.testing.assert_allclose(again.channels[key], values, rtol=4e-16)


def test_sigma_is_the_header_or_else_the_scatter(tmp_path: Path) -> None:
    assert read(folder(tmp_path)).sigma("accelerometer") == pytest.approx(100e-6 * G0)
    header = re.sub(r"accelerometer .*\n", "", HEADER)
    seen = read(folder(tmp_path, header)).sigma("accelerometer")
    # 3 axes x 74 third differences; their relative scatter is about sqrt(1/2/222 * 462/200) = 7 %: within 4 sigma
    assert seen == pytest.approx(100e-6 * G0, rel=0.28)
    assert read(folder(tmp_path)).sigma("gimbal_angle") is None


# --- averaging ------------------------------------------------------------------------------------------------------


def test_blocks_start_anew_in_each_position(tmp_path: Path) -> None:
    recording = read(folder(tmp_path), average_s=25.0)
    assert recording.weight.tolist() == [25, 15, 25, 15]
    assert recording.position is not None
    assert recording.position.tolist() == [1, 1, 2, 2]
    table = rows()
    np.testing.assert_allclose(recording.time, [12.0, 32.0, 112.0, 132.0], rtol=1e-15)
    np.testing.assert_allclose(recording.triad("specific_force")[0], table[:25, 2:5].mean(axis=0) * G0, rtol=1e-13)


def test_blocks_cross_batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = folder(tmp_path)
    whole = read(target, average_s=25.0)
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", 7)
    parts = read(target, average_s=25.0)
    assert parts.weight.tolist() == whole.weight.tolist()
    np.testing.assert_allclose(parts.triad("specific_force"), whole.triad("specific_force"), rtol=1e-14)
    np.testing.assert_array_equal(parts.position, whole.position)


@pytest.mark.parametrize("batch", [3, 1000])
def test_angles_average_across_the_wrap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int) -> None:
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", batch)
    table = rows()
    table[:DWELL, 5] = np.where(np.arange(DWELL) % 2, 1.0, 359.0)  # a mean of 0, not of 180
    middle = read(folder(tmp_path, samples=text(table)), average_s=1000.0).angles()[:, 2]
    turned = (middle[0] + np.pi) % (2 * np.pi) - np.pi
    assert turned == pytest.approx(0.0, abs=1e-12)
    assert middle[1] == pytest.approx(np.pi / 2, abs=1e-12)


def test_no_block_reaches_across_a_gap(tmp_path: Path) -> None:
    header = HEADER.replace("multi-position", "static-run").replace('position = { quantity = "position" }\n', "")
    recording = read(folder(tmp_path, header), average_s=1000.0)
    assert recording.weight.tolist() == [DWELL, DWELL]
    assert recording.position is None


def test_averaging_twice_is_averaging_once(tmp_path: Path) -> None:
    target = folder(tmp_path)
    tens = write(read(target, average_s=10.0), tmp_path / "tens")
    twice, once = read(tens, average_s=40.0), read(target, average_s=40.0)
    assert twice.weight.tolist() == once.weight.tolist() == [40, 40]
    np.testing.assert_allclose(twice.triad("specific_force"), once.triad("specific_force"), rtol=1e-14)


def test_scatter_sees_noise_and_not_the_sidereal_wave() -> None:
    rng = np.random.default_rng(3)
    time = 60.0 * np.arange(2880)
    sigma = 6e-5  # m/s^2, under a wave of 7.5 m/s^2
    force = 7.5 * np.cos(7.292115e-5 * time) + sigma * rng.standard_normal(2880)
    seen = pooled(time, None, {("specific_force", "x"): force})["specific_force", "x"]
    assert seen == pytest.approx(sigma, rel=0.08)  # 4 sigma of 2877 overlapping third differences (2 % each)


# --- refusals: the header -------------------------------------------------------------------------------------------

HEADER_FAULTS: list[tuple[str, str, str]] = [
    ("format = 1", "format = 2", "recording.toml, line 1: format must be 1, got 2"),
    (
        '"multi-position"',
        '"tumble"',
        "recording.toml, line 2: kind must be one of multi-position, static-run, rotation or",
    ),
    ('"two positions"', '"two positions', "recording.toml, line 3, column"),
    ("[site]", "[sites]", "'sites' is not known; write one of format, kind, title, samples, site, platform, noise"),
    ("latitude = {", "latitud = {", "recording.toml, line 7: 'latitud' in [site] is not known; write one of latitude,"),
    (
        '{ value = 40.0, unit = "deg" }',
        "40.0",
        "line 7: latitude needs a number and its unit, write latitude = { value",
    ),
    ("value = 40.0", "value = 95.0", "line 7: latitude 95.0 deg is beyond 90 deg; give it between -90 and 90 deg"),
    ('40.0, unit = "deg"', '40.0, unit = "rad"', "line 7: latitude 40.0 rad is beyond 90 deg"),
    ("value = 40.0", "value = nan", "line 7: the value of latitude must be a finite number, got nan"),
    ("9.80146", "980.146", "line 8: gravity 980.146 m/s^2 is not found on the Earth (9.76 to 9.84 m/s^2)"),
    (
        '"space-stable"',
        '"stable-space"',
        "line 11: the platform 'stable-space' is not known; write one of space-stable,",
    ),
    ('"ug"', '"count"', "line 14: the noise of the accelerometer is in count, its columns are not"),
    ('"ug"', '"deg"', "line 14, accelerometer: 'deg' is not a unit of specific_force; give the specific_force in m/s"),
    ("value = 100.0", "value = -1.0", "line 14: the noise of the accelerometer is a sigma and cannot be negative"),
    ("accelerometer =", "accel =", "line 14: 'accel' in [noise] is not known; write one of accelerometer, gyroscope,"),
    (
        ', axis = "x", unit = "g"',
        ', axis = "x"',
        "line 19: column 'accel_x' has no unit; write, for example, unit = \"m/s^2\"",
    ),
    (
        'axis = "x", unit = "g"',
        'axis = "x", unit = "gee"',
        "line 19, column 'accel_x': the unit 'gee' is not known; give the",
    ),
    (
        'axis = "x", unit = "g"',
        'axis = "x", unit = "K"',
        "line 19, column 'accel_x': 'K' is not a unit of specific_force",
    ),
    (
        'axis = "x", unit = "g"',
        'axis = "x", unit = 9.8',
        "line 19: the unit of column 'accel_x' must be a text such as",
    ),
    (
        'axis = "x", unit = "g"',
        'axis = "x", unit = "count"',
        "the specific_force columns mix counts or pulses with physical",
    ),
    ('axis = "y"', 'axis = "x"', "line 20: columns 'accel_x' and 'accel_y' are both specific_force x; keep one"),
    ('axis = "y"', 'axis = "w"', "line 20: column 'accel_y' has axis 'w'; a specific_force has axis x, y or z"),
    (
        'axis = "middle"',
        'axis = "tilt"',
        "line 22: column 'middle' has axis 'tilt'; a gimbal_angle has axis platform, inner",
    ),
    (
        '"temperature"',
        '"warmth"',
        "line 23: the quantity 'warmth' of column 'temp' is not known; write one of time, pos",
    ),
    ('time_s   = { quantity = "time", unit = "s" }\n', "", "line 16: no column is the time; write time_s = { quantity"),
    ("samples.csv", "../samples.csv", "line 4: samples = '../samples.csv' leaves the folder of the recording; put the"),
    ("samples.csv", "/etc/hosts.csv", "line 4: samples = '/etc/hosts.csv' leaves the folder of the recording"),
    ("samples.csv", "samples.xls", "line 4: samples = 'samples.xls' must end in .csv or .parquet; `gimbalcal import`"),
    ("samples.csv", "none.csv", "line 4: the samples file none.csv does not exist; put it there or correct its name"),
    (
        "accel_y  =",
        "accel_v  =",
        "samples.csv has no column 'accel_v', which [columns] of recording.toml names; it has 'ti",
    ),
    (
        '"space-stable"',
        '"bench"',
        "column 'middle' is a gimbal_angle, and the platform 'bench' has no axes; name the pla",
    ),
]


@pytest.mark.parametrize(("old", "new", "sentence"), HEADER_FAULTS, ids=[fault[2][:60] for fault in HEADER_FAULTS])
def test_header_fault_is_refused(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    assert old in HEADER
    said = refusal(tmp_path, HEADER.replace(old, new, 1))
    assert sentence in said
    assert "\n" not in said


def test_static_run_without_latitude_is_refused(tmp_path: Path) -> None:
    header = re.sub(r"latitude .*\n", "", HEADER.replace("multi-position", "static-run"))
    assert "line 6: a static run needs the latitude, because the Earth turns" in refusal(tmp_path, header)


def test_no_folder_no_header(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is not a folder: a recording is a folder with a recording\.toml in it"):
        read(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"has no recording\.toml: a recording is a folder with a"):
        read(tmp_path)


def test_link_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    target = folder(tmp_path)
    (target / "samples.csv").rename(tmp_path / "elsewhere.csv")
    (target / "samples.csv").symlink_to(tmp_path / "elsewhere.csv")
    with pytest.raises(InputError, match=r"samples = 'samples\.csv' leaves the folder of the recording"):
        read(target)


# --- refusals: the rows ---------------------------------------------------------------------------------------------


def stuck(table: Array) -> None:
    table[10:35, 3] = table[10, 3]


def dead(table: Array) -> None:
    table[:, 3] = 0.0


def stopped_clock(table: Array) -> None:
    table[12, 0] = table[11, 0]


def clock_back(table: Array) -> None:
    table[20:, 0] -= 100.0


def clock_forward(table: Array) -> None:
    table[20:, 0] += 3600.0


def inf_run(table: Array) -> None:
    table[5:9, 2] = np.inf


def spike(table: Array) -> None:
    table[[6, 50], 2] = 4000.0


def half_position(table: Array) -> None:
    table[3, 1] = 1.5


ROW_FAULTS: list[tuple[Callable[[Array], object], str]] = [
    (inf_run, "samples.csv, line 7, column accel_x: the value is empty or not a finite number, nor are the 3 below it"),
    (
        stopped_clock,
        "samples.csv, line 14, column time_s: the clock stands still at 11 s; time must grow from row to row",
    ),
    (clock_back, "samples.csv, line 22, column time_s: the clock jumps back by 99 s at -80 s; time must grow"),
    (
        clock_forward,
        "samples.csv, line 22, column time_s: the clock jumps forward by 3601 s within one position, whose",
    ),
    (
        spike,
        "samples.csv, line 8, column accel_x: 4000 g is beyond anything that a unit at rest can read (one of 2 such",
    ),
    (half_position, "samples.csv, line 5, column position: a position is a whole number, 1, 2, ... or 0 while moving"),
    (stuck, "samples.csv, lines 12 to 36, column accel_y: all 25 rows read "),
    (stuck, "although the noise is 8.9e-05 g, so the channel is frozen; leave those rows out, or correct [noise]"),
    (
        dead,
        "column accel_y: all 80 rows read 0 g although the noise is 8.9e-05 g, so the channel is dead; leave its",
    ),
    (
        lambda table: table[:, 4].clip(-0.99995, out=table[:, 4]),
        "column accel_z: -0.99995 g is the smallest value of the",
    ),
]


@pytest.mark.parametrize(("fault", "sentence"), ROW_FAULTS, ids=[fault[1][:70] for fault in ROW_FAULTS])
def test_row_fault_is_refused(tmp_path: Path, fault: Callable[[Array], object], sentence: str) -> None:
    table = rows()
    fault(table)
    said = refusal(tmp_path, samples=text(table))
    assert sentence in said
    assert "\n" not in said


CLOCK = 'quantity = "time", unit = "s"'


def test_a_clock_of_stated_coarseness_may_stamp_rows_alike(tmp_path: Path) -> None:
    table = rows()
    table[:, 0] = np.floor(table[:, 0] / 3) * 3
    assert "or state how coarse it is, as resolution beside its unit" in refusal(tmp_path, samples=text(table))
    stated = HEADER.replace(CLOCK, f"{CLOCK}, resolution = 3")
    made = read(folder(tmp_path, stated, text(table)))
    np.testing.assert_array_equal(made.time, table[:, 0])
    assert any("rows stamped as the one before, and taken in the order of the file" in r for r in made.remarks)
    table[7, 0] -= 3.0
    assert "the clock jumps back by 3 s" in refusal(tmp_path, stated, text(table))
    for value, sentence in [('"fine"', "must be a positive number"), ("-1", "must be a positive number")]:
        assert sentence in refusal(tmp_path, HEADER.replace(CLOCK, f"{CLOCK}, resolution = {value}"))


STARS = """\
format = 1
kind = "pointing"
[platform]
name = "alt-az"
[columns]
t = { quantity = "time", unit = "h" }
el = { quantity = "gimbal_angle", axis = "elevation", unit = "deg" }
az = { quantity = "gimbal_angle", axis = "azimuth", unit = "deg" }
tel = { quantity = "true_angle", axis = "elevation", unit = "deg" }
taz = { quantity = "true_angle", axis = "azimuth", unit = "deg" }
"""


def test_stars_may_be_stamped_alike_and_pause_for_days(tmp_path: Path) -> None:
    stamps = [0.0, 0.1, 0.1, 0.1, 0.2, 43.9, 43.9]
    lines = [f"{t},{30 + i},{20 * i},{30.1 + i},{20 * i}" for i, t in enumerate(stamps)]
    made = read(folder(tmp_path, STARS, "\n".join(["t,el,az,tel,taz", *lines, ""])))
    np.testing.assert_allclose(made.time, 3600 * np.array(stamps))
    assert any("3 rows stamped as the one before" in r for r in made.remarks)


@pytest.mark.parametrize("batch", [11, 50_000])
def test_row_numbers_hold_across_batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int) -> None:
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", batch)
    table = rows()
    inf_run(table[30:])
    assert "samples.csv, line 37, column accel_x" in refusal(tmp_path, samples=text(table))


def test_cells_that_are_not_numbers(tmp_path: Path) -> None:
    said = refusal(tmp_path, samples=changed(7, "accel_z", "off"))
    assert said == "samples.csv, line 9, column accel_z: 'off' is not a number; write a number there"
    assert "line 3, column time_s: the value is empty" in refusal(tmp_path, samples=changed(1, "time_s", ""))
    assert "line 4: 8 values where the first line names 7 columns" in refusal(
        tmp_path, samples=changed(2, "accel_y", "0,1")
    )
    units = text(rows()).replace("\n", "\ns,,g,g,g,deg,K\n", 1)
    assert "line 2, column time_s: 's' is not a number" in refusal(tmp_path, samples=units)


@pytest.mark.parametrize("batch", [11, 50_000])
def test_rows_without_a_value_are_left_out_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int
) -> None:
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", batch)
    table = rows()
    table[5:9, 2] = np.nan
    table[30, [2, 3]] = np.nan
    whole = text(table).splitlines()
    broken = [*whole[:61], whole[61].replace("1.0", "", 1), *whole[62:], "140,2,1.0"]  # an empty cell, a line cut short
    broken[61] = ",".join([*whole[61].split(",")[:4], "NA", *whole[61].split(",")[5:]])
    read_back = read(folder(tmp_path, samples="\n".join(broken)))
    gone = [5, 6, 7, 8, 30, 60]
    np.testing.assert_array_equal(read_back.time, np.delete(table[:, 0], gone))
    (told,) = read_back.remarks
    where = "lines 7 to 10, line 32, line 62 and 1 more place: 7 rows of 81 are left out, empty in "
    assert told.endswith(f"samples.csv, {where}accel_x (5), accel_y (2), accel_z (2), middle (1), temp (1)")
    broken[70] = broken[70].replace("1.0", "inf")
    assert "samples.csv, line 71, column" in refusal(tmp_path, samples="\n".join(broken))


def test_a_pause_of_days_is_told(tmp_path: Path) -> None:
    table = rows()
    table[40:, 0] += 2 * 86400
    read_back = read(folder(tmp_path, samples=text(table)))
    assert [(d.position, d.start, d.stop) for d in dwells(read_back)] == [(1, 0, 40), (2, 40, 80)]
    assert read_back.remarks[0].endswith(
        "samples.csv, line 42, column time_s: the clock pauses for 2 d; both sides are one recording"
    )


def test_dates_across_a_zone_and_midnight(tmp_path: Path) -> None:
    table = rows()
    lines = text(table).splitlines()
    stamps = [f"2026-12-31T23:59:{s:02d}.{k}+02:00" for s in range(40, 60) for k in (0, 5)]
    stamps += [f"20270101T0001{s:02d}.{k}+0200" for s in range(20) for k in ("25", "75")]
    dated = [lines[0], *(",".join([t, *line.split(",")[1:]]) for t, line in zip(stamps, lines[1:], strict=True))]
    header = HEADER.replace('"time", unit = "s"', '"time", unit = "ISO 8601"')
    read_back = read(folder(tmp_path, header, "\n".join(dated)))
    np.testing.assert_array_equal(np.diff(read_back.time)[[0, 39, 40]], [0.5, 60.75, 0.5])
    assert read_back.remarks[0].endswith("column time_s: dates, taken as seconds since 2026-12-31 00:00 UTC")
    said = refusal(tmp_path, header, "\n".join([*dated[:9], dated[9].replace("+02:00", ""), *dated[10:]]))
    assert "line 10, column time_s: '2026-12-31T23:59:44.0' names no zone, others do; correct it" in said
    said = refusal(tmp_path, header)
    assert "line 2, column time_s: '0.0' is not a date and time of ISO 8601, as [columns] says" in said


def test_line_numbers_count_comments(tmp_path: Path) -> None:
    said = refusal(tmp_path, samples="# a\n# b\n" + changed(7, "accel_z", "inf"))
    assert said.startswith("samples.csv, line 11, column accel_z: the value is empty or not a finite number;")


def test_other_separators_are_named(tmp_path: Path) -> None:
    assert "separate its columns by commas, not ';'" in refusal(tmp_path, samples=text(rows()).replace(",", ";"))


def test_empty_files(tmp_path: Path) -> None:
    assert refusal(tmp_path, samples="").startswith("samples.csv is empty; it must hold a line of column names and")
    assert refusal(tmp_path, samples=",".join(NAMES) + "\n") == "samples.csv has a line of column names and no rows"


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.999])
def test_truncated_parquet(tmp_path: Path, keep: float) -> None:
    target = write(read(folder(tmp_path)), tmp_path / "cut", samples="samples.parquet")
    whole = (target / "samples.parquet").read_bytes()
    (target / "samples.parquet").write_bytes(whole[: int(keep * len(whole))])
    with pytest.raises(InputError, match=r"samples\.parquet cannot be read as Parquet, it seems to be cut short or"):
        read(target)


def test_rows_of_parquet_are_counted_from_one(tmp_path: Path) -> None:
    import polars as pl

    target = write(read(folder(tmp_path)), tmp_path / "rec2", samples="samples.parquet")
    frame = pl.read_parquet(target / "samples.parquet")
    values = frame["accel_x"].to_numpy().copy()
    values[5] = np.inf
    frame.with_columns(accel_x=values).write_parquet(target / "samples.parquet")
    with pytest.raises(
        InputError, match=r"samples\.parquet, row 6, column accel_x: the value is empty or not a finite"
    ):
        read(target)


def test_degrees_called_radians(tmp_path: Path) -> None:
    said = refusal(tmp_path, HEADER.replace('axis = "middle", unit = "deg"', 'axis = "middle", unit = "rad"'))
    assert said.startswith('samples.csv, column middle: angles up to 90 rad look like degrees; write unit = "deg"')


def test_a_noiseless_recording_is_not_frozen(tmp_path: Path) -> None:
    table = rows()
    table[:, 2:5] = table[:, 2:5].round()
    header = re.sub(r"accelerometer .*\n", "", HEADER)
    assert read(folder(tmp_path, header, text(table))).scatter["specific_force", "x"] == 0.0


def test_a_dead_channel_is_seen_without_stated_noise(tmp_path: Path) -> None:
    table = rows()
    dead(table)
    said = refusal(tmp_path, re.sub(r"accelerometer .*\n", "", HEADER), text(table))
    assert "samples.csv, lines 2 to 81, column accel_y: all 80 rows read 0 g although the noise is" in said


def test_noise_stated_too_high_freezes_nothing(tmp_path: Path) -> None:
    table = rows()
    table[:, 2:5] = (table[:, 2:5] / 3e-4).round() * 3e-4
    header = HEADER.replace("value = 100.0", "value = 1000.0")
    assert len(read(folder(tmp_path, header, text(table))).time) == 2 * DWELL


def test_the_example_of_the_documentation_is_a_recording(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "recording-format.md").read_text(encoding="utf-8")
    example, own, numbered = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    table = rows()[:, [0, 1, 2, 3, 4, 5, 5, 5]]
    recording = read(folder(tmp_path, example, text(table, ["t", "pos", "ax", "ay", "az", "psi", "theta", "phi"])))
    assert recording.axes("gimbal_angle") == ("platform", "inner", "middle")
    header = re.sub(r"(\[platform\]\n.*?\n)\n", own + "\n", HEADER, flags=re.DOTALL).replace(
        '"middle", u', '"pitch", u'
    )
    assert read(folder(tmp_path, header)).platform.axes == (Axis("roll", "x"), Axis("pitch", "y", -1, np.pi / 2))
    header = 'format = 1\nkind = "rotation"\n' + numbered
    dated = "".join(f"2026-11-18T05:33:{i:02d},{f}\n" for i, f in enumerate(rows()[:30, 2]))
    np.testing.assert_allclose(
        read(folder(tmp_path, header, dated)).channels["specific_force", "x"], G0 * rows()[:30, 2]
    )


def test_coarse_steps_are_neither_frozen_nor_clipped(tmp_path: Path) -> None:
    table = rows()
    table[:, 2:5] = (table[:, 2:5] / 3e-4).round() * 3e-4  # a converter whose step is three sigma
    assert len(read(folder(tmp_path, samples=text(table))).time) == 2 * DWELL


def test_fine_steps_are_neither_frozen_nor_clipped(tmp_path: Path) -> None:
    table = np.tile(rows(), (40, 1))
    table[:, 0] = np.arange(len(table))
    rng = np.random.default_rng(5)
    table[:, 2:5] = ((table[:, 2:5] + 1e-4 * rng.standard_normal((len(table), 3))) / 8e-5).round() * 8e-5
    assert len(read(folder(tmp_path, samples=text(table))).time) == len(table)


# --- writing --------------------------------------------------------------------------------------------------------

FINITE = st.floats(-1e6, 1e6)


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    """Any recording that the format can hold, short enough not to be called frozen."""
    n = draw(st.integers(1, 12))
    column = st.lists(FINITE, min_size=n, max_size=n).map(np.array)
    kind, platform = draw(st.sampled_from([("multi-position", SPACE_STABLE), ("static-run", SPACE_STABLE_INERTIAL)]))
    own = Platform("own", (Axis("platform", "z", -1, 0.25), Axis("tilt", "x")))
    platform = draw(st.sampled_from([platform, own, BENCH]))
    unit = draw(st.sampled_from(["m/s^2", "ug", "count"]))
    keys = {("specific_force", a): unit for a in "xyz"} | {("temperature", ""): "K", ("temperature", "lid"): "degC"}
    keys |= {("covariate", "coil (north)"): "V"} | {("gimbal_angle", a): "deg" for a in platform.axis_names}
    angle = st.lists(st.floats(-6.0, 6.0), min_size=n, max_size=n).map(np.array)
    force = st.lists(st.floats(-90.0, 90.0), min_size=n, max_size=n).map(np.array)  # what a unit at rest may read
    warmth = st.lists(st.floats(-270.0, 1900.0), min_size=n, max_size=n).map(np.array)
    of = {"gimbal_angle": angle, "specific_force": force, "temperature": warmth}
    channels = {key: draw(of.get(key[0], column)) for key in keys}
    steps = draw(st.lists(st.floats(10.0, 90.0), min_size=n, max_size=n))  # no pause that would be a jump of the clock
    weight = draw(st.lists(st.integers(1, 500), min_size=n, max_size=n))
    visits = draw(st.lists(st.integers(0, 30), min_size=n, max_size=n))
    return Recording(
        kind=kind,
        title=draw(st.text(st.characters(codec="utf-8"), max_size=20)),
        platform=platform,
        site=Site(draw(st.floats(-1.5, 1.5)), draw(st.floats(-400, 9000)), draw(st.floats(9.76, 9.84))),
        noise={"accelerometer": draw(st.floats(0.0, 1.0))},
        time=np.cumsum(steps),
        position=None if kind == "static-run" else np.array(visits, dtype=np.int64),
        channels=channels,
        weight=np.array(weight, dtype=float),
        units=keys,
    )


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(recording=recordings(), samples=st.sampled_from(["samples.csv", "a b.parquet"]))
def test_what_is_written_is_read(tmp_path: Path, recording: Recording, samples: str) -> None:
    again = read(write(recording, tmp_path / "round", samples=samples))
    assert (again.kind, again.title, again.platform) == (recording.kind, recording.title, recording.platform)

    # Values pass through their unit and back: two roundings each way.
    def close(got: object, expected: object) -> None:
        np.testing.assert_allclose(np.asarray(got, dtype=float), np.asarray(expected, dtype=float), rtol=1e-15)

    assert again.site.gravity == recording.site.gravity
    assert again.site.height == recording.site.height
    close(again.site.latitude, recording.site.latitude)
    close(again.noise["accelerometer"], recording.noise["accelerometer"])
    np.testing.assert_array_equal(again.time, recording.time)
    np.testing.assert_array_equal(again.weight, recording.weight)
    assert (again.position is None) == (recording.position is None)
    if again.position is not None:
        np.testing.assert_array_equal(again.position, recording.position)
    assert set(again.channels) == set(recording.channels)
    for key, values in recording.channels.items():
        close(again.channels[key], values)


def test_nothing_is_left_when_writing_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = read(folder(tmp_path))

    def full(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr("gimbalcal.recording.writing._write_rows", full)
    with pytest.raises(OSError, match="no space left"):
        write(recording, tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rec"]


def test_writing_keeps_strangers_in_the_folder(tmp_path: Path) -> None:
    recording = read(folder(tmp_path))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "truth.json").write_text("{}")
    write(recording, tmp_path / "out")
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"truth.json", "recording.toml", "samples.csv"}


def test_writing_refuses_a_name_outside(tmp_path: Path) -> None:
    recording = read(folder(tmp_path))
    with pytest.raises(InputError, match=r"samples = '\.\./x\.csv' must be a plain file name"):
        write(recording, tmp_path / "out", samples="../x.csv")


def test_a_missing_axis_is_named(tmp_path: Path) -> None:
    header = re.sub(r"accel_y .*\n", "", HEADER)
    with pytest.raises(InputError, match="the recording 'two positions' has no specific_force along y: add the column"):
        read(folder(tmp_path, header)).triad("specific_force")


def test_unequal_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match=r"`specific_force x` must have one value per row of `time` \(3\), got 2"):
        Recording("pointing", "", BENCH, Site(), {}, np.arange(3.0), None, {("specific_force", "x"): np.zeros(2)})


def test_a_line_without_an_end_is_no_defect(tmp_path: Path) -> None:
    assert "numbers stand where the column names belong" in refusal(tmp_path, samples="7" * 200_000)


def test_a_row_that_no_sensor_filled_is_left_out(tmp_path: Path) -> None:
    lines = text(rows()).splitlines()
    lines.insert(20, "," * (len(NAMES) - 1))  # a logger that woke up and had nothing to say
    made = read(folder(tmp_path, samples="\n".join(lines)))
    assert len(made.time) == 2 * DWELL
    assert "line 21: 1 row of 81 is left out" in made.remarks[0]


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("name", ["bench [4]", "run*", "~", "a?b", "{x,y}"])
def test_a_path_is_a_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, ending: str) -> None:
    monkeypatch.chdir(tmp_path)
    neighbour, wanted = Path("run2"), Path(name)
    for at, seed in ((neighbour, 1), (wanted, 2)):
        write(read(folder(tmp_path, samples=text(rows(seed)))), at, f"samples{ending}")
    made = read(wanted)
    assert len(made.time) == 2 * DWELL
    assert not np.array_equal(made.triad("specific_force"), read(neighbour).triad("specific_force"))


@pytest.mark.parametrize("value", ["0", "-3"])
def test_a_weight_is_of_some_samples(tmp_path: Path, value: str) -> None:
    header = HEADER + 'n = { quantity = "weight" }\n'
    lines = [f"{line},{'n' if k == 0 else 5}" for k, line in enumerate(text(rows()).splitlines())]
    lines[7] = lines[7].rpartition(",")[0] + f",{value}"
    words = refusal(tmp_path, header, "\n".join(lines) + "\n")
    assert words.startswith("samples.csv, line 8, column n: a weight says of how many samples a row is the mean")


@pytest.mark.parametrize("reading", [-3.0, 9e9])
def test_a_temperature_of_no_sensor_is_refused_with_its_row(tmp_path: Path, reading: float) -> None:
    table = rows()
    table[3, NAMES.index("temp")] = reading
    assert f"line 5, column temp: {reading:g} K is no temperature of a sensor" in refusal(tmp_path, samples=text(table))
