"""All derivations once for the tests of this folder, whatever the number of test processes."""

from __future__ import annotations

import fcntl
import os
import pickle

import pytest

from derivations import wu2018


@pytest.fixture(scope="session")
def wu2018_list(tmp_path_factory):
    """Every verdict; under pytest-xdist the first process to ask derives, the others wait and read its result."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return wu2018.verdicts()
    shared = tmp_path_factory.getbasetemp().parent / "wu2018.pickle"  # this parent belongs to one test session
    with shared.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not shared.exists():
            shared.write_bytes(pickle.dumps(wu2018.verdicts()))
        return pickle.loads(shared.read_bytes())


@pytest.fixture(scope="session")
def wu2018_verdicts(wu2018_list):
    return {v.item: v for v in wu2018_list}
