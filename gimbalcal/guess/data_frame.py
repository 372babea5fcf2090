"""Guess the columns of an undescribed data frame as those of a log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from gimbalcal.errors import InputError
from gimbalcal.guess.column_guess import guess_columns
from gimbalcal.guess.proposal import StatedByUser, of_tables
from gimbalcal.guess.stored_arrays import frame_table
from gimbalcal.recording import Recording
from gimbalcal.recording.columns import Column
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import from_si, to_si

UNITS = {"latitude": "deg", "height": "m"}  # of a StatedByUser


def guessed_columns(frame: Any) -> dict[str, Column]:
    """Return what the columns of a frame hold, by names and numbers; those that are no column of the frame are omitted.

    Raises InputError where neither force nor rate is among them.
    """
    log = guess_columns(Path("frame"), frame_table(frame), 0.0, frozenset(), {}).log
    known = {name: g for name, g in log.guesses.items() if name in frame.columns}
    if not {g.quantity for g in known.values()} & {FORCE, RATE}:
        listed = ", ".join(map(str, frame.columns))
        raise InputError(
            f"no column is a force or a rate by its name ({listed}); give columns, which say what they hold"
        )
    return {name: Column(name, g.quantity, g.axis, g.unit) for name, g in known.items()}


def guessed_frame(frame: Any, title: str = "frame", site: Mapping[str, tuple[float, str]] | None = None) -> Recording:
    """Return the recording in a frame or a mapping of columns, with remarks on what each was taken for and why.

    site: latitude and height with their units. Raises InputError as `propose_recording` does.
    """
    site = site or {}
    if unknown := set(site) - set(UNITS):
        raise InputError(f"site holds {min(unknown)!r}; with guessed columns it takes latitude and height")
    where = {key: float(from_si(to_si(*stated), UNITS[key])) for key, stated in site.items()}
    place = StatedByUser(where.get("latitude"), where.get("height"))
    proposal = of_tables({Path(title): frame_table(frame)}, title, 0.0, place)
    taken = tuple(f"{name} is taken for {g.in_words}, by {g.why}" for name, g in proposal.guesses.items())
    notes = tuple(f"{what}: {note}" for what, note in proposal.notes.items())
    left_out = (f"left out: {', '.join(proposal.left_out)}",) if proposal.left_out else ()
    recording = proposal.recording
    return replace(recording, remarks=(*taken, *notes, *left_out, *recording.remarks))
