"""Small cases of which everything can be worked out densely: few rows, a few causes, a few noises.

The builders stand here so that a change of the rows or of the search is followed in one place.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.fft import idct

from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.stated_noise import noise_grid, scale_to_scatter
from gimbalcal.diagnose.library import assemble
from gimbalcal.diagnose.library.assemble import assemble_library, available_effects, columns_at
from gimbalcal.diagnose.library.candidates import Candidate, Library
from gimbalcal.diagnose.result import FitSummary
from gimbalcal.diagnose.search.ranking import Search, search
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.effects import CATALOGUE
from gimbalcal.number import Array
from gimbalcal.platform import BENCH, KNOWN
from gimbalcal.recording import Recording, Site
from gimbalcal.views.core import Fit, View
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose import static_plant
from tests.diagnose.plant import ARCSEC, UG, Error, record

G = 9.8
FIT = FitSummary(chi2_reduced_before=3.0, chi2_reduced_after=1.0, heldout_before=3.3, heldout_after=1.1, noise={})

__all__ = ["columns_at"]  # the rest is written here


def observed(seed: int = 1, error: Error | None = None, size: float = 0.0, **options: Any) -> Fit:
    """Residual rows of 18 positions with 12 readings each; `size` in ug, where the error is one of an output."""
    options.setdefault("dwell", 12)
    return scale_to_scatter(
        fit_baseline(view_at_known_attitude(record(np.random.default_rng(seed), error, size * UG, **options)))
    )


def at_rest(seed: int = 1, error: static_plant.Error | None = None, size: float = 0.0) -> Fit:
    """Residual rows of a static run of 48 h."""
    return scale_to_scatter(
        fit_baseline(view_at_known_attitude(static_plant.record(np.random.default_rng(seed), error, size * UG)))
    )


def few(o: Fit, *labels: str) -> Library:
    """The library of a recording with these candidates alone ("bias_drift:x"), each by its first entry."""
    effects = {label.partition(":")[0] for label in labels}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assemble, "available_effects", lambda v: tuple(i for i in available_effects(v) if i in effects))
        if effects <= set(CATALOGUE):
            patch.setattr(assemble, "shapes_in_outputs", lambda *_: [])
        whole = assemble_library(o)
    kept, blocks, at = [], [], 0
    for label in labels:
        c = next(c for c in whole.candidates if c.label == label)
        variants = []
        for v in c.variants:
            variants.append(replace(v, index=tuple(range(at, at + len(v.index)))))
            blocks.append(whole.X[:, list(v.index)])
            at += len(v.index)
        kept.append(replace(c, variants=tuple(variants)))
    return Library(tuple(kept), np.concatenate(blocks, axis=1))


def noises(o: Fit, count: int = 3) -> tuple[Node, ...]:
    """The noises with the largest prior shares, which add up to one again."""
    chosen = sorted(noise_grid(o), key=lambda n: -n.prior)[:count]
    total = sum(n.prior for n in chosen)
    return tuple(replace(n, prior=n.prior / total) for n in chosen)


def searched(o: Fit, *labels: str, count: int = 3) -> Search:
    """The search among these candidates in the likeliest noises."""
    return search(o, few(o, *labels), noises(o, count))


def again(s: Search, o: Fit) -> Search:
    """The same causes and noises on other data of the same design."""
    return search(o, s.library, [p.node for p in s.projections])


def candidate(s: Search, label: str) -> int:
    """Place of a candidate in the library of a search."""
    return [c.label for c in s.library.candidates].index(label)


def rows_of(o: Fit) -> tuple[Array, Array]:
    """Reduced calibration columns (R, q) and data (R,)."""
    return o.reduced(o.Z), o.reduced(o.residual[:, :, None])[:, 0]


def covariance(node: Node, rows: int) -> Array:
    """Dense covariance (R, R) of reduced rows in one noise, in squares of a row's sigma."""
    root = np.linalg.inv(node.whiten(np.eye(rows)))
    return np.asarray(root @ root.T)


def gls(A: Array, y: Array, V: Array) -> tuple[Array, Array]:
    """Generalised least squares by the normal equations: estimate and covariance."""
    W = np.linalg.solve(V, A)
    C = np.linalg.inv(A.T @ W)
    return C @ (W.T @ y), C


