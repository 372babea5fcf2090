"""The small expressions of which a law that no catalogue holds may consist, in what was recorded.

A term is a function of one variable: a power, a size, waves, a decay, a saturation, a threshold. A law is one term or
the product of two in different variables, each column of it with a coefficient that is fitted beside the calibration.
Constants inside a term (an order, a time constant, a limit) start from a grid.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.library.variables import Variable, variables
from gimbalcal.effects import Stimulus
from gimbalcal.effects.grids import highest_order
from gimbalcal.number import Array
from gimbalcal.units import to_si

LEVELS, STEPS = 12, 25  # thresholds of a variable at the most, and about one of them
INSTANTS = 40  # of a threshold in time
CYCLES, FAST = 30, 150  # waves over the recording, in half turns: in products, and alone
ORDERS = 8  # harmonics of an angle at the most
VARIED = (0.25, 0.5, 0.8, 1.25, 2.0, 4.0)  # times a constant: where else a law may be


@dataclass(frozen=True)
class Form:
    """A function of one variable: of x, its columns (n, m) by constant; in print and as code, {x} being the variable.

    power: of x, which the unit of a coefficient is divided by; constant: its letter and which unit it has ("" none,
    "x" that of the variable, "1/x", or a whole number).
    """

    key: str
    columns: Callable[[Array, float], list[Array]]
    words: tuple[str, ...]
    power: int = 0
    constant: str = ""
    of: str = ""

    @property
    def smooth(self) -> bool:
        """Return whether the constant can be refined between the values of its grid."""
        return bool(self.constant) and self.of != "whole" and self.key != "above"


WAVES = ("cos({c}*{x})", "sin({c}*{x})")
FORMS = {
    form.key: form
    for form in (
        Form("x", lambda x, _: [x], ("{x}",), 1),
        Form("x^2", lambda x, _: [x**2], ("{x}**2",), 2),
        Form("x^3", lambda x, _: [x**3], ("{x}**3",), 3),
        Form("|x|", lambda x, _: [np.abs(x)], ("Abs({x})",), 1),
        Form("harmonic", lambda x, n: [np.cos(n * x), np.sin(n * x)], WAVES, 0, "n", "whole"),
        Form("wave", lambda x, k: [np.cos(k * x), np.sin(k * x)], WAVES, 0, "k", "1/x"),
        Form("fade", lambda x, tau: [np.exp(-x / tau)], ("exp(-{x}/{c})",), 0, "tau", "x"),
        Form("bounded", lambda x, b: [x / (1 + np.abs(x) / b)], ("{x}/(1 + Abs({x})/{c})",), 1, "b", "x"),
        Form("above", lambda x, c: [(x > c).astype(float)], ("Heaviside({x} - {c})",), 0, "x0", "x"),
    )
}
OF = {
    "force": ("x", "x^2", "x^3", "|x|", "wave", "bounded", "above"),
    "angle": ("harmonic", "above"),
    "rate": ("x", "x^2", "x^3", "|x|", "bounded", "above"),
    "time": ("x", "x^2", "x^3", "wave", "fade", "above"),
    "since": ("x", "fade"),
    "logged": ("x", "x^2", "x^3", "|x|", "above"),
    "course": ("x", "x^2", "x^3", "|x|", "above"),
}


@dataclass(frozen=True, eq=False)
class Term:
    """A form of a variable with its constant (SI), its columns (n, m), and on how long a grid it stands."""

    variable: Variable
    form: Form
    constant: float
    columns: Array
    tried: int

    @property
    def family(self) -> str:
        """The term whatever its constant."""
        return f"{self.form.key} of {self.variable.name}"

    def at(self, constant: float) -> Term:
        """The same form with another constant."""
        return replace(self, constant=constant, columns=_columns(self.variable, self.form, constant))

    def printed(self, x: float) -> float:
        """A value of the constant, or its sigma, in its unit."""
        return x / float(to_si(1.0, self.unit_of_constant())) if self.unit_of_constant() else x

    def unit_of_constant(self) -> str:
        """In print."""
        unit = self.variable.unit
        return "" if self.form.of == "whole" or not unit else unit if self.form.of == "x" else f"1/{whole(unit)}"


@dataclass(frozen=True, eq=False)
class Expression:
    """A law: one term, or the product of two or three."""

    terms: tuple[Term, ...]

    @property
    def family(self) -> str:
        """The law whatever its constants."""
        return " * ".join(t.family for t in self.terms)

    @property
    def columns(self) -> Array:
        """Columns (n, m) of which each has a coefficient."""
        return multiplied(*(t.columns for t in self.terms))

    @property
    def tried(self) -> int:
        """Among how many choices of its constants it was chosen."""
        return int(np.prod([t.tried for t in self.terms]))

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The variables that it follows."""
        return tuple(t.variable for t in self.terms)

    def on(self, s: Stimulus) -> Expression:
        """The same law where something else is felt. Raises KeyError for what is not logged there."""
        there = {v.name: v for v in variables(s, still=True)}
        moved = ((t, replace(t.variable, x=there[t.variable.name].x)) for t in self.terms)
        return Expression(tuple(replace(t, variable=v, columns=_columns(v, t.form, t.constant)) for t, v in moved))

    def varied(self) -> list[Expression]:
        """The law, and with each of its smooth constants a quarter to four times as large."""
        out = [self]
        for i, t in enumerate(self.terms):
            if t.form.smooth:
                moved = (t.at(t.constant * by) for by in VARIED)
                out += [Expression((*self.terms[:i], m, *self.terms[i + 1 :])) for m in moved]
        return out


