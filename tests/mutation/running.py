"""Runs tests with a mutant in place, in a process of its own, which ends at the first failure."""

import os
import resource
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pytest

from tests.mutation.rewrite import Mutant

SECONDS = 100  # of processor; a mutant that has not ended by then does not end: noticed
NO_JUDGE = "takes_less"  # a test of speed: a busy machine fails it
Tests = tuple[str, ...]  # what pytest is given, the ones that end soonest first


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant."""

    mutant: Mutant
    noticed: bool


def verdicts(wanted: Sequence[tuple[Mutant, Tests]], at_once: int) -> Iterator[Verdict]:
    """Every mutant with the tests that ought to notice it; all of these have to pass without any mutant."""
    for tests in dict.fromkeys(tests for _, tests in wanted):
        if os.waitstatus_to_exitcode(os.waitpid(_started(tests), 0)[1]) != 0:
            raise RuntimeError(f"tests fail without any mutant: {' '.join(tests)}")
    running: dict[int, Mutant] = {}
    for mutant, tests in wanted:
        if len(running) == at_once:
            yield _ended(running)
        sys.stdout.flush()
        running[_started(tests, mutant)] = mutant
    while running:
        yield _ended(running)


def _ended(running: dict[int, Mutant]) -> Verdict:
    pid, status = os.wait()
    return Verdict(running.pop(pid), os.waitstatus_to_exitcode(status) != 0)


def _started(tests: Tests, mutant: Mutant | None = None) -> int:
    """The process id of a copy of this process that runs the tests and exits with 0 where they pass."""
    pid = os.fork()
    if pid:
        return pid
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        if mutant is not None:
            mutant.install()
        code = passes(tests)
    except BaseException:  # noqa: BLE001 - whatever a mutant does, it is noticed
        code = 1
    os._exit(code)


def passes(tests: Tests) -> int:
    """pytest's exit code of the tests, stopped at the first failure."""
    quiet = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:terminalreporter"]
    return int(pytest.main([*quiet, "-k", f"not {NO_JUDGE}", *tests]))
