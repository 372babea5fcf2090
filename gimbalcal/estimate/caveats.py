"""Caveats of the usual calibration of a recording: the model does not fit, or only with a larger noise.

A diagnosis integrates over noise, so that a noise larger than stated is not missing physics: its verdict stays
adequate, and these sentences are added to it. A calibration takes the noise as stated. Both must agree on one
recording.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.accelerometers.fit_summary import excess_in_words, larger_noise_in_words, outliers_in_words
from gimbalcal.estimate.accelerometers.multiposition import multiposition, parameters_of_terms, scatter_in_words
from gimbalcal.estimate.accelerometers.position_fit import Fault, Positions
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions
from gimbalcal.estimate.static_run.system import calibrate_static_run, static_readings
from gimbalcal.estimate.unit import with_gyroscopes
from gimbalcal.recording import Recording
from gimbalcal.recording.dwell import attitudes
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.views.core import by_triad
from gimbalcal.views.norm import norm


def caveats(recording: Recording, baseline: Sequence[str] = ()) -> list[str]:
    """Sentences of what speaks against the calibrated model of one recording."""
    usual = not baseline or set(baseline) == set(BASELINE.get(recording.kind, ()))
    out = []
    if recording.kind.stabilised and usual:
        out += _sentences(lambda: [calibrate_static_run(static_readings(recording)).outcome.partition(", so ")[0]])
    if not recording.kind.in_positions or recording.position is None or not recording.has(FORCE):
        return out
    if recording.has("gimbal_angle"):
        out += _sentences(lambda: _of_positions(trusted_positions(recording))) if usual else []
    mine, gyro = by_triad(baseline)
    if recording.has("gimbal_angle") and not recording.has(RATE):
        return out
    if mine or not baseline:
        terms = () if recording.has("gimbal_angle") else tuple(mine)
        out += _sentences(lambda: _of_unit(recording, terms, bool(gyro) or not baseline))
    return out


def too_few_attitudes(recordings: Sequence[Recording], baseline: Sequence[str]) -> str:
    """Explain that units turned by hand took no more attitudes than their model has constants; empty where they did.

    The constants then always fit: dwells that repeat an attitude test its noise and drift, not the model.
    """
    mine, gyro = by_triad(baseline)
    by_hand = [r for r in recordings if r.kind.in_positions and not r.platform.axes and r.has(FORCE)]
    if len(by_hand) < len(recordings) or (gyro and not mine):
        return ""
    try:
        views = [norm(r, mine) for r in by_hand]
    except InputError:  # counts whose scale no attitude shows
        return ""
    force = np.concatenate([v.source.triad(FORCE) for v in views])
    constants, different = len(parameters_of_terms(views[0].baseline)), attitudes(force)
    return (
        f"{number_of(len(force), 'position')} in {number_of(different, 'attitude')} are no more than the "
        f"{number_of(constants, 'constant')} of the model, which fit whatever the sensors do"
        if different <= constants
        else ""
    )


def _sentences(ask: Callable[[], list[str]]) -> list[str]:
    """Return what an estimator reports, less what is empty; nothing where it does not take the recording."""
    try:
        return list(filter(None, ask()))
    except InputError:
        return []


def _of_positions(p: Positions) -> list[str]:
    """Return the caveats of `three-stage` on positions at known angles in the stated noise."""
    s = p.fit.solution
    return outliers_in_words(p.faults) + excess_in_words(s.chi2, s.dof, larger_noise_in_words(p))


def _of_unit(recording: Recording, terms: tuple[str, ...], both: bool) -> list[str]:
    """Return the caveats of `multiposition` on the norm of the force, and on gyroscopes between the same dwells."""
    calibration = multiposition(recording, terms)
    times, excess = calibration.provenance.options.excess_over_noise, calibration.provenance.options.excess_scatter
    forces = scatter_in_words(recording.noise, excess, excess / times) if times and excess and times > 0 else ""
    alone = replace(calibration, outcome="")
    return [forces, *(_sentences(lambda: [with_gyroscopes(recording, alone).outcome]) if both else ())]


def position_faults(recording: Recording) -> tuple[Fault, ...]:
    """Return positions that were not held where the readouts say, which is a fault and no physics."""
    if not recording.kind.in_positions:
        return ()
    try:
        return trusted_positions(recording).faults
    except InputError:
        return ()
