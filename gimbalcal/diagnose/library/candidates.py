r"""Every cause that could be missing, as columns: the catalogue, and the five rivals that stand for "none of these".

One candidate is one effect on one axis (or on all its axes together), with all its linear parameters. A non-linear
constant (lag, epoch, period, place) is a grid of variants; each variant carries an equal share of the candidate's
prior, so that the search is paid for.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.library.shapes import products, settings, shapes, turns, unit_rms
from gimbalcal.diagnose.rows.baseline import follows, logged
from gimbalcal.diagnose.rows.observations import Observations, absent_effect
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, parameters
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.number import Array

SHAPES = ("encoder_harmonic", "encoder_cyclic_error", "readout_curve", "setting_error")  # say a shape, not a cause
RANDOM = ("slow_bias_drift",)  # realisations of what is integrated over as noise where the noise is stated
JOINT = ("position_blunder",)  # effects whose parameters are one vector
CARRIED = ("kappa_3", "kappa_4", "l", "K_pp")  # a second mechanism of the same effect: a candidate of its own
TWOFOLD = ("gimbal_flexure", "post_move_creep", "cross_axis_product")
SINGLE_AXES = ("x", "y", "z", "platform", "inner", "middle", "outer")
GRID = 7  # values of a non-linear constant before refinement
ORDERS = {"m": (1.0, 2.0)}  # whole-number constants: what a bearing does


@dataclass(frozen=True, eq=False)
class Variant:
    """One choice of the non-linear constants, and where its columns stand in the library."""

    constants: tuple[tuple[str, float], ...]
    index: tuple[int, ...]
    weight: float = 1.0  # share of the candidate's prior, up to their sum
    column: Array | None = None  # (n, C) per prior sigma, of an effect that bends with its size


@dataclass(frozen=True)
class Candidate:
    """A cause: catalogue id or rival, axis, linear parameters, and variants of its non-linear constants."""

    effect: str
    axis: str
    parameters: tuple[Parameter, ...]
    variants: tuple[Variant, ...]
    rival: str = ""  # in words, what an unknown of this shape depends on
    source: str = ""  # the covariate behind it
    channel: str = "specific_force"

    @property
    def label(self) -> str:
        """Readable name, "bias_drift:x"."""
        return f"{self.effect}:{self.axis}" if self.axis else self.effect


def groups(wanted: Sequence[Parameter], effect_id: str) -> dict[str, tuple[Parameter, ...]]:
    """Parameters by axis: "xy" belongs to x, "equatorial_x" to equatorial; all together if there are several."""
    if effect_id in JOINT:
        return {"": tuple(wanted)}
    out: dict[str, list[Parameter]] = {}
    own = [p for p in wanted if p.effect not in TWOFOLD or p.field not in CARRIED]
    for p in own:
        axis = p.axis.split("_")[0]
        axis = axis[0] if len(axis) == 2 and set(axis) <= set("xyz") else axis
        out.setdefault(axis, []).append(p)
    if len(out) > 1:
        out[", ".join(out)] = own
    return {axis: tuple(ps) for axis, ps in out.items()}


def available(o: Observations, baseline: Sequence[str]) -> tuple[str, ...]:
    """Ids of the catalogue that this recording could show."""
    out = []
    for effect_id, cls in CATALOGUE.items():
        if effect_id in (*SHAPES, *RANDOM, *baseline) or cls.stage not in o.sensitivity or o.kind not in cls.kinds:
            continue
        if logged(o.recording, cls) and parameters(cls, o.stimulus.axis_names):
            out.append(effect_id)
    return tuple(out)


def constant_fields(effect_id: str) -> tuple[dataclasses.Field[float], ...]:
    """Non-linear constants of an effect."""
    return tuple(f for f in dataclasses.fields(CATALOGUE[effect_id]) if f.metadata.get("kind") == "constant")


def limits(f: dataclasses.Field[float], o: Observations) -> tuple[float, float]:
    """Range of a constant that this recording could tell apart."""
    low, high = float(f.metadata["low"]), float(f.metadata["high"])
    time = o.stimulus.time
    if f.name in ("tau", "period"):
        low = max(low, 2 * float(np.median(np.diff(time)))) if f.name == "period" else low
        high = min(high, 3 * float(time[-1]))
    return (low, high) if low < high else (low, low)


def grid(effect_id: str, f: dataclasses.Field[float], o: Observations) -> Array:
    """Starting values of a constant: the places where something can happen, or even steps of its logarithm."""
    if f.name == "position":
        return np.unique(o.stimulus.position).astype(float)
    if f.name in ORDERS:
        return np.array(ORDERS[f.name])
    if f.name == "epoch":
        time, visit = o.stimulus.time, o.stimulus.visit
        starts = time[np.flatnonzero(np.diff(visit)) + 1]
        return starts - 1e-3 if len(starts) else np.linspace(0, time[-1], 50)[1:-1]
    low, high = limits(f, o)
    if f.name == "damping":
        return np.concatenate([[low], np.geomspace(1 / float(o.stimulus.time[-1]), high, 5)])
    if f.name in CATALOGUE[effect_id].steps:
        return np.unique(np.round(np.geomspace(low, high, GRID)))
    if f.name == "period":
        return period_grid(_usual(f), low, high, float(o.stimulus.time[-1]))
    return np.geomspace(low, high, GRID) if low > 0 else np.linspace(low, high, GRID)


def _usual(f: dataclasses.Field[float]) -> float:
    return f.default if isinstance(f.default, float) else 0.0


def period_grid(usual: float, low: float, high: float, duration: float) -> Array:
    """The usual period, and others within 5 % of it one third of a line width apart (at most 9)."""
    low, high = max(low, 0.95 * usual), min(high, 1.05 * usual)
    step = usual**2 / duration / 3
    m = min(4, int((high - low) / 2 / step)) if step > 0 else 0
    return usual + step * np.arange(-m, m + 1) if low < high else np.array([usual])


@dataclass(frozen=True)
class Library:
    """All candidates and their reduced columns X (R, P), in units of prior sigmas."""

    candidates: tuple[Candidate, ...]
    X: Array


def library(o: Observations, baseline: Sequence[str]) -> Library:
    """Every cause that this recording could show and every rival."""
    blocks: list[Array] = []
    known = _catalogue(o, baseline, blocks)
    unknown = rivals(o, blocks)
    return Library(tuple(known + unknown), np.concatenate(blocks, axis=1))


def _append(blocks: list[Array], X: Array) -> range:
    at = sum(b.shape[1] for b in blocks)
    blocks.append(X)
    return range(at, at + X.shape[1])


def _catalogue(o: Observations, baseline: Sequence[str], blocks: list[Array]) -> list[Candidate]:
    out: list[Candidate] = []
    for effect_id in available(o, baseline):
        for source in sources(effect_id, o):
            out += _of_effect(o, effect_id, source, blocks)
    return out


def sources(effect_id: str, o: Observations) -> tuple[str, ...]:
    """Names of the recorded covariates for an effect that follows any of them, else the empty name.

    What an effect of its own says of a channel (pressure, supply_voltage) need not be said by bias_covariate as well.
    """
    if follows(CATALOGUE[effect_id]) != "":
        return ("",)
    own = {need for cls in CATALOGUE.values() for need in cls.requires} if effect_id == "bias_covariate" else set()
    return tuple(name for name in o.stimulus.covariates if f"covariate:{name}" not in own)


def _of_effect(o: Observations, effect_id: str, source: str, blocks: list[Array]) -> list[Candidate]:
    cls = CATALOGUE[effect_id]
    wanted = parameters(cls, o.stimulus.axis_names)
    fields = constant_fields(effect_id)
    made: list[tuple[tuple[tuple[str, float], ...], range, Array]] = []
    for values in itertools.product(*(grid(effect_id, f, o).tolist() for f in fields)):
        named = tuple((f.name, v) for f, v in zip(fields, values, strict=True))
        X = scaled_columns(o, absent_effect(effect_id, o.stimulus, source, **dict(named)), wanted)
        made.append((named, _append(blocks, X), X))
    shares = list(groups(wanted, effect_id).items())
    shares += [
        (a, tuple(q for q in wanted if effect_id in TWOFOLD and q.field in CARRIED and q.axis == a))
        for a in SINGLE_AXES
    ]
    out = []
    for axis, chosen in [(a, ps) for a, ps in shares if ps]:
        index = [wanted.index(p) for p in chosen]
        if max(np.abs(X[:, index]).max(initial=0) for _, _, X in made) > 0:
            variants = tuple(Variant(named, tuple(at[i] for i in index)) for named, at, _ in made)
            out.append(Candidate(effect_id, axis, chosen, variants, channel=cls.channel, source=source))
    return out


def scaled_columns(o: Observations, effect: Effect, wanted: Sequence[Parameter]) -> Array:
    """Reduced columns (R, p) of an effect per prior sigma of each parameter."""
    X = o.columns(effect, wanted) * np.array([p.sigma for p in wanted])
    return o.reduce(np.nan_to_num(X))


def columns_at(o: Observations, c: Candidate, constants: Sequence[tuple[str, float]]) -> Array:
    """Reduced columns (R, p) of a cause at these non-linear constants, per prior sigma."""
    return scaled_columns(o, absent_effect(c.effect, o.stimulus, c.source, **dict(constants)), c.parameters)


# --- the rivals: shapes without a cause -------------------------------------------------------------------------------

ALIKE = 0.97  # correlation from which a simple law is one that the catalogue has
SLOWEST = 2000  # reduced rows on which that is judged: all of 18 positions, the slowest of a static run
RIVAL_SIGMA = 3.0  # prior size of one shape, in sigmas of a row: mixed over 0.1 to 100 like every other


def rivals(o: Observations, blocks: list[Array]) -> list[Candidate]:
    """Free per position, smooth in orientation, in time, in temperature, gimbal harmonics; and simple laws."""
    out: list[Candidate] = []
    axes = _outputs(o)
    for name, (words, basis) in shapes(o).items():
        scaled = unit_rms(basis)
        every: list[int] = []
        for axis, along in axes:
            X = np.stack([along * b[:, None] for b in scaled.T], axis=-1)
            at = tuple(_append(blocks, o.reduce(X) * RIVAL_SIGMA))
            every += at
            out.append(Candidate(f"unknown {name}", axis, (), (Variant((), at),), rival=words))
        if len(axes) > 1:
            together = ", ".join(axis for axis, _ in axes)
            out.append(Candidate(f"unknown {name}", together, (), (Variant((), tuple(every)),), rival=words))
    return out + gimbal_harmonics(o, blocks) + _simple_laws(o, blocks)


def _simple_laws(o: Observations, blocks: list[Array]) -> list[Candidate]:
    """Products and powers of what was recorded, as outputs of one accelerometer, less those that have a cause."""
    Q = orthonormal(o.reduce(o.Z)[:SLOWEST])

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
                X = o.reduce(along[:, :, None] * unit_rms(basis)[:, None, :])
                if X.any() and np.abs(known.T @ unit(X)).max(axis=0).min() < ALIKE:
                    variants.append(Variant((), tuple(_append(blocks, X * RIVAL_SIGMA))))
            if variants:
                out.append(Candidate(f"unknown {name}", axis, (), tuple(variants), rival=words))
    return out


def _outputs(o: Observations) -> list[tuple[str, Array]]:
    """What one unit (a sigma of a row) added to each accelerometer that was logged does to all channels, (n, C)."""
    S = o.sensitivity[Stage.ACCELEROMETER]
    out = []
    for k, (quantity, axis) in enumerate(o.channels):
        if quantity == "specific_force":
            along = S[:, :, "xyz".index(axis)]
            out.append((axis, along / np.abs(along[:, k]).max()))
    return out


def gimbal_harmonics(o: Observations, blocks: list[Array]) -> list[Candidate]:
    """Errors of each moving gimbal that no bearing or encoder has: high harmonics, or a value at each setting."""
    out = []
    for i, axis in enumerate(o.stimulus.axis_names):
        harmonics = turns(o.seen[Stage.ENCODER].angle[:, i])
        words = f"a third or higher harmonic of the {axis} gimbal angle"
        out += _of_gimbal(o, i, "unknown gimbal angle", words, harmonics, blocks)
        words = f"a value of its own at each setting of the {axis} gimbal"
        out += _of_gimbal(o, i, "unknown gimbal setting", words, settings(o.stimulus.readout[:, i]), blocks)
    return out


def _of_gimbal(
    o: Observations, i: int, effect: str, words: str, bases: Sequence[Array], blocks: list[Array]
) -> list[Candidate]:
    variants = []
    for basis in bases:
        added = np.zeros((*basis.shape, len(o.stimulus.axis_names)))
        added[:, :, i] = basis
        X = np.stack([o.through(Stage.ENCODER, added[:, j]) for j in range(basis.shape[1])], axis=-1)
        size = np.abs(X).max()
        if size > 0:
            variants.append(Variant((), tuple(_append(blocks, o.reduce(X / size) * RIVAL_SIGMA))))
    axis = o.stimulus.axis_names[i]
    made = Candidate(effect, axis, (), tuple(variants), rival=words, channel="gimbal_angle")
    return [made] if variants else []
