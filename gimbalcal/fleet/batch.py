"""Run a batch: find the recordings, compute those whose results the store does not hold, and sum up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from gimbalcal import atomic
from gimbalcal.campaign.workers import TimeLeft, compute_items, connect, number_of_workers
from gimbalcal.effects.loading import loaded_texts
from gimbalcal.errors import number_of
from gimbalcal.fleet.fleet_summary import FleetSummary, fleet_summary
from gimbalcal.fleet.unit_recording import (
    BATCH,
    BatchTask,
    UnitRecording,
    entries_of,
    failure_entry,
    may_pass,
    recordings_of,
)
from gimbalcal.history import FAILURE, StoredResult, keep, kept_entries, refuse_unusable
from gimbalcal.history.fleet import Fleet, grade_and_fleet
from gimbalcal.progress import Progress, no_progress

SUMMARY, TABLE, PAGE = "fleet.json", "fleet.parquet", "report.html"


def run_batch(
    patterns: Sequence[str],
    store: Path,
    out: Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str = "",
    method: str = "",
    more: Sequence[str] = (),
    grade: str = "",
    seed: int = 1,
    unit_name: str = "folder",
    progress: Progress = no_progress,
    page: Callable[[FleetSummary, Fleet], str] | None = None,
) -> FleetSummary:
    """Calibrate and diagnose every recording that matches, keep the results in `store`, and compare the units.

    workers: processes on this machine (default: its cores; 1 computes in this process); scheduler: address of a Dask
    scheduler instead, whose workers read the same files. Results that the store holds of the same files, options and
    version are not computed again. method, more, grade, seed: as of `calibrate` and `diagnose`; unit_name: see
    `recordings_of`. Into `out` go fleet.json, fleet.parquet and, where a function makes it, the page report.html.
    """
    workers = number_of_workers(workers)
    refuse_unusable(store)
    named, known = grade_and_fleet(grade)
    task = BatchTask(method, tuple(more), known or named, seed, loaded_texts())
    recordings = recordings_of(patterns, unit_name)
    client = connect(scheduler) if scheduler else None
    results = _results(task, recordings, store, workers, client, progress)
    summary, distributions, table = fleet_summary({r.folder: results[r.folder] for r in recordings})
    if out is not None:
        with atomic.atomic_folder(out, last=SUMMARY) as new:
            table.write_parquet(new / TABLE)
            atomic.write_json(new / SUMMARY, summary.to_dict())
            if page is not None:
                atomic.write(new / PAGE, page(summary, distributions))
    return summary


def _results(
    task: BatchTask, recordings: Sequence[UnitRecording], store: Path, workers: int, client: Any, progress: Progress
) -> dict[str, tuple[StoredResult, ...]]:
    """Return the entries of each recording by its folder, from the store or computed and kept there."""
    present = _by_key(store) if store.exists() else {}
    keys = {r.folder: task.key(r) for r in recordings}
    results = {folder: tuple(present[key]) for folder, key in keys.items() if key in present}
    todo = [r for r in recordings if r.folder not in results]
    if results:
        are = "is" if len(results) == 1 else "are"
        progress(f"{len(results)} of {number_of(len(recordings), 'recording')} {are} in {store} already")
    if todo:
        progress(f"calibrating and diagnosing {number_of(len(todo), 'recording')}")
    remaining = TimeLeft(len(recordings), len(results))

    def lost(recording: UnitRecording, times: str) -> tuple[StoredResult, ...]:
        why = f"computing it ended the worker {times}, out of memory most likely; give its dwells as means"
        return (failure_entry(task, recording, why),)

    for recording, entries in compute_items(partial(entries_of, task), todo, lost, workers, client):
        if not any(map(may_pass, entries)):  # otherwise the same batch computes the recording again
            keep(store, *entries)
        results[recording.folder] = entries
        for entry in (e for e in entries if e.kind == FAILURE):
            progress(f"{recording.folder}: {entry.content['in_words']}")
        progress(remaining.after(1, "recording"))
    return results


def _by_key(store: Path) -> dict[str, list[StoredResult]]:
    """Return the entries of batches in a store by their key; those of a recording were added together."""
    by_key: dict[str, list[StoredResult]] = {}
    for entry in kept_entries(store):
        if key := entry.content.get("provenance", {}).get(BATCH):
            by_key.setdefault(str(key), []).append(entry)
    return by_key
