"""Four pieces of work beside a peer in the same process, as a ratio that may not grow by a fifth.

    python -m tests.benchmarks.bench_gate                   the table; best of `ROUNDS`, ours and peer in turn
    python -m tests.benchmarks.bench_gate --against FILE    status 1 where a ratio is worse by a fifth than there

A peer is work of the same nature that no change of this package touches: polars averages the same file, NumPy computes
an overlapping Allan deviation, solves small systems as a fit of a few positions does, and multiplies the matrices of a
dense Kalman filter. Processor seconds of the whole process and all its threads; no imports. A machine that is busy adds
to single rounds, so a ratio that seems too large is measured again, up to `TRIES` times, and its best round counts.
Interpreter and BLAS do not gain alike on another processor (NumPy's products change by a factor of 2.6 with the
kernels of OpenBLAS), so ratios are compared on the same kind of machine; on another the status is 3.
"""

import argparse
import gc
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
from threadpoolctl import threadpool_info

import gimbalcal
from gimbalcal.inference import square_root_filter
from gimbalcal.recording import read
from tests.benchmarks.bench_speed import WORSE, ratios
from tests.benchmarks.collecting import say
from tests.benchmarks.day_of_samples import make as static_run
from tests.paths import DEVICE

ROUNDS, TRIES = 4, 4
OTHER_MACHINE = 3  # the status
MIN_SECONDS = 0.15  # of one round of a piece of work, which is repeated for as long
Work = Callable[[], object]


def reading(folder: Path) -> tuple[Work, Work]:
    """Three hours of ten columns at 100 Hz, as minute means with all checks; the means of the file."""
    static_run(3.0, folder / "static", "samples.parquet")
    samples = pl.scan_parquet(folder / "static" / "samples.parquet")
    return lambda: read(folder / "static", average_s=60.0), lambda: samples.select(pl.all().mean()).collect()


def noise(_: Path) -> tuple[Work, Work]:
    """Six channels of 1e5 samples: white noise, random walk and instability; overlapping Allan deviations."""
    rng = np.random.default_rng(3)
    still = gimbalcal.from_arrays(
        0.01 * np.arange(100_000), specific_force=[0, 0, -9.8] + 1e-3 * rng.standard_normal((100_000, 3)),
        angular_rate=1e-4 * rng.standard_normal((100_000, 3)), position=np.ones(100_000),
    )  # fmt: skip
    return lambda: gimbalcal.noise(still), lambda: [_allan(x) for x in still.channels.values()]


def _allan(rate: np.ndarray) -> list[float]:
    x, out = np.concatenate([[0.0], np.cumsum(rate)]), []
    for m in np.unique(np.logspace(0, np.log10(len(x) // 9), 60).astype(int)):
        d = x[2 * m :] - 2 * x[m:-m] + x[: -2 * m]
        out.append(float(np.sqrt(np.mean(d * d) / 2) / m))
    return out


def calibration(_: Path) -> tuple[Work, Work]:
    """The 18 coefficients of a space-stable platform in three stages; singular values of small matrices."""
    recording = gimbalcal.read(DEVICE)
    J = np.random.default_rng(5).standard_normal((54, 18))
    return lambda: gimbalcal.calibrate(recording), lambda: [np.linalg.svd(J, full_matrices=False) for _ in range(500)]


def filtering(_: Path) -> tuple[Work, Work]:
    """A square-root filter of 9 states and 54 constants over 4000 steps; products of a dense covariance of 63."""
    rng, K, m, p = np.random.default_rng(6), 4000, 9, 54
    Phi, Psi = np.eye(m) + 1e-3 * rng.standard_normal((K, m, m)), 1e-3 * rng.standard_normal((K, m, p))
    given = (Phi, Psi, 1e-3 * np.eye(m) + np.zeros((K, m, m)), np.zeros((K, m)), np.zeros((K, 3)))
    P = rng.standard_normal((m + p, m + p))
    return (
        lambda: square_root_filter.filter(
            *given, np.arange(3, 6), np.ones((K, 3)), np.zeros(m), np.zeros(p), np.eye(m + p), smoothed=3
        ),
        lambda: [P @ P @ P.T for _ in range(2000)],
    )


ROWS = {
    "read 3 h, Parquet": (reading, "polars mean"),
    "noise, 1e5 x 6": (noise, "NumPy oadev"),
    "calibrate, 18 positions": (calibration, "NumPy svd"),
    "filter, 4000 steps": (filtering, "NumPy matmul"),
}


def machine() -> str:
    """Return what ratios depend on: the architecture, the kernels that OpenBLAS chose, and the version of NumPy."""
    kernels = sorted({lib["architecture"] for lib in threadpool_info() if "architecture" in lib})
    return f"{platform.machine()}, {' '.join(kernels)} kernels, NumPy {np.__version__}"


def seconds(work: Work) -> float:
    """Return the processor seconds of one call, over as many as take `MIN_SECONDS`."""
    start, calls = time.process_time(), 0
    while calls == 0 or time.process_time() - start < MIN_SECONDS:
        work()
        calls += 1
    return (time.process_time() - start) / calls


def line(name: str, folder: Path, limit: float) -> str:
    """Return the line of one row, measured until its ratio is below the limit, or as often as is tried."""
    make, peer_name = ROWS[name]
    ours, peer = make(folder)
    ours(), peer()
    taken: list[tuple[float, float]] = []
    best = np.array([np.inf, np.inf])
    while len(taken) < ROUNDS or (best[0] > limit * best[1] and len(taken) < ROUNDS * TRIES):
        taken.append((seconds(ours), seconds(peer)))
        best = np.min(taken, axis=0)
    single = [own / other for own, other in taken]
    return (
        f"{name:26s} {best[0]:8.4f} s   {peer_name:12s} {best[1]:8.4f} s   "
        f"single rounds {min(single):.2f} to {max(single):.2f}   ratio {best[0] / best[1]:6.3f}"
    )


def main() -> int:
    """Print the table; return 1 where a ratio is worse by a fifth than in the table that is given."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--against", type=Path, default=None)
    chosen = options.parse_args()
    stored = chosen.against.read_text(encoding="utf-8") if chosen.against else ""
    before, here = ratios(stored), machine()
    if stored and here not in stored:
        say(f"{chosen.against} was measured on another kind of machine than this one ({here}): nothing is compared")
        return OTHER_MACHINE
    gc.disable()
    say(f"{here}: processor time of one call, best of {ROUNDS} rounds, ours and the peer in turn")
    worse = []
    with tempfile.TemporaryDirectory(prefix="gate-") as folder:
        for name in ROWS:
            limit = WORSE * before.get(name, 0.0) if chosen.against else np.inf
            say(text := line(name, Path(folder), limit))
            worse += [(name, now) for now in ratios(text).values() if now > limit]
    for name, now in worse:
        say(f"{name}: the ratio is {now:.3f}, was {before.get(name, np.nan):.3f}")
    return int(bool(worse))


if __name__ == "__main__":
    sys.exit(main())
