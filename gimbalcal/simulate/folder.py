"""A simulated run as a recording folder with its truth.json, written whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

from gimbalcal import atomic
from gimbalcal.errors import InputError
from gimbalcal.progress import Progress, no_progress
from gimbalcal.recording import write
from gimbalcal.recording.header import NAME
from gimbalcal.simulate.scenario import find, load
from gimbalcal.simulate.simulation import Run, blocks, join_blocks, prepare
from gimbalcal.simulate.truth import described_truth

MIN_PARQUET_ROWS = 400_000  # rows from which samples are written as Parquet
MIN_ROW_BYTES = 2 * 24  # bytes that a row of noise takes there at least, in its part and in the whole


def simulate_to(
    scenario: str | Path, folder: str | Path, seed: int | None = None, progress: Progress = no_progress
) -> dict[str, Any]:
    """Simulate into a recording folder that also has truth.json, whole or not at all; returns the truth."""
    path, folder = find(scenario), Path(folder)
    progress(f"preparing {path.name}")
    run = prepare(load(path), seed)
    truth = truth_of(run, path.name)
    samples = "samples.parquet" if len(run.time) > MIN_PARQUET_ROWS else "samples.csv"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file: a recording is a folder, give another name")
    with atomic.atomic_folder(folder, last=NAME) as new:  # the header last: it is what makes the folder a recording
        if samples.endswith(".csv"):
            write(join_blocks(blocks(run)), new, samples)
        else:
            _write_blocks(run, new, samples, progress)
        (new / "truth.json").write_text(atomic.as_json(truth, indent=1), encoding="utf-8")
    return truth


def truth_of(run: Run, name: str) -> dict[str, Any]:
    """Return what truth.json holds: parameters as in calibration.json, seed, and the scenario as it was run."""
    return {
        "format": 1,
        "scenario": name,
        "seed": run.seed,
        "parameters": described_truth(run.effects, run.platform.axis_names),
        "faults": run.scenario.faults.model_dump(mode="json"),
        "content": run.scenario.model_dump(mode="json"),
    }


def _write_blocks(run: Run, folder: Path, samples: str, progress: Progress) -> None:
    """Write each block as a Parquet file of its own, then join them without loading them."""
    import polars as pl

    needed, free = MIN_ROW_BYTES * len(run.time), shutil.disk_usage(folder).free
    if needed > free:
        raise InputError(
            f"schedule: {len(run.time):.3g} rows take {needed / 1e9:.2g} GB while they are written, and the disk has "
            f"{free / 1e9:.2g} GB left; lower `rate`, make it shorter, or write to another disk"
        )
    with tempfile.TemporaryDirectory(dir=folder) as parts:
        names, rows = [], 0
        for i, block in enumerate(blocks(run)):
            part = write(block, Path(parts) / f"part{i}", samples)
            names.append((part / samples).absolute())
            rows += len(block.time)
            progress(f"simulated {rows} of {len(run.time)} rows")
        (names[0].parent / NAME).replace(folder / NAME)
        pl.scan_parquet(names, glob=False).sink_parquet(folder / samples)
