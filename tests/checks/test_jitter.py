"""Stamps of arrival: found by the readings, put right where the sampling was regular, and left where it was not."""

import numpy as np
import pytest

from gimbalcal.checks.jitter import jitter_of, regular_clock
from gimbalcal.recording import read
from tests.golden import golden_text, refused

RATE = 50.0
HEADER = """\
format = 1
kind = "rotation"
[columns]
t = { quantity = "time", unit = "s" }
gx = { quantity = "angular_rate", axis = "x", unit = "rad/s" }
gy = { quantity = "angular_rate", axis = "y", unit = "rad/s" }
gz = { quantity = "angular_rate", axis = "z", unit = "rad/s" }
"""


def motion(time, seed=1):
    """Rates (n, 3) [rad/s] of a hand, sampled at `time`, with 1 mrad/s of noise."""
    rng = np.random.default_rng(seed)
    phase, f = rng.uniform(0, 6, (4, 3)), np.array([0.5, 1.1, 2.3, 4.1])[:, None, None]
    wave = np.sin(2 * np.pi * f * time[None, :, None] + phase[:, None, :]).sum(0)
    return np.asarray(wave + 1e-3 * rng.standard_normal(wave.shape))


def recording(path, stamps, rates, header=HEADER):
    (path / "recording.toml").write_text(header)
    rows = np.column_stack([stamps, rates])
    (path / "samples.csv").write_text("t,gx,gy,gz\n" + "\n".join(",".join(f"{v:.9f}" for v in row) for row in rows))
    return read(path)


def arrival(n, seed=2):
    """When n rows were sampled, and when they arrived: up to a third of a step late, one in fifty more than half."""
    rng = np.random.default_rng(seed)
    true = 100.0 + np.arange(n) / RATE
    late = rng.uniform(0, 0.3, n) / RATE + (rng.random(n) < 0.02) * 0.6 / RATE
    return true, np.maximum.accumulate(true + late + 1e-9 * np.arange(n))


def test_times_of_arrival_are_put_right_and_told(tmp_path):
    true, stamps = arrival(2000)
    made = recording(tmp_path, stamps, motion(true))
    np.testing.assert_allclose(made.time - made.time.mean(), true - true.mean(), atol=2e-4)  # the stamps: 2e-3
    golden_text(made.remarks[-1])  # 50 Hz, but for the last stamp
    kept = recording(tmp_path, stamps, motion(true), HEADER.replace('unit = "s" }', 'unit = "s", regular = false }'))
    np.testing.assert_allclose(kept.time, stamps, atol=1e-8)
    assert not any("regular clock" in remark for remark in kept.remarks)


def test_irregular_sampling_keeps_its_true_stamps(tmp_path):
    stamps = arrival(2000)[1]
    made = recording(tmp_path, stamps, motion(stamps))
    np.testing.assert_allclose(made.time, stamps, atol=1e-8)
    found = jitter_of(stamps, np.arange(2000), list(motion(stamps).T))
    assert found.roughness > 2


@pytest.mark.parametrize("seed", range(5))
def test_a_unit_at_rest_says_nothing(seed):
    stamps = arrival(2000, seed)[1]
    found = jitter_of(stamps, np.arange(2000), list(np.random.default_rng(seed).standard_normal((3, 2000))))
    assert found.roughness == pytest.approx(1.0, abs=0.05)


def test_rows_that_were_left_out_keep_their_place(tmp_path):
    true, stamps = arrival(2000)
    rates = motion(true)
    rates[500:520] = np.nan
    made = recording(tmp_path, stamps, rates)
    assert len(made.time) == 1980
    whole = np.delete(true, np.arange(500, 520))
    np.testing.assert_allclose(made.time - made.time.mean(), whole - whole.mean(), atol=4e-4)


def test_lost_rows_are_counted(tmp_path):
    true, stamps = arrival(3000)
    kept = np.flatnonzero(np.arange(3000) % 97 < 94)  # three in a hundred lost
    made = recording(tmp_path, stamps[kept], motion(true)[kept])
    np.testing.assert_allclose(made.time - made.time.mean(), true[kept] - true[kept].mean(), atol=4e-4)


def test_a_clock_that_wanders_is_told_and_left(tmp_path):
    true, stamps = arrival(3000)
    slow = stamps + 0.2 * np.sin(2 * np.pi * (true - 100.0) / 30.0)
    made = recording(tmp_path, slow, motion(true))
    np.testing.assert_allclose(made.time, slow, atol=1e-8)
    golden_text(made.remarks[-1])


def test_stamps_in_whole_seconds_where_the_clock_is_regular(tmp_path):
    true = 100.0 + np.arange(2000) / RATE
    with refused():
        recording(tmp_path, np.floor(true), motion(true))
    made = recording(
        tmp_path, np.floor(true), motion(true), HEADER.replace('unit = "s" }', 'unit = "s", regular = true }')
    )
    np.testing.assert_allclose(np.diff(made.time), 1 / RATE, rtol=1e-3)
    golden_text(made.remarks[-1])


def test_regular_is_for_the_time(tmp_path):
    true = np.arange(200) / RATE
    for old, new in (('unit = "s"', 'unit = "s", regular = 3'), ('unit = "rad/s"', 'unit = "rad/s", regular = true')):
        with refused():
            recording(tmp_path, true, motion(true), HEADER.replace(old, new, 1))
    assert regular_clock(np.zeros(10), np.arange(10)) is None


def test_noise_alone_is_as_rough_on_either_clock():
    """Stamps that scatter by a third of a step, as of a radio: each cubic leaves of the noise what its weights do."""
    rng = np.random.default_rng(5)
    row = np.arange(20_000)
    found = jitter_of((row + rng.uniform(0, 0.9, len(row))) / RATE, row, [rng.standard_normal(len(row))])
    assert found.roughness == pytest.approx(1.0, abs=0.015)


def test_roughness_is_that_of_the_noise_over_that_with_what_wrong_stamps_add():
    """On a ramp of slope a, stamps that are off by s add a s to the noise: three times in squares make a half."""
    rng = np.random.default_rng(6)
    row, off, noise = np.arange(20_000), 0.05, 0.01
    slope = np.sqrt(3) * noise / off  # a row
    found = jitter_of((row + off * rng.standard_normal(len(row))) / RATE, row,
                      [slope * row + noise * rng.standard_normal(len(row))])  # fmt: skip
    assert found.roughness == pytest.approx(0.5, abs=0.02)
    assert found.scatter == pytest.approx(np.sqrt(2) * off, rel=0.05)
    assert found.rate == pytest.approx(RATE, rel=1e-3)
