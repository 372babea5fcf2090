"""Calibrations with their dates, from files or from a store of calibrations and diagnoses in one SQLite file.

The file is in WAL mode: readers never wait, two writers wait for one another, and a process killed at any moment leaves
the previous entries intact. Table `parameters` has numbers for queries in SQL; `entries.content` has the whole JSON,
covariance included.
"""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from gimbalcal.calibration import Calibration, from_dict
from gimbalcal.calibration import read as read_calibration
from gimbalcal.entries import Json
from gimbalcal.errors import InputError
from gimbalcal.recording.header import NAME as HEADER

Wanted = Callable[[Calibration], bool]
FORMAT = 2  # of the tables, as SQLite's user_version
READABLE_FORMATS = (1, FORMAT)  # 1: an entry's digest is that of its content, without unit and date
MARK = 0x67696D62  # "gimb", SQLite's application_id: another program's database is not written into
WAIT_S = 60.0  # of a writer for another
CALIBRATION, DIAGNOSIS, FAILURE = "calibration", "diagnosis", "failure"

TABLES = """
create table entries (
    id integer primary key,
    unit text not null,
    date text not null,
    kind text not null,
    method text not null,
    answer text not null,
    recordings text not null,
    content text not null,
    digest text not null,
    unique (unit, kind, digest)
);
create table parameters (
    entry integer not null references entries (id),
    effect text not null, name text not null, axis text not null,
    value real not null, sigma real not null, unit text not null
);
create index parameters_of on parameters (name, axis, entry);
"""


@dataclass(frozen=True)
class StoredResult:
    """One calibration or diagnosis: unit, date, and the content of its JSON, or `in_words` of a failure."""

    unit: str
    date: str  # ISO 8601
    kind: str
    content: Json

    @property
    def is_calibration(self) -> bool:
        """Return whether it is a calibration, whose parameters are kept too."""
        return self.kind == CALIBRATION


def keep(path: Path, *entries: StoredResult) -> bool:
    """Add entries to the store, all or none, which is created if needed; return whether any of them is new.

    The same recordings calibrated again by the same version, to the same numbers, are one entry.
    """
    with _open(path, make=True) as base:
        base.execute("begin immediate")
        base.execute(f"pragma user_version = {FORMAT}")
        new = [_insert(base, entry) for entry in entries]
        base.execute("commit")
    return any(new)


def _insert(base: sqlite3.Connection, entry: StoredResult) -> bool:
    """Add an entry within a transaction, and return whether it is new."""
    content = dict(entry.content)
    method = str(content.get("method", entry.kind))
    answer = str(content.get("outcome") or content.get("verdict", ""))
    recordings = [r.get("sha256", "") for r in content.get("provenance", {}).get("recordings", ())]
    of_content = _content_digest(content)
    texts = json.dumps(recordings), json.dumps(content), f"{of_content} {_entry_digest(entry, of_content)}"
    row = (entry.unit, entry.date, entry.kind, method, answer, *texts)
    columns = "(unit, date, kind, method, answer, recordings, content, digest)"
    same = "select 1 from entries where unit = ? and kind = ? and substr(digest, 1, 64) = ?"
    cursor = base.execute(
        f"insert into entries {columns} select ?, ?, ?, ?, ?, ?, ?, ? where not exists ({same})",
        (*row, entry.unit, entry.kind, of_content),
    )
    if cursor.rowcount > 0 and entry.is_calibration:
        base.executemany(
            "insert into parameters values (?, ?, ?, ?, ?, ?, ?)",
            [(cursor.lastrowid, p.get("effect", p["name"]), p["name"], p["axis"], p["value"], p["sigma"], p["unit"])
             for p in content["parameters"]],
        )  # fmt: skip
    return cursor.rowcount > 0


