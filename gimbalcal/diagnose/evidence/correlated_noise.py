"""The noises over which the diagnosis of a view integrates: of known or unknown scale.

Rows of unknown scale have white noise, noise correlated with the row before, or the noise of sensors that wander.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.evidence.node import SINGLE_WALK, SINGLE_WALK_PRIOR_AT_REST, TRIAD_WALK, Node
from gimbalcal.diagnose.evidence.stated_noise import noise_grid
from gimbalcal.effects.process import GaussMarkov, Process, RandomWalk, WhiteNoise
from gimbalcal.inference.noise_processes import Cascade, Chain, chain
from gimbalcal.inference.whitening import modes, whitening, whitenings
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, View
from gimbalcal.views.noise import SingleWalk, TriadWalks, of_channels

MEMORY = (0.0, 0.3, 0.6, 0.8, 0.9, 0.96)  # from row to row, where the noise is not stated
MEMORY_PRIOR = (0.5, 0.1, 0.1, 0.1, 0.1, 0.1)
WANDER = (0.8, 0.95, 0.99)  # memory of what sensors wander from row to row; the last is next to a walk
WANDER_SHARE = (0.4, 0.9)  # of the variance; the remainder is white
MANY_ROWS = 200  # rows of a view, beyond which a wander of a small share of their variance is visible
SMALL_WANDER, SMALL_SHARE = (0.95, 0.99, 0.998), (0.03, 0.1, 0.3)  # memory and share of such a wander
WANDERS = 0.5  # prior probability of a wander in addition to white noise, where rows say how that shows
OFFSET_MEMORY, OFFSET_SHARE = 0.9999, (0.05, 0.2, 0.6)  # memory and share of an offset that a group of rows shares
OFFSETS = 0.2  # prior odds of offsets of groups
POLES = (
    (0.0, 0.0), (0.5, 0.0), (0.7, 0.3), (0.7, 0.5), (0.85, -0.3), (0.85, 0.0), (0.85, 0.3), (0.85, 0.85),
    (0.95, -0.3), (0.95, 0.0), (0.95, 0.3), (0.95, 0.7), (0.99, -0.3), (0.99, 0.0), (0.99, 0.4),
)  # fmt: skip
"""Poles of the second-order noise of a channel; a negative one stands for additional white noise."""


SLOW_WITH_WHITE = ((0.97, 0.4), (0.99, 0.4), (0.99, 0.8))
"""Memory, and share of the variance, of a slow process in white noise that exceeds the innovations of that process."""


SLIGHT_MEMORY = (0.0, 0.2)  # from row to row, with walks of triads: the velocity is less well known than assumed
TRIAD_WALK_PRIOR = 0.15  # prior odds of walks of all sensors of a triad, as at a known attitude


def possible_noises(fit: Fit, memory: bool = True) -> tuple[Node, ...]:
    """Return the possible noises of a fit's rows with their prior probabilities; without `memory` white noise alone."""
    if fit.view.noise.scale_known:
        return noise_grid(fit)
    every = _of_any_scale(fit.view)
    return every if memory else every[:1]


def _of_any_scale(v: View) -> tuple[Node, ...]:
    """Return the noises of a view of unknown scale: the same for every model of it."""
    if "noises" not in v.cache:
        n, C = len(v), len(v.channels)
        if v.noise.own_memories:
            every = noises_of_channels(n, C)
        else:
            every = noises_of_unknown_scale(n, C, v.noise.wander, v.groups)
        if v.noise.triad_walks:
            histories = {quantity: _time_histories(v, quantity) for quantity in v.measurement.acts_on}
            every += walks_of_triads(histories, C, float(np.ptp(v.stimulus.time)), v.noise.triad_walks)
        if v.noise.single_walks and v.noise.wander is not None:
            weight, walks = v.of_scales().weight, v.noise.single_walks
            every += single_walks(v.noise.wander, weight, v.stimulus.time, v.channels[0][0], walks)
        v.cache["noises"] = every
    return v.cache["noises"]


def _time_histories(v: View, quantity: str) -> Array:
    """Return the reduced rows (R, 3, m) of the time histories of the sensors of a triad."""
    each = [v.noise.reduced(v.time_history_of_sensor(quantity, axis)) for axis in "xyz"]
    return np.stack(each, axis=1)


