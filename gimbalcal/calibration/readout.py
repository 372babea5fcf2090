r"""How a unit is read: counts of its sensors, names of its gimbals, and the sense in which their zeros are counted.

Readings in counts N are brought to SI by a nominal scale k and offset N_0 before any effect is applied,

.. math:: y = k \, (N - N_0) ,

so that scale factor and bias of a calibration are errors of these. A gimbal's zero is counted as the platform's drawing
counts the angle, whichever way a recording logs it (`Platform.sense`); static runs were once calibrated in the sense
of their own readouts S_t, h, q, which `Readout.angles` can say of an old file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import COLOURED, FORCE, RATE, SENSORS

SI = {FORCE: "m/s^2", RATE: "rad/s"}
AXES = ("x", "y", "z")
DRAWING, INERTIAL = "drawing", "inertial"  # `Readout.angles`: as the platform's drawing, or as S_t, h, q of Eq. (4)


@dataclass(frozen=True)
class Counts:
    """Nominal scale [SI per count] and offset [count] of the axes x, y, z of a triad that reads in counts."""

    scale: tuple[float, ...]
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)

    def to_si(self, N: Array) -> Array:
        """SI (n, 3) of counts (n, 3)."""
        return np.asarray(np.array(self.scale) * (N - np.array(self.offset)))

    def from_si(self, y: Array) -> Array:
        """Counts (n, 3) of SI (n, 3)."""
        return np.asarray(y / np.array(self.scale) + np.array(self.offset))


@dataclass(frozen=True)
class Readout:
    """Nominal counts of accelerometers and gyroscopes (None: they read in SI), and gimbals."""

    accelerometers: Counts | None = None
    gyroscopes: Counts | None = None
    gimbals: tuple[str, ...] = ()  # names of the platform's axes, platform first; none for a unit without gimbals
    angles: str = DRAWING  # sense in which `gimbal_zero` is counted

    @property
    def counts(self) -> dict[str, Counts]:
        """Nominal counts by quantity, of the triads that read in counts."""
        every = {FORCE: self.accelerometers, RATE: self.gyroscopes}
        return {quantity: counts for quantity, counts in every.items() if counts is not None}

    def to_dict(self) -> dict[str, Any]:
        """The content of `readout` in calibration.json; scales in SI per count."""
        triads = {"accelerometers": self.accelerometers, "gyroscopes": self.gyroscopes}
        return {
            **{k: c and {"scale": list(c.scale), "offset": list(c.offset)} for k, c in triads.items()},
            "gimbals": list(self.gimbals),
            "angles": self.angles,
        }


def from_content(content: Mapping[str, Any]) -> Readout:
    """The readout in the content of calibration.json; files that are older than it tell it in other places."""
    if "readout" in content:
        told = content["readout"]
        accelerometers, gyroscopes = (_counts(told[k]) for k in ("accelerometers", "gyroscopes"))
        return Readout(accelerometers, gyroscopes, tuple(told["gimbals"]), told["angles"])
    options = content["provenance"].get("options", {})
    angles = INERTIAL if content.get("method") == "static-run" else DRAWING
    return Readout(_counts(options.get("nominal")), _counts(options.get("gyro_nominal")), (), angles)


def _counts(told: Mapping[str, Any] | None) -> Counts | None:
    if not told:
        return None
    scale, offset = (np.broadcast_to(told.get(key, 0.0), 3) for key in ("scale", "offset"))
    return Counts(tuple(map(float, scale)), tuple(map(float, offset)))


def in_si(recording: Recording, readout: Readout) -> Recording:
    """The recording with what it reads in counts in SI, as the readout scales it: values, scatter and noise."""
    for quantity, counts in readout.counts.items():
        if recording.has(quantity) and recording.counted(quantity):
            y = counts.to_si(recording.triad(quantity))
            recording = _scaled(recording, quantity, y, np.abs(counts.scale), SI[quantity])
    return recording


def in_counts(recording: Recording, readout: Readout) -> Recording:
    """The recording as the unit reads it, the inverse of `in_si`; one sigma of unlike axes takes their mean."""
    for quantity, counts in readout.counts.items():
        if recording.has(quantity):
            N = counts.from_si(recording.triad(quantity))
            recording = _scaled(recording, quantity, N, 1 / np.abs(counts.scale), "count")
    return recording


def with_noise(recording: Recording, quantity: str, gain: Array) -> Recording:
    """The recording with the noise and the scatter of a triad that has been through a gain (n, 3, 3) row by row.

    Noise that is alike on all axes, stated as one sigma, stays one: the root of the mean square of the three.
    """
    square = (gain**2).mean(axis=0)  # of output i by input j
    by_axis = np.array([recording.scatter.get((quantity, a), np.nan) for a in AXES])
    known = np.where(np.isfinite(by_axis), by_axis, 0.0)
    out = np.sqrt(square @ known**2)
    factor = float(np.sqrt(square.sum(axis=1).mean()))
    return replace(
        recording,
        noise=_sizes_scaled(recording.noise, quantity, factor),
        scatter=dict(recording.scatter)
        | {(quantity, a): float(out[i]) for i, a in enumerate(AXES) if np.isfinite(by_axis[i])},
    )


def _scaled(recording: Recording, quantity: str, values: Array, scale: Array, unit: str) -> Recording:
    """Other values (n, 3) of a quantity in another unit, with its scatter and noise times scale (3,)."""
    by_axis = {(quantity, a): float(scale[i]) for i, a in enumerate(AXES)}
    return replace(
        recording,
        channels={**recording.channels, **{(quantity, a): values[:, i] for i, a in enumerate(AXES)}},
        units={**recording.units, **{(quantity, a): unit for a in AXES}},
        scatter={k: v * by_axis.get(k, 1.0) for k, v in recording.scatter.items()},
        noise=_sizes_scaled(recording.noise, quantity, float(scale.mean())),
    )


def _sizes_scaled(noise: Mapping[str, float], quantity: str, factor: float) -> dict[str, float]:
    """Noise as a header states it, its sizes of one quantity times a factor; time constants stay as they are."""
    of = {**SENSORS, **{key: q for key, (q, given) in COLOURED.items() if given != "time"}}
    return {key: size * factor if of.get(key) == quantity else size for key, size in noise.items()}
