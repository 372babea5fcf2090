"""Can the tests fail? Falsifies every effect and every equation of the estimators, and names what no test notices.

    python -m tests.mutate                        everything: effects, then equations; a few minutes
    python -m tests.mutate effects                zero, sign, size, axes, powers, and one changed term in every equation
    python -m tests.mutate readings ...           one module, or several (--help lists them)
    python -m tests.mutate --terms 9 ...          not one changed term in every statement but up to nine

Exit status 1 where a mutant survives.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from gimbalcal.effects import CATALOGUE
from tests.mutation.effects import falsified, is_noticed, rewritten, survivors
from tests.mutation.equations import TESTS, verdicts
from tests.mutation.equivalent import EQUIVALENT

EFFECTS = "effects"


def main() -> int:
    """Prints the survivors; returns the exit status."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    every = [EFFECTS, *TESTS]
    reader.add_argument("parts", nargs="*", metavar="part", help="; ".join(every))
    reader.add_argument("--terms", type=int, default=1, help="changed terms in every statement, one at a time")
    given = reader.parse_args()
    if unknown := set(given.parts) - set(every):
        reader.error(f"{', '.join(sorted(unknown))}: the parts are {', '.join(every)}")
    parts = given.parts or every
    began, alive, count = time.perf_counter(), 0, 0
    for number, left in (_effects(parts, given.terms), _equations(parts, given.terms)):
        count, alive = count + number, alive + left
    print(f"{count} mutants, {alive} survivors, {time.perf_counter() - began:.0f} s")
    return int(alive > 0)


def _effects(parts: list[str], terms: int) -> tuple[int, int]:
    """How many mutants of effects there are, and how many survive."""
    count, alive = 0, 0
    if EFFECTS not in parts:
        return count, alive
    with np.errstate(all="ignore"):  # a mutant may divide by zero
        for words in survivors():
            print(f"survived: {words}")
            alive += 1
        count += sum(len(falsified(name)) for name in CATALOGUE)
        for mutant in rewritten(terms):
            count += 1
            if not is_noticed(mutant) and mutant.key not in EQUIVALENT:
                print(f"survived: {mutant}")
                alive += 1
    return count, alive


def _equations(parts: list[str], terms: int) -> tuple[int, int]:
    """How many mutants of estimators there are, and how many survive that are no other way to say the same."""
    count, alive = 0, 0
    for verdict in verdicts([p for p in parts if p in TESTS], terms):
        count += 1
        if not verdict.noticed and verdict.mutant.key not in EQUIVALENT:
            print(f"survived: {verdict.mutant}", flush=True)
            alive += 1
    return count, alive


if __name__ == "__main__":
    sys.exit(main())
