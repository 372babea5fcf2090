"""Calibrations with their dates, from files or from a store."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from gimbalcal.calibration import Calibration, from_dict
from gimbalcal.calibration import read as read_calibration
from gimbalcal.entries import Json
from gimbalcal.errors import InputError
from gimbalcal.history.unit_store import kept
from gimbalcal.recording.header import NAME as HEADER


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
    return DatedCalibration(str(path), when(calibration.provenance.date, path), calibration)


def date_in(provenance: Json) -> str:
    """Return the date of its recordings, else that of the computation; empty where neither is stated."""
    return str(provenance.get("recorded") or provenance.get("created") or "")


def of_store(path: Path, unit: str = "") -> tuple[tuple[DatedCalibration, ...], tuple[tuple[str, str], ...]]:
    """Return the calibrations of a unit in a store, and date and answer of its diagnoses, in order of their dates.

    Of the same recordings the last computed one is taken, and that of a diagnosis only where there is no other.
    Raises InputError where the store holds several units and none is named, or none of this name.
    """
    entries = kept(path, unit)
    units = sorted({e.unit for e in entries})
    if len(units) > 1:
        raise InputError(
            f"{path} holds the units {', '.join(u or 'without a name' for u in units)}: name one by --unit"
        )
    if not entries:
        raise InputError(f"{path} holds nothing{f' of {unit}' if unit else ''}")
    last: dict[tuple[str, ...], DatedCalibration] = {}
    computed = sorted(entries, key=lambda e: str(e.content.get("provenance", {}).get("created") or e.date))
    for e in (e for e in computed if e.is_calibration):
        entry_calibration = DatedCalibration(e.date, when(e.date), from_dict(e.content))
        key = tuple(sorted(entry_calibration.hashes)) or (e.date,)
        if (
            key not in last
            or entry_calibration.calibration.method != "diagnosis"
            or last[key].calibration.method == "diagnosis"
        ):
            last[key] = entry_calibration
    diagnoses = tuple((e.date, str(e.content.get("in_words", ""))) for e in entries if not e.is_calibration)
    return tuple(sorted(last.values(), key=lambda d: d.date)), diagnoses


def when(text: str, path: Path | None = None) -> datetime:
    """Return a date of ISO 8601, without a zone in UTC; else the date of the file."""
    try:
        date = datetime.fromisoformat(text)
    except ValueError:
        if path is None:
            raise InputError(f"{text!r} is not a date of ISO 8601, such as 2026-11-22") from None
        return datetime.fromtimestamp(path.stat().st_mtime, UTC)
    return date if date.tzinfo else date.replace(tzinfo=UTC)
