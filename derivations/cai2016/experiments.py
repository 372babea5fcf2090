"""Tables 2 and 3, and the sentences that sum navigation up: arithmetic, bounds, and what no printed number determines.

*Table 2*: errors before the filter are the conditions of Section 4.1; those after it are of one draw of noise that is
not printed, and it is not said whether they are the largest, the mean or the root mean square of a group. They are held
against the Cramer-Rao bound of the path (`bound`). *Table 3* rests on recordings that are not printed.
"""

from __future__ import annotations

from math import hypot, radians

from derivations.cai2016 import bound
from derivations.cai2016.symbols import SOURCE
from derivations.information import VELOCITY
from derivations.verdict import AGREES, NOT_DETERMINED, WRONG, Verdict, by_size

# name, unit, before, after, the same in Section 4.1, constants, SI to the unit
TABLE_2 = (
    ("gyro g-sensitivity", "deg/h/g", 0.001, 0.0002, 0.001, "G_", 1 / bound.DEG_H * bound.G0),
    ("accelerometer nonlinear scale", "ug/g^2", 300.0, 1.3, 300.0, ("K_axx", "K_ayy", "K_azz"), bound.G0**2 / bound.UG),
    ("accelerometer cross-coupling", "ug/g^2", 300.0, 1.5, 300.0,
     ("K_axy", "K_axz", "K_ayx", "K_ayz", "K_azx", "K_azy"), bound.G0**2 / bound.UG),
    ("accelerometer lever arm", "cm", 2.0, 0.01, 2.0, "r_", 100.0),
)  # fmt: skip
TABLE_3 = {
    "G_xx": 0.09e-5, "G_xy": 0.25e-5, "G_xz": -0.22e-5, "G_yx": 0.35e-5, "G_yy": 0.81e-5, "G_yz": -0.24e-5,
    "G_zx": -0.07e-5, "G_zy": -0.50e-5, "G_zz": -1.02e-5, "K_axx": 17.1, "K_ayy": -20.4, "K_azz": 25.2, "K_axy": -2.0,
    "K_axz": -22.6, "K_ayx": 7.8, "K_ayz": 16.5, "K_azx": -0.5, "K_azy": 1.6, "r_x": -4.1, "r_y": 2.2, "r_z": -2.4,
}  # fmt: skip
UNITS = {"G": "deg/h/g", "K": "ug/g^2", "r": "cm"}
# largest position errors [n mile] before and after: Sections 4.2, 4.3
POSITION = {
    "4.2, longitude": (0.32, 0.24), "4.2, latitude": (0.27, 0.25), "4.3, longitude": (0.53, 0.46),
    "4.3, latitude": (0.32, 0.28),
}  # fmt: skip
STILL = "how well zero velocity is known, which no number of the paper says: 1e-5 and 1e-3 m/s are tried"
LAST = 0.005  # n mile, half of the last digit
RING_LASER = radians(0.002) / 60  # rad/s/sqrt(Hz), 0.002 deg/sqrt(h): what such gyroscopes have
QUARTZ = 5 * bound.UG  # m/s^2/sqrt(Hz)


def sigma(name: str, rate: float, force: float, still: float = VELOCITY) -> float:
    """Return the bound of a constant in SI after one path, from the errors before the filter."""
    ratios = bound.found(rate, force, still)
    return ratios[name] * float(dict(zip(bound.NAMES, bound.PRIOR, strict=True))[name])


def judge_before(row: tuple[object, ...]) -> Verdict:
    name, unit, before, _, text, *_ = row
    same = before == text
    return Verdict(
        SOURCE, f"Table 2, {name}, before", AGREES if same else WRONG, f"{before:g} {unit}", f"{text:g} {unit}",
        "0" if same else "not quantified", "The condition of Section 4.1.",
    )  # fmt: skip


