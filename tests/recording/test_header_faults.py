"""What recording.toml may not say, and in which words it is refused."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gimbalcal.errors import InputError
from gimbalcal.recording import read
from tests.recording.folders import HEADER, folder, refusal

HEADER_FAULTS: list[tuple[str, str, str]] = [
    ("format = 1", "format = 2", "recording.toml, line 1: format must be 1, got 2"),
    (
        '"multi-position"',
        '"tumble"',
        "recording.toml, line 2: kind must be one of multi-position, static-run, rotation or",
    ),
    ('"two positions"', '"two positions', "recording.toml, line 3, column"),
    ("[site]", "[sites]", "'sites' is not known; write one of format, kind, title, date, samples, site"),
    (
        "format = 1",
        "format = 1\ndate = 18",
        "recording.toml, line 2: date says when it was recorded, as in date = 2026-11",
    ),
    ("format = 1", 'format = 1\ndate = "last week"', "line 2: date says when it was recorded"),
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


def test_a_header_stands_for_its_folder(tmp_path: Path) -> None:
    made = folder(tmp_path)
    assert read(made / "recording.toml").files == read(made).files


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
