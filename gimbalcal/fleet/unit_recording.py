"""Calibrate and diagnose one recording of a batch: text and options in, entries of the store out."""

from __future__ import annotations

import glob
import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from gimbalcal.effects.loading import load_text
from gimbalcal.entries import Json
from gimbalcal.errors import InputError
from gimbalcal.history import CALIBRATION, DIAGNOSIS, FAILURE, StoredResult, date_in
from gimbalcal.history.fleet import Fleet
from gimbalcal.recording import Source
from gimbalcal.recording.header import NAME, read_header

BATCH = "batch"  # key of a provenance: which recording and options a result belongs to


@dataclass(frozen=True)
class UnitRecording:
    """A recording of a unit: its folder, and the files that its results depend on."""

    folder: str
    unit: str
    files: tuple[Source, ...]


@dataclass(frozen=True, eq=False)
class BatchTask:
    """The options by which each recording of a batch is calibrated and diagnosed.

    effects: name and text of each file of a user's effects, which the workers load.
    """

    method: str = ""
    more: tuple[str, ...] = ()
    grade: str | Fleet = ""
    seed: int = 1
    effects: tuple[tuple[str, str], ...] = ()

    def key(self, recording: UnitRecording) -> str:
        """Return the SHA-256 of everything that the results of a recording depend on."""
        from gimbalcal import __version__

        grade = self.grade.identity if isinstance(self.grade, Fleet) else self.grade
        own = [hashlib.sha256(text.encode()).hexdigest() for _, text in self.effects]
        files = [source.sha256 for source in recording.files]
        text = json.dumps([__version__, recording.unit, files, self.method, self.more, grade, self.seed, own])
        return hashlib.sha256(text.encode()).hexdigest()


def recordings_of(patterns: Sequence[str], unit_name: str = "folder") -> list[UnitRecording]:
    """Return the recordings whose folders match any of the patterns, in order of their names.

    A pattern without wildcards is a recording, whatever is there. unit_name: what a unit is called after,
    "folder", "parent" (the folder around it) or "title". Raises InputError for a pattern that matches none.
    """
    folders: dict[Path, str] = {}
    without_match = []
    for pattern in patterns:
        exact = not glob.has_magic(pattern) or Path(pattern).exists()
        matches = [pattern] if exact else sorted(glob.glob(pattern, recursive=True))  # noqa: PTH207  absolute patterns and ** as a shell has them
        matching = [path.parent if path.name == NAME else path for path in map(Path, matches)]
        recorded = [folder for folder in matching if exact or (folder / NAME).is_file()]
        for folder in recorded:
            folders.setdefault(folder.resolve(), str(folder))
        if not recorded:
            without_match.append(pattern)
    if without_match:
        raise InputError(
            f"no folder that matches {' or '.join(without_match)} holds a {NAME}; give a pattern such as 'rigs/*' in "
            "quotes"
        )
    return [_unit_recording(folder, unit_name) for folder in folders.values()]


def _unit_recording(folder: str, unit_name: str) -> UnitRecording:
    path = Path(folder)
    named = {"folder": path.resolve().name, "parent": path.resolve().parent.name}
    files = [path / NAME]
    try:
        header = read_header(path)
        named["title"] = header.title
        files.append(header.samples)
    except (InputError, OSError):  # reported as a failure when the recording is loaded
        pass
    return UnitRecording(folder, named.get(unit_name, named["folder"]), tuple(map(_source, files)))


def _source(path: Path) -> Source:
    """Return a file with its SHA-256, which is empty where the file cannot be read."""
    try:
        return Source.of(path)
    except OSError:
        return Source(path.name, "")


def entries_of(task: BatchTask, recording: UnitRecording) -> tuple[StoredResult, ...]:
    """Calibrate and diagnose a recording; what fails is an entry with the sentence that says why."""
    from threadpoolctl import threadpool_limits

    for name, text in task.effects:
        load_text(name, text)
    with threadpool_limits(limits=1):  # small matrices: a second thread only waits, and sums in another order
        return tuple(_results(task, recording))


def _results(task: BatchTask, recording: UnitRecording) -> Iterable[StoredResult]:
    """Yield each result of a recording: of each sensor, calibration and diagnosis or the failure of either."""
    from gimbalcal.diagnose import diagnose
    from gimbalcal.methods import by_sensor, calibrate_each
    from gimbalcal.pipeline import load

    try:
        loaded = load([Path(recording.folder)])
        calibrated = calibrate_each(loaded, task.method, more=task.more, grade=task.grade)
    except Exception as problem:  # noqa: BLE001  a defect with one recording must not stop the others
        yield _entry_of_problem(task, recording, problem)
        return
    for calibration, group in calibrated:
        yield _entry(task, recording, CALIBRATION, calibration.to_dict(), group[0].sensor)
    for group in by_sensor(loaded):
        sensor = group[0].sensor
        try:
            diagnosis = diagnose(group, seed=task.seed, grade=task.grade)
        except Exception as problem:  # noqa: BLE001  nor must one sensor stop the others
            yield _entry_of_problem(task, recording, problem, sensor)
            continue
        yield _entry(task, recording, DIAGNOSIS, diagnosis.to_dict(), sensor)
        if diagnosis.calibration is not None:
            yield _entry(task, recording, CALIBRATION, diagnosis.calibration.to_dict(), sensor)


def _entry_of_problem(task: BatchTask, recording: UnitRecording, problem: Exception, sensor: str = "") -> StoredResult:
    """Return the entry of a problem; only what follows from the files is lasting."""
    if isinstance(problem, InputError):
        return failure_entry(task, recording, str(problem), sensor, lasting=True)
    if isinstance(problem, OSError):
        why = f"{problem.filename or recording.folder} cannot be read ({problem.strerror or problem})"
    elif isinstance(problem, MemoryError):
        why = "there is not enough memory for this recording; give it as means"
    else:
        why = f"a defect of the program, not of the data ({type(problem).__name__}: {problem}); please report it"
    return failure_entry(task, recording, why, sensor)


def failure_entry(
    task: BatchTask, recording: UnitRecording, why: str, sensor: str = "", *, lasting: bool = False
) -> StoredResult:
    """Return the entry of a failure of a recording, or of one of its sensors; lasting: it follows from the files."""
    files = [{"path": f.path, "sha256": f.sha256} for f in recording.files]
    content = {"in_words": why, "lasting": lasting, "provenance": {"recordings": files}}
    return _entry(task, recording, FAILURE, content, sensor)


def may_pass(entry: StoredResult) -> bool:
    """Return whether an entry is a failure that another machine, or another day, may not have."""
    return entry.kind == FAILURE and not entry.content["lasting"]


def _entry(task: BatchTask, recording: UnitRecording, kind: str, content: Json, sensor: str = "") -> StoredResult:
    origin = content["provenance"]
    date = date_in(origin) or datetime.now(UTC).isoformat(timespec="seconds")
    unit = " ".join(filter(None, [recording.unit, sensor]))
    return StoredResult(unit, date, kind, {**content, "provenance": {**origin, BATCH: task.key(recording)}})
