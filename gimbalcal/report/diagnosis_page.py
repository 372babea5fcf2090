"""The report of a diagnosis, built from the content of diagnosis.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import gimbalcal
from gimbalcal.effects import CATALOGUE
from gimbalcal.references import cite
from gimbalcal.report import wording
from gimbalcal.report.html import Picture, picture, render
from gimbalcal.report.rounding import minus, pdg, significant

if TYPE_CHECKING:
    from gimbalcal.report.figures import Panel

LOOKS = {"adequate": "fits", "missing-physics": "found", "unexplained": "misfit", "not-identifiable": "misfit"}


def diagnosis_report(content: Mapping[str, Any], panels: Sequence[Panel] = (), title: str = "") -> str:
    """The page for the content of a diagnosis.json; `panels` show where the mismatch is, before and after."""
    findings = [_finding(f) for f in content["findings"]]
    cards = [CATALOGUE[f["effect"]] for f in content["findings"] if f["effect"] in CATALOGUE]
    keys = dict.fromkeys(key for card in cards for key in card.sources)
    context = {
        "title": title or "a recording",
        "remark": f"gimbalcal {gimbalcal.__version__}",
        "answer": wording.typeset(answer(content)),
        "verdict": LOOKS.get(content["verdict"], "misfit"),
        "facts": _facts(content),
        "findings": findings,
        "picture": _before_after(panels),
        "mismatch": [_mismatch(m) for m in content["mismatch"]],
        "unexplained": [dict(u) for u in content["unexplained"]],
        "provenance": [
            (str(k).replace("_", " "), text) for k, v in content["provenance"].items() if (text := wording.plain(v))
        ],
        "citations": cite(*keys),
    }
    return render("diagnosis.html", context)


def answer(content: Mapping[str, Any]) -> str:
    """What was left out, in one or two sentences, from the content of diagnosis.json."""
    findings, verdict = content["findings"], content["verdict"]
    if verdict == "adequate":
        return f"The model explains these data; nothing needs to be added.{_improvement(content)}"
    if verdict == "unexplained" or not findings:
        shapes = "; ".join(str(u["shape"]) for u in content["unexplained"])
        found = f" It has this shape: {shapes}." if shapes else ""
        named = f" Beside it, {wording.listed([_named(f) for f in findings])} was found." if findings else ""
        return f"The mismatch is real, and no effect of the catalogue explains it.{found}{named}"
    if verdict == "not-identifiable":
        each = [wording.alternatives([_named(f), *map(wording.named, f["twins"])]) for f in findings]
        advice = " ".join(s for f in findings if (s := str(f.get("separate_by", ""))))
        return f"The data cannot tell which effect was left out: {'; '.join(each)}. {advice}".strip()
    told = wording.listed([f"{_named(f)} ({_percent(f['probability'])}{_size(f)})" for f in findings])
    return f"The model left out {told}.{_improvement(content)}"


def _named(f: Mapping[str, Any]) -> str:
    return wording.named(f["effect"], str(f.get("axis", "") or "").replace("_", " "))


def _size(f: Mapping[str, Any]) -> str:
    """The first coefficient with its sigma, if there is one."""
    if not f["parameters"]:
        return ""
    p = f["parameters"][0]
    value, sigma = pdg(p["value"], p["sigma"])
    return f"; {p['name']} = {minus(value)} ± {sigma} {wording.unit_in_print(p['unit'])}"


def _percent(p: float) -> str:
    return "over 99 % probable" if p > 0.99 else f"{100 * p:.0f} % probable"


def _improvement(content: Mapping[str, Any]) -> str:
    fit = content["fit"]
    if content["verdict"] == "adequate" and "chi2_reduced_before" in fit:
        return f" Reduced χ² is {significant(fit['chi2_reduced_before'], 3)}."
    if not {"chi2_reduced_before", "chi2_reduced_after"} <= fit.keys():
        return ""
    before, after = (significant(fit[f"chi2_reduced_{when}"], 3) for when in ("before", "after"))
    text = f" With {'it' if len(content['findings']) < 2 else 'them'}, reduced χ² falls from {before} to {after}"
    if {"heldout_before", "heldout_after"} <= fit.keys():
        out = (significant(fit[f"heldout_{when}"], 3) for when in ("before", "after"))
        text += " and, on data that the fit did not see, from {} to {}".format(*out)
    return text + "."


def _facts(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    fit = content["fit"]
    facts = [(content["verdict"].replace("-", " "), "verdict")]
    for key, what in (("chi2_reduced", "reduced χ², before → after"), ("heldout", "the same on held-out data")):
        known = [fit[f"{key}_{when}"] for when in ("before", "after") if fit.get(f"{key}_{when}") is not None]
        values = [significant(value, 3) for value in known]
        if values:
            facts.append((" → ".join(values), what))
    return facts


def _finding(f: Mapping[str, Any]) -> dict[str, Any]:
    rows = []
    for p in f["parameters"]:
        value, sigma = pdg(p["value"], p["sigma"])
        words = wording.named(p["name"], str(p.get("axis", "") or "").replace("_", " "))
        rows.append({"words": words, "value": minus(value), "sigma": sigma, "unit": wording.unit_in_print(p["unit"])})
    card = CATALOGUE.get(f["effect"])
    sentence = ((card.__doc__ if card else "") or "").strip().split("\n\n")[0].replace("\n", " ")
    return {
        "words": _named(f),
        "probability": f"{100 * f['probability']:.1f} %",
        "share": max(0.0, min(100.0, 100 * f["probability"])),
        "sigma": f"{f['sigma']:.1f} σ",
        "physics": wording.typeset(str(f.get("physics") or sentence)),
        "equation": equation(str(f.get("equation", ""))),
        "latex": str(f.get("equation", "")),
        "rows": rows,
        "twins": wording.alternatives([wording.named(t) for t in f["twins"]]),
        "separate_by": wording.typeset(str(f.get("separate_by", ""))),
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
        "where": wording.plain(m.get("where")),
        "statistic": significant(float(m["statistic"]), 3) if "statistic" in m else "",
        "p": "" if p is None else ("< 1e−6" if p < 1e-6 else minus(f"{p:.2g}")),
        "in_words": wording.typeset(str(m.get("in_words", ""))),
    }


def _before_after(panels: Sequence[Panel]) -> Picture | None:
    if not panels:
        return None
    from gimbalcal.report import figures

    told = "; ".join(f"{p.name}: {figures.rms(p.before)} to {figures.rms(p.after)} {p.unit}" for p in panels)
    return picture(
        figures.before_after(panels),
        f"Residuals before and after the effect is added, rms {told}.",
        "Measured minus model: as calibrated (grey) and with what was left out added (blue); bars are one sigma.",
    )
