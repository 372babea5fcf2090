"""Text files of the imu_tk toolkit: time and three outputs to a line, one file per triad.

Format: github.com/Kyle-ak/imu_tk, bin/test_data; data of Tedaldi, Pretto and Menegatti, "A robust and easy to implement
method for IMU calibration without external equipments", ICRA 2014. The files are called .mat and are text. The authors
logged counts; others log m/s^2 or g, and rad/s or deg/s, in the same format, so the unit follows from gravity: from its
size at rest, and from how far the gyroscopes say that it turned from one rest to the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.checks.input_errors import Correction, scale_correction
from gimbalcal.checks.measured_turns import turns_of
from gimbalcal.earth import G0
from gimbalcal.effects.effect import TRIAD
from gimbalcal.errors import InputError
from gimbalcal.importers.registry import importer
from gimbalcal.importers.unit_log import text_matrix, unit_log
from gimbalcal.quantities import refuse_unit
from gimbalcal.recording.dwell import dwells
from gimbalcal.recording.record import FORCE, RATE, Recording
from gimbalcal.units import is_raw, to_si

MAX_GRAVITY_ERROR = 0.1  # of gravity: any unit's bias and scale errors together are less, any other unit is further off
MAX_MISFIT_RAD = np.radians(20.0)  # gravity after a turn by gyroscopes that nobody calibrated, in the right unit
MIN_MISFIT_RATIO = 2.0  # times that the right unit must do better than the other


@importer("imu-tk", "accel", "gyro", single_file=False)
def import_imu_tk(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """Text files, accelerometers then gyroscopes (or the first only): time [s] and x y z in each line; accel, gyro.

    accel and gyro name the units, such as m/s^2 and deg/s; where they are not given they follow from gravity.
    """
    if len(files) not in (1, 2):
        raise InputError(f"imu-tk reads one or two files (accelerometers, gyroscopes), got {len(files)}")
    tables = [text_matrix(path, 4) for path in files]
    time = tables[0][:, 0]
    for path, table in zip(files[1:], tables[1:], strict=True):
        if len(table) != len(time) or not np.array_equal(table[:, 0], time, equal_nan=True):
            raise InputError(f"{path} does not have the times of {files[0]}; give two files of one session")
    quantities = (FORCE, RATE)[: len(files)]
    channels = {
        (q, axis): table[:, 1 + i] for q, table in zip(quantities, tables, strict=True) for i, axis in enumerate(TRIAD)
    }
    units = {FORCE: options.get("accel"), RATE: options.get("gyro")}
    for quantity, unit in units.items():
        if unit is not None:
            refuse_unit(unit, quantity)
    recording = unit_log(files[0].stem, time, channels, dict.fromkeys(channels, "count"), files)
    for quantity, by_gravity in zip(quantities, (_unit_of_force, _unit_of_rate), strict=False):
        stated = units[quantity]
        recording = _in_unit(recording, quantity, *((stated, "as stated") if stated else by_gravity(recording)))
    return recording


def _in_unit(recording: Recording, quantity: str, unit: str, why: str) -> Recording:
    """Return the recording with one triad in SI, and a remark on the unit it was taken to be in."""
    if is_raw(unit):
        return recording
    remark = f"{quantity} is taken to be in {unit}: {why}"
    units = {key: unit if key[0] == quantity else u for key, u in recording.units.items()}
    corrected = _counts_in(unit, quantity).corrected(recording)
    return replace(corrected, units=units, remarks=(*recording.remarks, remark))


def _counts_in(unit: str, quantity: str) -> Correction:
    return scale_correction(quantity, TRIAD, float(to_si(1.0, unit)), unit)


def _unit_of_force(recording: Recording) -> tuple[str, str]:
    force = recording.triad(FORCE)
    rest = np.concatenate([force[d.rows] for d in dwells(recording)]) if len(dwells(recording)) else force
    norm = float(np.median(np.linalg.norm(rest, axis=1)))
    for unit in ("m/s^2", "g"):
        if abs(to_si(norm, unit) / G0 - 1) < MAX_GRAVITY_ERROR:
            return unit, f"at rest its norm is {norm:.4g}"
    return "count", ""


def _unit_of_rate(recording: Recording) -> tuple[str, str]:
    """Return rad/s or deg/s, whichever turns gravity between dwells as the accelerometers do; else counts."""
    turns = None if recording.counted(FORCE) else turns_of(recording)
    if turns is None:
        return "count", ""
    turned = {unit: turns.turned(_counts_in(unit, RATE)) for unit in ("rad/s", "deg/s")}
    misfit = {unit: float(np.median(turns.deviation(C))) for unit, C in turned.items()}
    right, wrong = sorted(misfit, key=lambda unit: misfit[unit])
    if misfit[right] > MAX_MISFIT_RAD or misfit[wrong] < MIN_MISFIT_RATIO * misfit[right]:
        return "count", ""
    agreement = f"so it turns gravity from rest to rest to {np.degrees(misfit[right]):.2g} deg"
    return right, f"{agreement}, and in {wrong} to {np.degrees(misfit[wrong]):.2g} deg"
