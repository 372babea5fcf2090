"""Calibrate recordings by a method, each of several sensors by itself, and record the provenance of the result.

`gimbalcal calibrate` and `gimbalcal.calibrate` run this; the three stages themselves are in `pipeline`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

import gimbalcal
from gimbalcal.calibration import DIRECTION, Calibration, Provenance
from gimbalcal.calibration.content_checks import refuse_not_finite
from gimbalcal.calibration.gravity_uncertainty import with_gravity
from gimbalcal.effects.baseline_effects import GYROSCOPE_BIAS, GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.loading import outside
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.norm_fit import LINEAR
from gimbalcal.estimate.cross_check import CrossCheck, cross_check
from gimbalcal.estimate.extra_effects import extra_effects
from gimbalcal.estimate.grade import graded
from gimbalcal.estimate.gyroscopes.against_attitude import gyroscopes_against_attitude
from gimbalcal.estimate.gyroscopes.rate_table import gyroscopes_on_a_table
from gimbalcal.estimate.gyroscopes.two_position import two_position
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.estimate.sessions import unit_of_sessions
from gimbalcal.estimate.unit import inertial_unit
from gimbalcal.pipeline import Source, Tell, load, silent, three_stage
from gimbalcal.recording import Recording, when_recorded
from gimbalcal.recording.kinds import Method
from gimbalcal.unusual_constants import with_question

GYROSCOPE_METHODS = {"attitude": gyroscopes_against_attitude, "two-position": two_position}


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
    suited = [[m.name for m in r.kind.methods if _suits(m, r)] for r in recordings]
    return next(name for name in suited[0] if all(name in those for those in suited))


def _suits(method: Method, recording: Recording) -> bool:
    there, absent = map(recording.axes, method.requires), map(recording.axes, method.excludes)
    return all(there) and not any(absent)


def calibrate(
    recordings: Sequence[Source], method: str = "", terms: Sequence[str] = (), tell: Tell = silent,
    more: Sequence[str] = (), states: str = "51", grade: str = "",
) -> tuple[Calibration, tuple[Recording, ...]]:  # fmt: skip
    """Calibrate recordings, or folders of them, by `method`, else by their preferred one (`usual_method`).

    "three-stage" takes angles, "multiposition" none and one session or more, "systematic" takes a rotation recording
    and estimates `states`: "30", "51" or "EFFECT[:AXIS],...". Pointing runs, one or several of a mount, have a method
    of their own, "pointing".

    `more` adds effects of the catalogue to the fit of any method, "bias_temperature:y" or "warm_up,tau=0.5";
    `grade` names that of a unit on gimbals.
    Returns the calibration with its provenance, and the recordings; of several sensors side by side those of the
    first. Raises InputError for what it cannot take.
    """
    return calibrate_each(recordings, method, terms, tell, more, states, grade)[0]


def calibrate_each(
    recordings: Sequence[Source],
    method: str = "",
    terms: Sequence[str] = (),
    tell: Tell = silent,
    more: Sequence[str] = (),
    states: str = "51",
    grade: str = "",
) -> tuple[tuple[Calibration, tuple[Recording, ...]], ...]:
    """Calibrate each of several sensors that were logged side by side, and compare them with the first at rest."""
    groups = by_sensor(load(recordings, tell))
    if not method:
        method = usual_method(groups[0])
        stars = method == "pointing"
        tell("method: the terms of the mount, by least squares" if stars else f"method: {method} (another: --method)")
    made = []
    for group in groups:
        if len(groups) > 1:
            tell(f"calibrating {group[0].title}")
        made.append((_calibrated(group, method, terms, tell, more, states, grade), group))
    if len(made) == 1:
        return tuple(made)
    checks = cross_checks(made, tell)
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
        for c, group in made
    )


def cross_checks(each: Sequence[tuple[Calibration, tuple[Recording, ...]]], tell: Tell = silent) -> list[CrossCheck]:
    """Compare every triad with the first in the rests of the first recording, where that is possible."""
    made = []
    (a, (r, *_)) = each[0]
    for b, (s, *_) in each[1:]:
        try:
            made.append(cross_check((r, a), (s, b), (r.sensor, s.sensor)))
            tell(made[-1].in_words)
        except InputError as problem:
            tell(f"note: no cross-check: {problem}")
    return made


def _calibrated(
    recordings: tuple[Recording, ...], method: str, terms: Sequence[str], tell: Tell, more: Sequence[str],
    states: str = "51", grade: str = "",
) -> Calibration:  # fmt: skip
    """Calibrate one unit by `method`, question unusual constants, and add the provenance."""

    def again(changed: Sequence[Recording]) -> Calibration:
        return _estimated(tuple(changed), method, terms, silent, more, states, grade)

    made = with_gravity(_estimated(recordings, method, terms, tell, more, states, grade), recordings)
    if all(r.kind.inertial for r in recordings):
        made = with_question(made, recordings, graded(recordings, grade), again)
    made = replace(made, provenance=provenance(recordings, made, terms, more))
    refuse_not_finite(made.to_dict(), " and ".join(repr(r.title) for r in recordings))
    return made


def _estimated(
    recordings: tuple[Recording, ...], method: str, terms: Sequence[str], tell: Tell, more: Sequence[str],
    states: str, grade: str,
) -> Calibration:  # fmt: skip
    """Calibrate one unit by `method`."""
    if grade and method != "three-stage":
        raise InputError(
            f"--grade {grade} says how large errors are that the positions of gimbals do not show; other methods take "
            "any size as it comes, so leave it out"
        )
    if any(r.kind.sighting for r in recordings):
        if method != "pointing":
            raise InputError(f"--method {method} is for inertial sensors; leave it out for a pointing run")
        made = pointing_calibration(recordings, terms, more)
    elif method == "multiposition":
        tell("norm of the force at every position, and the gyroscopes where they were logged on the way")
        recordings = tuple(graded(recordings).of(recordings))
        also = extra_effects(more, recordings, (*LINEAR, *GYROSCOPE_BIAS, *GYROSCOPE_INPUT_TERMS))
        alone = len(recordings) == 1
        made = inertial_unit(recordings[0], terms, also) if alone else unit_of_sessions(recordings, terms, also)
        _tell_sessions(made, tell)
        for words in _left_out(made):
            tell(f"note: {words}")
    elif method == "systematic":
        made = _navigated(recordings, terms, tell, more, states)
    elif method == "rate-table":
        if terms or more:
            raise InputError("--method rate-table has its own terms; leave --terms and --with out")
        made = gyroscopes_on_a_table(graded(recordings).of(recordings))
        tell(made.provenance.options.in_words or "")
    elif method in GYROSCOPE_METHODS:
        if len(recordings) > 1 or terms or more:
            raise InputError(f"--method {method} takes one recording and has its own terms; give it alone")
        made = GYROSCOPE_METHODS[method](recordings[0])
        tell(made.provenance.options.in_words or "")
    elif terms:
        raise InputError(
            f"--terms {','.join(terms)} goes with --method multiposition; three-stage has its own, leave it out"
        )
    else:
        made = three_stage(recordings, tell, extra_effects(more, recordings, _modelled(recordings)), grade)
        if any(r.has("angular_rate") for r in recordings):
            why = (
                "the three stages calibrate accelerometers; --method multiposition takes both triads, and "
                "--method rate-table holds gyroscopes against the angles of the table that turns them"
            )
            made = replace(made, provenance=made.provenance.with_options(gyroscopes=why))
            tell(f"note: the gyroscopes stay out: {why}")
    return made


def _navigated(
    recordings: tuple[Recording, ...], terms: Sequence[str], tell: Tell, more: Sequence[str], asked: str
) -> Calibration:
    """Calibrate a unit that was turned in its place by navigation."""
    from gimbalcal.estimate.systematic.calibrate import systematic  # numba takes a second to load
    from gimbalcal.estimate.systematic.joint_recordings import calibrate_jointly

    if terms:
        raise InputError(f"--terms {','.join(terms)} goes with --method multiposition; a navigator has --states")
    if len(recordings) == 1:
        return systematic(recordings[0], asked, extra_effects(more, recordings), tell)
    made = calibrate_jointly(recordings, asked, extra_effects(more, recordings), tell)
    _tell_sessions(made, tell)
    return made


def _tell_sessions(made: Calibration, tell: Tell) -> None:
    for session in made.provenance.options.sessions or ():
        tell(f"{session.title}: {session.in_words}")


def _modelled(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the effects that the three stages fit in any case."""
    return tuple(effect for r in sorted(recordings, key=lambda r: r.kind.in_positions) for effect in r.kind.baseline)


