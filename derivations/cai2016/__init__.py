"""Cai, Yang, Song and Liu (2016), Self-calibration method based on a 51-state filter for ultra-high accuracy inertial
measurement units, Sensors 16, 940: every numbered equation, Tables 1 to 3 and what the text says of them.
"""

from __future__ import annotations

from functools import partial

from derivations.cai2016 import (
    bound,
    error_model,
    experiments,
    package,
    package_filter,
    package_passes,
    sensors,
    smoother,
    state_matrix,
    table_1,
)
from derivations.cai2016.symbols import SOURCE
from derivations.verdict import Verdict, decide_group

GROUPS = (sensors, smoother, error_model, state_matrix)  # in the order of the paper
TABLES = (table_1, experiments)
COMPARED = (package, package_filter, package_passes)  # register how far the package is from the derivations
judge_group = partial(decide_group, SOURCE)  # verdicts of one file


def verdicts() -> tuple[Verdict, ...]:
    """Return every verdict, in the order of the paper."""
    equations = (v for group in GROUPS for v in judge_group(group))
    return (
        *equations,
        smoother.judge_constants(),
        bound.judge_rank(),
        *(v for table in TABLES for v in table.verdicts()),
    )
