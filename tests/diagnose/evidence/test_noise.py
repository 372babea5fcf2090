"""The noise of a recording: weights leave what was measured as it is, and a node is what its processes make of rows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.fft import dct

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.evidence.node import SINGLE_WALK
from gimbalcal.diagnose.evidence.stated_noise import (
    coloured_row_count,
    noise_grid,
    scale_to_scatter,
    single_walks_of_stated_noise,
)
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.effects import Stage
from gimbalcal.effects.process import covariance
from gimbalcal.inference.noise_processes import chain
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose.law_plants import held_before
from tests.diagnose.plant import UG, on, record
from tests.diagnose.small import covariance as covariance_of
from tests.diagnose.static_plant import record as at_rest

TAILS = 4.0  # degrees of freedom of Student's t


def creep(b):
    """What a change of load leaves behind; it dies away in half a minute of a dwell's two."""
    f = b.ideal[:, 1]
    change = (f - held_before(b, 1, 1)) * (b.visit > 0)
    return on(1, change * np.exp(-b.since / 30.0))


def with_creep(size, seed=3):
    return record(np.random.default_rng(seed), creep, size * UG, tails=TAILS, rows=120)


def test_rows_stay_as_measured_where_tails_are_heavy():
    o = fit_baseline(view_at_known_attitude(with_creep(150.0)))
    settled = scale_to_scatter(o)
    assert settled.view.noise.kurtosis > 0.6
    np.testing.assert_allclose(settled.residual * settled.sigma, o.residual * o.sigma, rtol=1e-12)
    np.testing.assert_allclose(settled.view.noise.weights.mean(axis=0), 1.0, rtol=1e-12)


def test_an_effect_inside_dwells_costs_no_row_its_weight():
    without, with_it = (
        scale_to_scatter(fit_baseline(view_at_known_attitude(with_creep(size)))).view.noise.weights
        for size in (0.0, 150.0)
    )
    # the effect falls by 7 sigma of a row over the first minute, which a median of each block does not follow
    moved = np.abs(with_it - without)
    assert np.mean(moved > 0.25) < 0.02
    assert moved.mean() < 0.02


def test_outliers_lose_their_weight_and_their_pull():
    clean = record(np.random.default_rng(8), tails=TAILS, rows=120)
    channels = dict(clean.channels)
    hit = channels["specific_force", "x"].copy()
    hit[100::180] += 2000 * UG
    channels["specific_force", "x"] = hit
    o = scale_to_scatter(fit_baseline(view_at_known_attitude(clean)))
    spoiled = scale_to_scatter(fit_baseline(view_at_known_attitude(replace(clean, channels=channels))))
    assert spoiled.view.noise.weights[100::180, 0].max() < 0.05
    # twelve of 2160 rows, each worth 100 sigma of a row, in plain means 22 sigma of a block of 20
    moved = (spoiled.reduced(spoiled.residual[:, :, None]) - o.reduced(o.residual[:, :, None]))[::3, 0]
    assert np.abs(moved - np.median(moved)).max() < 2.0


@pytest.mark.parametrize("tails", [0.0, 3.0, 5.0])
def test_weighted_rows_have_unit_variance(tails):
    chi2, dof = 0.0, 0
    for seed in range(4):
        r = record(np.random.default_rng(seed), tails=tails, loose=0.0, rows=120)
        o = scale_to_scatter(fit_baseline(view_at_known_attitude(r)))
        y, Z = o.reduced(o.residual[:, :, None])[:, 0], o.reduced(o.Z)
        left = y - Z @ np.linalg.lstsq(Z, y, rcond=1e-10)[0]
        chi2, dof = chi2 + left @ left, dof + len(y) - 17
    assert chi2 / dof == pytest.approx(1.0, abs=4 * np.sqrt(2 / dof))


def test_a_cause_inside_dwells_is_found_in_heavy_tails():
    d = diagnose([with_creep(40.0)])
    assert [f["effect"] for f in d.findings] == ["post_move_creep"]
    assert d.findings[0]["parameters"][0]["value"] == pytest.approx(40.0, rel=0.25)


