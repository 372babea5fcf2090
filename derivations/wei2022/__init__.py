"""Wei, Zha, He and Li (2022), An improved system-level calibration scheme for rotational inertial navigation systems,
Sensors 22, 7610: every numbered equation, Tables 1 to 4 and what the text says of them.
"""

from __future__ import annotations

from functools import partial

from derivations.verdict import Verdict, decide_group
from derivations.wei2022 import bound, kalman, package, package_navigation, sensors, static_run, table_1, tables
from derivations.wei2022.symbols import SOURCE

GROUPS = (sensors, kalman)  # in the order of the paper
COMPARED = (package, package_navigation)  # register how far the package is from the derivations
judge_group = partial(decide_group, SOURCE)  # verdicts of one file


def verdicts() -> tuple[Verdict, ...]:
    """Return every verdict, in the order of the paper."""
    equations = (v for group in GROUPS for v in judge_group(group))
    return (*equations, *table_1.verdicts(), *bound.verdicts(), *tables.verdicts(), *static_run.verdicts())
