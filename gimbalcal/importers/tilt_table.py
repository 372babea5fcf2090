"""A seismometer and a rotation sensor on a table that is tilted in steps (Bernauer et al., 2020; data of TwistPy).

The archive `tilt_table_200hz.npz` holds velocities ``vel_HHN, HHE, HHZ`` [m/s], the instrument's response removed, and
rates ``rate_HJN, HJE, HJZ`` [rad/s], at ``fs`` samples a second. A seismometer blocks what is constant: its
acceleration is specific force less its mean, so gravity shows only where the table tilts. Axes here are x north, y
east, z down.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.registry import DAMAGED, importer
from gimbalcal.importers.unit_log import unit_log
from gimbalcal.number import Array
from gimbalcal.recording.memory_limit import refuse_packed_bomb
from gimbalcal.recording.record import FORCE, RATE, Key, Recording

_AXES = {"x": ("N", 1.0), "y": ("E", 1.0), "z": ("Z", -1.0)}  # Z of a seismometer is up


@importer("tilt-table")
def import_tilt_table(files: Sequence[Path], _options: Mapping[str, str]) -> Recording:
    """One .npz archive: vel_HHN, vel_HHE, vel_HHZ [m/s], rate_HJN, rate_HJE, rate_HJZ [rad/s] and fs [Hz]."""
    (path,) = files
    names = [f"{prefix}{letter}" for letter, _ in _AXES.values() for prefix in ("vel_HH", "rate_HJ")]
    try:
        refuse_packed_bomb(path)
        with np.load(path) as archive:
            arrays = {name: np.asarray(archive[name], dtype=float) for name in [*names, "fs"]}
    except InputError:
        raise
    except DAMAGED as error:
        raise InputError(
            f"{path} is not the archive of a tilt table, it must hold {', '.join(names)}, fs: {error}"
        ) from None
    rate = float(arrays["fs"].ravel()[0]) if arrays["fs"].size else 0.0
    sizes = {arrays[name].shape for name in names}
    if not (np.isfinite(rate) and rate > 0) or len(sizes) > 1 or len(next(iter(sizes))) != 1 or max(sizes) < (3,):
        raise InputError(f"{path}: fs must be a rate above 0 Hz, and all channels must be vectors of one length")
    bad = next((name for name in names if not np.isfinite(arrays[name]).all()), "")
    if bad:
        raise InputError(f"{path}: {bad} holds what is no number; leave such rows out")
    channels: dict[Key, Array] = {}
    for axis, (letter, sign) in _AXES.items():
        channels[FORCE, axis] = sign * np.gradient(arrays[f"vel_HH{letter}"], 1 / rate)
        channels[RATE, axis] = sign * arrays[f"rate_HJ{letter}"]
    units = {key: "m/s^2" if key[0] == FORCE else "rad/s" for key in channels}
    time = np.arange(len(arrays[names[0]])) / rate
    remark = "accelerations are differentiated velocities of a seismometer: their mean is not specific force"
    return replace(unit_log(path.stem, time, channels, units, files, kind="rotation"), remarks=(remark,))
