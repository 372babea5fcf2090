"""Generate the sentences on a fleet: results and failures, units outside, trends, and what to do next."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gimbalcal.errors import number_of
from gimbalcal.words.naming import capitalised, list_in_words, name_in_words

if TYPE_CHECKING:
    from gimbalcal.fleet.fleet_summary import FleetSummary

MAX_NAMED = 3  # units and parameters that the answer names


def fleet_in_words(f: FleetSummary) -> str:
    """Return whether all units are calibrated and alike, which are outside or failed, and what to do next."""
    text = f"{number_of(f.recordings, 'recording')} of {number_of(f.units, 'unit')}"
    if not any(r.method or r.verdict for r in f.reports):
        return f"None of {text} has a result: {f.reports[0].failure}. Next: correct them and run the batch again."
    text += f": {f.failed} failed" if f.failed else f" {'is' if f.recordings == 1 else 'are'} calibrated and diagnosed"
    verdicts = [f"{count} {verdict.replace('-', ' ')}" for verdict, count in f.verdicts.items()]
    text += f"; {list_in_words(verdicts)}." if verdicts else "."
    if not f.parameters:
        return f"{text} They are too few for a distribution of the parameters."
    outside = list(dict.fromkeys(o.unit for o in f.outside))
    if outside:
        first = f.outside[0]
        are = "is" if len(outside) == 1 else "are"
        text += (
            f" {list_in_words(outside, MAX_NAMED)} {are} outside the distribution of the others, most clearly "
            f"{name_in_words(first.name, first.axis)} of {first.unit}."
        )
    else:
        text += " No unit is outside the distribution of the others."
    drifting = [name_in_words(p.name, p.axis) for p in f.parameters if p.drifts]
    if drifting:
        text += f" {capitalised(list_in_words(drifting, MAX_NAMED))} changed with the date of the units."
    return text + _next_step(f)


def prior_in_words(f: FleetSummary) -> str:
    """Return what became of a fleet that served as prior; empty where none did."""
    if not f.with_prior:
        return ""
    prior = f"The fleet that was the prior of {number_of(f.with_prior, 'calibration')} is taken out here"
    return f"{prior}: these are the estimates of the units' own data."


def _next_step(f: FleetSummary) -> str:
    """Return what to do about the first thing that is not in order; empty where all is."""
    if f.failed:
        return " Next: correct the recordings that failed and run the same command; the others are not computed again."
    if f.outside:
        return f" Next: look at the report of {f.outside[0].unit}."
    odd = [r for r in f.reports if r.verdict not in ("", "adequate")]
    return f" Next: `gimbalcal diagnose {odd[0].recording}`." if odd else ""
