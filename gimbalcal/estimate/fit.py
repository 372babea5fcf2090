"""One fit of all views: the shared parameters, the excess of their noise, and the unobservable combinations.

Nuisances of a view are fitted within their priors, local parameters of its groups of rows are eliminated.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration import Calibration, Residual, StageResult
from gimbalcal.effects import Effect, Parameter, values, with_values
from gimbalcal.estimate.extra_effects import (
    NO_EXTENSION,
    Cost,
    Extension,
    ExtraEffect,
    columns_of_sizes,
    extension,
)
from gimbalcal.estimate.noise_memory import added_by_memory
from gimbalcal.forward import Rows
from gimbalcal.inference.algebra import orthonormal_columns, unit_columns
from gimbalcal.inference.gauss_newton import MAX_QUADRATIC_STEPS, gauss_newton
from gimbalcal.inference.information import (
    MIN_SIGNAL_TO_NOISE,
    Information,
    Solution,
    Unobservable,
    information,
    prior,
    solve,
)
from gimbalcal.number import Array, apply_matrix
from gimbalcal.views.core import View, range_of_constants
from gimbalcal.views.local import VisitRows, Whitened, eliminate

TOLERANCE = 1e-3  # sigmas by which the last step may move an estimate
MAX_SCALE_ROUNDS = 20  # fits, each in the noise that the one before leaves
SCALE_TOLERANCE = 1e-6  # relative change of the excess sigma at which the rounds end
VIEW_TOLERANCE = 1e-6  # `TOLERANCE` of the first `MAX_QUADRATIC_STEPS` of a fit of views; after them estimates creep
ROUNDING = 1e-10  # of the prior sigma: a smaller step is rounding, however small sigma is
MIN_SINGULAR_RATIO = 1e-9  # of columns of length one, below which rows say nothing of a combination
MIN_NUMBERS_LEFT = 6  # numbers beyond the parameters that tell how rows scatter about a model
LEAST_SIGNAL = 1e-6  # `min_signal` of a fit without priors
SIGNIFICANT_EXCESS = 3.0  # sigmas of chi^2 above its degrees of freedom, below which the known noise explains the rows
MAX_PRIOR_SIGMAS = 1e3  # beyond them positions mean nothing: 0.5 g of bias, 50 % of scale, 33 deg
MAX_SETTING_STEP = 1e-2  # sigmas of a row by which the last step of local parameters may move it
READING_ROUNDING = 1e-15  # of gravity: smaller steps are the rounding of numbers without noise
MIN_RELATIVE_SIGNAL = 1e-8  # singular value over the largest, below which rounding speaks


@dataclass(frozen=True, eq=False)
class ViewsFit:
    """Fit of views that share all parameters: effects with the estimates, and the solution.

    The solution is that of the effects' parameters and, behind them, of the nuisances. excesses: for each view the
    sigma [SI] of all channels (1,) or of each (C,) beyond the known noise of the rows, in units of
    `NoiseModel.parts_of_variance`; steps: 0 where the fit did not converge; min_signal: as in `solve`.
    """

    views: tuple[View, ...]
    absent: tuple[Effect, ...]  # the effects that the fit began with, before their parameters were estimated
    effects: tuple[Effect, ...]
    solution: Solution
    excesses: tuple[Array, ...]
    steps: int
    min_signal: float = MIN_SIGNAL_TO_NOISE
    local: tuple[Array, ...] = ()  # values (m, k) of the local parameters of each view, empty where it has none
    fixed: Array | float = 0.0  # covariance (p, p) by nuisances that are no part of the fit

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of effects, in the order of x and covariance."""
        return tuple(p for p in self.solution.parameters if p.effect)

    @property
    def x(self) -> Array:
        """Estimate (p,) of the parameters of effects, SI."""
        return self.solution.x[: len(self.parameters)]

    @property
    def covariance(self) -> Array:
        """Covariance (p, p) of the estimate, SI, marginal over the nuisances; rows may be correlated."""
        return np.asarray(self._covariance[: len(self.parameters), : len(self.parameters)] + self.fixed)

    @cached_property
    def _covariance(self) -> Array:
        """Covariance (p + m, p + m) of effects' parameters and nuisances, SI, without what is fixed."""
        P = self.solution.covariance
        return P if any(v.local is not None for v in self.views) else P + self.added_by_memory(*self.whitened, P)

    @property
    def widening(self) -> Array:
        """The factor by which memory widens the sigma of each parameter and nuisance (p + m,)."""
        with np.errstate(invalid="ignore"):
            ratio = np.sqrt(np.diag(self._covariance) / np.diag(self.solution.covariance))
        return np.asarray(np.where(ratio > 1, ratio, 1.0))

    def added_by_memory(self, J: Array, r: Array, G: Array) -> Array:
        """Return what the correlation of rows with Jacobian J (q, p) and misfit r (q,) adds to a covariance G (p, p).

        Both are in units of noise. Only channels whose estimated noise exceeds the known one are tested for it.
        """
        out, start = np.zeros(G.shape), 0
        for v, excess in zip(self.views, self.excesses, strict=True):
            n, C = len(v), len(v.channels)
            known, shape = v.noise.parts_of_variance((n, C))
            for c in np.flatnonzero((shape * excess**2).mean(axis=0) > known.mean(axis=0)):
                rows = slice(start + c, start + n * C, C)
                out += added_by_memory(J[rows], r[rows], G)
            start += n * C
        return out

    @property
    def sigmas(self) -> Array:
        """One standard deviation (p,) of each parameter, SI."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def unobservable(self) -> tuple[Unobservable, ...]:
        """Directions of the effects' parameters that the rows do not determine, or not separately from a nuisance."""
        if len(self.parameters) == len(self.solution.parameters):
            return self.solution.unobservable
        own, out = {p.label for p in self.parameters}, dict[frozenset[str], Unobservable]()
        for u in self.solution.unobservable:
            direction = {label: weight for label, weight in u.direction.items() if label in own}
            if direction:
                out.setdefault(frozenset(direction), Unobservable(direction, u.why))
        return tuple(out.values())

    def calibration(self, method: str, residual: Residual, **fields: Any) -> Calibration:
        """Return the effects, parameters, covariance, unobservable directions and readout with further fields."""
        return Calibration(
            **{"method": method, "effects": self.effects, "parameters": self.parameters, "covariance": self.covariance,
               "unobservable": self.unobservable, "residual": residual, "readout": self.views[0].readout, **fields}
        )  # fmt: skip

    def stage(self, name: str, in_words: str, rms: float | None = None) -> StageResult:
        """Return the fit as a stage of a calibration; rms [SI] of its residuals by default."""
        labels = tuple(p.label for p in self.parameters)
        return StageResult(name, labels, self.x, self.sigmas, self.rms if rms is None else rms, in_words)

    def nuisance(self, name: str) -> tuple[Array, Array]:
        """Return estimates and sigmas of the nuisance parameters of a name, SI."""
        at = [i for i, p in enumerate(self.solution.parameters) if not p.effect and p.name == name]
        return self.solution.x[at], np.sqrt(np.diag(self._covariance)[at])

    @property
    def excess(self) -> float:
        """The largest excess of any channel, SI."""
        return float(max(e.max() for e in self.excesses))

    @property
    def sigma(self) -> tuple[Array, ...]:
        """One sigma (n, C) of each row, SI."""
        parts = [v.noise.parts_of_variance((len(v), len(v.channels))) for v in self.views]
        return tuple(np.sqrt(known + shape * e**2) for (known, shape), e in zip(parts, self.excesses, strict=True))

    @cached_property
    def residual(self) -> tuple[Array, ...]:
        """Read minus predicted (n, C), SI, with the nuisances at their estimates."""
        return tuple(part.misfit for part in self._linear.parts)

    @property
    def rms(self) -> float:
        """Root mean square of all residuals, SI."""
        return float(np.sqrt(np.mean(np.concatenate([r.ravel() for r in self.residual]) ** 2)))

    @property
    def rms_by_channel(self) -> dict[str, float]:
        """Root mean square of the residuals of the first view, SI, by "quantity:axis"."""
        rms = np.sqrt(np.mean(self.residual[0] ** 2, axis=0))
        return {":".join(key): float(x) for key, x in zip(self.views[0].channels, rms, strict=True)}

    @cached_property
    def _linear(self) -> _Linear:
        """All rows about the estimate."""
        return _rows_about(self.views, self.effects, self.solution.parameters, self.solution.x, self.local)

    @cached_property
    def whitened(self) -> tuple[Array, Array]:
        """Jacobian (q, p) and misfit (q,) of all rows about the estimate, in units of their noise."""
        return self._linear.over(_row_sigma(self.views, self.excesses))

    def rows_by(self, wanted: Sequence[Parameter], x: Array) -> tuple[Array, Array]:
        """Return Jacobian (q, p) by any parameters and misfit (q,) of all rows about x (p,), in units of noise."""
        linear = _rows_about(self.views, self.effects, wanted, x, self.local)
        return linear.over(_row_sigma(self.views, self.excesses))

    def with_fixed_nuisances(self, views: Sequence[View]) -> ViewsFit:
        r"""Return the fit with what the nuisances of these views add to its covariance, which are not part of it.

        .. math:: \delta x = -A \, \nu, \quad A = J^+ N, \quad P_x + A A^T

        with N the rows of one sigma of each nuisance (implicit function theorem at the minimum).
        """
        p, fixed = len(self.parameters), [q for v in views for q in v.nuisances]
        wanted = (*self.parameters, *(replace(q, index=i) for i, q in enumerate(fixed)))
        of_views = replace(self, views=tuple(views), local=())
        J, _ = of_views.rows_by(wanted, np.append(self.x, np.zeros(len(fixed))))
        N = J[:, p:] * prior(wanted)[1][p:]
        unit, size = unit_columns(J[:, :p])
        A = np.linalg.lstsq(unit, N, rcond=None)[0] / size[:, None]
        return replace(self, fixed=A @ A.T)

    @property
    def determined(self) -> bool:
        """Return whether rows determine every parameter, nuisances included, far above rounding."""
        return columns_are_independent(self.whitened[0])

    @property
    def condition(self) -> float:
        """Condition number of the columns of the effects' parameters, each of length one."""
        return float(np.linalg.cond(unit_columns(self.whitened[0][:, : len(self.parameters)])[0]))

    @property
    def dof_of_scatter(self) -> float:
        """Least degrees of freedom of a scale of the noise; infinite where the known noise explains all of it."""
        if not self.excess > 0:
            return np.inf
        rows = np.concatenate([self.whitened[0], _prior_rows(self.solution.parameters)[0]])
        ordinal, _ = _scale_ordinals(self.views)
        return float(
            _scale_degrees_of_freedom(
                orthonormal_columns(rows, MIN_RELATIVE_SIGNAL)[: len(ordinal)], ordinal, ordinal >= 0
            ).min()
        )

    @cached_property
    def left_out(self) -> tuple[tuple[Array, ...], Array]:
        r"""Residuals (n, C) [SI] of groups of rows to fits without them, and a jackknife sigma (p,) of the parameters.

        .. math:: r_{left\,out} = (1 - h)^{-1} r, \qquad \delta x = R^{-1} Q^T r_{left\,out}

        with h the leverage of a group, of a model that is linear about the estimate.
        """
        J, r = self.whitened
        priors, scale = _prior_rows(self.solution.parameters)
        A, size = unit_columns(np.concatenate([J, priors]) * scale)
        Q, R = np.linalg.qr(A)
        out, moves, start = [], [], 0
        for v, sigma in zip(self.views, self.sigma, strict=True):
            rows = np.arange(sigma.size).reshape(sigma.shape)
            without = np.empty(sigma.size)
            for at in (rows[v.groups == g].ravel() for g in np.unique(v.groups)):
                q = Q[start + at]
                without[at] = np.linalg.lstsq(np.eye(len(at)) - q @ q.T, r[start + at], rcond=1e-9)[0]
                moves.append(without[at] @ q)
            out.append(without.reshape(sigma.shape) * sigma)
            start += sigma.size
        moved = np.linalg.lstsq(R, np.array(moves).T, rcond=MIN_SINGULAR_RATIO)[0].T * scale / size
        return tuple(out), np.sqrt((moved**2).sum(axis=0))[: len(self.parameters)]

    @property
    def left_out_rms(self) -> float:
        """Root mean square of the residuals of rows that took no part, SI."""
        return float(np.sqrt(np.mean(np.concatenate([r.ravel() for r in self.left_out[0]]) ** 2)))

    def cost_of_sizes(self, sizes: Sequence[Parameter]) -> Cost:
        """Return chi^2, linear about the fit, by absent effects whose `sizes` are free, given what was fitted."""
        every, sigma = (*self.solution.parameters, *sizes), _row_sigma(self.views, self.excesses)
        J, r = self.whitened
        y = r + J @ self.solution.x

        def cost(absent: Sequence[Effect]) -> float:
            each = ((p, columns_of_sizes(p.rows, _acting_effects(p.view, absent), sizes)) for p in self._linear.parts)
            X = np.concatenate([p.whitened(columns)[0] for p, columns in each]) / sigma[:, None]
            return solve(information(np.concatenate([J, X], axis=1), y, every), self.min_signal).chi2

        return cost

    def extension(self, more: Sequence[ExtraEffect], sizes: Sequence[Parameter] | None = None) -> Extension:
        """Return the extra effects, with constants that start where they fit best given what was fitted.

        sizes: their linear parameters, if not all of them are free.
        """
        s = self.views[0].stimulus
        free = [p for e in more for p in e.parameters(s.axis_names)] if sizes is None else sizes
        return extension(more, free, s, self.cost_of_sizes(free)) if more else NO_EXTENSION


