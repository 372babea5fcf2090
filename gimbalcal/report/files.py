"""Results as files: the JSON of the contract and the page beside it, each whole or not there at all."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gimbalcal.calibration import Calibration
    from gimbalcal.diagnose import Diagnosis
    from gimbalcal.recording import Recording


def write_text(path: Path, text: str) -> None:
    """Write to a temporary name, then rename, so that an interruption leaves the old file or none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON whole or not at all."""
    write_text(path, json.dumps(content, indent=1))


def write_calibration(
    calibration: Calibration, recordings: Sequence[Recording], out: Path, truth: Mapping[str, float] | None = None
) -> None:
    """calibration.json and report.html into `out`; the page is made first, so that both are written or neither."""
    from gimbalcal.report.calibration_page import calibration_report

    content = calibration.to_dict()
    page = calibration_report(content, recordings, truth)
    write_json(out / "calibration.json", content)
    write_text(out / "report.html", page)


def write_diagnosis(diagnosis: Diagnosis, out: Path, title: str = "") -> None:
    """diagnosis.json and report.html into `out`; `title` says of which recording."""
    from gimbalcal.report.diagnosis_page import diagnosis_report, panels

    drawn = panels(diagnosis.curves, diagnosis.mismatch) if diagnosis.curves else ()
    page = diagnosis_report(diagnosis.to_dict(), drawn, title)
    write_json(out / "diagnosis.json", diagnosis.to_dict())
    write_text(out / "report.html", page)
