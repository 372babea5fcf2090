r"""What was there, from what was read: a sensor law inverted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gimbalcal.number import Array, complex_step

MIN_DETERMINANT = 1e-6  # of a determinant that is one for a perfect sensor
MAX_RELATIVE_STEP = 1e-10  # of the largest reading: the step after it is its square, below rounding
MIN_RELATIVE_SINGULAR_VALUE = 1e-3  # of the largest singular value of H: along the others a flat law does not answer
MAX_STEPS = 20  # four or five are enough where the law is not flat


def invert_response(h: Callable[[Array], Array], y: Array) -> tuple[Array, Array, Array]:
    r"""Solve h(f) = y for f (n, 3) by Newton's method from f = y; h couples only the axes of one row.

    .. math:: f \leftarrow f + H^{-1} \left(y - h(f)\right), \qquad H = \partial h / \partial f

    with the exact H. Along what the law does not answer (an axis in its dead zone) nothing can be inferred: there f
    takes the smallest step with which the other axes are right. Returns f, H (n, 3, 3) and which rows are flat (n,).
    Where no f reads y, h(f) is not y: a caller that cannot be sure compares. h must be made of arithmetic and the
    functions of `number`.
    """
    f = np.array(y, dtype=float)
    for _ in range(MAX_STEPS):
        with np.errstate(invalid="ignore", over="ignore"):  # where no f reads y, a step may leave the law's domain
            read, H = response_with_derivative(h, f)
            flat = np.abs(np.linalg.det(H)) < MIN_DETERMINANT
            residual = (y - read)[..., None]
            step = np.linalg.solve(np.where(flat[:, None, None], np.eye(3), H), residual)[..., 0]
            step[flat] = (np.linalg.pinv(H[flat], rcond=MIN_RELATIVE_SINGULAR_VALUE) @ residual[flat])[..., 0]
            f = f + step
        if np.all(
            np.abs(step) <= MAX_RELATIVE_STEP * max(np.max(np.abs(y), initial=0.0), np.max(np.abs(f), initial=0.0))
        ):
            break
    return f, H, flat


def response_with_derivative(h: Callable[[Array], Array], f: Array) -> tuple[Array, Array]:
    """Return h(f) (n, 3) and its exact derivative H (n, 3, 3); h couples only the axes of one row."""
    return h(f), complex_step(h, f)
