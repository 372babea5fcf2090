"""A scenario: what to simulate, as a TOML file checked field by field."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from gimbalcal.entries import expected_in_words
from gimbalcal.errors import InputError
from gimbalcal.quantities import refuse_unit
from gimbalcal.recording.document import MAX_STATED_NUMBER, Document
from gimbalcal.recording.kinds import KINDS, Kind
from gimbalcal.schedule import ROTATIONS, SCHEDULES
from gimbalcal.units import parse, to_si


def _measured_value(quantity: str, like: str = "") -> BeforeValidator:
    """Return a number with its unit, {value = 1.0, unit = "arcsec"}, taken to SI."""

    def convert(given: Any) -> float:
        if not isinstance(given, dict) or set(given) != {"value", "unit"}:
            raise ValueError('give it as { value = ..., unit = "..." }')
        value, unit = given["value"], given["unit"]
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < MAX_STATED_NUMBER:
            raise ValueError(f"`value` must be a finite number, got {value!r}")
        if quantity:
            refuse_unit(str(unit), quantity)
        elif parse(str(unit)).dimension != parse(like).dimension:
            raise ValueError(f"{unit!r} is not a unit of it; give it in {like}")
        return float(to_si(float(value), str(unit)))

    return BeforeValidator(convert)


def _positive_value(value: float) -> float:
    if not value > 0:
        raise ValueError(f"must be above zero, got {value:g}")
    return value


Duration = Annotated[float, _measured_value("time"), AfterValidator(_positive_value)]
Rate = Annotated[float, _measured_value("", "Hz"), AfterValidator(_positive_value)]
Spinning = Annotated[float, _measured_value("", "deg/s"), AfterValidator(_positive_value)]
Angle = Annotated[float, _measured_value("angle")]
Force = Annotated[float, _measured_value("", "m/s^2")]
Spin = Annotated[float, _measured_value("", "deg/h")]
Walk = Annotated[float, _measured_value("", "ug/sqrt(h)")]
AngleWalk = Annotated[float, _measured_value("", "deg/sqrt(h)")]
ForceWalk = Annotated[float, _measured_value("", "ug/sqrt(Hz)")]
RateWalk = Annotated[float, _measured_value("", "deg/h/sqrt(h)")]
Speed = Annotated[float, _measured_value("velocity")]
Length = Annotated[float, _measured_value("height")]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class TurnSection(_Section):
    """[[schedule.moves]]: a turn about an axis of the unit (x, y, z) or of the table (outer, inner)."""

    axis: Literal["x", "y", "z", "outer", "inner"]
    angle: Angle
    rate: Spinning | None = None
    stop: Annotated[float, _measured_value("time")] | None = None


class Oscillation(_Section):
    """How one angle of a swing goes: amplitude x sin(2 pi frequency t)."""

    frequency: Rate
    amplitude: Angle


class SwingSection(_Section):
    """[schedule.swing]: a table that swings about all three axes at once."""

    heading: Oscillation | None = None
    pitch: Oscillation | None = None
    roll: Oscillation | None = None


class DriveSection(_Section):
    """[schedule.drive]: legs from crossing to crossing with bends and hills, after a rest."""

    speed: Speed
    leg: Duration = 240.0
    pitch: Angle = 0.0
    rest: Duration = 900.0


class ScheduleSection(_Section):
    """[schedule]: which holds or turns, how long, how fast between them, how often sampled."""

    name: str = ""
    holds: tuple[dict[str, float], ...] = ()  # gimbal readouts [deg] by axis
    dwell: Duration | None = None  # of every hold, instead of the schedule's own
    rate: Rate = 1.0
    slew_rate: Spinning | None = None  # of holds: 6 deg/s; of turns: the schedule's own
    ramp: Annotated[float, _measured_value("time")] | None = None  # to come to slew_rate; none: 0, with gyroscopes 1 s
    settle: Annotated[float, _measured_value("time")] = 5.0
    record_slews: bool = False
    sweeps: int = Field(default=1, ge=1, le=1000)
    duration: Duration = 86400.0  # of a static run, of a swing, of a drive with its rest
    start_angle: Angle = 0.4  # S_t of a static run's first sample
    # of turns, in a rotation
    file: str = ""  # a schedule.toml instead of a name
    start: dict[str, str] = {}  # where x, y and z point, as in schedule.toml
    moves: tuple[TurnSection, ...] = ()
    swing: SwingSection | None = None
    drive: DriveSection | None = None
    start_sigma: Angle = 0.0  # how far the unit is off its start, one sigma about each axis
    rates: Literal["mean", "instant"] = "mean"  # over the interval that ends at the row, or of the row's time

    @model_validator(mode="after")
    def _known(self) -> ScheduleSection:
        if self.name and self.name not in (*SCHEDULES, *ROTATIONS):
            raise ValueError(f"no schedule is called {self.name!r}; known: {', '.join((*SCHEDULES, *ROTATIONS))}")
        if sum(map(bool, (self.name, self.file, self.holds, self.moves, self.swing, self.drive))) > 1:
            raise ValueError("name, file, holds, moves, swing and drive each say where the unit goes; keep one")
        if self.start and set(self.start) != set("xyz"):
            raise ValueError('start: say where x, y and z point, { x = "east", y = "north", z = "up" }')
        return self

    @property
    def turns(self) -> bool:
        """Return whether it is a schedule of turns and stops of a unit without gimbals, or a rest, swing or drive."""
        return self.name in ROTATIONS or bool(self.file or self.moves or self.swing or self.drive or self.start)


class SiteSection(_Section):
    """[site]."""

    latitude: Annotated[float, _measured_value("angle")] | None = None
    height: Length = 0.0
    gravity: Force | None = None

    @model_validator(mode="after")
    def _on_earth(self) -> SiteSection:
        if self.latitude is not None and abs(self.latitude) > np.pi / 2:
            raise ValueError("latitude must lie between -90 and 90 deg")
        return self


class PlatformSection(_Section):
    """[platform]."""

    name: str = "space-stable"


class QuantityHistory(_Section):
    """How a quantity of the environment goes: a temperature in degC, any other as it will be logged."""

    shape: Literal["constant", "ramp", "sinusoid", "random-walk", "table"] = "constant"
    mean: float = 20.0
    rate: float = 0.0  # per h, of a ramp
    amplitude: float = 0.0  # of a sinusoid
    period: Duration = 86400.0
    phase: Annotated[float, _measured_value("angle")] = 0.0
    walk: float = Field(default=0.0, ge=0)  # per sqrt(h), of a random walk
    time_h: tuple[float, ...] = ()  # of a table
    value: tuple[float, ...] = ()

    @model_validator(mode="after")
    def _whole_table(self) -> QuantityHistory:
        if self.shape == "table" and (len(self.time_h) != len(self.value) or len(self.time_h) < 2):
            raise ValueError("a table needs as many `value` as `time_h`, at least two")
        if any(b <= a for a, b in zip(self.time_h, self.time_h[1:], strict=False)):
            raise ValueError("`time_h` must increase")
        return self


class EnvironmentSection(_Section):
    """[environment]."""

    temperature: QuantityHistory | None = None
    covariates: dict[str, QuantityHistory] = {}
    thermometer_sigma: float = Field(default=0.0, ge=0)  # degC


class NoiseSection(_Section):
    """[noise]: one sigma of one sample, and the coloured parts of the accelerometers."""

    accelerometer: Force = 0.0
    accelerometer_random_walk: Walk = 0.0
    accelerometer_flicker: Force = 0.0
    accelerometer_gauss_markov: Force = 0.0
    accelerometer_gauss_markov_tau: Duration = 3600.0
    accelerometer_density: ForceWalk = 0.0  # white, whatever the rate
    gyroscope: Spin = 0.0
    gyroscope_density: AngleWalk = 0.0  # angle random walk
    gyroscope_random_walk: RateWalk = 0.0
    gyroscope_flicker: Spin = 0.0
    gyroscope_gauss_markov: Spin = 0.0
    gyroscope_gauss_markov_tau: Duration = 3600.0
    velocity: Speed = 0.0  # how still the place of a turned unit is
    gimbal_angle: Angle = 0.0  # setting error of a position; of one reading in a static run
    attitude: Angle = 0.0
    place: Length = 0.0  # of the reference of a drive, in each direction


class BlunderSection(_Section):
    """A position whose gimbal was set wrong."""

    position: int
    gimbal: str
    angle: Angle


class FaultsSection(_Section):
    """[faults]: what goes wrong on purpose."""

    quantisation: Force = 0.0
    drop: tuple[int, ...] = ()
    blunders: tuple[BlunderSection, ...] = ()
    interchange: tuple[tuple[int, int], ...] = ()


class Scenario(_Section):
    """The whole file."""

    format: Literal[1]
    kind: Literal["multi-position", "static-run", "rotation"]
    gyroscopes: bool = False  # log angular_rate, and the slews; a rotation recording always does
    title: str = "simulated"
    seed: int = Field(default=1, ge=0)
    site: SiteSection = SiteSection()
    platform: PlatformSection = PlatformSection()
    schedule: ScheduleSection = ScheduleSection()
    truth: dict[str, Any] = {}
    environment: EnvironmentSection = EnvironmentSection()
    noise: NoiseSection = NoiseSection()
    faults: FaultsSection = FaultsSection()

    @model_validator(mode="after")
    def _complete(self) -> Scenario:
        if self.recording_kind.stabilised and self.site.latitude is None:
            raise ValueError("a static run needs [site] latitude: the Earth turns below the platform")
        if self.schedule.turns and not self.recording_kind.rotating:
            raise ValueError('a schedule of turns makes a rotation recording: write kind = "rotation"')
        if not self.recording_kind.stabilised and not (
            self.schedule.name or self.schedule.holds or self.schedule.turns
        ):
            raise ValueError(f'a {self.kind} scenario needs [schedule] name = "wu2018-18" or [[schedule.holds]]')
        if self.turning and self.recording_kind.stabilised:
            raise ValueError("gyroscopes are simulated where something turns: kind = multi-position or rotation")
        if self.turning and self.site.latitude is None:
            raise ValueError("gyroscopes feel the Earth turn: give [site] latitude")
        return self

    @model_validator(mode="after")
    def _nothing_ignored(self) -> Scenario:
        """Refuse what is stated of the schedule and would have no effect."""
        s = self.schedule
        if s.turns:
            free = bool(s.swing or s.drive)
            unused = {"settle", "record_slews", "start_angle", "holds"}
            unused |= {"sweeps", "dwell", "slew_rate", "ramp"} if free else {"duration"}
        elif self.recording_kind.stabilised:
            unused = {"dwell", "slew_rate", "ramp", "settle", "record_slews", "sweeps", "start_sigma"}
        else:
            unused = {"duration", "start_angle", "start_sigma"}
        if ignored := sorted(unused & s.model_fields_set):
            raise ValueError(f"schedule.{ignored[0]} has no effect on such a schedule; take it out")
        return self

    @property
    def recording_kind(self) -> Kind:
        """Return the kind of the recording that is simulated, with its properties."""
        return KINDS[self.kind]

    @property
    def turning(self) -> bool:
        """Return whether angular rates are logged, through the slews too."""
        return self.gyroscopes or self.recording_kind.rotating

    @property
    def ramp(self) -> float:
        """Return the time [s] in which a slew comes to speed; gyroscopes do not see a rate that jumps."""
        return float(self.turning) if self.schedule.ramp is None else self.schedule.ramp


SHIPPED = Path(__file__).parents[1] / "scenarios"


def find(scenario: str | Path) -> Path:
    """Return the file of a scenario: a path, or the name of one that ships with the package."""
    path = Path(scenario)
    if path.is_file():
        return path
    if path.name == str(path) and path.stem in shipped():
        return SHIPPED / f"{path.stem}.toml"
    raise InputError(f"{scenario} is no file and no scenario of the package; those are {', '.join(shipped())}")


def shipped() -> list[str]:
    """Return the names of the scenarios of the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def load(scenario: str | Path) -> Scenario:
    """Read and check a scenario. Raises InputError with the file and the first field that is wrong."""
    path = find(scenario)
    return check_content(Document(path).content, str(path))


def check_content(content: dict[str, Any], where: str = "scenario") -> Scenario:
    """Return a scenario from the content of its file."""
    try:
        return Scenario.model_validate(content)
    except ValidationError as problems:
        first = problems.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or "scenario"
        message = expected_in_words(first)
        got = "" if first["type"] == "value_error" or "input" not in first else f", got {first['input']!r}"
        raise InputError(f"{where}: {field}: {message}{got if len(got) < 80 else ''}") from None