def multiplied(A: Array, *others: Array) -> Array:
    """Products (n, a b ...) of each column of A (n, a) with each of the others (n, b)."""
    for B in others:
        A = (A[:, :, None] * B[:, None, :]).reshape(len(A), -1)
    return A


def terms(v: Variable, s: Stimulus) -> list[Term]:
    """Every term of a variable, with every constant of its grid."""
    out = []
    for key in OF[v.group]:
        form = FORMS[key]
        grid = _grid(v, form, s) if form.constant else [0.0]
        made = [Term(v, form, c, _columns(v, form, c), len(grid)) for c in grid]
        out += [t for t in made if np.ptp(t.columns, axis=0).max() > 1e-9 * np.abs(t.columns).max()]
    return out


def _columns(v: Variable, form: Form, constant: float) -> Array:
    x = v.x - v.origin if form.power else v.x
    return np.stack(form.columns(x, constant), axis=-1)


def _grid(v: Variable, form: Form, s: Stimulus) -> list[float]:
    """Constants from which a search starts, SI."""
    low, high = float(v.x.min()), float(v.x.max())
    size = max(abs(low - v.origin), abs(high - v.origin))
    if form.key == "harmonic":
        return [float(n) for n in range(1, max(1, min(ORDERS, int(highest_order(s)))) + 1)]
    if form.key == "wave":
        span = high - low
        return [
            np.pi * k / span for k in range(1, (min(FAST, len(v.x) // 4) if v.group == "time" else CYCLES // 4) + 1)
        ]
    if form.key == "fade":
        step = float(np.median(np.diff(np.unique(v.x))))
        return list(np.geomspace(max(2 * step, (high - low) / 50), 1.5 * (high - low), 7))
    if form.key == "bounded":
        return list(size * np.array([0.1, 0.3, 1.0, 3.0]))
    return _levels(v, s)


def _levels(v: Variable, s: Stimulus) -> list[float]:
    """Thresholds: between the levels that a variable takes, or between visits."""
    if v.group == "time":
        starts = s.time[np.flatnonzero(np.diff(s.visit)) + 1]
        every = starts - 1e-3 if len(starts) else np.linspace(v.x[0], v.x[-1], INSTANTS + 2)[1:-1]
        return list(every[np.unique(np.linspace(0, len(every) - 1, min(len(every), INSTANTS)).round().astype(int))])
    if v.group == "course":
        return [0.0]
    seen = np.unique(np.round((v.x - v.x.min()) / max(float(np.ptp(v.x)), 1e-300), 2)) * float(np.ptp(v.x)) + v.x.min()
    middle = (seen[1:] + seen[:-1]) / 2
    return list(middle[np.unique(np.linspace(0, len(middle) - 1, min(len(middle), LEVELS)).round().astype(int))])


def singles(every: Sequence[Sequence[Term]]) -> list[Expression]:
    """Laws of one term."""
    return [Expression((t,)) for own in every for t in own]


def partners(every: Sequence[Sequence[Term]]) -> list[tuple[Term, list[Term]]]:
    """Each term with all terms of the variables behind its own: products of two, each once.

    Fast waves are multiplied by the variables themselves alone.
    """
    slow = [[t for t in own if not _fast(t)] for own in every]
    out = [(t, list(itertools.chain(*slow[i + 1 :]))) for i, own in enumerate(slow) for t in own]
    for i, own in enumerate(every):
        plain = [t for k, other in enumerate(slow) if k != i for t in other if t.form.key == "x"]
        out += [(t, plain) for t in own if _fast(t)]
    return out


def triples(every: Sequence[Sequence[Term]]) -> list[Expression]:
    """Products of three variables as they are, of angles the first harmonic."""
    plain = [t for own in every for t in own if t.form.key == "x" or (t.form.key == "harmonic" and t.constant == 1)]
    return [Expression(three) for three in itertools.combinations(plain, 3)]


def _fast(t: Term) -> bool:
    return t.form.key == "wave" and t.constant * float(np.ptp(t.variable.x)) > (CYCLES + 0.5) * np.pi


def between(t: Term) -> list[Term]:
    """A threshold moved as far as the next ones of its grid, in steps; no others."""
    if t.form.key != "above" or t.variable.group == "course":
        return []
    step = float(np.ptp(t.variable.x)) / (INSTANTS if t.variable.group == "time" else LEVELS)
    made = (t.at(c) for c in t.constant + step * np.linspace(-1, 1, STEPS))
    return [m for m in made if np.ptp(m.columns) > 0]


def whole(unit: str) -> str:
    """A unit as one factor."""
    return f"({unit})" if "/" in unit else unit
