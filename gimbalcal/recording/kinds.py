"""Kinds of recording: whatever depends on how a unit was tested stands here, once per kind.

A `Kind` is its name in recording.toml, a string, with the properties of that kind. It compares, prints and serialises
as the string; code asks for the property that it depends on, as in ``recording.kind.stabilised``. To add a kind, add
an instance to `KINDS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS, BASELINE
from gimbalcal.platform import Platform


@dataclass(frozen=True, eq=False, repr=False)
class Kind(str):
    """A kind of recording: a string, its name in recording.toml, with what follows from how the unit was tested.

    in_positions: the unit is held in one position after the other, and its rows are numbered by position;
    stabilised: the platform keeps its attitude in inertial space while the Earth turns beneath it;
    rotating: the unit is turned in its place, and its angular rate is integrated over every step of the clock;
    sighting: a mount points at stars of known direction, and no inertial sensor is read.
    methods: names of the methods that calibrate it, the preferred one first. baseline: the effects that its calibrated
    model holds. predicted: the quantities that the forward model predicts at the readings. measured_by: the sensor
    whose stated noise weighs its rows.
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

    def __new__(cls, name: str, *_: object, **__: object) -> Kind:
        return super().__new__(cls, name)

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

    @property
    def gimbals_are_set(self) -> bool:
        """Return whether gimbals are set to an angle, with a setting error, instead of following the Earth."""
        return not self.stabilised


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
)
"""A unit without gimbals that is laid down in one position after the other: only the norm of gravity is known."""

STATIC_RUN = Kind(
    "static-run",
    methods=("rate-table", "three-stage"),
    baseline=BASELINE["static-run"],
    predicted=("specific_force", "gimbal_angle", "attitude_error"),
    stabilised=True,
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
)
"""A mount that points at stars."""

KINDS: Mapping[str, Kind] = MappingProxyType({k.name: k for k in (MULTI_POSITION, STATIC_RUN, ROTATION, POINTING)})
"""The kinds that recording.toml may name."""


def kind_of(name: str, platform: Platform) -> Kind:
    """Return the kind of a recording of this name on this platform; `ValueError` for a name that is no kind."""
    if name not in KINDS:
        raise ValueError(f"`kind` must be one of {', '.join(KINDS)}, got {name!r}")
    kind = KINDS[name]
    return HAND_TURNED if kind is MULTI_POSITION and not platform.axes else kind
