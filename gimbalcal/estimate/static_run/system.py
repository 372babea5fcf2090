r"""System level: what a static run says about the accelerometers, all channels in one fit.

Specific force, gimbal readouts and attitude error of a run are fitted together with the exact forward model. It sees
nine combinations of the twelve linear residual parameters of Wu et al. (2018), section 5, and no evaluation of the
same channels can see more: the bias of x and its lean towards the pole, for one, pull the constant part of f_x alike.
Those combinations come back by name. The paper's own method, the Kalman filter on the squared norm and the Fourier
coefficients of the attitude error, is in `force_filter`, `harmonics` and `combined_coefficients`, and both are stages
of the result; all must agree.

With positions as well, each level determines what the other cannot. Both state the same parameters of Eq. (6) as
square-root information, so fusion is addition and needs no transfer of "residuals" from stage to stage. Wu et al.
(2018) stop short of it: their third stage overwrites twelve coefficients. What is unobservable in both keeps its prior
sigma and is named.

The encoders are the same in both stages, and so are their zeros: `gimbal_zero` is counted in the sense of Table 1 in
either, although the static run reads S_t and q, which run the other way (`Platform.sense`). With the wrong sign and a
level base the turn of the triad about z would seem to be determined, and it is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import AssumedNoise, Calibration, Provenance, Residual, StageResult
from gimbalcal.effects import Effect, Parameter, parameters_of_effects, with_values
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.accelerometers.fit_summary import joined_sentences, misfit_in_words
from gimbalcal.estimate.accelerometers.position_fit import HEADER, SAMPLES, Positions
from gimbalcal.estimate.extra_effects import ExtraEffect, sizes_shown
from gimbalcal.estimate.fit import fit, information_of
from gimbalcal.estimate.sharing import agreement_test
from gimbalcal.estimate.static_run.combined_coefficients import Combined, fit_combined
from gimbalcal.estimate.static_run.force_filter import convergence_history
from gimbalcal.inference.information import Solution, solve
from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Recording
from gimbalcal.recording.noise_levels import header_noise, sample_sigma
from gimbalcal.views.core import View
from gimbalcal.views.known_attitude import Readings, readings, view_of_readings
from gimbalcal.views.noise import NoiseModel

MAX_REDUCED_CHI2 = 1.1  # chi^2 per degree of freedom: the header's sigma is not known better than to 5 %
PHASE, PHASE_SIGMA_RAD = "phi_0:polar", np.radians(1.0)  # many times what zeros and tilts make of it


def static_view(run: Readings) -> View:
    """Return the view of the readings of a static run, in the noise of each row."""
    return view_of_readings(run, NoiseModel(run.sigma, scale_known=True))


def static_readings(recording: Recording) -> Readings:
    """The readings of a static run with their noise. Raises InputError where there is nothing to fit.

    Sigma is that of the header over the root of a row's weight; if the header states none, the scatter of the rows
    about the model.
    """
    if not recording.kind.stabilised:
        raise InputError(f"{recording.title!r} is a {recording.kind} recording where a static run is needed")
    run = readings(recording)
    return replace(run, sigma=_sigmas(run))


def noise_from(run: Readings) -> str:
    """Return whether the header tells the noise of every channel, or the samples had to."""
    return HEADER if set(dict(run.channels)) <= set(header_noise(run.recording)) else SAMPLES


def _sigmas(run: Readings) -> Array:
    """One sigma (n, c) of every row and channel."""
    one = sample_sigma(run.recording, run.channels, run.residual())
    if not np.all(one > 0):
        quantity, axis = run.channels[int(np.argmin(one))]
        raise InputError(
            f"the channel {quantity} {axis} of {run.recording.title!r} does not scatter at all: state its noise"
        )
    return np.asarray(one / np.sqrt(run.recording.weight)[:, None])


def static_parameters(run: Readings) -> tuple[Parameter, ...]:
    """Parameters of the baseline; a gimbal that was not read has no zero, but the inner one is servoed to its.

    The platform's turn about the pole has no prior information: it is counted from S_t, whose constant is the mean
    reading of the platform gimbal, zero and tilts included. Its size has no information on these.
    """
    grade, names = run.recording.grade, run.recording.platform.axis_names
    usual = map(grade.usual, parameters_of_effects(BASELINE["static-run"], names))
    zeros = {axis for quantity, axis in run.channels if quantity == "gimbal_angle"} | {"inner"}
    read = (p for p in usual if p.effect != "gimbal_zero" or p.axis in zeros)
    return tuple(replace(p, sigma=PHASE_SIGMA_RAD) if p.label == PHASE else p for p in read)


def static_view_with(run: Readings, more: Sequence[ExtraEffect]) -> View:
    """Return the view of a static run in which its baseline acts, and of extra effects those that it can show."""
    shown = sizes_shown(more, run.recording.why_not_shown, run.recording.platform.axis_names)
    wanted = (*static_parameters(run), *shown)
    return replace(static_view(run), acting=frozenset(p.effect for p in wanted))


def calibrate_static_run(
    run: Readings, start: Sequence[Effect] = (), wanted: Sequence[Parameter] | None = None
) -> Calibration:
    """Calibration from a static run alone: the combinations that it sees, the others at zero with their prior sigma.

    start: effects to linearise at; those whose parameters are not wanted stay as they are. The combined coefficients
    of the paper, of what these effects leave, stand in `stages`.
    """
    wanted = static_parameters(run) if wanted is None else wanted
    fitted = fit([static_view(run)], wanted, start)
    solution, effects = fitted.solution, fitted.effects
    stages = [stage(run, effects, fit_combined(run, start, effects))]
    if len(columns := run.columns("specific_force")) == 3:  # the paper's filter takes all axes
        departure, sigma = run.residual(start)[:, columns], run.sigma[:, columns]
        stages.append(convergence_history(run.stimulus.time, departure, run.direction, sigma, run.stimulus.gravity))
    return fitted.calibration(
        "static-run",
        Residual(solution.chi2, solution.dof, fitted.rms_by_channel),
        outcome=outcome(solution),
        provenance=Provenance(recordings=run.recording.source, noise=AssumedNoise(from_=noise_from(run))),
        stages=tuple(stages),
    )


def linear_misfit(recording: Recording) -> float:
    """Return the misfit of a static run to its model linearised at usual constants, chi^2 per degree of freedom."""
    run = static_readings(recording)
    solution = solve(information_of([static_view(run)], (), static_parameters(run)))
    return solution.chi2 / max(solution.dof, 1)


def outcome(solution: Solution) -> str:
    """Return a sentence if the residual exceeds what chance and a sigma stated to a few per cent allow, else ""."""
    if solution.chi2 < MAX_REDUCED_CHI2 * solution.dof:
        return ""
    return joined_sentences([f"in the static run {words}" for words in misfit_in_words(solution.chi2, solution.dof)])


def stage(run: Readings, fitted: Sequence[Effect], table: Combined) -> StageResult:
    """The combined coefficients of section 5 for the record, each from its own channel."""
    rms = np.sqrt(np.mean(run.residual(fitted) ** 2, axis=0))[run.columns("specific_force")]
    words = "no combined coefficients: the run has neither the whole specific force nor roll nor pitch errors"
    if table.names:
        worst = float(np.max(np.abs(table.value - table.fit) / table.sigma))
        words = (
            f"{len(table.names)} combined coefficients of Eqs. (21)-(38), each from its own channel; the joint fit of "
            f"all channels moves none by more than {worst:.1f} of its sigma"
        )
    return StageResult(
        "system level: combined coefficients of the static run",
        table.names,
        table.value,
        table.sigma,
        float(np.sqrt(np.mean(rms**2))) if len(rms) else 0.0,
        words,
    )


SIGNIFICANCE = 1e-4  # probability below which two stages that are both right would differ so much


def both_levels(
    positions: Positions, run: Readings, effects: Sequence[Effect], wanted: Sequence[Parameter]
) -> tuple[Solution, Solution, Solution]:
    """Fit positions and a static run together, and return the solution, and what each alone says about its parameters.

    The base tilt and whatever else is of the run alone does not act in the positions. `effects` are where the fit
    begins.
    """
    device, level, mine = positions.view, static_view(run), positions.fit.parameters
    fitted = fit([device, level], tuple(dict.fromkeys((*mine, *wanted))), effects)
    own = information_of([device], fitted.effects, mine, fitted.local[:1])
    return fitted.solution, solve(own), solve(information_of([level], fitted.effects, wanted))


def fuse_stages(before: Calibration, together: Solution, device: Solution, static: Solution) -> Calibration:
    """Return the calibration by the joint solution of both stages, with that of each alone about the same point.

    `before` is the device-level calibration, from which effects that neither informs about, and the provenance, are
    kept. `outcome` says so where the two stages contradict each other.
    """
    names = tuple(axis.name for axis in SPACE_STABLE.axes)
    return replace(
        before,
        method="three-stage",
        effects=with_values(before.effects, together.parameters, together.x, names),
        parameters=together.parameters,
        covariance=together.covariance,
        unobservable=together.unobservable,
        residual=Residual(together.chi2, together.dof, before.residual.rms),
        outcome=". ".join(
            filter(None, (before.outcome, outcome(static), contradiction_sentence(together, device, static)))
        ),
        stages=(_stage_with_gain(together, device, before.stages[-1].rms if before.stages else 0.0),),
    )


def contradiction_sentence(together: Solution, device: Solution, static: Solution) -> str:
    """Return a sentence where the stages disagree on what both see, "" where they do not."""
    # a stage that its own model does not explain proves nothing against the other
    noise = max(1.0, device.chi2 / max(device.dof, 1), static.chi2 / max(static.dof, 1))
    result = agreement_test(together, [device, static], noise)
    if result.p_value >= SIGNIFICANCE:
        return ""
    return (
        f"The multi-position recording and the static run contradict each other: chi^2 of {result.rise:.0f} for the "
        f"{result.combinations} combinations that both see (probability {result.p_value:.1g}); the unit changed in "
        "between or a model is wrong"
    )


def _stage_with_gain(together: Solution, device: Solution, rms: float) -> StageResult:
    """Return the stage with the gain by the static run; rms [m/s^2] is that of the positions, which it hardly moves."""
    before = dict(zip(device.parameters, device.sigma, strict=True))
    ratio = [s / before[p] for p, s in zip(together.parameters, together.sigma, strict=True) if p in before]
    best = min(ratio, default=1.0)
    return StageResult(
        "system level: fused with the static run",
        tuple(p.label for p in together.parameters),
        together.x,
        together.sigma,
        rms,
        f"the static run makes sigma of {sum(r < 0.9 for r in ratio)} of {len(ratio)} parameters smaller by more than "
        f"a tenth, the best by a factor of {1 / best:.1f}; "
        f"seen by neither stage: {number_of(len(together.unobservable), 'direction')}",
    )
