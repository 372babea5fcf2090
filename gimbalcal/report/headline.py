"""The first sentences of a diagnosis: what it is, how large, what to do next, for somebody who has never seen one.

Each effect says in its own class what it does (`Effect.says`); who does it and how much is put in here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import hypot
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Stage
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES, constants
from gimbalcal.report import law_words, wording
from gimbalcal.report.rounding import CLEAR, pdg, significant, told_from_zero

if TYPE_CHECKING:
    from gimbalcal.diagnose.answer import Curves

APART = ("constants that differ", "terms that differ")  # between recordings of what should be one unit
MOST = 3  # findings that a headline names
NAMED = 3  # causes that fit alike up to which they are named
CONSTANTS = {"tau": "time constant", "period": "period", "order": "order", "teeth": "teeth", "lines": "lines",
             "epoch": "at", "m": "times a turn"}  # fmt: skip
STAMPS = ("time_tag_latency", "gyro_latency", "readout_latency")
GIMBAL_STAGES = (Stage.ENCODER, Stage.AXIS_TILT)

Entry = Mapping[str, Any]


def headline(content: Entry, curves: Curves | None = None) -> str:
    """What a diagnosis.json comes to, in two to four plain sentences; `curves` tell how large it is in the readings."""
    verdict, found = content["verdict"], content["findings"]
    apart = [u["shape"].startswith(APART) for u in content["unexplained"]]
    if content.get("outcome") and verdict == "unexplained" and apart and all(apart):
        return f"{_sentence(content['outcome'])} Otherwise no known physics is missing."
    if content.get("outcome") and verdict != "adequate":  # what else is odd does not unsay what was found
        both = [headline({**content, "outcome": ""}, curves), _beside(content["outcome"])]
        first = verdict == "unexplained" or content.get("provenance", {}).get("sessions")
        return " ".join(both[::-1] if first else both)  # a fault of the recording, or that it is two, comes first
    if content.get("outcome"):
        return (f"No known physics is missing, but these data scatter more than their noise as stated. "
                f"{_sentence(content['outcome'])} Next: state the noise as it is in [noise] of recording.toml, "
                "or record again.")  # fmt: skip
    if verdict == "adequate":
        return (
            f"Nothing is missing: the model explains these data{_noise(content['fit'])}. The calibration can be used."
        )
    if verdict == "unexplained":
        return _unexplained(content, curves)
    said = " ".join(_either([f]) if _nameless(f) else f"{_sentence(_does(f))}{_or(f)}" for f in found[:MOST])
    more = f" {wording.counted(len(found) - MOST, 'further cause').capitalize()} below." if len(found) > MOST else ""
    if verdict == "not-identifiable":
        return f"Something is missing, and these data cannot tell what. {_either(found)} {_apart(found)}"
    rest = " Something more is left that no known effect explains." if content["unexplained"] else ""
    if laws := content.get("laws", ()):
        rest = (
            f" Something more is left that no known effect explains, and a formula fits it: {law_words.fitted(laws)}."
        )
    return f"{said}{more}{_size(curves, content['mismatch'])}{rest} {_next(found)}"


def _beside(outcome: str) -> str:
    """What a calibration says against itself, without what it says of diagnoses: this is one."""
    told = re.split(r"(?<=\.) (?=[A-Z])", wording.spoken(outcome))
    return " ".join(_sentence(s) for s in told if "`gimbalcal diagnose`" not in s) or _sentence(outcome)


def does(finding: Entry) -> str:
    """What one finding is, as a sentence."""
    return _sentence(_does(finding))


def _does(f: Entry) -> str:
    cls = CATALOGUE.get(f["effect"])
    size = size_in_words(f)
    if cls is None or not cls.says:
        return f"{wording.named(f['effect'], str(f.get('axis') or '').replace('_', ' '))} is in these data, {size}"
    if f["effect"] in STAMPS:
        return _late(f)
    if f["effect"] == "position_blunder" and (at := _position(f)):
        return f"position {at} was not set where its readout says, or was disturbed: {size}"
    return cls.says.format(who=who(cls, str(f.get("axis") or "")), size=size)


def _late(f: Entry) -> str:
    """Which channel comes how much later or earlier than what it is logged with."""
    from gimbalcal.diagnose.wording import DELAYS

    channel, sense = DELAYS[f["effect"]]
    (p,) = f["parameters"]
    value, sigma = pdg(abs(p["value"]), p["sigma"])
    when = "later" if sense * p["value"] > 0 else "earlier"
    return f"{channel} is logged {value} ± {sigma} {p['unit']} {when} than what it is logged with"


def who(cls: type[Effect], axis: str) -> str:
    """The sensor or axis that an effect is of.

    >>> who(CATALOGUE["bias_temperature"], "y"), who(CATALOGUE["gimbal_zero"], "inner")
    ('accelerometer y', 'the inner axis')
    >>> who(CATALOGUE["gyro_bias"], "x, y, z")
    'each gyroscope'
    """
    several = "," in axis
    if cls.stage in GIMBAL_STAGES and several:
        return f"each of the axes {wording.listed([a.strip().replace('_', ' ') for a in axis.split(',')])}"
    if cls.stage in GIMBAL_STAGES or axis in ("inner", "middle", "outer", "platform"):
        return f"the {axis.replace('_', ' ')} axis" if axis else "each axis"
    if cls.stage in GYROSCOPE_STAGES | SENSOR_STAGES:
        sensor = "gyroscope" if cls.stage in GYROSCOPE_STAGES else "accelerometer"
        return f"{sensor} {axis[0]}" if axis and axis[0] in "xyz" and not several else f"each {sensor}"
    return axis.replace("_", " ") or "it"


def size_in_words(f: Entry) -> str:
    """The sizes of a finding: a sine and a cosine as one amplitude, the largest two of several, its constants behind.

    >>> size_in_words({"effect": "bias_temperature", "axis": "y", "parameters": [
    ...     {"name": "b_T", "axis": "y", "value": 14.83, "sigma": 0.34, "unit": "ug/degC"}]})
    '14.83 ± 0.34 µg per °C'
    """
    cls = CATALOGUE.get(f["effect"])
    fixed = {c.name for c in constants(cls)} if cls else set()
    linear = [p for p in f["parameters"] if p["name"].rpartition(".")[2] not in fixed]
    behind = [p for p in f["parameters"] if p["name"].rpartition(".")[2] in fixed - {"position", "span"}]
    parts = _amplitudes(linear)
    clear = [p for p in parts if told_from_zero(p["value"], p["sigma"])]
    if parts and not clear:
        return _at_most(max(parts, key=_bound))
    ranked = sorted(clear, key=lambda p: -abs(p["value"]))
    several = len({p["axis"] for p in parts}) > 1
    told = [_one(p) + (f" ({p['axis'].replace('_', ' ')})" if several and p["axis"] else "") for p in ranked[:2]]
    rest = f" and {wording.counted(len(parts) - 2, 'smaller', 'smaller')}" if len(ranked) > 2 else ""
    known = [
        (CONSTANTS.get(p["name"].rpartition(".")[2], ""), p) for p in behind if told_from_zero(p["value"], p["sigma"])
    ]
    with_ = "".join(f", {words} {_one(p, counted=True)}" for words, p in known if words)
    return f"{(', ' if rest else ' and ').join(told)}{rest}{with_}" or "of unknown size"


def _bound(p: Entry) -> float:
    return float(abs(p["value"]) + CLEAR * p["sigma"])


def _at_most(p: Entry) -> str:
    """What a size may be that is not told from zero: "-1 +- 18" is no size.

    >>> _at_most({"value": -1.2, "sigma": 18.0, "unit": "mg/g^2"})
    'at most 37 mg per g²'
    """
    share = p["unit"] == "1"
    return f"at most {significant(_bound(p) * (100 if share else 1), 2)} {'%' if share else unit_in_words(p['unit'])}"


def _amplitudes(parameters: Sequence[Entry]) -> list[dict[str, Any]]:
    """Parameters, where a sine and a cosine of one axis are their amplitude."""
    out: dict[tuple[str, str], dict[str, Any]] = {}
    for p in parameters:
        axis, root = str(p.get("axis") or ""), re.sub(r"_?(sin|cos)$", "", p["name"])
        new = {"value": p["value"], "sigma": p["sigma"], "unit": p["unit"], "axis": axis}
        key = (root if root != p["name"] else p["name"], axis)
        if key in out:
            a, b = out[key], new
            whole = hypot(a["value"], b["value"])
            spread = hypot(a["value"] * a["sigma"], b["value"] * b["sigma"]) / whole if whole else b["sigma"]
            new = {**new, "value": whole, "sigma": spread}
        out[key] = new
    return list(out.values())


def _one(p: Entry, counted: bool = False) -> str:
    """Value and sigma; a plain number is a share, in per cent, unless it is `counted`, as the teeth of a wheel are."""
    value, sigma, unit = p["value"], p["sigma"], str(p["unit"])
    if unit == "1" and counted:
        unit = ""
    elif unit == "1":
        value, sigma, unit = 100 * value, 100 * sigma, "%"
    if sigma <= 0 or not np.isfinite(sigma):
        return f"{value:.4g} {unit_in_words(unit)}".strip().replace("-", "−")
    told, spread = pdg(value, sigma)
    return f"{told} ± {spread} {unit_in_words(unit)}".strip().replace("-", "−")


def unit_in_words(unit: str) -> str:
    """A unit as it is said.

    >>> unit_in_words("ug/degC"), unit_in_words("deg/h/g"), unit_in_words("ppm")
    ('µg per °C', '°/h per g', 'ppm')
    """
    kept = unit.replace("deg/h", "deg|h", 1)
    return wording.unit_in_print(kept.replace("/", " per ").replace("|", "/").replace("(", "").replace(")", ""))


def _position(f: Entry) -> int:
    return next((round(p["value"]) for p in f["parameters"] if p["name"].rpartition(".")[2] == "position"), 0)


def _or(f: Entry) -> str:
    """What these data do not tell from a finding; empty for nothing."""
    names = [wording.named(t) for t in f["twins"]]
    if not names:
        return ""
    return f" It may as well be {' or '.join(names)}: these data fit alike."


def _nameless(f: Entry) -> bool:
    """Whether so many causes fit alike that none of them is named."""
    return len(f["twins"]) >= NAMED


def _either(found: Sequence[Entry]) -> str:
    """Causes that fit alike, as alternatives."""
    each = []
    for f in found[:MOST]:
        names = [wording.named(t) for t in f["twins"]]
        other = f", or it is {' or '.join(names)}" if names else ""
        if _nameless(f):
            other = f", or it is one of {wording.counted(len(names), 'other cause')} that fit these data alike"
        each.append(f"Perhaps {_does(f)}{other}.")
    return " ".join(each)


def _apart(found: Sequence[Entry]) -> str:
    advice = next((str(f["separate_by"]) for f in found if f.get("separate_by")), "")
    return f"Next: {advice[:1].lower()}{advice[1:]}" if advice else "Next: record other positions or conditions."


def _next(found: Sequence[Entry]) -> str:
    late = [f for f in found if f["effect"] in STAMPS]
    once = [f for f in found if f["effect"] == "position_blunder"]
    kept = [f for f in found if f not in late and f not in once]
    steps = ["shift the time stamps by that much"] if late else []
    steps += [f"leave position {_position(f)} out, or record it again" for f in once]
    if kept:
        asked = "`" + " ".join(f"--with {f['effect']}{':' + f['axis'] if _plain(f) else ''}" for f in kept) + "`"
        held = "it" if len(kept) == 1 else "them"
        steps.append(f"use the calibration.json written here, which holds {held}; calibrate later recordings {asked}")
    return f"Next: {'; '.join(steps)}."


def _plain(f: Entry) -> bool:
    return bool(f.get("axis")) and " " not in f["axis"]


def _unexplained(content: Entry, curves: Curves | None) -> str:
    if laws := content.get("laws", ()):
        return (f"{_sentence(law_words.fitted(laws))} No known effect does that: it is a formula that fits these data."
                f"{_size(curves, content['mismatch'])} {law_words.next_step(content)}")  # fmt: skip
    shape = next(iter(content["unexplained"]), None)
    follows = f" It {_follows(str(shape['shape']))}, in {str(shape['channel']).replace('_', ' ')}." if shape else ""
    usual = "look at the picture below, and record again with that quantity varied on purpose"
    recommend = str(content.get("recommend") or usual).rstrip(".")
    return (f"Something is missing that no known effect explains.{_size(curves, content['mismatch'])}{follows} "
            f"Next: {wording.typeset(recommend)}. Do not trust the calibration beyond that.")  # fmt: skip


def _follows(shape: str) -> str:
    return shape if shape.startswith(("depends", "follows", "is ", "comes")) else f"looks like {shape}"


def _noise(fit: Entry) -> str:
    chi2 = fit.get("chi2_reduced_before")
    if fit.get("rms_before") is not None and "noise" in fit:
        told = significant(float(fit["rms_after"]), 3)
        return f", what is left is {told} {wording.unit_in_print(str(fit['noise']['unit']))} rms without a pattern"
    return f", what is left is {chi2**0.5:.2f} times the noise" if chi2 else ""


def _size(curves: Curves | None, mismatch: Sequence[Entry]) -> str:
    """How large it is in the readings of these data after a calibration without it; empty where that is not known."""
    if curves is None or curves.sigma is None or not curves.units:
        return ""
    moved = np.nan_to_num(np.abs(curves.before - curves.after) * curves.sigma)
    left = np.nan_to_num(np.abs(curves.before) * curves.sigma)
    worst = next(((str(m["channel"]), str(m["axis"])) for m in mismatch), None)
    i = curves.channels.index(worst) if worst in curves.channels else int(np.argmax(moved.max(axis=0)))
    size, unit = float(moved[:, i].max()), curves.units[i]
    if not size:
        size = float(np.sqrt((left[:, i] ** 2).mean()))
        return f" The readings are off by {_amount(size, unit)} rms."
    return f" Left out, readings are off by up to {_amount(size, unit)}."


def _amount(size: float, unit: str) -> str:
    larger = {"ug": ("mg", 1e3), "arcsec": ("arcmin", 60.0)}
    if unit in larger and size >= 10 * larger[unit][1] ** (1 if unit == "arcsec" else 0) and size >= larger[unit][1]:
        unit, size = larger[unit][0], size / larger[unit][1]
    return f"{significant(size, 2)} {wording.unit_in_print(unit)}"


def _sentence(text: str) -> str:
    text = wording.typeset(text.strip().rstrip("."))
    return f"{text[:1].upper()}{text[1:]}."
