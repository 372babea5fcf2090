"""How often the diagnosis is right where nobody states the noise: on plants that share no line with it.

    python -m tests.benchmarks.bench_unknown_noise [--quick] [--jobs 2] [ARM ...]

Arms: clean, one, pair, strange, confounded (all). Units turned by hand and in chambers, mounts, tilting tables.
Every result is appended to out/bench_unknown_noise-<digest of the sources>.jsonl as it comes: stopped and started
again it goes on where it was. About 15 minutes on one core, 3 with --quick.
"""

from collections.abc import Iterator
from pathlib import Path

import gimbalcal
from tests.benchmarks.collecting import asked, collect, results_file, say
from tests.benchmarks.unknown_runs import answer, runs
from tests.benchmarks.unknown_tables import report


def sources() -> Iterator[Path]:
    """What the results depend on: the package, the plants, and how runs are made and judged."""
    here = Path(__file__).parent
    yield from sorted(Path(gimbalcal.__file__).parent.rglob("*.py"))
    yield from (here / f"unknown_{name}.py" for name in ("hand", "mount", "table", "laws", "runs"))


def main() -> None:
    wanted, jobs, _ = asked(__doc__, "a fifth of the runs", runs)
    rows = collect(wanted, results_file("bench_unknown_noise", sources()), jobs, answer)
    say(f"{len(rows)} recordings of unknown noise; intervals are 95 % (Wilson)")
    report(rows, say)


if __name__ == "__main__":
    main()
