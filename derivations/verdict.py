"""A verdict on one printed formula, decided by algebra.

==============  ==================================================================================================
agrees          printed minus derived is identically zero
approximation   printed minus derived is of higher order in the small quantities than the formula itself
misprint        one slip (a sign, a factor, a symbol) turns printed into derived, and the paper does not build on it
wrong           anything else that differs
not-determined  even the derived equations do not determine what the paper solves them for (rank); or what was printed
                cannot be read ("unreadable: ..."); or it takes recordings that the paper does not print
==============  ==================================================================================================

A definition agrees, and its why begins with "A definition: nothing to derive"; only the package can differ from it.

The scans are damaged. A glyph that cannot have been printed (8 for g, a frame that does not exist, two cells run into
one) is read as the only thing it can be, and `garbled` says so. An item is *unreadable* where its verdict hangs on the
damage: the scan shows nothing at all, or taken literally it is a formula of the paper's own symbols (a letter for one
like it, an entry lost, an exponent) on which the verdict would be another. Then a fault may be the paper's or the
scan's, and nothing is held against the paper.

"Derived" is exact for finite statements and first order for error propagation and small-angle tables, as each file
says. The judge never sees an opinion: it gets the printed expression, the derived one and the list of small symbols.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import sympy as sp

from derivations.comparison import Comparison, compare

AGREES, APPROXIMATION, MISPRINT, WRONG = "agrees", "approximation", "misprint", "wrong"
NOT_DETERMINED = "not-determined"
VERDICTS = (AGREES, APPROXIMATION, MISPRINT, WRONG, NOT_DETERMINED)

ARCSEC = math.pi / 648000
PRINTABLE = 60  # terms; a slip is sought term by term where a formula can be printed term by term
Expr = Any  # sympy is untyped: an expression or a Matrix


@dataclass(frozen=True)
class Printed:
    """A formula of a paper as data: typed in once, with the text of the scan it was read from.

    `formula` is the reading, None where the scan shows none; `literal` is the scan as it stands where that is a formula
    too. `garbled` says what character recognition did, `carried` where else in the paper the same form is stated or
    used (then a slip is not a misprint).
    """

    item: str
    scan: str
    formula: Expr
    garbled: str = ""
    carried: str = ""
    literal: Expr = None


@dataclass(frozen=True)
class Verdict:
    """What was found about one item; assumes: what the verdict hangs on and the paper does not state.

    `formulas` are the printed one as it was read and the derived one, None where there is none.
    """

    source: str
    item: str
    verdict: str
    printed: str
    derived: str
    size: str
    why: str
    package: Comparison | None = None
    assumes: str = ""
    formulas: tuple[Expr, Expr] = (None, None)


@dataclass(frozen=True)
class Case:
    """The derived form of one item (None for a definition) and what the judge needs to compare it.

    `small`: symbols that count as small. `at`: numbers for the size of the difference; `sweep`: further points, the
    largest counts. `unit`: "g", "ug" (of g), "arcsec" (of rad) or "". `symbols`, `factors`: what a slip could
    exchange or lose. `repairs`: slips that are not of that kind, in words, with what repairs a printed formula. `rank`:
    rank of the derived equations and the number of unknowns they are solved for. `reading`: a convention that the paper
    does not state or a simplification that it makes, in words, what it makes of the derived form, and the verdict where
    that is what is printed. `why` may quote {size}, {slip} and
    what `facts` holds, or is a function of the printed formula.
    """

    derived: Expr
    why: str | Callable[[Printed, Case], str]
    small: Sequence[Expr] = ()
    at: Mapping[Expr, float] | None = None
    sweep: Sequence[Mapping[Expr, float]] = ({},)
    unit: str = ""
    symbols: Sequence[Sequence[Expr]] = ()
    factors: Sequence[Expr] = ()
    repairs: Sequence[tuple[str, Callable[[Expr], Expr]]] = ()
    rank: tuple[int, int] | None = None
    facts: Mapping[str, object] | None = None
    reading: tuple[str, Callable[[Expr], Expr], str] | None = None
    assumes: str = ""


def is_zero(expr: Expr) -> bool:
    """Return whether an expression vanishes identically; a number at a generic point rejects, algebra confirms."""
    expr = sp.sympify(expr)
    at = {s: sp.Rational(prime, 97) for s, prime in zip(_ordered(expr), _primes(), strict=False)}
    if abs(expr.subs(at).evalf(40)) > 1e-25:
        return False
    expr = sp.expand(expr)
    if expr != 0 and sp.simplify(expr) != 0 and sp.simplify(expr.rewrite(sp.exp)) != 0:
        raise ArithmeticError(f"zero at a generic point but not proved to vanish: {expr}")
    return True


def _ordered(expr: Expr) -> list[Expr]:
    return sorted(expr.free_symbols, key=str)


def _primes() -> Iterator[int]:
    return (int(sp.prime(n)) for n in range(5, 200))


def order(expr: Expr, small: Sequence[Expr]) -> float:
    """Return the lowest total degree in the small symbols that is really there; infinite for zero."""
    if not small:
        return math.inf if is_zero(expr) else 0
    poly = sp.Poly(sp.expand(expr), *small)
    degrees = sorted({sum(powers) for powers in poly.monoms()})
    for degree in degrees:
        if any(not is_zero(c) for powers, c in poly.terms() if sum(powers) == degree):
            return degree
    return math.inf


def truncate(expr: Expr, small: Sequence[Expr], n: int) -> Expr:
    """Return Taylor expansion in the small symbols through total degree n."""
    e = sp.Dummy()
    scaled = expr.subs({s: e * s for s in small}, simultaneous=True)
    terms = []
    for k in range(n + 1):
        terms.append(scaled.subs(e, 0) / sp.factorial(k))
        scaled = scaled.diff(e)
    total = sum(terms[1:], start=terms[0])
    return total.applyfunc(sp.expand) if isinstance(total, sp.MatrixBase) else sp.expand(total)


def entries(formula: Expr) -> list[Expr]:
    """Return the scalar expressions of a formula, row by row."""
    return list(formula) if isinstance(formula, sp.MatrixBase) else [sp.sympify(formula)]


def _shape(formula: Expr) -> tuple[int, int]:
    return tuple(formula.shape) if isinstance(formula, sp.MatrixBase) else (1, 1)


def same(a: Expr, b: Expr) -> bool:
    """Return whether two formulas are identically equal."""
    return _shape(a) == _shape(b) and all(is_zero(x - y) for x, y in zip(entries(a), entries(b), strict=True))


def slips(expr: Expr, symbols: Sequence[Sequence[Expr]], factors: Sequence[Expr]) -> Iterator[tuple[str, Expr]]:
    """Yield every expression one slip away, with the slip in words: a sign, a lost or added factor, a symbol."""
    yield "the overall sign", -expr
    terms = sp.Add.make_args(sp.expand(expr))
    for term in terms if len(terms) <= PRINTABLE else ():
        others = sum((t for t in terms if t is not term), start=sp.Integer(0))
        yield f"the sign of {term}", others - term
        for f in factors:
            yield f"{term} should be multiplied by {f}", others + term * f
            yield f"{term} should be divided by {f}", others + term / f
        for group in symbols:
            for here in [s for s in group if s in term.free_symbols]:
                for there in [s for s in group if s is not here]:
                    yield f"{there} instead of {here} in {term}", others + term.subs(here, there)


def find_slip(printed: Expr, case: Case) -> str:
    """Return the one slip that turns printed into derived, in words; empty if there is none."""
    for words, repair in case.repairs:
        if same(repair(printed), case.derived):
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
    """Return the verdict, and the slip in words where one explains the difference."""
    if case.derived is None:
        return AGREES, ""
    if (case.rank is not None and case.rank[0] < case.rank[1]) or unreadable(printed, case):
        return NOT_DETERMINED, ""
    return _judge(printed.formula, printed, case)


def _by_reading(formula: Expr, case: Case) -> bool:
    """Return whether a formula follows by the convention or simplification of `reading`, and not without it."""
    if case.reading is None or same(formula, case.derived):
        return False
    return same(formula, case.reading[1](case.derived))


def _judge(formula: Expr, printed: Printed, case: Case) -> tuple[str, str]:
    if same(formula, case.derived):
        return AGREES, ""
    if case.reading is not None and _by_reading(formula, case):
        return case.reading[2], ""
    if _shape(formula) == _shape(case.derived):
        pairs = list(zip(entries(formula), entries(case.derived), strict=True))
        if case.small and all(order(p - d, case.small) > order(p, case.small) for p, d in pairs if not is_zero(p - d)):
            return APPROXIMATION, ""
    slip = find_slip(formula, case)
    return (MISPRINT if slip and not printed.carried else WRONG), slip


def unreadable(printed: Printed, case: Case) -> bool:
    """Return whether the scan shows no formula, or one whose verdict is another than that of the reading."""
    if printed.formula is None:
        return True
    if printed.literal is None:
        return False
    return _judge(printed.formula, printed, case)[0] != _judge(printed.literal, printed, case)[0]


def magnitude(difference: Expr, at: Mapping[Expr, float], sweep: Sequence[Mapping[Expr, float]] = ({},)) -> float:
    """Return the largest absolute value of a difference over the points of `sweep`."""
    formula = entries(difference)
    symbols = sorted(set().union(*(entry.free_symbols for entry in formula)), key=str)
    numeric = sp.lambdify(symbols, formula, "math")
    points = [{**at, **point} for point in sweep]
    return max(abs(value) for point in points for value in numeric(*(float(point[s]) for s in symbols)))


def in_unit(value: float, unit: str) -> str:
    """Return a force over g or an angle in rad, with its everyday unit."""
    if unit == "g":
        return f"{value:.3g} g"
    scaled = {"ug": value * 1e6, "arcsec": value / ARCSEC, "ppm": value * 1e6}.get(unit)
    return f"{value:.3g}" if scaled is None else f"{value:.1e} ({scaled:.3g} {unit})"


def size_in_words(verdict: str, printed: Printed, case: Case) -> str:
    """Return how much it matters: "0" where printed and derived agree."""
    if verdict == AGREES:
        return "0"
    if verdict == NOT_DETERMINED and case.rank is not None:
        return f"rank {case.rank[0]} of {case.rank[1]}"
    shown = printed.formula if printed.literal is None else printed.literal  # at worst the scan is what was printed
    if shown is None:
        return "not quantified"
    if _shape(shown) != _shape(case.derived):
        return "shapes differ"
    if case.at is None:
        return "not quantified"
    return in_unit(magnitude(shown - case.derived, case.at, case.sweep), case.unit)


def decide(source: str, printed: Printed, case: Case) -> Verdict:
    """Compare one printed formula with its derivation, and the package with both, and say what was found."""
    verdict, slip = judge(printed, case)
    size = size_in_words(verdict, printed, case)
    words = case.why(printed, case) if callable(case.why) else case.why
    why = words.format(size=size, slip=slip, **dict(case.facts or {}))
    if case.derived is None:
        why = f"A definition: nothing to derive. {why}".rstrip()
    elif unreadable(printed, case):
        why = f"unreadable: {printed.garbled}. {why}"
    elif printed.garbled:
        why += f" The scan is garbled here: {printed.garbled}."
    derived = "a definition" if case.derived is None else sp.sstr(case.derived)
    assumes = case.reading[0] if case.reading is not None and _by_reading(printed.formula, case) else case.assumes
    formulas = (printed.formula, case.derived)
    return with_package(
        Verdict(source, printed.item, verdict, printed.scan, derived, size, why, None, assumes, formulas)
    )


def by_size(difference: float, rounding: float, order: float = 0.0) -> str:
    """Return the verdict on a number: agrees within its rounding, approximation within `order`, else wrong."""
    if abs(difference) <= rounding:
        return AGREES
    return APPROXIMATION if abs(difference) <= order else WRONG


def last_digit(text: str) -> float:
    """Return one unit of the last printed digit."""
    mantissa, exponent = text.split("e")
    return float(10.0 ** (int(exponent) - len(mantissa.partition(".")[2])))


def decide_group(source: str, group: ModuleType, printed: Mapping[str, Printed] | None = None) -> tuple[Verdict, ...]:
    """Return verdicts of one file of a paper; `printed` replaces what the paper prints, item by item."""
    formulas = {**group.PRINTED, **(printed or {})}
    return tuple(decide(source, formulas[item], case) for item, case in group.cases().items())


def with_package(found: Verdict) -> Verdict:
    """Return the verdict with how the package compares, where it holds the item."""
    package = compare(found.source, found.item)
    return found if package is None else replace(found, why=f"{found.why} {package}", package=package)
