"""Work that ends its process: importable by the workers of a test."""

import os
from signal import SIGKILL

from gimbalcal.fleet.unit_recording import BatchTask, UnitRecording, entries_of
from gimbalcal.history import StoredResult


def dies_with_the_second(task: BatchTask, recording: UnitRecording) -> tuple[StoredResult, ...]:
    """Every worker that gets rig-001 is killed."""
    if recording.unit == "rig-001":
        os.kill(os.getpid(), SIGKILL)
    return entries_of(task, recording)
