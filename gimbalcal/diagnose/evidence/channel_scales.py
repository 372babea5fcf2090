r"""Channels of a view that scatter alike, or each with a scale of its own: half the prior probability each.

The scales of C channels are :math:`\sigma e^{l_c}` with :math:`\sum_c l_c = 0`. Alike, all :math:`l_c` are zero. With
scales of their own, where nothing bounds them, each is log-normal about the common one,

.. math:: t = E \, l, \qquad t \sim N(0, \tau^2 I_{C-1}), \qquad \tau = \ln 5,

with E (C - 1, C) orthonormal contrasts: a proper prior, by which the further scales pay for what they explain. Where
the samples of a row bound its scale, the prior of each is :math:`\rho(\sigma_c)` of `scale.Free`. The scale sigma is
integrated in closed form, t over a lattice of 2.5 of its standard deviations, :math:`1 / \sqrt{2 \nu_c}`, by the
trapezoidal rule, whose error is :math:`2 e^{-2 \pi^2 / 2.5^2} = 8 \%` or less. Products of columns are sums over the
channels and linear in the weights :math:`e^{-2 l_c}`, so that a node of the lattice costs no further pass through the
rows. The lattice extends to where a promising cause is likeliest: one in a single channel changes the ratio of scales.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.gram import Gram, triangle_size
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.scale import MIN_MISFIT_SHARE, Channels, log_density_of_scale, log_norm
from gimbalcal.inference.algebra import beyond, orthonormal_columns
from gimbalcal.number import Array

EQUAL_SCATTER_PRIOR = 0.5  # prior probability that all channels scatter alike
SPREAD = math.log(5.0)  # standard deviation of ln of a channel's scale about the common one
STEP = 2.5  # standard deviations of the lattice's coordinates between its nodes
MIN_DOF = 2.0  # that a model must leave of a channel whose scale is asked for
ROUNDS = 8  # of weights by what they leave
SCALE_TOLERANCE = 1e-3  # change of ln of a ratio of scales at which these end
ACTIVE_NATS = 6.0  # nats behind the likeliest scales of a cause within which the nodes next to these are tried
PROMISING_NATS = 30.0  # nats behind the strongest cause within which the scales of a cause are followed
NEGLIGIBLE_NATS = 8.0  # nats behind the likeliest scales of every such cause beyond which a node is dropped
MAX_NODES = 150
PRODUCTS = ("zz", "zx", "zy", "xy", "yy")  # in one array for all channels


def contrasts(C: int) -> Array:
    """Return orthonormal contrasts (C - 1, C) of C channels (Helmert)."""
    E = np.tril(np.ones((C - 1, C)))
    E[np.arange(C - 1), np.arange(1, C)] = -np.arange(1.0, C)
    return np.asarray(E / np.linalg.norm(E, axis=1, keepdims=True))


def log_prior_density(log_scales: Array, channels: Channels) -> float:
    """Return ln of the prior density of ln scales (C,) per unit of t, the bound by samples being part of `Free`."""
    C = len(log_scales)
    if channels.sample:
        return 0.5 * math.log(C)
    t = contrasts(C) @ (log_scales + np.log(channels.scale))
    return float(-(C - 1) * (0.5 * math.log(2 * math.pi) + math.log(SPREAD)) - t @ t / (2 * SPREAD**2))


def log_odds(alike: tuple[Array, Array], own: tuple[Array, Array], sample: Sequence[float]) -> float:
    r"""Return ln odds of scales of their own to one scale, from what a model fitted in either leaves of each channel.

    .. math:: \frac{p(\hat t)}{\sqrt C} \prod_c \tfrac12 \Gamma(\nu_c / 2) (m_c / 2)^{-\nu_c / 2} \Big/
        \tfrac12 \Gamma(\nu / 2) (m / 2)^{-\nu / 2}

    alike, own: misfit m_c (C,) and degrees of freedom nu_c (C,) in the same unit; sample: as in `Channels`.
    """

    def integral(m: float, nu: float) -> float:
        return math.lgamma(nu / 2) - nu / 2 * math.log(m / 2) - math.log(2)

    (misfit, dof), m, nu = own, float(alike[0].sum()), float(alike[1].sum())
    C, sigma = len(misfit), np.sqrt(misfit / dof)
    out = sum(integral(float(a), float(b)) for a, b in zip(misfit, dof, strict=True)) - integral(m, nu)
    channels, log_scales = Channels((1.0,) * C, tuple(sample)), np.log(sigma) - np.log(sigma).mean()
    out += log_prior_density(log_scales, channels) - 0.5 * math.log(C)
    if len(sample):
        each = sum(float(log_density_of_scale(s, a)) for s, a in zip(sigma, sample, strict=True))
        one = log_density_of_scale(np.sqrt(m / nu), float(np.sqrt(np.mean(np.square(sample)))))
        out += each - (C - 1) * log_norm(1.0) - float(one)
    return out + math.log(1 - EQUAL_SCATTER_PRIOR) - math.log(EQUAL_SCATTER_PRIOR)


def likeliest_scales(r: Array, J: Array, sample: Sequence[float] = ()) -> Array | None:
    """Return the scales (C,) that a linear model with columns J (n, C, q) leaves of a misfit r (n, C), fitted in them.

    None where it is likelier that all channels scatter alike, or where they do not show a scale.
    """
    C, own = r.shape[1], np.ones(r.shape[1])
    alike: tuple[Array, Array] | None = None
    for _ in range(ROUNDS):
        Q = orthonormal_columns((J / own[:, None]).reshape(r.size, -1))
        y = (r / own).ravel()
        residual, taken = beyond(Q, y).reshape(r.shape), (Q**2).sum(axis=1).reshape(r.shape)
        misfit, dof = (residual**2).sum(axis=0) * own**2, len(r) - taken.sum(axis=0)
        if not distinguishable(misfit, dof):
            return None
        alike, before, own = alike or (misfit, dof), own, np.sqrt(misfit / dof)
        if np.ptp(np.log(own / before)) < SCALE_TOLERANCE:
            break
    assert alike is not None
    return own if C > 1 and log_odds(alike, (misfit, dof), sample) > 0 else None


def distinguishable(misfit: Array, dof: Array) -> bool:
    """Return whether every channel has degrees of freedom, and a misfit (C,) above rounding and quantisation."""
    if np.any(dof < MIN_DOF):
        return False
    variance = misfit / dof
    return bool(np.all(variance > MIN_MISFIT_SHARE**2 * variance.max()))


@dataclass(frozen=True, eq=False)
class ChannelProducts:
    """Products of whitened rows [Z | X | y] of each channel by itself, in a noise of which the scales are open.

    zz (C, q, q), zx (C, q, P), zy (C, q, m), xx (P (P + 1) / 2,) of each channel, xy (C, P, m), yy (C, m); n rows of
    each channel.
    """

    node: Node
    channels: Channels
    n: int
    zz: Array
    zx: Array
    zy: Array
    xx: tuple[Array, ...]
    xy: Array
    yy: Array
    likeliest: tuple[Array, float] | None = None
    """The ln scales (C,) that the model leaves, and a step of the lattice; None where channels have none."""

    @classmethod
    def of(cls, node: Node, rows: Array, q: int, P: int, channels: Channels) -> ChannelProducts:
        """Form the products of rows [Z | X | y] (n C, q + P + m), without the likeliest scales."""
        C, end = len(channels.scale), q + P
        A = node.products_of_channels(rows, C)
        xx = np.empty((C, triangle_size(P)))
        for i in range(P):
            xx[:, triangle_size(i) : triangle_size(i + 1)] = A[:, q + i, q : q + i + 1]
        zz, zx, zy, xy = A[:, :q, :q], A[:, :q, q:end], A[:, :q, end:], A[:, q:end, end:]
        yy = np.diagonal(A[:, end:, end:], axis1=1, axis2=2)
        zz, zx, zy, xy, yy = (part.copy() for part in (zz, zx, zy, xy, yy))  # all of A need not be kept
        return cls(node, channels, len(rows) // C, zz, zx, zy, tuple(xx), xy, yy)

    @property
    def alike(self) -> Array:
        """The ln scales (C,) at which all channels scatter alike."""
        own = np.log(self.channels.scale)
        return np.asarray(own.mean() - own)

    def noise(self, at: tuple[int, ...] | None) -> tuple[Node, Array]:
        """Return the noise of a node of the lattice, or where all channels scatter alike, and its ln scales (C,)."""
        if at is None:
            share = EQUAL_SCATTER_PRIOR if self.likeliest is not None else 1.0
            return self.node.of_scales(self.alike, math.log(share)), self.alike
        assert self.likeliest is not None
        centre, step = self.likeliest
        log_scales = centre + step * np.array(at) @ contrasts(len(centre))
        own = 1.0 if self.node.channels else 1 - EQUAL_SCATTER_PRIOR
        share = math.log(own) + len(at) * math.log(step) + log_prior_density(log_scales, self.channels)
        return self.node.of_scales(log_scales, share), log_scales

    def projected(self, log_scales: Array) -> tuple[Gram, Array, Array, float]:
        """Return the products of columns, their scores (P, m), the misfit (m,), cleared of Z, and ln |Z^T W Z|."""
        w = np.exp(-2 * log_scales)
        L = np.linalg.cholesky(np.tensordot(w, self.zz, 1))
        K = np.linalg.solve(L, np.tensordot(w, self.zx, 1))
        Ky = np.linalg.solve(L, np.tensordot(w, self.zy, 1))
        G = Gram(self.xx, K.T, w)
        b, misfit = np.tensordot(w, self.xy, 1) - K.T @ Ky, w @ self.yy - (Ky**2).sum(axis=0)
        return G, b, misfit, 2 * float(np.log(np.diag(L)).sum())


def products_of_noises(nodes: Sequence[Node], rows: Array, q: int, P: int, channels: Channels) -> list[ChannelProducts]:
    """Return the products of rows [Z | X | y] (n C, q + P + m) in several noises.

    Of a noise of which each channel has its part they are those of the channel in that part, each formed once.
    """
    single = {id(part): part for node in nodes for part in node.channels or (node,)}
    of = {key: ChannelProducts.of(part, rows, q, P, channels) for key, part in single.items()}

    def picked(node: Node) -> ChannelProducts:
        parts = [of[id(part)] for part in node.channels]
        zz, zx, zy, xy, yy = (np.stack([getattr(p, name)[c] for c, p in enumerate(parts)]) for name in PRODUCTS)
        xx = tuple(p.xx[c] for c, p in enumerate(parts))  # some MB each: not copied
        return ChannelProducts(node, channels, parts[0].n, zz, zx, zy, xx, xy, yy)

    return _with_likeliest_scales([picked(node) if node.channels else of[id(node)] for node in nodes])


def _with_likeliest_scales(every: Sequence[ChannelProducts]) -> list[ChannelProducts]:
    """Return the products of several noises with the scales that the model leaves in each, iterated for all at once."""
    zz, zy, yy = np.stack([p.zz for p in every]), np.stack([p.zy[..., 0] for p in every]), [p.yy[:, 0] for p in every]
    channels, n = every[0].channels, every[0].n
    log_scales = np.tile(every[0].alike, (len(every), 1))
    shown = np.array([dict(p.node.name).get("memory", 0.0) <= channels.max_memory for p in every])
    for _ in range(ROUNDS):
        w = np.exp(-2 * log_scales)
        inverse = np.linalg.inv(np.linalg.cholesky(np.einsum("nc,ncij->nij", w, zz)))
        covariance = np.swapaxes(inverse, 1, 2) @ inverse
        K = np.einsum("nij,nc,ncj->ni", covariance, w, zy)
        variance = yy - 2 * np.einsum("nci,ni->nc", zy, K) + np.einsum("ni,ncij,nj->nc", K, zz, K)
        dof = n - w * np.einsum("nij,ncij->nc", covariance, zz)
        shown &= [distinguishable(v, d) for v, d in zip(variance, dof, strict=True)]
        found = 0.5 * np.log(np.divide(variance, dof, out=np.ones_like(dof), where=shown[:, None]))
        log_scales = found - found.mean(axis=1, keepdims=True)
    return [
        replace(p, likeliest=(own, STEP / math.sqrt(2 * float(free.max())))) if visible else p
        for p, own, free, visible in zip(every, log_scales, dof, shown, strict=True)
    ]


Place = tuple[int, tuple[int, ...] | None]
"""Ordinal of a noise, and of a node in the lattice of its scales; None where all channels scatter alike."""


def promising_nodes(every: Sequence[ChannelProducts], scored: Callable[[Sequence[Place]], Array]) -> list[Place]:
    """Return the nodes of the lattices of several noises that hold the evidence of no cause and of any promising one.

    scored: ln of prior x likelihood (nodes, 1 + candidates) of nodes, without a cause and with each.
    """
    C = len(every[0].channels.scale)
    steps = [d for d in itertools.product((-1, 0, 1), repeat=C - 1) if sum(map(abs, d)) == 1]
    origin = (0,) * (C - 1)
    own = [e.node.channels and e.likeliest is not None for e in every]  # other memories, other scales
    pending: list[Place] = [(k, at) for k, e in enumerate(every) for at in (None, origin)
                          if (not own[k] if at is None else e.likeliest is not None)]  # fmt: skip
    scored_places, ln = list[Place](), np.zeros((0, 0))
    while pending:
        new = scored(pending)
        scored_places, ln = [*scored_places, *pending], np.concatenate([ln.reshape(-1, new.shape[1]), new])
        top = ln.max(axis=0)
        promising = top >= top.max() - PROMISING_NATS
        promising[0] = True  # that nothing is missing: all Bayes factors are relative to it
        behind = (top[promising] - ln[:, promising]).min(axis=1)
        known, pending = set(scored_places), []
        for (k, at), lag in zip(scored_places, behind, strict=True):
            if at is not None and lag < ACTIVE_NATS and len(scored_places) + len(pending) < MAX_NODES:
                neighbours = ((k, tuple(np.add(at, d).tolist())) for d in steps)
                pending += [p for p in neighbours if p not in known]
                known |= set(pending)
    kept = [p for p, lag in zip(scored_places, behind, strict=True) if p[1] is None or lag < NEGLIGIBLE_NATS]
    return sorted(kept, key=lambda p: (p[0], p[1] is not None, p[1] or ()))
