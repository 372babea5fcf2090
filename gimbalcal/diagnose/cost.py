"""What a cause costs if it is left out: position error of a navigator whose calibration holds it, and of one without.

A cause is weighed by its consequence and not by its sigmas. The calibration without it is the refit of the diagnosis by
a model that lacks this cause alone, so that the other coefficients take up of it what they can. Where a static run was
diagnosed, it is navigated. Of positions and of a unit that was turned in its place, a still base of 24 h is, whose
sensors err as was found while temperature and other logged channels swing once through the range that they were
recorded in; with the cause in the calibration there is left what its covariance says. Where no navigator can be run,
nothing is said.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.result import Cost
from gimbalcal.earth import NAUTICAL_MILE, SOLAR_DAY
from gimbalcal.effects import CATALOGUE, Effect
from gimbalcal.effects.effect import lacking_quantity
from gimbalcal.errors import InputError
from gimbalcal.navigate.stationary_base import ROW, still_base, still_unit
from gimbalcal.navigate.uncertainty import navigation_errors, position_uncertainty, usual_references
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.progress import Progress, no_progress
from gimbalcal.recording import Recording
from gimbalcal.recording.record import FOLLOWED
from gimbalcal.schedule.commands import standing_attitude
from gimbalcal.views.segments import turned_in_place
from gimbalcal.words.diagnosis_sentences import cost_in_words

DAY = 24.0  # h that a still base is navigated
EAST_NORTH_UP = standing_attitude(("east", "north", "up"))  # how a unit stands on it


@dataclass(frozen=True)
class _Unit:
    """Effects that were found, the calibration with all and without one of them, and the base that it navigates on."""

    effects: Mapping[str, Effect]
    whole: Calibration
    without: Callable[[str], Calibration]
    base: Recording
    measured: bool  # whether the base is a recording of its own, or made up


def with_cost(recordings: Sequence[Recording], d: Diagnosis, progress: Progress = no_progress) -> Diagnosis:
    """The diagnosis with `cost` in each finding, where it can be computed: {hours, with_nmi, without_nmi, in_words}.

    Largest errors of position, in n miles; where the run is one of the recordings, `uncalibrated_nmi` beside them, that
    without any calibration; where it is made up, `with_nmi` is the one sigma that the calibration leaves open.
    """
    unit = _navigating_unit(recordings, d) if d.findings else None
    if unit is None:
        return d
    try:
        progress("navigating with and without what was found")
        costs = _cost_of_effects(unit)
    except InputError:  # no readouts, no latitude: no navigator
        return d
    return replace(d, findings=tuple(replace(f, cost=costs.get(f.effect)) for f in d.findings))


def _navigating_unit(recordings: Sequence[Recording], d: Diagnosis) -> _Unit | None:
    """Return the unit of these recordings and what it navigates on; None where no navigator can be run."""
    first, calibration = recordings[0], d.calibration
    if calibration is None or d.without is None:
        return None
    effects = {e.id: e for e in calibration.effects if e.id in {f.effect for f in d.findings}}
    if len(recordings) == 1 and turned_in_place(first):
        base = _with_daily_swing(still_unit(DAY + ROW / 3600, first.site, EAST_NORTH_UP), recordings)
        return _Unit(effects, calibration, d.without, base, False)
    located = [r for r in recordings if r.kind.at_rest and r.site.latitude is not None]
    runs = [r for r in recordings if r.kind.stabilised]
    if not located or first.platform.name != SPACE_STABLE.name or len(runs) > 1:
        return None
    base = runs[0] if runs else _with_daily_swing(still_base(DAY, located[0].site), recordings)
    return _Unit(effects, calibration, d.without, base, bool(runs))


def _cost_of_effects(unit: _Unit) -> Mapping[str, Cost]:
    """The cost of each effect that was found and that the run shows; what all of them leave is navigated once."""
    run, shown = _navigated_run(unit)
    if not shown:
        return {}
    aids = usual_references(run)
    raw = None
    if unit.measured:
        known, raw = (float(navigation_errors(run, c, aids).position.max()) / NAUTICAL_MILE for c in (unit.whole, None))
    else:
        known = position_uncertainty(run, unit.whole, aids) / NAUTICAL_MILE
    out: dict[str, Cost] = {}
    for effect in shown:
        without = navigation_errors(run, unit.without(effect), aids)
        hours, left_out = float(without.time[-1] / 3600), float(without.position.max() / NAUTICAL_MILE)
        out[effect] = Cost(hours, known, left_out, cost_in_words(hours, known, left_out, raw), raw)
    return out


def _with_daily_swing(base: Recording, recordings: Sequence[Recording]) -> Recording:
    """The base with temperature and other logged channels going once a day through the range they were recorded in."""
    turn = np.sin(2 * np.pi * base.time / SOLAR_DAY)
    around = {k: v for r in recordings for k, v in r.channels.items() if k[0] in FOLLOWED}
    swung = {k: (v.max() + v.min()) / 2 + (v.max() - v.min()) / 2 * turn for k, v in around.items()}
    return replace(base, channels=dict(base.channels) | swung)


def _navigated_run(unit: _Unit) -> tuple[Recording, tuple[str, ...]]:
    """Return what is navigated, and the effects whose cost it shows: none that follow a channel which it lacks.

    It is the static run that was diagnosed, or a still base whose sensors err as was found.
    """
    if unit.measured:
        return unit.base, tuple(unit.effects)
    kind = unit.base.kind
    there = [e for e in unit.whole.effects if e.shows_in(kind) and not lacking_quantity(type(e), unit.base.has)]
    ids = {e.id for e in there}
    shown = tuple(effect for effect in unit.effects if effect in ids or not CATALOGUE[effect].shows_in(kind))
    return replace(unit.whole, effects=tuple(there)).corrupt(unit.base), shown
