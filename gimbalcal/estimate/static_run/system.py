r"""System level: what a static run says about the accelerometers, all channels in one fit.

Specific force, gimbal readouts and attitude error of a run are fitted together with the exact forward model. It sees
nine combinations of the twelve linear residual parameters of Wu et al. (2018), section 5, and no evaluation of the
same channels can see more: the bias of x and its lean towards the pole, for one, pull the constant part of f_x alike.
Those combinations come back by name. The paper's own road, squared norm and Fourier coefficients, is in
`force_filter`, `harmonics` and `combined`; both methods must agree.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.calibration import AssumedNoise, Calibration, Provenance, Readout, Residual, StageResult
from gimbalcal.effects import Effect, Parameter, Stimulus
from gimbalcal.estimate.accelerometers.fit_summary import joined, misfit_in_words
from gimbalcal.estimate.extra_effects import Cost, ExtraEffect, sizes_shown_by
from gimbalcal.estimate.fit import fit
from gimbalcal.estimate.static_run.combined import Combined, combined
from gimbalcal.estimate.static_run.run import noise_from, static_parameters, static_readings, static_view
from gimbalcal.inference.information import Solution
from gimbalcal.readings import Readings
from gimbalcal.recording import Recording

MAX_REDUCED_CHI2 = 1.1  # chi^2 per degree of freedom: the header's sigma is not known better than to 5 %


def misfit_of_run(run: Readings, more: Sequence[ExtraEffect]) -> tuple[Cost, Stimulus]:
    """Return chi^2 of every row with the sizes of extra effects beside the baseline, and what the rows experienced."""
    wanted, sizes = static_parameters(run), sizes_shown_by(more, run.recording)
    return fit([static_view(run, (*wanted, *sizes))], wanted).cost_of_sizes(sizes), run.stimulus


def static(
    recording: Recording, start: Sequence[Effect] = (), wanted: Sequence[Parameter] | None = None
) -> Calibration:
    """Calibration from a static run alone: the combinations that it sees, the others at zero with their prior sigma.

    start: effects to linearise at; those whose parameters are not wanted stay as they are. The combined coefficients
    of the paper, of what these effects leave, stand in `stages`.
    """
    run = static_readings(recording)
    wanted = static_parameters(run) if wanted is None else wanted
    found = fit([static_view(run, wanted)], wanted, start)
    solution, effects = found.solution, found.effects
    J = run.jacobian(effects, solution.parameters)
    return found.calibration(
        "static-run",
        Residual(solution.chi2, solution.dof, rms_by_channel(run, effects)),
        outcome=outcome(solution),
        provenance=Provenance(recordings=recording.source, noise=AssumedNoise(from_=noise_from(run))),
        readout=Readout(gimbals=recording.platform.axis_names),
        stages=(stage(run, effects, combined(run, start, effects, solution, J)),),
    )


def outcome(solution: Solution) -> str:
    """One sentence where the residual is more than chance and a sigma stated to a few per cent allow, else ""."""
    if solution.chi2 < MAX_REDUCED_CHI2 * solution.dof:
        return ""
    return joined([f"in the static run {words}" for words in misfit_in_words(solution.chi2, solution.dof)])


def rms_by_channel(run: Readings, effects: Sequence[Effect]) -> dict[str, float]:
    """Root mean square of what the effects leave, SI, by "quantity:axis"."""
    rms = np.sqrt(np.mean(run.residual(effects) ** 2, axis=0))
    return {f"{q}:{axis}": float(x) for (q, axis), x in zip(run.channels, rms, strict=True)}


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
