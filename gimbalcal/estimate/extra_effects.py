"""Effects of the catalogue that a user adds to a fit by name, `--with EFFECT[:AXIS][,CONSTANT=VALUE]`.

Their sizes join the fit under a prior so wide that it holds nothing back. A nonlinear constant (a time constant, an
order) is held where it is stated, in the unit of the catalogue. Else it is one of the parameters of the fit, with all
correlations, and starts at the value of the catalogue's grid that fits best; a whole number, a position or an instant
has no derivative and stays there.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, known_effect, parameters, zero_effect
from gimbalcal.effects.effect import Grid, constants, followed_covariate
from gimbalcal.effects.grids import Constant, grid, kind, limits, range_beyond
from gimbalcal.errors import InputError
from gimbalcal.forward import Rows
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.units import to_si

WhyNotShown = Callable[[type[Effect]], str]  # `Recording.why_not_shown`
PRIOR_FACTOR = 1e4  # times the catalogue's prior, which is of navigation grade: what is asked for is fitted, not held


@dataclass(frozen=True)
class ExtraEffect:
    """One effect to add: its axes (none: all of them), stated constants in SI, and the channel that it follows."""

    effect: str
    axes: tuple[str, ...] = ()
    stated: tuple[tuple[str, float], ...] = ()
    covariate: str = ""

    def parameters(self, gimbals: Sequence[str]) -> tuple[Parameter, ...]:
        """Its linear parameters on a platform with these gimbals, under a wide prior."""
        every = parameters(CATALOGUE[self.effect], gimbals)
        return tuple(
            replace(p, sigma=PRIOR_FACTOR * p.sigma) for p in every if not self.axes or _is_of_axes(p, self.axes)
        )

    def absent(self, gimbals: Sequence[str] = (), values: Mapping[str, float] | None = None) -> Effect:
        """The effect with zero parameters and these constants, by default the stated ones."""
        named: dict[str, Any] = dict(self.stated if values is None else values.items())
        if self.covariate:
            named["covariate"] = self.covariate
        return replace(zero_effect(CATALOGUE[self.effect], gimbals), **named)

    @property
    def free(self) -> tuple[Constant, ...]:
        """The constants that nobody stated."""
        return tuple(f for f in constants(CATALOGUE[self.effect]) if f.name not in dict(self.stated))


def as_option(effect: str, axis: str) -> str:
    """Return an effect of an axis as --with takes it; one that acts on several axes together is asked for on all."""
    return f"{effect}:{axis}" if axis and "," not in axis else effect


def extra_effects(
    words: Sequence[str], recordings: Sequence[Recording], held: Sequence[str] = ()
) -> tuple[ExtraEffect, ...]:
    """Return the effects that these words ask for; `held`: effects that the model has anyway.

    Raises InputError for a misspelt effect, axis or constant, and for an effect that none of the recordings can show.
    """
    out: dict[str, ExtraEffect] = {}
    for word in words:
        name, *settings = (part.strip() for part in word.split(","))
        effect, _, axis = name.partition(":")
        if bad := next((s for s in settings if "=" not in s), ""):
            raise InputError(f"--with {word}: {bad!r} is no CONSTANT=VALUE; write EFFECT[:AXIS][,CONSTANT=VALUE]")
        stated = {constant.strip(): value for constant, _, value in (s.partition("=") for s in settings)}
        extra = _extra_effect(word, effect, axis, stated, recordings, held)
        before = out.get(effect)
        if before is not None:
            axes = (*before.axes, *extra.axes) if before.axes and extra.axes else ()
            extra = replace(extra, axes=axes, stated=tuple(dict([*before.stated, *extra.stated]).items()))
        out[effect] = extra
    return tuple(out.values())


def _extra_effect(
    said: str, effect: str, axis: str, settings: Mapping[str, str], recordings: Sequence[Recording], held: Sequence[str]
) -> ExtraEffect:
    cls = known_effect(effect, f"--with {said}")
    if effect in held:
        raise InputError(f"--with {said}: {effect} is in the model of this method anyway; leave it out")
    reasons = [r.why_not_shown(cls) for r in recordings]
    if all(reasons):
        raise InputError(f"--with {said}: {effect} {reasons[0]}")
    gimbals = recordings[0].platform.axis_names
    every = parameters(cls, gimbals)
    if not every:
        raise InputError(f"--with {said}: {effect} is of gimbals, and {recordings[0].title!r} has none")
    extra = ExtraEffect(
        effect,
        (axis,) if axis else (),
        _stated_constants(said, cls, settings),
        _logged_covariate(said, cls, [a for r in recordings for a in r.axes("covariate")]),
    )
    if not extra.parameters(gimbals):
        axes = ", ".join(dict.fromkeys(p.axis for p in every if p.axis)) or "no axes"
        raise InputError(f"--with {said}: {effect} has no axis {axis!r}; it has {axes}")
    return extra


def _stated_constants(said: str, cls: type[Effect], settings: Mapping[str, str]) -> tuple[tuple[str, float], ...]:
    known = {f.name: f for f in constants(cls)}
    out = []
    for name, text in settings.items():
        if name not in known:
            has = ", ".join(f"{f.name} [{f.metadata['unit']}]" for f in known.values()) or "none"
            raise InputError(f"--with {said}: {cls.id} has no constant {name!r}; it has {has}")
        f = known[name]
        try:
            value = float(to_si(float(text), f.metadata["unit"]))
        except ValueError:
            raise InputError(f"--with {said}: {name} must be a number in {f.metadata['unit']}, got {text!r}") from None
        if ends := range_beyond(f, value):
            raise InputError(f"--with {said}: {name} lies between {' and '.join(ends)} {f.metadata['unit']}")
        out.append((name, value))
    return tuple(out)


def _logged_covariate(said: str, cls: type[Effect], logged: Sequence[str]) -> str:
    """The one covariate that was logged, for an effect that follows any of them."""
    if followed_covariate(cls) != "":
        return ""
    logs = list(dict.fromkeys(logged))
    if len(logs) != 1:
        raise InputError(f"--with {said}: {cls.id} follows one covariate, and there are {len(logs)}: keep one column")
    return logs[0]


def _is_of_axes(p: Parameter, axes: Sequence[str]) -> bool:
    """Return whether a parameter is of one of these axes: "xy" is x's, "equatorial_x" is equatorial."""
    pair = len(p.axis) == 2 and set(p.axis) <= set("xyz")
    return any(a in (p.axis, p.axis[0] if pair else p.axis.rpartition("_")[0] or p.axis) for a in axes)


