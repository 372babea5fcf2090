r"""The noise of a recording, as a grid of possibilities to integrate over, never one estimate to plug in.

.. math:: V = \sigma_w^2 I + \sigma_\theta^2 K_{setting} + \sigma_{rw}^2 K_{walk}

The white part is known to a per cent from the scatter inside dwells (or at high frequency) and is fixed by it. The
setting error, one small turn of each gimbal per visit, decides the real size of the sample: it and the random walk
are integrated over. In a static run the cosine transform makes V diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.rows.observations import Observations
from gimbalcal.effects import Stage
from gimbalcal.inference.robust import huber
from gimbalcal.number import Array
from gimbalcal.units import to_si

SETTING = (0.5, 0.71, 1.0, 1.41, 2.0, 2.83)  # times the stated setting error
SETTING_PRIOR = (0.05, 0.15, 0.40, 0.22, 0.12, 0.06)
WALK = (0.0, 1.0, 2.5, 6.0)  # random walk over the whole recording, in sigmas of a dwell mean (or of an hour's mean)
WALK_PRIOR = (0.85, 0.07, 0.05, 0.03)
DEFAULT_SETTING = float(to_si(1.0, "arcsec"))
SLOW = 160  # cosine modes; the strongest walk of the grid adds 2 % to white noise there
FEW = 30  # rows inside dwells below which the stated noise is better than what they show
HEAVY = 0.6  # excess kurtosis above which rows are weighted
NEIGHBOURS = 15  # rows of a static run in which a level is followed: a quarter of an hour of minute means


@dataclass(frozen=True)
class Node:
    """One possible noise: how to whiten reduced rows, its log determinant and prior probability."""

    name: tuple[tuple[str, float], ...]
    prior: float
    logdet: float
    inverse_root: Array  # (R, R) lower triangle inverse, or (R,) diagonal

    def whiten(self, rows: Array) -> Array:
        """Reduced rows (R, p) to unit covariance; those beyond the coloured ones have it already."""
        coloured = len(self.inverse_root)
        if len(rows) > coloured:
            return np.concatenate([self.whiten(rows[:coloured]), rows[coloured:]])
        if self.inverse_root.ndim == 1:
            return np.asarray(self.inverse_root[:, None] * rows)
        return np.asarray(self.inverse_root @ rows)


def settle(o: Observations) -> Observations:
    """Rescale each channel to the scatter that the rows show, and weight the rows where their tails are heavy.

    What was measured stays as it is: y and its derivatives change by the unit of a channel alone.
    """
    fast = _fast(o)
    if len(fast) < FEW:
        return o
    scale = np.median(np.abs(fast), axis=0) / 0.6745
    scale = np.where(scale > 0, scale, 1.0)
    kurtosis, weight = float(np.mean(_excess(fast / scale))), None
    if kurtosis > HEAVY:
        static = o.kind == "static-run"
        found = huber(o.y, np.arange(len(o.y)) // NEIGHBOURS if static else o.block, scale)
        weight, scale = found.weight, found.of_rows if static else found.of_means
    else:
        scale = fast.std(axis=0)
    return replace(o.over(scale), heavy=kurtosis, weight=weight)


def _fast(o: Observations) -> Array:
    """What varies from row to row inside a dwell (n', C), unit gain for white noise."""
    d = (o.y[2:] - 2 * o.y[1:-1] + o.y[:-2]) / np.sqrt(6)
    if o.kind == "static-run":
        return np.asarray(d)
    inside = o.block[2:] == o.block[:-2]
    return np.asarray(d[inside])


def _excess(x: Array) -> Array:
    """Excess kurtosis per column, samples beyond 12 sigma counted as 12."""
    x = np.clip(x, -12, 12)
    return np.asarray((x**4).mean(axis=0) / (x**2).mean(axis=0) ** 2 - 3)


def nodes(o: Observations) -> tuple[Node, ...]:
    """The grid of noises of this recording with their prior probabilities."""
    return _spectral_nodes(o) if o.kind == "static-run" else _dwell_nodes(o)


def _dwell_nodes(o: Observations) -> tuple[Node, ...]:
    setting, walk = _setting(o), _walk(o)
    K = setting @ setting.T
    return tuple(
        _dwell_node(K, walk, s, w, ps * pw)
        for s, ps in zip(SETTING, SETTING_PRIOR, strict=True)
        for w, pw in zip(WALK, WALK_PRIOR, strict=True)
    )


def _dwell_node(setting: Array, walk: Array, s: float, w: float, prior: float) -> Node:
    L = np.linalg.cholesky(np.eye(len(setting)) + s**2 * setting + w**2 * walk)
    logdet = 2 * float(np.log(np.diag(L)).sum())
    return Node((("setting error", s), ("random walk", w)), prior, logdet, np.linalg.inv(L))


def nominal(o: Observations) -> Node:
    """The noise as stated, without a random walk."""
    if o.kind == "static-run":
        return _spectral_nodes(o)[0]
    setting = _setting(o)
    return _dwell_node(setting @ setting.T, np.zeros((len(setting), len(setting))), 1.0, 0.0, 1.0)


def _setting(o: Observations) -> Array:
    """Reduced columns (R, visits x gimbals) of one stated setting error of each gimbal at each visit."""
    S = o.sensitivity[Stage.ENCODER]
    size = o.recording.noise.get("gimbal_angle", DEFAULT_SETTING)
    k = [i for i, a in enumerate(o.stimulus.axis_names) if ("gimbal_angle", a) in o.recording.channels]
    visits = (o.stimulus.visit[:, None] == np.unique(o.stimulus.visit)).astype(float)
    X = np.einsum("ncm,nv->ncvm", S[:, :, k], visits) * size
    return o.reduce(X.reshape(*X.shape[:2], -1))


def _walk(o: Observations) -> Array:
    """Covariance (R, R) of independent random walks of the channels, reaching one sigma of a dwell mean at the end."""
    n, C = o.y.shape
    count = np.diff(np.append(o.starts, n))
    t = np.add.reduceat(o.stimulus.time, o.starts) / count
    dwell = n / len(np.unique(o.stimulus.visit))
    K = np.minimum.outer(t, t) / t[-1] * np.sqrt(np.outer(count, count)) / dwell
    return np.asarray(np.kron(K, np.eye(C)))


def coloured(o: Observations) -> int:
    """How many of the reduced rows can be other than white: all of a device test, the slowest of a static run."""
    n, C = o.y.shape
    if o.kind == "static-run":
        return min(n, SLOW) * C
    return len(o.starts) * C


def _spectral_nodes(o: Observations) -> tuple[Node, ...]:
    """White noise and, in forces or in angles, a random walk: diagonal in the cosine transform."""
    n, C = o.y.shape
    k = np.maximum(np.arange(coloured(o) // C), 0.5)
    unit = 1 / (2 - 2 * np.cos(np.pi * k / n)) / n  # walk that reaches one sigma of a row at the end
    hour = float(np.median(np.diff(o.stimulus.time))) / 3600.0  # variance of an hour's mean, in rows
    force = np.array([q == "specific_force" for q, _ in o.channels])
    out = []
    for wf, pf in zip(WALK, WALK_PRIOR, strict=True):
        for wa, pa in zip(WALK, WALK_PRIOR, strict=True):
            level = np.where(force, wf, wa) ** 2 * hour
            V = 1 + unit[:, None] * level
            out.append(
                Node((("random walk of forces", wf), ("random walk of angles", wa)), pf * pa,
                     float(np.log(V).sum()), (1 / np.sqrt(V)).ravel())
            )  # fmt: skip
    return tuple(out)
