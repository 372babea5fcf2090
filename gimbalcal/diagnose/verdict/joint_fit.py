r"""One fit of what was named: constants of the model and causes by the rows of all recordings of a unit.

The rows of each recording are linearised again at the estimate by this recording alone until nothing moves, and the
noise is averaged over: with the estimate x_k and its covariance P_k in noise k of probability p_k,

.. math:: \hat x = \sum_k p_k x_k, \qquad P = \sum_k p_k \left[ P_k + (x_k - \hat x)(x_k - \hat x)^T \right]

The information of recordings of one unit is summed. Sizes of causes are estimated with constants of each recording, as
a unit may have changed in between; the constants are then estimated from all rows given these sizes. With the
estimate (z, x) of constants and causes by all rows, its covariance P, and the sizes x' with P',

.. math:: z' = z + K (x' - x), \quad K = P_{zx} P_{xx}^{-1}, \quad P'_{zz} = P_{zz} + K (P'_{xx} - P_{xx}) K^T

The set-up of the rig, and single events in one of several recordings, belong to each recording: they are eliminated
there and not shared. Constants of causes that no fit can move (whole numbers, instants, places) are those
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
from gimbalcal.diagnose.search.fitted_causes import (
    FittedCauses,
    fit_causes,
)
from gimbalcal.diagnose.search.ranking import Ranking, Search
from gimbalcal.diagnose.verdict.agreement import ConstantsAgreement, agreement_on_constants
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values, with_values
from gimbalcal.effects.effect import constants
from gimbalcal.effects.grids import kind
from gimbalcal.errors import InputError
from gimbalcal.estimate.sharing import Agreement, Scope, agreement_test, scope_of
from gimbalcal.inference.gauss_newton import Minimum, chi2, gauss_newton
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
from gimbalcal.words.naming import without_underscores

MIN_NOISE_PROBABILITY = 1e-3  # probability of a noise below which it is left out of the mean
CONVERGED_SIGMAS = 1e-3  # of a sigma
ROUNDING = 1e-9  # of a constant that was chosen among values, below which its sigma is rounding
MIN_CHI2_DIFFERENCE = 9.0  # by which causes with constants of their own fit better than one effect can
UNREADABLE_MISFIT = 1e100  # misfit of constants with which no force could have been read
# sigmas that the prior of a cause spans at least: what rows know less well than a prior is held at zero
WIDE_SIGMAS = 30.0


@dataclass(frozen=True, eq=False)
class RecordingPart:
    """One recording: the causes that it shows fitted to it alone, and their ordinals among all causes.

    constants: of each of these causes, common to all recordings.
    """

    fit: FittedCauses
    ordinals: tuple[int, ...]
    constants: tuple[Constants, ...]

    @property
    def search(self) -> Search:
        """The search of this recording."""
        return self.fit.search

    @property
    def causes(self) -> tuple[Candidate, ...]:
        """The causes that the recording shows."""
        return tuple(c for c, _ in self.fit.causes)

    def significance(self, ordinal: int) -> float:
        """Return the significance [sigma] of a cause beyond all else; zero where it is not shown."""
        return self.fit.significance(self.ordinals.index(ordinal)) if ordinal in self.ordinals else 0.0

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
        return RecordingPart(fit, named, tuple(self.constants[n] for n in kept))

    @cached_property
    def start(self) -> tuple[Effect, ...]:
        """The model and the causes, fitted together to this recording alone."""
        fit, s = self.search.fit, self.search.fit.view.stimulus
        _, with_causes, _ = self.fit.calibration()
        effects = fit.shifted_effects(with_causes)
        for n, (c, own) in enumerate(zip(self.causes, self.constants, strict=True)):
            if c.effect not in {e.id for e in effects}:
                effects = (*effects, c.absent(s, own))
            x = values(effects, c.parameters) + self.fit.size(n)
            effects = with_values(effects, c.parameters, x, s.axis_names)
        return effects

    def information(self, effects: Sequence[Effect], wide: Mapping[Parameter, Parameter]) -> Information:
        """Return the information of the rows about all that is fitted, linearised at effects, with `wide` priors.

        Raises InputError if the readings are impossible for sensors of these constants.
        """
        fit, priors = self.search.fit, [wide.get(p, p) for p in self.wanted]
        with np.errstate(all="ignore"):
            rows = fit.view.evaluate(effects).over(fit.sigma)
            A = fit.reduced(np.concatenate([rows.jacobian(self.wanted), rows.residual[:, :, None]], axis=-1))
        if not np.isfinite(A).all():
            raise InputError("no force that these constants allow was read")
        x = values(effects, self.wanted)
        A[:, -1] += A[:, :-1] @ x
        likely = np.flatnonzero(self.fit.weights > MIN_NOISE_PROBABILITY)
        white = (self.search.projections[k].node.whiten(A) for k in likely)
        every = [information(W[:, :-1], W[:, -1], priors) for W in white]
        return mean_information(every, self.fit.weights[likely] / self.fit.weights[likely].sum())


def parts_of(c: Ranking, members: Sequence[int]) -> tuple[RecordingPart, ...]:
    """Return each recording with the causes that it shows, fitted to it, and their constants common to all."""
    own = [fit_causes(s, c.within(members, k)) for k, s in enumerate(c.searches)]
    common = [_common_constants(c, members, j, own) for j in range(len(members))]
    out = []
    for k in range(len(c.searches)):
        ordinals = _ordinals_in_recording(c, members, k)
        shared = (common[j] or chosen.constants for j, (_, chosen) in zip(ordinals, own[k].causes, strict=True))
        out.append(RecordingPart(own[k], ordinals, tuple(shared)))
    return tuple(out)


def _ordinals_in_recording(c: Ranking, members: Sequence[int], recording: int) -> tuple[int, ...]:
    return tuple(j for j, m in enumerate(members) if recording in c.sees(m))


def _common_constants(c: Ranking, members: Sequence[int], j: int, own: Sequence[FittedCauses]) -> Constants:
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
        s, n = c.searches[k], _ordinals_in_recording(c, members, k).index(j)
        rest = own[k].columns_of_others(n)
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
    converged: bool

    def size(self, ordinal: int) -> tuple[Array, Array]:
        """Return values and sigmas (p,) of the parameters of a cause, SI.

        What is one recording's own is by this one alone, and so is a cause whose effect holds the constants of another.
        """
        cause = self.causes[ordinal]
        if cause.effect not in self.differing and set(cause.parameters) <= set(self.solution.parameters):
            at = [self.solution.parameters.index(p) for p in cause.parameters]
            return self.solution.x[at], self.solution.sigma[at]
        k = max(range(len(self.parts)), key=lambda k: self.parts[k].significance(ordinal))
        return self.size_by(k, ordinal)

    def size_by(self, recording: int, ordinal: int) -> tuple[Array, Array]:
        """Return values and sigmas (p,) of the parameters of a cause by one recording, SI."""
        part, wanted = self.parts[recording], self.causes[ordinal].parameters
        if self.causes[ordinal].effect in self.differing:
            n, scale = part.ordinals.index(ordinal), np.array([p.sigma for p in wanted])
            return part.fit.size(n), np.sqrt(np.diag(part.fit.covariance)[part.fit.slice_of(n)]) * scale
        keep = [self.wide[p] for p in wanted]
        solution = solve(self._of_sizes(recording).about(keep))
        at = [solution.parameters.index(p) for p in keep]
        return solution.x[at], solution.sigma[at]

    def _of_sizes(self, recording: int) -> Information:
        """Return the information of a recording at the smooth constants of causes that all have in common."""
        info = self.each[recording]
        smooth = {self.wide.get(p, p): float(x) for p, x in zip(self.solution.parameters, self.solution.x, strict=True)
                  if _is_constant(p)}  # fmt: skip
        return info.at({p: x for p, x in smooth.items() if p in info.parameters})

    @cached_property
    def differing(self) -> frozenset[str]:
        """Effects that were found twice with other constants, of which one effect holds one: causes keep their own."""
        chosen: dict[str, set[Constants]] = {}
        for part in self.parts:
            for c, own in zip(part.causes, part.constants, strict=True):
                chosen.setdefault(c.effect, set()).add(own)
        twice = frozenset(effect for effect, each in chosen.items() if len(each) > 1)
        if not twice or len(self.parts) > 1:
            return twice
        return twice if self.solution.chi2 > self.parts[0].fit.misfit + MIN_CHI2_DIFFERENCE else frozenset()

    def sizes(self, part: RecordingPart) -> Array:
        """Return the sizes (p,) of the causes that a recording shows, in prior sigmas."""
        each = [self.size(k)[0] / [p.sigma for p in self.causes[k].parameters] for k in part.ordinals]
        return np.concatenate([np.zeros(0), *each])

    def chosen_constants(self, ordinal: int) -> list[tuple[Parameter, float, float]]:
        """Return the nonlinear constants of a cause: parameter, value and sigma in SI.

        A constant that no fit can move has the sigma of the values that were tried, the mean of all recordings.
        """
        effect_id, out = self.causes[ordinal].effect, []
        shown = [part for part in self.parts if ordinal in part.ordinals]
        named = dict(shown[0].constants[shown[0].ordinals.index(ordinal)])
        for p in _constants_of(effect_id):
            if p in self.solution.parameters and effect_id not in self.differing:
                i = self.solution.parameters.index(p)
                out.append((p, float(self.solution.x[i]), float(self.solution.sigma[i])))
            elif p.field in named:
                spread = np.array([part.fit.spread(part.ordinals.index(ordinal))[p.field] for part in shown])
                least = ROUNDING * max(abs(named[p.field]), ROUNDING)  # where one value alone fits, rounding is left
                weight = float((spread[spread > least] ** -2.0).sum())
                out.append((p, named[p.field], weight**-0.5 if weight > 0 else 0.0))
        return out

    def agreement_on(self, ordinal: int) -> Agreement:
        """Return how well the recordings agree on the size of a cause."""
        shown = [k for k, part in enumerate(self.parts) if ordinal in part.ordinals]
        if len(shown) == 1:
            return Agreement(0.0, 0, 1.0)
        own = {self.wide[p] for p in self.causes[ordinal].parameters}
        each = [self._of_sizes(k).about(own) for k in shown]
        return agreement_test(solve(reduce(add, each)), [solve(info) for info in each])

    @property
    def outcome(self) -> str:
        """The objections to the constants of the model, in words; empty where there are none."""
        words = "{} was found with several constants, of which this calibration holds one: do not apply it"
        several = [words.format(without_underscores(effect)) for effect in sorted(self.differing)]
        rough = [] if self.converged else ["the fit with what was found did not converge, so its constants are rough"]
        return "; ".join([*filter(None, [self.between.in_words if self.between else ""]), *several, *rough])

    def without(self, effect_id: str) -> JointFit:
        """Return the fit to the same rows, in the same noise, of a model without an effect that was found."""
        kept = [i for i, c in enumerate(self.causes) if c.effect != effect_id]
        parts = [part.only({old: new for new, old in enumerate(kept)}) for part in self.parts]
        return joint_fit(parts, [self.causes[i] for i in kept])

    @cached_property
    def between(self) -> ConstantsAgreement | None:
        """The agreement of several recordings on the constants of the unit; None for one."""
        return (
            agreement_on_constants(_shared_information(self.parts, self.each, self.wide))
            if len(self.each) > 1
            else None
        )

    def calibration(self, known: Calibration | None) -> Calibration:
        """Return the fit as a calibration; known: that which the diagnosis started from.

        Of `known` it holds what these recordings do not.
        """
        mine, effects = self.solution.parameters, {e.id for part in self.parts for e in part.search.fit.effects}
        carried = {p.effect for p in mine}  # the others are one recording's own
        chosen = {p: sigma for k, c in enumerate(self.causes) if c.effect in carried
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
            outcome=self.outcome,
            provenance=replace(
                provenance_of_fit(views, [c.label for c in self.causes]),
                agreement=self.between.to_dict() if self.between else None,
            ),
            readout=Readout(gimbals=views[0].readout.gimbals),
        )

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

    Each recording is linearised about its own least squares.
    """
    wide = _wide_priors(parts)
    alone = [_least_squares(part, wide) for part in parts]
    solution, each = alone[0].solution, tuple(m.information for m in alone)
    if len(parts) > 1:
        solution = _with_sizes(
            solve(reduce(add, _shared_information(parts, each, wide))), _pool_causes(parts, each, wide)
        )
    narrow, names = {w: p for p, w in wide.items()}, parts[0].search.fit.view.stimulus.axis_names
    solution = replace(solution, parameters=tuple(narrow.get(p, p) for p in solution.parameters))
    value = dict(zip(solution.parameters, solution.x, strict=True))
    effects: dict[str, Effect] = {}
    for part, m in zip(parts, alone, strict=True):
        model = with_values(part.start, part.wanted, m.solution.x, names)
        mine = [p for p in part.wanted if p in value]
        for e in with_values(model, mine, np.array([value[p] for p in mine]), names):
            effects.setdefault(e.id, e)
    converged = all(m.steps for m in alone)
    return JointFit(tuple(parts), tuple(causes), tuple(effects.values()), solution, each, wide, converged)