def fit(
    views: Sequence[View], wanted: Sequence[Parameter], absent: Sequence[Effect] = (), start: Array | None = None, *,
    min_signal: float = MIN_SIGNAL_TO_NOISE, min_excess: float = 0.0, significance: float = SIGNIFICANT_EXCESS,
) -> ViewsFit:  # fmt: skip
    r"""Fit parameters that views share, and the excess of their noise where it is not stated.

    .. math:: \sum_i \frac{r_i^2}{\sigma_i^2 + w_i \sigma_e^2} = \nu

    determines the excess sigma_e of rows with a known variance sigma_i^2 (that of their samples, or zero), nu being
    their degrees of freedom, the number of these rows less the sum of their leverages. Views of one kind have one
    excess, or one of each channel; a known noise is only widened where chi^2 is `significance` sigmas above nu.
    Nuisances of a view are fitted within their priors, and so are its local parameters, group by group. A parameter of
    an effect that does not act in a view has no column there. absent: effects that the fit begins with, their
    constants among them; start (p + m,): where the iteration begins (default: at these effects, with nuisances of
    zero).
    """
    names = views[0].stimulus.axis_names
    ordinal, of_views = _scale_ordinals(views)
    nuisances = [replace(q, index=i) for i, q in enumerate(q for v in views for q in v.nuisances)]  # each is another
    every = (*wanted, *nuisances)
    priors, scale = _prior_rows(every)
    scaled = tuple(replace(q, sigma=s) for q, s in zip(every, scale, strict=True))
    bounds = range_of_constants(wanted, *(v.stimulus for v in views))
    if bounds is not None:
        bounds = np.concatenate([bounds, np.tile([[-np.inf], [np.inf]], len(nuisances))], axis=1)
    known, shape = (np.concatenate(part) for part in zip(*map(_row_variances, views), strict=True))
    has_local = any(v.local is not None for v in views)
    last: dict[bytes, _Linear] = {}

    def effects_at(x: Array) -> tuple[Effect, ...]:
        return with_values(absent, wanted, x[: len(wanted)], names)

    def rows(x: Array) -> tuple[Array, Array]:
        """Return whitened rows and priors about x; what does not depend on the noise is kept."""
        if x.tobytes() not in last:
            e = next(iter(last.values())).local_at(x) if last else start_local
            last.clear()
            last[x.tobytes()] = _rows_about(views, effects_at(x), every, x, e)
        linear, sigma = last[x.tobytes()], np.sqrt(known + shape * excess[ordinal] ** 2)
        J, r = linear.over(sigma)
        return np.concatenate([J, priors]), np.concatenate([r, -priors @ x])

    def linearise(x: Array) -> Information:
        J, r = rows(x)
        info = information(J, r + J @ x, scaled)
        return replace(info, count=info.count - last[x.tobytes()].dependent)

    def arrived(step: int, x: Array, solution: Solution) -> bool:
        tolerance = VIEW_TOLERANCE if step <= MAX_QUADRATIC_STEPS and not has_local else TOLERANCE
        enough = np.maximum(tolerance * solution.sigma, ROUNDING * prior(solution.parameters)[1])
        return bool(np.all(np.abs(solution.x - x) <= enough)) and last[x.tobytes()].settled(solution.x)

    def diverged(x: Array) -> bool:
        mean, sigma = prior(scaled)
        return has_local and not np.all(np.abs(x - mean) <= MAX_PRIOR_SIGMAS * sigma)  # nor where it is no number

    def widened(x: Array) -> Array:
        """Return the excess that the rows leave if nothing holds the parameters but priors of nuisances."""
        J, r = rows(x)
        Q, out = orthonormal_columns(J, MIN_RELATIVE_SIGNAL), excess.copy()
        e = (r - Q @ (Q.T @ r))[: len(known)]
        free, w = _scale_degrees_of_freedom(Q[: len(known)], ordinal, shape > 0), np.where(shape > 0, shape, 1.0)
        for k, nu in enumerate(free):
            of = (ordinal == k) & (shape > 0)
            if excess[k] > 0 or e[of] @ e[of] > nu + significance * np.sqrt(2 * nu):
                si = e[of] * np.sqrt((known[of] + shape[of] * excess[k] ** 2) / w[of])
                out[k] = max(excess_sigma(si, known[of] / w[of], max(nu, 1.0)), min_excess)
        return out

    x = start if start is not None else np.append(values(absent, wanted), np.zeros(len(nuisances)))
    start_local = [v.local.start(v, _acting_effects(v, effects_at(x))) if v.local else NONE for v in views]
    excess = np.array([float(not known[ordinal == k].all()) for k in range(ordinal.max() + 1)])
    if np.any(excess > 0):
        excess = widened(x)
    for _ in range(MAX_SCALE_ROUNDS):
        minimum = gauss_newton(linearise, x, bounds, min_signal, not has_local, arrived, diverged)
        x = minimum.solution.x
        if not minimum.steps or not np.any(shape > 0):
            break
        new = widened(x)
        if np.all(np.abs(new - excess) <= SCALE_TOLERANCE * excess):
            break
        excess = new
    solution = replace(minimum.solution, parameters=every)
    excesses, local = tuple(excess[k] for k in of_views), tuple(next(iter(last.values())).local_at(x))
    return ViewsFit(tuple(views), tuple(absent), effects_at(x), solution, excesses, minimum.steps, min_signal, local)


