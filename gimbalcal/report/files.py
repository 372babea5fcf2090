"""Results as files: the JSON of the contract and the page beside it, each whole or not there at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gimbalcal.atomic import write, write_json

if TYPE_CHECKING:
    from gimbalcal.calibration import Calibration
    from gimbalcal.diagnose import Diagnosis
    from gimbalcal.recording import Recording


def write_calibration(
    calibration: Calibration, recordings: Sequence[Recording], out: Path, truth: Mapping[str, float] | None = None
) -> None:
    """calibration.json and report.html into `out`; the page is made first, so that both are written or neither."""
    from gimbalcal.report.calibration_page import calibration_report

    content = calibration.to_dict()
    page = calibration_report(content, recordings, truth)
    write_json(out / "calibration.json", content)
    write(out / "report.html", page)


def write_diagnosis(diagnosis: Diagnosis, out: Path, title: str = "") -> None:
    """diagnosis.json, the calibration.json of its refit and report.html into `out`; `title` says of which recording."""
    from gimbalcal.report.diagnosis_page import diagnosis_report, panels

    drawn = panels(diagnosis.curves, diagnosis.mismatch) if diagnosis.curves else ()
    page = diagnosis_report(diagnosis.to_dict(), drawn, title)
    write_json(out / "diagnosis.json", diagnosis.to_dict())
    if diagnosis.calibration is not None:
        diagnosis.calibration.write(out / "calibration.json")
    write(out / "report.html", page)
