r"""The refit as a calibration: the constants of the model and the causes that were found, with their covariance.

The rows are those of the diagnosis, in its likeliest noise, linearised again at what was found until nothing moves. The
causes keep the sizes that were reported, which are averaged over the noise; the constants are what the rows say beside
them. With estimate (z, x) of constants and causes, its covariance P, and the sizes reported x', P':

.. math:: z' = z + K (x' - x), \quad K = P_{zx} P_{xx}^{-1}, \quad P'_{zz} = P_{zz} + K (P'_{xx} - P_{xx}) K^T

Recordings of one unit add up as information. How the rig stood on the day, and what happened once in a single one of
several, is each recording's own: it is fitted there and not carried.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import reduce
from operator import add

import numpy as np

import gimbalcal
from gimbalcal.calibration import DIRECTION, Calibration, Options, Provenance, Readout, Residual
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.verdict.agreement import ConstantsAgreement, agreement_on_constants
from gimbalcal.diagnose.verdict.pooled_sizes import CommonSizes
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values, with_values
from gimbalcal.estimate.sharing import Scope, scope_of
from gimbalcal.inference.information import Information, Solution, information, solve
from gimbalcal.number import Array
from gimbalcal.recording import when_recorded
from gimbalcal.views.core import Fit, View

ROUNDS = 4  # linearisations at most: each leaves a product of two errors of what is left
FAR = 20.0  # prior sigmas of one step: interchanged positions ask for nonlinearities that no force could be read with
SETTLED = 1e-3  # of a sigma
WIDE = 30.0
FittedConstants = Sequence[tuple[str, float, float]]  # name, value and sigma in SI


@dataclass(frozen=True)
class SizedCauses:
    """Causes with their non-linear constants, and the values x (p,) and covariance (p, p) of `parameters`, SI.

    continuous: constants of each cause, by the ordinal of the cause, that are among the parameters.
    """

    causes: tuple[Candidate, ...]
    constants: tuple[FittedConstants, ...]  # of each cause
    x: Array
    covariance: Array
    continuous: tuple[tuple[int, Parameter], ...] = ()
    averaged: bool = True  # sizes are those averaged over the noises, which a refit keeps; else where it starts

    def without(self, effect_id: str) -> SizedCauses:
        """Return the other causes, whose sizes take up of this one what they can."""
        kept = [i for i, c in enumerate(self.causes) if c.effect != effect_id]
        at = [k for k, p in enumerate(self.parameters) if p.effect != effect_id]
        continuous = tuple((kept.index(i), p) for i, p in self.continuous if i in kept)
        causes, constants = tuple(self.causes[i] for i in kept), tuple(self.constants[i] for i in kept)
        return SizedCauses(causes, constants, self.x[at], self.covariance[np.ix_(at, at)], continuous, averaged=False)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Linear parameters of all causes, then their continuous constants."""
        return (*(p for c in self.causes for p in c.parameters), *(p for _, p in self.continuous))

    def differing(self) -> set[str]:
        """Effects that were found twice with other constants: one effect has one, so their sizes are fitted anew."""
        first: dict[str, tuple[float, ...]] = {}
        values = [tuple(value for _, value, _ in constants) for constants in self.constants]
        return {c.effect for c, v in zip(self.causes, values, strict=True) if v != first.setdefault(c.effect, v)}

    def wide(self) -> dict[Parameter, Parameter]:
        """The parameters with a prior as wide as what was found: a prior that is narrower would hold them back."""
        size = WIDE * np.maximum(np.abs(self.x), np.sqrt(np.diag(self.covariance)))
        return {p: replace(p, sigma=max(p.sigma, float(s))) for p, s in zip(self.parameters, size, strict=True)}

    def held(self, fitted: Sequence[Parameter]) -> dict[Parameter, tuple[float, float]]:
        """Non-linear constants of what was fitted, as parameters: value and sigma. An effect has each of them once."""
        out: dict[Parameter, tuple[float, float]] = {}
        for c, constants in zip(self.causes, self.constants, strict=True):
            every = {p.field: p for p in parameters(CATALOGUE[c.effect], constants=True)}
            for name, value, sigma in constants if any(p.effect == c.effect for p in fitted) else ():
                out.setdefault(every[name], (value, sigma))
        return out


def sized_causes_of(sizes: CommonSizes) -> SizedCauses:
    """Return causes as parameters in SI, their continuous constants among them."""
    causes, constants, x, joint = sizes.causes, sizes.constants, sizes.x, sizes.joint
    scale = np.array([p.sigma for c in causes for p in c.parameters])
    first = {p: i for i, (_, p) in reversed(list(enumerate(joint.constants)))}  # an effect has each constant once
    kept = [i for i, (_, p) in enumerate(joint.constants) if first[p] == i]
    continuous = tuple(joint.constants[i] for i in kept)
    values = [value for j, p in continuous for name, value, _ in constants[j] if name == p.field]
    at = [*range(len(x)), *(len(x) + i for i in kept)]
    return SizedCauses(causes, constants, np.append(x * scale, values), joint.covariance[np.ix_(at, at)], continuous)


