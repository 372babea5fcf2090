r"""The noise of a recording, as a grid of noises over which to integrate, not as a single estimate.

.. math:: V = \sigma_w^2 I + \sigma_\theta^2 K_{setting} + \sigma_\theta^4 K_{along} + \sigma_{rw}^2 K_{walk}

Each noise of the grid is a tuple of processes by quantity, in units of one sigma of a row (angles of a setting in rad),
and V is the resulting covariance of the reduced rows. The white part is known to a per cent from the scatter inside
dwells (or at high frequency) and is fixed by it. The setting repeatability, one small turn of each gimbal per visit,
determines the effective sample size: it and the random walk are integrated over. A turn across the force reduces the
component along it to second order: a degree by 150 ug, of variance (sigma_theta^2 g)^2 for two turns across. In a
static run the cosine transform makes V diagonal.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.node import SINGLE_WALK, SINGLE_WALK_PRIOR, SINGLE_WALK_PRIOR_AT_REST, Node
from gimbalcal.effects import Stage
from gimbalcal.effects.process import RandomWalk, SettingError, WhiteNoise
from gimbalcal.inference.noise_processes import Noise, one_sigma, spectrum
from gimbalcal.inference.robust import huber_weights
from gimbalcal.inference.white_noise import scaled_differences
from gimbalcal.inference.whitening import Whitening, whitenings
from gimbalcal.number import Array
from gimbalcal.views.core import Fit

SETTING = (0.5, 0.71, 1.0, 1.41, 2.0, 2.83)  # times the stated setting repeatability
SETTING_PRIOR = (0.05, 0.15, 0.40, 0.22, 0.12, 0.06)
WALK = (0.0, 1.0, 2.5, 6.0)  # random walk over the whole recording, in sigmas of a dwell mean (or of an hour's mean)
WALK_PRIOR = (0.85, 0.07, 0.05, 0.03)
SETTING_PRIOR_SHARE = 0.15  # prior from which a setting repeatability is combined with them
SLOW_MODES = 160  # cosine modes; the strongest walk of the grid adds 2 % to white noise there
LOST_NATS = 0.5  # nats of the likelihood of a walk that shows beyond them, to which more of them are taken
LEAST_SCATTER = 1e-6  # of the stated sigma, below which rows differ by the rounding of numbers alone
MIN_ROWS_INSIDE = 30  # rows inside dwells below which the stated noise is better than what they show
NEGLIGIBLE_SETTING = 1e-3  # sigmas of a mean: products of setting errors below are none, as those of arcseconds are
HEAVY_KURTOSIS = 0.6  # excess kurtosis above which rows are weighted
NEIGHBOURS = 15  # rows of a static run in which a level is followed: a quarter of an hour of minute means


def scale_to_scatter(o: Fit) -> Fit:
    """Rescale each channel to the scatter that the rows show, and weight the rows where their tails are heavy.

    With enough rows this replaces the white noise of the header; with too few consecutive rows that of
    the header is kept. y and its derivatives change only by the unit of a channel.
    """
    fast = _rows_within_blocks(o)
    if len(fast) < MIN_ROWS_INSIDE:
        return o
    scale, plain = _or_stated(np.median(np.abs(fast), axis=0) / 0.6745), _or_stated(fast.std(axis=0))
    kurtosis, weight = float(np.mean(_excess_kurtosis(fast / scale))), None
    if kurtosis > HEAVY_KURTOSIS:
        blocks = o.view.noise.in_blocks
        level = o.view.noise.block if blocks else np.arange(len(o.residual)) // NEIGHBOURS
        robust = huber_weights(o.residual, level, scale)
        # what no level follows is physics: it makes no row noisier than the rows next to it show
        weight = robust.weight
        scale = _or_stated(np.minimum(robust.of_means if blocks else robust.of_rows, plain))
    else:
        scale = plain
    noise = replace(o.view.noise, sigma=o.sigma * scale, kurtosis=kurtosis, weights=weight, scatter=scale)
    view, J = replace(o.view, noise=noise), o.jacobian / scale[:, None]
    return replace(o, view=view, residual=o.residual / scale, jacobian=J, kept=o.rows.over(scale))


def _or_stated(scatter: Array) -> Array:
    """Return the scatter (C,) of each channel in stated sigmas, one where all rows read the same.

    They do where a converter is coarser than the noise of its sensor.
    """
    return np.where(scatter > LEAST_SCATTER, scatter, 1.0)


def nats_beyond_stated_scatter(o: Fit) -> float:
    r"""Return the ln likelihood that the scatter of n rows gains over the stated sigma, of the channel that gains most.

    .. math:: \frac{n}{2} \, (s^2 - 1 - \ln s^2)

    with s the scatter in units of the stated sigma; zero where s is below one, or the rows are too few for it.
    """
    if o.view.noise.scatter is None:
        return 0.0
    square = np.maximum(o.view.noise.scatter, 1.0) ** 2
    return float(len(o.residual) * np.max(square - 1 - np.log(square)) / 2)


def _rows_within_blocks(o: Fit) -> Array:
    """Return what varies from row to row inside a block (n', C), unit gain for white noise."""
    begins = np.zeros(len(o.residual), dtype=bool)
    begins[o.view.noise.starts] = True
    return np.stack(scaled_differences(o.residual.T, begins, np.ones(len(o.residual)), order=2), axis=1)


def _excess_kurtosis(x: Array) -> Array:
    """Return the excess kurtosis per column, samples beyond 12 sigma counted as 12; zero for a constant column."""
    x = np.clip(x, -12, 12)
    square = (x**2).mean(axis=0)
    return np.asarray(np.where(square > 0, (x**4).mean(axis=0) / np.where(square > 0, square, 1.0) ** 2 - 3, 0.0))


def noise_grid(o: Fit) -> tuple[Node, ...]:
    """The grid of noises of this recording with their prior probabilities."""
    gimbals = (SETTING, SETTING_PRIOR) if o.view.noise.in_blocks else (WALK, WALK_PRIOR)
    both = itertools.product(zip(*gimbals, strict=True), zip(WALK, WALK_PRIOR, strict=True))
    return _noises(o, [(size, walk, p * q, "") for (size, p), (walk, q) in both])


def single_walks_of_stated_noise(o: Fit) -> tuple[Node, ...]:
    """Return noises with a random walk of a single accelerometer, of large sizes too, in addition to those of the grid.

    Noises with walks of all accelerometers are included, so that these are not taken for the walk of a single one.
    """
    blocks = o.view.noise.in_blocks
    axes = (*(axis for quantity, axis in o.view.channels if quantity == "specific_force"), "")
    usual = [(s, p) for s, p in zip(SETTING, SETTING_PRIOR, strict=True) if p >= SETTING_PRIOR_SHARE]
    gimbals = usual if blocks else zip(WALK, WALK_PRIOR, strict=True)
    share = (SINGLE_WALK_PRIOR if blocks else SINGLE_WALK_PRIOR_AT_REST) / len(SINGLE_WALK)
    every = itertools.product(axes, gimbals, SINGLE_WALK)
    return _noises(o, [(size, walk, share * p, axis) for axis, (size, p), walk in every])


def nominal_noise(o: Fit) -> Node:
    """The noise as stated, without a random walk."""
    return _noises(o, [(float(o.view.noise.in_blocks), 0.0, 1.0, "")])[0]


def _noises(o: Fit, processes: Sequence[tuple[float, float, float, str]]) -> tuple[Node, ...]:
    """Return a noise for each size of what gimbals do, walk of forces, prior probability, and accelerometer.

    Gimbals have setting errors in positions, and a walk of their angles in a static run. The accelerometer is the one
    with a random walk, "" if all of them have one.
    """
    return _of_dwells(o, processes) if o.view.noise.in_blocks else _spectral_noise(o, processes)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """The observation of the states of coloured noise, of any size, in n blocks of C channels."""

    walks: Array  # (n, C, C) of each channel
    angles: Array  # (n, C, k) of the gimbals that were read
    along: Array  # (n, C, 1) of the force along itself
    since: Array  # (n,) s from the mean time of the block before
    moved: Array  # (n,) whether a visit begins


def _blocks(o: Fit) -> _Blocks:
    n, C = len(o.view.noise.starts), o.residual.shape[1]
    count = np.diff(np.append(o.view.noise.starts, len(o.residual)))
    k = o.view.gimbals_with_readout
    return _Blocks(
        walks=np.sqrt(count)[:, None, None] * np.eye(C),  # as a mean of so many rows is reduced
        angles=o.reduced(o.rows.sensitivity(Stage.ENCODER)[:, :, k]).reshape(n, C, -1) if k else np.zeros((n, C, 0)),
        along=o.reduced(o.rows.through(Stage.ACCELEROMETER, o.view.stimulus.force)[:, :, None]).reshape(n, C, 1),
        since=np.diff(np.append(0.0, _block_time(o))),
        moved=np.append(True, np.diff(o.view.stimulus.visit[o.view.noise.starts]) != 0),
    )


def _of_dwells(o: Fit, processes: Sequence[tuple[float, float, float, str]]) -> tuple[Node, ...]:
    """Return the noises of positions: a walk of forces, and setting errors, in blocks of rows."""
    blocks = _blocks(o)
    noises = [dwell_noise(o, setting, walk) for setting, walk, _, _ in processes]
    states = [_states(o, blocks, noise, alone) for noise, (*_, alone) in zip(noises, processes, strict=True)]
    roots: dict[int, Whitening] = {}
    for width in {H.shape[-1] for _, _, H in states}:  # those that are seen by the same states at once
        alike = [k for k, (_, _, H) in enumerate(states) if H.shape[-1] == width]
        Phi, Q = (np.stack([states[k][part] for k in alike]) for part in (0, 1))
        roots |= zip(alike, whitenings(Phi, Q, states[alike[0]][2]), strict=True)
    return tuple(
        Node((("setting error", setting), (f"random walk {alone}".rstrip(), walk)), noises[k], prior,
             roots[k].log_determinant, roots[k], single_walk=alone)
        for k, (setting, walk, prior, alone) in enumerate(processes)
    )  # fmt: skip


def _states(o: Fit, blocks: _Blocks, noise: Mapping[str, Noise], alone: str) -> tuple[Array, Array, Array]:
    """Phi, Q (n, m) and H (n, C, m) of a walk of each channel, or of the one that is `alone`, at the mean time of each
    block; anew at each visit, an angle of each gimbal and what these take of the force along themselves.
    """
    (turned,), (wandering,) = noise["gimbal_angle"], noise["specific_force"][1:]
    short = SettingError((o.view.local.remaining if o.view.local else 1.0) * one_sigma((turned,)) ** 2)
    along = blocks.along if _shows_along_force(blocks.along, short) else blocks.along[:, :, :0]
    H = np.concatenate([blocks.walks, blocks.angles, along], axis=-1)
    walks = [wandering if alone in ("", axis) else RandomWalk(0.0) for _, axis in o.view.channels]
    every = [*walks, *[turned] * blocks.angles.shape[-1], *[short] * along.shape[-1]]
    Phi, Q = (np.concatenate(parts, axis=1) for parts in zip(
        *((p.transition(blocks.since, blocks.moved), p.diffusion(blocks.since, blocks.moved)) for p in every),
        strict=True))  # fmt: skip
    return Phi, Q, H


def setting_is_second_order(o: Fit) -> bool:
    """Return whether gimbals are set so loosely that it shows along the force, of second order."""
    return _shows_along_force(_blocks(o).along, SettingError((max(SETTING) * o.view.local_sigma) ** 2))


def _shows_along_force(along: Array, short: SettingError) -> bool:
    return bool(np.abs(along).max(initial=0.0) * one_sigma((short,)) > NEGLIGIBLE_SETTING)


def dwell_noise(o: Fit, setting: float, walk: float) -> Mapping[str, Noise]:
    """`setting` times the stated repeatability, and a walk that reaches `walk` sigmas of a dwell mean at the end."""
    repeatability = setting * o.view.local_sigma
    rows, end = len(o.residual) / len(np.unique(o.view.stimulus.visit)), float(_block_time(o)[-1])
    return {
        "specific_force": (WhiteNoise(1.0), RandomWalk(walk / float(np.sqrt(rows * end)))),
        "gimbal_angle": (SettingError(repeatability),),
    }


def _block_time(o: Fit) -> Array:
    count = np.diff(np.append(o.view.noise.starts, len(o.residual)))
    return np.asarray(np.add.reduceat(o.view.stimulus.time, o.view.noise.starts) / count)


def coloured_row_count(o: Fit, among: Sequence[Node] = ()) -> int:
    """Return how many of the reduced rows may not be white, in the grid and `among` further noises."""
    C = o.residual.shape[1]
    rows = len(o.view.noise.starts) if o.view.noise.in_blocks else slow_modes(o, 0.0)
    return max([rows * C, *(n.coloured for n in among)])


def slow_modes(o: Fit, walk: float) -> int:
    r"""Return how many modes of each channel of a static run show a walk; its share in white noise falls as 1 / k^2.

    Beyond mode K it has :math:`\epsilon_k = T w^2 / (\pi k)^2` of the white variance, T in h; taken for white, they
    cost the likelihood :math:`\sum \epsilon_k^2 / 4 = (T w^2 / \pi^2)^2 / 12 K^3` nats.
    """
    n = len(o.residual)
    hours = float(np.median(np.diff(o.view.stimulus.time))) * n / 3600.0
    shown = int(np.ceil(((hours * walk**2 / np.pi**2) ** 2 / (12 * LOST_NATS)) ** (1 / 3)))
    return min(n, max(SLOW_MODES, shown)) if shown < n / 2 else n  # the fastest modes show it more than 1 / k^2


def _spectral_noise(o: Fit, processes: Sequence[tuple[float, float, float, str]]) -> tuple[Node, ...]:
    """Return the noises of a static run: white, and a walk in forces and angles: diagonal in the cosine transform."""
    n = len(o.residual)
    step = float(np.median(np.diff(o.view.stimulus.time)))
    out = []
    for wa, wf, prior, alone in processes:
        # an offset, which the calibration takes, stands for half a wave
        angle = np.pi * np.maximum(np.arange(slow_modes(o, wf)), 0.5) / n
        noise = {q: static_noise(o, wf if q == "specific_force" else wa) for q in dict(o.view.channels)}
        V = np.stack([
            np.ones(len(angle)) if q == "specific_force" and alone not in ("", a) else spectrum(noise[q], step, angle)
            for q, a in o.view.channels
        ], axis=-1)  # fmt: skip
        name = ((f"random walk of forces {alone}".rstrip(), wf), ("random walk of angles", wa))
        out.append(Node(name, noise, prior, float(np.log(V).sum()), (1 / np.sqrt(V)).ravel(), single_walk=alone))
    return tuple(out)


def static_noise(o: Fit, walk: float) -> Noise:
    """White rows and a walk that reaches `walk` sigmas of an hour's mean at the end of a static run."""
    return (WhiteNoise(1.0), RandomWalk(walk / float(np.sqrt(3600.0 * len(o.residual)))))
