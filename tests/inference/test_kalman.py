"""The linear filter and smoother against the dense joint posterior, filterpy and each other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from gimbalcal.inference import kalman
from gimbalcal.number import Array


def time_varying(rng: np.random.Generator, n: int = 12, p: int = 3, m: int = 2) -> dict[str, Array]:
    """A random time-varying system with a simulated history."""
    root = rng.normal(size=(n, p, p)) * 0.3
    Q = root @ np.swapaxes(root, -1, -2)
    Phi = np.eye(p) + 0.3 * rng.normal(size=(n, p, p))
    H = rng.normal(size=(n, m, p))
    R = np.broadcast_to(np.diag([0.5, 2.0]), (n, m, m))
    P = np.diag([1.0, 4.0, 9.0])
    x = rng.multivariate_normal(np.zeros(p), P)
    truth, z = np.empty((n, p)), np.empty((n, m))
    for k in range(n):
        if k:
            x = Phi[k] @ x + rng.multivariate_normal(np.zeros(p), Q[k])
        truth[k], z[k] = x, H[k] @ x + rng.multivariate_normal(np.zeros(m), R[k])
    return {"z": z, "H": H, "R": R, "Phi": Phi, "Q": Q, "x": np.zeros(p), "P": P, "truth": truth}


def dense(s: dict[str, Array]) -> tuple[Array, Array]:
    """Joint posterior of all states at once: one weighted least squares, no recursion."""
    n, p = len(s["z"]), s["x"].size
    rows, right = [], []

    def add(J: Array, r: Array, covariance: Array) -> None:
        W = np.linalg.inv(np.linalg.cholesky(covariance))
        rows.append(W @ J)
        right.append(W @ r)

    unit = np.eye(n * p).reshape(n, p, n * p)
    add(unit[0], s["x"], s["P"])
    for k in range(n):
        if k:
            add(unit[k] - s["Phi"][k] @ unit[k - 1], np.zeros(p), s["Q"][k])
        seen = ~np.isnan(s["z"][k])
        if seen.any():
            add(s["H"][k][seen] @ unit[k], s["z"][k][seen], s["R"][k][np.ix_(seen, seen)])
    A, b = np.concatenate(rows), np.concatenate(right)
    covariance = np.linalg.inv(A.T @ A)
    blocks = covariance.reshape(n, p, n, p)
    return (covariance @ A.T @ b).reshape(n, p), np.stack([blocks[k, :, k] for k in range(n)])


def run(s: dict[str, Array]) -> kalman.Filtered:
    return kalman.filter(s["z"], s["H"], s["R"], s["Phi"], s["Q"], s["x"], s["P"])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_smoother_equals_the_dense_joint_posterior_also_with_missing_measurements(seed: int) -> None:
    s = time_varying(np.random.default_rng(seed))
    s["z"][3] = np.nan
    s["z"][7, 1] = np.nan
    x, P = dense(s)
    smoothed = kalman.smooth(run(s))
    # 1e-9 of a sigma: rounding of a 36-state normal matrix with condition 1e4 is 1e-12
    assert np.abs((smoothed.x - x) / np.sqrt(np.diagonal(P, axis1=1, axis2=2))).max() < 1e-9
    np.testing.assert_allclose(smoothed.P, P, rtol=1e-8, atol=1e-9)


def test_filter_equals_filterpy_and_its_smoother_method() -> None:
    from filterpy.kalman import KalmanFilter

    s = time_varying(np.random.default_rng(4))
    oracle = KalmanFilter(3, 2)
    oracle.x, oracle.P = s["x"].copy(), s["P"].copy()
    x, P = np.empty_like(s["truth"]), np.empty((12, 3, 3))
    for k in range(12):
        if k:
            oracle.predict(F=s["Phi"][k], Q=s["Q"][k])
        oracle.update(s["z"][k], R=s["R"][k], H=s["H"][k])
        x[k], P[k] = oracle.x, oracle.P
    ours = run(s)
    np.testing.assert_allclose(ours.x, x, rtol=1e-10)
    np.testing.assert_allclose(ours.P, P, rtol=1e-10, atol=1e-12)
    # the method takes Fs[k + 1] from row k to k + 1, as we do; the function of the same name does not
    x_s, P_s, _, _ = oracle.rts_smoother(x, P, s["Phi"], s["Q"])
    np.testing.assert_allclose(kalman.smooth(ours).x, x_s, rtol=1e-9)
    np.testing.assert_allclose(kalman.smooth(ours).P, P_s, rtol=1e-9, atol=1e-12)


def test_constant_state_needs_no_smoothing_and_equals_least_squares() -> None:
    rng = np.random.default_rng(5)
    H, prior = rng.normal(size=(200, 1, 4)), np.diag([1e-8, 1.0, 1e4, 1e-2]) ** 2  # ten decades, as in SI
    H = H / np.sqrt(np.diag(prior))
    z = rng.normal(size=200)
    f = kalman.filter(z, H, 1.0, np.eye(4), np.zeros((4, 4)), np.zeros(4), prior)
    A = np.concatenate([H[:, 0] * np.sqrt(np.diag(prior)), np.eye(4)])
    x = np.linalg.lstsq(A, np.concatenate([z, np.zeros(4)]), rcond=None)[0] * np.sqrt(np.diag(prior))
    sigma = np.sqrt(np.diag(f.P[-1]))
    smoothed = kalman.smooth(f)
    assert np.abs((f.x[-1] - x) / sigma).max() < 1e-9
    # start of the smoother = end of the filter, for a state that does not move
    assert np.abs((smoothed.x[0] - f.x[-1]) / sigma).max() < 1e-9
    np.testing.assert_allclose(smoothed.P[0], f.P[-1], rtol=1e-7, atol=1e-9 * np.outer(sigma, sigma).min())


def test_states_that_forget_and_states_that_stay_smooth_alike_by_both_forms_of_the_gain() -> None:
    rng = np.random.default_rng(7)
    s = time_varying(rng)
    s["Phi"] = np.broadcast_to(np.diag([0.0, 1e-9, 1.0]), (12, 3, 3))  # cannot be inverted
    s["Q"] = np.broadcast_to(np.diag([1.0, 1.0, 1e-6]), (12, 3, 3))
    x, P = dense(s)
    smoothed = kalman.smooth(run(s))
    np.testing.assert_allclose(smoothed.x, x, atol=1e-8)
    np.testing.assert_allclose(smoothed.P, P, atol=1e-8)


def test_a_state_known_exactly_stays_known() -> None:
    z = np.array([1.0, 1.2, 0.9])
    f = kalman.filter(z, [[1.0, 1.0]], 0.1, np.eye(2), np.zeros((2, 2)), np.zeros(2), np.diag([1.0, 0.0]))
    smoothed = kalman.smooth(f)
    assert np.all(smoothed.x[:, 1] == 0)
    np.testing.assert_allclose(smoothed.x[:, 0], f.x[-1, 0], rtol=1e-12)


def test_estimates_and_innovations_are_as_uncertain_as_claimed() -> None:
    runs, n, p = 200, 12, 3
    rng = np.random.default_rng(6)
    nees, smoothed_nees, nis = 0.0, 0.0, 0.0
    for _ in range(runs):
        s = time_varying(rng)
        f = run(s)
        smoothed = kalman.smooth(f)
        e = s["truth"][-1] - f.x[-1]
        nees += e @ np.linalg.solve(f.P[-1], e)
        e = s["truth"][0] - smoothed.x[0]
        smoothed_nees += e @ np.linalg.solve(smoothed.P[0], e)
        nis += float(sum(v @ np.linalg.solve(S, v) for v, S in zip(f.innovation, f.S, strict=True)))
    for value, dof in ((nees, runs * p), (smoothed_nees, runs * p), (nis, runs * n * 2)):
        # two-sided 99.9 % bounds of chi^2
        assert chi2.ppf(0.0005, dof) < value < chi2.ppf(0.9995, dof)


def test_log_likelihood_is_that_of_the_joint_normal() -> None:
    from scipy.stats import multivariate_normal

    z = np.array([0.3, -0.2, 0.7])
    f = kalman.filter(z, [[1.0]], 0.5, [[0.9]], [[0.2]], [0.1], [[2.0]])
    C = np.zeros((3, 3))
    variance = [2.0]
    for _ in range(2):
        variance.append(0.81 * variance[-1] + 0.2)
    for i in range(3):
        for j in range(3):
            C[i, j] = 0.9 ** abs(i - j) * variance[min(i, j)]
    joint = multivariate_normal([0.1, 0.09, 0.081], C + 0.5 * np.eye(3))
    assert f.log_likelihood == pytest.approx(joint.logpdf(z), rel=1e-12)


def test_a_wrong_shape_is_told() -> None:
    with pytest.raises(ValueError, match=r"expected a matrix of shape \(1, 2\) or a stack \(3, 1, 2\), got \(2, 2\)"):
        kalman.filter(np.zeros(3), np.eye(2), 1.0, np.eye(2), np.eye(2), np.zeros(2), np.eye(2))
