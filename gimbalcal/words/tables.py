"""Tables in text: aligned rows of name, value, sigma, unit and remark."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from gimbalcal.words import naming
from gimbalcal.words.rounding import duration_in_words, significant

if TYPE_CHECKING:
    from gimbalcal.design.next_step import NextPlan, NextStep
    from gimbalcal.design.optimal import PositionsDesign
    from gimbalcal.design.position_observability import Observability

NOT_DETERMINED = "* not determined one by one; the report gives the combinations"


def bounds_table(plan: Observability | PositionsDesign) -> str:
    """Return the bound of sigma of each parameter in a plan, and its usual size."""
    undetermined = naming.unobservable_leading(plan.unobservable)
    table = [
        (naming.label_in_words(r.parameter.label), "", significant(r.sigma, 3), naming.unit_in_print(r.parameter.unit),
         "*" if r.parameter.label in undetermined else f"usual {significant(r.prior_sigma, 2)}")
        for r in plan.rows
    ]  # fmt: skip
    return "\n".join([*aligned_table(table), *([NOT_DETERMINED] if undetermined else [])])


def steps_table(plan: NextPlan) -> str:
    """Return what may be recorded next: in words, how long it takes, and what it changes of which parameter."""
    table = [(s.words, duration_in_words(s.seconds), _change_in_print(s)) for s in plan.steps]
    words, time = (max(len(row[i]) for row in table) for i in range(2))
    return "\n".join(f"  {row[0]:{words}s}  {row[1]:>{time}s}  σ of {row[2]}" for row in table)


def _change_in_print(s: NextStep) -> str:
    sigmas = f"{significant(s.sigma_now, 3)} → {significant(s.sigma_after, 3)}"
    return f"{naming.without_underscores(s.parameter)} {sigmas} {naming.unit_in_print(s.unit)}"


def aligned_table(table: Sequence[tuple[str, str, str, str, str]]) -> list[str]:
    """Return aligned lines of name, value, sigma, unit and remark."""
    name, value, sigma, unit, _ = (max((len(r[i]) for r in table), default=0) for i in range(5))
    return [f"  {r[0]:{name}s}  {r[1]:>{value}s} ± {r[2]:<{sigma}s}  {r[3]:{unit}s}  {r[4]}".rstrip() for r in table]
