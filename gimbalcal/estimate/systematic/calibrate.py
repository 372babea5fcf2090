r"""Systematic calibration: 30, 51 or any other states, by navigation in place (Cai et al. 2016, Wei et al. 2022).

A unit that stays in its place and is turned there is a navigator whose true velocity is known: zero. The velocity that
it computes is a linear function of its initial attitude and of its sensors' errors; table angles are not used. Filter
and smoother (`filter_pass`) run about a reference, which is moved to their estimates (the feedback of Cai's Eq. (27))
until no estimate moves by 3 % of its sigma (`iterate`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration, Options, Provenance
from gimbalcal.calibration.calibration import Residual
from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.errors import amount
from gimbalcal.estimate.extra_effects import ExtraEffect
from gimbalcal.estimate.systematic.filter_pass import attitude_covariance, data_information
from gimbalcal.estimate.systematic.innovation_rows import innovation_rows
from gimbalcal.estimate.systematic.innovation_tests import innovation_statistics, outcome
from gimbalcal.estimate.systematic.iterate import SystematicFit, iterate
from gimbalcal.estimate.systematic.linearisation_error import linearisation_covariance
from gimbalcal.estimate.systematic.state_lists import UNESTIMATED, states
from gimbalcal.estimate.systematic.suspected_errors import limitations, suspected_error
from gimbalcal.inference.information import solve
from gimbalcal.number import Array
from gimbalcal.recording import Recording
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
    tell: Callable[[str], None] = lambda _: None,
) -> Calibration:
    """Calibrate both triads of a unit that was turned in its place; asked: the states, see `state_lists.states`.

    Raises InputError where the recording cannot be navigated: see `iterate`.
    """
    wanted = states(asked, recording, more)
    m = iterate(segment(recording), wanted, tuple(a.absent((), dict(a.stated)) for a in more), tell)
    calibration = calibrated(m)
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
        f"estimate holds: its sigma says so ({amount(int(np.sum(share >= 1.0)), 'parameter')} like this)"
    )
    return replace(calibration, provenance=_with_limits(calibration, wider))


def _with_limits(calibration: Calibration, *further: str) -> Provenance:
    return replace(calibration.provenance, limits=(*(calibration.provenance.limits or ()), *further))


def calibrated(m: SystematicFit) -> Calibration:
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
            options=Options(velocity_m_per_s=segments.velocity, stops=int(segments.stop.max()) + 1),
            limits=tuple(limitations(m, solution.sigma)),
        ),
    )


def navigation_view(
    recording: Recording, ids: tuple[str, ...], tell: Callable[[str], None], held: tuple[Effect, ...] = ()
) -> View:
    """Return the innovations of a unit turned in its place, about a fit of the effects `ids`, as a view.

    held: effects of fixed values. Raises InputError where a navigator cannot take the recording.
    """
    usual = states(",".join(ids), recording)

    def about(m: SystematicFit) -> View:
        fitted = dict(zip(m.wanted, m.theta.tolist(), strict=True))
        return navigation(recording, innovation_rows(m), fitted, ids, UNESTIMATED, m.segments.stated)

    def known(more: Sequence[Effect] = ()) -> tuple[Effect, ...]:
        return (*(e for e in held if e.id not in {m.id for m in more}), *more)

    def relinearise(effect: Effect, wanted: Sequence[Parameter]) -> View:
        return replace(about(iterate(segments, (*usual, *wanted), known([effect]), tell)), calibrate=converged)

    segments = segment(recording)
    first = iterate(segments, usual, held, tell)

    def converged(effects: Sequence[Effect], fitted: Sequence[Parameter]) -> Calibration:
        more = tuple(p for p in fitted if p.label not in {u.label for u in usual})
        fresh = [without_sizes(e) for e in effects if e.id in {p.effect for p in more}]
        return calibrated(iterate(segments, (*usual, *more), known(fresh), tell) if more else first)

    return replace(about(first), relinearise=relinearise, calibrate=converged)
