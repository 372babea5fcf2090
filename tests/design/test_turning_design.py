"""The search for turns: published schedules are tours of a table, the fast sigma is the exact one, limits are kept."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from gimbalcal.cli import gimbalcal
from gimbalcal.design.turning import turning_experiment
from gimbalcal.design.turning_design import (
    Tour,
    TurningSearch,
    as_tour,
    design_turning,
    keeps_table_limits,
    neighbouring_tour,
    table_of,
    with_total_duration,
)
from gimbalcal.schedule import ROTATIONS
from gimbalcal.schedule.file import read_rotation
from gimbalcal.schedule.trajectory import trajectory
from tests.golden import golden_text

TABLE = table_of(45.0, 360.0, 10.0, 1.0, 1000.0)


@pytest.fixture(scope="module")
def search():
    return TurningSearch(TABLE, turning_experiment(34.2, "30"))


@pytest.mark.parametrize("name", ["cai2016-18", "wei2022-30", "xie2011-19"])
def test_a_published_schedule_is_a_tour_of_a_two_axis_table(search, name):
    tour = as_tour(ROTATIONS[name], TABLE)
    assert tour is not None
    made, published = search.schedule(tour), with_total_duration(ROTATIONS[name], TABLE.total, TABLE)
    np.testing.assert_allclose(made.attitudes(), published.attitudes(), atol=1e-12)
    assert trajectory(made).duration == pytest.approx(TABLE.total)
    assert trajectory(published).duration == pytest.approx(TABLE.total)


def test_turns_about_three_axes_are_none_of_it():
    assert as_tour(ROTATIONS["jia2014-9"], TABLE) is None


def test_the_sigma_of_the_search_is_that_of_the_schedule(search):
    tour = Tour((2, 0), ((0, 1), (1, 2), (0, -3), (1, -1), (0, 4), (1, 4)))
    np.testing.assert_allclose(search.sigma(tour), search.experiment.sigma(search.schedule(tour)), rtol=0.01)


def test_every_neighbour_that_is_allowed_keeps_the_limits():
    rng, tour, seen = np.random.default_rng(1), Tour((0, 0), ((0, 2), (1, 4), (0, -4))), set()
    for _ in range(400):
        tour = neighbouring_tour(tour, rng, 4) if rng.random() < 0.5 else tour
        near = neighbouring_tour(tour, rng, 4)
        if not keeps_table_limits(TABLE, near):
            continue
        at = np.array([near.start, *(((s, 0) if a == 0 else (0, s)) for a, s in near.turns)])
        assert np.abs(np.cumsum(at, axis=0)).max() <= 8
        seen.add(len(near.turns))
        tour = near
    assert len(seen) > 3


def test_it_beats_what_it_is_measured_by_and_says_so():
    d = design_turning(TABLE, 34.2, "30", ("xie2011-19",), "sum", tries=40, seed=2)
    assert trajectory(d.schedule).duration == pytest.approx(TABLE.total)
    assert np.mean([g.ratio for g in d.groups]) < 0.98
    assert {g.group for g in d.groups} >= {"gyro_bias", "scale_factor"}
    golden_text(d.in_words)


def test_the_63_turns_are_better_than_both_papers_in_every_group_at_equal_duration():
    table = table_of(90.0, 720.0, 10.0, 1.0, 3870.0)
    search = TurningSearch(table, turning_experiment(34.2, "51"))
    mine = search.experiment.sigma(ROTATIONS["turns-63"])
    assert trajectory(ROTATIONS["turns-63"]).duration == pytest.approx(3870.0)
    rivals = [(ROTATIONS[n], t) for n in ("cai2016-18", "wei2022-30") for t in (None, table)]
    theirs = [search.experiment.sigma(with_total_duration(schedule, 3870.0, own)) for schedule, own in rivals]
    for name, i in search.groups.items():
        assert mine[i].max() < 0.99 * min(s[i].max() for s in theirs), name


def test_own_axes_of_a_sensitivity_are_a_group():
    groups = TurningSearch(TABLE, turning_experiment(34.2, "51")).groups
    assert len(groups["gyro_g_sensitivity_rate, own axis"]) == 3
    assert len(groups["gyro_g_sensitivity_rate"]) == 6
    assert len(groups["accelerometer_lever_arm"]) == 3


def test_the_command_writes_a_schedule_that_observe_takes(tmp_path):
    arguments = ["design", "--kind", "rotation", "--states", "bias,gyro_bias", "--total", "700", "--tries", "10",
                 "--out", str(tmp_path), "--json"]  # fmt: skip
    result = CliRunner().invoke(gimbalcal, arguments, catch_exceptions=False)
    told = json.loads(result.stdout)
    assert trajectory(read_rotation(tmp_path / "schedule.toml")).duration == pytest.approx(told["total_s"])
