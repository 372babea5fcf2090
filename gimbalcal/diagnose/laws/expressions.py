r"""The small expressions of which a law that no catalogue holds may consist, in what was recorded.

A term is a form of one variable: powers, waves, decays, logarithms, steps, knees, bumps, pulses, or a table. A law is
one term, or the product of two or three in different variables, and each of its columns has a coefficient that is
fitted alongside the calibration. Variables without a natural zero (time, temperature, logged channels) have a free
origin: lower powers stand with the higher ones, so that the columns span the same functions whatever the origin,

.. math:: \mathrm{span}\{x, x^2, x^3\} = \mathrm{span}\{x - c, (x - c)^2, (x - c)^3\} \text{ up to a constant,}

and whatever the unit. Constants inside a term (an order, a time constant, a threshold, a width) start from a grid.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gimbalcal.diagnose.laws.variables import CENTRED_GROUPS, Variable, variables
from gimbalcal.effects import Stimulus
from gimbalcal.effects.grids import highest_order
from gimbalcal.number import Array
from gimbalcal.units import to_si

LEVELS, STEPS = 12, 25  # thresholds of a variable at the most, and about one of them
INSTANTS = 40  # of a threshold in time
CYCLES, FAST = 30, 150  # waves over the recording, in half turns: in products, and alone
SLOW_WAVES = 16  # half turns over the range of a variable other than time
ORDERS = 8  # harmonics of an angle at the most
PLACES, WIDTHS = 9, (0.04, 0.12, 0.35)  # of steps and bumps, in shares of the range of a variable
SAME_VARIABLE_SHARE = 0.9999  # share of the variance of a variable that another says, from which they are one
NEAR_ZERO = 0.03  # of the range of a force or a rate, beyond which the distance of knots grows with that to zero
KNOTS, KNOTS_OF_PRODUCT = (4, 6, 9, 13, 19), 6  # of a table, and of one in a product at the most
CYCLIC = 3  # harmonics of a cycle of any shape
MIN_SINE = 0.05  # sine of an angle, below which its cosecant is none of a mount
COEFFICIENTS = 8  # of a law that is no table, at the most
AIR_MASSES = (1.0, 2.0, 4.0)  # powers of the air mass
ONSETS = (0.5, 1.5, 2.0, 3.0)  # powers behind a threshold
CHIRPS = (1, 2, 3, 4, 6, 8, 12)  # turns that a chirp gains or loses over the recording
PULSES, PHASES = np.cos(np.pi * np.arange(1, 8) / 8).tolist(), 24  # levels above which a cosine is a pulse; its phases
HARMONIC = 4  # of a pulse, the highest that may show most
MIN_PHASE_RANGE = 0.9 * 2 * np.pi  # of the phase of a wave: where it does not come round, its shape is not to be seen
POWERS = (0.5, 1.5, 2.5, 4.0)  # of the size of a variable, from which a search starts
VARIED_FACTORS = (0.25, 0.5, 0.8, 1.25, 2.0, 4.0)  # times a constant: where else a law may be


@dataclass(frozen=True)
class Constant:
    """A constant of a form: its letter, its unit ("x" that of the variable, "1/x", or none), and how it is refined.

    kind: "size" of a positive number, "power", which is near its grid, "place" among the values of the variable,
    "origin", which may lie beyond them, "number", or "fixed": as on the grid.
    """

    letter: str
    of: str = ""
    kind: str = "size"


@dataclass(frozen=True)
class Form:
    """A function of one variable: of x and its constants, its columns (n, m); in print, {x} being the variable.

    words: of each column, with {0}, {1}, ... for the constants; powers: of x of each column, by which the unit of its
    coefficient is divided; whole: whether the columns go together, as sine and cosine do.
    """

    key: str
    columns: Callable[..., list[Array]]
    words: tuple[str, ...]
    powers: tuple[int, ...]
    constants: tuple[Constant, ...] = ()
    whole: bool = False


def _power(x: Array, p: float) -> list[Array]:
    return [np.abs(x) ** p, np.sign(x) * np.abs(x) ** p]


def _beyond(x: Array, c: float) -> list[Array]:
    over = np.maximum(np.abs(x) - c, 0.0)
    return [over, np.sign(x) * over]


def _step(x: Array, c: float, w: float) -> list[Array]:
    return [np.tanh((x - c) / w)]


def _ring(x: Array, k: float, tau: float) -> list[Array]:
    return [np.exp(-x / tau) * np.cos(k * x), np.exp(-x / tau) * np.sin(k * x)]


def _table(x: Array, *knots: float) -> list[Array]:
    return [np.clip(x, a, b) - a for a, b in itertools.pairwise(knots)]


def _cyclic(x: Array, k: float) -> list[Array]:
    return [f(n * k * x) for n in range(1, CYCLIC + 1) for f in (np.cos, np.sin)]


def _chirp(x: Array, k: float, tau: float, sign: float) -> list[Array]:
    phase = k * x + sign * (x / tau) ** 2
    return [np.cos(phase), np.sin(phase)]


def _shock(x: Array, c: float, tau: float) -> list[Array]:
    return [(x > c) * np.exp(-np.maximum(x - c, 0.0) / tau)]


def _shaking(x: Array, c: float, tau: float, k: float) -> list[Array]:
    return [_shock(x, c, tau)[0] * f(k * x) for f in (np.cos, np.sin)]


WAVES = ("cos({0}*{x})", "sin({0}*{x})")
CYCLE = (*WAVES, *(f"{f}({n}*{{0}}*{{x}})" for n in range(2, CYCLIC + 1) for f in ("cos", "sin")))
PLACE, WIDTH, TAU, K = Constant("x0", "x", "place"), Constant("w", "x"), Constant("tau", "x"), Constant("k", "1/x")
START = Constant("x0", "x", "fixed")
LIMIT, POWER = Constant("x0", "x"), Constant("p", "", "power")
PHASE, ORIGIN = Constant("phi", "", "number"), Constant("x0", "x", "origin")
FORMS = {
    form.key: form
    for form in (
        Form("x", lambda x: [x], ("{x}",), (1,)),
        Form("x^2", lambda x: [x**2], ("{x}**2",), (2,)),
        Form("x^3", lambda x: [x**3], ("{x}**3",), (3,)),
        Form("to x^2", lambda x: [x, x**2], ("{x}", "{x}**2"), (1, 2)),
        Form("to x^3", lambda x: [x, x**2, x**3], ("{x}", "{x}**2", "{x}**3"), (1, 2, 3)),
        Form("|x|", lambda x: [np.abs(x)], ("Abs({x})",), (1,)),
        Form("power", _power, ("Abs({x})**{0}", "sign({x})*Abs({x})**{0}"), (0, 0), (POWER,)),
        Form("beyond", _beyond, ("Max(0, Abs({x}) - {0})", "sign({x})*Max(0, Abs({x}) - {0})"), (1, 1), (LIMIT,)),
        Form("harmonic", lambda x, n: [np.cos(n * x), np.sin(n * x)], WAVES, (0, 0),
             (Constant("n", "", "fixed"),), True),
        Form("wave", lambda x, k: [np.cos(k * x), np.sin(k * x)], WAVES, (0, 0), (K,), True),
        Form("phased", lambda x, k, p: [np.cos(k * x + p)], ("cos({0}*{x} + {1})",), (0,), (K, PHASE)),
        Form("fade", lambda x, tau: [np.exp(-x / tau)], ("exp(-{x}/{0})",), (0,), (TAU,)),
        Form("log", lambda x, tau: [np.log1p(x / tau)], ("log(1 + {x}/{0})",), (0,), (TAU,)),
        Form("ring", _ring, tuple(f"exp(-{{x}}/{{1}})*{w}" for w in WAVES), (0, 0), (K, TAU), True),
        Form("above", lambda x, c: [(x > c).astype(float)], ("Heaviside({x} - {0})",), (0,), (START,)),
        Form("step", _step, ("tanh(({x} - {0})/{1})",), (0,), (PLACE, WIDTH)),
        Form("knee", lambda x, c: [x, np.maximum(x - c, 0.0)], ("{x}", "Max(0, {x} - {0})"), (1, 1), (PLACE,)),
        Form("bump", lambda x, c, w: [np.exp(-(((x - c) / w) ** 2))], ("exp(-(({x} - {0})/{1})**2)",), (0,),
             (PLACE, WIDTH)),
        Form("pulse", lambda x, k, p, q: [np.sign(np.cos(k * x + p) - q)], ("sign(cos({0}*{x} + {1}) - {2})",), (0,),
             (K, PHASE, Constant("level", "", "number"))),
        Form("sawtooth", lambda x, k, p: [np.arctan2(np.sin(k * x + p), np.cos(k * x + p))],
             ("atan2(sin({0}*{x} + {1}), cos({0}*{x} + {1}))",), (0,), (K, PHASE)),
        Form("rectified", lambda x, k, p: [np.cos(k * x + p), np.abs(np.cos(k * x + p))],
             ("cos({0}*{x} + {1})", "Abs(cos({0}*{x} + {1}))"), (0, 0), (K, PHASE)),
        Form("cyclic", _cyclic, CYCLE, (0,) * len(CYCLE), (K,)),
        Form("rising", lambda x, k, tau: _chirp(x, k, tau, 1.0),
             ("cos({0}*{x} + ({x}/{1})**2)", "sin({0}*{x} + ({x}/{1})**2)"), (0, 0), (K, TAU), True),
        Form("falling", lambda x, k, tau: _chirp(x, k, tau, -1.0),
             ("cos({0}*{x} - ({x}/{1})**2)", "sin({0}*{x} - ({x}/{1})**2)"), (0, 0), (K, TAU), True),
        Form("onset", lambda x, c, p: [np.maximum(x - c, 0.0) ** p], ("Max(0, {x} - {0})**{1}",), (0,),
             (ORIGIN, POWER)),
        Form("end", lambda x, c, p: [np.maximum(c - x, 0.0) ** p], ("Max(0, {0} - {x})**{1}",), (0,),
             (ORIGIN, POWER)),
        Form("window", lambda x, a, b: [((x > a) & (x < b)).astype(float)],
             ("(Heaviside({x} - {0}) - Heaviside({x} - {1}))",), (0,),
             (START, Constant("x1", "x", "fixed"))),
        Form("growth", lambda x, tau: [np.exp(x / tau)], ("exp({x}/{0})",), (0,), (TAU,)),
        Form("cosecant", lambda x: [1 / np.sin(x), np.cos(x) / np.sin(x)], ("1/sin({x})", "cos({x})/sin({x})"), (0, 0)),
        Form("air mass", lambda x, p: [np.abs(np.sin(x)) ** -p], ("Abs(sin({x}))**(-{0})",), (0,), (POWER,)),
        Form("shock", _shock, ("Heaviside({x} - {0})*exp(-Max(0, {x} - {0})/{1})",), (0,), (START, TAU)),
        Form("shaking", _shaking, tuple(f"Heaviside({{x}} - {{0}})*exp(-Max(0, {{x}} - {{0}})/{{1}})*{f}({{2}}*{{x}})"
                                        for f in ("cos", "sin")), (0, 0), (START, TAU, K), True),
        Form("table", _table, (), ()),
    )
}  # fmt: skip
SINGLE_FORMS = {
    "force": ("x", "x^2", "x^3", "|x|", "power", "beyond", "wave", "above", "step", "knee"),
    "angle": ("harmonic", "cosecant", "air mass", "above", "step", "bump", "beyond", "onset", "end"),
    "rate": ("x", "x^2", "x^3", "|x|", "power", "beyond", "above", "step", "knee"),
    "time": ("x", "to x^2", "to x^3", "power", "wave", "rising", "falling", "fade", "log", "ring", "above", "step",
             "knee", "onset", "end", "window", "shock", "bump"),
    "since": ("x", "power", "fade", "log"),
    "logged": ("x", "to x^2", "to x^3", "growth", "wave", "above", "step", "knee", "onset", "end", "window", "bump"),
    "temperature rate": ("x", "x^2", "x^3", "|x|", "above"),
    "move": ("x", "|x|", "power", "step"),
}  # fmt: skip # of a variable of each group by itself
PRODUCT_FORMS = {
    "force": ("x", "x^2", "x^3", "|x|", "above"),
    "angle": ("harmonic", "above"),
    "rate": ("x", "x^2", "x^3", "|x|", "above"),
    "time": ("x", "to x^2", "wave", "fade", "log", "above"),
    "since": ("x", "fade"),
    "logged": ("x", "to x^2", "to x^3", "growth", "wave", "above", "knee"),
    "temperature rate": ("x", "x^2", "|x|", "above"),
    "move": ("x",),
}  # and in products


@dataclass(frozen=True, eq=False)
class Term:
    """A form of a variable with its constants (SI), and on how long a grid they stand."""

    variable: Variable
    form: Form
    constants: tuple[float, ...]
    tried: int

    @cached_property
    def columns(self) -> Array:
        """The columns (n, m)."""
        return np.stack(self._evaluated(self.variable.x, self.constants), axis=-1)

    def at_each(self, constants: Array) -> Array:
        """The columns (n, m, T) with each of T choices of the constants (T, k)."""
        each = self._evaluated(self.variable.x[:, None], tuple(constants.T))
        return np.stack([np.broadcast_to(X, (len(X), len(constants))) for X in each], axis=1)

    def _evaluated(self, x: Array, constants: Sequence[Any]) -> list[Array]:
        v, per = self.variable, self.unit_of_power
        x = x - v.origin if self.centred else x
        if per != 1.0:
            constants = [k / per if c.of == "x" else k for k, c in zip(constants, self.form.constants, strict=True)]
        return self.form.columns(x / per, *constants)

    @property
    def centred(self) -> bool:
        """Return whether the form is of the difference from the origin of its variable."""
        return (any(self.form.powers) and self.form.key != "knee") or self.form.key == "growth"

    @property
    def unit_of_power(self) -> float:
        """Return what a variable is divided by, SI: its unit of print where its power is no whole number, else one."""
        of_unit = self.form.key in ("power", "onset", "end") and self.variable.unit
        return float(to_si(1.0, self.variable.unit)) if of_unit else 1.0

    @cached_property
    def factors(self) -> Array:
        """The columns as they stand in a product, behind a constant where the origin is free."""
        one = np.ones((len(self.columns), int(self.free_origin)))
        return np.concatenate([one, self.columns], axis=1)

    @cached_property
    def family(self) -> str:
        """The term for any constants, with the order of a rare wave."""
        order = f" {self.constants[0]:.3g}" if self.form.key in ("pulse", "sawtooth", "rectified") else ""
        return f"{self.form.key}{order} of {self.variable.name}"

    @property
    def free_origin(self) -> bool:
        """Return whether a product includes a constant with the columns, since the variable has no natural zero."""
        powers = self.form.key in ("x", "to x^2", "to x^3", "knee") and self.variable.group in CENTRED_GROUPS
        return powers or self.form.key == "table"

    @property
    def words(self) -> tuple[str, ...]:
        """The columns in print, with {x} for the variable."""
        if self.form.key != "table":
            return self.form.words
        c = [float(self.variable.printed(k)) for k in self.constants]
        return tuple(f"(Abs({{x}} - {a:.6g}) - Abs({{x}} - {b:.6g}) + {b - a:.6g})/2" for a, b in itertools.pairwise(c))

    def at(self, *constants: float) -> Term:
        """The same form with other constants."""
        return replace(self, constants=constants)

    def is_threshold(self, i: int) -> bool:
        """Return whether constant i is a value of the variable at which the form jumps; that of a rate is zero."""
        known = self.form.constants
        fixed = bool(known) and (known[i].kind, known[i].of) == ("fixed", "x")
        return fixed and self.variable.group != "temperature rate"

    def refined(self, i: int) -> bool:
        """Return whether constant i may lie between the values of its grid; waves of an angle come round."""
        c = self.form.constants[i]
        return c.kind != "fixed" and not (c.of == "1/x" and self.variable.group == "angle")

    def printed(self, i: int, x: float) -> float:
        """A value of constant i, or its sigma, in its unit."""
        return x / float(to_si(1.0, self.unit_of(i))) if self.unit_of(i) else x

    def unit_of(self, i: int) -> str:
        """The unit of constant i in print."""
        unit, of = self.variable.unit, self.form.constants[i].of
        return "" if not of or not unit else unit if of == "x" else f"1/{unit_as_factor(unit)}"


@dataclass(frozen=True, eq=False)
class Expression:
    """A law: one term, or the product of two or three; `kept` are the ordinals of its columns, None for all."""

    terms: tuple[Term, ...]
    kept: tuple[int, ...] | None = None

    @property
    def family(self) -> str:
        """The law whatever its constants."""
        return " * ".join(t.family for t in self.terms)

    @property
    def _ones(self) -> tuple[bool, ...]:
        """Return whether a constant stands before the columns of each term."""
        return tuple(len(self.terms) > 1 and t.free_origin for t in self.terms)

    @cached_property
    def columns(self) -> Array:
        """Columns (n, m) of which each has a coefficient."""
        X = np.ones((len(self.terms[0].variable.x), 1))
        for t in self.terms:
            X = (X[:, :, None] * (t.factors if len(self.terms) > 1 else t.columns)[:, None]).reshape(len(X), -1)
        X = X[:, int(all(self._ones)) :]
        return X if self.kept is None else X[:, list(self.kept)]

    @property
    def factors(self) -> list[tuple[int, ...]]:
        """Return, for each column, the ordinal of the column of each term; -1 where that is a constant."""
        each = [range(-int(one), t.columns.shape[1]) for t, one in zip(self.terms, self._ones, strict=True)]
        every = list(itertools.product(*each))[int(all(self._ones)) :]
        return every if self.kept is None else [every[i] for i in self.kept]

    @property
    def groups(self) -> list[list[int]]:
        """Ordinals of columns that go together: those that differ by sine and cosine."""
        out: dict[tuple[int, ...], list[int]] = {}
        for i, own in enumerate(self.factors):
            key = tuple(-2 if t.form.whole and k >= 0 else k for t, k in zip(self.terms, own, strict=True))
            out.setdefault(key, []).append(i)
        return list(out.values())

    @property
    def simpler(self) -> bool:
        """Return whether no column needs a factor, or the last one of its form, so that a simpler law says the same."""
        last = {"to x^2": 1, "to x^3": 2, "knee": 1, "rectified": 1}
        return any(all(own[i] < 0 or own[i] != last.get(t.form.key, own[i]) for own in self.factors)
                   for i, t in enumerate(self.terms))  # fmt: skip

    def without(self, dropped: Sequence[int]) -> Expression:
        """Return the law without these of its columns."""
        kept = self.kept or tuple(range(self.columns.shape[1]))
        return Expression(self.terms, tuple(k for i, k in enumerate(kept) if i not in dropped))

    @property
    def tried(self) -> int:
        """Among how many choices of its constants it was chosen."""
        return math.prod(t.tried for t in self.terms)

    @property
    def degree(self) -> int:
        """The highest powers of its terms, added up."""
        return sum(max(t.form.powers, default=0) for t in self.terms)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The variables that it follows."""
        return tuple(t.variable for t in self.terms)

    def of(self, rows: Iterable[Variable]) -> Expression:
        """Return the same law of other rows of the variables. Raises KeyError for what is not logged there."""
        named = {v.name: v for v in rows}
        moved = (replace(t, variable=replace(named[t.variable.name], origin=t.variable.origin)) for t in self.terms)
        return Expression(tuple(moved), self.kept)

    def referred(self) -> Expression:
        """Return the same law with powers of the difference from the reference of each variable."""
        at = (replace(t, variable=replace(t.variable, origin=t.variable.reference)) for t in self.terms)
        return Expression(tuple(at), self.kept)

    def on(self, s: Stimulus) -> Expression:
        """Return the same law of another stimulus. Raises KeyError for what is not logged there."""
        return self.of(variables(s, still=True))

    def varied(self) -> list[Expression]:
        """The law, and with each of its sizes a quarter to four times as large."""
        out = [self]
        for i, j, value in self.smooth():
            if self.terms[i].form.constants[j].kind == "size":
                out += [self.at([(i, j, value * by)]) for by in VARIED_FACTORS]
        return out

    def smooth(self) -> list[tuple[int, int, float]]:
        """Ordinals of term and constant, and values, of the constants that can be refined."""
        return [(i, j, t.constants[j]) for i, t in enumerate(self.terms)
                for j in range(len(t.form.constants)) if t.refined(j)]  # fmt: skip

    def at(self, values: Sequence[tuple[int, int, float]]) -> Expression:
        """Return the law with these values of some constants, by the ordinals of term and constant."""
        each = [list(t.constants) for t in self.terms]
        for i, j, value in values:
            each[i][j] = value
        return replace(self, terms=tuple(t.at(*own) for t, own in zip(self.terms, each, strict=True)))


