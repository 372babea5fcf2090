"""Content of navigation.json, and its sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.earth import HOUR
from gimbalcal.navigate.navigation_errors import CHANNELS, NAUTICAL_MILE, NONE, Navigated
from gimbalcal.navigate.space_stable_navigator import Aids
from gimbalcal.units import from_si


def content(runs: Sequence[Navigated], aids: Aids, provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of navigation.json; the others are compared with the first run.

    Errors are navigator minus true. `improvement_percent` is that of the largest error over the first run's, null for
    the first; `sigma_linear` and `sigma_sampled` are the largest one sigma that the calibration's covariance leaves.
    """
    first = runs[0]
    return {
        "format": 1,
        "hours": float(first.time[-1] / HOUR),
        "mechanisation": first.mechanisation,
        "damping": aids.damping,
        "alignment_s": aids.alignment,
        "channels": [
            _channel(run, first, i)
            for run in runs
            for i in range(len(CHANNELS))
            if np.all(np.isfinite(run.error[:, i]))
        ],
        "position": [
            {
                "calibration": run.label,
                "max_nmi": float(run.position.max() / NAUTICAL_MILE),
                "rms_nmi": float(np.sqrt(np.mean(run.position**2)) / NAUTICAL_MILE),
                "end_nmi": float(run.position[-1] / NAUTICAL_MILE),
                "improvement_percent": _improvement(first.position.max(), run.position.max(), run, first),
            }
            for run in runs
        ],
        "in_words": in_words(runs),
        "provenance": dict(provenance),
    }


def _channel(run: Navigated, first: Navigated, i: int) -> dict[str, Any]:
    name, unit = CHANNELS[i]

    def printed(x: float) -> float:
        return float(from_si(float(x), unit))

    return {
        "name": name,
        "unit": unit,
        "calibration": run.label,
        "max": printed(run.largest[i]),
        "rms": printed(run.rms[i]),
        "improvement_percent": _improvement(first.largest[i], run.largest[i], run, first),
        "drift_per_day": printed(run.drift_per_day[i]),
        "sigma_linear": None if run.linear is None else printed(run.linear[:, i].max()),
        "sigma_sampled": None if run.sampled is None else printed(run.sampled[:, i].max()),
    }


def _improvement(before: float, after: float, run: Navigated, first: Navigated) -> float | None:
    return None if run is first or before == 0 else float(100 * (1 - after / before))


def in_words(runs: Sequence[Navigated]) -> str:
    """Return one sentence with the largest position error of each run."""
    hours = runs[0].time[-1] / HOUR

    def position_error(run: Navigated) -> str:
        after = "without calibration" if run.label == NONE else f"with {run.label}"
        return f"{run.position.max() / NAUTICAL_MILE:.3g} n mile {after}"

    *most, last = map(position_error, runs)
    both = f"{', '.join(most)} and {last}" if most else last
    return f"in {hours:.3g} h the position is wrong by at most {both}"