@dataclass(frozen=True)
class Extension:
    """The extension of a fit by extra effects: effects with starting constants, free parameters, and fixed constants.

    parameters: the sizes, and of the constants those that a fit can follow, whose prior mean is where the fit starts.
    fixed: constants that were stated, or that have no derivative (a whole number, a position, an instant), in SI.
    """

    effects: tuple[Effect, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    fixed: Mapping[Parameter, float] = field(default_factory=dict)

    @property
    def constants(self) -> tuple[Parameter, ...]:
        """The free constants among the parameters."""
        smooth = {(e.id, f.name) for e in self.effects for f in constants(type(e))}
        return tuple(p for p in self.parameters if (p.effect, p.field) in smooth)

    def shown(self, why_not: WhyNotShown) -> Extension:
        """The part that a recording can show."""
        shown = tuple(e for e in self.effects if not why_not(type(e)))
        ids = {e.id for e in shown}
        return Extension(shown, tuple(p for p in self.parameters if p.effect in ids), self.fixed)

    def complete(self, result: Calibration) -> Calibration:
        """The calibration with the fixed constants among its parameters; a fixed constant has sigma zero."""
        parameters = tuple(replace(p, mean=0.0) for p in (*result.parameters, *self.fixed))
        P = np.zeros((len(parameters),) * 2)
        n = len(result.parameters)
        P[:n, :n] = result.covariance
        return replace(result, parameters=parameters, covariance=P)


NO_EXTENSION = Extension()

Cost = Callable[[Sequence[Effect]], float]
"""Chi^2 of the best fit with the sizes of these absent effects free."""


def extension(more: Sequence[ExtraEffect], sizes: Sequence[Parameter], s: Stimulus, cost: Cost) -> Extension:
    """The extra effects as a fit takes them: constants that nobody stated start at the best value of their grid.

    sizes: the free linear parameters of the effects. One effect after the other, with the others at what they have:
    constants of two effects are rarely confounded.
    """
    values: dict[str, dict[str, float]] = {
        e.effect: {f.name: float(np.median(grid(f, s))) for f in e.free} | dict(e.stated) for e in more
    }

    def effects(trial: Mapping[str, Mapping[str, float]]) -> tuple[Effect, ...]:
        return tuple(e.absent(s.axis_names, trial[e.effect]) for e in more)

    for e in (e for e in more if e.free):
        grids = itertools.product(*(_starting_values(f, s) for f in e.free))
        trials = [dict(zip((f.name for f in e.free), point, strict=True)) for point in grids]
        costs = [cost(effects({**values, e.effect: {**values[e.effect], **trial}})) for trial in trials]
        values[e.effect] |= trials[int(np.argmin(costs))]
    fitted, fixed = [], {}
    for e in more:
        parameter_of = {p.field: p for p in parameters(CATALOGUE[e.effect], s.axis_names, constants=True)}
        for f in constants(CATALOGUE[e.effect]):
            value, (low, high) = values[e.effect][f.name], limits(f, s)
            if f in e.free and kind(f).smooth and low < high:
                fitted.append(replace(parameter_of[f.name], mean=value))
            else:
                fixed[parameter_of[f.name]] = value
    return Extension(effects(values), (*sizes, *fitted), fixed)


def _starting_values(f: Constant, s: Stimulus) -> list[float]:
    """The grid of a constant; of a whole number all values, as nothing lies between two."""
    if kind(f) is Grid.WHOLE:
        low, high = limits(f, s)
        return np.arange(low, high + 0.5).tolist()
    return grid(f, s).tolist()


def sizes_shown(more: Sequence[ExtraEffect], why_not: WhyNotShown, gimbals: Sequence[str]) -> tuple[Parameter, ...]:
    """The linear parameters of those effects that a recording on a platform with these gimbals can show."""
    return tuple(p for e in more if not why_not(CATALOGUE[e.effect]) for p in e.parameters(gimbals))


def columns_of_sizes(rows: Rows, effects: Sequence[Effect], sizes: Sequence[Parameter]) -> Array:
    """Derivatives (n, C, p) of rows by sizes: those of absent effects, zero for any other."""
    out = np.zeros((*rows.residual.shape, len(sizes)))
    for e in effects:
        at = [i for i, p in enumerate(sizes) if p.effect == e.id]
        out[..., at] = rows.columns(e, [sizes[i] for i in at])
    return out
