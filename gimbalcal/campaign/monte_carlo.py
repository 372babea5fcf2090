"""Run a campaign: share out, collect, report how long it takes, sum up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.campaign.campaign_folder import CampaignFolder, CampaignSummary, ParameterErrors
from gimbalcal.campaign.task import Task, compute_runs, task
from gimbalcal.campaign.workers import RESUMABLE, TimeLeft, compute_items, connect, number_of_workers
from gimbalcal.errors import InputError, number_of
from gimbalcal.progress import Progress, no_progress

if TYPE_CHECKING:
    import polars as pl

Page = Callable[[CampaignSummary], str]


def run_campaign(
    scenario: str | Path,
    n: int,
    out: Path,
    workers: int | None = None,
    scheduler: str = "",
    progress: Progress = no_progress,
    method: str = "three-stage",
    seed: int | None = None,
    page: Page | None = None,
    overwrite: bool = False,
) -> CampaignSummary:
    """Run a scenario n times into `out` (campaign.parquet, campaign.json) and return what campaign.json holds.

    workers: processes on this machine (default: its cores; 1 computes in this process). scheduler: address of a Dask
    scheduler to use instead. progress is reported after each share. A stopped campaign is resumed by the next call.
    page: returns the text of report.html, which is written with the numbers, from the content of campaign.json.
    overwrite: another campaign in `out` is replaced.
    """
    if n < 1:
        raise InputError(f"-n must be at least 1, got {n}")
    workers = number_of_workers(workers)
    what = task(scenario, method, seed)
    store = CampaignFolder(Path(out), what, n)
    client = connect(scheduler) if scheduler else None
    with store.alone():
        if overwrite:
            store.give_way()
        return _run_shares(what, store, n, workers, client, progress, page)


def _run_shares(
    what: Task, store: CampaignFolder, n: int, workers: int, client: Any, progress: Progress, page: Page | None
) -> CampaignSummary:
    todo = store.open()
    done = n - sum(len(share) for share in todo)
    if done:
        progress(f"{done} of {number_of(n, 'run')} were there already")
    time_left = TimeLeft(n, done)
    for share, columns in compute_items(partial(compute_runs, what), todo, lost_share, workers, client):
        store.keep(share, columns)
        progress(time_left.after(len(share), "run"))
    return store.finish(lambda rows, digest: summarise(rows, what, digest), page)


def lost_share(share: range, times: str) -> dict[str, list[Any]]:
    """Raise InputError for a share whose runs end their workers."""
    raise InputError(
        f"runs {share.start} to {share.stop - 1} ended their worker {times}, out of memory most likely: take a smaller "
        f"scenario; {RESUMABLE}"
    )


def summarise(rows: pl.DataFrame, what: Task, digest: str) -> CampaignSummary:
    """Return the errors of each parameter over all rows, and what failed; digest: SHA-256 of the file of the rows."""
    import polars as pl

    good = rows.filter(pl.col("parameter") != "")
    table = []
    for name in good["parameter"].unique(maintain_order=True).to_list():
        part = good.filter(pl.col("parameter") == name)
        error = (part["estimate"] - part["truth"]).to_numpy()
        sigma = part["sigma"].to_numpy()
        rms, bound = float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(sigma**2)))
        ratio = rms / bound if bound > 0 else nan
        table.append(ParameterErrors(name, part["unit"][0], len(part), float(np.mean(error)), rms, bound, ratio))
    runs = int(rows["run"].n_unique())
    failed = rows.filter(pl.col("outcome") != "").unique("run", keep="first", maintain_order=True)
    # of equals the first by the alphabet, so that equal runs give equal files
    words = failed["outcome"].value_counts().sort(["count", "outcome"], descending=[True, False]).head(5)
    outcomes = dict(zip(words["outcome"].to_list(), words["count"].to_list(), strict=True))
    text, n = _summary_in_words(runs, len(failed), table), len(failed)
    return CampaignSummary(1, what.identity, digest, what.direction, runs, n, outcomes, tuple(table), text)


def _summary_in_words(runs: int, failed: int, table: Sequence[ParameterErrors]) -> str:
    ratios = [row.ratio for row in table if isfinite(row.ratio)]
    if not ratios:
        return f"{number_of(runs, 'run')}, none with an estimate"
    spread = f"RMS error is {min(ratios):.2f} to {max(ratios):.2f} of the predicted sigma"
    parameters = number_of(len(table), "parameter")
    return f"{number_of(runs, 'run')}, {failed} with an outcome to read; {spread} over {parameters}"
