"""Tables 2 and 3, and the sentences that sum them up.

The mean of 500 errors of an unbiased estimator scatters by RMS / sqrt(500) about zero, and the RMS itself by 3 %. An
entry agrees when its mean lies within four of those and, for the claim that the turntable does not matter, when the
three RMS lie as near to one another as chance leaves them: within five standard errors, or, for the nine parameters of
Eq. (30), whose sigma has heavy tails, within the factor that `differences.chance` finds once in twenty.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import sympy as sp

from derivations.verdict import AGREES, APPROXIMATION, MISPRINT, NOT_DETERMINED, WRONG, Verdict, by_size
from derivations.wang2019 import differences, gyroscope
from derivations.wang2019.symbols import SOURCE

RUNS = 500


@dataclass(frozen=True)
class Row:
    """(mean, RMS) at turntable errors of 3 arcsec, 3 arcmin, 3 deg, as printed."""

    table: int
    name: str
    unit: str
    entries: tuple[tuple[float, float], ...]


def _rows(table: int, unit: str, names: str, numbers: str) -> list[Row]:
    values = [float(x) for x in numbers.split()]
    out = []
    for i, name in enumerate(names.split()):
        six = values[6 * i : 6 * i + 6]
        out.append(Row(table, name, unit, ((six[0], six[1]), (six[2], six[3]), (six[4], six[5]))))
    return out


ROWS = (
    *_rows(2, "ug", "nabla_x nabla_y nabla_z",
           "4.32e-2 1.90 4.33e-2 1.91 4.50e-2 2.11  2.14e-2 2.02 2.14e-2 2.01 2.31e-2 1.95 "
           "-3.69e-3 1.96 -3.68e-3 1.96 -2.95e-3 2.06"),
    *_rows(2, "ug/pulse", "K_a1x K_a1y K_a1z",
           "1.17e-7 1.90e-5 1.17e-7 1.90e-5 1.16e-7 2.04e-5  -2.37e-7 3.35e-5 -2.37e-7 3.35e-5 -2.28e-7 3.41e-5 "
           "-7.49e-7 1.86e-5 -7.48e-7 1.86e-5 -7.22e-7 1.81e-5"),
    *_rows(2, "fg/pulse^2", "K_a2x K_a2y K_a2z",
           "1.70e-3 4.93e-2 1.69e-3 4.94e-2 1.75e-3 5.40e-2  -3.14e-4 4.64e-2 -3.13e-4 4.64e-2 -2.86e-4 4.52e-2 "
           "2.45e-3 4.72e-2 2.46e-3 4.72e-2 2.55e-3 4.94e-2"),
    *_rows(2, "zg/pulse^3", "K_a3x K_a3y K_a3z",
           "1.10e-3 0.37 1.10e-3 0.38 1.48e-3 0.40  2.41e-3 0.62 2.40e-3 0.62 2.12e-3 0.63 "
           "1.96e-2 0.37 1.96e-2 0.37 1.88e-2 0.35"),
    *_rows(2, "1e-4", "E_ayx E_azx E_azy",
           "-5.25e-4 1.91e-2 -5.25e-4 1.91e-2 -5.04e-4 1.90e-2  -5.87e-4 1.90e-2 -5.87e-4 1.90e-2 -6.00e-4 1.87e-2 "
           "2.20e-4 1.87e-2 2.20e-4 1.87e-2 2.19e-4 1.97e-2"),
    *_rows(3, "1e-6 deg/s", "eps_x eps_y eps_z",
           "6.48e-4 1.58e-2 6.46e-4 1.58e-2 5.52e-4 1.57e-2  9.85e-4 1.94e-3 9.84e-4 1.95e-3 9.88e-4 1.94e-3 "
           "8.50e-4 2.04e-3 8.52e-4 2.03e-3 8.38e-4 2.01e-3"),
    *_rows(3, "1e-7 deg/s/pulse", "K_g1x K_g1y K_g1z",
           "-7.44e-10 3.14e-8 1.48e-9 1.73e-8 4.48e-10 1.87e-8  1.29e-9 6.27e-8 -3.38e-9 4.50e-8 -2.48e-9 6.51e-8 "
           "-1.24e-9 3.88e-8 1.47e-9 1.90e-8 3.51e-10 1.68e-8"),
    *_rows(3, "1e-17 deg/s/pulse^2", "K_g2x K_g2y K_g2z",
           "-1.71e-3 9.40e-2 -6.21e-3 0.15 1.91e-3 0.10  -9.34e-5 2.73e-2 1.86e-3 2.92e-2 2.14e-3 6.14e-2 "
           "2.63e-3 7.18e-2 -2.43e-3 3.53e-2 7.88e-5 1.19e-2"),
    *_rows(3, "1e-4", "E_gyx E_gzx E_gzy",
           "2.03e-6 1.18e-4 7.95e-6 1.90e-4 -2.92e-6 1.41e-4  1.81e-6 1.18e-4 7.74e-6 1.90e-4 -3.38e-6 1.31e-4 "
           "-2.18e-6 8.02e-5 3.45e-6 4.17e-5 -4.81e-7 1.81e-5"),
)  # fmt: skip


# the difference of two RMS of the same 500 draws scatters by at most sqrt(2) / sqrt(2 * 500) of their size
GAUSSIAN = 1 + 5 * sqrt(2) / sqrt(2 * RUNS)
OF_30 = tuple(row.name for row in ROWS if row.table == 3 and not row.name.startswith("eps"))  # K_g1, K_g2, E


def judge_row(row: Row) -> Verdict:
    """Judge means against zero, RMS against one another."""
    pulls = [mean / (rms / sqrt(RUNS)) for mean, rms in row.entries]
    worst = max(pulls, key=abs)
    spread = [rms for _, rms in row.entries]
    ratio = max(spread) / min(spread)
    heavy = row.name in OF_30
    allowed = float(differences.chance()[OF_30.index(row.name)]) if heavy else GAUSSIAN
    largest = f"{abs(max((m for m, _ in row.entries), key=abs)):.2g} {row.unit}"
    biased, excessive = abs(worst) > 4, ratio > allowed
    undecided = not excessive and ratio > GAUSSIAN
    largest_share = max(abs(mean) / rms for mean, rms in row.entries)
    verdict = NOT_DETERMINED if undecided else AGREES
    if biased or excessive:
        verdict = WRONG if excessive or largest_share >= 1 else APPROXIMATION
    words = [
        f"The mean lies {abs(worst):.0f} standard errors (RMS / sqrt(500)) from zero at "
        f"{sum(abs(p) > 4 for p in pulls)} of the three turntables: this estimate is biased by {largest}, "
        f"{largest_share:.2g} of its RMS, as the norm of noisy rests is, unless its noise is taken off. Ours is not"
        if biased
        else f"The means lie within {abs(worst):.1f} standard errors of zero"
    ]
    if excessive:
        words.append(f"The three RMS differ by a factor of {ratio:.2g}, where chance leaves {allowed:.2g}")
    elif heavy:
        words.append(
            f"The three RMS differ by a factor of {ratio:.2g}; a few runs in which Eq. (30) is nearly singular make an "
            f"RMS, and chance alone makes a factor of {allowed:.0f} once in twenty. They neither show an influence of "
            "the turntable nor a bound on it"
        )
    else:
        words.append(
            f"The RMS lie within {100 * (ratio - 1):.0f} % of one another. The length of a position is not printed, so "
            "the RMS cannot be derived; the benchmark shows the bound"
        )
    printed = ", ".join(f"{m:g} / {r:g}" for m, r in row.entries)
    size = ", ".join([largest] * biased + [f"factor {ratio:.2g}"] * excessive) or "0"
    if undecided:
        size = f"factor {ratio:.2g}"
    return Verdict(SOURCE, f"Table {row.table}, {row.name}", verdict,
                   f"{printed} {row.unit}", "mean 0 within RMS / sqrt(500); one RMS for all turntables", size,
                   ". ".join(words) + ".",
                   assumes="500 independent runs" + ", and for (30) our noise and speed" * heavy,
                   )  # fmt: skip


# what section 5.1 calls the maximum calibration errors, in the unit of the rows that begin so
LARGEST = {
    (2, "nabla"): (0.045, 0.0005), (2, "K_a1"): (-7.49e-7, 5e-10), (2, "K_a2"): (2.55e-3, 5e-6),
    (2, "K_a3"): (1.96e-2, 5e-5), (3, "eps"): (9.88e-4, 5e-7), (3, "K_g1"): (-3.38e-9, 5e-12),
    (3, "K_g2"): (-6.21e-3, 5e-6), (3, "E_g"): (7.95e-6, 5e-9),
}  # fmt: skip


def judge_largest(table: int, start: str) -> Verdict:
    """Judge a maximum error of section 5.1: the largest mean of its group, to its digits."""
    printed, rounding = LARGEST[table, start]
    group = [row for row in ROWS if row.table == table and row.name.startswith(start)]
    largest = max((m for row in group for m, _ in row.entries), key=abs)
    error = max(rms for row in group for _, rms in row.entries)
    verdict = by_size(printed - largest, rounding)
    return Verdict(
        SOURCE, f"Section 5.1, maximum of {start}", verdict, f"{printed:g} {group[0].unit}",
        f"{largest:g} {group[0].unit}", "0" if verdict == AGREES else f"{abs(printed - largest):.1g} {group[0].unit}",
        f"The largest of the means of 500 errors. As the error of one calibration it would be the largest RMS, "
        f"{error:g} {group[0].unit}, {error / abs(largest):.0f} times as large.",
        assumes="that the error of a calibration means the mean of 500",
    )  # fmt: skip


def sentences() -> tuple[Verdict, ...]:
    """Return what the text of section 5.1 sums up."""
    means = [m for row in ROWS if row.table == 2 and row.name.startswith("E_") for m, _ in row.entries]
    largest = max(means, key=abs)
    printed = -6.00e-4
    slip = MISPRINT if abs(printed - largest) < 5e-7 else by_size(printed - largest * 1e-4, 5e-7)
    misprint = Verdict(
        SOURCE, "Section 5.1, misalignment error", slip, f"{printed:.2e}", f"{largest * 1e-4:.2e}",
        f"{abs(printed - largest * 1e-4):.3e}",
        "The sentence takes -6.00e-4 from Table 2 without the table's unit of 1e-4; the same sentence for Table 3 "
        "has it. And "
        "what it calls the maximum calibration errors are the largest means of 500 errors: the errors are the RMS.",
    )  # fmt: skip
    by_angle = sp.diff(gyroscope.P(), gyroscope.angle)
    turntable = Verdict(
        SOURCE, "Section 5.1, turntable", AGREES if by_angle == 0 else WRONG,
        "turntable angle errors have no effect on the calibration errors",
        "none through the attitude of a position or an axis; in full through the angle of a rotation",
        "an angle wrong by 3 deg in 360 makes K_g1 wrong by 0.8 %",
        "Norms take the attitude out of Eqs. (18), (30) and (35), but 2 theta stands in Eq. (30): an error of the "
        "rotation "
        "angle goes into K_g1 in full. What holds is independence of the axis; the angle must be whole revolutions "
        "closed against a mark.",
    )  # fmt: skip
    return (misprint, turntable, *(judge_largest(*key) for key in LARGEST))


def verdicts() -> tuple[Verdict, ...]:
    """Return the verdicts on all 27 rows and the two sentences."""
    return (*(judge_row(row) for row in ROWS), *sentences())
