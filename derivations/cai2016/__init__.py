"""Cai, Yang, Song and Liu (2016), Self-calibration method based on a 51-state filter for ultra-high accuracy inertial
measurement units, Sensors 16, 940: every numbered equation, Tables 1 to 3 and what the text says of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType

from derivations.cai2016 import (
    error_model,
    experiments,
    package,
    package_filter,
    sensors,
    smoother,
    state_matrix,
    table_1,
)
from derivations.cai2016.symbols import SOURCE
from derivations.verdict import Printed, Verdict, decide

GROUPS = (sensors, smoother, error_model, state_matrix)  # in the order of the paper
TABLES = (table_1, experiments)
COMPARED = (package, package_filter)  # register how far the package is from the derivations


def judge_group(group: ModuleType, printed: Mapping[str, Printed] | None = None) -> tuple[Verdict, ...]:
    """Verdicts of one file; `printed` replaces what the paper prints, item by item."""
    formulas = {**group.PRINTED, **(printed or {})}
    cases = group.cases()
    return tuple(decide(SOURCE, formulas[item], cases[item]) for item in cases)


def verdicts() -> tuple[Verdict, ...]:
    """Everything, in the order of the paper."""
    return (*(v for group in GROUPS for v in judge_group(group)), *(v for table in TABLES for v in table.verdicts()))
