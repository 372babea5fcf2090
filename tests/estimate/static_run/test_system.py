"""The joint fit of a static run: unbiased, as uncertain as claimed, whatever channels and rows there are."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from gimbalcal.diagnose import diagnose
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import CATALOGUE, values
from gimbalcal.estimate.static_run.combined_coefficients import MEANS, NAMES, coefficient_matrix
from gimbalcal.estimate.static_run.force_filter import kalman, observation_matrix, projection
from gimbalcal.estimate.static_run.system import calibrate_static_run, static_parameters, static_readings
from gimbalcal.inference.information import solve
from gimbalcal.kinematics import mean_shortening
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import read
from tests.estimate.static_runs import TABLE_2_3, draw, run, static_information
from tests.golden import golden_text, refused
from tests.paths import ROOT
from tests.stimuli import LATITUDE, G

ALL = ("scale_factor", "bias", "misalignment", "gimbal_zero", "base_tilt", "polar_axis_misalignment")
CLEAN = ROOT.parent / "shared" / "challenge" / "open" / "static-029"


def test_parameters_without_noise_come_back_in_every_seen_direction():
    truth = draw(np.random.default_rng(1), (*ALL, "scale_nonlinearity"))
    recording = run(truth)
    found = calibrate_static_run(static_readings(recording))
    assert found.outcome == ""
    # what is left is of second order in the error of the first solution: far below the noise it was weighted with
    assert found.residual.chi2 < 1e-2
    assert found.residual.rms["specific_force:x"] < 1e-7  # unobservable parts of 3e-4 rad times turns of 1e-4
    x = values(truth, found.parameters)
    difference = coefficient_matrix(LATITUDE, G, found.parameters) @ (found.values - x)
    assert np.abs(difference).max() < 1e-7  # second-order terms of unobservable parts again


def test_a_latitude_that_is_off_by_a_sigma_moves_no_constant_by_more_than_a_few():
    """An error of 36 arcsec moves the scale factors by 150 ppm, of which nothing else shows."""
    exact = run(draw(np.random.default_rng(4), ALL), np.random.default_rng(5))
    off = np.radians(0.01)
    moved = dataclasses.replace(exact, site=dataclasses.replace(exact.site, latitude=exact.site.latitude + off))
    stated = dataclasses.replace(moved, site=dataclasses.replace(moved.site, latitude_sigma=off))
    right, taken_as_exact, known_to_a_sigma = (calibrate_static_run(static_readings(r)) for r in (exact, moved, stated))
    assert np.abs((taken_as_exact.values - right.values) / taken_as_exact.sigmas).max() > 5
    assert np.abs((known_to_a_sigma.values - right.values) / known_to_a_sigma.sigmas).max() < 1.5
    diagnosed = diagnose([stated])
    common = [p for p in diagnosed.calibration.parameters if p.effect == "scale_factor" and p.axis in "xy"]
    for p in common:
        sigmas = [c.sigmas[c.parameters.index(p)] for c in (diagnosed.calibration, known_to_a_sigma)]
        assert sigmas[0] == pytest.approx(sigmas[1], rel=0.25)  # the model of a diagnosis has fewer constants
    assert diagnosed.verdict == "adequate"
    assert len(common) == 2


def test_rank_is_fourteen_of_twentytwo_and_the_rest_is_named():
    recording = run(draw(np.random.default_rng(2), ALL), np.random.default_rng(3))
    wanted = tuple(p for p in static_parameters(static_readings(recording)) if p.effect != "scale_nonlinearity")
    found = solve(static_information(recording, (), wanted))
    assert len(wanted) == 22
    assert len(found.unobservable) == 8
    named = [set(u.direction) for u in found.unobservable]
    assert {"bias:x", "misalignment:xy"} in named
    assert {"bias:y", "misalignment:yx"} in named
    assert {"bias:z", "scale_factor:z"} in named
    assert {"gimbal_zero:middle", "base_tilt:east"} in named


def test_errors_are_as_large_as_claimed_in_seen_directions():
    runs, nees, misfit, dof, size = 25, 0.0, 0.0, 0, 0
    for seed in range(runs):
        truth = draw(np.random.default_rng(seed), ALL, share=0.03)
        recording = run(truth, np.random.default_rng(seed + 500), hours=30.0, step=1200.0)
        run_ = static_readings(recording)
        wanted = tuple(p for p in static_parameters(run_) if p.effect != "scale_nonlinearity")
        # the phase is what the platform gimbal reads on average; a turn about the pole takes up the difference
        x = values(truth, wanted)
        x[[p.axis for p in wanted].index("polar")] += (
            run_.phase - static_readings(run(hours=30.0, step=1200.0)).phase
        )[0]
        found = calibrate_static_run(static_readings(recording), wanted=wanted)
        info = static_information(recording, found.effects, wanted)
        s = solve(info)
        scale = np.array([p.sigma for p in wanted])
        e = info.rows[:, :-1] @ ((s.x - x) / scale)
        nees, misfit, dof = nees + e @ e, misfit + found.residual.chi2, dof + found.residual.dof
        size += len(wanted) - len(s.unobservable)
    assert chi2.ppf(0.0005, size) < nees < chi2.ppf(0.9995, size)
    assert chi2.ppf(0.0005, dof) < misfit < chi2.ppf(0.9995, dof)


@pytest.mark.parametrize(
    ("quantities", "rank"),
    [
        (("specific_force",), 11),  # nine linear combinations and the bend of x and y
        (("attitude_error",), 14),  # eight and two means of roll and pitch, the bends, two turns in yaw
        (("specific_force", "attitude_error"), 16),  # as with gimbals, whose zeros are then not asked for
    ],
)
def test_fewer_channels_are_enough_for_what_they_see(quantities, rank):
    recording = run(TABLE_2_3, np.random.default_rng(4))
    kept = {k: v for k, v in recording.channels.items() if k[0] in quantities or k == ("gimbal_angle", "platform")}
    if "specific_force" in quantities:
        del kept["gimbal_angle", "platform"]  # the phase then comes from the force
    part = dataclasses.replace(recording, channels=kept)
    found = calibrate_static_run(static_readings(part))
    assert not any(p.label == "gimbal_zero:middle" for p in found.parameters)
    assert len(found.parameters) - len(found.unobservable) == rank
    assert 0.8 < found.residual.chi2 / found.residual.dof < 1.2
    names = found.stages[0].labels
    assert ("x1" in names) == ("specific_force" in quantities)
    assert ("phi_1s" in names) == ("attitude_error" in quantities)


def test_block_means_are_not_taken_for_instantaneous_force():
    n, step = 600, 6.0  # hourly means of samples 6 s apart: kappa differs from 1 by 3e-3
    fine = run(TABLE_2_3, hours=50.0, step=step)
    rows = len(fine.time) // n
    mean = {k: v[: rows * n].reshape(rows, n).mean(axis=1) for k, v in _unwrapped(fine).items()}
    coarse = dataclasses.replace(
        fine, time=fine.time[: rows * n].reshape(rows, n).mean(axis=1), channels=mean, weight=np.full(rows, float(n))
    )
    x = EARTH_RATE * n * step / 2
    np.testing.assert_allclose(mean_shortening(coarse), 1 - np.sin(x) / x, rtol=1e-4)
    assert mean_shortening(coarse)[0] > 2e-3
    A = coefficient_matrix(LATITUDE, G, calibrate_static_run(static_readings(coarse)).parameters)
    keep = [i for i, name in enumerate(NAMES) if name not in MEANS]
    found, truth = (
        calibrate_static_run(static_readings(coarse)),
        values(TABLE_2_3, calibrate_static_run(static_readings(coarse)).parameters),
    )
    assert np.abs((A @ (found.values - truth))[keep]).max() < 3e-6  # of 2e-3 without; left is 3e-3 of 2e-4
    assert np.abs(mean_shortening(fine)).max() == 0


def _unwrapped(recording):
    return {k: np.unwrap(v) if k[0] == "gimbal_angle" else v for k, v in recording.channels.items()}


def test_the_stage_is_the_paper_s_filter_run_sample_by_sample():
    recording = run(TABLE_2_3, np.random.default_rng(7))
    a, left = filtered(recording), filtered(recording, TABLE_2_3)
    stage = calibrate_static_run(static_readings(recording)).stages[0]
    assert np.abs((stage.values[:5] - a.x) / a.sigma).max() < 1e-9
    np.testing.assert_allclose(stage.sigmas[:5], a.sigma, rtol=1e-9)
    assert 0.8 < a.chi2 / (a.rows - 5) < 1.2
    by_minutes = calibrate_static_run(static_readings(recording)).stages[1]
    assert np.abs((by_minutes.values - a.x) / a.sigma).max() < 1  # with the squares of Eq. (20)
    assert np.abs(left.x / left.sigma).max() < 4


def filtered(recording, effects=()):
    """State x1 ... x5 of Eqs. (21)-(25) from the specific force of a run, less what the effects explain."""
    made = static_readings(recording)
    columns, g, u = made.columns("specific_force"), made.stimulus.gravity, made.direction
    variance = ((u * made.sigma[:, columns] / g) ** 2).sum(axis=1)
    return kalman(projection(made.residual(effects)[:, columns], u, g), observation_matrix(u), variance)[0]


def test_noise_that_the_header_does_not_state_is_estimated():
    recording = run(TABLE_2_3, np.random.default_rng(5), step=120.0)
    silent = dataclasses.replace(recording, noise={})
    stated, found = static_readings(recording).sigma, static_readings(silent).sigma
    np.testing.assert_allclose(found[0], stated[0], rtol=0.12)  # 1440 rows, third differences: 3 % one sigma
    assert (
        0.9
        < calibrate_static_run(static_readings(silent)).residual.chi2
        / calibrate_static_run(static_readings(silent)).residual.dof
        < 1.1
    )
    exact = dataclasses.replace(run(), noise={})
    with refused():
        static_readings(dataclasses.replace(exact, channels={k: 0 * v for k, v in exact.channels.items()}))


def test_effects_that_are_not_wanted_are_held():
    recording = run(TABLE_2_3, np.random.default_rng(6))
    wanted = tuple(p for p in static_parameters(static_readings(recording)) if p.effect in ("bias", "scale_factor"))
    held = (CATALOGUE["misalignment"](beta=TABLE_2_3[2].beta),)
    found = calibrate_static_run(static_readings(recording), held, wanted)
    assert found.parameters == wanted
    assert abs(found.residual.chi2 / found.residual.dof - 1) < 0.1
    np.testing.assert_allclose(
        next(e for e in found.effects if e.id == "misalignment").beta,
        TABLE_2_3[2].beta,
    )
    ratio = (found.values - values(TABLE_2_3, wanted)) / found.sigmas
    assert np.abs(ratio[[0, 1, 3, 4]]).max() < 4


def test_a_run_that_the_model_does_not_explain_is_told():
    recording = run(TABLE_2_3, np.random.default_rng(8))
    wave = 5e-4 * np.sin(2 * np.pi * recording.time / 7200.0)  # m/s^2, every two hours
    x = ("specific_force", "x")
    bad = recording.with_channels({x: recording.channels[x] + wave})
    golden_text(calibrate_static_run(static_readings(bad)).outcome)
    assert calibrate_static_run(static_readings(recording)).outcome == ""


def test_another_kind_of_recording_is_refused():
    multi = dataclasses.replace(run(), kind="multi-position", platform=SPACE_STABLE)
    with refused():
        static_readings(multi)


@pytest.mark.skipif(not CLEAN.is_dir(), reason="the clean static run of the open challenge is not on this machine")
def test_an_independent_plants_clean_run_is_explained_to_the_noise():
    found = calibrate_static_run(static_readings(read(CLEAN, average_s=60.0)))
    assert chi2.ppf(0.0005, found.residual.dof) < found.residual.chi2 < chi2.ppf(0.9995, found.residual.dof)
    assert found.stages[0].labels == NAMES
