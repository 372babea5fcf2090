"""Columns by way of the stages against the complex step through the whole model; noise against what was put in."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.evidence.stated_noise import noise_grid, nominal_noise, scale_to_scatter
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.effects import CATALOGUE, parameters, values, with_values
from gimbalcal.forward import predict
from gimbalcal.number import STEP
from gimbalcal.recording import block_means, read
from gimbalcal.views.core import absent_effect
from gimbalcal.views.known_attitude import MOST_ROWS, view_at_known_attitude
from tests.diagnose.plant import ARCSEC, UG, record
from tests.golden import refused


@pytest.fixture(scope="module")
def o():
    return fit_baseline(view_at_known_attitude(record(np.random.default_rng(5))))


@pytest.mark.parametrize(
    "effect",
    ["cubic_nonlinearity", "bias_temperature", "misalignment_temperature", "encoder_two_cycle", "gimbal_flexure",
     "gimbal_nonorthogonality", "base_tilt_drift", "post_move_creep", "position_blunder"],
)  # fmt: skip
def test_columns_are_the_derivatives_of_the_forward_model(o, effect):
    wanted = parameters(CATALOGUE[effect], o.view.stimulus.axis_names)
    made = absent_effect(effect, o.view.stimulus)
    quick = o.rows.columns(made, wanted)
    x, columns = values([made], wanted), []
    for unit in np.eye(len(wanted)):
        nudged = with_values((*o.effects, made), wanted, x + 1j * STEP * unit, o.view.stimulus.axis_names)
        columns.append(
            predict(o.view.source.platform, o.view.stimulus, nudged, o.view.kind)["specific_force"].imag / STEP
        )
    whole = np.stack(columns, axis=-1) / o.sigma[:, None]
    # both are first derivatives at the same point: rounding only
    np.testing.assert_allclose(quick, whole, atol=1e-9 * np.abs(whole).max())


def test_noise_of_a_clean_recording_is_what_the_header_says(o):
    settled = scale_to_scatter(o)
    np.testing.assert_allclose(settled.sigma, 20 * UG, rtol=0.06)  # 3 sigma of 720 independent second differences


def test_heavy_tails_are_clipped_and_stay_white():
    settled = scale_to_scatter(fit_baseline(view_at_known_attitude(record(np.random.default_rng(1), tails=3.0))))
    assert settled.view.noise.kurtosis > 1
    # Student's t with 3 degrees of freedom: the clipped mean is worth 1.5 to 2 times as many samples as the plain one
    assert np.all(settled.sigma < 0.9 * 20 * UG)


def test_setting_errors_have_the_covariance_of_the_node():
    """Differences between a record with and without setting errors, whitened by the nominal node, have chi^2 of 1."""
    node_chi2 = []
    for seed in range(6):
        loose = fit_baseline(view_at_known_attitude(record(np.random.default_rng(seed), loose=1.0)))
        y = nominal_noise(loose).whiten(loose.reduced(loose.residual[:, :, None]))[:, 0]
        Z = nominal_noise(loose).whiten(loose.reduced(loose.Z))
        left = y - Z @ np.linalg.lstsq(Z, y, rcond=1e-10)[0]
        node_chi2.append(left @ left / (len(y) - 17))
    assert np.mean(node_chi2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 300 / 6))
    assert ARCSEC > 0


def test_priors_of_the_noise_sum_to_one(o):
    assert sum(n.prior for n in noise_grid(o)) == pytest.approx(1.0)


def test_an_unknown_baseline_is_refused(o):
    with refused():
        fit_baseline(view_at_known_attitude(o.view.source, ["bais"]))


def test_a_long_static_run_is_averaged_first_and_says_the_same():
    run = read("data/space_stable_static")
    means = block_means(run, 5)
    assert means.weight.sum() == run.weight.sum()
    fine, coarse = fit_baseline(view_at_known_attitude(run)), fit_baseline(view_at_known_attitude(means))
    C = np.linalg.pinv(np.einsum("ncp,ncq->pq", fine.Z, fine.Z), hermitian=True)
    moved = values(fine.effects, fine.parameters) - values(coarse.effects, coarse.parameters)
    moved /= np.array([p.sigma for p in fine.parameters]) * np.sqrt(np.diag(C))
    # 25 minutes shorten a turning force by 360 ppm, 1600 sigma of a scale factor; put back, the same readings say the
    # same but for the last block, which has fewer rows and stands for as many
    assert np.max(np.abs(moved)) < 3
    long = replace(run, time=np.arange(9000) * 20.0, weight=np.ones(9000),
                   channels={k: np.resize(v, 9000) for k, v in run.channels.items()})  # fmt: skip
    assert len(fit_baseline(view_at_known_attitude(long), steps=0).residual) <= MOST_ROWS


def test_blocks_are_counted_without_gaps_where_a_position_has_few_rows(o):
    """The search for laws takes a block's ordinal for its place among the means."""
    r = o.view.source
    rows = np.flatnonzero((r.position != 4) | (np.cumsum(r.position == 4) <= 2))
    few = fit_baseline(view_at_known_attitude(r.select(rows)))
    assert few.view.noise.block.max() + 1 == len(few.view.noise.starts) == len(o.view.noise.starts) - 4
    assert set(np.diff(few.view.noise.block)) == {0, 1}
