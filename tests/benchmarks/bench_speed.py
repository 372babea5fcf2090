"""Time and memory of whole processes beside a peer in the same run: the least processor time of three.

    python -m tests.benchmarks.bench_speed [ROW ...]            those rows, by the beginning of their names
    python -m tests.benchmarks.bench_speed --against FILE       status 1 where a ratio is worse by a fifth than there

A peer does the least that the work needs: polars reads and averages the same file, NumPy computes an overlapping Allan
deviation, Python imports what the command imports. Processor seconds are those of a process and all its threads, with
imports, checks and SHA-256; ratios compare between machines, seconds do not. All rows take half an hour.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site, write
from gimbalcal.simulate import simulate
from gimbalcal.simulate.scenario import find
from tests.benchmarks.collecting import say
from tests.benchmarks.day_of_samples import make as static_run
from tests.paths import CONCEALED, ROOT

REPEATS, WORSE = 3, 1.2
READ = "from gimbalcal.recording import read; read('{of}', average_s=60.0)"
MEAN = (
    "import polars as pl; "
    "print(pl.scan_{kind}('{of}/samples.{kind}').select(pl.all().mean()).collect(engine='streaming'))"
)
COMMAND = "import sys; from gimbalcal.cli import main; sys.argv = ['gimbalcal', {words}]; main()"
ALLAN = """
import numpy as np, polars as pl
frame = pl.read_parquet('{of}/samples.parquet')
for name in frame.columns[1:]:
    x = np.concatenate([[0.0], np.cumsum(frame[name].to_numpy())])
    for m in np.unique(np.logspace(0, np.log10(len(x) // 9), 60).astype(int)):
        d = x[2 * m :] - 2 * x[m:-m] + x[: -2 * m]
        np.sqrt(np.mean(d * d) / 2) / m
"""
IMPORTS = "import numpy, scipy.optimize, scipy.stats, polars, gimbalcal.diagnose, gimbalcal.report.files"


def positions(folder: Path, rows: int, count: int) -> None:
    """A unit laid down in `count` positions, with its position column."""
    rng = np.random.default_rng(2)
    down = rng.standard_normal((count, 3))
    down /= np.linalg.norm(down, axis=1)[:, None]
    position = np.repeat(np.arange(1, count + 1), rows // count)
    force = -9.80146 * down[position - 1] * [1.001, 0.999, 1.0005] + 5e-3 * rng.standard_normal((len(position), 3))
    write(_recording(position, {("specific_force", a): np.round(x, 6) for a, x in zip("xyz", force.T, strict=True)}),
          folder, "samples.parquet")  # fmt: skip


def still(folder: Path, rows: int) -> None:
    """Both triads at rest."""
    rng = np.random.default_rng(3)
    channels = {
        ("specific_force", a): g + 1e-3 * rng.standard_normal(rows) for a, g in zip("xyz", (0, 0, -9.8), strict=True)
    }
    channels |= {("angular_rate", a): 1e-4 * rng.standard_normal(rows) for a in "xyz"}
    write(_recording(np.ones(rows, dtype=np.int64), channels), folder, "samples.parquet")


def _recording(position: np.ndarray, channels: dict[tuple[str, str], np.ndarray]) -> Recording:
    return Recording("multi-position", "speed", BENCH, Site(0.7, 0.0, 9.80146), {}, 0.01 * np.arange(len(position)),
                     position, channels)  # fmt: skip


def log(folder: Path, rows: int) -> None:
    """An undescribed log of a unit in the hand, some 75 bytes a row."""
    folder.mkdir()
    rng = np.random.default_rng(4)
    faces = np.vstack([np.eye(3), -np.eye(3), [[0.6, 0.8, 0.0], [0.0, 0.6, 0.8]]])
    blocks = np.repeat(np.arange(24), -(-rows // 24))[:rows] % 8
    table = np.column_stack([0.01 * np.arange(rows), faces[blocks] + 1e-3 * rng.standard_normal((rows, 3)),
                             0.05 * rng.standard_normal((rows, 3))])  # fmt: skip
    head = "timestamp,ax,ay,az,gx,gy,gz"
    np.savetxt(folder / "log.csv", table, fmt="%.6f", delimiter=",", header=head, comments="")


def turned(folder: Path, sweeps: int) -> None:
    """The 18 turns of Cai et al. (2016) at 100 Hz, an hour for each sweep."""
    scenario = tomllib.loads(find("cai2016-18").read_text(encoding="utf-8"))
    scenario["schedule"]["sweeps"] = sweeps
    write(simulate(scenario, 5)[0], folder, "samples.parquet")


def drifting(folder: Path, hours: int) -> None:
    """Minute means of a platform at rest whose clock is 2 ppm fast, which a drift about the polar axis resembles."""
    scenario = tomllib.loads(find("wu2018-static").read_text(encoding="utf-8"))
    scenario["schedule"] |= {"duration": {"value": hours, "unit": "h"}, "rate": {"value": 1 / 60, "unit": "Hz"}}
    scenario["noise"]["accelerometer"]["value"] = 2e-5
    scenario["truth"]["clock_rate"] = {"clock_rate": 2.0}
    write(simulate(scenario, 6)[0], folder, "samples.parquet")


@dataclass(frozen=True)
class Row:
    """One line of the table: what is made, what is run and the peer; {of}: the folder that was made, {out}: results."""

    name: str
    make: Callable[..., None] | None
    given: tuple[object, ...]
    ours: str
    peer_name: str = ""
    peer: str = ""


def command(*words: str) -> str:
    """Python that runs a command line."""
    return COMMAND.format(words=", ".join(map(repr, words)))


DEVICE = str(CONCEALED)
ROWS = (
    Row("day, Parquet", static_run, (24.0, "samples.parquet"), READ, "polars mean", MEAN.replace("{kind}", "parquet")),
    Row("day, CSV", static_run, (24.0, "samples.csv"), READ, "polars mean", MEAN.replace("{kind}", "csv")),
    Row("positions, 1.2e7 rows", positions, (12_000_000, 24), "from gimbalcal.recording import read; read('{of}')",
        "polars mean", MEAN.replace("{kind}", "parquet")),
    Row("new, 200 MB", log, (2_800_000,), command("new", "{of}/log.csv", "--quiet", "--out", "{out}"),
        "polars read", "import polars as pl; pl.read_csv('{of}/log.csv')"),
    Row("noise, 1e6 x 6", still, (1_000_000,), command("noise", "{of}", "--quiet", "--out", "{out}"),
        "NumPy oadev", ALLAN),
    Row("diagnose, 18 positions", None, (), command("diagnose", DEVICE, "--quiet", "--out", "{out}"),
        "imports", IMPORTS),
    Row("diagnose, 125 positions", positions, (12_500, 125), command("diagnose", "{of}", "--quiet", "--out", "{out}")),
    Row("diagnose, 1000 positions", positions, (20_000, 1000),
        command("diagnose", "{of}", "--quiet", "--out", "{out}")),
    Row("diagnose, static run 48 h", drifting, (48,), command("diagnose", "{of}", "--quiet", "--out", "{out}")),
    Row("systematic, 7 h", turned, (7,), command("calibrate", "{of}", "--quiet", "--out", "{out}")),
    Row("campaign, 20 runs", None, (),
        command("campaign", "wu2018-18", "-n", "20", "--workers", "1", "--quiet", "--out", "{out}")),
)  # fmt: skip


def measured(code: str, of: Path) -> tuple[float, float]:
    """Least processor seconds and largest memory [MB] of a few processes, each with an empty folder for its results.

    Bytecode of this package is kept after the first of them, as after an installation.
    """
    seconds, memory = [], []
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    environment |= {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(of.parent / "bytecode")}
    for repeat in range(REPEATS):
        ours = code.replace("{of}", str(of)).replace("{out}", str(of.parent / f"results-{repeat}"))
        with subprocess.Popen(
            [sys.executable, "-c", ours], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment,
            cwd=ROOT,
        ) as process:  # fmt: skip
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode not in (0, 1):
            raise RuntimeError(f"{code[:200]} ended with {process.returncode}")
        seconds.append(used.ru_utime + used.ru_stime)
        memory.append(used.ru_maxrss / 1024)
    return min(seconds), max(memory)


def line(row: Row) -> str:
    """The line of one row, measured."""
    with tempfile.TemporaryDirectory(prefix="speed-") as name:
        of = Path(name) / "made"
        if row.make is None:
            of.mkdir()
        else:  # in a process of its own: the peak memory of a child starts from that of its parent
            first = (row.given[0], of, row.given[1]) if row.make is static_run else (of, *row.given)
            maker = get_context("spawn").Process(target=row.make, args=first)
            maker.start()
            maker.join()
        ours, memory = measured(row.ours, of)
        text = f"{row.name:26s} {ours:7.2f} s {memory:7.0f} MB"
        if row.peer:
            peer, _ = measured(row.peer, of)
            text += f"   {row.peer_name:12s} {peer:6.2f} s   ratio {ours / peer:5.2f}"
        return text


def ratios(text: str) -> dict[str, float]:
    """The ratio of each row of a table."""
    return {m[1].strip(): float(m[2]) for m in re.finditer(r"^(.{26}) .*ratio +([\d.]+)$", text, re.MULTILINE)}


def main() -> int:
    """Print the table; return 1 where a ratio is worse than in the table that is given."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("rows", nargs="*", metavar="ROW")
    options.add_argument("--against", type=Path, default=None)
    chosen = options.parse_args()
    before = ratios(chosen.against.read_text(encoding="utf-8")) if chosen.against else {}
    say("whole processes: least processor time of three, largest memory; the peer in the same run")
    table = []
    for row in ROWS:
        if row.name.startswith(tuple(chosen.rows) or ""):
            table.append(line(row))
            say(table[-1])
    worse = {n: (before[n], now) for n, now in ratios("\n".join(table)).items() if now > WORSE * before.get(n, np.inf)}
    for name, (was, now) in worse.items():
        say(f"{name}: the ratio is {now:.2f}, was {was:.2f}")
    return int(bool(worse))


if __name__ == "__main__":
    sys.exit(main())