@pytest.mark.parametrize("hours", [1.5, 3.0, 8.0])
def test_an_oscillation_keeps_its_size_in_heavy_tails(hours):
    """Nine rows to a period, eighteen and forty-eight: the first is faster than any level follows."""
    rng = np.random.default_rng(4)

    def error(r):
        tails = 2 * UG * rng.standard_t(3.0, (len(r.t), 3))
        return tails + np.outer(20 * UG * np.sin(2 * np.pi * r.t / (3600 * hours)), [0.0, 0.0, 1.0])

    o = scale_to_scatter(fit_baseline(view_at_known_attitude(at_rest(rng, error, 1.0))))
    assert o.view.noise.weights is not None
    angle = 2 * np.pi * o.view.stimulus.time / (3600 * hours)
    X = np.zeros((*o.residual.shape, 2))
    X[:, 2] = np.stack([np.sin(angle), np.cos(angle)], axis=-1) / o.sigma[2]
    A = np.concatenate([o.reduced(X), o.reduced(o.Z)], axis=1)
    size = np.linalg.lstsq(A, o.reduced(o.residual[:, :, None])[:, 0], rcond=1e-9)[0][:2] / UG
    # one row is 4 ug, 288 of them tell the amplitude to 0.35 ug: 4 sigma
    np.testing.assert_allclose(size, [20.0, 0.0], atol=1.4)
    assert o.sigma[2] < 1.5 * o.sigma[1]


@pytest.mark.parametrize("tails", [0.0, 3.0])
def test_a_channel_that_always_reads_the_same_breaks_nothing(tails):
    rng = np.random.default_rng(6)
    r = at_rest(rng, (lambda r: 2 * UG * rng.standard_t(tails, (len(r.t), 3))) if tails else None, 1.0)
    stuck = {**r.channels, ("gimbal_angle", "outer"): np.zeros(len(r.time))}
    o = scale_to_scatter(fit_baseline(view_at_known_attitude(replace(r, channels=stuck))))
    assert (o.view.noise.weights is not None) == bool(tails)
    assert np.all(np.isfinite(o.residual))
    assert np.all(o.sigma > 0)


@pytest.mark.parametrize("tails", [0.0, TAILS])
def test_a_channel_of_a_coarse_converter_keeps_the_stated_noise(tails):
    """Its rows are equal within a dwell, to the rounding of numbers; the others have the noise that they show."""
    r = record(np.random.default_rng(7), None, 0.0, tails=tails, rows=120)
    coarse = {("specific_force", a): np.round(r.channels["specific_force", a]) for a in "yz"}
    o = fit_baseline(view_at_known_attitude(replace(r, channels={**r.channels, **coarse})))
    sigma = scale_to_scatter(o).sigma
    np.testing.assert_allclose(sigma[1:], o.sigma[1:])
    assert 0.5 < sigma[0] / o.sigma[0] < 5


def of_rows(o, node):
    """Covariance (R, R) of reduced rows from the covariance of every process at every row, one dense product."""
    s, n, C = o.view.stimulus, *o.residual.shape
    B = o.reduced(np.eye(n * C).reshape(n, C, n * C))  # (R, n C)
    V = B @ B.T
    (setting,) = node.noise["gimbal_angle"]
    K = covariance(setting, s.time, s.visit)
    for gimbal in range(3):
        S = B * o.rows.sensitivity(Stage.ENCODER)[:, :, gimbal].ravel()
        V += S @ np.kron(K, np.ones((C, C))) @ S.T  # one angle turns all channels
    return V


@pytest.mark.parametrize("loose", [0.5, 2.83])
def test_a_node_is_the_covariance_of_its_processes(loose):
    o = fit_baseline(view_at_known_attitude(record(np.random.default_rng(5), dwell=12)))
    node = next(n for n in noise_grid(o) if dict(n.name) == {"setting error": loose, "random walk": 0.0})
    V = of_rows(o, node)
    np.testing.assert_allclose(node.whiten(node.whiten(V).T), np.eye(len(V)), atol=1e-10)
    np.testing.assert_allclose(node.colour(node.whiten(V)), V, atol=1e-10)
    assert node.logdet == pytest.approx(np.linalg.slogdet(V)[1], abs=1e-9)


