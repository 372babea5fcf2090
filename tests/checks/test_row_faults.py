"""Rows that are refused, and in which words."""

import re
from collections.abc import Callable

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording import read, write
from tests.golden import golden_text, refused
from tests.recording.folders import HEADER, NAMES, changed, folder, refusal, rows, text


def stuck(table):
    table[10:35, 3] = table[10, 3]


def dead(table):
    table[:, 3] = 0.0


def stopped_clock(table):
    table[12, 0] = table[11, 0]


def clock_back(table):
    table[20:, 0] -= 100.0


def clock_forward(table):
    table[20:, 0] += 3600.0


def inf_run(table):
    table[5:9, 2] = np.inf


def spike(table):
    table[[6, 50], 2] = 4000.0


def half_position(table):
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
    (dead, "column accel_y: all 80 rows read 0 g although the noise is 8.9e-05 g, so the channel is dead; leave its"),
    (
        lambda table: table[:, 4].clip(-0.99995, out=table[:, 4]),
        "column accel_z: -0.99995 g is the smallest value of the",
    ),
]


@pytest.mark.parametrize(("fault", "sentence"), ROW_FAULTS, ids=[fault[1][:70] for fault in ROW_FAULTS])
def test_row_fault_is_refused(tmp_path, fault, sentence):
    table = rows()
    fault(table)
    said = refusal(tmp_path, samples=text(table))
    assert sentence in said
    assert "\n" not in said


@pytest.mark.parametrize("batch", [11, 50_000])
def test_row_numbers_hold_across_batches(tmp_path, monkeypatch, batch):
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", batch)
    table = rows()
    inf_run(table[30:])
    golden_text(refusal(tmp_path, samples=text(table)))


def test_cells_that_are_not_numbers(tmp_path):
    said = refusal(tmp_path, samples=changed(7, "accel_z", "off"))
    golden_text(said)
    golden_text(refusal(tmp_path, samples=changed(1, "time_s", "")))
    golden_text(refusal(tmp_path, samples=changed(2, "accel_y", "0,1")))
    units = text(rows()).replace("\n", "\ns,,g,g,g,deg,K\n", 1)
    golden_text(refusal(tmp_path, samples=units))


def test_line_numbers_count_comments(tmp_path):
    said = refusal(tmp_path, samples="# a\n# b\n" + changed(7, "accel_z", "inf"))
    golden_text(said)


def test_other_separators_are_named(tmp_path):
    golden_text(refusal(tmp_path, samples=text(rows()).replace(",", ";")))


def test_empty_files(tmp_path):
    golden_text(refusal(tmp_path, samples=""))
    golden_text(refusal(tmp_path, samples=",".join(NAMES) + "\n"))


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.999])
def test_truncated_parquet(tmp_path, keep):
    target = write(read(folder(tmp_path)), tmp_path / "cut", samples="samples.parquet")
    whole = (target / "samples.parquet").read_bytes()
    (target / "samples.parquet").write_bytes(whole[: int(keep * len(whole))])
    with pytest.raises(InputError, match=r"samples\.parquet cannot be read as Parquet, it seems to be cut short or"):
        read(target)


def test_rows_of_parquet_are_counted_from_one(tmp_path):
    import polars as pl

    target = write(read(folder(tmp_path)), tmp_path / "rec2", samples="samples.parquet")
    frame = pl.read_parquet(target / "samples.parquet")
    values = frame["accel_x"].to_numpy().copy()
    values[5] = np.inf
    frame.with_columns(accel_x=values).write_parquet(target / "samples.parquet")
    with refused():
        read(target)


def test_degrees_called_radians(tmp_path):
    said = refusal(tmp_path, HEADER.replace('axis = "middle", unit = "deg"', 'axis = "middle", unit = "rad"'))
    golden_text(said)


def test_a_dead_channel_is_seen_without_stated_noise(tmp_path):
    table = rows()
    dead(table)
    said = refusal(tmp_path, re.sub(r"accelerometer .*\n", "", HEADER), text(table))
    golden_text(said)


def test_a_line_without_an_end_is_no_defect(tmp_path):
    golden_text(refusal(tmp_path, samples="7" * 200_000))


@pytest.mark.parametrize("value", ["0", "-3"])
def test_a_weight_is_of_some_samples(tmp_path, value):
    header = HEADER + 'n = { quantity = "weight" }\n'
    lines = [f"{line},{'n' if k == 0 else 5}" for k, line in enumerate(text(rows()).splitlines())]
    lines[7] = lines[7].rpartition(",")[0] + f",{value}"
    words = refusal(tmp_path, header, "\n".join(lines) + "\n")
    golden_text(words)


@pytest.mark.parametrize("reading", [-3.0, 9e9])
def test_a_temperature_of_no_sensor_is_refused_with_its_row(tmp_path, reading):
    table = rows()
    table[3, NAMES.index("temp")] = reading
    golden_text(refusal(tmp_path, samples=text(table)))


