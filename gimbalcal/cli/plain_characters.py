"""Print on consoles whose encoding lacks some characters: `±` becomes `+-` there, instead of an error."""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Iterable
from typing import TextIO

NAME = "gimbalcal.plain"  # of the error handler
PLAIN = {
    "±": "+-", "−": "-", "–": "-", "µ": "u", "μ": "u", "°": " deg", "σ": "sigma", "χ": "chi", "τ": "tau", "√": "sqrt",
    "·": "*", "×": "x", "→": "->", "⇒": "=>", "≤": "<=", "≥": ">=", "≈": "~", "∞": "inf", "′": "'", "″": '"', "’": "'",
    "“": '"', "”": '"', "…": "...",
}  # fmt: skip
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
POWER = re.compile(f"[{''.join(map(chr, SUPERSCRIPTS))}]+")


def plain(text: str) -> str:
    """Return a text in ASCII, with a question mark for what has no equivalent.

    >>> plain("χ² = 1565, p = 10⁻⁶, 16.3 ± 0.5 µg"), plain("Grüße")
    ('chi^2 = 1565, p = 10^-6, 16.3 +- 0.5 ug', 'Gr??e')
    """
    text = POWER.sub(lambda power: f"^{power[0].translate(SUPERSCRIPTS)}", text)
    return "".join(PLAIN.get(c, c) for c in text).encode("ascii", "replace").decode()


def print_plain_characters(streams: Iterable[TextIO]) -> None:
    """Make streams print what their encoding lacks by plain characters."""
    codecs.register_error(NAME, _replaced)
    for stream in streams:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=NAME)


def _replaced(problem: UnicodeError) -> tuple[str, int]:
    assert isinstance(problem, UnicodeEncodeError)
    return plain(problem.object[problem.start : problem.end]), problem.end
