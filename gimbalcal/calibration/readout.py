r"""The readout of a unit: counts of its sensors, and the names of its gimbals.

Readings in counts N are brought to SI by a nominal scale k and offset N_0 before any effect is applied,

.. math:: y = k \, (N - N_0) ,

so that scale factor and bias of a calibration are errors of these. A gimbal's zero is counted as the platform's drawing
counts the angle, in whichever sense a recording logs it (`Platform.sense`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimbalcal.effects.effect import TRIAD
from gimbalcal.entries import Entry, Json, entry_from
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording import Recording
from gimbalcal.recording.record import COLOURED, FORCE, RATE, SENSORS

DRAWING = "drawing"  # sense in which a file counts `gimbal_zero`: that of the platform's drawing


@dataclass(frozen=True)
class Counts:
    """Nominal scale [SI per count] and offset [count] of the axes x, y, z of a triad that reads in counts."""

    scale: tuple[float, ...]
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)

    def to_si(self, N: Array) -> Array:
        """Return SI (n, 3) of counts (n, 3)."""
        return np.asarray(np.array(self.scale) * (N - np.array(self.offset)))

    def from_si(self, y: Array) -> Array:
        """Return counts (n, 3) of SI (n, 3)."""
        return np.asarray(y / np.array(self.scale) + np.array(self.offset))


@dataclass(frozen=True)
class Readout:
    """Nominal counts of accelerometers and gyroscopes (None: their output is in SI), and gimbals."""

    accelerometers: Counts | None = None
    gyroscopes: Counts | None = None
    gimbals: tuple[str, ...] = ()  # names of the platform's axes, platform first; none for a unit without gimbals

    @property
    def counts(self) -> dict[str, Counts]:
        """Nominal counts by quantity, of the triads whose output is in counts."""
        every = {FORCE: self.accelerometers, RATE: self.gyroscopes}
        return {quantity: counts for quantity, counts in every.items() if counts is not None}

    def to_dict(self) -> Json:
        """Return the content of `readout` in calibration.json; scales in SI per count."""
        triads = {"accelerometers": self.accelerometers, "gyroscopes": self.gyroscopes}
        return {
            **{k: c and {"scale": list(c.scale), "offset": list(c.offset)} for k, c in triads.items()},
            "gimbals": list(self.gimbals),
            "angles": DRAWING,
        }


def from_content(content: Json) -> Readout:
    """Return the readout in the content of calibration.json; SI and no gimbals where the file states none."""
    if content.get("readout") is None:
        return Readout()
    stated = entry_from(ReadoutRow, content["readout"], "readout")
    if stated.angles != DRAWING:
        raise InputError(f"readout / angles must be {DRAWING!r}, got {stated.angles!r}; calibrate again")
    return Readout(_counts_by_quantity(stated.accelerometers), _counts_by_quantity(stated.gyroscopes), stated.gimbals)


@dataclass(frozen=True)
class CountsRow(Entry):
    """Scale [SI per count] and offset of a triad in calibration.json, by axis or one for all."""

    scale: float | tuple[float, float, float]
    offset: float | tuple[float, float, float] = 0.0


@dataclass(frozen=True)
class ReadoutRow(Entry):
    """The readout in calibration.json."""

    accelerometers: CountsRow | None
    gyroscopes: CountsRow | None
    gimbals: tuple[str, ...]
    angles: Any


def _counts_by_quantity(stated: CountsRow | None) -> Counts | None:
    if stated is None:
        return None
    scale, offset = (np.broadcast_to(x, 3) for x in (stated.scale, stated.offset))
    if not (np.isfinite([scale, offset]).all() and scale.all()):
        raise InputError("readout: the scale of counts must be finite and not zero, and the offset finite")
    return Counts(tuple(map(float, scale)), tuple(map(float, offset)))


def in_si(recording: Recording, readout: Readout) -> Recording:
    """Return the recording with its counts in SI, as the readout scales them: values, scatter and noise."""
    for quantity, counts in readout.counts.items():
        if recording.has(quantity) and recording.counted(quantity):
            y = counts.to_si(recording.triad(quantity))
            recording = _in_other_unit(recording, quantity, y, np.abs(counts.scale), QUANTITIES[quantity].si)
    return recording


def in_counts(recording: Recording, readout: Readout) -> Recording:
    """Return the recording in the counts of the unit, the inverse of `in_si`; unequal axes give the mean of a sigma."""
    for quantity, counts in readout.counts.items():
        if recording.has(quantity):
            N = counts.from_si(recording.triad(quantity))
            recording = _in_other_unit(recording, quantity, N, 1 / np.abs(counts.scale), "count")
    return recording


def with_noise(recording: Recording, quantity: str, gain: Array) -> Recording:
    """Return the recording with noise and scatter of a triad propagated through a gain (n, 3, 3) row by row.

    Noise that is stated as one sigma of all axes remains one: the root mean square of the three.
    """
    square = (gain**2).mean(axis=0)  # of output i by input j
    by_axis = np.array([recording.scatter.get((quantity, a), np.nan) for a in TRIAD])
    known = np.where(np.isfinite(by_axis), by_axis, 0.0)
    out = np.sqrt(square @ known**2)
    factor = float(np.sqrt(square.sum(axis=1).mean()))
    return replace(
        recording,
        noise=_sizes_scaled(recording.noise, quantity, factor),
        scatter=dict(recording.scatter)
        | {(quantity, a): float(out[i]) for i, a in enumerate(TRIAD) if np.isfinite(by_axis[i])},
    )


def _in_other_unit(recording: Recording, quantity: str, values: Array, scale: Array, unit: str) -> Recording:
    """Return the recording with values (n, 3) of a quantity in another unit, its scatter and noise times scale (3,)."""
    by_axis = {(quantity, a): float(scale[i]) for i, a in enumerate(TRIAD)}
    return replace(
        recording.with_channels({(quantity, a): values[:, i] for i, a in enumerate(TRIAD)}),
        units={**recording.units, **{(quantity, a): unit for a in TRIAD}},
        scatter={k: v * by_axis.get(k, 1.0) for k, v in recording.scatter.items()},
        noise=_sizes_scaled(recording.noise, quantity, float(scale.mean())),
    )


def _sizes_scaled(noise: Mapping[str, float], quantity: str, factor: float) -> dict[str, float]:
    """Return noise as in a header with the sizes of one quantity times a factor; time constants do not change."""
    of = {**SENSORS, **{key: q for key, (q, unit_of) in COLOURED.items() if unit_of != "time"}}
    return {key: size * factor if of.get(key) == quantity else size for key, size in noise.items()}
