"""The report of a diagnosis, built from the content of diagnosis.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.effects import CATALOGUE
from gimbalcal.errors import alternatives
from gimbalcal.number import Array
from gimbalcal.references import cite
from gimbalcal.report import wording
from gimbalcal.report.chart import Chart, sensible_time
from gimbalcal.report.figures import Panel, before_after, sky
from gimbalcal.report.headline import does, headline
from gimbalcal.report.html import Picture, formula, picture, render
from gimbalcal.report.parameter_rows import in_sigmas
from gimbalcal.report.rounding import minus, pdg, rms, significant
from gimbalcal.report.unseen import unseen_rows

if TYPE_CHECKING:
    from gimbalcal.diagnose.answer import Curves

MOST = 6  # panels
STILL = 0.01  # probability by chance below which what is left is said to have a pattern
ARROWS = " On the sky: from each star, an arrow to where it was seen, as from below (east on the left)."
POINTS = 240  # points of a panel; more cannot be told apart on a page

LOOKS = {"adequate": "fits", "missing-physics": "found", "unexplained": "misfit", "not-identifiable": "misfit"}


def diagnosis_report(
    content: Mapping[str, Any], panels: Sequence[Panel] = (), title: str = "", curves: Curves | None = None
) -> str:
    """The page for the content of a diagnosis.json; `panels` show where the mismatch is, `curves` how large it is."""
    findings = [_finding(f) for f in content["findings"]]
    cards = [CATALOGUE[f["effect"]] for f in content["findings"] if f["effect"] in CATALOGUE]
    keys = dict.fromkeys(key for card in cards for key in card.sources)
    context = {
        "title": title or "a recording",
        "answer": headline(content, curves),
        "in_words": wording.typeset(content["in_words"]),
        "verdict": "reserved" if content.get("outcome") else LOOKS.get(content["verdict"], "misfit"),
        "facts": _facts(content),
        "findings": findings,
        "laws": [_law(law) for law in content.get("laws", ())],
        "picture": _before_after(panels, content["findings"], on_the_sky(curves)),
        "mismatch": (mismatch := [_mismatch(m) for m in content["mismatch"]]),
        "places": any(m["where"] for m in mismatch),
        "unexplained": [
            {"channel": _channel(str(u["channel"]), ""), "shape": wording.sentence(wording.typeset(str(u["shape"])))}
            for u in content["unexplained"]
        ],
        "moved": [_moved(m) for m in content["fit"].get("calibration_moved", [])],
        "unseen": unseen_rows(content),
        "provenance": _provenance(content["provenance"]),
        "sources": wording.files(content["provenance"]),
        "citations": cite(*keys),
    }
    return render("diagnosis.html", context)


def panels(curves: Curves, mismatch: Sequence[Mapping[str, Any]]) -> tuple[Panel, ...]:
    """The channel that is off most, in physical units: by position, over time, and over what it may follow."""
    worst = next(((str(m["channel"]), str(m["axis"])) for m in mismatch), None)
    if worst not in curves.channels:
        worst = curves.channels[int(np.argmax((np.nan_to_num(curves.before) ** 2).sum(axis=0)))]
    i = curves.channels.index(worst)
    name = _channel(*worst)
    scale = np.ones_like(curves.before) if curves.sigma is None else curves.sigma
    unit = wording.unit_in_print(curves.units[i]) if curves.units else "σ"
    ok = np.isfinite(curves.before[:, i]) & np.isfinite(curves.after[:, i])
    before, after, sigma = (np.asarray(v[ok, i]) for v in (curves.before * scale, curves.after * scale, scale))
    rows = (before, after, sigma)
    time, hours = sensible_time(curves.time[ok] - curves.time[ok].min())
    made = [_panel(name, unit, f"time [{hours}]", _grouped(time), time, rows)]
    held = np.unique(position := curves.position[ok])
    if 1 < held.size <= POINTS:
        at = [np.flatnonzero(position == number) for number in held]
        place = "star" if worst[0] == "pointing" else "position"
        named = tuple(f"{place} {int(number)}" for number in held)
        made.insert(0, replace(_panel(name, unit, place, at, position.astype(float), rows), names=named))
    for label, x in curves.against.items():
        made.append(_panel(name, unit, label, _grouped(x[ok]), x[ok], rows))
    return tuple(made)


def _grouped(x: Array) -> list[Array]:
    """Rows in order of x, as many together as it takes to draw no more than `POINTS`."""
    return [g for g in np.array_split(np.argsort(x, kind="stable"), min(x.size, POINTS)) if g.size]


def _panel(
    name: str, unit: str, x_label: str, groups: Sequence[Array], x: Array, rows: tuple[Array, Array, Array]
) -> Panel:
    """Means of groups of rows as points, with the sigma that noise which differs from row to row gives them."""
    before, after, sigma = rows
    first, second, at = (np.array([v[g].mean() for g in groups]) for v in (before, after, x))
    spread = np.array([np.sqrt((sigma[g] ** 2).mean() / g.size) for g in groups])
    return Panel(name, unit, at, x_label, first, second, spread)


def _moved(m: Mapping[str, Any]) -> dict[str, Any]:
    """How far one calibration parameter moved because of what was left out."""
    moved, sigma = pdg(m["moved"], m["sigma"])
    return {
        "words": wording.named(m["name"], m["axis"].replace("_", " ")),
        "value": minus(moved),
        "sigma": sigma,
        "unit": wording.unit_in_print(m["unit"]),
        "in_sigmas": m["in_sigmas"],
        "text": in_sigmas(m["in_sigmas"], 1),
    }


def _law(law: Mapping[str, Any]) -> dict[str, Any]:
    """A formula that no catalogue holds: as it is written, its numbers, and how far it was seen."""
    rows = []
    for r in law["parameters"]:
        value, sigma = pdg(r["value"], r["sigma"])
        unit = wording.unit_in_print(r["unit"])
        rows.append({"words": r["name"], "value": minus(value), "sigma": sigma, "unit": unit})
    seen = (f"{v.replace('_', ' ')} from {significant(low, 3)} to {significant(high, 3)} {law['units'][v]}"
            for v, (low, high) in law["domain"].items())  # fmt: skip
    return {
        "where": f"{law['channel']} {law['axis']}".replace("_", " "),
        "equation": formula(law["latex"]), "form": law["form"], "rows": rows, "domain": minus("; ".join(seen)),
        "alternatives": "; ".join(law["alternatives"]), "with": " --with ".join([*law["beside"], law["with"]]),
        "beside": wording.listed([wording.named(*one.split(":")) for one in law["beside"]]),
    }  # fmt: skip


def _facts(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is left before and after, in units of the noise or in its own, and whether anything more shows."""
    fit = content["fit"]
    reserved = ", with a reservation" if content.get("outcome") else ""
    facts = [(content["verdict"].replace("-", " ") + reserved, "verdict")]
    if content.get("laws") and not content["findings"]:
        facts = [(f"a formula fits{reserved}", "verdict: unexplained by what is known")]
    unit, keys, power = " × noise", ("chi2_reduced", "heldout"), 0.5
    if "rms_before" in fit:  # the noise is what the last model leaves, so its chi^2 says nothing
        unit, keys, power = " " + wording.unit_in_print(fit["noise"]["unit"]), ("rms", "heldout_rms"), 1.0
    changed = bool(content["findings"] or content.get("laws"))
    for key, what in zip(keys, ("misfit", "misfit of readings kept aside"), strict=True):
        known = [fit[f"{key}_{when}"] for when in ("before", "after") if fit.get(f"{key}_{when}") is not None]
        values = [significant(max(float(value), 0.0) ** power, 3) for value in (known if changed else known[:1])]
        if values:
            facts.append((" → ".join(values) + unit, f"{what}, before → after" if len(values) > 1 else what))
    if (p := fit.get("scan_p_after")) is not None:
        left = "no pattern left" if float(p) >= STILL else "a pattern left"
        facts.append((left, f"as strong by chance: {_chance(float(p))}"))
    return facts


