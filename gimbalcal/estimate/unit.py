r"""A whole inertial unit turned from rest to rest: accelerometers by the norm of gravity, gyroscopes by the turns.

Revolutions both ways calibrate the gyroscopes in a frame of their own, q; the other turns between rests tell how it
lies in the accelerometers' frame p, Eq. (43) of Wang et al. (2019).

All rests and turns of several sessions go into one calibration. Whether the sessions may share their constants is asked
of each against all others together, in the terms that were taken up: `estimate.sharing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gimbalcal.calibration import Calibration, StageResult
from gimbalcal.calibration.readout import in_si
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.baseline_effects import GYROSCOPE_BIAS, GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import joined_sentences
from gimbalcal.estimate.accelerometers.multiposition import LINEAR, multiposition
from gimbalcal.estimate.accelerometers.norm_outliers import norm_outliers, norm_outliers_in_words
from gimbalcal.estimate.extra_effects import ExtraEffect, extra_effects
from gimbalcal.estimate.grade import grade_of_unit
from gimbalcal.estimate.gyroscopes.between_rests import gyroscopes_between_rests
from gimbalcal.estimate.gyroscopes.revolutions import (
    EFFECTS,
    gyroscopes_from_revolutions,
    in_accelerometer_frame,
    rotation_between_triads,
)
from gimbalcal.estimate.sharing import Comparison, Scope, compare_calibrations, disagreeing_recordings, scope_of
from gimbalcal.inference.algebra import block_diagonal
from gimbalcal.method_table import Request
from gimbalcal.recording import Recording, dwells, join, with_rests_as_positions
from gimbalcal.recording.dwell import without_dwells
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.views.turns import turns_on_record


def inertial_unit(recording: Recording, terms: Sequence[str] = (), more: Sequence[ExtraEffect] = ()) -> Calibration:
    """Calibrate what a unit turned from rest to rest holds: accelerometers by the norm, gyroscopes by the turns.

    A recording of rates alone is calibrated by its revolutions. terms: ids of effects of either triad (default: those
    of `multiposition` and of `gyroscopes_between_rests`). When the turns do not suffice, the accelerometers stand alone
    and the options say why.
    """
    recording = with_rests_as_positions(recording)
    if not recording.has(FORCE):
        if more:
            raise InputError(f"--with {more[0].effect}: gyroscopes alone, from revolutions, take no further effect")
        return gyroscopes_from_revolutions(recording)
    odd = norm_outliers(recording)
    recording = without_dwells(recording, [s.dwell for s in odd])
    turning = tuple(a for a in more if CATALOGUE[a.effect].stage in GYROSCOPE_STAGES)
    of_rate = tuple(t for t in terms if t in CATALOGUE and CATALOGUE[t].stage in GYROSCOPE_STAGES)
    calibration = multiposition(
        recording, tuple(t for t in terms if t not in of_rate), tuple(a for a in more if a not in turning)
    )
    try:
        if not terms or of_rate or turning:
            calibration = with_gyroscopes(recording, calibration, of_rate, turning)
    except InputError as problem:
        if of_rate or turning:
            raise
        outcome = joined_sentences([calibration.outcome, f"the gyroscopes are not calibrated: {problem}"])
        provenance = calibration.provenance.with_options(gyroscopes=str(problem))
        calibration = replace(calibration, outcome=outcome, provenance=provenance)
    return replace(
        calibration,
        outcome=joined_sentences([*norm_outliers_in_words(odd), calibration.outcome]),
        provenance=calibration.provenance.with_options(left_out=tuple(s.position for s in odd) or None),
    )


def with_gyroscopes(
    recording: Recording, accelerometers: Calibration, terms: Sequence[str] = (), more: Sequence[ExtraEffect] = ()
) -> Calibration:
    """Return both triads in one calibration: the accelerometers', with the gyroscopes between the same rests.

    Revolutions both ways are taken where there are six pairs of them, the direction of gravity elsewhere. Without
    rates, or without rows between the rests, it is the accelerometers' calibration as it came.
    """
    if not recording.has(RATE) or not turns_on_record(recording):
        if more:
            raise InputError(f"--with {more[0].effect}: {recording.title!r} logged no turns between its rests")
        return accelerometers
    g = None if more else _from_revolutions(recording, accelerometers, terms)
    g = gyroscopes_between_rests(recording, accelerometers, terms, more) if g is None else g
    g = replace(g, parameters=tuple(recording.grade.at_power_on(p) for p in g.parameters))  # no fit here has a prior
    return replace(
        accelerometers,
        effects=(*accelerometers.effects, *g.effects),
        parameters=(*accelerometers.parameters, *g.parameters),
        covariance=block_diagonal([accelerometers.covariance, g.covariance]),
        unobservable=(*accelerometers.unobservable, *g.unobservable),
        residual=replace(accelerometers.residual, rms={**accelerometers.residual.rms, **g.residual.rms}),
        provenance=accelerometers.provenance.with_options(gyro=g.provenance.options),
        stages=(*accelerometers.stages, *g.stages),
        outcome=joined_sentences([accelerometers.outcome, g.outcome]),
        readout=replace(accelerometers.readout, gyroscopes=g.readout.gyroscopes),
    )


def _from_revolutions(recording: Recording, accelerometers: Calibration, terms: Sequence[str]) -> Calibration | None:
    """The gyroscopes by revolutions both ways, in the accelerometers' frame; None where there are too few of them."""
    if not set(terms) <= set(EFFECTS):
        return None
    try:
        g = gyroscopes_from_revolutions(recording)
    except InputError:
        return None
    try:
        return in_accelerometer_frame(g, rotation_between_triads(g, recording, accelerometers))
    except InputError as problem:
        (turn,) = g.unobservable
        return replace(g, unobservable=(replace(turn, why=f"{turn.why}; {problem}"),))


