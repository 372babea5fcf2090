"""What `import gimbalcal` offers: the commands as functions, on folders or on recordings made from arrays.

    import gimbalcal
    units = {"specific_force": "g", "angular_rate": "deg/s"}
    r = gimbalcal.from_arrays(t, specific_force=f, angular_rate=w, units=units)
    calibration = gimbalcal.calibrate(r)
    print(calibration)                       # a table; .to_frame(), .plot(), .write(path)
    found = gimbalcal.diagnose(r)
    true = calibration.apply({"time": t, "specific_force": f, "angular_rate": w}, units=units)  # in g and deg/s too

What a file would be refused for, arrays are refused for, by an InputError with the same sentence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gimbalcal import methods
from gimbalcal.calibration import Calibration, exchange
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.entry import diagnose as run_diagnosis
from gimbalcal.errors import InputError
from gimbalcal.pipeline import Source, Tell, load, silent
from gimbalcal.recording import Recording
from gimbalcal.recording.frames import Entry
from gimbalcal.recording.frames import from_frame as from_described_frame

__all__ = ["calibrate", "diagnose", "from_frame", "read_calibration"]


def calibrate(
    recordings: Source | Sequence[Source], method: str = "", terms: Sequence[str] = (), more: Sequence[str] = (),
    states: str = "51", grade: str = "", tell: Tell = silent,
) -> Calibration:  # fmt: skip
    """The calibration of a unit or a mount from one recording or several, folders or what `read` returns.

    method: as `gimbalcal calibrate --method`; left out, what `methods.usual_method` says of such recordings. terms,
    more, states, grade: as `--terms`, `--with`, `--states`, `--grade`. Raises InputError as the command does; of
    several sensors logged side by side the first is returned.
    """
    return _printing(methods.calibrate(_listed(recordings), method, terms, tell, more, states, grade)[0])


def diagnose(
    recordings: Source | Sequence[Source], calibration: Calibration | None = None, baseline: Sequence[str] = (),
    seed: int = 1, grade: str = "", tell: Tell = silent,
) -> Diagnosis:  # fmt: skip
    """Return what the model of one recording, or of several of one unit, misses, as `gimbalcal diagnose` says it."""
    from gimbalcal.report.console import diagnosis_in_words

    result = run_diagnosis(load(_listed(recordings), tell), calibration, baseline, seed, tell, grade)
    refit = result.calibration and _printing(result.calibration)
    return replace(result, printer=diagnosis_in_words, calibration=refit)


def from_frame(frame: Any, columns: Mapping[str, Entry] | None = None, **options: Any) -> Recording:
    """Return a recording whose rows are those of a data frame (pandas, polars) or of a mapping of names to columns.

    columns: for each name what it holds, ``"specific_force x [g]"``, ``"time [s]"``; all options are those of
    `recording.from_frame`. Without columns they are guessed as `gimbalcal new` guesses those of a log, by names,
    numbers and what gravity does; what each was taken for stands in `remarks`. Then the options are title and site.
    """
    if columns is not None:
        return from_described_frame(frame, columns, **options)
    from gimbalcal.guess.data_frame import guessed_frame

    if unknown := set(options) - {"title", "site"}:
        raise InputError(f"{min(unknown)} needs columns, which say what the frame holds; without, give title and site")
    return guessed_frame(frame, **options)


def read_calibration(path: str | Path) -> Calibration:
    """Return the calibration in a calibration.json or a file of Kalibr (.yaml), PSINS (.mat), TPOINT (.mod) or .csv."""
    return _printing(exchange.read_calibration(Path(path)))


def _printing(calibration: Calibration) -> Calibration:
    """Return the calibration with the text of the console as its `str`."""
    from gimbalcal.report.console import calibration_in_words

    return replace(calibration, printer=calibration_in_words)


def _listed(recordings: Source | Sequence[Source]) -> Sequence[Source]:
    if isinstance(recordings, (str, Path, Recording)):
        return [recordings]
    if isinstance(recordings, Mapping) or hasattr(recordings, "columns"):
        raise InputError("a table is no recording yet: gimbalcal.from_frame(table) makes one and guesses what it holds")
    if not recordings:
        raise InputError("give at least one recording: a folder, or what from_arrays, from_frame or read returns")
    return recordings
