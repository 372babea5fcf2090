"""Commands without --out write where they are run: in a folder of the test's own."""

import pytest


@pytest.fixture(autouse=True)
def elsewhere(monkeypatch, tmp_path_factory):
    """Each test stands in a new empty folder."""
    monkeypatch.chdir(tmp_path_factory.mktemp("here"))