def _least_squares(part: RecordingPart, wide: Mapping[Parameter, Parameter]) -> Minimum:
    """Return the fit to one recording, relinearised until it converges, by steps that do not increase chi^2."""
    model, wanted, s = part.start, part.wanted, part.search.fit.view.stimulus
    priors, tried = tuple(wide.get(p, p) for p in wanted), dict[bytes, Information]()

    def linearise(x: Array) -> Information:
        if x.tobytes() not in tried:
            try:
                info = part.information(with_values(model, wanted, x, s.axis_names), wide)
            except InputError:  # further than the model goes
                info = Information(priors, np.append(np.zeros(len(wanted)), UNREADABLE_MISFIT)[None], 1)
            tried[x.tobytes()] = info
        return tried[x.tobytes()]

    def arrived(_: int, x: Array, solution: Solution) -> bool:
        return bool(np.all(np.abs(solution.x - x) <= CONVERGED_SIGMAS * solution.sigma))

    bounds, start = range_of_constants(wanted, s), values(model, wanted)
    baseline = part.search.fit  # its constants reproduce the readings, where those fitted with the causes may not
    without = [p for p in wanted if p in baseline.parameters]
    other = values(with_values(model, without, values(baseline.effects, without), s.axis_names), wanted)
    start = min((start, other), key=lambda x: chi2(linearise(x), x))
    m = gauss_newton(linearise, start, bounds, MIN_SIGNAL_TO_NOISE, True, arrived, lambda _: False)
    if m.steps:
        return m
    return replace(m, solution=replace(m.solution, x=m.x, chi2=chi2(m.information, m.x)))  # the last step was not tried


