"""Many runs of a benchmark on several processes, kept as they come, so that it goes on where it was stopped."""

import argparse
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from time import perf_counter
from typing import Any

from tests.benchmarks.diagnose_tables import Row

OUT = Path("out")


def asked(about: str | None, quick: str, runs: Callable[[bool], Iterable[Any]]) -> tuple[list[Any], int, bool]:
    """The runs whose arm the command line names, on how many processes, and whether they are all arms.

    about: what `--help` says; quick: what `--quick` leaves of the runs.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arms", nargs="*", metavar="ARM")
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1))
    options = parser.parse_args()
    wanted = [run for run in runs(options.quick) if run.arm.startswith(tuple(options.arms) or "")]
    if not wanted:
        parser.error(f"no arm begins with {' or '.join(options.arms)}")
    return wanted, options.jobs, not options.arms


def results_file(name: str, sources: Iterable[Path]) -> Path:
    """Where the rows of these very sources are kept."""
    digest = hashlib.sha256(b"".join(p.read_bytes() for p in sources)).hexdigest()[:12]
    return OUT / f"{name}-{digest}.jsonl"


def kept(path: Path) -> dict[str, Row]:
    """Rows of an earlier start, by run."""
    if not path.exists():
        return {}
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    rows = [json.loads(line) for line in lines if line.endswith("\n")]  # the last may have been cut off
    return {r["key"]: r for r in rows}


def collect(
    wanted: Sequence[Any], path: Path, jobs: int, answer: Callable[[Any], Row], limit: float | None = None
) -> list[Row]:
    """Rows of the wanted runs, those that are not kept computed on `jobs` processes and appended as they come.

    limit: seconds after which no further run is started; those under way are finished and kept.
    """
    rows = kept(path)
    left = [run for run in wanted if run.key not in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    begin = perf_counter()
    with path.open("a", encoding="utf-8") as file, ProcessPoolExecutor(jobs) as pool:
        waiting = [pool.submit(answer, run) for run in left]
        try:
            for n, done in enumerate(as_completed(waiting), start=1):
                if done.cancelled():
                    continue
                if limit is not None and perf_counter() - begin > limit:
                    for run in waiting:
                        run.cancel()
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
