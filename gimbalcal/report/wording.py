"""Results in words: the sentence that answers the question, names a person reads, a direction spelled out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from math import isnan, sqrt
from typing import Any, Literal

from gimbalcal.units import from_si

Verdict = Literal["fits", "misfit", "overstated", "reserved"]

SURPRISE = 1e-3  # probability below which chance is not believed
WANDERING = 1.5  # times the noise of a mean; less is no news
NEGLIGIBLE = 0.1  # relative excess over the stated noise that no user would act on, however significant

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def named(name: str, axis: str = "") -> str:
    """A parameter or an effect as a person says it: a parameter by its effect, so that one thing has one name.

    >>> named("gimbal_zero", "inner"), named("K3", "y")
    ('gimbal zero inner', 'cubic nonlinearity y')
    """
    return f"{_names().get(name, name.replace('_', ' '))} {axis}".strip()


@cache
def _names() -> dict[str, str]:
    """What parameters are called: their effect, and their own name behind it where it has several."""
    from gimbalcal.effects import CATALOGUE, parameters

    told: dict[str, str] = {}
    for effect, cls in CATALOGUE.items():
        own = dict.fromkeys(p.name for p in parameters(cls, ("inner",)))
        words = effect.replace("_", " ")
        for name in own:
            told.setdefault(name, words if len(own) == 1 else f"{words}, {name.replace('_', ' ')}")
    return told | {effect: effect.replace("_", " ") for effect in CATALOGUE}


def label_of(row: Mapping[str, Any]) -> str:
    """The label of a row of calibration.json's parameters.

    >>> label_of({"name": "bias", "axis": "x"})
    'bias:x'
    """
    return f"{row['name']}:{row['axis']}" if row["axis"] else str(row["name"])


def label_in_words(label: str) -> str:
    """A label of calibration.json, "bias:x" or "warm_up.tau:x", as a person says it.

    >>> label_in_words("misalignment:xz")
    'misalignment xz'
    """
    name, _, axis = label.partition(":")
    return named(name.replace(".", " "), axis.replace("_", " "))


def unit_in_print(unit: str) -> str:
    """A unit as it is printed.

    >>> unit_in_print("ug/g^2"), unit_in_print("deg/h")
    ('µg/g²', '°/h')
    """
    text = unit.replace("ug", "µg").replace("urad", "µrad").replace("degC", "°C").replace("deg", "°")
    return text.replace("^2", "²").replace("^3", "³").replace("sqrt(h)", "√h")


def counted(n: int, noun: str, plural: str = "") -> str:
    """A number and its noun; numbers up to twelve in words.

    >>> counted(1, "direction"), counted(17, "direction"), counted(2, "axis", "axes")
    ('one direction', '17 directions', 'two axes')
    """
    number = _NUMBERS[n] if 0 <= n < len(_NUMBERS) else str(n)
    return f"{number} {noun if n == 1 else plural or noun + 's'}"


def listed(items: Sequence[str]) -> str:
    """Items in a sentence.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return " and ".join(filter(None, [", ".join(items[:-1]), *items[-1:]]))


def fit(chi2: float, dof: int) -> tuple[float, float, Verdict]:
    """Residual in units of the noise, probability of a chi^2 at least as large, and what that means."""
    from scipy.special import chdtrc

    if dof <= 0:
        return float("nan"), float("nan"), "fits"
    ratio = sqrt(chi2 / dof)
    p = float(chdtrc(dof, chi2))
    if p < SURPRISE and ratio > 1 + NEGLIGIBLE:
        return ratio, p, "misfit"
    if p > 1 - SURPRISE and ratio < 1 - NEGLIGIBLE:
        return ratio, p, "overstated"
    return ratio, p, "fits"


