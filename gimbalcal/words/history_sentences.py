"""Generate the sentences on the history of a unit: whether it changed, which parameters most, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.earth import SOLAR_DAY, YEAR
from gimbalcal.effects import CATALOGUE, Parameter, parameters
from gimbalcal.units import from_si

if TYPE_CHECKING:
    from datetime import datetime

    from gimbalcal.history.compare import UnitComparison
    from gimbalcal.history.fleet import Distribution
    from gimbalcal.history.parameter_history import ParameterHistory
    from gimbalcal.history.unit_store import DatedCalibration


def comparison_in_words(c: UnitComparison) -> str:
    """Return a summary: whether the unit changed, which parameters most, and when to calibrate."""
    n, of = len(c.calibrations), f" of {c.unit}" if c.unit else ""
    ordered = c.calibrations
    first, last = (day_in_words(d.date, ordered) for d in (ordered[0], ordered[-1]))
    start = f"{n} calibrations{of} from {first} to {last}"
    moved = sorted((h for h in c.histories if h.moved), key=lambda h: -h.clear)
    if not moved and not c.significant:
        text = f"{start} agree within their sigmas in all {len(c.histories)} parameters."
    elif not moved:
        worst = min(c.significant, key=lambda s: s.p_value)
        names = [c.calibrations[k].name for k in (worst.before, worst.after)]
        text = (
            f"{start} do not agree: {names[0]} and {names[1]} differ in their parameters together "
            f"(p = {worst.p_value:.2g}), though no single parameter does."
        )
    else:
        more = f", and {len(moved) - 3} more" if len(moved) > 3 else ""
        text = f"{start} do not agree: {'; '.join(_change_sentence(h, c.calibrations) for h in moved[:3])}{more}."
        text += f" Next: {_next_step(moved[0], c.calibrations)}."
    if any(s.same_recording for s in c.steps):
        text += " Some are from the same recording and are not compared with each other."
    if c.gravity:
        text += (
            f" All took the same gravity, good to {1e6 * c.gravity:.3g} ppm: that is in each scale factor, and "
            "not in how they differ."
        )
    text += _dates_in_words(c)
    if c.due is not None:
        text += f" The next calibration is due by {c.due:%Y-%m-%d}."
    return text


def _dates_in_words(c: UnitComparison) -> str:
    """Remark on dates that are not those of the recordings; empty where they do not matter."""
    dated = [d for d in c.calibrations if d.calibration.provenance.recorded]
    write = "write date = 2026-11-18, say, into each recording.toml and calibrate again."
    if dated and len(dated) < len(c.calibrations):
        few = "one of them says" if len(dated) == 1 else f"{len(dated)} of them say"
        return f" Only {few} when it was recorded; others are dated by the day they were computed: {write}"
    one_day = np.ptp([d.date.timestamp() for d in c.calibrations]) < SOLAR_DAY
    if not dated and one_day and len(c.calibrations) > 2:
        return (
            " When they were recorded is not stated, and all were computed within a day: no drift is estimated; "
            f"{write}"
        )
    return ""


def day_in_words(date: datetime, among: Sequence[DatedCalibration]) -> str:
    """Return a date in words, with its time where another calibration is of the same day."""
    alone = sum(d.date.date() == date.date() for d in among) == 1
    return f"{date:%Y-%m-%d}" if alone else f"{date:%Y-%m-%d %H:%M:%S}"


def _change_sentence(c: ParameterHistory, ordered: Sequence[DatedCalibration]) -> str:
    """Describe the change of one parameter."""
    unit, name = c.parameter.unit, _parameter_name(c.parameter)
    days = [day_in_words(ordered[k].date, ordered) for k in c.at]
    when = [f" between {days[k - 1]} and {days[k]}" if len(ordered) > 2 else "" for k in c.jumps]
    parts = [f"jumped by {_size_with_unit(size, unit)}{w}" for size, w in zip(c.sizes, when, strict=False)]
    if c.drifts:
        parts.append(f"drifts by {_size_with_unit((c.rate * YEAR, c.rate_sigma * YEAR), unit)} a year")
    off = c.sizes[len(c.jumps) :]
    parts += [
        f"is off the others by {_size_with_unit(size, unit)} on {days[k]}"
        for k, size in zip(c.outliers, off, strict=True)
    ]
    if not parts:
        size, sigma = (float(from_si(v, unit)) for v in (c.scatter, float(np.median(c.sigma))))
        parts = [f"scatters by {size:.3g} {unit} beyond its sigma of {sigma:.2g}"]
    return f"{name} {' and '.join(parts)}"


def _next_step(c: ParameterHistory, ordered: Sequence[DatedCalibration]) -> str:
    """Return what to do about a parameter that changed."""
    if c.jumps:
        after = day_in_words(ordered[c.at[c.jumps[-1]]].date, ordered)
        return f"use the calibration of {after} and later for what was recorded since, and look for what happened then"
    if c.drifts:
        return "use the last one, as long as it holds"
    if c.outliers:
        return f"look at the report of {day_in_words(ordered[c.at[c.outliers[0]]].date, ordered)}, and leave it out"
    return "count on this scatter from one switching-on to the next, not on the sigmas"


def _size_with_unit(size: tuple[float, float], unit: str) -> str:
    return f"{_signed_rounded(*(float(from_si(v, unit)) for v in size))} {unit}"


def _signed_rounded(size: float, sigma: float) -> str:
    """Return a signed size to the second digit of its sigma.

    >>> _signed_rounded(-11.4412, 0.7032), _signed_rounded(1234.5, 432.1)
    ('-11.44 +- 0.70', '+1234 +- 432')
    """
    places = max(0, 1 - int(np.floor(np.log10(sigma)))) if sigma > 0 else 3
    return f"{size:+.{places}f} +- {sigma:.{places}f}"


def _parameter_name(p: Parameter) -> str:
    """Return the name of a parameter's effect; its own name where the effect has several."""
    several = p.effect not in CATALOGUE or len({q.name for q in parameters(CATALOGUE[p.effect], ("inner",))}) > 1
    return f"{p.name if several else p.effect} {p.axis}".replace("_", " ").strip()


def unusual_unit_in_words(outside: Sequence[tuple[Distribution, float, float]]) -> str:
    """Name the parameters of a unit that are unusual for its fleet; each with its value and sigma [SI]."""
    parts = [
        f"{_parameter_name(d.parameter)} is {_size_with_unit((x, sigma), d.parameter.unit)} and that of {len(d.units)} "
        f"units {_size_with_unit((d.mean, d.sigma), d.parameter.unit)}"
        for d, x, sigma in outside
    ]
    return f"unusual for the fleet, which is no prior of it there: {'; '.join(parts)}"
