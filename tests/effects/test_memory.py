"""What the order of visits leaves: the way by which a force was reached, and how soon that is forgotten."""

import numpy as np

from gimbalcal.units import from_si, to_si
from tests.effects.stimulus import given, made

G = to_si(1.0, "g")
HELD = np.array([0.0, 1.0, 0.0, -1.0, 0.0])  # g along x, dwell by dwell: null is reached from both sides
SINCE = np.array([0.0, 300.0, 600.0])


def visited(held=HELD):
    """Three rows in each dwell, at once and five and ten minutes after the move."""
    force = np.zeros((3 * len(held), 3))
    force[:, 0] = np.repeat(held, 3) * G
    moves, earlier = (np.zeros_like(force) for _ in range(2))
    change = np.diff(held, prepend=held[0]) * G
    moves[:, 0], earlier[:, 0] = np.repeat(change, 3), np.repeat([0.0, *change[:-1]], 3)
    since = np.tile(SINCE, len(held))
    return given().at(
        force=force, move_force=moves, earlier_move_force=earlier, since_move=since, time=np.arange(len(force)) * 300.0
    )


def output(effect, held=HELD):
    """What the x axis adds (dwells, 3) [ug]."""
    return np.asarray(from_si(effect.contribution(visited(held))[:, 0], "ug")).reshape(-1, 3)


def test_hysteresis_tells_from_which_side_a_force_was_reached():
    y = output(made("accelerometer_hysteresis", h=[to_si(5.0, "ug"), 0, 0]))
    np.testing.assert_allclose(y[:, 0], [0, 5, -5, -5, 5], rtol=1e-6)
    back = output(made("accelerometer_hysteresis", h=[to_si(5.0, "ug"), 0, 0]), HELD[::-1])
    np.testing.assert_allclose(back[:, 0], [0, -5, 5, 5, -5], rtol=1e-6)  # the reversed order


def test_creep_is_in_proportion_to_the_move_and_a_third_after_its_time():
    y = output(made("post_move_creep", c=[to_si(30.0, "ug/g"), 0, 0], tau=300.0))
    np.testing.assert_allclose(y[:, 0], [0, 30, -30, -30, 30], atol=1e-12)
    np.testing.assert_allclose(y[1], 30 * np.exp([0.0, -1.0, -2.0]), rtol=1e-12)
    load = output(made("post_move_creep", l=[to_si(30.0, "ug/g"), 0, 0], tau=300.0))
    np.testing.assert_allclose(load[:, 0], 30 * HELD, atol=1e-12)  # a caged suspension is loaded anew


def test_two_moves_back_is_the_position_before_the_last():
    y = output(made("two_move_memory", m=[to_si(5.0, "ug/g"), 0, 0]))
    np.testing.assert_allclose(y[:, 0], [0, 0, 0, 5, 0], atol=1e-12)
