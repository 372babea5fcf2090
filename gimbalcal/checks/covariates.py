"""Temperatures and clocks that cannot be right: they enter no force, so nothing else would notice them."""

from __future__ import annotations

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.recording.dwell import dwells
from gimbalcal.recording.record import Recording
from gimbalcal.units import from_si

TEMPERATURE = ("temperature", "")
WARMEST, COLDEST = 200.0, -100.0  # degC; sensors of oil wells, and of no place on Earth
LONGEST, SHORTEST = 5 * 86400.0, 0.2  # s that positions are held, the middle one of them
FEW, SHOWN = 0.1, 3  # of the rows; more were on the way. Times that are told
ENOUGH = 20  # rows of a position that tell how long it was held


def check_temperature(recording: Recording) -> tuple[str, ...]:
    """Raise InputError for temperatures in kelvin called degC; a sentence where those in K look like degC."""
    if TEMPERATURE not in recording.channels:
        return ()
    value = recording.channels[TEMPERATURE]
    known = value[np.isfinite(value)]
    if not len(known):
        return ()
    middle, unit = float(np.median(known)), recording.units.get(TEMPERATURE, "degC")
    if middle > WARMEST:
        told = float(from_si(middle, unit))
        likely = 'the numbers look like kelvin: write unit = "K"' if unit == "degC" and told < 500 else "correct it"
        raise InputError(
            f"{recording.label}: the temperature is {middle:.4g} degC in most rows, read in the unit {unit!r}, and no "
            f"sensor works there; {likely} for its column"
        )
    if middle < COLDEST:
        told = float(from_si(middle, unit))
        likely = "; the numbers look like degC, and then its unit is not K" if unit == "K" and told < WARMEST else ""
        return (f"the temperature is {middle:.4g} degC in most rows, read in the unit {unit!r}: is that so?{likely}",)
    return ()


def check_clock(recording: Recording) -> tuple[str, ...]:
    """A sentence where positions are held for days, or for milliseconds; nothing at rest tells the unit of a clock."""
    if not recording.kind.in_positions or recording.position is None:
        return ()
    held = [float(np.ptp(recording.time[d.rows])) for d in dwells(recording)]
    rows = [d.stop - d.start for d in dwells(recording)]
    if not held:
        return ()
    middle = float(np.median(held))
    if middle > LONGEST:
        likely = 'if the time is in ms, write unit = "ms" for its column'
        return (f"each position is held for {middle / 86400:.3g} days by the clock: is that so? {likely}",)
    if 0 < middle < SHORTEST and np.median(rows) > ENOUGH:
        likely = "if the time is in s, or in min, correct the unit of its column"
        return (f"each position is held for {middle:.2g} s by the clock: is that so? {likely}",)
    return ()


def check_marked(recording: Recording) -> tuple[str, ...]:
    """A sentence where a table that holds each rest in a row has rows that are marked 0, as if on the way."""
    if not recording.kind.in_positions or recording.position is None:
        return ()
    gone = np.flatnonzero(recording.position == 0)
    if not len(gone) or any(d.stop - d.start > 1 for d in dwells(recording)) or len(gone) > FEW * len(recording.time):
        return ()
    at = ", ".join(f"{t:.10g}" for t in recording.time[gone[:SHOWN]])
    is_are = "row is" if len(gone) == 1 else "rows are"
    where = at if len(gone) <= SHOWN else f"{at} and so on"
    return (f"{len(gone)} {is_are} marked 0, as on the way, where each rest is one row (at {where} s): left out",)
