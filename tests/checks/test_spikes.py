"""Single rows that leap away and back are left out and told; knocks, turns, steps and noise are not."""

import numpy as np
import pytest

from gimbalcal import from_arrays
from gimbalcal.checks.spikes import spikes
from tests.golden import golden_text, refused

N = 4000


def still(seed, n=N):
    return np.asarray([0, 0, 9.81] + 0.01 * np.random.default_rng(seed).standard_normal((n, 3)))


def test_noise_steps_knocks_and_turns_do_not_leap():
    rng = np.random.default_rng(1)
    t = np.arange(200_000) / 100
    white, heavy = rng.standard_normal(len(t)), rng.standard_t(5, len(t))
    turning = 3 * np.sin(t) + 0.01 * white
    knocks = 0.01 * white + sum(
        5 * np.exp(-(((t - at) / 0.03) ** 2)) * np.cos(200 * (t - at)) for at in range(5, 1990, 50)
    )
    steps = np.repeat(rng.standard_normal(200), 1000) + 1e-3 * white
    coarse = np.round(0.6 * white)
    for x in (white, heavy, turning, knocks, steps, coarse, np.zeros(1000), np.arange(5.0)):
        assert not spikes({"x": x})["x"].any()


def test_leaps_are_found_at_rest_and_in_turns_and_few_of_them_only():
    rng = np.random.default_rng(2)
    x = np.sin(np.arange(20_000) / 100) + 0.001 * rng.standard_normal(20_000)
    at = np.arange(100, 19_000, 700)
    x[at] += rng.choice([-1, 1], len(at)) * rng.uniform(0.2, 3, len(at))
    np.testing.assert_array_equal(np.flatnonzero(spikes({"x": x})["x"]), at)
    x[::20] += 5.0
    assert not spikes({"x": x})["x"].any()


def test_a_knock_is_felt_by_several_channels():
    f = still(9)
    f[500] += [4.0, 0.3, -2.0]
    assert not any(found.any() for found in spikes(dict(zip("xyz", f.T, strict=True))).values())
    f[900, 1] += 4.0
    np.testing.assert_array_equal(np.flatnonzero(spikes(dict(zip("xyz", f.T, strict=True)))["y"]), [900])


def test_a_row_of_zeros_is_no_knock():
    f = np.array([0.2, 0.0, 0.0]) + still(17)  # 20 sigma: a knock shakes an axis by as much
    f[700] = 0.0
    np.testing.assert_array_equal(np.flatnonzero(spikes(dict(zip("xyz", f.T, strict=True)))["z"]), [700])


def test_rows_that_leap_are_left_out_and_said():
    f, w = still(3), 0.001 * np.random.default_rng(4).standard_normal((N, 3))
    f[[700, 1500, 3000], [0, 2, 1]] += [7.0, -20.0, 3.0]
    w[2100, 1] += 0.9
    r = from_arrays(np.arange(N) / 100, specific_force=f, angular_rate=w)
    assert len(r.time) == N - 4
    told = next(remark for remark in r.remarks if "leaps away" in remark)
    golden_text(told)
    assert np.ptp(r.triad("specific_force"), axis=0).max() < 0.2


def test_a_rest_may_be_one_row_and_a_slow_turn_too():
    f, position = still(5), np.ones(N)
    f[2000], position[2000], position[2001:] = [9.81, 0, 0], 2, 3
    assert len(from_arrays(np.arange(N) / 100, specific_force=f, position=position).time) == N
    w = 1e-4 * np.random.default_rng(6).standard_normal((N, 3))
    w[2000, 2] = 0.5  # rad in the second that it takes
    assert len(from_arrays(1.0 * np.arange(N), specific_force=still(7), angular_rate=w).time) == N


def test_what_no_sensor_reads_is_refused_as_before():
    f = still(8)
    f[100, 0] = 1e9
    with refused():
        from_arrays(np.arange(N) / 100, specific_force=f)


def test_a_leap_along_several_axes_is_found_and_a_knock_that_rings_is_none():
    f = still(10)
    f[500, :2] += [4.0, -3.0]
    f[900] = 0.0
    ringing = np.exp(-np.arange(40) / 6) * np.cos(np.arange(40))
    f[1500:1540] += ringing[:, None] * [4.0, 0.3, -2.0]
    found = spikes(dict(zip("xyz", f.T, strict=True)))
    np.testing.assert_array_equal(np.flatnonzero(found["x"]), [500])
    np.testing.assert_array_equal(np.flatnonzero(found["y"]), [500])
    np.testing.assert_array_equal(np.flatnonzero(found["z"]), [900])


def test_a_leap_in_a_turn_that_speeds_up_is_found():
    t = np.arange(20_000) / 100
    x = 5 * np.sin(2 * np.pi * t) + 0.002 * np.random.default_rng(11).standard_normal(len(t))
    x[[4025, 9000]] += [0.5, -0.5]  # where it turns fastest, and where it speeds up most
    np.testing.assert_array_equal(np.flatnonzero(spikes({"x": x})["x"]), [4025, 9000])


