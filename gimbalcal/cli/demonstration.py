"""What `gimbalcal demo` shows: the three stages, a real recording, and a diagnosis, on the recordings that ship."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gimbalcal

if TYPE_CHECKING:
    from gimbalcal.diagnose import Diagnosis

Tell = Callable[[str], None]


def shipped() -> Path:
    """Folder of the recordings that ship: inside an installed package, or data/ of the project."""
    inside = Path(gimbalcal.__file__).parent / "shipped"
    return inside if inside.exists() else Path(gimbalcal.__file__).parent.parent / "data"


def demonstrate(out: Path, tell: Tell) -> tuple[dict[str, Any], str]:
    """Calibrate and diagnose what ships, a folder each under `out`; returns a summary and the sentence to print."""
    from gimbalcal.atomic import folder
    from gimbalcal.report.words import calibration_in_words, headline

    data = shipped()
    with folder(out) as new:  # all three are of one run
        tell("three stages: 18 positions and a static run of a space-stable platform (simulated, truth known)")
        platform = _calibrate([data / "space_stable_18", data / "space_stable_static"], "three-stage", new, tell)
        tell("a real recording: an Xsens unit turned by hand, no angles")
        xsens = _calibrate([data / "xsens_positions"], "multiposition", new / "xsens", tell)
        tell("diagnosis: 18 positions in which an effect is concealed")
        found = _diagnose(data / "space_stable_concealed", new / "diagnosis", tell)
    summary = {"space_stable": platform, "xsens": xsens, "diagnosis": found.to_dict()}
    sentence = "\n".join([
        f"space-stable platform: {calibration_in_words(platform)}",
        f"Xsens unit, real: {calibration_in_words(xsens)}",
        f"concealed effect: {headline(found.to_dict(), found.curves)}",
        f"open {out / 'report.html'}, {out / 'xsens' / 'report.html'} and {out / 'diagnosis' / 'report.html'}",
    ])  # fmt: skip
    return summary, sentence


def _calibrate(folders: list[Path], method: str, out: Path, tell: Tell) -> dict[str, Any]:
    from gimbalcal.methods import calibrate
    from gimbalcal.report.files import write_calibration

    calibration, recordings = calibrate(folders, method, (), tell)
    write_calibration(calibration, recordings, out, _truth(folders))
    return calibration.to_dict()


def _truth(folders: list[Path]) -> dict[str, float] | None:
    """What went into simulated recordings, label to SI; the first one that tells a parameter counts."""
    from gimbalcal.report.naming import label_of
    from gimbalcal.units import to_si

    told: dict[str, float] = {}
    for path in (folder / "truth.json" for folder in folders):
        for p in json.loads(path.read_text())["parameters"] if path.exists() else ():
            told.setdefault(label_of(p), float(to_si(p["value"], p["unit"])))
    return told or None


def _diagnose(folder: Path, out: Path, tell: Tell) -> Diagnosis:
    from gimbalcal.diagnose import diagnose
    from gimbalcal.pipeline import load
    from gimbalcal.report.files import write_diagnosis

    recordings = load([folder], tell)
    found = diagnose(recordings, tell=tell)
    write_diagnosis(found, out, recordings[0].title)
    return found
