r"""What is not known of gravity is not known of the scale factors.

At rest accelerometers are held against gravity alone. With gravity larger by a share e, SF x reading larger by as much
fits the same readings equally well, and nothing else moves: biases and nonlinearities belong to the reading,

.. math:: f^a = SF^{-1} C_p^a f^p + b + K (f^a - b)^2, \qquad f^p \to (1 + e) f^p, \quad SF \to (1 + e) SF ,

so the covariance grows by :math:`\sigma_e^2 u u^T` with u the scale factors SF and zero elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration.calibration import Calibration
from gimbalcal.recording import Recording

SCALED = "scale_factor"


def with_gravity(made: Calibration, recordings: Sequence[Recording]) -> Calibration:
    """The calibration with the uncertainty of the gravity of these recordings, one place, in its covariance."""
    e = max((r.site.gravity_sigma / r.site.gravity for r in recordings), default=0.0)
    u = np.array([1 + x if p.effect == SCALED else 0.0 for p, x in zip(made.parameters, made.values, strict=True)])
    if e == 0.0 or not u.any():
        return made
    options = {**made.provenance.get("options", {}), "gravity_sigma_ppm": 1e6 * e}
    return replace(
        made, covariance=made.covariance + e**2 * np.outer(u, u), provenance={**made.provenance, "options": options}
    )
