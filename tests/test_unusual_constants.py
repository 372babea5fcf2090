"""Constants that no unit has are a question, with the slip that explains them; the sigma of gravity is carried."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.calibration import Residual
from gimbalcal.calibration.readout import Counts, Readout
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.effects.sensor_grades import GRADES
from gimbalcal.errors import InputError
from gimbalcal.estimate.grade import Graded
from gimbalcal.methods import calibrate
from gimbalcal.platform import BENCH
from gimbalcal.recording import read, write
from gimbalcal.unusual_constants import beyond_grade, corrections, largest_usual, with_question
from tests.golden import golden_text
from tests.paths import DEVICE, STATIC, XSENS

HOUR = 3600.0


@pytest.fixture(scope="module")
def device():
    r = read(DEVICE)
    return r.select(np.arange(len(r.time)) % 10 == 0)


@pytest.fixture(scope="module")
def run():
    return read(STATIC)


def limit(grade, lasted=HOUR):
    return partial(largest_usual, Graded(GRADES[grade], ""), lasted)


def scaled(r, axes, factor, quantity="specific_force"):
    own = {(quantity, a): factor * r.channels[quantity, a] for a in axes}
    return r.with_channels(own)


def interchanged(r, a, b, quantity="attitude_error"):
    return r.with_channels({(quantity, a): r.channels[quantity, b], (quantity, b): r.channels[quantity, a]})


def moved(r, axis, degrees, quantity="gimbal_angle"):
    return r.with_channels({(quantity, axis): r.channels[quantity, axis] + np.radians(degrees)})


def elsewhere(r, degrees):
    return replace(r, site=replace(r.site, latitude=np.radians(degrees)))


@pytest.mark.parametrize("degrees", [43.0, 38.5])
def test_a_wrong_latitude_is_named(run, degrees):
    made, _ = calibrate([elsewhere(run, degrees)])
    golden_text(made.outcome)


def test_a_reversed_attitude_error_is_named_and_no_constants_with_it(run):
    """No model fits such a run: the iteration ends soon, and the constants are not those of the unit."""
    made, _ = calibrate([scaled(run, ["roll"], -1.0, "attitude_error")])
    assert "attitude error roll is of the opposite sign: write sign = -1" in made.outcome
    assert "usual is below" not in made.outcome


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: replace(r, time=r.time * 366.2422 / 365.2422), "the time is in sidereal seconds"),
        (lambda r: replace(r, time=1.05 * r.time), "the clock runs 4.76 % fast, or else the platform drifts"),
        (lambda r: scaled(r, ["roll", "pitch", "yaw"], 1 / 60, "attitude_error"), 'write unit = "arcmin" for them'),
        (lambda r: scaled(r, ["middle"], 10 / 9, "gimbal_angle"), "the middle angle is in gon"),
        (lambda r: interchanged(r, "roll", "pitch"), "attitude errors roll and pitch are interchanged"),
        (lambda r: moved(r, "platform", 5.0), "the zero of the platform angle is off by about 5.02 deg"),
    ],
    ids=["sidereal", "clock", "attitude", "gon", "interchanged", "zero"],
)
def test_what_explains_a_static_run_is_named(run, change, words):
    made, _ = calibrate([change(run)])
    assert words in made.outcome


def test_a_factor_of_all_accelerometers_is_no_question_about_each(device):
    made, _ = calibrate([scaled(device, "xyz", 10 / 9.80665)])
    assert "every accelerometer reads 1.96 % too much" in made.outcome


def test_an_accelerometer_read_in_another_range_is_named(device):
    forces = {k: x for k, x in device.channels.items() if k[0] == "specific_force"}
    made, _ = calibrate([scaled(replace(device, channels=forces, platform=BENCH), ["x"], 0.5)], "multiposition")
    assert "the accelerometer x is of another range, 2 times the one read" in made.outcome


def test_a_limit_is_in_the_unit_of_the_constant(device):
    """Large misalignments are printed in mrad, and three degrees are 52 of these."""
    made, _ = calibrate([device], "three-stage")
    (i,) = (i for i, p in enumerate(made.parameters) if p.label == "misalignment:xz")
    values = np.where(np.arange(len(made.values)) == i, 0.077, made.values)
    far = replace(made, effects=with_values(made.effects, made.parameters, values, device.platform.axis_names))
    asked = with_question(far, [device], Graded(GRADES["navigation"], ""), lambda _: far)
    assert "77 " in asked.outcome
    assert "mrad, usual is below 52.4" in asked.outcome


def test_a_gain_that_nothing_explains_is_asked_for(device):
    for method in ("three-stage", "multiposition"):
        made, _ = calibrate([scaled(device, "z", 1.1)], method)
        golden_text(made.outcome)


@pytest.mark.parametrize("method", ["three-stage", "multiposition"])
def test_a_sound_unit_is_not_asked_about(device, method):
    assert calibrate([device], method)[0].outcome == ""


def test_a_real_unit_is_not_asked_about():
    assert calibrate([XSENS])[0].outcome == ""


def test_the_zero_of_gyroscopes_that_count_is_no_question():
    """Raw counts stand about 32768 whatever the grade; the same numbers in SI are asked about."""
    p = next(p for p in parameters(CATALOGUE["gyro_bias"]) if p.axis == "x")
    bias, cov = with_values((), (p,), np.array([7.0])), np.array([[1e-12]])
    unit = Graded(GRADES["tactical"], "")
    r = read(XSENS)

    def never(_):
        raise InputError("no slip")

    for readout, asked in ((Readout(gyroscopes=Counts((1e-4,) * 3)), False), (Readout(), True)):
        made = Calibration("x", bias, (p,), cov, (), Residual(0.0, 1, {}), readout=readout)
        assert with_question(made, [r], unit, never).outcome.startswith("gyro bias x is 1.444e+06") is asked


def test_what_is_not_of_the_sensors_may_have_any_size():
    wanted = [p for e in ("gimbal_zero", "bias") for p in parameters(CATALOGUE[e], ("inner",))]
    x = np.array([1.0, 1.0, 0.0, 0.0])  # a gimbal's zero of 57 deg; a bias of a tenth of gravity
    made = Calibration("x", with_values((), wanted, x, ("inner",)), tuple(wanted), 1e-12 * np.eye(4), (), None)
    assert [made.parameters[i].label for i in beyond_grade(made, limit("navigation"))] == ["bias:x"]
    assert not beyond_grade(made, limit("consumer"))


def test_unseen_constants_at_their_prior_are_no_question():
    wanted = parameters(CATALOGUE["bias"])
    made = Calibration("x", with_values((), wanted, np.ones(3)), wanted, np.eye(3), (), None)
    assert not beyond_grade(made, limit("navigation"))


def test_a_unit_undone_is_undone_in_the_scatter_of_the_rows_too(device):
    wanted = parameters(CATALOGUE["scale_factor"])
    made = Calibration("t", with_values((), wanted, np.full(3, 8.8)), wanted, 1e-6 * np.eye(3), (), Residual(0, 1, {}))
    shown = replace(device, scatter={("specific_force", a): 2e-4 for a in "xyz"})
    (correction,) = [c for c in corrections(made, [shown], limit("navigation")) if "are in g, not in m/s^2" in c.words]
    undone = correction.corrected(shown)
    assert undone.scatter["specific_force", "y"] == pytest.approx(2e-4 * 9.80665)
    np.testing.assert_allclose(undone.triad("specific_force"), 9.80665 * shown.triad("specific_force"))


def test_a_drift_is_as_fast_as_the_recording_is_short():
    for effect, times in (("bias_drift", 12.0), ("bias", 1.0)):
        p = parameters(CATALOGUE[effect])[0]
        assert limit("consumer", HOUR / 12)(p) == pytest.approx(times * limit("consumer", 5 * HOUR)(p))


# --- gravity ----------------------------------------------------------------------------------------------------------


def sigmas(made, effect):
    return [s for p, s in zip(made.parameters, made.sigmas, strict=True) if p.effect == effect]


SITES: dict[str, tuple[Callable[[str], str], float]] = {
    "stated": (lambda t: t, 0.0),
    "stated with a sigma": (lambda t: t.replace("gravity = { ", "gravity = { sigma = 9.8e-5, "), 10.0),
    "from latitude and height": (lambda t: drop(t, "gravity"), 30.6),
    "from latitude alone": (lambda t: drop(t, "gravity", "height"), 106.5),
    "nobody says": (lambda t: drop(t, "gravity", "height", "latitude"), 1530.0),
    "standard gravity at 40 deg": (lambda t: t.replace("9.801511710051052", "9.80665"), 524.3),
    "off by 1000 ppm": (lambda t: t.replace("9.801511710051052", "9.8113"), 1000.0),
}


def drop(text, *keys):
    return "\n".join(line for line in text.splitlines() if not line.startswith(keys))


@pytest.mark.parametrize("site", SITES)
def test_the_sigma_of_gravity_is_in_the_scale_factors_and_in_nothing_else(device, tmp_path, site):
    change, ppm = SITES[site]
    folder = write(device, tmp_path / "r")
    sound, _ = calibrate([folder])
    header = folder / "recording.toml"
    header.write_text(change(header.read_text()))
    made, (r,) = calibrate([folder])
    own = np.array(sigmas(sound, "scale_factor"))
    np.testing.assert_allclose(sigmas(made, "scale_factor"), np.hypot(own, 1e-6 * ppm), rtol=0.01)
    np.testing.assert_allclose(sigmas(made, "bias"), sigmas(sound, "bias"), rtol=0.01)
    _, (other,) = calibrate([write(r, tmp_path / "again")])  # a file that is written says the same
    assert other.site.gravity_sigma == pytest.approx(r.site.gravity_sigma)


def test_gravity_moves_the_scale_factors_by_what_their_sigma_says(device):
    off = replace(device, site=replace(device.site, gravity=device.site.gravity * (1 + 50e-6)))
    (a, _), (b, _) = calibrate([device]), calibrate([off])
    moved = b.values - a.values
    for p, x, s in zip(a.parameters, moved, a.sigmas, strict=True):
        assert x == pytest.approx(50e-6 if p.effect == "scale_factor" else 0.0, abs=0.1 * s + 1e-9), p.label
