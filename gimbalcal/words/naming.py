"""Names, units, lists and directions as they are printed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from gimbalcal.entries import Json
from gimbalcal.words.rounding import significant

if TYPE_CHECKING:
    from gimbalcal.inference.information import Unobservable

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def name_in_words(name: str, axis: str = "") -> str:
    """Return the name of a parameter or an effect in words: a parameter by its effect, so that each has one name.

    >>> name_in_words("gimbal_zero", "inner"), name_in_words("K3", "y")
    ('gimbal zero inner', 'cubic nonlinearity y')
    """
    return (
        f"{_names_by_parameter().get(name, name.replace('_', ' ').replace('.', ', '))} {axis.replace('_', ' ')}".strip()
    )


@cache
def _names_by_parameter() -> dict[str, str]:
    """Return the names of parameters: that of the effect, and their own after it where the effect has several."""
    from gimbalcal.effects import CATALOGUE, parameters

    names: dict[str, str] = {}
    for effect, cls in CATALOGUE.items():
        own = dict.fromkeys(p.name for p in parameters(cls, ("inner",)))
        words = without_underscores(effect)
        for name in own:
            names.setdefault(name, words if len(own) == 1 else f"{words}, {name.replace('_', ' ')}")
    return names | {effect: without_underscores(effect) for effect in CATALOGUE}


def label_of(row: Json) -> str:
    """Return the label of a row of calibration.json's parameters.

    >>> label_of({"name": "bias", "axis": "x"})
    'bias:x'
    """
    return f"{row['name']}:{row['axis']}" if row["axis"] else str(row["name"])


def label_in_words(label: str) -> str:
    """Return a label of calibration.json, "bias:x" or "warm_up.tau:x", in words.

    >>> label_in_words("misalignment:xz")
    'misalignment xz'
    """
    name, _, axis = label.partition(":")
    return name_in_words(name.replace(".", " "), axis)


def unit_in_print(unit: str) -> str:
    """Return a unit as it is printed; a plain number has none.

    >>> unit_in_print("ug/g^2"), unit_in_print("deg/sqrt(h)"), unit_in_print("1")
    ('µg/g²', '°/√h', '')
    """
    if unit == "1":
        return ""
    text = unit.replace("ug", "µg").replace("urad", "µrad").replace("degC", "°C").replace("deg", "°")
    return text.replace("^2", "²").replace("^3", "³").replace("sqrt(h)", "√h").replace("sqrt(Hz)", "√Hz")


def number_and_noun(n: int, noun: str, plural: str = "") -> str:
    """Return a number and its noun; numbers up to twelve in words.

    >>> number_and_noun(1, "direction"), number_and_noun(17, "direction"), number_and_noun(2, "axis", "axes")
    ('one direction', '17 directions', 'two axes')
    """
    number = _NUMBERS[n] if 0 <= n < len(_NUMBERS) else str(n)
    return f"{number} {noun if n == 1 else plural or noun + 's'}"


def list_in_words(items: Sequence[str], most: int = 0) -> str:
    """Return items as a list in a sentence; of more than `most`, if that is given, the first and how many others.

    >>> list_in_words(["a", "b", "c"]), list_in_words(["a", "b", "c", "d"], 2)
    ('a, b and c', 'a, b and 2 more')
    """
    items = [*items[:most], f"{len(items) - most} more"] if 0 < most < len(items) else items
    return " and ".join(filter(None, [", ".join(items[:-1]), *items[-1:]]))


def unobservable_leading(unobservable: Iterable[Unobservable]) -> set[str]:
    """Return the labels that dominate the unobservable directions."""
    return {label for u in unobservable for label in leading_labels(u.direction)}


def sentence(words: str) -> str:
    """Return words as a sentence; a first word with a digit is something to type and keeps its case.

    >>> sentence("it is so"), sentence("wu2018-18 sees it"), sentence("")
    ('It is so.', 'wu2018-18 sees it.', '')
    """
    name = any(c.isdigit() for c in words.partition(" ")[0])
    first = words[:1] if name else words[:1].upper()
    return first + words[1:].rstrip(".") + "." if words else ""


def as_sentence(text: str) -> str:
    """Return a plain sentence as it is printed: typeset, with a capital and a full stop.

    >>> as_sentence("off by 3 ug/g^2")
    'Off by 3 µg/g².'
    """
    return sentence(typeset(text.strip()))


def without_underscores(identifier: str) -> str:
    """Return an identifier with spaces for underscores.

    >>> without_underscores("base_tilt")
    'base tilt'
    """
    return identifier.replace("_", " ")


def as_sentences(in_words: str) -> str:
    """Return the `in_words` of a result as sentences, for the console and the head of the page.

    >>> as_sentences("changing +1 misalignment:xz -1 bias:y by 3 ug^2 does nothing")
    'Changing +1 misalignment xz −1 bias y by 3 µg² does nothing.'
    """
    return "\n".join(as_sentence(labels_in_words(line)) for line in in_words.split("\n"))


def capitalised(text: str) -> str:
    """Return a text with a capital first letter; the rest keeps its case."""
    return text[:1].upper() + text[1:]


def leading_labels(direction: Mapping[str, float], least: float = 0.1) -> list[str]:
    """Return the labels that carry at least this share of the largest weight, the heaviest first."""
    top = max((abs(w) for w in direction.values()), default=0.0)
    ranked = sorted(direction, key=lambda label: -abs(direction[label]))
    return [label for label in ranked if abs(direction[label]) >= least * top and top > 0]


def direction_in_words(direction: Mapping[str, float]) -> str:
    """Return a combination of parameters as a sum in printed units; its sign, which is arbitrary, makes the first plus.

    >>> direction_in_words({"misalignment:xz": 1.0, "gimbal_zero:platform": -1.0, "bias:x": 0.5})
    'misalignment xz − gimbal zero platform + 0.50 bias x'
    """
    text = ""
    ranked = leading_labels(direction, 0.01)
    first = direction[ranked[0]] if ranked else 1.0
    for label in ranked:
        weight = direction[label] * (-1 if first < 0 else 1)
        sign = "−" if weight < 0 else "+"
        factor = "" if abs(abs(weight) - 1) < 0.005 else f"{abs(weight):.2f} "
        text += f" {sign} {factor}{label_in_words(label)}"
    return text.strip().removeprefix("+ ")


def why_in_words(unobservable: Unobservable) -> str:
    """Return the reason of an unobservable direction with labels and effects in words."""
    from gimbalcal.effects import CATALOGUE

    text = unobservable.why
    for label in sorted(unobservable.direction, key=len, reverse=True):
        text = text.replace(label, label_in_words(label))
    known = "|".join(sorted(CATALOGUE, key=len, reverse=True))
    return as_sentence(re.sub(rf"(?<![.\w])({known})(?!\w)", lambda match: name_in_words(match[0]), text))


def directions_in_words(unobservable: Iterable[Unobservable]) -> list[dict[str, str]]:
    """Return unobservable directions as pairs of a combination and its reason, in words."""
    return [{"direction": direction_in_words(u.direction), "why": why_in_words(u)} for u in unobservable]


def labels_in_words(text: str) -> str:
    """Return a text with the labels of parameters in words.

    >>> labels_in_words("changing +1 misalignment:xz -1 K3:y; 10:30 stays")
    'changing +1 misalignment xz -1 cubic nonlinearity y; 10:30 stays'
    """
    labels = r"\b([A-Za-z]\w*):([a-z_]+)\b"
    return re.sub(labels, lambda m: label_in_words(m[0]) if m[1] in _names_by_parameter() else m[0], text)


def typeset(text: str) -> str:
    """Return a plain sentence with powers, arrows, sigmas, signs and units as they are printed.

    >>> typeset("0.0016 -> 0.0059 m/s^2"), typeset("by -3 +- 0.2 ug on 2026-11-22")
    ('0.0016 → 0.0059 m/s²', 'by −3 ± 0.2 µg on 2026-11-22')
    >>> typeset("0.05 deg/sqrt(h) at 40 deg")
    '0.05 °/√h at 40°'
    """
    text = text.replace(" +- ", " ± ").replace(" -> ", " → ")
    text = re.sub(r"(\d) deg\b(?![/\w])", r"\1°", text)
    text = re.sub(r"(?<![\w.=])-(?=\d)", "−", text)
    text = re.sub(r"\b(\d(?:\.\d+)?)e([+-]\d+)\b", _without_power, text)
    units = r"\b(?:ug|urad|degC)\b|\bdeg(?=/)|\^[23]|sqrt\((?:h|Hz)\)"
    return re.sub(units, lambda m: unit_in_print(m[0]), text)


def _without_power(match: re.Match[str]) -> str:
    """Return a number without its power of ten where it needs none."""
    return significant(float(match[0]), sum(c.isdigit() for c in match[1]))


def as_text(value: Any) -> str:
    """Return a value of provenance as text; empty for nothing.

    >>> as_text({"seed": 1, "names": ["a", "b"], "none": None, "x": 0.123456789, "of each": [["a"], ["a", "b"]]})
    'seed 1; names a, b; x 0.123457; of each a | a, b'
    """
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return "; ".join(f"{str(k).replace('_', ' ')} {text}" for k, v in value.items() if (text := as_text(v)))
    if isinstance(value, (list, tuple)):
        between = " | " if any(isinstance(v, (Mapping, list, tuple)) for v in value) else ", "
        return between.join(filter(None, map(as_text, value)))
    return str(value)


def files_behind(provenance: Mapping[str, Any], read: Sequence[Mapping[str, Any]] = ()) -> list[dict[str, str]]:
    """Return path and SHA-256 of the files behind a result: recordings (or those `read`), then files of effects."""
    rows = [{"path": str(f["path"]), "sha256": str(f["sha256"])} for f in provenance.get("recordings") or read]
    defining = ((f"{f['path']}, which defines {', '.join(f['effects'])}", f) for f in provenance.get("effects", ()))
    return rows + [{"path": words, "sha256": str(f["sha256"])} for words, f in defining]


MAX_KINDS = 4  # of parameters that a sentence names


def least_precise_sentence(sigmas: Iterable[tuple[str, float, str]]) -> str:
    """Return a sentence on the least precise parameter of each kind, a space before it; empty for none.

    sigmas: kind, sigma and unit of each parameter.

    >>> least_precise_sentence([("bias", 1.2, "ug"), ("bias", 1.57, "ug"), ("scale_factor", 0.9, "ppm")])
    ' One σ at worst: bias 1.6 µg, scale factor 0.90 ppm.'
    """
    worst: dict[str, tuple[float, str]] = {}
    for kind, sigma, unit in sigmas:
        worst[kind] = max(worst.get(kind, (0.0, unit)), (sigma, unit))
    if not worst:
        return ""
    shown = list(worst.items())[:MAX_KINDS]
    parts = [f"{name_in_words(kind)} {significant(sigma, 2)} {unit_in_print(unit)}" for kind, (sigma, unit) in shown]
    more = f"; {len(worst) - MAX_KINDS} more in the report" if len(worst) > MAX_KINDS else ""
    return f" One σ at worst: {', '.join(parts)}{more}."
