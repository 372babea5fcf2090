r"""One fit of what was named: constants of the model and causes by the rows of all recordings of a unit.

Rows are linearised again at the estimate until nothing moves, and the noise is averaged over: with the estimate x_k and
its covariance P_k in noise k of probability p_k,

.. math:: \hat x = \sum_k p_k x_k, \qquad P = \sum_k p_k \left[ P_k + (x_k - \hat x)(x_k - \hat x)^T \right]

Recordings of one unit add up as information. Sizes of causes are those beside constants that each of several recordings
has for itself, as a unit may have changed in between; the constants are what all rows say beside these sizes. With the
estimate (z, x) of constants and causes by all rows, its covariance P, and the sizes x' with P',

.. math:: z' = z + K (x' - x), \quad K = P_{zx} P_{xx}^{-1}, \quad P'_{zz} = P_{zz} + K (P'_{xx} - P_{xx}) K^T

How the rig stood on the day, and what happened once in a single one of several, is each recording's own: it is
eliminated there and not carried. Constants of causes that no fit can move (whole numbers, instants, places) are those
at which all recordings together fit best.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property, reduce
from operator import add

import numpy as np

import gimbalcal
from gimbalcal.calibration import DIRECTION, Calibration, Options, Provenance, Readout, Residual
from gimbalcal.diagnose.evidence.projection import project, rows_like
from gimbalcal.diagnose.library.assemble import columns_at
from gimbalcal.diagnose.library.candidates import Candidate, Constants
from gimbalcal.diagnose.search.fitted_causes import FittedCauses, columns_of_causes, constant_value, fit_causes
from gimbalcal.diagnose.search.ranking import Ranking, Search
from gimbalcal.diagnose.verdict.agreement import ConstantsAgreement, agreement_on_constants
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values, with_values
from gimbalcal.effects.effect import constants
from gimbalcal.effects.grids import kind
from gimbalcal.errors import InputError
from gimbalcal.estimate.sharing import Agreement, Scope, agreement, scope_of
from gimbalcal.inference.gauss_newton import gauss_newton
from gimbalcal.inference.information import (
    MIN_SIGNAL_TO_NOISE,
    Information,
    Solution,
    information,
    mean_information,
    solve,
)
from gimbalcal.number import Array
from gimbalcal.recording import when_recorded
from gimbalcal.views.core import View, range_of_constants

UNLIKELY = 1e-3  # probability of a noise below which it is left out of the mean
SETTLED = 1e-3  # of a sigma
MAX_PRIOR_SIGMAS = 20.0  # of all steps: interchanged positions ask for nonlinearities that no force is read with
UNREADABLE = 1e100  # misfit of constants with which no force could have been read
WIDE = 30.0  # sigmas that the prior of a cause spans at least: what rows know less well than a prior is held at zero


@dataclass(frozen=True, eq=False)
class RecordingPart:
    """One recording: its search, the causes that it shows fitted to it alone, and their ordinals among all causes.

    constants: of each of these causes, common to all recordings.
    """

    search: Search
    fit: FittedCauses
    ordinals: tuple[int, ...]
    constants: tuple[Constants, ...]

    @property
    def causes(self) -> tuple[Candidate, ...]:
        """The causes that the recording shows."""
        return tuple(self.search.library.candidates[m] for m in self.fit.members)

    def cause(self, ordinal: int) -> Candidate:
        """Return a cause as the recording shows it."""
        return self.causes[self.ordinals.index(ordinal)]

    def significance(self, ordinal: int) -> float:
        """Return the significance [sigma] of a cause beyond all else; zero where it is not shown."""
        return self.fit.significance[self.ordinals.index(ordinal)] if ordinal in self.ordinals else 0.0

    def spread(self, ordinal: int) -> dict[str, float]:
        """Return how far each constant of a cause may be off among the values that were tried, SI."""
        each = constant_value(self.search, self.fit, self.ordinals.index(ordinal)) if ordinal in self.ordinals else ()
        return {name: sigma for name, _, sigma in each}

    @property
    def columns(self) -> Array:
        """The columns (n, C, p) of the causes per prior sigma."""
        return columns_of_causes(self.search, self.fit, self.constants)

    @cached_property
    def wanted(self) -> tuple[Parameter, ...]:
        """The parameters that are fitted: constants of the model, sizes of the causes and their smooth constants."""
        sizes = [p for c in self.causes for p in c.parameters]
        smooth = [p for c in self.causes for p in _constants_of(c.effect, smooth=True)]
        return tuple(dict.fromkeys([*self.search.fit.parameters, *sizes, *smooth]))

    def own(self, *scopes: Scope) -> tuple[Parameter, ...]:
        """Return the parameters of the model that are constants of such a scope, and what happened once."""
        once = {c.effect for c in self.causes if c.once}
        own = {p for p in self.search.fit.parameters if scope_of(p.effect) in scopes}
        return tuple(p for p in self.wanted if p.effect in once or p in own)

    def only(self, ordinals: Mapping[int, int]) -> RecordingPart:
        """Return the recording with some of the causes, by their ordinals and the new ones of these."""
        kept = [n for n, ordinal in enumerate(self.ordinals) if ordinal in ordinals]
        fit = fit_causes(self.search, [self.fit.members[n] for n in kept])
        fit = replace(fit, weights=self.fit.weights, projection=self.fit.projection)
        named = tuple(ordinals[self.ordinals[n]] for n in kept)
        return RecordingPart(self.search, fit, named, tuple(self.constants[n] for n in kept))

    def start(self) -> tuple[Effect, ...]:
        """Return the model of the baseline with the causes as this recording alone shows them."""
        effects, s, at = self.search.fit.effects, self.search.fit.view.stimulus, 0
        for c, own in zip(self.causes, self.constants, strict=True):
            size = self.fit.x[at : at + len(c.parameters)] * [p.sigma for p in c.parameters]
            at += len(c.parameters)
            if c.effect not in {e.id for e in effects}:
                effects = (*effects, c.absent(s, own))
            effects = with_values(effects, c.parameters, values(effects, c.parameters) + size, s.axis_names)
        return effects

    def information(self, effects: Sequence[Effect], wide: Mapping[Parameter, Parameter]) -> Information:
        """Return the information of the rows about all that is fitted, linearised at effects, with `wide` priors."""
        fit, priors = self.search.fit, [wide.get(p, p) for p in self.wanted]
        rows = fit.view.evaluate(effects).over(fit.sigma)
        x = values(effects, self.wanted)
        A = fit.reduced(np.concatenate([rows.jacobian(self.wanted), rows.residual[:, :, None]], axis=-1))
        A[:, -1] += A[:, :-1] @ x
        likely = np.flatnonzero(self.fit.weights > UNLIKELY)
        white = (self.search.projections[k].node.whiten(A) for k in likely)
        every = [information(W[:, :-1], W[:, -1], priors) for W in white]
        return mean_information(every, self.fit.weights[likely] / self.fit.weights[likely].sum())


def parts_of(c: Ranking, members: Sequence[int]) -> tuple[RecordingPart, ...]:
    """Return each recording with the causes that it shows, fitted to it, and their constants common to all."""
    own = [fit_causes(s, c.within(members, k)) for k, s in enumerate(c.searches)]
    common = [_common(c, members, j, own) for j in range(len(members))]
    out = []
    for k, s in enumerate(c.searches):
        ordinals = _ordinals(c, members, k)
        shared = tuple(common[j] or _variant(s, own[k], n) for n, j in enumerate(ordinals))
        out.append(RecordingPart(s, own[k], ordinals, shared))
    return tuple(out)


def _ordinals(c: Ranking, members: Sequence[int], recording: int) -> tuple[int, ...]:
    return tuple(j for j, m in enumerate(members) if recording in c.sees(m))


def _variant(s: Search, f: FittedCauses, n: int) -> Constants:
    return s.library.candidates[f.members[n]].variants[f.variants[n]].constants


def _common(c: Ranking, members: Sequence[int], j: int, own: Sequence[FittedCauses]) -> Constants:
    """The constants of member j, of all that any recording tried, at which all fit best; none where one recording is.

    What follows its size by secants has none.
    """
    recordings, of = c.sees(members[j]), c.library.candidates[members[j]]
    if len(recordings) == 1 or not of.variants[0].constants or not CATALOGUE[of.effect].linear:
        return ()
    candidates = {k: c.searches[k].library.candidates[c.within((members[j],), k)[0]] for k in recordings}
    tried = list(dict.fromkeys(v.constants for one in candidates.values() for v in one.variants))
    total = np.zeros(len(tried))
    for k, one in candidates.items():
        s, n = c.searches[k], _ordinals(c, members, k).index(j)
        rest = [i for o in range(len(own[k].members)) if o != n for i in own[k].columns_of(s, o)]
        columns = [columns_at(s.fit, one, at) for at in tried]
        X = np.concatenate([s.library.X[:, rest], *columns], axis=1)
        p = project(own[k].projection.node, rows_like(s.rows, X))
        width = columns[0].shape[1]
        starts = [len(rest) + width * i for i in range(len(tried))]
        total += [p.explained(range(at, at + width), range(len(rest))) / 2 for at in starts]
    return tried[int(np.argmax(total))]


@dataclass(frozen=True, eq=False)
class JointFit:
    """Constants of the model and causes, fitted to all recordings of a unit.

    effects: those of all recordings with the estimate; each: the information of every recording, whose `wide` priors
    of causes span what was found.
    """

    parts: tuple[RecordingPart, ...]
    causes: tuple[Candidate, ...]
    effects: tuple[Effect, ...]
    solution: Solution
    each: tuple[Information, ...]
    wide: Mapping[Parameter, Parameter]

    def estimate(self, wanted: Sequence[Parameter]) -> tuple[Array, Array]:
        """Return values and sigmas (p,) of parameters, SI; of what is one recording's own by this one alone."""
        if all(p in self.solution.parameters for p in wanted):
            at = [self.solution.parameters.index(p) for p in wanted]
            return self.solution.x[at], self.solution.sigma[at]
        return self.estimate_by(next(k for k, part in enumerate(self.parts) if set(wanted) <= set(part.wanted)), wanted)

    def estimate_by(self, recording: int, wanted: Sequence[Parameter]) -> tuple[Array, Array]:
        """Return values and sigmas (p,) of sizes of causes by one recording, SI."""
        keep = [self.wide[p] for p in wanted]
        info = self.each[recording].at(_smooth(self.each[recording]))
        solution = solve(info.without([p for p in info.parameters if p not in keep], flat=True))
        at = [solution.parameters.index(p) for p in keep]
        return solution.x[at], solution.sigma[at]

    def sizes(self, part: RecordingPart) -> Array:
        """Return the sizes (p,) of the causes that a recording shows, in prior sigmas."""
        wanted = [p for c in part.causes for p in c.parameters]
        return self.estimate(wanted)[0] / np.array([p.sigma for p in wanted])

    def chosen_constants(self, ordinal: int) -> list[tuple[Parameter, float, float]]:
        """Return the nonlinear constants of a cause: parameter, value and sigma in SI.

        A constant that no fit can move has the sigma of the values that were tried, the mean of all recordings.
        """
        effect_id, out = self.causes[ordinal].effect, []
        shown = [part for part in self.parts if ordinal in part.ordinals]
        named = dict(shown[0].constants[shown[0].ordinals.index(ordinal)])
        for p in _constants_of(effect_id):
            if p in self.solution.parameters:
                x, sigma = self.estimate([p])
                out.append((p, float(x[0]), float(sigma[0])))
            elif p.field in named:
                spread = np.array([part.spread(ordinal)[p.field] for part in shown])
                weight = float((spread[spread > 0] ** -2.0).sum())
                out.append((p, named[p.field], weight**-0.5 if weight > 0 else 0.0))
        return out

    def agreement_on(self, ordinal: int) -> Agreement:
        """Return how well the recordings agree on the size of a cause."""
        own = {self.wide[p] for p in self.causes[ordinal].parameters}
        shown = [info for part, info in zip(self.parts, self.each, strict=True) if ordinal in part.ordinals]
        if len(shown) == 1:
            return Agreement(0.0, 0, 1.0)
        each = [info.without([p for p in info.parameters if p not in own], flat=True) for info in shown]
        return agreement(solve(reduce(add, each)), [solve(info) for info in each])

    def without(self, effect_id: str) -> JointFit:
        """Return the fit to the same rows, in the same noise, of a model without an effect that was found."""
        kept = [i for i, c in enumerate(self.causes) if c.effect != effect_id]
        parts = [part.only({old: new for new, old in enumerate(kept)}) for part in self.parts]
        return joint_fit(parts, [self.causes[i] for i in kept])

    @cached_property
    def between(self) -> ConstantsAgreement | None:
        """How well several recordings agree on the constants of the unit; None for one."""
        return agreement_on_constants(_carried(self.parts, self.each, self.wide)) if len(self.each) > 1 else None

    def calibration(self, known: Calibration | None) -> Calibration:
        """Return the fit as a calibration; known: that which the diagnosis started from.

        Of `known` it holds what these recordings do not.
        """
        mine, effects = self.solution.parameters, {e.id for part in self.parts for e in part.search.fit.effects}
        chosen = {p: sigma for k in range(len(self.causes)) if self._is_carried(k)
                  for p, _, sigma in self.chosen_constants(k) if p not in mine}  # fmt: skip
        kept = [p for p in (known.parameters if known else ()) if p not in mine and p not in chosen]
        kept = [p for p in kept if p.effect in effects]
        wanted, n = (*mine, *chosen, *kept), len(mine)
        P = np.zeros((len(wanted), len(wanted)))
        P[:n, :n] = self.solution.covariance
        P[range(n, n + len(chosen)), range(n, n + len(chosen))] = [sigma**2 for sigma in chosen.values()]
        if kept and known is not None:
            at = [known.parameters.index(p) for p in kept]
            P[n + len(chosen) :, n + len(chosen) :] = known.covariance[np.ix_(at, at)]
        views = [part.search.fit.view for part in self.parts]
        return Calibration(
            method="diagnosis",
            effects=tuple(e for e in self.effects if e.id in {p.effect for p in wanted}),
            parameters=wanted,
            covariance=P,
            unobservable=self.solution.unobservable,
            residual=Residual(self.solution.chi2, self.solution.dof, self._rms()),
            outcome=self.between.in_words if self.between else "",
            provenance=replace(
                origin(views, [c.label for c in self.causes]),
                agreement=self.between.to_dict() if self.between else None,
            ),
            readout=Readout(gimbals=views[0].readout.gimbals),
        )

    def _is_carried(self, ordinal: int) -> bool:
        """Return whether a cause is a part of the solution, and not one recording's own."""
        return any(p.effect == self.causes[ordinal].effect for p in self.solution.parameters)

    def _rms(self) -> dict[str, float]:
        """Root mean square of what is left, SI, by "quantity:axis"; of the first recording that has the channel."""
        out: dict[str, float] = {}
        for part in self.parts:
            view, mine = part.search.fit.view, {p.effect for p in part.wanted} | {e.id for e in part.search.fit.effects}
            residual = view.evaluate([e for e in self.effects if e.id in mine]).residual
            for (quantity, axis), column in zip(view.channels, residual.T, strict=True):
                out.setdefault(f"{quantity}:{axis}", float(np.sqrt(np.mean(column**2))))
        return out