def noises_of_channels(n: int, C: int) -> tuple[Node, ...]:
    r"""Return noises in n rows of C channels, each channel with one of its own, of second order.

    .. math:: (1 - \rho_1 B)(1 - \rho_2 B) r_k = e_k, \quad B r_k = r_{k-1}, \quad
        E e_k^2 = (1 - \rho_1^2)(1 - \rho_2^2)

    A first-order noise has a single time constant: for a channel that is smooth from row to row it predicts far more
    power at low frequencies than there is.
    """
    every = []
    for poles in POLES:
        root = Cascade(_autoregressive_chain(poles[0], n), _autoregressive_chain(poles[1], n))
        name = (("memory", poles[0]), ("second memory", poles[1]))
        every.append(Node(name, {}, 0.0, C * root.log_determinant, root))
    every += [_wandering_covariance(of_channels(n, C), rho, share, 0.0) for rho, share in SLOW_WITH_WHITE]
    every = [replace(node, prior=1 / len(every)) for node in every]
    return tuple(every if C == 1 else (Node.of_channels(parts) for parts in itertools.product(every, repeat=C)))


def noises_of_unknown_scale(n: int, C: int, rows: Array | None = None, group: Array | None = None) -> tuple[Node, ...]:
    """Return unstated noises of unit variance in n rows of C channels, each row correlated with the one before.

    With a wander of sensors, whose columns are `rows` (n, C, m), in white noise, either part may be the larger one.
    Where several rows are of one group, `group` (n,) being its ordinal, each group may have an offset of its own: a
    table that turns at the same commanded rate in every row of a stretch.
    """
    out, others = [], 1.0 if rows is None else 1 - WANDERS
    for rho, prior in zip(MEMORY, MEMORY_PRIOR, strict=True):
        root = chain(first_order(rho), np.arange(float(n)))
        out.append(Node((("memory", rho),), {}, others * prior, C * root.log_determinant, root, 1 - rho**2))
    if rows is None:
        return tuple(out)
    wanders = [
        *itertools.product(WANDER, WANDER_SHARE),
        *(itertools.product(SMALL_WANDER, SMALL_SHARE) if n > MANY_ROWS else ()),
    ]
    out += [_wandering_covariance(rows, rho, share, WANDERS / len(wanders)) for rho, share in wanders]
    if group is not None and not np.diff(group).all():
        new, prior = np.diff(group, prepend=group[0] - 1) != 0, OFFSETS / len(OFFSET_SHARE)
        out += [_wandering_covariance(rows, OFFSET_MEMORY, share, prior, new) for share in OFFSET_SHARE]
    return tuple(out)


def _wandering_covariance(rows: Array, rho: float, share: float, prior: float, new: Array | None = None) -> Node:
    r"""Sensors that wander, of columns `rows` (n, C, m): :math:`V = (1 - a) I + a \, H K_\rho H^T`, a their share.

    new (n,): rows in which all of it is new, by default the first.
    """
    n, _, m = rows.shape
    process = first_order(rho)
    h, still = np.where(np.arange(n) == 0 if new is None else new, np.inf, 1.0), np.zeros(n, dtype=bool)
    Phi, Q = (np.repeat(x, m, axis=1) for x in (process.transition(h, still), process.diffusion(h, still)))
    root = whitening(Phi, Q, np.sqrt(share / (1 - share)) * rows).of_scale(np.sqrt(1 - share))
    return Node((("memory", rho), ("share", share)), {}, prior, root.log_determinant, root, 1 - share * rho**2)


SINGLE_WALKS = tuple(
    (axis, walk, *base)
    for axis in "xyz"
    for walk in SINGLE_WALK
    for base in ((0.0, 0.0), *((rho, share) for rho in WANDER for share in WANDER_SHARE))
)
"""Sensor with a random walk, its sigmas of a row at the end; memory of the wander of all sensors, and its share."""


