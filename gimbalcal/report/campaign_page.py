"""The page of a campaign: the ratio of error to sigma, parameter by parameter."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import isfinite, sqrt

import numpy as np

from gimbalcal.campaign.campaign_folder import CampaignSummary, ParameterErrors
from gimbalcal.errors import amount
from gimbalcal.report.chart import Band, Mark, Rule
from gimbalcal.report.figures import dots_by_name
from gimbalcal.report.html import Context, Picture, picture, render
from gimbalcal.report.parameters import in_sigmas
from gimbalcal.units import from_si
from gimbalcal.words import naming
from gimbalcal.words.rounding import significant

MIN_P_VALUE = 1e-3  # of all parameters jointly; a smaller one is not attributed to chance
MAX_RELATIVE_EXCESS = 0.1  # of errors over sigmas; less changes no decision, however significant
MAX_NAMED = 3  # parameters that a headline names


def headline(c: CampaignSummary) -> str:
    """Return whether errors and sigmas agree, which parameters have an offset, and what to do next."""
    rows = _estimated(c)
    runs = amount(c.runs, "run")
    if not rows:
        return f"{runs} without an estimate: {_reasons(c)}. Next: check the scenario."
    low, high = chance(min(r.runs for r in rows), len(rows))
    ratios = [r.ratio for r in rows]
    large, off = _larger(rows), _off(rows)
    size = f"{min(ratios):.2f} to {max(ratios):.2f} times their σ over {amount(len(rows), 'parameter')}"
    text = f"In {runs} errors are {size}; chance alone gives {low:.2f} to {high:.2f}."
    if large:
        text += f" The errors of {_names(large)} exceed their σ." if len(large) > 1 else (
            f" The error of {_names(large)} exceeds its σ.")  # fmt: skip
    if off:
        text += f" The mean error of {_names(off)} is not zero."
    if c.failed:
        text += f" {amount(c.failed, 'run')} ended with a reservation: {_reasons(c)}."
    if large or off:
        return f"{text} Next: `gimbalcal diagnose` a simulated recording of this scenario."
    small = min(r.runs for r in rows) < 50
    return f"{text} The σ are honest" + (" as far as so few runs show. Next: more of them, -n 200." if small else ".")


def campaign_report(c: CampaignSummary) -> str:
    """Return the page for the content of a campaign.json."""
    rows = _estimated(c)
    doubtful = bool(not rows or c.failed or _larger(rows) or _off(rows))
    identity = c.identity
    context = {
        "title": f"{identity.name}, {amount(c.runs, 'run')}",
        "answer": headline(c),
        "verdict": "reserved" if doubtful else "fits",
        "facts": _facts(c, rows),
        "picture": _picture(rows) if rows else None,
        "rows": [_row(r, before) for r, before in zip(rows, [None, *rows], strict=False)],
        "reasons": [(words, amount(count, "run")) for words, count in c.outcomes.items()],
        "provenance": [
            ("method", str(identity.method)), ("seed", str(identity.seed)), ("kind", str(identity.kind)),
            ("direction", c.direction), ("version", str(identity.version)),
            ("SHA-256 of the scenario", str(identity.scenario)),
        ],
    }  # fmt: skip
    return render("campaign.html", context)


def chance(runs: int, parameters: int) -> tuple[float, float]:
    """Return the interval of the ratio of RMS error to sigma by chance, over all parameters jointly.

    n ratio^2 is chi^2 with n degrees of freedom.

    >>> tuple(round(x, 2) for x in chance(200, 18))
    (0.8, 1.21)
    """
    from scipy.special import chdtri

    tail = MIN_P_VALUE / parameters / 2
    return sqrt(float(chdtri(runs, 1 - tail)) / runs), sqrt(float(chdtri(runs, tail)) / runs)


def _estimated(c: CampaignSummary) -> list[ParameterErrors]:
    return [r for r in c.parameters if isfinite(r.ratio)]


def _larger(rows: Sequence[ParameterErrors]) -> list[ParameterErrors]:
    """Return parameters whose errors exceed their sigmas significantly and by a relevant amount, worst first."""
    over = [r for r in rows if r.ratio > max(chance(r.runs, len(rows))[1], 1 + MAX_RELATIVE_EXCESS)]
    return sorted(over, key=lambda r: -r.ratio)


def _off(rows: Sequence[ParameterErrors]) -> list[ParameterErrors]:
    """Return parameters whose mean error is significant."""
    return [r for r in rows if abs(_offset(r)) > _far(len(rows))]


def _offset(r: ParameterErrors) -> float:
    """Return the mean error in its own sigmas."""
    return r.mean / r.sigma * sqrt(r.runs)


def _far(parameters: int) -> float:
    """Return the sigmas that a mean exceeds by chance in none of so many parameters."""
    from scipy.special import ndtri

    return float(-ndtri(MIN_P_VALUE / parameters / 2))


def _names(rows: Sequence[ParameterErrors]) -> str:
    names = [naming.label_in_words(r.parameter) for r in rows[:MAX_NAMED]]
    more = len(rows) - MAX_NAMED
    return naming.listed([*names, f"{more} more"] if more > 0 else names)


def _reasons(c: CampaignSummary) -> str:
    worst = next(iter(c.outcomes), "")
    return naming.typeset(worst.rstrip(".")) or "no reason is stated"


def _facts(c: CampaignSummary, rows: Sequence[ParameterErrors]) -> list[tuple[str, str]]:
    facts = [(str(c.runs), "runs"), (str(c.failed), "with a reservation")]
    if rows:
        middle = sqrt(float(np.mean([r.ratio**2 for r in rows])))
        worst = max(rows, key=lambda r: r.ratio)
        facts += [(f"{middle:.2f}", "RMS error over σ, all parameters"),
                  (f"{worst.ratio:.2f}", f"the largest, {naming.label_in_words(worst.parameter)}")]  # fmt: skip
    return facts


def _row(r: ParameterErrors, before: ParameterErrors | None) -> Context:
    rms, sigma, unit = _printed(r)
    return {
        "words": naming.label_in_words(r.parameter),
        "first": before is None or before.parameter.partition(":")[0] != r.parameter.partition(":")[0],
        "mean": in_sigmas(_offset(r), 1),
        "rms": significant(rms, 3),
        "sigma": significant(sigma, 3),
        "unit": unit,
        "ratio": f"{r.ratio:.2f}",
    }


def _printed(r: ParameterErrors) -> tuple[float, float, str]:
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
    low, high = chance(min(r.runs for r in rows), len(rows))
    ends = np.array([-0.5, len(rows) - 0.5])
    marks: list[Mark] = [Band(np.array([low, high]), ends[[0, 0]], ends[[1, 1]], "grey", "chance"),
             Rule(1.0, "ink", upright=True)]  # fmt: skip
    odd = ratio > high
    series = {"": np.where(odd, np.nan, ratio)} | (
        {"more than chance": np.where(odd, ratio, np.nan)} if odd.any() else {}
    )
    return picture(
        dots_by_name([naming.label_in_words(r.parameter) for r in rows], series, "RMS error / σ", "times σ", marks,
                     log=False),
        f"Error over sigma of {amount(len(rows), 'parameter')}, from {ratio.min():.2f} to {ratio.max():.2f}; chance "
        f"gives {low:.2f} to {high:.2f}.",
        "RMS error in units of the σ that each run stated. Right of the band σ is too small, left of it too large, as "
        "where it is partly the prior’s.",
    )  # fmt: skip
