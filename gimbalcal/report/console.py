"""What the console shows at the end: a table of parameters, value and sigma rounded alike, in the page's words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from gimbalcal.calibration import Calibration
from gimbalcal.report import naming
from gimbalcal.report.parameters import rows
from gimbalcal.report.rounding import minus, pdg, significant
from gimbalcal.report.words import calibration_in_words as answer
from gimbalcal.report.words import headline

if TYPE_CHECKING:
    from gimbalcal.diagnose import Diagnosis  # which loads every road of it


def parameters_table(content: Mapping[str, Any]) -> str:
    """The parameters of a calibration.json as the page has them, and which of them the data do not tell."""
    told = rows(content, None)
    unseen, held = any(r["unobservable"] for r in told), _held(content)
    return "\n".join([
        *_aligned([(r["words"], r["value"], r["sigma"], r["unit"], "*" if r["unobservable"] else "") for r in told]),
        *(["* not determined one by one; the report gives the combinations"] if unseen else []),
        *([f"not estimated: {'; '.join(held)}"] if held else []),
    ])  # fmt: skip


def calibration_in_words(made: Calibration) -> str:
    """The table of a calibration and its answer, as `gimbalcal calibrate` ends."""
    content = made.to_dict()
    return f"{parameters_table(content)}\n\n{answer(content)}"


def diagnosis_in_words(made: Diagnosis) -> str:
    """What a diagnosis found, its headline and its numbers, as `gimbalcal diagnose` ends."""
    content = made.to_dict()
    table = [findings_table(content), ""] if made.findings else []
    return "\n".join([*table, headline_and_numbers(made)])


def headline_and_numbers(made: Diagnosis) -> str:
    """The headline of a diagnosis, and its numbers."""
    return f"{headline(made.to_dict(), made.curves)}\nIn numbers: {naming.typeset(made.in_words)}"


def _held(content: Mapping[str, Any]) -> list[str]:
    """What was held instead of estimated, with its axes where others of the effect were estimated."""
    labels = {naming.label_of(p) for p in content["parameters"]}
    estimated = {label.partition(":")[0] for label in labels}
    axes: dict[str, dict[str, None]] = {}
    for label in (label for u in content["unobservable"] for label in u["direction"] if label not in labels):
        name, _, axis = label.partition(":")
        axes.setdefault(name, {})[axis.replace("_", " ")] = None
    return [naming.named(n, ", ".join(of) if n in estimated else "") for n, of in axes.items()]


def findings_table(content: Mapping[str, Any]) -> str:
    """What a diagnosis.json found: each cause with its sizes, how probable it is, how far above the noise."""
    told = [
        _row(p, f"{100 * f['probability']:.3g} % probable, {significant(f['sigma'])} σ" if not k else "")
        for f in content["findings"] for k, p in enumerate(f["parameters"])
    ]  # fmt: skip
    return "\n".join(_aligned(told))


def bounds_table(content: Mapping[str, Any]) -> str:
    """What a plan would tell of each parameter: the sigma that no estimate beats, and how large it usually is."""
    if "groups" in content:
        return "\n".join(_aligned([
            (naming.named(g["group"]), "", significant(g["sigma"], 3), naming.unit_in_print(g["unit"]), "at worst")
            for g in content["groups"]
        ]))  # fmt: skip
    lost = naming.unobservable_leading(content["unobservable"])
    told = [
        (naming.label_in_words(naming.label_of(p)), "", significant(p["sigma"], 3), naming.unit_in_print(p["unit"]),
         "*" if naming.label_of(p) in lost else f"usual {significant(p['prior_sigma'], 2)}")
        for p in content["parameters"]
    ]  # fmt: skip
    rest = ["* not determined one by one; the report gives the combinations"] if lost else []
    return "\n".join([*_aligned(told), *rest])


def _row(p: Mapping[str, Any], remark: str) -> tuple[str, str, str, str, str]:
    value, sigma = pdg(p["value"], p["sigma"])
    name = naming.named(p["name"], str(p.get("axis") or "").replace("_", " "))
    return name, minus(value), sigma, naming.unit_in_print(str(p["unit"])), remark


def _aligned(told: Sequence[tuple[str, str, str, str, str]]) -> list[str]:
    """Lines with names and units to the left and numbers to the right, each column as wide as it takes."""
    name, value, sigma, unit, _ = (max((len(r[i]) for r in told), default=0) for i in range(5))
    return [f"  {r[0]:{name}s}  {r[1]:>{value}s} ± {r[2]:<{sigma}s}  {r[3]:{unit}s}  {r[4]}".rstrip() for r in told]