def columns_are_independent(J: Array) -> bool:
    """Return whether no combination of columns (q, p), each of length one, vanishes but for rounding."""
    if len(J) < J.shape[1]:
        return False
    return not J.shape[1] or bool(np.linalg.svd(unit_columns(J)[0], compute_uv=False)[-1] > MIN_SINGULAR_RATIO)


def information_of(
    views: Sequence[View], effects: Sequence[Effect], wanted: Sequence[Parameter], local: Sequence[Array] = ()
) -> Information:
    """Return the information of views of stated noise about the wanted parameters, linearised at effects."""
    x = values(effects, wanted)
    linear = _rows_about(views, effects, wanted, x, local)
    J, r = linear.over(_row_sigma(views))
    info = information(J, r + J @ x, wanted)
    return replace(info, count=info.count - linear.dependent)


@dataclass(frozen=True, eq=False)
class _Part:
    """Rows of one view with their misfit (n, C), and with local parameters their values e (m, k) and rows by group."""

    view: View
    rows: Rows
    misfit: Array
    e: Array
    groups: tuple[VisitRows, Whitened] | None = None

    def whitened(self, columns: Array) -> tuple[Array, tuple[VisitRows, Whitened] | None]:
        """Return columns (n, C, p) as (q, p), with the local parameters eliminated, and the rows by group."""
        local = self.view.local
        if local is None:
            return columns.reshape(-1, columns.shape[-1]), None
        linear = local.by_group(self.view, self.rows, columns, self.e)
        white = eliminate(linear, 1.0, local.sigma**2)
        return white.rows[0], (linear, white)


