"""Three routes to one answer: square-root filter with adjoint smoother, a dense joint solution, and filterpy."""

import numpy as np
import pytest

from gimbalcal.inference import adjoint, square_root_filter

K, M, P = 40, 4, 5
INDEX = np.array([1, 2])


@pytest.fixture(scope="module")
def problem():
    rng = np.random.default_rng(3)
    Phi = np.eye(M) + 0.2 * rng.standard_normal((K, M, M))
    Psi = 0.3 * rng.standard_normal((K, M, P))
    half = 0.1 * rng.standard_normal((K, M, M))
    Q = half @ np.swapaxes(half, -1, -2)
    d = 0.1 * rng.standard_normal((K, M))
    R = np.tile([0.01, 0.04], (K, 1))
    z = rng.standard_normal((K, 2))
    z[7] = np.nan
    x, theta = rng.standard_normal(M), rng.standard_normal(P)
    S = np.triu(rng.standard_normal((M + P, M + P))) + 2 * np.eye(M + P)
    return Phi, Psi, Q, d, z, R, x, theta, S


def _ours(problem):
    Phi, Psi, Q, d, z, R, x, theta, S = problem
    filtered = square_root_filter.filter(Phi, Psi, square_root_filter.roots(Q), d, z, INDEX, R, x, theta, S)
    return filtered, adjoint.smooth(Phi, Psi, INDEX, filtered)


def _dense(problem):
    """Means (K + 1, M), constants, and the covariance of all unknowns: one least-squares problem."""
    Phi, Psi, Q, d, z, R, x, theta, S = problem
    n = (K + 1) * M + P
    rows, right = [], []

    def add(A, b, C):
        W = np.linalg.inv(np.linalg.cholesky(C))
        rows.append(W @ A)
        right.append(W @ b)

    A = np.zeros((M + P, n))
    A[:M, :M], A[M:, -P:] = np.eye(M), np.eye(P)
    add(A, np.concatenate([x, theta]), S @ S.T)
    for k in range(K):
        A = np.zeros((M, n))
        A[:, (k + 1) * M : (k + 2) * M], A[:, k * M : (k + 1) * M], A[:, -P:] = np.eye(M), -Phi[k], -Psi[k]
        add(A, d[k], Q[k])
        if not np.isnan(z[k]).any():
            A = np.zeros((2, n))
            A[range(2), (k + 1) * M + INDEX] = 1
            add(A, z[k], np.diag(R[k]))
    T = np.linalg.qr(np.column_stack([np.concatenate(rows), np.concatenate(right)]), mode="r")
    inverse = np.linalg.inv(T[:n, :n])
    best = inverse @ T[:n, n]
    return best[:-P].reshape(K + 1, M), best[-P:], inverse @ inverse.T


def _smoothed_covariance(problem, filtered):
    Phi, Psi, Q, d, z, R, x, _, S = problem
    none = np.zeros((K, M, 0))
    known = square_root_filter.filter(Phi, none, square_root_filter.roots(Q), d, z, INDEX, R, x, np.zeros(0), S[:M, :M])
    return adjoint.covariance(Phi, Psi, INDEX, known, S[:M, M:] @ np.linalg.inv(S[M:, M:]), filtered.factor[M:, M:])


def test_filter_and_smoother_are_the_dense_joint_solution(problem):
    filtered, smoothed = _ours(problem)
    means, theta, every = _dense(problem)
    covariance = every[-P:, -P:]
    sigma = np.sqrt(np.diag(covariance))
    own = filtered.factor[M:, M:]
    assert np.abs((filtered.theta[-1] - theta) / sigma).max() < 1e-8
    assert np.abs(own @ own.T / np.outer(sigma, sigma) - covariance / np.outer(sigma, sigma)).max() < 1e-8
    assert np.abs(smoothed - means).max() / sigma.min() < 1e-8
    assert np.allclose(filtered.theta_sigma[-1], sigma, rtol=1e-9)
    ours = _smoothed_covariance(problem, filtered)
    for k in range(K + 1):
        own = every[k * M : (k + 1) * M, k * M : (k + 1) * M]
        one = np.sqrt(np.diag(own))
        assert np.abs((ours[k] - own) / np.outer(one, one)).max() < 1e-8


