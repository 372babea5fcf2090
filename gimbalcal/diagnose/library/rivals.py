"""Shapes that stand for "none of these": free per position, smooth in orientation, time, temperature; simple laws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.diagnose.library.candidates import Candidate, Variant, appended_to
from gimbalcal.diagnose.library.shapes import high_harmonics, products, settings, shapes, unit_rms
from gimbalcal.effects import Stage
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.number import Array
from gimbalcal.views.core import Fit

ALIKE = 0.97  # correlation from which a simple law is one that the catalogue has
SLOWEST = 2000  # reduced rows on which that is judged: all of 18 positions, the slowest of a static run
RIVAL_SIGMA = 3.0  # prior size of one shape, in sigmas of a row: mixed over 0.1 to 100 like every other


def rivals(o: Fit, blocks: list[Array]) -> list[Candidate]:
    """Free per position, smooth in orientation, in time, in temperature, gimbal harmonics; and simple laws."""
    out: list[Candidate] = []
    axes = _outputs(o)
    for name, (words, basis) in shapes(o).items():
        scaled = unit_rms(basis)
        every: list[int] = []
        for axis, along in axes:
            X = np.stack([along * b[:, None] for b in scaled.T], axis=-1)
            at = tuple(appended_to(blocks, o.reduced(X) * RIVAL_SIGMA))
            every += at
            out.append(Candidate(f"unknown {name}", axis, (), (Variant((), at),), rival=words))
        if len(axes) > 1:
            together = ", ".join(axis for axis, _ in axes)
            out.append(Candidate(f"unknown {name}", together, (), (Variant((), tuple(every)),), rival=words))
    return out + gimbal_harmonics(o, blocks) + _simple_laws(o, blocks)


def _simple_laws(o: Fit, blocks: list[Array]) -> list[Candidate]:
    """Products and powers of what was recorded, as outputs of one accelerometer, less those that have a cause."""
    Q = orthonormal(o.reduced(o.Z)[:SLOWEST])

    def unit(X: Array) -> Array:
        X = X[:SLOWEST]
        left = X - Q @ (Q.T @ X)
        size = np.sqrt((left**2).sum(axis=0))
        return left / np.where(size > 1e-3 * np.sqrt((X**2).sum(axis=0)) + 1e-300, size, np.inf)

    known = unit(np.concatenate([b[:SLOWEST] for b in blocks], axis=1))
    out = []
    for name, (words, bases) in products(o).items():
        for axis, along in _outputs(o):
            variants = []
            for basis in bases:
                X = o.reduced(along[:, :, None] * unit_rms(basis)[:, None, :])
                if X.any() and np.abs(known.T @ unit(X)).max(axis=0).min() < ALIKE:
                    variants.append(Variant((), tuple(appended_to(blocks, X * RIVAL_SIGMA))))
            if variants:
                out.append(Candidate(f"unknown {name}", axis, (), tuple(variants), rival=words))
    return out


def _outputs(o: Fit) -> list[tuple[str, Array]]:
    """What one unit (a sigma of a row) added to each accelerometer that was logged does to all channels, (n, C)."""
    S = o.rows.sensitivity[Stage.ACCELEROMETER]
    out = []
    for k, (quantity, axis) in enumerate(o.view.channels):
        if quantity == "specific_force":
            along = S[:, :, "xyz".index(axis)]
            out.append((axis, along / np.abs(along[:, k]).max()))
    return out


def gimbal_harmonics(o: Fit, blocks: list[Array]) -> list[Candidate]:
    """Errors of each moving gimbal that no bearing or encoder has: high harmonics, or a value at each setting."""
    out = []
    for i, axis in enumerate(o.view.stimulus.axis_names):
        harmonics = high_harmonics(o.rows.seen[Stage.ENCODER].angle[:, i])
        words = f"a third or higher harmonic of the {axis} gimbal angle"
        out += _of_gimbal(o, i, "unknown gimbal angle", words, harmonics, blocks)
        words = f"a value of its own at each setting of the {axis} gimbal"
        out += _of_gimbal(o, i, "unknown gimbal setting", words, settings(o.view.stimulus.readout[:, i]), blocks)
    return out


def _of_gimbal(o: Fit, i: int, effect: str, words: str, bases: Sequence[Array], blocks: list[Array]) -> list[Candidate]:
    variants = []
    for basis in bases:
        added = np.zeros((*basis.shape, len(o.view.stimulus.axis_names)))
        added[:, :, i] = basis
        X = np.stack([o.rows.through(Stage.ENCODER, added[:, j]) for j in range(basis.shape[1])], axis=-1)
        size = np.abs(X).max()
        if size > 0:
            variants.append(Variant((), tuple(appended_to(blocks, o.reduced(X / size) * RIVAL_SIGMA))))
    axis = o.view.stimulus.axis_names[i]
    made = Candidate(effect, axis, (), tuple(variants), rival=words, channel="gimbal_angle")
    return [made] if variants else []
