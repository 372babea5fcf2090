"""Dwells: visits of numbered positions, their means, and rests found where nobody numbered them."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Dwell, Recording, Site, dwell_means, dwells, read
from gimbalcal.recording.detection import detect_rests
from gimbalcal.recording.dwell import block_means, rests_are_means, usual_step, whole_means
from tests.golden import golden_text, refused
from tests.recording.folders import HEADER, folder, text
from tests.xsens import accelerometers


def recording(position, middle=None):
    n = 8 if position is None else len(position)
    channels: dict[tuple[str, str], Array] = {("specific_force", "x"): np.arange(n, dtype=float)}
    if middle is not None:
        channels["gimbal_angle", "middle"] = middle
    numbers = None if position is None else np.array(position)
    return Recording("multi-position", "", SPACE_STABLE, Site(), {}, np.arange(n, dtype=float), numbers, channels)


def test_a_position_may_be_visited_again():
    visits = dwells(recording([0, 1, 1, 0, 2, 1, 1, 1]))
    assert visits == (Dwell(1, 1, 3), Dwell(2, 4, 5), Dwell(1, 5, 8))


def test_without_positions_all_rows_are_one_visit():
    assert dwells(recording(None)) == (Dwell(1, 0, 8),)


def test_moving_all_the_time_is_no_dwell():
    assert dwells(recording([0, 0, 0])) == ()
    with refused():
        dwell_means(recording([0, 0, 0]))


def test_means_by_weight():
    rows = replace(recording([1, 1, 2, 2]), weight=np.array([1.0, 3.0, 2.0, 2.0]))
    means = dwell_means(rows)
    np.testing.assert_allclose(means.channels["specific_force", "x"], [0.75, 2.5], rtol=1e-15)
    assert means.weight.tolist() == [4.0, 4.0]
    assert means.position.tolist() == [1, 2]


def test_means_count_the_time_as_their_rows_do():
    """A recording begins with its first row, and sessions where their first rows are, not at the middle of a dwell."""
    rows = replace(recording([0, 1, 1, 1, 0, 2, 2, 2]), restarts=(5.0,))
    means = dwell_means(rows)
    assert rows.elapsed.tolist() == [0, 1, 2, 3, 4, 0, 1, 2]
    assert means.elapsed.tolist() == [2.0, 1.0]
    assert means.duration is not None
    assert means.duration.tolist() == [2.0, 2.0]
    assert rows.duration is None
    again = dwell_means(means.select(slice(1, 2)))
    assert again.elapsed.tolist() == [1.0]
    assert again.duration is not None
    assert again.duration.tolist() == [2.0]
    at = [s.time.tolist() for s in stimulus_from_truth(means, np.zeros((2, 3)), np.zeros((2, 3))).instants()]
    np.testing.assert_allclose(np.mean(at, axis=0), means.elapsed, rtol=1e-15)
    np.testing.assert_allclose(np.ptp(at, axis=0), 2 * (1 - 1 / len(at)), rtol=1e-15)


def test_means_of_angles_do_not_break_at_the_wrap():
    middle = np.radians([359.0, 1.0, 0.0, 10.0, 20.0, 30.0])
    means = dwell_means(recording([1, 1, 1, 2, 2, 2], middle))
    np.testing.assert_allclose(np.degrees(means.channels["gimbal_angle", "middle"]), [360.0, 20.0], rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 3), min_size=1, max_size=30), st.floats(-1e6, 1e6))
def test_dwells_do_not_care_about_the_origin_of_time(position, origin):
    rows = recording(position)
    assert dwells(rows) == dwells(replace(rows, time=rows.time + origin))
    covered = [i for d in dwells(rows) for i in range(d.start, d.stop)]
    assert covered == [i for i, p in enumerate(position) if p > 0]


def rests_as_means():
    """Two rests in rows that are means over half a minute, but for their last ones, and a way between them."""
    rows = recording([1, 1, 1, 0, 0, 0, 0, 2, 2, 2])
    time = np.array([0.0, 30.0, 45.0, 46.0, 47.0, 48.0, 49.0, 65.0, 95.0, 110.0])
    return replace(rows, time=time, weight=np.array([30.0, 29, 1, 1, 1, 1, 1, 30, 30, 1]))


def test_the_step_is_that_on_the_way_where_rests_are_means():
    means = rests_as_means()
    assert rests_are_means(means)
    assert usual_step(means) == 1.0
    samples = replace(means, weight=np.ones(10))
    assert not rests_are_means(samples)
    assert usual_step(samples) == 15.0  # of nine steps of 1, 15, 16 and 30 s
    assert whole_means(means).weight.tolist() == [30, 29, 30, 30]


def test_blocks_of_rows_end_where_rows_are_missing():
    rows = recording(None)
    blocks = block_means(replace(rows, time=np.array([0.0, 1, 2, 3, 13, 14, 15, 16])), 3)
    assert blocks.time.tolist() == [1.0, 3.0, 14.0, 16.0]
    assert blocks.weight.tolist() == [3, 1, 3, 1]
    assert blocks.channels["specific_force", "x"].tolist() == [1.0, 3.0, 5.0, 7.0]


def test_a_mean_goes_over_less_than_half_a_turn_as_it_was_turned():
    turned = recording([1, 1, 1], np.radians([10.0, 70.0, 130.0]))
    assert np.degrees(dwell_means(turned).channels["gimbal_angle", "middle"]) == pytest.approx(70.0)


# --- detection ------------------------------------------------------------------------------------------------------


def turned_by_hand(rng, rests, rate):
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
def test_every_rest_is_found_and_nothing_of_a_move(seed, rate):
    time, channels, edges = turned_by_hand(np.random.default_rng(seed), 15, rate)
    position = detect_rests(time, channels)
    assert position.max() == 15
    for k, (start, stop) in enumerate(edges, start=1):
        rows = np.flatnonzero(position == k)
        assert start <= rows[0]
        assert rows[-1] < stop
        # Half a window is lost at each end, and a little more where the window's variance strays.
        assert len(rows) / rate > (stop - start) / rate - 2 * 0.5 - 0.5


def test_slow_turns_on_a_table_are_no_rests():
    """Twenty degrees a second in coarse rows, with one rest of two seconds on the way."""
    rng = np.random.default_rng(3)
    turn = np.radians(np.concatenate([np.arange(24.0, 400), np.full(48, 400.0), np.arange(400.0, 1152)]))
    third = turn >= turn[800]  # about an axis that is off the vertical by 23 deg
    x, y = np.where(third, 0.4 * np.sin(turn), 0.05), np.where(third, 0.4 * np.cos(turn), np.sin(turn))
    f = 9.8 * np.stack([x, y, np.where(third, 0.92, np.cos(turn))], axis=-1)
    f = np.round(f + 0.04 * rng.standard_normal(f.shape), 2)
    position = detect_rests(np.arange(len(f)) / 20, dict(zip("xyz", f.T, strict=True)))
    assert position.max() == 1
    assert not position[:370].any()
    assert not position[430:].any()


@pytest.mark.parametrize("unit", [1.0, np.radians(1.0), 0.0])
def test_a_gyroscope_that_shakes_ends_a_rest(unit):
    rng = np.random.default_rng(5)
    time, channels, edges = turned_by_hand(rng, 10, 50.0)
    rate = np.radians(0.05) * rng.standard_normal((len(time), 3)) + np.radians([0.9, -0.4, 0.1])
    start, stop = edges[4]
    rate[start:stop, 1] += np.radians(5.0) * rng.standard_normal(stop - start)  # too small for the accelerometers
    gyros = dict(zip("xyz", rate.T / (unit or 1.0), strict=True))
    assert detect_rests(time, channels).max() == 10
    position = detect_rests(time, channels, gyros, unit)
    assert position.max() == 9
    assert not position[start:stop].any()


@pytest.mark.parametrize("unit", [1.0, np.radians(1.0)])
def test_a_turn_about_the_vertical_is_no_rest(unit):
    rng = np.random.default_rng(6)
    time, channels, edges = turned_by_hand(rng, 10, 50.0)
    rate = np.radians(0.05) * rng.standard_normal((len(time), 3)) + np.radians([0.9, -0.4, 0.1])
    start, stop = edges[6]
    rate[start : start + 100] += np.radians([0.0, 10.0, 0.0])
    position = detect_rests(time, channels, dict(zip("xyz", rate.T / unit, strict=True)), unit)
    assert position.max() == 10
    assert not position[start : start + 100].any()
    assert position[start + 150 : stop - 60].all()


def test_a_shaking_hand_and_a_slow_bias_are_rests():
    rng = np.random.default_rng(7)
    time, channels, _ = turned_by_hand(rng, 10, 50.0)
    tremor = np.radians(0.3) * np.abs(rng.standard_normal(len(time) // 100 + 1)).repeat(100)[: len(time)]
    rate = tremor[:, None] * rng.standard_normal((len(time), 3)) + np.radians(0.8) * (time / time[-1])[:, None]
    assert detect_rests(time, channels, dict(zip("xyz", rate.T, strict=True))).max() == 10


def test_a_rest_ends_where_the_logger_paused():
    time, channels, edges = turned_by_hand(np.random.default_rng(8), 4, 50.0)
    middle = sum(edges[2]) // 2
    assert detect_rests(time + 1e5 * (np.arange(len(time)) >= middle), channels).max() == 5
    assert detect_rests(time + 5.0 * (np.arange(len(time)) >= middle), channels).max() == 4


def test_a_pause_that_is_longer_than_the_rest_ends_it():
    """A logger that stood for 30 s in the middle of a rest of 4 to 9 s has seen two of them, which checks ask for."""
    time, channels, edges = turned_by_hand(np.random.default_rng(8), 4, 50.0)
    middle = sum(edges[2]) // 2
    position = detect_rests(time + 30.0 * (np.arange(len(time)) >= middle), channels)
    assert position.max() == 5
    assert position[middle] == position[middle - 1] + 1


def test_sensors_of_little_noise_rest_throughout_an_hour():
    """1 ug beside 1 g and 1e-4 deg/h beside turns of 5 deg/s: sums over the whole of it drowned them."""
    rng, n = np.random.default_rng(2), 120_000
    time, turn = 0.01 * np.arange(1, n + 1), (np.arange(n) // 3000) % 2 == 1
    angle = np.cumsum(np.where(turn, np.radians(5.0) * 0.01, 0.0))
    force = 9.8 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) + 1e-5 * rng.standard_normal((n, 3))
    rate = np.stack([0 * angle, 0 * angle, np.where(turn, np.radians(5.0), 0.0)], axis=1)
    rate += 5e-10 * rng.standard_normal((n, 3)) + 7e-5
    found = detect_rests(time, dict(zip("xyz", force.T, strict=True)), dict(zip("xyz", rate.T, strict=True)))
    assert found.max() == 20
    assert (found > 0).mean() > 0.45


def quiet_for(seconds, rate=50.0, seed=9):
    """White noise, a hundred times larger in 3 s before each quiet stretch and after the last."""
    rng = np.random.default_rng(seed)
    size = np.concatenate([np.repeat([100.0, 1.0], [round(3 * rate), round(s * rate)]) for s in (*seconds, 0.0)])
    return np.arange(len(size)) / rate, size * rng.standard_normal(len(size))


def test_a_rest_loses_half_a_window_at_both_ends_and_lasts_one_after_that():
    time, x = quiet_for([20.0, 1.5, 4.0])
    position = detect_rests(time, {"x": x})
    begin = np.array([3.0, 3.0 + 20.0 + 3.0 + 1.5 + 3.0])
    assert position.max() == 2  # half a second is left of the one between
    for k, lasts in ((1, 20.0), (2, 4.0)):
        rest = time[position == k]
        assert rest[0] - begin[k - 1] == pytest.approx(0.5, abs=0.05)
        assert rest[-1] - begin[k - 1] == pytest.approx(lasts - 0.5, abs=0.05)


@pytest.mark.parametrize(("rate", "lasts"), [(155.0, 0.9), (60.0, 1.5), (100.0, 2.5), (500.0, 0.8)])
@pytest.mark.parametrize("seed", range(3))
def test_the_window_follows_short_rests(seed, rate, lasts):
    """All of 30 dwells of 0.8 to 2.5 s are found, with moves of half a second between them."""
    rng = np.random.default_rng(seed)
    way, rest = round(0.5 * rate), round(lasts * rate)
    poses = rng.standard_normal((31, 3))
    poses /= np.linalg.norm(poses, axis=1, keepdims=True)
    s = (1 - np.cos(np.pi * np.linspace(0, 1, way)))[:, None] / 2
    parts = [np.concatenate([(1 - s) * a + s * b, np.repeat(b[None], rest, axis=0)]) for a, b in pairwise(poses)]
    force = np.concatenate(parts) + 3e-3 * rng.standard_normal((30 * (way + rest), 3))
    position = detect_rests(np.arange(len(force)) / rate, dict(zip("xyz", force.T, strict=True)))
    assert position.max() == 30
    assert (position > 0).mean() > 0.5 * rest / (way + rest)
    worst = max(float(np.ptp(np.concatenate(parts)[position == k], axis=0).max()) for k in range(1, 31))
    assert worst < 3 * 3e-3  # nothing of a move


@pytest.mark.parametrize(
    ("rate", "lasts", "shaking"),
    [(1.0, 30.0, 0.0), (5.0, 4.0, 0.0), (10.0, 2.0, 0.05), (10.0, 3.0, 0.0), (18.0, 2.0, 0.05), (50.0, 2.0, 0.05)],
)
def test_a_rig_that_turns_one_axis_at_a_time_dwells_at_every_rate(rate, lasts, shaking):
    """All of twelve faces are found, with 1.5 to 3 s between them in which the drive shakes, and no row of a turn.

    A seed of four may have no dwell: of a few windows at rest one in thirty grows by chance.
    """
    faces, count = np.array([[0, 0, 1], [0, 1, 0], [0, 0, -1], [0, -1, 0], [1, 0, 0], [0, 1, 0]] * 2), 0
    for seed in range(4):
        rng, parts = np.random.default_rng(seed), list[Array]()
        for a, b in pairwise([faces[-1], *faces]):
            s = np.pi / 2 * (np.arange(max(1, round(rate * rng.uniform(1.5, 3)))) + 0.5)[:, None]
            s /= len(s)
            parts += [np.cos(s) * a + np.sin(s) * b + shaking * rng.standard_normal((len(s), 3))]
            parts += [np.repeat(b[None], round(rate * lasts * rng.uniform(0.95, 1.05)), axis=0)]
        force = np.concatenate(parts)
        moving = np.concatenate([np.full(len(part), k % 2 == 0) for k, part in enumerate(parts)])
        force += 1e-3 * rng.standard_normal(force.shape)
        position = detect_rests(np.arange(len(force)) / rate, dict(zip("xyz", force.T, strict=True)))
        assert not position[moving].any()
        count += position.max() == 12
    assert count >= 3


@pytest.mark.parametrize("seed", range(3))
def test_six_faces_of_a_table_that_rocks_are_six_dwells(seed):
    """The axis that stands upright hardly scatters: a table that rocks by 6 mrad tilts gravity into the level ones."""
    rng, parts = np.random.default_rng(seed), list[Array]()
    faces = np.array([[0, 0, 1], [-1, 0, 0], [0, 0, -1], [0, 1, 0], [1, 0, 0], [0, -1, 0.0]])
    for a, b in pairwise([faces[-1], *faces]):
        s = np.linspace(0, np.pi / 2, 60)[:, None]
        rest = b + 6e-3 * np.cross(rng.standard_normal((150, 3)), b)
        parts += [np.cos(s) * a + np.sin(s) * b, rest]
    force = np.concatenate(parts) + 1.5e-3 * rng.standard_normal((6 * 210, 3))
    position = detect_rests(np.arange(len(force)) / 5.0, dict(zip("xyz", force.T, strict=True)))
    assert position.max() == 6
    assert np.mean(position.reshape(6, 210)[:, 60:] > 0) > 0.8
    assert not position.reshape(6, 210)[:, 1:59].any()


@pytest.mark.parametrize("seed", range(3))
def test_a_rest_before_a_drive_that_vibrates_is_found(seed):
    rng = np.random.default_rng(seed)
    time = np.arange(1700) / 64.0
    drives = time > 2.0
    force = np.array([-1.1, -0.1, 9.6]) + np.where(drives, 0.35, 0.015)[:, None] * rng.standard_normal((1700, 3))
    position = detect_rests(time, dict(zip("xyz", force.T, strict=True)))
    assert position.max() == 1
    assert np.mean(position[~drives] > 0) > 0.7
    assert not position[drives].any()


@pytest.mark.parametrize("kind", ["turned", "driven", "shaken"])
@pytest.mark.parametrize("seed", range(3))
def test_nothing_rests_in_a_unit_that_moves_all_the_time(seed, kind):
    """Turned by hand without a stop, on a rough road, in the air: the quietest second is a motion."""
    rng = np.random.default_rng(seed)
    time = np.arange(24000) / 200.0
    slow = np.stack([sum(np.sin(2 * np.pi * f * time + rng.uniform(0, 6)) for f in rng.uniform(0.05, 0.5, 4))
                     for _ in range(3)], axis=1)  # fmt: skip
    walk = np.cumsum(rng.standard_normal((len(time), 3)), axis=0) * 3e-3
    walk -= np.cumsum(np.concatenate([np.zeros((100, 3)), walk]), axis=0)[:-100] / np.arange(1, len(time) + 1)[:, None]
    size = np.exp(0.5 * slow[:, :1])
    motion = {"turned": 0.3 * slow, "driven": walk, "shaken": 0.1 * slow + size * walk}[kind]
    force = np.array([0, 0, 1.0]) + motion + 3e-3 * rng.standard_normal(motion.shape)
    assert detect_rests(time, dict(zip("xyz", force.T, strict=True))).max() == 0


@pytest.mark.parametrize(("noise", "count"), [(0.01, 1), (0.04, 0)])
def test_noise_beyond_that_of_any_accelerometer_is_vibration(noise, count):
    rng = np.random.default_rng(0)
    force = np.array([0.1, 0.2, 0.95]) + noise * rng.standard_normal((20_000, 3))
    assert detect_rests(np.arange(20_000) / 200.0, dict(zip("xyz", force.T, strict=True))).max() == count


def test_knocks_at_a_low_rate_end_no_stay():
    """Rows that stand out by ten sigma, of gyroscopes and accelerometers, in a unit that stays for an hour at 18 Hz."""
    rng = np.random.default_rng(1)
    for rate, n in ((18.0, 4000), (1.2, 1500)):
        time = np.arange(n) / rate
        force = np.array([9.4, -2.6, -4.9]) + 0.05 * rng.standard_normal((n, 3))
        turn = 2e-3 * rng.standard_normal((n, 3))
        force[rng.choice(n, n // 300, replace=False)] += 0.5 * rng.standard_normal(3)
        turn[rng.choice(n, n // 40, replace=False), 1] += 0.02
        position = detect_rests(time, *(dict(zip("xyz", x.T, strict=True)) for x in (force, turn)))
        assert position.max() == 1
        assert (position > 0).mean() > 0.9


def test_a_knock_does_not_end_a_stay_and_a_turn_does():
    rng = np.random.default_rng(3)
    time = np.arange(6000) / 100.0
    force = np.array([0.0, 0.0, 1.0]) + 1e-3 * rng.standard_normal((6000, 3))
    force[2000:2050] += 0.2 * np.sin(2 * np.pi * 20.0 * time[2000:2050, None])  # on the table
    force[4000:4400, 0] += np.sin(np.pi * np.linspace(0, 1, 400))  # away and back
    position = detect_rests(time, dict(zip("xyz", force.T, strict=True)))
    assert position.max() == 2
    assert (position[:1900] == 1).all()
    assert (position[2150:3900] == 1).all()
    assert (position[4500:] == 2).all()
    moved = np.array([0.0, 0.0, 1.0]) + 1e-3 * rng.standard_normal((6000, 3))
    moved[2000:2020, 1] += 0.2 * (-1.0) ** np.arange(20)
    assert detect_rests(time, dict(zip("xyz", moved.T, strict=True))).max() == 1
    moved[2020:, 0] += 2.6e-3  # 1.5 times the noise of a row
    assert detect_rests(time, dict(zip("xyz", moved.T, strict=True))).max() == 2
    rate = 1e-3 * rng.standard_normal((6000, 3))
    rate[2000:2050, 2] += np.radians(90.0) / 0.5  # about the vertical
    position = detect_rests(time, dict(zip("xyz", force.T, strict=True)), dict(zip("xyz", rate.T, strict=True)))
    assert position.max() == 3


def test_coarse_readings_rest():
    """Readings that mostly repeat have no variance in most windows: the floor is that of their quantisation."""
    rng = np.random.default_rng(4)
    x = np.round(0.3 + 0.25 * rng.standard_normal(40_000))
    assert (
        detect_rests(np.arange(40_000) / 5.0, {"x": x, "y": np.round(x + 0.1 * rng.standard_normal(40_000))}).min() == 1
    )


def test_noise_of_few_samples_in_a_second_scatters_and_is_a_rest():
    rng = np.random.default_rng(10)  # the variance of five samples is ten times its tenth part once in thirty
    assert detect_rests(np.arange(3000) / 4.0, {"x": rng.standard_normal(3000)}).tolist() == [1] * 3000


def test_a_gyroscope_is_judged_by_what_it_does_at_rest():
    """A bias of 3 deg/s, and six times its usual noise, are no turn; 10 deg/s more all along are."""
    rng = np.random.default_rng(12)
    time, channels, edges = turned_by_hand(rng, 10, 50.0)
    rate = np.radians(0.05) * rng.standard_normal((len(time), 3)) + np.radians(3.0)
    rate[slice(*edges[3])] = 6 * (rate[slice(*edges[3])] - np.radians(3.0)) + np.radians(3.0)
    gyros = dict(zip("xyz", rate.T, strict=True))
    assert detect_rests(time, channels, gyros).max() == 10
    turning = slice(*edges[6])
    gyros["z"] = rate[:, 2] + np.radians(10.0) * ((time >= time[turning][0]) & (time <= time[turning][-1]))
    position = detect_rests(time, channels, gyros)
    assert position.max() == 9
    assert not position[turning].any()


def test_gyroscopes_alone_rest_while_their_bias_wanders_by_less_than_any_motion():
    rng, n = np.random.default_rng(4), 3000
    steps = rng.standard_normal((n, 3)) * [2e-4, 2e-6, 2e-6]
    rate = 2e-3 + 0.9 * np.cumsum(steps, axis=0) / 15 + 1e-5 * rng.standard_normal((n, 3))
    gyros = dict(zip("xyz", rate.T, strict=True))
    time = np.arange(n) / 50.0
    assert (detect_rests(time, gyros, gyros, gravity=False) > 0).mean() > 0.8
    assert (
        detect_rests(time, gyros, {a: 30 * x for a, x in gyros.items()}, rate_unit=0.0, gravity=False) > 0
    ).mean() < 0.5


def test_units_do_not_matter():
    time, channels, _ = turned_by_hand(np.random.default_rng(7), 8, 50.0)
    counts = {axis: 32768 + 4100 * f for axis, f in channels.items()}
    np.testing.assert_array_equal(detect_rests(time, channels), detect_rests(time, counts))


def test_a_quiet_recording_is_one_rest():
    rng = np.random.default_rng(2)
    position = detect_rests(np.arange(5000) / 100, {"x": rng.standard_normal(5000)})
    assert position.min() == position.max() == 1


def test_the_real_unit_rests_38_times():
    # The long rest at the start and 37 poses; thresholds from 10 to 20 agree on it, see below.
    time, counts = accelerometers()
    position = detect_rests(time, dict(zip("xyz", counts.T, strict=True)))
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
def test_the_count_does_not_hang_on_the_threshold(monkeypatch, threshold):
    monkeypatch.setattr("gimbalcal.recording.detection.THRESHOLD", threshold)
    time, counts = accelerometers()
    assert detect_rests(time, dict(zip("xyz", counts.T, strict=True))).max() == 38


def test_a_file_of_a_unit_that_never_rests_says_so(tmp_path):
    rng, time = np.random.default_rng(0), np.arange(4000) / 100.0
    angle = 2 * np.pi * 0.3 * time
    force = np.stack([np.sin(angle), np.zeros(4000), -np.cos(angle)], axis=1)
    rows = np.column_stack([time, force + 0.002 * rng.standard_normal((4000, 3)), 293 + 0.01 * time])
    header = re.sub(r"(position|middle) *= .*\n", "", HEADER)
    r = read(folder(tmp_path, header, text(rows, ["time_s", "accel_x", "accel_y", "accel_z", "temp"])))
    assert not r.position.any()
    golden_text(next(remark for remark in r.remarks if "never at rest" in remark))
