r"""Coarse calibration: Wu et al. (2018), section 3. Nonlinearity is ignored, angles are believed.

1. The six faces, where one input axis stands along the vertical, give its scale factor and bias in closed form,

   .. math:: \frac{1}{SF_i} = \frac{f^a_{i+} - f^a_{i-}}{f^p_{i+} - f^p_{i-}}, \qquad
             b_i = \frac{f^a_{i+} + f^a_{i-}}{2} - \frac{f^p_{i+} + f^p_{i-}}{2 \, SF_i} .

2. The other positions, where two axes lean by 45 deg, give gimbal zeros and misalignments by linear least squares of

   .. math:: f^a = SF^{-1} C_p^a \, f^p(\theta + \theta_0) + b \qquad \text{(Eq. (7))} .

3. The platform's force is computed again with the estimated zeros, and both steps repeat until nothing moves. With a
   platform at hand, `relevel` turns it back by the zeros and measures again, as the paper does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.estimate.accelerometers.fit_summary import (
    fit_stage,
    joined_sentences,
    outliers_in_words,
    provenance,
    rms,
)
from gimbalcal.estimate.accelerometers.position_fit import Positions
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE, Solution, information, solve
from gimbalcal.number import Array, apply_matrix
from gimbalcal.views.core import View
from gimbalcal.views.local import VisitRows, Whitened, eliminate
from gimbalcal.views.positions import by_visit, force_of_visits, position_parameters

OMITTED_TERM = "scale_nonlinearity"
MIN_FACE_COSINE = np.cos(np.deg2rad(10.0))  # cosine of the vertical: a face, even if the zeros are off by degrees
MAX_ITERATIONS = 20  # three are enough: each round leaves the product of two small angles
NEGLIGIBLE_ZERO_RAD = np.deg2rad(0.1 / 3600)  # rad: 0.1 arcsec moves 0.5 ug across an axis at 1 g


def coarse(positions: Positions) -> Calibration:
    """Scale factors and biases from the faces, gimbal zeros and misalignments from the other positions.

    The stated sigmas hold noise, setting errors, and what a nonlinearity of its prior size does, since it is ignored.
    Where an axis lacks a face, all coefficients come from one least squares over all positions; what these do not
    determine is named in `unobservable`.
    """
    view, absent = positions.view, positions.fit.absent
    kept = [name for name in BASELINE["multi-position"] if name != OMITTED_TERM]
    wanted = position_parameters(view.source.platform, kept, view.grade)
    solution, setting, faceless = closed_form(view, absent, wanted)
    effects = with_values(absent, wanted, solution.x, view.stimulus.axis_names)
    fit = ViewsFit((view,), absent, effects, solution, (np.zeros(1),), 1, local=(setting,))
    p = replace(positions, fit=fit)
    lack = f"axis {', '.join(faceless)} lacks a face: one least squares over all positions took its place"
    notes = [lack] if faceless else []
    return fit.calibration(
        "coarse",
        Residual(solution.chi2, solution.dof, rms(p)),
        outcome=joined_sentences(outliers_in_words(p.faults)),
        provenance=replace(provenance(p), notes=tuple(notes)),
        stages=(
            fit_stage("coarse", p, joined_sentences(["faces and tilted positions, nonlinearity ignored", *notes])),
        ),
    )


def closed_form(view: View, absent: Sequence[Effect], wanted: tuple[Parameter, ...]) -> tuple[Solution, Array, str]:
    """Faces, then tilted positions, until nothing moves; with the covariance of both steps.

    Where an axis lacks a face, one least squares over all positions takes the place of both steps. Returned are the
    solution, whose chi^2 is that of all visits, nonlinearity in the misfit, the setting errors (m, k) and the axes
    without both faces.
    """
    x = np.zeros(len(wanted))
    scale = np.array([q.sigma for q in wanted])
    for _ in range(MAX_ITERATIONS):
        linear = by_visit(view, absent, wanted, x)
        before, x = x, x.copy()
        axes, faces, faceless = _faces(view, wanted, linear, before)
        for i, (estimates, _) in enumerate(axes):
            x[_index_of_parameter(wanted, "scale_factor", i)], x[_index_of_parameter(wanted, "bias", i)] = estimates
        tilts = np.array([i for i, q in enumerate(wanted) if q.effect in ("misalignment", "gimbal_zero")])
        columns = tilts if axes else np.arange(len(x))
        rows = ~faces if axes and not faces.all() else np.ones_like(faces)
        w = eliminate(linear, 1.0, view.local_sigma**2)
        others = np.setdiff1d(np.arange(len(x)), columns)
        r = w.r[rows] - w.J[rows][..., others] @ x[others]
        solution = solve(information(w.J[rows][..., columns], r, [wanted[i] for i in columns]))
        x[columns] = solution.x
        if np.all(np.abs(x - before) < 1e-7 * scale):  # 1e-5 arcsec, 5e-5 ug
            break
    K = position_parameters(view.source.platform, [OMITTED_TERM], view.grade)
    bend = by_visit(view, absent, K, np.zeros(3)).J * np.array([q.sigma for q in K])
    count = int(np.isfinite(w.sigma).sum())
    every = replace(
        solution, parameters=wanted, x=x, covariance=_covariance(wanted, linear, w, axes, columns, rows, bend),
        chi2=float(((w.r - w.J @ x) ** 2).sum()), dof=count - len(wanted) + len(solution.unobservable),
    )  # fmt: skip
    return every, apply_matrix(w.gain, linear.r - linear.J @ x), faceless


AxisFit = tuple[Array, Array]
"""Scale factor - 1 and bias (2,) of one axis, and their derivatives (2, m) by its readings."""


def _faces(view: View, wanted: Sequence[Parameter], linear: VisitRows, x: Array) -> tuple[list[AxisFit], Array, str]:
    """Step 1: a line through the two clusters of faces, which is the closed form; which visits are faces (m,).

    No axis is fitted, and those that lack a face are named, unless each has both.
    """
    measured = force_of_visits(view)
    h = measured - (linear.r - linear.J @ x)
    scale, bias = (
        np.array([x[_index_of_parameter(wanted, name, i)] for i in range(3)]) for name in ("scale_factor", "bias")
    )
    u = (1 + scale) * (h - bias)
    vertical = np.abs(u) > MIN_FACE_COSINE * view.stimulus.gravity
    both = np.any(vertical & (u > 0), axis=0) & np.any(vertical & (u < 0), axis=0)
    out = []
    for i in range(3) if both.all() else ():
        # of full rank: both faces are there
        slope, level = np.linalg.pinv(np.stack([u[:, i], np.ones(len(u))], axis=-1) * vertical[:, [i]])
        a = slope @ measured[:, i]
        # 1/SF = a: d(SF - 1) = -da / a^2
        out.append((np.array([1 / a - 1, level @ measured[:, i]]), np.stack([-slope / a**2, level])))
    return out, vertical.any(axis=1), "".join(np.array(["x", "y", "z"])[~both])


def _covariance(
    wanted: Sequence[Parameter], linear: VisitRows, w: Whitened, axes: Sequence[AxisFit], columns: Array, rows: Array,
    bend: Array,
) -> Array:  # fmt: skip
    """Both steps are linear in the readings, x = A y: noise and setting errors through A, and the neglected K.

    bend (m, 3, 3): what one sigma of K does to the readings.
    """
    m, P = len(w.W), len(wanted)
    A = np.zeros((P, m, 3))
    for i, (_, derivative) in enumerate(axes):
        A[[_index_of_parameter(wanted, "scale_factor", i), _index_of_parameter(wanted, "bias", i)], :, i] = derivative
    scale = np.array([wanted[i].sigma for i in columns])
    U, S, Vt = np.linalg.svd((w.J[rows][..., columns] * scale).reshape(-1, scale.size), full_matrices=False)
    keep = S >= MIN_SIGNAL_TO_NOISE
    B = np.zeros((scale.size, m, 3))
    gain = ((scale[:, None] * Vt[keep].T / S[keep]) @ U[:, keep].T).reshape(scale.size, -1, 3)
    B[:, rows] = np.einsum("qvi,vij->qvj", gain, w.W[rows])
    A[columns] = B - np.einsum("qmi,mip,pnj->qnj", B, linear.J, A)
    spread = np.einsum("pmi,mij->pmj", A, np.linalg.inv(w.W)).reshape(P, -1)
    bent = np.einsum("qmi,mik->qk", A, bend)
    unobservable = np.zeros((P, P))
    unobservable[np.ix_(columns, columns)] = (scale[:, None] * Vt[~keep].T) @ (Vt[~keep] * scale)
    return np.asarray(spread @ spread.T + bent @ bent.T + unobservable)


def _index_of_parameter(wanted: Sequence[Parameter], effect: str, index: int) -> int:
    return next(i for i, q in enumerate(wanted) if q.effect == effect and q.index == index)


@dataclass(frozen=True)
class Levelled:
    """The end of the levelling loop: last coarse calibration, its positions, and each round's leftover zeros [rad]."""

    calibration: Calibration
    positions: Positions
    leftover: tuple[Array, ...]


def relevel(measure: Callable[[Array], Positions], angles: Array) -> Levelled:
    """Turn the platform back by the estimated zeros and calibrate again, until the zeros that are left are negligible.

    measure(readouts (m, k) [rad]) holds the platform at these readouts; angles (m, k) are the schedule's.
    Inner and middle gimbal are levelled, as in Wu et al. (2018), section 3; a zero about the vertical does nothing. A
    leftover is what the last estimate adds to the correction already made. Ends after 10 rounds at the latest.
    """
    corrected = np.zeros(angles.shape[1])
    history: list[Array] = []
    while True:
        positions = measure(angles - corrected)
        calibration, names = coarse(positions), positions.view.stimulus.axis_names
        zero = corrected.copy()
        for q, value in zip(calibration.parameters, calibration.values, strict=True):
            if q.effect == "gimbal_zero" and q.axis != names[0]:
                zero[names.index(q.axis)] = value
        history.append(zero - corrected)
        if np.all(np.abs(history[-1]) < NEGLIGIBLE_ZERO_RAD) or len(history) == 10:
            return Levelled(calibration, positions, tuple(history))
        corrected = zero
