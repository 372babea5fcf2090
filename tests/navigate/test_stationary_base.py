"""A perfect unit at rest stays where it is, however it stands; what is added moves it by known amounts and signs."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.earth import normal_gravity
from gimbalcal.navigate.space_stable_navigator import Aids
from gimbalcal.navigate.stationary_base import still_unit
from gimbalcal.navigate.uncertainty import navigation_errors, usual_references
from gimbalcal.recording import Site
from gimbalcal.rotation import exponential

L = np.deg2rad(40.0)
SITE = Site(L, 60.0, float(normal_gravity(L, 60.0)))
ASKEW = exponential(np.array([0.4, -1.1, 2.0]))


def added(run, more):
    return replace(run, channels={key: x + more.get(key, 0.0) for key, x in run.channels.items()})


@pytest.mark.parametrize("C_bn", [np.eye(3), ASKEW])
def test_a_perfect_unit_at_rest_stays_where_and_as_it_is(C_bn):
    run = still_unit(6.0, SITE, C_bn)
    found = navigation_errors(run, None, usual_references(run))
    assert found.position.max() < 0.01  # m
    assert np.abs(found.error[:, 4:]).max() < 1e-8


@pytest.mark.parametrize(("axis", "channel"), [("x", 0), ("y", 1)])
def test_a_force_that_steps_overshoots_as_its_damping_lets_it(axis, channel):
    """A level unit that feels 50 ug more to the north or east, once aligned, settles there, where it takes the
    vertical to be, after an overshoot of exp(-pi z / sqrt(1 - z^2)): position is navigator minus true."""
    z, b, run = 0.3, 50e-6, still_unit(4.0, SITE, np.eye(3))
    felt = added(run, {("specific_force", axis): b * SITE.gravity * (run.time > 600.0)})
    found = navigation_errors(felt, None, Aids(damping=z, alignment=600.0))
    moved = found.error[:, channel] * (np.cos(L) if channel else 1.0)
    assert moved.min() > -0.02 * b
    assert moved.max() / b == pytest.approx(1 + np.exp(-np.pi * z / np.sqrt(1 - z**2)), abs=0.03)
    assert moved[-1] / b == pytest.approx(1.0, abs=0.1)


def test_of_a_unit_that_turns_slowly_nobody_knows_how_it_stands():
    run = still_unit(2.0, SITE, np.eye(3))
    turning = added(run, {("angular_rate", "z"): np.deg2rad(0.1)})
    assert np.isnan(navigation_errors(turning, None, usual_references(turning)).error[:, 4:]).all()
    assert np.isfinite(navigation_errors(run, None, usual_references(run)).error).all()


def test_a_gyroscope_that_reads_too_much_turns_the_navigator_on():
    """0.1 deg/h about down are six arc minutes of yaw in an hour, navigator minus true, and little else."""
    run = still_unit(1.5, SITE, np.eye(3))
    found = navigation_errors(added(run, {("angular_rate", "z"): np.deg2rad(0.1) / 3600}), None, usual_references(run))
    hour = int(np.searchsorted(found.time, 3600.0))
    assert np.degrees(found.error[hour, 6]) == pytest.approx(0.1, rel=0.05)
    assert np.abs(found.error[hour, 4:6]).max() < 0.2 * found.error[hour, 6]
