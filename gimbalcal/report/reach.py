"""How well a plan tells each kind of parameter, in a sentence: the worst axis of each."""

from __future__ import annotations

from collections.abc import Iterable

from gimbalcal.report import wording
from gimbalcal.report.rounding import significant

TOLD = 4  # kinds that a sentence names


def reach(sigmas: Iterable[tuple[str, float, str]]) -> str:
    """A sentence on kinds of parameters from (kind, sigma, unit) of each, a space before it; empty for none.

    >>> reach([("bias", 1.2, "ug"), ("bias", 1.57, "ug"), ("scale_factor", 0.9, "ppm")])
    ' One σ at worst: bias 1.6 µg, scale factor 0.90 ppm.'
    """
    worst: dict[str, tuple[float, str]] = {}
    for kind, sigma, unit in sigmas:
        worst[kind] = max(worst.get(kind, (0.0, unit)), (sigma, unit))
    if not worst:
        return ""
    told = [f"{wording.named(kind)} {significant(sigma, 2)} {wording.unit_in_print(unit)}"
            for kind, (sigma, unit) in list(worst.items())[:TOLD]]  # fmt: skip
    more = f"; {len(worst) - TOLD} more in the report" if len(worst) > TOLD else ""
    return f" One σ at worst: {', '.join(told)}{more}."
