r"""Systematic calibration: 30, 51 or any other states, by navigation in place (Cai et al. 2016, Wei et al. 2022).

A unit that stays in its place and is turned there is a navigator whose true velocity is known: zero. The velocity that
it computes is a linear function of its initial attitude and of its sensors' errors; table angles are not used. Filter
and smoother (`filter_pass`) run about a reference, which is moved to their estimates (the feedback of Cai's Eq. (27))
until no estimate moves by 3 % of its sigma (`iterate`).

Several recordings of one unit have common constants, and each an attitude of its own. The information of a recording
about the constants is a triangle; those of all recordings are added. Each is then linearised again about the joint
estimate, because products of two errors differ from those of its own estimate. Whether one agrees with the others is
`estimate.sharing.agreement_test`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import add

import numpy as np

from gimbalcal.calibration import Calibration, Options, Provenance
from gimbalcal.calibration.calibration import Residual
from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.errors import number_of
from gimbalcal.estimate.extra_effects import ExtraEffect, extra_effects
from gimbalcal.estimate.sharing import (
    Comparison,
    agreement_test,
    disagreeing_recordings,
    largest_difference,
    with_widest_priors,
)
from gimbalcal.estimate.systematic.error_model import invert_readings, rotated
from gimbalcal.estimate.systematic.filter_pass import (
    WIDE_PRIOR_SIGMAS,
    attitude_covariance,
    data_information,
    filter_and_smooth,
)
from gimbalcal.estimate.systematic.innovation_rows import innovation_rows
from gimbalcal.estimate.systematic.innovation_tests import innovation_statistics, outcome
from gimbalcal.estimate.systematic.iterate import CONVERGED_SIGMAS, SystematicFit, iterate
from gimbalcal.estimate.systematic.linearisation_error import linearisation_covariance
from gimbalcal.estimate.systematic.state_lists import UNESTIMATED, states
from gimbalcal.estimate.systematic.suspected_errors import limitation_sentences, suspected_error
from gimbalcal.inference.information import Information, solve
from gimbalcal.method_table import Request
from gimbalcal.number import Array
from gimbalcal.progress import Progress, no_progress
from gimbalcal.recording import Recording
from gimbalcal.recording.joining import refuse_twice
from gimbalcal.views.core import View, without_sizes
from gimbalcal.views.navigation import navigation
from gimbalcal.views.segments import segment

TABLE_CAVEAT = (
    "what the table read is no reference: gravity and the turn of the Earth alone tell the scale of the gyroscopes"
)
LARGE_HEADING_SIGMA_RAD = np.radians(3.0)  # beyond, second order counts


def systematic(
    recording: Recording,
    asked: str = "51",
    more: Sequence[ExtraEffect] = (),
    progress: Progress = no_progress,
) -> Calibration:
    """Calibrate both triads of a unit that was turned in its place; asked: the states, see `state_lists.states`.

    Raises InputError where the recording cannot be navigated: see `iterate`.
    """
    wanted = states(asked, recording.why_not_shown, more)
    m = iterate(segment(recording), wanted, tuple(a.absent() for a in more), progress)
    calibration = calibration_of_fit(m)
    if m.converged and (calibration.unobservable or m.last.attitude[2, 2] > LARGE_HEADING_SIGMA_RAD**2):
        calibration = _with_linearisation_error(calibration, linearisation_covariance(m, calibration.covariance))
    origin = _with_limits(calibration, *([TABLE_CAVEAT] if recording.has("gimbal_angle") else [])).with_options(
        states=asked
    )
    return replace(calibration, provenance=origin)


def _with_linearisation_error(calibration: Calibration, linearisation: Array) -> Calibration:
    """Add the covariance of the linearisation error, with a caveat where it dominates a sigma."""
    share = np.sqrt(np.diag(linearisation) / np.diag(calibration.covariance))
    worst = int(np.argmax(share))
    calibration = replace(calibration, covariance=calibration.covariance + linearisation)
    if share[worst] < 1.0:
        return calibration
    wider = (
        f"what these turns do not show makes {calibration.parameters[worst].label} "
        f"{np.hypot(1.0, share[worst]):.2g} times as uncertain as the noise does, by products of errors that no linear "
        f"estimate holds: its sigma says so ({number_of(int(np.sum(share >= 1.0)), 'parameter')} like this)"
    )
    return replace(calibration, provenance=_with_limits(calibration, wider))


def _with_limits(calibration: Calibration, *further: str) -> Provenance:
    return replace(calibration.provenance, limits=(*(calibration.provenance.limits or ()), *further))


def calibration_of_fit(m: SystematicFit) -> Calibration:
    """Return the calibration of a fit, with the tests of its innovations."""
    segments, wanted, scale = m.segments, m.wanted, np.array([p.sigma for p in m.wanted])
    solution = solve(data_information(wanted, m.last.factor, m.unregularised - m.prior_mean, scale))
    smoothed = attitude_covariance(segments, m.last, m.excluded, solution.covariance / np.outer(scale, scale))
    navigation = innovation_statistics(segments, wanted, m.prior_mean, m.last, m.C, m.passes, smoothed)
    words = outcome(navigation, 9 + len(wanted), m.converged, len(solution.unobservable), lambda: suspected_error(m))
    rms = {f"velocity {axis}": float(v) for axis, v in navigation.pop("velocity_rms").items()}
    return Calibration(
        method="systematic",
        effects=with_values(m.base_effects, wanted, m.prior_mean + solution.x),
        parameters=wanted,
        covariance=solution.covariance,
        unobservable=solution.unobservable,
        residual=Residual(navigation["nis"]["sum"], navigation["nis"]["dof"], rms, navigation),
        outcome=words,
        provenance=Provenance(
            options=Options(velocity_m_per_s=float(segments.velocity.min()), stops=int(segments.stop.max()) + 1),
            limits=tuple(limitation_sentences(m, solution.sigma)),
        ),
    )


def navigation_view(recording: Recording, ids: tuple[str, ...], progress: Progress, held: tuple[Effect, ...]) -> View:
    """Return the innovations of a unit turned in its place, about a fit of the effects `ids`, as a view.

    held: effects of fixed values. Raises InputError where a navigator cannot take the recording.
    """
    usual = states(",".join(ids), recording.why_not_shown)

    def about(m: SystematicFit) -> View:
        fitted = dict(zip(m.wanted, m.theta.tolist(), strict=True))
        return navigation(recording, innovation_rows(m), fitted, ids, UNESTIMATED, m.segments.stated)

    def known(more: Sequence[Effect] = ()) -> tuple[Effect, ...]:
        return (*(e for e in held if e.id not in {m.id for m in more}), *more)

    def relinearise(effect: Effect, wanted: Sequence[Parameter]) -> View:
        return replace(about(iterate(segments, (*usual, *wanted), known([effect]), progress)), calibrate=converged)

    segments = segment(recording)
    first = iterate(segments, usual, held, progress)

    def converged(effects: Sequence[Effect], fitted: Sequence[Parameter]) -> Calibration:
        more = tuple(p for p in fitted if p.label not in {u.label for u in usual})
        fresh = [without_sizes(e) for e in effects if e.id in {p.effect for p in more}]
        return calibration_of_fit(iterate(segments, (*usual, *more), known(fresh), progress) if more else first)

    return replace(about(first), relinearise=relinearise, calibrate=converged)


MAX_ROUNDS = 4  # of all recordings


def calibrate_by_navigation(request: Request) -> Calibration:
    """Calibrate a unit that was turned in its place, from one recording or several."""
    more = extra_effects(request.more, request.recordings)
    if len(request.recordings) == 1:
        return systematic(request.recordings[0], request.states, more, request.progress)
    return calibrate_jointly(request.recordings, request.states, more, request.progress)


def calibrate_jointly(
    recordings: Sequence[Recording], asked: str = "51", more: Sequence[ExtraEffect] = (),
    progress: Progress = no_progress,
) -> Calibration:  # fmt: skip
    """Calibrate a unit from several rotation recordings, and test each against the others.

    Raises InputError as `systematic` does for each of them.
    """
    refuse_twice(recordings)
    each: list[SystematicFit] = []
    for r in recordings:
        progress(r.title)
        base = tuple(a.absent() for a in more)
        wanted = states(asked, r.why_not_shown, more)
        each.append(iterate(segment(r), wanted, base, progress))
    wanted = with_widest_priors(p for m in each for p in m.wanted)
    theta = solve(_joint_information(wanted, each, np.zeros(len(wanted)))).x
    for _ in range(MAX_ROUNDS):
        each = [_relinearise_recording(wanted, each, k, theta) for k in range(len(each))]
        solution = solve(_joint_information(wanted, each, theta))
        move, theta = float(np.abs(solution.x / solution.sigma).max()), theta + solution.x
        progress(f"all together: the estimates moved by up to {move:.2g} of their sigma")
        if move < CONVERGED_SIGMAS:
            break
    each = [replace(m, converged=move < CONVERGED_SIGMAS) for m in each]
    compared = [_compare_recording(r.title, wanted, each, k, theta) for k, r in enumerate(recordings)]
    calibrations = [calibration_of_fit(m) for m in each]
    sessions = tuple(c.session(stops=int(m.segments.stop.max()) + 1) for c, m in zip(compared, each, strict=True))
    worst = min(calibrations, key=lambda c: c.residual.navigation["nis"]["p_value"])
    nis = [c.residual.navigation["nis"] for c in calibrations]
    different = "; ".join(f"{compared[k].title} {compared[k].in_words}" for k in disagreeing_recordings(compared))
    words = [f"{number_of(len(each), 'recording')} do not share their constants: {different}"] if different else []
    words += [f"{r.title}: {c.outcome}" for r, c in zip(recordings, calibrations, strict=True) if c.outcome]
    limits = tuple(dict.fromkeys(text for c in calibrations for text in c.provenance.limits or ()))
    return Calibration(
        method="systematic",
        effects=with_values(each[0].base_effects, wanted, theta),
        parameters=wanted,
        covariance=solution.covariance,
        unobservable=solution.unobservable,
        residual=Residual(
            sum(n["sum"] for n in nis), sum(n["dof"] for n in nis), worst.residual.rms, worst.residual.navigation
        ),
        outcome=". ".join(words),
        provenance=Provenance(options=Options(states=asked, sessions=sessions), limits=limits),
    )


def _joint_information(wanted: Sequence[Parameter], each: Sequence[SystematicFit], about: Array) -> Information:
    """Return the information of all recordings about the constants, less some values (p,) of them."""
    own = ((m, [p.sigma for p in m.wanted]) for m in each)
    return reduce(add, (data_information(wanted, m.last.factor, m.unregularised - about, scale) for m, scale in own))


def _relinearise_recording(
    wanted: tuple[Parameter, ...], each: Sequence[SystematicFit], k: int, theta: Array
) -> SystematicFit:
    """Linearise a recording about the joint constants: attitudes with the others' information, then its own estimate.

    Where it observes little alone, its own attitudes are off by as much as its constants are.
    """
    m = replace(each[k], wanted=wanted)
    others = _joint_information(wanted, [o for i, o in enumerate(each) if i != k], theta)
    p = len(wanted)
    rows = np.asarray(np.linalg.qr(np.concatenate([others.rows, np.eye(p, p + 1) / WIDE_PRIOR_SIGMAS]), mode="r"))
    root = np.linalg.inv(rows[:p, :p])
    scale, C, u, now = np.array([q.sigma for q in wanted]), m.C, m.u, theta
    mean = theta + scale * (root @ rows[:p, p])
    for known in (root, root, None):
        effects = with_values(m.base_effects, wanted, now)
        u = invert_readings(m.segments, effects, u)
        before = m.prior_mean if known is None else mean
        last = filter_and_smooth(m.segments, wanted, effects, u, C, m.start, before - now, m.excluded, known=known)
        if known is not None:
            C, now = rotated(C, last.smoothed[:, :3]), now + last.step
    return replace(
        m, theta=now + last.regularised_step, unregularised=now + last.step, u=u, C=C, last=last, passes=m.passes + 3
    )


def _compare_recording(
    title: str, wanted: Sequence[Parameter], each: Sequence[SystematicFit], k: int, theta: Array
) -> Comparison:
    """Compare one recording with all others together."""
    parts = [each[k]], [m for i, m in enumerate(each) if i != k], each
    own, others, whole = (solve(_joint_information(wanted, part, theta)) for part in parts)
    largest = largest_difference(wanted, own.x - others.x, np.hypot(own.sigma, others.sigma))
    return Comparison(title, len(each), agreement_test(whole, [own, others]).p_value, largest)
