"""Effects of a user's own in a calibration.json: of which file they are, and that the same file is there again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.loading import outside
from gimbalcal.errors import InputError

SHOWN = 12  # digits of a SHA-256


def refuse_other_definitions(ids: Sequence[str], provenance: Mapping[str, Any]) -> None:
    """Raise InputError where the catalogue lacks an effect of `ids`, or has it of another text than it was fitted in.

    provenance: as a calibration.json tells it, its "effects" {path, sha256, effects} being files of a user's own.
    """
    told = {i: row for row in provenance.get("effects", ()) for i in row["effects"]}
    there = {i: row for row in outside() for i in row["effects"]}
    for i in ids:
        row, now = told.get(i), there.get(i)
        if i not in CATALOGUE:
            file = f"{row['path']} (its SHA-256 was {row['sha256'][:SHOWN]}...)" if row else "FILE.py"
            raise InputError(
                f"calibration holds the effect {i!r}, which the catalogue does not have; give the file that "
                f"defines it with --effects {file}"
            )
        if row and now and now["sha256"] != row["sha256"]:
            raise InputError(
                f"calibration holds the effect {i!r} of {row['path']} (SHA-256 {row['sha256'][:SHOWN]}...), and "
                f"{now['path']} defines it in another text ({now['sha256'][:SHOWN]}...), in which its numbers may mean "
                "something else; give the file as it was, or calibrate again"
            )


def refuse_unsound_definitions(provenance: Mapping[str, Any]) -> None:
    """Raise InputError where what a calibration.json says of files of effects is not of their kind."""
    rows = provenance.get("effects", [])
    sound = isinstance(rows, list) and all(isinstance(r, dict) and isinstance(r.get("effects"), list) for r in rows)
    if not sound or not all(isinstance(x, str) for r in rows for x in (r.get("path"), r.get("sha256"), *r["effects"])):
        raise InputError("provenance / effects must be a list of files, each with its path, sha256 and effects")
