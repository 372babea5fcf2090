"""Wang, Cheng and Fu (2019), Optimized multi-position calibration method with nonlinear scale factor for inertial
measurement units, Sensors 19, 3568: every numbered equation, Tables 2 to 6 and what the text says about them.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType

from derivations.verdict import Printed, Verdict, decide
from derivations.wang2019 import (
    accelerometer,
    experiments,
    frames,
    gyroscope,
    models,
    monte_carlo,
    navigation,
    optimisation,
    package,
    package_navigation,
    package_rows,
    table_4,
)
from derivations.wang2019.symbols import SOURCE

GROUPS = (models, navigation, accelerometer, gyroscope, optimisation, frames)  # in the order of the paper
TABLES = (monte_carlo, table_4, experiments)
COMPARED = (package, package_navigation, package_rows)  # register how far the package is from the derivations


def judge_group(group: ModuleType, printed: Mapping[str, Printed] | None = None) -> tuple[Verdict, ...]:
    """Verdicts of one file; `printed` replaces what the paper prints, item by item."""
    formulas = {**group.PRINTED, **(printed or {})}
    cases = group.cases()
    return tuple(decide(SOURCE, formulas[item], cases[item]) for item in cases)


def verdicts() -> tuple[Verdict, ...]:
    """Everything, in the order of the paper."""
    return (*(v for group in GROUPS for v in judge_group(group)), *(v for table in TABLES for v in table.verdicts()))
