"""Whether data support a term: a coefficient stands clear of its sigma, and what was left out is told no worse."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.effects import Parameter
from gimbalcal.number import Array
from gimbalcal.units import from_si

CLEAR = 3.0  # sigma that the largest coefficient of a further term must reach to be taken up


def refusal(
    term: str, data: str, wanted: Sequence[Parameter], x: Array, sigma: Array,
    left_out: tuple[float, float], unit: str, condition: tuple[float, float],
) -> str:  # fmt: skip
    """Why `data` ("38 positions") do not support `term`, in a sentence; empty where they do.

    wanted, x, sigma: parameters of the fit with the term, SI; left_out: rms misfit [unit] of what took no part,
    without and with the term; condition: the condition numbers, columns of length one.
    """
    mine = [i for i, q in enumerate(wanted) if q.effect == term]
    clear = float(np.max(np.abs(x[mine]) / sigma[mine]))
    worse = left_out[1] > left_out[0]
    if not worse and clear > CLEAR:
        return ""
    printed, things = wanted[mine[0]].unit, data.rsplit(maxsplit=1)[-1]
    return (
        f"{term} declined: these {data} leave it uncertain by {from_si(float(sigma[mine].max()), printed):.2g} "
        f"{printed} and no coefficient exceeds {clear:.1f} sigma; {things} left out are predicted "
        f"{'worse' if worse else 'no worse'} with it ({left_out[0]:.3g} -> {left_out[1]:.3g} {unit}, "
        f"condition number {condition[0]:.0f} -> {condition[1]:.0f})"
    )


def scatter(r: Array, own: Array, dof: int) -> float:
    """The excess sigma at which the sum of r^2 / (own + excess^2) is dof; 0 where the noise `own` alone explains r."""
    low, high = 0.0, float(np.sqrt((r**2).sum()))
    for _ in range(60):
        mid = (low + high) / 2
        low, high = (mid, high) if (r**2 / (own + mid**2)).sum() > dof else (low, mid)
    return high if (r**2 / own).sum() > dof else 0.0
