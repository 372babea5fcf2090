"""Tables of the terms of a mount: in the columns of TPOINT, and each with the residual without it and with it."""

from __future__ import annotations

from collections.abc import Sequence

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.provenance import TermTest
from gimbalcal.report.html import Context
from gimbalcal.report.parameters import plus_minus
from gimbalcal.words.calibration_sentences import candidate_terms, sky_rms
from gimbalcal.words.naming import label_in_words, unit_in_print
from gimbalcal.words.rounding import p_value, printed_number, significant

CANDIDATES_SHOWN = 8  # of the page; the others are folded
CANDIDATES_PRINTED = 4  # of the console


def term_tables(c: Calibration) -> Context:
    """Return the tables of a mount for the page of its calibration; empty for any other."""
    tests = c.provenance.term_tests or ()
    candidates = [_row(t) for t in tests if not t.in_model]
    return {
        "tpoint": [dict(zip(("number", "term", "change", "value", "sigma"), map(printed_number, row), strict=True))
                   for row in _tpoint_rows(c)],
        "tpoint_rms": [(name, f"{x:.2f} arcsec") for name, x in _tpoint_rms(c)],
        "terms": [_row(t) for t in tests if t.in_model],
        "candidates": [candidates[:CANDIDATES_SHOWN], candidates[CANDIDATES_SHOWN:]],
    }  # fmt: skip


def terms_in_text(c: Calibration) -> str:
    """Return the tables of a mount for the console: TPOINT's, and the tests of its terms; empty for any other."""
    parts = []
    if table := _tpoint_rows(c):
        rows = [("", "coeff", "change", "value", "sigma"), *table]
        parts += ["{:>3s}  {:<8s}{:>11s} {:>11s} {:>9s}".format(*row) for row in rows]
        parts += ["", *(f"  {name} = {x:6.2f}" for name, x in _tpoint_rms(c)), ""]
    tests = c.provenance.term_tests or ()
    chosen = [t for t in tests if t.in_model], candidate_terms(c)[:CANDIDATES_PRINTED]
    if any(chosen):
        heads = (f"terms {where} the model: rms on the sky without and with each" for where in ("of", "outside"))
        for head, group in zip(heads, chosen, strict=True):
            if group:
                parts += [f"  {head}", *_aligned_rows([_row(t) for t in group])]
    return "\n".join(parts)


def _aligned_rows(rows: Sequence[Context]) -> list[str]:
    """Return rows as aligned lines: name, TPOINT's name, residuals, F, p-value, the largest correlation."""
    cells = [(r["words"], r["tpoint"], f"{r['without']} → {r['with_']} arcsec", f"F {r['F']}", f"p {r['p']}",
              r["correlated"][0] if r["correlated"] else "") for r in rows]  # fmt: skip
    width = [max(len(c[i]) for c in cells) for i in range(6)]
    return ["    " + "  ".join(f"{x:<{w}s}" for x, w in zip(c, width, strict=True)).rstrip() for c in cells]


def _tpoint_rows(c: Calibration) -> list[tuple[str, str, str, str, str]]:
    """Return ordinal, coefficient, change, value and sigma of each term, with the digits that TPOINT prints."""
    return [
        (str(i), t.term, f"{t.change or 0.0:+.3f}", f"{t.value:+.2f}", f"{t.sigma:.3f}")
        for i, t in enumerate(c.provenance.tpoint or (), 1)
    ]


def _tpoint_rms(c: Calibration) -> list[tuple[str, float]]:
    """Return the two measures of the residual on the sky [arcsec] by the names that TPOINT gives them."""
    sd = c.provenance.population_sd_arcsec
    return [("Sky RMS", sky_rms(c)), *([("Popn SD", sd)] if sd is not None else [])]


def _row(t: TermTest) -> Context:
    """Return the test of a term as printed."""
    return {
        "words": label_in_words(t.term),
        "tpoint": t.tpoint or "",
        "value": "" if t.value is None or t.sigma is None else plus_minus(t.value, t.sigma),
        "unit": unit_in_print(t.unit or ""),
        "without": significant(t.rms_without_arcsec, 3),
        "with_": significant(t.rms_with_arcsec, 3),
        "F": significant(t.F, 3),
        "p": p_value(t.p_value),
        "correlated": [f"{label_in_words(label)} {printed_number(f'{r:+.2f}')}" for label, r in t.correlations.items()],
        "name": t.tpoint or t.term,
    }
