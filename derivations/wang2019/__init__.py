"""Wang, Cheng and Fu (2019), Optimized multi-position calibration method with nonlinear scale factor for inertial
measurement units, Sensors 19, 3568: every numbered equation, Tables 2 to 6 and what the text says about them.
"""

from __future__ import annotations

from functools import partial

from derivations.verdict import Verdict, decide_group
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
    package_estimators,
    package_rows,
    table_4,
)
from derivations.wang2019.symbols import SOURCE

GROUPS = (models, navigation, accelerometer, gyroscope, optimisation, frames)  # in the order of the paper
TABLES = (monte_carlo, table_4, experiments)
COMPARED = (package, package_rows, package_estimators)  # register how far the package is from the derivations
judge_group = partial(decide_group, SOURCE)  # verdicts of one file


def verdicts() -> tuple[Verdict, ...]:
    """Return every verdict, in the order of the paper."""
    return (*(v for group in GROUPS for v in judge_group(group)), *(v for table in TABLES for v in table.verdicts()))
