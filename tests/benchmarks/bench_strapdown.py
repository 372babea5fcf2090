"""How fast the navigator is, and the filter over it.

The yardstick of the field, pyins 1.0.1, is in no registry here and cannot be timed in the same run; measured elsewhere
it took 925 ns a sample (1.08 M samples/s), and 66 ns a step was the floor of any compiled loop. Time of the processor,
best of seven, so that other programs on the machine do not count.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from gimbalcal.estimate.systematic.calibrate import systematic
from gimbalcal.navigate.strapdown import strapdown
from tests.estimate.systematic.table import LATITUDE, MOVES, START, turning_unit

PYINS, FLOOR = 925.0, 66.0  # ns a sample
BEST_OF = 7


def best(run: Callable[[], object]) -> float:
    """Shortest time [s] of several runs; the first, which may compile, does not count."""
    run()
    out = []
    for _ in range(BEST_OF):
        start = time.process_time()
        run()
        out.append(time.process_time() - start)
    return min(out)


def main() -> None:
    """Print both tables."""
    r = turning_unit(moves=MOVES * 4, stop=45.0, rate=100.0, start=START)
    dt, w, f = np.diff(r.time, prepend=0.0), r.triad("angular_rate"), r.triad("specific_force")
    place = np.array([LATITUDE, 0.0, 0.0])
    took = best(lambda: strapdown(dt, w, f, START, np.zeros(3), place))
    ns = 1e9 * took / len(dt)
    sys.stdout.write(f"strapdown, {len(dt)} samples: {1e-6 * len(dt) / took:.2f} M samples/s, {ns:.0f} ns a sample\n")
    sys.stdout.write(f"  {PYINS / ns:.1f} times what pyins did, {ns / FLOOR:.1f} times the floor\n")
    for asked in ("30", "51"):
        took = best(lambda asked=asked: systematic(r, asked))
        sys.stdout.write(f"systematic, {asked} states, {r.time[-1] / 60:.0f} min at 100 Hz: {took:.2f} s\n")


if __name__ == "__main__":
    main()
