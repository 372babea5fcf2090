"""Every cause that a view of a recording could show, as columns, and shapes that stand for "none of these"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.library.candidates import (
    Candidate,
    Constants,
    Variant,
    appended_to,
    choices,
    eligible,
    of_effect,
    sources,
)
from gimbalcal.diagnose.library.shapes import polynomials, unit_rms
from gimbalcal.diagnose.rows.views import View
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters
from gimbalcal.effects.effect import constants
from gimbalcal.forward import Rows
from gimbalcal.number import Array


def causes(v: View, present: Sequence[Effect], modelled: Sequence[Parameter]) -> tuple[tuple[Candidate, ...], Array]:
    """Everything that could still be missing, and its columns (n, C, P) per prior sigma."""
    blocks: list[Array] = []
    found: list[Candidate] = []
    rows = v.rows(present)
    for effect_id in available(v):
        found += _of_effect(v, effect_id, rows, modelled, blocks)
    strange = shapes_of(v, rows.residual, blocks)
    return (*found, *strange), np.concatenate(blocks, axis=-1)


def available(v: View) -> tuple[str, ...]:
    """Ids of the catalogue that act on these rows and whose channels were recorded."""
    return tuple(
        effect_id
        for effect_id, cls in CATALOGUE.items()
        if eligible(cls, v.recording.kind, v.stimulus, v.stages, known_noise=False)
    )


def unknowns(v: View, effect_id: str) -> tuple[Parameter, ...]:
    """Parameters of an effect, without those of gimbals that were not read and those that these rows cannot show."""
    names, read = v.stimulus.axis_names, v.recording.axes("gimbal_angle")
    found = parameters(CATALOGUE[effect_id], names)
    seen = (p for p in found if (p.axis not in names or p.axis in read) and (p.effect, p.axis) not in v.unobservable)
    return tuple(replace(p, sigma=v.wide * p.sigma) for p in seen)


def _of_effect(
    v: View, effect_id: str, rows: Rows, modelled: Sequence[Parameter], blocks: list[Array]
) -> list[Candidate]:
    """Candidates of what the model does not hold of an effect; with the constants it has there, if it has some."""
    cls = CATALOGUE[effect_id]
    there = next((e for e in rows.effects if e.id == effect_id), None)
    had = {(p.effect, p.field, p.axis) for p in modelled}
    wanted = [p for p in unknowns(v, effect_id) if (p.effect, p.field, p.axis) not in had]
    scale = np.array([p.sigma for p in wanted])

    def columns(made: Effect) -> Array:
        return np.nan_to_num(rows.columns(made if there is None else there, wanted) * scale)

    tried = choices(cls, v.stimulus) if there is None else [constants_of(there)]
    out: list[Candidate] = []
    for source in sources(cls, v.stimulus) if wanted else ():
        if there is None or source == (getattr(there, "covariate", "") if source else ""):
            out += of_effect(cls, source, wanted, tried, v.stimulus, columns, blocks)
    return out


def constants_of(e: Effect) -> Constants:
    """The non-linear constants of an effect."""
    return tuple((f.name, float(getattr(e, f.name))) for f in constants(type(e)))


def shapes_of(v: View, misfit: Array, blocks: list[Array]) -> tuple[Candidate, ...]:
    """What is no cause, its columns (n, C, p), per rms of the misfit (n, C), appended to `blocks`.

    Smooth in time in each channel; smooth in the direction of gravity, or harmonics of the gimbal angles.
    """
    rms = float(np.sqrt(np.mean(misfit**2)))
    n, C = len(v.recording.time), len(v.channels)
    t = v.recording.time - v.recording.time[0]
    bases = {"time": ("a smooth function of time", np.cos(np.pi * np.outer(t / (t[-1] or 1.0), np.arange(1, 9))))}
    if v.name == "pointing":
        bases |= _angle_harmonics(v)
    elif v.name != "table":
        basis = polynomials(v.stimulus.force / v.stimulus.gravity)
        bases["orientation"] = ("a smooth function of the direction of gravity", basis)
    out = []
    for name, (words, basis) in bases.items():
        scaled = rms * unit_rms(basis)
        for c, (quantity, axis) in enumerate(v.channels):
            X = np.zeros((n, C, basis.shape[1]))
            X[:, c] = scaled
            span = tuple(appended_to(blocks, X))
            out.append(Candidate(f"unknown {name}", axis, (), (Variant((), span),), words, channel=quantity))
    return tuple(out)


def _angle_harmonics(v: View) -> dict[str, tuple[str, Array]]:
    """Harmonics 2 to 6 of each gimbal angle that moves."""
    out = {}
    for i, axis in enumerate(v.stimulus.axis_names):
        angle = v.stimulus.readout[:, i]
        if np.ptp(angle) > 1e-2:
            basis = np.stack([f(k * angle) for k in range(2, 7) for f in (np.cos, np.sin)], axis=-1)
            words = axis.replace("_", " ").removesuffix(" angle") + " angle"
            out[words] = (f"a pattern in the {words}, twice per turn and faster", basis)
    return out
