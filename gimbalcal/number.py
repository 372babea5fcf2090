"""Elementary functions that run alike on floats, complex numbers and sympy symbols.

An effect is written once and evaluated on three kinds of number: float (simulate, predict), complex (exact
derivatives by the complex step, Squire and Trapp 1998) and symbols (derivations). numpy drops the imaginary part in
``abs``, ``maximum`` and comparisons and does not know symbols, so effects use the functions of this module instead.
Branches are decided by the real part.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]
STEP = 1e-30  # complex step; any value far below sqrt(smallest double) / largest second derivative is exact


def is_symbolic(x: ArrayLike) -> bool:
    """Return whether `x` holds sympy expressions (an object array)."""
    return np.asarray(x).dtype == object


def holds_real_numbers(x: Array) -> bool:
    """Return whether an array is of a type of real numbers, or of truth values."""
    return x.dtype.kind in "biuf"


def _elementwise(name: str, numeric: Callable[[Array], Array]) -> Callable[[ArrayLike], Array]:
    def function(x: ArrayLike) -> Array:
        x = np.asarray(x)
        if x.dtype != object:
            return numeric(x)
        import sympy

        return np.vectorize(getattr(sympy, name), otypes=[object])(x)

    function.__name__ = name
    function.__doc__ = f"{name} of each element: float, complex or sympy."
    return function


sin = _elementwise("sin", np.sin)
cos = _elementwise("cos", np.cos)
exp = _elementwise("exp", np.exp)
log = _elementwise("log", np.log)
sqrt = _elementwise("sqrt", np.sqrt)
absolute = _elementwise("Abs", lambda x: np.where(x.real < 0, -x, x))
sign = _elementwise("sign", lambda x: np.sign(x.real))


def _complex_arcsin(x: Array) -> Array:
    """Return the arc sine; for complex x the first-order extension about the real part that the complex step needs."""
    if not np.iscomplexobj(x):
        return np.arcsin(x)
    return np.arcsin(x.real) + 1j * x.imag / np.sqrt(1 - x.real**2)


arcsin = _elementwise("asin", _complex_arcsin)


def arctan2(y: ArrayLike, x: ArrayLike) -> Array:
    """Return the quadrant-aware arc tangent of y / x [rad]; complex arguments carry their first-order part."""
    y, x = np.asarray(y), np.asarray(x)
    if is_symbolic(y) or is_symbolic(x):
        import sympy

        return np.vectorize(sympy.atan2, otypes=[object])(y, x)
    angle = np.arctan2(y.real, x.real)
    if np.iscomplexobj(y) or np.iscomplexobj(x):
        return angle + 1j * (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return angle


def minimum(x: ArrayLike, y: ArrayLike) -> Array:
    """Return the smaller of two by the real part, keeping the imaginary part of the one chosen."""
    x, y = np.asarray(x), np.asarray(y)
    if is_symbolic(x) or is_symbolic(y):
        import sympy

        return np.vectorize(sympy.Min, otypes=[object])(x, y)
    return np.where(x.real <= y.real, x, y)


def maximum(x: ArrayLike, y: ArrayLike) -> Array:
    """Return the larger of two by the real part, keeping the imaginary part of the one chosen."""
    return -minimum(-np.asarray(x), -np.asarray(y))


def apply_matrix(matrix: ArrayLike, vector: ArrayLike) -> Array:
    """Return the matrix times vector over leading dimensions: (..., 3, 3), (..., 3) to (..., 3)."""
    matrix, vector = np.asarray(matrix), np.asarray(vector)
    return np.asarray(vector @ matrix.T if matrix.ndim == 2 else (matrix @ vector[..., None])[..., 0])


def complex_step(function: Callable[[Array], Array], x: Array) -> Array:
    """Return the exact derivative of an array (...) by the last axis of x: (..., p) for x (p,), row by row for x (n,
    p).

    Squire and Trapp (1998). The function must be made of this module's functions and arithmetic.
    """
    x = np.asarray(x)
    if x.shape[-1] == 0:
        return np.zeros((*np.shape(function(x)), 0))
    return np.stack([np.asarray(function(x + 1j * STEP * unit)).imag / STEP for unit in np.eye(x.shape[-1])], axis=-1)
