"""Spoils inputs of every kind and counts what gimbalcal does wrong with them.

    python -m tests.fuzz                            10 000 inputs, all targets
    python -m tests.fuzz --n 100000 --seed 7        more, other ones
    python -m tests.fuzz --target tpoint,csv        only these (--help lists them)
    python -m tests.fuzz --target csv --seed 7 --only 123 --keep DIR    one input again, its files kept in DIR

Wrong is exit status 3, a traceback, a panic of an engine, a process that dies or hangs, a NaN in a result, a refusal
that is not one sentence, or one that leaves something written. Exit status 1 where anything was wrong.
"""

import argparse
import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzzing import seeds
from tests.fuzzing.targets import TARGETS
from tests.fuzzing.worker import PROGRESS

HANG = 60.0  # s of processor time: on a busy machine a sound answer waits longer
AT_WORK = "at work"  # after so long, of which so much is done as it tells: no hang
STILL = 600.0  # s of waiting
RENEWED = 2000  # inputs of one worker


class Worker:
    """A process that runs inputs; it is replaced when it dies or hangs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        environment = {**os.environ, "MPLBACKEND": "Agg", "OPENBLAS_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.fuzzing.worker", str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True, env=environment,
        )  # fmt: skip

    def ask(self, name: str, seed: int, number: int, keep: Path | None = None) -> dict[str, Any]:
        """What came of one input; its files are kept in `keep`."""
        assert self.process.stdin
        assert self.process.stdout
        kept = None if keep is None else str(keep.absolute())
        self.process.stdin.write(json.dumps({"name": name, "seed": seed, "number": number, "keep": kept}) + "\n")
        self.process.stdin.flush()
        began, spent = time.monotonic(), self.spent()
        with selectors.DefaultSelector() as waiting:
            waiting.register(self.process.stdout, selectors.EVENT_READ)
            while not waiting.select(2.0):
                worked, waited = self.spent() - spent, time.monotonic() - began
                if worked > HANG or waited > STILL:
                    self.end()
                    if (self.folder / PROGRESS).is_file():
                        return {"status": AT_WORK, "wrong": "", "last": (self.folder / PROGRESS).read_text()}
                    last = f"no answer within {worked:.0f} s of processor time, {waited:.0f} s in all"
                    return {"status": None, "wrong": "hang", "last": last, "where": ""}
        line = self.process.stdout.readline()
        if not line:
            code = self.process.wait()
            return {"status": code, "wrong": "killed", "last": f"the process ended with {code}", "where": ""}
        answer: dict[str, Any] = json.loads(line)
        return answer

    def spent(self) -> float:
        """Processor time [s] of the process and of those it waited for; the clock where no /proc tells it."""
        try:
            fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return time.monotonic()
        return sum(int(ticks) for ticks in fields[11:15]) / os.sysconf("SC_CLK_TCK")

    def end(self) -> None:
        """Stop the process."""
        self.process.kill()
        self.process.wait()


def fuzz(n: int, seed: int, names: list[str], tell: Any = print) -> tuple[dict[str, Counter[str]], list[Any]]:
    """Run n inputs of the targets called `names`; returns how often each outcome came of each target, and the finds.

    Ctrl-C or a kill ends it with what came until then.
    """
    share = np.array([TARGETS[name].weight for name in names])
    drawn = np.random.default_rng(seed).choice(len(names), size=n, p=share / share.sum())
    counts: dict[str, Counter[str]] = {name: Counter() for name in names}
    finds: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="fuzz-seeds-") as folder:
        seeds.make(Path(folder))
        worker, asked = Worker(Path(folder)), 0
        for ended in (signal.SIGINT, signal.SIGTERM):
            signal.signal(ended, signal.default_int_handler)
        with contextlib.suppress(KeyboardInterrupt):
            for number, k in enumerate(drawn):
                answer = worker.ask(names[k], seed, number)
                asked += 1
                at_work = answer["status"] == AT_WORK
                counts[names[k]][answer["wrong"] or (AT_WORK if at_work else f"exit {answer['status']}")] += 1
                if answer["wrong"]:
                    again = f"python -m tests.fuzz --target {names[k]} --seed {seed} --only {number}"
                    finds.append({"target": names[k], "seed": seed, "number": number, **answer, "again": again})
                    tell(json.dumps(finds[-1]))
                if at_work or answer["wrong"] in ("hang", "killed") or asked >= RENEWED:
                    worker.end()
                    worker, asked = Worker(Path(folder)), 0
        for ended in (signal.SIGINT, signal.SIGTERM):
            signal.signal(ended, signal.SIG_IGN)  # what came until then is told, however often it is asked to end
        worker.end()
    return counts, finds


def main() -> int:
    """Prints the finds as they come and what came of all; returns the exit status."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--n", type=int, default=10_000, help="how many inputs")
    reader.add_argument("--seed", type=int, default=1)
    reader.add_argument("--target", default="", help=f"comma-separated: {', '.join(TARGETS)}")
    reader.add_argument("--only", type=int, default=None, help="one input of one target, as found")
    reader.add_argument("--keep", type=Path, default=None, help="folder for the files of that input")
    given = reader.parse_args()
    names = [name for name in given.target.split(",") if name] or list(TARGETS)
    if unknown := set(names) - set(TARGETS):
        reader.error(f"{', '.join(sorted(unknown))}: the targets are {', '.join(TARGETS)}")
    if given.only is not None:
        with tempfile.TemporaryDirectory(prefix="fuzz-seeds-") as folder:
            seeds.make(Path(folder))
            worker = Worker(Path(folder))
            print(json.dumps(worker.ask(names[0], given.seed, given.only, given.keep), indent=1))
            worker.end()
        return 0
    if Path("/dev/shm").is_dir():  # thousands of small folders: a disk would be what is waited for
        tempfile.tempdir = os.environ["TMPDIR"] = "/dev/shm"
    began = time.perf_counter()
    counts, finds = fuzz(given.n, given.seed, names, lambda line: print(line, flush=True))
    for name, outcomes in counts.items():
        print(f"{name:20s} {outcomes.total():7d}  {', '.join(f'{k}: {n}' for k, n in sorted(outcomes.items()))}")
    total = sum(outcomes.total() for outcomes in counts.values())
    print(f"{total} inputs in {time.perf_counter() - began:.0f} s; {len(finds)} wrong")
    return int(bool(finds))


if __name__ == "__main__":
    sys.exit(main())
