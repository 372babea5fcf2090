"""Tables in text: aligned rows of name, value, sigma, unit and remark."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from gimbalcal.words import naming
from gimbalcal.words.rounding import significant

if TYPE_CHECKING:
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
    return "\n".join([*aligned(table), *([NOT_DETERMINED] if undetermined else [])])


def aligned(table: Sequence[tuple[str, str, str, str, str]]) -> list[str]:
    """Return aligned lines of name, value, sigma, unit and remark."""
    name, value, sigma, unit, _ = (max((len(r[i]) for r in table), default=0) for i in range(5))
    return [f"  {r[0]:{name}s}  {r[1]:>{value}s} ± {r[2]:<{sigma}s}  {r[3]:{unit}s}  {r[4]}".rstrip() for r in table]
