"""One term changed in every equation of the estimators: do their tests notice?

Each mutant runs the tests of its module in a process of its own, which ends at the first failure.
"""

from __future__ import annotations

import os
import resource
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module

import pytest

from tests.mutation.rewrite import Mutant, mutants

ROOM = "gimbalcal."
HOME = "tests/estimate/"
TESTS: Mapping[str, tuple[str, ...]] = {  # of each module, the ones that end soonest first
    "estimate.accelerometers.coarse": ("accelerometers/test_terms.py", "accelerometers/test_coarse.py"),
    "estimate.accelerometers.fine": ("accelerometers/test_terms.py", "accelerometers/test_fine.py"),
    "estimate.accelerometers.joint": ("accelerometers/test_joint.py",),
    "estimate.accelerometers.setting": (
        "accelerometers/test_terms.py", "accelerometers/test_setting.py", "accelerometers/test_joint.py",
    ),
    "estimate.static_run.force_filter": ("static_run/test_terms.py", "static_run/test_force_filter.py"),
    "estimate.static_run.run": ("static_run/test_terms.py", "static_run/test_system.py"),
    "estimate.static_run.combined": ("static_run/test_combined.py",),
    "estimate.static_run.system": ("static_run/test_terms.py", "static_run/test_system.py"),
    "readings": ("static_run/test_terms.py", "static_run/test_system.py"),
}  # fmt: skip
SECONDS = 100  # of processor; a mutant that has not ended by then does not end: noticed
NO_JUDGE = "takes_less"  # a test of speed: a busy machine fails it


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant."""

    mutant: Mutant
    noticed: bool


def verdicts(modules: list[str], per_statement: int = 1, workers: int = os.cpu_count() or 1) -> Iterator[Verdict]:
    """Every mutant of the modules, as many at a time as there are cores."""
    for module in modules:
        import_module(ROOM + module)
    for module, pid in [(module, _started(module)) for module in modules]:
        if os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) != 0:
            raise RuntimeError(f"the tests of {module} fail without any mutant: {' '.join(TESTS[module])}")
    running: dict[int, Mutant] = {}
    for mutant in (m for module in modules for m in mutants(ROOM + module, per_statement)):
        if len(running) == workers:
            yield _ended(running)
        sys.stdout.flush()
        running[_started(mutant.module.removeprefix(ROOM), mutant)] = mutant
    while running:
        yield _ended(running)


def _ended(running: dict[int, Mutant]) -> Verdict:
    pid, status = os.wait()
    return Verdict(running.pop(pid), os.waitstatus_to_exitcode(status) != 0)


def _started(module: str, mutant: Mutant | None = None) -> int:
    """The process id of a copy of this process that runs the module's tests and exits with 0 where they pass."""
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
        code = passes(module)
    except BaseException:  # noqa: BLE001 - whatever a mutant does, it is noticed
        code = 1
    os._exit(code)


def passes(module: str) -> int:
    """pytest's exit code of the module's tests, stopped at the first failure."""
    paths = [HOME + path for path in TESTS[module]]
    quiet = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:terminalreporter"]
    return int(pytest.main([*quiet, "-k", f"not {NO_JUDGE}", *paths]))
