"""Workers that compute the shares of a campaign: this process, processes on this machine, or an existing Dask cluster.

A worker that dies takes its shares with it; they are done again. The extra `gimbalcal[cluster]` brings the client.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import logging
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

Columns = dict[str, list[Any]]
Work = Callable[[Task, range], Columns]
DEATHS = 3  # workers that a share may take with it before it is the share's fault
CANCELLED = (asyncio.CancelledError, concurrent.futures.CancelledError)
PATIENCE = 10.0  # s without a share that is done before it is asked whether anybody works
RESUMABLE = "finished runs are kept, and the same command continues from there"


def here(task: Task, shares: Sequence[range]) -> Iterator[tuple[range, Columns]]:
    """Yield results of the shares, computed one after the other in this process."""
    for share in shares:
        yield share, compute(task, share)


def processes(
    task: Task, shares: Sequence[range], workers: int, work: Work = compute
) -> Iterator[tuple[range, Columns]]:
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


def _alone(task: Task, share: range, work: Work) -> Columns:
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


def _pooled(task: Task, shares: Sequence[range], workers: int, work: Work) -> Iterator[tuple[range, Columns]]:
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
) -> Iterator[tuple[range, Columns]]:
    waiting = list(shares)
    running: dict[Future[Columns], range] = {}
    while waiting or running:
        while waiting and len(running) < workers:
            share = waiting.pop(0)
            running[pool.submit(work, task, share)] = share
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            yield running.pop(future), future.result()


def connect(address: str, timeout: float = 10.0) -> Any:
    """Return a client of the scheduler at tcp://host:port. Raises InputError where Dask is missing here or there."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--scheduler needs Dask: pip install 'gimbalcal[cluster]'") from None
    for name in ("distributed", "asyncio"):  # they log tracebacks of what we say in a sentence
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        return Client(address, timeout=timeout)
    except (OSError, ValueError) as problem:
        raise InputError(f"no Dask scheduler answers at {address} within {timeout:g} s ({problem})") from None


def cluster(task: Task, shares: Sequence[range], client: Any) -> Iterator[tuple[range, Columns]]:
    """Yield results of the shares, in the order in which the client's workers finish them.

    The scheduler does the shares of a lost worker again.
    """
    from distributed import wait as finished
    from distributed.comm.core import CommClosedError
    from distributed.scheduler import KilledWorker

    address = client.scheduler.address
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise InputError(
                f"the Dask scheduler at {address} has no worker; start some, `dask worker {address}`, and run the same "
                "command again"
            ) from None
        pending = {client.submit(compute, task, share, pure=False): share for share in shares}
        while pending:
            try:
                done = finished(list(pending), timeout=PATIENCE, return_when="FIRST_COMPLETED").done
                # a result lies with its worker, who may be gone by now
                results = [(future, future.result(timeout=PATIENCE)) for future in done]
            except TimeoutError:
                if client.status == "running" and client.nthreads():
                    continue
                raise InputError(f"the Dask scheduler at {address} has no worker left; {RESUMABLE}") from None
            except KilledWorker as problem:
                raise InputError(f"a share ended every worker that took it ({problem.task}); {RESUMABLE}") from None
            except (CommClosedError, *CANCELLED, OSError):
                raise InputError(f"the Dask scheduler at {address} is gone; {RESUMABLE}") from None
            for future, columns in results:
                yield pending.pop(future), columns
