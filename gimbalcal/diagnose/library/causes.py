"""Candidates for a view: effects of the catalogue by axis and constants, and shapes that stand for "none of these"."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.library.candidates import GRID, SHAPES
from gimbalcal.diagnose.library.shapes import polynomials, unit_rms
from gimbalcal.diagnose.rows.baseline import NORTH, follows, logged
from gimbalcal.diagnose.rows.views import View
from gimbalcal.effects import CATALOGUE, Effect, Parameter, absent, parameters
from gimbalcal.number import Array

DAY_PART = {"base_tilt_diurnal": 8 * 3600.0}  # s; shorter, it is base_tilt_drift and nothing else
SKIPPED = (  # nothing that these rows could show, or a part of another candidate
    *SHAPES, "position_blunder", "gravity_error", "frame_misalignment", "vertical_deflection", "clock_rate",
    "torquer_scale_factor", "accelerometer_lever_arm",
)  # fmt: skip


@dataclass(frozen=True)
class Cause:
    """An effect on some of its axes with all its variants, as indices of columns; a shape if `shape` says what of."""

    effect: str
    axis: str
    parameters: tuple[Parameter, ...]
    variants: tuple[tuple[Effect | None, tuple[int, ...]], ...]
    shape: str = ""

    @property
    def label(self) -> str:
        """Readable name."""
        return f"{self.effect}:{self.axis}" if self.axis else self.effect


def causes(v: View, present: Sequence[Effect], modelled: Sequence[Parameter]) -> tuple[tuple[Cause, ...], Array]:
    """Everything that could still be missing, and its columns (n, C, P) per prior sigma."""
    blocks: list[Array] = []
    found: list[Cause] = []
    for effect_id in available(v):
        found += _of_effect(v, effect_id, present, modelled, blocks)
    strange, X = shapes_of(v, present, sum(b.shape[-1] for b in blocks))
    return (*found, *strange), np.concatenate([*blocks, X], axis=-1)


def available(v: View) -> tuple[str, ...]:
    """Ids of the catalogue that act on these rows and whose channels were recorded."""
    out = []
    for effect_id, cls in CATALOGUE.items():
        acts = cls.linear and cls.stage in v.stages and v.recording.kind in cls.kinds and follows(cls) is None
        long_enough = np.ptp(v.recording.time) >= DAY_PART.get(effect_id, 0.0)
        headed = bool(v.recording.platform.axes) or effect_id not in NORTH
        if acts and long_enough and headed and logged(v.recording, cls) and effect_id not in SKIPPED:
            out.append(effect_id)
    return tuple(out)


def unknowns(v: View, effect_id: str) -> tuple[Parameter, ...]:
    """Parameters of an effect, without those of gimbals that were not read and those that a bench cannot see."""
    names, read = v.stimulus.axis_names, v.recording.axes("gimbal_angle")
    found = parameters(CATALOGUE[effect_id], names)
    seen = (p for p in found if (p.axis not in names or p.axis in read) and (p.effect, p.axis) not in v.unseen)
    return tuple(replace(p, sigma=v.wide * p.sigma) for p in seen)


def by_axis(wanted: Sequence[Parameter]) -> dict[str, tuple[Parameter, ...]]:
    """Parameters of each axis ("xy" belongs to x), and all of them together."""
    out: dict[str, list[Parameter]] = {}
    for p in wanted:
        pair = len(p.axis) == 2 and set(p.axis) <= set("xyz")
        out.setdefault(p.axis[0] if pair else p.axis, []).append(p)
    if len(out) > 1:
        out[", ".join(out)] = list(wanted)
    return {axis: tuple(ps) for axis, ps in out.items()}


def _of_effect(
    v: View, effect_id: str, present: Sequence[Effect], modelled: Sequence[Parameter], blocks: list[Array]
) -> list[Cause]:
    had = {(p.effect, p.field, p.axis) for p in modelled}
    wanted = [p for p in unknowns(v, effect_id) if (p.effect, p.field, p.axis) not in had]
    if not wanted:
        return []
    made: list[tuple[Effect | None, int]] = []
    for variant in variants(v, effect_id, present):
        effects = [e for e in present if e.id != effect_id] + [variant]
        X = v.linear(effects, wanted)[1] * np.array([p.sigma for p in wanted])
        made.append((variant, sum(b.shape[-1] for b in blocks)))
        blocks.append(np.nan_to_num(X))
    out = []
    for axis, chosen in by_axis(wanted).items():
        index = [wanted.index(p) for p in chosen]
        if np.abs(blocks[-1][..., index]).max() > 0:
            spans = tuple((variant, tuple(at + i for i in index)) for variant, at in made)
            out.append(Cause(effect_id, axis, tuple(chosen), spans))
    return out


def variants(v: View, effect_id: str, present: Sequence[Effect]) -> list[Effect]:
    """The effect as it is, or absent with each choice of its non-linear constants."""
    there = [e for e in present if e.id == effect_id]
    if there:
        return there
    out = [absent(CATALOGUE[effect_id], v.stimulus.axis_names)]
    for f in dataclasses.fields(out[0]):
        if f.metadata.get("kind") == "constant":
            out = [replace(e, **{f.name: float(x)}) for e in out for x in _grid(v, effect_id, f)]
    return out


def _grid(v: View, effect_id: str, f: dataclasses.Field[float]) -> Array:
    time = v.recording.time - v.recording.time[0]
    low, high = float(f.metadata["low"]), float(f.metadata["high"])
    if f.name == "span":
        return time[-1:]
    if f.name == "epoch":
        return np.asarray((time[1:] + time[:-1]) / 2)[:: max(1, len(time) // 40)]
    if f.name in ("tau", "period"):
        low, high = max(low, float(np.median(np.diff(time)))), min(high, 3 * float(time[-1]))
    if low >= high:
        return np.array([low])
    grid = np.geomspace(low, high, GRID) if low > 0 else np.linspace(low, high, GRID)
    return np.unique(np.round(grid)) if f.name in CATALOGUE[effect_id].steps else grid


def shapes_of(v: View, present: Sequence[Effect], at: int = 0) -> tuple[tuple[Cause, ...], Array]:
    """What is no cause, and its columns (n, C, P), numbered from `at`, per rms of the misfit.

    Smooth in time in each channel; smooth in the direction of gravity, or harmonics of the gimbal angles.
    """
    rms = float(np.sqrt(np.mean(v.linear(present, ())[0] ** 2)))
    n, C = len(v.recording.time), len(v.channels)
    t = v.recording.time - v.recording.time[0]
    bases = {"time": ("a smooth function of time", np.cos(np.pi * np.outer(t / t[-1], np.arange(1, 9))))}
    if v.name == "pointing":
        bases |= _angle_harmonics(v)
    elif v.name != "table":
        basis = polynomials(v.stimulus.force / v.stimulus.gravity)
        bases["orientation"] = ("a smooth function of the direction of gravity", basis)
    out, blocks = [], []
    for name, (words, basis) in bases.items():
        scaled = rms * unit_rms(basis)
        for c, (_, axis) in enumerate(v.channels):
            X = np.zeros((n, C, basis.shape[1]))
            X[:, c] = scaled
            at += basis.shape[1]
            blocks.append(X)
            out.append(Cause(f"unknown {name}", axis, (), ((None, tuple(range(at - basis.shape[1], at))),), words))
    return tuple(out), np.concatenate(blocks, axis=-1)


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
