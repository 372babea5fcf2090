"""How far the package is from the derivations, item by item.

What the package computes knows the derivations, never the other way: a check compares numbers of one place of the
package with a derived form. One place may hold several items and one item may stand in several places; all of them are
compared, and the worst is reported. A check that breaks differs too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

Check = Callable[[], float]
CHECKS: dict[tuple[str, str], list[tuple[str, Check]]] = {}  # (source, item) to the places that hold it, with checks
TOLERANCES: dict[Check, float] = {}  # of checks whose place ends an iteration or integrates by steps
ONCE: list[Any] = []  # what the package was asked once for several items
TOLERANCE = 1e-12  # derivation and package are the same algebra in floats: a few hundred roundings of 1e-16


@dataclass(frozen=True)
class Comparison:
    """The place of the package that differs most from the derivation of an item, and by how much."""

    where: str
    difference: float
    problem: str = ""
    places: int = 1
    tolerance: float = TOLERANCE

    @property
    def same(self) -> bool:
        """Whether nothing but rounding differs; a difference that is not a number is one."""
        return self.difference <= self.tolerance

    def __str__(self) -> str:
        if self.same:
            return f"Package: same within {self.tolerance:.0e}."
        return f"PACKAGE DIFFERS in {self.where} {self.problem or f'by {self.difference:.2g}'}."


def checks(source: str, *items: str, where: str, tolerance: float = TOLERANCE) -> Callable[[Check], Check]:
    """Decorator: the function tells how far `where` in the package is from the derivations of these items.

    tolerance: what the steps of an integration or the end of an iteration leave, where that is more than rounding.
    """

    def register(check: Check) -> Check:
        TOLERANCES[check] = tolerance
        for item in items:
            CHECKS.setdefault((source, item), []).append((where, check))
        return check

    return register


def once(ask: Callable[[], Any]) -> Callable[[], Any]:
    """Decorator: numbers of the package that several checks need, kept until `forget`."""
    kept = cache(ask)
    ONCE.append(kept)
    return kept


def forget() -> None:
    """Ask the package again from now on."""
    for kept in ONCE:
        kept.cache_clear()


def compare(source: str, item: str) -> Comparison | None:
    """Return the comparison that is worst; None where the package has no formula for the item."""
    results = [_run(where, check) for where, check in CHECKS.get((source, item), ())]
    if not results:
        return None
    worst = max(results, key=lambda c: (not c.same, c.difference / c.tolerance))
    return replace(
        worst, places=len(results), tolerance=max(c.tolerance for c in results) if worst.same else worst.tolerance
    )


def _run(where: str, check: Check) -> Comparison:
    try:
        return Comparison(where, check(), tolerance=TOLERANCES[check])
    except Exception as problem:  # noqa: BLE001  whatever breaks is a difference, not the end of the run
        return Comparison(where, float("inf"), f"({type(problem).__name__}: {problem})")