def _pool_causes(
    parts: Sequence[RecordingPart], each: Sequence[Information], wide: Mapping[Parameter, Parameter]
) -> Solution:
    """Return the causes by all recordings, the constants of the model free in each.

    Smooth constants of causes are the mean of those of all recordings, whatever sizes these see; sizes are those at
    these constants, and their covariance is that of both.
    """
    own = ([wide.get(p, p) for p in part.own(*Scope)] for part in parts)
    free = [info.without(rest, flat=True) for info, rest in zip(each, own, strict=True)]
    info = reduce(add, free)
    constant = _smooth_constants(free)
    sizes = solve(info.at(constant))
    value = constant | dict(zip(sizes.parameters, sizes.x, strict=True))
    return replace(solve(info), x=np.array([value[p] for p in info.parameters]))


def _smooth_constants(each: Sequence[Information]) -> dict[Parameter, float]:
    """Return the smooth constants of causes by several recordings, each with sizes of its own."""
    marginal = [info.about([p for p in info.parameters if _is_constant(p)]) for info in each]
    solution = solve(reduce(add, marginal))
    return dict(zip(solution.parameters, map(float, solution.x), strict=True))


def _shared_information(
    parts: Sequence[RecordingPart], each: Sequence[Information], wide: Mapping[Parameter, Parameter]
) -> list[Information]:
    """Return the information of each of several recordings about the shared parameters."""
    own = ([wide.get(p, p) for p in part.own(Scope.INSTALLATION, Scope.RECORDING)] for part in parts)
    return [info.without(rest) for info, rest in zip(each, own, strict=True)]


