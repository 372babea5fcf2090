r"""The uncertainty of gravity is an uncertainty of the scale factors.

At rest gravity is the only reference of accelerometers. If gravity is larger by a share e, SF larger by the same share
fits the readings equally well, and nothing else changes: biases and nonlinearities belong to the reading,

.. math:: f^a = SF^{-1} C_p^a f^p + b + K (f^a - b)^2, \qquad f^p \to (1 + e) f^p, \quad SF \to (1 + e) SF ,

so the covariance grows by :math:`\sigma_e^2 u u^T` with u the scale factors SF and zero elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration.calibration import Calibration
from gimbalcal.number import Array
from gimbalcal.recording import Recording

SCALED = "scale_factor"
MAX_DIFFERENCE = 1e-9  # of gravity and its sigma at one site


def with_gravity(c: Calibration, recordings: Sequence[Recording]) -> Calibration:
    """Return the calibration with the uncertainty of gravity at the site of these recordings in its covariance."""
    e, g = max(((r.site.gravity_sigma / r.site.gravity, r.site.gravity) for r in recordings), default=(0.0, 0.0))
    u = scale_factor_direction(c)
    if e == 0.0 or not u.any():
        return c
    origin = c.provenance.with_options(gravity=g, gravity_sigma_ppm=1e6 * e)
    return replace(c, covariance=c.covariance + e**2 * np.outer(u, u), provenance=origin)


def scale_factor_direction(c: Calibration) -> Array:
    """Return u (p,): the scale factors SF, which are proportional to gravity, and zero elsewhere."""
    return np.array([1 + x if p.effect == SCALED else 0.0 for p, x in zip(c.parameters, c.values, strict=True)])


def common_gravity(a: Calibration, b: Calibration) -> float:
    """Return one sigma of the relative error of gravity that both calibrations have in common; zero for none.

    Calibrations with the same gravity and sigma are of one site: the error cancels in their difference.
    """
    options = [c.provenance.options for c in (a, b)]
    one, other = (np.array([o.gravity, o.gravity_sigma_ppm], dtype=float) for o in options)  # nan of what is absent
    same = bool(np.all(np.abs(one - other) <= MAX_DIFFERENCE * np.abs(one)))
    return 1e-6 * float(one[1]) if same and 0 < one[1] < np.inf else 0.0


def without_gravity(c: Calibration, e: float) -> Array:
    """Return the covariance (p, p) without the common error e of gravity; unchanged where it contains none."""
    u = scale_factor_direction(c)
    remaining = np.diag(c.covariance)[u != 0] - (e * u[u != 0]) ** 2
    return c.covariance if np.any(remaining <= 0) else np.asarray(c.covariance - e**2 * np.outer(u, u))