def calibrated(
    fits: Sequence[tuple[Fit, Node, Sequence[int]]],
    sized: SizedCauses,
    outcome: str,
    known: Calibration | None = None,
) -> tuple[Calibration, ConstantsAgreement | None]:
    """The calibration that a diagnosis ends in, and how well several recordings agree on its constants.

    fits: the rows of each recording, their noise, and which of the causes it shows; known: the calibration that the
    diagnosis started from, for what it holds and these recordings do not.
    """
    here = [_RecordingRows(fit, node, sized, tuple(which), alone=len(fits) == 1) for fit, node, which in fits]
    solution, effects, between = _refitted(here, sized)
    mine = solution.parameters
    constants = {p: size for p, size in sized.held(mine).items() if p not in mine}
    kept = [p for p in (known.parameters if known else ()) if p not in mine and p not in constants]
    kept = [p for p in kept if p.effect in {e.id for s in here for e in s.fit.effects}]
    wanted, n = (*mine, *constants, *kept), len(mine)
    P = np.zeros((len(wanted), len(wanted)))
    P[:n, :n] = solution.covariance
    P[range(n, n + len(constants)), range(n, n + len(constants))] = [sigma**2 for _, sigma in constants.values()]
    if kept and known is not None:
        at = [known.parameters.index(p) for p in kept]
        P[n + len(constants) :, n + len(constants) :] = known.covariance[np.ix_(at, at)]
    calibration = Calibration(
        method="diagnosis",
        effects=tuple(e for e in effects if e.id in {p.effect for p in wanted}),
        parameters=wanted,
        covariance=P,
        unobservable=solution.unobservable,
        residual=Residual(solution.chi2, solution.dof, _rms(here, effects)),
        outcome=" ".join(filter(None, (outcome, between.in_words if between else ""))),
        provenance=replace(
            origin([s.fit.view for s in here], [c.label for c in sized.causes]),
            agreement=between.to_dict() if between else None,
        ),
        readout=Readout(gimbals=here[0].fit.view.readout.gimbals),
    )
    return calibration, between


def calibrated_without(
    effect_id: str, fits: Sequence[tuple[Fit, Node, Sequence[int]]], sized: SizedCauses, known: Calibration | None
) -> Calibration:
    """Return the calibration of the same rows, in the same noise, by a model without an effect that was found."""
    kept = [i for i, c in enumerate(sized.causes) if c.effect != effect_id]
    rest = [(fit, node, [kept.index(i) for i in which if i in kept]) for fit, node, which in fits]
    return calibrated(rest, sized.without(effect_id), "", known)[0]


def origin(views: Sequence[View], causes: Sequence[str]) -> Provenance:
    """Return the provenance of a calibration of a diagnosis, with the files behind the views."""
    recordings = list(dict.fromkeys(v.source for v in views))
    return Provenance(
        recordings=tuple(file for r in recordings for file in r.source),
        version=gimbalcal.__version__,
        options=Options(direction=DIRECTION, method="diagnosis", causes=tuple(causes)),
        recorded=when_recorded(recordings),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )


@dataclass(frozen=True)
class _RecordingRows:
    """One recording: its rows, their noise, and the causes that it shows."""

    fit: Fit
    node: Node
    sized: SizedCauses
    which: tuple[int, ...]
    alone: bool

    @property
    def wanted(self) -> tuple[Parameter, ...]:
        """The parameters that are fitted: constants of the model, and causes."""
        causes = [p for i in self.which for p in self.sized.causes[i].parameters]
        causes += [p for i, p in self.sized.continuous if i in self.which]
        return tuple(dict.fromkeys([*self.fit.parameters, *causes]))

    @property
    def own(self) -> tuple[Parameter, ...]:
        """The parameters that are this recording's own and not carried."""
        once = {self.sized.causes[i].effect for i in self.which if self.sized.causes[i].once}
        stood = {p for p in self.fit.parameters if scope_of(p.effect) is Scope.INSTALLATION}
        return tuple(p for p in self.wanted if p.effect in once or p in stood)

    def model(self) -> tuple[Effect, ...]:
        """The model of the baseline with the causes at the sizes that were reported."""
        effects, names = self.fit.effects, self.fit.view.stimulus.axis_names
        at = np.cumsum([0, *(len(c.parameters) for c in self.sized.causes)])
        for i in self.which:
            c = self.sized.causes[i]
            if c.effect not in {e.id for e in effects}:
                at_constants = tuple((name, value) for name, value, _ in self.sized.constants[i])
                effects = (*effects, c.absent(self.fit.view.stimulus, at_constants))
            size = values(effects, c.parameters) + self.sized.x[at[i] : at[i + 1]]
            effects = with_values(effects, c.parameters, size, names)
        return effects

    def information(self, effects: Sequence[Effect]) -> Information:
        """Return the information of the rows on the wanted parameters, linearised at effects, its own eliminated."""
        rows = self.fit.view.evaluate(effects).over(self.fit.sigma)
        A = self.node.whiten(self.fit.reduced(rows.jacobian(self.wanted)))
        r = self.node.whiten(self.fit.reduced(rows.residual[:, :, None]))[:, 0]
        wide = self.sized.wide()
        info = information(A, r + A @ values(effects, self.wanted), [wide.get(p, p) for p in self.wanted])
        return info if self.alone else info.without([wide.get(p, p) for p in self.own])


