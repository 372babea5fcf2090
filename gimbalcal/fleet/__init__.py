"""Calibrate and diagnose the recordings of many units, each by itself, and show how the units differ.

    summary = run_batch(["rigs/*"], Path("units.sqlite"), Path("fleet"))

Results are kept in the store of units as they come, so that a batch that was stopped continues where it was. Recordings
are independent of each other: neither the number of workers nor an interruption changes a digit, and one that fails is
listed with the sentence that says why.
"""

from gimbalcal.fleet.batch import run_batch

__all__ = ["run_batch"]
