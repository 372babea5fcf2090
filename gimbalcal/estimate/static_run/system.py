r"""System level: what a static run says about the accelerometers, all channels in one fit.

Specific force, gimbal readouts and attitude error of a run are fitted together with the exact forward model. It sees
nine combinations of the twelve linear residual parameters of Wu et al. (2018), section 5, and no evaluation of the
same channels can see more: the bias of x and its lean towards the pole, for one, pull the constant part of f_x alike.
Those combinations come back by name. The paper's own road, squared norm and Fourier coefficients, is in
`force_filter`, `harmonics` and `combined`; both roads must agree.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.calibration import Calibration, Readout, Residual, StageResult
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, values, with_values
from gimbalcal.estimate.accelerometers.fit_summary import joined, misfit_in_words
from gimbalcal.estimate.extra_effects import Cost, ExtraEffect, columns_of_sizes, sizes_shown_by
from gimbalcal.estimate.fit import gauss_newton, range_of_constants, solve_about
from gimbalcal.estimate.static_run.combined import Combined, combined
from gimbalcal.estimate.static_run.run import information_of_rows, noise_from, static_parameters, static_readings
from gimbalcal.inference.information import Information, Solution, information, prior, solve
from gimbalcal.number import Array
from gimbalcal.readings import Readings
from gimbalcal.recording import Recording

MAX_REDUCED_CHI2 = 1.1  # chi^2 per degree of freedom: the header's sigma is not known better than to 5 %
LINEARISATION_ROWS = 300  # rows for a first solution to linearise at: good to 1e-6, its square is nothing
MAX_STEPS, TOLERANCE = 6, 1e-3  # prior sigmas: its product with a tilt is 1e-4 arcsec


def static_information(
    recording: Recording,
    effects: Sequence[Effect] = (),
    wanted: Sequence[Parameter] | None = None,
    known: Information | None = None,
) -> Information:
    """Information of a static run about the wanted parameters (default: the baseline).

    Linearised at `effects` and what the run adds to them, together with what is `known` of other recordings, so that
    products of a bias and a turn that only those see come out right; effects that are not wanted are held.
    """
    run = static_readings(recording)
    wanted = tuple(wanted) if wanted is not None else static_parameters(run)
    return information_of_rows(run, linearisation_point(run, effects, wanted, known), wanted)


def linearisation_point(
    run: Readings, effects: Sequence[Effect], wanted: Sequence[Parameter], known: Information | None = None
) -> tuple[Effect, ...]:
    """Effects with the wanted parameters where part of the rows, and what is known of them, puts them.

    A model without nonlinear constants is linear enough for a part of the rows. Directions that are seen nowhere end at
    zero, as they do in the solution: a turn of 100 arcsec that is shared out otherwise there would leave its product
    with a tilt, 0.05 arcsec, of which a day knows a quarter.
    """
    bounds = range_of_constants(wanted, run.stimulus)
    few, names = run.thinned(LINEARISATION_ROWS) if bounds is None else run, run.recording.platform.axis_names
    union = tuple(wanted) if known is None else tuple(dict.fromkeys((*known.parameters, *wanted)))
    scale = prior(union)[1]

    def linearise(x: Array) -> Information:
        info = information_of_rows(few, with_values(effects, union, x, names), wanted)
        return info if known is None else known + info

    def arrived(x: Array, target: Array, _: Solution) -> bool:
        return bool(np.max(np.abs(target - x) / scale) < TOLERANCE)

    start = values(effects, union)
    if bounds is None:
        x = gauss_newton(linearise, start, limit=MAX_STEPS, arrived=arrived).solution.x
    else:
        x = gauss_newton(linearise, start, range_of_constants(union, run.stimulus)).solution.x
    return with_values(effects, union, x, names)


def misfit_of_run(recording: Recording, more: Sequence[ExtraEffect]) -> tuple[Cost, Stimulus]:
    """Chi^2 of every row with the sizes of extra effects beside the baseline, and what the rows experienced."""
    run, sizes = static_readings(recording), sizes_shown_by(more, recording)
    baseline = static_parameters(run)
    start = linearisation_point(run, (), baseline)
    wanted = (*baseline, *sizes)
    rows = run.rows(start, dict.fromkeys(CATALOGUE[p.effect].stage for p in wanted))
    J = rows.jacobian(baseline)
    r = (rows.residual + J @ values(start, baseline)) / run.sigma

    def misfit(effects: Sequence[Effect]) -> float:
        every = np.concatenate([J, columns_of_sizes(rows, effects, sizes)], axis=-1) / run.sigma[..., None]
        return solve(information(every, r, wanted)).chi2

    return misfit, run.stimulus


def static(
    recording: Recording, start: Sequence[Effect] = (), wanted: Sequence[Parameter] | None = None
) -> Calibration:
    """Calibration from a static run alone: the combinations that it sees, the others at zero with their prior sigma.

    start: effects to linearise at; those whose parameters are not wanted stay as they are. The combined coefficients
    of the paper, of what these effects leave, stand in `stages`.
    """
    run = static_readings(recording)
    wanted = tuple(wanted) if wanted is not None else static_parameters(run)
    effects = linearisation_point(run, start, wanted)
    J, bounds = run.jacobian(effects, wanted), range_of_constants(wanted, run.stimulus)
    solution = solve_about(information_of_rows(run, effects, wanted, J), values(effects, wanted), bounds)
    effects = with_values(effects, wanted, solution.x, recording.platform.axis_names)
    return Calibration(
        method="static-run",
        effects=effects,
        parameters=wanted,
        covariance=solution.covariance,
        unobservable=tuple(u.to_dict() for u in solution.unobservable),
        residual=Residual(solution.chi2, solution.dof, rms_by_channel(run, effects)),
        outcome=outcome(solution),
        provenance={
            "recordings": recording.files,
            "noise": {"from": noise_from(run)},
        },
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
