"""Tables of parameters: of a calibration, and of each of its stages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.calibration import Calibration, Counts, ParameterEstimate, Readout, StageHistory, StageResult
from gimbalcal.calibration.calibration import SENSOR_AXES
from gimbalcal.calibration.readout import from_content
from gimbalcal.earth import HOUR
from gimbalcal.effects import CATALOGUE, Parameter
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.entries import Json
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.report.chart import BLUE, Band, Chart, Line, Rule
from gimbalcal.report.figures import AS_BEFORE, dots_by_name
from gimbalcal.report.html import Context, Picture, picture
from gimbalcal.units import LARGER_OF_SENSOR, from_si, printed_unit, to_si
from gimbalcal.words import naming
from gimbalcal.words.rounding import distinct_from_zero, last_place, pdg_rounded, printed_number, significant

if TYPE_CHECKING:
    from gimbalcal.diagnose.result import Estimate  # which loads the whole diagnosis


def plus_minus(value: float, sigma: float) -> str:
    """Return value ± sigma as printed."""
    return " ± ".join(map(printed_number, pdg_rounded(value, sigma)))


def estimate(name: str, axis: str | None, value: float, sigma: float, unit: str) -> dict[str, str]:
    """Return name, value, sigma and unit of an estimate as printed."""
    printed, spread = pdg_rounded(value, sigma)
    return {"words": naming.name_in_words(name, axis or ""), "value": printed_number(printed), "sigma": spread,
            "unit": naming.unit_in_print(unit)}  # fmt: skip


def estimates(parameters: Sequence[Estimate]) -> list[dict[str, str]]:
    """Return the parameters of a cause as printed, misalignments in the unit in which the largest is printed."""
    largest = max((abs(p.value) for p in parameters if p.name in SENSOR_AXES), default=0.0)
    printed = [
        p.in_unit(printed_unit(largest, p.unit, LARGER_OF_SENSOR)) if p.name in SENSOR_AXES else p for p in parameters
    ]
    return [estimate(p.name, p.axis, p.value, p.sigma, p.unit) for p in printed]


# --- of a calibration -------------------------------------------------------------------------------------------------


def rows(c: Calibration, truth: Mapping[str, float] | None) -> list[Context]:
    """Return the rows by group; `below` opens the parameters that the data do not determine one by one."""
    c, in_null_direction = c.in_printed_units, naming.unobservable_leading(c.null_directions)
    determined = [e for e in c.estimates if e.parameter.label not in in_null_direction]
    others = [e for e in c.estimates if e.parameter.label in in_null_direction]
    nominal = c.readout.accelerometers
    return [
        {**_parameter_row(e, nominal, truth), "unobservable": part is others, "below": part is others and not i}
        for part in (determined, others)
        for i, e in enumerate(part)
    ]


def _parameter_row(e: ParameterEstimate, nominal: Counts | None, truth: Mapping[str, float] | None) -> Context:
    p = e.parameter
    value, sigma, unit = as_printed(p, e.value, e.sigma, nominal)
    moved = (e.value - float(from_si(p.mean, p.unit))) / e.prior_sigma if e.prior_sigma else 0.0
    error = ""
    if truth is not None and p.label in truth and e.sigma > 0:
        error = in_sigmas((e.value - float(from_si(truth[p.label], p.unit))) / e.sigma, 1)
    own = unit == naming.unit_in_print(p.unit)  # else counted from a nominal value that the same data gave
    return {
        "group": p.name,
        "words": naming.name_in_words(p.name, p.axis) + (", as stated" if e.sigma == 0 else ""),
        "means": naming.typeset(e.in_words) if own and distinct_from_zero(e.value, e.sigma) else "",
        "value": value,
        "sigma": sigma,
        "unit": unit,
        "prior": significant(e.prior_sigma, 2) if own else "",
        "moved": moved,
        "moved_text": in_sigmas(moved, 2 if abs(moved) < 1000 else 0) if own else "",
        "error": error,
    }


def in_sigmas(x: float, places: int) -> str:
    """Return a signed number of sigmas as printed; zero has no sign.

    >>> in_sigmas(-1.26, 1), in_sigmas(-0.01, 1)
    ('−1.3 σ', '0.0 σ')
    """
    text = f"{x:+.{places}f}"
    return printed_number(text if text.strip("+-0.") else text[1:]) + " σ"


def as_printed(p: Parameter, value: float, sigma: float, nominal: Counts | None) -> tuple[str, str, str]:
    """Return value, sigma and unit of a parameter as printed, from its value and sigma in its own unit.

    Where readings are counts N of nominal scale k and offset N_0, the model reads k (N - N_0) = f / (1 + s) + b, so
    that f = k (1 + s) (N - N_0 - b / k): then the scale k (1 + s) and the offset N_0 + b / k are printed.
    """
    unit = naming.unit_in_print(p.unit)
    if nominal is not None and p.effect in ("scale_factor", "bias") and p.axis in ("x", "y", "z"):
        k, zero = (x["xyz".index(p.axis)] for x in (nominal.scale, nominal.offset))
        x, dx = float(to_si(value, p.unit)), float(to_si(sigma, p.unit))
        if p.effect == "scale_factor":
            value, sigma, unit = 1e6 * k * (1 + x), 1e6 * abs(k) * dx, "µm/s²/count"
        else:
            value, sigma, unit = zero + x / k, dx / abs(k), "counts"
    printed, spread = pdg_rounded(value, sigma)
    return printed_number(printed), spread, unit


def nominal_in_words(readout: Readout) -> str:
    """Return what the parameters of a unit that outputs counts mean, in sentences; empty for any other."""
    sentences = []
    if readout.accelerometers is not None:
        counts = readout.accelerometers
        scale, offset = (", ".join(f"{v:.7g}" for v in x) for x in (counts.scale, counts.offset))
        sentences.append(
            "The accelerometers output counts: scale factor is the acceleration of one count, bias the count at zero "
            f"acceleration. In calibration.json both are errors of a nominal {scale} m/s² per count from {offset} "
            "counts (x, y, z), which were estimated from this recording, and so are nearly zero there."
        )
    if readout.gyroscopes is not None:
        scale = f"{float(from_si(readout.gyroscopes.scale[0], 'deg/s')):.7g}"
        sentences.append(f"The gyroscopes output counts: their parameters apply to a nominal {scale} °/s per count.")
    return " ".join(sentences)


def common_nominal_in_words(content: Json) -> str:
    """Return what parameters of several calibrations in counts are errors of, from `readout` of a result in JSON."""
    sentences = []
    for quantity, counts in from_content(content).counts.items():
        unit, printed = {FORCE: ("m/s^2", "m/s²"), RATE: ("deg/s", "°/s")}[quantity]
        scale = ", ".join(f"{float(from_si(k, unit)):.7g}" for k in counts.scale)
        offset = ", ".join(f"{n:.7g}" for n in counts.offset)
        sentences.append(
            f"The {'accelerometers' if quantity == FORCE else 'gyroscopes'} output counts: scale factor and bias are "
            f"errors of {scale} {printed} per count from {offset} counts (x, y, z), the median of the calibrations."
        )
    return " ".join(sentences)


# --- of its stages ---------------------------------------------------------------------------------------------------

MAX_SHOWN_SIGMA = 8.0  # of the last, from which on a state is drawn
RATE_RESIDUALS = ("rate-table", "two-position")  # methods whose residuals are rates


def stages(c: Calibration, truth: Mapping[str, float] | None) -> Context:
    """Return tables and a picture of the stages; one that estimates other coefficients has a table of its own."""
    c = c.in_printed_units
    labels = {p.label for p in c.parameters}
    ours = [s for s in c.stages if labels.intersection(s.labels)]
    staged = [p for p in c.parameters if any(p.label in s.labels for s in ours)]
    several = len(ours) > 1
    return {
        "stages": [_stage(s, c) for s in c.stages],
        "stage_names": [_short_name(s.name) for s in ours] if several else [],
        "stage_rows": [_stage_row(p, c, ours, truth) for p in staged],
        "stage_figure": _stage_picture(staged, ours) if several else None,
        "stage_rest": _parameters_outside_stages(p for p in c.parameters if p not in staged) if several else "",
        "coefficients": [_coefficients(s) for s in c.stages if s.labels and s not in ours],
    }


def _parameters_outside_stages(parameters: Iterable[Parameter]) -> str:
    """Return a sentence on the parameters that no stage lists; empty where there are none."""
    names = dict.fromkeys(naming.name_in_words(p.name) for p in parameters)
    return f"Estimated in one step, outside these stages: {naming.list_in_words(list(names))}." if names else ""


def _short_name(name: str) -> str:
    return naming.without_underscores(name).replace("system level: ", "")


def _stage_picture(parameters: Sequence[Parameter], stages: Sequence[StageResult]) -> Picture:
    ratios = {_short_name(s.name): np.array([s.sigma_of(p.label) / p.sigma for p in parameters]) for s in stages}
    return picture(
        dots_by_name([naming.label_in_words(p.label) for p in parameters], ratios,
                     "σ / prior σ (left: better known)", "of its prior σ", [AS_BEFORE]),
        f"Sigma of each parameter after each of {naming.number_and_noun(len(stages), 'stage')}, relative to its prior.",
        "Uncertainty after each stage, relative to the prior.",
    )  # fmt: skip


def _coefficients(s: StageResult) -> Context:
    """Return the combined coefficients that a stage estimates instead of parameters, in microradians."""
    rows = [estimate(name, "", float(from_si(value, "urad")), float(from_si(sigma, "urad")), "urad")
            | {"words": naming.without_underscores(name)}  # phi_0 is also the name of a parameter
            for name, value, sigma in zip(s.labels, s.values, s.sigmas, strict=True)]  # fmt: skip
    return {
        "name": _short_name(s.name),
        "rows": rows,
        "picture": None if s.history is None else _convergence(s, s.history),
    }


def _convergence(s: StageResult, h: StageHistory) -> Picture:
    """Return the estimates of a sequential stage over time, with one sigma about them and their last value."""
    hours = h.time / HOUR
    charts = []
    for i, name in enumerate(s.labels):
        last, sigma = float(from_si(h.values[-1, i], "urad")), from_si(h.sigmas[:, i], "urad")
        x, known = from_si(h.values[:, i], "urad"), sigma < MAX_SHOWN_SIGMA * sigma[-1]
        t, x, sigma = hours[known], np.asarray(x)[known], sigma[known]
        charts.append(Chart(
            (Band(t, x - sigma, x + sigma, BLUE, "one σ"), Line(t, x, BLUE, "estimate"), Rule(last)),
            naming.without_underscores(name), "time [h]", "[µrad]", height=170,
        ))  # fmt: skip
    return picture(
        charts,
        f"The {len(s.labels)} states of the {_short_name(s.name)} over time, with one sigma.",
        f"The states from where their σ is below {MAX_SHOWN_SIGMA:g} times its last value; line: the last estimate.",
    )


def _stage(s: StageResult, c: Calibration) -> dict[str, str]:
    """Return a row of the table of stages; residuals are rates or angles of gyroscopes, or forces."""
    effects = {p.effect for p in c.parameters if p.label in s.labels}
    of_gyroscopes = effects and all(CATALOGUE[e].stage in GYROSCOPE_STAGES for e in effects)
    unit = "deg/h" if c.method in RATE_RESIDUALS else "arcsec" if of_gyroscopes else "ug"
    rms = float(from_si(s.rms, unit))
    text = f"{significant(rms, 3)} {naming.unit_in_print(unit)}" if np.isfinite(rms) else "–"
    return {
        "name": _short_name(s.name),
        "count": str(len(s.labels)),
        "rms": text,
        "in_words": naming.as_sentence(s.in_words),
    }


def _stage_row(
    p: Parameter, c: Calibration, stages: Sequence[StageResult], truth: Mapping[str, float] | None
) -> Context:
    printed, cells = "", []
    for s in stages:
        if p.label in s.labels:
            own, spread = (float(from_si(x, p.unit)) for x in (s.value_of(p.label), s.sigma_of(p.label)))
            value, sigma, printed = as_printed(p, own, spread, c.readout.accelerometers)
            cells.append(f"{value}\u00a0±\u00a0{sigma}")
        else:
            cells.append("–")
    final = float(from_si(c.sigmas[c.parameters.index(p)], p.unit))
    places = max(0, -last_place(final)) if final > 0 else 2
    known = (
        ""
        if truth is None or p.label not in truth
        else printed_number(f"{float(from_si(truth[p.label], p.unit)):.{places}f}")
    )
    return {
        "group": p.name,
        "words": naming.name_in_words(p.name, p.axis),
        "cells": cells,
        "truth": known,
        "unit": printed,
    }