def joint_fit(parts: Sequence[RecordingPart], causes: Sequence[Candidate]) -> JointFit:
    """Fit constants of the model and causes to the recordings of a unit; `causes` as all recordings together have them.

    Raises InputError where no constants fit the readings.
    """
    models = [part.start() for part in parts]
    wide = _wide(parts, models)
    if len(parts) == 1:
        solution, each = _least_squares(parts[0], models[0], wide)
    else:
        each = tuple(part.information(m, wide) for part, m in zip(parts, models, strict=True))
        solution = _with_sizes(solve(reduce(add, _carried(parts, each, wide))), _pooled(parts, each, wide))
    narrow, names = {w: p for p, w in wide.items()}, parts[0].search.fit.view.stimulus.axis_names
    solution = replace(solution, parameters=tuple(narrow.get(p, p) for p in solution.parameters))
    value = dict(zip(solution.parameters, solution.x, strict=True))
    effects: dict[str, Effect] = {}
    for part, model in zip(parts, models, strict=True):
        mine = [p for p in part.wanted if p in value]
        for e in with_values(model, mine, np.array([value[p] for p in mine]), names):
            effects.setdefault(e.id, e)
    return JointFit(tuple(parts), tuple(causes), tuple(effects.values()), solution, each, wide)


def _least_squares(
    part: RecordingPart, model: Sequence[Effect], wide: Mapping[Parameter, Parameter]
) -> tuple[Solution, tuple[Information, ...]]:
    """Return the fit to one recording, linearised again until nothing moves, and the information about it."""
    wanted, s = part.wanted, part.search.fit.view.stimulus
    priors, last = [wide.get(p, p) for p in wanted], dict[bytes, Information]()

    def linearise(x: Array) -> Information:
        last.clear()
        try:
            last[x.tobytes()] = part.information(with_values(model, wanted, x, s.axis_names), wide)
        except InputError:  # no force reads what was read: further than the model goes
            last[x.tobytes()] = Information(tuple(priors), np.append(np.zeros(len(wanted)), UNREADABLE)[None], 1)
        return last[x.tobytes()]

    def arrived(_: int, x: Array, solution: Solution) -> bool:
        return bool(np.all(np.abs(solution.x - x) <= SETTLED * solution.sigma))

    start, scale = values(model, wanted), np.array([p.sigma for p in priors])

    def farthest(x: Array) -> float:
        return float((np.abs(x - start) / scale).max(initial=0.0))

    def diverged(x: Array) -> bool:
        return farthest(x) > MAX_PRIOR_SIGMAS

    bounds = range_of_constants(wanted, s)
    solution, _ = gauss_newton(linearise, start, bounds, MIN_SIGNAL_TO_NOISE, True, arrived, diverged)
    share = MAX_PRIOR_SIGMAS / max(farthest(solution.x), MAX_PRIOR_SIGMAS)  # as far as a model can be trusted
    return replace(solution, x=start + share * (solution.x - start)), tuple(last.values())


