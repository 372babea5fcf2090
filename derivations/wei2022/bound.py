"""What Table 1's path shows of the 21 constants, at a noise and times that the paper does not print."""

from __future__ import annotations

from functools import cache
from math import radians
from typing import Any

import numpy as np

from derivations.information import NAVIGATION, Noise, sigmas, unobserved
from derivations.turning import path
from derivations.verdict import AGREES, ARCSEC, NOT_DETERMINED, WRONG, Verdict, by_size
from derivations.wei2022 import table_1
from derivations.wei2022.symbols import NAMES, SOURCE

LATITUDE = radians(30.0)  # Section 4.1
DEG_H, UG = radians(1.0) / 3600, 9.80665e-6
NOISE = Noise(radians(0.002) / 60, 5 * UG)  # 0.002 deg/sqrt(h), 5 ug/sqrt(Hz)
# a priori: wide, so that the path decides
PRIOR = np.array([1.0 * DEG_H] * 3 + [1e3 * UG] * 3 + [1e-3] * 6 + [1e3 * ARCSEC] * 9)


def columns(rate: Any, force: Any) -> Any:
    """Return (n, 6, 21) readings too much by each constant: (7), (8)."""
    out = np.zeros((len(rate), 6, 21))
    for i in range(3):
        out[:, i, i] = out[:, 3 + i, 3 + i] = 1
        out[:, i, 6 + i], out[:, 3 + i, 9 + i] = rate[:, i], force[:, i]
    for k, (i, j) in enumerate(((1, 0), (2, 0), (2, 1)), start=12):
        out[:, i, k] = rate[:, j]
    for k, (i, j) in enumerate(((1, 0), (2, 0), (0, 1), (2, 1), (0, 2), (1, 2)), start=15):
        out[:, 3 + i, k] = force[:, j]
    return out


@cache
def found() -> dict[str, float]:
    """Return the sigma of each constant over its prior."""
    s = sigmas(table_1.motion(), LATITUDE, columns, PRIOR, NOISE)
    return dict(zip(NAMES, map(float, s), strict=True))


def judge_all_seen() -> Verdict:
    """Judge Section 3.2: the scheme can calibrate 21 errors."""
    ratios = found()
    determined = [n for n, r in ratios.items() if r < 0.1]
    worst = max(ratios, key=lambda n: ratios[n])
    return Verdict(
        SOURCE, "Section 3.2, 21 errors", AGREES if len(determined) == 21 else WRONG,
        "this scheme can calibrate 21 related sensor errors", f"{len(determined)} of 21",
        "0" if len(determined) == 21 else "-",
        f"Measured velocities alone leave less than a tenth of each prior (the most of {worst}, "
        f"{100 * ratios[worst]:.1g} %), at 10 deg/s, 100 s stops, 0.002 deg/sqrt(h) and 5 ug/sqrt(Hz), which are ours.",
    )  # fmt: skip


def judge_rank() -> Verdict:
    """Judge what of the 30 states of (13) velocity and position, (15), determine on the path of Table 1."""
    null = unobserved(table_1.motion(), LATITUDE, columns, PRIOR)
    place = null[:, [NAVIGATION.index(n) for n in ("dL", "dlambda", "dh")]]
    left = len(null) - int(np.linalg.matrix_rank(place, tol=1e-6))
    states = len(NAVIGATION) + len(NAMES)
    return Verdict(
        SOURCE, "Eq. (13), rank", AGREES if left == 0 else NOT_DETERMINED, f"{states} states, observed by (15)",
        f"rank {states - left} of {states}", "0" if left == 0 else f"rank {states - left} of {states}",
        f"Velocities alone determine {states - len(null)}; longitude and height are known by the position of (15).",
    )  # fmt: skip


@cache
def gained() -> tuple[float, float]:
    """Return the median factor in sigma that rows 16 to 30 gain over rows 1 to 15, and the least of it."""
    turns = table_1.turns()
    half = path(table_1.start(), turns[: len(turns) // 2], table_1.SPEED, table_1.STOP)
    s = sigmas(half, LATITUDE, columns, PRIOR, NOISE)
    ratios = s / np.array([found()[n] for n in NAMES])
    return float(np.median(ratios)), float(ratios.min())


def judge_second_half() -> Verdict:
    """Judge what the opposite turns of rows 16 to 30 add."""
    factor, least = gained()
    longer = 2**0.5  # of twice the time
    return Verdict(
        SOURCE, "Table 1, gain of 16~30", by_size(min(factor - longer, 0.0), 0.0, longer - 1),
        "order 16~30: the direction is opposite", f"sigmas fall by {factor:.1f} in the median",
        "0" if factor > longer else f"{factor:.1f} of {longer:.1f} by time alone",
        f"All 21 constants are determined by rows 1 to 15; the rest takes their sigmas down by {factor:.1f} in the "
        f"median and {least:.1f} at least, where twice the time alone would make {longer:.1f}.",
        assumes="10 deg/s, 100 s stops, 0.002 deg/sqrt(h) and 5 ug/sqrt(Hz)",
    )  # fmt: skip


def verdicts() -> tuple[Verdict, ...]:
    """Return what the path of Table 1 shows."""
    return (judge_all_seen(), judge_rank(), judge_second_half())
