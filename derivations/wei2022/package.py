"""The package's sensor effects and rotation schedule against the derivations.

As in `cai2016.package`: what the package's unit reads more by each parameter against the derivative of (7), (8). The
paper's errors are of the reading, so dK = -s with true = SF x reading; dA is an element of what the reading is of the
input, which the package's angles beta are with signs of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import sympy as sp

from derivations import navigator
from derivations.comparison import checks, once
from derivations.readings import BETA, FORCE, RATE, TURN, package_slopes
from derivations.wei2022 import sensors, table_1, tables
from derivations.wei2022.symbols import NAMES, SOURCE, dA_a, dA_g, dK_a, dK_g, epsilon, f, nabla, omega

# element of dA in terms of beta: Eq. (5) of Wu et al. has the reading's matrix off the diagonal
ELEMENT = {"xz": ("xy", 1), "xy": ("xz", -1), "yz": ("yx", -1), "yx": ("yz", 1), "zy": ("zx", 1), "zx": ("zy", -1)}


def _beta(element: str) -> str:
    """Return the package's letters of an element of dA."""
    return next(beta for beta, (of, _) in ELEMENT.items() if of == element)


def _slopes(symbols: Sequence[Any], error: Any) -> Any:
    """Return (3, p) derivatives of the derived reading."""
    J = error.jacobian(sp.Matrix(symbols)).subs(dict(zip((*omega, *f), (*RATE[0], *FORCE[0]), strict=True)))
    return np.array(J.evalf(20).tolist(), dtype=float)


def coefficient(effect: str, field: str, symbols: Sequence[Any], sign: int, error: Any) -> float:
    """Return one field, relative."""
    ours, derived = package_slopes(effect, field, len(symbols)), sign * _slopes(symbols, error())
    return float(np.abs(ours - derived).max() / np.abs(derived).max())


def angles(effect: str, symbols: Sequence[Any], error: Any) -> float:
    """Return each beta against the element of dA that it is."""
    ours, derived = package_slopes(effect, "beta", 6), _slopes(symbols, error())
    names = [str(s)[-2:] for s in symbols]
    worst = 0.0
    for i, beta in enumerate(BETA):
        element, sign = ELEMENT[beta]
        if element in names:
            worst = max(worst, float(np.abs(ours[:, i] - sign * derived[:, names.index(element)]).max()))
    return worst / float(np.abs(derived).max())


_G, _A = "forward.gyroscopes", "forward.accelerometers"
checks(SOURCE, "Eq. (1)", "Eq. (7)", where=_G)(
    partial(coefficient, "gyro_bias", "epsilon", epsilon, 1, sensors.rate_error)
)
checks(SOURCE, "Eq. (3)", "Eq. (7)", where=_G)(
    partial(coefficient, "gyro_scale_factor", "s", dK_g, -1, sensors.rate_error)
)
checks(SOURCE, "Eq. (5)", "Eq. (7)", where=_G)(partial(angles, "gyro_misalignment", dA_g, sensors.rate_error))
checks(SOURCE, "Eq. (2)", "Eq. (8)", where=_A)(partial(coefficient, "bias", "b", nabla, 1, sensors.force_error))
checks(SOURCE, "Eq. (4)", "Eq. (8)", where=_A)(partial(coefficient, "scale_factor", "s", dK_a, -1, sensors.force_error))
checks(SOURCE, "Eq. (6)", "Eq. (8)", where=_A)(partial(angles, "misalignment", dA_a, sensors.force_error))


@once
def _attitudes() -> Any:
    """Return the package's (31, 3, 3) body to east, north, up."""
    from gimbalcal.schedule.published import ROTATIONS

    return TURN @ ROTATIONS["wei2022-30"].attitudes()


def attitude(row: int) -> float:
    """Return a row of the published schedule against the attitude that the turns make."""
    return float(np.abs(_attitudes()[row] - table_1.attitudes()[row]).max())


for _row in range(1, 2 * len(table_1.ROWS) + 1):
    checks(SOURCE, table_1.item(_row), where="schedule.published.WEI_30")(partial(attitude, _row))
checks(SOURCE, "Section 4.1, initial attitude", where="schedule.published.WEI_30")(partial(attitude, 0))


# --- navigation and filter

checks(SOURCE, *(f"Eq. ({n})" for n in (9, 10, 11)), where=navigator.UNIT)(navigator.mechanised)
for _item, _row in (("Eq. (9)", 1), ("Eq. (10)", 2), ("Eq. (11)", 3)):
    for _column in (1, 2, 3):
        checks(SOURCE, _item, where=navigator.GROWTH)(partial(navigator.growth, _row, _column))
checks(SOURCE, "Eq. (9)", "Eq. (10)", where=navigator.GROWTH)(navigator.driven)
_UPDATES = tuple(f"Eq. ({n})" for n in range(18, 23))
checks(SOURCE, *_UPDATES, where="inference.square_root_filter.filter")(navigator.square_root_filter)


# --- degrees of observability

CURVES = "design.turning_observability"
# states as the package names them, in the order of the paper's
STATES = (
    *(f"{name}:{a}" for name in ("gyro_bias", "bias", "gyro_scale_factor", "scale_factor") for a in "xyz"),
    *(f"gyro_misalignment:{_beta(str(s)[-2:])}" for s in dA_g), *(f"misalignment:{_beta(str(s)[-2:])}" for s in dA_a),
)  # fmt: skip


def printed_degree(row: int) -> float:
    """Return a row of Table 2 as the package tells it."""
    from gimbalcal.design.turning_observability import TABLE_2

    return float(np.abs(np.array(TABLE_2[STATES[row]]) - [float(d) for d in tables.TABLE_2[row]]).max())


for _row, _name in enumerate(NAMES):
    checks(SOURCE, f"Table 2, {_name}", where=f"{CURVES}.TABLE_2")(partial(printed_degree, _row))


def _curve(degree: float) -> Any:
    from gimbalcal.design.turning_observability import SigmaCurve

    return SigmaCurve("bias:x", "ug", degree, np.array([degree, 1.0]))


@checks(SOURCE, "Eq. (23)", where=f"{CURVES}.SigmaCurve.degree")
def degree() -> float:
    """Root of the ratio of variances."""
    return abs(_curve(7.0).degree - np.sqrt(7.0**2 / 1.0**2))


@checks(SOURCE, "Eq. (24)", where=f"{CURVES}.SigmaCurve.word")
def thresholds() -> float:
    """How many of the words on either side of a threshold are others."""
    words = {1.0: "unobservable", 1.1: "low", 2.0: "low", 2.1: "moderate", 10.0: "moderate", 10.1: "high"}
    return float(sum(_curve(d).word != word for d, word in words.items()))
