"""Wu, Wu, Han and Zhang (2018), A three-stage accelerometer self-calibration technique for space-stable inertial
navigation systems, Sensors 18, 2888: every numbered equation, Section 3, Tables 1 to 5.
"""

from __future__ import annotations

from functools import partial

from derivations.verdict import Verdict, decide_group
from derivations.wu2018 import (
    attitude_error,
    fine_norm,
    frames,
    package,
    package_estimators,
    package_rows,
    package_static,
    positions,
    sensor,
    separation,
    static_force,
    table1,
    table4,
    table5,
)
from derivations.wu2018.symbols import SOURCE

GROUPS = (frames, sensor, table1, fine_norm, static_force, attitude_error, separation)  # in the order of the paper
COMPARED = (
    package,
    package_rows,
    package_static,
    package_estimators,
)  # register how far the package is from the derivations
judge_group = partial(decide_group, SOURCE)  # verdicts of one file


def verdicts() -> tuple[Verdict, ...]:
    """Return every verdict, in the order of the paper."""
    return (
        *(v for group in GROUPS for v in judge_group(group)),
        *positions.verdicts(),
        *table4.inputs(),
        *table4.verdicts(),
        *table4.sentences(),
        *table5.verdicts(),
    )
