"""What `import gimbalcal` offers: the commands as functions, on folders or on recordings made from arrays.

    import gimbalcal
    units = {"specific_force": "g", "angular_rate": "deg/s"}
    r = gimbalcal.from_arrays(t, specific_force=f, angular_rate=w, units=units)
    calibration = gimbalcal.calibrate(r)
    print(calibration)                       # a table; .to_frame(), .plot(), .write(path)
    found = gimbalcal.diagnose(r)
    true = calibration.apply({"time": t, "specific_force": f, "angular_rate": w}, units=units)  # in g and deg/s too
    true = calibration.apply(frame)          # a data frame of pandas or polars, in its own units

Results print as on the console, show a figure in a notebook, and have `to_frame`, `plot` and, of files, `write`.
What a file would be refused for, arrays are refused for, by an InputError with the same sentence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar, cast

from gimbalcal import methods
from gimbalcal.at_rest import RestNoise, rest_noise
from gimbalcal.calibration import Calibration, exchange
from gimbalcal.design.next_step import NextPlan
from gimbalcal.design.next_step import next_step as plan_next_step
from gimbalcal.design.next_turn import next_turn as plan_next_turn
from gimbalcal.design.position_observability import Observability, observe_any
from gimbalcal.design.turning_observability import TurningObservability, observe_turning
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.entry import diagnose as run_diagnosis
from gimbalcal.effects import Effect
from gimbalcal.errors import InputError
from gimbalcal.history.fleet import Fleet, grade_and_fleet
from gimbalcal.navigate.navigation_errors import labels
from gimbalcal.navigate.summary import NamedCalibration, NavigationInputs, NavigationSummary, summary
from gimbalcal.navigate.uncertainty import before_and_after, usual_references
from gimbalcal.pipeline import Source, load
from gimbalcal.progress import Progress, no_progress
from gimbalcal.recording import Recording, read
from gimbalcal.recording.frames import Entry
from gimbalcal.recording.frames import from_frame as from_described_frame
from gimbalcal.schedule import RotationSchedule, Schedule
from gimbalcal.schedule.file import is_rotation, read_rotation, read_schedule
from gimbalcal.simulate.simulation import simulate as simulate_scenario

__all__ = [
    "calibrate",
    "diagnose",
    "from_frame",
    "navigate",
    "next_step",
    "noise",
    "observe",
    "read_calibration",
    "simulate",
]

Names = str | Sequence[str]
File = str | Path
Item = TypeVar("Item", str, File)


def calibrate(
    recordings: Source | Sequence[Source], method: str = "", terms: Names = (), more: Names = (),
    states: str = "51", grade: str = "", progress: Progress = no_progress, without: Names = (),
) -> Calibration:  # fmt: skip
    """The calibration of a unit or a mount from one recording or several, folders or what `read` returns.

    method: as `gimbalcal calibrate --method`; left out, what `methods.usual_method` says of such recordings. terms,
    more, states, grade, without: as `--terms`, `--with`, `--states`, `--grade`, `--without`. Raises InputError as the
    command does; of several sensors logged side by side the first is returned.
    """
    calibration, _ = methods.calibrate(
        _as_list(recordings),
        method,
        _as_sequence(terms),
        progress,
        _as_sequence(more),
        states,
        grade,
        _as_sequence(without),
    )
    return _with_console_text(calibration)


def diagnose(
    recordings: Source | Sequence[Source], calibration: Calibration | None = None, baseline: Names = (),
    seed: int = 1, grade: str = "", progress: Progress = no_progress,
) -> Diagnosis:  # fmt: skip
    """Return what the model of one recording, or of several of one unit, misses, as `gimbalcal diagnose` says it."""
    from gimbalcal.report.console import diagnosis_in_words

    result = run_diagnosis(
        load(_as_list(recordings), progress), calibration, _as_sequence(baseline), seed, progress, grade
    )
    refit = result.calibration and _with_console_text(result.calibration)
    return replace(result, printer=diagnosis_in_words, calibration=refit)


def noise(recording: Source, progress: Progress = no_progress) -> RestNoise:
    """Return white noise, bias instability and random walk of every sensor of a recording from its dwells.

    As `gimbalcal noise`. Raises InputError where nothing is at rest.
    """
    r = recording if isinstance(recording, Recording) else read(recording)
    for remark in r.remarks:
        progress(f"note: {remark}")
    return rest_noise(r)


def navigate(
    recording: Source, calibrations: Mapping[str, Calibration] | Calibration | File | Sequence[File] = (),
    damping: float | None = None, alignment_min: float = 10.0, samples: int = 50, seed: int = 1,
    progress: Progress = no_progress,
) -> NavigationSummary:  # fmt: skip
    """Navigate a recording without a calibration and with each, as `gimbalcal navigate`.

    recording: a static run of a space-stable platform, or a strapdown unit that stays in its place. calibrations: one,
    several by name, or files. damping: of Schuler's oscillation by the velocity reference, of critical, None for the
    default of the mechanisation. samples: draws behind the sampled bands. Raises InputError for other recordings.
    """
    (run,) = load([recording], progress)
    given, files = calibrations, list[Path]()
    if isinstance(given, Calibration):
        given = {"calibration": given}
    elif not isinstance(given, Mapping):
        files = [Path(file) for file in _as_sequence(given)]
        given = {name: read_calibration(file) for name, file in zip(labels(files), files, strict=True)}
    aids = usual_references(run, damping, 60 * alignment_min)
    runs = before_and_after(run, list(given.items()), aids, samples, seed, progress)
    named = (NamedCalibration(name, str(file)) for name, file in zip(given, files, strict=False))
    return summary(runs, aids, NavigationInputs(run.source, tuple(named), samples, seed), run.title)


def observe(
    schedule: str | Path | Schedule | RotationSchedule, angle_sigma: float = 1.0, force_sigma: float = 2.0,
    latitude: float = 40.0, candidates: Names = (), states: str = "51", rate_noise: float = 0.002,
    force_noise: float = 5.0, velocity_sigma: float = 1e-5,
) -> Observability | TurningObservability:  # fmt: skip
    """Return what a schedule can and cannot show, before anything is recorded, as `gimbalcal observe`.

    schedule: a name, a file, or a schedule, of positions or of turns. Of positions and static runs: angle_sigma
    [arcsec], force_sigma [ug], candidates; of turns: states, rate_noise [deg/sqrt(h)], force_noise [ug/sqrt(Hz)],
    velocity_sigma [m/s]; latitude [deg]. Raises InputError for what does not exist.
    """
    if isinstance(schedule, RotationSchedule) or (not isinstance(schedule, Schedule) and is_rotation(schedule)):
        if candidates:
            raise InputError("--candidates is for positions; of a schedule of turns name them among --states")
        return observe_turning(schedule, latitude, states, rate_noise, force_noise, velocity_sigma)
    return observe_any(schedule, angle_sigma, force_sigma, latitude, _as_sequence(candidates))


def next_step(
    recordings: Source | Sequence[Source], more: Names = (), separate: Names = (),
    reach: File | Schedule | RotationSchedule = "", step: float = 45.0, most: int = 5, grade: str | Fleet = "",
    progress: Progress = no_progress, states: str = "",
) -> NextPlan:  # fmt: skip
    """Return what to record next, so that the largest unknown shrinks most in its time, as `gimbalcal next`.

    recordings: dwells of a unit, one or more, with static runs; or a unit that is turned in its place. more: effects
    to estimate in addition to the usual ones; separate: effects, EFFECT[:AXIS], to separate from each other; reach: a
    schedule, its name or its file, whose sigmas are to be reached; step [deg] of the angles of a rig; most: how many
    steps are named; grade: as `--grade`; states: as `--states`, of turns. Raises InputError for other recordings.
    """
    loaded = load(_as_list(recordings), progress)
    name, fleet = grade_and_fleet(grade)
    known = None if fleet is None else fleet.without(loaded).distributions
    prior = None if known is None else {label: d.sigma for label, d in known.items()}
    if all(r.kind.rotating for r in loaded):
        if name:
            raise InputError(f"--grade {name}: that of a unit that is turned is taken from its noise; leave it out")
        turns = reach if isinstance(reach, RotationSchedule) else read_rotation(cast(File, reach)) if reach else None
        return plan_next_turn(
            loaded, states or "51", _as_sequence(more), _as_sequence(separate), turns, most, prior, progress
        )
    if states:
        raise InputError(f"--states {states} goes with rotation recordings; leave it out")
    goal = reach if isinstance(reach, Schedule) else read_schedule(cast(File, reach)) if reach else None
    return plan_next_step(loaded, _as_sequence(more), _as_sequence(separate), goal, step, most, name, prior)


def simulate(scenario: Mapping[str, Any] | str | Path, seed: int | None = None) -> tuple[Recording, tuple[Effect, ...]]:
    """Return a recording from truth, and that truth, of a scenario: its content, its file, or the name of one.

    Raises InputError, naming the field, where the scenario cannot be run.
    """
    return simulate_scenario(scenario, seed)


def from_frame(frame: Any, columns: Mapping[str, Entry] | None = None, **options: Any) -> Recording:
    """Return a recording whose rows are those of a data frame (pandas, polars) or of a mapping of names to columns.

    columns: for each name what it holds, ``"specific_force x [g]"``, ``"time [s]"``; all options are those of
    `recording.from_frame`. Without columns they are guessed as `gimbalcal new` guesses those of a log, by names,
    numbers and what gravity does; what each was taken for stands in `remarks`. Then the options are title and site.
    """
    if columns is not None:
        return from_described_frame(frame, columns, **options)
    from gimbalcal.guess.data_frame import guessed_frame

    if unknown := set(options) - {"title", "site"}:
        raise InputError(f"{min(unknown)} needs columns, which say what the frame holds; without, give title and site")
    return guessed_frame(frame, **options)


def read_calibration(path: str | Path) -> Calibration:
    """Return the calibration in a calibration.json or a file of Kalibr (.yaml), PSINS (.mat), TPOINT (.mod) or .csv."""
    return _with_console_text(exchange.read_calibration(Path(path)))


def _with_console_text(calibration: Calibration) -> Calibration:
    """Return the calibration with the text of the console as its `str`."""
    from gimbalcal.report.console import calibration_in_words

    return replace(calibration, printer=calibration_in_words)


def _as_sequence(given: Item | Sequence[Item]) -> Sequence[Item]:
    """Return a sequence; one name or file alone becomes a sequence of it and not of its characters."""
    return [given] if isinstance(given, (str, Path)) else given


def _as_list(recordings: Source | Sequence[Source]) -> Sequence[Source]:
    if isinstance(recordings, (str, Path, Recording)):
        return [recordings]
    if isinstance(recordings, Mapping) or hasattr(recordings, "columns"):
        raise InputError("a table is no recording yet: gimbalcal.from_frame(table) makes one and guesses what it holds")
    if not recordings:
        raise InputError("give at least one recording: a folder, or what from_arrays, from_frame or read returns")
    return recordings
