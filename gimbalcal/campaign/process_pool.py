"""Shares on the cores of this machine. A worker that dies takes its shares with it; they are done again."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from signal import SIG_IGN, SIGINT, SIGTERM, signal
from threading import Thread
from typing import Any

from gimbalcal.campaign.task import Task, compute
from gimbalcal.errors import InputError

Work = Callable[[Task, range], dict[str, list[Any]]]
DEATHS = 3  # workers that a share may take with it before it is the share's fault


def here(task: Task, shares: Sequence[range]) -> Iterator[tuple[range, dict[str, list[Any]]]]:
    """Yield results of the shares, computed one after the other in this process."""
    for share in shares:
        yield share, compute(task, share)


def processes(
    task: Task, shares: Sequence[range], workers: int, work: Work = compute
) -> Iterator[tuple[range, dict[str, list[Any]]]]:
    """Yield results of the shares, in the order in which `workers` processes finish them.

    Raises InputError when one share keeps ending its worker.
    """
    pending = list(shares)
    while pending:
        try:
            for share, columns in _pooled(task, pending, workers, work):
                pending.remove(share)
                yield share, columns
        except BrokenProcessPool:
            for share in pending[:workers]:  # only these can have been in work: `_pooled` keeps no more in the pool
                yield share, _alone(task, share, work)
            pending = pending[workers:]


def _alone(task: Task, share: range, work: Work) -> dict[str, list[Any]]:
    """One share in a process of its own, so that a death is its own and not its neighbour's."""
    for _ in range(DEATHS):
        try:
            return next(_pooled(task, [share], 1, work))[1]
        except BrokenProcessPool:
            continue
    raise InputError(
        f"runs {share.start} to {share.stop - 1} ended their worker {DEATHS} times, out of memory most likely: take a "
        "smaller scenario; finished runs are kept"
    )


def _pooled(
    task: Task, shares: Sequence[range], workers: int, work: Work
) -> Iterator[tuple[range, dict[str, list[Any]]]]:
    # a fork server starts clean processes: no copied locks of BLAS or Arrow threads; Ctrl-C is the parent's to answer
    pool = ProcessPoolExecutor(workers, get_context("forkserver"), _begin)
    try:
        yield from _run(pool, task, shares, workers, work)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _begin() -> None:
    """Leave Ctrl-C to the parent of a worker, and end the worker with it and with the server that forked it."""
    signal(SIGINT, SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getppid(), SIGTERM)
        os._exit(1)


def _run(
    pool: ProcessPoolExecutor, task: Task, shares: Sequence[range], workers: int, work: Work
) -> Iterator[tuple[range, dict[str, list[Any]]]]:
    waiting = list(shares)
    running: dict[Future[dict[str, list[Any]]], range] = {}
    while waiting or running:
        while waiting and len(running) < workers:
            share = waiting.pop(0)
            running[pool.submit(work, task, share)] = share
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            yield running.pop(future), future.result()