@dataclass(frozen=True, eq=False)
class TermGroup:
    """Terms of one family and of as many columns (n, m each), and these of all T of them."""

    terms: tuple[Term, ...]

    @cached_property
    def columns(self) -> Array:
        """The columns (n, m, T)."""
        if len(self.terms) == 1:
            return self.terms[0].columns[..., None]
        return self.terms[0].at_each(np.array([t.constants for t in self.terms]))

    @cached_property
    def factors(self) -> Array:
        """The columns (n, m, T) as they stand in a product."""
        one = np.ones((len(self.columns), int(self.terms[0].free_origin), len(self.terms)))
        return np.concatenate([one, self.columns], axis=1)


Family = tuple[TermGroup, ...]  # expressions that differ in constants alone: any term of one times any of the next


def terms_of_variable(v: Variable, s: Stimulus, keys: Sequence[str], rows: Array | slice = slice(None)) -> list[Term]:
    """Return every term of a variable in these forms, with every constant of its grid, at some `rows`."""
    out = []
    here = replace(v, x=v.x[rows])
    for key in keys:
        grid = _grid(v, FORMS[key], s)
        if grid:
            X = Term(here, FORMS[key], grid[0], len(grid)).at_each(np.array(grid))
            shown = np.ptp(X, axis=0).max(axis=0) > 1e-9 * np.abs(X).max(axis=(0, 1))
            out += [Term(here, FORMS[key], c, len(grid)) for c, own in zip(grid, shown, strict=True) if own]
    return out


