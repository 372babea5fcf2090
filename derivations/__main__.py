"""`python -m derivations [--out DIR]`: print every verdict, compare the package with each, write `errata.json`.

Exit status 1 where the package differs from a derivation: the items and the places are listed at the end. What a paper
printed wrong is a result and no failure.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from derivations import cai2016, comparison, errata, wang2019, wei2022, wu2018

PAPERS = (wang2019, wu2018, cai2016, wei2022)


def main(arguments: list[str] | None = None) -> int:
    """Run all derivations. Returns 0, 1 where the package differs from one, 2 where the file cannot be written."""
    parser = argparse.ArgumentParser(prog="python -m derivations", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder for errata.json, default here")
    parser.add_argument("--faults", action="store_true", help="print only what does not agree")
    options = parser.parse_args(arguments)
    comparison.forget()
    try:
        verdicts = [v for paper in PAPERS for v in paper.verdicts()]
        path = errata.write(verdicts, options.out)
    except KeyboardInterrupt:
        return 130
    except OSError as problem:
        print(f"cannot write errata.json into {options.out}: {problem.strerror}; give --out a folder", file=sys.stderr)
        return 2
    shown = [v for v in verdicts if not options.faults or v.verdict != "agrees"]
    print(errata.table(shown))
    print(f"\n{errata.summary(verdicts)}\nWritten to {path}.")
    return 1 if errata.differing(verdicts) else 0


if __name__ == "__main__":
    os.environ.setdefault("NUMBA_DISABLE_JIT", "1")  # a few steps of each loop: to compile them would take longer
    sys.exit(main())
