"""Tables 2, 3, 4 and 6, and the sentences that sum them up.

*Tables 2 and 3.* The mean of 500 errors of an unbiased estimator scatters by RMS / sqrt(500) about zero, and the RMS
itself by 3 %. An entry agrees when its mean lies within four of those and, for the claim that the turntable does not
matter, when the three RMS lie within five standard errors of one another.

*Table 4.* Method 2 fits the same positions without the nonlinear terms. A second-order term of size q = K2 N^2 at one g
pulls its bias by between q / 2 (gravity at 45 degrees) and q (along the axis), so that range, and the rounding of the
printed digits, must hold the difference of methods 2 and 3.

*Table 6.* The decrease is (method 1 - method 3) / method 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

from derivations.verdict import AGREES, MISPRINT, NOT_DETERMINED, WRONG, Verdict
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


def judge_row(row: Row) -> Verdict:
    """Means against zero, RMS against one another."""
    pulls = [mean / (rms / sqrt(RUNS)) for mean, rms in row.entries]
    worst = max(pulls, key=abs)
    spread = [rms for _, rms in row.entries]
    ratio = max(spread) / min(spread)
    # the difference of two RMS of the same 500 draws scatters by at most sqrt(2) / sqrt(2 * 500) of their size
    allowed = 1 + 5 * sqrt(2) / sqrt(2 * RUNS)
    words, size = [], []
    if abs(worst) > 4:
        words.append(
            f"The mean lies {abs(worst):.0f} standard errors (RMS / sqrt(500)) from zero at "
            f"{sum(abs(p) > 4 for p in pulls)} of the three turntables: this estimate is biased by "
            f"{abs(max((m for m, _ in row.entries), key=abs)):.2g} {row.unit}, half of its RMS or so. Ours is not"
        )
        size.append(f"{abs(max((m for m, _ in row.entries), key=abs)):.2g} {row.unit}")
    if ratio > allowed:
        words.append(
            f"The three RMS differ by a factor of {ratio:.1f} where 500 runs leave {100 * (allowed - 1):.0f} %: a "
            f"few runs "
            "far off make them, as Eq. (30) hardly determines K_g2 and what hangs on it (see there). 'Without "
            "relying on "
            "the angle errors of the turntable' cannot be read from these numbers"
        )
        size.append(f"factor {ratio:.2g}")
    verdict = AGREES if not words else NOT_DETERMINED if ratio > allowed else WRONG
    why = ". ".join(words) or (
        f"The means lie within {abs(worst):.1f} standard errors of zero and the RMS within {100 * (ratio - 1):.0f} % "
        f"of one "
        "another. The length of a position is not printed, so the RMS cannot be derived; the benchmark shows the bound"
    )
    printed = ", ".join(f"{m:g} / {r:g}" for m, r in row.entries)
    return Verdict(SOURCE, f"Table {row.table}, {row.name}", verdict, f"{printed} {row.unit}",
                   "mean 0 within RMS / sqrt(500); one RMS for all turntables",
                   ", ".join(size) or "0", why + ".")  # fmt: skip


# (axis, bias of methods 2 and 3 [g], linear scale factor [g/pulse], K2 [g/pulse^2] of method 3)
TABLE_4 = (
    ("x", -1.23e-2, -1.21e-2, 2.32e-6, -1.53e-15),
    ("y", -1.55e-2, -1.54e-2, 2.26e-6, -1.12e-15),
    ("z", -1.39e-2, -1.37e-2, 2.18e-6, -1.21e-15),
)
LAST = 1e-4  # g, of the biases


def judge_bias(axis: str, two: float, three: float, K1: float, K2: float) -> Verdict:
    """Whether the bias that method 2 finds is that of method 3 plus the pull of the second order."""
    q = K2 / K1**2
    ends = sorted((three + q / 2, three + q))
    inside = ends[0] - LAST <= two <= ends[1] + LAST
    why = (
        f"Method 3's second order is {1e6 * q:.0f} ug at 1 g; left out, it pulls the bias to between {ends[0]:.4g} and "
        f"{ends[1]:.4g} g, and method 2 prints {two:.4g} g" + ("." if inside else ", which does not follow.")
    )
    gap = max(ends[0] - two, two - ends[1], 0.0)
    return Verdict(SOURCE, f"Table 4, nabla_{axis}", AGREES if inside else WRONG, f"{two:g}, {three:g}",
                   f"{ends[0]:.4g} to {ends[1]:.4g}", "0" if inside else f"{gap:.1g} g", why)  # fmt: skip


def judge_angles() -> tuple[Verdict, ...]:
    """Inter-triad angles of method 3 against those that methods 1's two rotations give."""
    one = {"alpha": (-7.48, 5.97), "beta": (-0.69, -0.026), "gamma": (-7.36, -3.77)}
    three = {"alpha": -14.72, "beta": 0.0039, "gamma": -4.84}
    lean = (4.24e-4, 3.21e-4, 1.75e-4, 3.58e-4, 13.30e-4, 2.09e-4)  # size of the six E of the two triads
    room = sum(lean) / 2.908882086657216e-4  # arcmin: what triangles left out of Eqs. (44) and (45) can move
    out = []
    for name, (a, g) in one.items():
        apart = three[name] - (a - g)
        fits = abs(apart) <= room
        why = (
            f"C_p^q of Eq. (43) should be the product of Eq. (45), inverted, and Eq. (44): {a - g:.2f} arcmin, "
            f"{abs(apart):.2f} "
            f"from the printed one. The triangles that (44) and (45) leave out are of that size (together {room:.1f} "
            "arcmin), so the table neither confirms nor contradicts itself here"
        )
        out.append(Verdict(SOURCE, f"Table 4, {name}_1", AGREES if fits else WRONG, f"{three[name]:g} arcmin",
                           f"{a - g:.2f} arcmin within {room:.1f}",
                           "0" if fits else f"{abs(apart):.2g} arcmin", why + "."))  # fmt: skip
    return tuple(out)


