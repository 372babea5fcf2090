"""What Table 1's path shows of the 42 constants at the noise of Section 4.1, and of a ring laser.

Section 4.1 states white noise of 0.00005 deg/h and 1 ug without its bandwidth: taken as that of one sample at 100 Hz,
the rate of Section 4.2.
"""

from __future__ import annotations

from functools import cache
from math import radians
from typing import Any

import numpy as np

from derivations.cai2016 import table_1
from derivations.cai2016.symbols import SOURCE
from derivations.information import NAVIGATION, VELOCITY, Noise, of_density, sigmas, unobserved
from derivations.verdict import AGREES, ARCSEC, NOT_DETERMINED, Verdict

LATITUDE = radians(34.2)  # not printed: the authors' laboratory lies between 28 and 40 deg north
DEG_H, UG = radians(1.0) / 3600, 9.80665e-6
G0 = 9.80665
NAMES = (
    *(f"dK_G {i}{j}" for j in "xyz" for i in "xyz" if i >= j), *(f"b_g{i}" for i in "xyz"),
    *(f"G_{i}{j}" for i in "xyz" for j in "xyz"), *(f"dK_A {i}{j}" for j in "xyz" for i in "xyz"),
    *(f"b_a{i}" for i in "xyz"), *(f"K_a{i}{i}" for i in "xyz"),
    "K_axy", "K_axz", "K_ayx", "K_ayz", "K_azx", "K_azy", "r_x", "r_y", "r_z",
)  # fmt: skip
# errors before the filter, Section 4.1, SI
PRIOR = np.array([
    *(300e-6 if n[-2] == n[-1] else 180 * ARCSEC for n in NAMES[:6]), *[0.05 * DEG_H] * 3, *[0.001 * DEG_H / G0] * 9,
    *(300e-6 if n[-2] == n[-1] else 180 * ARCSEC for n in NAMES[18:27]), *[200 * UG] * 3,
    *[300 * UG / G0**2] * 9, *[0.02] * 3,
])  # fmt: skip
LOOSE = 1e-3  # m/s: how still a unit stands on a table that turns it; no noise of velocity is printed
STATED = Noise(of_density(0.00005 * DEG_H, 100.0), of_density(UG, 100.0))


def columns(rate: Any, force: Any) -> Any:
    """Return (n, 6, 42) readings too much by each constant, first order of (1), (4), (9) to (11)."""
    n, zero = len(rate), np.zeros(len(rate))
    out = np.zeros((n, 6, 42))
    at = 0
    for j in range(3):
        for i in range(j, 3):
            out[:, i, at] = rate[:, j]
            at += 1
    for i in range(3):
        out[:, i, 6 + i] = 1
        out[:, i, 9 + 3 * i : 12 + 3 * i] = force
        out[:, 3 + i, 27 + i] = 1
        out[:, 3 + i, 30 + i] = force[:, i] ** 2
        out[:, 3 + i, 39 + i] = rate[:, i] ** 2 - (rate**2).sum(1)
        for j in range(3):
            out[:, 3 + i, 18 + 3 * j + i] = force[:, j]
        others = [j for j in range(3) if j != i]
        for k, j in enumerate(others):
            out[:, 3 + i, 33 + 2 * i + k] = force[:, i] * force[:, j]
    return out + zero[:, None, None]


@cache
def found(rate: float = STATED.rate, force: float = STATED.force, still: float = VELOCITY) -> dict[str, float]:
    """Return the sigma of each constant over its error before the filter; still [m/s]: noise of zero velocity."""
    s = sigmas(table_1.motion(), LATITUDE, columns, PRIOR, Noise(rate, force), still)
    return dict(zip(NAMES, map(float, s), strict=True))


@cache
def unseen() -> tuple[int, tuple[str, ...]]:
    """Return how many of the 51 states velocities on the path determine, and those that take part in the others."""
    null = unobserved(table_1.motion(), LATITUDE, columns, PRIOR)
    names = (*NAVIGATION, *NAMES)
    share = np.abs(null).max(axis=0, initial=0.0)
    return len(names) - len(null), tuple(n for n, s in zip(names, share, strict=True) if s > 0.01)


def judge_rank() -> Verdict:
    """Judge what of the 51 states of (22) the velocities of (25) determine on the path of Table 1."""
    rank, names = unseen()
    return Verdict(
        SOURCE, "Eq. (22), rank", AGREES if rank == 51 else NOT_DETERMINED, "51 states, observed by (25)",
        f"rank {rank} of 51", "0" if rank == 51 else f"rank {rank} of 51",
        f"Velocities without any noise leave {51 - rank} directions undetermined; {', '.join(names)} take part in "
        "them. No constant of the sensors does.",
    )  # fmt: skip
