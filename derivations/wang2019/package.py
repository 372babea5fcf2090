"""The package's sensor models, frames and step for the paper's formulas, and how far they are from the derivations.

Nothing is derived here. Every function returns the largest relative difference between what `gimbalcal` computes and
what the derivation says, at generic numbers. `package_rows` does it for the fits.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from derivations.comparison import checks
from derivations.wang2019 import frames, models, optimisation
from derivations.wang2019.symbols import BIAS, K1, K2, K3, SOURCE, E, N, polynomial, triangle

RNG_SEED = 3
GENERIC: dict[Any, float] = {
    **dict(zip(K1, (1.1, 0.9, 1.05), strict=True)),
    **dict(zip(K2, (0.03, -0.02, 0.01), strict=True)),
    **dict(zip(K3, (-0.01, 0.02, 0.015), strict=True)),
    **dict(zip(BIAS, (0.1, -0.2, 0.15), strict=True)),
    **dict(zip(E, (0.02, -0.03, 0.01), strict=True)),
    **dict(zip(N, (0.7, -0.4, 0.6), strict=True)),
}
PARAMETERS = (*K1, *K2, *K3, *BIAS, *E)  # order of `Pulses.vector`
PULSES = "estimate.pulses.gravity_norm.Pulses.physical"


def numbers(expr: Any, values: dict[Any, float]) -> Any:
    """Return the sympy to floats."""
    matrix = sp.Matrix([expr]) if not isinstance(expr, sp.MatrixBase) else expr
    return np.array(matrix.subs(values).evalf(20).tolist(), dtype=float)


def vector(*dropped: Any) -> Any:
    """Return the generic parameters (15,) with some at zero."""
    return np.array([0.0 if s in dropped else GENERIC[s] for s in PARAMETERS])


def counts() -> Any:
    """Return one generic row of counts (1, 3)."""
    return np.array([[GENERIC[s] for s in N]])


def _physical(*dropped: Any) -> Any:
    from gimbalcal.estimate.pulses.gravity_norm import Pulses

    return Pulses.from_vector(vector(*dropped)).physical(counts())[0]


@checks(SOURCE, "Eq. (2)", where=PULSES)
def accelerometer_model() -> float:
    """Pulses to force."""
    return float(np.abs(_physical() - numbers(triangle() * polynomial(3), GENERIC)[:, 0]).max())


@checks(SOURCE, "Eq. (2)", "Eq. (6)", where="estimate.pulses.gravity_norm.Pulses.counts")
def inverse_model() -> float:
    """Force to pulses: the inverse of the derived force must be the counts."""
    from gimbalcal.estimate.pulses.gravity_norm import Pulses

    force = numbers(triangle() * polynomial(3), GENERIC)[:, 0]
    return float(np.abs(Pulses.from_vector(vector()).counts(force[None]) - counts()).max())


@checks(SOURCE, "Eq. (6)", where=PULSES)
def gyroscope_model() -> float:
    """Pulses to rate: no cubic term."""
    return float(np.abs(_physical(*K3) - numbers(triangle() * polynomial(2), GENERIC)[:, 0]).max())


@checks(SOURCE, "Eq. (3)", "Eq. (7)", where=PULSES)
def square() -> float:
    """The second order alone."""
    alone = sp.diag(*K2) * models.elementwise(2)
    return float(np.abs(_physical(*K1, *K3, *BIAS, *E) - numbers(alone, GENERIC)[:, 0]).max())


@checks(SOURCE, "Eq. (4)", where=PULSES)
def cube() -> float:
    """The third order alone."""
    alone = sp.diag(*K3) * models.elementwise(3)
    return float(np.abs(_physical(*K1, *K2, *BIAS, *E) - numbers(alone, GENERIC)[:, 0]).max())


@checks(SOURCE, "Eq. (5)", "Eq. (8)", where="estimate.pulses.gravity_norm.unit_lower_triangular")
def lower_triangle() -> float:
    """C through first order, which is what a diagonal in the scale terms leaves."""
    from gimbalcal.estimate.pulses.gravity_norm import unit_lower_triangular

    first = models.orthogonalised().applyfunc(_through_first)
    return float(np.abs(unit_lower_triangular(np.array([GENERIC[s] for s in E])) - numbers(first, GENERIC)).max())


def _through_first(expr: Any) -> Any:
    return sum(c * sp.prod(s**k for s, k in zip(E, p, strict=True)) for p, c in sp.Poly(expr, *E).terms() if sum(p) < 2)


@checks(SOURCE, "Eq. (40)", where="inference.levenberg")
def damped_step() -> float:
    """One step of the package with a Jacobian J against the minimum of the damped model with H = J^T J, J^T r."""
    from gimbalcal.inference import levenberg

    rng = np.random.default_rng(RNG_SEED)
    J, r, beta = rng.standard_normal((1, 5, 2)), rng.standard_normal((1, 5)), 0.3
    H, slope = J[0].T @ J[0], J[0].T @ r[0]
    at = dict(zip((*optimisation.gradient, *optimisation.x), (*slope, 0.0, 0.0), strict=True))
    at |= {optimisation.H[i, j]: H[i, j] for i in range(2) for j in range(2)} | {optimisation.beta: beta}
    ours = levenberg._step(r, J, np.array([beta]))[0]
    return float(np.abs(ours - numbers(optimisation.damped_step(), at)[:, 0]).max())


@checks(SOURCE, "Eq. (36)", where="inference.levenberg")
def half_square() -> float:
    """The cost that is minimised."""
    from gimbalcal.inference import levenberg

    r = np.array([0.3, -0.2, 0.5])
    minimum = levenberg.minimise(lambda x, _: (r[None] + 0 * x, np.zeros((1, 3, 1))), np.zeros((1, 1)), limit=1)
    cost = optimisation.PRINTED["Eq. (36)"].formula
    return float(abs(minimum.cost[0] - numbers(cost, dict(zip(optimisation.r, r, strict=True)))[0, 0]))


@checks(SOURCE, "Eq. (41)", "Eq. (42)", where="estimate.pulses.gravity_norm.initial_scale")
def rough_scale() -> float:
    """Gradient of Eq. (41) or (42) at the package's initial scale factors, over its size elsewhere."""
    from gimbalcal.estimate.pulses import gravity_norm as fit

    rng = np.random.default_rng(RNG_SEED)
    drawn = rng.standard_normal((1, 12, 3))
    K = fit.initial_scale(drawn, 1.3)[0]
    here, there = (optimisation.gradient_of_rough(K * f, drawn[0], 1.3) for f in (1.0, 1.1))
    return float(np.abs(here).max() / np.abs(there).max())


@checks(SOURCE, "Eq. (43)", where="estimate.gyroscopes.revolutions.triad_rotation")
def euler_matrix() -> float:
    """The matrix from its angles."""
    from gimbalcal.estimate.gyroscopes import revolutions

    at = np.array([0.3, -0.2, 0.5])
    derived = numbers(frames.product(), dict(zip(frames.ANGLES, at, strict=True)))
    return float(np.abs(revolutions.triad_rotation(at) - derived).max())


@checks(SOURCE, "Eq. (43)", where="estimate.gyroscopes.revolutions.euler_angles")
def euler_angles() -> float:
    """The angles from the derived matrix."""
    from gimbalcal.estimate.gyroscopes import revolutions

    at = np.array([0.3, -0.2, 0.5])
    return float(
        np.abs(
            revolutions.euler_angles(numbers(frames.product(), dict(zip(frames.ANGLES, at, strict=True)))) - at
        ).max()
    )
