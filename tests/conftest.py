"""What tests of every folder share."""

import gc
import sys

import pytest

from gimbalcal import cli
from gimbalcal.effects import CATALOGUE, loading
from tests.golden import Golden, Messages

MESSAGES = pytest.StashKey[Messages]()


def pytest_addoption(parser):
    parser.addoption("--regenerate-golden", action="store_true", help="write tests/golden anew instead of comparing")


def pytest_configure(config):
    config.stash[MESSAGES] = Messages(bool(config.getoption("--regenerate-golden")))


def pytest_collection_finish():
    """Exempt modules and collected tests from garbage collection, which would pass over them again and again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Say whose section of the golden files `golden_text` and `refused` compare with."""
    with item.config.stash[MESSAGES].of_test(item):
        return (yield)


@pytest.fixture(scope="session")
def golden(request):
    """Compares text with a golden file, or writes it: see tests/golden/__init__.py."""
    return Golden(bool(request.config.getoption("--regenerate-golden")))


@pytest.fixture
def command(monkeypatch, tmp_path_factory):
    """Runs the command line in this process with these arguments, in a folder of its own; returns its exit status."""
    monkeypatch.chdir(tmp_path_factory.mktemp("here"))  # where results go that no --out is given for

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["gimbalcal", *map(str, arguments)])
        monkeypatch.setattr(sys.modules["__main__"], "__package__", None)  # else click names `python -m pytest`
        try:
            cli.main()
        except SystemExit as stop:
            return int(stop.code or 0)
        return 0

    return run


@pytest.fixture
def own_catalogue(monkeypatch):
    """Nothing that a test loads stays in the catalogue, and nothing that it takes out is lost."""
    before = dict(CATALOGUE)
    for loaded in ("_loaded", "_installed"):
        monkeypatch.setattr(loading, loaded, {})
    yield
    for i in set(CATALOGUE) - set(before):
        del CATALOGUE[i]
    CATALOGUE.update(before)
