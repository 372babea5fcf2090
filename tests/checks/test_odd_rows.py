"""Rows that look odd and are not wrong: what is made of them, and what is told."""

import re

import numpy as np
import pytest

from gimbalcal.recording import dwells, read
from tests.golden import golden_text
from tests.recording.folders import DWELL, HEADER, NAMES, folder, refusal, rows, text

CLOCK = 'quantity = "time", unit = "s"'


def test_a_clock_of_stated_coarseness_may_stamp_rows_alike(tmp_path):
    table = rows()
    table[:, 0] = np.floor(table[:, 0] / 3) * 3
    golden_text(refusal(tmp_path, samples=text(table)))
    stated = HEADER.replace(CLOCK, f"{CLOCK}, resolution = 3")
    made = read(folder(tmp_path, stated, text(table)))
    np.testing.assert_array_equal(made.time, table[:, 0])
    golden_text(*made.remarks)
    table[7, 0] -= 3.0
    golden_text(refusal(tmp_path, stated, text(table)))
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


def test_stars_may_be_stamped_alike_and_pause_for_days(tmp_path):
    stamps = [0.0, 0.1, 0.1, 0.1, 0.2, 43.9, 43.9]
    lines = [f"{t},{30 + i},{20 * i},{30.1 + i},{20 * i}" for i, t in enumerate(stamps)]
    made = read(folder(tmp_path, STARS, "\n".join(["t,el,az,tel,taz", *lines, ""])))
    np.testing.assert_allclose(made.time, 3600 * np.array(stamps))
    golden_text(*made.remarks)


@pytest.mark.parametrize("batch", [11, 50_000])
def test_rows_without_a_value_are_left_out_and_told(tmp_path, monkeypatch, batch):
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
    golden_text(told)
    broken[70] = broken[70].replace("1.0", "inf")
    golden_text(refusal(tmp_path, samples="\n".join(broken)))


def test_a_row_behind_some_that_are_left_out_is_named_by_its_own_line(tmp_path):
    table = rows()
    table[[5, 6, 9], 2] = np.nan
    table[10, 0] = 3.0  # its clock; the eighth row that is left, in line 12
    golden_text(refusal(tmp_path, samples=text(table)))
    table[10, 0], table[7, 0] = 10.0, 3.0  # right behind two
    golden_text(refusal(tmp_path, samples=text(table)))


def test_a_pause_of_days_is_told(tmp_path):
    table = rows()
    table[40:, 0] += 2 * 86400
    read_back = read(folder(tmp_path, samples=text(table)))
    assert [(d.position, d.start, d.stop) for d in dwells(read_back)] == [(1, 0, 40), (2, 40, 80)]
    golden_text(read_back.remarks[0])


def test_dates_across_a_zone_and_midnight(tmp_path):
    table = rows()
    lines = text(table).splitlines()
    stamps = [f"2026-12-31T23:59:{s:02d}.{k}+02:00" for s in range(40, 60) for k in (0, 5)]
    stamps += [f"20270101T0001{s:02d}.{k}+0200" for s in range(20) for k in ("25", "75")]
    dated = [lines[0], *(",".join([t, *line.split(",")[1:]]) for t, line in zip(stamps, lines[1:], strict=True))]
    header = HEADER.replace('"time", unit = "s"', '"time", unit = "ISO 8601"')
    read_back = read(folder(tmp_path, header, "\n".join(dated)))
    np.testing.assert_array_equal(np.diff(read_back.time)[[0, 39, 40]], [0.5, 60.75, 0.5])
    golden_text(read_back.remarks[0])
    assert read_back.date == "2026-12-31"
    said = refusal(tmp_path, header, "\n".join([*dated[:9], dated[9].replace("+02:00", ""), *dated[10:]]))
    golden_text(said)
    said = refusal(tmp_path, header)
    golden_text(said)


def test_a_noiseless_recording_is_not_frozen(tmp_path):
    table = rows()
    table[:, 2:5] = table[:, 2:5].round()
    header = re.sub(r"accelerometer .*\n", "", HEADER)
    assert read(folder(tmp_path, header, text(table))).scatter["specific_force", "x"] == 0.0


def test_noise_stated_too_high_freezes_nothing(tmp_path):
    table = rows()
    table[:, 2:5] = (table[:, 2:5] / 3e-4).round() * 3e-4
    header = HEADER.replace("value = 100.0", "value = 1000.0")
    assert len(read(folder(tmp_path, header, text(table))).time) == 2 * DWELL


def test_coarse_steps_are_neither_frozen_nor_clipped(tmp_path):
    table = rows()
    table[:, 2:5] = (table[:, 2:5] / 3e-4).round() * 3e-4  # a converter whose step is three sigma
    assert len(read(folder(tmp_path, samples=text(table))).time) == 2 * DWELL


def test_fine_steps_are_neither_frozen_nor_clipped(tmp_path):
    table = np.tile(rows(), (40, 1))
    table[:, 0] = np.arange(len(table))
    rng = np.random.default_rng(5)
    table[:, 2:5] = ((table[:, 2:5] + 1e-4 * rng.standard_normal((len(table), 3))) / 8e-5).round() * 8e-5
    assert len(read(folder(tmp_path, samples=text(table))).time) == len(table)


def test_a_row_that_no_sensor_filled_is_left_out(tmp_path):
    lines = text(rows()).splitlines()
    lines.insert(20, "," * (len(NAMES) - 1))  # a logger that woke up and had nothing to say
    made = read(folder(tmp_path, samples="\n".join(lines)))
    assert len(made.time) == 2 * DWELL
    golden_text(made.remarks[0])
