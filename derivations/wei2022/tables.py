"""Tables 2 to 4, and what the text says of them.

*Table 2*: degrees of observability of formula (24)'s kind. Initial covariance, noise, rates and stops are not printed,
so no value follows; that its rows are different quantities does. *Table 3*: a residual is the estimate less the ideal
value, to the digits of the estimate; the estimates themselves are of noise that is not printed. The scan runs its
columns into one another; digits are separated in the one way in which estimate, ideal value and residual have the
stated relation to their first digits, and the last digits test it. *Table 4* rests on recordings that are not printed.
"""

from __future__ import annotations

from decimal import Decimal
from functools import cache
from itertools import permutations
from math import sqrt

import numpy as np
import sympy as sp

from derivations.verdict import AGREES, MISPRINT, NOT_DETERMINED, WRONG, Verdict, with_package
from derivations.wei2022.symbols import NAMES, SOURCE

# 18-position, 30-position, in the order of NAMES
TABLE_2 = (
    ("22.37", "79.94"), ("23.08", "69.69"), ("25.05", "75.55"), ("181.52", "251.99"), ("197.31", "263.65"),
    ("170.47", "247.22"), ("31.99", "80.49"), ("65.02", "95.85"), ("103.45", "186.40"), ("64.07", "154.33"),
    ("163.65", "318.26"), ("103.46", "225.95"), ("111.99", "100.50"), ("158.46", "155.51"), ("165.26", "282.83"),
    ("274.16", "332.01"), ("229.89", "261.05"), ("452.96", "633.62"), ("54.74", "102.71"), ("174.74", "244.61"),
    ("22.37", "79.94"),
)  # fmt: skip
# ideal, 18-estimate, 30-estimate, 18-residual, 30-residual; rows of dA_a carry no name and are in the states' order
TABLE_3 = tuple(
    tuple(row.split())
    for row in """
0.01 0.011301017 0.010314397 0.001301017 0.000314397
0.015 0.014783523 0.014088555 -0.000216477 -0.000911445
0.02 0.017859505 0.019863169 -0.002140495 -0.000136831
80 80.45810632 79.83330178 0.458106325 -0.166698218
90 89.58384702 89.98982828 -0.416152981 -0.010171722
100 99.2916787 100.3147819 -0.708321297 0.314781869
10 9.787512187 10.40013812 -0.212487813 0.400138118
20 20.15702346 20.20475451 0.157023456 0.20475451
30 30.18298086 29.97072048 0.182980864 -0.029279523
10 10.07074401 9.96198043 0.070744014 -0.03801957
20 20.44490916 20.4155934 0.444909159 0.415593405
30 30.15649279 30.15181757 0.156492792 0.151817574
10 10.28440017 9.906793199 0.284400167 -0.093206801
20 19.36711027 19.67128246 -0.632889727 -0.328717541
30 29.76259989 29.78869477 -0.237400115 -0.211305227
10 9.902931167 9.750802654 -0.097068833 -0.249197346
-20 -20.1225843 -20.12456347 -0.122584303 -0.12456347
-30 -30.28877323 -29.80122684 -0.288773226 0.198773161
30 29.75675589 29.92631969 -0.243244114 -0.073680314
10 10.67119009 10.06981142 0.67119009 0.069811417
-20 -19.61482211 -19.78829016 0.385177888 0.211709844
""".strip().splitlines()
)
TABLE_4 = (
    "-0.004108297", "0.001381599", "0.012232855", "112.5559752", "-53.77119242", "-128.2295866", "-11.72975729",
    "3.722942935", "10.07015303", "211.7416169", "109.2483131", "52.0861156", "5.148117571", "3.244895406",
    "2.732270054", "3.801944879", "-3.359659629", "-5.07799273", "1.355994872", "3.907654511", "-2.908936285",
)  # fmt: skip
GROUPS = {"gyro bias": slice(0, 3), "accelerometer bias": slice(3, 6), "gyro scale factor": slice(6, 9),
          "accelerometer scale factor": slice(9, 12), "gyro installation": slice(12, 15),
          "accelerometer installation": slice(15, 21)}  # fmt: skip
UNITS = ("deg/h", "ug", "ppm", "ppm", "arcsec", "arcsec")
SCHEMES = (18, 30)


def unit(row: int) -> str:
    """Return the unit of a row of Tables 3 and 4."""
    return next(u for u, part in zip(UNITS, GROUPS.values(), strict=True) if part.start <= row < part.stop)


