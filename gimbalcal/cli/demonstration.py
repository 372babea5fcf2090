"""`gimbalcal demo`: the three stages, a real recording, and a diagnosis, on the recordings of the package."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

import gimbalcal
from gimbalcal.cli.options import example
from gimbalcal.cli.output_folders import Output, output_options
from gimbalcal.entries import Json
from gimbalcal.progress import Progress

if TYPE_CHECKING:
    from gimbalcal.calibration import Calibration
    from gimbalcal.diagnose import Diagnosis


def shipped() -> Path:
    """Return the folder of the package's recordings: inside an installed package, or data/ of the project."""
    inside = Path(gimbalcal.__file__).parent / "shipped"
    return inside if inside.exists() else Path(gimbalcal.__file__).parent.parent / "data"


def demonstrate(out: Path, progress: Progress) -> tuple[Json, str]:
    """Calibrate and diagnose the package's recordings, a folder each under `out`; return a summary and its sentence."""
    from gimbalcal.atomic import atomic_folder
    from gimbalcal.words.calibration_sentences import calibration_in_words
    from gimbalcal.words.diagnosis_headline import headline

    data = shipped()
    with atomic_folder(out) as new:  # all three are of one run
        progress("three stages: 18 positions and a static run of a space-stable platform (simulated, truth known)")
        platform = _calibrate([data / "space_stable_18", data / "space_stable_static"], "three-stage", new, progress)
        progress("a real recording: an Xsens unit turned by hand, no angles")
        xsens = _calibrate([data / "xsens_positions"], "multiposition", new / "xsens", progress)
        progress("diagnosis: 18 positions in which an effect is concealed")
        diagnosis = _diagnose(data / "space_stable_concealed", new / "diagnosis", progress)
    summary = {"space_stable": platform.to_dict(), "xsens": xsens.to_dict(), "diagnosis": diagnosis.to_dict()}
    sentence = "\n".join([
        f"space-stable platform: {calibration_in_words(platform)}",
        f"Xsens unit, real: {calibration_in_words(xsens)}",
        f"concealed effect: {headline(diagnosis)}",
        f"open {out / 'report.html'}, {out / 'xsens' / 'report.html'} and {out / 'diagnosis' / 'report.html'}",
    ])  # fmt: skip
    return summary, sentence


def _calibrate(folders: list[Path], method: str, out: Path, progress: Progress) -> Calibration:
    from gimbalcal.methods import calibrate
    from gimbalcal.report.files import write_calibration

    calibration, recordings = calibrate(folders, method, (), progress)
    write_calibration(calibration, recordings, out, _truth(folders))
    return calibration


def _truth(folders: list[Path]) -> dict[str, float] | None:
    """Return the truth of simulated recordings, label to SI; the first value of each parameter."""
    from gimbalcal.units import to_si
    from gimbalcal.words.naming import label_of

    truth: dict[str, float] = {}
    for path in (folder / "truth.json" for folder in folders):
        for p in json.loads(path.read_text(encoding="utf-8"))["parameters"] if path.exists() else ():
            truth.setdefault(label_of(p), float(to_si(p["value"], p["unit"])))
    return truth or None


def _diagnose(folder: Path, out: Path, progress: Progress) -> Diagnosis:
    from gimbalcal.diagnose import diagnose
    from gimbalcal.pipeline import load
    from gimbalcal.report.files import write_diagnosis

    recordings = load([folder], progress)
    diagnosis = diagnose(recordings, progress=progress)
    write_diagnosis(diagnosis, out, recordings[0].title)
    return diagnosis


@click.command(epilog=example("gimbalcal demo --out out/demo"))
@output_options("the reports", "out/demo", replaces=False)
def demo(output: Output) -> None:
    """Calibrate and diagnose the recordings that ship with the package."""
    summary, sentence = demonstrate(output.out or Path("out/demo"), output.progress)
    output.show(summary, sentence)
