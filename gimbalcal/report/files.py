"""Results as files: the JSON of the contract and the page beside it, of one run all or none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gimbalcal.atomic import folder, write, write_json
from gimbalcal.report.html import marked

if TYPE_CHECKING:
    from gimbalcal.calibration import Calibration
    from gimbalcal.design.budget import Budget
    from gimbalcal.diagnose import Diagnosis
    from gimbalcal.navigate.outcome import Navigated
    from gimbalcal.recording import Recording


def write_calibration(
    calibration: Calibration, recordings: Sequence[Recording], out: Path, truth: Mapping[str, float] | None = None,
    question: str = "",
) -> None:  # fmt: skip
    """calibration.json and report.html into `out`; the page is made first, so that both are written or neither.

    question: which one the page answers; as with all others here it marks the page.
    """
    from gimbalcal.report.calibration_page import calibration_report

    content = calibration.to_dict()
    page = calibration_report(content, recordings, truth)
    with folder(out) as new:
        write_json(new / "calibration.json", content)
        write(new / "report.html", marked(page, question))


def write_diagnosis(diagnosis: Diagnosis, out: Path, title: str = "", question: str = "") -> None:
    """diagnosis.json, calibration.json of its refit, law.py of a law and report.html; `title`: of which recording."""
    from gimbalcal.diagnose.verdict.law_file import source
    from gimbalcal.report.diagnosis_page import diagnosis_report, panels

    drawn = panels(diagnosis.curves, diagnosis.mismatch) if diagnosis.curves else ()
    page = diagnosis_report(diagnosis.to_dict(), drawn, title, diagnosis.curves)
    with folder(out) as new:
        write_json(new / "diagnosis.json", diagnosis.to_dict())
        if diagnosis.calibration is not None:
            diagnosis.calibration.write(new / "calibration.json")
        if diagnosis.laws:
            write(new / "law.py", source(diagnosis.laws))
        write(new / "report.html", marked(page, question))


def write_observability(content: Mapping[str, Any], out: Path, question: str = "") -> None:
    """observability.json and report.html of a schedule of turns into `out`."""
    from gimbalcal.report.observability_page import observability_report

    page = observability_report(content)
    with folder(out) as new:
        write_json(new / "observability.json", content)
        write(new / "report.html", marked(page, question))


def write_navigation(
    content: Mapping[str, Any], runs: Sequence[Navigated], title: str, out: Path, question: str = ""
) -> None:
    """navigation.json and report.html into `out`."""
    from gimbalcal.report.navigation_page import navigation_report

    page = navigation_report(content, runs, title)
    with folder(out) as new:
        write_json(new / "navigation.json", content)
        write(new / "report.html", marked(page, question))


def write_comparison(
    content: Mapping[str, Any], diagnoses: Sequence[tuple[str, str]], out: Path, question: str = ""
) -> None:
    """compare.json, report.html and all values as history.csv and history.parquet into `out`."""
    import polars as pl

    from gimbalcal.history.compare import flat
    from gimbalcal.report.history import history_report

    page, rows = history_report(content, diagnoses), pl.DataFrame(flat(content))
    with folder(out) as new:
        write_json(new / "compare.json", content)
        write(new / "history.csv", rows.write_csv())
        rows.write_parquet(new / "history.parquet")
        write(new / "report.html", marked(page, question))


def write_budget(made: Budget, out: Path, question: str = "") -> None:
    """budget.json and report.html into `out`."""
    from gimbalcal.report.budget_page import budget_report

    page = budget_report(made)
    with folder(out) as new:
        write_json(new / "budget.json", made.to_list())
        write(new / "report.html", marked(page, question))


def write_plan(content: Mapping[str, Any], out: Path, question: str = "") -> None:
    """observability.json and report.html of a schedule of positions or a static run into `out`."""
    from gimbalcal.report.plan_page import plan_report

    page = plan_report(content)
    with folder(out) as new:
        write_json(new / "observability.json", content)
        write(new / "report.html", marked(page, question))


def write_noise(content: Mapping[str, Any], title: str, out: Path, question: str = "") -> None:
    """noise.json and report.html into `out`."""
    from gimbalcal.report.noise_page import noise_report

    page = noise_report(content, title)
    with folder(out) as new:
        write_json(new / "noise.json", content)
        write(new / "report.html", marked(page, question))
