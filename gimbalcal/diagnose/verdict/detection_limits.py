r"""From which size on a cause would have shown in a recording that lacks nothing: smaller ones may be there.

.. math:: x_{least} = 8 \, \sigma_x, \qquad \sigma_x^{-2} = X_\perp^T V^{-1} X_\perp

by the column of the cause that the calibration leaves, in the likeliest noise; of causes with a time constant or an
order at the one that shows best, of several axes at the one that shows least. From eight sigma nine of ten are found.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.diagnose.evidence.projection import Projection
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.result import DetectionLimit
from gimbalcal.effects import Parameter
from gimbalcal.units import from_si

SHOWS = 8.0  # sigmas
FAINT = 0.08  # sigmas at the usual size; a hundred times that would not show: the calibration takes all of it


def detection_limits(candidates: Sequence[Candidate], projections: Sequence[Projection]) -> tuple[DetectionLimit, ...]:
    """Return, of each effect that was compared, the least size that would have shown and the usual one, as printed.

    What happened once, as a step, is left out; what bends with its size is taken as it begins.
    """
    p = max(projections, key=lambda q: np.log(q.node.prior) + q.log_likelihood()[0])
    shows = np.sqrt(np.maximum(p.G.diagonal, 0.0)) / float(p.scale.sigma(p.misfit[0]))
    worst: dict[str, tuple[float, Candidate, Parameter]] = {}
    for c in candidates:
        if c.rival or c.once or "," in c.axis:
            continue
        best = max(((float(shows[i]), q) for v in c.variants for i, q in zip(v.index, c.parameters, strict=True)),
                   key=lambda told: told[0])  # fmt: skip
        if best[0] > FAINT and best[0] < worst.get(c.effect, (np.inf,))[0]:
            worst[c.effect] = (best[0], c, best[1])
    return tuple(
        DetectionLimit(effect, c.axis, float(from_si(SHOWS / sigmas * q.sigma, q.unit)),
                       float(from_si(q.sigma, q.unit)), q.unit)
        for effect, (sigmas, c, q) in sorted(worst.items())
    )  # fmt: skip