def judge_after(row: tuple[object, ...]) -> Verdict:
    name, unit, _, after, _, constants, to_unit = row
    assert isinstance(after, float)
    names = [n for n in bound.NAMES if (n.startswith(constants) if isinstance(constants, str) else n in constants)]  # type: ignore[operator]
    noise = bound.STATED
    all_ = [sigma(n, noise.rate, noise.force) * to_unit for n in names]  # type: ignore[operator]
    loose = max(sigma(n, noise.rate, noise.force, bound.LOOSE) * to_unit for n in names)  # type: ignore[operator]
    ratio = after / max(all_)
    return Verdict(
        SOURCE, f"Table 2, {name}, after", NOT_DETERMINED, f"{after:g} {unit}",
        f"sigma {min(all_):.2g} to {max(all_):.2g} {unit}", f"{after / loose:.2g} to {ratio:.2g} times the bound",
        "One draw of noise that is not printed, and one number for a group. Section 4.1's noise taken as that of one "
        f"sample at 100 Hz, the path allows sigmas of {min(all_):.2g} to {max(all_):.2g} {unit}; the printed error is "
        f"{ratio:.2g} times the largest, and {after / loose:.2g} times where zero velocity is known to 1 mm/s. "
        "At 300 ppm and 180 arcsec products of two errors reach 0.3 ug: one pass of a "
        "linear filter keeps them.", assumes=STILL,
    )  # fmt: skip


def judge_all_seen() -> Verdict:
    """Judge Sections 3.4 and 4.1: all parameters are estimated on the path, whatever noise zero velocity has."""
    tight, loose = (bound.found(still=still) for still in (VELOCITY, bound.LOOSE))
    open_ = {still: [n for n, ratio in ratios.items() if ratio >= 0.5]
             for still, ratios in ((VELOCITY, tight), (bound.LOOSE, loose))}  # fmt: skip
    worst = max(tight, key=lambda n: tight[n])
    left = [len(names) for names in open_.values()]
    verdict = AGREES if not any(left) else WRONG if all(left) else NOT_DETERMINED
    return Verdict(
        SOURCE, "Section 4.1, all parameters", verdict,
        "all of the parameters got completely convergent in one group of calibration rotation",
        f"{len(tight) - left[0]} and {len(loose) - left[1]} of {len(tight)} below half of their error before",
        "0" if verdict == AGREES else f"{max(left)}",
        f"At the stated noise and a velocity known to {VELOCITY:.0e} m/s the weakest is {worst}, to "
        f"{100 * tight[worst]:.0f} % of its error before: an own-axis g-sensitivity turns only the heading, while that "
        f"axis is vertical. At {bound.LOOSE:.0e} m/s {', '.join(open_[bound.LOOSE]) or 'none'} keep more than "
        "half of it.",
        assumes=STILL,
    )  # fmt: skip


def judge_result(name: str, value: float) -> Verdict:
    """Judge an estimate of the laboratory."""
    unit = UNITS[name[0]]
    return Verdict(SOURCE, f"Table 3, {name}", NOT_DETERMINED, f"{value:g} {unit}", "nothing printed determines it",
                   "not quantified", "It needs the recordings, which are not printed.")  # fmt: skip


def judge_unit_of_g() -> Verdict:
    """Judge nine g-sensitivities of ring lasers of 1e-5 deg/h/g and less."""
    to_unit = bound.G0 / bound.DEG_H
    cross, own = _unprimed("G_xy") * to_unit, _unprimed("G_xx") * to_unit
    largest = max(abs(v) for n, v in TABLE_3.items() if n.startswith("G"))
    return Verdict(
        SOURCE, "Table 3, gyro g-sensitivity", NOT_DETERMINED, f"all nine below {largest:.2g} deg/h/g",
        f"sigma {cross:.2g} (cross), {own:.2g} (own axis) deg/h/g at 0.002 deg/sqrt(h)",
        f"factor {cross / largest:.0f}",
        f"In deg/h/g all nine are at least {cross / largest:.0f} times below what one path shows of a ring laser: for "
        f"a sigma of {largest:.0e} its noise would have to be {0.002 * largest / cross:.0e} deg/sqrt(h). The noise is "
        "not printed; either the filter's prior made these numbers, or their unit is another (deg/s/g would fit).",
    )  # fmt: skip


def _unprimed(name: str) -> float:
    """Return the sigma of a g-sensitivity in SI from the data alone: what the prior adds is taken off."""
    posterior, prior = sigma(name, RING_LASER, QUARTZ), dict(zip(bound.NAMES, bound.PRIOR, strict=True))[name]
    return float((posterior**-2 - prior**-2) ** -0.5)


