"""Tables 5 and 6, and the sentences on navigation. Recordings are not printed: arithmetic and orders of magnitude only.

*Table 5* is a condition that the authors set. *Table 6*: the decrease is (method 1 - method 3) / method 1; the errors
themselves are compared with what the stated precision of the sensors makes of 3.2 h: a constant gyroscope error eps
carries position off by eps R (t - sin(w t) / w), w^2 = g / R, an accelerometer error a by at most 2 a / w^2, on one
axis and to first order; `dead_reckoning` navigates in full, about each of the three axes.
"""

from __future__ import annotations

from math import cos, degrees, pi, radians, sin, sqrt

from derivations.verdict import AGREES, NOT_DETERMINED, WRONG, Verdict, by_size
from derivations.wang2019.dead_reckoning import LATITUDE, largest
from derivations.wang2019.navigation import EARTH
from derivations.wang2019.symbols import SOURCE
from derivations.wang2019.table_4 import value

SWING = (("heading", 2.0, 3.0), ("pitch", 2.0, 3.0), ("roll", 8.0, 5.0))  # Hz, deg
TABLE_6 = ((1.452, 1.513, 1.275, 12.19), (1.537, 1.528, 1.389, 9.63), (1.426, 1.448, 1.263, 11.43))  # n mile, %
HOURS, RADIUS, GRAVITY, MILE = 3.2, 6.371e6, 9.8, 1852.0
LAST = 0.0005  # n mile, half of the last digit


def judge_swing(axis: str, frequency: float, amplitude: float) -> Verdict:
    """Judge a condition, and what it means."""
    w = 2 * pi * frequency
    rate, acceleration = w * amplitude, w**2 * amplitude
    return Verdict(
        SOURCE, f"Table 5, {axis}", AGREES, f"{frequency:g} Hz, {amplitude:g} deg", "a definition", "0",
        f"A definition: nothing to derive. The condition means {rate:.0f} deg/s and {acceleration:.0f} deg/s^2 at the "
        "peaks.",
    )  # fmt: skip


def drift(gyroscope: float, accelerometer: float) -> tuple[float, float]:
    """Return the position errors [n mile] after `HOURS` from a constant gyroscope error [deg/h] and accelerometer error
    [g].
    """
    t, w = 3600 * HOURS, sqrt(GRAVITY / RADIUS)
    eps = radians(gyroscope) / 3600
    return eps * RADIUS * (t - sin(w * t) / w) / MILE, 2 * accelerometer * GRAVITY / w**2 / MILE


def in_full(gyroscope: float, accelerometer: float) -> tuple[float, float]:
    """Return the same [n mile] with nothing linearised, the worst of three axes each (level ones of the
    accelerometers).
    """
    eps, a = radians(gyroscope) / 3600, accelerometer * GRAVITY
    none = (0.0, 0.0, 0.0)
    of_rate = max(largest(_along(i, eps), none, HOURS) for i in range(3))
    return of_rate / MILE, max(largest(none, _along(i, a), HOURS) for i in range(2)) / MILE


def _along(axis: int, size: float) -> tuple[float, float, float]:
    x, y, z = (size * (i == axis) for i in range(3))
    return x, y, z


def judge_error(number: int, method: int, printed: float) -> Verdict:
    """Judge a largest position error: of the order that the stated precision makes, and no more can be said."""
    gyroscope, accelerometer = in_full(0.01, 1e-5)
    one_axis = drift(0.01, 1e-5)
    return Verdict(
        SOURCE, f"Table 6, experiment {number}, method {method}", NOT_DETERMINED, f"{printed} n mile",
        f"up to {gyroscope:.1f} n mile of 0.01 deg/h, {accelerometer:.2f} of 0.01 mg", "not quantified",
        f"It needs the recordings, which are not printed. Of the right order: the precision of 0.01 deg/h that Section "
        f"5.2 states makes {gyroscope:.2f} n mile in {HOURS} h, that of 0.01 mg {accelerometer:.2f}, at rest and "
        f"with nothing linearised ({one_axis[0]:.2f} and {one_axis[1]:.2f} by Schuler's formula for one axis).",
    )  # fmt: skip


