"""A kill at any time leaves results of one run, and nothing after the next; `tests.fuzzing.kills` makes hundreds."""

import subprocess
import sys

from tests.paths import ROOT


def test_twenty_kills_tear_nothing_and_leave_nothing():
    """In a process of its own, which forks."""
    run = subprocess.run(
        [sys.executable, "-m", "tests.fuzzing.kills", "-n", "20", "calibrate", "new", "apply", "calibrate --store"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.startswith("20 kills")