@dataclass(frozen=True, eq=False)
class _Linear:
    """Rows of views about x (p,): Jacobian J (q, p) and misfit r (q,), SI, those with local parameters whitened."""

    x: Array
    J: Array
    r: Array
    parts: tuple[_Part, ...]

    def over(self, sigma: Array) -> tuple[Array, Array]:
        """Return Jacobian (q, p) and misfit (q,) in units of sigma (q,)."""
        return self.J / sigma[:, None], self.r / sigma

    @property
    def dependent(self) -> int:
        """Return how many rows hold nothing that the others do not hold."""
        return sum(part.groups[1].dependent for part in self.parts if part.groups)

    def local_at(self, x: Array) -> list[Array]:
        """Return the values (m, k) of the local parameters of each view that parameters x (p,) call for."""
        return [
            apply_matrix(p.groups[1].gain, p.groups[0].r - p.groups[0].J @ (x - self.x)) if p.groups else NONE
            for p in self.parts
        ]

    def settled(self, x: Array) -> bool:
        """Return whether parameters x (p,) move no row by local parameters."""
        for part, e in zip(self.parts, self.local_at(x), strict=True):
            if part.groups:
                by_group, rounding = part.groups[0], READING_ROUNDING * part.view.stimulus.gravity
                least = MAX_SETTING_STEP / np.sqrt(by_group.weight)[:, None] + rounding
                if np.any(np.abs(apply_matrix(by_group.G, e - part.e)) > least):
                    return False
        return True