def judge_bends() -> Verdict:
    """Judge Table 4's second order of the heading gyroscope in the bends of a drive, against what Table 6 says it is
    worth.

    A bend through a right angle in T s at a rate that rises and falls as 1 - cos has the square 3/2 (pi/2)^2 / T. An
    error of heading phi lets the Earth's rate in, phi Omega cos L for a gyroscope error east.
    """
    K1, K2 = value("K_g1z"), abs(value("K_g2z"))
    bend = 6.0  # s
    bent = degrees(1) * K2 / K1**2  # per rad/s
    heading = bent * 1.5 * (pi / 2) ** 2 / bend
    leak = heading * EARTH * cos(LATITUDE)
    rate = degrees(leak) * 3600
    miles = largest((leak, 0.0, 0.0), (0.0, 0.0, 0.0), HOURS) / MILE
    slow = bend * miles / 0.18
    return Verdict(
        SOURCE, "Tables 4 and 6, K_g2", by_size(miles - 0.18, 0.03, 0.18),
        "K_g2z -9.97e-18 deg/s/pulse^2; left out, the drive of 3.2 h is worse by 0.15 to 0.18 n mile",
        f"{miles:.2f} n mile by one right angle in {bend:g} s", f"a factor of {miles / 0.18:.2g} for each bend one way",
        f"A bend through a right angle in {bend:g} s turns the heading by {degrees(heading) * 60:.1f} arcmin where the "
        f"square is left out, which lets {rate:.2f} deg/h of the Earth's rate in: {miles:.2f} n mile in {HOURS:g} h. "
        "The sign is that of the rate squared, so bends right and left add up, and the text has the vehicle turn; for "
        f"one of them to be worth the printed 0.18 n mile it would take {slow:.0f} s. K_g2 does not hold, or pulses "
        "are not per second.",
    )  # fmt: skip


def decrease(one: float, three: float) -> float:
    """Return the decrease in per cent of method 1."""
    return 100 * (one - three) / one


def judge_experiment(number: int, one: float, three: float, printed: float) -> Verdict:
    derived = decrease(one, three)
    right = abs(derived - printed) < 0.006  # half of the last digit
    spread = decrease(one - LAST, three + LAST), decrease(one + LAST, three - LAST)
    return Verdict(
        SOURCE, f"Table 6, experiment {number}", AGREES if right else WRONG, f"{printed} %", f"{derived:.2f} %",
        "0" if right else f"{abs(derived - printed):.2g} %",
        "The decrease against method 1, as the footnote says; the digits of the table leave it between "
        f"{spread[0]:.2f} and {spread[1]:.2f} %. One run each, so without an uncertainty.",
    )  # fmt: skip


def sentences() -> tuple[Verdict, ...]:
    """Return the verdicts on Section 5.2.3, and on the abstract against Section 5.2.2."""
    shares = [decrease(a, c) for a, _, c, _ in TABLE_6]
    average = sum(shares) / len(shares)
    inside = round(average) == 11
    mean = Verdict(
        SOURCE, "Section 5.2.3, average", AGREES if inside else WRONG, "an average of 11 %", f"{average:.2f} %",
        "0" if inside else f"{abs(average - 11):.2g} %", "The mean of the three decreases of Table 6, rounded.",
    )  # fmt: skip
    lab = Verdict(
        SOURCE, "Abstract, 17 %", by_size(17.89 - 17, 0.5, 1.0),
        "up to 17 % in lab conditions", "17.89 % in Section 5.2.2", "0.9 %",
        "Cut off, not rounded; Figure 10, which it is read from, carries no numbers here. It is the largest of six "
        "runs, one each.",
    )  # fmt: skip
    swing = Verdict(
        SOURCE, "Section 5.2.2, 5.19 % and 17.89 %", NOT_DETERMINED, "improved up to 5.19 % and 17.89 %",
        "nothing printed determines it", "not quantified",
        "The position errors stand in Figure 10, which carries no numbers here, and need the recordings.",
    )  # fmt: skip
    return mean, lab, swing


def verdicts() -> tuple[Verdict, ...]:
    """Return the verdicts on Table 5, Table 6 and the sentences."""
    errors = (judge_error(i, method, row[method - 1]) for i, row in enumerate(TABLE_6, start=1) for method in (1, 2, 3))
    shares = (judge_experiment(i, a, c, d) for i, (a, _, c, d) in enumerate(TABLE_6, start=1))
    return (*(judge_swing(*row) for row in SWING), *errors, *shares, judge_bends(), *sentences())
