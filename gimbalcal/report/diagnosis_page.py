"""The report of a diagnosis, built from the content of diagnosis.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

import gimbalcal
from gimbalcal.effects import CATALOGUE
from gimbalcal.errors import alternatives
from gimbalcal.number import Array
from gimbalcal.references import cite
from gimbalcal.report import wording
from gimbalcal.report.html import Picture, picture, render
from gimbalcal.report.rounding import minus, pdg, significant

if TYPE_CHECKING:
    from gimbalcal.diagnose.answer import Curves
    from gimbalcal.report.figures import Panel

POINTS = 240  # points of a panel; more cannot be told apart on a page

LOOKS = {"adequate": "fits", "missing-physics": "found", "unexplained": "misfit", "not-identifiable": "misfit"}


def diagnosis_report(content: Mapping[str, Any], panels: Sequence[Panel] = (), title: str = "") -> str:
    """The page for the content of a diagnosis.json; `panels` show where the mismatch is, before and after."""
    findings = [_finding(f) for f in content["findings"]]
    cards = [CATALOGUE[f["effect"]] for f in content["findings"] if f["effect"] in CATALOGUE]
    keys = dict.fromkeys(key for card in cards for key in card.sources)
    context = {
        "title": title or "a recording",
        "remark": f"gimbalcal {gimbalcal.__version__}",
        "answer": wording.typeset(content["in_words"]),
        "verdict": "reserved" if content.get("outcome") else LOOKS.get(content["verdict"], "misfit"),
        "facts": _facts(content),
        "findings": findings,
        "picture": _before_after(panels),
        "mismatch": [_mismatch(m) for m in content["mismatch"]],
        "unexplained": [{**u, "channel": str(u["channel"]).replace("_", " ")} for u in content["unexplained"]],
        "moved": [_moved(m) for m in content["fit"].get("calibration_moved", [])],
        "provenance": [
            (str(k).replace("_", " "), text)
            for k, v in content["provenance"].items()
            if k not in ("recordings", "grade") and (text := wording.as_text(v))
        ],
        "sources": content["provenance"].get("recordings", []),
        "citations": cite(*keys),
    }
    return render("diagnosis.html", context)


def panels(curves: Curves, mismatch: Sequence[Mapping[str, Any]]) -> tuple[Panel, ...]:
    """The channel that is off most, by position where there are positions and over time, in sigmas of one row."""
    worst = next(((str(m["channel"]), str(m["axis"])) for m in mismatch), None)
    if worst not in curves.channels:
        worst = curves.channels[int(np.argmax((np.nan_to_num(curves.before) ** 2).sum(axis=0)))]
    i = curves.channels.index(worst)
    name = " ".join(worst).replace("_", " ").strip()
    ok = np.isfinite(curves.before[:, i]) & np.isfinite(curves.after[:, i])
    order = np.argsort(curves.time[ok], kind="stable")
    time, before, after = curves.time[ok][order], curves.before[ok, i][order], curves.after[ok, i][order]
    groups = np.array_split(np.arange(time.size), min(time.size, POINTS))
    made = [_panel(f"{name} over time", "time [h]", [g for g in groups if g.size], time / 3600, before, after)]
    held = np.unique(position := curves.position[ok][order])
    if 1 < held.size <= POINTS:
        at = [np.flatnonzero(position == number) for number in held]
        place = "star" if worst[0] == "pointing" else "position"
        made.insert(0, _panel(f"{name} by {place}", place, at, position.astype(float), before, after))
    return tuple(made)


def _panel(name: str, x_label: str, groups: Sequence[Array], x: Array, before: Array, after: Array) -> Panel:
    """Means of groups of rows as points, with the sigma that noise which differs from row to row gives them."""
    from gimbalcal.report.figures import Panel

    first, second = (np.array([v[g].mean() for g in groups]) for v in (before, after))
    sigma = np.array([1 / np.sqrt(g.size) for g in groups])
    return Panel(name, "σ", np.array([x[g].mean() for g in groups]), x_label, first, second, sigma)


def _moved(m: Mapping[str, Any]) -> dict[str, Any]:
    """How far one calibration parameter moved because of what was left out."""
    moved, sigma = pdg(m["moved"], m["sigma"])
    return {
        "words": wording.named(m["name"], m["axis"].replace("_", " ")),
        "value": minus(moved),
        "sigma": sigma,
        "unit": wording.unit_in_print(m["unit"]),
        "in_sigmas": m["in_sigmas"],
        "text": minus(f"{m['in_sigmas']:+.1f} σ"),
    }


def _facts(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    fit = content["fit"]
    reserved = ", with a reservation" if content.get("outcome") else ""
    facts = [(content["verdict"].replace("-", " ") + reserved, "verdict")]
    measures = [("chi2_reduced", "reduced χ², before → after", ""), ("heldout", "the same on held-out data", "")]
    if "rms_before" in fit:  # the noise is what the last model leaves, so its chi^2 says nothing
        unit = " " + wording.unit_in_print(fit["noise"]["unit"])
        measures = [("rms", "misfit rms, before → after", unit), ("heldout_rms", "the same on held-out data", unit)]
    for key, what, unit in measures:
        known = [fit[f"{key}_{when}"] for when in ("before", "after") if fit.get(f"{key}_{when}") is not None]
        values = [significant(value, 3) for value in known]
        if values:
            facts.append((" → ".join(values) + unit, what))
    if fit.get("scan_p_after") is not None:
        facts.append((_chance(float(fit["scan_p_after"])), "probability by chance of what a new scan still finds"))
    if grade := content["provenance"].get("grade"):
        facts.append((grade["name"], f"grade of the unit: {grade['from']}"))
    return facts


def _chance(p: float) -> str:
    return "< 1e−6" if p < 1e-6 else minus(f"{p:.2g}")


def _probable(p: float) -> str:
    from gimbalcal.diagnose.evidence.odds import OUTSIDE

    highest = p >= 1 - OUTSIDE
    return f"{100 * p:.3g} % probable" + (", the most that is stated of any cause" if highest else "")


def _finding(f: Mapping[str, Any]) -> dict[str, Any]:
    rows = []
    for p in f["parameters"]:
        value, sigma = pdg(p["value"], p["sigma"])
        words = wording.NAMES.get(p["name"], p["name"].replace("_", " ") if len(p["name"]) > 4 else p["name"])
        axis = str(p.get("axis", "") or "").replace("_", " ")
        rows.append(
            {
                "words": f"{words} {axis}".strip(),
                "value": minus(value),
                "sigma": sigma,
                "unit": wording.unit_in_print(p["unit"]),
            }
        )
    card = CATALOGUE.get(f["effect"])
    sentence = ((card.__doc__ if card else "") or "").strip().split("\n\n")[0].replace("\n", " ")
    return {
        "words": wording.named(f["effect"], str(f.get("axis", "") or "").replace("_", " ")),
        "probability": _probable(float(f["probability"])),
        "share": max(0.0, min(100.0, 100 * f["probability"])),
        "sigma": f"{f['sigma']:.1f} σ",
        "physics": wording.typeset(str(f.get("physics") or sentence)),
        "equation": equation(str(f.get("equation", ""))),
        "latex": str(f.get("equation", "")),
        "rows": rows,
        "twins": alternatives([wording.named(t) for t in f["twins"]]),
        "separate_by": wording.typeset(str(f.get("separate_by", ""))),
        "cost": wording.typeset(str(f.get("cost", {}).get("in_words", ""))),
    }


def equation(latex: str) -> Picture | None:
    """An equation as a picture; None where it is empty or beyond matplotlib's mathematics."""
    if not latex.strip():
        return None
    from gimbalcal.report import figures

    text = latex.strip().strip("$").removeprefix(r"\[").removesuffix(r"\]").strip()
    try:
        return picture(figures.formula(text), text)
    except ValueError:
        return None


def _mismatch(m: Mapping[str, Any]) -> dict[str, str]:
    p = m.get("p_value")
    axis = str(m.get("axis", "") or "")
    return {
        "channel": f"{m['channel'].replace('_', ' ')} {axis}".strip(),
        "where": wording.as_text(m.get("where")),
        "statistic": significant(float(m["statistic"]), 3) if "statistic" in m else "",
        "p": "" if p is None else _chance(float(p)),
        "in_words": wording.typeset(str(m.get("in_words", ""))),
    }


def _before_after(panels: Sequence[Panel]) -> Picture | None:
    if not panels:
        return None
    from gimbalcal.report import figures
    from gimbalcal.report.style import rms

    told = "; ".join(f"{p.name}: {rms(p.before)} to {rms(p.after)} {p.unit}" for p in panels)
    return picture(
        figures.before_after(panels),
        f"Residuals before and after the effect is added, rms {told}.",
        "Measured minus model in units of the noise of one row, as calibrated (grey) and with what was left out added "
        "(blue). Bars and band are what that noise alone would do; setting errors of the gimbals come on top.",
    )
