"""The zero of an encoder is one number of the hardware, in whichever sense a recording counts its readouts."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual, from_dict
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import CATALOGUE, parameters, values, with_values
from gimbalcal.estimate.static_run.system import calibrate_static_run, static_readings
from gimbalcal.forward import jacobian, predict
from gimbalcal.inference.information import information, solve
from gimbalcal.kinematics import navigation_to_platform, stimulus_from_angles
from gimbalcal.platform import SPACE_STABLE, SPACE_STABLE_INERTIAL, Axis, Platform
from gimbalcal.simulate import simulate

ARCSEC = np.deg2rad(1 / 3600)
ZEROS = {"platform": 24.0, "inner": -41.0, "middle": 33.0, "outer": 15.0}  # arcsec
LATITUDE, START = np.deg2rad(40.0), np.deg2rad(25.0)
TINY = {"value": 1e-6, "unit": "arcsec"}  # a noise that is stated and does not matter: 5e-12 rad


def recording(kind):
    """A recording of perfect sensors on a platform whose encoders have these zeros."""
    schedule: dict[str, Any] = {"name": "wu2018-18", "dwell": {"value": 20.0, "unit": "s"}}
    noise: dict[str, Any] = {"accelerometer": {"value": 1e-6, "unit": "ug"}, "gimbal_angle": TINY}
    if kind == "static-run":
        schedule = {"duration": {"value": 24.0, "unit": "h"}, "rate": {"value": 1 / 600, "unit": "Hz"},
                    "start_angle": {"value": 25.0, "unit": "deg"}}  # fmt: skip
        noise["attitude"] = TINY
    return simulate({
        "format": 1, "kind": kind, "title": kind, "seed": 1, "platform": {"name": "space-stable"},
        "site": {"latitude": {"value": 40.0, "unit": "deg"}, "height": {"value": 60.0, "unit": "m"}},
        "schedule": schedule, "noise": noise, "truth": {"gimbal_zero": ZEROS},
    })[0]  # fmt: skip


def zeros(effects):
    return values(effects, parameters(CATALOGUE["gimbal_zero"], SPACE_STABLE.axis_names)) / ARCSEC


def from_positions(r):
    """The zeros by least squares on the force; that of the outer gimbal, whose axis is vertical, is not among them."""
    wanted = parameters(CATALOGUE["gimbal_zero"], SPACE_STABLE.axis_names)[:3]
    s, effects = stimulus_from_angles(r), with_values((), wanted, np.zeros(3), SPACE_STABLE.axis_names)
    for _ in range(3):
        left = r.triad("specific_force") - predict(r.platform, s, effects)["specific_force"]
        J = jacobian(r.platform, s, effects, wanted)["specific_force"]
        step = solve(information(J / 1e-9, left / 1e-9, wanted))
        effects = with_values(effects, wanted, values(effects, wanted) + step.x, SPACE_STABLE.axis_names)
    return Calibration("zeros", effects, wanted, step.covariance, (), Residual(0.0, 0, {}))


def from_static_run(r):
    """On a base known to be level, with the zero of the inner gimbal, which is not logged, known from elsewhere.

    The phase is what the platform gimbal reads, so a turn about the pole takes up its zero.
    """
    every = parameters(CATALOGUE["gimbal_zero"], r.platform.axis_names)
    inner = with_values((), every[1:2], np.array([ZEROS["inner"] * ARCSEC]), r.platform.axis_names)
    polar = [p for p in parameters(CATALOGUE["polar_axis_misalignment"]) if p.axis == "polar"]
    made = calibrate_static_run(static_readings(r), inner, (every[0], *every[2:], *polar))
    x = values(made.effects, every)
    return replace(made, effects=with_values((), every, x, SPACE_STABLE.axis_names), parameters=every,
                   covariance=np.eye(4))  # fmt: skip


MAKERS = {"multi-position": from_positions, "static-run": from_static_run}


@pytest.mark.parametrize("kind", MAKERS)
def test_a_gimbal_zero_that_was_simulated_is_estimated_with_its_sign(kind):
    """It was +24 arcsec in a multi-position truth and -24 arcsec in a static one."""
    told = zeros(MAKERS[kind](recording(kind)).effects)
    expected = np.array(list(ZEROS.values()))
    if kind == "multi-position":
        told[3], expected[3] = 0.0, 0.0
    np.testing.assert_allclose(told, expected, atol=1e-2)


@pytest.mark.parametrize("origin", MAKERS)
def test_one_calibration_file_corrects_the_angles_of_both_kinds(origin):
    made = from_dict(json.loads(json.dumps(MAKERS[origin](recording(origin)).to_dict())))

    held = made.apply(recording("multi-position"))
    toward = -held.site.gravity * SPACE_STABLE.attitude(held.angles())[..., 2]
    np.testing.assert_allclose(held.triad("specific_force"), toward, atol=9.8 * 0.02 * ARCSEC)

    run = made.apply(recording("static-run"))
    inertial = navigation_to_platform(START + EARTH_RATE * run.time, LATITUDE)
    angles = run.angles()
    if origin == "multi-position":  # does not know the outer gimbal, whose readout runs against its zero
        angles[:, 3] -= ZEROS["outer"] * ARCSEC
    angles[:, 1] += ZEROS["inner"] * ARCSEC  # not logged: its readout is held at zero
    np.testing.assert_allclose(SPACE_STABLE_INERTIAL.attitude(angles), inertial, atol=0.02 * ARCSEC)


def test_a_calibration_added_to_a_static_run_and_taken_off_again_changes_nothing():
    run = recording("static-run")
    wanted = parameters(CATALOGUE["gimbal_zero"], SPACE_STABLE.axis_names)
    effects = with_values((), wanted, np.array(list(ZEROS.values())) * ARCSEC, SPACE_STABLE.axis_names)
    made = Calibration("truth", effects, wanted, np.eye(4), (), Residual(0.0, 0, {}))
    off = made.apply(run).angles() - run.angles()
    expected = np.broadcast_to([-24.0, 33.0, -15.0], (len(off), 3))
    np.testing.assert_allclose(off[:, [0, 2, 3]] / ARCSEC, expected, rtol=1e-6)
    np.testing.assert_allclose(made.corrupt(made.apply(run)).angles(), run.angles(), atol=1e-15)


def test_a_platform_that_is_not_known_by_name_is_its_own_drawing():
    mount = Platform("mount", (Axis("declination", "y", -1), Axis("hour_angle", "z", 1)))
    assert mount.sense == (1, 1)
    assert Platform("space-stable", mount.axes).sense == (1, 1)  # another chain of the same name
