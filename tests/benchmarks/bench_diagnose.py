"""How often the diagnosis is right on a plant that shares no line with it, and how the usual rivals do.

    python -m tests.benchmarks.bench_diagnose [--quick] [--jobs 2] [ARM ...]

Arms: clean, timetable, alien, single, pair, strange, strange new, hidden, static (all; a word chooses those that
begin with it).
Every result is appended to out/bench_diagnose-<digest of the sources>.jsonl as it comes: stopped and started again it
goes on where it was, and results of other sources are never mixed in. About an hour on two cores, 5 min with --quick.
"""

from collections.abc import Iterator
from pathlib import Path

import gimbalcal
from tests.benchmarks.collecting import asked, collect, results_file, say
from tests.benchmarks.diagnose_runs import answer, runs, static_runs
from tests.benchmarks.diagnose_tables import report
from tests.benchmarks.rivals import rivals_table, speed


def sources() -> Iterator[Path]:
    """What the results depend on: the package, the plant, and how runs are made and judged."""
    package, here = Path(gimbalcal.__file__).parent, Path(__file__).parent
    yield from sorted(package.rglob("*.py"))
    yield from sorted((here.parent / "diagnose").glob("[lp]*.py"))
    yield from (here / name for name in ("diagnose_runs.py", "diagnose_static.py", "rivals.py"))


def main() -> None:
    wanted, jobs, whole = asked(__doc__, "a tenth of the runs, about 5 min", lambda q: [*runs(q), *static_runs(q)])
    rows = collect(wanted, results_file("bench_diagnose", sources()), jobs, answer)
    say(f"{len(rows)} recordings; 18 positions of 2 min unless it says otherwise; intervals are 95 % (Wilson)")
    report(rows, say)
    rivals_table(rows, say)
    if whole:
        speed(rows, say)


if __name__ == "__main__":
    main()
