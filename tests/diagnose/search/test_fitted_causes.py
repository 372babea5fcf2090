"""Sizes of what was found: dense generalised least squares, averaged over the noise, and honest on drawn data."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gimbalcal.diagnose.evidence.scale import ANY_SIZE
from gimbalcal.diagnose.search.fitted_causes import (
    fit_causes,
)
from gimbalcal.inference.algebra import orthonormal
from tests.diagnose.plant import known
from tests.diagnose.small import again, candidate, clean, covariance, gls, observed, rows_of, searched, with_data

PAIR = ("scale_factor_asymmetry:y", "cross_coupling:y")
S = searched(observed(2, known(1)["asymmetry"][0], 60.0, dwell=6), *PAIR)
LAGGED = searched(observed(1, known(0)["lagged T"][0], 100.0, dwell=30), "bias_temperature_lagged:x")


def dense(s, index, k):
    """Calibration and columns fitted together in noise k: estimate, covariance, and how many are of the calibration."""
    Z, y = rows_of(s.fit)
    Q = orthonormal(Z)
    x, C = gls(np.concatenate([Q, s.library.X[:, index]], axis=1), y, covariance(s.projections[k].node, len(y)))
    return x, C, Q.shape[1]


def ln_posterior_of_noises(s, index):
    """ln prior and restricted likelihood of each noise, the columns in the model at their likeliest common size."""
    Z, y = rows_of(s.fit)
    U, sv, _ = np.linalg.svd(Z)
    free = U[:, int((sv > 1e-4).sum()) :]  # contrasts that the calibration has no part in
    X = free.T @ s.library.X[:, index]
    out = []
    for p in s.projections:
        V = free.T @ covariance(p.node, len(y)) @ free
        ln = [multivariate_normal(cov=V + size**2 * X @ X.T).logpdf(free.T @ y) for size in ANY_SIZE[8:25:1]]
        out.append(np.log(p.node.prior) + max(ln))
    return np.array(out)


def test_sizes_are_generalised_least_squares_averaged_over_the_noise():
    members = (0, 1)
    index = [i for m in members for i in S.library.candidates[m].variants[0].index]
    f = fit_causes(S, members)
    ln = ln_posterior_of_noises(S, index)
    w = np.exp(ln - ln.max())
    w /= w.sum()
    assert 0.01 < np.sort(w)[-2]  # a mean over noises that count, not one of them
    made = [dense(S, index, k) for k in range(len(w))]
    x = np.array([x[q:] for x, _, q in made])
    C = np.array([C[q:, q:] for _, C, q in made])
    mean = w @ x
    spread = np.einsum("k,ki,kj->ij", w, x - mean, x - mean)  # law of total covariance
    np.testing.assert_allclose(f.x, mean, rtol=1e-3)  # the likeliest size is sought on the library's grid
    np.testing.assert_allclose(f.covariance, np.einsum("k,kij->ij", w, C) + spread, rtol=2e-3)
    assert f.projection.node == S.projections[int(np.argmax(w))].node
    assert (f.members, f.index) == (members, tuple(index))


def test_significance_is_what_a_member_takes_away_beside_the_others():
    f = fit_causes(S, (0, 1))
    k = [p.node for p in S.projections].index(f.projection.node)
    for j, m in enumerate(f.members):
        own = list(S.library.candidates[m].variants[0].index)
        x, C, q = dense(S, list(f.index), k)
        at = [q + f.index.index(i) for i in own]
        wald = x[at] @ np.linalg.solve(C[np.ix_(at, at)], x[at])  # equal to the fall of chi^2
        assert f.significance(j) == pytest.approx(np.sqrt(wald), rel=1e-6)


def test_drawn_sizes_scatter_as_stated():
    """NEES of 60 recordings with known sizes, in the noise they were drawn from: a mean of chi^2 over its degrees."""
    rng = np.random.default_rng(8)
    s = searched(S.fit, *PAIR, count=1)
    index = [i for c in s.library.candidates for i in c.variants[0].index]
    truth = np.arange(1.0, 1 + len(index)) * 3
    nees, pulls = [], []
    for _ in range(60):
        noise = clean(s.fit, s.projections[0].node, rng)
        f = fit_causes(again(s, with_data(s.fit, rows_of(noise)[1] + s.library.X[:, index] @ truth)), (0, 1))
        nees.append((f.x - truth) @ np.linalg.solve(f.covariance, f.x - truth))
        pulls.append((f.x - truth) / np.sqrt(np.diag(f.covariance)))
    p = len(index)
    assert np.mean(nees) == pytest.approx(p, abs=4 * np.sqrt(2 * p / 60))
    assert np.abs(np.mean(pulls, axis=0)).max() < 4 / np.sqrt(60)


def test_nothing_found_is_the_calibration_alone():
    f = fit_causes(S, ())
    assert (f.members, f.index, f.causes) == ((), (), ())
    assert f.x.shape == (0,)
    assert f.projection.node == S.projections[int(np.argmax(S.null))].node


def test_constants_of_the_calibration_move_as_a_joint_fit_moves_them():
    f = fit_causes(S, (0,))
    before, after, sigma = f.calibration()
    Z, y = rows_of(S.fit)
    V = covariance(f.projection.node, len(y))
    root = np.linalg.inv(np.linalg.cholesky(V))
    alone = np.linalg.lstsq(root @ Z, root @ y, rcond=1e-9)[0]
    A = root @ np.concatenate([Z, S.library.X[:, list(f.index)]], axis=1)
    both = np.linalg.lstsq(A, root @ y, rcond=1e-9)[0]
    q = Z.shape[1]
    np.testing.assert_allclose(before, alone, atol=1e-6 * np.abs(alone).max())
    np.testing.assert_allclose(after, both[:q], atol=1e-6 * np.abs(both).max())
    assert np.abs(after - before).max() > 0.1 * sigma[np.argmax(np.abs(after - before))]
    _, sv, Vt = np.linalg.svd(A, full_matrices=False)
    keep = sv > 1e-6 * sv[0]  # `pinv` of the square cuts at 1e-12
    np.testing.assert_allclose(sigma, np.sqrt(((Vt[keep].T / sv[keep]) ** 2).sum(axis=1))[:q], rtol=1e-5)


def test_a_lag_has_the_mean_and_spread_of_its_variants():
    f = fit_causes(LAGGED, (0,))
    c = LAGGED.library.candidates[candidate(LAGGED, "bias_temperature_lagged:x")]
    Z, y = rows_of(LAGGED.fit)
    root = np.linalg.inv(np.linalg.cholesky(covariance(f.projection.node, len(y))))
    chi2 = []
    for v in c.variants:
        A = root @ np.concatenate([orthonormal(Z), LAGGED.library.X[:, list(v.index)]], axis=1)
        chi2.append(np.sum((root @ y - A @ np.linalg.lstsq(A, root @ y, rcond=1e-9)[0]) ** 2))
    w = np.array([v.weight for v in c.variants]) * np.exp(-(np.array(chi2) - min(chi2)) / 2)
    tau = np.array([v.constants[0][1] for v in c.variants])
    mean = w @ tau / w.sum()
    ((name, sigma),), ((_, value),) = f.spread(0).items(), f.causes[0][1].constants
    assert name == "tau"
    assert value == tau[int(np.argmin(chi2))]  # the variant that was fitted: the likeliest
    assert sigma == pytest.approx(np.sqrt(w @ (tau - mean) ** 2 / w.sum()), rel=1e-4)
