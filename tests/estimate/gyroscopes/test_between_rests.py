"""Gyroscopes between rests: recovery from a simulated hand, exact derivatives, counts, and refusals."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.effects import Effect, parameters_of_effects, with_values
from gimbalcal.effects.gyroscope import (
    GyroBias,
    GyroMisalignment,
    GyroScaleAsymmetry,
    GyroScaleFactor,
    GyroScaleNonlinearity,
    GyroScaleTemperature,
)
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.gyroscopes import between_rests as poses
from gimbalcal.estimate.gyroscopes.between_rests import LINEAR, gyroscopes_between_rests
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import fit_turns
from gimbalcal.estimate.gyroscopes.revolutions import euler_angles, triad_rotation
from gimbalcal.estimate.unit import inertial_unit, with_gyroscopes
from gimbalcal.forward import gyroscopes
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site
from gimbalcal.rotation import exponential
from gimbalcal.views.turns import gravity_after_turns, turns_between_rests
from tests.golden import golden_text, refused

STEP = 0.04  # s
REST, TURN = 50, 60  # samples
TRUTH: tuple[Effect, ...] = (
    GyroBias(epsilon=np.array([2e-3, -1e-3, 3e-3])),
    GyroScaleFactor(s=np.array([0.01, -0.02, 0.015])),
    GyroMisalignment(beta=np.array([0.01, -0.005, 0.004, 0.006, -0.008, 0.003])),
)
BENT = GyroScaleNonlinearity(K=np.array([2e-3, -1e-3, 1.5e-3]))


def hand(effects, noise, count=24, seed=0, temperature=None, wobble=1.0):
    """A unit turned from rest to rest about random axes by random angles; its accelerometers are perfect.

    wobble: share of the turns about x and z, 0 on a jig that turns about y alone.
    """
    rng = np.random.default_rng(seed)
    bump = np.sin(np.linspace(0, np.pi, TURN)) ** 2
    rates, forces, position = [], [], []
    f = np.array([0.0, 0.0, -9.8])
    for k in range(count + 1):
        rates += [np.zeros((REST, 3))]
        forces += [np.tile(f, (REST, 1))]
        position += [np.full(REST, k + 1)]
        axis = rng.standard_normal(3) * [wobble, 1.0, wobble]
        turn = axis / np.linalg.norm(axis) * rng.uniform(1, 3) / (bump.sum() * STEP)
        rates += [turn * bump[:, None]]
        steps = exponential(rates[-1] * STEP)
        forces += [np.array([f := C @ f for C in steps])]
        position += [np.zeros(TURN, dtype=int)]
    rate, force = np.concatenate(rates[:-1]), np.concatenate(forces[:-1])
    n = len(rate)
    channels = {("specific_force", a): force[:, i] for i, a in enumerate("xyz")}
    channels |= {} if temperature is None else {("temperature", ""): temperature}
    made = Recording("multi-position", "hand", BENCH, Site(gravity=9.8), {}, STEP * np.arange(n),
                     np.concatenate(position[:-1]), channels)  # fmt: skip
    y = gyroscopes(rate, stimulus_from_readings(made), effects) + noise * rng.standard_normal((n, 3))
    return replace(made, channels=channels | {("angular_rate", a): y[:, i] for i, a in enumerate("xyz")})


def truth_of(effects, made):
    by_id = {e.id: e for e in effects}
    return np.array([getattr(by_id[p.effect], p.field)[p.index] for p in made.parameters])


def test_truth_comes_back_within_its_uncertainty():
    errors = []
    for seed in range(4):
        recording = hand(TRUTH, 2e-3, seed=seed)
        made = gyroscopes_between_rests(recording, multiposition(recording, ("bias",)), LINEAR)
        errors.append((made.values - truth_of(TRUTH, made)) / made.sigmas)
    spread = np.sqrt(np.mean(np.square(errors)))
    assert 0.5 < spread < 1.5  # 48 normal numbers, sigma scaled to 39 degrees of freedom: 0.12, with room for both


def test_a_unit_that_turned_about_one_axis_shows_no_scale_of_the_other_gyroscopes():
    """On such a jig their scale came out as -890000 +- 220000 ppm, and that as determined."""
    recording = hand(TRUTH, 0.02, wobble=0.001)
    made = gyroscopes_between_rests(recording, multiposition(recording, ("bias",)))
    scale = {p.axis for p in made.parameters if p.effect == "gyro_scale_factor"}
    assert scale == {"y"}
    unseen = {label for u in made.unobservable for label in u.direction}
    assert {"gyro_scale_factor:x", "gyro_scale_factor:z"} <= unseen
    assert np.all(np.abs(made.values - truth_of(TRUTH, made)) < 4 * made.sigmas)
    assert "turn the unit farther about x and z too" in made.outcome


def test_what_one_axis_does_not_show_stays_out_when_a_further_term_is_taken_up():
    """The nonlinearity of the gyroscopes across came back with the asymmetry that was taken up after it."""
    further = GyroScaleNonlinearity(K=np.array([0.0, 0.02, 0.0])), GyroScaleAsymmetry(A=np.array([0.0, 0.02, 0.0]))
    recording = hand((*TRUTH, *further), 5e-3, count=40, wobble=0.003)
    made = gyroscopes_between_rests(recording, multiposition(recording, ("bias",)))
    names = [p.label for p in made.parameters if p.effect in {e.id for e in further}]
    assert names == ["gyro_scale_nonlinearity:y", "gyro_scale_asymmetry:y"]
    assert np.all(np.abs(made.values - truth_of((*TRUTH, *further), made)) < 4 * made.sigmas)


def test_a_wrong_range_is_no_reason_to_call_a_scale_undetermined():
    doubled = (GyroScaleFactor(s=np.array([1.0, 1.0, 1.0])),)
    recording = hand(doubled, 2e-3)
    made = gyroscopes_between_rests(recording, multiposition(recording, ("bias",)), LINEAR)
    assert {p.axis for p in made.parameters if p.effect == "gyro_scale_factor"} == set("xyz")


def test_a_recording_may_begin_while_the_unit_moves():
    whole = hand(TRUTH, 2e-3)
    late = whole.select(slice(REST + TURN // 2, None))
    trimmed = whole.select(slice(REST + TURN, None))
    made, expected = (gyroscopes_between_rests(r, multiposition(r, ("bias",)), LINEAR) for r in (late, trimmed))
    np.testing.assert_allclose(made.values, expected.values, atol=1e-9)


def test_derivative_is_that_of_a_difference():
    recording = hand(TRUTH, 0.0, count=8)
    turned = turns_between_rests(recording, multiposition(recording, ("bias",)))
    view, wanted = gravity_after_turns(turned), fit_turns(turned, parameters_of_effects(LINEAR)).parameters
    x = np.full(len(wanted), 0.01)
    J = view.linearised(with_values((), wanted, x), wanted)[1]
    h = 1e-6
    for k, unit in enumerate(np.eye(len(x))):
        up, down = (view.linearised(with_values((), wanted, x + s * h * unit), ())[0] for s in (1, -1))
        # the misfit is observed minus predicted; central differences leave h^2 and 1e-16 / h
        np.testing.assert_allclose(J[..., k], -(up - down) / (2 * h), atol=1e-8)


def test_nonlinearity_is_kept_where_it_is_and_declined_where_not():
    bent, straight = (hand(e, 1e-3, count=30) for e in ((*TRUTH, BENT), TRUTH))
    kept = gyroscopes_between_rests(bent, multiposition(bent, ("bias",)))
    assert "gyro_scale_nonlinearity" in {p.effect for p in kept.parameters}
    declined = gyroscopes_between_rests(straight, multiposition(straight, ("bias",)))
    names = {p.effect for p in declined.parameters}
    if "gyro_scale_nonlinearity" not in names:
        assert "positions" not in declined.unobservable[0]["why"]
        golden_text(declined.unobservable[0]["why"])
    else:
        x = {p.label: abs(v / s) for p, v, s in zip(declined.parameters, declined.values, declined.sigmas, strict=True)}
        assert max(v for k, v in x.items() if "nonlinearity" in k) < 4


def test_counts_get_their_scale_from_gravity():
    recording = hand(TRUTH, 1e-3)
    raw = {key: v / 2e-4 + 30000 if key[0] == "angular_rate" else v for key, v in recording.channels.items()}
    units = {("angular_rate", a): "count" for a in "xyz"}
    counted = replace(recording, channels=raw, units=units)
    accelerometers = multiposition(recording, ("bias",))
    one, other = (gyroscopes_between_rests(r, accelerometers, LINEAR) for r in (recording, counted))
    scale = other.provenance["options"]["nominal"]["scale"]
    sf = [(c.values[3] + 1) for c in (one, other)]
    assert sf[1] * scale / 2e-4 == pytest.approx(sf[0], rel=1e-5)  # one problem in two units, to the stopping rule


def test_too_few_rests_and_foreign_terms_are_refused():
    recording = hand(TRUTH, 1e-3, count=3)
    accelerometers = multiposition(hand(TRUTH, 1e-3), ("bias",))
    with refused():
        gyroscopes_between_rests(recording, accelerometers)
    with refused():
        gyroscopes_between_rests(recording, accelerometers, ("bias",))


def test_rotation_between_the_triads_comes_out_of_the_misalignments():
    """M = (C_q^p C_g^q)^-1 for a known C_p^q and triangle, Eqs. (8) and (43)."""
    angles = np.array([0.01, -0.02, 0.015])
    triangle = np.array([[1, 0, 0], [0.004, 1, 0], [-0.003, 0.002, 1]])
    M = np.linalg.inv(triad_rotation(angles).T @ triangle @ np.diag([1.01, 0.98, 1.0]))
    SF = 1 / np.diag(M)
    C = SF[:, None] * M  # Eq. (5) of Wu et al. (2018)
    x = np.array([*(SF - 1), -C[0, 2], C[0, 1], -C[1, 0], C[1, 2], -C[2, 1], C[2, 0]])
    recording = hand(TRUTH, 0.0, count=8)
    turned = turns_between_rests(recording, multiposition(recording, ("bias",)))
    estimate = dict(zip(fit_turns(turned, parameters_of_effects(LINEAR)).parameters, x, strict=True))
    np.testing.assert_allclose(poses._inter_triad(estimate), angles, atol=1e-14)  # an exact factorisation
    np.testing.assert_allclose(euler_angles(triad_rotation(angles)), angles, atol=1e-15)


def test_both_triads_in_one_calibration_correct_a_recording_in_counts():
    recording = hand(TRUTH, 1e-3)
    raw = {key: v / 2e-4 + 30000 if key[0] == "angular_rate" else v for key, v in recording.channels.items()}
    counted = replace(recording, channels=raw, units={("angular_rate", a): "count" for a in "xyz"})
    made = with_gyroscopes(counted, multiposition(counted, ("bias",)), LINEAR)
    assert {p.effect for p in made.parameters} == {"bias", "gyro_bias", *LINEAR}
    assert made.covariance.shape == (15, 15)
    there = made.apply(counted)
    at_rest = recording.position != 0
    # the rests read no rate: what is left is the noise of a sample and the level's error
    assert np.sqrt(np.mean(there.triad("angular_rate")[at_rest] ** 2)) < 1.5e-3
    np.testing.assert_allclose(made.corrupt(there).triad("angular_rate"), counted.triad("angular_rate"), rtol=1e-12)
    still = replace(recording, position=np.ones(len(recording.time), dtype=int))
    accelerometers = multiposition(hand(TRUTH, 1e-3), ("bias",))
    assert with_gyroscopes(still, accelerometers) is accelerometers


def test_a_unit_is_calibrated_whole_or_says_why_not():
    whole = inertial_unit(hand(TRUTH, 1e-3))
    assert {"bias", "gyro_bias", "gyro_scale_factor"} <= {p.effect for p in whole.parameters}
    alone = inertial_unit(hand(TRUTH, 1e-3), ("bias",))
    assert {p.effect for p in alone.parameters} == {"bias"}
    few = hand(TRUTH, 1e-3, count=3)
    with refused():
        inertial_unit(few, ("bias", "gyro_scale_factor"))


def test_asymmetry_is_told_from_nonlinearity_and_temperature_needs_its_channel():
    recording = hand((*TRUTH, GyroScaleAsymmetry(A=np.array([8e-3, -6e-3, 7e-3]))), 1e-3, count=40)
    accelerometers = multiposition(recording, ("bias",))
    effects = {p.effect for p in gyroscopes_between_rests(recording, accelerometers).parameters}
    assert "gyro_scale_asymmetry" in effects
    assert "gyro_scale_nonlinearity" not in effects
    with refused():
        gyroscopes_between_rests(recording, accelerometers, ("gyro_scale_temperature",))


def test_the_temperature_of_each_turn_counts():
    warm = np.linspace(10.0, 40.0, len(hand(TRUTH, 0.0, count=40).time))
    s_T = np.array([4e-4, -3e-4, 5e-4])
    recording = hand((*TRUTH, GyroScaleTemperature(s_T=s_T)), 1e-3, count=40, temperature=warm)
    made = gyroscopes_between_rests(recording, multiposition(recording, ("bias",)))
    x = {p.label: (v, s) for p, v, s in zip(made.parameters, made.values, made.sigmas, strict=True)}
    for i, a in enumerate("xyz"):
        value, sigma = x[f"gyro_scale_temperature:{a}"]
        assert abs(value - s_T[i]) < 4 * sigma < 2e-4
    constant = replace(recording, channels=recording.channels | {("temperature", ""): np.full(len(warm), 20.0)})
    declined = gyroscopes_between_rests(constant, multiposition(recording, ("bias",)))
    assert (
        "is left out: the turns hardly show it" in declined.provenance["options"]["declined"]["gyro_scale_temperature"]
    )
