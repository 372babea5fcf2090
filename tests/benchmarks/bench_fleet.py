"""A batch of simulated units: processor times, killed workers and schedulers, and what the fleet is worth as a prior.

    python -m tests.benchmarks.bench_fleet [--units 1000] [--batch 40]
    python -m tests.benchmarks.bench_fleet --store FILE --seconds 200   # a part; again until all are there

Processor times do not depend on what else the machine does: the work of a unit is done by a worker, that of the parent,
which gives out the work and keeps the results, cannot be shared and bounds how many workers are of use. The units are
drawn with a tenth of the catalogue's sigmas; the gain is the ratio of the sigmas without the fleet and with it.
How long two workers take on cores of their own is the time by the clock less what they waited for a core, of which
Linux keeps an account. A cluster loses a worker after a quarter of the batch and its scheduler after half; another one
continues.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from gimbalcal.campaign.workers import connect
from gimbalcal.effects import values
from gimbalcal.errors import InputError
from gimbalcal.fleet import run_batch
from gimbalcal.history import StoredResult, keep, kept_entries
from gimbalcal.history.fleet import Fleet, fleet_of_store
from gimbalcal.history.unit_store import CALIBRATION
from gimbalcal.methods import calibrate
from tests.benchmarks.collecting import say
from tests.campaign.test_campaign import dask_cluster
from tests.fleet.test_batch import digits
from tests.fleet.units import unit, write_units

TESTED, FIRST_TESTED = 40, 1000
GROUPS = ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero")


class Took(NamedTuple):
    """Seconds of a batch: of the processor by the process that runs it, by the clock, and of it without others' work.

    processor: those of several workers are not among them.
    """

    processor: float
    clock: float
    alone: float


def timed(rigs: Path, store: Path, workers: int) -> Took:
    """How long a batch takes."""
    words = ["batch", f"{rigs}/*", "--store", str(store), "--workers", str(workers), "--quiet", "--json"]
    before, began, waited = os.times(), time.perf_counter(), dict[str, tuple[float, float]]()
    with subprocess.Popen([sys.executable, "-m", "gimbalcal", *words], stdout=subprocess.DEVNULL) as process:
        while process.poll() is None:
            for pid in descendants(str(process.pid)):
                waited[pid] = max(waited.get(pid, (0.0, 0.0)), accounted(pid))
            time.sleep(0.2)
    after, clock = os.times(), time.perf_counter() - began
    busiest = sorted(waited.values(), reverse=True)[:workers]
    return Took(
        after.children_user + after.children_system - before.children_user - before.children_system,
        clock,
        clock - min((wait for _, wait in busiest), default=0.0),
    )


def descendants(pid: str) -> list[str]:
    """A process and those that it and they have begun."""
    try:
        own = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        own = []
    return [pid, *(each for child in own for each in descendants(child))]


def accounted(pid: str) -> tuple[float, float]:
    """Seconds for which a process ran, and for which it waited for a core."""
    try:
        ran, waited, _ = Path(f"/proc/{pid}/schedstat").read_text().split()
    except OSError:
        return 0.0, 0.0
    return float(ran) / 1e9, float(waited) / 1e9


def batches(count: int) -> None:
    """The time of a unit, that of the process that gives out the work and keeps the results, and what kills do."""
    with tempfile.TemporaryDirectory(prefix="fleet-") as name:
        rigs = Path(name) / "rigs"
        write_units(rigs, count)
        one, two, again = (
            timed(rigs, Path(name) / f"{store}.sqlite", n) for store, n in (("one", 1), ("two", 2), ("one", 1))
        )
        kills = killed(rigs, Path(name), count)
        stores = [digits(Path(name) / f"{store}.sqlite", *units_of(count)) for store in ("one", "two", "killed")]
    own = (two.processor - again.processor) / count
    say(f"{count} units of 18 positions, calibrated and diagnosed: processor seconds")
    say(f"in one process           {one.processor:8.1f}   {one.processor / count:.2f} a unit")
    say(f"parent of two workers    {two.processor:8.1f}   {own:.3f} a unit beyond a batch without work")
    say(f"all results in the store {again.processor:8.1f}")
    say(f"the parent keeps up with {one.processor / count / max(own, 1e-3):.0f} workers")
    say(
        f"two workers took {two.clock:.1f} s by the clock, {two.alone:.1f} s of it not waiting for one of "
        f"{os.cpu_count()} cores in use: {one.processor / 2 / two.alone:.0%} efficiency on cores of their own"
    )
    say(kills)
    same = all(store == stores[0] for store in stores)
    say(f"digits of one process, two workers and the batch with kills: {'the same' if same else 'DIFFERENT'}")


def units_of(count: int) -> list[str]:
    """The units of a batch."""
    return [f"rig-{k:03d}" for k in range(count)]


def killed(rigs: Path, folder: Path, count: int) -> str:
    """Kill a worker after a quarter and the scheduler after half, then continue on another cluster."""
    store, ends, kept_then = folder / "killed.sqlite", [], 0

    def run(address: str, processes: Sequence[subprocess.Popen[bytes]], kills: bool) -> None:
        left = {count // 4: processes[0], count // 2: processes[-1]} if kills else {}

        def progress(line: str) -> None:
            match = re.match(r"(\d+) of \d+ recordings", line)
            for number in [n for n in left if match and int(match[1]) >= n]:
                left.pop(number).kill()

        with connect(address) as client:
            client.wait_for_workers(2, timeout=30)
        run_batch([f"{rigs}/*"], store, folder / "fleet", scheduler=address, progress=progress)

    (folder / "first").mkdir()
    with dask_cluster(folder / "first") as (address, processes):
        try:
            run(address, processes, kills=True)
        except InputError as problem:
            ends.append(str(problem))
    kept_then = len({e.unit for e in kept_entries(store)})
    (folder / "second").mkdir()
    with dask_cluster(folder / "second") as (address, processes):
        run(address, processes, kills=False)
    table = pl.read_parquet(folder / "fleet" / "fleet.parquet")
    ended = re.sub(r"tcp://[\d.:]+", "tcp://...", ends[0]) if ends else "the batch ended without a word"
    last = f"{kept_then} units kept, {table['unit'].n_unique()} in the table after the second cluster"
    return f"a worker killed, then the scheduler: {ended!r}; {last}"


def calibrated(store: Path, count: int, seconds: float) -> int:
    """Calibrate the units that a store lacks for so long, and keep them there; returns how many it holds."""
    there = {e.unit for e in kept_entries(store)} if store.exists() else set()
    until, entries = time.monotonic() + seconds, []
    for k in range(count):
        if f"u{k}" not in there and time.monotonic() < until:
            content = calibrate([unit(k)[0]])[0].to_dict()
            entries.append(StoredResult(f"u{k}", content["provenance"]["created"], CALIBRATION, content))
    if entries:
        keep(store, *entries)
    return len(there) + len(entries)


def gain(known: Fleet, positions: int) -> None:
    """The gain in sigma of units that record so few positions, by group, and their errors over sigma."""
    ratio: dict[str, list[float]] = {group: [] for group in GROUPS}
    z: dict[bool, list[np.ndarray]] = {True: [], False: []}
    unusual = 0
    for k in range(FIRST_TESTED, FIRST_TESTED + TESTED):
        recording, effects = unit(k, positions)
        alone, together = (calibrate([recording], grade=grade)[0] for grade in ("", known))
        unusual += "unusual" in together.outcome
        for c, with_prior in ((alone, False), (together, True)):
            z[with_prior].append((c.values - values(effects, c.parameters)) / c.sigmas)
        for p, a, b in zip(alone.parameters, alone.sigmas, together.sigmas, strict=True):
            ratio[p.effect].append(a / b)
    columns = "".join(f"{np.exp(np.mean(np.log(ratio[group]))):20.2f}" for group in GROUPS)
    errors = [np.sqrt(np.mean(np.square(z[side]))) for side in (False, True)]
    say(f"{positions:9d}{columns}{errors[0]:10.2f}{errors[1]:8.2f}{unusual:10d}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print both tables."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--units", type=int, default=1000, help="of the fleet that is the prior")
    options.add_argument("--batch", type=int, default=40, help="units that are calibrated and diagnosed by batch")
    options.add_argument("--store", type=Path, help="file in which the fleet is kept and continued")
    options.add_argument("--seconds", type=float, default=np.inf, help="stop calibrating the fleet after so long")
    given = options.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="fleet-") as name:
        store = given.store or Path(name) / "fleet.sqlite"
        there = calibrated(store, given.units, given.seconds)
        if there < given.units:
            say(f"{there} of {given.units} units are in {store}")
            return
        known = fleet_of_store(store)
    if given.batch:
        batches(given.batch)
        say("")
    say(f"gain in sigma by a fleet of {given.units} units in 18 positions, {TESTED} further units (geometric mean)")
    say("positions" + "".join(f"{group:>20s}" for group in GROUPS) + "  error/sigma: alone, fleet  unusual")
    for positions in (6, 12, 18):
        gain(known, positions)


if __name__ == "__main__":
    main()