def _left_out(made: Calibration) -> list[str]:
    """Return what was requested and is not part of the result, and why."""
    options = made.provenance.options
    both = [each.declined or {} for each in (options, options.gyro) if each]
    declined = ", ".join(dict.fromkeys(term for terms in both for term in terms)).replace("_", " ")
    told = [f"these data do not show {declined}, so they are left out; why, and how large each may be, says the report"]
    gyroscopes = [f"the gyroscopes stay out: {options.gyroscopes}"] if options.gyroscopes else []
    return [*(told if declined else []), *gyroscopes]


def provenance(
    recordings: Sequence[Recording], made: Calibration, terms: Sequence[str], more: Sequence[str] = ()
) -> Provenance:
    """Return the provenance of a calibration: files with their hashes, version, options, time, and remarks."""
    options = replace(
        made.provenance.options,
        direction=DIRECTION,
        sensor=recordings[0].sensor or None,
        method=made.method,
        terms=tuple(terms),
        with_=tuple(more) or None,
    )
    return replace(
        made.provenance,
        recordings=tuple(file for r in recordings for file in r.source),
        effects=outside({p.effect for p in made.parameters}) or None,
        version=gimbalcal.__version__,
        options=options,
        recorded=when_recorded(recordings),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        remarks=tuple(remark for r in recordings for remark in r.remarks),
    )
