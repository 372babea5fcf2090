"""Dwells: visits of numbered positions, their means, and rests found where nobody numbered them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Dwell, Recording, Site, dwell_means, dwells
from gimbalcal.recording.detection import detect
from tests.xsens import accelerometers


def recording(position: list[int] | None, middle: Array | None = None) -> Recording:
    n = 8 if position is None else len(position)
    channels: dict[tuple[str, str], Array] = {("specific_force", "x"): np.arange(n, dtype=float)}
    if middle is not None:
        channels["gimbal_angle", "middle"] = middle
    numbers = None if position is None else np.array(position)
    return Recording("multi-position", "", SPACE_STABLE, Site(), {}, np.arange(n, dtype=float), numbers, channels)


def test_a_position_may_be_visited_again() -> None:
    visits = dwells(recording([0, 1, 1, 0, 2, 1, 1, 1]))
    assert visits == (Dwell(1, 1, 3), Dwell(2, 4, 5), Dwell(1, 5, 8))


def test_without_positions_all_rows_are_one_visit() -> None:
    assert dwells(recording(None)) == (Dwell(1, 0, 8),)


def test_moving_all_the_time_is_no_dwell() -> None:
    assert dwells(recording([0, 0, 0])) == ()
    with pytest.raises(InputError, match="has no dwell: every row has position 0, or nothing in it is at rest"):
        dwell_means(recording([0, 0, 0]))


def test_means_by_weight() -> None:
    rows = replace(recording([1, 1, 2, 2]), weight=np.array([1.0, 3.0, 2.0, 2.0]))
    means = dwell_means(rows)
    np.testing.assert_allclose(means.channels["specific_force", "x"], [0.75, 2.5], rtol=1e-15)
    assert means.weight.tolist() == [4.0, 4.0]
    assert means.position is not None
    assert means.position.tolist() == [1, 2]


def test_means_of_angles_do_not_break_at_the_wrap() -> None:
    middle = np.radians([359.0, 1.0, 0.0, 10.0, 20.0, 30.0])
    means = dwell_means(recording([1, 1, 1, 2, 2, 2], middle))
    np.testing.assert_allclose(np.degrees(means.channels["gimbal_angle", "middle"]), [360.0, 20.0], rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 3), min_size=1, max_size=30), st.floats(-1e6, 1e6))
def test_dwells_do_not_care_about_the_origin_of_time(position: list[int], origin: float) -> None:
    rows = recording(position)
    assert dwells(rows) == dwells(replace(rows, time=rows.time + origin))
    covered = [i for d in dwells(rows) for i in range(d.start, d.stop)]
    assert covered == [i for i, p in enumerate(position) if p > 0]


# --- detection ------------------------------------------------------------------------------------------------------


def turned_by_hand(
    rng: np.random.Generator, rests: int, rate: float
) -> tuple[Array, dict[str, Array], list[tuple[int, int]]]:
    """Rests of 4 to 9 s, moves of 1.5 to 3 s along smooth curves with the shaking of a hand, 1 mg of white noise."""
    force: list[Array] = []
    edges: list[tuple[int, int]] = []
    here = np.array([0.0, 0.0, -1.0])
    for _ in range(rests):
        there = rng.standard_normal(3)
        there /= np.linalg.norm(there)
        move = np.linspace(0, 1, round(rate * rng.uniform(1.5, 3.0)))[:, None]
        rest = np.repeat(there[None], round(rate * rng.uniform(4.0, 9.0)), axis=0)
        shake = 0.1 * np.sin(np.pi * move) * rng.standard_normal((len(move), 3))
        start = sum(len(part) for part in force) + len(move)
        force += [(1 - move) * here + move * there + shake, rest]
        edges.append((start, start + len(rest)))
        here = there
    f = np.concatenate(force)
    f += 1e-3 * rng.standard_normal(f.shape)
    return np.arange(len(f)) / rate, dict(zip("xyz", f.T, strict=True)), edges


@pytest.mark.parametrize("rate", [20.0, 100.0])
@pytest.mark.parametrize("seed", range(5))
def test_every_rest_is_found_and_nothing_of_a_move(seed: int, rate: float) -> None:
    time, channels, edges = turned_by_hand(np.random.default_rng(seed), 15, rate)
    position = detect(time, channels)
    assert position.max() == 15
    for k, (start, stop) in enumerate(edges, start=1):
        rows = np.flatnonzero(position == k)
        assert start <= rows[0]
        assert rows[-1] < stop
        # A window is lost at each end, and a little more where the window's variance strays.
        assert len(rows) / rate > (stop - start) / rate - 2 * 1.0 - 0.5


@pytest.mark.parametrize("raw", [False, True])
def test_a_gyroscope_that_shakes_ends_a_rest(raw: bool) -> None:
    rng = np.random.default_rng(5)
    time, channels, edges = turned_by_hand(rng, 10, 50.0)
    rate = np.radians(0.05) * rng.standard_normal((len(time), 3)) + np.radians([0.9, -0.4, 0.1])
    start, stop = edges[4]
    rate[start:stop, 1] += np.radians(5.0) * rng.standard_normal(stop - start)  # too small for the accelerometers
    gyros = dict(zip("xyz", rate.T, strict=True))
    assert detect(time, channels).max() == 10
    position = detect(time, channels, gyros, raw)
    assert position.max() == 9
    assert not position[start:stop].any()


def test_a_turn_about_the_vertical_is_no_rest() -> None:
    rng = np.random.default_rng(6)
    time, channels, edges = turned_by_hand(rng, 10, 50.0)
    rate = np.radians(0.05) * rng.standard_normal((len(time), 3)) + np.radians([0.9, -0.4, 0.1])
    start, stop = edges[6]
    rate[start : start + 100] += np.radians([0.0, 10.0, 0.0])
    position = detect(time, channels, dict(zip("xyz", rate.T, strict=True)))
    assert position.max() == 10
    assert not position[start : start + 100].any()
    assert position[start + 150 : stop - 60].all()


def test_a_shaking_hand_and_a_slow_bias_are_rests() -> None:
    rng = np.random.default_rng(7)
    time, channels, _ = turned_by_hand(rng, 10, 50.0)
    tremor = np.radians(0.3) * np.abs(rng.standard_normal(len(time) // 100 + 1)).repeat(100)[: len(time)]
    rate = tremor[:, None] * rng.standard_normal((len(time), 3)) + np.radians(0.8) * (time / time[-1])[:, None]
    assert detect(time, channels, dict(zip("xyz", rate.T, strict=True))).max() == 10


def test_a_rest_ends_where_the_logger_paused() -> None:
    time, channels, edges = turned_by_hand(np.random.default_rng(8), 4, 50.0)
    middle = sum(edges[2]) // 2
    assert detect(time + 1e5 * (np.arange(len(time)) >= middle), channels).max() == 5
    assert detect(time + 5.0 * (np.arange(len(time)) >= middle), channels).max() == 4


def test_sensors_of_little_noise_rest_throughout_an_hour() -> None:
    """1 ug beside 1 g and 1e-4 deg/h beside turns of 5 deg/s: sums over the whole of it drowned them."""
    rng, n = np.random.default_rng(2), 120_000
    time, turn = 0.01 * np.arange(1, n + 1), (np.arange(n) // 3000) % 2 == 1
    angle = np.cumsum(np.where(turn, np.radians(5.0) * 0.01, 0.0))
    force = 9.8 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) + 1e-5 * rng.standard_normal((n, 3))
    rate = np.stack([0 * angle, 0 * angle, np.where(turn, np.radians(5.0), 0.0)], axis=1)
    rate += 5e-10 * rng.standard_normal((n, 3)) + 7e-5
    found = detect(time, dict(zip("xyz", force.T, strict=True)), dict(zip("xyz", rate.T, strict=True)))
    assert found.max() == 20
    assert (found > 0).mean() > 0.45


def test_units_do_not_matter() -> None:
    time, channels, _ = turned_by_hand(np.random.default_rng(7), 8, 50.0)
    counts = {axis: 32768 + 4100 * f for axis, f in channels.items()}
    np.testing.assert_array_equal(detect(time, channels), detect(time, counts))


def test_a_quiet_recording_is_one_rest() -> None:
    rng = np.random.default_rng(2)
    position = detect(np.arange(5000) / 100, {"x": rng.standard_normal(5000)})
    assert position.min() == position.max() == 1


def test_the_real_unit_rests_38_times() -> None:
    # The long rest at the start and 37 poses; thresholds from 10 to 20 agree on it, see below.
    time, counts = accelerometers()
    position = detect(time, dict(zip("xyz", counts.T, strict=True)))
    assert position.max() == 38
    first = time[position == 1]
    assert first[-1] - first[0] > 50.0  # s: the initial rest
    for k in range(1, 39):
        rest = counts[position == k]
        assert len(rest) >= 100
        assert rest.std(axis=0).max() < 7.0  # counts; the noise is 3, one pose is settling
        norm = np.linalg.norm((rest.mean(axis=0) - [33100.0, 33270.0, 32400.0]) / 4060.0)  # about count per g
        assert norm == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("threshold", [12.0, 16.0, 20.0])
def test_the_count_does_not_hang_on_the_threshold(monkeypatch: pytest.MonkeyPatch, threshold: float) -> None:
    monkeypatch.setattr("gimbalcal.recording.detection.THRESHOLD", threshold)
    time, counts = accelerometers()
    assert detect(time, dict(zip("xyz", counts.T, strict=True))).max() == 38