def _pooled(
    parts: Sequence[RecordingPart], each: Sequence[Information], wide: Mapping[Parameter, Parameter]
) -> Solution:
    """Return the causes by all recordings, the constants of the model free in each.

    Sizes are those at the constants of the causes that fit all recordings best; their covariance is that of both.
    """
    own = ([wide.get(p, p) for p in part.own(*Scope)] for part in parts)
    info = reduce(add, (info.without(rest, flat=True) for info, rest in zip(each, own, strict=True)))
    solution = solve(info)
    constant, sizes = _smooth(info), solve(info.at(_smooth(info)))
    value = constant | dict(zip(sizes.parameters, sizes.x, strict=True))
    return replace(solution, x=np.array([value[p] for p in info.parameters]))


def _smooth(info: Information) -> dict[Parameter, float]:
    """Return the smooth constants of causes with the values about which rows are linearised."""
    return {p: p.mean for p in info.parameters if p.field in {f.name for f in constants(CATALOGUE[p.effect])}}


def _carried(
    parts: Sequence[RecordingPart], each: Sequence[Information], wide: Mapping[Parameter, Parameter]
) -> list[Information]:
    """Return the information of each of several recordings about what holds in the others as well."""
    own = ([wide.get(p, p) for p in part.own(Scope.INSTALLATION, Scope.RECORDING)] for part in parts)
    return [info.without(rest) for info, rest in zip(each, own, strict=True)]