def single_walks(
    seen: Array, weight: Array, time: Array, quantity: str, asked: Sequence[SingleWalk]
) -> tuple[Node, ...]:
    r"""Return noises with a random walk of one of three sensors in addition to the wander of all of them.

    .. math:: V = (1 - a) I + a H K_\rho H^T + w^2 h \min(t_j, t_k) h^T / T

    with h the sensor's column of H = `seen` (n, C, 3), in rows that are `weight` (n, C) times as large, t since `time`
    (n,) [s] of the first.
    """
    lasts, still = max(float(np.ptp(time)), 1e-9), np.zeros(len(time), dtype=bool)
    rows, since = np.append(np.inf, np.ones(len(time) - 1)), np.append(0.0, np.diff(time))
    walks = [RandomWalk(walk / np.sqrt(lasts)) for _, walk, *_ in asked]
    Phi, Q = np.empty((2, len(asked), len(time), 4))
    for b, ((_, _, rho, share), walk) in enumerate(zip(asked, walks, strict=True)):
        wander = first_order(rho)
        Phi[b, :, :3], Phi[b, :, 3:] = wander.transition(rows, still), walk.transition(since, still)
        Q[b, :, :3], Q[b, :, 3:] = share * wander.diffusion(rows, still), walk.diffusion(since, still)
        Q[b] /= 1 - share
    nodes: dict[int, Node] = {}
    for k, axis in enumerate("xyz"):  # those that are seen alike at once
        mine = [b for b, ask in enumerate(asked) if ask[0] == axis]
        H = np.concatenate([seen, (seen * weight[:, :, None])[:, :, k : k + 1]], axis=2)
        for b, root in zip(mine, whitenings(Phi[mine], Q[mine], H), strict=True):
            _, size, rho, share = asked[b]
            scaled = root.of_scale(np.sqrt(1 - share))
            base = WANDERS / len(WANDER) / len(WANDER_SHARE) if share else 1 - WANDERS
            name = (("memory", rho), ("share", share), (f"random walk {axis}", size))
            prior, fresh = SINGLE_WALK_PRIOR_AT_REST / len(SINGLE_WALK) * base, 1 - share * rho**2
            noise = {quantity: (walks[b],)}
            nodes[b] = Node(name, noise, prior, scaled.log_determinant, scaled, fresh, axis)
    return tuple(nodes[b] for b in range(len(asked)))


TRIAD_WALKS: tuple[TriadWalks, ...] = tuple(
    w for w in itertools.product(SLIGHT_MEMORY, *[(0.0, *TRIAD_WALK)] * 2) if any(w[1:])
)
"""Memory of the rows, and sizes of the walks of each accelerometer and of each gyroscope."""


def walks_of_triads(
    histories: Mapping[str, Array], channels: int, lasts: float, asked: Sequence[TriadWalks]
) -> tuple[Node, ...]:
    r"""Return noises with a random walk of all sensors of one triad, or of both, in addition to other noise.

    .. math:: V = K_\rho + \sum_q w_q^2 C_q C_q^T, \qquad
        b(t) = N \frac{\sqrt{2 T}}{\pi} \sum_k \frac{z_k}{k} \cos\frac{\pi k t}{T}

    A random walk b of density N, less its mean over the time T that it `lasts` [s], is cosines of k half periods of
    independent sizes z; the mean is part of the calibration. histories: by quantity, the reduced rows (R, 3, m) that
    cosines of 1 to m half periods in its sensors make. C_q is normalised such that w is the size of the most likely
    time history of a walk, in sigmas of all rows together.
    """
    unit, density = dict[str, Array](), dict[str, float]()
    for quantity, each in histories.items():
        C = (each / np.arange(1, each.shape[-1] + 1)).reshape(len(each), -1)
        size = float(np.sqrt(np.linalg.eigvalsh(C.T @ C)[-1]))
        unit[quantity], density[quantity] = C / size, np.pi / np.sqrt(2 * lasts) / size
    out, n = [], len(next(iter(histories.values()))) // channels
    for memory, *sizes in asked:
        walking = {q: w for q, w in zip(unit, sizes, strict=True) if w}
        root = modes(
            np.concatenate([w * unit[q] for q, w in walking.items()], axis=1), _autoregressive_chain(memory, n)
        )
        noise = {q: (RandomWalk(w * density[q]),) for q, w in walking.items()}
        name = (("memory", memory), *((f"random walk of {q}", w) for q, w in walking.items()))
        prior, fresh = TRIAD_WALK_PRIOR / len(TRIAD_WALKS), 1 - memory**2
        out.append(Node(name, noise, prior, root.log_determinant, root, fresh))
    return tuple(out)


def _autoregressive_chain(rho: float, n: int) -> Chain:
    r"""Return the chain of n rows :math:`r_k = \rho r_{k-1} + e_k`, of unit variance, of a pole of either sign."""
    new = np.full(n, 1 - rho**2)
    new[:1] = 1.0
    return Chain(np.full(n, rho), new)


def first_order(rho: float) -> Process:
    """Unit noise of memory rho from row to row, time counted in rows."""
    return GaussMarkov(1.0, -1 / np.log(rho)) if rho > 0 else WhiteNoise(1.0)