def unobservable_of(content: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Directions among the estimated parameters that the data do not see.

    The other entries of `unobservable` speak of parameters that were held, by convention or for want of data.
    """
    labels = {label_of(p) for p in content["parameters"]}
    return [u for u in content["unobservable"] if labels.issuperset(u["direction"])]


def scaled_to_residual(content: Mapping[str, Any]) -> bool:
    """Whether the noise was estimated from the residual itself, so that chi^2 says nothing about the fit."""
    provenance = content["provenance"]
    noise = provenance.get("noise", {})
    sources = (noise.get("accelerometer_from"), noise.get("gimbal_angle_from"))
    return "residual" in sources or bool(provenance.get("options", {}).get("excess_scatter"))


def noise_is_stated(content: Mapping[str, Any]) -> bool:
    """Whether recording.toml told the noise; else it was taken from how the samples scatter."""
    noise = content["provenance"].get("noise", {})
    return "samples" not in (noise.get("accelerometer_from"), noise.get("from"))


def verdict(content: Mapping[str, Any]) -> Verdict:
    """What the fit says of the model, from the content of calibration.json."""
    if content["outcome"]:
        return "reserved"
    return fit(content["residual"]["chi2"], content["residual"]["dof"])[2]


def answer(content: Mapping[str, Any]) -> str:
    """A few plain sentences from the content of calibration.json: did it work, what is not known, what next."""
    if content["outcome"]:
        return typeset(sentence(content["outcome"])) + _limits(content)
    told = f"{_left(content)}."
    asked = f"{_limits(content)}{_questions(content)}"
    return f"{told[0].upper()}{told[1:]}{_far_off(content)}{asked} {_known(content)}{_next(content)}"


def sentence(words: str) -> str:
    """Words as a sentence.

    >>> sentence("it is so")
    'It is so.'
    """
    return words[:1].upper() + words[1:].rstrip(".") + "."


def _limits(content: Mapping[str, Any]) -> str:
    """What noise and hands did not allow, a sentence each."""
    return "".join(f" {typeset(sentence(text))}" for text in content["provenance"].get("limits", []))


def _questions(content: Mapping[str, Any]) -> str:
    """Sentences on constants that no such unit has; empty for none."""
    return "".join(f" But {typeset(text)}" for text in content["provenance"].get("questions", [])[:3])


def _next(content: Mapping[str, Any]) -> str:
    """What a person does with a calibration that fits; one that does not says so where it says why."""
    doubted = content["provenance"].get("pattern") or content["provenance"].get("questions")
    if doubted or verdict(content) != "fits" or content["residual"]["dof"] <= 0:
        return ""
    return " Next: `gimbalcal apply` corrects recordings with it."


def _known(content: Mapping[str, Any]) -> str:
    """How many of the parameters are known, and which of them only together."""
    every, unobservable = content["parameters"], unobservable_of(content)
    if not unobservable:
        return f"All {counted(len(every), 'parameter')} are known."
    tied = list(dict.fromkeys(label for u in unobservable for label in leading(u["direction"])))
    names = listed([*map(label_in_words, tied[:4]), *([f"{len(tied) - 4} more"] if len(tied) > 4 else [])])
    apart = " from each other" if len(tied) > 1 else ""
    known = f"{len(every) - len(tied)} of {len(every)} parameters are known"
    return f"{known}; these data cannot tell {names}{apart}: the report says why."


def _left(content: Mapping[str, Any]) -> str:
    """What is left of the readings, how large it is, and what that means."""
    ratio, _, meaning = fit(content["residual"]["chi2"], content["residual"]["dof"])
    if isnan(ratio):
        return "there are as many unknowns as data, so nothing is left to test the fit with: more positions would"
    if scaled_to_residual(content) and meaning == "fits":
        return _scaled(content)
    stated = noise_is_stated(content)
    noise = f"{ratio:.2f} times the {'stated noise' if stated else 'noise that the samples show'}"
    if meaning == "fits":
        return f"the calibration explains these data: what is left is {noise}"
    if meaning == "overstated":
        smaller = f"the noise is smaller than {'stated' if stated else 'that'}, and so is every sigma"
        return f"what is left is {noise}: {smaller}; state it in [noise]"
    other = "is larger than stated" if stated else "wanders more than it scatters from sample to sample"
    return (
        f"what is left is {noise}, more than chance allows: the model lacks something, or the noise {other}; "
        "`gimbalcal diagnose` tells which"
    )


def _scaled(content: Mapping[str, Any]) -> str:
    """What is left where nobody stated the noise and it says nothing of the fit."""
    rms = content["residual"].get("rms", {})
    star, force = (
        sqrt(sum(x**2 for c, x in rms.items() if c.startswith(key))) for key in ("pointing", "specific_force")
    )
    if star:
        left = float(f"{from_si(star, 'arcsec'):.3g}")
        told = f"{left:g} arcsec rms of a star on the sky is left, and every sigma is scaled to that"
        return f"{told}{_pattern(content['provenance'].get('pattern', {}))}"
    size = ""
    if force:
        ug = float(from_si(force / sqrt(sum(c.startswith("specific_force") for c in rms)), "ug"))
        size = f" by {ug / 1e3:.3g} mg" if ug >= 1e3 else f" by {ug:.3g} ug"
    return f"the readings scatter{size} about the calibration, and every sigma is scaled to that{_wandering(content)}"


def _wandering(content: Mapping[str, Any]) -> str:
    """How far the scatter of the positions is above the noise of their means, where that is known and worth saying."""
    times = content["provenance"].get("options", {}).get("excess_over_noise") or 0.0
    if times < WANDERING:
        return ""
    return f", {times:.2g} times what the noise of the samples explains: the outputs wander from position to position"


def _pattern(pattern: Mapping[str, Any]) -> str:
    """What is left of stars that is no noise, in words; empty for none."""
    if not pattern:
        return ""
    where = f"{pattern['channel']} it follows the {pattern['axis'].replace('_', ' ')}"
    return f"; but it is no noise: {where}, and `gimbalcal diagnose` looks for the cause"


def _far_off(content: Mapping[str, Any]) -> str:
    """A sentence on stars far off the others; empty for none."""
    stars = content["provenance"].get("far_off", [])
    if not stars:
        return ""
    worst = ", ".join(f"number {s['star']} of “{s['title']}” by {s['arcsec']:.3g} arcsec" for s in stars[:3])
    one = len(stars) == 1
    which = "A star is" if one else f"{counted(len(stars), 'star').capitalize()} are"
    return f" {which} far off the others, {worst}: mistaken or not centred, so leave {'it' if one else 'them'} out."


def leading(direction: Mapping[str, float], least: float = 0.1) -> list[str]:
    """Labels that carry at least this share of the largest weight, the heaviest first."""
    top = max((abs(w) for w in direction.values()), default=0.0)
    ranked = sorted(direction, key=lambda label: -abs(direction[label]))
    return [label for label in ranked if abs(direction[label]) >= least * top and top > 0]


def direction_in_words(direction: Mapping[str, float]) -> str:
    """A combination of parameters as a sum in printed units; its sign, which means nothing, makes the first one plus.

    >>> direction_in_words({"misalignment:xz": 1.0, "gimbal_zero:platform": -1.0, "bias:x": 0.5})
    'misalignment xz − gimbal zero platform + 0.50 bias x'
    """
    text = ""
    ranked = leading(direction, 0.01)
    first = direction[ranked[0]] if ranked else 1.0
    for label in ranked:
        weight = direction[label] * (-1 if first < 0 else 1)
        sign = "−" if weight < 0 else "+"
        factor = "" if abs(abs(weight) - 1) < 0.005 else f"{abs(weight):.2f} "
        text += f" {sign} {factor}{label_in_words(label)}"
    return text.strip().removeprefix("+ ")


def why_in_words(unobservable: Mapping[str, Any]) -> str:
    """The reason of an entry of `unobservable` with labels and effects as a person says them."""
    from gimbalcal.effects import CATALOGUE

    text = str(unobservable["why"])
    for label in sorted(unobservable["direction"], key=len, reverse=True):
        text = text.replace(label, label_in_words(label))
    known = "|".join(sorted(CATALOGUE, key=len, reverse=True))
    return typeset(re.sub(rf"(?<![.\w])({known})(?!\w)", lambda found: named(found[0]), text))


def typeset(text: str) -> str:
    """Powers, arrows, sigmas and micro-g of a plain sentence as they are printed.

    >>> typeset("0.0016 -> 0.0059 m/s^2"), typeset("by +3 +- 0.2 ug")
    ('0.0016 → 0.0059 m/s²', 'by +3 ± 0.2 µg')
    """
    text = (
        text.replace(" +- ", " ± ").replace("^2", "²").replace("^3", "³").replace(" -> ", " → ").replace(" degC", " °C")
    )
    return re.sub(r"\bug\b", "µg", text)


def as_text(value: Any) -> str:
    """A value of provenance as text; empty for nothing.

    >>> as_text({"seed": 1, "names": ["a", "b"], "none": None, "x": 0.123456789})
    'seed 1; names a, b; x 0.123457'
    """
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return "; ".join(f"{str(k).replace('_', ' ')} {text}" for k, v in value.items() if (text := as_text(v)))
    if isinstance(value, (list, tuple)):
        between = " | " if any(isinstance(v, Mapping) for v in value) else ", "
        return between.join(filter(None, map(as_text, value)))
    return str(value)