NONE = np.zeros((0, 0))


def _rows_about(
    views: Sequence[View], effects: Sequence[Effect], wanted: Sequence[Parameter], x: Array, local: Sequence[Array]
) -> _Linear:
    """Return the rows of views about parameters and nuisances x (p,), and local parameters (m, k); none: zero."""
    J, r, parts = [], [], []
    for v, own, e in zip(views, _nuisance_ordinals(views, wanted), local or [NONE] * len(views), strict=True):
        rows, columns, misfit = _of_view(v, effects, wanted, x, own, e)
        part = _Part(v, rows, misfit, e if v.local is None or e.size else v.local.zero_values)
        own_columns, groups = part.whitened(columns)
        J.append(own_columns)
        r.append(misfit.ravel() if groups is None else groups[1].rows[1])
        parts.append(replace(part, groups=groups))
    return _Linear(x, np.concatenate(J), np.concatenate(r), tuple(parts))


def _nuisance_ordinals(views: Sequence[View], wanted: Sequence[Parameter]) -> list[slice]:
    """Return where the nuisances of each view are among the parameters, behind those of effects."""
    ends = np.cumsum([sum(bool(q.effect) for q in wanted), *(len(v.nuisances) for v in views)])
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]


def _acting_effects(v: View, effects: Sequence[Effect]) -> Sequence[Effect]:
    """Return the effects that act in the rows of a view."""
    return effects if v.acting is None else [e for e in effects if e.id in v.acting]


