"""Correct and corrupt are exact inverses, for any calibration that the catalogue can hold."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.calibration.provenance import Options, Provenance
from gimbalcal.earth import G0
from gimbalcal.effects import CATALOGUE, Stage, parameters, with_values, zero_effect
from gimbalcal.effects.accelerometer import Bias
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.estimate.accelerometers.multiposition import LINEAR, multiposition
from gimbalcal.pipeline import load
from gimbalcal.platform import BENCH, SPACE_STABLE
from gimbalcal.recording import Recording, Site
from gimbalcal.schedule import EIGHTEEN_POSITIONS
from tests.golden import refused
from tests.paths import DEVICE

SENSORS = (Stage.ENCODER, Stage.INPUT_AXIS, Stage.SCALE, Stage.ACCELEROMETER, *GYROSCOPE_STAGES)
LOSSY = ("dead_zone",)  # a flat law: what is in it cannot be told back
IDS = sorted(i for i, c in CATALOGUE.items() if c.stage in SENSORS and c.requires != ("covariate",) and i not in LOSSY)


def table_recording(seed):
    """The 18 positions with a temperature, and the force and rate of a perfect unit, shaken."""
    rng = np.random.default_rng(seed)
    n = 18
    angles = EIGHTEEN_POSITIONS.angles
    channels = {("gimbal_angle", a): angles[:, i] for i, a in enumerate(SPACE_STABLE.axis_names)}
    force = -G0 * EIGHTEEN_POSITIONS.gravity_directions() + 0.1 * rng.standard_normal((n, 3))
    rate = rng.standard_normal((n, 3))
    channels |= {("specific_force", a): force[:, i] for i, a in enumerate("xyz")}
    channels |= {("angular_rate", a): rate[:, i] for i, a in enumerate("xyz")}
    channels["temperature", ""] = 20 + rng.standard_normal(n)
    for need in {need for i in IDS for need in CATALOGUE[i].requires if ":" in need}:
        channels["covariate", need.partition(":")[2]] = rng.standard_normal(n)
    return Recording("multi-position", "table", SPACE_STABLE, Site(0.7, 60.0, 9.8), {}, 600.0 * np.arange(n),
                     np.arange(1, n + 1), channels)  # fmt: skip


def calibration(effects, **options):
    return Calibration(
        "test",
        effects,
        (),
        np.zeros((0, 0)),
        (),
        Residual(0.0, 0, {}),
        provenance=Provenance(options=Options(**options)),
    )


def drawn(effect_id, seed):
    rng = np.random.default_rng(seed)
    cls = CATALOGUE[effect_id]
    wanted = parameters(cls, SPACE_STABLE.axis_names)
    x = np.array([p.sigma for p in wanted]) * rng.uniform(-2, 2, len(wanted))
    made = with_values((zero_effect(cls, SPACE_STABLE.axis_names),), wanted, x, SPACE_STABLE.axis_names)
    return made[0]


@settings(deadline=None, max_examples=60)
@given(st.sets(st.sampled_from(IDS), min_size=1, max_size=5), st.integers(0, 10**6))
def test_correcting_what_was_corrupted_gives_it_back(ids, seed):
    made = calibration(tuple(drawn(i, seed) for i in sorted(ids)))
    true = table_recording(seed)
    back = made.apply(made.corrupt(true))
    for key, values in true.channels.items():
        # a few roundings of g; angles of 2 pi; rates of a few rad/s
        np.testing.assert_allclose(back.channels[key], values, rtol=0, atol=2e-14 * 10, err_msg=str(key))


def test_corrupt_moves_every_kind_of_reading():
    bias = Bias(b=np.array([1e-3, -2e-3, 3e-3]))
    effects = (bias, drawn("gyro_bias", 1), drawn("gimbal_zero", 1))
    true = table_recording(1)
    read = calibration(effects).corrupt(true)
    for key in (("specific_force", "x"), ("angular_rate", "y"), ("gimbal_angle", "inner")):
        assert np.all(read.channels[key] != true.channels[key])
    np.testing.assert_allclose(
        read.channels["specific_force", "x"] - true.channels["specific_force", "x"], bias.b[0], rtol=1e-9
    )  # rounding of 9.8 against a bias of 1e-3


@pytest.mark.parametrize("direction", ["apply", "corrupt"])
def test_a_triad_with_an_axis_missing_is_refused_in_both_directions(direction):
    whole = table_recording(2)
    part = replace(whole, channels={key: x for key, x in whole.channels.items() if key != ("specific_force", "x")})
    with refused():
        getattr(calibration((drawn("bias", 1),)), direction)(part)


def test_a_recording_without_a_dwell_is_corrected_as_one_of_a_single_dwell():
    true = table_recording(1)
    nowhere, once = (replace(true, position=p * np.ones(18, dtype=int)) for p in (0, 1))
    effects = (drawn("bias", 1), drawn("gimbal_zero", 1))
    for key, corrected in calibration(effects).apply(once).channels.items():
        np.testing.assert_array_equal(calibration(effects).apply(nowhere).channels[key], corrected)


def test_counts_become_force_and_back():
    rng = np.random.default_rng(4)
    v = rng.standard_normal((25, 3))
    force = 9.8 * v / np.linalg.norm(v, axis=1, keepdims=True)
    N = force @ np.array([[500, 2, 3], [0, 480, 5], [0, 0, 510.0]]) + [100, -50, 3e4]
    raw = Recording("multi-position", "raw", BENCH, Site(gravity=9.8), {}, 60.0 * np.arange(25), np.arange(1, 26),
                    {("specific_force", a): N[:, i] for i, a in enumerate("xyz")},
                    units={("specific_force", a): "count" for a in "xyz"})  # fmt: skip
    made = multiposition(raw, LINEAR)
    there = made.apply(raw)
    norm = np.linalg.norm(there.triad("specific_force"), axis=1)
    np.testing.assert_allclose(norm, 9.8, atol=1e-9)  # a linear unit: the fit is exact up to its stopping rule
    assert there.units["specific_force", "x"] == "m/s^2"
    np.testing.assert_allclose(made.corrupt(there).triad("specific_force"), N, rtol=1e-12)
    with refused():
        made.apply(replace(raw, units={}))


def test_a_missing_temperature_is_named():
    true = table_recording(2)
    bare = replace(true, channels={k: v for k, v in true.channels.items() if k[0] != "temperature"})
    with refused():
        calibration((drawn("bias_temperature", 0),)).apply(bare)


def test_a_dead_zone_leaves_the_reading():
    made = calibration((CATALOGUE["dead_zone"](d=np.full(3, 1e-3)),))
    true = table_recording(0)
    small = {("specific_force", a): np.full(18, 5e-4) for a in "xyz"}
    read = made.corrupt(true.with_channels(small))
    for inside in (0.0, 1e-5):  # nothing is read there; with a little noise the law is flat
        noisy = {("specific_force", a): read.channels["specific_force", a] + inside for a in "xyz"}
        there = made.apply(read.with_channels(noisy))
        np.testing.assert_allclose(there.triad("specific_force"), inside, atol=1e-15)


def test_readouts_that_no_rounds_settle_are_refused():
    """They came out without a word, where a mount drifts by degrees, and `apply` did not take them back."""
    (true,) = load([DEVICE])
    K = parameters(CATALOGUE["gyro_g2_sensitivity"])
    small, large = (calibration(with_values((), K, np.full(len(K), size))) for size in (1e-7, 3e-7))
    np.testing.assert_allclose(small.corrupt(small.apply(true)).angles(), true.angles(), atol=1e-14)
    with refused():
        large.corrupt(large.apply(true))


def test_every_sensor_effect_takes_part():
    assert len(IDS) > 20
    assert all(dataclasses.is_dataclass(CATALOGUE[i]) for i in IDS)


def test_readings_that_no_force_makes_are_refused():
    K = 0.5  # s^2/m: f = y - K y^2 is largest, 0.5, where y = 1, and no larger y is ever read
    wanted = parameters(CATALOGUE["quadratic_nonlinearity"])
    made = Calibration("t", with_values((), wanted, K * np.ones(3)), wanted, np.zeros((3, 3)), (), Residual(0, 0, {}))
    force = np.array([[0.1, 0.2, 0.3], [0.1, 9.0, 0.3], [0.1, 0.2, 9.0]])
    channels = {("specific_force", a): force[:, i] for i, a in enumerate("xyz")}
    bench = Recording("rotation", "t", BENCH, Site(gravity=9.8), {}, np.arange(3.0), None, channels)
    with refused():
        made.apply(bench)
    with refused():
        made.corrupt(bench)
    fine = replace(bench, channels={k: v[:1] for k, v in channels.items()}, time=np.zeros(1), weight=np.ones(1))
    assert np.isfinite(made.apply(fine).triad("specific_force")).all()
