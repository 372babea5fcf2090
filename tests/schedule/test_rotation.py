"""Rotation schedules: printed rows follow from the moves, files come back, the motion is what the moves say."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.rotation import exponential
from gimbalcal.schedule import ROTATIONS, Move, RotationSchedule
from gimbalcal.schedule.commands import contradictions
from gimbalcal.schedule.file import is_rotation, read_rotation, read_schedule, rotation_toml
from gimbalcal.schedule.trajectory import trajectory
from tests.golden import refused


@pytest.mark.parametrize("name", ROTATIONS)
def test_what_the_source_prints_follows_from_the_moves(name):
    assert contradictions(ROTATIONS[name]) == ()


def test_a_row_that_does_not_follow_is_told():
    cai, wei = ROTATIONS["cai2016-18"], ROTATIONS["wei2022-30"]
    wrong = (*cai.stated[:6], ("north", "west", "up"), *cai.stated[7:])
    assert contradictions(replace(cai, stated=wrong)) == (
        "row 7: the move leads to south, west, down, printed north, west, up",
    )
    moves = (*wei.moves[:5], replace(wei.moves[5], along="east"), *wei.moves[6:])
    assert contradictions(replace(wei, moves=moves)) == ("row 6: z points north by the rows above, printed east",)


@pytest.mark.parametrize("name", ROTATIONS)
def test_a_schedule_comes_back_from_its_file(name, tmp_path):
    path = tmp_path / "schedule.toml"
    path.write_text(rotation_toml(ROTATIONS[name]))
    assert is_rotation(path)
    made = read_rotation(path)
    np.testing.assert_allclose(made.attitudes(), ROTATIONS[name].attitudes(), atol=1e-10)
    one, two = trajectory(made), trajectory(ROTATIONS[name])
    assert one.duration == pytest.approx(two.duration)
    np.testing.assert_allclose(one.begin, two.begin)
    with refused():
        read_schedule(path)


def test_cai_takes_3870_s_and_every_face_is_up_once():
    cai = ROTATIONS["cai2016-18"]
    assert trajectory(cai).duration == pytest.approx(3870.0)
    assert {tuple(-C[2].round()) for C in cai.attitudes()} == {
        tuple(s * e) for e in np.eye(3) for s in (1.0, -1.0)
    }  # fmt: skip


def test_the_motion_is_that_of_its_rates():
    moves = (Move("x", 2.0), Move("outer", -1.3, rate=0.5), Move("inner", 0.01), Move("y", 7.0, stop=1.0))
    own = RotationSchedule("own", ("north", "down", "west"), moves, rate=0.7, ramp=0.8, stop=2.0, inner="y")
    t = trajectory(own, tilt=np.array([0.01, -0.02, 0.03]), angle_error=np.array([1e-3, -2e-3, 1e-4, 0.0]))
    fine = np.linspace(0, t.duration, 40001)
    C, rate, slope = t.at(fine)
    mid = t.at((fine[1:] + fine[:-1]) / 2)[1]
    step = np.diff(fine)[:, None]
    np.testing.assert_allclose(C[1:], C[:-1] @ exponential(-mid * step), atol=1e-7)  # rows across corners
    np.testing.assert_allclose(np.cumsum(slope[1:] + slope[:-1], axis=0) * step / 2, rate[1:], atol=1e-3)
    np.testing.assert_allclose(C[-1], t.attitude[-1], atol=1e-12)
    assert np.abs(rate).max() == pytest.approx(0.7)
    still = ~t.moving(fine[:-1], fine[1:])
    assert not np.any(rate[:-1][still])
    assert t.moving(t.begin - 0.1, t.begin + 1e-9).all()


def test_without_a_ramp_the_rate_jumps():
    t = trajectory(RotationSchedule("own", ("east", "north", "up"), (Move("z", 1.0),), rate=0.5, ramp=0.0, stop=1.0))
    C, rate, slope = t.at(np.array([0.5, 2.0, 3.5]))
    np.testing.assert_allclose(rate[:, 2], [0.0, 0.5, 0.0])
    assert not slope.any()
    np.testing.assert_allclose(C[1], C[0] @ exponential(np.array([0, 0, -0.5])), atol=1e-15)


HEAD = 'kind = "rotation"\nstart = { x = "east", y = "north", z = "up" }\n'
MOVE = '[[moves]]\naxis = "x"\nangle = { value = 90, unit = "deg" }\n'


@pytest.mark.parametrize(
    "text",
    [
        HEAD,
        HEAD.replace('"up"', '"down"') + MOVE,
        HEAD.replace('"up"', '"sky"') + MOVE,
        HEAD + MOVE.replace('"x"', '"roll"'),
        HEAD + MOVE.replace("90", "0"),
        HEAD + MOVE + "speed = 3\n",
        HEAD + 'rate = { value = -1, unit = "deg/s" }\n' + MOVE,
        HEAD + 'ramp = { value = -1, unit = "s" }\n' + MOVE,
        HEAD + 'stop = { value = 100, unit = "deg" }\n' + MOVE,
        HEAD + 'outer = "x"\n' + MOVE,
    ],
)
def test_a_wrong_file_is_refused_with_the_place(text, tmp_path):
    (tmp_path / "schedule.toml").write_text(text)
    with refused():
        read_rotation(tmp_path / "schedule.toml")
