"""A recording made in Python is completed as a file is when it is read."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Counts, Readout, Residual
from gimbalcal.effects.accelerometer import ScaleFactor
from gimbalcal.estimate.unit import inertial_unit
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site, read, with_rests_as_positions, write


def by_hand(noise=0.003, rests=14):
    """A unit held still in many attitudes and turned from one to the next, at 50 Hz; nothing but its readings."""
    rng = np.random.default_rng(3)
    force: list[Array] = []
    held = rng.standard_normal((rests, 3))
    held *= 9.8 / np.linalg.norm(held, axis=1)[:, None]
    for here, there in zip(held, np.roll(held, -1, axis=0), strict=True):
        force.append(np.tile(here, (200, 1)))
        way = np.linspace(0, 1, 100)[:, None]
        moved = (1 - way) * here + way * there
        force.append(9.8 * moved / np.linalg.norm(moved, axis=1)[:, None])
    f = np.concatenate(force)
    f += noise * rng.standard_normal(f.shape)
    channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
    units = dict.fromkeys(channels, "m/s^2")
    return Recording("multi-position", "hand", BENCH, Site(gravity=9.8), {}, 0.02 * np.arange(len(f)), None, channels,
                     units=units)  # fmt: skip


def test_rests_and_scatter_are_those_of_the_same_recording_in_a_file(tmp_path):
    made = by_hand()
    write(made, tmp_path, "samples.csv")
    there, here = read(tmp_path), with_rests_as_positions(made)
    np.testing.assert_array_equal(here.position, there.position)
    assert here.position.max() == 14
    assert here.scatter.keys() == there.scatter.keys()
    assert here.scatter["specific_force", "x"] == pytest.approx(there.scatter["specific_force", "x"], rel=1e-6)
    assert here.sigma("accelerometer") == pytest.approx(0.003, rel=0.1)


def test_what_is_there_stays():
    made = with_rests_as_positions(by_hand())
    assert with_rests_as_positions(made) is made
    still = replace(made, scatter={}, channels={key: np.full(len(made.time), 1.0) for key in made.channels})
    assert with_rests_as_positions(still).scatter == {}


def test_a_calibration_in_python_is_that_of_the_file(tmp_path):
    made = by_hand()
    write(made, tmp_path, "samples.csv")
    one, other = inertial_unit(made), inertial_unit(read(tmp_path))
    np.testing.assert_allclose(one.values, other.values, atol=1e-6 * one.sigmas.max())
    np.testing.assert_allclose(one.sigmas, other.sigmas, rtol=1e-6)


def test_a_correction_changes_the_noise_as_it_changes_the_readings():
    r = replace(with_rests_as_positions(by_hand()), noise={"accelerometer": 0.003, "gyroscope": 1.0})
    s = np.array([0.5, 0.0, 0.0])  # reads two thirds of what is there
    unit = Calibration("test", (ScaleFactor(s=s),), (), np.zeros((0, 0)), (), Residual(0.0, 0, {}))
    there = unit.apply(r)
    ratio = {a: there.scatter["specific_force", a] / r.scatter["specific_force", a] for a in "xyz"}
    assert ratio == pytest.approx({"x": 1.5, "y": 1.0, "z": 1.0})
    assert there.noise["accelerometer"] == pytest.approx(0.003 * np.sqrt((1.5**2 + 2) / 3))  # one sigma for three
    assert there.noise["gyroscope"] == 1.0
    back = unit.corrupt(there)
    assert back.scatter["specific_force", "x"] == pytest.approx(r.scatter["specific_force", "x"])
    counted = replace(unit, readout=Readout(accelerometers=Counts((1e-3, 1e-3, 1e-3))))
    assert counted.corrupt(there).scatter["specific_force", "y"] == pytest.approx(
        1e3 * r.scatter["specific_force", "y"]
    )
