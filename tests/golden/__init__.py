"""Compare pages, console output and sentences with the golden files of this folder.

Each golden file holds the text of one page or of one kind of output, so that rewording a sentence changes one file.
After a change of wording, regenerate all of them, read the difference and commit it:

    python -m pytest tests --regenerate-golden && git diff tests/golden

A test compares with the fixture `golden`: `golden("pages/noise", page_text(html))`. Words must be equal; numbers must
agree within rounding (`ROUNDING`), because their last digit depends on the processor. A number that matters is asserted
as a number by a test of its own. Line breaks count, spaces do not.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import unified_diff
from html.parser import HTMLParser
from itertools import zip_longest
from pathlib import Path

import gimbalcal

FOLDER = Path(__file__).parent
ROUNDING = 0.01  # relative difference of two numbers that are printed alike up to rounding
COUNTED = 100  # integers below it are counts or labels and must be equal
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?")
BLOCKS = re.compile(r"address|caption|d[dlt]|details|div|fig\w+|footer|form|h\d|header|li|main|nav|ol|p|pre|section|"
                    r"summary|t(?:able|body|head|r)|title|ul")  # fmt: skip
CELLS = frozenset(("td", "th"))
SILENT = frozenset(("style", "script", "svg"))


@dataclass(frozen=True)
class Golden:
    """Compare text with golden files, or write them where `regenerate` is set."""

    regenerate: bool

    def __call__(self, name: str, text: str) -> None:
        """Compare text with the golden file `name`; fail with a unified diff where they differ."""
        file = FOLDER / f"{name}.txt"
        lines = [re.sub(r"\s+", " ", line).strip() for line in text.strip().splitlines()]
        if self.regenerate:
            if not file.exists() or not same(file.read_text(encoding="utf-8").splitlines(), lines):
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text("\n".join(lines) + "\n", encoding="utf-8")
            return
        kept = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
        if not same(kept, lines):
            shown = "\n".join(unified_diff(kept, lines, f"tests/golden/{name}.txt", "now", lineterm="", n=1))
            raise AssertionError(f"{shown}\nIf the new text is intended: python -m pytest tests --regenerate-golden")


def same(kept: list[str], now: list[str]) -> bool:
    """Return whether two texts have equal words, and numbers that agree within rounding.

    >>> same(["bias x 1.24 ± 0.10 µg"], ["bias x 1.25 ± 0.10 µg"]), same(["15 of 18"], ["16 of 18"])
    (True, False)
    """
    return all(a is not None and b is not None and (a == b or _line(a, b)) for a, b in zip_longest(kept, now))


def _line(kept: str, now: str) -> bool:
    numbers = [NUMBER.findall(line) for line in (kept, now)]
    return NUMBER.sub("#", kept) == NUMBER.sub("#", now) and all(map(_number, *numbers))


def _number(kept: str, now: str) -> bool:
    a, b = float(kept), float(now)
    if kept.isdigit() and now.isdigit() and max(a, b) < COUNTED:
        return a == b
    last = max(10.0 ** -len(text.partition("e")[0].partition(".")[2]) for text in (kept, now))
    unit = 0.0 if "e" in kept + now or a == b == int(a) else last
    return abs(a - b) <= max(ROUNDING * max(a, b), unit * 1.001)


def page_text(page: str) -> str:
    """Return the text of a page, one line for each block or row; of a chart its title, axes and description."""
    reader = _Reader()
    reader.feed(page)
    text = "".join(reader.parts).replace(gimbalcal.__version__, "VERSION")
    lines = (re.sub(r"\s+", " ", line).strip(" |") for line in text.splitlines())
    return "\n".join(line for line in lines if line)


class _Reader(HTMLParser):
    """Collect the text of a page as it is read."""

    def __init__(self) -> None:
        super().__init__()
        self.parts: list[str] = []
        self.silent: list[str] = []
        self.title_of_chart = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        of = dict(attrs)
        if tag in SILENT:
            self.silent.append(tag)
            if of.get("data-words"):
                self.parts.append(f"\nchart axes: {of['data-words']}\n")
        self.title_of_chart = tag == "text" and of.get("class") == "title"
        if not self.silent:
            self.parts.append("\n" if BLOCKS.fullmatch(tag) else " | " if tag in CELLS else "")
            if of.get("aria-label"):
                self.parts.append(f"{of['aria-label']}\n")

    def handle_endtag(self, tag: str) -> None:
        if self.silent and self.silent[-1] == tag:
            self.silent.pop()
        self.title_of_chart = False
        if not self.silent and BLOCKS.fullmatch(tag):
            self.parts.append("\n")

    def handle_data(self, data: str) -> None:
        if self.title_of_chart:
            self.parts.append(f"\nchart: {data}\n")
        elif not self.silent:
            self.parts.append(data.replace("\n", " "))
