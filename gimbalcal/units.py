"""The units of this trade, and nothing else: SI and radians inside, these words at the edges.

A unit is written as atoms joined by ``/``, ``*`` and ``^``, with brackets and ``sqrt()``: ``m/s^2``,
``ug/g^2``, ``deg/sqrt(h)``, ``ug/(degC/h)``, ``deg/h/g``. ``g`` is standard gravity (9.80665 m/s^2), never
the gram; ``h`` is the hour. ``°``, ``µ``, ``²`` and ``√`` are read too.

Angle is a dimension of its own here, so that ``deg/h`` is never taken for a ratio, nor ``ppm`` for an angle.
Two dimensions stand for outputs whose scale is not known yet, ``count`` and ``pulse``: their factor is 1, and
a sensor that is logged in them is left as it is.

No general package serves: pint, for one, reads ``deg/sqrt(h)`` as ``deg/h`` without a word.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import inf, isfinite, pi
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gimbalcal.earth import G0
from gimbalcal.errors import InputError

Value = TypeVar("Value", float, NDArray[np.float64])
Dimension = tuple[tuple[str, float], ...]
"""Exponents of the base dimensions, sorted by name, without zeros."""


@dataclass(frozen=True)
class Unit:
    """A factor to SI and the dimension that it belongs to."""

    factor: float
    dimension: Dimension


def _dimension(**exponents: float) -> Dimension:
    return tuple(sorted((name, float(n)) for name, n in exponents.items() if n))


_NUMBER = _dimension()
_ANGLE = _dimension(angle=1)
_TIME = _dimension(time=1)
_LENGTH = _dimension(length=1)
_ACCELERATION = _dimension(length=1, time=-2)
_TEMPERATURE = _dimension(temperature=1)
_PRESSURE = _dimension(pressure=1)
_FIELD = _dimension(field=1)
_VOLTAGE = _dimension(voltage=1)
_CURRENT = _dimension(current=1)
_FREQUENCY = _dimension(time=-1)

ATOMS: Mapping[str, Unit] = MappingProxyType(
    {
        "1": Unit(1.0, _NUMBER),
        "%": Unit(1e-2, _NUMBER),
        "ppm": Unit(1e-6, _NUMBER),
        "ppb": Unit(1e-9, _NUMBER),
        "rad": Unit(1.0, _ANGLE),
        "mrad": Unit(1e-3, _ANGLE),
        "urad": Unit(1e-6, _ANGLE),
        "nrad": Unit(1e-9, _ANGLE),
        "deg": Unit(pi / 180, _ANGLE),
        "mdeg": Unit(pi / 180e3, _ANGLE),
        "gon": Unit(pi / 200, _ANGLE),
        "arcmin": Unit(pi / 10800, _ANGLE),
        "arcsec": Unit(pi / 648000, _ANGLE),
        "mas": Unit(pi / 648e6, _ANGLE),
        "rev": Unit(2 * pi, _ANGLE),
        "s": Unit(1.0, _TIME),
        "ms": Unit(1e-3, _TIME),
        "us": Unit(1e-6, _TIME),
        "ns": Unit(1e-9, _TIME),
        "min": Unit(60.0, _TIME),
        "h": Unit(3600.0, _TIME),
        "d": Unit(86400.0, _TIME),
        "Hz": Unit(1.0, _FREQUENCY),
        "m": Unit(1.0, _LENGTH),
        "km": Unit(1e3, _LENGTH),
        "cm": Unit(1e-2, _LENGTH),
        "mm": Unit(1e-3, _LENGTH),
        "um": Unit(1e-6, _LENGTH),
        "ft": Unit(0.3048, _LENGTH),
        "g": Unit(G0, _ACCELERATION),
        "mg": Unit(1e-3 * G0, _ACCELERATION),
        "ug": Unit(1e-6 * G0, _ACCELERATION),
        "ng": Unit(1e-9 * G0, _ACCELERATION),
        "Gal": Unit(1e-2, _ACCELERATION),
        "mGal": Unit(1e-5, _ACCELERATION),
        "uGal": Unit(1e-8, _ACCELERATION),
        "degC": Unit(1.0, _TEMPERATURE),
        "K": Unit(1.0, _TEMPERATURE),
        "mK": Unit(1e-3, _TEMPERATURE),
        "degF": Unit(5 / 9, _TEMPERATURE),
        "Pa": Unit(1.0, _PRESSURE),
        "hPa": Unit(1e2, _PRESSURE),
        "mbar": Unit(1e2, _PRESSURE),
        "kPa": Unit(1e3, _PRESSURE),
        "T": Unit(1.0, _FIELD),
        "mT": Unit(1e-3, _FIELD),
        "uT": Unit(1e-6, _FIELD),
        "nT": Unit(1e-9, _FIELD),
        "V": Unit(1.0, _VOLTAGE),
        "mV": Unit(1e-3, _VOLTAGE),
        "A": Unit(1.0, _CURRENT),
        "mA": Unit(1e-3, _CURRENT),
        "count": Unit(1.0, _dimension(count=1)),
        "pulse": Unit(1.0, _dimension(pulse=1)),
    }
)

_SPELLINGS = {
    "µ": "u", "μ": "u", "²": "^2", "³": "^3", "√": "sqrt", "°C": "degC", "°": "deg", "″": "arcsec",
    "′": "arcmin", "·": "*", "**": "^", " ": "",
}  # fmt: skip
_WORDS = {
    "hr": "h", "hour": "h", "sec": "s", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad",
    "counts": "count", "pulses": "pulse", "LSB": "count", "lsb": "count", "C": "degC", "day": "d",
}  # fmt: skip

_TOKEN = re.compile(r"sqrt|[A-Za-z%]+|[0-9]+(?:\.[0-9]+)?|[/*^()-]")


def _tokens(text: str) -> list[str]:
    for spelling, plain in _SPELLINGS.items():
        text = text.replace(spelling, plain)
    tokens = _TOKEN.findall(text)
    if "".join(tokens) != text or not tokens:
        raise KeyError(text)
    return [_WORDS.get(token, token) for token in tokens]


class _Parser:
    """Recursive descent over ``term (('*'|'/') term)*`` with ``term = atom ('^' number)?``."""

    def __init__(self, tokens: list[str]) -> None:
        self.tokens = tokens

    def peek(self) -> str:
        return self.tokens[0] if self.tokens else ""

    def take(self, expected: str = "") -> str:
        token = self.peek()
        if not token or (expected and token != expected):
            raise KeyError(token)
        return self.tokens.pop(0)

    def product(self) -> Unit:
        unit = self.term()
        while self.peek() in ("*", "/"):
            sign = 1.0 if self.take() == "*" else -1.0
            unit = _multiply(unit, _power(self.term(), sign))
        return unit

    def term(self) -> Unit:
        word = self.take()
        if word in ("sqrt", "("):
            if word == "sqrt" and self.peek() != "(":
                return _power(ATOMS[self.take()], 0.5)
            if word == "sqrt":
                self.take("(")
            unit = _power(self.product(), 0.5 if word == "sqrt" else 1.0)
            self.take(")")
        else:
            unit = ATOMS[word]
        if self.peek() == "^":
            self.take()
            sign = -1.0 if self.peek() == "-" and self.take() else 1.0
            try:
                unit = _power(unit, sign * float(self.take()))
            except ValueError as error:
                raise KeyError(word) from error
        return unit


def _multiply(one: Unit, other: Unit) -> Unit:
    exponents = dict(one.dimension)
    for name, n in other.dimension:
        exponents[name] = exponents.get(name, 0.0) + n
    return _sound_unit(one.factor * other.factor, exponents)


def _power(unit: Unit, n: float) -> Unit:
    # 1/x rather than x**-1: a correctly rounded reciprocal.
    try:
        factor = 1.0 / unit.factor if n == -1 else unit.factor**n
    except (OverflowError, ZeroDivisionError):  # ug^400
        raise KeyError(str(n)) from None
    return _sound_unit(factor, {name: e * n for name, e in unit.dimension})


def _sound_unit(factor: float, exponents: Mapping[str, float]) -> Unit:
    """Return the unit, unless numbers run out on it: ug^-inf, ug^70."""
    if not (0 < factor < inf and all(map(isfinite, exponents.values()))):
        raise KeyError(str(factor))
    return Unit(factor, _dimension(**exponents))


@cache
def _parse(text: str) -> Unit:
    parser = _Parser(_tokens(text))
    unit = parser.product()
    if parser.tokens:
        raise KeyError(text)
    return unit


def parse(text: str) -> Unit:
    """Return the unit that `text` names; `InputError` if it names none.

    >>> parse("deg/sqrt(h)").dimension
    (('angle', 1.0), ('time', -0.5))
    """
    try:
        return _parse(text)
    except KeyError:
        raise InputError(
            f"the unit {text!r} is not known; units are written from {', '.join(ATOMS)} with / * ^ "
            "and sqrt(), as in m/s^2, ug/g^2 or deg/sqrt(h)"
        ) from None


def to_si(value: Value, unit: str) -> Value:
    """Return `value`, given in `unit`, in SI and radians.

    A factor only: a temperature in degC or K is a difference here, see `celsius` for a reading.
    """
    return value * parse(unit).factor


def from_si(value: Value, unit: str) -> Value:
    """Return `value`, given in SI and radians, in `unit`; a factor only."""
    return value / parse(unit).factor


def celsius(value: Value, unit: str) -> Value:
    """Return a thermometer reading in degC, not K: every thermal law of the catalogue uses T - T0."""
    offset = {"K": -273.15, "mK": -273.15, "degF": -160 / 9}.get(unit, 0.0)
    return value * parse(unit).factor + offset


def is_raw(unit: str) -> bool:
    """Return whether the physical size of a unit is not known: counts and pulses."""
    return any(name in ("count", "pulse") for name, _ in parse(unit).dimension)


LARGER: Mapping[str, Sequence[tuple[float, str]]] = {"ug": [(1e3, "mg")], "arcsec": [(600.0, "arcmin")]}
"""Units of readings, each with the size in it from which on a larger unit is printed."""
LARGER_OF_SENSOR: Mapping[str, Sequence[tuple[float, str]]] = {"arcsec": [(1e3, "mrad"), (18e3, "deg")]}
"""The same for input axes: 5 mrad and 5 degrees are usual for a unit of low cost, and never for a platform."""


def printed_unit(size: float, unit: str, larger: Mapping[str, Sequence[tuple[float, str]]] = LARGER) -> str:
    """Return the unit in which a size in this unit is printed; JSON files keep the units of the catalogue.

    >>> printed_unit(2500.0, "ug"), printed_unit(2500.0, "ppm"), printed_unit(4400.0, "arcsec", LARGER_OF_SENSOR)
    ('mg', 'ppm', 'mrad')
    """
    return next((name for least, name in reversed(larger.get(unit, ())) if size >= least), unit)
