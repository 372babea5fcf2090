"""The package's sensor effects, inversion and rotation schedule against the derivations.

Nothing is derived here. The package's unit reads; what it reads more by each parameter, at a generic rate and force, is
compared with the derivative of the derived model. Signs between both: a scale factor of the package is SF - 1 with true
= SF x reading, so dK = s of (1), (4); its misalignment turns an axis of the block into the input axis, Cai's angles the
input axis into that of the block, so beta = -gamma, -alpha with the same letters.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np
import sympy as sp

from derivations.cai2016 import table_1
from derivations.cai2016.symbols import (
    ALPHA,
    GAMMA,
    SOURCE,
    G_matrix,
    K_a,
    K_a2,
    K_cross,
    K_g,
    accelerometer_axes,
    b_a,
    b_g,
    crossed,
    f,
    gyro_axes,
    omega,
    r,
    size_effect,
    squared,
)
from derivations.comparison import checks, once
from derivations.readings import BETA, FORCE, RATE, TURN, package_slopes

GYRO, ACC = "forward.gyroscopes", "forward.accelerometers"
# effect of the package, its field, symbols of the derivation in the field's order
GYRO_FIELDS = (
    ("gyro_scale_factor", "s", K_g), ("gyro_bias", "epsilon", b_g), ("gyro_g_sensitivity_rate", "G", tuple(G_matrix)),
)  # fmt: skip
ACC_FIELDS = (
    ("scale_factor", "s", K_a), ("bias", "b", b_a), ("quadratic_nonlinearity", "K2", K_a2),
    ("cross_coupling", "K_c", K_cross),
)  # fmt: skip


def derived_counts(gyroscopes: bool) -> Any:
    """Return what a unit reads, exactly as (1) and (4) with (9) to (11): counts N at the true rate and force."""
    if gyroscopes:
        along = gyro_axes() * sp.Matrix(omega) + sp.Matrix(b_g) + G_matrix * sp.Matrix(f)
        return sp.Matrix([a / k for a, k in zip(along, K_g, strict=True)])
    along = accelerometer_axes() * sp.Matrix(f) + sp.Matrix(b_a) + squared(f) * sp.Matrix(K_a2)
    along += crossed(f) * sp.Matrix(K_cross) + size_effect(omega) * sp.Matrix(r)
    return sp.Matrix([a / k for a, k in zip(along, K_a, strict=True)])


def derived_slopes(symbols: Sequence[Any], gyroscopes: bool) -> Any:
    """Return (3, p) derivatives of the derived reading at nominal."""
    return _all_slopes(gyroscopes)[:, [_order(gyroscopes).index(s) for s in symbols]]


def _order(gyroscopes: bool) -> tuple[Any, ...]:
    return (*K_g, *b_g, *G_matrix, *GAMMA) if gyroscopes else (*K_a, *b_a, *K_a2, *K_cross, *r, *ALPHA)


@cache
def _all_slopes(gyroscopes: bool) -> Any:
    order = _order(gyroscopes)
    nominal = dict.fromkeys(order, 0) | dict.fromkeys((*K_g, *K_a), 1)
    nominal |= dict(zip((*omega, *f), (*RATE[0], *FORCE[0]), strict=True))
    J = derived_counts(gyroscopes).jacobian(sp.Matrix(order)).subs(nominal)
    return np.array(J.evalf(20).tolist(), dtype=float)


def coefficient(effect: str, field: str, symbols: Sequence[Any], gyroscopes: bool) -> float:
    """Return one field against the derivative of the derived model, relative."""
    ours, derived = package_slopes(effect, field, len(symbols)), derived_slopes(symbols, gyroscopes)
    return float(np.abs(ours - derived).max() / np.abs(derived).max())


def angles(gyroscopes: bool) -> float:
    """Return the misalignment, letter by letter, with the other sign."""
    effect = "gyro_misalignment" if gyroscopes else "misalignment"
    ours = package_slopes(effect, "beta", 6)
    symbols = GAMMA if gyroscopes else ALPHA
    letters = [str(s).split("_")[1] for s in symbols]
    derived = -derived_slopes(symbols, gyroscopes)
    return float(np.abs(ours[:, [BETA.index(x) for x in letters]] - derived).max() / np.abs(derived).max())


def arms() -> float:
    """Return each accelerometer's arm along its own axis, in steady rotation."""
    ours = package_slopes("accelerometer_lever_arm", "r", 9)[:, [0, 4, 8]]
    derived = derived_slopes(r, False)
    return float(np.abs(ours - derived).max() / np.abs(derived).max())


for _effect, _field, _symbols in GYRO_FIELDS:
    _items = ["Eq. (1)", "Eq. (2)", "Eq. (3)", "Eq. (18)"]
    _items.append("Eq. (23), F16" if _field == "G" else "Eq. (23), F14")
    checks(SOURCE, *_items, where=GYRO)(partial(coefficient, _effect, _field, _symbols, True))
for _effect, _field, _symbols in ACC_FIELDS:
    _block = {"K2": "F27", "K_c": "F28"}.get(_field, "F25")
    checks(SOURCE, "Eq. (4)", "Eq. (5)", "Eq. (6)", "Eq. (12)", "Eq. (19)", f"Eq. (23), {_block}", where=ACC)(
        partial(coefficient, _effect, _field, _symbols, False)
    )
checks(SOURCE, "Eq. (3)", "Eq. (18)", "Eq. (23), F14", where=GYRO)(partial(angles, True))
checks(SOURCE, "Eq. (6)", "Eq. (20)", "Eq. (23), F25", where=ACC)(partial(angles, False))
checks(SOURCE, *(f"Eq. ({n})" for n in (9, 10, 11, 12, 19)), "Eq. (23), F29", where=ACC)(arms)


@checks(SOURCE, "Eq. (7)", "Eq. (8)", where="inversion.invert_response")
def inversion() -> float:
    """(6) solved: counts of the derived model with squares and products, inverted by the package's, over the force."""
    from gimbalcal.inversion import invert_response

    values = dict(zip((*K_a2, *K_cross), (3e-5, -2e-5, 1e-5, 2e-5, -1e-5, 3e-5, 1e-5, -3e-5, 2e-5), strict=True))
    values |= dict.fromkeys((*b_a, *r, *ALPHA), 0.0) | dict.fromkeys(K_a, 1.0)
    model = sp.lambdify(f, list(derived_counts(False).subs(values)))

    def read(force: Any) -> Any:
        return np.stack(model(*np.moveaxis(force, -1, 0)), axis=-1)

    solved, _, _ = invert_response(read, read(FORCE))
    return float(np.abs(solved - FORCE).max() / np.abs(FORCE).max())


# --- Table 1


@once
def _schedule() -> tuple[Any, Any]:
    """Return the package's attitudes (19, 3, 3) body to east, north, up, and speed [deg/s], stop [s]."""
    from gimbalcal.schedule.published import ROTATIONS

    schedule = ROTATIONS["cai2016-18"]
    return TURN @ schedule.attitudes(), np.array([np.degrees(schedule.rate), schedule.stop])


def attitude(row: int) -> float:
    """Return a row of the published schedule against the attitude that the turns make."""
    return float(np.abs(_schedule()[0][row] - table_1.attitudes()[row]).max())


for _row in range(len(table_1.ROWS) + 1):
    checks(SOURCE, table_1.item(_row), where="schedule.published.CAI_18")(partial(attitude, _row))


@checks(SOURCE, "Section 3.4, 1 h", where="schedule.published.CAI_18")
def times() -> float:
    """Speed and stop."""
    return float(np.abs(_schedule()[1] - [table_1.SPEED, table_1.STOP]).max())