def judge_degree(row: int) -> Verdict:
    """Judge a row of Table 2."""
    degrees = TABLE_2[row]
    twin = [NAMES[i] for i, d in enumerate(TABLE_2) if d == degrees and i < row]
    why = "It needs the initial covariance, the noise, the rate and the stops, which are not printed."
    if twin:
        why = (
            f"Both values are those of {twin[0]}, eight digits of two different quantities; no other rows share one. "
            "One of the two rows was copied, this one by its place: its own values are not printed."
        )
    return with_package(Verdict(
        SOURCE, f"Table 2, {NAMES[row]}", MISPRINT if twin else NOT_DETERMINED, " / ".join(degrees),
        "nothing printed determines it", "not quantified", why,
    ))  # fmt: skip


def residual_gap(row: int, scheme: int) -> Decimal:
    """Return the printed residual less (estimate - ideal), beyond the rounding of both."""
    ideal, estimate, residual = (Decimal(TABLE_3[row][i]) for i in (0, 1 + scheme, 3 + scheme))
    last = Decimal(1).scaleb(int(estimate.as_tuple().exponent)) + Decimal(1).scaleb(int(residual.as_tuple().exponent))
    return max(abs(residual - (estimate - ideal)) - last / 2, Decimal(0))


def judge_residual(row: int, scheme: int) -> Verdict:
    """Judge a residual of Table 3."""
    gap = residual_gap(row, scheme)
    ideal, estimate, residual = (TABLE_3[row][i] for i in (0, 1 + scheme, 3 + scheme))
    return Verdict(
        SOURCE, f"Table 3, {NAMES[row]}, {SCHEMES[scheme]}-residual", AGREES if gap == 0 else WRONG,
        f"{residual} {unit(row)}", f"{Decimal(estimate) - Decimal(ideal)} {unit(row)}",
        "0" if gap == 0 else f"{gap:.1E}",
        "Estimate less ideal value, to the digits of both.",
    )  # fmt: skip


def judge_estimate(row: int, scheme: int) -> Verdict:
    """Judge an estimate of Table 3."""
    return Verdict(
        SOURCE, f"Table 3, {NAMES[row]}, {SCHEMES[scheme]}-estimate", NOT_DETERMINED,
        f"{TABLE_3[row][1 + scheme]} {unit(row)}", "nothing printed determines it", "not quantified",
        "One draw of noise; neither its size nor the turns' times are printed.",
    )  # fmt: skip


def chance_of_variances() -> float:
    """Return how likely residuals as small as Table 3's are if a degree of Table 2 were a ratio of variances.

    Then a residual has the sigma sigma_0 / sqrt(degree), and sigma_0 is not less than the error that was there, the
    ideal value: of chi^2 of 42 degrees of freedom, the sum of squares of residual over sigma is an upper bound.
    """
    squares = sum((float(row[3 + scheme]) / float(row[0])) ** 2 * float(degree)
                  for row, degrees in zip(TABLE_3, TABLE_2, strict=True)
                  for scheme, degree in enumerate(degrees))  # fmt: skip
    half = sp.Rational(2 * len(TABLE_3), 2)
    return float(sp.lowergamma(half, squares / 2) / sp.gamma(half))


def judge_result(row: int) -> Verdict:
    """Judge an estimate of Table 4."""
    return Verdict(
        SOURCE, f"Table 4, {NAMES[row]}", NOT_DETERMINED, f"{TABLE_4[row]} {unit(row)}",
        "nothing printed determines it",
        "not quantified", "It needs the recordings, which are not printed.",
    )  # fmt: skip


def residuals(scheme: int) -> list[float]:
    return [float(row[3 + scheme]) for row in TABLE_3]


@cache
def orders_as_likely() -> tuple[int, int]:
    """Return how many orders of the six rows of dA_a in Table 3 are as likely as that of the states, and of how many.

    A residual has the sigma c / degree of Table 2 for its scheme, c unknown: ln L = sum ln degree - n/2 ln sum (r d)^2.
    The row whose degrees are a copy is left out, whichever residual it has.
    """
    degree = np.array(TABLE_2[15:20], dtype=float)  # dA_ayz is the copy
    residual = np.array([row[3:] for row in TABLE_3[15:]], dtype=float)
    squares = np.array([((residual[list(o[:5])] * degree) ** 2).sum(0) for o in permutations(range(6))])
    likely = -degree.shape[0] / 2 * np.log(squares).sum(1)
    return int((likely >= likely[0] - 1e-12).sum()), len(likely)