def test_rows_of_a_navigator_are_filled_and_said():
    f, w = still(12), 0.001 * np.random.default_rng(13).standard_normal((N, 3))
    w[2000:2400, 2] += 0.3 * np.sin(np.pi * np.arange(400) / 400) ** 2
    true = w[2150].copy()
    w[2150, 2], f[700, 0] = 0.0, -3.0
    r = from_arrays(np.arange(N) / 100, specific_force=f, angular_rate=w, kind="rotation")
    assert len(r.time) == N
    assert abs(r.triad("angular_rate") - w)[2150].max() == pytest.approx(true[2], abs=0.006)
    assert abs(r.triad("specific_force")[700, 0]) < 0.06
    golden_text(*r.remarks)


def test_two_rows_that_leap_alike_are_one_leap_and_a_knock_of_two_is_none():
    t = np.arange(20_000) / 100
    x = 5 * np.sin(2 * np.pi * t) + 0.002 * np.random.default_rng(18).standard_normal(len(t))
    at = np.array([3000, 3001, 4025, 4026, 9000, 9001])
    x[at] += np.repeat([0.5, -0.6, 3.0], 2)
    x[[12000, 12001]] += [0.5, 0.25]  # as a knock leaves them
    x[[15000, 15001, 15002]] += 0.5
    np.testing.assert_array_equal(np.flatnonzero(spikes({"x": x})["x"]), at)
    f = still(19)
    f[500:502] += [4.0, 0.3, -2.0]  # felt by an axis that does not leap
    f[900:902], f[1200:1202, 1] = 0.0, 5.0
    found = spikes(dict(zip("xyz", f.T, strict=True)))
    np.testing.assert_array_equal(np.flatnonzero(found["z"]), [900, 901])
    np.testing.assert_array_equal(np.flatnonzero(found["y"]), [1200, 1201])


def test_two_rows_of_a_navigator_are_filled_by_the_neighbours_of_both():
    f, w = still(20), 0.001 * np.random.default_rng(21).standard_normal((N, 3))
    w[2000:2400, 2] += 0.3 * np.sin(np.pi * np.arange(400) / 400) ** 2
    true = w[2150:2152].copy()
    w[2150:2152, 2] += 1.0
    r = from_arrays(np.arange(N) / 100, specific_force=f, angular_rate=w, kind="rotation")
    np.testing.assert_allclose(r.triad("angular_rate")[2150:2152], true, atol=0.006)
    golden_text(*r.remarks)


@pytest.mark.parametrize("noise", [0.0, 2e-6])
def test_a_gimbal_that_is_held_and_reads_something_else_in_a_row(noise):
    """Twelve rests of 60 rows; at zero the readout goes round from a full turn."""
    rng, position = np.random.default_rng(22), np.repeat(np.arange(1, 13), 60)
    inner = np.radians(90.0 * (position % 4)) + noise * rng.standard_normal(720)
    f = 9.81 * np.stack([0 * inner, np.sin(inner), -np.cos(inner)], axis=-1) + 1e-3 * rng.standard_normal((720, 3))
    axes = {"platform": 0 * inner, "inner": inner % (2 * np.pi), "middle": 0 * inner}
    axes["inner"][[150, 401, 402]] += np.radians([0.03, -0.02, -0.02])  # 100 arcsec and 72
    axes["middle"][500] += np.radians(1 / 3600)  # which nobody would see in the mean
    r = from_arrays(
        10.0 * np.arange(720), specific_force=f, gimbal_angle=axes, position=position, kind="multi-position",
        platform="space-stable", site={"latitude": (40.0, "deg")},
    )  # fmt: skip
    assert len(r.time) == 717
    golden_text(*r.remarks)


AXES = ("platform", "inner", "middle", "outer")


def test_a_static_run_leaves_out_any_channel_that_leaps():
    n, rng = 600, np.random.default_rng(14)
    t = 300.0 * np.arange(n)
    angle = np.degrees(7.292115e-5 * t)[:, None] * [1.0, 0, 0, 0] + 1e-4 * rng.standard_normal((n, 4))
    angle[[100, 200], [0, 2]] += [0.05, -0.02]
    f = [0, 0, 9.8] + 1e-4 * rng.standard_normal((n, 3))
    f[300] *= 1.1
    r = from_arrays(
        t,
        specific_force=f,
        gimbal_angle=dict(zip(AXES, np.radians(angle).T, strict=True)),
        kind="static-run",
        platform="space-stable",
        site={"latitude": (40.0, "deg")},
    )
    assert len(r.time) == n - 3
    assert any("row 101, row 201, row 301" in remark and "leaps away" in remark for remark in r.remarks)


def test_a_row_of_a_navigator_where_a_turn_begins_is_refused_by_name():
    w = 1e-6 * np.random.default_rng(15).standard_normal((N, 3))
    w[2000:, 1] += np.clip(np.arange(N - 2000) * 0.01, 0, 0.2)
    sound = from_arrays(np.arange(N) / 10, specific_force=still(16), angular_rate=w, kind="rotation")
    assert not any("leaps" in remark for remark in sound.remarks)
    w[2001, 1] = -2.0
    with refused():
        from_arrays(np.arange(N) / 10, specific_force=still(16), angular_rate=w, kind="rotation")
