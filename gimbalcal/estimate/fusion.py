r"""Device level and system level in one estimate: what one stage cannot see another supplies.

Both stages state the same parameters of Eq. (6) as square-root information, so fusion is addition and needs no
transfer of "residuals" from stage to stage. Wu et al. (2018) stop short of it: their third stage overwrites twelve
coefficients. What is unobservable in both keeps its prior sigma and is named.

The encoders are the same in both stages, and so are their zeros: `gimbal_zero` is counted in the sense of Table 1 in
either, although the static run reads S_t and q, which run the other way (`Platform.sense`). With the wrong sign and a
level base the turn of the triad about z would seem to be determined, and it is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gimbalcal.calibration import Calibration, Residual, StageResult
from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.errors import amount
from gimbalcal.estimate.accelerometers.position_fit import Positions
from gimbalcal.estimate.fit import fit, information_of
from gimbalcal.estimate.sharing import agreement
from gimbalcal.estimate.static_run.system import outcome, static_view
from gimbalcal.inference.information import Information, Solution, solve
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.readings import Readings

SIGNIFICANCE = 1e-4  # probability below which two stages that are both right would differ so much


def both_levels(
    positions: Positions, run: Readings, effects: Sequence[Effect], wanted: Sequence[Parameter]
) -> tuple[Information, Information, Solution]:
    """Fit positions and a static run together, and return the information of each about its parameters there.

    The base tilt and whatever else is of the run alone does not act in the positions. `effects` are where the fit
    begins.
    """
    device, level, mine = positions.view, static_view(run, wanted), positions.fit.parameters
    fitted = fit([device, level], tuple(dict.fromkeys((*mine, *wanted))), effects)
    own = information_of([device], fitted.effects, mine, fitted.local[:1])
    return own, information_of([level], fitted.effects, wanted), fitted.solution


def fuse(
    device: Information, static: Information, before: Calibration, together: Solution | None = None
) -> Calibration:
    """Add device-level and static-run information about common parameters, and solve, unless the solution is given.

    device, static: linearised at the same effects; `before` is the device-level calibration, from which effects that
    neither informs about, and the provenance, are kept. `outcome` says so where the two stages contradict each other.
    """
    names = tuple(axis.name for axis in SPACE_STABLE.axes)
    together = together or solve(device + static)
    alone = solve(device), solve(static)
    return replace(
        before,
        method="three-stage",
        effects=with_values(before.effects, together.parameters, together.x, names),
        parameters=together.parameters,
        covariance=together.covariance,
        unobservable=together.unobservable,
        residual=Residual(together.chi2, together.dof, before.residual.rms),
        outcome=". ".join(filter(None, (before.outcome, outcome(alone[1]), contradiction(together, *alone)))),
        stages=(_gain(together, alone[0], before.stages[-1].rms if before.stages else 0.0),),
    )


def contradiction(together: Solution, device: Solution, static: Solution) -> str:
    """Return a sentence where the stages disagree on what both see, "" where they do not."""
    # a stage that its own model does not explain proves nothing against the other
    noise = max(1.0, device.chi2 / max(device.dof, 1), static.chi2 / max(static.dof, 1))
    result = agreement(together, [device, static], noise)
    if result.p_value >= SIGNIFICANCE:
        return ""
    return (
        f"The multi-position recording and the static run contradict each other: chi^2 of {result.rise:.0f} for the "
        f"{result.combinations} combinations that both see (probability {result.p_value:.1g}); the unit changed in "
        "between or a model is wrong"
    )


def _gain(together: Solution, device: Solution, rms: float) -> StageResult:
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
        f"seen by neither stage: {amount(len(together.unobservable), 'direction')}",
    )