def _with_sizes(s: Solution, causes: Solution) -> Solution:
    """Return the solution with the causes at their own estimate, the others conditioned on it (module docstring)."""
    c = [s.parameters.index(p) for p in causes.parameters]
    P = s.covariance
    scale = s.sigma[c]  # of a covariance with its prior no direction is without variance
    K = np.linalg.solve(P[np.ix_(c, c)] / np.outer(scale, scale), (P[:, c] / scale).T).T / scale
    covariance = P + K @ (causes.covariance - P[np.ix_(c, c)]) @ K.T
    return replace(s, x=s.x + K @ (causes.x - s.x[c]), covariance=(covariance + covariance.T) / 2)


def _wide_priors(parts: Sequence[RecordingPart]) -> dict[Parameter, Parameter]:
    """Return the parameters of causes with the priors of this fit: wide about zero, of constants about their start."""
    out: dict[Parameter, Parameter] = {}
    for part in parts:
        sizes = [p for c in part.causes for p in c.parameters]
        sigma = np.sqrt(np.diag(part.fit.covariance)) * [p.sigma for p in sizes]
        for p, s in zip(sizes, sigma, strict=True):
            out[p] = replace(p, sigma=max(p.sigma, WIDE_SIGMAS * float(s), out.get(p, p).sigma))
        for p in part.wanted:
            if p not in out and p not in part.search.fit.parameters:
                out[p] = replace(p, mean=float(values(part.start, (p,))[0]))
    return out


def _constants_of(effect_id: str, smooth: bool = False) -> list[Parameter]:
    """Return the nonlinear constants of an effect as parameters, all or those that outputs follow smoothly."""
    names = {f.name for f in constants(CATALOGUE[effect_id]) if kind(f).smooth or not smooth}
    return [p for p in parameters(CATALOGUE[effect_id], constants=True) if p.field in names]


def _is_constant(p: Parameter) -> bool:
    """Return whether a parameter of a fit is a nonlinear constant of its effect and not a size."""
    return p.field in {f.name for f in constants(CATALOGUE[p.effect])}


def provenance_of_fit(views: Sequence[View], causes: Sequence[str]) -> Provenance:
    """Return the provenance of a calibration of a diagnosis, with the files behind the views."""
    recordings = list(dict.fromkeys(v.source for v in views))
    return Provenance(
        recordings=tuple(file for r in recordings for file in r.source),
        stars=sum(len(v) for v in views if v.kind.sighting) or None,
        version=gimbalcal.__version__,
        options=Options(direction=DIRECTION, method="diagnosis", causes=tuple(causes)),
        recorded=when_recorded(recordings),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )
