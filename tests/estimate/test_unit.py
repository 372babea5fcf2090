"""A whole unit from the command line's own scenarios: revolutions, poses, and the frame that both triads share."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gimbalcal.estimate.gyroscopes.revolutions import gyroscopes_from_revolutions
from gimbalcal.estimate.unit import inertial_unit
from gimbalcal.simulate import simulate


@cache
def run(name):
    recording, truth = simulate(name)
    return recording, truth, inertial_unit(recording)


def errors(name, effects):
    """Estimate minus truth over sigma."""
    _, truth, made = run(name)
    by_id = {e.id: e for e in truth}
    return np.array([
        (v - (getattr(by_id[p.effect], p.field)[p.index] if p.effect in by_id else 0.0)) / s
        for p, v, s in zip(made.parameters, made.values, made.sigmas, strict=True) if p.effect in effects
    ])  # fmt: skip


@pytest.mark.parametrize(
    ("name", "effects", "count"),
    [
        ("revolutions", ("gyro_scale_factor", "gyro_misalignment", "gyro_scale_nonlinearity", "gyro_bias"), 15),
        ("turned-unit", ("gyro_scale_factor", "gyro_misalignment", "gyro_scale_nonlinearity"), 12),
        ("turned-unit", ("gyro_bias", "gyro_g_sensitivity_rate"), 12),
        ("turned-unit", ("bias", "scale_factor", "misalignment"), 9),
    ],
)
def test_truth_comes_back_within_its_uncertainty(name, effects, count):
    found = errors(name, effects)
    assert found.size == count
    assert np.sqrt(np.mean(found**2)) < 2  # 9 to 15 normal numbers, sigma scaled to the scatter
    assert np.abs(found).max() < 4


def test_revolutions_are_a_hundred_times_sharper_than_gravity():
    sigma = {}
    for name in ("revolutions", "turned-unit"):
        made = run(name)[2]
        sigma[name] = [s for p, s in zip(made.parameters, made.sigmas, strict=True) if p.effect == "gyro_scale_factor"]
    assert np.mean(sigma["revolutions"]) < 1.5e-6
    assert np.mean(sigma["turned-unit"]) > 1e-5


def test_the_rotation_between_the_triads_is_told_with_its_sigma():
    recording, truth, made = run("revolutions")
    options = made.provenance["options"]
    # M = C_p^q to first order where it lies above the triangle, Eq. (43); products of two are below 1 arcsec
    beta = next(e for e in truth if e.id == "gyro_misalignment").beta * 648000 / np.pi
    xy, xz, _, yx = beta[:4]
    found, sigma = np.array(options["gyro_inter_triad_arcsec"]), np.array(options["gyro_inter_triad_sigma_arcsec"])
    np.testing.assert_allclose(found, [xz, yx, xy], atol=1.0 + 4 * sigma.max())
    assert np.all(sigma < 1)
    assert options["gyro_frame"] == "accelerometers"
    alone = gyroscopes_from_revolutions(recording)
    assert {p.axis for p in alone.parameters if p.effect == "gyro_misalignment"} == {"yz", "zx", "zy"}


def test_applied_the_unit_reads_what_turned_it():
    recording, _, made = run("revolutions")
    still = recording.position > 0
    clean = simulate("revolutions")[0]
    there = made.apply(clean)
    outer = recording.channels["gimbal_angle", "outer"]
    # about a vertical that points down, against the Earth's vertical rate or with it; noise of 3 deg/h averages out
    earth = 7.292115e-5 * np.sin(np.deg2rad(32))
    speed, sense = np.linalg.norm(there.triad("angular_rate"), axis=1), np.sign(np.gradient(outer))
    revolving = (outer > 1) & (outer < 4 * np.pi - 1)  # at full speed: the ramps take 15 deg
    for sign in (1, -1):
        rows = revolving & (sense == sign)
        assert rows.sum() > 1000
        assert np.mean(speed[rows]) == pytest.approx(np.deg2rad(30) - sign * earth, abs=2e-6)
    force = np.linalg.norm(there.triad("specific_force")[still], axis=1)
    assert np.mean(force) == pytest.approx(recording.site.gravity, abs=1e-5)


def test_rates_alone_are_calibrated_by_their_revolutions():
    recording, _, _ = run("revolutions")
    rates = {k: v for k, v in recording.channels.items() if k[0] != "specific_force"}
    made = inertial_unit(replace(recording, channels=rates))
    assert made.method == "revolutions"
