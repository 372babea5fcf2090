"""Every cause that a view of a recording could show, as columns, and shapes that stand for "none of these"."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.diagnose.library.candidates import (
    Candidate,
    Constants,
    choices,
    eligible,
    of_effect,
    sources,
)
from gimbalcal.diagnose.library.view_shapes import shapes_of
from gimbalcal.effects import CATALOGUE, Effect, Parameter
from gimbalcal.effects.effect import Grid, constants
from gimbalcal.effects.grids import kind, resolved
from gimbalcal.forward import Rows
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.number import Array
from gimbalcal.views.core import View, absent_effect

PEAKS = 3  # of a scan over whole numbers
STILL = 0.01  # of a column: a gimbal that stands still but for the drift of its readout
SHAKEN = 5.0  # times the relative misfit: laws of second and third degree, sums of a few
ABOUT = 9  # whole numbers about each of them


def causes(v: View, present: Sequence[Effect], modelled: Sequence[Parameter]) -> tuple[tuple[Candidate, ...], Array]:
    """Everything that could still be missing, and its columns (n, C, P) per prior sigma."""
    blocks: list[Array] = []
    found: list[Candidate] = []
    rows = v.noise_free(present)
    taken = spans(rows.jacobian(modelled))
    for effect_id in available(v):
        found += _of_effect(v, effect_id, rows, modelled, taken, blocks)
    blocks = [_clear_of_noise(v, X, rows.residual, taken) for X in blocks]
    strange = shapes_of(v, rows.residual, taken, blocks, free_rows(v, modelled))
    return (*found, *strange), np.concatenate(blocks, axis=-1)


def available(v: View) -> tuple[str, ...]:
    """Ids of the catalogue that act on these rows and whose channels were recorded."""
    return tuple(
        effect_id
        for effect_id, cls in CATALOGUE.items()
        if eligible(cls, v.kind, v.stimulus, v.stages, known_noise=False)
    )


def _of_effect(
    v: View, effect_id: str, rows: Rows, modelled: Sequence[Parameter], taken: Array, blocks: list[Array]
) -> list[Candidate]:
    """Candidates of what the model does not hold of an effect; with the constants it has there, if it has some.

    Of a gimbal that stands still a pattern in its angle is a constant, which the model has `taken` (n C, q): no cause.
    """
    cls = CATALOGUE[effect_id]
    there = next((e for e in rows.effects if e.id == effect_id), None)
    had = {(p.effect, p.field, p.axis) for p in modelled}
    wanted = [p for p in v.parameters_of(effect_id) if (p.effect, p.field, p.axis) not in had]
    if there is None and {p.axis for p in wanted} & set(v.stimulus.axis_names):
        first = absent_effect(effect_id, v.stimulus, "", **dict(choices(cls, v.stimulus)[0]))
        own = _beyond(np.nan_to_num(rows.columns(first, wanted)), taken)
        wanted = [p for p, seen in zip(wanted, own, strict=True) if seen or p.axis not in v.stimulus.axis_names]
    scale = np.array([p.sigma for p in wanted])

    def columns(made: Effect) -> Array:
        return np.nan_to_num(rows.columns(made if there is None else there, wanted) * scale)

    tried, count = choices(cls, v.stimulus), 0
    if wanted and there is None:
        tried, count = _scanned(v, cls, rows.residual, columns, tried)
    elif there is not None:  # its constants were chosen among as many, unless another axis has told them
        held = any(p.effect == effect_id for p in modelled)
        tried, count = [constants_of(there)], 1 if held else len(v.cache.get(effect_id, tried))
    out: list[Candidate] = []
    for source in sources(cls, v.stimulus) if wanted else ():
        if there is None or source == (getattr(there, "covariate", "") if source else ""):
            out += of_effect(cls, source, wanted, tried, v.stimulus, columns, blocks)
    return [replace(c, scanned=count) for c in out]


def _clear_of_noise(v: View, X: Array, misfit: Array, taken: Array) -> Array:
    """Columns X (n, C, p), zero where what the model leaves of them is no more than the noise of the forces in them.

    Poses that come again and again in the same order leave nothing else of what follows the pose: it would be a copy of
    the misfit (n, C). Forces are known to its share of gravity.
    """
    if v.name != "norm":
        return X
    A = X.reshape(len(taken), -1)
    left = np.linalg.norm(A - taken @ (taken.T @ A), axis=0)
    noise = SHAKEN * float(np.sqrt(np.mean(misfit**2))) / v.stimulus.gravity
    return np.asarray(X * (left > noise * np.linalg.norm(A, axis=0)))


def spans(J: Array) -> Array:
    """Orthonormal basis (n C, q) of columns J (n, C, p), whatever their units."""
    A = J.reshape(J.shape[0] * J.shape[1], -1)
    return orthonormal(A / (np.linalg.norm(A, axis=0) + 1e-300))


def _beyond(X: Array, Q: Array) -> NDArray[np.bool_]:
    """Which of the columns X (n, C, p) are more than what Q (n C, q) spans."""
    A = X.reshape(len(Q), -1)
    left = np.linalg.norm(A - Q @ (Q.T @ A), axis=0)
    return np.asarray(left > STILL * np.linalg.norm(A, axis=0))


def _scanned(
    v: View, cls: type[Effect], misfit: Array, columns: Callable[[Effect], Array], tried: list[Constants]
) -> tuple[list[Constants], int]:
    """Whole numbers about those that explain most of a misfit (n, C), of all that the readouts tell apart; how many.

    What was `tried` without them, and none, for an effect without a whole number or with few.
    """
    whole = next((f for f in constants(cls) if kind(f) is Grid.WHOLE), None)
    every = np.zeros(0) if whole is None else resolved(whole, v.stimulus)
    if whole is None or len(every) <= len(tried):
        return tried, len(every)
    if cls.id not in v.cache:  # the same for all models of a course, but for their few per mille
        made = (absent_effect(cls.id, v.stimulus, "", **{whole.name: m}) for m in every)
        v.cache[cls.id] = np.stack([spanned(columns(m) * v.weight[..., None]) for m in made]).astype(np.float32)
    best = every[peaks(powers(v.cache[cls.id], misfit * v.weight), PEAKS)]
    return [((whole.name, float(m)),) for m in between_scanned(best, float(every[1] - every[0]))], len(every)


def spanned(X: Array) -> Array:
    """Orthonormal columns of what X (n, C, p) spans, zero where it spans less than p."""
    A = X.reshape(-1, X.shape[-1])
    lam, V = np.linalg.eigh(A.T @ A)
    seen = lam > 1e-6 * max(float(lam.max(initial=0.0)), 1e-300)
    return np.asarray((A @ V / np.sqrt(np.where(seen, lam, np.inf))).reshape(X.shape))


def powers(Q: Array, misfit: Array) -> Array:
    """How much of a misfit (n, C) each of the sets of orthonormal columns Q (m, n, C, p) takes away by itself, (m,)."""
    return np.asarray(((misfit.ravel() @ Q.reshape(len(Q), misfit.size, -1)) ** 2).sum(axis=1))


def peaks(power: Array, count: int) -> list[int]:
    """Ordinals of the highest local maxima, in order."""
    padded = np.concatenate([[-np.inf], power, [-np.inf]])
    top = np.flatnonzero((power >= padded[:-2]) & (power >= padded[2:]))
    return sorted(int(i) for i in top[np.argsort(-power[top])][:count])


def between_scanned(best: Array, step: float) -> list[float]:
    """Whole numbers about the best of a scan, up to the next that it looked at; `ABOUT` of each where they are many."""
    near = np.unique(np.round(np.linspace(1 - step, step - 1, int(min(2 * step - 1, ABOUT)))))
    return sorted({float(m + d) for m in best for d in near if m + d >= 1})


def constants_of(e: Effect) -> Constants:
    """The non-linear constants of an effect."""
    return tuple((f.name, float(getattr(e, f.name))) for f in constants(type(e)))


def free_rows(v: View, modelled: Sequence[Parameter]) -> int:
    """Rows of a channel that a model with these parameters leaves to test anything with."""
    return max(len(v) - -(-len(modelled) // len(v.channels)), 1)
