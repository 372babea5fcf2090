"""What a mount does is taken off: force, readouts and directions are then those of a perfect mount."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.calibration.mount_correction import SENSORS, mount
from gimbalcal.effects import CATALOGUE, Stage, parameters, values, with_values, zero_effect
from gimbalcal.forward import predict
from gimbalcal.kinematics import ideal_force, stimulus_from_angles, stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, SPACE_STABLE_INERTIAL, Axis, Platform
from gimbalcal.recording import Recording, Site
from tests.calibration.test_correction import drawn, table_recording

NEEDS = [(), ("temperature",), ("attitude",), ("position",)]  # what the recordings here have
HELD = [i for i, c in CATALOGUE.items() if c.stage not in SENSORS and "multi-position" in c.kinds]
HELD = [i for i in HELD if CATALOGUE[i].requires in NEEDS and CATALOGUE[i].stage is not Stage.ATTITUDE]
FREE = [i for i, c in CATALOGUE.items() if c.stage not in SENSORS and "static-run" in c.kinds]
SIGHT = [i for i, c in CATALOGUE.items() if c.stage not in SENSORS and "pointing" in c.kinds]


def calibration(*effects):
    return Calibration("test", effects, (), np.zeros((0, 0)), (), Residual(0.0, 0, {}))


def read_as(recording, effects):
    """The recording with what the model predicts in its channels."""
    s = stimulus_from_readings(recording)
    outputs = predict(recording.platform, s, effects, recording.kind)
    names = {"gimbal_angle": recording.platform.axis_names, "attitude_error": ("roll", "pitch", "yaw")}
    channels = dict(recording.channels)
    for quantity, axis in channels:
        if quantity in outputs and quantity != "angular_rate":
            channels[quantity, axis] = outputs[quantity][:, names.get(quantity, ("x", "y", "z")).index(axis)]
    return replace(recording, channels=channels)


@pytest.mark.parametrize("name", HELD)
def test_the_force_is_that_of_a_perfect_mount_at_the_corrected_readouts(name):
    """Also where two gimbals turn about one axis, as at several of the 18 positions."""
    effect = drawn(name, 3)
    made, true = calibration(effect), table_recording(3)
    read = read_as(true, [effect])
    there = made.apply(read)
    expected = ideal_force(true, there.angles())
    # products of three angles of a milliradian, as a vector of small turns is not quite a rotation
    np.testing.assert_allclose(there.triad("specific_force"), expected, rtol=0, atol=1e-9)
    back = made.corrupt(there)
    np.testing.assert_allclose(back.angles(), true.angles(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(back.triad("specific_force"), read.triad("specific_force"), rtol=0, atol=1e-11)


def static(n=48):
    time = 1800.0 * np.arange(n)
    zeros = {("specific_force", a): np.zeros(n) for a in "xyz"}
    zeros |= {("attitude_error", a): np.zeros(n) for a in ("roll", "pitch", "yaw")}
    phase = {("gimbal_angle", "platform"): 0.3 + 7.2921150e-5 * time}
    angles = phase | {("gimbal_angle", a): np.zeros(n) for a in ("middle", "outer")}
    temperature = {("temperature", ""): 20 + np.sin(time / 2e4)}
    made = Recording("static-run", "run", SPACE_STABLE_INERTIAL, Site(0.7, 60.0, 9.8), {}, time, None,
                     zeros | angles | temperature)  # fmt: skip
    return read_as(made, [])


@pytest.mark.parametrize("name", [i for i in FREE if CATALOGUE[i].requires in NEEDS])
def test_a_static_run_becomes_that_of_a_platform_that_stands(name):
    true, effect = static(), small(name)
    there = calibration(effect).apply(read_as(true, [effect]))
    s = stimulus_from_readings(there)  # its phase is what the corrected platform gimbal reads
    outputs = predict(there.platform, s, [], "static-run")
    # the phase is one for a whole run, where a turn of the mount may change as the run goes on: squares of 2e-5 rad
    np.testing.assert_allclose(there.angles(), outputs["gimbal_angle"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(there.triad("specific_force"), outputs["specific_force"], rtol=0, atol=1e-8)
    np.testing.assert_allclose(there.triad("attitude_error", ("roll", "pitch", "yaw")), 0.0, rtol=0, atol=1e-9)
    back = calibration(effect).corrupt(there)
    for key, expected in read_as(true, [effect]).channels.items():
        np.testing.assert_allclose(back.channels[key], expected, rtol=0, atol=1e-9, err_msg=str(key))


def small(name):
    """A hundredth of what is usual; no error of the inner gimbal, which nobody reads and which would stay."""
    effect = drawn(name, 5)
    wanted = parameters(CATALOGUE[name], SPACE_STABLE_INERTIAL.axis_names)
    x = np.array([0.0 if p.axis == "inner" else 0.01 for p in wanted]) * values([effect], wanted)
    return with_values([effect], wanted, x, SPACE_STABLE_INERTIAL.axis_names)[0]


def telescope(n=40):
    rng = np.random.default_rng(2)
    platform = KNOWN["alt-az"]
    lofts, turns = rng.uniform(0.3, 1.2, n), rng.uniform(-2, 2, n)
    angles = {"elevation": lofts, "azimuth": turns}
    channels: dict[tuple[str, str], Array] = {("gimbal_angle", a): v for a, v in angles.items()}
    channels |= {("true_angle", a): v for a, v in angles.items()}
    return Recording("pointing", "night", platform, Site(0.6), {}, 60.0 * np.arange(n), None, channels)


def on_a_pier(night):
    """The same stars with a mount whose axes stand on a third one, at an angle that nobody reads."""
    pier = Platform("pier", (*night.platform.axes, Axis("pier", "y", 1, 0.9)))
    return replace(night, platform=pier)


@pytest.mark.parametrize("night", [telescope(), on_a_pier(telescope())], ids=["two axes", "a third that is not read"])
@pytest.mark.parametrize("name", SIGHT)
def test_a_perfect_mount_sees_the_star_at_the_corrected_readouts(name, night):
    effect = drawn_for(name, night)
    s = stimulus_from_angles(night)
    seen = predict(night.platform, s, [effect], "pointing")["pointing"]
    angle = calibration(effect).apply(night).angles()
    np.testing.assert_array_equal(angle[:, 2:], 0.0)
    found = predict(night.platform, s.at(readout=angle, angle=angle), [], "pointing")["pointing"]
    np.testing.assert_allclose(found, seen, rtol=0, atol=1e-13)


def drawn_for(name, recording):
    names = recording.platform.axis_names
    wanted = parameters(CATALOGUE[name], names)
    x = np.array([p.sigma for p in wanted]) * np.random.default_rng(4).uniform(-2, 2, len(wanted))
    return with_values((zero_effect(CATALOGUE[name], names),), wanted, x, names)[0]


def test_nothing_is_taken_off_where_nothing_is_known_of_the_mount():
    assert mount(table_recording(1), (drawn("bias", 1), drawn("gyro_bias", 1))) is None
