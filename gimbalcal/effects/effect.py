"""The contract of a physical effect: parameters, one contribution, a card.

An effect is a frozen dataclass whose fields are its parameter values and whose single method `contribution` returns
what it adds at its stage of the forward model; one that remembers may give its states (`dynamics`) instead. Zero means
absent. Contributions of one stage add, so their order cannot matter. A truth, a prior and an estimate are the same
type: a tuple of effects.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from enum import Enum
from typing import Any, ClassVar, TypeVar, dataclass_transform

import numpy as np

from gimbalcal.effects.history import Dynamics, integrated
from gimbalcal.effects.stimulus import REFERENCE_TEMPERATURE
from gimbalcal.effects.stimulus import Stimulus as Stimulus  # noqa: PLC0414 (an effect finds its whole contract here)
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.units import from_si, to_si

TRIAD = ("x", "y", "z")
MATRIX_AXES = tuple(i + j for i in "xyz" for j in "xyz")  # sensor, then component of what acts on it
MISALIGNMENT_AXES = ("xy", "xz", "yz", "yx", "zx", "zy")  # sensor, then the other axis; order of the published betas
PARTNER_AXES = ("xy", "xz", "yx", "yz", "zx", "zy")  # sensor, then the axis that acts with it, row by row
PLATFORM_AXES = ("equatorial_x", "equatorial_y", "polar")  # x, y, z of an inertially fixed platform
GIMBALS = ("gimbals",)  # one entry per axis of the platform at hand
SCALAR = ("",)
MAX_EXTRAPOLATION = 0.05  # of the range in which a law was determined, by which another recording may leave it
NEEDS = ("temperature", "angular_rate", "attitude", "position", "covariate")  # "attitude": gimbals, read or not
EVERY_KIND = ("multi-position", "static-run", "rotation", "pointing")


class Stage(Enum):
    """Stages at which contributions are added, in the order in which the forward model visits the stages."""

    ENCODER = "gimbal angle minus readout [rad], (n, k)"
    AXIS_TILT = "tilt of the next axis out [rad], (n, k, 3)"
    BASE = "rotation of the base against the local level, about north, east, down [rad], (n, 3)"
    PLATFORM = "rotation of the platform against its drawing, in platform axes [rad], (n, 3)"
    GRAVITY = "added to gravity in north, east, down [m/s^2], (n, 3)"
    INPUT_AXIS = "added to the specific force along the accelerometer input axes [m/s^2], (n, 3)"
    SCALE = "added by the scale factor to the force along the input axes [m/s^2], (n, 3)"
    ACCELEROMETER = "added to the accelerometer output [m/s^2], (n, 3)"
    RATE_AXIS = "added to the angular rate along the gyroscope input axes [rad/s], (n, 3)"
    RATE_SCALE = "added by the scale factor to the rate along the input axes [rad/s], (n, 3)"
    GYROSCOPE = "added to the gyroscope output [rad/s], (n, 3)"
    LINE_OF_SIGHT = "rotation of the line of sight against the innermost gimbal, in platform axes [rad], (n, 3)"
    ATTITUDE = "added to the navigator's attitude error, roll, pitch, yaw [rad], (n, 3)"


SENSOR_STAGES = frozenset({Stage.INPUT_AXIS, Stage.SCALE, Stage.ACCELEROMETER})  # of an accelerometer itself
GYROSCOPE_STAGES = frozenset({Stage.RATE_AXIS, Stage.RATE_SCALE, Stage.GYROSCOPE})  # what angular rate passes through


class Grid(Enum):
    """Kinds of a non-linear constant, from which a search for it starts."""

    VALUE = "any value: even steps, of the logarithm where it is positive"
    LAG = "a time constant: even steps of its logarithm, as short as the rows and as long as three recordings tell"
    PERIOD = "a period that is nearly known: within 5 % of it, in steps of a third of a line width"
    DECAY = "a rate at which something dies away: none, and what shows within the recording"
    WHOLE = "a whole number: each one that the angles distinguish, even steps of the logarithm where these are many"
    EPOCH = "an instant: the beginning of each visit, or even steps where nothing moves; it comes once"
    POSITION = "the name of a position: each of them; it comes once"
    SPAN = "the duration of the recording itself"
    FOUND = "a value that a diagnosis found: that one"
    JUMP = "where an output jumps: even steps about where it did, as it has no derivative"

    @property
    def counts(self) -> bool:
        """Return whether nothing lies between two values."""
        return self in (Grid.WHOLE, Grid.POSITION)

    @property
    def smooth(self) -> bool:
        """Return whether outputs follow it smoothly, so that a fit can."""
        return not (self.counts or self.once or self in (Grid.SPAN, Grid.JUMP))

    @property
    def once(self) -> bool:
        """Return whether an effect with such a constant is an event of one recording, of no meaning for another."""
        return self in (Grid.EPOCH, Grid.POSITION)


def parameter(
    axes: Sequence[str], *, unit: str, sigma: float, name: str = "", mechanism: str = "", order: int = 1
) -> Any:
    """Declare a linear parameter of an effect: one value per axis, nominal zero, prior scale `sigma` in `unit`.

    Values are SI inside; `unit` is what people read. `name` is the public name if it is not the field's. Parameters of
    another `mechanism` of the same effect are looked for by themselves; those of a higher `order` are terms of a series
    and are candidates only together with all terms of lower order.
    """
    axes = tuple(axes)
    value = 0.0 if axes == SCALAR else np.zeros(4 if axes == GIMBALS else len(axes))
    return dataclasses.field(
        default_factory=lambda: value,
        metadata={"axes": axes, "unit": unit, "sigma": sigma, "name": name, "mechanism": mechanism, "order": order},
    )


def constant(default: float, *, unit: str, low: float, high: float, grid: Grid = Grid.VALUE) -> Any:
    """Declare a non-linear constant of an effect (time constant, epoch, phase), in SI, between `low` and `high`."""
    return dataclasses.field(
        default=default,
        metadata={"axes": SCALAR, "unit": unit, "low": low, "high": high, "grid": grid},
    )


@dataclass(frozen=True)
class Role:
    """The part an effect plays among the candidate causes of a diagnosis; the default is an ordinary cause.

    excluded: reason why the effect is never a candidate; empty for a candidate.
    noise_realisation: one realisation of a noise process, hence a candidate only where the noise is not stated.
    generic: describes the response to any logged channel, and yields to effects that require a channel by its name.
    indivisible: the parameters form one vector, so that no single axis is a candidate.
    time_drift: a function of the clock alone. Two of these on one axis are one cause, and the prior of the rate grows
        as the recording gets shorter.
    min_duration_s: shortest recording of unstated noise that shows the shape of the effect.
    max_travel_rad: largest range of a gimbal readout over which the effect is a candidate.
    textbook_kinds: kinds of recording that every rig shows the effect in, at some size; the prior of a candidate is
        raised there.
    """

    excluded: str = ""
    noise_realisation: bool = False
    generic: bool = False
    indivisible: bool = False
    time_drift: bool = False
    min_duration_s: float = 0.0
    max_travel_rad: float = np.inf
    textbook_kinds: tuple[str, ...] = ()


@dataclass(frozen=True)
class Domain:
    """The range of a variable in which a law was determined: its name, unit of print and ends, all in that unit.

    value: the variable (n,) of a stimulus, SI.
    """

    name: str
    unit: str
    low: float
    high: float
    value: Callable[[Stimulus], Array]

    def exceeded(self, s: Stimulus) -> str:
        """Return how far a stimulus leaves the range, in words; empty if not, by more than a twentieth of its width."""
        x = np.asarray(self.value(s))
        low, high = (float(from_si(end, self.unit)) if self.unit else float(end) for end in (x.min(), x.max()))
        margin = MAX_EXTRAPOLATION * (self.high - self.low)
        if self.low - margin <= low and high <= self.high + margin:
            return ""
        return (
            f"{self.name.replace('_', ' ')} from {low:.4g} to {high:.4g} {self.unit}".rstrip()
            + f", and it was determined from {self.low:.4g} to {self.high:.4g}"
        )


@dataclass(frozen=True)
class Effect:
    """One imperfection with its parameter values; knows nothing of who calls it."""

    id: ClassVar[str] = ""
    says: ClassVar[str] = ""  # what it does, in plain words: {who} is the sensor or axis, {size} how much
    stage: ClassVar[Stage]
    channel: ClassVar[str] = "specific_force"  # where it first shows
    requires: ClassVar[tuple[str, ...]] = ()  # of `NEEDS`: what a recording must have for the effect to be a candidate
    kinds: ClassVar[tuple[str, ...]] = ("multi-position", "static-run", "rotation")
    sources: ClassVar[tuple[str, ...]] = ()  # keys of references.REFERENCES
    linear: ClassVar[bool] = True  # whether the contribution is linear in the parameters
    spans_rows: ClassVar[bool] = False  # whether the contribution at one row depends on force or angle at other rows
    role: ClassVar[Role] = Role()  # what a diagnosis has to know of it as a candidate cause
    domain: ClassVar[tuple[Domain, ...]] = ()  # where a law without a known cause was determined; empty: everywhere
    gauge: ClassVar[tuple[str, ...]] = ()  # axes that only turn a frame which nothing ties down; zero by convention

    @classmethod
    def shows_in(cls, kind: str) -> bool:
        """Return whether a recording of a kind can show the effect."""
        return kind in cls.kinds

    def contribution(self, s: Stimulus) -> Array:
        """Return what the effect adds at its stage, as `Stage` says; of one that remembers, its states."""
        states = self.dynamics(s)
        if states is None:
            raise NotImplementedError(f"{self.id} has neither a contribution nor states")
        return integrated(states, s.time)

    def dynamics(self, s: Stimulus) -> Dynamics | None:  # noqa: ARG002 (those that remember read it)
        """Return the states of an effect that remembers, which its contribution integrates; None for all others."""
        return None


CATALOGUE: dict[str, type[Effect]] = {}


E = TypeVar("E", bound=Effect)


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(parameter, constant))
def effect(cls: type[E]) -> type[E]:
    """Make a class a frozen dataclass and enter it into the catalogue under its `id`."""
    frozen = dataclass(frozen=True, eq=False)(cls)
    if frozen.id in CATALOGUE:
        raise ValueError(f"two effects are called {frozen.id!r}: {CATALOGUE[frozen.id].__name__} and {frozen.__name__}")
    CATALOGUE[frozen.id] = frozen
    return frozen


@dataclass(frozen=True)
class Parameter:
    """One scalar unknown: which effect, which field, which axis; prior `sigma` and `mean` in SI.

    Every size has prior mean zero; a nonlinear constant has the value from which its fit starts.
    """

    effect: str
    field: str
    name: str
    axis: str
    index: int
    unit: str
    sigma: float
    mean: float = 0.0

    @property
    def label(self) -> str:
        """Readable key, "bias:x"; for an effect of several fields "warm_up.tau:x"."""
        return f"{self.name}:{self.axis}" if self.axis else self.name


def known_effect(name: str, where: str = "") -> type[Effect]:
    """Return the effect of the catalogue with this id. Raises InputError, which proposes a similar one.

    where: the option or the place that names it, with which the sentence begins.
    """
    if name not in CATALOGUE:
        similar = get_close_matches(name, CATALOGUE, 1)
        hint = f"did you mean {similar[0]}?" if similar else "`gimbalcal catalogue` lists them"
        raise InputError(f"{where}{': ' if where else ''}no effect is called {name!r}; {hint}")
    return CATALOGUE[name]


def constants(cls: type[Effect]) -> tuple[dataclasses.Field[float], ...]:
    """Return non-linear constants of an effect; `metadata` of each has unit, low, high and grid."""
    return tuple(f for f in dataclasses.fields(cls) if "grid" in f.metadata)


def without_gauge(wanted: Sequence[Parameter]) -> tuple[Parameter, ...]:
    """Return the parameters without those that only turn a frame to which nothing is tied."""
    return tuple(p for p in wanted if p.axis not in CATALOGUE[p.effect].gauge)


def order_of(p: Parameter) -> int:
    """Return the order of a parameter among the terms of a series, 1 where its effect is no series."""
    fields = CATALOGUE[p.effect].__dataclass_fields__
    return int(fields[p.field].metadata.get("order", 1))


def lacking_quantity(cls: type[Effect], carries: Callable[[str], bool]) -> str:
    """Return first quantity that an effect needs and a stimulus, a recording or a plan does not have; empty if none."""
    return next((need for need in cls.requires if not carries(need)), "")


def followed_covariate(cls: type[Effect]) -> str | None:
    """Return the covariate that an effect follows: its name, the empty name for any logged one, None for no effect."""
    return next((str(f.default) for f in dataclasses.fields(cls) if f.name == "covariate"), None)


def zero_effect(cls: type[Effect], gimbals: Sequence[str] = ()) -> Effect:
    """Return the effect with every parameter zero, sized for a platform with these gimbals."""
    sizes = {f.name: np.zeros(len(gimbals)) for f in dataclasses.fields(cls) if f.metadata.get("axes") == GIMBALS}
    return cls(**sizes)


def parameters(cls: type[Effect], gimbals: Sequence[str] = (), *, constants: bool = False) -> tuple[Parameter, ...]:
    """Return the scalar unknowns of an effect, linear parameters first come in field order."""
    out = []
    for f in dataclasses.fields(cls):
        if not f.metadata or ("grid" in f.metadata and not constants):
            continue
        axes = tuple(gimbals) if f.metadata["axes"] == GIMBALS else f.metadata["axes"]
        unit = f.metadata["unit"]
        if "grid" in f.metadata:
            sigma, name = (f.metadata["high"] - f.metadata["low"]) / 2, f"{cls.id}.{f.name}"
        else:
            sigma, name = float(to_si(f.metadata["sigma"], unit)), f.metadata["name"] or f.name
        out += [Parameter(cls.id, f.name, name, axis, i, unit, sigma) for i, axis in enumerate(axes)]
    return tuple(out)


def parameters_of_effects(ids: Iterable[str], gimbals: Sequence[str] = ()) -> tuple[Parameter, ...]:
    """Return the scalar unknowns of effects of the catalogue, in this order."""
    return tuple(p for i in ids for p in parameters(CATALOGUE[i], gimbals))


def values(effects: Sequence[Effect], wanted: Sequence[Parameter]) -> Array:
    """Return the current values (p,) in SI of the wanted parameters, the prior mean where absent."""
    by_id = {e.id: e for e in effects}
    out = [np.atleast_1d(getattr(by_id[p.effect], p.field))[p.index] if p.effect in by_id else p.mean for p in wanted]
    return np.array(out)


def with_values(
    effects: Sequence[Effect], wanted: Sequence[Parameter], x: Array, gimbals: Sequence[str] = ()
) -> tuple[Effect, ...]:
    """Return the effects with the wanted parameters set to x (p,); effects that were absent are added."""
    by_id, x = {e.id: e for e in effects}, np.asarray(x)
    changes: dict[str, dict[str, Any]] = {}
    for p, value in zip(wanted, x, strict=True):
        if p.effect not in by_id:
            by_id[p.effect] = zero_effect(CATALOGUE[p.effect], gimbals)
        present = by_id[p.effect]
        fields = changes.setdefault(p.effect, {})
        if p.field not in fields:
            old = np.asarray(getattr(present, p.field))
            fields[p.field] = old.astype(np.result_type(old, x))
        if np.ndim(fields[p.field]):
            fields[p.field][p.index] = value
        else:
            fields[p.field] = value
    return tuple(_with_fields(e, changes[i]) if i in changes else e for i, e in by_id.items())


def _with_fields(effect: Effect, changes: Mapping[str, Any]) -> Effect:
    out = object.__new__(type(effect))  # what `dataclasses.replace` does, without a look at every field
    vars(out).update(vars(effect), **changes)
    return out


def equation(cls: type[Effect]) -> str:
    """Return the formula of an effect's card, LaTeX; empty where it has none."""
    match = re.search(r"\.\. math::(.*?)(?:\n\s*\n|\Z)", cls.__doc__ or "", re.DOTALL)
    return " ".join(match[1].split()) if match else ""


def stated_law(cls: type[Effect]) -> dict[str, Any]:
    """Return the meaning of an effect's numbers: its equation, and T0 in degC where it follows the temperature."""
    law: dict[str, Any] = {"effect": cls.id, "equation": equation(cls)}
    return law | ({"T0_degC": REFERENCE_TEMPERATURE} if "temperature" in cls.requires else {})


def happens_once(cls: type[Effect]) -> bool:
    """Return whether an effect is an event of one recording, of no meaning for another."""
    return any(f.metadata["grid"].once for f in constants(cls))
