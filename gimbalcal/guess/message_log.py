"""Text whose rows are of several kinds, or have words between their numbers, as tables.

Flight controllers and telephones write messages, each with a word in front that says what follows ("IMU, 61234567, 0,
0.01, ..."); terminals write the time of arrival before a line, receivers a checksum behind it, and programs a name
before each number ("ax: 0.1, ay: 0.2", "Ax 0.1 Ay 0.2", "Ax0.1 Ay0.2"), as ROS does in lines of their own.
"""

from __future__ import annotations

import ast
import contextlib
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import by_name, quantity_of_log
from gimbalcal.importers.text_file import encoding_of
from gimbalcal.recording.dates import is_date
from gimbalcal.recording.record import FORCE, RATE

MIN_TRIAD_ROWS = 20  # rows of a kind of message that holds a triad
MIN_ROWS, MAX_KINDS = 3, 200
_STAMP = r"\[?((?:\d{4}-\d\d-\d\d[T ])?\d{1,2}:\d\d:\d\d(?:[.,]\d+)?)\]?"
_ARRIVED = re.compile(rf"^\s*{_STAMP}\s*->\s*")
_STAMPED = re.compile(rf"^\s*{_STAMP}")
_ELAPSED = re.compile(r"^\s*\[\s*(\d+(?:\.\d+)?)\s*(?:ns|us|ms|s)?\s*\]\s*")  # [1530815 ms] before a line
_COUNTED = re.compile(r"^\s*([-+]?\d+(?:\.\d+)?)[\s,;]+(?=[A-Za-z])")  # a clock without a name before others with one
_CHECKSUM = re.compile(r"\*[0-9A-Fa-f]{2,8}\s*$")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_VALUE = rf"{_NUMBER}|[-+]?(?i:nan|inf)"
_PAIR = re.compile(rf"""(?<![\w."])"?([A-Za-z]\w*(?:\[\d\])?)"?\s*[:=]\s*({_VALUE})(?![\w:])""")
_LABELLED = re.compile(  # a digit before a number without any separator belongs to the number
    rf"(?<![\w.])([A-Za-z]\w*)(?:\s*[:=]\s*|\s+(?=\S)|(?<!\d)(?=[-+.\d]))({_VALUE})(?![\w.:])"
)
_VECTOR = (  # accel=(9480, -5408, -12188), GYRO: X=0.1,Y=-0.2,Z=0.3
    re.compile(r"(?<!\w)([A-Za-z]\w*)\s*[:=]\s*[(\[]" + r"[\s,;]+".join([rf"\s*({_VALUE})"] * 3) + r"\s*[)\]]"),
    re.compile(
        r"(?<!\w)([A-Za-z]\w*)\s*:\s*" + r"[\s,;]+".join(rf"{a}\s*[=:]\s*({_VALUE})" for a in "XYZ"), re.IGNORECASE
    ),
)
_FIELD = re.compile(rf"(\s*)(\w+):\s*({_VALUE})?\s*$")  # of a message that a line of dashes ends
_KIND = re.compile(r"[$%]?[A-Za-z][\w-]*:?")
_COMMENT = ("#", "!", "//")


@dataclass(frozen=True)
class _Message:
    """The rows of one kind of message, without its keyword, and what its columns are called, or nothing."""

    names: tuple[str, ...]
    rows: list[list[str]]


def tables_in(path: Path, head: Sequence[str]) -> tuple[dict[str, list[str]], int]:
    """Return the lines of plain tables by the names of their messages, and how many lines with names before their
    numbers, or among such, are in none of them; no table where the file is a plain table.

    head: the first lines of the file. Raises InputError where messages hold no accelerometers.
    """
    documents = 2 * sum(bool(_FIELD.match(line)) for line in head) > len(head) and "---" in head
    head = _documents(head) if documents else head
    elapsed = 2 * sum(bool(_ELAPSED.match(line)) for line in head) > len(head)
    head = [_ELAPSED.sub(r"\1 ", line) for line in head] if elapsed else head
    lines_of_text = [line for line in head if line.strip() and not line.startswith(_COMMENT)]

    def usual(test: Callable[[str], object]) -> bool:
        return 2 * sum(bool(test(line)) for line in lines_of_text) > len(lines_of_text)

    arrived, summed, paired = usual(_ARRIVED.match), usual(_CHECKSUM.search), usual(_pairs)
    at = next((k for k in (0, 1) if usual(partial(_tag, at=k))), None)
    if not lines_of_text or not (arrived or elapsed or summed or paired or at is not None):
        return {}, 0
    lines = path.read_text(encoding=encoding_of(path), errors="replace").splitlines()
    lines = _documents(lines) if documents else lines
    if arrived:
        lines = _without_arrows(lines)
    if elapsed:
        lines = [_ELAPSED.sub(r"\1 ", line) for line in lines]
    if summed:
        lines = [_CHECKSUM.sub("", line) for line in lines]
    messages, skipped = _of_pairs(lines) if paired else (_of_words(lines, at) if at is not None else {}, 0)
    if messages:
        chosen = _chosen_kind(path, messages)
        skipped += sum(len(message.rows) for tag, message in messages.items() if paired and tag not in chosen)
        return {tag: _lines(message) for tag, message in chosen.items()}, skipped
    return ({"": lines} if arrived or elapsed or summed else {}), 0


