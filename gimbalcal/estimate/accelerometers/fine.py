r"""Fine calibration: Wu et al. (2018), section 4. The norm of the force does not care where the gimbals really stood.

Half the squared norm of the true force less that of the estimated one is linear in the remaining errors (Eqs. (8) to
(17); Delta = true less estimate, beta the angles of Eq. (5)):

.. math:: \tfrac12 (g^2 - |\hat f^p|^2) = \sum_i u_i^2 \frac{\Delta SF_i}{SF_i} - u_i \, SF_i \Delta b_i
          - u_i^3 \frac{\Delta K_i}{SF_i} + u_x u_y \Delta(\beta_{yz} - \beta_{xz})
          + u_x u_z \Delta(\beta_{xy} - \beta_{zy}) + u_z u_y \Delta(\beta_{zx} - \beta_{yx}),
          \quad u = \hat{SF} (f^a - \hat b)

Twelve combinations, one row per position. The paper solves once; here the force is estimated again with the result,
nonlinearity included (Eq. (8), exact), until nothing moves. The sums of the three pairs of misalignments turn all axes
alike, which no norm can show: they are named, and stay as the coarse stage left them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration, Residual, StageResult
from gimbalcal.effects import Parameter, values, with_values
from gimbalcal.effects.accelerometer import misalignment_matrix
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.effect import MISALIGNMENT_AXES
from gimbalcal.estimate.accelerometers.fit_summary import (
    joined_sentences,
    misfit_in_words,
    outliers_in_words,
    provenance,
)
from gimbalcal.estimate.accelerometers.position_fit import Positions
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE, Information, Solution, Unobservable, information, solve
from gimbalcal.number import Array
from gimbalcal.views.core import View
from gimbalcal.views.positions import force_of_visits, position_parameters

FORCE_TERMS = [name for name in BASELINE["multi-position"] if name != "gimbal_zero"]
PAIRS = (("yz", "xz"), ("xy", "zy"), ("zx", "yx"))  # first less second: the differences that Eq. (17) holds
COMBINATIONS = tuple(
    [f"{name}:{axis}" for name in FORCE_TERMS[:3] for axis in "xyz"] + [f"misalignment:{a}-{b}" for a, b in PAIRS]
)
MAX_ITERATIONS = 20  # two after a coarse calibration, four from nothing
NORM = "specific_force:norm"


def fine(positions: Positions, coarse: Calibration | None = None) -> Calibration:
    """Twelve combinations of coefficients from the norm of the force at every position, iterated to convergence.

    `coarse` is where the iteration begins and supplies what the norm cannot see: sums of misalignments and gimbal
    zeros, with their covariance. Without it these stay at zero with their prior sigma.
    """
    view, sample = positions.view, positions.noise.accelerometer
    platform, visits, weight = view.source.platform, len(positions.setting), view.source.weight
    wanted = position_parameters(platform, FORCE_TERMS, view.grade)
    start = coarse.effects if coarse else ()
    x, info = _iterate(view, wanted, values(start, wanted), sample)
    solution = solve(info)
    every = position_parameters(platform, grade=view.grade)
    labels = [q.label for q in every]
    first = values(start, every)
    first[[labels.index(q.label) for q in wanted]] = x
    covariance = _combine(info, solution, coarse, every)
    residual_rms = np.sqrt(solution.chi2 / visits) * sample / np.sqrt(np.mean(weight))
    misfit = misfit_in_words(solution.chi2, solution.dof)
    return Calibration(
        method="fine",
        effects=with_values(start, every, first, platform.axis_names),
        parameters=every,
        covariance=covariance,
        unobservable=_unobservable(solution, coarse),
        residual=Residual(solution.chi2, solution.dof, {NORM: float(residual_rms)}),
        outcome=joined_sentences([*outliers_in_words(positions.faults), *misfit]),
        provenance=provenance(positions),
        readout=view.readout,
        stages=(_stage(solution, x, float(residual_rms)),),
    )


def _iterate(view: View, wanted: tuple[Parameter, ...], x: Array, sigma: float) -> tuple[Array, Information]:
    """Gauss-Newton on Eq. (16); directions that the norm does not see stay where they are."""
    measured, weight = force_of_visits(view), np.bincount(view.visits.group, view.source.weight)
    for _ in range(MAX_ITERATIONS):
        info = norm_rows(measured, weight, x, wanted, view.stimulus.gravity, sigma)
        solution = solve(info)
        x = x + solution.x
        if np.all(np.abs(solution.x) < 1e-6 * solution.sigma):
            break
    return x, info


def norm_rows(
    measured: Array, weight: Array, x: Array, wanted: tuple[Parameter, ...], gravity: float, sigma: float
) -> Information:
    """Eq. (16) at estimates x: whitened rows, one per visit, about the increments of `wanted` (15,).

    measured (m, 3) [m/s^2], weight (m,) samples behind each, sigma [m/s^2] of one sample.
    """
    scale, bias, K, beta = np.split(x, [3, 6, 9])
    SF = 1 + scale
    off = measured - bias
    force = np.linalg.solve(np.eye(3) + misalignment_matrix(beta), (SF * (off - K * off**2)).T).T  # Eq. (8)
    variance = sigma**2 / weight
    # white noise adds 3 sigma^2 / n to the squared norm on average: 4e-7 g^2 at 5e-3 m/s^2 a sample
    z = (gravity**2 - ((force**2).sum(axis=-1) - 3 * variance)) / 2
    u = SF * off  # Eq. (15)
    products = [u[:, "xyz".index(i)] * u[:, "xyz".index(j)] for i, j in ("xy", "xz", "zy")]
    H = np.column_stack([u**2, -u, -(u**3), *products])  # Eq. (16)
    noise = gravity * np.sqrt(variance)
    return information((H @ combinations(SF)) / noise[:, None], z / noise, wanted)


def combinations(SF: Array) -> Array:
    """The unknowns of Eq. (17) by the increments of scale factor, bias, nonlinearity and misalignment, (12, 15)."""
    M = np.zeros((12, 15))
    M[[0, 1, 2], [0, 1, 2]] = 1 / SF
    M[[3, 4, 5], [3, 4, 5]] = SF
    M[[6, 7, 8], [6, 7, 8]] = 1 / SF
    for row, (plus, minus) in enumerate(PAIRS, start=9):
        M[row, 9 + MISALIGNMENT_AXES.index(plus)] = 1
        M[row, 9 + MISALIGNMENT_AXES.index(minus)] = -1
    return M


def _combine(info: Information, solution: Solution, coarse: Calibration | None, every: tuple[Parameter, ...]) -> Array:
    """Covariance (p, p): what the norm saw from here, what it did not see from the coarse stage."""
    before = np.diag([q.sigma**2 for q in every])
    if coarse is not None:
        shared = [i for i, q in enumerate(every) if q in coarse.parameters]
        theirs = [coarse.parameters.index(every[i]) for i in shared]
        before[np.ix_(shared, shared)] = coarse.covariance[np.ix_(theirs, theirs)]
    mine = [every.index(q) for q in solution.parameters]
    scale = np.array([q.sigma for q in solution.parameters])
    _, S, Vt = np.linalg.svd(info.rows[:, :-1], full_matrices=True)
    null = Vt[np.concatenate([S, np.zeros(len(Vt) - len(S))]) < MIN_SIGNAL_TO_NOISE].T
    unobservable = null @ null.T
    T = np.eye(len(every))
    T[np.ix_(mine, mine)] = scale[:, None] * unobservable / scale
    total = T @ before @ T.T
    total[np.ix_(mine, mine)] += solution.covariance - np.outer(scale, scale) * unobservable
    return np.asarray(total)


def _unobservable(solution: Solution, coarse: Calibration | None) -> tuple[Unobservable, ...]:
    keeps = "kept from the coarse stage" if coarse else "left at zero"
    mine = [
        replace(
            u, why=f"the norm of the force stays the same when {' and '.join(u.direction)} change together; {keeps}"
        )
        for u in solution.unobservable
    ]
    return (*mine, *(coarse.unobservable if coarse else ()))


def _stage(solution: Solution, x: Array, residual_rms: float) -> StageResult:
    """The twelve combinations that the norm determines, in full: what Eq. (17) adds up to."""
    D = combinations(np.ones(3))
    sigma = np.sqrt(np.diag(D @ solution.covariance @ D.T))
    words = "norm of the force: twelve combinations, nonlinearity among them, whatever the gimbals did"
    return StageResult("fine", COMBINATIONS, D @ x, sigma, residual_rms, words)
