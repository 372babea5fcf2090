"""A recording from truth: scenario in, recording and true effects out.

    recording, truth = simulate("wu2018-18", seed=1)     # a scenario that ships with the package, or a file
    simulate_to("my.toml", "out/run-1")                  # into a folder, with truth.json

Format of a scenario: docs/scenarios.md and the files in gimbalcal/scenarios.
"""

import sys

from gimbalcal import CalledPackage
from gimbalcal.simulate.folder import simulate_to
from gimbalcal.simulate.scenario import Scenario, check_content, load
from gimbalcal.simulate.simulation import prepare, simulate

__all__ = ["Scenario", "check_content", "load", "prepare", "simulate", "simulate_to"]

sys.modules[__name__].__class__ = CalledPackage
