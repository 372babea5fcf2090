"""A recording: arrays in SI and radians, time first, with the platform, the site and the source of every number."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gimbalcal.display import Displayed, data_frame, panels
from gimbalcal.earth import G0
from gimbalcal.effects.effect import Effect, lacking_quantity
from gimbalcal.effects.sensor_grades import GRADES, Grade
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import Platform
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording.kinds import Kind, kind_of
from gimbalcal.units import is_raw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_DRAWN = 3000  # rows of a figure
Key = tuple[str, str]
"""(quantity, axis) of a channel, as in ``("specific_force", "x")`` or ``("temperature", "")``."""

FORCE, RATE, ANGLE = "specific_force", "angular_rate", "gimbal_angle"
"""Quantities that most estimators read."""
FORCES, RATES = (tuple((quantity, axis) for axis in "xyz") for quantity in (FORCE, RATE))
"""The channels of both triads."""

SENSORS: Mapping[str, str] = MappingProxyType(
    {
        "accelerometer": "specific_force",
        "gyroscope": "angular_rate",
        "gimbal_angle": "gimbal_angle",
        "attitude": "attitude_error",
        "velocity": "velocity",  # of a strapdown unit that stays in place: how still that place is; no column holds it
    }
)
"""Names in ``[noise]`` and the quantity that each speaks of."""
SENSOR_OF = {quantity: sensor for sensor, quantity in SENSORS.items()}

COLOURED: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        f"{sensor}_{name}": (SENSORS[sensor], given.format(SENSORS[sensor]))
        for sensor in ("accelerometer", "gyroscope")
        for name, given in (("random_walk", "{}_walk"), ("flicker", "{}"), ("gauss_markov", "{}"),
                            ("gauss_markov_tau", "time"))
    }
)  # fmt: skip
"""Coloured noise that ``[noise]`` of a rotation recording may state: the quantity, and that of its unit."""

SOURCE_OF = {"attitude": "gimbals, which say where north is"}  # of a quantity that no channel is named after
FOLLOWED = ("temperature", "covariate")  # quantities that effects follow
ANGLES = ("gimbal_angle", "attitude_error", "true_angle")
"""Quantities that are angles: they may wrap."""


@dataclass(frozen=True)
class Site:
    """The site of a rig: latitude and its sigma [rad], height [m], gravity and its sigma [m/s^2].

    The latitude is None where it was not given, and its sigma where none was stated.
    """

    latitude: float | None = None
    height: float = 0.0
    gravity: float = G0
    gravity_sigma: float = 0.0
    latitude_sigma: float | None = None


UNKNOWN_SITE = Site(gravity_sigma=0.015)
"""An unknown site: gravity is anywhere from 9.780 to 9.832 m/s^2, NIMA TR8350.2, Table 3.4."""


@dataclass(frozen=True)
class Source:
    """A file that the numbers came from, and its SHA-256."""

    path: str
    sha256: str

    @classmethod
    def of(cls, path: Path, called: str = "") -> Source:
        """Return the file at `path` as it is now, called by its name if not otherwise."""
        with path.open("rb") as file:
            return cls(called or path.name, hashlib.file_digest(file, "sha256").hexdigest())


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Displayed):
    """The log of a rig, in SI and radians (temperature in degC), one entry per row.

    kind: its name as a string, with the properties of that kind (`gimbalcal.recording.kinds`); a plain string is taken
    too. time (n,) s; position (n,) 1, 2, ... or 0 while moving, None where the idea does not apply; channels (n,) each;
    weight (n,) raw samples behind each row (1 unless rows are averages). `noise` is what the header states: one
    sigma of one raw sample, by sensor (see `SENSORS`, and `COLOURED`); `scatter` is what the rows show, by channel, see
    `recording.noise_levels`. `units` keeps the unit that each channel was logged in; in counts or pulses the
    numbers are left as they are, because their scale is not known. `remarks` are sentences for the user.
    `sensor` is the name of the sensors where a recording holds several triads; the others are `other_sensors`,
    a recording each, in the same rows. `instant`: forces and rates are those of the row's time; else, where it matters,
    they are means over the interval that ends there. `grade` says how large the usual imperfections of such sensors
    are. `date` is when it was recorded, ISO 8601, empty where unknown; `epoch` [s since 1970] is where a clock of dates
    has its zero. `restarts` are the times of rows at which a session begins an unknown time after the one before.
    `corrected` names the calibrations by which it was corrected, in order (`Calibration.identity`). `duration` (n,) [s]
    is the time of which each row is a mean, None where rows are samples; `begin` [s] is the first row of the recording
    of which rows are means, from which effects count the time.
    """

    kind: Kind
    title: str
    platform: Platform
    site: Site
    noise: Mapping[str, float]
    time: Array
    position: NDArray[np.int64] | None
    channels: Mapping[Key, Array]
    source: tuple[Source, ...] = ()
    weight: Array = field(default_factory=lambda: np.ones(0))
    units: Mapping[Key, str] = field(default_factory=dict)
    scatter: Mapping[Key, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    sensor: str = ""
    other_sensors: tuple[Recording, ...] = ()
    instant: bool = False
    grade: Grade = GRADES["navigation"]
    date: str = ""
    epoch: float | None = None
    restarts: tuple[float, ...] = ()
    corrected: tuple[str, ...] = ()
    duration: Array | None = None
    begin: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", kind_of(self.kind, self.platform, self.channels))
        n = len(self.time)
        if len(self.weight) == 0 < n:
            object.__setattr__(self, "weight", np.broadcast_to(1.0, (n,)))
        sizes = {f"{q} {a}".strip(): len(v) for (q, a), v in self.channels.items()} | {"weight": len(self.weight)}
        if self.position is not None:
            sizes["position"] = len(self.position)
        if self.duration is not None:
            sizes["duration"] = len(self.duration)
        for name, size in sizes.items():
            if size != n:
                raise ValueError(f"`{name}` must have one value per row of `time` ({n}), got {size}")

    def __str__(self) -> str:
        """Return a summary in a few lines: kind, rows, dwells, channels with their units, remarks."""
        p = self.position
        visits = 0 if p is None else int(np.count_nonzero((np.diff(p, prepend=0) != 0) & (p > 0)))
        span = float(np.ptp(self.time)) if len(self.time) else 0.0
        channels = []
        for q in dict.fromkeys(q for q, _ in self.channels):
            axes = self.axes(q)
            channels.append(f"  {q} {' '.join(axes)}".rstrip() + f"  [{self.units.get((q, axes[0]), 'SI')}]")
        rows = f"{len(self.time)} rows in {span:.6g} s" + (f", {visits} rests" if visits else "")
        head = f"{self.kind} recording {self.title!r} on {self.platform.name}: {rows}"
        return "\n".join([head, *channels, *(f"  note: {remark}" for remark in self.remarks)])

    @property
    def elapsed(self) -> Array:
        """Return the time (n,) [s] since the first row, or the first of the session where the separation is unknown."""
        begin = float(self.time[0]) if self.begin is None else self.begin
        return np.asarray(self.time - np.array([begin, *self.restarts])[self.session])

    @property
    def session(self) -> NDArray[np.int64]:
        """Return the number, from 0, of the session of each row (n,), where the separation of sessions is unknown."""
        return np.searchsorted(np.asarray(self.restarts), self.time, side="right")

    @property
    def step(self) -> float:
        """Return the usual time [s] from a row to the next."""
        return float(np.median(np.diff(self.time), overwrite_input=True))

    @property
    def label(self) -> str:
        """Return the file that the recording comes from, else its title: a refusal begins with it."""
        return self.source[0].path if self.source else f"recording {self.title!r}"

    @property
    def files(self) -> list[dict[str, str]]:
        """Return the files behind it and their SHA-256, for a provenance."""
        return [{"path": s.path, "sha256": s.sha256} for s in self.source]

    def has(self, quantity: str) -> bool:
        """Return whether any axis of `quantity` was logged, or the one that is named ("covariate:pressure").

        Gimbals have an "attitude", whichever of them were read; rows have a "position" where one was written down.
        """
        if quantity == "attitude":
            return bool(self.platform.axes)
        if quantity == "position":
            return self.position is not None
        quantity, _, axis = quantity.partition(":")
        return any(q == quantity and axis in ("", a) for q, a in self.channels)

    def why_not_shown(self, effect: type[Effect]) -> str:
        """Return why it cannot show an effect, as the predicate of a sentence; empty where it can."""
        if not effect.shows_in(self.kind):
            return f"shows in {' and '.join(effect.kinds)} recordings, and {self.title!r} is a {self.kind} recording"
        missing = lacking_quantity(effect, self.has)
        return f"needs {SOURCE_OF.get(missing, missing)}, and {self.title!r} has none" if missing else ""

    def axes(self, quantity: str) -> tuple[str, ...]:
        """Return the axes of `quantity` that were logged, in the order of the file."""
        return tuple(a for q, a in self.channels if q == quantity)

    def triad(self, quantity: str, axes: tuple[str, ...] = ("x", "y", "z"), rows: slice = slice(None)) -> Array:
        """Return the channels of `quantity` as columns, (n, 3) or some rows; `InputError` if one was not logged."""
        missing = [axis for axis in axes if (quantity, axis) not in self.channels]
        if missing:
            raise InputError(
                f"the recording {self.title!r} has no {quantity} along {' and '.join(missing)}: add the column "
                "to [columns] of its recording.toml"
            )
        return np.stack([self.channels[quantity, axis][rows] for axis in axes], axis=-1)

    def counted(self, quantity: str) -> bool:
        """Return whether a quantity was logged in counts or pulses, so that its numbers are not in SI."""
        return any(is_raw(u) for (q, _), u in self.units.items() if q == quantity)

    def angles(self) -> Array:
        """Return gimbal readouts (n, k) [rad] in the order of the platform's axes; one without a readout is at 0."""
        readings = {axis: self.channels["gimbal_angle", axis] for axis in self.axes("gimbal_angle")}
        return self.platform.angles(readings, (len(self.time),))

    def sigma(self, sensor: str) -> float | None:
        """Return the noise of one raw sample of `sensor`: as the header states it, else as the rows scatter, else None.

        A setting repeatability cannot be seen in the readout of its gimbal, so it is never taken from the scatter.
        """
        if sensor in self.noise:
            return self.noise[sensor]
        shown = [s for (q, _), s in self.scatter.items() if q == SENSORS[sensor]]
        if not shown or sensor == "gimbal_angle":
            return None
        return float(np.sqrt(np.mean(np.square(shown))))

    def to_frame(self, kind: str = "polars") -> Any:
        """Return the rows as a data frame, "polars" or "pandas": time [s], position, and each channel in SI."""
        position = {} if self.position is None else {"position": self.position.astype(float)}
        named = {f"{quantity}_{axis}".rstrip("_"): x for (quantity, axis), x in self.channels.items()}
        return data_frame({"time": self.time, **position, **named}, kind)

    def plot(self) -> Figure:
        """Return a matplotlib figure of every quantity over time, at most `MAX_DRAWN` rows of it."""
        quantities = list(dict.fromkeys(quantity for quantity, _ in self.channels))
        rows = np.unique(np.linspace(0, len(self.time) - 1, MAX_DRAWN).astype(int)) if len(self.time) else slice(0)
        units = {q: next(u for key, u in self.in_print.items() if key[0] == q) for q in quantities}
        figure, axes = panels(
            [f"{q.replace('_', ' ')} [{units[q]}]" for q in quantities], across=1, width=8, height=1.9
        )
        for ax, quantity in zip(axes, quantities, strict=True):
            for axis in self.axes(quantity):
                ax.plot(self.time[rows], self.channels[quantity, axis][rows], lw=0.8, label=axis or quantity)
            ax.legend(loc="upper right", fontsize=8)
        if axes:
            axes[-1].set_xlabel("time [s]", fontsize=8)
        return figure

    @property
    def in_print(self) -> dict[Key, str]:
        """Return the unit of the numbers of each channel: SI, or what counts are counted in."""
        raw = {key: unit for key, unit in self.units.items() if is_raw(unit)}
        return {key: raw.get(key) or (QUANTITIES[key[0]].si if key[0] in QUANTITIES else "1") for key in self.channels}

    def write(self, folder: str | Path) -> None:
        """Write the recording into a folder: recording.toml and samples.csv, both or neither."""
        from gimbalcal.recording.writing import write

        write(self, folder)

    def select(self, rows: NDArray[Any] | slice) -> Recording:
        """Return the same recording with only `rows` (a mask, indices or a slice)."""
        return replace(
            self,
            time=self.time[rows],
            position=None if self.position is None else self.position[rows],
            channels={key: values[rows] for key, values in self.channels.items()},
            weight=self.weight[rows],
            duration=None if self.duration is None else self.duration[rows],
            other_sensors=tuple(other.select(rows) for other in self.other_sensors),
        )

    def with_channels(self, channels: Mapping[Key, Array]) -> Recording:
        """Return the same recording with these channels added, or in place of its own."""
        return replace(self, channels={**self.channels, **channels})

    @property
    def sensors(self) -> tuple[Recording, ...]:
        """Return itself and those of other sensors in the same rows, each alone."""
        return (replace(self, other_sensors=()), *self.other_sensors)


def since_power_up(time: Array, session: Array) -> Array:
    """Return the time (n,) [s] since the first row of the session of each row."""
    _, first, ordinal = np.unique(session, return_index=True, return_inverse=True)
    return np.asarray(time - time[first][ordinal])


def when_recorded(recordings: Iterable[Recording]) -> str | None:
    """Return the date of the last of some recordings, for a provenance; None where none is known."""
    return max((r.date for r in recordings), default="") or None
