"""A law that was found, in print and as an effect: its entry in diagnosis.json, and law.py."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gimbalcal.diagnose.answer import PRINTED
from gimbalcal.diagnose.laws.expressions import Expression, Term, whole
from gimbalcal.diagnose.laws.law_search import Law
from gimbalcal.diagnose.result import Estimate, LawResult
from gimbalcal.effects import CATALOGUE
from gimbalcal.number import Array
from gimbalcal.units import from_si
from gimbalcal.views.core import View

TOLD = 6  # alternatives in print
STAGES = {"specific_force": "ACCELEROMETER", "angular_rate": "GYROSCOPE", "gimbal_angle": "ENCODER"}
SIGMAS, FARTHEST = 3.0, 5.0  # of a constant that a fit may look through, and times its value at the most
HEAD = '''"""Laws that no catalogue holds, as `gimbalcal diagnose` found them: any command takes --effects law.py."""

import numpy as np

from gimbalcal.effects.effect import Effect, Stage, Stimulus, constant, effect, parameter
from gimbalcal.effects.history import smoothed_rate
from gimbalcal.number import Array, absolute, cos, exp, sign, sin


def angle(s: Stimulus, name: str) -> Array:
    """Angle (n,) [rad] of a gimbal; zero on a platform without it."""
    return s.angle[:, s.axis_names.index(name)] if name in s.axis_names else 0 * s.time


def above(x: Array, limit: float) -> Array:
    """One where x is above the limit, else zero."""
    return (1 + sign(x - limit)) / 2

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
{fields}

    def contribution(self, s: Stimulus) -> Array:
        """{form}."""
        law = {code}
        return law[..., None] * {to}
'''


LETTERS = "abcdefgh"


@dataclass(frozen=True, eq=False)
class Stated:
    """A law with letters: in print, as code in SI, its coefficients with the unit they divide by, its constants."""

    text: str
    code: str
    coefficients: tuple[tuple[str, str], ...]
    constants: tuple[tuple[str, Term], ...]


def stated(e: Expression) -> Stated:
    """A law as it is written down; whole numbers and thresholds as numbers, what can be fitted as letters."""
    shown, codes, divided, named = [""], [""], "", list[tuple[str, Term]]()
    for i, t in enumerate(e.terms):
        v, letter = t.variable, t.form.constant + (str(i + 1) if len(e.terms) > 1 else "")
        centred = bool(t.form.power and v.origin)
        x = f"({v.name} - {float(v.printed(v.origin)):.6g})" if centred else v.name
        code, constant = f"({v.code} - {v.origin!r})" if centred else v.code, f"self.{letter}"
        if t.form.of == "whole":
            letter = constant = f"{t.constant:.0f}"
        elif t.form.key == "above":
            letter, constant = f"{float(v.printed(t.constant)):.6g}", repr(float(t.constant))
        elif t.form.constant:
            named.append((letter, t))
        words = [w.replace("{c}*", "") if letter == "1" else w for w in t.form.words]
        shown = ["*".join(filter(None, (a, w.format(x=x, c=letter)))) for a in shown for w in words]
        codes = [" * ".join(filter(None, (a, _coded(w, code, constant)))) for a in codes for w in words]
        if t.form.power and v.unit:
            divided += f"/{whole(v.unit)}" + (f"^{t.form.power}" if t.form.power > 1 else "")
    letters = LETTERS[: len(shown)]
    text = " + ".join(f"{a}*{w}" for a, w in zip(letters, shown, strict=True)).replace("- -", "+ ")
    lines = " + ".join(f"self.{a}[0] * {w}" for a, w in zip(letters, codes, strict=True))
    return Stated(text, lines, tuple((a, divided) for a in letters), tuple(named))


def _coded(words: str, x: str, c: str) -> str:
    """A form as Python, arguments in SI."""
    if words.startswith("Heaviside"):
        return f"above({x}, {c})"
    return words.replace("Abs(", "absolute(").format(x=x, c=c)


def printed(law: Law) -> str:
    """The form of a law with letters for its coefficients, constants told."""
    told = stated(law.expression)
    return _with(told.text, {letter: t.printed(t.constant) for letter, t in told.constants})


def _with(text: str, values: Mapping[str, float]) -> str:
    """A formula with numbers in the place of some letters."""
    for name, value in values.items():
        text = re.sub(rf"(?<![\w.]){name}(?![\w(])", f"{value:.6g}", text)
    return text.replace("+ -", "- ").replace("- -", "+ ")


def found(
    law: Law, x: Array, covariance: Array, heldout: tuple[float, float], others: Sequence[Law], title: str,
    number: int = 1, view: View | None = None, beside: Sequence[str] = (),
) -> LawResult:  # fmt: skip
    """A law with its coefficients x (m,) and their covariance (m, m) in SI, and those that fit as well.

    number: which one it is of those of its axis, in a `view`; what is fed to a navigator is calibrated by a filter, and
    that has to be given the constants. beside: known causes that it stands beside, as --with takes them.
    """
    told, e, place = stated(law.expression), law.expression, law.place
    rows = _parameters(law, told, x, covariance)
    filtered = view is not None and view.added is not None
    effect = _identity(law, number, view.measurement.law_suffix if view is not None else "")
    stating = {letter for letter, _ in told.constants if filtered}
    asked = ",".join([effect, *(f"{r.name}={r.value:.9g}" for r in rows if r.name in stating)])
    units = {v.name: v.unit or "as logged" for v in e.variables}
    made = LawResult(
        channel=place.channel,
        axis=place.axis,
        variables=tuple(units),
        expression=_with(told.text, {r.name: r.value for r in rows}),
        form=told.text,
        unit=PRINTED.get(place.channel, "arcsec"),
        latex=_latex(told.text, [*units, *(r.name for r in rows)]),
        parameters=rows,
        domain={v.name: (float(v.printed(v.x.min())), float(v.printed(v.x.max()))) for v in e.variables},
        units=units,
        evidence=round(law.evidence, 2),
        heldout_before=heldout[0],
        heldout_after=heldout[1],
        alternatives=tuple(dict.fromkeys(printed(o) for o in others))[:TOLD],
        effect=effect,
        with_=asked,
        beside=tuple(beside),
    )
    return replace(made, source=_class(law, told, made, title))


def _parameters(law: Law, told: Stated, x: Array, covariance: Array) -> tuple[Estimate, ...]:
    """Coefficients and constants with their sigmas, as they are printed."""
    unit, rows = PRINTED.get(law.place.channel, "arcsec"), []
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    for (name, by), value, spread in zip(told.coefficients, x, sigma, strict=True):
        u = f"{unit}{by}"
        rows.append(Estimate(name, None, float(from_si(value, u)), float(from_si(spread, u)), u))
    for letter, t in told.constants:
        value, spread = t.printed(t.constant), t.printed(law.spread(t))
        rows.append(Estimate(letter, None, value, spread, t.unit_of_constant() or "1"))
    return tuple(rows)


def _latex(text: str, names: Sequence[str]) -> str:
    import sympy

    symbols = {n: sympy.Symbol(n, real=True) for n in names}
    upright = {s: rf"\mathrm{{{n.replace('_', ' ')}}}" for n, s in symbols.items() if len(n) > 3}
    return str(sympy.latex(sympy.sympify(text, locals=symbols), symbol_names=upright))


def _identity(law: Law, number: int, suffix: str) -> str:
    """An id for the law as an effect that the catalogue does not have yet."""
    plain = re.sub(r"\W", "_", f"law_{law.place.channel}_{law.place.axis}{suffix}")
    free = (i for i in (plain, *(f"{plain}_{n}" for n in range(2, 1000))) if i not in CATALOGUE)
    return next(itertools.islice(free, number - 1, None))


def _class(law: Law, told: Stated, made: LawResult, title: str) -> str:
    """The law as a class of law.py."""
    i, axis, s = made.effect, law.place.axis, law.place.stimulus
    per = {r.name: r for r in made.parameters}
    fields = [
        f'    {name}: Array = parameter(({axis!r},), unit="{per[name].unit}", '
        f'sigma={max(abs(per[name].value), per[name].sigma):.6g}, name="{i}_{name}")'
        for name, _ in told.coefficients
    ]
    for letter, t in told.constants:
        c, spread = t.constant, SIGMAS * law.spread(t)
        low, high = max(c - spread, c / FARTHEST), min(c + spread, c * FARTHEST)
        unit = t.unit_of_constant() or "1"
        fields.append(f'    {letter}: float = constant({c:.9g}, unit="{unit}", low={low:.9g}, high={high:.9g})')
    of_gimbal = f"np.array([float(name == {axis!r}) for name in s.axis_names])"
    of_sensor = f"np.array([{', '.join(str(float(a == axis)) for a in 'xyz')}])"
    return CLASS.format(
        name="".join(w.capitalize() for w in i.split("_")), title=" ".join(re.findall(r"[\w.,:;+-]+", title)),
        latex=made.latex, id=i,
        variables=", ".join(made.variables), stage=STAGES[law.place.channel], channel=law.place.channel,
        kinds=("pointing",) if s.true_angle is not None else ("multi-position", "static-run", "rotation"),
        needs=tuple(dict.fromkeys(v.needs for v in law.expression.variables if v.needs)), fields="\n".join(fields),
        form=made.form, code=told.code, to=of_gimbal if law.place.channel == "gimbal_angle" else of_sensor,
    )  # fmt: skip


def is_found(path: Path) -> bool:
    """Return whether a file is the law.py of a diagnosis as it was written, not a user's own."""
    try:
        return path.read_bytes().startswith(HEAD.encode())
    except OSError:
        return False


def source(laws: Sequence[LawResult]) -> str:
    """The text of law.py."""
    return HEAD + "\n".join(law.source for law in laws)
