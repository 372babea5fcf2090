"""Generate the sentences that a person reads first: of a calibration.json and of a diagnosis.json.

They say what the result is, how large it is and what to do next, for a reader who knows neither the package nor its
files. Each effect states in its own class what it does (`Effect.says`); the sensor and the size are inserted here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import hypot, isnan, sqrt
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Stage
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES, constants
from gimbalcal.report.naming import (
    capitalised,
    counted,
    label_in_words,
    leading,
    listed,
    named,
    sentence,
    spoken,
    typeset,
    unit_in_print,
    unobservable_of,
)
from gimbalcal.report.rounding import CLEAR, distinct_from_zero, pdg, significant
from gimbalcal.units import from_si

if TYPE_CHECKING:
    from gimbalcal.diagnose.answer import Curves

Content = Mapping[str, Any]  # of calibration.json or diagnosis.json, or of one entry of its lists


# --- a calibration ----------------------------------------------------------------------------------------------------

Fit = Literal["fits", "misfit", "overstated", "reserved"]
MIN_P_VALUE = 1e-3  # below it an excess is not attributed to chance
MAX_RELATIVE_EXCESS = 0.1  # of the residual over the noise; less changes no decision, however significant
MIN_EXCESS_SCATTER = 1.5  # of positions over the noise of their means, from which on it is reported


def goodness_of_fit(chi2: float, dof: int) -> tuple[float, float, Fit]:
    """Return the residual in units of the noise, the probability of a chi^2 at least as large, and the judgement."""
    from scipy.special import chdtrc

    if dof <= 0:
        return float("nan"), float("nan"), "fits"
    ratio = sqrt(chi2 / dof)
    p = float(chdtrc(dof, chi2))
    if p < MIN_P_VALUE and ratio > 1 + MAX_RELATIVE_EXCESS:
        return ratio, p, "misfit"
    if p > 1 - MIN_P_VALUE and ratio < 1 - MAX_RELATIVE_EXCESS:
        return ratio, p, "overstated"
    return ratio, p, "fits"


def scaled_to_residual(content: Content) -> bool:
    """Return whether the noise was estimated from the residual itself, so that chi^2 does not test the fit."""
    provenance = content["provenance"]
    noise = provenance.get("noise", {})
    sources = (noise.get("accelerometer_from"), noise.get("gimbal_angle_from"))
    return "residual" in sources or bool(provenance.get("options", {}).get("excess_scatter"))


def noise_is_stated(content: Content) -> bool:
    """Return whether recording.toml states the noise; otherwise it was estimated from the scatter of the samples."""
    noise = content["provenance"].get("noise", {})
    return "samples" not in (noise.get("accelerometer_from"), noise.get("from"))


def calibration_verdict(content: Content) -> Fit:
    """Return what the residuals say of the model."""
    if content["outcome"]:
        return "reserved"
    if content["provenance"].get("pattern"):
        return "misfit"  # systematic residuals are no noise, whatever their size
    return goodness_of_fit(content["residual"]["chi2"], content["residual"]["dof"])[2]


def calibration_in_words(content: Content) -> str:
    """Return a few sentences on a calibration: the fit, the parameters that are not determined, and what to do next."""
    limits = "".join(f" {sentence(text)}" for text in content["provenance"].get("limits", []))
    if content["outcome"]:
        return typeset(sentence(content["outcome"]) + limits)
    residual = f"{capitalised(_residual(content))}.{_outliers(content)}"
    return typeset(f"{residual}{limits} {_determined(content)}{_next_of_calibration(content)}")


def _next_of_calibration(content: Content) -> str:
    """Return what to do with a calibration that fits; one that does not fit names the step with the reason."""
    if calibration_verdict(content) != "fits" or content["residual"]["dof"] <= 0:
        return ""
    total, confounded = len(content["parameters"]), len(_confounded(content))
    if 0 < total < 2 * confounded:
        both = " and calibrate them jointly with this recording" if confounded < total else ""
        return f" Next: record more attitudes{both}; `gimbalcal observe` predicts what each determines."
    return " Next: `gimbalcal apply` corrects recordings with it."


def _confounded(content: Content) -> list[str]:
    """Return the labels of the parameters that the data do not determine one by one."""
    return list(dict.fromkeys(label for u in unobservable_of(content) for label in leading(u["direction"])))


def _determined(content: Content) -> str:
    parameters, confounded = content["parameters"], _confounded(content)
    if not unobservable_of(content):
        return f"All {counted(len(parameters), 'parameter')} are determined."
    more = [f"{len(confounded) - 4} more"] if len(confounded) > 4 else []
    names = listed([*map(label_in_words, confounded[:4]), *more])
    separately = " separately" if len(confounded) > 1 else ""
    return (f"{len(parameters) - len(confounded)} of {len(parameters)} parameters are determined; these data do not "
            f"determine {names}{separately} (the report gives the reason).")  # fmt: skip


def _residual(content: Content) -> str:
    """Return how large the residual is, and what that says of the model and of the noise."""
    ratio, _, judgement = goodness_of_fit(content["residual"]["chi2"], content["residual"]["dof"])
    if isnan(ratio):
        return "there are as many unknowns as data, so the fit cannot be tested: record more positions"
    if scaled_to_residual(content) and judgement == "fits":
        return _scaled(content)
    stated = noise_is_stated(content)
    size = f"{ratio:.2f} times the {'stated noise' if stated else 'noise of the samples'}"
    if judgement == "fits":
        return f"the calibration explains these data: the residuals are {size}"
    if judgement == "overstated":
        reference = "stated" if stated else "the samples suggest"
        return (f"the residuals are {size}: the noise, and with it every sigma, is smaller than {reference}; "
                "state it in [noise]")  # fmt: skip
    noise = "is larger than stated" if stated else "is correlated from sample to sample"
    return (f"the residuals are {size}, more than chance allows: the model is incomplete, or the noise {noise}; "
            "`gimbalcal diagnose` decides which")  # fmt: skip


def _scaled(content: Content) -> str:
    """Return how large the residual is where its scatter is the only estimate of the noise."""
    rms = content["residual"].get("rms", {})
    star, force = (
        sqrt(sum(x**2 for c, x in rms.items() if c.startswith(key))) for key in ("pointing", "specific_force")
    )
    if star:
        size = float(f"{from_si(star, 'arcsec'):.3g}")
        text = f"the residuals of the stars are {size:g} arcsec rms on the sky, and every sigma is scaled to them"
        if pattern := content["provenance"].get("pattern"):
            text += (f"; but they are not noise: the residual {pattern['channel']} follows the "
                     f"{pattern['axis'].replace('_', ' ')}, and `gimbalcal diagnose` looks for the cause")  # fmt: skip
        return text
    size_of_force = ""
    if force:
        ug = float(from_si(force / sqrt(sum(c.startswith("specific_force") for c in rms)), "ug"))
        size_of_force = f" by {ug / 1e3:.3g} mg" if ug >= 1e3 else f" by {ug:.3g} ug"
    excess = content["provenance"].get("options", {}).get("excess_over_noise") or 0.0
    wandering = (f", {excess:.2g} times what the noise of the samples explains: the outputs change from position to "
                 "position") if excess >= MIN_EXCESS_SCATTER else ""  # fmt: skip
    return f"the readings scatter{size_of_force} about the calibration, and every sigma is scaled to that{wandering}"


def _outliers(content: Content) -> str:
    """Return a sentence on stars far from all others; empty for none."""
    stars = content["provenance"].get("far_off", [])
    if not stars:
        return ""
    worst = ", ".join(f"number {s['star']} of “{s['title']}” by {s['arcsec']:.3g} arcsec" for s in stars[:3])
    one = len(stars) == 1
    which = "One star is an outlier" if one else f"{capitalised(counted(len(stars), 'star'))} are outliers"
    why = stars[0].get("why", "mistaken or not centred")
    omit = f"leave {'it' if one else 'them'} out"
    step = omit if why.startswith("mistaken") else "`gimbalcal diagnose` looks for the cause"
    return f" {which}, {worst}: {why}; {step}."


# --- a diagnosis ------------------------------------------------------------------------------------------------------

DIFFERENT_UNITS = ("constants that differ", "terms that differ")  # between recordings of what should be one unit
MAX_FINDINGS = 3  # that a headline names
MAX_ALTERNATIVES = 3  # confounded causes up to which each is named
CONSTANTS = {"tau": "time constant", "period": "period", "order": "order", "teeth": "teeth", "lines": "lines",
             "epoch": "at", "m": "times a turn"}  # fmt: skip
DELAYS = ("time_tag_latency", "gyro_latency", "readout_latency")
GIMBAL_STAGES = (Stage.ENCODER, Stage.AXIS_TILT)


def headline(content: Content, curves: Curves | None = None) -> str:
    """Return two to four sentences on a diagnosis; `curves` give the size of the misfit in the readings."""
    outcome, verdict = content.get("outcome"), content["verdict"]
    if not outcome:
        return _headline(content, curves)
    if verdict == "adequate":
        return (f"No known physics is missing, but these data scatter more than their noise as stated. "
                f"{_sentence(outcome)} Next: state the actual noise in [noise] of recording.toml, or record "
                "again.")  # fmt: skip
    different = [u["shape"].startswith(DIFFERENT_UNITS) for u in content["unexplained"]]
    if verdict == "unexplained" and different and all(different):
        return f"{_sentence(outcome)} Otherwise no known physics is missing."
    both = [_headline(content, curves), _outcome(outcome)]
    first = verdict == "unexplained" or content.get("provenance", {}).get("sessions")
    return " ".join(both[::-1] if first else both)  # a fault of the recording, or that it is of two units, comes first


def _headline(content: Content, curves: Curves | None) -> str:
    verdict, findings = content["verdict"], content["findings"]
    if verdict == "adequate":
        return (
            f"Nothing is missing: the model explains these data{_noise(content['fit'])}. The calibration can be used."
        )
    if verdict == "unexplained":
        return _unexplained(content, curves)
    if verdict == "not-identifiable":
        advice = next((str(f["separate_by"]) for f in findings if f.get("separate_by")), "")
        step = f"{advice[:1].lower()}{advice[1:]}" if advice else "record other positions or conditions."
        return (f"Something is missing, and these data do not determine what. "
                f"{' '.join(_perhaps(f) for f in findings[:MAX_FINDINGS])} Next: {step}")  # fmt: skip
    text = " ".join(_perhaps(f) if _many(f) else f"{does(f)}{_alternatives(f)}" for f in findings[:MAX_FINDINGS])
    if len(findings) > MAX_FINDINGS:
        text += f" {capitalised(counted(len(findings) - MAX_FINDINGS, 'further cause'))} below."
    text += _size_in_readings(curves, content["mismatch"])
    if laws := content.get("laws", ()):
        text += f" A further misfit has no known cause; a formula fits it: {laws_in_words(laws)}."
    elif content["unexplained"]:
        text += " A further misfit has no known cause."
    return f"{text} {_next_of_findings(findings)}"


def _outcome(outcome: str) -> str:
    """Return the reservation of a calibration, without its advice to run a diagnosis: this is one."""
    sentences = re.split(r"(?<=\.) (?=[A-Z])", spoken(outcome))
    return " ".join(_sentence(s) for s in sentences if "`gimbalcal diagnose`" not in s) or _sentence(outcome)


def does(finding: Content) -> str:
    """Return what one finding does, as a sentence with its size."""
    return _sentence(_does(finding))


def _does(f: Content) -> str:
    cls, size = CATALOGUE.get(f["effect"]), size_in_words(f)
    if cls is None or not cls.says:
        return f"{named(f['effect'], f.get('axis') or '')} is present in these data, {size}"
    if f["effect"] in DELAYS:
        return delay_in_words(f)
    if f["effect"] == "position_blunder" and (position := _position(f)):
        return f"position {position} was not set as its readout states, or was disturbed: {size}"
    return cls.says.format(who=who(cls, str(f.get("axis") or "")), size=size)


def delay_in_words(f: Content) -> str:
    """Return which channel is logged how much later or earlier than the others."""
    from gimbalcal.diagnose import wording  # which loads the whole diagnosis

    channel, sense = wording.DELAYS[f["effect"]]
    (p,) = f["parameters"]
    value, sigma = pdg(abs(p["value"]), p["sigma"])
    when = "later" if sense * p["value"] > 0 else "earlier"
    return f"{channel} is logged {value} ± {sigma} {p['unit']} {when} than the other channels"


def who(cls: type[Effect], axis: str) -> str:
    """Return the sensor or axis that an effect belongs to.

    >>> who(CATALOGUE["bias_temperature"], "y"), who(CATALOGUE["gimbal_zero"], "inner")
    ('accelerometer y', 'the inner axis')
    >>> who(CATALOGUE["gyro_bias"], "x, y, z")
    'each gyroscope'
    """
    several = "," in axis
    if cls.stage in GIMBAL_STAGES and several:
        return f"each of the axes {listed([a.strip().replace('_', ' ') for a in axis.split(',')])}"
    if cls.stage in GIMBAL_STAGES or axis in ("inner", "middle", "outer", "platform"):
        return f"the {axis.replace('_', ' ')} axis" if axis else "each axis"
    if cls.stage in GYROSCOPE_STAGES | SENSOR_STAGES:
        sensor = "gyroscope" if cls.stage in GYROSCOPE_STAGES else "accelerometer"
        return f"{sensor} {axis[0]}" if axis and axis[0] in "xyz" and not several else f"each {sensor}"
    return axis.replace("_", " ") or "it"


def size_in_words(f: Content) -> str:
    """Return the sizes of a finding: sine and cosine as one amplitude, the largest two of several, then constants.

    >>> size_in_words({"effect": "bias_temperature", "axis": "y", "parameters": [
    ...     {"name": "b_T", "axis": "y", "value": 14.83, "sigma": 0.34, "unit": "ug/degC"}]})
    '14.83 ± 0.34 µg per °C'
    """
    cls = CATALOGUE.get(f["effect"])
    fixed = {c.name for c in constants(cls)} if cls else set()
    parts = _amplitudes([p for p in f["parameters"] if p["name"].rpartition(".")[2] not in fixed])
    clear = [p for p in parts if distinct_from_zero(p["value"], p["sigma"])]
    if parts and not clear:
        return _at_most(max(parts, key=_bound))
    ranked = sorted(clear, key=lambda p: -abs(p["value"]))
    several = len({p["axis"] for p in parts}) > 1
    sizes = [_one(p) + (f" ({p['axis'].replace('_', ' ')})" if several and p["axis"] else "") for p in ranked[:2]]
    rest = f" and {counted(len(parts) - 2, 'smaller', 'smaller')}" if len(ranked) > 2 else ""
    behind = [(CONSTANTS.get(p["name"].rpartition(".")[2], ""), p) for p in f["parameters"]
              if p["name"].rpartition(".")[2] in fixed - {"position", "span"}]  # fmt: skip
    with_ = "".join(f", {words} {_one(p, counts=True)}" for words, p in behind
                    if words and distinct_from_zero(p["value"], p["sigma"]))  # fmt: skip
    return f"{(', ' if rest else ' and ').join(sizes)}{rest}{with_}" or "of unknown size"


def _bound(p: Content) -> float:
    return float(abs(p["value"]) + CLEAR * p["sigma"])


def _at_most(p: Content) -> str:
    """Return an upper bound, for a size that is not distinct from zero.

    >>> _at_most({"value": -1.2, "sigma": 18.0, "unit": "mg/g^2"})
    'at most 37 mg per g²'
    """
    share = p["unit"] == "1"
    return f"at most {significant(_bound(p) * (100 if share else 1), 2)} {'%' if share else unit_in_words(p['unit'])}"


def _amplitudes(parameters: Sequence[Content]) -> list[dict[str, Any]]:
    """Return the parameters with sine and cosine of one axis combined into their amplitude."""
    out: dict[tuple[str, str], dict[str, Any]] = {}
    for p in parameters:
        new = {"value": p["value"], "sigma": p["sigma"], "unit": p["unit"], "axis": str(p.get("axis") or "")}
        key = (re.sub(r"_?(sin|cos)$", "", p["name"]), new["axis"])
        if key in out:
            a, b = out[key], new
            whole = hypot(a["value"], b["value"])
            spread = hypot(a["value"] * a["sigma"], b["value"] * b["sigma"]) / whole if whole else b["sigma"]
            new = {**new, "value": whole, "sigma": spread}
        out[key] = new
    return list(out.values())


def _one(p: Content, counts: bool = False) -> str:
    """Return value and sigma; a plain number is a share, in per cent, unless it `counts`, as the teeth of a wheel."""
    value, sigma, unit = p["value"], p["sigma"], str(p["unit"])
    if unit == "1":
        value, sigma, unit = (value, sigma, "") if counts else (100 * value, 100 * sigma, "%")
    size = f"{value:.4g}" if sigma <= 0 or not np.isfinite(sigma) else " ± ".join(pdg(value, sigma))
    return f"{size} {unit_in_words(unit)}".strip().replace("-", "−")


def unit_in_words(unit: str) -> str:
    """Return a unit with its quotients in words.

    >>> unit_in_words("ug/degC"), unit_in_words("deg/h/g"), unit_in_words("ppm")
    ('µg per °C', '°/h per g', 'ppm')
    """
    kept = unit.replace("deg/h", "deg|h", 1)
    return unit_in_print(kept.replace("/", " per ").replace("|", "/").replace("(", "").replace(")", ""))


def _position(f: Content) -> int:
    return next((round(p["value"]) for p in f["parameters"] if p["name"].rpartition(".")[2] == "position"), 0)


def _alternatives(f: Content) -> str:
    names = " or ".join(named(t) for t in f["twins"])
    return f" It may equally be {names}: these data do not distinguish them." if names else ""


def _many(f: Content) -> bool:
    return len(f["twins"]) >= MAX_ALTERNATIVES


def _perhaps(f: Content) -> str:
    """Return a finding as one of several causes that fit equally well."""
    names = [named(t) for t in f["twins"]]
    other = f", or the cause is {' or '.join(names)}" if names else ""
    if _many(f):
        other = f", or the cause is one of {counted(len(names), 'other')} that fit these data equally well"
    return f"Possibly {_does(f)}{other}."


def _next_of_findings(findings: Sequence[Content]) -> str:
    late = [f for f in findings if f["effect"] in DELAYS]
    disturbed = [f for f in findings if f["effect"] == "position_blunder"]
    kept = [f for f in findings if f not in late and f not in disturbed]
    steps = ["shift the time stamps by that much"] if late else []
    steps += [f"leave position {_position(f)} out, or record it again" for f in disturbed]
    if kept:
        options = " ".join(f"--with {f['effect']}{':' + f['axis'] if f.get('axis') and ' ' not in f['axis'] else ''}"
                           for f in kept)  # fmt: skip
        which = "it" if len(kept) == 1 else "them"
        steps.append(
            f"use the calibration.json written here, which includes {which}; calibrate later recordings `{options}`"
        )
    return f"Next: {'; '.join(steps)}."


def _unexplained(content: Content, curves: Curves | None) -> str:
    size = _size_in_readings(curves, content["mismatch"])
    if laws := content.get("laws", ()):
        return (f"{_sentence(laws_in_words(laws))} No known effect does that; a formula fits these data.{size} "
                f"{_next_of_laws(content)}")  # fmt: skip
    shape = next(iter(content["unexplained"]), None)
    follows = f" It {_follows(str(shape['shape']))}, in {str(shape['channel']).replace('_', ' ')}." if shape else ""
    usual = "look at the chart below, and record again while that quantity is varied deliberately"
    step = typeset(str(content.get("recommend") or usual).rstrip("."))
    return (f"Something is missing that no known effect explains.{size}{follows} Next: {step}. Do not trust the "
            "calibration beyond that.")  # fmt: skip


def _follows(shape: str) -> str:
    return shape if shape.startswith(("depends", "follows", "is ", "comes", "grows")) else f"looks like {shape}"


def _noise(fit: Content) -> str:
    chi2 = fit.get("chi2_reduced_before")
    if fit.get("rms_before") is not None and "noise" in fit:
        size = f"{significant(float(fit['rms_after']), 3)} {unit_in_print(str(fit['noise']['unit']))}"
        return f", with residuals of {size} rms that show no pattern"
    return f", with residuals of {chi2**0.5:.2f} times the noise" if chi2 else ""


def _size_in_readings(curves: Curves | None, mismatch: Sequence[Content]) -> str:
    """Return how large the misfit is in the readings without what was found; empty where that is not known."""
    if curves is None or curves.sigma is None or not curves.units:
        return ""
    moved = np.nan_to_num(np.abs(curves.before - curves.after) * curves.sigma)
    residual = np.nan_to_num(np.abs(curves.before) * curves.sigma)
    worst = next(((str(m["channel"]), str(m["axis"])) for m in mismatch), None)
    i = curves.channels.index(worst) if worst in curves.channels else int(np.argmax(moved.max(axis=0)))
    size, unit = float(moved[:, i].max()), curves.units[i]
    if not size:
        return f" The readings are off by {_amount(float(np.sqrt((residual[:, i] ** 2).mean())), unit)} rms."
    return f" Without it, readings are off by up to {_amount(size, unit)}."


def _amount(size: float, unit: str) -> str:
    larger = {"ug": ("mg", 1e3, 1e3), "arcsec": ("arcmin", 60.0, 600.0)}  # unit, factor, from which size on
    if unit in larger and size >= larger[unit][2]:
        unit, size = larger[unit][0], size / larger[unit][1]
    return f"{significant(size, 2)} {unit_in_print(unit)}"


def _sentence(text: str) -> str:
    return f"{capitalised(typeset(text.strip().rstrip('.')))}."


# --- a law: a formula that no catalogue holds -------------------------------------------------------------------------

SENSORS = {"specific_force": "accelerometer {}", "angular_rate": "gyroscope {}", "gimbal_angle": "the {} axis"}
POWERS = {"**2": "²", "**3": "³"}


def laws_in_words(laws: Sequence[Content]) -> str:
    """Return which sensor is off by which formula, of all laws one after the other."""
    parts = []
    for law in laws:
        sensor = SENSORS.get(law["channel"], law["channel"] + " {}").format(str(law["axis"]).replace("_", " "))
        parts.append(f"{sensor} is off by {law_in_words(law)}")
    known = list(dict.fromkeys(named(*one.split(":")) for law in laws for one in law.get("beside", ())))
    return "; ".join(parts) + (f", in addition to {listed(known)}, which is known" if known else "")


def _next_of_laws(content: Content) -> str:
    laws = content["laws"]
    options = dict.fromkeys(f"--with {one}" for law in laws for one in (*law.get("beside", ()), law["with"]))
    step = f"Next: calibrate with it, `{' '.join(options)} --effects law.py`, and look for its physical cause."
    return f"{step} {typeset(str(content.get('recommend') or ''))}".rstrip()


def law_in_words(law: Content) -> str:
    """Return the formula of a law with its numbers; terms that are not distinct from zero are omitted.

    >>> law_in_words({"form": "a*force_y*Heaviside(temperature - 23.003) + b*Abs(force_x)**2*exp(-time/tau2)",
    ...     "units": {"force_y": "g", "temperature": "degC", "force_x": "g", "time": "s"}, "parameters": [
    ...     {"name": "a", "value": 20.81, "sigma": 1.0, "unit": "ug/g"},
    ...     {"name": "b", "value": -1.234, "sigma": 0.1, "unit": "ug/g^2"},
    ...     {"name": "tau2", "value": 900.4, "sigma": 9.0, "unit": "s"}]})
    '20.8 µg/g · force y where temperature > 23.00 °C − 1.23 µg/g² · |force x|² · exp(−time/900.4 s)'
    """
    numbers = {p["name"]: p for p in law["parameters"]}
    terms = re.split(r" \+ (?=[a-h]\*)", str(law["form"]))
    fixed = {name: _constant(p) for name, p in numbers.items() if name not in {t[0] for t in terms}}
    clear = [t for t in terms if distinct_from_zero(numbers[t[0]]["value"], numbers[t[0]]["sigma"])] or terms
    out = ""
    for t in clear:
        p = numbers[t[0]]
        sign = ("−" if p["value"] < 0 else "") if not out else " − " if p["value"] < 0 else " + "
        unit = unit_in_print(str(p["unit"]))
        out += f"{sign}{significant(abs(float(p['value'])), 3)} {unit} · {_factors(t[2:], fixed, law['units'])}"
    return out.replace("· where", "where")


def _constant(p: Content) -> str:
    """Return a constant with its unit; an angle without one is in radians."""
    number, unit = significant(float(p["value"]), 4), str(p["unit"])
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
    text = re.sub(r"Abs\(\(?([^()]*)\)?\)", r"|\1|", text)
    for power, sign in POWERS.items():
        text = text.replace(power, sign)
    text = text.replace("*", " · ") + (f" where {' and '.join(where)}" if where else "")
    return re.sub(r"-(?=[\w ])", "−", text.replace("_", " ")).strip()