def triad_folder(at, quantity, unit, step, x, digits, position=None):
    """Write a recording of a triad x (n, 3) in a unit, rows `step` s apart, as text with so many digits."""
    columns = {"t": 'quantity = "time", unit = "s"'} | ({} if position is None else {"p": 'quantity = "position"'})
    columns |= {axis: f'quantity = "{quantity}", axis = "{axis}", unit = "{unit}"' for axis in "xyz"}
    places = [""] * len(x) if position is None else [f"{p}," for p in position]
    read_out = (f"{step * k:.3f},{p}" + ",".join(f"{v:.{digits}f}" for v in x[k]) for k, p in enumerate(places))
    at.mkdir(exist_ok=True)
    header = "".join(f"{name} = {{ {text} }}\n" for name, text in columns.items())
    (at / "recording.toml").write_text(f'format = 1\nkind = "multi-position"\ntitle = "triad"\n[columns]\n{header}')
    (at / "samples.csv").write_text("\n".join([",".join(columns), *read_out, ""]))
    return at


def test_a_dead_band_about_zero_is_no_frozen_channel(tmp_path):
    """Steps of 0.01 mg, noise of 0.3 mg, and zero for half a second now and then as a driver sets it."""
    rng = np.random.default_rng(5)
    x = np.round(rng.normal([0.0, 0.0, 1.0], 3e-4, (3000, 3)), 5)
    for k in range(0, 3000, 200):
        x[k : k + 25, 1] = 0.0
    at = triad_folder(tmp_path, "specific_force", "g", 0.02, x, digits=5)
    with pytest.raises(InputError, match=r"by a dead band, in 4\d\d rows"):
        read(at)


def test_gyroscopes_that_a_table_turned_at_sixty_degrees_a_second_read_no_faulty_rows(tmp_path):
    """A log of six steady turns was proposed by `new` for `noise`, and refused by it."""
    rate = np.random.default_rng(5).normal(0.0, 1e-3, (600, 3))
    for k in range(6):
        rate[100 * k : 100 * k + 100, k // 2] += 1.047 * (-1) ** k

    def recording(rate, name):
        return triad_folder(tmp_path / name, "angular_rate", "rad/s", 0.01, rate, 6, position=np.arange(600) // 100 + 1)

    assert len(read(recording(rate, "steady")).time) == 600
    rate[250:256, 0] = 1.2
    with pytest.raises(InputError, match="beyond anything that a unit at rest can read"):
        read(recording(rate, "spike"))


@pytest.mark.parametrize(("value", "said"), [(-4.0, "at the end of its range; raise that"), (-0.7, "frozen")])
def test_a_channel_that_stays_at_the_largest_value_of_its_triad_is_not_frozen(tmp_path, value, said):
    """A unit that was shaken read -39.22 m/s^2, its range of 4 g, for 39 of 27000 rows."""
    x = np.random.default_rng(5).normal([0.0, 0.0, 1.0], 3e-4, (6000, 3))
    x[3000:3040] += np.linspace(0, 2.5, 40)[:, None]
    x[3010:3040, 1], x[3039, 2] = value, 4.0
    at = triad_folder(tmp_path, "specific_force", "g", 0.02, x, digits=5)
    with pytest.raises(InputError, match=f"so the channel is {said}"):
        read(at)


def test_a_channel_behind_a_filter_is_not_frozen_where_it_hardly_changes(tmp_path):
    """Readings of 1 kHz behind a filter of 30 Hz in steps of 0.06 deg/s, one axis quiet; vibration comes before."""
    rng = np.random.default_rng(8)
    n, smooth = 6000, np.hanning(60) / np.hanning(60).sum()
    w = np.stack([np.convolve(rng.standard_normal(n + 59), smooth, "valid") for _ in "xyz"], axis=-1)
    w *= [6.0, 6.0, 1.0]
    w[:5000] += 2 * rng.standard_normal((5000, 3))
    w = 0.061 * np.round(w / 0.061)
    at = triad_folder(tmp_path, "angular_rate", "deg/s", 1e-3, w, digits=3, position=np.ones(n, dtype=int))
    assert len(read(at).time) == n


@pytest.mark.parametrize("frozen", [False, True])
def test_a_channel_of_coarse_steps_stands_still_where_its_unit_does(tmp_path, frozen):
    """Steps of 0.02 g, noise of 8 mg, motion of 0.1 g before the rest; frozen: the others go on moving beside it."""
    rng = np.random.default_rng(3)
    n, moving = 600, np.arange(600) < 300
    x = 0.008 * rng.standard_normal((n, 3)) + [0.0, 0.0, 1.0]
    x += 0.1 * rng.standard_normal((n, 3)) * (moving | np.bool_(frozen))[:, None]
    x = 0.02 * np.round(x / 0.02)
    x[310:590, 1] = 0.04
    at = triad_folder(tmp_path, "specific_force", "g", 0.1, x, digits=2)
    if frozen:
        with pytest.raises(InputError, match="so the channel is frozen"):
            read(at)
    else:
        assert len(read(at).time) == n


def test_a_channel_that_reads_two_neighbours_of_a_coarse_scale_is_not_frozen(tmp_path):
    """Steps of 0.01 rad/s, noise of 3 mrad/s: the first gyroscope reads 0.03 for most of the time, and 0.02 else."""
    rng = np.random.default_rng(4)
    n = 6000
    x = np.round(rng.normal([0.031, 0.026, 0.01], 0.003, (n, 3)), 2).clip(0.01, 0.03)
    x[1000:1900, 0] = 0.03  # as it drifts away from the edge of its step
    at = triad_folder(tmp_path, "angular_rate", "rad/s", 0.01, x, digits=2)
    assert np.unique(x[:, 0]).tolist() == [0.02, 0.03]
    assert len(read(at).time) == n
