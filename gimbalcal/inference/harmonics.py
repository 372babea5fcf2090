r"""Harmonics of the Earth's rotation in a series of any length, spacing and noise colour.

.. math:: y(t) = \sum_k \left[a_{ks} \sin k S_t + a_{kc} \cos k S_t\right] + \sum_{j=1}^{d} c_j P_j(u) + \text{noise}

with the measured sidereal angle S_t, so the run need not hold whole sidereal days, and Legendre polynomials P_j of
u = time scaled to [-1, 1] as slow drift. Order 0 is the mean level at mid-run. Everything is one least-squares fit:
gaps and irregular rows cost accuracy and cause no bias. An FFT would, as its frequencies are multiples of 1/duration.

Source: Wu et al. (2018), section 5.2, which says "Fourier expansion" and no more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.inference.coloured import estimate_noise, least_squares
from gimbalcal.inference.noise_processes import Noise
from gimbalcal.number import Array


@dataclass(frozen=True, eq=False)
class Harmonics:
    """Coefficients of sin and cos of multiples of an angle, the drift being profiled.

    labels "0", "1s", "1c", ...; value (q,) and covariance (q, q) in the unit of y; drift (d,) Legendre coefficients;
    noise as found or given; chi2 over dof is 1 by construction where sigma was estimated.
    """

    labels: tuple[str, ...]
    value: Array
    covariance: Array
    drift: Array
    noise: Noise
    chi2: float
    dof: int
    rms: float

    @property
    def sigma(self) -> Array:
        """One standard deviation (q,)."""
        return np.sqrt(np.diag(self.covariance))

    def __getitem__(self, label: str) -> float:
        return float(self.value[self.labels.index(label)])

    def at(self, angle: Array) -> Array:
        """Return the harmonics, without the drift, at angles (n,) [rad]."""
        return columns(angle, self.orders) @ self.value

    @property
    def orders(self) -> tuple[int, ...]:
        """Multiples of the angle that were fitted."""
        return tuple(dict.fromkeys(int(label.rstrip("sc")) for label in self.labels))


def columns(angle: Array, orders: Sequence[int]) -> Array:
    """Return 1, sin, cos of multiples of the angle (n,): (n, q)."""
    parts = [[np.ones_like(angle)] if k == 0 else [np.sin(k * angle), np.cos(k * angle)] for k in orders]
    return np.stack([c for part in parts for c in part], axis=-1)


def labels(orders: Sequence[int]) -> tuple[str, ...]:
    """Return the names of `columns`."""
    return tuple(name for k in orders for name in ((f"{k}",) if k == 0 else (f"{k}s", f"{k}c")))


def design_matrix(time: Array, angle: Array, orders: Sequence[int], drift: int) -> Array:
    """Return harmonics and drift polynomials (n, q + drift)."""
    middle, half = (time[0] + time[-1]) / 2, (time[-1] - time[0]) / 2
    slow = np.polynomial.legendre.legvander((time - middle) / half, drift)[:, 1:]
    return np.concatenate([columns(angle, orders), slow], axis=1)


def fourier(
    time: Array,
    angle: Array,
    y: Array,
    orders: Sequence[int] = (0, 1, 2),
    weight: Array | None = None,
    drift: int = 1,
    noise: str | Noise = "auto",
) -> Harmonics:
    """Fit harmonic coefficients of y (n,) in the angle (n,) [rad]; rows that are not finite are gaps.

    weight (n,): raw samples behind each row. drift: degree of the polynomial. noise: "white", "gauss-markov",
    "random-walk", "auto" (best BIC of the three) or processes that are known, the white one of a row of unit weight.
    Raises InputError where the run is too short to separate the harmonics from each other and from the drift.
    """
    keep = np.isfinite(y)
    time, angle, y = time[keep], angle[keep], y[keep]
    weight = np.ones(len(y)) if weight is None else np.asarray(weight, dtype=float)[keep]
    q, names = len(labels(orders)), labels(orders)
    if len(y) <= q + drift:
        raise InputError(f"{len(y)} rows cannot determine {q} harmonics and {drift} drift terms: record a longer run")
    A = design_matrix(time, angle, orders, drift)
    try:
        processes = estimate_noise(time, A, y, weight, noise) if isinstance(noise, str) else noise
        fit = least_squares(time, A, y[:, None], weight, processes)
    except np.linalg.LinAlgError:
        turned = np.rad2deg(np.ptp(angle))
        raise InputError(
            f"the run covers {turned:.1f} deg of the Earth's turn, too little to separate harmonics {tuple(orders)} "
            f"from each other and from {drift} drift terms: record a longer run or ask for fewer terms"
        ) from None
    r = y - A @ fit.beta[:, 0]
    return Harmonics(
        names, fit.beta[:q, 0], fit.covariance[:q, :q], fit.beta[q:, 0], processes,
        float(fit.chi2[0]), len(y) - A.shape[1], float(np.sqrt(np.mean(r**2))),
    )  # fmt: skip
