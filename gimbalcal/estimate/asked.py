"""Effects that a user adds to the three stages: their constants from all recordings, and what each stage fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, values, with_values
from gimbalcal.effects.card import happens_once
from gimbalcal.estimate.accelerometers.positions import Positions
from gimbalcal.estimate.accelerometers.setting import by_turns, problem, set_off, visit_rows, whiten
from gimbalcal.estimate.added import Added, unfit, with_constants
from gimbalcal.estimate.static_run.run import static_parameters, static_readings
from gimbalcal.estimate.static_run.system import linearisation_point
from gimbalcal.forward import Rows
from gimbalcal.inference.information import information, solve
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording import Recording

Misfit = Callable[[Sequence[Effect]], float]  # chi^2 with these absent effects' parameters free


@dataclass(frozen=True)
class Asked:
    """Absent effects with their constants, the constants' values and sigmas, and what was asked for."""

    more: tuple[Added, ...]
    effects: tuple[Effect, ...]
    constants: dict[Parameter, tuple[float, float]]

    def of(self, recording: Recording) -> tuple[tuple[Effect, ...], tuple[Parameter, ...]]:
        """Effects that a recording shows, and their parameters."""
        shown = {a.effect for a in self.more if not unfit(CATALOGUE[a.effect], recording)}
        wanted = (p for a in self.more if a.effect in shown for p in a.parameters(recording.platform.axis_names))
        return tuple(e for e in self.effects if e.id in shown), tuple(wanted)


def asked(more: Sequence[Added], positions: Positions | None, run: Recording | None) -> Asked:
    """The constants of the added effects that fit all recordings best, where nobody stated them."""
    parts: list[tuple[Misfit, Stimulus]] = []
    if positions is not None:
        parts.append(_of_positions(more, positions))
    if run is not None:
        parts.append(_of_run(more, run))
    effects, told = with_constants(more, parts[0][1], lambda effects: sum(part(effects) for part, _ in parts))
    return Asked(tuple(more), effects, told)


def _shown(more: Sequence[Added], recording: Recording) -> dict[str, tuple[Parameter, ...]]:
    gimbals = recording.platform.axis_names
    return {a.effect: a.parameters(gimbals) for a in more if not unfit(CATALOGUE[a.effect], recording)}


def _stages(wanted: Sequence[Parameter], shown: dict[str, tuple[Parameter, ...]]) -> dict[Stage, None]:
    return dict.fromkeys([*(CATALOGUE[p.effect].stage for p in wanted), *(CATALOGUE[i].stage for i in shown)])


def _beside(rows: Rows, J: Array, effects: Sequence[Effect], shown: dict[str, tuple[Parameter, ...]]) -> Array:
    """Columns of the model with those of the added effects beside them."""
    return np.concatenate([J, *(rows.columns(e, shown[e.id]) for e in effects if e.id in shown)], axis=-1)


def _of_positions(more: Sequence[Added], positions: Positions) -> tuple[Misfit, Stimulus]:
    """Every row at rest, about the fit of the baseline, and what the rows experienced."""
    shown, fit = _shown(more, positions.recording), positions.fit
    p = problem(positions.recording, positions.problem.parameters, averaged=False)
    x, e = fit.solution.x, fit.setting
    if any(happens_once(CATALOGUE[a.effect]) for a in more):  # a fault of one position may be what is asked for
        e = np.zeros((p.visits, p.turns))
    else:
        p = p.without([visit for fault in positions.faults for visit in fault.visits])
    effects = with_values(p.effects, p.parameters, x, p.platform.axis_names)
    rows = set_off(p, e).rows(effects, _stages(p.parameters, shown))
    J, G = rows.jacobian(p.parameters), by_turns(p, x, e)
    r = rows.residual + J @ x + apply_matrix(G, e[p.visit])

    def misfit(effects: Sequence[Effect]) -> float:
        wanted = (*p.parameters, *(q for e in effects for q in shown.get(e.id, ())))
        linear = visit_rows(p, _beside(rows, J, effects, shown), r, G)
        return solve(whiten(linear, positions.noise).information(wanted)).chi2

    return misfit, p.stimulus


def _of_run(more: Sequence[Added], recording: Recording) -> tuple[Misfit, Stimulus]:
    """Every row of a static run, about the fit of its baseline, and what the rows experienced."""
    run, shown = static_readings(recording), _shown(more, recording)
    wanted = static_parameters(run)
    effects = linearisation_point(run, (), wanted)
    rows = run.rows(effects, _stages(wanted, shown))
    J = rows.jacobian(wanted)
    r = rows.residual + J @ values(effects, wanted)

    def misfit(effects: Sequence[Effect]) -> float:
        both = (*wanted, *(q for e in effects for q in shown.get(e.id, ())))
        columns = _beside(rows, J, effects, shown) / run.sigma[..., None]
        return solve(information(columns, r / run.sigma, both)).chi2

    return misfit, run.stimulus
