"""Optimal positions: against exhaustive search, against the published schedules, and the words for what is not seen."""

from itertools import combinations_with_replacement

import numpy as np
import pytest

from gimbalcal.design.optimal import (
    assess_schedule,
    assessed_design,
    criterion_gains,
    criterion_value,
    design,
    optimise,
    position_response,
)
from gimbalcal.design.rig_positions import (
    PositioningRig,
    angle_grid,
    design_parameters,
    free_rig,
    rig_of,
    whitened_rows,
)
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.estimate.accelerometers.multiposition import TERMS
from gimbalcal.platform import KNOWN
from gimbalcal.schedule import EIGHTEEN_POSITIONS, FIFTEEN_POSITIONS, Schedule
from tests.golden import golden_text, refused

TABLE = KNOWN["two-axis-table"]


@pytest.mark.parametrize("criterion", ["D", "A"])
@pytest.mark.parametrize("part", [False, True])
def test_exchange_finds_the_best_of_all_choices(criterion, part):
    rng = np.random.default_rng(8)
    rows = 5 * rng.standard_normal((9, 1, 3))
    interest = np.array([True, True, not part])
    best = max(
        combinations_with_replacement(range(9), 4), key=lambda c: criterion_value(rows[list(c)], criterion, interest)
    )
    found = optimise(rows, 4, criterion, interest, seed=1)
    assert criterion_value(rows[found], criterion, interest) == pytest.approx(
        criterion_value(rows[list(best)], criterion, interest)
    )


@pytest.mark.parametrize("criterion", ["D", "A"])
def test_gain_is_the_change_of_the_value(criterion):
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((6, 3, 4))
    interest = np.array([True, False, True, True])
    F = np.eye(4) + np.einsum("cip,ciq->pq", rows[:3], rows[:3])
    before = criterion_value(rows[:3], criterion, interest)
    worth = criterion_gains(rows, F, criterion, interest)
    for c in range(6):
        after = criterion_value(np.concatenate([rows[:3], rows[c : c + 1]]), criterion, interest)
        assert worth[c] == pytest.approx(after - before, abs=1e-12)  # the same algebra by another route


def test_fifteen_positions_beat_the_published_fifteen():
    d = design(free_rig(TABLE, np.pi / 12), 15, criterion="A")
    against = d.against["wang2019-15"]
    assert len(d.schedule.holds) == 15
    assert against.value > against.value_of_other
    assert against.sigma_ratio < 0.95
    assert against.criterion_ratio < 0.95
    assert d.unsupported == []
    written = d.to_dict()["against"]["wang2019-15"]
    assert (written["A_value"], written["criterion_ratio_equal_time"]) == (against.value, against.criterion_ratio)


def test_predicted_sigma_is_that_of_a_calibration():
    """Two routes: the design's prediction and the Cramer-Rao bound of the pulse model at unit scale."""
    from gimbalcal.campaign.trials import POSITIONS
    from gimbalcal.estimate.pulses.gravity_norm import accelerometer_pulses

    rig = free_rig(TABLE, gravity=9.8, accelerometer=1e-5)
    wanted = design_parameters(rig, TERMS)
    sigma = assess_schedule(FIFTEEN_POSITIONS, rig, wanted)[0]
    bound = accelerometer_pulses(POSITIONS[None] * 9.8, 9.8, 1e-5).sigma[0]
    bias = [s for p, s in zip(wanted, sigma, strict=True) if p.effect == "bias"]
    # the prior, 500 ug against 2 ug, pulls the prediction down by its share of the information: below 1 %
    np.testing.assert_allclose(bias, bound[9:12], rtol=0.01)


def test_a_rig_that_only_leans_is_told_what_it_cannot_support():
    rig = PositioningRig(
        TABLE, {"outer": angle_grid(0, np.pi / 6, np.pi / 12), "inner": angle_grid(-np.pi, np.pi, np.pi / 4)}
    )
    assert any("K3:z would be uncertain by" in words for words in design(rig, 15).unsupported)


def test_with_angles_the_platform_zero_stays_one_with_a_rotation_of_the_triad():
    d = design(free_rig(KNOWN["space-stable"], setting=5e-6), 18)
    assert [set(u.direction) for u in d.unobservable] == [
        {"misalignment:xz", "misalignment:yz", "gimbal_zero:platform"}
    ]
    assert d.against[EIGHTEEN_POSITIONS.name].sigma_ratio < 1


def test_separating_confounded_effects_makes_both_known_better():
    rig = free_rig(TABLE, np.pi / 12)
    pair = ("scale_nonlinearity", "scale_factor_asymmetry")
    terms = ("bias", "scale_factor", "misalignment", *pair)
    wanted = design_parameters(rig, terms)
    plain, separated = (design(rig, 12, terms, separate=s).schedule for s in ((), pair))
    mine = np.array([p.effect in pair for p in wanted])
    sigma = [assess_schedule(s, rig, wanted)[0][mine] for s in (plain, separated)]
    assert np.prod(sigma[1]) < np.prod(sigma[0])


def test_unknown_effects_and_criteria_are_refused():
    with refused():
        design(free_rig(TABLE), 6, ("spin",))
    with refused():
        design(free_rig(TABLE), 6, criterion="E")


def test_words_name_the_published_schedules():
    d = design(rig_of("two-axis-table", 45.0, None), 15)
    golden_text(d.in_words)


@pytest.mark.parametrize("criterion", ["D", "A"])
def test_a_schedule_against_itself_is_worth_the_same_and_twice_the_positions_too(criterion):
    rig = free_rig(TABLE, accelerometer=1e-7)  # far below the priors, which do not double
    twice = Schedule("twice", TABLE, 2 * FIFTEEN_POSITIONS.holds)
    d = assessed_design(FIFTEEN_POSITIONS, rig, design_parameters(rig, TERMS), criterion, (FIFTEEN_POSITIONS, twice), 0)
    for name in ("wang2019-15", "twice"):
        assert d.against[name].criterion_ratio == pytest.approx(1, rel=1e-3)
        assert d.against[name].sigma_ratio == pytest.approx(1, rel=1e-3)


def test_a_noisy_unit_is_told_which_orders_it_cannot_support():
    quiet, noisy = (design(rig_of("two-axis-table", 45.0, None, ug), 15).unsupported for ug in (1.0, 1000.0))
    assert quiet == []
    assert {words.split(":")[0] for words in noisy} >= {"scale_nonlinearity", "K3"}


def test_positions_that_leave_the_smallest_error_of_a_days_navigation():
    """Ten positions chosen for the navigator leave less of it than ten that are D-optimal."""
    rig = rig_of("space-stable", 90.0, 5.0)
    d = design(rig, 10, criterion="position")
    wanted = design_parameters(rig, BASELINE["multi-position"])
    S = position_response(rig, wanted, (), 40.0)
    usual = design(rig, 10).schedule
    own, other = (criterion_value(whitened_rows(s.angles, rig, wanted), "position", S) for s in (d.schedule, usual))
    assert -own < 0.98 * -other
    assert f"{np.sqrt(-own):.3g} m of" in d.in_words
    golden_text(d.in_words)
    with refused():
        design(rig_of("three-axis-table", 90.0, 5.0), 6, criterion="position")
