"""A law that was found, in print and as an effect: its entry in diagnosis.json, and law.py."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import PRINTED
from gimbalcal.diagnose.laws.expressions import Expression, Term, unit_as_factor
from gimbalcal.diagnose.laws.law_search import JUMPS, STAGE, Law
from gimbalcal.diagnose.result import Estimate, LawResult, LawTable
from gimbalcal.effects import CATALOGUE
from gimbalcal.number import Array
from gimbalcal.units import from_si, to_si
from gimbalcal.views.core import View

MAX_ALTERNATIVES = 6  # in print
SIGMAS, FARTHEST = 3.0, 5.0  # of a constant that a fit may look through, and times its size at the most
HEAD = '''"""Laws that no catalogue holds, as `gimbalcal diagnose` found them: any command takes --effects law.py."""

import numpy as np

from gimbalcal.effects.effect import Domain, Effect, Grid, Stage, Stimulus, constant, effect, parameter
from gimbalcal.effects.history import smoothed_rate
from gimbalcal.number import Array, absolute, arctan2, cos, exp, log, sign, sin


def angle(s: Stimulus, name: str) -> Array:
    """Angle (n,) [rad] of a gimbal; pi/2 on a platform without it, where a negative power of its sine is finite."""
    return s.angle[:, s.axis_names.index(name)] if name in s.axis_names else 0 * s.time + np.pi / 2


def moved(s: Stimulus, name: str) -> Array:
    """Angle (n,) [rad] by which a gimbal was turned before a dwell; zero on a platform without it."""
    return s.move_angle[:, s.axis_names.index(name)] if name in s.axis_names else 0 * s.time


def above(x: Array) -> Array:
    """One where x is positive, else zero."""
    return (1 + sign(x)) / 2


def positive(x: Array) -> Array:
    """x where it is positive, else zero."""
    return (x + absolute(x)) / 2


def tanh(x: Array) -> Array:
    """Hyperbolic tangent."""
    decay = exp(-2 * absolute(x))
    return sign(x) * (1 - decay) / (1 + decay)

'''
CLASS = '''
@effect
class {name}(Effect):
    r"""A law that no catalogue held, found in {title}.

    .. math:: \\delta = {latex}

    Source: diagnosis. Magnitude: as found there. Seen by: {variables}.
    """

    id = "{id}"
    says = "{{who}} follows a law of its own, by {{size}}"
    stage = Stage.{stage}
    channel = "{channel}"
    kinds = {kinds!r}
    requires = {needs!r}
    domain = (
{domain}
    )
{fields}
{methods}'''
ADDED = '''
    def law(self, s: Stimulus) -> Array:
        """{form}."""
        law = {code}
        return law{to}
'''
CONTRIBUTION = '''
    def contribution(self, s: Stimulus) -> Array:
        """What the law adds, in the mean of each row{beyond}."""
        each = [{added} for one in s.instants()]
        return sum(each) / len(each)
'''
OVER_ALL = {"beyond": "", "added": "self.law(one)"}
SINCE_REST = {
    "beyond": ", beyond what it adds at rest, which is part of the bias",
    "added": "self.law(one) - self.law(one.at(rate=0 * one.rate))",
}


LETTERS = "abcdefghijlmoqrsuvyz"  # of coefficients; the others are those of constants
PYTHON_NAMES = (("Abs(", "absolute("), ("Heaviside(", "above("), ("Max(0, ", "positive("), ("atan2(", "arctan2("))


@dataclass(frozen=True, eq=False)
class LawText:
    """A law with letters: in print, as code in SI, its coefficients with the unit they divide by, its constants.

    constants: letter, and ordinals of the term and of its constant.
    """

    text: str
    code: str
    coefficients: tuple[tuple[str, str], ...]
    constants: tuple[tuple[str, int, int], ...]


def law_as_written(e: Expression) -> LawText:
    """A law as it is written down; whole numbers and thresholds as numbers, what can be fitted as letters."""
    named, each = list[tuple[str, int, int]](), list[tuple[list[str], list[str]]]()
    for i, t in enumerate(e.terms):
        letters, codes = [], []
        for j, c in enumerate(t.form.constants):
            value = t.constants[j]
            if not t.refined(j):
                letters.append(f"{t.printed(j, value) if c.of == '1/x' else float(t.variable.printed(value)):.6g}")
                codes.append(repr(float(value)))
            else:
                letter = c.letter + (str(i + 1) if len(e.terms) > 1 else "")
                letters.append(letter)
                codes.append(f"self.{letter}")
                named.append((letter, i, j))
        each.append(_words_of_term(t, letters, codes))
    shown, lines, divided = list[str](), list[str](), list[str]()
    for own in e.factors:
        parts = [(t, *each[i], k) for i, (t, k) in enumerate(zip(e.terms, own, strict=True)) if k >= 0]
        shown.append("*".join(words[k] for _, words, _, k in parts))
        lines.append(" * ".join(code[k] for _, _, code, k in parts))
        divided.append("".join(_coefficient_divisor(t, k) for t, _, _, k in parts))
    names = LETTERS[: len(shown)]
    text = " + ".join(f"{a}*{w}" for a, w in zip(names, shown, strict=True)).replace("- -", "+ ")
    code = " + ".join(f"self.{a} * ({w})[..., None]" for a, w in zip(names, lines, strict=True))
    return LawText(text, code, tuple(zip(names, divided, strict=True)), tuple(named))


def _words_of_term(t: Term, letters: Sequence[str], codes: Sequence[str]) -> tuple[list[str], list[str]]:
    """The columns of a term in print and as Python with arguments in SI."""
    v, at = t.variable, t.variable.origin
    centred = bool(t.centred and at)
    x = f"({v.name} - {float(v.printed(at)):.6g})" if centred else v.name
    x = x.replace("- -", "+ ")
    unity = letters[:1] == ["1"] and bool(t.form.constants) and t.form.constants[0].kind in ("fixed", "size")
    words = [w.replace("{0}*", "") if unity else w for w in t.words]
    code = f"({v.code} - {at!r})" if centred else v.code
    if (per := t.unit_of_power) != 1:
        code = f"({code} / {per!r})"
        each = zip(codes, t.form.constants, strict=True)
        codes = [f"({k} / {per!r})" if c.of == "x" else k for k, c in each]
    if t.form.key == "table":
        coded = [
            f"(absolute({code} - {a!r}) - absolute({code} - {b!r}) + {b - a!r}) / 2"
            for a, b in itertools.pairwise(t.constants)
        ]
    else:
        python = list(t.words)
        for of, to in PYTHON_NAMES:
            python = [w.replace(of, to) for w in python]
        coded = [w.format(*codes, x=code) for w in python]
    return [w.format(*letters, x=x) for w in words], coded


def _coefficient_divisor(t: Term, k: int) -> str:
    """The unit of a column by which its coefficient is divided."""
    power = 1 if t.form.key == "table" else t.form.powers[k]
    return (
        f"/{unit_as_factor(t.variable.unit)}" + (f"^{power}" if power > 1 else "") if power and t.variable.unit else ""
    )


def _is_table(e: Expression) -> bool:
    """Return whether a law is a table of one variable."""
    return len(e.terms) == 1 and e.terms[0].form.key == "table"


def printed_form(law: Law) -> str:
    """Return the form of a law with letters for its coefficients and the values of its constants."""
    if _is_table(law.expression):
        return f"table({law.expression.terms[0].variable.name})"
    e, description = law.expression, law_as_written(law.expression)
    constants = {a: e.terms[i].printed(j, e.terms[i].constants[j]) for a, i, j in description.constants}
    return _with_numbers(description.text, constants)


def _other_law_in_print(other: Law, law: Law) -> str:
    """Return another law in print, with its sensor or gimbal where that is not the one of a law."""
    here, there = ((o.channel, o.axis) for o in (law, other))
    return printed_form(other) + (f" in {' '.join(there).replace('_', ' ')}" if there != here else "")


def _with_numbers(text: str, values: Mapping[str, float]) -> str:
    """A formula with numbers in the place of some letters."""
    for name, value in values.items():
        text = re.sub(rf"(?<![\w.]){name}(?![\w(])", f"{value:.6g}", text)
    return text.replace("+ -", "- ").replace("- -", "+ ")


def found_law(
    law: Law, x: Array, covariance: Array, heldout: tuple[float, float], others: Sequence[Law], title: str,
    taken: Sequence[str] = (), view: View | None = None, known_effects: Sequence[str] = (),
) -> tuple[LawResult, ...]:  # fmt: skip
    """Return a law at each of its q axes: one effect with coefficients x (q m,), covariance (q m, q m) in SI.

    others: those that fit as well. taken: ids of effects that are laws already. view: what is fed to a navigator is
    calibrated by a filter, and that has to be given the constants. known_effects: known causes that are fitted together
    with it, as --with takes them.
    """
    description, e = law_as_written(law.expression), law.expression
    m, sigma = e.columns.shape[1], np.sqrt(np.maximum(np.diag(covariance), 0.0))
    each = [_parameters(law, description, x[i : i + m], sigma[i : i + m]) for i in range(0, len(x), m)]
    filtered = view is not None and view.added is not None
    effect = _identity(law, taken, view.measurement.law_suffix if view is not None else "")
    stating = {letter for letter, _, _ in description.constants if filtered}
    argument = ",".join([effect, *(f"{r.name}={r.value:.9g}" for r in each[0] if r.name in stating)])
    units = {v.name: v.unit or "as logged" for v in e.variables}
    domain = {v.name: (float(v.printed(v.x.min())), float(v.printed(v.x.max()))) for v in e.variables}
    latex = _latex(description.text, [*units, *(r.name for r in each[0])])
    turning = view is not None and bool(view.measurement.law_suffix)
    text = _class(law, description, each, domain, effect, latex, title, turning)
    table = steps = None
    if _is_table(e):
        (t,), unit = e.terms, PRINTED.get(law.channel, "arcsec")
        knots = np.array(t.constants)
        table = LawTable(tuple(np.asarray(t.variable.printed(knots)).tolist()), (), (), unit)
        steps = from_si(to_si(e.of([replace(t.variable, x=knots)]).columns, each[0][0].unit), unit)
        latex = f"f({_upright(e.terms[0].variable.name)})"
    C = [covariance[i : i + m, i : i + m] for i in range(0, len(x), m)]
    return tuple(
        _with_values(
            LawResult(
                channel=place.channel,
                axis=place.axis,
                variables=tuple(units),
                expression="table",
                form=description.text if table is None else printed_form(law),
                unit=PRINTED.get(place.channel, "arcsec"),
                latex=latex,
                parameters=(),
                domain=domain,
                units=units,
                evidence=round(law.evidence, 2),
                heldout_before=heldout[0],
                heldout_after=heldout[1],
                alternatives=tuple(dict.fromkeys(_other_law_in_print(o, law) for o in others))[:MAX_ALTERNATIVES],
                effect=effect,
                with_=argument,
                known_effects=tuple(known_effects),
                source=text,
                table=table,
                steps=steps,
            ),
            rows,
            own,
        )
        for place, rows, own in zip(law.places, each, C, strict=True)
    )


def as_calibrated(law: LawResult, calibration: Calibration) -> LawResult:
    """Return a law with the coefficients and constants that a calibration estimated together with all else.

    What the calibration does not estimate, as the constants that a filter has to be given, stays as it is; so does one
    sigma of where a law jumps.
    """
    at = {
        p.name: k for k, p in enumerate(calibration.parameters) if p.effect == law.effect and p.axis in ("", law.axis)
    }
    coefficients = [f"{law.effect}_{r.name}" for r in law.parameters]
    places = [
        at.get(name, at.get(f"{law.effect}.{r.name}")) for name, r in zip(coefficients, law.parameters, strict=True)
    ]
    each = calibration.estimates
    rows = tuple(
        r if k is None else replace(r, value=each[k].value, sigma=each[k].sigma or r.sigma)
        for k, r in zip(places, law.parameters, strict=True)
    )
    own = [at[name] for name in coefficients if name in at]
    return _with_values(law, rows, calibration.covariance[np.ix_(own, own)])


def _with_values(law: LawResult, rows: tuple[Estimate, ...], covariance: Array) -> LawResult:
    """Return a law with these coefficients and constants, the coefficients first; covariance (m, m) [SI] of them.

    Of a table the coefficients are the slopes between its knots, and it is zero at the first.
    """
    if law.table is None or law.steps is None:
        expression = _with_numbers(law.form, {r.name: r.value for r in rows})
        return replace(law, parameters=rows, expression=expression)
    C = from_si(from_si(covariance, rows[0].unit), rows[0].unit)
    values = law.steps @ np.array([r.value for r in rows])
    sigma = np.sqrt(np.maximum(np.einsum("km,mn,kn->k", law.steps, C, law.steps), 0.0))
    table = replace(law.table, values=tuple(values.tolist()), sigma=tuple(sigma.tolist()))
    return replace(law, parameters=rows, table=table)


def _parameters(law: Law, description: LawText, x: Array, sigma: Array) -> tuple[Estimate, ...]:
    """Return coefficients x (m,) of one axis and the constants with their sigmas, as they are printed."""
    unit, rows = PRINTED.get(law.channel, "arcsec"), []
    for (name, by), value, spread in zip(description.coefficients, x, sigma, strict=True):
        u = f"{unit}{by}"
        rows.append(Estimate(name, None, float(from_si(value, u)), float(from_si(spread, u)), u))
    spreads = law.spreads()
    for letter, i, j in description.constants:
        t = law.expression.terms[i]
        spread = t.printed(j, spreads[i, j])
        rows.append(Estimate(letter, None, t.printed(j, t.constants[j]), spread, t.unit_of(j) or "1"))
    return tuple(rows)


def _latex(text: str, names: Sequence[str]) -> str:
    import sympy

    symbols = {n: sympy.Symbol(n, real=True) for n in names}
    upright = {s: _upright(n) for n, s in symbols.items() if len(n) > 3}
    return str(sympy.latex(sympy.sympify(text, locals=symbols), symbol_names=upright))


def _upright(name: str) -> str:
    """A variable in LaTeX, by its name."""
    return rf"\mathrm{{{name}}}".replace("_", r"\ ")


def _identity(law: Law, taken: Sequence[str], suffix: str) -> str:
    """An id for the law as an effect that the catalogue does not have yet."""
    axis = f"_{law.axis}" if len(law.places) == 1 else ""
    plain = re.sub(r"\W", "_", f"law_{law.channel}{axis}{suffix}")
    numbered = (f"{plain}_{n}" for n in itertools.count(2))
    return next(i for i in itertools.chain([plain], numbered) if i not in CATALOGUE and i not in taken)


def _class(
    law: Law, description: LawText, each: Sequence[tuple[Estimate, ...]], domain: Mapping[str, tuple[float, float]],
    effect: str, latex: str, title: str, turning: bool,
) -> str:  # fmt: skip
    """Return the law as a class of law.py, with a size for each of its axes.

    turning: whether it was found in turns, from whose rates the level of the rests before and after them is taken off.
    """
    axes, s, of_gimbals = tuple(p.axis for p in law.places), law.places[0].stimulus, law.channel == "gimbal_angle"
    fields = []
    for k, (name, _) in enumerate(description.coefficients):
        size = max(max(abs(rows[k].value), rows[k].sigma) for rows in each)
        fields.append(f'    {name}: Array = parameter({axes!r}, unit="{each[0][k].unit}", '
                      f'sigma={size:.6g}, name="{effect}_{name}")')  # fmt: skip
    spreads = law.spreads()
    for letter, k, j in description.constants:
        t = law.expression.terms[k]
        c, spread, unit = t.constants[j], SIGMAS * spreads[k, j], t.unit_of(j) or "1"
        low, high = c - spread, c + spread
        if t.form.constants[j].kind in ("size", "power"):
            farthest = min(1 + spread / abs(c), FARTHEST)
            low, high = sorted((c / farthest, c * farthest))
        grid = "JUMP" if t.form.key in JUMPS else "FOUND"
        fields.append(f'    {letter}: float = constant({c:.9g}, unit="{unit}", low={low:.9g}, high={high:.9g}, '
                      f'grid=Grid.{grid})')  # fmt: skip
    ends = {name: f"{low:.9g}, {high:.9g}" for name, (low, high) in domain.items()}
    limits = [
        f"        Domain({v.name!r}, {v.unit!r}, {ends[v.name]}, lambda s: {v.code})," for v in law.expression.variables
    ]
    to = f" @ np.array({[[float(a == axis) for a in 'xyz'] for axis in axes]})" if axes != tuple("xyz") else ""
    if of_gimbals:
        to = f" @ np.array([[float(name == axis) for name in s.axis_names] for axis in {axes!r}])"
    methods = CONTRIBUTION.format(**(SINCE_REST if turning else OVER_ALL))
    methods += ADDED.format(form=description.text, code=description.code, to=to)
    return CLASS.format(
        name="".join(w.capitalize() for w in effect.split("_")), title=" ".join(re.findall(r"[\w.,:;+-]+", title)),
        latex=latex, id=effect, variables=", ".join(v.name for v in law.expression.variables),
        stage=STAGE[law.channel].name, channel=law.channel,
        kinds=("pointing",) if s.true_angle is not None else ("multi-position", "static-run", "rotation"),
        needs=tuple(dict.fromkeys(v.needs for v in law.expression.variables if v.needs)), fields="\n".join(fields),
        domain="\n".join(limits), methods=methods,
    )  # fmt: skip


def is_found(path: Path) -> bool:
    """Return whether a file is the law.py of a diagnosis as it was written, not a user's own."""
    try:
        return path.read_bytes().startswith(HEAD.encode())
    except OSError:
        return False


def source_text(laws: Sequence[LawResult]) -> str:
    """The text of law.py."""
    return HEAD + "\n".join(dict.fromkeys(law.source for law in laws))
