"""Generate the headline of a diagnosis: what is missing, how large it is and what to do next.

It is for a reader who knows neither the package nor its files. Each effect states in its own class what it does
(`Effect.says`); the sensor and the size are inserted here.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from math import hypot
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Stage
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES, constants
from gimbalcal.units import from_si, printed_unit, to_si
from gimbalcal.words.diagnosis_sentences import (
    DELAYS,
    FORCES_NOT_ANALYSED,
    GYROSCOPES_NOT_ANALYSED,
    MAX_ALTERNATIVES,
    MAX_EXCESS_SCATTER,
    NOT_AS_READ,
)
from gimbalcal.words.law_sentences import kind_of_laws, laws_in_words, next_of_laws
from gimbalcal.words.naming import (
    as_sentence,
    capitalised,
    labels_in_words,
    list_in_words,
    name_in_words,
    number_and_noun,
    typeset,
    unit_in_print,
    without_underscores,
)
from gimbalcal.words.rounding import MIN_VALUE_SIGMAS, distinct_from_zero, pdg_rounded, significant

if TYPE_CHECKING:
    from gimbalcal.diagnose.answer import Diagnosis
    from gimbalcal.diagnose.result import Estimate, Finding, FitSummary

# beginnings of shapes that are faults of the recordings: of two units, or with positions that are mis-set
NO_PHYSICS = ("constants that differ", "terms that differ", NOT_AS_READ)
MAX_FINDINGS = 3  # that a headline names
CONSTANTS = {"tau": "time constant", "period": "period", "order": "order", "teeth": "teeth", "lines": "lines",
             "epoch": "at", "m": "times a turn"}  # fmt: skip
GIMBAL_STAGES = (Stage.ENCODER, Stage.AXIS_TILT)


def headline(d: Diagnosis) -> str:
    """Return two to four sentences on a diagnosis; its curves give the size of the misfit in the readings."""
    if not d.outcome:
        return _verdict_headline(d)
    if d.provenance.get("untested"):
        return f"The model is not tested. {as_sentence(d.outcome)} Next: hold the unit in more attitudes."
    if d.verdict == "adequate" and any(f.untested for f in (d.fit.views or {"": d.fit}).values()):
        return f"The model is not tested. {as_sentence(d.outcome)}"
    if d.verdict == "adequate":
        stated = d.provenance.get("noise_stated", True)
        noise = "their noise as stated" if stated else "the noise of their samples explains"
        step = "state the actual noise in [noise] of recording.toml, or record again" if stated else "record again"
        scatter = f"No known physics is missing, but these data scatter more than {noise}."
        return f"{scatter} {as_sentence(d.outcome)} Next: {step}."
    faults = [u.shape.startswith(NO_PHYSICS) for u in d.unexplained]
    if d.verdict == "unexplained" and faults and all(faults):
        return f"{as_sentence(d.outcome)} Otherwise no known physics is missing."
    both = [_verdict_headline(d), _reservation_without_advice(d.outcome)]
    first = d.verdict == "unexplained" or d.provenance.get("sessions")
    return " ".join(both[::-1] if first else both)  # a fault of the recording, or that it is of two units, comes first


def _verdict_headline(d: Diagnosis) -> str:
    if d.verdict == "adequate":
        return _adequate_headline(d)
    if d.verdict == "unexplained":
        return _unexplained_headline(d)
    if d.verdict == "not-identifiable":
        advice = next((f.separate_by for f in d.findings if f.separate_by), "")
        step = f"{advice[:1].lower()}{advice[1:]}" if advice else "record other positions or conditions."
        each = [_as_one_of_several(f) for f in d.findings[:MAX_FINDINGS]]
        return " ".join(["Something is missing, and these data do not determine what.", *each, f"Next: {step}"])
    text = " ".join(
        _as_one_of_several(f) if _has_many_alternatives(f) else f"{finding_sentence(f)}{_alternatives_sentence(f)}"
        for f in d.findings[:MAX_FINDINGS]
    )
    if len(d.findings) > MAX_FINDINGS:
        text += f" {capitalised(number_and_noun(len(d.findings) - MAX_FINDINGS, 'further cause'))} below."
    text += _size_in_readings(d)
    if d.laws:
        text += f" A further misfit has no known cause; a formula fits it: {laws_in_words(d.laws)}."
    elif d.unexplained:
        text += " A further misfit has no known cause."
    return f"{text} {_next_of_findings(d.findings)}"


def _adequate_headline(d: Diagnosis) -> str:
    """Return what an adequate fit shows, of the sensors that were analysed, and an unexplained scatter."""
    for start, analysed in ((GYROSCOPES_NOT_ANALYSED, "accelerometers"), (FORCES_NOT_ANALYSED, "gyroscopes")):
        if omitted := next((n for n in d.provenance.get("notes", ()) if n.startswith(start)), ""):
            fits = f"Nothing is missing in the model of the {analysed}{_residuals_sentence(d.fit)}"
            return f"{fits}, whose calibration can be used. {omitted}"
    if excess := _excess_scatter(d.fit):
        change = f"outputs change from one position to the next: {excess}"
        return f"No known physics is missing, but {change}. The sigmas of the calibration include that scatter."
    return (
        f"Nothing is missing: the model explains these data{_residuals_sentence(d.fit)}. The calibration can be used."
    )


def _excess_scatter(fit: FitSummary) -> str:
    """Return which residuals exceed the standard error from their samples most, and by how much; or ""."""
    ratio, name = max(f.excess_scatter for f in (fit.views or {"": fit}).values())
    if ratio < MAX_EXCESS_SCATTER:
        return ""
    return f"the residuals of the {name} are {ratio:.2g} times the standard error from the scatter of the samples"


def _reservation_without_advice(outcome: str) -> str:
    """Return the reservation of a calibration, without its advice to run a diagnosis: this is one."""
    sentences = re.split(r"(?<=\.) (?=[A-Z])", labels_in_words(outcome))
    return " ".join(as_sentence(s) for s in sentences if "`gimbalcal diagnose`" not in s) or as_sentence(outcome)


def finding_sentence(f: Finding) -> str:
    """Return what one finding does, as a sentence with its size."""
    return as_sentence(_finding_clause(f))


def _finding_clause(f: Finding) -> str:
    cls, size = CATALOGUE[f.effect], size_in_words(f)
    if not cls.says:
        return f"{name_in_words(f.effect, f.axis)} is present in these data, {size}"
    if f.effect in DELAYS:
        channel, sign = DELAYS[f.effect]
        (p,) = f.parameters
        value, sigma = pdg_rounded(abs(p.value), p.sigma)
        when = "later" if sign * p.value > 0 else "earlier"
        return f"{channel} is logged {value} ± {sigma} {p.unit} {when} than the other channels"
    if f.effect == "position_blunder" and (position := _position_number(f)):
        return f"position {position} was not set as its readout states, or was disturbed: {size}"
    return cls.says.format(who=sensor_in_words(cls, f.axis), size=size)


def sensor_in_words(cls: type[Effect], axis: str) -> str:
    """Return the sensor or axis that an effect belongs to.

    >>> sensor_in_words(CATALOGUE["bias_temperature"], "y"), sensor_in_words(CATALOGUE["gimbal_zero"], "inner")
    ('accelerometer y', 'the inner axis')
    >>> sensor_in_words(CATALOGUE["gyro_bias"], "x, y, z")
    'each gyroscope'
    """
    several = "," in axis
    if cls.stage in GIMBAL_STAGES and several:
        return f"each of the axes {list_in_words([without_underscores(a.strip()) for a in axis.split(',')])}"
    if cls.stage in GIMBAL_STAGES or axis in ("inner", "middle", "outer", "platform"):
        return f"the {without_underscores(axis)} axis" if axis else "each axis"
    if cls.stage in GYROSCOPE_STAGES | SENSOR_STAGES:
        sensor = "gyroscope" if cls.stage in GYROSCOPE_STAGES else "accelerometer"
        return f"{sensor} {axis[0]}" if axis and axis[0] in "xyz" and not several else f"each {sensor}"
    return without_underscores(axis) or "it"


def size_in_words(f: Finding) -> str:
    """Return the sizes of a finding: sine and cosine as one amplitude, the largest two of several, then constants.

    >>> from gimbalcal.diagnose.result import Estimate, Finding
    >>> size_in_words(Finding("bias_temperature", "y", 0.9, 44.0, (Estimate("b_T", "y", 14.83, 0.34, "ug/degC"),)))
    '14.83 ± 0.34 µg per °C'
    """
    fixed = {c.name for c in constants(CATALOGUE[f.effect])}
    parts = _combine_amplitudes([p for p in f.parameters if _own_name(p) not in fixed])
    clear = [p for p in parts if distinct_from_zero(p.value, p.sigma)]
    if parts and not clear:
        return _at_most(max(parts, key=_upper_bound))
    ranked = sorted(clear, key=lambda p: -abs(p.value))
    several = len({p.axis for p in parts}) > 1
    sizes = [
        _value_in_words(p) + (f" ({without_underscores(p.axis)})" if several and p.axis else "") for p in ranked[:2]
    ]
    smaller = f" and {number_and_noun(len(parts) - 2, 'smaller', 'smaller')}" if len(ranked) > 2 else ""
    with_constants = "".join(
        f", {CONSTANTS[_own_name(p)]} {_value_in_words(p, counts=True)}"
        for p in f.parameters
        if _own_name(p) in fixed & CONSTANTS.keys() and distinct_from_zero(p.value, p.sigma)
    )
    return f"{(', ' if smaller else ' and ').join(sizes)}{smaller}{with_constants}" or "of unknown size"


def _own_name(p: Estimate) -> str:
    """Return the name of a parameter or constant without that of its effect."""
    return p.name.rpartition(".")[2]


def _upper_bound(p: Estimate) -> float:
    return float(abs(p.value) + MIN_VALUE_SIGMAS * p.sigma)


def _at_most(p: Estimate) -> str:
    """Return an upper bound, for a size that is not distinct from zero.

    >>> from gimbalcal.diagnose.result import Estimate
    >>> _at_most(Estimate("K2", "x", -1.2, 18.0, "mg/g^2"))
    'at most 37 mg per g²'
    """
    share = p.unit == "1"
    return (
        f"at most {significant(_upper_bound(p) * (100 if share else 1), 2)} {'%' if share else unit_in_words(p.unit)}"
    )


def _combine_amplitudes(parameters: Sequence[Estimate]) -> list[Estimate]:
    """Return the parameters with sine and cosine of one axis combined into their amplitude."""
    out: dict[tuple[str, str], Estimate] = {}
    for p in parameters:
        key = (re.sub(r"_?(sin|cos)$", "", p.name), p.axis or "")
        if key in out:
            a = out[key]
            amplitude = hypot(a.value, p.value)
            sigma = hypot(a.value * a.sigma, p.value * p.sigma) / amplitude if amplitude else p.sigma
            out[key] = replace(p, value=amplitude, sigma=sigma)
        else:
            out[key] = p
    return list(out.values())


def _value_in_words(p: Estimate, counts: bool = False) -> str:
    """Return value and sigma; a plain number is a share, in per cent, unless it `counts`, as the teeth of a wheel."""
    value, sigma, unit = p.value, p.sigma, p.unit
    if unit == "1":
        value, sigma, unit = (value, sigma, "") if counts else (100 * value, 100 * sigma, "%")
    size = f"{value:.4g}" if sigma <= 0 or not np.isfinite(sigma) else " ± ".join(pdg_rounded(value, sigma))
    return f"{size} {unit_in_words(unit)}".strip().replace("-", "−")


def unit_in_words(unit: str) -> str:
    """Return a unit with its quotients in words.

    >>> unit_in_words("ug/degC"), unit_in_words("deg/h/g"), unit_in_words("ppm")
    ('µg per °C', '°/h per g', 'ppm')
    """
    plain = unit.replace("deg/h", "deg|h", 1)
    return unit_in_print(plain.replace("/", " per ").replace("|", "/").replace("(", "").replace(")", ""))


def _position_number(f: Finding) -> int:
    return next((round(p.value) for p in f.parameters if _own_name(p) == "position"), 0)


def _alternatives_sentence(f: Finding) -> str:
    names = " or ".join(name_in_words(t) for t in f.twins)
    return f" It may equally be {names}: these data do not distinguish them." if names else ""


def _has_many_alternatives(f: Finding) -> bool:
    """Return whether a finding has more confounded causes than are named one by one."""
    return 1 + len(f.twins) > MAX_ALTERNATIVES


def _as_one_of_several(f: Finding) -> str:
    """Return a finding as one of several causes that fit equally well."""
    names = [name_in_words(t) for t in f.twins]
    other = f", or the cause is {' or '.join(names)}" if names else ""
    if _has_many_alternatives(f):
        other = f", or the cause is one of {number_and_noun(len(names), 'other')} that fit these data equally well"
    return f"Possibly {_finding_clause(f)}{other}."


def _next_of_findings(findings: Sequence[Finding]) -> str:
    late = [f for f in findings if f.effect in DELAYS]
    disturbed = [f for f in findings if f.effect == "position_blunder"]
    added = [f for f in findings if f not in late and f not in disturbed]
    steps = ["shift the time stamps by that much"] if late else []
    steps += [f"leave position {_position_number(f)} out, or record it again" for f in disturbed]
    if added:
        options = " ".join(f"--with {f.effect}{f':{f.axis}' if f.axis and ' ' not in f.axis else ''}" for f in added)
        which = "it" if len(added) == 1 else "them"
        steps.append(
            f"use the calibration.json written here, which includes {which}; calibrate later recordings `{options}`"
        )
    return f"Next: {'; '.join(steps)}."


def _unexplained_headline(d: Diagnosis) -> str:
    size = _size_in_readings(d)
    if d.laws:
        known = f"No known effect does that; {kind_of_laws(d.laws)} fits these data."
        formula = f"{as_sentence(laws_in_words(d.laws))} {known}"
        return f"{formula}{size} {next_of_laws(d.laws, d.recommend)}"
    shape = next(iter(d.unexplained), None)
    follows = f" It {_shape_sentence(shape.shape)}, in {without_underscores(shape.channel)}." if shape else ""
    usual = "look at the chart below, and record again while that quantity is varied deliberately"
    step = f"Next: {typeset((d.recommend or usual).rstrip('.'))}. Do not trust the calibration beyond that."
    return f"Something is missing that no known effect explains.{size}{follows} {step}"


def _shape_sentence(shape: str) -> str:
    return shape if shape.startswith(("depends", "follows", "is ", "comes", "grows")) else f"looks like {shape}"


def _residuals_sentence(fit: FitSummary) -> str:
    """Return how large the residuals of an adequate fit are: in their unit, or relative to the noise that is known."""
    if (misfit := fit.misfit) is not None:
        size = f"{significant(misfit.rms_after, 3)} {unit_in_print(misfit.unit)}"
        return f", with residuals of {size} rms that show no pattern"
    chi2 = fit.chi2_reduced_before
    return f", with residuals of {chi2**0.5:.2f} times the noise" if chi2 else ""


def _size_in_readings(d: Diagnosis) -> str:
    """Return how large the misfit is in the readings without the findings; empty where that is not known."""
    curves = d.curves
    if curves is None or curves.sigma is None or not curves.units:
        return ""
    moved = np.nan_to_num(np.abs(curves.before - curves.after) * curves.sigma)
    residual = np.nan_to_num(np.abs(curves.before) * curves.sigma)
    worst = next(((m.channel, m.axis) for m in d.mismatch), None)
    i = curves.channels.index(worst) if worst in curves.channels else int(np.argmax(moved.max(axis=0)))
    size, unit = float(moved[:, i].max()), curves.units[i]
    if not size:
        return f" The readings are off by {_size_in_print(float(np.sqrt((residual[:, i] ** 2).mean())), unit)} rms."
    return f" Without it, readings are off by up to {_size_in_print(size, unit)}."


def _size_in_print(size: float, unit: str) -> str:
    printed = printed_unit(size, unit)
    return f"{significant(float(from_si(to_si(size, unit), printed)), 2)} {unit_in_print(printed)}"
