r"""Split-record check: each third of the rows on its own.

.. math:: x_k = x + (J_k^T J_k)^{-1} J_k^T r_k , \qquad
          F = \frac{1}{2 q s^2} \sum_k (x_k - \bar x)^T C_k^{-1} (x_k - \bar x)

with r the whitened residuals (n,) of the fit, J their Jacobian (n, p) by all its parameters, C_k the covariance of q of
them in a third, the mean weighted by C_k^-1, and s^2 what the thirds leave of r by themselves. Noise with a longer
memory than the fit assumes, and parameters that change, make the thirds differ by more than their sigmas say.
Source: G. C. Chow, Econometrica 28 (1960) 591, for three groups.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.calibration.provenance import SplitRecord
from gimbalcal.effects import Parameter
from gimbalcal.estimate.fit import ViewsFit, independent
from gimbalcal.inference.information import chi2_about_mean
from gimbalcal.inference.p_value import probability
from gimbalcal.number import Array
from gimbalcal.units import from_si

PARTS = 3
MIN_ROWS_EACH = 3.0  # rows of a third for each parameter
MIN_CHI2 = 1e-200  # of rows without noise
SIGNIFICANCE = 1e-3  # probability below which the thirds differ


@dataclass(frozen=True)
class Thirds:
    """Estimates (3, p) and covariances (3, p, p) [SI] of all parameters of a fit in each third; dof: of the scatter."""

    parameters: tuple[Parameter, ...]  # those of effects, then nuisances
    x: Array
    covariance: Array
    dof: int

    @property
    def sigma(self) -> Array:
        """One standard deviation (3, p) of each estimate, SI."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    def p_value(self, nuisances: bool = False) -> float:
        """Return the probability that the thirds have the same parameters of effects, or the same nuisances."""
        at = [i for i, p in enumerate(self.parameters) if bool(p.effect) != nuisances]
        chi2 = chi2_about_mean(self.x[:, at], self.covariance[:, at][:, :, at])
        return probability(chi2, (PARTS - 1) * len(at), self.dof)

    @property
    def entry(self) -> SplitRecord:
        """Return the check as it stands in calibration.json, in printed units."""
        of_effects = [(i, p) for i, p in enumerate(self.parameters) if p.effect]
        values, sigmas = (
            {p.label: tuple(float(v) for v in from_si(X[:, i], p.unit)) for i, p in of_effects}
            for X in (self.x, self.sigma)
        )
        return SplitRecord(self.p_value(), values, sigmas)

    def outcome(self, nuisances: bool = False) -> str:
        """Return the sentence for thirds that differ in parameters of effects, or in nuisances; empty if none does."""
        p_value = self.p_value(nuisances)
        if p_value >= SIGNIFICANCE:
            return ""
        at = [i for i, p in enumerate(self.parameters) if bool(p.effect) != nuisances]
        k = max(at, key=lambda i: float(np.ptp(self.x[:, i]) / np.linalg.norm(self.sigma[:, i])))
        p = self.parameters[k]
        own = zip(from_si(self.x[:, k], p.unit), from_si(self.sigma[:, k], p.unit), strict=True)
        each = ", ".join(f"{v:.4g} +- {s:.2g}" for v, s in own)
        p_text = "p < 1e-6" if p_value < 1e-6 else f"p = {p_value:.1g}"
        name = " ".join(filter(None, [p.effect or p.name, p.axis])).replace("_", " ")
        return f"the thirds of the record differ by more than their sigmas ({p_text}), most in {name}: {each} {p.unit}"


def thirds(fitted: ViewsFit) -> Thirds | None:
    """Return the fits of each third of the rows in time; None where a third does not determine the parameters."""
    J, r = fitted.whitened
    n, p = J.shape
    if any(v.local is not None for v in fitted.views) or n < PARTS * MIN_ROWS_EACH * p:
        return None
    rows = np.concatenate([np.repeat(v.time + v.source.time[0], len(v.channels)) for v in fitted.views])
    parts = np.array_split(np.argsort(rows, kind="stable"), PARTS)
    size = np.linalg.norm(J, axis=0)
    if not all(independent(J[at]) for at in parts):
        return None
    x, inverse, chi2 = [], [], float(r @ r)
    for at in parts:
        A = J[at] / size
        N, b = A.T @ A, A.T @ r[at]
        delta = np.linalg.solve(N, b)
        chi2 -= float(delta @ b)
        x.append(fitted.solution.x + delta / size)
        inverse.append(np.linalg.inv(N) / np.outer(size, size))
    variance = max(chi2, MIN_CHI2) / (n - PARTS * p)
    return Thirds(fitted.solution.parameters, np.array(x), variance * np.array(inverse), n - PARTS * p)
