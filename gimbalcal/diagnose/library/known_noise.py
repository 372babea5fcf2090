"""Every cause that a recording of known noise could show, and every rival, as reduced columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.library.candidates import (
    Candidate,
    Constants,
    Library,
    choices,
    eligible,
    of_effect,
    sources,
)
from gimbalcal.diagnose.library.rivals import rivals
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, absent_effect

MOST = 150  # choices of constants that are weighed beside each other; of more, those that explain most


def library(o: Fit, baseline: Sequence[str]) -> Library:
    """Every cause that this recording could show and every rival."""
    blocks: list[Array] = []
    known: list[Candidate] = []
    for effect_id in available(o, baseline):
        cls = CATALOGUE[effect_id]
        wanted = tuple(o.view.grade.usual(p) for p in parameters(cls, o.view.stimulus.axis_names))
        for source in sources(cls, o.view.stimulus):
            every, columns = choices(cls, o.view.stimulus), _per_sigma(o, wanted)
            many = len(every) > MOST
            tried = _likeliest(o, cls, source, every, columns) if many else every
            found = of_effect(cls, source, wanted, tried, o.view.stimulus, columns, blocks)
            known += [replace(c, scanned=len(every)) for c in found] if many else found
    unknown = rivals(o, blocks)
    return Library(tuple(known + unknown), np.concatenate(blocks, axis=1))


def _likeliest(
    o: Fit, cls: type[Effect], source: str, every: Sequence[Constants], columns: Callable[[Effect], Array]
) -> list[Constants]:
    """The `MOST` choices that take away most of what the calibration leaves of the data, in order.

    All of a thousand positions would be as many columns squared for each noise; what explains least adds nothing to
    a sum over choices, of which each keeps its share among all.
    """
    Q = orthonormal(o.reduced(o.Z))
    r = o.reduced(o.residual[:, :, None])[:, 0]
    r = r - Q @ (Q.T @ r)
    taken = []
    for constants in every:
        X = columns(absent_effect(cls.id, o.view.stimulus, source, **dict(constants)))
        taken.append(float(((orthonormal(X - Q @ (Q.T @ X)).T @ r) ** 2).sum()) if X.any() else 0.0)
    return [every[i] for i in sorted(np.argsort(taken)[::-1][:MOST])]


def available(o: Fit, baseline: Sequence[str]) -> tuple[str, ...]:
    """Ids of the catalogue that this recording could show and that its model does not hold."""
    return tuple(
        effect_id
        for effect_id, cls in CATALOGUE.items()
        if effect_id not in baseline
        and eligible(cls, o.view.kind, o.view.stimulus, o.rows.sensitivity, known_noise=True)
        and parameters(cls, o.view.stimulus.axis_names)
    )


def _per_sigma(o: Fit, wanted: Sequence[Parameter]) -> Callable[[Effect], Array]:
    return lambda made: scaled_columns(o, made, wanted)


def scaled_columns(o: Fit, effect: Effect, wanted: Sequence[Parameter]) -> Array:
    """Reduced columns (R, p) of an effect per prior sigma of each parameter."""
    X = o.rows.columns(effect, wanted) * np.array([p.sigma for p in wanted])
    return o.reduced(np.nan_to_num(X))


def columns_at(o: Fit, c: Candidate, constants: Constants) -> Array:
    """Reduced columns (R, p) of a cause at these non-linear constants, per prior sigma."""
    return scaled_columns(o, absent_effect(c.effect, o.view.stimulus, c.source, **dict(constants)), c.parameters)
