"""Gyroscopes calibrated on a rate table: what they read while it turns steadily, against what its readouts say.

Scatter of the stretches beyond that of their samples is estimated with the effects (a bias that wanders from stretch to
stretch, a table that is not as even as it reads). Misalignments hold how the unit is mounted, and their sigma says so;
that of a scale factor holds the cosine of such a tilt. See `views.rate_table` for the rows and their nuisances.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import (
    DIRECTION,
    AssumedNoise,
    Calibration,
    Counts,
    Options,
    Provenance,
    Readout,
    Residual,
)
from gimbalcal.checks.driven_rates import refuse_unlike_table
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, parameters_of_effects, with_values
from gimbalcal.effects.baseline_effects import GYROSCOPE_BIAS, GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.gyroscope import rate_matrix
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.accelerometers.position_fit import SAMPLES
from gimbalcal.estimate.extra_effects import ExtraEffect, extra_effects
from gimbalcal.estimate.fit import LEAST_SIGNAL, MIN_NUMBERS_LEFT, ViewsFit, columns_are_independent, fit
from gimbalcal.estimate.grade import grade_of_unit
from gimbalcal.estimate.gyroscopes.residual_checks import rates_in_words
from gimbalcal.estimate.term_selection import needed_significance, refusal_sentence, select_terms
from gimbalcal.inference.information import Unobservable
from gimbalcal.method_table import Request
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.joining import refuse_twice
from gimbalcal.recording.record import RATE
from gimbalcal.units import from_si
from gimbalcal.views.core import View
from gimbalcal.views.rate_table import (
    MAX_RATE_CHANGE,
    MIN_RATE,
    MOUNTING_SIGMA_RAD,
    Stretches,
    rate_table,
    stretches_of,
)
from gimbalcal.views.rest_rates import MIN_RATE_SIGMA

BASE = (*GYROSCOPE_BIAS, *GYROSCOPE_INPUT_TERMS)
MIN_SHARE_INSIDE = 0.01  # of the variance of what an effect adds, within stretches
FURTHER_TERMS = ("gyro_scale_asymmetry", "gyro_scale_nonlinearity")


def calibrate_on_a_table(request: Request) -> Calibration:
    """Calibrate gyroscopes on a rate table, as those of a unit of the grade that their noise tells."""
    more = extra_effects(request.more, request.recordings, BASE)
    return gyroscopes_on_a_table(grade_of_unit(request.recordings).of(request.recordings), more)


def gyroscopes_on_a_table(recordings: Sequence[Recording], more: Sequence[ExtraEffect] = ()) -> Calibration:
    """Calibrate gyroscopes against the angles of the table that turned them, from one recording or several mountings.

    Bias, scale factors and misalignments, and asymmetry and nonlinearity of the scale where the stretches support
    them; what `more` adds is fitted in any case, to parts of the stretches where it changes within one. What no
    recording turned about is not estimated and named. Raises InputError without rates or angles of a rig, where nothing
    turns steadily, and where counts are of an axis that was never turned.
    """
    parts = on_a_table(recordings, divided=True) if more else None
    table = parts if parts and _change_within_stretches(parts.view, more) else on_a_table(recordings)
    linear = table.linear
    sizes = [p for e in more for p in e.parameters(()) if (p.effect, p.axis) not in table.view.gauge]
    if lost := next((e.effect for e in more if e.effect not in {p.effect for p in sizes}), ""):
        raise InputError(f"--with {lost}: no stretch of steady turning shows it; leave it out")
    extra = linear.extension(more, sizes)
    if more:
        linear = _fit(table.view, (*linear.parameters, *extra.parameters), extra.effects)
    best, declined = _fit_with_supported_terms(table.view, linear, {e.effect for e in more})
    calibration = extra.complete(_calibration(best, table.unseen, declined, table.stretches))
    files = tuple(file for r in recordings for file in r.source)
    return replace(calibration, provenance=replace(calibration.provenance, recordings=files), readout=table.readout)


def _change_within_stretches(parts: View, more: Sequence[ExtraEffect]) -> bool:
    """Return whether what some of these effects add changes within a stretch, as it does with the angle of the table.

    Whole stretches are taken where nothing does, as they show how the biases scatter from one stretch to the next.
    """
    mean = np.equal.outer(np.unique(parts.groups), parts.groups).astype(float)
    mean /= mean.sum(axis=1, keepdims=True)
    for e in more:
        for p in e.parameters(()):
            (effect,) = with_values([e.absent()], (p,), np.array([p.sigma]))
            added = np.asarray(effect.contribution(parts.stimulus), dtype=float)
            inside = added - (mean @ added)[parts.groups]
            if float((inside**2).sum()) > MIN_SHARE_INSIDE * float(((added - added.mean(axis=0)) ** 2).sum()):
                return True
    return False


@dataclass(frozen=True, eq=False)
class OnTable:
    """The view of gyroscopes on a table, their linear model in it, and the parameters that no stretch depends on.

    scale (3,): rad/s per unit of the readings; stretches: how many each recording has.
    """

    recordings: tuple[Recording, ...]
    view: View
    linear: ViewsFit
    unseen: tuple[Parameter, ...]
    scale: Array
    stretches: tuple[int, ...]

    @property
    def readout(self) -> Readout:
        """Return how the unit is read, with the nominal scale of gyroscopes that count."""
        counts = Counts(tuple(map(float, self.scale))) if self.view.source.counted(RATE) else None
        return replace(self.view.readout, gyroscopes=counts)

    @property
    def view_in_scatter(self) -> View:
        """Return the view of parts of the stretches, mountings and the Earth's rate eliminated in its own scatter.

        Raises InputError where the stretches are too few to estimate their scatter.
        """
        if self.linear.dof_of_scatter < MIN_NUMBERS_LEFT:
            raise InputError(
                f"{self.view.title!r} holds {number_of(sum(self.stretches), 'stretch', 'stretches')} of steady "
                "turning, too few to tell how they scatter: turn at more rates, both ways round"
            )
        parts = on_a_table(self.recordings, divided=True)
        return replace(parts.view.without_nuisances(parts.linear.sigma[0]), readout=self.readout)


def on_a_table(recordings: Sequence[Recording], divided: bool = False) -> OnTable:
    """Return gyroscopes on a table with their linear model. Raises InputError as `gyroscopes_on_a_table`.

    divided: whether rows are parts of stretches of steady turning, which show what happens within them.
    """
    refuse_twice(recordings)
    for r in recordings:
        refuse_unlike_table(r)
    each = [stretches_of(r, divided) for r in recordings]
    scale = _nominal_scales([r.counted(RATE) for r in recordings], each)
    view = rate_table(recordings, each, scale, np.eye(3))
    wanted, unseen = _seen_parameters(view)
    first = _fit(view, wanted)
    own = dict(zip(first.parameters, first.x, strict=True))
    scale_factor, turned = (
        np.array([own.get(p, 0.0) for p in parameters(CATALOGUE[i])]) for i in GYROSCOPE_INPUT_TERMS
    )
    M = rate_matrix(scale_factor, turned * _share_of_unit(turned[turned != 0]))
    view = rate_table(recordings, each, scale, M)  # a misalignment reads what the mounting turns aside: second order
    return OnTable(tuple(recordings), view, _fit(view, wanted), unseen, scale, tuple(int(s.number[-1]) for s in each))


def _share_of_unit(misalignments: Array) -> float:
    """Return the share of misalignments (m,) that is of the unit, rms: the rest is how the mountings are turned."""
    square = float(np.mean(misalignments**2)) if misalignments.size else 0.0
    return float(np.sqrt(1 - MOUNTING_SIGMA_RAD**2 / square)) if square > MOUNTING_SIGMA_RAD**2 else 0.0


def _nominal_scales(counted: Sequence[bool], each: Sequence[Stretches]) -> Array:
    """Rad/s per unit of the readings (3,): ones where they have a scale, else by the turns about each own axis."""
    if not any(counted):
        return np.ones(3)
    if not all(counted):
        raise InputError("some recordings read rates in counts and some in a unit: give all alike")
    rate = np.concatenate([s.rate for s in each])
    read = np.concatenate([s.reading + s.rate for s in each])
    out = np.zeros(3)
    for i in range(3):
        if np.ptp(rate[:, i]) < MIN_RATE:
            raise InputError(
                f"gyroscope {'xyz'[i]} counts and was never turned about its own axis, so how much a count is stays "
                "unknown: mount the unit with that axis along the table's and turn it"
            )
        design = np.stack([rate[:, i], np.ones(len(rate))], axis=1)
        out[i] = 1 / np.linalg.lstsq(design, read[:, i], rcond=None)[0][0]
    return out


def _seen_parameters(view: View) -> tuple[tuple[Parameter, ...], tuple[Parameter, ...]]:
    """Parameters of the linear model that some stretch depends on, and those that none does."""
    every = parameters_of_effects(BASE)
    size = np.abs(view.evaluate(()).jacobian(every)).max(axis=(0, 1))
    determined = tuple(p for p, s in zip(every, size, strict=True) if s > MAX_RATE_CHANGE * MIN_RATE)
    if not _distinguished(view, determined):
        raise InputError(
            "these turns do not tell scale factors from misalignments: turn the unit about one of its own axes in each "
            "recording, or about three axes and more"
        )
    return determined, tuple(p for p in every if p not in determined)


def _fit(view: View, wanted: Sequence[Parameter], effects: Sequence[Effect] = ()) -> ViewsFit:
    return fit([view], wanted, effects, min_signal=LEAST_SIGNAL, significance=0.0)


def _distinguished(view: View, wanted: Sequence[Parameter]) -> bool:
    """Return whether the rows distinguish parameters; a constant of an absent effect has no column."""
    J = view.evaluate(()).jacobian(wanted).reshape(-1, len(wanted))
    return columns_are_independent(J[:, J.any(axis=0)])


def _fit_with_supported_terms(
    view: View, linear: ViewsFit, requested: Collection[str]
) -> tuple[ViewsFit, dict[str, str]]:
    """The linear fit with each further term that the stretches support, none of those `requested`, and why not."""
    turned = {p.axis for p in linear.parameters if p.effect == "gyro_scale_factor"}

    def attempt(terms: tuple[str, ...], without: ViewsFit) -> ViewsFit | str:
        term = terms[-1]
        more = (*without.parameters, *(p for p in parameters(CATALOGUE[term]) if p.axis in turned))
        if 3 * len(view) <= len(more) or not _distinguished(view, more):
            return f"{term} is left out: it takes more rates, both ways round"
        fit = _fit(view, more, linear.effects)
        clear_of = needed_significance(len(parameters_of_effects(FURTHER_TERMS)), fit.dof_of_scatter)
        data = f"{len(np.unique(view.groups))} stretches"
        return refusal_sentence(term, data, without, fit, "rad/s", clear_of) or fit

    fits, declined = select_terms(BASE, linear, [t for t in FURTHER_TERMS if t not in requested], attempt)
    return fits[-1][1], declined


def _calibration(
    best: ViewsFit, unseen: Sequence[Parameter], declined: dict[str, str], stretches: Sequence[int]
) -> Calibration:
    sample = best.views[0].noise.sample
    assert sample is not None
    dof = best.residual[0].size - len(best.x)
    many = number_of(sum(stretches), "stretch", "stretches")
    words = (
        f"{many} of steady turning in {number_of(len(stretches), 'recording')}; what is left is "
        f"{from_si(best.rms, 'deg/h'):.3g} deg/h rms"
    )
    mounted = (
        f"misalignments hold how the unit is mounted on the table, which is taken to be good to "
        f"{from_si(MOUNTING_SIGMA_RAD, 'deg'):.2g} deg"
    )
    options = Options(
        direction=DIRECTION, frame="the table's axes", in_words=words, stretches=tuple(stretches), declined=declined
    )
    rate = best.views[0].stimulus.rate
    still = " and ".join(a for a, w in zip("xyz", rate.T, strict=True) if np.abs(w).max() < MIN_RATE)
    seldom = "no recording turns the unit about every axis" + (f", none about {still}" if still else "")
    dark = [Unobservable.of([p], seldom) for p in unseen]
    dark += [Unobservable.of(parameters(CATALOGUE[t]), why) for t, why in declined.items()]
    chi2 = float(((best.residual[0] / sample) ** 2).sum()) if np.all(sample > MIN_RATE_SIGMA) else float(dof)
    wanders = "its samples explain: its bias wanders, or the table turns otherwise"
    scattering = rates_in_words("in steady turning", best.residual[0], np.sqrt((sample**2).mean(0)), wanders)
    usual = tuple(best.views[0].grade.at_power_on(p) for p in best.parameters)  # no fit here has a prior
    return best.calibration(
        "rate-table", Residual(chi2, dof, {RATE: best.rms}), parameters=usual,
        unobservable=(*best.unobservable, *dark), outcome="".join(scattering),
        provenance=Provenance(noise=AssumedNoise(from_=SAMPLES), options=options, limits=(mounted,)),
        stages=(best.stage("against the table", words),),
    )  # fmt: skip
