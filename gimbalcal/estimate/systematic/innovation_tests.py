"""Tests of the innovations against the filter's own covariance: does the model explain the data?"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects import Parameter
from gimbalcal.errors import number_of
from gimbalcal.estimate.systematic.error_model import STATE_SCALE
from gimbalcal.estimate.systematic.filter_pass import GATE_NIS, Pass, curve_points
from gimbalcal.number import Array
from gimbalcal.p_value import probability
from gimbalcal.units import from_si
from gimbalcal.views.segments import Segments

MIN_P_VALUE = 1e-5  # of each of three tests
SUSPECT_NIS_RATIO = 0.2  # to the largest normalised innovation squared
MAX_REJECTED_SHARE = 0.01  # of updates; beyond, the model is wrong, not the table
DIRECTIONS = ("north", "east", "down")


def innovation_statistics(
    segments: Segments, wanted: Sequence[Parameter], prior_mean: Array, last: Pass, C: Array, passes: int,
    smoothed: Array,
) -> dict[str, Any]:  # fmt: skip
    """Return the content of `residual.navigation`: NIS, NEES, whiteness, rejected updates, and results over time.

    These are estimate and sigma of each parameter, and the sigma of the attitude. prior_mean (p,) of the parameters;
    smoothed (K + 1, 3, 3): covariance of the smoothed attitudes [rad^2].
    """
    f, navigator = last.filtered, last.calibrated
    z = navigator.innovation / np.sqrt(navigator.variance)
    n = int(np.count_nonzero(~np.isnan(z)))
    nis, used = float(np.nansum(z**2)), max(n - len(wanted) - 3, 1)
    legs = _stops_and_turns(segments)
    by_leg = np.array(
        [np.nansum(z[leg], axis=0) / np.sqrt(np.maximum((~np.isnan(z[leg])).sum(axis=0), 1)) for _, leg in legs]
    )
    sum_of_legs, legs_used = float((by_leg**2).sum()), by_leg.size  # degrees of freedom of the fit are not subtracted
    lag = float(np.nansum(z[1:] * z[:-1]) / max(np.nansum(z**2), 1e-300))
    # the unit stays in its place, so the computed displacement is an error
    grown = np.maximum(navigator.sigma[1:, 6:9] ** 2 - navigator.sigma[0, 6:9] ** 2, 1e-300)
    position = (navigator.x[1:, 6:9] - navigator.x[0, 6:9]) ** 2 / grown
    rms = np.sqrt(np.nanmean(navigator.innovation**2, axis=0)) * STATE_SCALE[3]
    heading, roll = np.arctan2(C[0, 1, 0], C[0, 0, 0]), np.arctan2(C[0, 2, 1], C[0, 2, 2])
    angles = [heading, -np.arcsin(np.clip(C[0, 2, 0], -1, 1)), roll]
    pick, estimates = curve_points(len(z)), prior_mean + last.estimates
    sigma = from_si(1.0, "arcsec") * np.sqrt(np.diag(last.attitude))
    worst = int(np.argmax(np.abs(by_leg).max(axis=1)))
    return {
        "passes": passes,
        "updates": len(z),
        "rejected": int(np.count_nonzero(navigator.distance > GATE_NIS)),
        "nis": {"sum": nis, "dof": used, "ratio": nis / used, "p_value": probability(nis, used)},
        "legs": {
            "sum": sum_of_legs,
            "dof": legs_used,
            "p_value": probability(sum_of_legs, legs_used),
            "worst": legs[worst][0],
            "name": [name for name, _ in legs],
            "innovation": np.round(by_leg, 3).tolist(),
        },
        "whiteness": {"lag_one": lag, "sigma": float(1 / np.sqrt(n))},
        "nees": {"velocity": float(np.nanmean(z**2)), "position": float(np.mean(position))},
        "velocity_rms": dict(zip(DIRECTIONS, rms.tolist(), strict=True)),
        "attitude": {
            **dict(zip(("heading_deg", "pitch_deg", "roll_deg"), np.degrees(angles).tolist(), strict=True)),
            "sigma_arcsec": dict(zip(DIRECTIONS, sigma.tolist(), strict=True)),
            **_sigma_of_variance(np.diagonal(smoothed[pick], axis1=1, axis2=2)),
        },
        "time_s": np.round(segments.time[pick] - segments.time[0], 3).tolist(),
        "estimate": {p.label: _printed(estimates[:, i], p, 10) for i, p in enumerate(wanted)},
        "sigma": {p.label: _printed(f.theta_sigma[pick, i] * p.sigma, p, 5) for i, p in enumerate(wanted)},
    }


def _printed(x: Array, p: Parameter, digits: int) -> list[float]:
    """Return values of a parameter [SI] in its unit, rounded to significant digits."""
    return [float(f"{v:.{digits}g}") for v in np.asarray(from_si(x, p.unit))]


def _sigma_of_variance(variance: Array) -> dict[str, dict[str, list[float]]]:
    """Return the sigma of the smoothed attitude; nothing where rounding has made a variance (n, 3) negative."""
    if not np.all(variance > 0):
        return {}
    sigma = from_si(1.0, "arcsec") * np.sqrt(variance)
    return {"smoothed_arcsec": {a: [float(f"{x:.5g}") for x in sigma[:, i]] for i, a in enumerate(DIRECTIONS)}}


def suspect_updates(last: Pass, left_out: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return updates (K,) to exclude next: the excluded ones, and the worst of the others.

    One outlier inflates the innovations of its neighbours, so only the worst are added. None are excluded where more
    would be than knocks explain.
    """
    rest = np.where(left_out, 0.0, last.calibrated.distance)
    more: NDArray[np.bool_] = left_out | (rest > max(GATE_NIS, SUSPECT_NIS_RATIO * rest.max()))
    return more if more.mean() <= MAX_REJECTED_SHARE else np.zeros_like(more)


