"""The rows of the package's estimators against the derivations: Eqs. (5), (8) to (10), (15) to (17), (20), (26).

`package` compares the forward model; an estimator that writes an equation down again is compared here. As there, the
largest difference is returned, columns scaled to order one.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from derivations.comparison import checks
from derivations.wu2018 import fine_norm, sensor, static_force
from derivations.wu2018.package import numbers, wanted
from derivations.wu2018.package_static import PHASES
from derivations.wu2018.symbols import BETA, G_NORMAL, LATITUDE, NUMBERS, RESIDUALS, SOURCE, L, S_t

NORM_ROWS = "estimate.accelerometers.fine.norm_rows"
SIGMA, SAMPLES = 2e-3, 7.0  # m/s^2 of one sample, samples of a position: any
# 1 + scale, bias [m/s^2], K_nl [s^2/m], beta [rad]: as large as is exact, each unlike the others
AT = np.array([3e-3, -2e-3, 1e-3, 0.02, -0.03, 0.01, 2e-4, -1e-4, 3e-4, 2e-3, -1e-3, 3e-3, 1e-3, -2e-3, 4e-3])
OUTPUTS = np.array([[3.1, -5.2, 7.3], [-6.9, 1.1, 6.4], [0.3, 9.7, -1.2], [-2.2, -3.3, -8.8]])  # m/s^2, any


@cache
def _derived_force() -> Any:
    """Return Eq. (8) at the estimates of `AT` for each of the outputs (m, 3)."""
    values = dict(zip((*sensor.SF, *sensor.b, *sensor.K, *BETA), np.r_[1 + AT[:3], AT[3:]], strict=True))
    force = sensor.solved_for_force()
    return np.array([numbers(force, values | dict(zip(sensor.f_a, y, strict=True)))[:, 0] for y in OUTPUTS])


@cache
@cache
def _derived_rows() -> Any:
    """Return (m, 15) the first-order observation by the deviations, at u = SF_hat (f^a - b_hat): (16) times d(17)."""
    at = dict(zip(fine_norm.SF_hat, 1 + AT[:3], strict=True))
    first = sp.expand((fine_norm.ROW * fine_norm.unknowns())[0])
    gradient = sp.lambdify(fine_norm.u, [first.diff(x).subs(at) for x in fine_norm.DEVIATIONS])
    return np.array([gradient(*((1 + AT[:3]) * (y - AT[3:6]))) for y in OUTPUTS])


def _package_row(y: Any) -> Any:
    """Return (16,) what the fine stage makes of one output: derivatives [per SI unit] and observation, not whitened."""
    from gimbalcal.estimate.accelerometers import fine

    parameters = wanted(("scale_factor", "bias", "scale_nonlinearity", "misalignment"))
    info = fine.norm_rows(y[None], np.array([SAMPLES]), AT, parameters, G_NORMAL, SIGMA)
    row = info.rows[0] / np.r_[[p.sigma for p in parameters], 1.0] * G_NORMAL * SIGMA / np.sqrt(SAMPLES)
    return row * np.sign(row[0])  # the triangle of one row leaves its sign open; u_x^2 / SF_x is positive


@checks(SOURCE, "Eq. (10)", "Eq. (15)", "Eq. (16)", "Eq. (17)", where=NORM_ROWS)
def norm_row() -> float:
    """The derivatives of the observation."""
    derived = _derived_rows()
    ours = np.array([_package_row(y)[:-1] for y in OUTPUTS])
    return float(np.abs((ours - derived) / np.abs(derived).max(axis=0)).max())


@checks(SOURCE, "Eq. (8)", "Eq. (9)", "Eq. (10)", where=NORM_ROWS)
def norm_misfit() -> float:
    """The observation itself: half of g^2 less the squared norm of (8) at the estimates, less what noise adds to it.

    Noise n white along the axes makes E|f + n|^2 = |f|^2 + 3 sigma^2 / samples, as in (20).
    """
    ours = np.array([_package_row(y)[-1] for y in OUTPUTS])
    derived = (G_NORMAL**2 - (_derived_force() ** 2).sum(1) + 3 * SIGMA**2 / SAMPLES) / 2
    return float(np.abs(ours - derived).max() / G_NORMAL**2)


@cache
def _day() -> tuple[Any, Any, Any, Any]:
    """Return the ideal force over g (n, 3), Delta f over g (n, 3), z of (20) at each, for Tables 2 and 3; and x_1 to
    x_5.
    """
    at = {**NUMBERS}
    force = np.stack([numbers(static_force.force(), {L: LATITUDE, S_t: t})[:, 0] for t in PHASES])
    error = static_force.force_error().subs({r: at[r] for r in RESIDUALS}).subs(at)
    off = np.stack([numbers(error, {S_t: t})[:, 0] for t in PHASES])
    f, d = sp.Matrix(static_force.f), sp.Matrix(static_force.df)
    z = sp.lambdify((*f, *d), (f.T * d)[0])
    states = np.array([float(x.subs(at).evalf(20)) for x in static_force.states()])
    return force, off, np.array([z(*a, *b) for a, b in zip(force, off, strict=True)]), states


@checks(SOURCE, "Eq. (20)", where="estimate.static_run.force_filter.projection")
def projection() -> float:
    """The linear part of (20), which is what the package observes."""
    from gimbalcal.estimate.static_run import force_filter

    force, off, z, _ = _day()
    ours = force_filter.projection(G_NORMAL * off, force, G_NORMAL)
    return float(np.abs(ours - z).max() / np.abs(z).max())


@checks(SOURCE, "Eq. (26)", where="estimate.static_run.force_filter.estimate_state")
def filtered() -> float:
    """The states from a day without noise: the filter must return (21) to (25)."""
    from gimbalcal.estimate.static_run import force_filter

    force, _, z, states = _day()
    estimate = force_filter.estimate_state(z, force_filter.observation_matrix(force), 1e-24)  # 1e20 times the prior
    return float(np.abs(estimate.x - states).max() / np.abs(states).max())
