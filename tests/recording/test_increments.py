"""Increments become means over the interval once, at reading; how still a place is; instants."""

import dataclasses

import numpy as np
import pytest

from gimbalcal.recording import read, write
from gimbalcal.units import from_si
from tests.golden import golden_text, refused

HEAD = """format = 1
kind = "rotation"
[site]
latitude = { value = 40.0, unit = "deg" }
[noise]
velocity = { value = 0.01, unit = "mm/s" }
[columns]
t = { quantity = "time", unit = "s"%s }
vx = { quantity = "velocity_increment", axis = "x", unit = "m/s" }
vy = { quantity = "velocity_increment", axis = "y", unit = "m/s" }
vz = { quantity = "velocity_increment", axis = "z", unit = "m/s" }
ax = { quantity = "angle_increment", axis = "x", unit = "arcsec", sign = -1 }
ay = { quantity = "angle_increment", axis = "y", unit = "arcsec" }
az = { quantity = "angle_increment", axis = "z", unit = "arcsec" }
"""


def folder(tmp_path, time, head=HEAD % "", stamps=None, interval=None, seed=0):
    rng = np.random.default_rng(seed)
    n = len(time)
    force = np.array([0.1, 0.0, 9.8]) + 1e-3 * rng.standard_normal((n, 3))
    rate = 0.2 * np.sin(time)[:, None] + 1e-5 * rng.standard_normal((n, 3))
    dt = np.diff(time, prepend=2 * time[0] - time[1])[:, None] if interval is None else interval
    table = np.column_stack([time if stamps is None else stamps, force * dt, from_si(rate * dt, "arcsec")])
    table[:, 4] *= -1
    (tmp_path / "recording.toml").write_text(head)
    np.savetxt(tmp_path / "samples.csv", table, delimiter=",", header="t,vx,vy,vz,ax,ay,az", comments="", fmt="%.17g")
    return force, rate


def test_increments_are_read_as_means_over_their_interval(tmp_path):
    time = np.cumsum(np.random.default_rng(1).choice([0.01, 0.012], 400))
    force, rate = folder(tmp_path, time, HEAD % ", regular = false")
    made = read(tmp_path)
    np.testing.assert_allclose(made.triad("specific_force")[1:], force[1:], rtol=1e-12)
    np.testing.assert_allclose(made.triad("angular_rate")[1:], rate[1:], rtol=1e-11)
    assert made.sigma("velocity") == 1e-5
    assert not made.instant
    assert not made.counted("specific_force")


@pytest.mark.parametrize("batch", [1, 7])
def test_the_interval_of_a_row_begins_in_the_batch_before(tmp_path, monkeypatch, batch):
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", batch)
    time = np.cumsum(np.random.default_rng(1).choice([0.01, 0.012], 100))
    force, _ = folder(tmp_path, time, HEAD % ", regular = false")
    np.testing.assert_allclose(read(tmp_path).triad("specific_force")[1:], force[1:], rtol=1e-12)


def test_rows_lost_take_their_increments_with_them(tmp_path):
    time = np.delete(0.01 * np.arange(500), [*range(100, 130), 300])
    force, _ = folder(tmp_path, time, interval=0.01)
    np.testing.assert_allclose(read(tmp_path).triad("specific_force"), force, rtol=1e-12)


def test_a_clock_laid_through_times_of_arrival_mends_the_means_too(tmp_path):
    time = 0.01 * np.arange(6000)
    late = time + 0.003 * np.random.default_rng(2).random(6000)
    _, rate = folder(tmp_path, time, stamps=late)
    made = read(tmp_path)
    golden_text(made.remarks[-1])
    np.testing.assert_allclose(made.triad("angular_rate")[1:], rate[1:], rtol=1e-5)


def test_frozen_increments_are_told(tmp_path):
    folder(tmp_path, 0.01 * np.arange(4000))
    lines = (tmp_path / "samples.csv").read_text().splitlines()
    for i in range(2000, 3000):
        parts = lines[i].split(",")
        lines[i] = ",".join([*parts[:1], lines[2000].split(",")[1], *parts[2:]])
    (tmp_path / "samples.csv").write_text("\n".join(lines))
    with refused():
        read(tmp_path)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('vx = { quantity = "velocity_increment"', 'vx = { quantity = "specific_force"'),
        ("[noise]", '[samples]\nrates = "instant"\n[noise]'),
        ("[noise]", '[samples]\nrates = "sometimes"\n[noise]'),
        ("[noise]", '[samples]\nrate = "mean"\n[noise]'),
        ("[noise]", "[noise]\naccelerometer = { value = 1.0, unit = \"m/s\" }"),
        ('unit = "arcsec", sign = -1', 'unit = "arcsec/s"'),
        (
            "[columns]",
            '[columns]\ngx = { quantity = "angular_rate", axis = "x", unit = "rad/s" }',
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(tmp_path, old, new):
    folder(tmp_path, 0.01 * np.arange(50), (HEAD % "").replace(old, new, 1))
    with refused():
        read(tmp_path)


def test_instants_are_kept_through_a_folder(tmp_path):
    folder(tmp_path, 0.01 * np.arange(50))
    made = dataclasses.replace(read(tmp_path), instant=True)
    write(made, tmp_path / "again", "samples.parquet")
    again = read(tmp_path / "again")
    assert again.instant
    np.testing.assert_allclose(again.triad("angular_rate"), made.triad("angular_rate"), rtol=1e-14)
    assert again.noise == made.noise
