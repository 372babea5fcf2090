"""Text of the console: a table of parameters and the sentences of the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from gimbalcal.calibration import Calibration
from gimbalcal.report.parameters import estimates, rows
from gimbalcal.report.terms import terms_in_text
from gimbalcal.words import naming
from gimbalcal.words.calibration_sentences import calibration_in_words as answer
from gimbalcal.words.diagnosis_headline import headline
from gimbalcal.words.rounding import significant
from gimbalcal.words.tables import NOT_DETERMINED, aligned_table

if TYPE_CHECKING:
    from gimbalcal.design.turning_design import TurnsDesign
    from gimbalcal.diagnose import Diagnosis  # which loads the whole diagnosis
    from gimbalcal.diagnose.result import Finding


def parameters_table(c: Calibration) -> str:
    """Return the parameters of a calibration as on the page, and which the data do not determine one by one."""
    table = rows(c, None)
    fixed = _fixed_parameters(c)
    terms = terms_in_text(c)
    return "\n".join([
        *aligned_table([(r["words"], r["value"], r["sigma"], r["unit"],
        "*" if r["unobservable"] else "") for r in table]),
        *([NOT_DETERMINED] if any(r["unobservable"] for r in table) else []),
        *([f"not estimated: {'; '.join(fixed)}"] if fixed else []),
        *(["", terms] if terms else []),
    ])  # fmt: skip


def calibration_in_words(c: Calibration) -> str:
    """Return the table of a calibration and its sentences, the last output of `gimbalcal calibrate`."""
    return f"{parameters_table(c)}\n\n{answer(c)}"


def diagnosis_in_words(d: Diagnosis) -> str:
    """Return the findings of a diagnosis, its headline and its numbers, the last output of `gimbalcal diagnose`."""
    table = [findings_table(d.findings), ""] if d.findings else []
    return "\n".join([*table, headline_and_numbers(d)])


def headline_and_numbers(d: Diagnosis) -> str:
    """Return the headline of a diagnosis, and its numbers."""
    return f"{headline(d)}\nIn numbers: {naming.typeset(d.in_words)}"


def _fixed_parameters(c: Calibration) -> list[str]:
    """Return what was fixed instead of estimated, with its axes where others of the effect were estimated."""
    labels = {p.label for p in c.parameters}
    estimated = {label.partition(":")[0] for label in labels}
    axes: dict[str, dict[str, None]] = {}
    for label in (label for u in c.unobservable for label in u.direction if label not in labels):
        name, _, axis = label.partition(":")
        axes.setdefault(name, {})[naming.without_underscores(axis)] = None
    return [naming.name_in_words(n, ", ".join(of) if n in estimated else "") for n, of in axes.items()]


def findings_table(findings: Sequence[Finding]) -> str:
    """Return the causes of a diagnosis with sizes, probability and significance."""
    table = []
    for f in findings:
        remark = f"{100 * f.probability:.3g} % probable, {significant(f.sigma)} σ"
        for row in estimates(f.parameters):
            table.append((row["words"], row["value"], row["sigma"], row["unit"], remark))
            remark = ""
    return "\n".join(aligned_table(table))


def groups_table(d: TurnsDesign) -> str:
    """Return the largest sigma of each group of states that a designed schedule of turns determines."""
    return "\n".join(aligned_table([
        (naming.name_in_words(g.group), "", significant(g.sigma, 3), naming.unit_in_print(g.unit), "at worst")
        for g in d.groups
    ]))  # fmt: skip
