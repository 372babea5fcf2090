r"""Several recordings of one unit that was turned in its place: common constants, and an attitude of its own for each.

The information of a recording about the constants is a triangle; those of all recordings are added. Each is then
linearised again about the joint estimate, because products of two errors differ from those of its own estimate. Whether
one agrees with the others is `estimate.sharing.agreement`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration, Options, Provenance
from gimbalcal.calibration.calibration import Residual
from gimbalcal.effects import Parameter, with_values
from gimbalcal.errors import amount
from gimbalcal.estimate.extra_effects import ExtraEffect, extra_effects
from gimbalcal.estimate.sharing import Comparison, agreement, disagreeing, largest_difference
from gimbalcal.estimate.systematic.calibrate import calibrated, systematic
from gimbalcal.estimate.systematic.error_model import rotated
from gimbalcal.estimate.systematic.filter_pass import WIDE_PRIOR_SIGMAS, data_information, filter_and_smooth
from gimbalcal.estimate.systematic.iterate import CONVERGED_SIGMAS, SystematicFit, iterate
from gimbalcal.estimate.systematic.sensor_inversion import invert_readings
from gimbalcal.estimate.systematic.state_lists import states
from gimbalcal.inference.information import Information, solve
from gimbalcal.method_table import Request
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.joining import refuse_twice
from gimbalcal.views.segments import segment

MAX_ROUNDS = 4  # of all recordings


def calibrate_by_navigation(request: Request) -> Calibration:
    """Calibrate a unit that was turned in its place, from one recording or several."""
    more = extra_effects(request.more, request.recordings)
    if len(request.recordings) == 1:
        return systematic(request.recordings[0], request.states, more, request.tell)
    return calibrate_jointly(request.recordings, request.states, more, request.tell)


def calibrate_jointly(
    recordings: Sequence[Recording], asked: str = "51", more: Sequence[ExtraEffect] = (),
    tell: Callable[[str], None] = lambda _: None,
) -> Calibration:  # fmt: skip
    """Calibrate a unit from several rotation recordings, and test each against the others.

    Raises InputError as `systematic` does for each of them.
    """
    refuse_twice(recordings)
    each: list[SystematicFit] = []
    for r in recordings:
        tell(r.title)
        base = tuple(a.absent((), dict(a.stated)) for a in more)
        wanted = states(asked, r, more)
        each.append(iterate(segment(r), wanted, base, tell))
    wanted = _common([m.wanted for m in each])
    theta = solve(_joint(wanted, each, np.zeros(len(wanted)))).x
    for _ in range(MAX_ROUNDS):
        each = [_relinearised(wanted, each, k, theta) for k in range(len(each))]
        solution = solve(_joint(wanted, each, theta))
        move, theta = float(np.abs(solution.x / solution.sigma).max()), theta + solution.x
        tell(f"all together: the estimates moved by up to {move:.2g} of their sigma")
        if move < CONVERGED_SIGMAS:
            break
    each = [replace(m, converged=move < CONVERGED_SIGMAS) for m in each]
    compared = [_compared(r.title, wanted, each, k, theta) for k, r in enumerate(recordings)]
    calibrations = [calibrated(m) for m in each]
    sessions = tuple(c.session(stops=int(m.segments.stop.max()) + 1) for c, m in zip(compared, each, strict=True))
    worst = min(calibrations, key=lambda c: c.residual.navigation["nis"]["p_value"])
    nis = [c.residual.navigation["nis"] for c in calibrations]
    different = "; ".join(f"{compared[k].title} {compared[k].in_words}" for k in disagreeing(compared))
    words = [f"{amount(len(each), 'recording')} do not share their constants: {different}"] if different else []
    words += [f"{r.title}: {c.outcome}" for r, c in zip(recordings, calibrations, strict=True) if c.outcome]
    limits = tuple(dict.fromkeys(text for c in calibrations for text in c.provenance.limits or ()))
    return Calibration(
        method="systematic",
        effects=with_values(each[0].base_effects, wanted, theta),
        parameters=wanted,
        covariance=solution.covariance,
        unobservable=solution.unobservable,
        residual=Residual(sum(n["sum"] for n in nis), sum(n["dof"] for n in nis), worst.residual.rms,
                          worst.residual.navigation),
        outcome=". ".join(words),
        provenance=Provenance(options=Options(states=asked, sessions=sessions), limits=limits),
    )  # fmt: skip


def _common(each: Sequence[tuple[Parameter, ...]]) -> tuple[Parameter, ...]:
    """Return the parameters of all, each with the largest prior sigma of any recording."""
    sigma: dict[str, float] = {}
    for p in (p for wanted in each for p in wanted):
        sigma[p.label] = max(p.sigma, sigma.get(p.label, 0.0))
    return tuple(replace(p, sigma=sigma[p.label]) for p in each[0])


def _information(wanted: Sequence[Parameter], m: SystematicFit, about: Array) -> Information:
    """Return the information of one recording about the constants, less some values (p,) of them."""
    return data_information(wanted, m.last.factor, m.unregularised - about, [p.sigma for p in m.wanted])


def _joint(wanted: Sequence[Parameter], each: Sequence[SystematicFit], about: Array) -> Information:
    """Return the information of all recordings about the constants, less some values (p,) of them."""
    whole = _information(wanted, each[0], about)
    for m in each[1:]:
        whole = whole + _information(wanted, m, about)
    return whole


def _relinearised(wanted: tuple[Parameter, ...], each: Sequence[SystematicFit], k: int, theta: Array) -> SystematicFit:
    """Linearise a recording about the joint constants: attitudes with the others' information, then its own estimate.

    Where it observes little alone, its own attitudes are off by as much as its constants are.
    """
    m = replace(each[k], wanted=wanted)
    others = _joint(wanted, [o for i, o in enumerate(each) if i != k], theta)
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


def _compared(
    title: str, wanted: Sequence[Parameter], each: Sequence[SystematicFit], k: int, theta: Array
) -> Comparison:
    """Compare one recording with all others together."""
    parts = [each[k]], [m for i, m in enumerate(each) if i != k], each
    own, others, whole = (solve(_joint(wanted, part, theta)) for part in parts)
    largest = largest_difference(wanted, own.x - others.x, np.hypot(own.sigma, others.sigma))
    return Comparison(title, len(each), agreement(whole, [own, others]).p_value, largest)
