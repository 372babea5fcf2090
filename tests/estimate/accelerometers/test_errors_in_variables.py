"""The engine: setting errors eliminated equal those estimated; exact angles and unknown attitude are its two ends."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.process import SettingError, WhiteNoise, covariance
from gimbalcal.estimate.accelerometers.position_fit import fit_in_noise
from gimbalcal.estimate.fit import fit
from gimbalcal.platform import KNOWN, SPACE_STABLE
from gimbalcal.views.local import eliminate
from gimbalcal.views.norm import in_noise_of_readings, norm
from gimbalcal.views.positions import Noise, by_visit, position_parameters, view_of_positions
from tests.estimate.device import ARCSEC, NOISE, PARAMETERS, SAMPLE, draw, measured


@pytest.fixture
def recording():
    rng = np.random.default_rng(1)
    return measured(draw(rng), rng)


def raw(recording, rng, n=7):
    """Every dwell mean spread into n samples with that mean and some scatter."""
    wide = recording.select(np.repeat(np.arange(len(recording.time)), n))
    channels = dict(wide.channels)
    for axis in "xyz":
        scatter = SAMPLE * rng.normal(size=(len(recording.time), n))
        channels["specific_force", axis] = (
            channels["specific_force", axis] + (scatter - scatter.mean(axis=1, keepdims=True)).ravel()
        )
    return replace(wide, channels=channels, weight=np.ones(len(wide.time)))


def gauss_newton(recording, noise=NOISE, wanted=PARAMETERS, **options):
    return fit_in_noise(view_of_positions(recording, noise, **options), noise, wanted)


def test_elimination_equals_stacking_the_setting_errors_as_unknowns(recording):
    p = gauss_newton(recording)
    fit = p.fit
    # one dense least squares: readings, then one row for the prior of each setting error
    linear = p.rows
    m, k, P = *p.setting.shape, len(PARAMETERS)
    sigma = SAMPLE / np.sqrt(p.view.source.weight)
    rows = np.zeros((3 * m + m * k, P + m * k))
    prior = np.array([q.sigma for q in PARAMETERS])
    for d in range(m):
        rows[3 * d : 3 * d + 3, :P] = linear.J[d] * prior / sigma[d]
        rows[3 * d : 3 * d + 3, P + k * d : P + k * (d + 1)] = linear.G[d] * ARCSEC / sigma[d]
    rows[3 * m :, P:] = np.eye(m * k)
    right = np.concatenate([(linear.r / sigma[:, None]).ravel(), np.zeros(m * k)])
    # the least norm in units of the prior holds the one direction that is not seen where `solve` holds it
    dense = np.linalg.lstsq(rows, right, rcond=1e-9)[0]
    np.testing.assert_allclose(dense[:P] * prior / fit.solution.sigma, fit.solution.x / fit.solution.sigma, atol=1e-6)
    np.testing.assert_allclose(dense[P:].reshape(m, k), p.setting / ARCSEC, atol=1e-6)
    assert fit.solution.dof == 3 * m - np.linalg.matrix_rank(rows[: 3 * m, :P], tol=1e-6) == 54 - 17


def test_every_sample_tells_what_the_dwell_means_tell(recording):
    samples = raw(recording, np.random.default_rng(2))
    means, every = gauss_newton(samples).fit, gauss_newton(samples, averaged=False).fit
    np.testing.assert_allclose(every.solution.x, means.solution.x, atol=1e-6 * means.solution.sigma.min())
    np.testing.assert_allclose(every.solution.sigma, means.solution.sigma, rtol=1e-9)
    inside = 18 * 3 * 6
    assert every.solution.dof == means.solution.dof + inside
    # 324 degrees of freedom scatter by 8 %
    assert (every.solution.chi2 - means.solution.chi2) / inside == pytest.approx(1, abs=0.3)


def test_rows_in_motion_take_no_part(recording):
    moving = replace(recording, position=np.where(np.arange(18) == 4, 0, recording.position))
    for averaged in (True, False):
        assert len(view_of_positions(moving, NOISE, averaged=averaged).local.zero_values) == 17


def test_visits_are_whitened_by_the_covariance_of_the_processes(recording):
    linear = by_visit(view_of_positions(recording, NOISE), (), PARAMETERS, np.zeros(len(PARAMETERS)))
    noise = Noise(SAMPLE, 3 * ARCSEC)
    w = eliminate(linear, 1.0, noise.setting**2)
    ordinal = np.arange(18)
    setting = covariance(SettingError(noise.setting), ordinal.astype(float), ordinal)
    white = covariance(WhiteNoise(noise.accelerometer), np.arange(120.0))
    mean = np.full(120, 1 / 120)
    for i, W in enumerate(w.W):
        V = mean @ white @ mean * np.eye(3) + setting[i, i] * linear.G[i] @ linear.G[i].T
        np.testing.assert_allclose(W @ V @ W.T, np.eye(3), atol=1e-10)
    assert np.count_nonzero(setting - np.diag(np.diag(setting))) == 0


def test_unknown_attitude_leaves_one_row_a_visit_along_the_force(recording):
    view = view_of_positions(recording, NOISE)
    linear = by_visit(view, (), PARAMETERS, np.zeros(len(PARAMETERS)))
    free = eliminate(linear, 1.0, np.inf)
    assert np.isfinite(free.sigma).sum(axis=1).tolist() == [1] * 18
    along = free.W[np.isfinite(free.sigma)] * SAMPLE / np.sqrt(120)
    force = view.source.triad("specific_force")
    unit = force / np.linalg.norm(force, axis=1, keepdims=True)
    # nominal parameters: the normal is the force direction up to the platform's errors of 1e-4
    np.testing.assert_allclose(np.abs((along * unit).sum(axis=1)), 1, atol=1e-6)
    tight = eliminate(linear, 1.0, 0.0)
    np.testing.assert_allclose(tight.sigma, SAMPLE / np.sqrt(120))
    assert np.abs(tight.gain).max() < 1e-200


def test_a_unit_without_gimbals_is_the_same_as_gimbals_that_say_nothing(recording):
    wanted = position_parameters(SPACE_STABLE, [name for name in BASELINE["multi-position"] if name != "gimbal_zero"])
    blind = gauss_newton(recording, Noise(SAMPLE, np.inf), wanted).fit
    bench = fit([in_noise_of_readings(norm(recording))], wanted)
    assert blind.solution.chi2 == pytest.approx(bench.solution.chi2, rel=1e-5)  # each stops within 1e-3 sigma
    np.testing.assert_allclose(bench.solution.x, blind.solution.x, atol=2e-3 * blind.solution.sigma.min())


def test_gimbal_about_the_vertical_is_left_out_and_others_stay():
    assert [q.axis for q in position_parameters(SPACE_STABLE) if q.effect == "gimbal_zero"] == [
        "platform",
        "inner",
        "middle",
    ]
    assert [q.axis for q in position_parameters(KNOWN["two-axis-table"]) if q.effect == "gimbal_zero"] == [
        "inner",
        "outer",
    ]


def test_a_fit_that_runs_away_stops_and_says_so(recording):
    nonsense = replace(
        recording,
        channels={k: (np.roll(v, 5) * 3 if k[0] == "specific_force" else v) for k, v in recording.channels.items()},
    )
    assert gauss_newton(nonsense).fit.steps == 0
