r"""The grade of a unit, from how its sensors scatter at rest: what is quiet is made well.

.. math:: N^2 = \tfrac12 \left\langle (\bar y_{k+1} - \bar y_k)^2 \right\rangle \tau

with means over tau = 1 s of readings at rest: the noise as a random walk, which is what data sheets print and what
neither the rate of the samples nor a filter in front of them changes. Source: IEEE Std 952, Allan variance at 1 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Readout
from gimbalcal.calibration.provenance import AssumedGrade
from gimbalcal.calibration.readout import in_si
from gimbalcal.effects.sensor_grades import DEG_ROOT_H, GRADES, UG, Grade, grade_named, grade_of_noise
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording import SENSORS, Dwell, Recording, dwell_means, dwells
from gimbalcal.recording.dwell import rests_are_means, whole_means
from gimbalcal.recording.noise_levels import resolution
from gimbalcal.views.norm import scaled_by_gravity

AVERAGING_S = 1.0  # s of a mean; data sheets print the noise at this time
TRIADS = ("accelerometer", "gyroscope")


@dataclass(frozen=True)
class Graded:
    """A grade, and what it was taken from."""

    grade: Grade
    source: str

    def of(self, recordings: Sequence[Recording]) -> list[Recording]:
        """The recordings as those of a unit of this grade."""
        return [r if r.grade is self.grade else replace(r, grade=self.grade) for r in recordings]

    @property
    def in_words(self) -> str:
        """One sentence."""
        return f"the unit is taken for {self.grade.name} grade: {self.source} (another: --grade)"

    @property
    def origin(self) -> AssumedGrade:
        """The entry of the provenance."""
        return AssumedGrade(self.grade.name, self.source)


def grade_of_unit(recordings: Sequence[Recording], name: str = "") -> Graded:
    """The grade of the unit of these recordings: the one that is named, else by its noise, else by its platform.

    Raises InputError for a name that is none.
    """
    if name:
        return Graded(grade_named(name), "--grade says so")
    stabilised = [r for r in recordings if r.kind.stabilised]
    force, rate = (
        _median_of_known([random_walk_size(r, s) for r in recordings if r not in stabilised]) for s in TRIADS
    )
    if stabilised and force is None:
        return Graded(GRADES["navigation"], "its gyroscopes hold a platform still in inertial space")
    reasons = [] if force is None else [f"accelerometers scatter by {_two_digits(force / UG)} ug in a mean over 1 s"]
    reasons += [] if rate is None else [f"gyroscopes by {_two_digits(rate / DEG_ROOT_H)} deg/sqrt(h)"]
    if reasons:
        return Graded(grade_of_noise(force, rate), f"{' and '.join(reasons)}")
    gimbals = any(r.platform.axes for r in recordings)
    what = "assumed on gimbals" if gimbals else "assumed of a unit without gimbals"
    assumed = GRADES["navigation" if gimbals else "consumer"]
    return Graded(assumed, f"{what}, since the rows show no noise")


def refuse_for_mounts(name: str) -> None:
    """Raise InputError where a grade is named for pointing runs, in which no inertial sensor is."""
    if name:
        raise InputError(
            f"--grade {name} speaks of inertial sensors, and a pointing run has none: leave it out; the terms of a "
            "mount are expected from a tenth to thirty times the catalogue's size"
        )


def random_walk_size(recording: Recording, sensor: str) -> float | None:
    """Noise of a triad [m/s^2 sqrt(s) or rad/s sqrt(s)] as a random walk: stated, else seen; None where it is neither.

    Gyroscopes that count say nothing; accelerometers that count have gravity for a scale.
    """
    quantity = SENSORS[sensor]
    recording = whole_means(recording) if rests_are_means(recording) else recording
    visits = dwells(recording)
    step = _usual_step(recording.time, recording.weight, visits)
    if step is None or not recording.has(quantity):
        return None
    if recording.counted(quantity):
        if sensor == "gyroscope":
            return None
        try:
            counts = scaled_by_gravity(dwell_means(recording))[1]
        except InputError:  # too few rests to tell how much a count is
            return None
        recording = in_si(recording, Readout(accelerometers=counts))
    sigma = recording.noise.get(sensor)
    if sigma is None:
        rests = visits if recording.position is not None else []
        means = _of_means(
            np.stack([recording.channels[quantity, a] for a in recording.axes(quantity)], -1), rests, step
        )
        if means is not None:
            return means
        sigma = recording.sigma(sensor)
    return None if sigma is None else sigma * float(np.sqrt(step / np.median(recording.weight)))


def _usual_step(time: Array, weight: Array, stays: Sequence[Dwell]) -> float | None:
    """Usual time [s] from a row to the next in one dwell, or from dwell to dwell where these are the rows.

    A reading that comes less than once a second is taken for one of a second: nobody says that it is a longer mean.
    """
    within = np.concatenate([np.diff(time[d.rows]) for d in stays] or [np.zeros(0)])
    step, samples = np.diff(time), float(np.median(weight))
    if not len(within) and (samples == 1 or not len(step)):
        return None
    return min(float(np.median(within if len(within) else step)), AVERAGING_S * samples)


def _of_means(x: Array, stays: Sequence[Dwell], step: float) -> float | None:
    """Return the scatter of means of readings (n, C) over a second at rest, at least that of a converter step.

    None where no dwell holds two means.
    """
    size, squares = max(1, round(AVERAGING_S / step)), []
    for d in stays:
        n = (d.stop - d.start) // size
        if n > 1:
            means = x[d.start : d.start + n * size].reshape(n, size, -1).mean(axis=1)
            squares.append((np.diff(means, axis=0) ** 2 / 2).mean(axis=0))
    if not squares:
        return None
    coarse = max(map(resolution, x.T)) / np.sqrt(12 * size)
    return float(max(np.sqrt(np.median(squares)), coarse) * np.sqrt(size * step))


def _median_of_known(values: Sequence[float | None]) -> float | None:
    known = [x for x in values if x is not None]
    return float(np.median(known)) if known else None


def _two_digits(x: float) -> str:
    return f"{float(f'{x:.2g}'):g}"