def calibrate_at_rest(request: Request) -> Calibration:
    """Calibrate a unit that is turned from rest to rest, from one recording or several sessions."""
    request.progress("norm of the force at every position, and the gyroscopes where they were logged on the way")
    recordings = grade_of_unit(request.recordings).of(request.recordings)
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

    def against_others(k: int) -> tuple[Calibration | None, Comparison]:
        """Return the calibration of one session alone, if it can be made, and its comparison with all others."""
        title, n = sessions[k].title, len(sessions)
        try:
            alone = inertial_unit(scaled[k], taken, more)
            others = inertial_unit(join([r for i, r in enumerate(scaled) if i != k]), taken, more)
        except InputError as problem:
            return None, Comparison(title, n, obstacle=str(problem))
        return alone, Comparison(title, n, *compare_calibrations(alone, others))

    alone, compared = zip(*map(against_others, range(len(sessions))), strict=True)
    stages = [
        StageResult(
            f"{c.title} alone", tuple(p.label for p in a.parameters), a.values, a.sigmas,
            next(iter(a.residual.rms.values()), 0.0), c.in_words,
        )
        for a, c in zip(alone, compared, strict=True) if a
    ]  # fmt: skip
    entries = tuple(c.session(rests=len(dwells(r))) for c, r in zip(compared, sessions, strict=True))
    return replace(
        calibration,
        outcome=joined_sentences([_outcome(compared), calibration.outcome]),
        provenance=calibration.provenance.with_options(sessions=entries),
        stages=(*calibration.stages, *stages),
    )


def _outcome(compared: Sequence[Comparison]) -> str:
    off = disagreeing_recordings(compared)
    if not off:
        return ""
    words = "; ".join(f"session {k + 1} ({compared[k].title}) {compared[k].in_words}" for k in off)
    return (
        f"the {len(compared)} sessions do not share their constants: {words}; calibrate each alone, "
        "or take the constants that differ as changing from one switching-on to the next"
    )
