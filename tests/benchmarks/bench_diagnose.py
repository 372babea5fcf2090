"""How often the diagnosis is right on a plant that shares no line with it, and how the usual rivals do.

    python -m tests.benchmarks.bench_diagnose [--quick] [--jobs 2] [ARM ...]

Arms: clean, timetable, alien, single, pair, strange, strange new, hidden, static (all; a word chooses those that
begin with it).
Every result is appended to out/bench_diagnose-<digest of the sources>.jsonl as it comes: stopped and started again it
goes on where it was, and results of other sources are never mixed in. About an hour on two cores, 5 min with --quick.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from time import perf_counter
from typing import Any

import gimbalcal
from tests.benchmarks.diagnose_runs import answer, runs, static_runs
from tests.benchmarks.diagnose_tables import Row, report
from tests.benchmarks.rivals import rivals_table, speed

OUT = Path("out")


def sources() -> Iterator[Path]:
    """What the results depend on: the package, the plant, and how runs are made and judged."""
    package, here = Path(gimbalcal.__file__).parent, Path(__file__).parent
    yield from sorted(package.rglob("*.py"))
    yield from sorted((here.parent / "diagnose").glob("[lp]*.py"))
    yield from (here / name for name in ("diagnose_runs.py", "diagnose_static.py", "rivals.py"))


def results_file() -> Path:
    """Where the rows of these very sources are kept."""
    digest = hashlib.sha256(b"".join(p.read_bytes() for p in sources())).hexdigest()[:12]
    return OUT / f"bench_diagnose-{digest}.jsonl"


def kept(path: Path) -> dict[str, Row]:
    """Rows of an earlier start, by run."""
    if not path.exists():
        return {}
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    rows = [json.loads(line) for line in lines if line.endswith("\n")]  # the last may have been cut off
    return {r["key"]: r for r in rows}


def collect(wanted: Sequence[Any], path: Path, jobs: int, answer: Callable[[Any], Row] = answer) -> list[Row]:
    """Rows of the wanted runs, those that are not kept computed on `jobs` processes and appended as they come."""
    rows = kept(path)
    left = [run for run in wanted if run.key not in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    begin = perf_counter()
    with path.open("a", encoding="utf-8") as file, ProcessPoolExecutor(jobs) as pool:
        waiting = [pool.submit(answer, run) for run in left]
        try:
            for n, done in enumerate(as_completed(waiting), start=1):
                row = json.loads(json.dumps(done.result()))
                rows[row["key"]] = row
                file.write(json.dumps(row) + "\n")
                file.flush()
                if n % 20 == 0 or n == len(left):
                    sys.stderr.write(f"\r{n} of {len(left)} runs, {perf_counter() - begin:.0f} s ")
        except BaseException as problem:
            pool.shutdown(cancel_futures=True)  # waits for the runs under way, else `with` takes the cancelling back
            sys.stderr.write(f"\nstopped; {path} keeps what was done\n")
            if not isinstance(problem, KeyboardInterrupt):
                raise
    return [rows[run.key] for run in wanted if run.key in rows]


def say(line: str) -> None:
    """One line of the report."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arms", nargs="*", metavar="ARM")
    parser.add_argument("--quick", action="store_true", help="a tenth of the runs, about 5 min")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1))
    options = parser.parse_args()
    wanted = [
        run
        for run in [*runs(options.quick), *static_runs(options.quick)]
        if not options.arms or any(run.arm.startswith(a) for a in options.arms)
    ]
    if not wanted:
        parser.error(f"no arm begins with {' or '.join(options.arms)}")
    rows = collect(wanted, results_file(), options.jobs)
    say(f"{len(rows)} recordings; 18 positions of 2 min unless it says otherwise; intervals are 95 % (Wilson)")
    report(rows, say)
    rivals_table(rows, say)
    if not options.arms:
        speed(rows, say)


if __name__ == "__main__":
    main()