NAMED = {
    "ln_bayes_factor": "ln Bayes factor, what was found against nothing",
    "ln_bayes_factor_needed": "ln Bayes factor that is needed",
    "false_alarm_rate_simulated": "false alarms of this design, simulated",
    "probability_unknown": "probability that it is none of the catalogue",
    "causes_compared": "causes compared",
    "excess_kurtosis": "excess kurtosis of what is left",
}


def _provenance(given: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Pairs of term and text; what the page says elsewhere is not repeated."""
    grade = given.get("grade")
    pairs = [("grade of the unit", wording.typeset(f"{grade['name']}: {grade['from']}"))] if grade else []
    for key, value in given.items():
        text = minus(f"{value:.3g}") if isinstance(value, float) else wording.as_text(value)
        if key not in ("recordings", "effects", "grade", "notes") and text:
            pairs.append((NAMED.get(key, str(key).replace("_", " ")), text))
    return pairs


def _chance(p: float) -> str:
    return "< 10⁻⁶" if p < 1e-6 else minus(f"{p:.2g}")


def _probable(p: float) -> str:
    from gimbalcal.diagnose.evidence.odds import OUTSIDE

    highest = p >= 1 - OUTSIDE
    return f"{100 * p:.3g} % probable" + (", the most that is stated of any cause" if highest else "")


def _finding(f: Mapping[str, Any]) -> dict[str, Any]:
    rows = []
    for p in f["parameters"]:
        value, sigma = pdg(p["value"], p["sigma"])
        axis = str(p.get("axis", "") or "").replace("_", " ")
        rows.append(
            {
                "words": wording.named(p["name"], axis),
                "value": minus(value),
                "sigma": sigma,
                "unit": wording.unit_in_print(p["unit"]),
            }
        )
    card = CATALOGUE.get(f["effect"])
    sentence = ((card.__doc__ if card else "") or "").strip().split("\n\n")[0].replace("\n", " ")
    return {
        "words": wording.named(f["effect"], str(f.get("axis", "") or "").replace("_", " ")),
        "does": does(f),
        "probability": _probable(float(f["probability"])),
        "share": max(0.0, min(100.0, 100 * f["probability"])),
        "sigma": f"{significant(f['sigma'])} σ",
        "physics": wording.typeset(str(f.get("physics") or sentence)),
        "equation": formula(str(f.get("equation", ""))),
        "latex": str(f.get("equation", "")),
        "rows": rows,
        "twins": alternatives([wording.named(t) for t in f["twins"]]),
        "separate_by": wording.typeset(str(f.get("separate_by", ""))),
        "cost": wording.typeset(str(f.get("cost", {}).get("in_words", ""))),
    }


def _mismatch(m: Mapping[str, Any]) -> dict[str, str]:
    p, where = m.get("p_value"), m.get("where") or {}
    told = wording.sentence(wording.typeset(str(m.get("in_words", "")))) or _channel(m["channel"], m.get("axis") or "")
    number = "star" if m["channel"] == "pointing" else "position"
    at = [str(k) for k in where.get("positions", ())] if isinstance(where, Mapping) else []
    said = not at or f" {at[0]}" in told  # the sentence names them
    return {
        "where": "" if said else f"{number}{'s' if len(at) > 1 else ''} {wording.listed(at)}",
        "p": "" if p is None else _chance(float(p)),
        "in_words": told,
    }


def _channel(quantity: str, axis: str) -> str:
    """A channel as a person says it.

    >>> _channel("angular_rate", "tilted"), _channel("specific_force", "norm"), _channel("specific_force", "y")
    ('tilt after a turn', 'norm of the force', 'specific force y')
    """
    known = {("angular_rate", "tilted"): "tilt after a turn", ("specific_force", "norm"): "norm of the force"}
    return known.get((quantity, axis), f"{quantity} {axis}".replace("_", " ").strip())


def _telling(p: Panel) -> float:
    """Share of what was there before that a course over x explains: the panel that shows it best comes first."""
    bins = np.array_split(np.argsort(p.x, kind="stable"), min(12, max(1, p.x.size // 3)))
    edges = np.unique(p.x[[b[0] for b in bins]])
    of = np.searchsorted(edges, p.x, side="right")
    y = p.before - p.before.mean()
    inside = sum(float(((y[of == k] - y[of == k].mean()) ** 2).sum()) for k in np.unique(of))
    free = max(p.x.size - np.unique(of).size, 1)
    return 1 - inside / free / max(float((y**2).sum()) / max(p.x.size - 1, 1), 1e-300)


def _named_by(p: Panel, findings: Sequence[Mapping[str, Any]]) -> bool:
    """Whether a cause that was found follows what this panel is drawn over."""
    label = p.x_label.replace(" ", "_")
    cards = [CATALOGUE[f["effect"]] for f in findings if f["effect"] in CATALOGUE]
    return any(label.startswith(q) for c in cards for q in c.requires) or any(
        f.get("axis") and label.startswith(str(f["axis"])) for f in findings
    )


def on_the_sky(curves: Curves | None) -> list[Chart]:
    """Misfits of stars as arrows on the sky, before and after what was found is added; none for what has no sky."""
    if curves is None or {("pointing", "across"), ("pointing", "along")} - set(curves.channels):
        return []
    axes = next((a for a in (("azimuth [°]", "elevation [°]"), ("hour angle [°]", "declination [°]"))
                 if a[0] in curves.against and a[1] in curves.against), None)  # fmt: skip
    if axes is None or curves.sigma is None:
        return []
    around, up = (np.asarray(curves.against[a]) for a in axes)
    i, k = (curves.channels.index(("pointing", c)) for c in ("across", "along"))
    names = [f"star {int(n)}" for n in curves.position]
    unit, zenith = wording.unit_in_print(curves.units[i]), axes[0].startswith("azimuth")
    told = [("before", curves.before), ("after", curves.after)]
    if np.array_equal(curves.before, curves.after, equal_nan=True):
        told = [("on the sky", curves.after)]
    drawn = []
    for when, left in told:
        both = left[:, [i, k]] * curves.sigma[:, [i, k]]
        ok = np.isfinite(both).all(axis=1)
        at = [n for n, there in zip(names, ok, strict=True) if there]
        drawn.append(sky(around[ok], up[ok], both[ok, 0], both[ok, 1], unit, at, zenith, when))
    return drawn


def _before_after(
    panels: Sequence[Panel], findings: Sequence[Mapping[str, Any]], skies: Sequence[Chart]
) -> Picture | None:
    if not panels:
        return None
    panels = sorted(panels, key=lambda p: (_named_by(p, findings), _telling(p)), reverse=True)[: MOST - len(skies)]
    changed = any(p.changed for p in panels)
    told = "; ".join(f"{p.name} by {p.x_label}: " + (f"{rms(p.before)} to " if p.changed else "")
                     + f"{rms(p.after)} {p.unit}" for p in panels)  # fmt: skip
    what = "as calibrated (grey squares) and with what was left out added (blue dots)" if changed else "as calibrated"
    return picture(
        [*before_after(panels), *skies],
        f"Residuals{' before and after the effect is added' if changed else ''}, rms {told}.",
        f"Measured minus model, {what}. Bars and band are what the noise alone would do; setting errors of gimbals, "
        f"where there are any, come on top.{ARROWS if skies else ''}",
    )
