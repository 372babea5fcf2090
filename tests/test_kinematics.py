"""What the hardware experienced is told by angles, by the caller or by readings, and none is taken for another."""

from dataclasses import replace

import numpy as np

from gimbalcal.kinematics import stimulus_from_angles, stimulus_from_readings, stimulus_from_truth
from gimbalcal.platform import BENCH, SPACE_STABLE
from gimbalcal.recording import Recording, Site
from gimbalcal.schedule import EIGHTEEN_POSITIONS
from tests.golden import refused

G = 9.8


def read(platform=SPACE_STABLE, **more):
    """18 positions whose triads read what no hardware experienced."""
    angles = EIGHTEEN_POSITIONS.angles
    channels = {("gimbal_angle", a): angles[:, i] for i, a in enumerate(platform.axis_names)}
    channels |= {(q, a): v[:, i] for q, v in more.items() for i, a in enumerate("xyz")}
    return Recording("multi-position", "made", platform, Site(gravity=G), {}, 60.0 * np.arange(18),
                     np.arange(1, 19), channels)  # fmt: skip


FALSE = np.random.default_rng(1).standard_normal((18, 3))


def test_angles_tell_the_force_and_no_sensor_is_asked():
    s = stimulus_from_angles(read(specific_force=FALSE, angular_rate=FALSE))
    np.testing.assert_allclose(s.force, -G * EIGHTEEN_POSITIONS.gravity_directions(), atol=1e-14)
    np.testing.assert_array_equal(s.rate, np.zeros((18, 3)))


def test_readings_stand_in_only_where_no_gimbal_tells():
    s = stimulus_from_readings(read(specific_force=FALSE, angular_rate=2 * FALSE))
    np.testing.assert_array_equal(s.force, stimulus_from_angles(read()).force)
    np.testing.assert_array_equal(s.rate, 2 * FALSE)  # the readouts of rests say nothing of turning
    bench = stimulus_from_readings(read(BENCH, specific_force=FALSE))
    np.testing.assert_array_equal(bench.force, FALSE)
    np.testing.assert_array_equal(bench.rate, np.zeros((18, 3)))


def test_the_truth_is_the_caller_s_and_so_are_the_moves_between():
    force, rate = np.cumsum(FALSE, axis=0), FALSE**2
    s = stimulus_from_truth(read(specific_force=FALSE, angular_rate=FALSE), force, rate)
    np.testing.assert_array_equal(s.force, force)
    np.testing.assert_array_equal(s.rate, rate)
    np.testing.assert_allclose(s.move_force[1:], FALSE[1:], atol=1e-14)
    np.testing.assert_allclose(s.earlier_move_force[2:], FALSE[1:-1], atol=1e-14)
    assert not s.move_force[0].any()
    assert not s.earlier_move_force[:2].any()


def test_without_gimbals_no_angle_tells_the_force():
    with refused():
        stimulus_from_angles(replace(read(BENCH, specific_force=FALSE), title="still unit"))
