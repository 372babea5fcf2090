"""The package's own numbers for the paper's formulas, and how far they are from the derivations.

Nothing is derived here. Every function returns the largest relative difference between what `gimbalcal` computes and
what the derivation says, at generic numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from derivations.verdict import checks
from derivations.wang2019 import accelerometer, frames, gyroscope, optimisation
from derivations.wang2019.symbols import BIAS, K1, K2, K3, SOURCE, E, N, fa, fp, polynomial, triangle

RNG_SEED = 3
GENERIC: dict[Any, float] = {
    **dict(zip(K1, (1.1, 0.9, 1.05), strict=True)),
    **dict(zip(K2, (0.03, -0.02, 0.01), strict=True)),
    **dict(zip(K3, (-0.01, 0.02, 0.015), strict=True)),
    **dict(zip(BIAS, (0.1, -0.2, 0.15), strict=True)),
    **dict(zip(E, (0.02, -0.03, 0.01), strict=True)),
    **dict(zip(N, (0.7, -0.4, 0.6), strict=True)),
}


def numbers(expr: Any, values: dict[Any, float]) -> Any:
    """Sympy to floats."""
    matrix = sp.Matrix([expr]) if not isinstance(expr, sp.MatrixBase) else expr
    return np.array(matrix.subs(values).evalf(20).tolist(), dtype=float)


def _vector(order: int) -> Any:
    drop = {3: (), 2: K3}[order]
    x = [GENERIC[s] for s in (*K1, *K2, *K3, *BIAS, *E)]
    names = (*K1, *K2, *K3, *BIAS, *E)
    return np.array([0.0 if s in drop else v for s, v in zip(names, x, strict=True)])


def _counts() -> Any:
    return np.array([[GENERIC[s] for s in N]])


@checks(SOURCE, "Eq. (2)")
def accelerometer_model() -> float:
    """Eq. (2) against `Pulses.physical`."""
    from gimbalcal.wang2019.pulses import Pulses

    ours = Pulses.from_vector(_vector(3)).physical(_counts())[0]
    return float(np.abs(ours - numbers(triangle() * polynomial(3), GENERIC)[:, 0]).max())


@checks(SOURCE, "Eq. (6)")
def gyroscope_model() -> float:
    """Eq. (6) against `Pulses.physical` without a cubic term."""
    from gimbalcal.wang2019.pulses import Pulses

    ours = Pulses.from_vector(_vector(2)).physical(_counts())[0]
    return float(np.abs(ours - numbers(triangle() * polynomial(2), GENERIC)[:, 0]).max())


@checks(SOURCE, "Eq. (20)", "Eq. (25)")
def norm_derivatives() -> float:
    """The 15 derivatives of F against the Jacobian of the norm fit (which is F over 2 sigma, in g)."""
    from gimbalcal.wang2019.fit import _residuals

    x = _vector(3)
    J = 2 * _residuals(x[None], _counts()[None], 1.0, np.arange(15))[1][0, 0]
    along = numbers(polynomial(3), GENERIC)[:, 0]
    force = numbers(triangle() * polynomial(3), GENERIC)[:, 0]
    at = {**GENERIC, **dict(zip(fa, along, strict=True)), **dict(zip(fp, force, strict=True))}
    return float(np.abs(J - numbers(sp.Matrix(accelerometer.derivatives()), at)[:, 0]).max())


@checks(SOURCE, "Eq. (34)")
def turn_derivatives() -> float:
    """The 9 derivatives of P against the Jacobian of the rotation fit."""
    from gimbalcal.wang2019.revolutions import _triad

    S, S2 = np.array([0.7, -0.4, 0.6]), np.array([0.1, 0.2, -0.15])
    sums, squares = gyroscope.S, gyroscope.S2
    at = {**GENERIC, **dict(zip(sums, S, strict=True)), **dict(zip(squares, S2, strict=True))}
    x = np.r_[_vector(2)[:6], np.zeros(3), _vector(2)[12:]]
    D, J = _triad(x[None], np.stack([S, S2, 0 * S])[None, None])
    ours = 2 * (D[0, 0] @ J[0, 0])[[0, 1, 2, 3, 4, 5, 9, 10, 11]]
    along = [at[k1] * at[s] + at[k2] * at[q] for k1, k2, s, q in zip(K1, K2, sums, squares, strict=True)]
    turned = numbers(triangle(), GENERIC) @ np.array(along)
    at |= dict(zip(gyroscope.psi_q, turned, strict=True)) | dict(zip(gyroscope.psi_g, along, strict=True))
    exact = [gyroscope.exact(*wanted) for wanted in (K1, K2, E)]
    return float(np.abs(ours - np.concatenate([numbers(e, at)[:, 0] for e in exact])).max())


@checks(SOURCE, "Eq. (41)")
def rough_scale() -> float:
    """Gradient of Eq. (41) or (42) at the package's initial scale factors, over its size elsewhere."""
    from gimbalcal.wang2019.fit import initial_scale

    rng = np.random.default_rng(RNG_SEED)
    counts = rng.standard_normal((1, 12, 3))
    K = initial_scale(counts, 1.0)[0]
    here, there = (optimisation.gradient_of_rough(K * f, counts[0], 1.0) for f in (1.0, 1.1))
    return float(np.abs(here).max() / np.abs(there).max())


@checks(SOURCE, "Eq. (43)")
def euler_matrix() -> float:
    """Eq. (43) against `inter_triad.triad_rotation`."""
    from gimbalcal.estimate.gyroscopes.inter_triad import triad_rotation

    at = np.array([0.3, -0.2, 0.5])
    return float(
        np.abs(triad_rotation(at) - numbers(frames.product(), dict(zip(frames.ANGLES, at, strict=True)))).max()
    )
