"""What a column or a number of a recording may be given in: quantities, their units, and what they are kept in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from gimbalcal.errors import InputError, list_of_alternatives
from gimbalcal.units import parse


@dataclass(frozen=True)
class Quantity:
    """What a column or a number may be given in, and what it is kept in inside."""

    si: str
    units: tuple[str, ...]


_FORCES = ("m/s^2", "g", "mg", "ug", "Gal", "mGal")
_RATES = ("rad/s", "mrad/s", "urad/s", "deg/s", "deg/h", "rad/h", "arcsec/s", "arcsec/h", "rev/min")
_VELOCITIES = ("m/s", "cm/s", "mm/s", "um/s", "ft/s")
_ANGLES = ("rad", "mrad", "urad", "deg", "mdeg", "gon", "arcmin", "arcsec", "rev")

QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "time": Quantity("s", ("s", "ms", "us", "ns", "min", "h", "d")),
        "specific_force": Quantity("m/s^2", (*_FORCES, "pulse/s", "count", "count/s")),
        "angular_rate": Quantity("rad/s", (*_RATES, "pulse/s", "count", "count/s")),
        "velocity_increment": Quantity("m/s", (*_VELOCITIES, "pulse", "count")),
        "angle_increment": Quantity("rad", (*_ANGLES, "pulse", "count")),
        "velocity": Quantity("m/s", _VELOCITIES),
        "angle": Quantity("rad", _ANGLES),
        "gimbal_angle": Quantity("rad", _ANGLES),
        "true_angle": Quantity("rad", _ANGLES),
        "attitude_error": Quantity("rad", _ANGLES),
        "attitude": Quantity("rad", (*_ANGLES, "1")),
        "latitude": Quantity("rad", _ANGLES),
        "longitude": Quantity("rad", _ANGLES),
        "temperature": Quantity("degC", ("degC", "K", "degF")),
        "gravity": Quantity("m/s^2", _FORCES),
        "specific_force_walk": Quantity("m/s^2/sqrt(s)", ("ug/sqrt(h)", "mg/sqrt(h)", "m/s^2/sqrt(s)")),
        "angular_rate_walk": Quantity("rad/s/sqrt(s)", ("deg/h/sqrt(h)", "deg/s/sqrt(s)", "rad/s/sqrt(s)")),
        "height": Quantity("m", ("m", "km", "ft")),
    }
)
"""Known quantities. A ``covariate`` may have any unit at all, so it is not here."""


def refuse_unit(unit: str, quantity: str) -> None:
    """Refuse a `unit` that is unknown or is not one of `quantity`, and say which ones are.

    >>> refuse_unit("deg/h", "angular_rate")
    """
    known = QUANTITIES.get(quantity)
    if known is None:
        parse(unit)
        return
    choice = f"give the {quantity} in {list_of_alternatives(known.units)}"
    try:
        dimension = parse(unit).dimension
    except InputError:
        raise InputError(f"the unit {unit!r} is not known; {choice}") from None
    if dimension not in {parse(each).dimension for each in known.units}:
        rate = quantity == "gimbal_angle" and dimension == parse("rad/s").dimension
        how = "; where only the rate of a table is known, `gimbalcal new LOG` adds it up" if rate else ""
        raise InputError(f"{unit!r} is not a unit of {quantity}; {choice}{how}")