def test_the_walk_of_a_node_is_its_process_at_the_middle_of_each_block():
    o = fit_baseline(view_at_known_attitude(record(np.random.default_rng(5), dwell=12)))
    still, walking = (next(n for n in noise_grid(o) if dict(n.name) == {"setting error": 1.0, "random walk": w})
                      for w in (0.0, 2.5))  # fmt: skip
    V, W = (covariance_of(n, 3 * len(o.view.noise.starts)) for n in (still, walking))
    n, starts = len(o.residual), o.view.noise.starts
    t = np.add.reduceat(o.view.stimulus.time, starts) / 2  # blocks of two rows
    walk = walking.noise["specific_force"][1]
    expected = 2 * np.kron(covariance(walk, np.append(0.0, t))[1:, 1:], np.eye(3))
    np.testing.assert_allclose(W - V, expected, atol=1e-10 * expected.max())
    # in units of a dwell mean the walk ends at 2.5 sigma; rows inside a block shift it by 1 % of that
    whole = covariance(walk, o.view.stimulus.time)
    B = np.add.reduceat(np.eye(n), starts, axis=0) / np.sqrt(2)
    np.testing.assert_allclose(B @ whole @ B.T, expected[::3, ::3], atol=0.01 * expected.max())
    assert whole[-1, -1] * 12 == pytest.approx(2.5**2, rel=0.01)


def test_a_lone_walk_is_that_of_one_accelerometer():
    o = fit_baseline(view_at_known_attitude(record(np.random.default_rng(5), dwell=12)))
    still = next(n for n in noise_grid(o) if dict(n.name) == {"setting error": 1.0, "random walk": 0.0})
    named = (("setting error", 1.0), ("random walk y", pytest.approx(250.0)))
    alone = next(n for n in single_walks_of_stated_noise(o) if n.single_walk == "y" and n.name == named)
    V, W = (covariance_of(n, 3 * len(o.view.noise.starts)) for n in (still, alone))
    t = np.add.reduceat(o.view.stimulus.time, o.view.noise.starts) / 2  # blocks of two rows
    process = alone.noise["specific_force"][1]
    expected = 2 * np.kron(covariance(process, np.append(0.0, t))[1:, 1:], np.diag([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(W - V, expected, atol=1e-10 * expected.max())


def test_a_static_node_is_the_covariance_of_its_processes():
    o = fit_baseline(view_at_known_attitude(at_rest(np.random.default_rng(1))))
    node = next(
        n for n in noise_grid(o) if dict(n.name) == {"random walk of forces": 6.0, "random walk of angles": 1.0}
    )
    n, C = o.residual.shape
    low = dct(np.eye(n), axis=0, norm="ortho")[1 : coloured_row_count(o) // C]
    variance = (1 / node.inverse_root**2).reshape(-1, C)[1:]
    for i, (quantity, _) in enumerate(o.view.channels):
        white, walk = node.noise[quantity]
        # a walk of unknown start, exactly: the inverse of its precision without the first row's own
        diagonal, below = chain(walk, o.view.stimulus.time).precision
        Lambda = np.diag(diagonal) + np.diag(below, 1) + np.diag(below, -1)
        Lambda[0, 0] -= 1 / (walk.N**2 * 600.0)
        V = low @ (covariance(white, o.view.stimulus.time) + np.linalg.pinv(Lambda, hermitian=True)) @ low.T
        np.testing.assert_allclose(V, np.diag(variance[:, i]), atol=1e-10 * V.max())


def test_a_lone_walk_of_a_static_run_is_that_of_one_accelerometer():
    o = fit_baseline(view_at_known_attitude(at_rest(np.random.default_rng(1))))
    grid = next(
        n for n in noise_grid(o) if dict(n.name) == {"random walk of forces": 6.0, "random walk of angles": 1.0}
    )
    for size in SINGLE_WALK:
        named = {"random walk of forces z": size, "random walk of angles": 1.0}
        (alone,) = (n for n in single_walks_of_stated_noise(o) if dict(n.name) == named)
        V = (1 / alone.inverse_root**2).reshape(-1, o.residual.shape[1])
        z = o.view.channels.index(("specific_force", "z"))
        assert alone.single_walk == "z"
        white = [
            i for i, (quantity, axis) in enumerate(o.view.channels) if quantity == "specific_force" and axis != "z"
        ]
        np.testing.assert_array_equal(V[:, white], 1.0)
        G = (1 / grid.inverse_root**2).reshape(-1, o.residual.shape[1])
        np.testing.assert_allclose(V[: len(G), z] - 1, (G[:, z] - 1) * (size / 6.0) ** 2, rtol=1e-9)
        # what is taken for white beyond these modes costs no more than half a nat: ln of 1 + x, less x, halved
        angle = np.pi * np.arange(len(V), len(o.residual)) / len(o.residual)
        beyond = size**2 * 600.0 / (3600.0 * len(o.residual)) / (2 - 2 * np.cos(angle))
        assert (beyond - np.log1p(beyond)).sum() / 2 < 0.6
