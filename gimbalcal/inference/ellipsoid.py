r"""Ellipsoids through points, without iteration.

.. math:: u^T Q u + q^T u = 1 \;\Rightarrow\; M^T M = s Q, \quad M^T C b = s q / 2, \quad
          s = 1 / (1 + \tfrac14 q^T Q^{-1} q)

The linear model M u + C b, with M = C K1 lower triangular, carries the points to the unit sphere.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.number import Array

MIN_POINTS = 9  # coefficients of an ellipsoid
MIN_RELATIVE_PIVOT = 1e-9  # points u are of order one


def design(u: Array) -> Array:
    """Return rows (..., 9) of points u (..., 3): those of Q, mixed ones twice, and of q."""
    x, y, z = np.moveaxis(u, -1, 0)
    return np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, x, y, z], axis=-1)


def matrix(c: Array) -> Array:
    """Return Q (..., 3, 3) of coefficients (..., 9)."""
    return np.asarray(c[..., [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(*c.shape[:-1], 3, 3))


def scale_of_deviation(Q: Array, q: Array) -> Array:
    """Return s (r,) of Q (r, 3, 3) and q (r, 3)."""
    return np.asarray(1 / (1 + (q * np.linalg.solve(Q, q[..., None])[..., 0]).sum(-1) / 4))


def ellipsoid(u: Array) -> Array:
    """Return the linear model (K1, bias, E), (r, 9), that carries points u (r, m, 3) to the unit sphere.

    Exact for any misalignment and bias when the unit is linear. Rows are NaN where the points lie on no ellipsoid.
    """
    A = design(u)
    Qr, R = np.linalg.qr(A)
    degenerate = np.abs(np.diagonal(R, axis1=-2, axis2=-1)).min(-1) < MIN_RELATIVE_PIVOT * np.sqrt(A.shape[-2])
    R = np.where(degenerate[:, None, None], np.eye(9), R)
    c = np.linalg.solve(R, np.swapaxes(Qr, -1, -2) @ np.ones((*A.shape[:-1], 1)))[..., 0]
    Q, q = matrix(c), c[:, 6:]
    bad = degenerate | (np.linalg.eigvalsh(Q)[:, 0] <= 0)
    Q = np.where(bad[:, None, None], np.eye(3), Q)
    s = scale_of_deviation(Q, q)
    # M^T M with M lower triangular is the Cholesky factorisation of the matrix read from its last row and column
    L = np.linalg.cholesky((s[:, None, None] * Q)[:, ::-1, ::-1])
    M = np.swapaxes(L, -1, -2)[:, ::-1, ::-1]
    K1 = np.diagonal(M, axis1=-2, axis2=-1)
    h = np.linalg.solve(np.swapaxes(M, -1, -2), (s[:, None] * q / 2)[..., None])  # h = C b
    C = M / K1[:, None, :]
    bias = np.linalg.solve(C, h)[..., 0]
    out = np.concatenate([K1, bias, np.stack([C[:, 1, 0], C[:, 2, 0], C[:, 2, 1]], axis=-1)], axis=-1)
    return np.where(bad[:, None], np.nan, out)
