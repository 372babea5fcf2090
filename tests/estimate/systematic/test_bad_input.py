"""Recordings that are not what they say: one sentence that names the likeliest slip, or a result that asks about it."""

import re
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.checks.table import refuse_implausible
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.errors import InputError
from gimbalcal.estimate.systematic.calibrate import systematic
from gimbalcal.estimate.systematic.innovation_tests import outcome
from gimbalcal.methods import calibrate_each
from tests.estimate.systematic.table import NOISE, turning_unit
from tests.golden import golden_text

FORCE, RATE = "specific_force", "angular_rate"
SOUND = turning_unit(stop=15.0)
STEP = 0.05  # s


def held(q, change, recording=SOUND):
    """The recording whose columns of a quantity hold something else."""
    y = change(recording.triad(q).copy())
    return recording.with_channels({(q, a): y[:, i] for i, a in enumerate("xyz")})


def taken(recording):
    refuse_implausible(recording)
    return systematic(recording, "30")


def said(recording):
    with pytest.raises(InputError) as caught:
        taken(recording)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("recording 'a table'")
    return str(caught.value)


def row(k, value):
    """One row that holds something else."""

    def change(y):
        y[k, 0] = value
        return y

    return change


def test_a_sound_recording_passes():
    assert refuse_implausible(SOUND) == ()
    found = systematic(SOUND, "30")
    assert found.outcome == ""
    assert found.provenance["limits"] == []


@pytest.mark.parametrize(
    ("quantity", "change", "words"),
    [
        (FORCE, lambda y: y * [1, 1, 1 / 9.80665], 'if accelerometer z alone were in g; write unit = "g"'),
        (FORCE, lambda y: y * 1e6 / 9.80665, 'the numbers look like ug: write unit = "ug"'),
        (FORCE, lambda y: y * STEP, 'adds to the velocity: write quantity = "velocity_increment"'),
        (FORCE, lambda y: y * (1 - 9.797 / np.linalg.norm(y, axis=1))[:, None], "gravity has been taken off"),
        (FORCE, lambda y: y + np.array([0, 9.8, 0]), "or has an offset that is no bias"),
        (FORCE, lambda y: y[:, [1, 1, 2]], "specific_force x and y hold the same numbers"),
        (FORCE, row(500, 1e3), "at 25.05 s specific_force x is 1e\\+03 m/s\\^2, beyond anything"),
        (FORCE, lambda y: np.roll(y, 8, axis=0), "the accelerometers come 0.4 s after the gyroscopes"),
        (FORCE, lambda y: np.roll(y, -60, axis=0), "the gyroscopes come 3 s after the accelerometers"),
        (RATE, lambda y: y[:, [0, 2, 2]], "angular_rate y and z hold the same numbers"),
        (RATE, row(900, 1e16), "at 45.05 s angular_rate x is 1e\\+16 rad/s, beyond anything"),
        (RATE, lambda y: y * STEP, 'adds to the angle \\(write quantity = "angle_increment"'),
        (RATE, lambda y: y / 6, "if every rate were some (5.9|6|6.1) times what it is; correct the unit"),
        (RATE, np.degrees, 'if the rates are in deg/s \\(write unit = "deg/s"\\)'),
        (RATE, lambda y: y * [1, -1, 1], "a left-handed triad; .* for gyroscope y write sign = -1"),
        (RATE, lambda y: np.where(np.abs(y) < 1e-3, 0.0, y), "its rate was taken off, by a navigator or a dead band"),
    ],
)
def test_a_slip_is_named(quantity, change, words):
    assert re.search(words, said(held(quantity, change)))


def test_samples_that_were_lost_in_a_turn_are_missed_though_the_clock_goes_on():
    kept = np.abs(SOUND.time - 50.0) > 1.0
    shorter = replace(SOUND.select(kept), time=SOUND.time[: kept.sum()])
    golden_text(said(shorter))


def test_one_wrong_sample_of_a_turn_is_missed():
    spiked = held(RATE, lambda y: np.where((np.arange(len(y)) == 390)[:, None], y + 1.0, y))
    golden_text(said(spiked))


@pytest.mark.parametrize("stop", [0.0, 0.5])
def test_what_never_comes_to_rest_is_told(stop):
    golden_text(said(turning_unit(stop=stop)))


def test_turns_without_a_stop_between_are_not_called_large_errors():
    told = outcome({"nis": {}, "legs": {}}, 30, settled=False, unseen=10)
    golden_text(told)


def test_a_gain_that_no_such_unit_has_is_calibrated_and_asked_about():
    ((found, _),) = calibrate_each([held(RATE, lambda y: y * [1, 1.1, 1])], "systematic", states="30")
    k = [p.label for p in found.parameters].index("gyro_scale_factor:y")
    assert found.values[k] == pytest.approx(1 / 1.1 - 1, abs=4 * found.sigmas[k])
    golden_text(found.outcome)
    assert found.residual.navigation["nis"]["ratio"] < 1.1


def test_three_that_are_off_alike_are_one_slip():
    fast = systematic(replace(SOUND, time=1.05 * SOUND.time), "30")
    golden_text(fast.outcome)


def test_gains_that_are_off_alike_are_no_clock_where_another_clock_explains_nothing():
    square = parameters(CATALOGUE["quadratic_nonlinearity"])[0]
    bent = turning_unit((), (square,), [10 * square.sigma], stop=15.0)
    found = systematic(held(RATE, lambda y: 1.05 * y, bent), "30")
    sizes = [x for p, x in zip(found.parameters, found.values, strict=True) if p.effect == "gyro_scale_factor"]
    np.testing.assert_allclose(sizes, 1 / 1.05 - 1, rtol=0.1)
    golden_text(found.outcome)


def test_a_latitude_that_is_a_little_off_is_named():
    off = replace(SOUND, site=replace(SOUND.site, latitude=np.radians(36.2)))
    found = systematic(off, "30")
    near = re.search(r"a latitude of some (\d+\.\d) deg instead of 36\.2 deg", found.outcome)
    assert near
    assert float(near[1]) == pytest.approx(34.2, abs=0.4)


def test_a_clock_that_is_one_per_cent_off_is_no_latitude():
    """With it the Earth's axis stands eight degrees higher."""
    assert "a clock whose second is 0.99" in systematic(replace(SOUND, time=1.01 * SOUND.time), "30").outcome


def test_a_stated_noise_that_is_too_small_hides_no_other_error():
    site = replace(SOUND.site, latitude=np.radians(36.2))
    off = replace(SOUND, site=site, noise={**NOISE, "accelerometer": 0.1 * NOISE["accelerometer"]})
    assert "a latitude of some 34." in systematic(off, "30").outcome


def test_a_noise_that_is_not_so_is_named():
    found = systematic(replace(SOUND, noise={**NOISE, "gyroscope": 1e-3 * NOISE["gyroscope"]}), "30")
    golden_text(found.outcome)