TABLE_6 = ((1.452, 1.513, 1.275, 12.19), (1.537, 1.528, 1.389, 9.63), (1.426, 1.448, 1.263, 11.43))


def judge_experiment(number: int, one: float, three: float, printed: float) -> Verdict:
    derived = 100 * (one - three) / one
    right = abs(derived - printed) < 0.006  # half of the last digit
    better = "The decrease against method 1, as the footnote says; one run each, so without an uncertainty."
    return Verdict(SOURCE, f"Table 6, experiment {number}",
    AGREES if right else WRONG, f"{printed} %", f"{derived:.2f} %",
                   "0" if right else f"{abs(derived - printed):.2g} %", better)  # fmt: skip


def judge_swing() -> Verdict:
    """Table 4's second order of the gyroscopes under Table 5's swing."""
    K1, K2 = 5.09e-7, 6.35e-18  # deg/s per pulse/s, the smallest of the three K_g2
    frequency, amplitude = 8.0, 5.0  # Hz, deg: roll
    mean = K2 / K1**2 * (2 * pi * frequency * amplitude) ** 2 / 2
    return Verdict(
        SOURCE,
        "Tables 4 and 5, K_g2",
        WRONG,
        "K_g2x -6.35e-18 deg/s/pulse^2; roll 8 Hz, 5 deg",
        f"mean rate {mean:.2f} deg/s where it is left out",
        f"{mean:.2f} deg/s",
        f"A square does not average out: 5 deg at 8 Hz peaks at {2 * pi * frequency * amplitude:.0f} deg/s, and the "
        f"smallest "
        f"K_g2 of Table 4 makes {mean:.2f} deg/s of mean drift of it for a navigator that leaves it out. No position "
        f"would "
        "survive a minute of that, while Figure 10 shows 18 % less error. Either pulses are not per second, or K_g2 "
        "is some "
        "thousand times too large: Eq. (30) hardly determines it (see there).",
    )


def sentences() -> tuple[Verdict, ...]:
    """What the text of section 5.1 sums up."""
    means = [m for row in ROWS if row.table == 2 and row.name.startswith("E_") for m, _ in row.entries]
    largest = max(means, key=abs)
    misprint = Verdict(
        SOURCE, "Section 5.1, misalignment error", MISPRINT, "-6.00e-4", f"{largest * 1e-4:.2e}", "5.999e-04",
        "The sentence takes -6.00e-4 from Table 2 without the table's unit of 1e-4; the same sentence for Table 3 "
        "has it. And "
        "what it calls the maximum calibration errors are the largest means of 500 errors: the errors are the RMS.",
    )  # fmt: skip
    turntable = Verdict(
        SOURCE, "Section 5.1, turntable", WRONG, "turntable angle errors have no effect on the calibration errors",
        "none through the attitude of a position or an axis; in full through the angle of a rotation",
        "an angle wrong by 3 deg in 360 makes K_g1 wrong by 0.8 %",
        "Norms take the attitude out of Eqs. (18), (30) and (35), but 2 theta stands in Eq. (30): an error of the "
        "rotation "
        "angle goes into K_g1 in full. What holds is independence of the axis; the angle must be whole revolutions "
        "closed against a mark.",
    )  # fmt: skip
    return (misprint, turntable)


def verdicts() -> tuple[Verdict, ...]:
    """All entries that can be judged, and the sentences."""
    experiments = (judge_experiment(i, a, c, d) for i, (a, _, c, d) in enumerate(TABLE_6, start=1))
    return (
        *(judge_row(row) for row in ROWS), *(judge_bias(*row) for row in TABLE_4), *judge_angles(), *experiments,
        judge_swing(), *sentences(),
    )  # fmt: skip
