r"""The fit of a triad to the norm of gravity: one row for each rest, whose attitude is not known.

Rests may scatter beyond the noise of their means; how far is estimated with the terms, and widens their sigmas.

A term that is declined, as its coefficients do not stand clear of chance, need not be zero. With J and C the whitened
rows of what is estimated and of what is not, r the misfit, and c normal with the usual size of such a unit, what is
known of c after the fit is

.. math:: \Lambda = C^T M C + D^{-2}, \quad M = 1 - J J^+, \qquad
          \langle c c^T \rangle = \Lambda^{-1} + \bar c \bar c^T, \quad \bar c = \Lambda^{-1} C^T M r

and the estimates, whose covariance is P, err by S c with S = P J^T C besides: their covariance grows by
S <c c^T> S^T. Source: Bierman, *Factorization Methods for Discrete Sequential Estimation* (1977), chapter 8 (consider
parameters).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.effects import CATALOGUE, Parameter, parameters, values
from gimbalcal.effects.effect import tied
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension
from gimbalcal.estimate.fit import ViewsFit, fit
from gimbalcal.inference.ellipsoid import MIN_POINTS, ellipsoid
from gimbalcal.number import Array
from gimbalcal.recording.record import FORCE
from gimbalcal.views.core import View
from gimbalcal.views.norm import SIX_TERMS, attitudes, in_noise_of_readings

LINEAR = ("scale_factor", "bias", "misalignment")
PRIOR_FACTOR = 100.0  # times the prior scale of a navigation platform: low-cost units reach 50 mg, 5 % and 3 deg
MAX_LEVERAGE = 1 - 1e-9  # of a position
UNKNOWN_SCATTER_G = 1e-6  # of gravity, a sample where none is known: far below any rig, the excess takes over
NOTABLE_SIGMAS = 1.0  # by which an omitted term must move an estimate to be worth a word
# x of the orthogonal frame lies along the first input axis, y in the plane of the first two: Eq. (5)


def unknowns(terms: Sequence[str]) -> tuple[Parameter, ...]:
    """Parameters of the terms; of the six misalignments the three that the norm can see."""
    wanted = [p for t in terms for p in parameters(CATALOGUE[t])]
    return tuple(replace(p, sigma=PRIOR_FACTOR * p.sigma) for p in tied(wanted))


def norm_fit(view: View, terms: Sequence[str], extra: Extension = NO_EXTENSION) -> ViewsFit:
    """Fit the terms to the norm of gravity. The scatter beyond the noise of the means is estimated with it."""
    wanted = (*unknowns(terms), *extra.parameters)
    y, g, m = view.source.triad(FORCE), view.stimulus.gravity, len(view)
    different = attitudes(y)
    if m < len(wanted) or different < min(len(wanted), len(unknowns(SIX_TERMS))):
        raise InputError(
            f"{view.title!r} holds {amount(m, 'rest position')} in {amount(different, 'attitude')} for "
            f"{amount(len(wanted), 'parameter')} ({', '.join(terms)}): hold the unit in more attitudes, each axis up "
            "and down at least"
        )
    least = 0.0 if view.noise.sample is not None else sample_sigma(view)
    return fit([in_noise_of_readings(view)], wanted, extra.effects, _start(y, wanted, g), min_excess=least)


def sample_sigma(view: View) -> float:
    """Return one sigma [m/s^2] of a sample; where none is known, that of a perfect rig."""
    return view.source.sigma("accelerometer") or UNKNOWN_SCATTER_G * view.stimulus.gravity


def left_out_rms(fitted: ViewsFit) -> float:
    """Return the rms misfit [m/s^2] of positions that took no part; nan where one alone determines a parameter."""
    Q = np.linalg.qr(fitted.whitened[0])[0]
    return fitted.left_out_rms if np.all((Q**2).sum(1) < MAX_LEVERAGE) else np.nan


def _start(y: Array, wanted: Sequence[Parameter], g: float) -> Array:
    """Linear start [SI] from the ellipsoid through the readings y (m, 3), turned to the direction of the effects."""
    solution = ellipsoid(y[None] / g)[0] if len(y) >= MIN_POINTS else np.full(9, np.nan)
    if not np.isfinite(solution).all():
        return np.array([q.mean for q in wanted])
    K1, bias, (yx, zx, zy) = solution[:3], solution[3:6], solution[6:]
    start = {("scale_factor", i): K1[i] - 1 for i in range(3)} | {("bias", i): -g * bias[i] / K1[i] for i in range(3)}
    inverse = {"yz": yx, "zy": -(zx - zy * yx), "zx": zy}  # the inverse of Eq. (5), in the betas of Wu et al.'s Eq. (5)
    return np.array(
        [inverse[q.axis] if q.effect == "misalignment" else start.get((q.effect, q.index), q.mean) for q in wanted]
    )


def covariance_of_omitted_terms(fitted: ViewsFit, terms: Sequence[str]) -> Array:
    """Return the increase of the covariance (p, p) of a fit by terms that are omitted from it; zero for none."""
    view, solution, n = fitted.views[0], fitted.solution, len(fitted.solution.parameters)
    omitted = tuple(view.grade.usual(q) for t in terms for q in parameters(CATALOGUE[t]))
    if not omitted:
        return np.zeros((n, n))
    every = (*solution.parameters, *omitted)
    both, r = fitted.rows_by(every, values(fitted.effects, every))
    J, C = both[:, :n], both[:, n:]
    Q = np.linalg.qr(J)[0]
    C_left, r_left = C - Q @ (Q.T @ C), r - Q @ (Q.T @ r)
    known = np.linalg.inv(C_left.T @ C_left + np.diag([1 / q.sigma**2 for q in omitted]))
    mean = known @ C_left.T @ r_left
    S = solution.covariance @ J.T @ C
    return np.asarray(S @ (known + np.outer(mean, mean)) @ S.T)


def omitted_terms_in_words(added: Array, covariance: Array) -> str:
    """Describe the largest increase of a sigma as the end of a sentence; empty where it is small."""
    own, more = np.diag(covariance), np.diag(added)
    times = float(np.sqrt(np.max(more / own))) if len(own) else 0.0
    return (
        ""
        if times < NOTABLE_SIGMAS
        else f"; of usual size it moves an estimate by {times:.2g} of its sigma, which is wider for it"
    )
