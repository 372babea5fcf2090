"""Read 24 h at 100 Hz (8.64e6 rows of 10 columns) as minute means, from Parquet and from CSV: time and peak memory.

    python tests/benchmarks/bench_reading.py [--csv]

The file is made in a temporary folder; the reading runs in a process of its own, so that the figures are those of
a fresh start with all imports, the checks of every row and the SHA-256 of the file. Targets: Parquet below 3 s and
500 MB, CSV below 1 GB.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording, Site, write

READ = """
import json, resource, sys, time
start = time.perf_counter()
from gimbalcal.recording import read
recording = read(sys.argv[1], average_s=60.0)
print(json.dumps({"rows": len(recording.time), "samples": float(recording.weight.sum()),
                  "seconds": time.perf_counter() - start, "cpu": time.process_time(),
                  "MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}))
"""


def static_run(hours: float, rate: float, rng: np.random.Generator) -> Recording:
    """A space-stable platform on a still base at 40 N, with the noise of a tactical sensor, as a logger rounds it."""
    time = np.arange(round(hours * 3600 * rate)) / rate
    latitude, phase = np.radians(40.0), EARTH_RATE * time
    force = 9.80146 * np.stack(
        [np.cos(phase) * np.cos(latitude), np.sin(phase) * np.cos(latitude), np.full_like(phase, np.sin(latitude))]
    )
    channels = {
        ("specific_force", a): np.round(f + 5e-3 * rng.standard_normal(len(time)), 6)
        for a, f in zip("xyz", force, strict=True)
    }
    angles = {"platform": phase, "middle": np.full_like(phase, latitude), "outer": np.zeros_like(phase)}
    for axis, angle in angles.items():
        channels["gimbal_angle", axis] = np.round(angle + 2.4e-6 * rng.standard_normal(len(time)), 9)
    for axis in ("roll", "pitch", "yaw"):
        channels["attitude_error", axis] = np.round(1e-5 + 2.4e-6 * rng.standard_normal(len(time)), 9)
    return Recording(
        "static-run", "24 h at 100 Hz", SPACE_STABLE_INERTIAL, Site(latitude, 0.0, 9.80146),
        {"accelerometer": 5e-3}, time, None, channels,
    )  # fmt: skip


def make(hours: float, folder: Path, samples: str) -> None:
    """Write the recording."""
    write(static_run(hours, 100.0, np.random.default_rng(1)), folder, samples=samples)


def main() -> None:
    """Make, read, print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--csv", action="store_true", help="CSV too (slow to write)")
    options.add_argument("--hours", type=float, default=24.0)
    chosen = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for samples in ("samples.parquet", "samples.csv")[: 1 + chosen.csv]:
            target = Path(folder) / samples
            # In a process of its own too: the peak memory of a child starts from that of its parent on Linux.
            maker = get_context("spawn").Process(target=make, args=(chosen.hours, target, samples))
            maker.start()
            maker.join()
            size = (target / samples).stat().st_size / 1e6
            environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
            out = subprocess.run(
                [sys.executable, "-c", READ, str(target)], check=True, capture_output=True, text=True, env=environment
            )
            figures = json.loads(out.stdout)
            print(  # noqa: T201
                f"{samples:16s} {size:6.0f} MB  {figures['samples']:.0f} rows -> {figures['rows']} means  "
                f"{figures['seconds']:.2f} s ({figures['cpu']:.2f} s of processor)  {figures['MB']:.0f} MB peak"
            )


if __name__ == "__main__":
    main()
