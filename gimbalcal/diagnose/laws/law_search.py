r"""Search for a law outside the catalogue: all small expressions of the recorded variables, ranked by evidence.

All terms, all products of two and plain products of three are compared by how much they reduce the misfit, with the
calibration profiled out, in the likeliest noise. The constants of those that reduce it most are refined, together with
richer forms in their place and with tables; their evidence is integrated over all noises and sizes, as for causes. The
prior allows for the number of trials: a third is for single terms, a third for products of two and of three, equal
within each; the prior of a constant is uniform on its grid.

.. math:: \ln E = \ln BF - \ln n_{grid} - \ln (3 n_{expressions})

The prior of sizes is that of the functions which its columns span, so that neither origins nor units matter.

A law acts on one output, or on all of a triad or platform: one form with one set of constants, and sizes of each. Its
evidence is that of all outputs together, so that a law too weak in each of them shows in their sum.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from gimbalcal.diagnose.laws.expressions import (
    COEFFICIENTS,
    ONSETS,
    ORDERS,
    PHASE,
    POWERS,
    PRODUCT_FORMS,
    SINGLE_FORMS,
    Expression,
    Family,
    K,
    TermGroup,
    families,
    free_tables,
    moved_threshold,
    richer_forms,
    term_pairs,
    term_triples,
    terms_of_variable,
)
from gimbalcal.diagnose.laws.variables import Variable
from gimbalcal.effects import Stage, Stimulus
from gimbalcal.inference.algebra import beyond, orthonormal, orthonormal_columns
from gimbalcal.inference.levenberg import minimise
from gimbalcal.number import Array

WEIGHED_EXPRESSIONS = 60  # expressions whose evidence is worked out in full
REFINED_COUNTS = (20, 16, 4)  # of these, the best of one, two and three terms are refined in their constants
EXTENDED_COUNTS = (6, 6, 0)  # of these, richer forms are tried in the place of theirs
SHARE_OF_TRIADS = 3  # by which these numbers are divided for laws of all axes
LATTICE_SIZES = 0.75 ** np.arange(12)  # of the first step of a constant, from one refinement of a jump to the next
LATTICE_POINTS = 2  # from which a refinement of jumps goes on: from one alone it sometimes misses the best
SAME_GAIN = 1e-6  # nats by which rounding changes what is explained where no row lies between two constants
MIDDLE_ROUNDS = 2  # in which each constant is put in the middle of the places that explain the same
DIFFERENCE = 1e-4  # of the first step of a constant: for derivatives
SETTLED, GAIN, MOST_STEPS = 1e-3, 1e-6, 30  # of the first step, and of the misfit, at which a refinement has arrived
CHUNK = 100  # families at a time
# where a law is added: to what a sensor feels, as it is before the scale factor
STAGE = {"specific_force": Stage.SCALE, "angular_rate": Stage.RATE_SCALE, "gimbal_angle": Stage.ENCODER}
ROWS = 900  # rows of a recording on which expressions are compared
MIN_SHARE_OF_COLUMN = 3e-2  # of a column: less left by the calibration is nothing to speak of
MIN_RESPONSE = 1.0  # sigmas that one m/s^2, rad/s or rad makes: rows that respond less are those of no fit
MIN_STRETCHES = 2.5  # stretches of a recording, at the least, that a law has to act in: what acts in one is an outlier
RIDGE = 1e-4  # of a unit column: two that are alike count as one
SAME_SPACE = 1e-6  # sine of the largest angle between two spaces of columns that are one
SAME_CORRELATION = 0.999  # correlation from which two expressions are one in this recording
# nats against a law of an output in gimbal angles, or of a gimbal in forces, and against a rare form
UNUSUAL_NATS = 1.5
RARE_FORMS = ("pulse", "sawtooth", "rectified", "ring", "cyclic", "rising", "falling", "growth")
JUMPS = ("pulse", "sawtooth", "above", "window")
ROUNDS = 4  # at the most, in which thresholds and the other constants of an expression are refined alternately
MIN_GAIN = 0.1  # nats of a round, below which it is the last
PROBE_STEPS = 2.0 ** -np.arange(0.0, 8.0, 0.5)  # of the first step of a constant, where its likelihood is looked at
MIN_NATS_OF_COLUMN = 3.0  # nats that a column of a law has to explain to be kept, at each of its places
LEAST_VARIANCE = 1e-6  # that a law leaves, of the noise without it
FARTHEST, FARTHEST_POWER = 3.4, 0.7  # of ln of a size, and of a power, from the grid to where it is refined
# ranges of a variable from its middle, beyond which powers are not printed from its reference
MAX_REFERENCE_RANGES = 2.0


@dataclass(frozen=True, eq=False)
class Place:
    """Where a law may be added: channel, axis, what it may follow there, what is felt, and what an addition does.

    columns: (n, m) added there to (n', C, m) rows, each the mean of so many successive `instants`; block (n,): ordinals
    of the stretches over which an addition is taken as even for a first look. stimulus: of several recordings that of
    the first; the variables have the rows of all.
    """

    channel: str
    axis: str
    variables: tuple[Variable, ...]
    stimulus: Stimulus
    block: Array
    columns: Callable[[Array], Array]
    instants: int = 1


@dataclass(frozen=True, eq=False)
class LawProblem:
    """The problem of finding a law: places, the likeliest noise, calibration and data in it, and the full evidence.

    whiten: (n', C, m) to rows (R, m) of unit variance; Q (R, q) orthonormal calibration and y (R,) data so whitened;
    evidence: sets of columns (n', C, m) to their ln Bayes factors over all noises and sizes; shape: (n', C); parts:
    columns to those of each recording, where the rows of several stand in one channel.
    """

    places: Sequence[Place]
    whiten: Callable[[Array], Array]
    Q: Array
    y: Array
    evidence: Callable[[Sequence[Array]], Array]
    shape: tuple[int, int]
    parts: Callable[[Array], Sequence[Array]] = lambda X: (X,)

    def remainder(self, A: Array) -> Array:
        """Return what the calibration leaves of whitened columns A (R, m)."""
        return beyond(self.Q, A)


@dataclass(frozen=True, eq=False)
class BlockResponse:
    """Response of rows to additions at some places, each by itself, that are even over blocks.

    A column b (blocks,) at a place takes away (v.b)^2 / 2 b'K b, of b'K b + |absorbed b|^2 before calibration. rows
    (blocks k,): of the variables where expressions are evaluated, k of each block; weight (blocks, k): of these in the
    mean of the block. Of each place, root (p, r, blocks): K = root' root; y (p, r): root' y = v; absorbed
    (p, q, blocks): in the columns of calibration.
    """

    rows: Array
    weight: Array
    root: Array
    absorbed: Array
    y: Array

    def means_of(self, e: Expression) -> Array:
        """Means (blocks, m) of the columns of one expression."""
        return np.asarray(np.einsum("bk,bkm->bm", self.weight, e.columns.reshape(*self.weight.shape, -1)))

    def means(self, family: Family) -> Array:
        """Means (blocks, m, K) of the columns of the K expressions of a family, which are never formed themselves."""
        blocks, k = self.weight.shape
        *first, last = (own.factors if len(family) > 1 else own.columns for own in family)
        X = self.weight[:, :, None, None]
        for F in (F.reshape(blocks, k, 1, F.shape[1], 1, F.shape[2]) for F in first):
            X = (X[:, :, :, None, :, None] * F).reshape(blocks, k, -1, X.shape[3] * F.shape[5])
        (a, T), (b, S) = X.shape[2:], last.shape[1:]
        B = np.swapaxes(X.reshape(blocks, k, a * T), 1, 2) @ last.reshape(blocks, k, b * S)
        B = B.reshape(blocks, a, T, b, S).transpose(0, 1, 3, 2, 4).reshape(blocks, a * b, T * S)
        return np.asarray(B[:, int(len(family) > 1 and all(own.terms[0].free_origin for own in family)) :])

    def at(self, places: list[int]) -> BlockResponse:
        """Return the response to additions at some of the places."""
        return replace(self, root=self.root[places], absorbed=self.absorbed[places], y=self.y[places])


def block_response(g: LawProblem, places: Sequence[Place]) -> BlockResponse:
    """Return the response of the whitened rows, calibration removed, to even additions over blocks of like places."""
    block, blocks = places[0].block, int(places[0].block[-1]) + 1
    even = (block[:, None] == np.arange(blocks)).astype(float)
    each = [_roots(g, g.whiten(place.columns(even))) for place in places]
    root, absorbed, y = (np.stack(part) for part in zip(*each, strict=True))
    first = int(np.argmax(root.any(axis=(0, 2))))  # what shows at no place stands first
    return BlockResponse(*_thinned_rows(block, blocks), root[:, first:], absorbed, y[:, first:])


def _roots(g: LawProblem, M: Array) -> tuple[Array, Array, Array]:
    """Return root, absorbed and y of the response M (R, blocks) of whitened rows at one place."""
    absorbed = g.Q.T @ M
    remainder = M - g.Q @ absorbed
    lam, V = np.linalg.eigh(remainder.T @ remainder)
    size = np.sqrt(np.where(lam > 1e-12 * max(float(lam.max(initial=0.0)), 1e-300), lam, 0.0))
    y = (V.T @ (remainder.T @ g.y)) / np.where(size > 0, size, np.inf)
    return size[:, None] * V.T, absorbed, y


def _thinned_rows(block: Array, blocks: int) -> tuple[Array, Array]:
    """Return ordinals of some `ROWS` rows, as many evenly in each block, with their weights in its mean.

    A short block has its last row several times, once with a weight.
    """
    starts = np.flatnonzero(np.diff(block, prepend=-1))[:, None]
    size = np.diff(np.append(starts, len(block)))[:, None]
    most = min(max(ROWS // blocks, 1), int(size.max()))
    k = np.arange(most)
    even = np.round(k * ((size - 1) / max(most - 1, 1)) + starts).astype(int)
    rows = np.where(size > most, even, starts + np.minimum(k, size - 1))
    return rows.ravel(), (k < size) / np.minimum(size, most)


@dataclass(frozen=True, eq=False)
class Law:
    """An expression at one place, or at all of a channel with sizes of its own at each, and its evidence.

    The evidence is the ln Bayes factor less what the choice among others costs. response: to additions at the places.
    """

    places: tuple[Place, ...]
    expression: Expression
    evidence: float
    response: BlockResponse
    cost: float = 0.0

    @property
    def columns(self) -> Array:
        """The rows (n', C, q m) that a unit of each coefficient adds, the m of each of q places after the other."""
        return _columns_at(self.places, self.expression.columns)

    @property
    def channel(self) -> str:
        """The channel of its places."""
        return self.places[0].channel

    @property
    def axis(self) -> str:
        """The axes of its places."""
        return ", ".join(p.axis for p in self.places)

    def spreads(self) -> dict[tuple[int, int], float]:
        """One sigma [SI] of each constant that was refined, by the curvature of the likelihood in all of them.

        By ordinals of term and constant; the value, or the range of the variable, where the data do not determine it.
        """
        return {(m.i, m.j): sigma * m.unit for m, sigma in self._determined}

    @property
    def posterior(self) -> float:
        """Return the evidence less the penalty of refined constants, which the data resolve better than their grids.

        The penalty of a constant is ln of the step of its grid over the width of its likelihood.
        """
        finer = [3 * m.step / (np.sqrt(2 * np.pi) * sigma) for m, sigma in self._determined]
        return self.evidence - float(np.log(np.maximum(finer, 1.0)).sum())

    @property
    def wants_another_form(self) -> bool:
        """Return whether a power is at the end of what is tried, where the law tends to a step or to a limit."""
        powers = [t.constants[j] for t in self.expression.terms for j, c in enumerate(t.form.constants)
                  if c.kind == "power"]  # fmt: skip
        low, high = POWERS[0] * np.exp(0.99 * -FARTHEST_POWER), ONSETS[-1] * np.exp(0.99 * FARTHEST_POWER)
        return any(not low < p < high for p in powers)

    @cached_property
    def _determined(self) -> list[tuple[_Move, float]]:
        """Each constant that was refined, with one sigma of it in the units in which it is moved."""
        e = _at_rows(self.expression, self.response)
        moves = [_Move(e, i, j) for i, j, _ in e.smooth()]
        h = np.array([m.step / 4 for m in moves])

        def at(u: Array) -> float:
            return _likelihood_gain(self.response, _moved_expression(e, moves, u * h))

        H, one = np.zeros((len(h), len(h))), np.eye(len(h))
        for a in range(len(h)):
            for b in range(a + 1):
                H[a, b] = H[b, a] = -sum(
                    p * q * at(p * one[a] + q * one[b]) for p in (1, -1) for q in (1, -1)
                ) / (4 * h[a] * h[b])  # fmt: skip
        lam, V = np.linalg.eigh(H)
        C = (V / np.maximum(lam, 1.0)) @ V.T
        return [(m, float(np.sqrt(C[k, k]))) for k, m in enumerate(moves)]


def laws_of(problems: Sequence[LawProblem], products: bool = True) -> list[list[Law]]:
    """Return for each problem the expressions that explain something, by evidence, best first; of those that are one in
    this recording each.

    All are of the same recordings, each with its noise and its known causes, so that an expression is evaluated once
    for all of them. products: whether products are searched too, or single terms alone.
    """
    scored, number = [list[Scored]() for _ in problems], np.zeros((len(problems), 3))
    alike: dict[tuple[int, int, int], dict[int, list[Target]]] = {}
    for k, g in enumerate(problems):
        for key, targets in _places_alike(g).items():
            alike.setdefault(key, {})[k] = targets
    for each in alike.values():
        laws = _families(next(iter(each.values())), products)
        lengths = {(" * ".join(own.terms[0].family for own in law), len(law)) for law in laws}
        count = np.bincount([length for _, length in lengths], minlength=4)[1:]
        for k, own in zip(each, _best_families(list(each.values()), laws), strict=True):
            scored[k] += own
            number[k] += len(each[k]) * count
    return [_weighed(*own) for own in zip(problems, scored, number, strict=True)]


def _weighed(g: LawProblem, scored: list[Scored], number: Array) -> list[Law]:
    """Return the best expressions as laws, by evidence; number (3,) of families of each length that were looked at."""
    chosen = list[tuple[Target, Expression]]()
    for several, share in ((False, 1), (True, SHARE_OF_TRIADS)):
        chosen += _extended_and_refined([s for s in scored if (len(s[1].places) > 1) is several], share)
    if not chosen:
        return []  # nothing is left that any would take away
    chosen = [(target, e.of(target.places[0].variables)) for target, e in chosen]
    ln = _evidence_of_spans(g, [(target.places, e) for target, e in chosen])
    laws = []
    for (target, e), gained in zip(chosen, ln, strict=True):
        cost = np.log(3 * number[min(len(e.terms), 3) - 1]) + np.log(e.tried) + _cost_of_unusual(target.places[0], e)
        laws.append(Law(target.places, e, float(gained - cost), target.response, float(cost)))
    return sorted(laws, key=lambda law: -law.evidence)


def weighed_in(g: LawProblem, laws: Sequence[Law]) -> list[Law]:
    """Return laws with their evidence in another problem of the same recordings."""
    moved = list[tuple[tuple[Place, ...], Expression]]()
    for law in laws:
        keys = [(p.channel, p.axis) for p in law.places]
        places = tuple(p for p in g.places if (p.channel, p.axis) in keys)
        moved.append((places, law.expression.of(places[0].variables)))
    ln = _evidence_of_spans(g, moved) if laws else ()
    return [Law(places, e, float(gained - law.cost), block_response(g, places), law.cost)
            for law, (places, e), gained in zip(laws, moved, ln, strict=True)]  # fmt: skip


def _evidence_of_spans(g: LawProblem, each: Sequence[tuple[tuple[Place, ...], Expression]]) -> Array:
    """Return the ln Bayes factor of columns of rms one that span those of each expression, at each of its places."""
    return g.evidence([_columns_at(places, orthonormal_span(e.columns)) for places, e in each])


Scored = tuple[float, "Target", Expression]  # what an expression explains at a target


def _extended_and_refined(scored: list[Scored], share: int) -> list[tuple[Target, Expression]]:
    """Return the expressions to be weighed: of the best, richer forms too, and the best of each length refined.

    share: by which the numbers of these are divided.
    """
    richer, refined = [0, 0, 0], [0, 0, 0]
    for _, target, e in sorted(scored, key=lambda f: -f[0]):
        n = len(e.terms) - 1
        if richer[n] < EXTENDED_COUNTS[n] // share and richer_forms(e, several := len(target.places) > 1):
            richer[n] += 1  # of those that may become something else
            # A pulse begins at the frequency of its wave, and being flat between its jumps is not led to a better one.
            begun = _refined_expression(target.response, e)
            scored += _best_families([[target]], richer_forms(begun, several))[0]
    out = list[tuple[Target, Expression]]()
    for _, target, e in sorted(scored, key=lambda f: -f[0]):
        n = len(e.terms) - 1
        refined[n] += 1
        best = refined[n] <= REFINED_COUNTS[n] // share
        if best or len(out) < WEIGHED_EXPRESSIONS // share:
            out.append((target, _refined_expression(target.response, e) if best else e))
    return [(target, e) for target, e in out if _is_carried_widely(target.response, e)]


def _columns_at(places: Sequence[Place], X: Array) -> Array:
    """Return what additions X (n, m) do at each of some places, one after the other (n', C, q m)."""
    return np.concatenate([p.columns(X) for p in places], axis=-1)


@dataclass(frozen=True, eq=False)
class Target:
    """One place, or all places of a channel, of those with the same variables: their ordinals in the response of all.

    Between outputs that the rows show together, what they explain together is taken as the sum of what each explains:
    good enough to choose what is weighed.
    """

    places: tuple[Place, ...]
    at: list[int]
    of_all: BlockResponse

    @cached_property
    def response(self) -> BlockResponse:
        """The response to additions at these places."""
        return self.of_all.at(self.at)


def _places_alike(g: LawProblem) -> dict[tuple[int, int, int], list[Target]]:
    """Return the places that show additions, those together in which the same variables stand."""
    alike: dict[tuple[int, int, int], list[Place]] = {}
    for place in g.places:
        alike.setdefault((id(place.stimulus), len(place.block), len(place.variables)), []).append(place)
    each = ((key, _search_targets(places, block_response(g, places))) for key, places in alike.items())
    return {key: own for key, own in each if own}


def _search_targets(places: Sequence[Place], response: BlockResponse) -> list[Target]:
    """Return each place that responds to additions, and all of a channel together where they are several."""
    size = np.sqrt((response.root**2).sum(axis=1) + (response.absorbed**2).sum(axis=1)).max(axis=1)
    shown = np.flatnonzero(size > MIN_RESPONSE).tolist()
    places, response = [places[k] for k in shown], response.at(shown)
    of_channel: dict[str, list[int]] = {}
    for k, place in enumerate(places):
        of_channel.setdefault(place.channel, []).append(k)
    each = [[k] for k in range(len(places))] + [own for own in of_channel.values() if len(own) > 1]
    return [Target(tuple(places[k] for k in own), own, response) for own in each]


def _families(targets: Sequence[Target], products: bool) -> list[Family]:
    """Return the expressions that are looked at, at places of the same variables."""
    place, rows = targets[0].places[0], targets[0].of_all.rows
    every = [terms_of_variable(v, place.stimulus, SINGLE_FORMS[v.group], rows) for v in place.variables]
    laws = [*((grid,) for own in every for grid in families(own)), *free_tables(place.variables, rows, products)]
    if products:
        slow = [[t for t in own if t.form.key in PRODUCT_FORMS[t.variable.group]] for own in every]
        laws += [*term_pairs(slow), *term_triples(slow)]
    return laws


def free_numbers(law: Law) -> int:
    """Return the number of fitted constants of a law, a rare form counting as one: the shortest law is preferred."""
    e = law.expression
    return e.columns.shape[1] + len(e.smooth()) + sum(t.form.key in RARE_FORMS for t in e.terms)


def orthonormal_span(X: Array) -> Array:
    """Return columns (n, q) of rms one that span those of X (n, m) and are orthogonal to each other."""
    return orthonormal_columns(X, 1e-6) * np.sqrt(len(X))


def _at_rows(e: Expression, response: BlockResponse) -> Expression:
    """Return the expression at the rows that a response is thinned to."""
    return e.of(replace(v, x=v.x[response.rows]) for v in e.variables)


def trimmed_law(g: LawProblem, law: Law) -> Law:
    """Return the law with powers from the references of its variables, without columns that explain next to nothing.

    What the calibration takes up has no size, and a lower power may be none of the law. The noise is no larger than
    what the law leaves: where its scale is fitted, the model without a law takes all of the law for noise.
    """
    e = _at_rows(law.expression, law.response)
    away = [abs(v.reference - v.origin) / max(float(np.ptp(v.x)), 1e-300) for v in law.expression.variables]
    e = e.referred() if max(away) <= MAX_REFERENCE_RANGES else e
    while len(groups := e.groups) > 1:
        worth = _likelihood_gain(law.response, e)
        variance = _variance_left(g, worth)
        least, drop = min(
            ((worth - _likelihood_gain(law.response, e.without(own)), own) for own in groups), key=lambda x: x[0]
        )
        if least > MIN_NATS_OF_COLUMN * len(law.places) * variance:
            break
        e = e.without(drop)
    return replace(law, expression=e.of(law.expression.variables))


def _variance_left(g: LawProblem, worth: float) -> float:
    """Return the variance of rows with a law that takes away so much of the misfit, at most that without it."""
    return float(np.clip((g.y @ g.y - 2 * worth) / max(len(g.y) - g.Q.shape[1], 1), LEAST_VARIANCE, 1.0))


def centred_jumps(g: LawProblem, law: Law) -> Law:
    """Return a law whose jumps are in the middle of where the data allow them.

    Between two rows the likelihood of a jump is level, and a search ends anywhere there; the mean over the likelihood
    of each constant errs least on the next recording.
    """
    e = begun = _at_rows(law.expression, law.response)
    worth = _likelihood_gain(law.response, begun)
    variance = _variance_left(g, worth)
    for i, j in 2 * _jump_constants(e):
        move = _Move(e, i, j)
        u = move.step * np.concatenate([-PROBE_STEPS, [0.0], PROBE_STEPS[::-1]])
        ln = np.array([_likelihood_gain(law.response, _moved_expression(e, [move], [x])) for x in u]) / variance
        p = np.exp(ln - ln.max()) * np.gradient(u)
        e = _moved_expression(e, [move], [float(p @ u / p.sum())])
    # The mean of two correlated constants lies off the ridge of their likelihood.
    if worth - _likelihood_gain(law.response, e) > variance:
        return law
    return replace(law, expression=e.of(law.expression.variables))


def _jump_constants(e: Expression) -> list[tuple[int, int]]:
    """Return term and constant of each position of a jump, except those of waves of an angle and zero."""
    return [
        (i, j)
        for i, t in enumerate(e.terms)
        for j in range(len(t.form.constants))
        if t.is_threshold(j) or (t.form.key in JUMPS and t.variable.group != "temperature rate" and t.refined(j))
    ]


def _cost_of_unusual(place: Place, e: Expression) -> float:
    """Nats against what stands for another: angles of what is felt in an output, forces in a gimbal; and rare forms."""
    of = "force" if place.channel in ("gimbal_angle", "pointing") else "angle"
    return UNUSUAL_NATS * (sum(v.group == of for v in e.variables) + sum(t.form.key in RARE_FORMS for t in e.terms))


def _best_families(problems: Sequence[Sequence[Target]], laws: Sequence[Family]) -> list[list[Scored]]:
    """Return for each problem the best families of each length at each of its targets, at their best constants; at
    several places those that are better than at one.

    What they explain is less the cost of coefficients and grid. The means of an expression are formed once.
    """
    tops = [[dict[str, Best]() for _ in targets] for targets in problems]
    for k in range(0, len(laws), CHUNK):
        by_width: dict[int, list[tuple[Family, Array]]] = {}
        for law in laws[k : k + CHUNK]:
            B = problems[0][0].of_all.means(law)
            if B.shape[1] <= COEFFICIENTS or law[0].terms[0].form.key == "table":
                by_width.setdefault(B.shape[1], []).append((law, B))
        for m, own in by_width.items():
            columns, ends = np.concatenate([B for _, B in own], axis=-1), np.cumsum([B.shape[2] for _, B in own])[:-1]
            for targets, of_problem in zip(problems, tops, strict=True):
                each = likelihood_gains(targets[0].of_all, columns) - 2.0 * m
                worths = np.stack([each[target.at].sum(axis=0) for target in targets])
                for (law, _), worth in zip(own, np.split(worths, ends, axis=1), strict=True):
                    _keep_better(of_problem, law, worth)
    return [_best_by_length(targets, own) for targets, own in zip(problems, tops, strict=True)]


Best = tuple[float, Family, int]
"""What the best expression of a family explains, less the cost of its choice; the family, and its ordinal there."""


def _keep_better(tops: Sequence[dict[str, Best]], law: Family, worth: Array) -> None:
    """Keep at each target the best of a family of worth (targets, K) if it explains more than what is kept so far."""
    name, cost = " * ".join(own.terms[0].family for own in law), math.log(math.prod(own.terms[0].tried for own in law))
    best = worth.argmax(axis=1)
    gains = worth[np.arange(len(worth)), best] - cost
    for top, gain, i in zip(tops, gains.tolist(), best.tolist(), strict=True):
        if gain > (top[name][0] if name in top else 0.0):
            top[name] = gain, law, i


def _best_by_length(targets: Sequence[Target], tops: Sequence[dict[str, Best]]) -> list[Scored]:
    """Return the best families of each length at each target, at several places those that are better than at one."""
    single = {target.places[0]: top for target, top in zip(targets, tops, strict=True) if len(target.places) == 1}
    out = list[Scored]()
    for target, top in zip(targets, tops, strict=True):
        others = [single[p] for p in target.places if p in single and len(target.places) > 1]
        better = [b for key, b in top.items() if all(b[0] > own[key][0] for own in others if key in own)]
        for n in (1, 2, 3):  # products are many, and would leave no room for what a single term may become
            as_long = sorted((b for b in better if len(b[1]) == n), key=lambda b: -b[0])
            out += [(gain, target, _member(law, i)) for gain, law, i in as_long[:WEIGHED_EXPRESSIONS]]
    return out


def _member(law: Family, i: int) -> Expression:
    """Return an expression of a family by its ordinal."""
    at = np.unravel_index(i, [len(own.terms) for own in law])
    return Expression(tuple(own.terms[k] for own, k in zip(law, at, strict=True)))


def likelihood_gains(response: BlockResponse, B: Array) -> Array:
    """Return the gain in ln likelihood (p, K) by formulas, each of m columns B (blocks, m, K), at each of p outputs."""
    (blocks, m, K), p = B.shape, len(response.y)
    flat = B.reshape(blocks, m * K)
    X = response.root @ flat
    with np.errstate(over="ignore"):  # of a power that a refinement tries; it shows nothing
        square = np.einsum("prk,prk->pk", X, X)
        taken = response.absorbed @ flat
        whole = square + np.einsum("pqk,pqk->pk", taken, taken)
        shown = np.isfinite(whole) & (square > MIN_SHARE_OF_COLUMN**2 * whole)
    scale = (1.0 / np.sqrt(np.where(shown, square, np.inf))).reshape(p, m, K)
    b = (response.y[:, None] @ X).reshape(p, m, K) * scale
    if m == 1:
        return np.asarray(b[:, 0] ** 2 / 2)
    X = X.reshape(p, -1, m, K)
    G = np.einsum("prik,prjk->pkij", X, X) * np.einsum("pik,pjk->pkij", scale, scale) + RIDGE * np.eye(m)
    return np.asarray(np.einsum("pmk,pkm->pk", b, np.linalg.solve(G, b.transpose(0, 2, 1)[..., None])[..., 0]) / 2)


def _is_carried_widely(response: BlockResponse, e: Expression) -> bool:
    """Return whether what a law adds is spread over several stretches and not an outlier of one or two."""
    B = response.means_of(e)
    each = zip(response.root, response.y, strict=True)
    added = np.stack([B @ np.linalg.lstsq(root @ B, y, rcond=1e-6)[0] for root, y in each], axis=1)
    square = ((added - np.median(added, axis=0)) ** 2).sum(axis=1)
    return bool(square.sum() ** 2 > MIN_STRETCHES * (square**2).sum())


def _likelihood_gain(response: BlockResponse, e: Expression) -> float:
    """Return the ln likelihood that an expression at the rows of a response takes away of the misfit."""
    return float(likelihood_gains(response, response.means_of(e)[:, :, None]).sum())


@dataclass(frozen=True, eq=False)
class _Move:
    """A constant that is refined: constant j of term i, in steps of the logarithm of a size, or of a range."""

    e: Expression
    i: int
    j: int

    @property
    def kind(self) -> str:
        return self.e.terms[self.i].form.constants[self.j].kind

    @property
    def value(self) -> float:
        return self.e.terms[self.i].constants[self.j]

    @property
    def span(self) -> float:
        return float(np.ptp(self.e.terms[self.i].variable.x)) or 1.0

    @property
    def unit(self) -> float:
        """The change of the constant [SI] for a small change of what is moved."""
        of = {"size": abs(self.value), "power": self.value, "place": self.span, "origin": self.span, "fixed": self.span}
        return of.get(self.kind, 1.0)

    @property
    def step(self) -> float:
        """First step: a third of that of its grid."""
        c = self.e.terms[self.i].form.constants[self.j]
        if c.of == "1/x":
            return float(np.log1p(np.pi / self.span / max(self.value, 1e-300) / 3))
        return {"size": 0.3, "power": 0.2, "place": 0.03, "fixed": 0.03, "origin": 0.1}.get(self.kind, 0.2)

    def at(self, u: float) -> tuple[int, int, float]:
        """Return the constant moved by u, within the range that its variable can determine."""
        if self.kind in ("size", "power"):
            farthest = FARTHEST if self.kind == "size" else FARTHEST_POWER
            return self.i, self.j, self.value * float(np.exp(np.clip(u, -farthest, farthest)))
        x = self.value + u * self.unit
        if self.kind in ("place", "origin"):
            logged, beyond = self.e.terms[self.i].variable.x, self.span * (self.kind == "origin")
            x = float(np.clip(x, logged.min() - beyond, logged.max() + beyond))
        return self.i, self.j, float(x)


def _moved_expression(e: Expression, moves: Sequence[_Move], u: Sequence[float] | Array) -> Expression:
    """Return the expression with its constants moved by u.

    A frequency k turns about the middle of its variable, where the phase k x + phi stays: moved alone, it would shift
    all that lies far from zero, and only a change of phi as well could put that back.
    """
    changed = {(i, j): x for i, j, x in (m.at(float(x)) for m, x in zip(moves, u, strict=True))}
    for m in moves:
        term, phase = e.terms[m.i], (m.i, m.j + 1)
        if term.form.constants[m.j : m.j + 2] == (K, PHASE):
            x = term.variable.x
            turned = (changed[m.i, m.j] - m.value) * (x.min() + x.max()) / 2
            changed[phase] = changed.get(phase, term.constants[m.j + 1]) - float(turned)
    return e.at([(i, j, x) for (i, j), x in changed.items()])


def _refined_expression(response: BlockResponse, e: Expression) -> Expression:
    """Return the expression with its constants where they take away most.

    Where it begins and how it continues from there depend on each other, so that both are refined alternately.
    """
    gain = _likelihood_gain(response, e)
    for _ in range(ROUNDS):
        before, e = gain, _with_moved_thresholds(response, e)
        moves = [_Move(e, i, j) for i, j, _ in e.smooth()]
        if moves:
            jumps = any(e.terms[m.i].form.key in JUMPS for m in moves)
            other = _moved_expression(e, moves, (_by_lattice if jumps else _by_derivatives)(response, e, moves))
            e = max(e, other, key=partial(_likelihood_gain, response))
        gain = _likelihood_gain(response, e)
        if gain - before < MIN_GAIN or not any(t.is_threshold(k) for t in e.terms for k in range(len(t.constants))):
            break
    return e


def _with_moved_thresholds(response: BlockResponse, e: Expression) -> Expression:
    """Return the expression with each of its thresholds where it takes away most, one after the other."""
    for i, k in [(i, k) for i, t in enumerate(e.terms) for k in range(len(t.constants))]:
        near = TermGroup((e.terms[i], *moved_threshold(e.terms[i], k)))
        family = tuple(near if n == i else TermGroup((t,)) for n, t in enumerate(e.terms))
        best = int(np.argmax(likelihood_gains(response, response.means(family)).sum(axis=0)))
        e = replace(e, terms=(*e.terms[:i], near.terms[best], *e.terms[i + 1 :]))
    return e


def _by_lattice(response: BlockResponse, e: Expression, moves: Sequence[_Move]) -> Array:
    """Return the best constants of what jumps, which has no derivatives, on lattices about the best that shrink.

    Their steps are of one constant or of two, as the phase of a pulse follows its frequency. Where no row lies between
    two places of a jump they explain the same, and the middle of all that do errs least.
    """
    steps = np.array([m.step for m in moves])
    signs = np.array([d for d in itertools.product((0, 1, -1), repeat=len(moves)) if np.count_nonzero(d) <= 2])
    best = np.zeros((1, len(moves)))

    def gains(tried: Array) -> Array:
        columns = np.stack([response.means_of(_moved_expression(e, moves, u)) for u in tried], axis=-1)
        return likelihood_gains(response, columns).sum(axis=0)

    for size in LATTICE_SIZES:
        tried = (best[:, None] + size * steps * signs).reshape(-1, len(moves))
        _, first = np.unique(np.round(-gains(tried) / SAME_GAIN), return_index=True)
        best = tried[first[:LATTICE_POINTS]]
    return _in_the_middle(gains, best[0], steps)


def _in_the_middle(gains: Callable[[Array], Array], best: Array, steps: Array) -> Array:
    """Return constants (k,) in the middle of those about the best that explain the same, one constant after the other.

    gains: nats that choices of constants (m, k) take away of the misfit, (m,); steps (k,): how far is looked at most.
    """
    most, sizes = float(gains(best[None])[0]), LATTICE_SIZES[::-1]
    for step in [*np.diag(steps)] * MIDDLE_ROUNDS:
        same = [np.abs(gains(best + sizes[:, None] * way) - most) < SAME_GAIN for way in (step, -step)]
        above, below = (float(sizes[np.logical_and.accumulate(each)].max(initial=0.0)) for each in same)
        best = best + (above - below) / 2 * step
    return best


def _by_derivatives(response: BlockResponse, e: Expression, moves: Sequence[_Move]) -> Array:
    """Return the best constants of a smooth expression, its coefficients following them.

    Kaufman's variable projection: of the derivative of the columns that part counts which they do not span themselves.
    """
    steps = np.array([m.step for m in moves])

    def shown(u: Array) -> Array:
        B = response.means_of(_moved_expression(e, moves, u * steps))
        X, taken = response.root @ B, response.absorbed @ B
        square, hidden = (X**2).sum(axis=1), (taken**2).sum(axis=1)
        return np.where((square > MIN_SHARE_OF_COLUMN**2 * (square + hidden))[:, None], X, 0.0)

    def model(u: Array, _: Array) -> tuple[Array, Array]:
        A = shown(u[0])
        derivative = np.stack([shown(u[0] + DIFFERENCE * one) - A for one in np.eye(len(steps))], axis=-1) / DIFFERENCE
        length = np.sqrt((A**2).sum(axis=1, keepdims=True))
        unit = A / np.where(length > 0, length, 1.0)
        inverse = np.linalg.inv(np.swapaxes(unit, 1, 2) @ unit + RIDGE * np.eye(A.shape[2])) @ np.swapaxes(unit, 1, 2)
        size = (inverse @ response.y[..., None])[..., 0]
        rest = response.y - (unit @ size[..., None])[..., 0]
        moved = np.einsum("prmk,pm->prk", derivative, size / np.where(length > 0, length, np.inf)[:, 0])
        return rest.reshape(1, -1), -(moved - unit @ (inverse @ moved)).reshape(1, rest.size, -1)

    return minimise(model, np.zeros((1, len(moves))), SETTLED, MOST_STEPS, GAIN).x[0] * steps


def aliases(g: LawProblem, law: Law) -> list[Law]:
    """Return the law with other harmonics of its angles whose columns span the same space here, calibration removed.

    At multiples of 45 deg the fifth harmonic is the third: no evidence distinguishes what no row shows.
    """

    def span(one: Law) -> Array:
        return orthonormal_columns(g.remainder(g.whiten(one.columns)))

    own, out = span(law), []
    for i, t in enumerate(law.expression.terms):
        for n in range(1, ORDERS + 1) if t.form.key == "harmonic" else ():
            other = replace(law, expression=law.expression.at([(i, 0, float(n))]))
            Q = span(other) if n != t.constants[0] else own[:, :0]
            if Q.shape == own.shape and np.linalg.norm(beyond(own, Q), 2) < SAME_SPACE:
                out.append(other)
    return out


def response_of(g: LawProblem, law: Law) -> Array:
    """Return what a law, fitted, adds to the whitened rows, calibration removed, as a unit vector (R,)."""
    Q = orthonormal(g.remainder(g.whiten(law.columns)))
    added = Q @ (Q.T @ g.y)
    return np.asarray(added / max(float(np.linalg.norm(added)), 1e-300))