def _refitted(
    here: Sequence[_RecordingRows], sized: SizedCauses
) -> tuple[Solution, tuple[Effect, ...], ConstantsAgreement | None]:
    """Return constants and causes from all recordings, all effects with these values, and how recordings agree."""
    models = [s.model() for s in here]
    start = dict(zip(sized.parameters, values(_union(models), sized.parameters), strict=True))
    before: Array | float = np.inf
    for _ in range(ROUNDS):
        infos = [s.information(m) for s, m in zip(here, models, strict=True)]
        solution = solve(reduce(add, infos))
        narrow = {w: p for p, w in sized.wide().items()}
        solution = replace(solution, parameters=tuple(narrow.get(p, p) for p in solution.parameters))
        solution = _limited_step(_with_sizes(solution, sized, start), values(_union(models), solution.parameters))
        names = here[0].fit.view.stimulus.axis_names
        models = [
            with_values(m, mine, values_of(solution, mine), names)
            for s, m in zip(here, models, strict=True)
            for mine in [tuple(p for p in s.wanted if p in solution.parameters)]
        ]
        if np.all(np.abs(solution.x - before) <= SETTLED * solution.sigma):
            break
        before = solution.x
    effects = with_values(_union(models), solution.parameters, solution.x, names)
    return solution, effects, agreement_on_constants(infos) if len(infos) > 1 else None


def _limited_step(solution: Solution, start: Array) -> Solution:
    """The solution, or as much of the way to it from `start` (p,) as a linear model can be trusted over."""
    farthest = float((np.abs(solution.x - start) / [p.sigma for p in solution.parameters]).max(initial=0.0))
    return solution if farthest <= FAR else replace(solution, x=start + FAR / farthest * (solution.x - start))


def values_of(solution: Solution, wanted: Sequence[Parameter]) -> Array:
    """Values (q,) of some parameters of a solution."""
    return np.array([solution.x[solution.parameters.index(p)] for p in wanted])


def _with_sizes(s: Solution, sized: SizedCauses, sizes: Mapping[Parameter, float]) -> Solution:
    """The solution with the causes at their sizes and covariance, the others as they go with it (module docstring)."""
    mine = [p for p in sized.parameters if p in s.parameters and p.effect not in sized.differing()]
    if not mine or not sized.averaged:
        return s
    c = [s.parameters.index(p) for p in mine]
    at = [sized.parameters.index(p) for p in mine]
    P = s.covariance
    scale = s.sigma[c]  # of a covariance with its prior no direction is without variance
    K = np.linalg.solve(P[np.ix_(c, c)] / np.outer(scale, scale), (P[:, c] / scale).T).T / scale
    new = sized.covariance[np.ix_(at, at)]
    x = s.x + K @ (np.array([sizes[p] for p in mine]) - s.x[c])
    covariance = P + K @ (new - P[np.ix_(c, c)]) @ K.T
    covariance[c, :], covariance[:, c] = new @ K.T, K @ new
    return replace(s, x=x, covariance=(covariance + covariance.T) / 2)


def _union(models: Sequence[Sequence[Effect]]) -> tuple[Effect, ...]:
    """Effects of all recordings, each once."""
    return tuple({e.id: e for m in reversed(models) for e in m}.values())


def _rms(here: Sequence[_RecordingRows], effects: Sequence[Effect]) -> dict[str, float]:
    """Root mean square of what is left, SI, by "quantity:axis"; of the first recording that has the channel."""
    out: dict[str, float] = {}
    for s in here:
        mine = {p.effect for p in s.wanted} | {e.id for e in s.fit.effects}
        residual = s.fit.view.evaluate([e for e in effects if e.id in mine]).residual
        for (quantity, axis), column in zip(s.fit.view.channels, residual.T, strict=True):
            out.setdefault(f"{quantity}:{axis}", float(np.sqrt(np.mean(column**2))))
    return out
