"""Simulated units of one fleet as recording folders: sizes drawn about a mean that the units share."""

import tomllib
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.effects import Effect, parameters, values
from gimbalcal.recording import Recording, write
from gimbalcal.simulate import simulate
from gimbalcal.simulate.scenario import find

SPREAD = 0.1  # of a parameter from unit to unit, in sigmas of the catalogue
START = date(2026, 1, 5)


def scenario(dwell_min: float = 1.0) -> dict[str, Any]:
    """The 18 positions with short dwells, and parameters drawn with the spread of the fleet."""
    content = tomllib.loads(find("wu2018-18").read_text())
    content["truth"] = {"draw": True, "factor": SPREAD}
    content["schedule"]["dwell"] = {"value": dwell_min, "unit": "min"}
    return content


def unit(k: int, positions: int = 18, dwell_min: float = 1.0, **extra: Any) -> tuple[Recording, tuple[Effect, ...]]:
    """The first positions of unit k, recorded on a day of its own, and its true effects; extra: further truth."""
    content = scenario(dwell_min)
    content["truth"] |= extra
    recording, effects = simulate(content, 7000 + k)
    few = recording.select(np.isin(recording.position, range(1, positions + 1)))
    return replace(few, title=f"unit {k:03d}", date=(START + timedelta(days=3 * k)).isoformat()), tuple(effects)


def write_units(folder: Path, count: int, positions: int = 18, first: int = 0) -> None:
    """Write units as recordings rig-000, rig-001, ... into a folder."""
    for k in range(first, first + count):
        write(unit(k, positions)[0], folder / f"rig-{k:03d}")


def truth_of(effects: tuple[Effect, ...], labels: list[str]) -> np.ndarray:
    """True values (p,) of parameters by label, SI."""
    wanted = [p for e in effects for p in parameters(type(e), ("platform", "inner", "middle"))]
    known = dict(zip([p.label for p in wanted], values(effects, wanted), strict=True))
    return np.array([known.get(label, 0.0) for label in labels])
