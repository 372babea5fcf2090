"""Work that ends its process: importable by the workers of a test."""

import os
from pathlib import Path
from signal import SIGKILL
from typing import Any

from gimbalcal.campaign.task import Task, compute_runs


def dies_once(task: Task, runs: range) -> dict[str, list[Any]]:
    """The first worker that gets runs 20 to 29 is killed; the marker is the file that the task is called after."""
    marker = Path(task.name)
    if runs.start == 20 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), SIGKILL)
    return compute_runs(task, runs)


def always_dies(task: Task, runs: range) -> dict[str, list[Any]]:
    """Every worker that gets runs 20 to 29 is killed."""
    if runs.start == 20:
        os.kill(os.getpid(), SIGKILL)
    return compute_runs(task, runs)
