"""Workers that compute items: this process, processes on this machine, or an existing Dask cluster.

An item is a share of the runs of a campaign, or a recording of a fleet. A worker that dies takes its items with it;
they are computed again. An item that ends its worker `DEATHS` times is `lost`, a function of the item and of how often
it did so in words, which returns a result in its place or raises. The extra `gimbalcal[cluster]` installs the client.
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
from time import monotonic
from typing import Any, TypeVar

from gimbalcal.errors import InputError, number_of
from gimbalcal.memory_reuse import reuse_freed_memory

Item = TypeVar("Item")
Result = TypeVar("Result")
MAX_WORKERS = 1000
DEATHS = 3  # workers that an item may end before it is lost
CANCELLED = (asyncio.CancelledError, concurrent.futures.CancelledError)
PATIENCE = 10.0  # s without a result, after which it is checked whether any worker is left
RESUMABLE = "finished runs are kept, and the same command continues from there"


def number_of_workers(requested: int | None) -> int:
    """Return how many processes to use, by default one for each core. Raises InputError for an impossible number."""
    workers = len(os.sched_getaffinity(0)) if requested is None else requested
    if workers < 1:
        raise InputError(f"--workers must be at least 1, got {workers}")
    if workers > MAX_WORKERS:
        raise InputError(f"--workers {workers}: more than {MAX_WORKERS} processes no machine has room for")
    return workers


def compute_items(
    work: Callable[[Item], Result], items: Sequence[Item], lost: Callable[[Item, str], Result], workers: int,
    client: Any,
) -> Iterator[tuple[Item, Result]]:  # fmt: skip
    """Yield each item with its result, as they are finished, by a Dask client or by processes of this machine."""
    if client is not None:
        return compute_on_cluster(work, items, client, lost)
    if workers == 1 or len(items) < 2:
        return compute_in_process(work, items)
    return compute_in_processes(work, items, min(workers, len(items)), lost)


class TimeLeft:
    """The time that remains, from the time that items took since this was made."""

    def __init__(self, total: int, done: int) -> None:
        self.total, self.done, self.fresh, self.start = total, done, 0, monotonic()

    def after(self, items: int, noun: str) -> str:
        """Return in words how much is done, and the time left, after so many further items."""
        self.fresh += items
        seconds = (self.total - self.done - self.fresh) * (monotonic() - self.start) / self.fresh
        return f"{self.done + self.fresh} of {number_of(self.total, noun)}, {_hours_minutes_seconds(seconds)} left"


def _hours_minutes_seconds(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"


def compute_in_process(work: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[tuple[Item, Result]]:
    """Yield results of the items, computed one after the other in this process."""
    for item in items:
        yield item, work(item)


def compute_in_processes(
    work: Callable[[Item], Result], items: Sequence[Item], workers: int, lost: Callable[[Item, str], Result]
) -> Iterator[tuple[Item, Result]]:
    """Yield results of the items, in the order in which `workers` processes finish them."""
    pending = list(items)
    while pending:
        try:
            for item, result in _compute_in_pool(work, pending, workers):
                pending.remove(item)
                yield item, result
        except BrokenProcessPool:
            for item in pending[:workers]:  # `compute_in_pool` keeps no more of them in the pool
                yield item, _compute_alone(work, item, lost)
            pending = pending[workers:]


def _compute_alone(work: Callable[[Item], Result], item: Item, lost: Callable[[Item, str], Result]) -> Result:
    """Return the result of an item in a process of its own, which no other item can end."""
    for _ in range(DEATHS):
        try:
            return next(_compute_in_pool(work, [item], 1))[1]
        except BrokenProcessPool:
            continue
    return lost(item, f"{DEATHS} times")


def _compute_in_pool(
    work: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Iterator[tuple[Item, Result]]:
    # a fork server starts clean processes: no copied locks of BLAS or Arrow threads; Ctrl-C is the parent's to answer
    pool = ProcessPoolExecutor(workers, get_context("forkserver"), _begin_worker)
    try:
        yield from _run(pool, work, items, workers)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent of a worker, and end the worker with it and with the server that forked it."""
    reuse_freed_memory()
    signal(SIGINT, SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getppid(), SIGTERM)
        os._exit(1)


def _run(
    pool: ProcessPoolExecutor, work: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Iterator[tuple[Item, Result]]:
    waiting = list(items)
    running: dict[Future[Result], Item] = {}
    while waiting or running:
        while waiting and len(running) < workers:
            item = waiting.pop(0)
            running[pool.submit(work, item)] = item
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            yield running.pop(future), future.result()


def connect(address: str, timeout: float = 10.0) -> Any:
    """Return a client of the scheduler at tcp://host:port. Raises InputError where Dask is missing here or there."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--scheduler needs Dask: pip install 'gimbalcal[cluster]'") from None
    for name in ("distributed", "distributed.client", "asyncio"):  # they log tracebacks of what we say in a sentence
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        return Client(address, timeout=timeout)
    except (OSError, ValueError) as problem:
        raise InputError(f"no Dask scheduler answers at {address} within {timeout:g} s ({problem})") from None


def compute_on_cluster(
    work: Callable[[Item], Result], items: Sequence[Item], client: Any, lost: Callable[[Item, str], Result]
) -> Iterator[tuple[Item, Result]]:
    """Yield results of the items, in the order in which the client's workers finish them.

    The scheduler does the items of a lost worker again.
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
        pending = {client.submit(work, item, pure=False): item for item in items}
        while pending:
            results = []
            try:
                for future in finished(list(pending), timeout=PATIENCE, return_when="FIRST_COMPLETED").done:
                    try:  # a result lies with its worker, who may be gone by now
                        results.append((future, future.result(timeout=PATIENCE)))
                    except KilledWorker:
                        results.append((future, lost(pending[future], "every time")))
            except TimeoutError:
                if not results and not (client.status == "running" and client.nthreads()):
                    raise InputError(f"the Dask scheduler at {address} has no worker left; {RESUMABLE}") from None
            except (CommClosedError, *CANCELLED, OSError):
                raise InputError(f"the Dask scheduler at {address} is gone; {RESUMABLE}") from None
            for future, result in results:
                yield pending.pop(future), result
