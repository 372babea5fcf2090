"""The course of one parameter, on numbers small enough to be worked out by hand."""

import numpy as np
import pytest

from gimbalcal.earth import YEAR
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.history.compare import CalibrationStep, UnitComparison
from gimbalcal.history.parameter_history import parameter_history

BIAS = parameters(CATALOGUE["bias"])[0]
TRIED = 42  # steps of six parameters over eight calibrations: one counts from 3.7 sigmas on


def of(
    x, sigma = 1.0, *, at = (), begin = 0.0,
    independent = (), allowed = np.inf):  # fmt: skip
    """A value a quarter of a year."""
    k = np.arange(len(x))
    return parameter_history(
        BIAS, at or k.tolist(), YEAR * (begin + k / 4), np.array(x, dtype=float), np.broadcast_to(sigma, k.shape) * 1.0,
        TRIED, independent or [True] * (max(at, default=len(x) - 1)), allowed,
    )  # fmt: skip


def test_what_stands_clearest_is_counted_in_its_sigmas():
    assert of([0, 6], [3, 4]).clear == pytest.approx(6 / 5)
    assert of([0, 2, 4, 6]).clear == pytest.approx(2 * np.sqrt(5))  # a line through -3, -1, 1, 3 halves


def test_a_drift_is_due_on_the_clock_of_the_calibrations():
    drift = of([0, 10, 20, 30], 0.5, begin=50.0)
    assert drift.drifts
    assert drift.time.tolist() == pytest.approx((YEAR * np.arange(4) / 4).tolist())
    assert drift.rate * YEAR == pytest.approx(40.0)
    assert drift.rate_sigma * YEAR == pytest.approx(4 * 0.5 / np.sqrt(5))
    assert drift.due == pytest.approx(YEAR * (50.75 + 3 * 0.5 / 40))  # three sigmas of the last
    assert of([0, 10, 20, 30], 0.5, begin=50.0, allowed=8.0).due == pytest.approx(YEAR * (50.75 + 8 / 40))


@pytest.mark.parametrize(("independent", "jumps"), [((True, True), (1,)), ((False, True), ()), ((True, False), ())])
def test_calibrations_that_share_a_recording_show_no_jump_across_another(independent, jumps):
    assert of([0, 50], at=(0, 2), independent=independent).jumps == jumps


def test_there_and_back_is_one_value_and_what_comes_later_a_jump():
    found = of([0, 0, 400, 0, 0, 0, 8, 8])
    assert (found.jumps, found.outliers) == ((6,), (2,))
    assert found.sizes[0] == pytest.approx((8.0, np.sqrt(1 / 5 + 1 / 2)))  # of five before and two after


def test_what_is_drift_is_no_jump():
    drift = of([0, 1000, 2030], 10.0)  # each change is seventy sigmas, and one off the line
    assert drift.drifts
    assert drift.jumps == ()


def test_a_step_counts_by_the_sigmas_of_both_sides():
    (size,) = (found := of([100, 100, 100, 130, 130, 130], [1, 2, 1, 2, 1, 2])).sizes
    assert found.jumps == (3,)
    assert size == pytest.approx((30.0, np.sqrt(1 / 2.25 + 1 / 1.5)))


def test_a_step_pays_for_the_places_where_it_could_be():
    """A line leaves 7.2 and the best of five steps 4.9, which is less, but by no more than 2 ln 5 of places."""
    found = of([0, 1, 2.2, 7.8, 9, 10])
    assert found.jumps == ()
    assert found.drifts


def test_beside_a_drift_the_change_that_stands_off_it_is_the_jump():
    drift = of([0, 100, 200, 310])  # 103 a quarter: 2 sigmas less twice, and 5 more
    assert drift.drifts
    assert drift.jumps == (3,)


def test_of_few_values_a_step_begins_where_the_later_ones_stand():
    found = of([0, 0, 100, 100])
    assert (found.jumps, found.outliers, found.drifts) == ((2,), (), False)
    assert (found.scatter, found.rate) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert found.sizes == ((pytest.approx(100.0), pytest.approx(np.sqrt(2))),)


def test_of_few_values_there_and_back_is_one_value_off_the_mean_of_the_others():
    found = of([0, 400, 0, 0])
    assert (found.jumps, found.outliers) == ((), (1,))
    assert found.sizes == ((pytest.approx(400.0), pytest.approx(np.sqrt(1 + 1 / 3))),)


def test_a_jump_is_a_surprise_of_either_sign():
    """One of 42 steps beyond 3.67 sigmas, up or down, is a chance of one in a hundred; 3.49 were two in a hundred."""
    assert of([0, 3.6 * np.sqrt(2)]).jumps == ()
    assert of([0, -3.75 * np.sqrt(2)]).jumps == (1,)


def test_a_drift_is_due_when_it_shows_in_a_calibration_as_good_as_the_last():
    drift = of([0, 10, 20, 30], [2.0, 0.5, 0.5, 0.25])
    assert drift.due == pytest.approx(YEAR * (0.75 + 3 * 0.25 / 40), rel=1e-3)


def test_of_several_parameters_the_first_to_be_due_counts():
    slow, fast = of([0, 1, 2, 3], 0.1), of([0, 2, 4, 6], 0.1)
    assert slow.due > fast.due
    due = UnitComparison("", (), (), (of([0, 0, 0, 0]), slow, fast)).due
    assert due.timestamp() == pytest.approx(fast.due)


def test_of_several_steps_chance_has_several_goes():
    steps = tuple(CalibrationStep(k, k + 1, 9.0, 1, p, False) for k, p in enumerate((0.5, 0.004, 0.002, 0.5)))
    assert UnitComparison("", (), steps, ()).significant == steps[2:3]  # one of four: beyond 0.0025
