"""A verdict on one printed formula, decided by algebra.

==============  ==================================================================================================
agrees          printed minus derived is identically zero
approximation   printed minus derived is of higher order in the small quantities than the formula itself
misprint        one slip (a sign, a factor, a symbol) turns printed into derived, and the paper does not build on it
wrong           anything else that differs
not-determined  even the derived equations do not determine what the paper solves them for (rank)
==============  ==================================================================================================

"Derived" is exact for finite statements and first order for error propagation and small-angle tables, as each file
says. The judge never sees an opinion: it gets the printed expression, the derived one and the list of small symbols.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

AGREES, APPROXIMATION, MISPRINT, WRONG = "agrees", "approximation", "misprint", "wrong"
NOT_DETERMINED = "not-determined"
VERDICTS = (AGREES, APPROXIMATION, MISPRINT, WRONG, NOT_DETERMINED)

ARCSEC = math.pi / 648000
Expr = Any  # sympy is untyped: an expression or a Matrix


@dataclass(frozen=True)
class Printed:
    """A formula of a paper as data: typed in once, with the text of the scan it was read from.

    `formula` is the reading; `garbled` says what the scan made of it where character recognition failed, `carried`
    where else in the paper the same form is stated or used (then a slip is not a misprint).
    """

    item: str
    scan: str
    formula: Expr
    garbled: str = ""
    carried: str = ""


@dataclass(frozen=True)
class Verdict:
    """What was found about one item; the seven fields are those of `errata.json`."""

    source: str
    item: str
    verdict: str
    printed: str
    derived: str
    size: str
    why: str


@dataclass(frozen=True)
class Case:
    """The derived form of one item and what the judge needs to compare it.

    `small`: symbols that count as small. `at`: numbers for the size of the difference; `sweep`: further points, the
    largest counts. `unit`: "g", "ug" (of g), "arcsec" (of rad) or "". `symbols`, `factors`: what a slip could
    exchange or lose. `repairs`: slips that are not of that kind, in words, with the repaired formula. `rank`: rank of
    the derived equations and the number of unknowns they are solved for. `why` may quote {size}, {slip} and what
    `facts` holds, or is a function of the printed formula.
    """

    derived: Expr
    why: str | Callable[[Printed, Case], str]
    small: Sequence[Expr] = ()
    at: Mapping[Expr, float] | None = None
    sweep: Sequence[Mapping[Expr, float]] = ({},)
    unit: str = ""
    symbols: Sequence[Sequence[Expr]] = ()
    factors: Sequence[Expr] = ()
    repairs: Sequence[tuple[str, Expr]] = ()
    rank: tuple[int, int] | None = None
    facts: Mapping[str, object] | None = None


Check = Callable[[], float]
CHECKS: dict[tuple[str, str], Check] = {}  # source and item to the largest difference between derivation and package
CODE_TOLERANCE = 1e-12  # derivation and package are the same algebra in floats: a few hundred roundings of 1e-16


def checks(source: str, *items: str) -> Callable[[Check], Check]:
    """Decorator: the function tells how far the package is from the derivations of these items.

    What the package computes knows the derivations, never the other way; an item without a check is one for which the
    package has no formula.
    """

    def register(check: Check) -> Check:
        CHECKS.update({(source, item): check for item in items})
        return check

    return register


def is_zero(expr: Expr) -> bool:
    """Whether an expression vanishes identically; a number at a generic point rejects, algebra confirms."""
    expr = sp.expand(expr)
    if expr == 0:
        return True
    at = {s: sp.Rational(prime, 97) for s, prime in zip(_ordered(expr), _primes(), strict=False)}
    if abs(expr.subs(at).evalf(40)) > 1e-25:
        return False
    if sp.simplify(expr) != 0 and sp.simplify(expr.rewrite(sp.exp)) != 0:
        raise ArithmeticError(f"zero at a generic point but not proved to vanish: {expr}")
    return True


def _ordered(expr: Expr) -> list[Expr]:
    return sorted(expr.free_symbols, key=str)


def _primes() -> Iterator[int]:
    return (int(sp.prime(n)) for n in range(5, 200))


def order(expr: Expr, small: Sequence[Expr]) -> float:
    """Lowest total degree in the small symbols that is really there; infinite for zero."""
    if not small:
        return math.inf if is_zero(expr) else 0
    poly = sp.Poly(sp.expand(expr), *small)
    degrees = sorted({sum(powers) for powers in poly.monoms()})
    for degree in degrees:
        if any(not is_zero(c) for powers, c in poly.terms() if sum(powers) == degree):
            return degree
    return math.inf


def truncate(expr: Expr, small: Sequence[Expr], n: int) -> Expr:
    """Taylor expansion in the small symbols through total degree n."""
    e = sp.Dummy()
    scaled = expr.subs({s: e * s for s in small}, simultaneous=True)
    terms = []
    for k in range(n + 1):
        terms.append(scaled.subs(e, 0) / sp.factorial(k))
        scaled = scaled.diff(e)
    total = sum(terms[1:], start=terms[0])
    return total.applyfunc(sp.expand) if isinstance(total, sp.MatrixBase) else sp.expand(total)


def entries(formula: Expr) -> list[Expr]:
    """The scalar expressions of a formula, row by row."""
    return list(formula) if isinstance(formula, sp.MatrixBase) else [sp.sympify(formula)]


def _shape(formula: Expr) -> tuple[int, int]:
    return tuple(formula.shape) if isinstance(formula, sp.MatrixBase) else (1, 1)


def same(a: Expr, b: Expr) -> bool:
    """Whether two formulas are identically equal."""
    return _shape(a) == _shape(b) and all(is_zero(x - y) for x, y in zip(entries(a), entries(b), strict=True))


def slips(expr: Expr, symbols: Sequence[Sequence[Expr]], factors: Sequence[Expr]) -> Iterator[tuple[str, Expr]]:
    """Every expression one slip away, with the slip in words: a sign, a lost or added factor, a symbol."""
    yield "the overall sign", -expr
    terms = sp.Add.make_args(sp.expand(expr))
    for term in terms:
        rest = sum((t for t in terms if t is not term), start=sp.Integer(0))
        yield f"the sign of {term}", rest - term
        for f in factors:
            yield f"{term} should be multiplied by {f}", rest + term * f
            yield f"{term} should be divided by {f}", rest + term / f
        for group in symbols:
            for here in [s for s in group if s in term.free_symbols]:
                for there in [s for s in group if s is not here]:
                    yield f"{there} instead of {here} in {term}", rest + term.subs(here, there)


def find_slip(printed: Expr, case: Case) -> str:
    """The one slip that turns printed into derived, in words; empty if there is none."""
    for words, repaired in case.repairs:
        if same(repaired, case.derived):
            return words
    if _shape(printed) != _shape(case.derived):
        return ""
    if same(-printed, case.derived):
        return "the overall sign"
    pairs = [(p, d) for p, d in zip(entries(printed), entries(case.derived), strict=True) if not is_zero(p - d)]
    if len(pairs) != 1:
        return ""
    p, d = pairs[0]
    return next((words for words, repaired in slips(p, case.symbols, case.factors) if is_zero(repaired - d)), "")


def judge(printed: Printed, case: Case) -> tuple[str, str]:
    """The verdict, and the slip in words where one explains the difference."""
    if case.rank is not None and case.rank[0] < case.rank[1]:
        return NOT_DETERMINED, ""
    if same(printed.formula, case.derived):
        return AGREES, ""
    if _shape(printed.formula) == _shape(case.derived):
        pairs = list(zip(entries(printed.formula), entries(case.derived), strict=True))
        if case.small and all(order(p - d, case.small) > order(p, case.small) for p, d in pairs if not is_zero(p - d)):
            return APPROXIMATION, ""
    slip = find_slip(printed.formula, case)
    return (MISPRINT if slip and not printed.carried else WRONG), slip


def magnitude(difference: Expr, at: Mapping[Expr, float], sweep: Sequence[Mapping[Expr, float]] = ({},)) -> float:
    """Largest absolute value of a difference over the points of `sweep`."""
    formula = entries(difference)
    symbols = sorted(set().union(*(entry.free_symbols for entry in formula)), key=str)
    numeric = sp.lambdify(symbols, formula, "math")
    points = [{**at, **point} for point in sweep]
    return max(abs(value) for point in points for value in numeric(*(float(point[s]) for s in symbols)))


def in_unit(value: float, unit: str) -> str:
    """A force over g or an angle in rad, with its everyday unit."""
    if unit == "g":
        return f"{value:.3g} g"
    scaled = {"ug": value * 1e6, "arcsec": value / ARCSEC, "ppm": value * 1e6}.get(unit)
    return f"{value:.3g}" if scaled is None else f"{value:.1e} ({scaled:.3g} {unit})"


def size_in_words(verdict: str, printed: Printed, case: Case) -> str:
    """How much it matters: "0" where printed and derived agree."""
    if verdict == AGREES:
        return "0"
    if verdict == NOT_DETERMINED and case.rank is not None:
        return f"rank {case.rank[0]} of {case.rank[1]}"
    if _shape(printed.formula) != _shape(case.derived):
        return "shapes differ"
    if case.at is None:
        return "not quantified"
    return in_unit(magnitude(printed.formula - case.derived, case.at, case.sweep), case.unit)


def decide(source: str, printed: Printed, case: Case) -> Verdict:
    """Compare one printed formula with its derivation and say what was found."""
    verdict, slip = judge(printed, case)
    size = size_in_words(verdict, printed, case)
    words = case.why(printed, case) if callable(case.why) else case.why
    why = words.format(size=size, slip=slip, **dict(case.facts or {}))
    if printed.garbled:
        why += f" The scan is garbled here: {printed.garbled}."
    check = CHECKS.get((source, printed.item))
    if check is not None:
        why += code_words(check())
    return Verdict(source, printed.item, verdict, printed.scan, sp.sstr(case.derived), size, why)


def code_words(difference: float) -> str:
    """How the package compares with the derivation."""
    if difference <= CODE_TOLERANCE:
        return f" Package: same to {difference:.0e}."
    return f" PACKAGE DIFFERS by {difference:.2g}."
