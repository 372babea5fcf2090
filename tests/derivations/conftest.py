"""All derivations once for the tests of this folder, and what is asked of those of every paper."""

import fcntl
import os
import pickle
import re
from dataclasses import replace

import pytest

from derivations import wu2018
from derivations.verdict import AGREES, MISPRINT, VERDICTS, WRONG, judge


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
    return by_item(wu2018_list)


def by_item(listed):
    """Verdicts by item; of every paper each is one of five and says why, and the package follows the derivation."""
    for v in listed:
        assert v.verdict in VERDICTS
        assert v.printed, v.item
        assert v.derived, v.item
        assert len(v.why) > 10, v.item
        assert not re.search(r"\{\w+\}", v.why), v.item
        assert (v.size == "0") == (v.verdict == AGREES), v.item
        assert v.package is None or v.package.same, v
    found = {v.item: v for v in listed}
    assert len(found) == len(listed)
    return found


@pytest.fixture(scope="module")
def listed(request):
    """Every verdict on the `PAPER` of a module of tests."""
    return request.module.PAPER.verdicts()


@pytest.fixture(scope="module")
def found(listed):
    """The same by item."""
    return by_item(listed)


@pytest.fixture(scope="session")
def slipped():
    """Whether a slip in a printed equation is seen: group, item, and what stands for what."""

    def seen(group, item, old, new):
        printed = group.PRINTED[item]
        changed = replace(printed, formula=printed.formula.subs(old, new))
        return judge(changed, group.cases()[item])[0] in (MISPRINT, WRONG)

    return seen
