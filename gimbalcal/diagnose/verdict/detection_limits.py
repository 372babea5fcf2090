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


def detection_limits(
    each: Sequence[tuple[Sequence[Candidate], Sequence[Projection]]],
) -> tuple[DetectionLimit, ...]:
    """Return, of each effect that was compared, the least size that would have shown and the usual one, as printed.

    each: candidates of each view of a unit, and the projections of their columns; what one shows and another shows adds
    up in quadrature. What happened once, as a step, is left out; what bends with its size is taken as it begins.
    """
    shown: dict[tuple[str, ...], tuple[float, Candidate, Parameter]] = {}
    for candidates, projections in each:
        p = max(projections, key=Projection.log_evidence)
        shows = np.sqrt(np.maximum(p.G.diagonal, 0.0)) / float(p.scale.sigma(p.misfit[0]))
        for c in candidates:
            if c.rival or c.once or "," in c.axis:
                continue
            sigmas, q = max(
                ((float(shows[i]), q) for v in c.variants for i, q in zip(v.index, c.parameters, strict=True)),
                key=lambda one: one[0],
            )
            before, first, own = shown.get(c.key, (0.0, c, q))
            shown[c.key] = (float(np.hypot(before, sigmas)), first, own)
    worst: dict[str, tuple[float, Candidate, Parameter]] = {}
    for sigmas, c, q in shown.values():
        if sigmas > FAINT and sigmas < worst.get(c.effect, (np.inf,))[0]:
            worst[c.effect] = (sigmas, c, q)
    return tuple(
        DetectionLimit(effect, c.axis, float(from_si(SHOWS / sigmas * q.sigma, q.unit)),
                       float(from_si(q.sigma, q.unit)), q.unit)
        for effect, (sigmas, c, q) in sorted(worst.items())
    )  # fmt: skip
