"""A batch of simulated units: processor time of a unit and of the parent, and what the fleet is worth as a prior.

    python -m tests.benchmarks.bench_fleet [--units N]

Processor times do not depend on what else the machine does: the work of a unit is done by a worker, that of the parent,
which gives out the work and keeps the results, cannot be shared and bounds how many workers are of use. The units are
drawn with a tenth of the catalogue's sigmas; the gain is the ratio of the sigmas without the fleet and with it.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gimbalcal.effects import values
from gimbalcal.history import DatedCalibration
from gimbalcal.history.fleet import Fleet, fleet
from gimbalcal.methods import calibrate
from tests.benchmarks.collecting import say
from tests.fleet.units import unit, write_units
from tests.history.calibrations import START

TESTED, FIRST_TESTED = 40, 1000
GROUPS = ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero")


def processor_seconds(rigs: Path, store: Path, workers: int) -> float:
    """Processor seconds of the process that runs a batch; those of several workers are not among them."""
    words = ["batch", f"{rigs}/*", "--store", str(store), "--workers", str(workers), "--quiet", "--json"]
    before = os.times()
    subprocess.run([sys.executable, "-m", "gimbalcal", *words], stdout=subprocess.DEVNULL, check=False)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def batches(count: int) -> None:
    """The time of a unit, and that of the process that gives out the work and keeps the results."""
    with tempfile.TemporaryDirectory(prefix="fleet-") as name:
        rigs = Path(name) / "rigs"
        write_units(rigs, count)
        one = processor_seconds(rigs, Path(name) / "one.sqlite", 1)
        parent = processor_seconds(rigs, Path(name) / "two.sqlite", 2)
        again = processor_seconds(rigs, Path(name) / "one.sqlite", 1)
    own = (parent - again) / count
    say(f"{count} units of 18 positions, calibrated and diagnosed: processor seconds")
    say(f"in one process           {one:8.1f}   {one / count:.2f} a unit")
    say(f"parent of two workers    {parent:8.1f}   {own:.3f} a unit beyond a batch without work")
    say(f"all results in the store {again:8.1f}")
    say(f"the parent keeps up with {one / count / max(own, 1e-3):.0f} workers")


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
    options.add_argument("--units", type=int, default=40)
    count = options.parse_args(arguments).units
    batches(count)
    made = {f"u{k}": DatedCalibration(f"u{k}", START, calibrate([unit(k)[0]])[0]) for k in range(count)}
    say("")
    say(f"gain in sigma by a fleet of {count} units in 18 positions, {TESTED} further units (geometric mean)")
    say("positions" + "".join(f"{group:>20s}" for group in GROUPS) + "  error/sigma: alone, fleet  unusual")
    known = fleet(made)
    for positions in (6, 12, 18):
        gain(known, positions)


if __name__ == "__main__":
    main()
