"""Several sessions of one unit that is turned from rest to rest: constants in common, rests of their own.

All rests and turns go into one calibration. Whether the sessions may share their constants is asked of each against
all others together, in the terms that were taken up: `estimate.sharing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gimbalcal.calibration import Calibration, StageResult
from gimbalcal.calibration.readout import in_si
from gimbalcal.effects.baseline_effects import GYROSCOPE_BIAS, GYROSCOPE_INPUT_TERMS
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import joined
from gimbalcal.estimate.accelerometers.norm_fit import LINEAR
from gimbalcal.estimate.extra_effects import ExtraEffect, extra_effects
from gimbalcal.estimate.grade import graded
from gimbalcal.estimate.sharing import Comparison, Scope, compare_calibrations, disagreeing, scope_of
from gimbalcal.estimate.unit import inertial_unit
from gimbalcal.method_table import Request
from gimbalcal.recording import Recording, dwells, join


def calibrate_at_rest(request: Request) -> Calibration:
    """Calibrate a unit that is turned from rest to rest, from one recording or several sessions."""
    request.tell("norm of the force at every position, and the gyroscopes where they were logged on the way")
    recordings = graded(request.recordings).of(request.recordings)
    more = extra_effects(request.more, recordings, (*LINEAR, *GYROSCOPE_BIAS, *GYROSCOPE_INPUT_TERMS))
    if len(recordings) == 1:
        return inertial_unit(recordings[0], request.terms, more)
    return unit_of_sessions(recordings, request.terms, more)


def unit_of_sessions(
    sessions: Sequence[Recording], terms: Sequence[str] = (), more: Sequence[ExtraEffect] = ()
) -> Calibration:
    """Calibrate a unit from several sessions together, and say which of them does not agree with the others.

    Raises InputError for sessions that are not of one unit, see `recording.join`.
    """
    calibration = inertial_unit(join(sessions), terms, more)
    added = {a.effect for a in more}
    effects = dict.fromkeys(p.effect for p in calibration.parameters)
    taken = tuple(i for i in effects if i not in added and scope_of(i) is Scope.UNIT)
    scaled = [in_si(r, calibration.readout) for r in sessions]  # counts of all by one nominal scale
    alone, compared = zip(*(_compared(scaled, k, taken, more) for k in range(len(sessions))), strict=True)
    entries = tuple(c.session(rests=len(dwells(r))) for c, r in zip(compared, sessions, strict=True))
    return replace(
        calibration,
        outcome=joined([_outcome(compared), calibration.outcome]),
        provenance=calibration.provenance.with_options(sessions=entries),
        stages=(*calibration.stages, *(_stage(a, c) for a, c in zip(alone, compared, strict=True) if a)),
    )


def _compared(
    sessions: Sequence[Recording], k: int, terms: tuple[str, ...], more: Sequence[ExtraEffect]
) -> tuple[Calibration | None, Comparison]:
    """Return the calibration of one session alone, if it can be made, and its comparison with all others."""
    title, n = sessions[k].title, len(sessions)
    try:
        alone = inertial_unit(sessions[k], terms, more)
        others = inertial_unit(join([r for i, r in enumerate(sessions) if i != k]), terms, more)
    except InputError as problem:
        return None, Comparison(title, n, obstacle=str(problem))
    return alone, Comparison(title, n, *compare_calibrations(alone, others))


def _outcome(compared: Sequence[Comparison]) -> str:
    off = disagreeing(compared)
    if not off:
        return ""
    words = "; ".join(f"session {k + 1} ({compared[k].title}) {compared[k].in_words}" for k in off)
    return (
        f"the {len(compared)} sessions do not share their constants: {words}; calibrate each alone, "
        "or take the constants that differ as changing from one switching-on to the next"
    )


def _stage(alone: Calibration, compared: Comparison) -> StageResult:
    rms = next(iter(alone.residual.rms.values()), 0.0)
    labels = tuple(p.label for p in alone.parameters)
    return StageResult(f"{compared.title} alone", labels, alone.values, alone.sigmas, rms, compared.in_words)
