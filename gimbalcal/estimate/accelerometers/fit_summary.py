"""Report of a fit of a multi-position recording: residual, stage, outcome and provenance of a Calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import AssumedNoise, Provenance, StageResult
from gimbalcal.estimate.accelerometers.position_fit import RESIDUAL, Fault, Positions, fit_with_noise, noise_deviance
from gimbalcal.estimate.fit import information_of
from gimbalcal.inference.information import Unobservable, solve
from gimbalcal.number import apply_matrix
from gimbalcal.p_value import is_explained_by_chance, probability
from gimbalcal.recording.record import FOLLOWED, FORCE
from gimbalcal.schedule import SCHEDULES, Schedule
from gimbalcal.units import from_si
from gimbalcal.views.positions import Noise, planned_recording, view_of_positions

NOTABLE_SIGMA_RATIO = 1.5  # every sigma that grew by more than this is reported; else the one that grew most
SAME_DIRECTION_RAD = np.deg2rad(10.0)  # angle between two forces within which they count as one position of a schedule


def rms(p: Positions) -> Mapping[str, float]:
    """Root mean square [m/s^2] by channel of what is left when setting errors are taken out."""
    mean_square = np.average(p.fit.residual[0] ** 2, axis=0, weights=p.view.source.weight)
    return {f"{FORCE}:{axis}": float(np.sqrt(v)) for axis, v in zip("xyz", mean_square, strict=True)}


def fit_stage(name: str, p: Positions, in_words: str) -> StageResult:
    """The fit as a stage of the calibration: estimate, sigma, and rms of the misfit with setting errors left in."""
    residual = p.view.evaluate(p.fit.effects).residual
    return p.fit.stage(name, in_words, float(np.sqrt(np.mean(residual**2))))


def fit_outcome(p: Positions, larger: str) -> str:
    """Return why this calibration should not be used as it is; empty where nothing speaks against it.

    larger: which larger noise would explain the misfit, as `larger_noise` says it.
    """
    sentences = outliers_in_words(p.faults)
    if not p.fit.steps:
        sentences.append("the fit did not converge, so its numbers mean nothing: check signs, axes and units")
    else:
        sentences += misfit_in_words(p.fit.solution.chi2, p.fit.solution.dof, larger)
    return joined_sentences(sentences)


def outliers_in_words(faults: Sequence[Fault]) -> list[str]:
    """One sentence about all positions that were left out, in a list; empty if none was."""
    if not faults:
        return []
    left_out = "it was" if sum(len(f.visits) for f in faults) == 1 else "they were"
    return ["; ".join(f.in_words for f in faults) + f"; {left_out} left out of the fit"]


def misfit_in_words(chi2: float, dof: int, larger: str = "") -> list[str]:
    """One sentence, in a list, where a residual this large is not due to chance; empty where it may be."""
    so = f"{'; else' if larger else ', so'} the model misses something: `gimbalcal diagnose` looks for it"
    return [words + so for words in excess_in_words(chi2, dof, larger)]


def excess_in_words(chi2: float, dof: int, larger: str) -> list[str]:
    """Return, as a list, how far a residual is above its noise and which larger noise explains it; empty for chance."""
    if is_explained_by_chance(chi2, dof):
        return []
    excess = f"chi^2 = {chi2:.4g} for {dof} degrees of freedom, p = {probability(chi2, dof):.1g}"
    words = f"the residual is {np.sqrt(chi2 / dof):.3g} times what the noise allows ({excess})"
    return [", ".join(filter(None, [words, larger]))]


def larger_noise_in_words(p: Positions) -> str:
    """Words "explained only if ..." for a misfit that one larger noise, at its most likely size, explains; else empty.

    The setting repeatability is tried, and outputs that wander from one visit to the next.
    """
    fit, s = p.fit, p.fit.solution
    if not fit.steps or is_explained_by_chance(s.chi2, s.dof):
        return ""
    causes = []
    opened = {
        "setting": replace(p.noise, setting_from=RESIDUAL),
        "accelerometer": replace(p.noise, accelerometer_from=RESIDUAL),
    }
    for name, noise in opened.items():
        stated = getattr(p.noise, name)
        if getattr(p.noise, f"{name}_from") == RESIDUAL or not 0 < stated < np.inf:
            continue
        free = fit_with_noise(p.view, noise, fit.parameters, fit.absent, s.x)
        times = getattr(free.noise, name) / stated
        if free.fit.steps and times > 1 and is_explained_by_chance(free.fit.solution.chi2, free.fit.solution.dof):
            causes.append((noise_deviance(free, free.noise), name, times))
    if not causes:
        return ""
    _, name, times = min(causes)
    if name == "setting":
        return f"explained only if the setting repeatability is {times:.2g} times the stated"
    mean = p.noise.accelerometer / np.sqrt(float(np.median(p.view.source.weight)))
    wander = from_si(float(np.sqrt(times**2 - 1) * mean), "ug")
    return f"explained only if the outputs wander by {wander:.2g} ug from one position to the next"


def joined_sentences(sentences: Sequence[str]) -> str:
    """Return sentences in a row, each with its capital and without the last stop; empty ones are left out."""
    return ". ".join(s[0].upper() + s[1:].rstrip(".") for s in sentences if s)


def provenance(p: Positions) -> Provenance:
    """Return the provenance: files, noise and its source, visits left out, setting errors, positions missing."""
    recording = p.view.source
    names = recording.platform.axis_names
    return Provenance(
        recordings=recording.source,
        noise=assumed_noise(p.noise),
        setting_errors_arcsec=tuple(
            {"position": int(position), **dict(zip(names, np.round(e, 4).tolist(), strict=True))}
            for position, e in zip(p.numbers, from_si(p.setting, "arcsec"), strict=True)
        ),
        left_out=tuple(tuple(f.positions) for f in p.faults),
        lost=loss_by_skipped_positions(p) or None,
        remarks=recording.remarks,
    )


def assumed_noise(noise: Noise) -> AssumedNoise:
    """Return noise and its source, in printed units."""
    return AssumedNoise(
        accelerometer_ug=float(from_si(noise.accelerometer, "ug")),
        accelerometer_from=noise.accelerometer_from,
        gimbal_angle_arcsec=float(from_si(noise.setting, "arcsec")),
        gimbal_angle_from=noise.setting_from,
    )


def rotations_of_the_triad() -> list[Unobservable]:
    """The three turns of all input axes alike, which change no norm, as entries of `unobservable`."""
    pairs = (("yx", "zx", "x"), ("xy", "zy", "y"), ("xz", "yz", "z"))
    return [
        Unobservable(
            {f"misalignment:{a}": 1.0, f"misalignment:{b}": 1.0},
            f"turning all three input axes about {axis} changes no norm; convention: x of the frame lies along the "
            "first input axis and y in the plane of the first two (xy, xz and yx are zero)",
        )
        for a, b, axis in pairs
    ]


def loss_by_skipped_positions(p: Positions) -> str:
    """Return in a sentence what skipped positions of a published schedule would have added."""
    recording, fit, solution = p.view.source, p.fit, p.fit.solution
    schedule = next((s for s in SCHEDULES.values() if _follows_schedule(p, s)), None)
    missing = sorted(set(range(1, len(schedule.holds) + 1)) - {int(q) for q in p.numbers}) if schedule else []
    if schedule is None or not missing:
        return ""
    extra = planned_recording(schedule, float(np.median(recording.weight))).select(np.array(missing) - 1)
    logged = {key: np.full(len(missing), x.mean()) for key, x in recording.channels.items() if key[0] in FOLLOWED}
    extra = extra.with_channels(logged)  # of effects that follow them
    views = [p.view, view_of_positions(extra, p.noise, sorted(p.view.acting or ()))]
    full = solve(information_of(views, fit.effects, fit.parameters))
    grown = solution.sigma / full.sigma
    worst = [i for i in np.argsort(-grown) if grown[i] > NOTABLE_SIGMA_RATIO] or [int(np.argmax(grown))]
    cost = ", ".join(f"{fit.parameters[i].label} by {grown[i]:.2g}" for i in worst)
    names = ", ".join(map(str, missing))
    plural = "s" if len(missing) > 1 else ""
    words = f"position{plural} {names} of schedule {schedule.name} missing: sigma grows most for "
    more = len(solution.unobservable) - len(full.unobservable)
    return words + cost + (f"; {more} further direction{'s' if more > 1 else ''} not seen at all" if more > 0 else "")


def _follows_schedule(p: Positions, schedule: Schedule) -> bool:
    """Return whether positions of the recording are those of the schedule under the same numbers."""
    platform, numbers, local = p.view.source.platform, p.numbers, p.view.visits
    if schedule.platform != platform or numbers.min() < 1 or numbers.max() > len(schedule.holds):
        return False
    mine = -apply_matrix(platform.attitude(p.view.stimulus.readout[local.first]), np.array([0.0, 0.0, 1.0]))
    theirs = -schedule.gravity_directions()[numbers - 1]
    return bool(np.all((mine * theirs).sum(axis=-1) > np.cos(SAME_DIRECTION_RAD)))
