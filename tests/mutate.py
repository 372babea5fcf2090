"""Can the tests fail? Falsifies effects, equations of the estimators, and what mistakes are feared elsewhere.

    python -m tests.mutate                        everything; half an hour of one core
    python -m tests.mutate effects                zero, sign, size, axes, powers, and one changed term in every equation
    python -m tests.mutate readings ...           one module of the estimators, or several (--help lists them)
    python -m tests.mutate history ...            the mistakes of `tests/mutation/chosen.py` in a room, or in several
    python -m tests.mutate derivations            errors that the derivations ought to notice
    python -m tests.mutate --terms 9 ...          not one changed term in every statement but up to nine
    python -m tests.mutate --at-once 1 ...        one process of tests at a time, not as many as there are cores

Exit status 1 where a mutant survives, or a mistake of that list has no place in the code any more.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence

import numpy as np

from gimbalcal.effects import CATALOGUE
from tests.mutation.chosen import ROOMS, chosen
from tests.mutation.effects import falsified, is_noticed, rewritten, survivors
from tests.mutation.equations import TESTS, changed_terms
from tests.mutation.equivalent import EQUIVALENT
from tests.mutation.rewrite import Mutant
from tests.mutation.running import Tests, verdicts

EFFECTS, DERIVATIONS = "effects", "derivations"


def main() -> int:
    """Prints the survivors; returns the exit status."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    every = [EFFECTS, DERIVATIONS, *TESTS, *ROOMS]
    reader.add_argument("parts", nargs="*", metavar="part", help="; ".join(every))
    reader.add_argument("--terms", type=int, default=1, help="changed terms in every statement, one at a time")
    reader.add_argument("--at-once", type=int, default=os.cpu_count() or 1, help="processes of tests at a time")
    given = reader.parse_args()
    if unknown := set(given.parts) - set(every):
        reader.error(f"{', '.join(sorted(unknown))}: the parts are {', '.join(every)}")
    parts = given.parts or every
    began = time.perf_counter()
    wanted = [one for part in parts if part in TESTS for one in changed_terms(part, given.terms)]
    outdated: list[str] = []
    wanted += [one for part in parts if part in ROOMS for one in chosen(part, outdated)]
    for words in outdated:
        print(f"outdated in tests/mutation/chosen.py: {words}")
    count, alive = _effects(given.terms) if EFFECTS in parts else (0, 0)
    count, alive = count + len(wanted), alive + len(outdated) + _left(wanted, given.at_once)
    if DERIVATIONS in parts:  # a process of its own, in which no loop is compiled
        program = [sys.executable, "-m", "tests.mutation.of_derivations"]
        alive += subprocess.run(program, env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, check=False).returncode != 0
    print(f"{count} mutants, {alive} survivors, {time.perf_counter() - began:.0f} s")
    return int(alive > 0)


def _effects(terms: int) -> tuple[int, int]:
    """How many mutants of effects there are, and how many survive."""
    count, alive = 0, 0
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


def _left(wanted: Sequence[tuple[Mutant, Tests]], at_once: int) -> int:
    """How many mutants survive their tests and are no other way to say the same."""
    alive = 0
    for verdict in verdicts(wanted, at_once):
        if not verdict.noticed and verdict.mutant.key not in EQUIVALENT:
            print(f"survived: {verdict.mutant}", flush=True)
            alive += 1
    return alive


if __name__ == "__main__":
    sys.exit(main())
