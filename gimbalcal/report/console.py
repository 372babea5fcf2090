"""What the console shows at the end: a table of parameters, value and sigma rounded alike, in the page's words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gimbalcal.report import wording
from gimbalcal.report.rounding import pdg


def parameters_table(content: Mapping[str, Any]) -> str:
    """The parameters of a calibration.json, and which of them the data do not tell."""
    unseen = {label for u in wording.unobservable_of(content) for label in wording.leading(u["direction"])}
    rows = [_row(p, "*" if wording.label_of(p) in unseen else "") for p in content["parameters"]]
    labels = {wording.label_of(p) for p in content["parameters"]}
    held = dict.fromkeys(wording.named(label.partition(":")[0]) for u in content["unobservable"]
                         for label in u["direction"] if label not in labels)  # fmt: skip
    return "\n".join([
        *_aligned(rows),
        *(["* these data do not tell it alone; the report says with what it moves together"] if unseen else []),
        *([f"not estimated: {', '.join(held)}"] if held else []),
    ])  # fmt: skip


def findings_table(content: Mapping[str, Any]) -> str:
    """What a diagnosis.json found: each cause with its sizes, how probable it is, how far above the noise."""
    rows = [
        _row({**p, "axis": p.get("axis") or ""},
             f"{100 * f['probability']:.3g} % probable, {f['sigma']:.3g} sigma")
        for f in content["findings"] for p in f["parameters"]
    ]  # fmt: skip
    return "\n".join(_aligned(rows))


def _row(p: Mapping[str, Any], remark: str) -> tuple[str, str, str, str, str]:
    value, sigma = pdg(p["value"], p["sigma"])
    return wording.named(p["name"], str(p["axis"]).replace("_", " ")), value, sigma, str(p["unit"]), remark


def _aligned(rows: Sequence[tuple[str, str, str, str, str]]) -> list[str]:
    """Lines with names and units to the left and numbers to the right, each column as wide as it takes."""
    name, value, sigma, unit, _ = (max((len(r[i]) for r in rows), default=0) for i in range(5))
    return [f"  {r[0]:{name}s}  {r[1]:>{value}s} +- {r[2]:<{sigma}s}  {r[3]:{unit}s}  {r[4]}".rstrip() for r in rows]
