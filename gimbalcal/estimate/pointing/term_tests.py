r"""Tests of the terms of a mount, one by one: the residual without a term of the model, and with one more.

.. math:: F = \frac{(S_0 - S_1) / k}{S_1 / \nu}

with S_0, S_1 the weighted sums of squares without and with the k parameters of a term, and nu the degrees of freedom of
the larger model; a stated noise takes the place of S_1 / nu. The models are linear about the estimate. Where
rows remember each other F is less, as chi^2 of the term's size by its covariance (`noise_memory`) is than that by the
one for independent rows.

An effect outside the model whose constant must be sought (the teeth of a worm, an order, the instant of a step) is no
candidate: `gimbalcal diagnose` seeks it, and accounts for the number of values tried.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from math import sqrt
from typing import Any

import numpy as np

from gimbalcal.calibration.exchange.tpoint_model import term_names
from gimbalcal.calibration.provenance import TermTest
from gimbalcal.effects import CATALOGUE, Parameter, zero_effect
from gimbalcal.effects.effect import constants
from gimbalcal.estimate.extra_effects import columns_of_sizes
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.inference.algebra import orthonormal_columns, unit_columns
from gimbalcal.number import Array
from gimbalcal.p_value import probability
from gimbalcal.units import from_si

MIN_INDEPENDENT_SHARE = 1e-3  # of a column that the model does not span, below which stars do not distinguish the term
MIN_SINGULAR_RATIO = 3e-8  # of columns of length one, below which stars determine no combination of them
MAX_CORRELATIONS = 2  # of each term that are reported, the largest


def term_tests(fitted: ViewsFit, candidates: Sequence[Parameter], stated: bool) -> tuple[TermTest, ...]:
    """Return the tests of the terms of a fit, in its order, then those of candidates, the smallest residual first.

    stated: whether the noise of a star is stated. Candidates of the model itself, or that it spans, have no test.
    """
    tests = _Tests(fitted, stated)
    outside = [p for p in candidates if p not in fitted.parameters and not constants(CATALOGUE[p.effect])]
    added = [tests.of_candidate(p, column) for p, column in zip(outside, tests.columns(outside).T, strict=True)]
    ranked = sorted(filter(None, added), key=lambda t: (round(t.rms_with_arcsec, 6), t.tpoint is None))
    return (*tests.of_model(), *ranked)  # of equals the one that TPOINT has a name for


class _Tests:
    """The whitened rows of a fit: Jacobian J (q, p), residual r (q,), and one sigma (q,) of each row [rad]."""

    def __init__(self, fitted: ViewsFit, stated: bool) -> None:
        self.fitted, self.stated = fitted, stated
        self.J, r = fitted.whitened
        self.Q = orthonormal_columns(self.J)
        self.r = r - self.Q @ (self.Q.T @ r)
        self.sigma = np.concatenate([s.ravel() for s in fitted.sigma])
        self.stars = sum(map(len, fitted.views))
        self.names = term_names(fitted.views[0].source.platform)

    def of_model(self) -> list[TermTest]:
        """Return the test of each parameter of the model; the parameters of an effect with constants are one term."""
        parameters, P, out = self.fitted.parameters, self.fitted.covariance, []
        G, R = self.fitted.solution.covariance, correlations(P)
        for group in _terms(parameters):
            fixed = {f.name for f in constants(CATALOGUE[parameters[group[0]].effect])}
            sizes = [i for i in group if parameters[i].field not in fixed]
            y, Q = (
                self.r + self.J[:, sizes] @ self.fitted.x[sizes],
                orthonormal_columns(np.delete(self.J, group, axis=1)),
            )
            others = {q.label: float(R[i, j]) for i in group for j, q in enumerate(parameters) if j not in group}
            p, x, block = parameters[group[0]], self.fitted.x[sizes], np.ix_(sizes, sizes)
            label = p.label if len(group) == 1 else p.effect
            printed = _printed(p, self.fitted.x[group[0]], self.fitted.sigmas[group[0]]) if len(group) == 1 else ()
            memory = float(x @ np.linalg.solve(P[block], x)) / max(float(x @ np.linalg.solve(G[block], x)), 1e-300)
            out.append(self._test(label, printed, True, y - Q @ (Q.T @ y), self.r, len(group), others, memory))
        return out

    def of_candidate(self, p: Parameter, column: Array) -> TermTest | None:
        """Return the test of a parameter with this whitened column (q,); None where the model spans it."""
        own = column - self.Q @ (self.Q.T @ column)
        square = float(own @ own)
        if not square > (MIN_INDEPENDENT_SHARE * np.linalg.norm(column)) ** 2:
            return None
        x = float(own @ self.r) / square
        after = self.r - own * x
        scale = 1.0 if self.stated else float(after @ after) / max(self.fitted.solution.dof - 1, 1)
        A = np.column_stack([self.J, column])
        unit, size = unit_columns(A)
        inverse = np.linalg.pinv(np.linalg.qr(unit, mode="r"), rcond=MIN_SINGULAR_RATIO) / size[:, None]
        G = scale * inverse @ inverse.T
        P = G + self.fitted.added_by_memory(A, after, G)
        others = {q.label: float(c) for q, c in zip(self.fitted.parameters, correlations(P)[-1, :-1], strict=True)}
        memory = float(G[-1, -1] / P[-1, -1])
        printed = _printed(p, x, sqrt(float(P[-1, -1])))
        return self._test(p.label, printed, False, self.r, after, 1, others, memory)

    def columns(self, wanted: Sequence[Parameter]) -> Array:
        """Return whitened derivatives (q, k) of the rows by parameters of absent effects."""
        by_effect = [list(group) for _, group in groupby(wanted, key=lambda p: p.effect)]
        axes = self.fitted.views[0].stimulus.axis_names
        effects = [zero_effect(CATALOGUE[group[0].effect], axes) for group in by_effect]
        each = [columns_of_sizes(v.evaluate(self.fitted.effects), effects, wanted) for v in self.fitted.views]
        return np.concatenate([c.reshape(-1, len(wanted)) for c in each]) / self.sigma[:, None]

    def _test(
        self, label: str, printed: Sequence[Any], in_model: bool, without: Array, after: Array, k: int,
        others: Mapping[str, float], memory: float,
    ) -> TermTest:  # fmt: skip
        """Return the test of a term from the residuals (q,) without it and with it, of k parameters.

        printed: value, sigma and unit of a term that is one parameter. memory: by which chi^2 of its size is less than
        in noise whose rows are independent.
        """
        dof = None if self.stated else max(self.fitted.solution.dof - (0 if in_model else k), 0)
        gain = float(without @ without - after @ after)
        scale = 1.0 if dof is None else float(after @ after) / max(dof, 1)
        F = memory * max(gain, 0.0) / k / max(scale, 1e-300)
        largest = sorted(others, key=lambda label: -abs(others[label]))[:MAX_CORRELATIONS]
        return TermTest(
            label, in_model, self._rms(without), self._rms(after), F, (k, dof),
            probability(k * F, k, np.inf if dof is None else dof), {q: others[q] for q in largest},
            self.names.get(label), *printed,
        )  # fmt: skip

    def _rms(self, r: Array) -> float:
        """Return the root mean square on the sky [arcsec] of a whitened residual (q,)."""
        return float(from_si(sqrt(float(np.sum((r * self.sigma) ** 2)) / self.stars), "arcsec"))


def _printed(p: Parameter, x: float, sigma: float) -> tuple[float, float, str]:
    """Return value, sigma [SI] and unit as calibration.json states them."""
    return float(from_si(x, p.unit)), float(from_si(sigma, p.unit)), p.unit


def _terms(parameters: Sequence[Parameter]) -> list[list[int]]:
    """Return the ordinals of the parameters of each term: one, or all of an effect that has constants."""
    terms: dict[object, list[int]] = {}
    for i, p in enumerate(parameters):
        terms.setdefault(p.effect if constants(CATALOGUE[p.effect]) else p, []).append(i)
    return list(terms.values())


def correlations(covariance: Array) -> Array:
    """Return the correlations (p, p) of a covariance; zero where a variance is."""
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    inverse = np.where(sigma > 0, 1 / np.where(sigma > 0, sigma, 1.0), 0.0)
    return np.asarray(covariance * inverse * inverse[:, None])
