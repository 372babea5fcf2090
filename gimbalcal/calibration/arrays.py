"""Apply a calibration to arrays in stated units, with one row for each time."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

import numpy as np

from gimbalcal.calibration.correction import correct
from gimbalcal.earth import G0
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import BENCH, KNOWN
from gimbalcal.quantities import QUANTITIES, refuse_unit
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.dates import Dates, names_iso
from gimbalcal.recording.frames import Entry, by_axis, column_values, described_columns
from gimbalcal.recording.kinds import ROTATION
from gimbalcal.recording.record import ANGLE, FORCE, RATE, Key
from gimbalcal.units import celsius, from_si, is_raw, to_si

if TYPE_CHECKING:
    from gimbalcal.calibration.calibration import Calibration


class Frame(Protocol):
    """A data frame of pandas or of polars."""

    @property
    def columns(self) -> Any:
        """The names of its columns."""

    def __getitem__(self, name: Any) -> Any: ...


FrameT = TypeVar("FrameT", bound=Frame)
MAX_RATE = 35.0  # rad/s, 2000 deg/s: the range of common gyroscopes; larger numbers are probably in deg/s


def correct_arrays(
    calibration: Calibration, readings: Mapping[str, Any], units: Mapping[str, str] | None
) -> dict[str, Array]:
    """Return corrected arrays: time (n,), specific_force and angular_rate (n, 3), others (n,) or by axis.

    units: by quantity, SI and degC where absent. Returns the triads that were given, (n, 3), in their units; counts
    become SI. Raises InputError for another shape or unit and, where no unit is stated, for forces whose norm is
    gravity in another unit and for rates beyond 2000 deg/s.
    """
    given = {quantity: x for quantity, x in readings.items() if quantity != "time"}
    stated = dict(units or {})
    unknown = set(stated) - set(readings)
    if unknown:
        raise InputError(f"units names {min(unknown)!r}, but there is no such array")
    for quantity, unit in stated.items():
        refuse_unit(unit, quantity)
    n = len(next(iter(readings.values()), ()))
    time = to_si(np.asarray(readings.get("time", np.arange(n)), dtype=float), stated.get("time", "s"))
    each = ((q, axis, x) for q, values in given.items() for axis, x in by_axis(q, values, str(n)))
    channels: dict[Key, Array] = {(q, axis): _from_stated_unit(q, x, stated.get(q, "")) for q, axis, x in each}
    logged = {key: stated[key[0]] for key in channels if key[0] in stated}
    corrected = _corrected(calibration, time, channels, logged)
    return {q: _to_unit(corrected.triad(q), stated.get(q, "")) for q in (FORCE, RATE) if corrected.has(q)}


def correct_frame(calibration: Calibration, frame: FrameT, columns: Mapping[str, Entry] | None) -> FrameT:
    """Return a data frame (pandas, polars) whose columns of force and rate are corrected, in their own units.

    columns: what they hold, as in `recording.from_frame`; without, they are guessed as by `gimbalcal new`. Counts
    become SI. Raises InputError as `correct_arrays` does, and for what is no data frame.
    """
    from gimbalcal.guess.data_frame import guessed_columns  # forty modules that nothing else needs

    if hasattr(frame, "collect"):
        raise InputError("apply takes a data frame whose rows are there: call collect() on this one first")
    if not hasattr(frame, "columns") or not (hasattr(frame, "with_columns") or hasattr(frame, "assign")):
        raise InputError(
            "apply takes a recording, a data frame (pandas, polars), or arrays by name as in {'specific_force': f}, "
            f"got {type(frame).__name__}"
        )
    described = guessed_columns(frame) if columns is None else described_columns(frame, columns)
    channels: dict[Key, Array] = {}
    logged: dict[Key, str] = {}
    time = np.arange(float(len(frame[next(iter(described))])))
    for name, column in described.items():
        key = (column.quantity, column.axis)
        if key[0] != "time" and key[0] not in QUANTITIES:
            continue
        clock = replace(column, unit="s") if names_iso(column.unit) or not column.unit else column
        values = column_values("frame", clock if key[0] == "time" else column, np.asarray(frame[name]), Dates())
        if key[0] == "time":
            time = to_si(values, clock.unit)
        else:
            channels[key] = column.sign * _from_stated_unit(key[0], values, column.unit)
            logged[key] = column.unit
    corrected = _corrected(calibration, time, channels, logged)
    new = {
        name: c.sign * _to_unit(corrected.channels[c.quantity, c.axis], c.unit)
        for name, c in described.items()
        if c.quantity in (FORCE, RATE)
    }
    if hasattr(frame, "with_columns"):
        import polars as pl

        return cast(FrameT, frame.with_columns(*(pl.Series(name, x) for name, x in new.items())))
    return cast(FrameT, cast(Any, frame).assign(**new))


def _corrected(
    calibration: Calibration, time: Array, channels: dict[Key, Array], logged: Mapping[Key, str]
) -> Recording:
    """Return the recording of channels in SI (or counts) corrected; `logged` has the units that were stated."""
    incomplete = next((q for (q, _), x in channels.items() if len(x) != len(time)), "")
    if incomplete:
        raise InputError(f"{incomplete} must have one row for each of the {len(time)} of time")
    for (quantity, axis), x in channels.items():
        if quantity in (FORCE, RATE) and not np.isfinite(x).all():
            row = int(np.flatnonzero(~np.isfinite(x))[0]) + 1
            raise InputError(f"{quantity} {axis} holds no number in row {row}: fill it, or leave such rows out")
    gimbals = {axis for quantity, axis in channels if quantity == ANGLE}
    candidates = (p for p in KNOWN.values() if gimbals <= set(p.axis_names))
    platform = next(candidates, BENCH) if gimbals else BENCH
    recording = Recording(ROTATION, "arrays", platform, Site(), {}, time, None, channels, units=logged)
    stated = {quantity for quantity, _ in logged}
    counted = next((q for q in calibration.readout.counts if recording.has(q) and q not in stated), "")
    if counted:
        raise InputError(
            f"the unit of the calibration outputs counts: state units={{'{counted}': 'count'}} if these arrays do"
        )
    _refuse_another_unit(recording, stated)
    return correct(calibration, recording)


def _from_stated_unit(quantity: str, values: Any, unit: str) -> Array:
    x = np.asarray(values, dtype=float)
    if not unit or is_raw(unit):
        return x
    return celsius(x, unit) if quantity == "temperature" else to_si(x, unit)


def _to_unit(x: Array, unit: str) -> Array:
    return x if not unit or is_raw(unit) else from_si(x, unit)


def _refuse_another_unit(recording: Recording, stated: Container[str]) -> None:
    """Raise InputError for readings without a stated unit that are hardly SI.

    Such are forces whose median norm is 1 g in another unit, and rates beyond the range of common gyroscopes.
    """
    if not len(recording.time):
        return
    if recording.has(FORCE) and FORCE not in stated:
        norm = float(np.median(np.linalg.norm(recording.triad(FORCE), axis=1)))
        off, unit = min((abs(to_si(norm, u) / G0 - 1), u) for u in QUANTITIES[FORCE].units if not is_raw(u))
        if off < 0.1 and not 0.5 < norm / G0 < 2:
            raise InputError(
                f"the median norm of specific_force is {norm:.4g}, which is gravity in {unit} and not in m/s^2: "
                f"state units={{'{FORCE}': '{unit}'}}, or 'm/s^2' if that is right"
            )
    most = float(np.abs(recording.triad(RATE)).max()) if recording.has(RATE) and RATE not in stated else 0.0
    if most > MAX_RATE:
        raise InputError(
            f"angular_rate reaches {most:.4g}, more than gyroscopes measure in rad/s: "
            f"state units={{'{RATE}': 'deg/s'}}, or 'rad/s' if that is right"
        )