def share(before: float, after: float) -> float:
    """Return the decrease in per cent of before."""
    return 100 * (before - after) / before


def judge_position(name: str) -> Verdict:
    before, after = POSITION[name]
    ends = share(before - LAST, after + LAST), share(before + LAST, after - LAST)
    return Verdict(
        SOURCE, f"Section {name}", NOT_DETERMINED, f"{before} to {after} n mile", f"{share(before, after):.1f} % less",
        "not quantified",
        f"The errors need the recordings, which are not printed. They mean a decrease of {share(before, after):.1f} %, "
        f"between {ends[0]:.0f} and {ends[1]:.0f} % by the digits.",
    )  # fmt: skip


def sentences() -> tuple[Verdict, ...]:
    """Return the verdicts on about 8 % and at least 20 %, and on how long five days are."""
    least = min(POSITION, key=lambda n: share(*POSITION[n]))
    before, after = POSITION[least]
    shares = sorted(share(*p) for p in POSITION.values())
    radial = []
    for place in ("4.2", "4.3"):
        one, other = POSITION[f"{place}, longitude"], POSITION[f"{place}, latitude"]
        radial.append(share(hypot(one[0], other[0]), hypot(one[1], other[1])))
    drop = min(b - a for b, a in POSITION.values())
    eight = Verdict(
        SOURCE, "Section 4.3, about 8 %", by_size(8 - shares[0], 0.5, 1.0),
        "position accuracy is improved about 8 % in five days",
        f"{', '.join(f'{x:.1f}' for x in shares)} %", f"{8 - shares[0]:.1f} to {shares[-1] - 8:.0f} %",
        f"It is the least of the four decreases, that of Section {least}, over the error *after* compensation, "
        f"{100 * (before - after) / after:.1f} %; over the error before {share(before, after):.1f} %. The others are "
        f"{shares[1]:.0f} to {shares[-1]:.0f} %, both coordinates together {radial[0]:.0f} and {radial[1]:.0f} %.",
    )  # fmt: skip
    twenty = Verdict(
        SOURCE, "Section 4.3, at least 20 %", by_size(min(100 * drop / 0.1 - 20, 0), 1e-9, 100 * 2 * LAST / 0.1),
        "improved by at least 20 % at 0.1 n mile / 5 d", f"{drop:.2f} n mile of 0.1 n mile: {100 * drop / 0.1:.0f} %",
        "0",
        "The least of the four decreases in n mile over 0.1 n mile, taken to stay as large with better sensors. By the "
        f"digits it may be anything from {100 * (drop - 2 * LAST) / 0.1:.0f} to {100 * (drop + 2 * LAST) / 0.1:.0f} %.",
    )  # fmt: skip
    days = [
        Verdict(SOURCE, f"Section {section}, {hours} h", by_size(hours / 24 - 5, 0.0, 0.5),
                f"{hours} h (about five days)",
                f"{hours / 24:.2f} d", f"{100 * abs(hours / 120 - 1):.0f} %", "Hours over 24.")
        for section, hours in (("4.2", 128), ("4.3", 108))
    ]  # fmt: skip
    turntable = Verdict(
        SOURCE, "Section 4.1, turntable", NOT_DETERMINED, "the attitude error of the turntable is 11 (1 sigma)", "-",
        "not quantified",
        "unreadable: 11 may be 1 arcmin or 1 arcsec with a prime taken for a digit, or 11 of a lost unit. It enters "
        "nothing: the method uses no angle of the table.",
    )  # fmt: skip
    return (eight, twenty, *days, turntable)


def verdicts() -> tuple[Verdict, ...]:
    """Return the verdicts on Tables 2 and 3, then on the sentences."""
    two = (v for row in TABLE_2 for v in (judge_before(row), judge_after(row)))
    three = (judge_result(name, value) for name, value in TABLE_3.items())
    where = (judge_position(name) for name in POSITION)
    return (judge_all_seen(), *two, *three, judge_unit_of_g(), *where, *sentences())
