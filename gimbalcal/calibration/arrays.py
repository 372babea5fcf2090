"""A calibration applied to arrays: units in and out as they are said, one row for each time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gimbalcal.calibration.correction import Calibrated, correct
from gimbalcal.earth import G0
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import BENCH, KNOWN
from gimbalcal.quantities import QUANTITIES, check
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.frames import by_axis
from gimbalcal.recording.kinds import ROTATION
from gimbalcal.recording.record import ANGLE, FORCE, RATE, Key
from gimbalcal.units import celsius, from_si, is_raw, to_si

FASTEST = 35.0  # rad/s, 2000 deg/s: the range of ordinary gyroscopes; numbers beyond are likelier deg/s


def correct_arrays(
    calibration: Calibrated, readings: Mapping[str, Any], units: Mapping[str, str] | None = None
) -> dict[str, Array]:
    """`correct` for arrays: time (n,), specific_force and angular_rate (n, 3), others (n,) or by axis.

    units: by quantity, SI and degC where absent. Returns the triads that were given, (n, 3), in their units; of counts
    in SI. Raises InputError for another shape or unit and, where no unit is said, for forces as long as gravity
    in another one and for rates beyond 2000 deg/s.
    """
    if not isinstance(readings, Mapping):
        raise InputError(
            f"apply takes a recording, or arrays by name as in {{'specific_force': f}}, got {type(readings).__name__}; "
            "of a table gimbalcal.from_frame makes a recording"
        )
    given = {quantity: x for quantity, x in readings.items() if quantity != "time"}
    said = dict(units or {})
    unknown = set(said) - set(readings)
    if unknown:
        raise InputError(f"units names {min(unknown)!r}, and there is no such array")
    for quantity, unit in said.items():
        check(unit, quantity)
    n = len(next(iter(readings.values()), ()))
    time = to_si(np.asarray(readings.get("time", np.arange(n)), dtype=float), said.get("time", "s"))
    each = ((q, axis, x) for q, values in given.items() for axis, x in by_axis(q, values, str(n)))
    channels: dict[Key, Array] = {(q, axis): _si(q, x, said.get(q, "")) for q, axis, x in each}
    short = next((q for (q, _), x in channels.items() if len(x) != len(time)), "")
    if short:
        raise InputError(f"{short} must have one row for each of the {len(time)} of time")
    gimbals = {axis for quantity, axis in channels if quantity == ANGLE}
    holding = (p for p in KNOWN.values() if gimbals <= set(p.axis_names))
    platform = next(holding, BENCH) if gimbals else BENCH
    logged = {key: said[key[0]] for key in channels if key[0] in said}
    recording = Recording(ROTATION, "arrays", platform, Site(), {}, time, None, channels, units=logged)
    counted = next((q for q in calibration.readout.counts if recording.has(q) and q not in said), "")
    if counted:
        raise InputError(
            f"the calibration is of a unit that counts: say units={{'{counted}': 'count'}} if these arrays do"
        )
    if FORCE not in said:
        _refuse_forces_of_another_unit(recording)
    if RATE not in said:
        _refuse_rates_of_another_unit(recording)
    made = correct(calibration, recording)
    return {q: _out(made.triad(q), said.get(q, "")) for q in (FORCE, RATE) if made.has(q)}


def _si(quantity: str, values: Any, unit: str) -> Array:
    x = np.asarray(values, dtype=float)
    if not unit or is_raw(unit):
        return x
    return celsius(x, unit) if quantity == "temperature" else to_si(x, unit)


def _out(x: Array, unit: str) -> Array:
    return x if not unit or is_raw(unit) else from_si(x, unit)


def _refuse_forces_of_another_unit(recording: Recording) -> None:
    """Forces that nobody gave a unit, and that are not 1 g long in m/s^2 but in another unit, in the median."""
    if not recording.has(FORCE) or not len(recording.time):
        return
    norm = float(np.median(np.linalg.norm(recording.triad(FORCE), axis=1)))
    if 0.5 < norm / G0 < 2:
        return
    known = [u for u in QUANTITIES[FORCE].units if not is_raw(u)]
    off, unit = min((abs(to_si(norm, u) / G0 - 1), u) for u in known)
    if off < 0.1:
        raise InputError(
            f"specific_force is {norm:.4g} long in the median, which is gravity in {unit} and not in m/s^2: "
            f"say units={{'{FORCE}': '{unit}'}}, or 'm/s^2' if it is so"
        )


def _refuse_rates_of_another_unit(recording: Recording) -> None:
    """Rates that nobody gave a unit, and that no ordinary gyroscope could read in rad/s."""
    if not recording.has(RATE) or not len(recording.time):
        return
    most = float(np.abs(recording.triad(RATE)).max())
    if most > FASTEST:
        raise InputError(
            f"angular_rate reaches {most:.4g}, more than gyroscopes read in rad/s: "
            f"say units={{'{RATE}': 'deg/s'}} or whatever it is in, 'rad/s' included"
        )