def _documents(lines: Sequence[str]) -> list[str]:
    """Return a line of names and numbers for each message of ROS, whose fields stand indented below one another."""
    out: list[str] = []
    pairs: list[str] = []
    above: list[tuple[int, str]] = []  # indent and name of the fields that hold the next one
    for line in (*lines, "---"):
        if field := _FIELD.match(line):
            indent = len(field[1])
            above = [*(each for each in above if each[0] < indent), (indent, field[2])]
            pairs += [f"{'_'.join(name for _, name in above)}: {field[3]}"] if field[3] else []
        elif line.startswith("---"):
            out, pairs = [*out, ", ".join(pairs)] if pairs else out, []
    return out


def _split(line: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"[,;\t]", line)] if re.search(r"[,;\t]", line) else line.split()


def _tag(line: str, at: int) -> str:
    """Return the word of a row that stands in cell `at`, before three others."""
    cells = _split(line)
    word = len(cells) > at + 3 and _KIND.fullmatch(cells[at]) is not None
    return cells[at] if word and (at == 0 or re.fullmatch(_NUMBER, cells[0]) is not None) else ""


def _without_arrows(lines: Sequence[str]) -> list[str]:
    """Return times of arrival as the first cell of each line: "12:30:05.123 -> 1,2,3"."""
    marks = Counter(mark for line in lines for mark in ("\t", ";", ",") if _ARRIVED.match(line) and mark in line)
    mark = marks.most_common(1)[0][0] if marks else " "
    return [_ARRIVED.sub(lambda match: match[1] + mark, line) for line in lines]


def _pairs(line: str) -> list[tuple[str, str]]:
    """Return names with their numbers, where a line has three or more, or two or more and nothing else but a time of
    arrival; those of JSON by their path, and the three of a vector by its name and axis.
    """
    fewest = 3
    if line.lstrip().startswith("{"):
        pairs = _json_pairs(line)
    else:
        for vector in _VECTOR:
            line = vector.sub(r"\1_x=\2 \1_y=\3 \1_z=\4", line)
        text = _COUNTED.sub("", _STAMPED.sub("", line))
        if not _LABELLED.sub("", text).strip(" ,;|\t"):
            pairs, fewest = _LABELLED.findall(text), 2
        else:
            pairs = _PAIR.findall(line)
    return pairs if len(pairs) >= fewest and len({name for name, _ in pairs}) == len(pairs) else []


def _json_pairs(line: str) -> list[tuple[str, str]]:
    """Return the numbers and times in an object of JSON by their path; none where the line is no JSON."""
    return [
        (name, str(value))
        for name, value in leaves_of_object(object_in(line))
        if (isinstance(value, int | float) and not isinstance(value, bool)) or is_date(str(value))
    ]


def object_in(line: str) -> dict[str, Any]:
    """Return the object of JSON in a line, or the dictionary as Python prints one; empty where it holds none."""
    if not line.lstrip().startswith("{"):
        return {}
    for read in (json.loads, ast.literal_eval):
        with contextlib.suppress(ValueError, SyntaxError, RecursionError, MemoryError):
            content = read(line)
            return content if isinstance(content, dict) else {}
    return {}


def leaves_of_object(content: Any) -> Iterator[tuple[str, Any]]:
    """Yield what an object of JSON holds, however deep it is nested, by its path, acc_x or acc_0."""
    pending = [("", content)]
    while pending:
        name, value = pending.pop()
        if isinstance(value, dict | list | tuple):
            inner = list(value.items() if isinstance(value, dict) else enumerate(value))
            pending += [(f"{name}_{key}".strip("_"), each) for key, each in reversed(inner)]
        else:
            yield name, value


