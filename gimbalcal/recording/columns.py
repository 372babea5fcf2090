"""``[columns]``: which quantity, axis and unit each column of the samples has."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from gimbalcal.effects.effect import TRIAD
from gimbalcal.errors import InputError, list_of_alternatives
from gimbalcal.platform import Platform
from gimbalcal.recording.dates import names_iso
from gimbalcal.recording.document import Document
from gimbalcal.recording.record import Key
from gimbalcal.units import is_raw

AXES: Mapping[str, tuple[str, ...] | None] = {
    "time": (),
    "position": (),
    "weight": (),
    "specific_force": TRIAD,
    "angular_rate": TRIAD,
    "velocity_increment": TRIAD,
    "angle_increment": TRIAD,
    "gimbal_angle": None,  # the platform's
    "true_angle": None,
    "attitude_error": ("roll", "pitch", "yaw"),
    "temperature": None,  # any word: which thermometer
    "covariate": None,
    "sigma": (),
    "attitude": ("qw", "qx", "qy", "qz", "roll", "pitch", "yaw"),
    "latitude": (),
    "longitude": (),
    "height": (),
}
"""Known quantities of a column and the axes that each may have."""

SPARSE = ("attitude",)
"""Quantities that may be logged less often than the others; rows without them are kept."""
UNITLESS = ("position", "weight")
RATE_OF = {"velocity_increment": "specific_force", "angle_increment": "angular_rate"}
"""The rate that each increment, over the interval that ends at its row, is the integral of."""
SIGNED = ("specific_force", "angular_rate", *RATE_OF, "gimbal_angle")
OF_A_SENSOR = ("specific_force", "angular_rate", *RATE_OF, "temperature")
"""Quantities of which a recording may hold several triads, distinguished by `sensor`."""
OF_A_ROW = ("specific_force", "angular_rate", "gimbal_angle", "true_angle")
"""Quantities of which a column may give one sigma, row by row."""


@dataclass(frozen=True)
class Column:
    """One column of the samples: its name in the file and what it holds."""

    name: str
    quantity: str
    axis: str
    unit: str
    dated: bool = False  # a clock of dates (ISO 8601), which become seconds
    resolution: float = 0.0  # of a clock, in its unit; 0 where it is not stated
    sensor: str = ""  # which of several, where a recording holds more than one triad of a kind
    regular: bool | None = None  # a clock whose stamps are times of arrival, or not; None: the readings decide
    sign: int = 1  # -1 where the sensor counts backwards
    of: str = ""  # the quantity that a sigma is of
    increments: bool = False  # whether it was logged as increments, which have become means over the interval

    @property
    def key(self) -> Key:
        """Return the channel that the column becomes."""
        return self.quantity, self.axis


COUNTED = Column(" time", "time", "", "s")  # made from the number of the row; a name that no header can hold
ROW_STEP_S = 60.0  # s between rows that are counted without a rate


def columns_of(document: Document, platform: Platform, clock_needed: bool) -> tuple[Column, ...]:
    """Return every column that the header names, checked; `InputError` names the line. Rows may serve as clock."""
    table = document.table("columns")
    columns: list[Column] = []
    for name, entry in table.items():
        mine = entry.get("sensor", "") if isinstance(entry, dict) else ""
        thermometers = len([c for c in columns if c.quantity == "temperature" and c.sensor == mine])
        column = _column(document, name, entry, platform, thermometers)
        other = next((c for c in columns if (c.key, c.sensor) == (column.key, column.sensor)), None)
        if other:
            raise InputError(
                f"{document.where('columns', name)}: columns {other.name!r} and {name!r} are both "
                f"{' '.join(column.key).strip()}; keep one, name the second triad, as in "
                'sensor = "b", or log the other as a covariate'
            )
        columns.append(column)
    if not any(c.quantity == "time" for c in columns):
        if not clock_needed and columns:
            return (*columns, COUNTED)
        raise InputError(
            f'{document.where("columns")}: no column is the time; write time_s = {{ quantity = "time", unit = "s" }}'
        )
    _check_attitude(document, columns)
    _check_increments(document, columns)
    for quantity in ("specific_force", "angular_rate", *RATE_OF):
        for sensor in {c.sensor for c in columns}:
            units = {c.unit: c.name for c in columns if (c.quantity, c.sensor) == (quantity, sensor)}
            if len({is_raw(unit) for unit in units}) > 1:
                raise InputError(
                    f"{document.where('columns', next(iter(units.values())))}: the {quantity} columns mix counts or "
                    "pulses with physical units; give all three in the same kind of unit"
                )
    return tuple(columns)


def _column(document: Document, name: str, entry: object, platform: Platform, thermometers: int) -> Column:
    where = document.where("columns", name)
    if not isinstance(entry, dict) or not isinstance(entry.get("quantity"), str):
        raise InputError(f'{where}: column {name!r} must say what it holds, as in {{ quantity = "time", unit = "s" }}')
    for key in entry:
        if key not in ("quantity", "axis", "unit", "sign", "resolution", "regular", "sensor", "of"):
            raise InputError(f"{where}: {key!r} of column {name!r} is not known; write quantity, axis, unit or sign")
    sensor = _sensor(where, name, entry)
    regular = entry.get("regular")
    if regular is not None and (entry["quantity"] != "time" or not isinstance(regular, bool)):
        raise InputError(
            f"{where}: regular = {regular!r} of column {name!r}; it is true or false, and of the time column alone"
        )
    quantity, axis = entry["quantity"], entry.get("axis", "")
    if quantity not in AXES:
        raise InputError(
            f"{where}: the quantity {quantity!r} of column {name!r} is not known; write one of "
            f"{list_of_alternatives(list(AXES))}"
        )
    if quantity == "covariate":
        axis = axis or name
    elif quantity == "temperature":
        axis = axis or (name if thermometers else "")
    else:
        allowed = platform.axis_names if AXES[quantity] is None else AXES[quantity] or ()
        _check_axis(where, name, quantity, axis, allowed, platform)
    if quantity in UNITLESS:
        return Column(name, quantity, "", "1")
    if quantity == "sigma" and entry.get("of") not in OF_A_ROW:
        raise InputError(
            f"{where}: column {name!r} is a sigma of {entry.get('of')!r}; write what it is of, "
            f"of = {list_of_alternatives([repr(q) for q in OF_A_ROW])}"
        )
    if quantity != "sigma" and "of" in entry:
        raise InputError(f"{where}: column {name!r} is a {quantity}; of = {entry['of']!r} is for a sigma alone")
    if "unit" not in entry:
        raise InputError(
            f'{where}: column {name!r} has no unit; write, for example, unit = "{_example_column(quantity)}"'
        )
    if quantity == "time" and names_iso(entry["unit"]):
        return Column(name, quantity, "", "s", dated=True, regular=regular)
    of = str(entry.get("of", ""))
    unit = document.unit(where, f"column {name!r}", entry["unit"], of or quantity)
    resolution = _resolution(where, name, quantity, entry.get("resolution", 0.0))
    sign = _sign_of_column(where, name, quantity, entry.get("sign", 1))
    return Column(name, quantity, axis, unit, resolution=resolution, regular=regular, sign=sign, sensor=sensor, of=of)


def _sign_of_column(where: str, name: str, quantity: str, value: object) -> int:
    """Return -1 for what counts backwards."""
    if isinstance(value, bool) or value not in (1, -1) or (value == -1 and quantity not in SIGNED):
        raise InputError(
            f"{where}: the sign of column {name!r} is {value!r}; write 1, or -1 where an accelerometer, a gyroscope or "
            "a gimbal counts backwards"
        )
    return -1 if value == -1 else 1


def _sensor(where: str, name: str, entry: Mapping[str, object]) -> str:
    """Return the sensor that a column belongs to: a word, of quantities that come with a sensor."""
    sensor = entry.get("sensor", "")
    if not isinstance(sensor, str) or (sensor and not re.fullmatch(r"[A-Za-z0-9_-]+", sensor)):
        raise InputError(f'{where}: sensor = {sensor!r} of column {name!r} must be one word, as in sensor = "b"')
    if sensor and entry["quantity"] not in OF_A_SENSOR:
        raise InputError(
            f"{where}: column {name!r} is a {entry['quantity']}, which all sensors share; sensor is for "
            f"{list_of_alternatives(OF_A_SENSOR)}"
        )
    return sensor


def _resolution(where: str, name: str, quantity: str, value: object) -> float:
    """Return the resolution of a clock in its unit: rows within it may be stamped alike."""
    if quantity != "time" and value != 0.0:
        raise InputError(f"{where}: resolution of column {name!r} is for the time; leave it out of a {quantity}")
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < float("inf"):
        raise InputError(f"{where}: the resolution of column {name!r} must be a positive number, got {value!r}")
    return float(value)


def _check_attitude(document: Document, columns: list[Column]) -> None:
    """Raise InputError unless an attitude is a quaternion or three Euler angles, complete."""
    own = [c for c in columns if c.quantity == "attitude"]
    if not own:
        return
    axes, where = {c.axis for c in own}, document.where("columns", own[0].name)
    if axes not in ({"qw", "qx", "qy", "qz"}, {"roll", "pitch", "yaw"}):
        raise InputError(
            f"{where}: an attitude is qw, qx, qy and qz, or roll, pitch and yaw, got {', '.join(sorted(axes))}"
        )
    wrong = next((c for c in own if (c.unit == "1") != (c.axis[0] == "q")), None)
    if wrong:
        right = '"1"' if wrong.axis[0] == "q" else 'an angle, as in "deg"'
        raise InputError(
            f"{where}: the unit of column {wrong.name!r}, axis {wrong.axis}, is {right}, not {wrong.unit!r}"
        )


def _check_increments(document: Document, columns: list[Column]) -> None:
    """Raise InputError where a sensor logs increments and also their mean over the interval."""
    for increment, rate in RATE_OF.items():
        for each in columns:
            twin = next((c for c in columns if c.quantity == rate and c.sensor == each.sensor), None)
            if each.quantity == increment and twin:
                raise InputError(
                    f"{document.where('columns', each.name)}: column {each.name!r} is an {increment.replace('_', ' ')} "
                    f"and {twin.name!r} a {rate.replace('_', ' ')}: one is the other times the interval, so keep one "
                    "of the two, or log the other as a covariate"
                )


def _check_axis(
    where: str, name: str, quantity: str, axis: object, allowed: tuple[str, ...], platform: Platform
) -> None:
    if axis in allowed or (not allowed and not axis and AXES[quantity] is not None):
        return
    if not allowed and AXES[quantity] is None:
        raise InputError(
            f"{where}: column {name!r} is a {quantity}, and the platform {platform.name!r} has no axes; name the "
            "platform in [platform]"
        )
    if not allowed:
        raise InputError(f"{where}: column {name!r} is a {quantity}, which has no axis, got axis = {axis!r}")
    raise InputError(
        f"{where}: column {name!r} has axis {axis!r}; a {quantity} has axis {list_of_alternatives(allowed)}"
    )


def _example_column(quantity: str) -> str:
    examples = {
        "time": "s",
        "specific_force": "m/s^2",
        "angular_rate": "deg/h",
        "velocity_increment": "m/s",
        "angle_increment": "rad",
        "temperature": "degC",
        "covariate": "V",
    }
    return examples.get(quantity, "deg")