def _with_sizes(s: Solution, causes: Solution) -> Solution:
    """The solution with the causes at their own estimate, the others as they go with it (module docstring)."""
    c = [s.parameters.index(p) for p in causes.parameters]
    P = s.covariance
    scale = s.sigma[c]  # of a covariance with its prior no direction is without variance
    K = np.linalg.solve(P[np.ix_(c, c)] / np.outer(scale, scale), (P[:, c] / scale).T).T / scale
    covariance = P + K @ (causes.covariance - P[np.ix_(c, c)]) @ K.T
    return replace(s, x=s.x + K @ (causes.x - s.x[c]), covariance=(covariance + covariance.T) / 2)


def _wide(parts: Sequence[RecordingPart], models: Sequence[Sequence[Effect]]) -> dict[Parameter, Parameter]:
    """Return the parameters of causes with the priors of this fit: wide about zero, of constants about their start."""
    out: dict[Parameter, Parameter] = {}
    for part, model in zip(parts, models, strict=True):
        sizes = [p for c in part.causes for p in c.parameters]
        sigma = np.sqrt(np.diag(part.fit.covariance)) * [p.sigma for p in sizes]
        for p, s in zip(sizes, sigma, strict=True):
            out[p] = replace(p, sigma=max(p.sigma, WIDE * float(s), out.get(p, p).sigma))
        for p in part.wanted:
            if p not in out and p not in part.search.fit.parameters:
                out[p] = replace(p, mean=float(values(model, (p,))[0]))
    return out


def _constants_of(effect_id: str, smooth: bool = False) -> list[Parameter]:
    """Return the nonlinear constants of an effect as parameters, all or those that outputs follow smoothly."""
    names = {f.name for f in constants(CATALOGUE[effect_id]) if kind(f).smooth or not smooth}
    return [p for p in parameters(CATALOGUE[effect_id], constants=True) if p.field in names]


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
