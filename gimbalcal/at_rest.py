"""Determine the noise of sensors at rest: Allan deviation of each channel, its coefficients, and a header line.

The rests are those of the recording; a static run is one rest, less the Earth's turn under the platform.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.display import Displayed, data_frame, panels
from gimbalcal.earth import EARTH_RATE
from gimbalcal.entries import Entry, Json
from gimbalcal.errors import InputError, number_of
from gimbalcal.inference.allan import MIN_P_VALUE, MIN_ROWS, AllanCurve, AllanFit, allan_curve, allan_law, fit
from gimbalcal.number import Array
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording import Recording, Source, dwells
from gimbalcal.recording.detection import UNUSUAL_VARIANCE_RATIO
from gimbalcal.recording.dwell import MISSED_ROW_STEPS
from gimbalcal.recording.record import FORCE, RATE, SENSOR_OF, SENSORS, Key
from gimbalcal.units import from_si, is_raw
from gimbalcal.views.segments import stop_rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNITS: Mapping[str, tuple[str, str, str]] = {
    "specific_force": ("ug/sqrt(Hz)", "ug", "ug/sqrt(h)"),
    "angular_rate": ("deg/sqrt(h)", "deg/h", "deg/h/sqrt(h)"),
}
MAX_LATE = 0.01  # of the rows, that a clock without jitter stamps late because rows before them are missing
MAX_WAIT = 2.5  # steps, that such a row is late
MIN_CROSSING_S = 1.0  # before which no sensor's random walk exceeds its white noise: the unit moves


@dataclass(frozen=True)
class Coefficient(Entry):
    """A coefficient with one sigma; where it is not significant both are nan, and `below` is its 95 % limit."""

    value: float
    sigma: float
    below: float
    unit: str

    @property
    def significant(self) -> bool:
        """Return whether the coefficient is determined."""
        return isfinite(self.value)


@dataclass(frozen=True)
class ChannelNoise(Entry):
    """The noise of one sensor: coefficients, and the Allan deviation (P,), its sigma and the model in `unit`."""

    quantity: str
    axis: str
    sensor: str
    white_noise: Coefficient
    bias_instability: Coefficient
    random_walk: Coefficient
    unit: str
    tau_s: tuple[float, ...]
    deviation: tuple[float, ...]
    sigma: tuple[float, ...]
    model: tuple[float, ...]
    fitted_from_s: float
    chi2: float
    dof: int
    p_value: float


@dataclass(frozen=True)
class StatedNoise(Entry):
    """A line of [noise] in a recording.toml."""

    value: float
    unit: str

    def line(self, sensor: str) -> str:
        """Return the line for a sensor."""
        return f'{sensor} = {{ value = {self.value:g}, unit = "{self.unit}" }}'


@dataclass(frozen=True, repr=False)
class RestNoise(Displayed, Entry):
    """The content of noise.json: the answer, the rests, what [noise] may state, and the noise of each channel."""

    format: int
    in_words: str
    rests: int
    seconds: float
    longest_s: float
    rate_hz: float
    header: Mapping[str, StatedNoise]
    channels: tuple[ChannelNoise, ...]
    recordings: tuple[Source, ...]

    def to_dict(self) -> Json:
        """Return the content of noise.json."""
        content = super().to_dict()
        content["provenance"] = {"recordings": content.pop("recordings")}
        return content

    def __str__(self) -> str:
        """Return the answer as the console has it, with the lines of [noise]."""
        from gimbalcal.words.answers import noise_answer

        return "\n".join([noise_answer(self), *(["[noise]", *self.lines] if self.lines else [])])

    def to_frame(self, kind: str = "polars") -> Any:
        """Return a row for each coefficient of each sensor, nan where only `below` is known; "polars" or "pandas"."""
        rows = [
            (f"{SENSOR_OF[c.quantity]} {c.axis} {c.sensor}".strip(), name, x.value, x.sigma, x.below, x.unit)
            for c in self.channels
            for name in ("white_noise", "bias_instability", "random_walk")
            for x in [getattr(c, name)]
        ]
        names = ("sensor", "coefficient", "value", "sigma", "below", "unit")
        return data_frame({n: [r[i] for r in rows] for i, n in enumerate(names)}, kind, (*names[:2], "unit"))

    def plot(self) -> Figure:
        """Return a matplotlib figure of the Allan deviation of each sensor, with one sigma and the fitted noise."""
        figure, axes = panels([f"{SENSOR_OF[c.quantity]} {c.axis} {c.sensor}".strip() for c in self.channels])
        for ax, c in zip(axes, self.channels, strict=True):
            ax.errorbar(c.tau_s, c.deviation, c.sigma, fmt=".", ms=3, lw=0.8)
            ax.plot(c.tau_s, c.model, lw=1)
            ax.set(xscale="log", yscale="log")
            ax.set_xlabel("averaging time [s]", fontsize=8)
            ax.set_ylabel(f"[{c.unit}]", fontsize=8)
        return figure

    @property
    def lines(self) -> list[str]:
        """The lines of [noise] for recording.toml."""
        return [stated.line(sensor) for sensor, stated in self.header.items()]


@dataclass(frozen=True)
class Channel:
    """One sensor at rest: its curve [SI^2], the fitted noise, and how many samples a row is the mean of.

    shaken: rests that are left out, because a sensor is shaken in them.
    """

    key: Key
    sensor: str
    raw: str  # the unit of counts or pulses; empty of a reading in SI
    curve: AllanCurve
    fitted: AllanFit
    weight: float
    shaken: int

    @property
    def name(self) -> str:
        """Name for people."""
        return " ".join(filter(None, [SENSOR_OF[self.key[0]], self.key[1], self.sensor]))

    @property
    def units(self) -> tuple[str, str, str]:
        """Units of white noise, of bias instability (and the curve), and of random walk."""
        return (f"{self.raw}/sqrt(Hz)", self.raw, f"{self.raw}/sqrt(h)") if self.raw else UNITS[self.key[0]]

    def printed(self, value: Array | float, part: int) -> Any:
        """Return an SI value in the unit in which coefficients of this kind are printed."""
        si = np.asarray(value, dtype=float)
        return si * (60.0 if part == 2 else 1.0) if self.raw else from_si(si, self.units[part])

    def coefficient(self, part: int) -> Coefficient:
        """Return value and sigma of a coefficient; where it is not significant, its 95 % limit."""
        square, spread = self.fitted.square[part], np.sqrt(self.fitted.covariance[part, part])
        significant, root = bool(spread > 0), float(np.sqrt(square))
        most = float(np.sqrt(max(self.fitted.most[part], 0.0)))
        unit = self.units[part]
        if not significant:
            return Coefficient(nan, nan, float(self.printed(most, part)), unit)
        return Coefficient(float(self.printed(root, part)), float(self.printed(spread / (2 * root), part)), nan, unit)

    @property
    def moves(self) -> bool:
        """Return whether its random walk exceeds its white noise within `MIN_CROSSING_S`."""
        white, _, walk = allan_law(np.array([MIN_CROSSING_S]))[0] * self.fitted.square
        return bool(self.coefficient(2).significant and self.curve.step < MIN_CROSSING_S and walk > white)

    @property
    def result(self) -> ChannelNoise:
        """The entry of noise.json."""
        return ChannelNoise(
            quantity=self.key[0],
            axis=self.key[1],
            sensor=self.sensor,
            white_noise=self.coefficient(0),
            bias_instability=self.coefficient(1),
            random_walk=self.coefficient(2),
            unit=self.units[1],
            tau_s=tuple(self.curve.tau.tolist()),
            deviation=tuple(self.printed(np.sqrt(self.curve.variance), 1).tolist()),
            sigma=tuple(self.printed(self.fitted.spread / (2 * np.sqrt(self.model)), 1).tolist()),
            model=tuple(self.printed(np.sqrt(self.model), 1).tolist()),
            fitted_from_s=float(self.curve.tau[self.fitted.first]),
            chi2=self.fitted.chi2,
            dof=self.fitted.dof,
            p_value=self.fitted.p_value,
        )

    @property
    def model(self) -> Array:
        """Return the Allan variance (P,) of the fitted noise."""
        return np.asarray(allan_law(self.curve.tau) @ self.fitted.square)


def noise_at_rest(recording: Recording) -> tuple[Channel, ...]:
    """Return the noise of every accelerometer and gyroscope of a recording; `InputError` where nothing is at rest."""
    if recording.kind.sighting:
        raise InputError(f"{recording.title!r} is a pointing run: no inertial sensor rests in it")
    out = []
    for each in recording.sensors:
        stretches, step, shaken = _quiet_stretches(each)
        for (quantity, axis), values in each.channels.items():
            if quantity not in UNITS:
                continue
            x = _without_the_earth(each, values) if each.kind.stabilised else values
            unit = each.units.get((quantity, axis), "")
            c = allan_curve(x, stretches, step)
            if not c.variance.min() > 0:
                raise InputError(f"{each.title!r}: {quantity} {axis} shows no noise at rest; log it with more digits")
            raw = unit if is_raw(unit) else ""
            weight = float(np.median(each.weight))
            out.append(Channel((quantity, axis), each.sensor, raw, c, fit(c), weight, shaken))
    if not out:
        raise InputError(f"{recording.title!r} has no specific_force or angular_rate: so no noise can be determined")
    return tuple(out)


def _quiet_stretches(recording: Recording) -> tuple[list[slice], float, int]:
    """Return the stretches of `_stretches` in which no sensor is shaken, the step [s], and how many of them are.

    There the mean square of the change from row to row is more than `UNUSUAL_VARIANCE_RATIO` times its median over all
    rows at rest.
    """
    stretches, step = _stretches(recording)
    rows = np.array([s.stop - s.start for s in stretches])
    quiet = np.ones(len(stretches), dtype=bool)
    for (quantity, _), x in recording.channels.items() if len(stretches) > 1 else ():
        if quantity in UNITS:
            changes = [np.abs(np.diff(x[s])) for s in stretches]
            square = np.array([np.mean(change**2) for change in changes])
            order = np.argsort(square)
            usual = square[order][np.searchsorted(np.cumsum(rows[order]), rows.sum() / 2)]
            quantised = min((float(change[change > 0].min()) for change in changes if np.any(change)), default=0.0)
            quiet &= square <= UNUSUAL_VARIANCE_RATIO * usual + quantised**2
    return [s for s, kept in zip(stretches, quiet, strict=True) if kept] or stretches, step, int(np.sum(~quiet))


def _stretches(recording: Recording) -> tuple[list[slice], float]:
    """Return stretches of rows at rest without a pause of the clock, and its step [s].

    Rows that wait to be read are stamped late by turns. Where more than `MAX_LATE` of them are, a row is missing only
    where the clock pauses for more than `MAX_WAIT` steps, and the mean is the step.
    """
    step = recording.step if len(recording.time) > 1 else 1.0
    rests = stop_rows(recording) if recording.kind.rotating else dwells(recording)
    dt = np.diff(recording.time)
    late = MISSED_ROW_STEPS * step
    if np.mean(dt > late) > MAX_LATE:
        late = MAX_WAIT * step
        step = float(np.mean(dt[dt <= late]))
    cut = np.flatnonzero(dt > late) + 1
    pieces: list[slice] = []
    for d in rests:
        inside = cut[(cut > d.start) & (cut < d.stop)]
        pieces += [slice(a, b) for a, b in pairwise([d.start, *map(int, inside), d.stop])]
    out = [p for p in pieces if p.stop - p.start >= MIN_ROWS]
    if not out:
        unbroken = " without a pause of the clock" if any(d.stop - d.start >= MIN_ROWS for d in rests) else ""
        longest = number_of(max((p.stop - p.start for p in pieces), default=0), "row")
        raise InputError(
            f"{recording.title!r}: the longest rest{unbroken} has {longest}, and noise takes {MIN_ROWS} or more; "
            "leave the unit alone for an hour while it is logged"
        )
    return out, step


def _without_the_earth(recording: Recording, x: Array) -> Array:
    """Return readings (n,) less the Earth's turn, which the force follows in the axes of a stabilised platform.

    Its second harmonic comes from nonlinear sensors, and both may change steadily as the platform drifts.
    """
    t = (recording.time - recording.time[0]) / (recording.time[-1] - recording.time[0])
    angle = EARTH_RATE * (recording.time - recording.time[0])
    waves = [np.ones(len(x)), *(f(k * angle) for k in (1, 2) for f in (np.cos, np.sin))]
    A = np.stack([*waves, *(t * w for w in waves[:3])], axis=-1)
    return np.asarray(x - A @ np.linalg.lstsq(A, x, rcond=None)[0])


def noise_header(channels: tuple[Channel, ...]) -> dict[str, StatedNoise]:
    """Return what `[noise]` may state: one sigma of a sample as white noise, the rms of the axes of the first sensors.

    Axes whose curve is another, or in which no white noise shows, do not count; where none is left nothing is stated.
    """
    out = {}
    for name, quantity in SENSORS.items():
        mine = [c for c in channels if c.key[0] == quantity and c.sensor == channels[0].sensor and not c.raw]
        mine = [c for c in mine if c.fitted.covariance[0, 0] > 0 and c.fitted.p_value > MIN_P_VALUE]
        if mine:
            squares = [c.fitted.square[0] * c.weight / c.curve.step for c in mine]
            out[name] = StatedNoise(float(f"{np.sqrt(np.mean(squares)):.4g}"), QUANTITIES[quantity].si)
    return out


def rest_noise(recording: Recording) -> RestNoise:
    """Return the noise of the channels of a recording as the content of noise.json.

    Raises InputError as `noise_at_rest` does.
    """
    channels = noise_at_rest(recording)
    first, shaken = channels[0].curve, max(c.shaken for c in channels)
    left_out = f"; {number_of(shaken, 'rest')} in which a sensor is shaken {'is' if shaken == 1 else 'are'} left out"
    return RestNoise(
        format=1,
        in_words=in_words(channels) + (left_out if shaken else ""),
        rests=len(first.lengths),
        seconds=float(first.lengths.sum() * first.step),
        longest_s=float(first.lengths.max() * first.step),
        rate_hz=1 / first.step,
        header=noise_header(channels),
        channels=tuple(c.result for c in channels),
        recordings=recording.source,
    )


def in_words(channels: tuple[Channel, ...]) -> str:
    """Return the answer: the largest coefficients of channels that follow the model, and those that do not."""
    unmodelled = [c.name for c in channels if c.fitted.p_value < MIN_P_VALUE]
    parts = []
    for quantity in (FORCE, RATE):
        every = [c for c in channels if c.key[0] == quantity]
        mine = [c for c in every if c.name not in unmodelled] or every  # else the numbers mean nothing
        if not mine:
            continue
        parts.append(f"{SENSOR_OF[quantity]}s: {', '.join(_largest_coefficient(mine, k) for k in range(3))}")
    sentence = "; ".join(parts)
    if unmodelled:
        one = "s" if len(unmodelled) == 1 else ""
        sentence += f"; {', '.join(unmodelled)} follow{one} no such law, sigmas are widened: look at the curve"
    late = [c.name for c in channels if c.fitted.first and c.name not in unmodelled]
    if late:
        tau = max(c.curve.tau[c.fitted.first] for c in channels if c.name in late)
        sentence += f"; {', '.join(late)} only from {tau:.3g} s on, as behind a filter"
    moved = [c.name for c in channels if c.moves and c.name not in unmodelled]
    if moved:
        sentence += (
            f"; the random walk of {', '.join(moved)} exceeds the white noise within {MIN_CROSSING_S:g} s, as of a "
            "unit in the hand or on a soft stand: it is motion, not noise of a sensor"
        )
    return sentence


def _largest_coefficient(mine: list[Channel], part: int) -> str:
    """Return the largest coefficient of a kind among channels in words."""
    names = ("white noise", "bias instability", "random walk")
    coefficients = [(c.coefficient(part), c.key[1]) for c in mine]
    determined = [pair for pair in coefficients if pair[0].significant]
    if determined:
        largest, axis = max(determined, key=lambda pair: pair[0].value)
        return f"{names[part]} {largest.value:.3g} {largest.unit} ({axis})"
    below = max(c.below for c, _ in coefficients)
    return f"{names[part]} below {below:.2g} {mine[0].units[part]}"
