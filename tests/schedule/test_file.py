"""schedule.toml there and back, and its refusals."""

import numpy as np
import pytest

from gimbalcal.platform import Axis, Platform
from gimbalcal.schedule import SCHEDULES, Hold, Schedule
from gimbalcal.schedule.file import read_schedule, schedule_toml
from tests.golden import refused


@pytest.mark.parametrize("name", SCHEDULES)
def test_a_schedule_comes_back(name, tmp_path):
    path = tmp_path / "schedule.toml"
    path.write_text(schedule_toml(SCHEDULES[name]))
    made = read_schedule(path)
    np.testing.assert_allclose(made.angles, SCHEDULES[name].angles, atol=2e-11)  # written to 1e-9 deg
    assert made.platform == SCHEDULES[name].platform
    assert made.holds[0].duration == SCHEDULES[name].holds[0].duration
    assert read_schedule(name) is SCHEDULES[name]


@pytest.mark.parametrize(
    "text",
    [
        '[platform]\nname = "moon"\n',
        "[schedule]\n",
        "[[schedule.holds]]\nyaw = 1.0\n",
        '[[schedule.holds]]\ninner = "a"\n',
    ],
)
def test_a_wrong_file_is_refused_with_the_place(text, tmp_path):
    path = tmp_path / "schedule.toml"
    path.write_text(text)
    with refused():
        read_schedule(path)


def test_an_unknown_name_lists_the_known_ones():
    with refused():
        read_schedule("nobody-7")


def test_a_platform_of_ones_own_and_a_title_with_quotes_are_kept(tmp_path):
    own = Platform("tilt table", (Axis("roll", "x"), Axis("pitch", "y", -1, np.pi / 2)))
    made = Schedule('bench "4"', own, (Hold((0.0, 0.5)), Hold((1.0, -0.5))))
    path = tmp_path / "schedule.toml"
    path.write_text(schedule_toml(made))
    again = read_schedule(path)
    assert (again.name, again.platform.axis_names) == (made.name, ("roll", "pitch"))
    assert again.platform.axes[1].sign == -1
    np.testing.assert_allclose(again.platform.attitude([0.3, 0.4]), own.attitude([0.3, 0.4]), atol=1e-12)
