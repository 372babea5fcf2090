"""Rows made white by a filter of what colours them, against their covariance, formed."""

import numpy as np
import pytest

from gimbalcal.inference.noise_processes import Chain
from gimbalcal.inference.whitening import modes, whitening, whitenings


def example():
    """Seven rows of three channels: a level that wanders, one that fades, one anew at two rows."""
    rng = np.random.default_rng(4)
    Phi, Q = np.tile([1.0, 0.8, 1.0], (7, 1)), rng.uniform(0.1, 2.0, (7, 3))
    Phi[[0, 4], 2], Q[[1, 2, 3, 5, 6], 2] = 0.0, 0.0
    return Phi, Q, rng.standard_normal((7, 3, 3))


def formed(Phi, Q, H):
    n, C, m = H.shape
    V = np.eye(n * C)
    for k in range(n):  # what enters at row k and what is left of it later
        x = np.diag(np.sqrt(Q[k]))
        F = np.zeros((n, C, m))
        for j in range(k, n):
            x = x if j == k else Phi[j, :, None] * x
            F[j] = H[j] @ x
        V += F.reshape(n * C, m) @ F.reshape(n * C, m).T
    return V


def test_it_is_the_inverse_of_the_cholesky_factor():
    V, made = formed(*example()), whitening(*example())
    np.testing.assert_allclose(made.whiten(np.eye(21)), np.linalg.inv(np.linalg.cholesky(V)), atol=1e-12)
    np.testing.assert_allclose(made.colour(np.eye(21)), np.linalg.cholesky(V), atol=1e-12)
    assert made.log_determinant == pytest.approx(np.linalg.slogdet(V)[1], abs=1e-12)
    assert made.rows == 21


def test_several_at_once_are_each_what_it_is_alone():
    Phi, Q, H = example()
    both = whitenings(np.stack([Phi, 0.5 * Phi]), np.stack([Q, 3 * Q]), H)
    for made, alone in zip(both, (whitening(Phi, Q, H), whitening(0.5 * Phi, 3 * Q, H)), strict=True):
        for a, b in zip(made, alone, strict=True):
            np.testing.assert_allclose(a, b, atol=1e-14)
    np.testing.assert_allclose(
        both[1].whiten(np.eye(21)), np.linalg.inv(np.linalg.cholesky(formed(0.5 * Phi, 3 * Q, H))), atol=1e-12
    )


@pytest.mark.parametrize("memory", [0.0, 0.4])
def test_columns_of_random_size_are_whitened_beside_noise_with_a_memory(memory):
    n, C = 9, 3
    X = np.random.default_rng(6).standard_normal((n * C, 4)) * [20.0, 3.0, 0.5, 1e-3]
    of_channel = memory ** np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    V = np.kron(of_channel, np.eye(C)) + X @ X.T
    made = modes(X, Chain(np.full(n, memory), np.where(np.arange(n) == 0, 1.0, 1 - memory**2)))
    W = made.whiten(np.eye(n * C))
    np.testing.assert_allclose(W.T @ W, np.linalg.inv(V), atol=1e-5)
    assert made.log_determinant == pytest.approx(np.linalg.slogdet(V)[1], abs=1e-4)
    assert (made.rows, made.u.shape) == (n * C, (n * C, 3))  # what noise hides is left out
