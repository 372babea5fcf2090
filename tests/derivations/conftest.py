"""All derivations once for the tests of this folder."""

from __future__ import annotations

import pytest

from derivations import wu2018


@pytest.fixture(scope="session")
def wu2018_verdicts():
    return {v.item: v for v in wu2018.verdicts()}
