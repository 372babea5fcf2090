r"""A law that nobody has written down: every small expression of what was recorded, by its evidence.

All terms, all products of two and plain products of three are looked at by what they take away of the misfit,
calibration profiled out, in the likeliest noise. Those that take away most are refined in their constants, together
with richer forms in the place of theirs and with tables, and weighed over all noises and sizes, as every cause is. An
expression pays for its number: a third of the prior is for single terms, for products of two and of three, alike in
each; and a constant pays for its grid.

.. math:: \ln E = \ln BF - \ln n_{grid} - \ln (3 n_{expressions})

The prior of sizes is that of the functions which its columns span, so that neither origins nor units matter.

A law acts on one output, or on all of a triad or platform: one form with one set of constants, and sizes of each. Its
evidence is that of all outputs together, so that a law too weak in each of them shows in their sum.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.laws.expressions import (
    ALONE,
    COEFFICIENTS,
    MULTIPLIED,
    ORDERS,
    Expression,
    Term,
    between,
    partners,
    relatives,
    singles,
    tables,
    terms,
    triples,
)
from gimbalcal.diagnose.library.variables import Variable
from gimbalcal.effects import Stimulus
from gimbalcal.inference.algebra import basis, orthonormal
from gimbalcal.number import Array

WEIGHED = 60  # expressions whose evidence is worked out in full
REFINED = 10  # of these, the best of one, two and three terms are refined in their constants
EXTENDED = 6  # of these, richer forms are tried in the place of theirs
SHARE_OF_TRIADS = 3  # by which these numbers are divided for laws of all axes
ROUNDS = 70  # steps of a refinement for each constant
CHUNK = 400  # columns at a time
ROWS = 900  # rows of a recording on which expressions are compared
ABSORBED = 3e-2  # of a column: less left by the calibration is nothing to speak of
MIN_RESPONSE = 1.0  # sigmas that one m/s^2, rad/s or rad makes: rows that respond less are those of no fit
CARRIED = 2.5  # stretches of a recording, at the least, that a law has to act in: what acts in one is an outlier
RIDGE = 1e-4  # of a unit column: two that are alike count as one
SAME_SPACE = 1e-6  # sine of the largest angle between two spaces of columns that are one
SAME = 0.999  # correlation from which two expressions are one in this recording
UNUSUAL = 1.5  # nats against a law of an output in gimbal angles, or of a gimbal in forces, and against a rare form
RARE = ("pulse", "sawtooth", "rectified", "ring")
NEEDED = 3.0  # nats that a column of a law has to explain to be kept, at each of its places
LEAST_VARIANCE = 1e-6  # that a law leaves, of the noise without it
FAR = 2.0  # ranges of a variable from its middle, beyond which powers are not printed from its reference


@dataclass(frozen=True, eq=False)
class Place:
    """Where a law may be added: channel, axis, what it may follow there, what is felt, and what an addition does.

    columns: (n, m) added there to (n', C, m) rows; block (n,): ordinals of the stretches over which an addition is
    taken as even for a first look. stimulus: of several recordings that of the first; the variables have the rows of
    all.
    """

    channel: str
    axis: str
    variables: tuple[Variable, ...]
    stimulus: Stimulus
    block: Array
    columns: Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Ground:
    """In what a law is sought: places, the likeliest noise, calibration and data in it, and the full evidence.

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
        return np.asarray(A - self.Q @ (self.Q.T @ A))


@dataclass(frozen=True, eq=False)
class BlockResponse:
    """Response of rows to additions at a place that are even over blocks.

    A column b (blocks,) takes away (v.b)^2 / 2 b'K b, of b'K0 b before calibration. rows (m,): of the variables where
    expressions are evaluated; block (m,): the block of each. root (r, blocks) and before (s, blocks): K = root' root,
    K0 = before' before; y (r,): root' y = v.
    """

    rows: Array
    block: Array
    count: Array
    root: Array
    before: Array
    y: Array

    def block_means(self, columns: Array) -> Array:
        """Means (blocks, q) of columns (m, q)."""
        return np.asarray(np.add.reduceat(columns, np.flatnonzero(np.diff(self.block, prepend=-1))) / self.count)


def block_response(g: Ground, place: Place) -> BlockResponse:
    """Return the response of the whitened rows, calibration removed, to even additions over blocks."""
    blocks = int(place.block[-1]) + 1
    M = g.whiten(place.columns((place.block[:, None] == np.arange(blocks)).astype(float)))
    remainder = g.remainder(M)
    lam, V = np.linalg.eigh(remainder.T @ remainder)
    keep = lam > 1e-12 * max(float(lam.max(initial=0.0)), 1e-300)
    root = np.sqrt(lam[keep])[:, None] * V[:, keep].T
    lam0, V0 = np.linalg.eigh(M.T @ M)
    shown = lam0 > 1e-12 * max(float(lam0.max(initial=0.0)), 1e-300)  # fewer than blocks, where rows are few
    before = np.sqrt(lam0[shown])[:, None] * V0[:, shown].T
    y = (V[:, keep].T @ (remainder.T @ g.y)) / np.sqrt(lam[keep])
    rows = _thinned(place.block, blocks)
    return BlockResponse(rows, place.block[rows], np.bincount(place.block[rows])[:, None], root, before, y)


def _thinned(block: Array, blocks: int) -> Array:
    """Return the ordinals of at most some `ROWS` rows, evenly within each block."""
    each = max(ROWS // blocks, 1)
    ends = np.append(np.flatnonzero(np.diff(block, prepend=-1)), len(block))
    spans = itertools.pairwise(ends)
    return np.concatenate([np.arange(i, j) if j - i <= each else np.linspace(i, j - 1, each).round().astype(int)
                           for i, j in spans])  # fmt: skip


@dataclass(frozen=True, eq=False)
class Law:
    """An expression at one place, or at all of a channel with sizes of its own at each, and its evidence.

    The evidence is the ln Bayes factor less what the choice among others costs. responses: of each place.
    """

    places: tuple[Place, ...]
    expression: Expression
    evidence: float
    responses: tuple[BlockResponse, ...]

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

    @property
    def table(self) -> bool:
        """Return whether the law is no closed form."""
        return any(t.form.key == "table" for t in self.expression.terms)

    def spreads(self) -> dict[tuple[int, int], float]:
        """One sigma [SI] of each constant that was refined, by the curvature of the likelihood in all of them.

        By ordinals of term and constant; the value, or the range of the variable, where the data do not determine it.
        """
        e = _at_rows(self.expression, self.responses[0])
        moves = [_Move(e, i, j) for i, j, _ in e.smooth()]
        h = np.array([m.step / 4 for m in moves])

        def at(u: Array) -> float:
            return _worth(self.responses, _moved(e, moves, u * h))

        H, one = np.zeros((len(h), len(h))), np.eye(len(h))
        for a in range(len(h)):
            for b in range(a + 1):
                H[a, b] = H[b, a] = -sum(
                    p * q * at(p * one[a] + q * one[b]) for p in (1, -1) for q in (1, -1)
                ) / (4 * h[a] * h[b])  # fmt: skip
        lam, V = np.linalg.eigh(H)
        C = (V / np.maximum(lam, 1.0)) @ V.T
        return {(m.i, m.j): float(np.sqrt(C[k, k]) * m.unit) for k, m in enumerate(moves)}


def laws_of(g: Ground, products: bool = True) -> list[Law]:
    """Expressions that explain something, by evidence, best first; of those that are one in this recording each.

    products: whether to look at products too, or at single terms alone.
    """
    scored, number = list[Scored](), np.zeros(3)
    for targets in _alike(g):
        own, count = _compared(targets, products)
        scored += own
        number += len(targets) * count
    if not scored:
        return []  # nothing is left that any would take away
    chosen = list[tuple[Target, Expression]]()
    for several, share in ((False, 1), (True, SHARE_OF_TRIADS)):
        own = [s for s in scored if (len(s[1].places) > 1) is several]
        chosen += _extended_and_refined(own, EXTENDED // share, REFINED // share, WEIGHED // share)
    if not chosen:
        return []
    chosen = [(target, e.of({v.name: v for v in target.places[0].variables})) for target, e in chosen]
    ln = g.evidence([_columns_at(target.places, spanned(e.columns)) for target, e in chosen])
    laws = []
    for (target, e), gained in zip(chosen, ln, strict=True):
        cost = np.log(3 * number[min(len(e.terms), 3) - 1]) + np.log(e.tried) + _unusual(target.places[0], e)
        laws.append(Law(target.places, e, float(gained - cost), target.responses))
    return sorted(laws, key=lambda law: -law.evidence)


Scored = tuple[float, "Target", Expression]  # what an expression explains at a target


def _extended_and_refined(
    scored: list[Scored], extended: int, refined: int, weighed: int
) -> list[tuple[Target, Expression]]:
    """Return the expressions to be weighed: of the best, richer forms too, and the best of each length refined."""
    scored.sort(key=lambda f: -f[0])
    for _, target, e in scored[:extended]:
        scored += _best([(target, _explained([target], relatives(e, len(target.places) > 1))[0])])
    scored.sort(key=lambda f: -f[0])
    out, number_of = list[tuple[Target, Expression]](), [0, 0, 0]
    for _, target, e in scored:
        number_of[len(e.terms) - 1] += 1
        best = number_of[len(e.terms) - 1] <= refined
        if best or len(out) < weighed:
            out.append((target, _refined(target.responses, e) if best else e))
    return [(target, e) for target, e in out if _carried(target.responses, e)]


def _columns_at(places: Sequence[Place], X: Array) -> Array:
    """Return what additions X (n, m) do at each of some places, one after the other (n', C, q m)."""
    return np.concatenate([p.columns(X) for p in places], axis=-1)


@dataclass(frozen=True, eq=False)
class Target:
    """One place with its response, or all places of a channel in which the same variables stand.

    Between outputs that the rows show together, what they explain together is taken as the sum of what each explains:
    good enough to choose what is weighed.
    """

    places: tuple[Place, ...]
    responses: tuple[BlockResponse, ...]


def _alike(g: Ground) -> list[list[Target]]:
    """Return the places with their responses, those together in which the same variables stand."""
    out: dict[tuple[int, int, int], list[Target]] = {}
    for place in g.places:
        if np.abs((response := block_response(g, place)).before).max() > MIN_RESPONSE:
            key = id(place.stimulus), len(place.block), len(place.variables)
            out.setdefault(key, []).append(Target((place,), (response,)))
    return [[*targets, *_all_of_a_channel(targets)] for targets in out.values()]


def _all_of_a_channel(targets: Sequence[Target]) -> list[Target]:
    of_channel: dict[str, list[Target]] = {}
    for target in targets:
        of_channel.setdefault(target.places[0].channel, []).append(target)
    return [
        Target(tuple(t.places[0] for t in own), tuple(t.responses[0] for t in own))
        for own in of_channel.values()
        if len(own) > 1
    ]


def _compared(targets: Sequence[Target], products: bool) -> tuple[list[Scored], Array]:
    """Return the best expressions at places of the same variables, and the number of families of each length (3,)."""
    place, rows = targets[0].places[0], targets[0].responses[0].rows
    every = [terms(v, place.stimulus, ALONE[v.group], rows) for v in place.variables]
    ones = [*singles(every), *tables(place.variables, rows, products)]
    count, pairs = np.zeros(3), list[tuple[Term, list[Term]]]()
    if products:
        slow = [terms(v, place.stimulus, MULTIPLIED[v.group], rows) for v in place.variables]
        ones, pairs = [*ones, *triples(slow)], partners(slow)
    for e in {e.family: e for e in ones}.values():
        count[len(e.terms) - 1] += 1
    count[1] += len({(t.family, o.family) for t, others in pairs for o in others})
    each = zip(targets, _explained(targets, ones), _explained_by_pairs(targets, pairs), strict=True)
    return _best([(target, [*one, *two]) for target, one, two in each]), count


def spanned(X: Array) -> Array:
    """Return columns (n, q) of rms one that span those of X (n, m) and are orthogonal to each other."""
    U, S, _ = np.linalg.svd(X / np.maximum(np.sqrt((X**2).mean(axis=0)), 1e-300), full_matrices=False)
    return np.asarray(U[:, S > 1e-6 * S[0]] * np.sqrt(len(X)))


def _at_rows(e: Expression, response: BlockResponse) -> Expression:
    """Return the expression at the rows that a response is thinned to."""
    return e.of({v.name: replace(v, x=v.x[response.rows]) for v in e.variables})


def trimmed(g: Ground, law: Law) -> Law:
    """Return the law with powers from the references of its variables, without columns that explain next to nothing.

    What the calibration takes up has no size, and a lower power may be none of the law. The noise is no larger than
    what the law leaves: where its scale is fitted, the model without a law takes all of the law for noise.
    """
    e = _at_rows(law.expression, law.responses[0])
    e = e.referred() if all(_near_reference(t.variable) for t in law.expression.terms) else e
    dof = max(len(g.y) - g.Q.shape[1], 1)
    while len(groups := e.groups) > 1:
        worth = _worth(law.responses, e)
        variance = float(np.clip((g.y @ g.y - 2 * worth) / dof, LEAST_VARIANCE, 1.0))
        least, drop = min(((worth - _worth(law.responses, e.without(own)), own) for own in groups), key=lambda x: x[0])
        if least > NEEDED * len(law.places) * variance:
            break
        e = e.without(drop)
    full = e.of({v.name: v for v in law.expression.variables})
    return replace(law, expression=full)


def _near_reference(v: Variable) -> bool:
    return bool(abs(v.reference - v.origin) <= FAR * max(float(np.ptp(v.x)), 1e-300))


def _unusual(place: Place, e: Expression) -> float:
    """Nats against what stands for another: angles of what is felt in an output, forces in a gimbal; and rare forms."""
    of = "force" if place.channel in ("gimbal_angle", "pointing") else "angle"
    return UNUSUAL * (sum(v.group == of for v in e.variables) + sum(t.form.key in RARE for t in e.terms))


Gains = list[tuple[float, Expression]]


def _best(each: Sequence[tuple[Target, Gains]]) -> list[Scored]:
    """Return the best constant of each family at each target; at several places those that are better than at one."""
    tops = list[dict[str, tuple[float, Expression]]]()
    for _, every in each:
        best = dict[str, tuple[float, Expression]]()
        for gain, e in every:
            if gain > best.get(e.family, (0.0, e))[0]:
                best[e.family] = gain, e
        tops.append(best)
    out, single = (
        [],
        {target.places[0]: top for (target, _), top in zip(each, tops, strict=True) if len(target.places) == 1},
    )
    for (target, _), top in zip(each, tops, strict=True):
        others = [single[p] for p in target.places if p in single and len(target.places) > 1]
        better = [b for key, b in top.items() if all(b[0] > own[key][0] for own in others if key in own)]
        out += [(gain, target, e) for gain, e in sorted(better, key=lambda b: -b[0])[:WEIGHED]]
    return out


def _explained(targets: Sequence[Target], every: Sequence[Expression]) -> list[Gains]:
    """Return what each expression explains at each target, less the cost of coefficients and grid."""
    out: list[Gains] = [[] for _ in targets]
    by_width: dict[int, list[Expression]] = {}
    for e in every:
        by_width.setdefault(e.columns.shape[1], []).append(e)
    for width, own in by_width.items():
        tried = np.log([e.tried for e in own])
        for k in range(0, len(own) if width <= COEFFICIENTS else 0, CHUNK):
            part = own[k : k + CHUNK]
            X = np.concatenate([e.columns for e in part], axis=1)
            for worth, mine in zip(_worths(targets, X, width), out, strict=True):
                mine.extend(zip((worth - tried[k : k + CHUNK]).tolist(), part, strict=True))
    return out


def _worths(targets: Sequence[Target], X: Array, width: int) -> list[Array]:
    """Return what columns X (m, K width), so many at a time, explain at each target, less the cost of coefficients."""
    B = targets[0].responses[0].block_means(X)
    each = {id(one): gains(one, B, width) for target in targets for one in target.responses}
    return [np.sum([each[id(one)] - 2.0 * width for one in target.responses], axis=0) for target in targets]


def _explained_by_pairs(targets: Sequence[Target], pairs: Sequence[tuple[Term, list[Term]]]) -> list[Gains]:
    """Return the same for products: for each term the best partner of each family."""
    out: list[Gains] = [[] for _ in targets]
    stacks: dict[tuple[int, ...], tuple[Array, Array]] = {}
    for t, others in pairs:
        by_width: dict[tuple[int, bool], list[Term]] = {}
        for o in others:
            by_width.setdefault((o.factors.shape[1], o.free_origin), []).append(o)
        for (_, free), own in by_width.items():
            both = int(free and t.free_origin)
            key = tuple(id(o) for o in own)
            if key not in stacks:
                stacks[key] = np.stack([o.factors for o in own], axis=1), np.log([o.tried for o in own])
            S, tried = stacks[key]
            width = t.factors.shape[1] * S.shape[2] - both
            if width > COEFFICIENTS:
                continue
            first: dict[str, list[int]] = {}
            for i, o in enumerate(own):
                first.setdefault(o.family, []).append(i)
            X = (t.factors[:, None, :, None] * S[:, :, None, :]).reshape(*S.shape[:2], -1)[:, :, both:]
            for gain, mine in zip(_worths(targets, X.reshape(len(X), -1), width), out, strict=True):
                worth = gain - np.log(t.tried) - tried
                for at in first.values():
                    i = at[int(np.argmax(worth[at]))]
                    mine.append((float(worth[i]), Expression((t, own[i]))))
    return out


def gains(response: BlockResponse, B: Array, width: int) -> Array:
    """ln likelihood (K,) that additions (blocks, K width), so many at a time, take away of the misfit."""
    X = response.root @ B
    with np.errstate(over="ignore"):  # of a power that a refinement tries; it shows nothing
        norm = np.sqrt(np.einsum("rk,rk->k", X, X))
        whole = response.before @ B
        shown = np.isfinite(norm) & (norm > ABSORBED * np.sqrt(np.einsum("rk,rk->k", whole, whole)))
    scale = 1.0 / np.where(shown & (norm > 0), norm, np.inf)
    K = X.shape[1] // width
    b = (response.y @ X * scale).reshape(K, width)
    if width == 1:
        return np.asarray(b[:, 0] ** 2 / 2)
    A = X.reshape(len(X), K, width).transpose(1, 0, 2)
    scale = scale.reshape(K, width)
    G = np.swapaxes(A, 1, 2) @ A * (scale[:, :, None] * scale[:, None, :]) + RIDGE * np.eye(width)
    return np.asarray(np.einsum("ki,ki->k", b, np.linalg.solve(G, b[..., None])[..., 0]) / 2)


def _carried(responses: Sequence[BlockResponse], e: Expression) -> bool:
    """Return whether what a law adds is spread over several stretches and not an outlier of one or two."""
    B = responses[0].block_means(e.columns)
    added = np.stack([B @ np.linalg.lstsq(one.root @ B, one.y, rcond=1e-6)[0] for one in responses], axis=1)
    square = ((added - np.median(added, axis=0)) ** 2).sum(axis=1)
    return bool(square.sum() ** 2 > CARRIED * (square**2).sum())


def _worth(responses: Sequence[BlockResponse], e: Expression) -> float:
    """Return the ln likelihood that an expression at the rows of some responses takes away of the misfit."""
    B = responses[0].block_means(e.columns)
    return float(sum(gains(one, B, B.shape[1])[0] for one in responses))


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
        return {"size": abs(self.value), "place": self.span}.get(self.kind, 1.0)

    @property
    def step(self) -> float:
        """First step: a third of that of its grid."""
        c = self.e.terms[self.i].form.constants[self.j]
        if c.of == "1/x":
            return float(np.log1p(np.pi / self.span / max(self.value, 1e-300) / 3))
        return {"size": 0.3, "place": 0.03}.get(self.kind, 0.2)

    def at(self, u: float) -> tuple[int, int, float]:
        """The constant moved by u, within what its variable may tell."""
        if self.kind == "size":
            return self.i, self.j, self.value * float(np.exp(np.clip(u, -3.4, 3.4)))
        x = self.value + u * self.unit
        if self.kind == "place":
            logged = self.e.terms[self.i].variable.x
            x = float(np.clip(x, logged.min(), logged.max()))
        return self.i, self.j, float(x)


def _moved(e: Expression, moves: Sequence[_Move], u: Array) -> Expression:
    return e.at([m.at(float(x)) for m, x in zip(moves, u, strict=True)])


def _refined(responses: Sequence[BlockResponse], e: Expression) -> Expression:
    """The expression with its smooth constants where they take away most."""
    from scipy.optimize import minimize

    for i, t in enumerate(e.terms):
        others = [e.replaced((*e.terms[:i], moved, *e.terms[i + 1 :])) for moved in between(t)]
        e = max([e, *others], key=lambda tried: _worth(responses, tried))
    moves = [_Move(e, i, j) for i, j, _ in e.smooth()]
    if not moves:
        return e
    begun, steps = np.zeros(len(moves)), np.array([m.step for m in moves])

    def cost(u: Array) -> float:
        return -_worth(responses, _moved(e, moves, u))

    simplex = np.concatenate([begun[None], np.diag(steps)])
    minimum = minimize(cost, begun, method="Nelder-Mead", options={
        "maxfev": ROUNDS * len(moves), "initial_simplex": simplex, "xatol": 1e-4, "fatol": 1e-2})  # fmt: skip
    return _moved(e, moves, minimum.x) if minimum.fun < cost(begun) else e


def aliases(g: Ground, law: Law) -> list[Law]:
    """Return the law with other harmonics of its angles whose columns span the same space here, calibration removed.

    At multiples of 45 deg the fifth harmonic is the third: no evidence distinguishes what no row shows.
    """

    def span(one: Law) -> Array:
        return basis(g.remainder(g.whiten(one.columns)))

    own, out = span(law), []
    for i, t in enumerate(law.expression.terms):
        for n in range(1, ORDERS + 1) if t.form.key == "harmonic" else ():
            other = replace(law, expression=law.expression.at([(i, 0, float(n))]))
            Q = span(other) if n != t.constants[0] else own[:, :0]
            if Q.shape == own.shape and np.linalg.norm(Q - own @ (own.T @ Q), 2) < SAME_SPACE:
                out.append(other)
    return out


def same(g: Ground, one: Law, other: Law) -> bool:
    """Return whether two laws are one here: each explains the columns of the other, calibration removed."""

    def fit(law: Law) -> Array:
        Q = orthonormal(g.remainder(g.whiten(law.columns)))
        return np.asarray(Q @ (Q.T @ g.y))

    a, b = fit(one), fit(other)
    return bool(a @ b > SAME * np.linalg.norm(a) * np.linalg.norm(b))