def test_filter_and_smoother_are_filterpy_s(problem):
    """`batch_filter`, and the smoother of Rauch, Tung and Striebel with each step's own matrix.

    filterpy's `rts_smoother` takes F[k] where F[k + 1] belongs, so it is given them shifted by one.
    """
    from filterpy.kalman import KalmanFilter

    Phi, Psi, Q, d, z, R, x, theta, S = problem
    filtered, smoothed = _ours(problem)
    n = M + P
    F, N, B = np.tile(np.eye(n), (K, 1, 1)), np.zeros((K, n, n)), np.zeros((K, n, 1))
    F[:, :M, :M], F[:, :M, M:], N[:, :M, :M], B[:, :M, 0] = Phi, Psi, Q, d
    H = np.zeros((2, n))
    H[range(2), INDEX] = 1
    f = KalmanFilter(dim_x=n, dim_z=2)
    f.x, f.P, f.H = np.concatenate([x, theta])[:, None], S @ S.T, H
    zs = [None if np.isnan(row).any() else row[:, None] for row in z]
    mu, P_k, _, _ = f.batch_filter(zs, Fs=list(F), Qs=list(N), Rs=[np.diag(r) for r in R], Bs=list(B), us=[1.0] * K)
    assert np.abs(mu[:, :M, 0] - filtered.x[1:]).max() < 1e-8
    assert np.abs(np.sqrt(P_k[:, range(M, n), range(M, n)]) / filtered.theta_sigma[1:] - 1).max() < 1e-8
    # x_{k+1} = F x_k + B: the smoother knows nothing of B, so it is given errors about the filter's own forecasts
    x_s, P_s = mu.copy(), P_k.copy()
    for k in range(K - 2, -1, -1):
        forecast = F[k + 1] @ P_k[k] @ F[k + 1].T + N[k + 1]
        gain = np.linalg.solve(forecast, F[k + 1] @ P_k[k]).T
        x_s[k] += gain @ (x_s[k + 1] - F[k + 1] @ mu[k] - B[k + 1])
        P_s[k] += gain @ (P_s[k + 1] - forecast) @ gain.T
    assert np.abs(x_s[:, :M, 0] - smoothed[1:]).max() < 1e-8
    ours, one = _smoothed_covariance(problem, filtered)[1:], np.sqrt(P_s[:, range(M), range(M)])
    assert np.abs((ours - P_s[:, :M, :M]) / one[:, :, None] / one[:, None, :]).max() < 1e-8
    plain, method, *_ = f.rts_smoother(mu, P_k, Fs=list(F), Qs=list(N))
    assert np.abs((ours - method[:, :M, :M]) / one[:, :, None] / one[:, None, :]).max() < 1e-8  # B is in no covariance
    assert np.abs(plain[:, :M, 0] - smoothed[1:]).max() > 1e-3  # why it is not used


def test_covariances_beside_a_wide_prior_keep_their_digits(problem):
    """A prior a million times wider: what is smoothed is as it is with one that is wide enough."""
    Phi, Psi, Q, d, z, R, x, theta, S = problem
    made = []
    for wide in (1e4, 1e10):
        loose = S.copy()
        loose[:M, M:], loose[M:, M:] = 0.0, wide * np.eye(P)
        one = (Phi, Psi, Q, d, z, R, x, theta, loose)
        made.append(_smoothed_covariance(one, _ours(one)[0]))
    assert np.abs(made[1] / made[0] - 1).max() < 1e-4


def test_a_measurement_beyond_the_gate_changes_nothing(problem):
    Phi, Psi, Q, d, z, R, x, theta, S = problem
    wild, gone = z.copy(), z.copy()
    wild[20], gone[20] = 1e6, np.nan
    gated = square_root_filter.filter(Phi, Psi, square_root_filter.roots(Q), d, wild, INDEX, R, x, theta, S, gate=1e8)
    without = square_root_filter.filter(Phi, Psi, square_root_filter.roots(Q), d, gone, INDEX, R, x, theta, S)
    assert np.flatnonzero(gated.distance > 1e8).tolist() == [20]
    assert np.array_equal(gated.theta, without.theta)
    assert np.array_equal(gated.factor, without.factor)
