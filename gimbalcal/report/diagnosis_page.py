"""The page of a diagnosis, built from the content of diagnosis.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.effects import CATALOGUE
from gimbalcal.errors import alternatives
from gimbalcal.number import Array
from gimbalcal.references import cite
from gimbalcal.report import naming
from gimbalcal.report.chart import Chart, sensible_time
from gimbalcal.report.figures import Panel, before_after, sky
from gimbalcal.report.formulas import formula
from gimbalcal.report.html import Picture, picture, render
from gimbalcal.report.parameters import estimate, in_sigmas
from gimbalcal.report.rounding import minus, p_value, rms, significant
from gimbalcal.report.words import does, headline

if TYPE_CHECKING:
    from gimbalcal.diagnose.answer import Curves

MAX_PANELS = 6
MIN_P_VALUE = 0.01  # of the residuals; below it they are reported to have a pattern
ARROWS = " On the sky: an arrow from each star to its observed direction, seen from below (east on the left)."
MAX_POINTS = 240  # of a panel; more overlap on a page

LOOKS = {"adequate": "fits", "missing-physics": "found", "unexplained": "misfit", "not-identifiable": "misfit"}


def diagnosis_report(
    content: Mapping[str, Any], panels: Sequence[Panel] = (), title: str = "", curves: Curves | None = None
) -> str:
    """Return the page of a diagnosis.json; `panels` show where the mismatch is, `curves` how large it is."""
    findings = [_finding(f) for f in content["findings"]]
    cards = [CATALOGUE[f["effect"]] for f in content["findings"] if f["effect"] in CATALOGUE]
    keys = dict.fromkeys(key for card in cards for key in card.sources)
    context = {
        "title": title or "a recording",
        "answer": headline(content, curves),
        "in_words": naming.typeset(content["in_words"]),
        "verdict": "reserved" if content.get("outcome") else LOOKS.get(content["verdict"], "misfit"),
        "facts": _facts(content),
        "findings": findings,
        "laws": [_law(law) for law in content.get("laws", ())],
        "picture": _before_after(panels, content["findings"], on_the_sky(curves)),
        "mismatch": (mismatch := [_mismatch(m) for m in content["mismatch"]]),
        "places": any(m["where"] for m in mismatch),
        "unexplained": [
            {"channel": _channel(str(u["channel"]), ""), "shape": naming.sentence(naming.typeset(str(u["shape"])))}
            for u in content["unexplained"]
        ],
        "moved": [_moved(m) for m in content["fit"].get("calibration_moved", [])],
        "unseen": _undetected(content),
        "provenance": _provenance(content["provenance"]),
        "sources": naming.files(content["provenance"]),
        "citations": cite(*keys),
    }
    return render("diagnosis.html", context)


def panels(curves: Curves, mismatch: Sequence[Mapping[str, Any]]) -> tuple[Panel, ...]:
    """Return panels of the channel with the largest misfit, by position, over time and over its possible causes."""
    worst = next(((str(m["channel"]), str(m["axis"])) for m in mismatch), None)
    if worst not in curves.channels:
        worst = curves.channels[int(np.argmax((np.nan_to_num(curves.before) ** 2).sum(axis=0)))]
    i = curves.channels.index(worst)
    name = _channel(*worst)
    scale = np.ones_like(curves.before) if curves.sigma is None else curves.sigma
    unit = naming.unit_in_print(curves.units[i]) if curves.units else "σ"
    ok = np.isfinite(curves.before[:, i]) & np.isfinite(curves.after[:, i])
    before, after, sigma = (np.asarray(v[ok, i]) for v in (curves.before * scale, curves.after * scale, scale))
    rows = (before, after, sigma)
    time, hours = sensible_time(curves.time[ok] - curves.time[ok].min())
    out = [_panel(name, unit, f"time [{hours}]", _grouped(time), time, rows)]
    numbers = np.unique(position := curves.position[ok])
    if 1 < numbers.size <= MAX_POINTS:
        at = [np.flatnonzero(position == number) for number in numbers]
        place = "star" if worst[0] == "pointing" else "position"
        named = tuple(f"{place} {int(number)}" for number in numbers)
        out.insert(0, replace(_panel(name, unit, place, at, position.astype(float), rows), names=named))
    for label, x in curves.against.items():
        out.append(_panel(name, unit, label, _grouped(x[ok]), x[ok], rows))
    return tuple(out)


def _grouped(x: Array) -> list[Array]:
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


def _moved(m: Mapping[str, Any]) -> dict[str, Any]:
    """Return how far one calibration parameter moved because of what was missing."""
    return {**estimate({**m, "value": m["moved"]}), "text": in_sigmas(m["in_sigmas"], 1)}


def _law(law: Mapping[str, Any]) -> dict[str, Any]:
    """Return a formula that no catalogue holds: as it is written, its parameters, and the domain of the data."""
    units = {v: naming.unit_in_print(unit) for v, unit in law["units"].items()}
    domain = (f"{v.replace('_', ' ')} from {significant(low, 3)} to {significant(high, 3)} {units[v]}"
              for v, (low, high) in law["domain"].items())  # fmt: skip
    return {
        "where": f"{law['channel']} {law['axis']}".replace("_", " "),
        "equation": formula(law["latex"]), "form": law["form"], "domain": minus("; ".join(domain)),
        "rows": [{**estimate(p), "words": p["name"]} for p in law["parameters"]],
        "alternatives": "; ".join(law["alternatives"]), "with": " --with ".join([*law["beside"], law["with"]]),
        "beside": naming.listed([naming.named(*one.split(":")) for one in law["beside"]]),
    }  # fmt: skip


def _facts(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the residual before and after, in units of the noise or in its own, and whether it has a pattern."""
    fit = content["fit"]
    reserved = ", with a reservation" if content.get("outcome") else ""
    facts = [(content["verdict"].replace("-", " ") + reserved, "verdict")]
    if content.get("laws") and not content["findings"]:
        facts = [(f"a formula fits{reserved}", "verdict: not explained by a known effect")]
    unit, keys, power = " × noise", ("chi2_reduced", "heldout"), 0.5
    if "rms_before" in fit:  # the noise was estimated from the residual, so chi^2 does not test the fit
        unit, keys, power = " " + naming.unit_in_print(fit["noise"]["unit"]), ("rms", "heldout_rms"), 1.0
    changed = bool(content["findings"] or content.get("laws"))
    for key, what in zip(keys, ("misfit", "misfit of held-out readings"), strict=True):
        known = [fit[f"{key}_{when}"] for when in ("before", "after") if fit.get(f"{key}_{when}") is not None]
        values = [significant(max(float(value), 0.0) ** power, 3) for value in (known if changed else known[:1])]
        if values:
            facts.append((" → ".join(values) + unit, f"{what}, before → after" if len(values) > 1 else what))
    if (p := fit.get("scan_p_after")) is not None:
        pattern = "no pattern" if float(p) >= MIN_P_VALUE else "a pattern"
        facts.append((f"{pattern} in the residuals", f"p-value {p_value(float(p))}"))
    return facts


