"""Write results: JSON and page of one run, all of them or none."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gimbalcal.atomic import atomic_folder, write, write_json
from gimbalcal.entries import Json
from gimbalcal.report.html import page_with_question

if TYPE_CHECKING:
    from gimbalcal.calibration import Calibration
    from gimbalcal.diagnose import Diagnosis
    from gimbalcal.history.compare import PrintedComparison
    from gimbalcal.recording import Recording


def write_calibration(
    calibration: Calibration, recordings: Sequence[Recording], out: Path, truth: Mapping[str, float] | None = None,
    question: str = "",
) -> None:  # fmt: skip
    """Write calibration.json and report.html into `out`, both or neither.

    question: the question that the page answers, with which it is marked.
    """
    from gimbalcal.report.calibration_page import calibration_report

    page = calibration_report(calibration, recordings, truth)
    write_report("calibration.json", calibration.to_dict(), page, out, question)


def write_diagnosis(diagnosis: Diagnosis, out: Path, title: str) -> None:
    """Write diagnosis.json, calibration.json of its refit, law.py and report.html; `title`: of the recording."""
    write_diagnoses([(diagnosis, title, "")], out)


def write_calibrations(
    each: Sequence[tuple[Calibration, Sequence[Recording], str]],
    out: Path,
    question: str,
    keep: Callable[[], None] = lambda: None,
) -> None:
    """Write the calibration of each sensor, of its recordings, into its folder in `out` ("" or a name), all or none.

    keep: called when all is written and before it is in its place: where it fails, nothing is written.
    """
    with atomic_folder(out) as new:
        for calibration, recordings, own in each:
            write_calibration(calibration, recordings, new / own, question=question)
        keep()


def write_diagnoses(
    each: Sequence[tuple[Diagnosis, str, str]], out: Path, question: str = "", keep: Callable[[], None] = lambda: None
) -> None:
    """Write the diagnosis of each sensor, with its title, into its folder in `out` ("" or a name), all or none.

    keep: see `write_calibrations`.
    """
    from gimbalcal.diagnose.laws.law_file import is_found, source_text
    from gimbalcal.report.diagnosis_page import diagnosis_report

    laws = [str(Path(own) / "law.py") for _, _, own in each]
    with atomic_folder(out, belonging=[law for law in laws if is_found(out / law)]) as new:
        for diagnosis, title, own in each:
            page = diagnosis_report(diagnosis, title)
            write_json(new / own / "diagnosis.json", diagnosis.to_dict())
            if diagnosis.calibration is not None:
                diagnosis.calibration.write(new / own / "calibration.json")
            if diagnosis.laws:
                write(new / own / "law.py", source_text(diagnosis.laws))
            write(new / own / "report.html", page_with_question(page, question))
        keep()


def write_report(name: str, content: Json | Sequence[Json], page: str, out: Path, question: str) -> None:
    """Write a result as the JSON `name`, and its page as report.html, into `out`."""
    with atomic_folder(out) as new:
        write_json(new / name, content)
        write(new / "report.html", page_with_question(page, question))


def write_comparison(
    comparison: PrintedComparison, diagnoses: Sequence[tuple[str, str]], out: Path, question: str
) -> None:
    """Write compare.json, report.html and all values as history.csv and history.parquet into `out`."""
    import polars as pl

    from gimbalcal.report.history_page import history_report

    page, rows = history_report(comparison, diagnoses), pl.DataFrame(comparison.columns)
    with atomic_folder(out) as new:
        write_json(new / "compare.json", comparison.to_dict())
        write(new / "history.csv", rows.write_csv())
        rows.write_parquet(new / "history.parquet")
        write(new / "report.html", page_with_question(page, question))
