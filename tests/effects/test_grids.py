"""Starting values of non-linear constants: what the effect declares, as far as the recording tells it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.effect import Effect, Grid, constant, constants
from gimbalcal.effects.grids import MIN_SETTING_STEP_RAD, grid, highest_order, limits, values_between
from gimbalcal.kinematics import stimulus_from_angles
from tests.diagnose import static_plant
from tests.diagnose.plant import record

HELD = stimulus_from_angles(record(np.random.default_rng(2), dwell=20))  # 18 positions, 20 rows a second apart each
AT_REST = stimulus_from_angles(static_plant.record(np.random.default_rng(3)))  # 48 h, a row every 10 min


def of(effect, name, s):
    return grid(next(f for f in constants(CATALOGUE[effect]) if f.name == name), s)


@dataclass(frozen=True)
class Any(Effect):
    value: float = constant(1.0, unit="s", low=2.0, high=200.0)
    signed: float = constant(0.0, unit="rad", low=-1.0, high=1.0)
    lag: float = constant(1.0, unit="s", low=1.0, high=1e9, grid=Grid.LAG)
    few: float = constant(2.0, unit="1", low=2.0, high=9.0, grid=Grid.WHOLE)
    many: float = constant(2.0, unit="1", low=2.0, high=2000.0, grid=Grid.WHOLE)
    decay: float = constant(0.0, unit="1/h", low=0.0, high=1e-3, grid=Grid.DECAY)
    phase: float = constant(1.5, unit="1", low=0.2, high=3.0, grid=Grid.JUMP)


FIELDS = {f.name: f for f in constants(Any)}


@pytest.mark.parametrize(("step", "order"), [(90, 1), (45, 3), (60, 2), (22.5, 7), (30, 5)])
def test_equal_settings_tell_orders_below_that_of_nyquist(step, order):
    rng = np.random.default_rng(1)
    angle = np.deg2rad(np.arange(0, 360, step)) + 1e-4 * rng.standard_normal(round(360 / step))
    angle = np.repeat(angle, 3)[:, None] + 1e-5 * rng.standard_normal((3 * round(360 / step), 1))
    assert highest_order(replace(HELD, readout=angle)) == order


def test_a_gimbal_that_sweeps_tells_all_and_one_that_stands_still_tells_none():
    sweep = np.linspace(0.0, 2.0, 500)[:, None]
    assert highest_order(replace(HELD, readout=sweep)) > np.pi / MIN_SETTING_STEP_RAD - 2
    assert highest_order(replace(HELD, readout=0 * sweep + 1.0)) == 0
    assert highest_order(replace(HELD, readout=np.concatenate([sweep, 0 * sweep], axis=1))) > 100


def test_settings_on_no_common_step_tell_every_order():
    stars = np.random.default_rng(4).uniform(-np.pi, np.pi, (60, 1))
    assert highest_order(replace(HELD, readout=stars)) > 720  # the teeth of a large worm wheel
    nearly = np.deg2rad(15) * np.round(stars / np.deg2rad(15))
    assert highest_order(replace(HELD, readout=nearly)) == 11


def test_a_bearing_is_tried_at_every_order_that_the_positions_tell():
    assert of("bearing_wobble", "m", HELD).tolist() == [1, 2, 3]
    assert of("bearing_wobble", "m", AT_REST).tolist() == list(range(1, 13))


def test_few_whole_numbers_are_all_tried_and_many_in_even_ratios():
    assert grid(FIELDS["few"], AT_REST).tolist() == [2, 3, 4, 5, 6, 7, 8, 9]
    many = grid(FIELDS["many"], AT_REST)
    assert 5 <= len(many) <= 7
    assert np.array_equal(many, np.round(many))


def test_a_lag_is_no_shorter_than_half_a_row_and_no_longer_than_three_recordings():
    low, high = limits(FIELDS["lag"], AT_REST)
    assert (low, high) == (300.0, 3 * AT_REST.time[-1])
    x = grid(FIELDS["lag"], AT_REST)
    assert np.allclose(x[1:] / x[:-1], x[1] / x[0])


def test_a_positive_value_has_even_ratios_and_a_signed_one_even_steps():
    x, y = grid(FIELDS["value"], HELD), grid(FIELDS["signed"], HELD)
    assert np.allclose(np.diff(np.log(x)), np.log(100) / 6)
    assert np.allclose(np.diff(y), 2 / 6)
    assert values_between(FIELDS["value"], 3.0, 3.0, 7).tolist() == [3.0]


def test_a_jump_is_looked_for_where_it_was_and_in_even_steps_about_it():
    x = grid(FIELDS["phase"], HELD)
    assert 1.5 in x
    assert np.diff(np.delete(x, x.tolist().index(1.5))) == pytest.approx(2.8 / 6)


def test_an_instant_is_the_beginning_of_a_visit_or_any_where_nothing_moves():
    starts = of("bias_step", "epoch", HELD)
    assert len(starts) == 17
    assert np.array_equal([np.sum(HELD.time < t) for t in starts], 20 * np.arange(1, 18))
    still = of("bias_step", "epoch", AT_REST)
    assert 0 < still[0] < still[-1] < AT_REST.time[-1]


def test_positions_are_those_that_were_held_and_a_span_is_the_whole():
    assert of("position_blunder", "position", HELD).tolist() == list(range(1, 19))
    assert of("slow_bias_drift", "span", HELD).tolist() == [HELD.time[-1]]


def test_nothing_decays_or_within_the_recording():
    x = grid(FIELDS["decay"], AT_REST)
    assert x[0] == 0.0
    assert x[1] == pytest.approx(1 / AT_REST.time[-1])
    assert x[-1] == pytest.approx(1e-3)


def test_a_period_is_the_usual_one_with_others_a_third_of_a_line_apart():
    x = of("plumb_line_tide", "period", AT_REST)
    usual = CATALOGUE["plumb_line_tide"]().period
    assert usual in x
    assert np.allclose(np.diff(x), usual**2 / AT_REST.time[-1] / 3)
    assert np.abs(x / usual - 1).max() <= 0.05
