"""Compare pages, console output and messages with the golden files of this folder.

Each golden file holds the text of one page or of one kind of output, so that rewording a sentence changes one file.
After a change of wording, regenerate all of them, read the difference and commit it:

    python -m pytest tests --regenerate-golden && git diff tests/golden

A test compares a page with the fixture `golden`: `golden("pages/noise", page_text(html))`. Words must be equal; numbers
must agree within rounding (`ROUNDING`), because their last digit depends on the processor. A number that matters is
asserted as a number by a test of its own. Line breaks count, spaces do not.

What a test reads in a sentence (a refusal, a remark, an outcome) is compared with the section of this test in
`messages/FOLDER.txt`: `with refused(): read(folder)` and `golden_text(recording.remarks[-1])`. There whole
numbers must be equal: they are rows, lines and counts.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from difflib import unified_diff
from html.parser import HTMLParser
from itertools import zip_longest
from pathlib import Path

import pytest

import gimbalcal
from gimbalcal.errors import InputError

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[1]
ROUNDING = 0.01  # relative difference of two numbers that are printed alike up to rounding
COUNTED = 100  # integers below it are counts or labels and must be equal
WAITING = re.compile(r"\d+ s so far$")  # what long work says, on a slow machine more often
LONG = 5  # digits of a whole number that is computed, such as a large chi^2, and counts no rows of a test
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


@dataclass
class Messages:
    """The sections of the golden files of messages, and the lines that the test that runs has read so far."""

    regenerate: bool
    files: dict[Path, dict[str, list[str]]] = field(default_factory=dict)
    seen: set[str] = field(default_factory=set)
    earlier: dict[str, list[str]] = field(default_factory=dict)

    @contextmanager
    def of_test(self, item: pytest.Item) -> Iterator[None]:
        """Compare what `item` reads with its section; at its end, no line of the section may be left."""
        folder, stem = item.path.parent.relative_to(ROOT / "tests"), item.path.stem
        self.file = FOLDER / "messages" / (f"{folder}.txt" if folder.name else "tests.txt")
        self.section = f"== {stem} {item.name}".encode("unicode_escape").decode()
        self.temporary = rf"{re.escape(str(item.config._tmp_path_factory.getbasetemp()))}/[^/\s'\"]*"  # type: ignore[attr-defined]
        self.lines: list[str] = []
        MESSAGES.append(self)
        try:
            yield
        finally:
            MESSAGES.pop()
        if self.regenerate:
            whole = not (item.config.option.keyword or any("[" in argument for argument in item.config.args))
            self.write(f"== {stem} {getattr(item, 'originalname', item.name)}", whole)
        else:
            kept = self.sections().get(self.section, [])
            assert len(self.lines) == len(kept), f"fewer lines than {self.section} of {self.file}"

    def write(self, test: str, whole: bool) -> None:
        """Write the section of the test that ran; where all cases of a test are run, cases that are no more go."""
        sections = self.sections()
        if whole and test not in self.seen:
            self.seen.add(test)
            for key in [key for key in sections if key.partition("[")[0] == test]:
                self.earlier[key] = sections.pop(key)
        before = self.earlier.pop(self.section, sections.get(self.section, []))
        sections[self.section] = before if alike(before, self.lines) else self.lines
        text = "\n".join(line for key in sorted(sections) if sections[key] for line in (key, *sections[key], ""))
        if text or self.file.exists():
            self.file.parent.mkdir(parents=True, exist_ok=True)
            self.file.write_text(text, encoding="utf-8")

    def sections(self) -> dict[str, list[str]]:
        """Return the lines of each section of the golden file of the test that runs."""
        if self.file not in self.files:
            text = self.file.read_text(encoding="utf-8") if self.file.exists() else ""
            parts = [part.splitlines() for part in text.split("\n\n") if part]
            self.files[self.file] = {lines[0]: [line for line in lines[1:] if line] for lines in parts}
        return self.files[self.file]

    def __call__(self, text: str) -> None:
        """Compare a text with the next lines of the section."""
        text = re.sub(self.temporary, "TMP", text).replace(f"{ROOT}/", "").replace(gimbalcal.__version__, "VERSION")
        lines = [" ".join(line.split()) for line in text.splitlines() if line.strip() and not WAITING.search(line)]
        kept = self.sections().get(self.section, [])[len(self.lines) : len(self.lines) + len(lines)]
        if not self.regenerate and not alike(kept, lines):
            shown = "\n".join(unified_diff(kept, lines, f"{self.file}, {self.section}", "now", lineterm="", n=1))
            raise AssertionError(f"{shown}\nIf the new text is intended: python -m pytest tests --regenerate-golden")
        self.lines += lines


MESSAGES: list[Messages] = []
"""The messages of the test that runs; a test may run tests."""


def golden_text(*texts: object) -> None:
    """Compare sentences with the section of the running test in the golden file of its folder."""
    for text in texts:
        MESSAGES[-1](str(text))


@contextmanager
def refused(error: type[Exception] = InputError, choice: str = "") -> Iterator[None]:
    """Expect an error whose message is one line, and compare it with the section of the running test.

    choice: one effect of the list that it ends with, which is then not compared: every new effect makes it longer.
    """
    with pytest.raises(error) as caught:
        yield
    assert "\n" not in str(caught.value)
    golden_text(without_choices(str(caught.value), choice) if choice else caught.value)


def without_choices(text: str, choice: str) -> str:
    """Return a sentence without the list of effects that it ends with, of which `choice` is one."""
    sentence, _, choices = text.partition(" choose from ")
    assert choice in choices.split(", ")
    return sentence


def alike(kept: list[str], now: list[str]) -> bool:
    """Return whether two texts have equal words and whole numbers, and decimals that agree within rounding.

    >>> alike(["row 2001 is off by 1.24 ug"], ["row 2001 is off by 1.25 ug"]), alike(["row 2001"], ["row 2002"])
    (True, False)
    """
    return len(kept) == len(now) and all(
        NUMBER.sub("#", a) == NUMBER.sub("#", b) and all(map(_decimal, NUMBER.findall(a), NUMBER.findall(b)))
        for a, b in zip(kept, now, strict=True)
    )


def _decimal(kept: str, now: str) -> bool:
    computed = ("." in kept and "." in now) or min(len(kept), len(now)) >= LONG
    return kept == now or (computed and _number(kept, now))


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
