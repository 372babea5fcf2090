"""Table 5: largest navigation errors before, after two and after three stages, and the sentences that sum them up.

All results "have been normalized", by numbers that are not printed, of recordings that are not printed: the 21 maxima
cannot be derived. The fourteen improvements can: (before - after) / before. Each maximum has two digits, which leaves
an improvement open by what is stated.
"""

from __future__ import annotations

from collections.abc import Iterator

from derivations.verdict import AGREES, APPROXIMATION, NOT_DETERMINED, WRONG, Verdict
from derivations.wu2018.symbols import SOURCE

# before, two-stage, improvement %, three-stage, improvement %
ROWS = {
    "longitude": (0.84, 0.58, 30.95, 0.33, 60.71),
    "latitude": (0.86, 0.60, 30.23, 0.26, 69.77),
    "northern velocity": (0.85, 0.70, 17.65, 0.56, 34.12),
    "eastern velocity": (0.87, 0.78, 10.34, 0.67, 22.99),
    "roll": (0.89, 0.50, 43.82, 0.38, 57.30),
    "pitch": (0.95, 0.58, 38.95, 0.43, 54.74),
    "yaw": (0.80, 0.54, 32.50, 0.44, 45.00),
}
STAGES = ("before", "two-stage", "three-stage")
LAST = 0.005  # half of the last digit of a maximum
VELOCITIES = ("northern velocity", "eastern velocity")
# what Section 6.2 says: stage, rows, "over ... %"
CLAIMS = (
    ("two-stage", tuple(n for n in ROWS if n not in VELOCITIES), 30.0),
    ("three-stage", tuple(n for n in ROWS if n not in VELOCITIES), 45.0),
    ("two-stage", VELOCITIES, 10.0),
    ("three-stage", VELOCITIES, 22.0),
)


def improvement(before: float, after: float) -> float:
    """Return the improvement in per cent of before."""
    return 100 * (before - after) / before


def _after(name: str, stage: str) -> tuple[float, float]:
    """Return the maximum and printed improvement after a stage."""
    i = 2 * STAGES.index(stage) - 1
    return ROWS[name][i], ROWS[name][i + 1]


def judge_improvement(name: str, stage: str) -> Verdict:
    """Judge the arithmetic."""
    before = ROWS[name][0]
    after, printed = _after(name, stage)
    derived = improvement(before, after)
    right = abs(derived - printed) < 0.006  # half of the last digit, and its rounding
    ends = improvement(before - LAST, after + LAST), improvement(before + LAST, after - LAST)
    return Verdict(
        SOURCE, f"Table 5, {name}, {stage} improvement", AGREES if right else WRONG, f"{printed:.2f} %",
        f"{derived:.2f} %", "0" if right else f"{abs(derived - printed):.2g} %",
        f"({before} - {after}) / {before}. The two digits of the maxima leave it between {ends[0]:.1f} and "
        f"{ends[1]:.1f} %.",
    )  # fmt: skip


def judge_maximum(name: str, stage: str) -> Verdict:
    """Judge a maximum of a run that is not printed, over a number that is not printed."""
    printed = ROWS[name][0] if stage == "before" else _after(name, stage)[0]
    return Verdict(
        SOURCE, f"Table 5, {name}, {stage}", NOT_DETERMINED, f"{printed:.2f}", "nothing printed determines it",
        "not quantified",
        "It needs the recordings and the number it was divided by; neither is printed. All seven rows begin between "
        "0.80 and 0.95, so they were not divided by their own maxima before calibration.",
    )  # fmt: skip


def judge_claim(stage: str, names: tuple[str, ...], bound: float) -> Verdict:
    """Judge a sentence of Section 6.2: every one of the improvements is over so many per cent."""
    least = min(names, key=lambda n: _after(n, stage)[1])
    before, (after, printed) = ROWS[least][0], _after(least, stage)
    over = improvement(before, after) > bound + 1e-9
    low = improvement(before - LAST, after + LAST)
    words = f"The least is that of {least}, {printed:.2f} %"
    if not over:
        words += f": not over {bound:g} %, and with the digits of the table anything from {low:.1f} %"
    return Verdict(
        SOURCE, f"Section 6.2, over {bound:g} %", AGREES if over else APPROXIMATION,
        f"{', '.join(names)} reduced by over {bound:g} % after {stage}", f"least {improvement(before, after):.2f} %",
        "0" if over else f"{bound - low:.1f} %", f"{words}.",
    )  # fmt: skip


def verdicts() -> Iterator[Verdict]:
    """Yield the verdicts row by row, then those on the sentences."""
    for name in ROWS:
        for stage in STAGES:
            yield judge_maximum(name, stage)
            if stage != "before":
                yield judge_improvement(name, stage)
    for claim in CLAIMS:
        yield judge_claim(*claim)
