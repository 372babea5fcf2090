"""All derivations once for the tests of this folder."""

from __future__ import annotations

import pytest

from derivations import wu2018


@pytest.fixture(scope="session")
def wu2018_list():
    return wu2018.verdicts()


@pytest.fixture(scope="session")
def wu2018_verdicts(wu2018_list):
    return {v.item: v for v in wu2018_list}
