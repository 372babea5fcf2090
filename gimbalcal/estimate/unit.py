r"""A whole inertial unit turned from rest to rest: accelerometers by the norm of gravity, gyroscopes by the turns.

Revolutions both ways calibrate the gyroscopes in a frame of their own, q; the other turns between rests tell how it
lies in the accelerometers' frame p, Eq. (43) of Wang et al. (2019).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import joined
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.accelerometers.norm_outliers import norm_outliers_in_words, without_norm_outliers
from gimbalcal.estimate.extra_effects import ExtraEffect
from gimbalcal.estimate.gyroscopes.between_rests import gyroscopes_between_rests
from gimbalcal.estimate.gyroscopes.inter_triad import in_accelerometer_frame, rotation_between_triads
from gimbalcal.estimate.gyroscopes.revolutions import EFFECTS, gyroscopes_from_revolutions
from gimbalcal.inference.algebra import block_diagonal
from gimbalcal.recording import Recording, completed
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.views.turns import turns_on_record


def inertial_unit(recording: Recording, terms: Sequence[str] = (), more: Sequence[ExtraEffect] = ()) -> Calibration:
    """Calibrate what a unit turned from rest to rest holds: accelerometers by the norm, gyroscopes by the turns.

    A recording of rates alone is calibrated by its revolutions. terms: ids of effects of either triad (default: those
    of `multiposition` and of `gyroscopes_between_rests`). When the turns do not suffice, the accelerometers stand alone
    and the options say why.
    """
    recording = completed(recording)
    if not recording.has(FORCE):
        if more:
            raise InputError(f"--with {more[0].effect}: gyroscopes alone, from revolutions, take no further effect")
        return gyroscopes_from_revolutions(recording)
    recording, odd = without_norm_outliers(recording)
    calibration = _both(recording, terms, more)
    return replace(
        calibration,
        outcome=joined([*norm_outliers_in_words(odd), calibration.outcome]),
        provenance=calibration.provenance.with_options(left_out=tuple(s.position for s in odd) or None),
    )


def _both(recording: Recording, terms: Sequence[str], more: Sequence[ExtraEffect]) -> Calibration:
    """Accelerometers, and gyroscopes where the turns suffice."""
    turning = tuple(a for a in more if CATALOGUE[a.effect].stage in GYROSCOPE_STAGES)
    of_rate = tuple(t for t in terms if t in CATALOGUE and CATALOGUE[t].stage in GYROSCOPE_STAGES)
    calibration = multiposition(
        recording, tuple(t for t in terms if t not in of_rate), tuple(a for a in more if a not in turning)
    )
    if terms and not of_rate and not turning:
        return calibration
    try:
        return with_gyroscopes(recording, calibration, of_rate, turning)
    except InputError as problem:
        if of_rate or turning:
            raise
        outcome = joined([calibration.outcome, f"the gyroscopes are not calibrated: {problem}"])
        provenance = calibration.provenance.with_options(gyroscopes=str(problem))
        return replace(calibration, outcome=outcome, provenance=provenance)


def with_gyroscopes(
    recording: Recording, accelerometers: Calibration, terms: Sequence[str] = (), more: Sequence[ExtraEffect] = ()
) -> Calibration:
    """Both triads in one calibration: the accelerometers', and the gyroscopes between the same rests beside it.

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
        outcome=joined([accelerometers.outcome, g.outcome]),
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
