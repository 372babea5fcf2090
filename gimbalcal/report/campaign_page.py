"""The page of a campaign: the ratio of error to sigma, parameter by parameter."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import sqrt

import numpy as np

from gimbalcal.campaign.campaign_folder import CampaignSummary, ParameterErrors
from gimbalcal.errors import number_of
from gimbalcal.report.chart import Band, Mark, Rule
from gimbalcal.report.figures import dots_by_name
from gimbalcal.report.html import Context, Picture, picture, render
from gimbalcal.report.parameters import in_sigmas
from gimbalcal.units import from_si
from gimbalcal.words import naming
from gimbalcal.words.answers import (
    campaign_answer,
    larger_errors,
    offset_sigmas,
    ratio_interval_by_chance,
    with_estimate,
    with_offset,
)
from gimbalcal.words.rounding import significant


def campaign_report(c: CampaignSummary) -> str:
    """Return the page for the content of a campaign.json."""
    rows = with_estimate(c)
    doubtful = bool(not rows or c.failed or larger_errors(rows) or with_offset(rows))
    identity = c.identity
    context = {
        "title": f"{identity.name}, {number_of(c.runs, 'run')}",
        "answer": campaign_answer(c),
        "verdict": "reserved" if doubtful else "fits",
        "facts": _facts(c, rows),
        "picture": _picture(rows) if rows else None,
        "rows": [*map(_errors_row, rows)],
        "reasons": [(words, number_of(count, "run")) for words, count in c.outcomes.items()],
        "provenance": [
            ("method", str(identity.method)), ("seed", str(identity.seed)), ("kind", str(identity.kind)),
            ("direction", c.direction), ("version", str(identity.version)),
            ("SHA-256 of the scenario", str(identity.scenario)),
        ],
    }  # fmt: skip
    return render("campaign.html", context)


def _facts(c: CampaignSummary, rows: Sequence[ParameterErrors]) -> list[tuple[str, str]]:
    facts = [(str(c.runs), "runs"), (str(c.failed), "with a reservation")]
    if rows:
        middle = sqrt(float(np.mean([r.ratio**2 for r in rows])))
        worst = max(rows, key=lambda r: r.ratio)
        facts.append((f"{middle:.2f}", "RMS error over σ, all parameters"))
        facts.append((f"{worst.ratio:.2f}", f"the largest, {naming.label_in_words(worst.parameter)}"))
    return facts


def _errors_row(r: ParameterErrors) -> Context:
    rms, sigma, unit = _printed_row(r)
    return {
        "words": naming.label_in_words(r.parameter),
        "group": r.parameter.partition(":")[0],
        "mean": in_sigmas(offset_sigmas(r), 1),
        "rms": significant(rms, 3),
        "sigma": significant(sigma, 3),
        "unit": unit,
        "ratio": f"{r.ratio:.2f}",
    }


def _printed_row(r: ParameterErrors) -> tuple[float, float, str]:
    """Return RMS error and sigma in the unit in which the parameter is printed."""
    stated = r.unit != "SI"  # of pulses: no parameter of the catalogue
    unit = r.unit if stated else _units().get(r.parameter.partition(":")[0], "1")
    rms, sigma = (x if stated else float(from_si(x, unit)) for x in (r.rms, r.sigma))
    return rms, sigma, naming.unit_in_print(unit)


@cache
def _units() -> dict[str, str]:
    from gimbalcal.effects import CATALOGUE, parameters

    return {p.label.partition(":")[0]: p.unit for e in CATALOGUE.values() for p in parameters(e, ("inner",))}


def _picture(rows: Sequence[ParameterErrors]) -> Picture:
    """Draw the ratio of every parameter, and its interval by chance."""
    ratio = np.array([r.ratio for r in rows])
    low, high = ratio_interval_by_chance(min(r.runs for r in rows), len(rows))
    ends = np.array([-0.5, len(rows) - 0.5])
    band = Band(np.array([low, high]), ends[[0, 0]], ends[[1, 1]], "grey", "chance")
    marks: list[Mark] = [band, Rule(1.0, "ink", upright=True)]
    odd = ratio > high
    series = {"": np.where(odd, np.nan, ratio)} | (
        {"more than chance": np.where(odd, ratio, np.nan)} if odd.any() else {}
    )
    return picture(
        dots_by_name(
            [naming.label_in_words(r.parameter) for r in rows], series, "RMS error / σ", "times σ", marks, log=False
        ),
        f"Error over sigma of {number_of(len(rows), 'parameter')}, from {ratio.min():.2f} to "
        f"{ratio.max():.2f}; chance gives {low:.2f} to {high:.2f}.",
        "RMS error in units of the σ that each run stated. Right of the band σ is too small, left of it too large, as "
        "where it is partly the prior’s.",
    )