def _grid(v: Variable, form: Form, s: Stimulus) -> list[tuple[float, ...]]:
    """Constants from which a search starts, SI."""
    low, high = float(v.x.min()), float(v.x.max())
    span, places = high - low, np.linspace(low, high, PLACES + 2)[1:-1]

    def above_horizon() -> bool:
        return bool(np.abs(np.sin(v.x)).min() > MIN_SINE)

    def waves() -> int:
        if v.group == "time":
            return min(FAST, len(v.x) // (4 * len(s.instants())))
        return min(SLOW_WAVES, len(np.unique(np.round((v.x - low) / (span or 1.0), 3))) // 2)

    def chirps() -> list[tuple[float, ...]]:
        return [(np.pi * k / span, span / np.sqrt(2 * np.pi * more)) for k in range(1, CYCLES + 1) for more in CHIRPS]

    grids: dict[str, Callable[[], Sequence[tuple[float, ...]]]] = {
        "harmonic": lambda: [(float(n),) for n in range(1, max(1, min(ORDERS, int(highest_order(s)))) + 1)],
        "wave": lambda: [(np.pi * k / span,) for k in range(1, waves() + 1)],
        "rising": chirps,
        "falling": chirps,
        "growth": lambda: [(sign * tau,) for tau in np.geomspace(span / 6, 2 * span, 5) for sign in (1, -1)],
        "cosecant": lambda: [()] if above_horizon() else [],
        "air mass": lambda: [(p,) for p in AIR_MASSES if above_horizon()],
        "onset": lambda: [(c, p) for c in (low - span / 3, *places) for p in ONSETS],
        "end": lambda: [(c, p) for c in (*places, high + span / 3) for p in ONSETS],
        "shock": lambda: [(c, span * part) for c in _threshold_levels(v, s) for part in (0.02, 0.05, 0.12, 0.3)],
        "window": lambda: list(itertools.combinations(_threshold_levels(v, s), 2)),
        "ring": lambda: [(np.pi * k / span, span * part) for k in range(2, CYCLES + 1) for part in (0.08, 0.2, 0.5)],
        "fade": lambda: [
            (tau,) for tau in np.geomspace(max(2 * np.median(np.diff(np.unique(v.x))), span / 50), 1.5 * span, 7)
        ],
        "log": lambda: [(tau,) for tau in np.geomspace(span / 300, span, 6)],
        "beyond": lambda: [(np.abs(v.x).max() * part,) for part in (0.1, 0.25, 0.4, 0.55, 0.7, 0.85)],
        "power": lambda: [(p,) for p in POWERS],
        "knee": lambda: [(c,) for c in places],
        "step": lambda: [(c, span * w) for c in places for w in WIDTHS],
        "bump": lambda: [(c, span * w) for c in places for w in WIDTHS],
        "above": lambda: [(c,) for c in _threshold_levels(v, s)],
    }
    return list(grids[form.key]()) if form.key in grids else [()]


def _threshold_levels(v: Variable, s: Stimulus) -> list[float]:
    """Thresholds: between the levels that a variable takes, or between visits."""
    if v.group == "time":
        starts = s.time[np.flatnonzero(np.diff(s.visit)) + 1]
        every = starts - 1e-3 if len(starts) else np.linspace(v.x[0], v.x[-1], INSTANTS + 2)[1:-1]
        return list(every[np.unique(np.linspace(0, len(every) - 1, min(len(every), INSTANTS)).round().astype(int))])
    if v.group == "temperature rate":
        return [0.0]
    span = float(np.ptp(v.x))
    levels = np.unique(np.round((v.x - v.x.min()) / max(span, 1e-300), 2)) * span + v.x.min()
    middle = (levels[1:] + levels[:-1]) / 2
    return list(middle[np.unique(np.linspace(0, len(middle) - 1, min(len(middle), LEVELS)).round().astype(int))])


def families(own: Iterable[Term]) -> list[TermGroup]:
    """Return successive terms of one family together."""
    return [TermGroup(tuple(alike)) for _, alike in itertools.groupby(own, key=lambda t: t.family)]


def term_pairs(every: Sequence[Sequence[Term]]) -> list[Family]:
    """Return the products of each term with all terms of the variables behind its own.

    Fast waves are multiplied by the variables themselves alone. What goes with a variable throughout, as the hour angle
    of a mount that tracks goes with time, is no other one: such a product is any function of one variable.
    """
    every = [own for own in every if own]
    slow, out = [families(t for t in own if not _is_fast(t)) for own in every], list[Family]()
    for i, own in enumerate(every):
        other = [k for k in range(len(every)) if k != i and not _as_one(own[0].variable, every[k][0].variable)]
        plain = [o for k in other for o in slow[k] if o.terms[0].form.key == "x"]
        out += [(grid, o) for grid in slow[i] for k in other if k > i for o in slow[k]]
        out += [(grid, o) for grid in families(t for t in own if _is_fast(t)) for o in plain]
    return out


def _as_one(u: Variable, v: Variable) -> bool:
    """Return whether two variables go with each other throughout a recording."""
    a, b = (w.x - w.x.mean() for w in (u, v))
    return bool((a @ b) ** 2 > SAME_VARIABLE_SHARE * (a @ a) * (b @ b))


def term_triples(every: Sequence[Sequence[Term]]) -> list[Family]:
    """Products of three variables as they are, of angles the first harmonic."""
    plain = [TermGroup((t,)) for own in every for t in own if t.variable.group != "move"
             and (t.form.key == "x" or (t.form.key == "harmonic" and t.constants == (1,)))]  # fmt: skip
    return [law for law in itertools.combinations(plain, 3) if not any(
        _as_one(a.terms[0].variable, b.terms[0].variable) for a, b in itertools.combinations(law, 2))]  # fmt: skip


def free_tables(vs: Sequence[Variable], rows: Array | slice, products: bool) -> list[Family]:
    """Return free functions of each variable, as tables between knots; where asked for, times a force or a rate too.

    They stand for what no closed form says. Knots are equally spaced in the mean of rank and value, so that each
    interval has data though a unit rests half of the time; of forces and rates others are closer near zero, where
    friction and lock-in act.
    """
    out = list[Family]()
    plain = [TermGroup((Term(replace(u, x=u.x[rows]), FORMS["x"], (), 1),)) for u in vs if u.group in ("force", "rate")]
    for v in (v for v in vs if v.group != "move"):
        here, ordered = replace(v, x=v.x[rows]), np.sort(v.x)
        for n, spread in itertools.product(KNOTS, _spreads_of_knots(ordered, v.group)):
            knots = np.interp(np.linspace(spread[0], spread[-1], n), spread, ordered)
            if np.diff(knots).min() > 1e-3 * np.ptp(v.x):
                table = TermGroup((Term(here, FORMS["table"], tuple(knots.tolist()), 2 * len(KNOTS)),))
                out.append((table,))
                if products and v.group in CENTRED_GROUPS and n <= KNOTS_OF_PRODUCT:
                    out += [(table, u) for u in plain]
    return out


def _spreads_of_knots(x: Array, group: str) -> list[Array]:
    """Return monotonic functions (n,) of the ordered values x (n,) of a variable, in which knots are equally spaced."""
    out = [np.linspace(0, 1, len(x)) + (x - x[0]) / (np.ptp(x) or 1.0)]
    if group in ("force", "rate"):
        out.append(np.arcsinh(x / (NEAR_ZERO * np.ptp(x) or 1.0)))
    return out


def richer_forms(e: Expression, several: bool) -> list[Family]:
    """Return laws with a richer form in the place of one of a law: what a wave, a threshold or a size may really be.

    A wave may have a free origin and, at `several` axes, also one phase in common.
    """
    out = list[Family]()
    for i, t in enumerate(e.terms):
        span = float(np.ptp(t.variable.x))
        variants = list[Term]()
        if t.form.key in ("wave", "harmonic"):
            k, of_angle = t.constants[0], t.variable.group == "angle"
            phases = 2 * np.pi * np.arange(PHASES) / PHASES
            slower = [
                k / n for n in range(1, HARMONIC + 1) if (not of_angle or k % n == 0) and k / n * span > MIN_PHASE_RANGE
            ]
            variants += [Term(t.variable, FORMS["pulse"], (c, p, q), PHASES * len(PULSES) * HARMONIC)
                         for c in slower for p in phases for q in PULSES]  # fmt: skip
            if several or any(other.free_origin for other in e.terms if other is not t):
                variants += [Term(t.variable, FORMS["phased"], (k, p), PHASES) for p in phases[: PHASES // 2]]
            variants += [Term(t.variable, FORMS["sawtooth"], (c, p), PHASES) for c in slower[:1] for p in phases]
            if not of_angle:  # of a gimbal the first harmonics have names
                variants += [Term(t.variable, FORMS["cyclic"], (c,), 2) for c in slower[:2]]
            variants += [Term(t.variable, FORMS["rectified"], (c, p), PHASES) for c in slower[:2] for p in phases]
        elif t.form.key == "shock":
            waves = np.pi * np.arange(2, CYCLES + 1) / span
            variants += [Term(t.variable, FORMS["shaking"], (*t.constants, k), t.tried * CYCLES) for k in waves]
        elif t.form.key == "above" and t.variable.group != "temperature rate":
            variants += [Term(t.variable, FORMS["step"], (*t.constants, span * w), t.tried * 3) for w in WIDTHS]
        elif t.form.key == "|x|" and t.variable.group in ("force", "rate"):
            variants += [Term(t.variable, FORMS["power"], (p,), 4) for p in (0.5, 1.5, 2.5)]
        out += [
            tuple(grid if k == i else TermGroup((o,)) for k, o in enumerate(e.terms)) for grid in families(variants)
        ]
    return out


def _is_fast(t: Term) -> bool:
    return t.form.key == "wave" and t.constants[0] * float(np.ptp(t.variable.x)) > (CYCLES + 0.5) * np.pi


def moved_threshold(t: Term, k: int) -> list[Term]:
    """Threshold k of a term moved as far as the next of its grid, in steps and in finer ones; no other constant."""
    if not t.is_threshold(k):
        return []
    step = float(np.ptp(t.variable.x)) / (INSTANTS if t.variable.group == "time" else LEVELS)
    steps = np.linspace(-1, 1, STEPS)
    moved = (t.constants[k] + x for x in step * np.unique([*steps, *(2 / STEPS * steps)]))
    neighbours = (t.at(*t.constants[:k], c, *t.constants[k + 1 :]) for c in moved)
    return [m for m in neighbours if np.ptp(m.columns) > 0]


def unit_as_factor(unit: str) -> str:
    """A unit as one factor."""
    return f"({unit})" if "/" in unit else unit
