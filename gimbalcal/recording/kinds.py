"""Kinds of recording: whatever depends on how a unit was tested stands here, once per kind.

A `Kind` is its name in recording.toml, a string, with the properties of that kind. It compares, prints and serialises
as the string; code asks for the property that it depends on, as in ``recording.kind.stabilised``. Several kinds may
have one name, as a unit on gimbals and one in the hand: `when` distinguishes them. To add a kind, add an instance to
`EVERY`; one with a `view` is calibrated and diagnosed with no other edit, in a noise of known or of estimated scale.
Effects name the kinds in which they show, so that a new way to measure keeps the name of a kind, has a `when`, and
stands before the kind that it specialises.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING

from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS, BASELINE
from gimbalcal.platform import Platform

if TYPE_CHECKING:
    from gimbalcal.recording.record import Key, Recording
    from gimbalcal.views.core import View


@dataclass(frozen=True, eq=False, repr=False)
class Kind(str):
    """A kind of recording: a string, its name in recording.toml, with what follows from how the unit was tested.

    in_positions: the unit is held in one position after the other, and its rows are numbered by position;
    stabilised: the platform keeps its attitude in inertial space while the Earth turns beneath it;
    rotating: the unit is turned in its place, and its angular rate is integrated over every step of the clock;
    sighting: a mount points at stars of known direction, and no inertial sensor is read.
    methods: names of the methods that calibrate it, the preferred one first. baseline: the effects that its calibrated
    model holds. predicted: the quantities that the forward model predicts at the readings. measured_by: the sensor
    whose stated noise weighs its rows. extended_by: what more of it would be, in words. view: "module:function" of the
    one view that a recording makes, from the recording and the ids of effects that its model holds; empty where a
    recording makes several.
    """

    name: str
    methods: tuple[str, ...]
    baseline: tuple[str, ...]
    predicted: tuple[str, ...]
    in_positions: bool = False
    stabilised: bool = False
    rotating: bool = False
    sighting: bool = False
    measured_by: str = "accelerometer"
    extended_by: str = "positions"
    view: str = ""
    when: Callable[[Platform, Container[Key]], bool] | None = None  # of platform and channels; None: where no other is

    def __new__(cls, name: str, *_: object, **__: object) -> Kind:
        return super().__new__(cls, name)

    def view_of(self, recording: Recording, baseline: Sequence[str] = ()) -> View:
        """Return the view of a recording of this kind."""
        module, _, name = self.view.partition(":")
        view: View = getattr(import_module(module), name)(recording, baseline)
        return view

    @property
    def inertial(self) -> bool:
        """Return whether inertial sensors are read."""
        return not self.sighting

    @property
    def at_rest(self) -> bool:
        """Return whether the force is measured at rest: the unit is held in positions, or stabilised."""
        return self.in_positions or self.stabilised

    @property
    def continuous(self) -> bool:
        """Return whether the time between rows is part of the physics, so that the clock may not pause."""
        return self.stabilised or self.rotating

    @property
    def weighed(self) -> bool:
        """Return whether its estimators weigh rows by the samples, or the sigma, behind each."""
        return not self.rotating


MULTI_POSITION = Kind(
    "multi-position",
    methods=("rate-table", "three-stage"),
    baseline=BASELINE["multi-position"],
    predicted=("specific_force",),
    in_positions=True,
)
"""A unit on gimbals that is held in one position after the other."""


HAND_TURNED = Kind(
    "multi-position",
    methods=("multiposition", "three-stage"),
    baseline=ACCELEROMETER_TERMS,
    predicted=("specific_force",),
    in_positions=True,
    when=lambda platform, _: not platform.axes,
)
"""A unit without gimbals that is laid down in one position after the other: only the norm of gravity is known."""

STATIC_RUN = Kind(
    "static-run",
    methods=("rate-table", "three-stage"),
    baseline=BASELINE["static-run"],
    predicted=("specific_force", "gimbal_angle", "attitude_error"),
    stabilised=True,
    extended_by="hours",
)
"""An inertially stabilised platform that is left alone for hours."""

ROTATION = Kind(
    "rotation",
    methods=("rate-table", "attitude", "systematic", "three-stage"),
    baseline=BASELINE["rotation"],
    predicted=("specific_force",),
    rotating=True,
)
"""A unit that is turned in its place, with or without stops."""

POINTING = Kind(
    "pointing",
    methods=("pointing",),
    baseline=BASELINE["pointing"],
    predicted=(),
    sighting=True,
    measured_by="gimbal_angle",
    extended_by="stars",
    view="gimbalcal.views.pointing:pointing",
)
"""A mount that points at stars."""

EVERY = [HAND_TURNED, MULTI_POSITION, STATIC_RUN, ROTATION, POINTING]
"""All kinds; of those of one name the first that suits a recording is taken."""

KINDS: Mapping[str, Kind] = MappingProxyType({k.name: k for k in EVERY if k.when is None})
"""The kinds that recording.toml may name, each as it is where no other of its name suits."""


def kind_of(name: str, platform: Platform, channels: Container[Key] = ()) -> Kind:
    """Return the kind of a recording of this name with these channels; `ValueError` for a name that is no kind."""
    if name not in KINDS:
        raise ValueError(f"`kind` must be one of {', '.join(KINDS)}, got {name!r}")
    suited = (k for k in EVERY if k.name == name and k.when is not None and k.when(platform, channels))
    return next(suited, KINDS[name])
