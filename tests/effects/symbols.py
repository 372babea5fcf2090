"""What the symbols of the cards mean: fields of the effect, definitions, quantities of the stimulus.

Subscripts i, j, k are the channel, the next one and the one after; what has no index is taken for all channels. Values
are (n, 1) for one quantity, (n, 3) or (n, k) for all channels, and `Matrix` for matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from gimbalcal.effects import Effect, Stimulus
from gimbalcal.number import Array
from tests.effects import mount_laws
from tests.effects.sensor_laws import G0, lag, slope, two_sided_rate

Value = Any


@dataclass(frozen=True)
class Scope:
    """What symbols mean: the stimulus, the effect, other names of its fields, definitions, and running indices."""

    s: Stimulus
    effect: Effect
    names: Mapping[str, str]
    defined: Mapping[str, Callable[[Scope], Value]]
    index: Mapping[str, int]

    def at(self, **index: int) -> Scope:
        return Scope(self.s, self.effect, self.names, self.defined, {**self.index, **index})


@dataclass(frozen=True)
class Matrix:
    """A matrix (3, 3), or one for each row (n, 3, 3), that multiplies vectors (3,) or (n, 3)."""

    entries: Array

    def __matmul__(self, vector: Array) -> Array:
        return np.asarray(np.einsum("...ij,...j->...i", self.entries, vector))


@dataclass(frozen=True)
class OfAxes:
    """A unit vector of each gimbal axis (k, 3), in the frame that turns with it."""

    vectors: Array


def area(s: Stimulus, x: Array) -> Array:
    return mount_laws.area(x, s.time)


def late(s: Stimulus, x: Array, tau: float) -> Array:
    return lag(x, s.time, tau)


def _unit(s: Stimulus, around: int) -> Array:
    """Unit vectors (k, 3): the axis of each gimbal, or one of the two across it, cyclic."""
    return np.eye(3)[[("xyz".index(d) + around) % 3 for d in s.axis_directions]]


def _load(s: Stimulus, units: Array) -> Array:
    assert s.load is not None
    return np.asarray(s.gravity * (s.load * units).sum(axis=-1))


def _along_next_inwards(s: Stimulus) -> Array:
    return _load(s, np.concatenate([np.zeros((1, 3)), _unit(s, 0)[:-1]]))


def _excess(s: Stimulus, effect: Any) -> Array:
    c = s.covariates[effect.covariate]
    return np.asarray(c - c.mean())[:, None]


AMONG_STIMULUS: Mapping[str, Callable[[Any, Any], Any]] = {
    "t": lambda s, _: s.time[:, None],
    "t_move": lambda s, _: (s.time - s.since_move)[:, None],
    "f": lambda s, _: s.force,
    "u": lambda s, _: s.force,
    "dot f": lambda s, _: slope(s.force, s.time, s.visit),
    "Delta f": lambda s, _: s.move_force,
    "f^(n-2)": lambda s, _: s.force - s.move_force - s.earlier_move_force,
    "g": lambda s, _: s.gravity,
    "g_0": lambda s, _: G0,
    "pi": lambda s, _: np.pi,
    "omega": lambda s, _: s.rate,
    "Omega": lambda s, _: s.rate,
    "dot omega": lambda s, _: slope(s.rate, s.time, s.visit),
    "dot theta": lambda s, _: slope(s.angle, s.time, s.visit),
    "omega_d": lambda s, _: 2 * np.pi / mount_laws.DAY,
    "omega_ie": lambda s, _: mount_laws.EARTH_RATE,
    "T": lambda s, _: s.temperature[:, None],
    "T_0": lambda s, _: s.reference_temperature,
    "dot T": lambda s, p: two_sided_rate(s.temperature, s.time, p.tau)[:, None],
    "c": lambda s, p: s.covariates[p.covariate][:, None],
    "bar c": lambda s, p: s.covariates[p.covariate].mean(),
    "Delta V": _excess,
    "Delta P": _excess,
    "a_rms": lambda s, _: s.covariates["vibration"][:, None],
    "e": lambda s, _: np.column_stack([s.covariates[f"servo_{axis}"] for axis in "xyz"]),
    "theta": lambda s, _: s.angle,
    "Delta theta": lambda s, _: s.move_angle,
    "p": lambda s, _: s.position[:, None],
    "a": lambda s, _: OfAxes(_unit(s, 0)),
    "e_1": lambda s, _: OfAxes(_unit(s, 1)),
    "e_2": lambda s, _: OfAxes(_unit(s, 2)),
    "g_1^(i)": lambda s, _: _load(s, _unit(s, 1)),
    "g_2^(i)": lambda s, _: _load(s, _unit(s, 2)),
    "g_a(i-1)^(i)": lambda s, _: _along_next_inwards(s),
    "C_n^p": lambda s, _: Matrix(s.attitude),
    "x_p": lambda s, _: np.array([1.0, 0.0, 0.0]),
}


def meaning(name: str, below: str, above: str, e: Scope) -> Value:
    """The value of a symbol: a field of the effect, a definition of the card, or a quantity of the stimulus."""
    parts = [str(e.index[p]) if p == "n" and p in e.index else p for p in below.split(",") if p]
    own = {f.name.replace("_", ""): f for f in fields(e.effect)}
    for indices in range(len(parts) + 1):  # the last part of a subscript may be an index
        labels, rest = parts[len(parts) - indices :], parts[: len(parts) - indices]
        full = "_".join([name, *rest]) + above
        field = own.get(e.names.get(full, full).replace("_", ""))
        if field is not None:
            value, axes = getattr(e.effect, field.name), field.metadata.get("axes", ("",))
            return _of_field(np.asarray(value), axes, "".join(labels), e)
        if full in e.defined or full in AMONG_STIMULUS:
            value = e.defined[full](e) if full in e.defined else AMONG_STIMULUS[full](e.s, e.effect)
            if isinstance(value, OfAxes):
                return value.vectors[_channel(labels[0], e, len(value.vectors))]
            labels = [*labels, *(["i"] if above.endswith("(i)") else [])]
            return value[..., [_channel(labels[0], e, value.shape[-1])]] if labels else value
    raise AssertionError(f"{e.effect.id}: the card's symbol {name}_{below}{above} is neither a field nor known")


def _of_field(value: Array, axes: tuple[str, ...], label: str, e: Scope) -> Value:
    if len(axes) == 9:
        matrix = value.reshape(3, 3)
        whole = [e.index[c] for c in label]
        return Matrix(matrix) if not whole else matrix[tuple(whole)]
    if not label:
        return value
    if label in axes:
        return value[axes.index(label)]
    if len(label) == 2:
        return value[axes.index("".join("xyz"[e.index[c]] for c in label))]
    return value["NED".index(label) if label in "NED" else _channel(label, e, len(value))]


def _channel(label: str, e: Scope, size: int) -> int:
    """i, j, k, i-1, i+1 (the last has no neighbour outwards), or x, y, z."""
    if label in {"x", "y", "z"}:
        return "xyz".index(label)
    return min(e.index[label[0]] + int(label[1:] or 0), size - 1)