def kept_entries(path: Path, unit: str = "") -> tuple[StoredResult, ...]:
    """Return entries in order of their dates, of one unit if it is named.

    Raises InputError for no store, and for an entry that is not what was kept.
    """
    with _open(path, make=False) as base:
        rows = base.execute("select unit, date, kind, content, digest from entries order by date, id").fetchall()
    entries = []
    for unit_, date, kind_, text, digest in rows:
        try:
            content = json.loads(text)
            entry = StoredResult(unit_, date, kind_, content)
            of_content = _content_digest(content)
            sound = all(isinstance(word, str) for word in (unit_, date, kind_)) and digest in (
                of_content,
                f"{of_content} {_entry_digest(entry, of_content)}",
            )
        except (ValueError, TypeError, AttributeError, RecursionError):
            sound = False
        if not sound:
            raise InputError(
                f"{path} holds an entry of {date!r:.40} that is not what was kept: changed by another program, or "
                "damaged; take the file from a copy, or compare the calibration.json files themselves"
            )
        entries.append(entry)
    return tuple(e for e in entries if unit in ("", e.unit))


def _content_digest(content: Json) -> str:
    """Return the SHA-256 of a result without its date of computation."""
    provenance = {k: v for k, v in content.get("provenance", {}).items() if k != "created"}
    text = json.dumps({**content, "provenance": provenance}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _entry_digest(entry: StoredResult, of_content: str) -> str:
    """Return the SHA-256 of an entry with its unit, date and kind, which stand outside its content."""
    return hashlib.sha256(json.dumps([entry.unit, entry.date, entry.kind, of_content]).encode()).hexdigest()


def refuse_unusable(path: Path) -> None:
    """Raise InputError where an entry could not be added to the store `path`, which stays as it is, or absent."""
    if path.exists():
        with _open(path, make=False) as base:
            base.execute("begin immediate")
            _insert(base, StoredResult("", "", CALIBRATION, {"parameters": ()}))
            base.execute("rollback")
        return
    folder = next(p for p in path.absolute().parents if p.exists() or p.is_symlink())
    if not (folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)):
        why = "does not permit it" if folder.is_dir() else "is not a folder"
        raise InputError(f"--store {path} cannot be made, {folder} {why}; give another file")


@contextmanager
def _open(path: Path, make: bool) -> Iterator[sqlite3.Connection]:
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is a folder or a device, which cannot be a store; give another --store")
    if not path.exists() and not make:
        raise InputError(f"there is no store {path}; `--store {path}` of calibrate and diagnose makes one")
    if make:
        path.parent.mkdir(parents=True, exist_ok=True)
    base = None
    try:
        base = sqlite3.connect(_store_uri(path), timeout=WAIT_S, isolation_level=None, uri=True)
        base.execute("begin")  # one look at all of it: another process may be making the tables just now
        mark, version = (base.execute(f"pragma {name}").fetchone()[0] for name in ("application_id", "user_version"))
        empty = mark == 0 and version == 0 and not base.execute("select * from sqlite_master").fetchone()
        base.execute("commit")
        if empty and make:
            _create_tables(base)
        elif mark != MARK or version not in READABLE_FORMATS:
            formats = " and ".join(map(str, READABLE_FORMATS))
            what = f"of format {version}, and this version reads {formats}" if mark == MARK else "of another program"
            raise InputError(f"{path} is a database {what}; give another --store")
        yield base
    except (sqlite3.DatabaseError, UnicodeDecodeError) as problem:  # a damaged byte of a text is no database error
        damaged = isinstance(problem, UnicodeDecodeError)
        reason = "a text in it is damaged" if damaged else " ".join(str(problem).split())
        raise InputError(f"{path} cannot be used as a store ({reason}); give another --store") from None
    finally:
        if base is not None:
            base.close()


def _store_uri(path: Path) -> str:
    """Return the URI of a store; where nothing can be written and no writer left a log, one that needs no lock."""
    fixed = not os.access(path.parent, os.W_OK) and path.is_file() and not path.with_name(f"{path.name}-wal").exists()
    return path.absolute().as_uri() + ("?mode=ro&immutable=1" if fixed else "")


