"""Shares on an existing Dask cluster, by its address. The extra `gimbalcal[cluster]` brings the client."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from gimbalcal.campaign.task import Task, compute
from gimbalcal.errors import InputError


def connect(address: str, timeout: float = 10.0) -> Any:
    """A client of the scheduler at tcp://host:port. Raises InputError when there is no Dask here or none there."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--scheduler needs Dask: pip install 'gimbalcal[cluster]'") from None
    try:
        return Client(address, timeout=timeout)
    except (OSError, ValueError) as problem:
        raise InputError(f"no Dask scheduler answers at {address} within {timeout:g} s ({problem})") from None


def cluster(task: Task, shares: Sequence[range], client: Any) -> Iterator[tuple[range, dict[str, list[Any]]]]:
    """Results of the shares, in the order in which the client's workers finish them.

    The scheduler does the shares of a lost worker again.
    """
    from distributed import as_completed

    with client:
        futures = {client.submit(compute, task, share, pure=False): share for share in shares}
        for future in as_completed(list(futures)):
            yield futures[future], future.result()
