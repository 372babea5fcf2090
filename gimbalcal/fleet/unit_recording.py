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
UNIT_NAMES = ("folder", "parent", "title")


@dataclass(frozen=True)
class UnitRecording:
    """A recording of a unit: its folder, and the files that its results depend on."""

    folder: str
    unit: str
    files: tuple[Source, ...]


@dataclass(frozen=True, eq=False)
class BatchTask:
    """What is done with each recording; effects: name and text of each file of a user's effects, for the workers."""

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

    A pattern without wildcards is a recording, whatever is there. unit_name: what a unit is called after, one of
    `UNIT_NAMES`. Raises InputError where there is none.
    """
    folders: dict[Path, str] = {}
    for pattern in patterns:
        exact = not glob.has_magic(pattern) or Path(pattern).exists()
        matches = [pattern] if exact else sorted(glob.glob(pattern, recursive=True))  # noqa: PTH207  absolute patterns and ** as a shell has them
        for path in map(Path, matches):
            folder = path.parent if path.name == NAME else path
            if exact or (folder / NAME).is_file():
                folders.setdefault(folder.resolve(), str(folder))
    if not folders:
        raise InputError(
            f"no folder that matches {' '.join(patterns)} holds a {NAME}; give a pattern such as 'rigs/*' in quotes"
        )
    return [_unit_recording(folder, unit_name) for folder in folders.values()]


def _unit_recording(folder: str, unit_name: str) -> UnitRecording:
    path = Path(folder)
    named = {"folder": path.resolve().name, "parent": path.resolve().parent.name}
    try:
        header = read_header(path)
    except (InputError, OSError):  # the sentence comes when it is read
        files = [path / NAME] if (path / NAME).is_file() else []
        return UnitRecording(folder, named.get(unit_name, path.resolve().name), tuple(map(Source.of, files)))
    files = [path / NAME, header.samples]
    return UnitRecording(folder, named.get(unit_name, header.title), tuple(map(Source.of, files)))


def entries_of(task: BatchTask, recording: UnitRecording) -> tuple[StoredResult, ...]:
    """Calibrate and diagnose a recording; what fails is an entry with the sentence that says why."""
    from threadpoolctl import threadpool_limits

    for name, text in task.effects:
        load_text(name, text)
    entries: list[StoredResult] = []
    try:
        with threadpool_limits(limits=1):  # small matrices: a second thread only waits, and sums in another order
            for kind, sensor, content in _results(task, recording):
                entries.append(_entry(task, recording, kind, content, sensor))
    except InputError as problem:
        entries.append(failed(task, recording, str(problem)))
    except OSError as problem:
        why = f"{problem.filename or recording.folder} cannot be read ({problem.strerror or problem})"
        entries.append(failed(task, recording, why))
    except MemoryError:
        entries.append(failed(task, recording, "there is not enough memory for this recording; give it as means"))
    except Exception as problem:  # noqa: BLE001  a defect with one recording must not stop the others
        why = f"a defect of the program, not of the data ({type(problem).__name__}: {problem}); please report it"
        entries.append(failed(task, recording, why))
    return tuple(entries)


def _results(task: BatchTask, recording: UnitRecording) -> Iterable[tuple[str, str, Json]]:
    """Yield kind, sensor and content of each result of a recording."""
    from gimbalcal.diagnose import diagnose
    from gimbalcal.methods import by_sensor, calibrate_each
    from gimbalcal.pipeline import load

    loaded = load([Path(recording.folder)])
    for calibration, group in calibrate_each(loaded, task.method, more=task.more, grade=task.grade):
        yield CALIBRATION, group[0].sensor, calibration.to_dict()
    for group in by_sensor(loaded):
        diagnosis = diagnose(group, seed=task.seed, grade=task.grade)
        yield DIAGNOSIS, group[0].sensor, diagnosis.to_dict()
        if diagnosis.calibration is not None:
            yield CALIBRATION, group[0].sensor, diagnosis.calibration.to_dict()


def failed(task: BatchTask, recording: UnitRecording, why: str) -> StoredResult:
    """Return the entry of a recording that fails."""
    content = {"in_words": why, "provenance": {"recordings": [{"path": f.path, "sha256": f.sha256}
                                                              for f in recording.files]}}  # fmt: skip
    return _entry(task, recording, FAILURE, content)


def _entry(task: BatchTask, recording: UnitRecording, kind: str, content: Json, sensor: str = "") -> StoredResult:
    origin = content["provenance"]
    date = date_in(origin) or datetime.now(UTC).isoformat(timespec="seconds")
    unit = " ".join(filter(None, [recording.unit, sensor]))
    return StoredResult(unit, date, kind, {**content, "provenance": {**origin, BATCH: task.key(recording)}})