def _create_tables(base: sqlite3.Connection) -> None:
    """Create the tables, in the first of several processes."""
    until = time.monotonic() + WAIT_S
    while True:  # whoever makes the store at the same time: sqlite does not wait by itself where the mode changes
        try:
            base.execute("pragma journal_mode = wal")
            break
        except sqlite3.OperationalError as problem:
            if problem.sqlite_errorcode not in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED) or time.monotonic() > until:
                raise
            time.sleep(0.01)
    base.execute("begin immediate")
    if not base.execute("select * from sqlite_master").fetchone():
        for statement in TABLES.split(";"):
            base.execute(statement)
        base.execute(f"pragma application_id = {MARK}")
        base.execute(f"pragma user_version = {FORMAT}")
    base.execute("commit")


# --- calibrations with their dates ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DatedCalibration:
    """A calibration with its date, and its name: a file, or its date in a store."""

    name: str
    date: datetime
    calibration: Calibration

    @property
    def hashes(self) -> frozenset[str]:
        """Return the hashes of its samples; headers may be equal."""
        files = self.calibration.provenance.recordings
        return frozenset(f.sha256 for f in files if f.sha256 and Path(f.path).name != HEADER)


def dated_file(path: Path) -> DatedCalibration:
    """Read a calibration.json with its date, else that of the file. Raises InputError."""
    calibration = read_calibration(path)
    return DatedCalibration(str(path), date_of(calibration.provenance.date, path), calibration)


def date_in(provenance: Json) -> str:
    """Return the date of its recordings, else that of the computation; empty where neither is stated."""
    return str(provenance.get("recorded") or provenance.get("created") or "")


def of_store(path: Path, unit: str = "") -> tuple[tuple[DatedCalibration, ...], tuple[tuple[str, str], ...]]:
    """Return the calibrations of a unit in a store, and date and answer of its diagnoses, in order of their dates.

    Raises InputError where the store holds several units and none is named, or none of this name.
    """
    entries = kept_entries(path, unit)
    units = sorted({e.unit for e in entries})
    if len(units) > 1:
        raise InputError(
            f"{path} holds the units {', '.join(u or 'without a name' for u in units)}: name one by --unit"
        )
    if not entries:
        raise InputError(f"{path} holds nothing{f' of {unit}' if unit else ''}")
    diagnoses = tuple((e.date, str(e.content.get("in_words", ""))) for e in entries if e.kind == DIAGNOSIS)
    return dated_calibrations(entries), diagnoses


def calibrations_by_unit(path: Path, wanted: Wanted) -> dict[str, tuple[DatedCalibration, ...]]:
    """Return the wanted calibrations of every unit in a store, in order of their dates; see `dated_calibrations`."""
    by_unit: dict[str, list[StoredResult]] = {}
    for e in kept_entries(path):
        by_unit.setdefault(e.unit, []).append(e)
    return {unit: dated_calibrations(entries, wanted) for unit, entries in by_unit.items()}


def dated_calibrations(
    entries: Iterable[StoredResult], wanted: Wanted = lambda _: True
) -> tuple[DatedCalibration, ...]:
    """Return the wanted calibrations among the entries of one unit, in order of their dates.

    Of the same recordings the last computed one is taken, and that of a diagnosis only where there is no other.
    """
    last: dict[tuple[str, ...], DatedCalibration] = {}
    computed = sorted(entries, key=lambda e: str(e.content.get("provenance", {}).get("created") or e.date))
    for e in (e for e in computed if e.is_calibration):
        entry_calibration = DatedCalibration(e.date, date_of(e.date), from_dict(e.content))
        if not wanted(entry_calibration.calibration):
            continue
        key = tuple(sorted(entry_calibration.hashes)) or (e.date,)
        if (
            key not in last
            or entry_calibration.calibration.method != "diagnosis"
            or last[key].calibration.method == "diagnosis"
        ):
            last[key] = entry_calibration
    return tuple(sorted(last.values(), key=lambda d: d.date))


def date_of(text: str, path: Path | None = None) -> datetime:
    """Return a date of ISO 8601, without a zone in UTC; else the date of the file."""
    try:
        date = datetime.fromisoformat(text)
    except ValueError:
        if path is None:
            raise InputError(f"{text!r} is not a date of ISO 8601, such as 2026-11-22") from None
        return datetime.fromtimestamp(path.stat().st_mtime, UTC)
    return date if date.tzinfo else date.replace(tzinfo=UTC)