def judge_ideals() -> Verdict:
    """Judge the ideal values of Table 3, which both schemes share: estimate less residual."""
    off = [NAMES[row] for row in range(len(NAMES)) if any(residual_gap(row, scheme) != 0 for scheme in (0, 1))]
    return Verdict(
        SOURCE, "Table 3, ideal values", AGREES if not off else WRONG, "one ideal value for both schemes",
        f"estimate less residual in {2 * (len(NAMES) - len(off))} of {2 * len(NAMES)}", "0" if not off else "-",
        "Set by the authors; the simulation's estimates of both schemes are counted from the same values.",
    )  # fmt: skip


def judge_order() -> Verdict:
    """Judge the order of the six rows of dA_a in Table 3, which carry no name."""
    likely, every = orders_as_likely()
    determined = likely <= every / 20
    return Verdict(
        SOURCE, "Table 3, order of dA_a", AGREES if determined else NOT_DETERMINED, "six values without names",
        f"{likely} of {every} orders are as likely as that of (13)", "0" if determined else "not quantified",
        "Read in the order of the states. Residuals with sigmas in proportion to 1/degree of Table 2 do not decide.",
    )  # fmt: skip


def rms(group: str, scheme: int) -> float:
    """Return the rms of the residuals of a group."""
    part = residuals(scheme)[GROUPS[group]]
    return sqrt(sum(r**2 for r in part) / len(part))


def larger_with_thirty() -> list[str]:
    """Return parameters whose residual is larger with thirty positions than with eighteen."""
    return [n for n, a, b in zip(NAMES, residuals(0), residuals(1), strict=True) if abs(b) > abs(a)]


def sentences() -> tuple[Verdict, ...]:
    """Return what Section 4.1 sums up."""
    degrees = [(float(a), float(b)) for a, b in TABLE_2]
    strong = min(min(pair) for pair in degrees)
    weaker = [n for n, (a, b) in zip(NAMES, degrees, strict=True) if b < a]
    larger = larger_with_thirty()
    worse = [g for g in GROUPS if rms(g, 1) > rms(g, 0)]
    level = Verdict(
        SOURCE, "Section 4.1, level", AGREES if strong > 10 else WRONG,
        "the observability of the two schemes was at the level of strong", f"least {strong}",
        "0" if strong > 10 else "-",
        "All 42 are above the 10 of (24), where the level is called high.",
    )  # fmt: skip
    mostly = Verdict(
        SOURCE, "Section 4.1, mostly stronger", AGREES if len(weaker) < len(NAMES) / 2 else WRONG,
        "mostly stronger with 30 positions", f"in {len(NAMES) - len(weaker)} of {len(NAMES)} rows", "0",
        f"Not for {' and '.join(weaker)}. A degree is a ratio to an initial sigma, and grows with time.",
    )  # fmt: skip
    worst = max(abs(b) / abs(a) for a, b in zip(residuals(0), residuals(1), strict=True))
    smaller = Verdict(
        SOURCE, "Section 4.1, residuals", WRONG if larger else AGREES,
        "the residual error of the 30-position scheme was smaller than the residual error of the 18-position scheme",
        f"in {len(NAMES) - len(larger)} of {len(NAMES)} parameters",
        f"up to {worst:.2g} times larger" if larger else "0",
        f"It is larger for {', '.join(larger)}; as the RMS of a group for {', '.join(worse)} ("
        f"{', '.join(f'{rms(g, 0):.2f} to {rms(g, 1):.2f} ppm' for g in worse)}). One draw of noise each: of 21 "
        "parameters of equal sigma half would be larger.",
    )  # fmt: skip
    count = Verdict(
        SOURCE, "Abstract, 21 parameters", AGREES if len(NAMES) == 21 else WRONG, "21 error parameters, 30 dimensions",
        f"{len(NAMES)} and {len(NAMES) + 9}", "0",
        "Constants 6, scale factors 6, installation 3 + 6; nine of navigation.",
    )  # fmt: skip
    return (level, mostly, smaller, count)


def verdicts() -> tuple[Verdict, ...]:
    """Return the verdicts on Tables 2, 3 and 4, then on the sentences."""
    rows = range(len(NAMES))
    three = (judge(i, s) for i in rows for s in (0, 1) for judge in (judge_estimate, judge_residual))
    return (
        *(judge_degree(i) for i in rows),
        *three,
        judge_ideals(),
        judge_order(),
        *(judge_result(i) for i in rows),
        *sentences(),
    )
