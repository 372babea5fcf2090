"""Insert the measured results of docs/measured into the pages that show them.

    python docs/build_measured.py

`make bench` writes what each benchmark prints to docs/measured/NAME.txt, docs/build_navigation.py a table to
docs/measured/quasi_static.md, and docs/build_hidden.py docs/measured/hidden_causes.txt;
docs/measured/unseen_recordings.md is written by hand. A page shows a result between the lines
`<!-- measured: NAME -->` and `<!-- end of NAME -->`; no page contains a measured figure that is not in these files.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

DOCS = Path(__file__).parent
MEASURED = DOCS / "measured"
MAX_LINES = 60  # of a text that is shown whole; of a longer one the lines before the first empty one are shown
BLOCK = re.compile(r"<!-- measured: (\w+) -->\n.*?<!-- end of \1 -->", re.DOTALL)


def filled(page: str) -> str:
    """Return a page with the result of every block as it is in docs/measured."""
    return BLOCK.sub(lambda b: f"<!-- measured: {b[1]} -->\n{result(b[1])}\n<!-- end of {b[1]} -->", page)


def result(name: str) -> str:
    """Return the result of one benchmark in Markdown, of a long one its summary; without a file, the command."""
    table, text = MEASURED / f"{name}.md", MEASURED / f"{name}.txt"
    if table.exists():
        return table.read_text(encoding="utf-8").strip()
    if text.exists():
        whole = text.read_text(encoding="utf-8").rstrip()
        shown, _, rest = whole.partition("\n\n") if whole.count("\n") >= MAX_LINES else (whole, "", "")
        more = f"\n\nEach result: [{text.name}](measured/{text.name})." if rest else ""
        return f"```text\n{shown}\n```{more}"
    return f"Not measured in this version: `python -m tests.benchmarks.{name}`."


def pages() -> list[Path]:
    """Return the pages with such blocks."""
    return [p for p in sorted(DOCS.glob("*.md")) if BLOCK.search(p.read_text(encoding="utf-8"))]


if __name__ == "__main__":
    for path in pages():
        path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
        sys.stdout.write(f"wrote {path.name}\n")