def _of_pairs(lines: Sequence[str]) -> tuple[dict[str, _Message], int]:
    """Return messages of names with numbers, and the number of lines among and below them that are none.

    Those with the same names are of one kind, which has no word where it is the only one. Kinds of a line or two count
    as other lines.
    """
    messages: dict[tuple[str, ...], _Message] = {}
    others = 0
    for line in lines:
        pairs = _pairs(line)
        if not pairs:
            others += bool(messages and line.strip())
            continue
        stamp = _STAMPED.match(line)
        names, cells = [name for name, _ in pairs], [number for _, number in pairs]
        if stamp:
            names, cells = ["time of arrival", *names], [stamp[1], *cells]
        elif number := _COUNTED.match(line):
            names, cells = ["", *names], [number[1], *cells]
        messages.setdefault(tuple(names), _Message(tuple(names), [])).rows.append(cells)
    kinds = [m for m in messages.values() if len(m.rows) >= MIN_ROWS] or list(messages.values())
    others += sum(len(m.rows) for m in messages.values()) - sum(len(m.rows) for m in kinds)
    if len(kinds) == 1:
        return {"": kinds[0]}, others
    return {f"message {k}": message for k, message in enumerate(kinds, start=1)}, others


def _of_words(lines: Sequence[str], at: int) -> dict[str, _Message]:
    """Return messages by the word in cell `at`; none where it only labels the rows of one table."""
    rows: dict[str, list[list[str]]] = {}
    headings: list[str] = []  # lines of words: what columns are called
    common: tuple[str, ...] = ()
    for line in lines:
        cells = _split(line)
        if line.startswith(_COMMENT) or not any(re.fullmatch(_NUMBER, c) for c in cells):
            headings.append(line)
            named = tuple(c for i, c in enumerate(cells) if i != at)
            if not common and not line.startswith(_COMMENT) and len(cells) > at + 3:
                common = named
        elif tag := _tag(line, at):
            rows.setdefault(tag, []).append([c for i, c in enumerate(cells) if i != at])
            if _is_word(cells[-1]) and _is_word(cells[-2]):  # FMT, 164, 47, IMU, QBff, TimeUS,I,GyrX, ...
                headings.append(line)
    if not 1 < len(rows) <= MAX_KINDS:
        return {}
    widths = {tag: Counter(map(len, own)).most_common(1)[0][0] for tag, own in rows.items()}
    own_names = {tag: _names(tag, headings, widths[tag]) for tag in rows}
    hints = {quantity_of_log(tag) for tag in rows}
    uneven = len({widths[tag] for tag, own in rows.items() if len(own) > MIN_ROWS}) > 1
    if not any(own_names.values()) and not uneven and not {FORCE, RATE} <= hints:
        return {}
    return {
        tag: _Message(
            own_names[tag] or (common if len(common) == widths[tag] else ()),
            [cells for cells in own if len(cells) == widths[tag]],
        )
        for tag, own in rows.items()
        if len(own) >= MIN_TRIAD_ROWS
    }


def _names(tag: str, headings: Sequence[str], columns: int) -> tuple[str, ...]:
    """Return the names of the columns of a kind: the last words of a line that names it before them."""
    for line in headings:
        words = [word for word in re.split(r"[,;\s]+", line.strip("#!/ \t")) if word]
        names = words[-columns:]
        if (
            tag in words[:-columns]
            and all(map(_is_word, names))
            and any(by_name(n, quantity_of_log(tag)) for n in names)
        ):
            return tuple(names)
    return ()


def _is_word(cell: str) -> bool:
    return re.search(r"[^\W\d_]", cell) is not None


def _chosen_kind(path: Path, messages: Mapping[str, _Message]) -> dict[str, _Message]:
    """Return the kind that holds both triads, or one for each; of several the one with the most rows."""
    holds = {
        tag: {g.quantity for n in message.names if (g := by_name(n, quantity_of_log(tag)))}
        for tag, message in messages.items()
    }

    def most(wanted: set[str]) -> list[str]:
        fitting = [tag for tag, quantities in holds.items() if wanted <= quantities]
        return sorted(fitting, key=lambda tag: -len(messages[tag].rows))[:1]

    tags = most({FORCE, RATE}) or [*most({FORCE}), *most({RATE})]
    if not tags and (len(messages) == 1 or not any(message.names for message in messages.values())):
        tags = sorted(messages, key=lambda tag: -len(messages[tag].rows))[:1]
    if not tags:
        listed = "; ".join(f"{tag}: {', '.join(message.names)}" for tag, message in list(messages.items())[:4])
        raise InputError(
            f"{path} holds messages of {len(messages)} kinds and none has accelerometers by the names of its columns "
            f"({listed}); log those too, or put the rows of one kind into a table with a line of names"
        )
    return {tag: messages[tag] for tag in tags}


def _lines(message: _Message) -> list[str]:
    return ["\t".join(cells) for cells in ([list(message.names)] if message.names else []) + message.rows]