PROVENANCE = {
    "ln_bayes_factor": "ln Bayes factor, findings against none",
    "ln_bayes_factor_needed": "ln Bayes factor required",
    "false_alarm_rate_simulated": "false alarms of this design, simulated",
    "probability_unknown": "probability of a cause outside the catalogue",
    "causes_compared": "causes compared",
    "excess_kurtosis": "excess kurtosis of the residuals",
}


def _provenance(given: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return pairs of term and text, without what the page shows elsewhere."""
    grade = given.get("grade")
    pairs = [("grade of the unit", naming.typeset(f"{grade['name']}: {grade['from']}"))] if grade else []
    for key, value in given.items():
        text = minus(f"{value:.3g}") if isinstance(value, float) else naming.as_text(value)
        if key not in ("recordings", "effects", "grade", "notes") and text:
            pairs.append((PROVENANCE.get(key, str(key).replace("_", " ")), text))
    return pairs


def _probability(p: float) -> str:
    from gimbalcal.diagnose.evidence.odds import OUTSIDE

    return f"{100 * p:.3g} % probable" + (
        ", the highest value that is stated for any cause" if p >= 1 - OUTSIDE else ""
    )


def _finding(f: Mapping[str, Any]) -> dict[str, Any]:
    card = CATALOGUE.get(f["effect"])
    physics = f.get("physics") or ((card.__doc__ if card else "") or "").strip().split("\n\n")[0].replace("\n", " ")
    return {
        "words": naming.named(f["effect"], str(f.get("axis") or "")),
        "does": does(f),
        "probability": _probability(float(f["probability"])),
        "share": max(0.0, min(100.0, 100 * f["probability"])),
        "sigma": f"{significant(f['sigma'])} σ",
        "physics": naming.typeset(str(physics)),
        "equation": formula(str(f.get("equation", ""))),
        "latex": str(f.get("equation", "")),
        "rows": [estimate(p) for p in f["parameters"]],
        "twins": alternatives([naming.named(t) for t in f["twins"]]),
        "separate_by": naming.typeset(str(f.get("separate_by", ""))),
        "cost": naming.typeset(str(f.get("cost", {}).get("in_words", ""))),
    }


def _mismatch(m: Mapping[str, Any]) -> dict[str, str]:
    p, where = m.get("p_value"), m.get("where") or {}
    text = naming.sentence(naming.typeset(str(m.get("in_words", "")))) or _channel(m["channel"], m.get("axis") or "")
    number = "star" if m["channel"] == "pointing" else "position"
    at = [str(k) for k in where.get("positions", ())] if isinstance(where, Mapping) else []
    named = not at or f" {at[0]}" in text  # the sentence names them
    return {
        "where": "" if named else f"{number}{'s' if len(at) > 1 else ''} {naming.listed(at)}",
        "p": "" if p is None else p_value(float(p)),
        "in_words": text,
    }


def _channel(quantity: str, axis: str) -> str:
    """Return a channel in words.

    >>> _channel("angular_rate", "tilted"), _channel("specific_force", "norm"), _channel("specific_force", "y")
    ('tilt after a turn', 'norm of the force', 'specific force y')
    """
    known = {("angular_rate", "tilted"): "tilt after a turn", ("specific_force", "norm"): "norm of the force"}
    return known.get((quantity, axis), f"{quantity} {axis}".replace("_", " ").strip())


def _explained(p: Panel) -> float:
    """Return the share of the misfit that a curve over x explains: the panel with the largest comes first."""
    bins = np.array_split(np.argsort(p.x, kind="stable"), min(12, max(1, p.x.size // 3)))
    edges = np.unique(p.x[[b[0] for b in bins]])
    of = np.searchsorted(edges, p.x, side="right")
    y = p.before - p.before.mean()
    inside = sum(float(((y[of == k] - y[of == k].mean()) ** 2).sum()) for k in np.unique(of))
    free = max(p.x.size - np.unique(of).size, 1)
    return 1 - inside / free / max(float((y**2).sum()) / max(p.x.size - 1, 1), 1e-300)


def _of_a_cause(p: Panel, findings: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether a cause that was found depends on the variable of this panel."""
    label = p.x_label.replace(" ", "_")
    cards = [CATALOGUE[f["effect"]] for f in findings if f["effect"] in CATALOGUE]
    return any(label.startswith(q) for c in cards for q in c.requires) or any(
        f.get("axis") and label.startswith(str(f["axis"])) for f in findings
    )


def on_the_sky(curves: Curves | None) -> list[Chart]:
    """Draw misfits of stars as arrows on the sky, before and after the findings; none for other recordings."""
    if curves is None or {("pointing", "across"), ("pointing", "along")} - set(curves.channels):
        return []
    axes = next((a for a in (("azimuth [°]", "elevation [°]"), ("hour angle [°]", "declination [°]"))
                 if a[0] in curves.against and a[1] in curves.against), None)  # fmt: skip
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
    panels: Sequence[Panel], findings: Sequence[Mapping[str, Any]], skies: Sequence[Chart]
) -> Picture | None:
    if not panels:
        return None
    panels = sorted(panels, key=lambda p: (_of_a_cause(p, findings), _explained(p)), reverse=True)[
        : MAX_PANELS - len(skies)
    ]
    changed = any(p.changed for p in panels)
    sizes = "; ".join(f"{p.name} by {p.x_label}: " + (f"{rms(p.before)} to " if p.changed else "")
                     + f"{rms(p.after)} {p.unit}" for p in panels)  # fmt: skip
    what = "as calibrated (grey squares) and with the findings added (blue dots)" if changed else "as calibrated"
    return picture(
        [*before_after(panels), *skies],
        f"Residuals{' before and after the findings are added' if changed else ''}, rms {sizes}.",
        f"Measured minus model, {what}. Bars and band are one sigma of the noise; setting errors of gimbals, "
        f"if there are any, add to it.{ARROWS if skies else ''}",
    )


def _undetected(content: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the detection limits of an adequate fit: cause, least size, usual size and unit, of all views."""
    if content["verdict"] != "adequate":
        return []
    limits = (
        u for fit in (content["fit"].get("views") or {"": content["fit"]}).values() for u in fit.get("unseen", ())
    )
    return [
        {"words": naming.named(u["effect"], u["axis"]), "least": significant(u["least"], 2),
         "usual": significant(u["usual"], 2), "unit": naming.unit_in_print(u["unit"])}
        for u in limits
    ]  # fmt: skip
