"""A formula that no catalogue holds, as a person says it: who is off by what, in which units, and what comes next."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from gimbalcal.report import wording
from gimbalcal.report.rounding import significant, told_from_zero

SENSORS = {"specific_force": "accelerometer {}", "angular_rate": "gyroscope {}", "gimbal_angle": "the {} axis"}
POWERS = {"**2": "²", "**3": "³"}


def fitted(laws: Sequence[Mapping[str, Any]]) -> str:
    """Who is off by which formula, of all laws one after the other."""
    said = []
    for law in laws:
        who = SENSORS.get(law["channel"], law["channel"] + " {}").format(str(law["axis"]).replace("_", " "))
        said.append(f"{who} is off by {in_words(law)}")
    known = dict.fromkeys(wording.named(*one.split(":")) for law in laws for one in law.get("beside", ()))
    return "; ".join(said) + (f", beside {wording.listed(list(known))}, which is known" if known else "")


def next_step(content: Mapping[str, Any]) -> str:
    """What to do with laws that were found, and what would tell them from other formulas."""
    laws = content["laws"]
    asked = dict.fromkeys(f"--with {one}" for law in laws for one in (*law.get("beside", ()), law["with"]))
    more = str(content.get("recommend") or "")
    told = f"Next: calibrate with it, `{' '.join(asked)} --effects law.py`, and look for what is behind it."
    return f"{told} {wording.typeset(more)}".rstrip()


def in_words(law: Mapping[str, Any]) -> str:
    """The formula of a law with its numbers, terms that are clear of nothing alone.

    >>> in_words({"form": "a*force_y*Heaviside(temperature - 23.003) + b*Abs(force_x)**2*exp(-time/tau2)",
    ...     "units": {"force_y": "g", "temperature": "degC", "force_x": "g", "time": "s"}, "parameters": [
    ...     {"name": "a", "value": 20.81, "sigma": 1.0, "unit": "ug/g"},
    ...     {"name": "b", "value": -1.234, "sigma": 0.1, "unit": "ug/g^2"},
    ...     {"name": "tau2", "value": 900.4, "sigma": 9.0, "unit": "s"}]})
    '20.8 µg/g · force y where temperature > 23.00 °C − 1.23 µg/g² · |force x|² · exp(−time/900.4 s)'
    """
    numbers = {p["name"]: p for p in law["parameters"]}
    terms = re.split(r" \+ (?=[a-h]\*)", str(law["form"]))
    constants = {name: _stated(p) for name, p in numbers.items() if name not in {t[0] for t in terms}}
    clear = [t for t in terms if told_from_zero(numbers[t[0]]["value"], numbers[t[0]]["sigma"])] or terms
    out = ""
    for t in clear:
        p = numbers[t[0]]
        sign = ("−" if p["value"] < 0 else "") if not out else " − " if p["value"] < 0 else " + "
        unit = wording.unit_in_print(str(p["unit"]))
        out += f"{sign}{significant(abs(float(p['value'])), 3)} {unit} · {_factors(t[2:], constants, law['units'])}"
    return out.replace("· where", "where")


def _stated(p: Mapping[str, Any]) -> str:
    """A constant with its unit; an angle is in radians, where nothing is said."""
    number, unit = significant(float(p["value"]), 4), str(p["unit"])
    if unit in ("1", "rad", "1/rad"):
        return number
    return f"{number}/{wording.unit_in_print(unit[2:])}" if unit.startswith("1/") else f"{number} {_printed(unit)}"


def _printed(unit: str) -> str:
    return "" if unit in ("rad", "as logged", "") else wording.unit_in_print(unit)


def _factors(text: str, constants: Mapping[str, str], units: Mapping[str, str]) -> str:
    """The factors of a term behind its coefficient, thresholds as conditions behind them."""
    where = []
    for x, sign, limit in re.findall(r"Heaviside\((\w+) ([-+]) ([\w.+-]+)\)", text):
        above = f"{'-' * (sign == '+')}{significant(float(limit), 4)} {_printed(units.get(x, ''))}".rstrip()
        where.append(f"{x} > {above}")
    text = re.sub(r"\*?Heaviside\([^)]*\)", "", text).lstrip("*")
    for name, told in constants.items():
        text = re.sub(rf"(?<![\w.]){name}(?![\w(])", told, text)
    text = re.sub(r"Abs\(\(?([^()]*)\)?\)", r"|\1|", text)
    for power, sign in POWERS.items():
        text = text.replace(power, sign)
    text = text.replace("*", " · ")
    text += f" where {' and '.join(where)}" if where else ""
    return re.sub(r"-(?=[\w ])", "−", text.replace("_", " ")).strip()
