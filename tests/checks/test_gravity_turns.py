"""Turns between rests as their gyroscopes tell them: the order of steps, the level at rest, which count, how close."""

import numpy as np
import pytest

from gimbalcal.checks.input_errors import PERMUTATIONS, scale_correction
from gimbalcal.checks.measured_turns import RATE, MeasuredTurns, turns_of, turns_that_agree
from gimbalcal.effects.effect import TRIAD
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site
from gimbalcal.rotation import frame_rotation

RIGHT = np.pi / 2
AS_READ = scale_correction(RATE, TRIAD, 1.0, "")


@pytest.mark.parametrize("steps", [2, 3, 5])
def test_a_later_step_of_a_turn_is_about_the_axes_as_the_earlier_ones_left_them(steps):
    axes = "xyzxy"[:steps]
    w = RIGHT * np.array([np.eye(3)["xyz".index(a)] for a in axes])
    due = np.eye(3)
    for a in axes:
        due = frame_rotation(a, RIGHT) @ due
    none = np.zeros((1, 3, 1))
    made = MeasuredTurns([w / 0.5], [np.full(steps, 0.5)], np.zeros(1), none, none).turned(AS_READ)
    np.testing.assert_allclose(made[0], due, atol=1e-12)


@pytest.mark.parametrize(("off", "close"), [(0.0, True), (14.0, True), (16.0, False), (170.0, False)])
def test_a_turn_agrees_that_ends_within_fifteen_degrees_of_gravity(off, close):
    before, after = (np.array([[[0.0], [np.sin(a)], [np.cos(a)]]]) for a in np.radians([0.0, 90.0]))
    turn = MeasuredTurns([], [], np.zeros(0), before, after)  # what lay along z lies along y: turned by 90 deg about x
    assert turns_that_agree(turn, frame_rotation("x", np.radians(90.0 + off))[None]) == close


def in_turns(angles, creep=0.0):
    """A second of rest, then a turn of so many rad about x in a second and a second of rest, again and again.

    The gyroscope's bias grows by `creep` [rad/s] in a second.
    """
    step, n = 0.01, 100
    speed = 1 - np.cos(2 * np.pi * np.arange(n) / n)
    rate = np.concatenate([np.zeros(n), *(np.concatenate([a * speed, np.zeros(n)]) for a in angles)])
    position = np.concatenate([np.ones(n), *(np.repeat([0, k + 2], n) for k in range(len(angles)))]).astype(np.int64)
    time = step * np.arange(len(rate))
    along = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * step)])
    force = np.stack([0 * along, -np.sin(along), -np.cos(along)], axis=1)  # level at first, seen from the unit
    channels = {("specific_force", a): 9.8 * force[:, i] for i, a in enumerate("xyz")}
    channels |= {("angular_rate", a): creep * time + (rate if a == "x" else 0.0) for a in "xyz"}
    return Recording("multi-position", "", BENCH, Site(), {}, time, position, channels)


def test_of_a_turn_the_level_of_both_rests_is_taken():
    turns = turns_of(in_turns(np.array([1.0, 1.0, -1.5, 2.0]), creep=0.05))
    angle = [(w * dt[:, None]).sum(0) for w, dt in zip(turns.reading, turns.step, strict=True)]
    np.testing.assert_allclose(sorted(a[0] for a in angle), [-1.5, 1.0, 1.0, 2.0], atol=2e-3)
    np.testing.assert_allclose([a[1:] for a in angle], 0.0, atol=2e-3)
    assert turns.agreeing(AS_READ) == 4


def test_the_turns_that_move_gravity_most_are_taken(monkeypatch):
    monkeypatch.setattr("gimbalcal.checks.measured_turns.MAX_TURNS", 3)
    turns = turns_of(in_turns(np.array([0.6, 2.0, 0.7, -1.8, 0.8, 1.9])))
    angle = [float((w[:, 0] * dt).sum()) for w, dt in zip(turns.reading, turns.step, strict=True)]
    assert angle == pytest.approx([2.0, 1.9, -1.8], abs=1e-3)


def test_a_change_of_columns_and_back_is_none():
    for change in PERMUTATIONS:
        np.testing.assert_array_equal(change.inverse().matrix @ change.matrix, np.eye(3))
        np.testing.assert_array_equal(change.inverse(-1).matrix @ change.matrix, -np.eye(3))
