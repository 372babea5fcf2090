r"""Tables 2 to 4: thirteen combined coefficients from twelve residuals, at 40 deg latitude.

Each reference value is computed from the derived form (not the printed one) of its equation. Biases are divided by g,
which the paper does not state: normal gravity at 40 deg is used, and the g that fits the printed digits best is given.
A value agrees within 1.5 units of its last digit, half for its own rounding and one for rounded intermediate results.

For a value that does not follow, every combination of these slips is tried: all biases, scale factors or betas counted
with the other sign, and sin L lost from the bias. The fewest that reproduce it are the explanation. The paper also
prints what its simulation estimated; where that confirms the reference, the reference is no slip of the pen, so the
entry is "wrong" and not "misprint".

Six relations hold between the thirteen coefficients whatever the parameters are, since their rank is seven. A column
that breaks them belongs to no accelerometer.

Tables 2 and 3 are inputs. Table 4 confirms an entry where a reference value that contains it follows from the tables
as printed; an entry without one may have been used with another sign.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import sympy as sp

from derivations.verdict import (
    AGREES,
    ARCSEC,
    MISPRINT,
    NOT_DETERMINED,
    WRONG,
    Verdict,
    in_unit,
    last_digit,
    with_package,
)
from derivations.wu2018.separation import coefficients
from derivations.wu2018.symbols import BETA, BIAS, G_NORMAL, NUMBERS, SCALE, SOURCE, TABLE_2, TABLE_3, L, g

LAST_DIGITS = 1.5


@dataclass(frozen=True)
class Row:
    """One row of Table 4 as printed: mantissas as text, so that their last digit is known."""

    name: str  # as in the errata
    coefficient: str  # key of separation.coefficients
    equation: str
    reference: str
    estimated: str
    error: str


ROWS = (
    Row("x1", "x_1", "(21)", "1.1228e-4", "1.1256e-4", "2.8e-7"),
    Row("x2", "x_2", "(22)", "-8.645e-5", "-8.612e-5", "3.3e-7"),
    Row("x3", "x_3", "(23)", "8.217e-5", "8.206e-5", "-1.1e-7"),
    Row("x4", "x_4", "(24)", "-5.000e-5", "-4.957e-5", "4.3e-7"),
    Row("x5", "x_5", "(25)", "1.212e-5", "1.185e-5", "-2.7e-7"),
    Row("delta_phi_1s", "dphi_1s", "(35)", "-1.3319e-4", "-1.3343e-4", "-2.4e-7"),
    Row("delta_phi_1c", "dphi_1c", "(36)", "-3.542e-5", "-3.575e-5", "-3.3e-7"),
    Row("delta_phi_2s", "dphi_2s", "(37)", "3.830e-5", "3.848e-5", "1.8e-7"),
    Row("delta_phi_2c", "dphi_2c", "(38)", "-9.28e-6", "-9.47e-6", "-1.9e-7"),
    Row("delta_theta_1s", "dtheta_1s", "(31)", "-5.521e-5", "-5.536e-5", "-1.5e-7"),
    Row("delta_theta_1c", "dtheta_1c", "(30)", "1.3629e-4", "1.3695e-4", "6.6e-7"),
    Row("delta_theta_2s", "dtheta_2s", "(33)", "-5.97e-6", "-5.76e-6", "2.1e-7"),
    Row("delta_theta_2c", "dtheta_2c", "(32)", "-2.462e-5", "-2.484e-5", "-2.2e-7"),
)


def fits(value: float, printed: str) -> bool:
    """Return whether a computed value is the printed one to its digits."""
    return abs(value - float(printed)) <= LAST_DIGITS * last_digit(printed)


@cache
def evaluate(coefficient: str, flipped: tuple[Any, ...] = (), lost: bool = False, gravity: float = G_NORMAL) -> float:
    """Return a coefficient from Tables 2 and 3, with some parameters sign-reversed and sin L lost from the biases."""
    expr = sp.expand(coefficients()[coefficient])
    if lost:
        expr = _without_sine(expr)
    values = NUMBERS | {g: gravity} | {symbol: -NUMBERS[symbol] for symbol in flipped}
    return float(expr.subs(values).evalf())


def _without_sine(expr: Any) -> Any:
    """Return the coefficient with sin L lost from its bias terms."""
    terms = sp.Add.make_args(sp.expand(expr))
    return sum((t / sp.sin(L) if t.has(*BIAS) and t.has(sp.sin(L)) else t for t in terms), start=sp.Integer(0))


def explanations(row: Row) -> Iterator[tuple[tuple[Any, ...], bool]]:
    """Yield combinations of slips that reproduce the reference value, fewest first.

    The parameters of one kind (biases, scale factors, betas) that occur in the coefficient are reversed together.
    """
    expr = coefficients()[row.coefficient]
    kinds = [tuple(s for s in kind if expr.has(s)) for kind in (BIAS, SCALE, BETA)]
    present = [kind for kind in kinds if kind]
    choices = [
        (len(chosen) + lost, tuple(itertools.chain(*chosen)), lost)
        for n in range(len(present) + 1)
        for chosen in itertools.combinations(present, n)
        for lost in ((False, True) if _without_sine(expr) != sp.expand(expr) else (False,))
    ]
    for _count, flipped, lost in sorted(choices, key=lambda c: c[0]):
        if fits(evaluate(row.coefficient, flipped, lost), row.reference):
            yield flipped, lost


def in_words(flipped: tuple[Any, ...], lost: bool) -> str:
    """Return a combination of slips."""
    parts = [f"the sign of {', '.join(map(str, flipped))} reversed"] if flipped else []
    return " and ".join(parts + ["sin L lost from the bias"] * lost)


@cache
def best_gravity() -> float:
    """Return the g [m/s^2] that minimises the misfit of the explained reference column in units of last digits."""

    def misfit(gravity: float) -> float:
        total = 0.0
        for row in ROWS:
            explained = next(explanations(row), None)
            if explained is not None:
                value = evaluate(row.coefficient, *explained, gravity)
                total += ((value - float(row.reference)) / last_digit(row.reference)) ** 2
        return total

    low, high = 9.78, 9.83
    for _ in range(25):  # the misfit is a parabola in 1/g: shrink by thirds
        third = (high - low) / 3
        if misfit(round(low + third, 7)) < misfit(round(high - third, 7)):
            high -= third
        else:
            low += third
    return (low + high) / 2


def closures(column: dict[str, float]) -> dict[str, float]:
    """Return the six relations that hold for any parameters; how far a column of the table breaks each."""
    S, C = float(sp.sin(NUMBERS[L])), float(sp.cos(NUMBERS[L]))
    v = column
    return {
        "dphi_2s + x4 C": v["dphi_2s"] + v["x_4"] * C,
        "dtheta_2c - x4 S C": v["dtheta_2c"] - v["x_4"] * S * C,
        "dphi_2c - x5 C": v["dphi_2c"] - v["x_5"] * C,
        "dtheta_2s - x5 S C": v["dtheta_2s"] - v["x_5"] * S * C,
        "dtheta_1c + S dphi_1s - C^2/S (x2 - dphi_1s)": v["dtheta_1c"]
        + S * v["dphi_1s"]
        - C**2 / S * (v["x_2"] - v["dphi_1s"]),
        "dtheta_1s - S dphi_1c - C^2/S (x3 + dphi_1c)": v["dtheta_1s"]
        - S * v["dphi_1c"]
        - C**2 / S * (v["x_3"] + v["dphi_1c"]),
    }


def broken_closures() -> dict[str, float]:
    """Return relations that the printed reference column breaks by more than its rounding."""
    column = {row.coefficient: float(row.reference) for row in ROWS}
    return {name: v for name, v in closures(column).items() if abs(v) > 5e-8}  # five last digits, factors up to 1.6


def _verdict(row: Row) -> tuple[str, str]:
    """Return the verdict and explanation of one reference value."""
    explained = next(explanations(row), None)
    confirmed = abs(float(row.estimated) - float(row.reference)) < 1e-6  # the accuracy the paper claims
    if explained == ((), False):
        return AGREES, f"It follows from {row.equation} and Tables 2 and 3."
    again = (
        "the simulated estimate confirms it, so the simulation had it too"
        if confirmed
        else "the simulated estimate does not confirm it"
    )
    if explained is None:
        return WRONG, f"No reversal of signs nor a lost sin L in {row.equation} reproduces it; {again}."
    words = f"{row.equation} gives it with {in_words(*explained)}; {again}.{other_side(explained[0])}"
    return (WRONG if confirmed else MISPRINT), words


def other_side(flipped: tuple[Any, ...]) -> str:
    """Return what the same reversal, made in Tables 2 or 3 instead, would do to the rest of the column."""
    sound = [r for r in ROWS if fits(evaluate(r.coefficient), r.reference)]
    spoiled = [r.name for r in sound if not fits(evaluate(r.coefficient, flipped), r.reference)]
    if spoiled:
        return f" Reversed in the input table instead, {', '.join(spoiled)} would no longer follow."
    return " No other row would notice it, so the fault may as well be that sign in the input table." if flipped else ""


def _error_column(row: Row) -> str:
    difference = float(row.estimated) - float(row.reference)
    right = abs(difference - float(row.error)) < 0.51 * last_digit(row.error)
    words = "is" if right else f"should be {difference:.1e}, not"
    return f"Its error column {words} {row.error}{', estimate minus reference' if right else ''}."


def item(row: Row) -> str:
    """Return a row as `errata.json` names it."""
    return f"Table 4, {row.name}"


def judge_row(row: Row) -> Verdict:
    """Return the verdict on one row of Table 4."""
    verdict, words = _verdict(row)
    value = evaluate(row.coefficient)
    explained = next(explanations(row), None)
    difference = float(row.reference) - value
    why = [words]
    if explained is not None:
        remaining = (evaluate(row.coefficient, *explained) - float(row.reference)) / last_digit(row.reference)
        g_fit = f"g = {G_NORMAL} m/s^2 (best fit {best_gravity():.4f})"
        why.append(f"{abs(remaining):.1f} units of the last digit remain with {g_fit}.")
    if verdict != AGREES:
        why.append(f"Derived and printed differ by {in_unit(abs(difference), 'ug')}.")
        broken = [f"{name} = {v:.1e}" for name, v in broken_closures().items() if _mentions(name, row.name)]
        if broken:
            why.append(f"No parameters at all give this column: {', '.join(broken)} must vanish.")
    why.append(_error_column(row))
    printed = f"reference {row.reference}, estimated {row.estimated}, error {row.error}"
    size = "0" if verdict == AGREES else in_unit(abs(difference), "ug")
    return with_package(Verdict(SOURCE, item(row), verdict, printed, f"{value:.4e}", size, " ".join(why)))


def _mentions(relation: str, name: str) -> bool:
    return name.replace("delta_", "d") in relation.split() or f"({name.replace('delta_', 'd')}" in relation


def verdicts(rows: tuple[Row, ...] = ROWS) -> tuple[Verdict, ...]:
    """Return the verdicts on all thirteen rows."""
    return tuple(judge_row(row) for row in rows)


# --- Tables 2 and 3, and what Section 6.1 says of all three

NOISE = 5e-3  # m/s^2 of one sample, Section 6.1
DAY = 86164.0905  # s, one turn of S_t


def judge_input(symbol: Any, value: float) -> Verdict:
    """Return the verdict on one entry of Tables 2 and 3."""
    table, unit = (3, "arcsec") if symbol in TABLE_3 else (2, "m/s^2" if symbol in BIAS else "")
    printed = f"{value / ARCSEC:.0f} {unit}" if table == 3 else f"{value:g} {unit}".strip()
    containing = [r for r in ROWS if coefficients()[r.coefficient].has(symbol)]
    following = [r.name for r in containing if fits(evaluate(r.coefficient), r.reference)]
    words = (
        f"An input of the simulation. Table 4 contains it in {', '.join(r.name for r in containing)}; of these "
        f"{', '.join(following) or 'none'} can be computed from the tables as printed."
    )
    if not following:
        reversed_ = [r.name for r in containing if fits(evaluate(r.coefficient, (symbol,)), r.reference)]
        words += f" With its sign reversed {', '.join(reversed_)} could." if reversed_ else ""
    return Verdict(
        SOURCE, f"Table {table}, {symbol}", AGREES if following else NOT_DETERMINED, printed,
        f"confirmed by {', '.join(following)}" if following else "not confirmed by any reference value",
        "0" if following else "not quantified", words,
    )  # fmt: skip


def inputs() -> tuple[Verdict, ...]:
    """Return the verdicts on the twelve entries of Tables 2 and 3."""
    return tuple(judge_input(symbol, value) for symbol, value in {**TABLE_2, **TABLE_3}.items())


def samples_of_a_day() -> float:
    """Return the samples in one turn of S_t whose white noise leaves errors as large as those of Table 4.

    The mean of z has the variance s^2/N of the noise s along the force; a harmonic of amplitude A(S_t) has 2 s^2/N over
    its factor squared. Every state is scaled by its own factor, so that the errors are equal draws.
    """
    C = float(sp.cos(NUMBERS[L]))
    s = NOISE / G_NORMAL
    # variance of each state times N / s^2: H = 1, C cos, C sin, C^2 cos 2, C^2 sin 2 (27)
    variance = {"x_1": 1.0, "x_2": 2 / C**2, "x_3": 2 / C**2, "x_4": 2 / C**4, "x_5": 2 / C**4}
    errors = {r.coefficient: float(r.estimated) - float(r.reference) for r in ROWS}
    return float(len(variance) * s**2 / sum(errors[k] ** 2 / v for k, v in variance.items()))


def sentences() -> tuple[Verdict, ...]:
    """Return the verdicts on what Section 6.1 says of Tables 2 to 4."""
    largest = max(abs(v) for v in TABLE_3.values()) / ARCSEC
    beyond = [str(s) for s, v in TABLE_3.items() if abs(v) / ARCSEC > 10 * (1 + 1e-9)]
    limit = [str(s) for s, v in TABLE_3.items() if str(s) not in beyond and abs(v) / ARCSEC > 10 * (1 - 1e-9)]
    errors = {r.name: abs(float(r.estimated) - float(r.reference)) for r in ROWS}
    worst = max(errors, key=lambda name: errors[name])
    far = [r.name for r in ROWS if abs(float(r.estimated) - evaluate(r.coefficient)) >= 1e-6]
    n = samples_of_a_day()
    return (
        Verdict(
            SOURCE, "Section 6.1, 10 arcsec", WRONG if beyond else AGREES, "the residuals are generally less than 10 "
            "arcsec", f"at most {largest:.0f} arcsec", "0" if not beyond else f"{len(beyond)} of 6",
            f"{', '.join(limit)} have just 10 arcsec.",
        ),
        Verdict(
            SOURCE, "Section 6.1, 1e-6 rad", AGREES if errors[worst] < 1e-6 else WRONG,
            "the estimation accuracy of each combined coefficient is better than 1e-6 rad",
            f"{errors[worst]:.1e} ({worst})", "0" if errors[worst] < 1e-6 else in_unit(errors[worst], "ug"),
            f"Estimate less printed reference. From what Tables 2 and 3 give {', '.join(far)} differ by more; "
            "their references are judged with Table 4.",
            assumes="that the simulation's true values were the printed references",
        ),
        Verdict(
            SOURCE, "Section 6.1, noise", NOT_DETERMINED, "a zero-mean random noise with an amplitude of 5e-3 m/s^2",
            f"{n:.1e} samples, {n / DAY:.0f} Hz over one turn of S_t", "not quantified",
            "Rate and duration are not printed. The errors of x1 to x5 are those of white noise of that size if one "
            "turn of S_t has so many samples, known to a factor of about two from five errors.",
        ),
    )  # fmt: skip
