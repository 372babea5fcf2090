"""Write docs/errata.md: what of the four papers is not right as printed, from the verdicts of the derivations.

python -m derivations --out docs/_build
python docs/build_errata.py docs/_build/errata.json
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from gimbalcal.references import REFERENCES

PAGE = Path(__file__).parent / "errata.md"
PAPERS = {"001": "wu2018", "000": "wang2019", "002": "cai2016", "003": "wei2022"}
SHORT = 160  # characters of a derived expression that are still read on a page
HEAD = """# Errata of the papers

Every numbered equation and every table entry of the four papers that this package follows is derived again and
judged: {count} items, {counts}. This page is written by `make docs` from the verdicts; `python -m derivations`
derives and prints them all, compares the package with each and writes `errata.json`, which holds the long expressions
too. Where a paper is wrong, the package does the right thing.

*Agrees*: as printed, definitions included. *Approximation*: right to the order that is stated. *Misprint*: a slip of
the pen, the paper itself goes on with the right one. *Wrong*: what is printed does not follow. *Not determined*: the
equations leave it open, the recordings it needs are not printed, or the scan cannot be read there.
"""
Entry = dict[str, str]


def page(entries: Sequence[Entry]) -> str:
    """The page as text."""
    head = HEAD.format(count=len(entries), counts=counted(entries))
    return "\n\n".join([head.strip(), *(section(source, entries) for source in PAPERS)]) + "\n"


def counted(entries: Sequence[Entry]) -> str:
    """How many of each verdict, in words."""
    return ", ".join(f"{n} {verdict}" for verdict, n in sorted(Counter(e["verdict"] for e in entries).items()))


def section(source: str, entries: Sequence[Entry]) -> str:
    """One paper: what is wrong or a misprint in full, approximations and what is open as tables."""
    mine = [e for e in entries if e["source"] == source]
    name = REFERENCES[PAPERS[source]]
    parts = [f"## {name.split(',')[0]} {PAPERS[source][-4:]}", f"{name}. Of {len(mine)} items: {counted(mine)}."]
    parts += [fault(e) for e in mine if e["verdict"] in ("wrong", "misprint")]
    near = [e for e in mine if e["verdict"] == "approximation"]
    if near:
        rows = [f"| {cell(e['item'])} | {cell(e['size'])} | {cell(e['why'])} |" for e in near]
        parts.append("\n".join(["**Approximations**", "", "| item | size | why |", "|---|---|---|", *rows]))
    reasons: dict[str, list[str]] = {}
    for e in mine:
        if e["verdict"] == "not-determined":
            reasons.setdefault(e["why"].split(". ")[0].rstrip("."), []).append(e["item"])
    if reasons:
        lines = [f"* {text(why)}: {text(named(items))}." for why, items in reasons.items()]
        parts.append("\n".join(["**Not determined**", "", *lines]))
    return "\n\n".join(parts)


def fault(e: Entry) -> str:
    """An item that is not right: what is printed, what follows, by how much, and why."""
    derived = e["derived"]
    lines = [
        f"**{text(e['item'])}**: {e['verdict']}. {text(e['why'])}",
        "",
        f"* printed: `{e['printed'].replace('`', chr(39))}`",
    ]
    if len(derived) <= SHORT and "\n" not in derived:
        lines.append(f"* derived: `{derived}`")
    if e["size"] != "not quantified":
        lines.append(f"* size: {text(e['size'])}")
    return "\n".join(lines)


def named(items: Sequence[str]) -> str:
    """Items by name; of a table with many of them only how many."""
    tables = Counter(item.partition(",")[0] for item in items)
    told = [f"{head} ({n} entries)" if n > 3 else head for head, n in tables.items()]
    return "; ".join(told)


def text(words: str) -> str:
    """Plain words, none of which Markdown takes for a mark."""
    for mark in "\\_*[]<>$|":
        words = words.replace(mark, f"\\{mark}")
    return " ".join(words.split())


def cell(words: str) -> str:
    """A cell of a table."""
    return text(words)


if __name__ == "__main__":
    found = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    PAGE.write_text(page(found), encoding="utf-8")
    sys.stdout.write(f"wrote {PAGE.name}: {len(found)} items\n")
