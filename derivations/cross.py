"""The matrix of the cross product, [v x] w = v x w, for every paper: of symbols, and of numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp


def cross(v: Any) -> Any:
    """Return [v x] (3, 3) of symbols."""
    x, y, z = v
    return sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def cross_of_numbers(v: Any) -> Any:
    """Return [v x] (3, 3) of numbers, complex ones too."""
    x, y, z = v
    return np.array([[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]])
