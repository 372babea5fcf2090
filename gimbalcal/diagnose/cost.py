"""What a cause costs if it is left out: position error of a navigator whose calibration holds it, and of one without.

A cause is weighed by its consequence and not by its sigmas. The calibration without it is the refit of the diagnosis by
a model that lacks this cause alone, so that the other coefficients take up of it what they can. Where a static run was
diagnosed, it is navigated. Of positions and of a unit that was turned in its place, a still base of 24 h is, whose
sensors err as was found while temperature and other logged channels swing once through the range that they were
recorded in; with the cause in the calibration there is left what its covariance says. Where no navigator can be run,
nothing is said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.result import Cost
from gimbalcal.earth import NAUTICAL_MILE, SOLAR_DAY
from gimbalcal.effects import CATALOGUE
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


def with_cost(recordings: Sequence[Recording], d: Diagnosis, progress: Progress = no_progress) -> Diagnosis:
    """The diagnosis with `cost` in each finding, where it can be computed: {hours, with_nmi, without_nmi, in_words}.

    Values are the largest errors of position, in n miles. If the run is one of the recordings, `uncalibrated_nmi` is
    added, the error without any calibration; for a simulated run, `with_nmi` is one sigma, by the covariance of the
    calibration.
    """
    base = _navigated_base(recordings) if d.findings and d.calibration and d.without else None
    if base is None:
        return d
    try:
        progress("navigating with and without what was found")
        costs = _cost_of_effects(d, base, measured=any(base is r for r in recordings))
    except InputError:  # no readouts, no latitude: no navigator
        return d
    return replace(d, findings=tuple(replace(f, cost=costs.get(f.effect)) for f in d.findings))


def _navigated_base(recordings: Sequence[Recording]) -> Recording | None:
    """Return the static run that a unit navigates, or a still base; None where no navigator can be run."""
    first = recordings[0]
    if len(recordings) == 1 and turned_in_place(first):
        return _with_daily_swing(still_unit(DAY + ROW / 3600, first.site, EAST_NORTH_UP), recordings)
    located = [r for r in recordings if r.kind.at_rest and r.site.latitude is not None]
    runs = [r for r in recordings if r.kind.stabilised]
    if not located or first.platform.name != SPACE_STABLE.name or len(runs) > 1:
        return None
    return runs[0] if runs else _with_daily_swing(still_base(DAY, located[0].site), recordings)


def _cost_of_effects(d: Diagnosis, base: Recording, measured: bool) -> Mapping[str, Cost]:
    """Return the cost of each effect found that acts in the run; the run corrected for all of them is navigated once.

    measured: whether the base is a recording, not a simulated run.
    """
    whole = d.calibration
    assert whole is not None
    assert d.without is not None
    effects = {f.effect for f in d.findings}
    found = [e.id for e in whole.effects if e.id in effects]
    run, shown = (base, found) if measured else _erring_base(whole, found, base)
    if not shown:
        return {}
    aids = usual_references(run)
    raw = None
    if measured:
        known, raw = (float(navigation_errors(run, c, aids).position.max()) / NAUTICAL_MILE for c in (whole, None))
    else:
        known = position_uncertainty(run, whole, aids) / NAUTICAL_MILE
    out: dict[str, Cost] = {}
    for effect in shown:
        without = navigation_errors(run, d.without(effect), aids)
        hours, left_out = float(without.time[-1] / 3600), float(without.position.max() / NAUTICAL_MILE)
        out[effect] = Cost(hours, known, left_out, cost_in_words(hours, known, left_out, raw), raw)
    return out


def _with_daily_swing(base: Recording, recordings: Sequence[Recording]) -> Recording:
    """The base with temperature and other logged channels going once a day through the range they were recorded in."""
    turn = np.sin(2 * np.pi * base.time / SOLAR_DAY)
    around = {k: v for r in recordings for k, v in r.channels.items() if k[0] in FOLLOWED}
    swung = {k: (v.max() + v.min()) / 2 + (v.max() - v.min()) / 2 * turn for k, v in around.items()}
    return replace(base, channels=dict(base.channels) | swung)


def _erring_base(whole: Calibration, found: Sequence[str], base: Recording) -> tuple[Recording, list[str]]:
    """Return a still base whose sensors err as was found, and the effects whose cost it shows.

    None of these follow a channel which it lacks.
    """
    there = [e for e in whole.effects if e.shows_in(base.kind) and not lacking_quantity(type(e), base.has)]
    ids = {e.id for e in there}
    shown = [effect for effect in found if effect in ids or not CATALOGUE[effect].shows_in(base.kind)]
    return replace(whole, effects=tuple(there)).corrupt(base), shown
