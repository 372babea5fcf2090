"""How a unit is read is part of its calibration: counts, gimbals of any platform, and the sense of their zeros."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Counts, Readout, Residual, from_dict, read
from gimbalcal.calibration.exchange import export, read_calibration
from gimbalcal.calibration.readout import in_counts, in_si, with_noise
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.inference.information import Unobservable
from gimbalcal.pipeline import load, three_stage
from gimbalcal.platform import BENCH, KNOWN, SPACE_STABLE, Axis, Platform
from gimbalcal.recording import Recording, Site
from gimbalcal.simulate import simulate
from tests.golden import refused
from tests.paths import DEVICE, STATIC

ARCSEC = np.deg2rad(1 / 3600)
MOUNT = Platform("mount", (Axis("declination", "y"), Axis("hour_angle", "z")))
ZERO = CATALOGUE["gimbal_zero"]


def calibration(platform, *zeros, **more):
    """Zeros [arcsec] of the first gimbals of a platform, correlated."""
    wanted = parameters(ZERO, platform.axis_names)[: len(zeros)]
    n = len(zeros)
    unobservable = Unobservable({"gimbal_zero:platform": 0.6, "base_tilt:down": 0.8}, "")
    return Calibration(
        more.pop("method", "test"), with_values((), wanted, np.array(zeros) * ARCSEC, platform.axis_names), wanted,
        (np.eye(n) + 0.5) * ARCSEC**2, (unobservable,),
        Residual(1.0, 2, {}), readout=more.pop("readout", Readout(gimbals=platform.axis_names)), **more,
    )  # fmt: skip


def counted(rng):
    readout = Readout(Counts((2e-3, -3e-3, 4e-3), (100.0, -50.0, 7.0)), Counts((1e-4,) * 3))
    channels = {(q, a): 1000 * rng.standard_normal(8) for q in ("specific_force", "angular_rate") for a in "xyz"}
    return Recording(
        "multi-position", "counts", BENCH, Site(), {"accelerometer": 4.0, "gyroscope": 2.0, "gimbal_angle": 1.0},
        60.0 * np.arange(8), np.arange(1, 9), channels,
        scatter={("specific_force", "y"): 5.0, ("angular_rate", "x"): 3.0}, units=dict.fromkeys(channels, "count"),
    ), readout  # fmt: skip


@pytest.mark.parametrize("platform", [MOUNT, KNOWN["two-axis-table"], KNOWN["alt-az"], SPACE_STABLE])
def test_a_calibration_of_any_gimbals_is_read_again(platform, tmp_path):
    """A two-axis mount was refused: its gimbals were looked for among those of the space-stable platform."""
    made = calibration(platform, 24.0, -41.0)
    made.write(tmp_path / "calibration.json")
    back = read(tmp_path / "calibration.json")
    assert back.readout == made.readout
    assert [p.label for p in back.parameters] == [f"gimbal_zero:{a}" for a in platform.axis_names[:2]]
    np.testing.assert_allclose(back.effects[0].theta_0, made.effects[0].theta_0, rtol=1e-15)
    angles = {("gimbal_angle", a): np.zeros(2) for a in platform.axis_names}
    rates = {("angular_rate", a): np.zeros(2) for a in "xyz"}
    held = Recording("multi-position", "", platform, Site(), {}, np.arange(2.0), np.array([1, 2]), angles | rates)
    np.testing.assert_allclose(back.apply(held).angles()[0, :2] / ARCSEC, [24.0, -41.0])


def test_other_gimbals_are_read_from_a_table_too(tmp_path):
    made = replace(calibration(KNOWN["two-axis-table"], 24.0, -41.0), unobservable=())
    export(made, "csv", tmp_path / "calibration.csv")
    back = read_calibration(tmp_path / "calibration.csv")
    assert back.readout.gimbals == ("inner", "outer")
    np.testing.assert_allclose(back.effects[0].theta_0, made.effects[0].theta_0, rtol=1e-15)


def test_a_file_without_a_readout_is_in_si():
    content = calibration(MOUNT, 1.0, 2.0).to_dict()
    del content["readout"]
    back = from_dict(json.loads(json.dumps(content)))
    assert back.readout == Readout()
    assert back.effects[0].theta_0.shape == (2,)


def test_zeros_in_another_sense_than_the_drawing_are_refused():
    content = calibration(SPACE_STABLE, 1.0).to_dict()
    with refused():
        from_dict(content | {"readout": content["readout"] | {"angles": "inertial"}})


def test_counts_become_si_with_their_scatter_and_noise_and_counts_again():
    raw, readout = counted(np.random.default_rng(1))
    there = in_si(raw, readout)
    assert there.channels["specific_force", "y"] == pytest.approx(-3e-3 * (raw.channels["specific_force", "y"] + 50))
    assert there.channels["angular_rate", "z"] == pytest.approx(1e-4 * raw.channels["angular_rate", "z"])
    assert there.units["specific_force", "x"] == "m/s^2"
    assert there.units["angular_rate", "x"] == "rad/s"
    assert there.noise == pytest.approx({"accelerometer": 4 * 3e-3, "gyroscope": 2e-4, "gimbal_angle": 1.0})
    assert there.scatter == pytest.approx({("specific_force", "y"): 5 * 3e-3, ("angular_rate", "x"): 3e-4})
    assert in_si(there, readout).channels == there.channels  # what is in SI stays
    back = in_counts(there, readout)
    for key, N in raw.channels.items():
        np.testing.assert_allclose(back.channels[key], N, rtol=1e-12)
    assert back.units == raw.units


def test_stated_coloured_noise_is_scaled_as_the_white_noise_is_and_its_time_constant_stays():
    """`apply` and `corrupt` of a rotation recording that states it were tracebacks."""
    stated = {"accelerometer": 4.0, "accelerometer_flicker": 2.0, "gyroscope_random_walk": 5.0,
              "accelerometer_gauss_markov": 3.0, "accelerometer_gauss_markov_tau": 100.0}  # fmt: skip
    raw, readout = counted(np.random.default_rng(1))
    raw = replace(raw, noise=stated)
    there = in_si(raw, readout)
    scaled = {"accelerometer": 4.0 * 3e-3, "accelerometer_flicker": 2.0 * 3e-3, "gyroscope_random_walk": 5.0 * 1e-4,
              "accelerometer_gauss_markov": 3.0 * 3e-3, "accelerometer_gauss_markov_tau": 100.0}  # fmt: skip
    assert there.noise == pytest.approx(scaled)
    doubled = with_noise(raw, "specific_force", np.tile(2 * np.eye(3), (8, 1, 1)))
    assert doubled.noise == pytest.approx({
        "accelerometer": 8.0, "accelerometer_flicker": 4.0, "gyroscope_random_walk": 5.0,
        "accelerometer_gauss_markov": 6.0, "accelerometer_gauss_markov_tau": 100.0,
    })  # fmt: skip


def test_the_readout_of_a_file_is_what_was_written():
    _, readout = counted(np.random.default_rng(1))
    made = calibration(SPACE_STABLE, 1.0, readout=replace(readout, gimbals=SPACE_STABLE.axis_names))
    content = json.loads(json.dumps(made.to_dict()))
    assert content["format"] == 2
    assert set(content["readout"]) == {"accelerometers", "gyroscopes", "gimbals", "angles"}
    assert content["readout"]["accelerometers"] == {"scale": [2e-3, -3e-3, 4e-3], "offset": [100.0, -50.0, 7.0]}
    assert from_dict(content).readout == made.readout


def test_a_two_axis_mount_is_calibrated_written_read_and_applied(tmp_path):
    """Its vertical gimbal has no zero among the parameters, and is a gimbal all the same."""
    holds = [{"elevation": float(a), "azimuth": float(b)} for a in range(0, 360, 45) for b in (0, 90)]
    recording, _ = simulate({
        "format": 1, "kind": "multi-position", "title": "mount", "seed": 3, "platform": {"name": "alt-az"},
        "schedule": {"holds": holds, "dwell": {"value": 20.0, "unit": "s"}},
        "noise": {"accelerometer": {"value": 10.0, "unit": "ug"}, "gimbal_angle": {"value": 1.0, "unit": "arcsec"}},
        "truth": {"gimbal_zero": {"elevation": 50.0}},
    })  # fmt: skip
    made = three_stage([recording])
    made.write(tmp_path / "calibration.json")
    back = read(tmp_path / "calibration.json")
    assert back.readout.gimbals == ("elevation", "azimuth")
    for each in (back, from_dict({k: v for k, v in made.to_dict().items() if k != "readout"})):
        off = each.apply(recording).angles() - recording.angles()
        zero = {p.label: v for p, v in zip(made.parameters, made.values, strict=True)}["gimbal_zero:elevation"]
        np.testing.assert_allclose(off, np.broadcast_to([zero, 0.0], off.shape), atol=1e-15)


def test_every_estimator_says_which_gimbals_it_had():
    positions, run = load([DEVICE, STATIC])
    for made in (three_stage([positions]), three_stage([run]), three_stage([positions, run]), multiposition(positions)):
        assert made.readout.gimbals == SPACE_STABLE.axis_names