def outcome(
    navigation: Mapping[str, Any], states: int, settled: bool, unseen: int = 0, slip: Callable[[], str] = str
) -> str:
    """Return one sentence where the model does not explain the data; empty where it does.

    unseen: number of unobservable directions; slip: returns a possible input error.
    """
    nis, legs = navigation["nis"], navigation["legs"]
    if not settled and unseen:
        return (
            f"the estimates of {states} states do not settle: {number_of(unseen, 'direction')} of them cannot "
            "be seen "
            "from these turns and stops; turn the unit through a dozen stops or more, each axis up and down, or "
            "name fewer states with --states"
        )
    if not settled:
        return (
            f"the estimates of {states} states do not settle: the errors are too large for navigation in place to be "
            "linear, the sensors wander beyond their white noise, or the model is another; check order, signs, units "
            'and clock of the columns, or calibrate the stops alone (kind = "multi-position")'
        )
    share = navigation["rejected"] / navigation["updates"]
    reasons = []
    if nis["p_value"] < MIN_P_VALUE:
        reasons.append(f"innovations of the velocity are {np.sqrt(nis['ratio']):.3g} times what the noise explains")
    if legs["p_value"] < MIN_P_VALUE:
        far = float(np.sqrt(legs["sum"] / legs["dof"]))
        reasons.append(f"they do not average out over stops and turns ({far:.3g} times, most in {legs['worst']})")
    if share > MAX_REJECTED_SHARE:
        reasons.append(f"{100 * share:.2g} % of the updates were rejected")
    if not reasons:
        return ""
    cure = slip()
    if cure:
        return f"{states} states do not explain this recording: {', and '.join(reasons)}; {cure}"
    return (
        f"{states} states do not explain this recording: {', and '.join(reasons)}; `gimbalcal diagnose` looks for what "
        "is left out, and [noise] should be what the sensors and the table have"
    )


def _stops_and_turns(segments: Segments) -> list[tuple[str, Array]]:
    """Return stops and turns in order, with their stretches."""
    cuts = np.flatnonzero(np.diff(segments.stop)) + 1
    parts = np.split(np.arange(len(segments.stop)), cuts)
    names, turns = [], 0
    for part in parts:
        k = int(segments.stop[part[0]])
        turns += k < 0
        names.append(f"stop {k + 1}" if k >= 0 else f"turn {turns}")
    return list(zip(names, parts, strict=True))