def _of_view(
    v: View, effects: Sequence[Effect], wanted: Sequence[Parameter], x: Array, own: slice, e: Array
) -> tuple[Rows, Array, Array]:
    """Return the rows of one view about its effects, the columns (n, C, p) of all parameters, and the misfit (n, C)."""
    view, acting = v if v.about is None else v.about(x[own]), _acting_effects(v, effects)
    rows = v.local.evaluate(acting, e) if v.local is not None and e.size else view.evaluate(acting)
    at = [i for i, q in enumerate(wanted) if q.effect and (v.acting is None or q.effect in v.acting)]
    columns, misfit = np.zeros((*rows.residual.shape, len(wanted))), rows.residual
    columns[..., at] = rows.jacobian([wanted[i] for i in at])
    if v.nuisances and rows.nuisance is not None:
        columns[..., own] = rows.nuisance
        misfit = misfit if v.about is not None else misfit - rows.nuisance @ x[own]
    return rows, columns, misfit


def _row_variances(v: View) -> tuple[Array, Array]:
    """Known variance (q,) of the rows, and the shape of what is added to it; of whitened rows one and nothing."""
    if v.local is not None:
        groups = v.local.group[-1] + 1
        q = len(v.channels) * (groups + (len(v) if len(v) > groups else 0))
        return np.ones(q), np.zeros(q)
    known, shape = v.noise.parts_of_variance((len(v), len(v.channels)))
    return known.ravel(), shape.ravel()


