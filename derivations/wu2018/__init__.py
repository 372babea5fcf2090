"""Wu, Wu, Han and Zhang (2018), A three-stage accelerometer self-calibration technique for space-stable inertial
navigation systems, Sensors 18, 2888: every numbered equation, Table 1 and Table 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType

from derivations.verdict import Printed, Verdict, decide

SOURCE = "001"


def groups() -> tuple[ModuleType, ...]:
    """The files with printed formulas and their derivations, in the order of the paper."""
    from derivations.wu2018 import attitude_error, fine_norm, frames, sensor, separation, static_force, table1

    return (frames, sensor, table1, fine_norm, static_force, attitude_error, separation)


def judge_group(group: ModuleType, printed: Mapping[str, Printed] | None = None) -> tuple[Verdict, ...]:
    """Verdicts of one file; `printed` replaces what the paper prints, item by item."""
    formulas = {**group.PRINTED, **(printed or {})}
    cases = group.cases()
    return tuple(decide(SOURCE, formulas[item], cases[item]) for item in cases)


def verdicts() -> tuple[Verdict, ...]:
    """Everything, in the order of the paper."""
    from derivations.wu2018 import table4

    return (*(v for group in groups() for v in judge_group(group)), *table4.verdicts())
