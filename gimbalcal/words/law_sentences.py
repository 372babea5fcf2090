"""Generate the sentences on a law: a formula that fits a misfit and that no catalogue holds."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from gimbalcal.words.naming import list_in_words, name_in_words, typeset, unit_in_print, without_underscores
from gimbalcal.words.rounding import distinct_from_zero, printed_number, significant

if TYPE_CHECKING:
    from gimbalcal.diagnose.result import Estimate, LawResult, LawTable

SENSORS = {"specific_force": "accelerometer {}", "angular_rate": "gyroscope {}", "gimbal_angle": "the {} axis"}
POWERS = {"**2": "²", "**3": "³"}
SHOWN_KNOTS = 6  # of a table, in a sentence

SEARCHING = "looking for a formula in what was recorded"
SEARCHING_REPLACEMENT = "comparing what was named with formulas in what was recorded"
CAUSE_UNKNOWN = (
    "The calibration contains a formula whose physical cause is unknown, for the range in which it was found"
)
NOT_CALIBRATED = "The formula is not part of this calibration: {problem}"
REPEAT_POSITIONS = "record the positions again that were not held where the readouts say: a law is sought when they are"
DIAGNOSE_SEPARATELY = (
    "diagnose each recording alone, and look for what was changed between them: a formula cannot describe constants "
    "that differ between recordings"
)
REPEAT_TURNS = (
    "make the same turns again, slower and faster, with whole minutes of rest between them: of what shows only while "
    "the unit turns no formula is sought"
)
LACK_OF_FIT = "log what else varies: the formula that fits best, {law}, leaves a significant residual"
NO_FORMULA = (
    "log what may be behind it ({lacking}), or take further {more} that spread angles, time and temperature "
    "independently of each other: no small formula in what was recorded explains it"
)
DIFFERENT_SIZES = (
    "look for what differed between the recordings: the formula that fits best, {law}, has other sizes in each of them"
)
KNOWN_CAUSE = (
    "take further {more}: {names}, which is known, explains these data as well as the formula that fits best, {law}"
)
SEVERAL_FORMULAS = (
    "take further {more} in which {names} vary independently of each other: several formulas fit alike, {alike}"
)


def kind_of_laws(laws: Sequence[LawResult]) -> str:
    """Return what laws are in print: a table where none of them has a closed form, else a formula."""
    return "a table" if all(law.table is not None for law in laws) else "a formula"


def shape_of_law(law: LawResult) -> str:
    """Return what a law follows, as the shape of a misfit."""
    return f"a function of {list_in_words([without_underscores(v) for v in law.variables])}"


def laws_in_words(laws: Sequence[LawResult]) -> str:
    """Return which sensor is off by which formula, of all laws one after the other."""
    parts = []
    for law in laws:
        sensor = SENSORS.get(law.channel, law.channel + " {}").format(without_underscores(law.axis))
        if law.table is not None:
            (variable, unit), *_ = law.units.items()
            parts.append(f"{sensor} is off by {table_in_words(law.table, without_underscores(variable), unit)}")
        else:
            parts.append(f"{sensor} is off by {law_in_words(law.form, law.parameters, law.units)}")
    known = list(dict.fromkeys(name_in_words(*one.split(":")) for law in laws for one in law.known_effects))
    return "; ".join(parts) + (f", in addition to {list_in_words(known)}, which is known" if known else "")


def next_of_laws(laws: Sequence[LawResult], recommend: str) -> str:
    """Return what to do next with laws: apply them, fit them again, look for the cause, and what the advice says."""
    options = dict.fromkeys(f"--with {one}" for law in laws for one in (*law.known_effects, law.with_))
    step = (
        "Next: correct recordings with the calibration.json written here and `--effects law.py`, fit the formula to "
        f"another recording with `{' '.join(options)} --effects law.py`, and look for its physical cause."
    )
    return f"{step} {typeset(recommend)}".rstrip()


def table_in_words(table: LawTable, variable: str, unit: str) -> str:
    """Return a law without a closed form: what it adds at some knots, evenly chosen where they are many.

    >>> from gimbalcal.diagnose.result import LawTable
    >>> table_in_words(LawTable((-100.0, 0.0, 50.0), (0.0, -3.214, 12.66), (0.0, 0.1, 0.2), "deg/h"), "rate z", "deg/s")
    'a function of rate z without a closed form: 0 °/h at −100 °/s, −3.21 °/h at 0 °/s and 12.7 °/h at 50.0 °/s'
    """
    last, most = len(table.knots) - 1, min(len(table.knots), SHOWN_KNOTS)
    chosen = [round(k * last / (most - 1)) for k in range(most)]
    size, at = unit_in_print(table.unit), _unit_of_variable(unit)
    printed = [[printed_number(significant(x, 3)) for x in (table.values[k], table.knots[k])] for k in chosen]
    each = [f"{value} {size} at {knot} {at}".rstrip() for value, knot in printed]
    return f"a function of {variable} without a closed form: {list_in_words(each)}"


def law_in_words(form: str, parameters: Sequence[Estimate], units: Mapping[str, str]) -> str:
    """Return the formula of a law with its numbers; terms that are not distinct from zero are omitted.

    >>> from gimbalcal.diagnose.result import Estimate
    >>> law_in_words("a*force_y*Heaviside(temperature - 23.003) + b*Abs(force_x)**2*exp(-time/tau2)", [
    ...     Estimate("a", None, 20.81, 1.0, "ug/g"), Estimate("b", None, -1.234, 0.1, "ug/g^2"),
    ...     Estimate("tau2", None, 900.4, 9.0, "s")],
    ...     {"force_y": "g", "temperature": "degC", "force_x": "g", "time": "s"})
    '20.8 µg/g · force y where temperature > 23.00 °C − 1.23 µg/g² · |force x|² · exp(−time/900.4 s)'
    """
    numbers = {p.name: p for p in parameters}
    terms = re.split(r" \+ (?=[a-h]\*)", form)
    fixed = {name: _constant_in_words(p) for name, p in numbers.items() if name not in {t[0] for t in terms}}
    clear = [t for t in terms if distinct_from_zero(numbers[t[0]].value, numbers[t[0]].sigma)] or terms
    out = ""
    for t in clear:
        p = numbers[t[0]]
        sign = ("−" if p.value < 0 else "") if not out else " − " if p.value < 0 else " + "
        out += f"{sign}{significant(abs(p.value), 3)} {unit_in_print(p.unit)} · {_factors(t[2:], fixed, units)}"
    return out.replace("· where", "where")


def _constant_in_words(p: Estimate) -> str:
    """Return a constant with its unit; an angle without one is in radians."""
    number, unit = significant(p.value, 4), p.unit
    if unit in ("1", "rad", "1/rad"):
        return number
    return f"{number}/{unit_in_print(unit[2:])}" if unit.startswith("1/") else f"{number} {_unit_of_variable(unit)}"


def _unit_of_variable(unit: str) -> str:
    return "" if unit in ("rad", "as logged", "") else unit_in_print(unit)


def _factors(text: str, fixed: Mapping[str, str], units: Mapping[str, str]) -> str:
    """Return the factors of a term after its coefficient, with thresholds as conditions after them."""
    where = []
    for x, sign, limit in re.findall(r"Heaviside\((\w+) ([-+]) ([\w.+-]+)\)", text):
        above = f"{'-' * (sign == '+')}{significant(float(limit), 4)} {_unit_of_variable(units.get(x, ''))}".rstrip()
        where.append(f"{x} > {above}")
    text = re.sub(r"\*?Heaviside\([^)]*\)", "", text).lstrip("*")
    for name, value in fixed.items():
        text = re.sub(rf"(?<![\w.]){name}(?![\w(])", value, text)
    text = text.replace("- -", "+ ")
    text = re.sub(r"Abs\(\(?([^()]*)\)?\)", r"|\1|", text)
    for power, sign in POWERS.items():
        text = text.replace(power, sign)
    text = text.replace("*", " · ") + (f" where {' and '.join(where)}" if where else "")
    return re.sub(r"-(?=[\w ])", "−", text.replace("_", " ")).strip()
