"""`python -m derivations [PAPER] [ITEM]`: print verdicts, compare the package with each, write `errata.json`.

PAPER is a name (wang2019, wu2018, cai2016, wei2022) or the number of its source, ITEM the beginning of an item, such as
"Eq. (41)" or "Table 4", which is then shown in full. `errata.json` is written where all papers are derived.

Exit status 1 where the package differs from a derivation: the items and the places are listed at the end. What a paper
printed wrong is a result and no failure.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from derivations import cai2016, comparison, errata, wang2019, wei2022, wu2018
from derivations.verdict import AGREES, Verdict

PAPERS = (wang2019, wu2018, cai2016, wei2022)
NAMES = {name: paper.SOURCE for name, paper in (
    ("wang2019", wang2019), ("wu2018", wu2018), ("cai2016", cai2016), ("wei2022", wei2022)
)}  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Run all derivations. Returns 0, 1 where the package differs from one, 2 where the file cannot be written."""
    parser = argparse.ArgumentParser(prog="python -m derivations", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder for errata.json, default here")
    parser.add_argument("paper", nargs="?", choices=[*NAMES, *NAMES.values()], metavar="PAPER", help=", ".join(NAMES))
    parser.add_argument("item", nargs="?", metavar="ITEM", help='beginning of an item, such as "Eq. (41)"')
    parser.add_argument("--faults", action="store_true", help="print only what does not agree")
    options = parser.parse_args(arguments)
    comparison.forget()
    if options.paper is not None:
        return _of_paper(NAMES.get(options.paper, options.paper), options.item, options.faults)
    try:
        verdicts = [v for paper in PAPERS for v in paper.verdicts()]
        path = errata.write(verdicts, options.out)
    except KeyboardInterrupt:
        return 130
    except OSError as problem:
        print(f"cannot write errata.json into {options.out}: {problem.strerror}; give --out a folder", file=sys.stderr)
        return 2
    print(errata.table(_faults(verdicts) if options.faults else verdicts))
    print(f"\n{errata.summary(verdicts)}\nWritten to {path}.")
    return 1 if errata.differing(verdicts) else 0


def _faults(verdicts: list[Verdict]) -> list[Verdict]:
    return [v for v in verdicts if v.verdict != AGREES]


def _of_paper(source: str, item: str | None, faults: bool) -> int:
    """Print the verdicts of one paper, or the items that begin with `item` in full. Returns 2 where there are none."""
    paper = next(p for p in PAPERS if p.SOURCE == source)
    verdicts = [v for v in paper.verdicts() if item is None or v.item.startswith(item)]
    if not verdicts:
        print(f"no item of {errata.PAPERS[source]} begins with {item!r}; without it all are listed", file=sys.stderr)
        return 2
    if item is None:
        print(errata.table(_faults(verdicts) if faults else verdicts))
        print(f"\n{errata.summary(verdicts)}")
    else:
        print("\n\n".join(map(errata.page, verdicts)))
    return 1 if errata.differing(verdicts) else 0


if __name__ == "__main__":
    os.environ.setdefault("NUMBA_DISABLE_JIT", "1")  # a few steps of each loop: to compile them would take longer
    sys.exit(main())
