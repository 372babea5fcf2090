"""Print on a console: control characters are shown, not obeyed, and what its encoding lacks becomes plain.

Titles, names and cells of foreign files reach the console; an escape sequence in one must not move its cursor.
"""

from __future__ import annotations

import codecs
import io
import re
import sys
from collections.abc import Iterable
from typing import TextIO

NAME = "gimbalcal.plain"  # of the error handler
PLAIN = {
    "±": "+-", "−": "-", "–": "-", "µ": "u", "μ": "u", "°": " deg", "σ": "sigma", "χ": "chi", "τ": "tau", "√": "sqrt",
    "·": "*", "×": "x", "→": "->", "⇒": "=>", "≤": "<=", "≥": ">=", "≈": "~", "∞": "inf", "′": "'", "″": '"', "’": "'",
    "“": '"', "”": '"', "…": "...",
}  # fmt: skip
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
CONTROLS = {
    c: f"\\x{c:02x}" if c < 0x100 else f"\\u{c:04x}"
    for c in (*range(32), *range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A))
    if chr(c) not in "\t\n"
}  # of ASCII and Latin-1, and those that reverse the direction of writing
POWER = re.compile(f"[{''.join(map(chr, SUPERSCRIPTS))}]+")


def plain(text: str) -> str:
    """Return a text in ASCII, with a question mark for what has no equivalent.

    >>> plain("χ² = 1565, p = 10⁻⁶, 16.3 ± 0.5 µg"), plain("Grüße")
    ('chi^2 = 1565, p = 10^-6, 16.3 +- 0.5 ug', 'Gr??e')
    """
    text = POWER.sub(lambda power: f"^{power[0].translate(SUPERSCRIPTS)}", text)
    return "".join(PLAIN.get(c, c) for c in text).encode("ascii", "replace").decode()


def say(text: str, stream: TextIO | None = None, end: str = "\n") -> None:
    r"""Print a text on stdout, or on another stream, with its control characters as escapes.

    >>> say("bench \x1b[31m4")
    bench \x1b[31m4
    """
    print(text.translate(CONTROLS), end=end, file=sys.stdout if stream is None else stream, flush=stream is not None)


def print_plain_characters(streams: Iterable[TextIO]) -> None:
    """Make streams print what their encoding lacks by plain characters."""
    codecs.register_error(NAME, _replaced)
    for stream in streams:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=NAME)


def _replaced(problem: UnicodeError) -> tuple[str, int]:
    assert isinstance(problem, UnicodeEncodeError)
    return plain(problem.object[problem.start : problem.end]), problem.end
