"""Calibrate recordings by a method, each of several sensors by itself, and record the provenance of the result.

`gimbalcal calibrate` and `gimbalcal.calibrate` run this; the three stages themselves are in `pipeline`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

import gimbalcal
from gimbalcal.calibration import DIRECTION, Calibration, Options, Provenance
from gimbalcal.calibration.content_checks import not_finite, refuse_not_finite
from gimbalcal.calibration.gravity_uncertainty import with_gravity
from gimbalcal.effects.loading import files_outside
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.multiposition import LINEAR
from gimbalcal.estimate.grade import grade_of_unit
from gimbalcal.estimate.sharing import CrossCheck, cross_check
from gimbalcal.history.fleet import Fleet, grade_and_fleet, rests_on_fleet, with_fleet
from gimbalcal.method_table import METHODS, Request
from gimbalcal.pipeline import Source, load
from gimbalcal.progress import Progress, no_progress
from gimbalcal.recording import Recording, when_recorded
from gimbalcal.unusual_constants import with_correction, with_question


def by_sensor(recordings: Sequence[Recording]) -> tuple[tuple[Recording, ...], ...]:
    """Return the recordings of each sensor, where several were logged side by side."""
    first = recordings[0]
    names = [r.sensor for r in first.sensors]
    for r in recordings[1:]:
        if [one.sensor for one in r.sensors] != names:
            raise InputError(
                f"{first.title!r} and {r.title!r} do not hold the same sensors; name them alike in [columns], or give "
                "each recording alone"
            )
    return tuple(zip(*(r.sensors for r in recordings), strict=True))


def usual_method(recordings: Sequence[Recording]) -> str:
    """Return the preferred method that suits all recordings, by their kinds and quantities (see `recording.kinds`)."""
    if any(r.kind.sighting for r in recordings):
        return "pointing"
    suited = [[name for name in r.kind.methods if METHODS[name].suits(r.axes)] for r in recordings]
    return next(name for name in suited[0] if all(name in those for those in suited))


def calibrate(
    recordings: Sequence[Source], method: str = "", terms: Sequence[str] = (), progress: Progress = no_progress,
    more: Sequence[str] = (), states: str = "51", grade: str | Fleet = "", without: Sequence[str] = (),
) -> tuple[Calibration, tuple[Recording, ...]]:  # fmt: skip
    """Calibrate recordings, or folders of them, by `method`, else by their preferred one (`usual_method`).

    "three-stage" takes angles, "multiposition" none and one session or more, "systematic" takes a rotation recording
    and estimates `states`: "30", "51" or "EFFECT[:AXIS],...". Pointing runs, one or several of a mount, have a method
    of their own, "pointing".

    `more` adds effects of the catalogue to the fit of any method, "bias_temperature:y" or "warm_up,tau=0.5"; `without`
    omits terms of a mount; `grade` names that of a unit on gimbals; with "fleet:FILE", or a fleet, its units are the
    prior of the parameters. Returns the calibration with its provenance, and the recordings; of several sensors side
    by side those of the first. Raises InputError for what it cannot take.
    """
    return calibrate_each(recordings, method, terms, progress, more, states, grade, without)[0]


def calibrate_each(
    recordings: Sequence[Source],
    method: str = "",
    terms: Sequence[str] = (),
    progress: Progress = no_progress,
    more: Sequence[str] = (),
    states: str = "51",
    grade: str | Fleet = "",
    without: Sequence[str] = (),
) -> tuple[tuple[Calibration, tuple[Recording, ...]], ...]:
    """Calibrate each of several sensors that were logged side by side, and compare them with the first at rest."""
    grade, known = grade_and_fleet(grade)
    groups = by_sensor(load(recordings, progress))
    if not method:
        method = usual_method(groups[0])
        stars = method == "pointing"
        progress(
            "method: the terms of the mount, by least squares" if stars else f"method: {method} (another: --method)"
        )
    results = []
    for group in groups:
        if len(groups) > 1:
            progress(f"calibrating {group[0].title}")
        request = Request(group, tuple(terms), tuple(more), tuple(without), states, grade, progress)
        results.append((_calibrate_unit(method, request, known), group))
    if len(results) == 1:
        return tuple(results)
    checks = cross_checks(results, progress)
    words = tuple(check.in_words for check in checks)
    off = [check.in_words for check in checks if not check.agree]
    return tuple(
        (
            replace(
                c,
                outcome=". ".join(filter(None, [c.outcome, "; ".join(off)])),
                provenance=c.provenance.with_options(cross_check=words),
            ),
            group,
        )
        for c, group in results
    )


def cross_checks(each: Sequence[tuple[Calibration, tuple[Recording, ...]]], progress: Progress) -> list[CrossCheck]:
    """Compare every triad with the first in the rests of the first recording, where that is possible."""
    checks = []
    (a, (r, *_)) = each[0]
    for b, (s, *_) in each[1:]:
        try:
            checks.append(cross_check((r, a), (s, b), (r.sensor, s.sensor)))
            progress(checks[-1].in_words)
        except InputError as problem:
            progress(f"note: no cross-check: {problem}")
    return checks


def _calibrate_unit(method: str, request: Request, known: Fleet | None) -> Calibration:
    """Calibrate one unit by `method`, question unusual constants, add a fleet as prior, and the provenance."""
    recordings = request.recordings
    if method != "pointing" and any(r.kind.sighting for r in recordings):
        raise InputError(f"--method {method} is for inertial sensors; leave it out for a pointing run")

    def again(changed: Sequence[Recording]) -> Calibration:
        return _estimate(method, replace(request, recordings=tuple(changed), progress=no_progress))

    calibration = _estimate(method, request)
    options = calibration.provenance.options
    sessions = [f"{session.title}: {session.in_words}" for session in options.sessions or ()]
    for words in (*sessions, *filter(None, [options.in_words]), *(f"note: {w}" for w in _left_out(options))):
        request.progress(words)
    fitted = with_gravity(calibration, recordings)
    calibration = with_correction(fitted, recordings, again)
    if calibration is fitted and all(r.kind.inertial for r in recordings):  # else its constants are those of no unit
        calibration = with_question(calibration, recordings, grade_of_unit(recordings, request.grade), again)
    if known is not None:
        calibration = with_fleet(calibration, known, recordings)
        origin = calibration.provenance.options.grade
        none = f"note: {known.source} is the prior of no parameter of this unit"
        request.progress(f"prior: {origin.from_}" if origin and rests_on_fleet(calibration) else none)
    calibration = replace(calibration, provenance=provenance(request, calibration))
    refuse_not_finite(calibration.to_dict(), _titles(recordings))
    return calibration


def _estimate(method: str, request: Request) -> Calibration:
    """Return the calibration by a method. Raises InputError also where a matrix of a fit that ran away is singular."""
    try:
        return METHODS[method].estimate(request)
    except np.linalg.LinAlgError as error:
        raise not_finite(_titles(request.recordings), "the inverse of a matrix") from error


def _titles(recordings: Sequence[Recording]) -> str:
    return " and ".join(repr(r.title) for r in recordings)


def _left_out(options: Options) -> list[str]:
    """Return what was requested and is not part of the result, and why, from the options of its provenance."""
    both = [each.declined or {} for each in (options, options.gyro) if each]
    every = {term: why for terms in both for term, why in terms.items()}
    linear = [every.pop(term) for term in LINEAR if term in every]
    declined = ", ".join(every).replace("_", " ")
    reasons = [f"these data do not show {declined}, so they are left out; the report gives reasons and bounds"]
    gyroscopes = [f"the gyroscopes are left out: {options.gyroscopes}"] if options.gyroscopes else []
    return [*linear, *(reasons if declined else []), *gyroscopes]


def provenance(request: Request, calibration: Calibration) -> Provenance:
    """Return the provenance of a calibration: files with their hashes, version, options, time, and remarks."""
    recordings = request.recordings
    options = replace(
        calibration.provenance.options,
        direction=DIRECTION,
        sensor=recordings[0].sensor or None,
        method=calibration.method,
        terms=request.terms,
        with_=request.more or None,
        without=request.without or None,
    )
    return replace(
        calibration.provenance,
        recordings=tuple(file for r in recordings for file in r.source),
        effects=files_outside({p.effect for p in calibration.parameters}) or None,
        version=gimbalcal.__version__,
        options=options,
        recorded=when_recorded(recordings),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        remarks=tuple(remark for r in recordings for remark in r.remarks),
    )
