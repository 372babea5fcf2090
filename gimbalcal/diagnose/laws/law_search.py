r"""A law that nobody has written down: every small expression of what was recorded, by its evidence.

All terms, all products of two and plain products of three are looked at by what they take away of the misfit,
calibration profiled out, in the likeliest noise; those that take away most are refined in their constants and weighed
over all noises and sizes, as every cause is. An expression pays for its number: a third of the prior is for single
terms, for products of two and of three, alike in each; and a constant pays for its grid.

.. math:: \ln E = \ln BF - \ln n_{grid} - \ln (3 n_{expressions})
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.laws.expressions import (
    Expression,
    Term,
    between,
    multiplied,
    partners,
    singles,
    terms,
    triples,
)
from gimbalcal.diagnose.library.variables import Variable
from gimbalcal.effects import Stimulus
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.number import Array

WEIGHED = 60  # expressions whose evidence is worked out in full
REFINED = 12  # of these, the best are refined in their constants
ROUNDS = 60  # steps of a refinement
CHUNK = 400  # columns at a time
ABSORBED = 3e-2  # of a column: less left by the calibration is nothing to speak of
RIDGE = 1e-4  # of a unit column: two that are alike count as one
SAME = 0.999  # correlation from which two expressions are one in this recording
UNUSUAL = 1.5  # nats against a law of an output in gimbal angles, or of a gimbal in forces


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


@dataclass(frozen=True, eq=False)
class Screen:
    """A place as seen through blocks: a column b (blocks,) takes away (v.b)^2 / 2 b'K b, of b'K0 b before calibration.

    root (r, blocks) and before (r, blocks): K = root' root, K0 = before' before; y (r,): root' y = v.
    """

    block: Array
    count: Array
    root: Array
    before: Array
    y: Array

    def seen(self, columns: Array) -> Array:
        """Means (blocks, m) of columns (n, m)."""
        return np.asarray(np.add.reduceat(columns, np.flatnonzero(np.diff(self.block, prepend=-1))) / self.count)


def screen(g: Ground, place: Place) -> Screen:
    """Return the response of the whitened rows, calibration removed, to even additions over blocks."""
    count = np.bincount(place.block).astype(float)
    M = g.whiten(place.columns((place.block[:, None] == np.arange(len(count))).astype(float)))
    left = M - g.Q @ (g.Q.T @ M)
    lam, V = np.linalg.eigh(left.T @ left)
    keep = lam > 1e-12 * max(float(lam.max(initial=0.0)), 1e-300)
    root = np.sqrt(lam[keep])[:, None] * V[:, keep].T
    lam0, V0 = np.linalg.eigh(M.T @ M)
    before = np.sqrt(np.maximum(lam0, 0.0))[:, None] * V0.T
    return Screen(place.block, count[:, None], root, before, (V[:, keep].T @ (left.T @ g.y)) / np.sqrt(lam[keep]))


@dataclass(frozen=True, eq=False)
class Law:
    """An expression at a place, with its evidence: ln Bayes factor less what its choice among others costs."""

    place: Place
    expression: Expression
    evidence: float
    seen: Screen

    @property
    def columns(self) -> Array:
        """The rows (n', C, m) that a unit of each coefficient adds."""
        return self.place.columns(self.expression.columns)

    def spread(self, term: Term) -> float:
        """One sigma [SI] of the constant of a term, by the curvature of the likelihood; itself where none is told."""
        terms, i = self.expression.terms, self.expression.terms.index(term)
        h = 0.1 * _step(terms[i])

        def at(u: float) -> float:
            tried = Expression((*terms[:i], terms[i].at(terms[i].constant * float(np.exp(u))), *terms[i + 1 :])).columns
            return float(gains(self.seen, tried, tried.shape[1])[0])

        curvature = (2 * at(0.0) - at(h) - at(-h)) / h**2
        return float(terms[i].constant / np.sqrt(curvature)) if curvature > 1.0 else float(terms[i].constant)


def laws_of(g: Ground, products: bool = True) -> list[Law]:
    """Expressions that explain something, by evidence, best first; of those that are one in this recording each.

    products: whether to look at products too, or at single terms alone.
    """
    found: list[tuple[float, Place, Expression]] = []
    number, screens = [0, 0, 0], dict[int, Screen]()
    for place in g.places:
        every = [terms(v, place.stimulus) for v in place.variables]
        ones, pairs, threes = singles(every), partners(every), triples(every) if products else []
        number[0] += len({e.family for e in ones})
        number[1] += len({f"{t.family}{o.family}" for t, others in pairs for o in others})
        number[2] += len(threes)
        seen = screen(g, place)
        found += _best(place, _screened(seen, [*ones, *threes]), _paired(seen, pairs) if products else [])
        screens[id(place)] = seen
    if not found:
        return []  # nothing is left that any would take away
    found.sort(key=lambda f: -f[0])
    refined = [_refined(screens[id(place)], place, e) for _, place, e in found[:REFINED]]
    chosen = [*refined, *((place, e) for _, place, e in found[REFINED:WEIGHED])]
    ln = g.evidence([place.columns(e.columns) for place, e in chosen])
    costs = [
        np.log(len(number) * number[len(e.terms) - 1]) + np.log(e.tried) + _unusual(place, e) for place, e in chosen
    ]
    made = [Law(place, e, float(b - c), screens[id(place)]) for (place, e), b, c in zip(chosen, ln, costs, strict=True)]
    return sorted(made, key=lambda law: -law.evidence)


def _unusual(place: Place, e: Expression) -> float:
    """Nats against what stands for another: angles of what is felt in an output, forces in a gimbal."""
    of = "force" if place.channel in ("gimbal_angle", "pointing") else "angle"
    return UNUSUAL * sum(v.group == of for v in e.variables)


Gains = list[tuple[float, Expression]]


def _best(place: Place, *of: Gains) -> list[tuple[float, Place, Expression]]:
    """The best constant of each family, the best families."""
    best: dict[str, tuple[float, Expression]] = {}
    for gain, e in (x for gains in of for x in gains):
        if gain > best.get(e.family, (0.0, e))[0]:
            best[e.family] = gain, e
    top = sorted(best.values(), key=lambda b: -b[0])[:WEIGHED]
    return [(gain, place, e) for gain, e in top]


def _screened(seen: Screen, every: Sequence[Expression]) -> Gains:
    """Return what each expression explains of the misfit, less the cost of its coefficients and its grid."""
    out: Gains = []
    for e in every:
        width = e.columns.shape[1]
        out.append((float(gains(seen, e.columns, width)[0]) - _paid(width, e.tried), e))
    return out


def _paid(coefficients: int, tried: int) -> float:
    return float(2.0 * coefficients + np.log(tried))


def _paired(seen: Screen, pairs: Sequence[tuple[Term, list[Term]]]) -> Gains:
    """Return the same for products: for each term the best partner of each family."""
    out: Gains = []
    for t, others in pairs:
        for width in {o.columns.shape[1] for o in others}:
            own = [o for o in others if o.columns.shape[1] == width]
            each = t.columns.shape[1] * width
            for k in range(0, len(own), CHUNK // each):
                part = own[k : k + CHUNK // each]
                B = np.concatenate([multiplied(t.columns, o.columns) for o in part], axis=1)
                gain = gains(seen, B, each)
                worth = [float(x) - _paid(each, t.tried * o.tried) for x, o in zip(gain, part, strict=True)]
                best: dict[str, int] = {}
                for i, o in enumerate(part):
                    if worth[i] > worth[best.setdefault(o.family, i)]:
                        best[o.family] = i
                out += [(worth[i], Expression((t, part[i]))) for i in best.values()]
    return out


def gains(seen: Screen, columns: Array, width: int) -> Array:
    """ln likelihood (K,) that columns (n, K width) added there, so many at a time, take away of the misfit."""
    B = seen.seen(columns)
    X = seen.root @ B
    norm = np.sqrt((X**2).sum(axis=0))
    shown = norm > ABSORBED * np.sqrt(((seen.before @ B) ** 2).sum(axis=0))
    X = X / np.where(shown & (norm > 0), norm, np.inf)
    K = X.shape[1] // width
    b = (X.T @ seen.y).reshape(K, width)
    if width == 1:
        return np.asarray(b[:, 0] ** 2 / 2)
    A = X.reshape(len(X), K, width).transpose(1, 0, 2)
    G = np.swapaxes(A, 1, 2) @ A + RIDGE * np.eye(width)
    return np.asarray(np.einsum("ki,ki->k", b, np.linalg.solve(G, b[..., None])[..., 0]) / 2)


def _refined(seen: Screen, place: Place, e: Expression) -> tuple[Place, Expression]:
    """The expression with its smooth constants where they take away most."""
    from scipy.optimize import minimize

    def worth(tried: Expression) -> float:
        return float(gains(seen, tried.columns, tried.columns.shape[1])[0])

    for i, t in enumerate(e.terms):
        others = [Expression((*e.terms[:i], moved, *e.terms[i + 1 :])) for moved in between(t)]
        e = max([e, *others], key=worth)
    free = [i for i, t in enumerate(e.terms) if t.form.smooth]
    if not free:
        return place, e

    def at(u: Array) -> Expression:
        moved = dict(zip(free, np.exp(u).tolist(), strict=True))
        return Expression(tuple(t.at(moved[i]) if i in moved else t for i, t in enumerate(e.terms)))

    def cost(u: Array) -> float:
        return -worth(at(u))

    begun = np.log([e.terms[i].constant for i in free])
    steps = np.array([_step(e.terms[i]) for i in free])
    simplex = np.concatenate([begun[None], begun + np.diag(steps)])
    found = minimize(cost, begun, method="Nelder-Mead", options={"maxfev": ROUNDS, "initial_simplex": simplex})
    bounded = np.clip(found.x, begun - np.log(30.0), begun + np.log(30.0))
    return place, at(bounded) if cost(bounded) < cost(begun) else e


def _step(t: Term) -> float:
    """First step of the logarithm of a constant: a third of that of its grid."""
    if t.form.key == "wave":
        span = float(np.ptp(t.variable.x))
        return float(np.log1p(np.pi / span / t.constant / 3))
    return 0.3


def same(g: Ground, one: Law, other: Law) -> bool:
    """Return whether two laws are one here: each explains the columns of the other, calibration removed."""

    def fit(law: Law) -> Array:
        X = g.whiten(law.columns)
        Q = orthonormal(X - g.Q @ (g.Q.T @ X))
        return np.asarray(Q @ (Q.T @ g.y))

    a, b = fit(one), fit(other)
    return bool(a @ b > SAME * np.linalg.norm(a) * np.linalg.norm(b))
