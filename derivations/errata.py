"""The verdicts as a table to read and as `errata.json`."""

from __future__ import annotations

import json
import shutil
import textwrap
from collections import Counter
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

from derivations.verdict import AGREES, APPROXIMATION, NOT_DETERMINED, VERDICTS, Verdict
from gimbalcal import atomic

ITEM, VERDICT, SIZE = 26, 15, 22  # column widths
MANY = 6  # entries of a table that are still named one by one
PAPERS = {
    "000": "Wang 2019",
    "001": "Wu 2018",
    "002": "Cai 2016",
    "003": "Wei 2022",
}  # `source` of errata.json, as a reader knows it


def table(verdicts: Sequence[Verdict], width: int | None = None) -> str:
    """Return the item, verdict, size and why, the why wrapped into the last column; a line opens each paper."""
    width = width or max(100, min(shutil.get_terminal_size((140, 24)).columns, 180))
    indent = ITEM + VERDICT + SIZE
    lines = [f"{'item':{ITEM}}{'verdict':{VERDICT}}{'size':{SIZE}}why", "-" * width]
    for i, v in enumerate(verdicts):
        if not i or v.source != verdicts[i - 1].source:
            lines.append(f"{PAPERS.get(v.source, v.source)} (source {v.source} in errata.json)")
        text = v.why if v.verdict != AGREES else v.why.split(". ")[0].rstrip(".") + "."  # a few words suffice
        if v.assumes:
            text += f" Assumes {v.assumes}."
        why = textwrap.wrap(text, width - indent) or [""]
        lines.append(f"{_column(v.item, ITEM)}{v.verdict:{VERDICT}}{_column(v.size, SIZE)}{why[0]}")
        lines += [" " * indent + part for part in why[1:]]
    return "\n".join(lines)


def _column(words: str, width: int) -> str:
    """Return words with a space after them, however long they are."""
    return f"{words:{width - 1}} "


def page(v: Verdict) -> str:
    """Return one item in full: print, derivation, verdict and why, what it assumes, and the package."""
    package = "not compared" if v.package is None else str(v.package).removeprefix("Package: ")
    rows = (("printed", v.printed), ("derived", v.derived), ("verdict", f"{v.verdict}, size {v.size}"),
            ("why", v.why.split(" Package: ")[0]), ("assumes", v.assumes or "nothing beyond the paper"),
            ("package", package))  # fmt: skip
    wrapped = (
        textwrap.fill(words, 100, initial_indent=f"  {name:9}", subsequent_indent=" " * 11) for name, words in rows
    )
    return "\n".join([f"{PAPERS.get(v.source, v.source)}, {v.item}", *wrapped])


def summary(verdicts: Sequence[Verdict]) -> str:
    """Return counts, the items of each paper that are not right as printed, and those that nothing printed
    determines.
    """
    counts = Counter(v.verdict for v in verdicts)
    total = ", ".join(f"{counts[name]} {name}" for name in VERDICTS if counts[name])
    lines = [f"{len(verdicts)} items: {total}."]
    for source in dict.fromkeys(v.source for v in verdicts):
        mine = [v for v in verdicts if v.source == source]
        faulty = [v.item for v in mine if v.verdict not in (AGREES, APPROXIMATION, NOT_DETERMINED)]
        lines.append(f"Not right as printed in {PAPERS.get(source, source)}: {'; '.join(faulty) or 'none'}.")
        if open_ := [v.item for v in mine if v.verdict == NOT_DETERMINED]:
            lines.append(f"Not determined in {PAPERS.get(source, source)}: {'; '.join(_together(open_))}.")
    return "\n".join([*lines, *_of_the_package(verdicts)])


def _together(items: Sequence[str]) -> list[str]:
    """Return items by name; of a table with many of them only how many."""
    counts = Counter(item.partition(",")[0] for item in items)
    named = (f"{head} ({counts[head]} entries)" if counts[head] > MANY else item
             for item in items for head in (item.partition(",")[0],))  # fmt: skip
    return list(dict.fromkeys(named))


def differing(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return the items whose derivation the package does not follow."""
    return [v for v in verdicts if v.package is not None and not v.package.same]


def _of_the_package(verdicts: Sequence[Verdict]) -> list[str]:
    compared = [v for v in verdicts if v.package is not None]
    if not compared:
        return []
    different = differing(verdicts)
    if not different:
        return [f"The package follows the derivation in all {len(compared)} items that it computes."]
    lines = [f"THE PACKAGE DIFFERS from the derivation in {len(different)} of {len(compared)} items that it computes:"]
    return lines + [f"  {PAPERS.get(v.source, v.source)}, {v.item}: {v.package}" for v in different]


def write(verdicts: Sequence[Verdict], folder: Path) -> Path:
    """Write `errata.json` into the folder, complete or not at all."""
    path = folder / "errata.json"
    atomic.write(path, json.dumps([entry(v) for v in verdicts], indent=1, ensure_ascii=False) + "\n")
    return path


def entry(v: Verdict) -> dict[str, str]:
    """Return the fields of an item of `errata.json`."""
    package = "not compared" if v.package is None else "same" if v.package.same else "differs"
    return {f.name: getattr(v, f.name) for f in fields(v) if f.name != "formulas"} | {"package": package}
