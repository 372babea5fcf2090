r"""A whole inertial unit turned from rest to rest: accelerometers by the norm of gravity, gyroscopes by the turns.

Revolutions both ways calibrate the gyroscopes in a frame of their own, q; the other turns between rests tell how it
lies in the accelerometers' frame p, Eq. (43) of Wang et al. (2019), and with M physics to reading

.. math:: y = M \omega^q + \dots = (M C_p^q) \, \omega^p + \dots
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.effects.gyroscope import of_rate_matrix, rate_matrix
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.accelerometers.fit_summary import joined
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.accelerometers.norm_outliers import norm_outliers_in_words, without_norm_outliers
from gimbalcal.estimate.extra_effects import ExtraEffect
from gimbalcal.estimate.gyroscopes.between_rests import gyroscopes_between_rests
from gimbalcal.estimate.gyroscopes.inter_triad import InterTriad, from_turns, triad_rotation
from gimbalcal.estimate.gyroscopes.revolutions import EFFECTS, gyroscopes_from_revolutions
from gimbalcal.inference.algebra import block_diagonal
from gimbalcal.number import Array, complex_step
from gimbalcal.recording import Recording, completed, dwells
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import exponential, mean_rates
from gimbalcal.units import from_si
from gimbalcal.views.turns import paused, turns_on_record

MIN_GRAVITY_CHANGE = 0.1  # of its direction: a turn that moves it less, a whole revolution, says nothing of the triads


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
    made = _both(recording, terms, more)
    return replace(
        made,
        outcome=joined([*norm_outliers_in_words(odd), *filter(None, [made.outcome])]),
        provenance=made.provenance.with_options(left_out=tuple(s.position for s in odd) or None),
    )


def _both(recording: Recording, terms: Sequence[str], more: Sequence[ExtraEffect]) -> Calibration:
    """Accelerometers, and gyroscopes where the turns suffice."""
    turning = tuple(a for a in more if CATALOGUE[a.effect].stage in GYROSCOPE_STAGES)
    of_rate = tuple(t for t in terms if t in CATALOGUE and CATALOGUE[t].stage in GYROSCOPE_STAGES)
    made = multiposition(
        recording, tuple(t for t in terms if t not in of_rate), tuple(a for a in more if a not in turning)
    )
    if terms and not of_rate and not turning:
        return made
    try:
        return with_gyroscopes(recording, made, of_rate, turning)
    except InputError as problem:
        if of_rate or turning:
            raise
        outcome = joined(list(filter(None, [made.outcome, f"the gyroscopes are not calibrated: {problem}"])))
        return replace(made, outcome=outcome, provenance=made.provenance.with_options(gyroscopes=str(problem)))


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
        outcome=joined(list(filter(None, [accelerometers.outcome, g.outcome]))),
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
        return in_frame_of(g, between_triads(g, recording, accelerometers))
    except InputError as problem:
        (turn,) = g.unobservable
        return replace(g, unobservable=(replace(turn, why=f"{turn.why}; {problem}"),))


def between_triads(gyroscopes: Calibration, recording: Recording, accelerometers: Calibration) -> InterTriad:
    """C_p^q from the turns between rests that move gravity, against the Earth; sigma from what the turns leave."""
    rate = gyroscopes.apply(recording).triad(RATE)
    force = accelerometers.apply(recording).triad(FORCE)
    stays = dwells(recording)
    down = np.array([force[d.rows].mean(0) for d in stays])
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    spans = [slice(a.stop - 1, b.start + 1) for a, b in pairwise(stays)]
    moved = np.linalg.norm(np.diff(down, axis=0), axis=1) > MIN_GRAVITY_CHANGE
    moves = [i for i, span in enumerate(spans) if moved[i] and not paused(recording, span)]
    turns = [_turn(recording.time, rate, spans[i], rate[stays[i].rows].mean(0)) for i in moves]
    if len(moves) < 3:
        raise InputError(
            f"gravity is moved by {amount(len(moves), 'turn')}; three or more tell how the triads lie to each other"
        )
    after = [i + 1 for i in moves]
    found = from_turns(down[moves], down[after], np.array(turns), 1.0)
    # each turn has three residuals of rank two
    sigma = found.rms * np.sqrt(3 * len(moves) / max(2 * len(moves) - 3, 1))
    return replace(found, covariance=sigma**2 * found.covariance)


def _turn(time: Array, rate: Array, span: slice, earth: Array) -> Array:
    """R^q (3, 3) of one turn against the Earth, whose rate (3,) [rad/s] is known before it."""
    t, C = time[span], np.eye(3)
    mean, bend, coning = mean_rates(t, rate[span])
    for dt, w in zip(np.diff(t), mean + bend + coning, strict=True):
        C = exponential((w - C @ earth) * dt) @ C
    return C


def in_frame_of(gyroscopes: Calibration, lie: InterTriad) -> Calibration:
    """The same gyroscopes referred to the accelerometers' frame: six misalignments instead of three, exact."""
    order = [p for e in EFFECTS for p in parameters(CATALOGUE[e])]
    labels = [p.label for p in gyroscopes.parameters]
    linear = [[p.label for p in parameters(CATALOGUE[i])] for i in ("gyro_scale_factor", "gyro_misalignment")]
    n = len(labels)

    def referred(x: Array) -> Array:
        own = dict(zip(labels, x[:n], strict=True))
        s, beta = (np.array([own.get(label, 0.0) for label in of]) for of in linear)
        new = np.concatenate(of_rate_matrix(rate_matrix(s, beta) @ triad_rotation(x[n:])))
        own |= dict(zip([*linear[0], *linear[1]], new, strict=True))
        return np.array([own[p.label] for p in order])

    x = np.concatenate([gyroscopes.values, lie.angles])
    J = complex_step(referred, x)  # a change of variables from one frame to the other
    covariance = block_diagonal([gyroscopes.covariance, lie.covariance])
    angles, sigmas = (
        tuple(float(from_si(a, "arcsec")) for a in rad) for rad in (lie.angles, np.sqrt(np.diag(lie.covariance)))
    )
    origin = gyroscopes.provenance.with_options(
        frame="accelerometers", inter_triad_arcsec=angles, inter_triad_sigma_arcsec=sigmas
    )
    return replace(
        gyroscopes, effects=with_values((), order, referred(x)), parameters=tuple(order),
        covariance=J @ covariance @ J.T, unobservable=(), provenance=origin,
    )  # fmt: skip
