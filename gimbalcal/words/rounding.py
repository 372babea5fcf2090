"""A value and its sigma with as many digits as the sigma deserves."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Decimal, localcontext
from math import isfinite

import numpy as np

from gimbalcal.number import Array

MIN_VALUE_SIGMAS = 2.0  # sigmas; a smaller value is given as an upper bound


def pdg_rounded(value: float, sigma: float) -> tuple[str, str]:
    """Return value and sigma as text, rounded by the rule of the Particle Data Group [pdg].

    If the three highest digits of sigma lie between 100 and 354, two digits are kept; between 355 and 949, one;
    between 950 and 999 sigma is rounded up to 1000 and two are kept. The value gets the same last place. A sigma
    that is zero or not finite says nothing about digits: then the value keeps six.

    >>> pdg_rounded(0.827, 0.119)
    ('0.83', '0.12')
    >>> pdg_rounded(0.827, 0.367)
    ('0.8', '0.4')
    >>> pdg_rounded(0.827, 0.996)
    ('0.8', '1.0')
    """
    if not (isfinite(value) and isfinite(sigma)) or sigma <= 0:
        return f"{value:.6g}", f"{sigma:.3g}"
    place = last_place(sigma)
    return _rounded_at(value, place), _rounded_at(sigma, place)


def distinct_from_zero(value: float, sigma: float) -> bool:
    """Return whether a value differs from zero clearly enough for words to give its size."""
    return abs(value) > MIN_VALUE_SIGMAS * sigma


def last_place(sigma: float) -> int:
    """Return the exponent of ten of the last digit that the rule keeps, for a finite sigma > 0.

    >>> last_place(0.119), last_place(0.367), last_place(0.996), last_place(1234.0)
    (-2, -1, -1, 2)
    """
    mantissa, exponent = f"{sigma:.2e}".split("e")
    leading = int(mantissa.replace(".", ""))
    if leading <= 354:
        return int(exponent) - 1
    return int(exponent)


def _rounded_at(x: float, place: int) -> str:
    """Return x rounded half to even at 10^place, in plain decimal notation without a negative zero."""
    with localcontext(prec=700):  # a float has digits from 1e308 down to 1e-324
        rounded = Decimal(repr(float(x))).quantize(Decimal(1).scaleb(place), rounding=ROUND_HALF_EVEN)
    text = f"{rounded:f}" if place <= 0 else f"{int(rounded)}"
    return text[1:] if text.startswith("-") and not any(c in "123456789" for c in text) else text


def significant(x: float, digits: int = 3) -> str:
    """Return x with so many significant digits, in decimal notation between 1e-4 and 1e6, else with a power of ten.

    >>> significant(0.0123456), significant(123456.0, 2), significant(3.2e-9)
    ('0.0123', '120000', '3.20·10⁻⁹')
    """
    if x == 0 or not isfinite(x):
        return f"{x:g}"
    exponent = int(f"{x:e}".split("e")[1])
    if not -5 < exponent < 6:
        return _with_raised_power(f"{x:.{digits - 1}e}")
    return f"{float(f'{x:.{digits - 1}e}'):.{max(digits - 1 - exponent, 0)}f}"


def p_value(p: float) -> str:
    """Return a p-value as printed; below 1e-6 its bound.

    >>> p_value(0.1304), p_value(0.00002), p_value(1e-9)
    ('0.13', '2.0·10⁻⁵', '< 10⁻⁶')
    """
    return "< 10⁻⁶" if p < 1e-6 else significant(p, 2)


def printed_number(text: str) -> str:
    """Return a number as it is printed: with the minus sign that lines up with figures, a power of ten raised.

    >>> printed_number("-0.5"), printed_number("3.20e-09"), printed_number("1e+06")
    ('−0.5', '3.20·10⁻⁹', '10⁶')
    """
    return _with_raised_power(text).replace("-", "−")


def _with_raised_power(text: str) -> str:
    """Return a number with the power of ten after its e raised; any other text unchanged."""
    mantissa, e, power = text.partition("e")
    if not e or not power.lstrip("+-").isdigit():
        return text
    raised = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{raised}" if mantissa == "1" else f"{mantissa}·10{raised}"


def signed(x: float) -> str:
    """Return x with its sign and three significant digits.

    >>> signed(-1234.5), signed(0.5)
    ('−1230', '+0.500')
    """
    return f"{'−' if x < 0 else '+'}{significant(abs(x), 3)}"


def rms(x: Array) -> str:
    """Return the root mean square with three significant digits."""
    return significant(float(np.sqrt(np.mean(x**2))), 3)


def duration_in_words(seconds: float) -> str:
    """Return a duration in a readable unit.

    >>> duration_in_words(0.02), duration_in_words(300.0), duration_in_words(172800.0), duration_in_words(400000.0)
    ('0.02 s', '5 min', '48 h', '4.63 days')
    """
    value, unit = sensible_time(np.array([0.0, seconds]))
    return f"{value[1]:.3g} {unit}" if value[1] < 1000 else f"{value[1]:.0f} {unit}"


def sensible_time(seconds: Array) -> tuple[Array, str]:
    """Return time in a readable unit, and that unit.

    >>> sensible_time(np.array([0.0, 7200.0]))[1], sensible_time(np.array([0.0, 30.0]))[1]
    ('h', 's')
    """
    long = float(np.ptp(seconds)) if np.size(seconds) else 0.0
    units = (("days", 86400.0, 4 * 86400.0), ("h", 3600.0, 5400.0), ("min", 60.0, 150.0), ("s", 1.0, -1.0))
    unit, size = next((u, s) for u, s, least in units if long > least)
    return np.asarray(seconds) / size, unit
