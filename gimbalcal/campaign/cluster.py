"""Shares on an existing Dask cluster, by its address. The extra `gimbalcal[cluster]` brings the client."""

from __future__ import annotations

import asyncio
import concurrent.futures
import logging
from collections.abc import Iterator, Sequence
from typing import Any

from gimbalcal.campaign.task import Task, compute
from gimbalcal.errors import InputError

CANCELLED = (asyncio.CancelledError, concurrent.futures.CancelledError)
PATIENCE = 10.0  # s without a share that is done before it is asked whether anybody works
RESUMABLE = "finished runs are kept, and the same command continues from there"


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


def cluster(task: Task, shares: Sequence[range], client: Any) -> Iterator[tuple[range, dict[str, list[Any]]]]:
    """Yield results of the shares, in the order in which the client's workers finish them.

    The scheduler does the shares of a lost worker again.
    """
    from distributed import wait
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
                done = wait(list(pending), timeout=PATIENCE, return_when="FIRST_COMPLETED").done
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
