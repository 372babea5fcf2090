"""The page of a diagnosis, built from the content of diagnosis.json."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.answer import Curves, Diagnosis
from gimbalcal.diagnose.evidence.odds import UNKNOWN_LAW_SHARE
from gimbalcal.diagnose.result import (
    Finding,
    LawResult,
    Mismatch,
    Shift,
    StatedNoiseFit,
    ViewFit,
)
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.effect import stated_law
from gimbalcal.errors import list_of_alternatives
from gimbalcal.number import Array
from gimbalcal.references import cite
from gimbalcal.report.chart import Chart
from gimbalcal.report.figures import Panel, before_after, formula_over_variable, sky
from gimbalcal.report.formulas import formula
from gimbalcal.report.html import Context, Picture, picture, render
from gimbalcal.report.parameters import estimate, estimates, in_sigmas
from gimbalcal.words import naming
from gimbalcal.words.diagnosis_headline import finding_sentence, headline
from gimbalcal.words.law_sentences import kind_of_laws
from gimbalcal.words.rounding import p_value, printed_number, rms, sensible_time, significant

MAX_PANELS = 6
MIN_P_VALUE = 0.01  # of the residuals; below it they are reported to have a pattern
ARROWS = " On the sky: an arrow from each star to its observed direction, seen from below (east on the left)."
FORMULAS = (
    " The formula (blue line, one σ by its coefficients) is drawn with the formula plus residual of that sensor (dots, "
    "means of neighbouring rows), and formulas that fit as well in grey. Squares are what "
    "it predicts in each part of its range if it is fitted to the other parts."
)
MAX_POINTS = 240  # of a panel; more overlap on a page

MAX_OTHER_PANELS = 2  # of each measurement that does not lead
LOOKS = {"adequate": "fits", "missing-physics": "found", "unexplained": "misfit", "not-identifiable": "misfit"}


def diagnosis_report(d: Diagnosis, title: str = "") -> str:
    """Return the page of a diagnosis; its curves show where the mismatch is and how large."""
    cards = [CATALOGUE[f.effect] for f in d.findings]
    mismatch = [_mismatch(m) for m in d.mismatch]
    context = {
        "title": title or "a recording",
        "answer": headline(d),
        "in_words": naming.typeset(d.in_words),
        "verdict": "reserved" if d.outcome else LOOKS[d.verdict],
        "facts": _facts(d),
        "findings": [_finding_section(f) for f in d.findings],
        "laws": [_law(law) for law in d.laws],
        "picture": _before_after(panels(d.curves, d.mismatch), d.findings, on_the_sky(d.curves), _law_charts(d.laws))
        if d.curves
        else None,
        "others": [
            replace(_before_after(panels(c, d.mismatch, MAX_OTHER_PANELS), d.findings, on_the_sky(c)), caption="")
            for c in d.other_curves
        ],
        "mismatch": mismatch,
        "places": any(m.where for m in d.mismatch),
        "unexplained": [
            {"channel": _channel(u.channel, ""), "shape": naming.as_sentence(u.shape)} for u in d.unexplained
        ],
        "moved": [_shift_row(m) for m in d.fit.calibration_moved],
        "unseen": _detection_limit_rows(d),
        "provenance": _provenance(dict(d.provenance)),
        "sources": naming.files_behind(d.provenance),
        "citations": cite(*dict.fromkeys(key for card in cards for key in card.sources)),
    }
    return render("diagnosis.html", context)


def panels(curves: Curves, mismatch: Sequence[Mismatch], most: int = 0) -> tuple[Panel, ...]:
    """Return panels of the channel with the largest misfit, by position, over time and over its possible causes.

    most: of them, those that the misfit follows most; 0 for all.
    """
    worst = next(((m.channel, m.axis) for m in mismatch), None)
    if worst not in curves.channels:
        worst = curves.channels[int(np.argmax((np.nan_to_num(curves.before) ** 2).sum(axis=0)))]
    i = curves.channels.index(worst)
    name = curves.words[i] if curves.words else _channel(*worst)
    scale = np.ones_like(curves.before) if curves.sigma is None else curves.sigma
    unit = naming.unit_in_print(curves.units[i]) if curves.units else "σ"
    ok = np.isfinite(curves.before[:, i]) & np.isfinite(curves.after[:, i])
    before, after, sigma = (np.asarray(v[ok, i]) for v in (curves.before * scale, curves.after * scale, scale))
    rows = (before, after, sigma)
    time, hours = sensible_time(curves.time[ok] - curves.time[ok].min())
    out = [_panel(name, unit, f"time [{hours}]", _groups_in_order(time), time, rows)]
    numbers = np.unique(position := curves.position[ok])
    if 1 < numbers.size <= MAX_POINTS:
        at = [np.flatnonzero(position == number) for number in numbers]
        place = "star" if worst[0] == "pointing" else "position"
        named = tuple(f"{place} {int(number)}" for number in numbers)
        out.insert(0, replace(_panel(name, unit, place, at, position.astype(float), rows), names=named))
    for label, x in curves.against.items():
        out.append(_panel(name, unit, label, _groups_in_order(x[ok]), x[ok], rows))
    return tuple(sorted(out, key=_share_explained, reverse=True)[:most] if most else out)


def _groups_in_order(x: Array) -> list[Array]:
    """Return groups of rows in order of x, no more than `MAX_POINTS` of them."""
    return [g for g in np.array_split(np.argsort(x, kind="stable"), min(x.size, MAX_POINTS)) if g.size]


def _panel(
    name: str, unit: str, x_label: str, groups: Sequence[Array], x: Array, rows: tuple[Array, Array, Array]
) -> Panel:
    """Return means of groups of rows as points, with their sigma from noise that is independent from row to row."""
    before, after, sigma = rows
    first, second, at = (np.array([v[g].mean() for g in groups]) for v in (before, after, x))
    spread = np.array([np.sqrt((sigma[g] ** 2).mean() / g.size) for g in groups])
    return Panel(name, unit, at, x_label, first, second, spread)


def _shift_row(m: Shift) -> dict[str, str]:
    """Return the change of one calibration parameter by the findings."""
    return {**estimate(m.name, m.axis, m.moved, m.sigma, m.unit), "text": in_sigmas(m.in_sigmas, 1)}


def _law(law: LawResult) -> Context:
    """Return a formula that no catalogue holds: as it is written, its parameters, and the domain of the data."""
    units = {v: naming.unit_in_print(unit) for v, unit in law.units.items()}
    ranges = ((v, *(significant(end, 3) for end in ends)) for v, ends in law.domain.items())
    domain = (f"{naming.without_underscores(v)} from {low} to {high} {units[v]}" for v, low, high in ranges)
    return {
        "where": naming.without_underscores(f"{law.channel} {law.axis}"),
        "equation": formula(law.latex), "form": law.form, "domain": printed_number("; ".join(domain)),
        "rows": _law_rows(law),
        "alternatives": "; ".join(law.alternatives), "with": " --with ".join([*law.known_effects, law.with_]),
        "known_effects": naming.list_in_words([naming.name_in_words(*one.split(":")) for one in law.known_effects]),
    }  # fmt: skip


def _law_rows(law: LawResult) -> list[dict[str, str]]:
    """Return the numbers of a formula by their letters, or what a table adds at its knots."""
    if law.table is None:
        return [{**row, "words": p.name} for row, p in zip(estimates(law.parameters), law.parameters, strict=True)]
    (variable, unit), *_ = law.units.items()
    at = [f"{naming.without_underscores(variable)} = {printed_number(significant(x, 4))} {naming.unit_in_print(unit)}"
          for x in law.table.knots]  # fmt: skip
    each = zip(at, law.table.values, law.table.sigma, strict=True)
    return [{**estimate("", None, value, sigma, law.table.unit), "words": words} for words, value, sigma in each]


def _law_charts(laws: Sequence[LawResult]) -> list[Chart]:
    """Return each formula over its variable, with what the recording shows there."""
    return [
        formula_over_variable(
            replace(law.curve, x_label=naming.unit_in_print(law.curve.x_label)),
            f"formula for {naming.without_underscores(f'{law.channel} {law.axis}')}", naming.unit_in_print(law.unit),
        )
        for law in laws if law.curve is not None
    ]  # fmt: skip


def _facts(d: Diagnosis) -> list[tuple[str, str]]:
    """Return the residual before and after, in units of the noise or in its own, and whether it has a pattern."""
    fit = d.fit
    reserved = ", with a reservation" if d.outcome else ""
    facts = [(d.verdict.replace("-", " ") + reserved, "verdict")]
    if d.laws and not d.findings:
        facts = [(f"{kind_of_laws(d.laws)} fits{reserved}", "verdict: not explained by a known effect")]
    if isinstance(fit, ViewFit):  # the noise was estimated from the residual, so chi^2 does not test the fit
        unit = f" {naming.unit_in_print(fit.noise.unit)}"
        sizes = [(fit.rms_before, fit.rms_after), (fit.heldout_rms_before, fit.heldout_rms_after)]
    else:
        unit, pairs = (
            " × noise",
            [(fit.chi2_reduced_before, fit.chi2_reduced_after), (fit.heldout_before, fit.heldout_after)],
        )
        sizes = [(max(before, 0.0) ** 0.5, max(after, 0.0) ** 0.5) for before, after in pairs]
    for (before, after), what in zip(sizes, ("misfit", "misfit of held-out readings"), strict=True):
        if d.findings or d.laws:
            facts.append((f"{significant(before, 3)} → {significant(after, 3)}{unit}", f"{what}, before → after"))
        else:
            facts.append((f"{significant(before, 3)}{unit}", what))
    if isinstance(fit, StatedNoiseFit):
        pattern = "no pattern" if fit.scan_p_after >= MIN_P_VALUE else "a pattern"
        facts.append((f"{pattern} in the residuals", f"p-value {p_value(fit.scan_p_after)}"))
    return facts


PROVENANCE = {
    "ln_bayes_factor": "ln Bayes factor, findings against none",
    "ln_bayes_factor_needed": "ln Bayes factor required",
    "false_alarm_rate_simulated": "false alarms of this design, simulated",
    "probability_unknown": "probability of a cause outside the catalogue",
    "causes_compared": "causes compared",
    "excess_kurtosis": "excess kurtosis of the residuals",
}


def _provenance(given: Context) -> list[tuple[str, str]]:
    """Return pairs of term and text, without what the page shows elsewhere."""
    grade = given.get("grade")
    pairs = [("grade of the unit", naming.typeset(f"{grade['name']}: {grade['from']}"))] if grade else []
    for key, value in given.items():
        text = printed_number(f"{value:.3g}") if isinstance(value, float) else naming.as_text(value)
        if key not in ("recordings", "effects", "grade", "notes") and text:
            pairs.append((PROVENANCE.get(key, str(key).replace("_", " ")), text))
    return pairs


def _probability(p: float) -> str:
    return f"{100 * p:.3g} % probable" + (
        ", the highest value that is stated for any cause" if p >= 1 - UNKNOWN_LAW_SHARE else ""
    )


def _finding_section(f: Finding) -> Context:
    latex = str(stated_law(CATALOGUE[f.effect])["equation"])
    return {
        "words": naming.name_in_words(f.effect, f.axis),
        "does": finding_sentence(f),
        "probability": _probability(f.probability),
        "share": max(0.0, min(100.0, 100 * f.probability)),
        "sigma": f"{significant(f.sigma)} σ",
        "physics": naming.typeset(f.physics),
        "equation": formula(latex),
        "latex": latex,
        "rows": estimates(f.parameters),
        "twins": list_of_alternatives([naming.name_in_words(t) for t in f.twins]),
        "separate_by": naming.typeset(f.separate_by),
        "cost": naming.typeset(f.cost.in_words) if f.cost else "",
    }


def _mismatch(m: Mismatch) -> dict[str, str]:
    text = naming.as_sentence(m.in_words)
    at = [str(k) for k in m.where.get("positions", ())]
    number = "star" if m.channel == "pointing" else "position"
    named = not at or f" {at[0]}" in text  # the sentence names them
    return {
        "where": "" if named else f"{number}{'s' if len(at) > 1 else ''} {naming.list_in_words(at)}",
        "p": p_value(m.p_value),
        "in_words": text,
    }


def _channel(quantity: str, axis: str) -> str:
    """Return a channel in words.

    >>> _channel("angular_rate", "tilted"), _channel("specific_force", "norm"), _channel("specific_force", "y")
    ('tilt after a turn', 'norm of the force', 'specific force y')
    """
    known = {("angular_rate", "tilted"): "tilt after a turn", ("specific_force", "norm"): "norm of the force"}
    return known.get((quantity, axis), f"{quantity} {axis}".replace("_", " ").strip())


def _share_explained(p: Panel) -> float:
    """Return the share of the misfit that a curve over x explains: the panel with the largest comes first."""
    bins = np.array_split(np.argsort(p.x, kind="stable"), min(12, max(1, p.x.size // 3)))
    edges = np.unique(p.x[[b[0] for b in bins]])
    of = np.searchsorted(edges, p.x, side="right")
    y = p.before - p.before.mean()
    inside = sum(float(((y[of == k] - y[of == k].mean()) ** 2).sum()) for k in np.unique(of))
    free = max(p.x.size - np.unique(of).size, 1)
    return 1 - inside / free / max(float((y**2).sum()) / max(p.x.size - 1, 1), 1e-300)


def _of_a_cause(p: Panel, findings: Sequence[Finding]) -> bool:
    """Return whether a finding depends on the variable of this panel."""
    label = p.x_label.replace(" ", "_")
    return any(label.startswith(q) for f in findings for q in CATALOGUE[f.effect].requires) or any(
        f.axis and label.startswith(f.axis) for f in findings
    )


def on_the_sky(curves: Curves) -> list[Chart]:
    """Draw misfits of stars as arrows on the sky, before and after the findings; none for other recordings."""
    if {("pointing", "across"), ("pointing", "along")} - set(curves.channels):
        return []
    mounts = (("azimuth [°]", "elevation [°]"), ("hour angle [°]", "declination [°]"))
    axes = next((a for a in mounts if a[0] in curves.against and a[1] in curves.against), None)
    if axes is None or curves.sigma is None:
        return []
    around, up = (np.asarray(curves.against[a]) for a in axes)
    i, k = (curves.channels.index(("pointing", c)) for c in ("across", "along"))
    stars = [f"star {int(n)}" for n in curves.position]
    unit, zenith = naming.unit_in_print(curves.units[i]), axes[0].startswith("azimuth")
    shown = [("before", curves.before), ("after", curves.after)]
    if np.array_equal(curves.before, curves.after, equal_nan=True):
        shown = [("on the sky", curves.after)]
    drawn = []
    for when, residual in shown:
        both = residual[:, [i, k]] * curves.sigma[:, [i, k]]
        ok = np.isfinite(both).all(axis=1)
        at = [n for n, there in zip(stars, ok, strict=True) if there]
        drawn.append(sky(around[ok], up[ok], both[ok, 0], both[ok, 1], unit, at, zenith, when))
    return drawn


def _before_after(
    panels: Sequence[Panel], findings: Sequence[Finding], skies: Sequence[Chart], laws: Sequence[Chart] = ()
) -> Picture:
    panels = sorted(panels, key=lambda p: (_of_a_cause(p, findings), _share_explained(p)), reverse=True)[
        : MAX_PANELS - len(skies) - len(laws)
    ]
    changed = any(p.changed for p in panels)
    each = ((p, f"{rms(p.before)} to " if p.changed else "") for p in panels)
    sizes = "; ".join(f"{p.name} by {p.x_label}: {before}{rms(p.after)} {p.unit}" for p, before in each)
    what = "as calibrated (grey squares) and with the findings added (blue dots)" if changed else "as calibrated"
    return picture(
        [*laws, *before_after(panels), *skies],
        f"Residuals{' before and after the findings are added' if changed else ''}, rms {sizes}.",
        f"Measured minus model, {what}. The rms is that of the points drawn, which are means of neighbouring rows. "
        "Bars and band are one sigma of the noise; setting errors of gimbals, if there are any, add to it."
        f"{ARROWS if skies else ''}{FORMULAS if laws else ''}",
    )


def _detection_limit_rows(d: Diagnosis) -> list[dict[str, str]]:
    """Return the detection limits of an adequate fit: cause, least size, usual size and unit, of all views."""
    if d.verdict != "adequate":
        return []
    limits = (u for fit in (d.fit.views or {"": d.fit}).values() for u in fit.unseen or ())
    return [
        {"words": naming.name_in_words(u.effect, u.axis), "least": significant(u.least, 2),
        "usual": significant(u.usual, 2),
         "unit": naming.unit_in_print(u.unit)}
        for u in limits
    ]  # fmt: skip
