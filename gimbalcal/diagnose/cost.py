"""What a cause costs if it is left out: position error of a navigator whose calibration holds it, and of one without.

A cause is weighed by its consequence and not by its sigmas. The recordings are calibrated twice more, with everything
that was found and with everything but this cause, so that the other coefficients take up of it what they can, as they
would in a calibration that does not know it. Where a static run was diagnosed, it is navigated; of positions alone, a
still base of 24 h is, whose sensors err as was found while temperature and other logged channels swing once through the
range that they were recorded in. Where no navigator can be run, nothing is said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.design.budget import still_base
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.earth import SOLAR_DAY
from gimbalcal.effects import CATALOGUE, Effect
from gimbalcal.effects.effect import constants, follows, lacking
from gimbalcal.errors import InputError
from gimbalcal.estimate.added import Added
from gimbalcal.navigate.outcome import NAUTICAL_MILE, Navigated
from gimbalcal.navigate.run import navigated
from gimbalcal.pipeline import Tell, silent, three_stage
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Recording

DAY = 24.0  # h that a still base is navigated
NOTICEABLE = 1.1  # of the error that is there with the cause in the calibration


def with_cost(recordings: Sequence[Recording], d: Diagnosis, tell: Tell = silent) -> Diagnosis:
    """The diagnosis with `cost` in each finding: {hours, with_nmi, without_nmi, in_words}, where it can be told."""
    fixes = any(r.kind in ("static-run", "multi-position") and r.site.latitude is not None for r in recordings)
    if not d.findings or d.calibration is None or not fixes or recordings[0].platform.name != SPACE_STABLE.name:
        return d
    named = list(dict.fromkeys(f["effect"] for f in d.findings))
    found = {e.id: e for e in d.calibration.effects if e.id in named}
    try:
        tell("navigating with and without what was found")
        whole = _calibrated(recordings, found, "")
        out = [_told(f, recordings, whole, found) for f in d.findings]
    except InputError:  # two runs of a kind, no readouts, no latitude: no calibration or no navigator
        return d
    return replace(d, findings=tuple(out))


def _calibrated(recordings: Sequence[Recording], found: Mapping[str, Effect], without: str) -> Calibration:
    """The recordings calibrated with all that was found but one cause, at the constants that were found."""
    return three_stage(recordings, more=[_as_found(e) for e in found.values() if e.id != without])


def _as_found(e: Effect) -> Added:
    stated = tuple((f.name, float(getattr(e, f.name))) for f in constants(type(e)))
    return Added(e.id, (), stated, str(getattr(e, "covariate", "")) if follows(type(e)) == "" else "")


def _told(
    finding: Mapping[str, Any], recordings: Sequence[Recording], whole: Calibration, found: Mapping[str, Effect]
) -> Mapping[str, Any]:
    effect = finding["effect"]
    run = _run(recordings, whole, effect)
    if effect not in found or run is None:
        return finding
    known, left_out = (navigated(run, c) for c in (whole, _calibrated(recordings, found, effect)))
    miles = [_miles(n) for n in (known, left_out)]
    hours = float(known.time[-1] / 3600)
    cost = {"hours": hours, "with_nmi": miles[0], "without_nmi": miles[1], "in_words": in_words(hours, *miles)}
    return {**finding, "cost": cost}


def in_words(hours: float, known: float, left_out: float) -> str:
    """One line of a report; below a tenth of what is there anyway it is nothing.

    >>> in_words(72.0, 0.021, 1.34)
    'left out, it costs 1.34 n mile of position in 72 h; with it in the calibration the error is 0.021 n mile'
    """
    if left_out < NOTICEABLE * known:
        return f"left out, it costs nothing of position: {known:.2g} n mile in {hours:.3g} h with it or without"
    return (
        f"left out, it costs {left_out:.3g} n mile of position in {hours:.3g} h; with it in the calibration the error "
        f"is {known:.2g} n mile"
    )


def _miles(n: Navigated) -> float:
    return float(n.position.max() / NAUTICAL_MILE)


def _run(recordings: Sequence[Recording], whole: Calibration, effect: str) -> Recording | None:
    """What is navigated: the static run that was diagnosed, or a still base whose sensors err as was found."""
    own = next((r for r in recordings if r.kind == "static-run"), None)
    if own is not None:
        return own
    (device,) = (r for r in recordings if r.site.latitude is not None)
    base = still_base(DAY, device.site)
    turn = np.sin(2 * np.pi * base.time / SOLAR_DAY)
    around = {k: v for k, v in device.channels.items() if k[0] in ("temperature", "covariate")}
    swung = {k: (v.max() + v.min()) / 2 + (v.max() - v.min()) / 2 * turn for k, v in around.items()}
    base = replace(base, channels=dict(base.channels) | swung)
    there = [e for e in whole.effects if "static-run" in e.kinds and not lacking(type(e), base.has)]
    if effect not in {e.id for e in there} and "static-run" in CATALOGUE[effect].kinds:
        return None  # it follows a channel that the still base does not have
    return replace(whole, effects=tuple(there)).corrupt(base)
