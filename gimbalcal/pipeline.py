"""The three stages of Wu et al. (2018), in the paper's order, on one screen.

    recording ──> coarse ──> fine ──> system level ──> calibration with covariance, and what was not seen

`gimbalcal calibrate`, `gimbalcal demo` and the notebooks run this script.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from gimbalcal.calibration import Calibration
from gimbalcal.checks.table import refuse_implausible
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.accelerometers.coarse import coarse
from gimbalcal.estimate.accelerometers.fine import fine
from gimbalcal.estimate.accelerometers.joint import joint
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions, view_of_every_row
from gimbalcal.estimate.extra_effects import NO_EXTENSION, ExtraEffect, extra_effects
from gimbalcal.estimate.fit import fit
from gimbalcal.estimate.grade import grade_of_unit
from gimbalcal.estimate.static_run.system import (
    both_levels,
    calibrate_static_run,
    fuse_stages,
    static_parameters,
    static_readings,
    static_view_with,
)
from gimbalcal.method_table import Request
from gimbalcal.progress import Progress, no_progress
from gimbalcal.recording import Recording, dwells, read, with_rests_as_positions
from gimbalcal.recording.header import read_header
from gimbalcal.recording.record import RATE

Source = str | Path | Recording  # a folder, or what was read from one or made from arrays
FEWEST_POSITIONS = 6
MOST_ROWS = 10_000_000  # of a recording of positions, 1.3 GB; of more, rests are read as means
STATIC_BLOCK = 60.0  # s; a static run is read as minute means: no effect of the catalogue lives below 3 min


def load(recordings: Sequence[Source], progress: Progress = no_progress) -> tuple[Recording, ...]:
    """Read recordings from their folders, or take them as they are, and refuse those that cannot be what they say.

    A static run that is read comes as minute means, and rests of more than `MOST_ROWS` rows of positions as means. A
    recording in memory gets the rests and the scatter of its rows that reading would have given it.
    """
    loaded = []
    for each in recordings:
        if isinstance(each, Recording):
            recording = with_rests_as_positions(each)
        else:
            progress(f"reading {Path(each).name}")
            static_run = read_header(Path(each)).kind.stabilised
            recording = read(Path(each), average_s=STATIC_BLOCK if static_run else None, most=MOST_ROWS)
        unchecked = [remark for sensor in recording.sensors for remark in refuse_implausible(sensor)]
        recording = replace(recording, remarks=(*recording.remarks, *unchecked))
        for remark in recording.remarks:
            progress(f"note: {remark}")
        loaded.append(recording)
    return tuple(loaded)


def calibrate_in_three_stages(request: Request) -> Calibration:
    """Calibrate by the three stages, and say in the options why gyroscopes that were logged take no part."""
    recordings = request.recordings
    fitted = tuple(i for r in sorted(recordings, key=lambda r: r.kind.in_positions) for i in r.kind.baseline)
    extra = extra_effects(request.more, recordings, fitted)
    calibration = three_stage(recordings, request.progress, extra, request.grade)
    if not any(r.has(RATE) for r in recordings):
        return calibration
    why = (
        "the three stages calibrate accelerometers; --method multiposition takes both triads, and --method rate-table "
        "compares gyroscopes with the angles of the table that turns them"
    )
    return replace(calibration, provenance=calibration.provenance.with_options(gyroscopes=why))


def three_stage(
    recordings: Sequence[Recording], progress: Progress = no_progress, more: Sequence[ExtraEffect] = (), grade: str = ""
) -> Calibration:
    """Calibrate the accelerometers of a space-stable platform from a multi-position recording, a static run, or both.

    1. coarse: faces give scale factors and biases, tilted positions gimbal zeros and misalignments (section 3);
    2. fine: the norm of the force at every position, then all 18 coefficients jointly with each position's setting
       error (section 4, Eqs. (8)-(17), and beyond);
    3. system level: force, gimbals and attitude error of the static run (section 5), added as information.

    `more` joins the fits of stage 2 and 3; `grade` is that of the unit, by which sizes are expected (else it is
    estimated from the noise). Raises InputError when there is neither kind of recording, or two of a kind.
    """
    recordings = [with_rests_as_positions(r) for r in recordings]
    unit = grade_of_unit(recordings, grade)
    progress(unit.in_words)
    calibration = _three_stages(unit.of(recordings), progress, more)
    return replace(calibration, provenance=calibration.provenance.with_options(grade=unit.origin))


def _three_stages(recordings: Sequence[Recording], progress: Progress, more: Sequence[ExtraEffect]) -> Calibration:
    device, run = _one_of_each(recordings)
    at_rest = static_readings(run) if run is not None else None
    if device is None and at_rest is not None:
        progress("system level: static run alone")
        wanted = static_parameters(at_rest)
        extra = fit([static_view_with(at_rest, more)], wanted).extension(more) if more else NO_EXTENSION
        return extra.complete(calibrate_static_run(at_rest, extra.effects, (*wanted, *extra.parameters)))
    if device is None:
        raise InputError("`calibrate` needs a multi-position recording, a static run, or one of each")

    _refuse_too_little(device)
    positions = trusted_positions(device)
    progress("stage 1: coarse, from faces and tilted positions")
    first = coarse(positions)
    progress("stage 2: fine, from the norm of the force at every position")
    second = fine(positions, first)
    progress("stage 2: all 18 coefficients jointly, with the setting error of each position")
    extra = NO_EXTENSION
    if more:
        views, wanted = [view_of_every_row(device, positions, more)], positions.fit.parameters
        if at_rest is not None:
            views.append(static_view_with(at_rest, more))
            wanted = tuple(dict.fromkeys((*wanted, *static_parameters(at_rest))))
        extra = fit(views, wanted).extension(more)
        shown = extra.shown(device.why_not_shown)
        positions = trusted_positions(device, shown.effects, shown.parameters)
    both = joint(positions, second)
    stages = (*first.stages, *second.stages, *both.stages)
    if at_rest is None:
        return extra.complete(replace(both, method="three-stage", stages=stages))

    progress("stage 3: system level, force, gimbals and attitude error of the static run")
    wanted = (*static_parameters(at_rest), *extra.shown(at_rest.recording.why_not_shown).parameters)
    absent = tuple(e for e in extra.effects if e.id not in {o.id for o in both.effects})
    both = replace(both, effects=(*both.effects, *absent))
    third = fuse_stages(both, *both_levels(positions, at_rest, both.effects, wanted))
    alone = calibrate_static_run(at_rest).stages
    return extra.complete(replace(third, method="three-stage", stages=(*stages, *alone, *third.stages)))


def _refuse_too_little(device: Recording) -> None:
    """The vector fit needs the gimbal angles, and three numbers at each of six positions for its 17 coefficients."""
    if device.platform.axes and not device.has("gimbal_angle"):
        raise InputError(
            f"{device.title!r} has no gimbal_angle column, so its attitude is not known; add the readouts to "
            "[columns], or calibrate it from the norm of the force with --method multiposition"
        )
    positions = sorted({d.position for d in dwells(device)})
    if len(positions) < FEWEST_POSITIONS:
        raise InputError(
            f"{device.title!r} holds {number_of(len(positions), 'position')} "
            f"({', '.join(map(str, positions))}), from "
            f"which the errors of three accelerometers cannot be determined; hold {FEWEST_POSITIONS} or more, each "
            "axis up, down and tilted"
        )


def _one_of_each(recordings: Sequence[Recording]) -> tuple[Recording | None, Recording | None]:
    by_kind: dict[str, Recording] = {}
    for recording in recordings:
        if not recording.kind.at_rest:
            raise InputError(
                f"{recording.title!r} is a {recording.kind} recording; the three stages take a multi-position "
                "recording and a static run (for others see `gimbalcal calibrate --method`)"
            )
        if (other := by_kind.get(recording.kind)) is not None:
            raise InputError(
                f"{other.title!r} and {recording.title!r} are both {recording.kind} recordings; "
                "give one of each kind, and calibrate the other alone"
            )
        by_kind[recording.kind] = recording
    return by_kind.get("multi-position"), by_kind.get("static-run")