def with_data(o: Fit, rows: Array) -> Fit:
    """The same recording with other data, given as reduced rows (R,)."""
    n, C = o.residual.shape
    if o.view.kind == "static-run":
        y = np.asarray(idct(rows.reshape(n, C), axis=0, norm="ortho"))
    else:
        count = np.diff(np.append(o.view.noise.starts, n))
        y = np.repeat(rows.reshape(-1, C) / np.sqrt(count)[:, None], count, axis=0)
    return replace(o, residual=y)


def clean(o: Fit, node: Node, rng: np.random.Generator) -> Fit:
    """The same recording with nothing but this noise in it."""
    R = len(o.reduced(o.Z))
    return with_data(o, np.linalg.cholesky(covariance(node, R)) @ rng.standard_normal(R))


def telescope(
    seed: int, north: float = 0.0, east: float = 0.0, bend: float = 0.0, n: int = 80,
    lifted: Callable[[Array, Array], Array] = lambda E, _: 0 * E,
) -> Recording:  # fmt: skip
    """Stars all over the sky, by spherical trigonometry; an arcsecond of noise in each component.

    The encoders have zeros, the base is tilted about north and east, the tube bends with cos(elevation), and the
    elevation is read too high by `lifted` (elevation, azimuth); all in arcsec.
    """
    rng = np.random.default_rng(seed)
    E, A = np.arcsin(rng.uniform(0.26, 0.99, n)), rng.uniform(-np.pi, np.pi, n)
    x, y, z = np.cos(E) * np.cos(A), np.cos(E) * np.sin(A), -np.sin(E)  # north, east, down
    a, b = north * ARCSEC, east * ARCSEC
    x, y, z = x - b * z, y + a * z, z + b * x - a * y  # frame rotation, first order
    up, around = -np.arcsin(z), A + np.angle(np.exp(1j * (np.arctan2(y, x) - A)))
    read = {
        "elevation": up + (bend * np.cos(E) + lifted(E, A)) * ARCSEC + 0.1 + ARCSEC * rng.standard_normal(n),
        "azimuth": around - 0.2 + ARCSEC * rng.standard_normal(n) / np.cos(E),
    }
    true = {"elevation": E, "azimuth": A}
    channels = {("gimbal_angle", k): v for k, v in read.items()} | {("true_angle", k): v for k, v in true.items()}
    time = 130.0 * np.arange(n)
    return Recording("pointing", "telescope", KNOWN["alt-az"], Site(0.55, 0.0, G), {}, time, None, channels)


def turned(seed: int, g_sensitivity: Array | None = None, drift: float = 0.0) -> Recording:
    """A unit at rest in forty attitudes, ten means each: bias, scale and misalignment, and what is asked for."""
    rng = np.random.default_rng(seed)
    up = rng.standard_normal((40, 3))
    f = G * np.repeat(up / np.linalg.norm(up, axis=1, keepdims=True), 10, axis=0)
    n = len(f)
    t = np.linspace(0.0, 600.0, n)
    M = np.eye(3) + 1e-2 * rng.standard_normal((3, 3))
    wander = drift * np.stack([np.sin(4 * np.pi * t / t[-1]), -np.cos(2 * np.pi * t / t[-1]), (t / t[-1]) ** 2], -1)
    y = f @ M.T + [0.1, -0.2, 0.05] + wander * 1e-3 * G + 3e-4 * G * rng.standard_normal((n, 3))
    hour = np.pi / 648000  # rad/s of a degree an hour
    w = hour * (np.array([50.0, -80.0, 20.0]) + 60 * rng.standard_normal((n, 3)))
    if g_sensitivity is not None:
        w = w + hour * f / G @ g_sensitivity.T
    channels = {("specific_force", a): y[:, i] for i, a in enumerate("xyz")}
    channels |= {("angular_rate", a): w[:, i] for i, a in enumerate("xyz")}
    position = np.repeat(np.arange(1, 41), 10)
    return Recording("multi-position", "made", BENCH, Site(None, 0.0, G), {}, t, position, channels)


def causes_of(v: View, m: Fit) -> tuple[Candidate, ...]:
    """Everything that could be missing from a model of a view."""
    return assemble_library(m).candidates