def _row_sigma(views: Sequence[View], excesses: Sequence[Array] | None = None) -> Array:
    """Return one sigma (q,) of all rows, those that are whitened one; excesses: none of a stated noise."""
    parts = map(_row_variances, views)
    each = [np.zeros(1)] * len(views) if excesses is None else excesses
    return np.sqrt(
        np.concatenate([known + w * np.resize(e, len(known)) ** 2 for (known, w), e in zip(parts, each, strict=True)])
    )


def _prior_rows(every: Sequence[Parameter]) -> tuple[Array, Array]:
    """Rows (m, p) of what is known of nuisances, whitened, and a scale (p,) of each parameter: one for a flat prior."""
    sigma = prior(every)[1]
    scale = np.where(np.isinf(sigma), 1.0, sigma)
    known = [i for i, q in enumerate(every) if not q.effect and np.isfinite(sigma[i])]
    return (np.eye(len(every)) / scale)[known], scale


def _scale_ordinals(views: Sequence[View]) -> tuple[NDArray[np.int64], list[NDArray[np.int64]]]:
    """Return the ordinal of the scale of each row of views, and those of the channels, (1,) or (C,), of each view."""
    ordinals: dict[str, NDArray[np.int64]] = {}
    for v in views:
        new = np.arange(len(v.channels) if v.noise.of_each_channel else 1) + sum(map(len, ordinals.values()))
        ordinals.setdefault(v.name, new)
    of_views = [ordinals[v.name] for v in views]
    return np.concatenate(
        [np.resize(k, len(_row_variances(v)[0])) for k, v in zip(of_views, views, strict=True)]
    ), of_views


def _scale_degrees_of_freedom(Q: Array, ordinal: NDArray[np.int64], rows: NDArray[np.bool_]) -> Array:
    """Return the degrees of freedom that a basis Q (q, rank) leaves of those rows of each scale that are named."""
    leverage_free = np.maximum(1 - (Q**2).sum(axis=1), 0.0)  # of a row that is fitted alone, rounding may leave less
    return np.bincount(ordinal[rows], leverage_free[rows], minlength=ordinal.max(initial=-1) + 1)


def excess_sigma(r: Array, own: Array, dof: int) -> float:
    """Return the excess sigma at which the sum of r^2 / (own + excess^2) is dof; 0 where the variance `own` explains r.

    Rows of infinite variance take no part.
    """
    if not np.any(own):
        return float(np.sqrt((r**2).sum() / dof))
    low, high = 0.0, float(np.sqrt((r**2).sum()))
    for _ in range(60):
        mid = (low + high) / 2
        low, high = (mid, high) if (r**2 / (own + mid**2)).sum() > dof else (low, mid)
    return high if (r**2 / own).sum() > dof else 0.0
