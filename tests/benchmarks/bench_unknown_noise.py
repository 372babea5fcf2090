"""How often the diagnosis is right where nobody states the noise: on plants that share no line with it.

    python -m tests.benchmarks.bench_unknown_noise [--quick] [--jobs 2] [ARM ...]

Arms: clean, one, pair, strange, confounded (all). Units turned by hand and in chambers, mounts, tilting tables.
Every result is appended to out/bench_unknown_noise-<digest of the sources>.jsonl as it comes: stopped and started
again it goes on where it was. About 15 minutes on one core, 3 with --quick.
"""

from __future__ import annotations

import argparse
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

import gimbalcal
from tests.benchmarks.bench_diagnose import OUT, collect, say
from tests.benchmarks.unknown_runs import answer, runs
from tests.benchmarks.unknown_tables import report


def sources() -> Iterator[Path]:
    """What the results depend on: the package, the plants, and how runs are made and judged."""
    here = Path(__file__).parent
    yield from sorted(Path(gimbalcal.__file__).parent.rglob("*.py"))
    yield from (here / f"unknown_{name}.py" for name in ("hand", "mount", "table", "laws", "runs"))


def results_file() -> Path:
    """Where the rows of these very sources are kept."""
    digest = hashlib.sha256(b"".join(p.read_bytes() for p in sources())).hexdigest()[:12]
    return OUT / f"bench_unknown_noise-{digest}.jsonl"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arms", nargs="*", metavar="ARM")
    parser.add_argument("--quick", action="store_true", help="a fifth of the runs")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1))
    options = parser.parse_args()
    wanted = [r for r in runs(options.quick) if not options.arms or any(r.arm.startswith(a) for a in options.arms)]
    if not wanted:
        parser.error(f"no arm begins with {' or '.join(options.arms)}")
    rows = collect(wanted, results_file(), options.jobs, answer)
    say(f"{len(rows)} recordings of unknown noise; intervals are 95 % (Wilson)")
    report(rows, say)


if __name__ == "__main__":
    main()
