r"""Navigation of a strapdown unit in its place, at rest, swinging or turned, so that its output is its error.

It starts at the known place and aligns itself: level and north come from the first minutes (`Aids.alignment`), in which
its velocity is zero whatever it turns through. First, in axes carried along by the gyroscopes, the integral of the
force is that of gravity, which turns with the Earth,

.. math:: \min_R \sum_k \left| \int_0^{t_k} f^{i_b} dt - R^T \! \int_0^{t_k} f^{i_n} dt \right|^2 ;

then the three angles are corrected until the navigated velocity is smallest. The attitude absorbs what it can of the
sensors' errors, as in any navigator: a constant bias east is balanced by a heading error. From there on it navigates
alone; the height is held by an external one, and the swing is damped only on request. Errors are navigator minus true.
True is the site, or of a vehicle its reference latitude, longitude and height at each row; it begins with a rest.

Source: Wu and Pan, IEEE Trans. AES 49 (2013) 1006, for the attitude in carried axes.

Readings are means over intervals, long where the unit does not turn. A mean over an interval of constant rate holds the
information of its samples, so that rests of days become a few thousand intervals. A block of rows is one interval if
the angle turned deviates from a constant rate by less than :math:`\delta`,

.. math:: \max_t \left| \int_0^t \omega \, dt' - \bar\omega t \right| < \delta ,

as the coning error, half the enclosed area, is then below :math:`\delta^2`, and if the same holds for the blocks on
either side, so that the first row of a turn has its own neighbours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.earth import EARTH_RATE, rate_at
from gimbalcal.errors import InputError
from gimbalcal.kinematics import required_latitude
from gimbalcal.navigate.navigation_errors import CHANNELS, Navigated
from gimbalcal.navigate.space_stable_navigator import Aids, InertialSite, schuler_rate
from gimbalcal.navigate.static_run import horizontal_distance
from gimbalcal.navigate.strapdown import StrapdownStates, aided_strapdown, integrated_attitudes
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording import Recording
from gimbalcal.recording.dwell import MISSED_ROW_STEPS
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import exponential, rotation_between, rotation_vector

MAX_UNSTEADY_ANGLE_RAD = 1e-4  # rad
MAX_INTERVAL_S = 10.0  # s, of an interval that the navigator takes in one step


@dataclass(frozen=True, eq=False)
class Intervals:
    """Mean readings: rows, with time in mid-interval; lengths dt (n,) [s]; steady: whether all rates are constant."""

    rows: Recording
    dt: Array
    steady: bool

    def filled(self) -> tuple[Array, Array]:
        """Return lengths (m,) none longer than `MAX_INTERVAL_S`, and the interval (m,) that each comes from."""
        pieces = np.maximum(np.ceil(self.dt / MAX_INTERVAL_S - 1e-9).astype(int), 1)
        return np.repeat(self.dt / pieces, pieces), np.repeat(np.arange(len(self.dt)), pieces)


def thinned_intervals(recording: Recording, block: float) -> Intervals:
    """Return means of up to `block` [s] where the rate is constant, and every row elsewhere or of a driven unit.

    A driven unit moves also where it does not turn.
    Raises InputError for a clock that pauses while the unit turns: its attitude is unknown after that.
    """
    run = _as_means(recording)
    usual = run.step
    dt = np.diff(run.time, prepend=run.time[0] - usual)
    _refuse_lost_turns(run, dt, usual)
    several = 1 if has_reference_position(run) else max(1, round(block / usual))
    n = len(dt)
    first = np.arange(0, n, several)
    whole = np.diff(np.append(first, n))
    steady = _has_constant_rate(run.triad(RATE), dt, first)
    alone = steady & np.append(steady[1:], True) & np.append(True, steady[:-1])
    begin = np.concatenate([np.flatnonzero(~np.repeat(alone, whole)), first[alone]])
    begin.sort()
    if len(begin) == n:
        return Intervals(replace(run, time=run.time - dt / 2, position=None), dt, bool(steady.all()))
    return _means(run, dt, begin, bool(steady.all()))


def _means(run: Recording, dt: Array, begin: Array, steady: bool) -> Intervals:
    """Return the means of the rows from each `begin` to the next, weighted with their lengths."""
    length = np.add.reduceat(dt, begin)

    def mean(x: Array) -> Array:
        return np.asarray(np.add.reduceat(x * dt, begin) / length)

    channels = {key: mean(values) for key, values in run.channels.items()}
    weight = np.add.reduceat(run.weight, begin)
    middle = mean(run.time - dt / 2)
    rows = replace(run, time=middle, channels=channels, weight=weight, position=None, other_sensors=())
    return Intervals(rows, length, steady)


def _has_constant_rate(rate: Array, dt: Array, first: Array) -> Array:
    """Return whether the rate is constant in each block (k,), by the angle turned."""
    turned, time = np.cumsum(rate * dt[:, None], axis=0), np.cumsum(dt)
    before, start = turned[first] - rate[first] * dt[first, None], time[first] - dt[first]
    last = np.append(first[1:], len(dt)) - 1
    mean = (turned[last] - before) / (time[last] - start)[:, None]
    k = np.repeat(np.arange(len(first)), last - first + 1)
    off = np.abs(turned - before[k] - mean[k] * (time - start[k])[:, None]).max(axis=1)
    return np.asarray(np.maximum.reduceat(off, first) < MAX_UNSTEADY_ANGLE_RAD)


def _refuse_lost_turns(run: Recording, dt: Array, usual: float) -> None:
    for k in np.flatnonzero(dt > MISSED_ROW_STEPS * usual):
        rate = run.triad(RATE)[max(k - 1, 0) : k + 1]
        if np.abs(rate[0] - rate[-1]).max() * dt[k] > np.deg2rad(1.0) or np.abs(rate).max() > np.deg2rad(0.5):
            raise InputError(
                f"{run.title!r}: the clock pauses for {dt[k]:.3g} s before row {k + 1} while the unit turns, so its "
                "attitude after that is unknown; give a recording without that pause"
            )


def _as_means(recording: Recording) -> Recording:
    """Convert instantaneous rates to means over the interval before, by linear interpolation."""
    if not recording.instant:
        return recording
    channels = {
        k: np.append(v[:1], (v[1:] + v[:-1]) / 2) if k[0] in (FORCE, RATE) else v for k, v in recording.channels.items()
    }
    return replace(recording, channels=channels, instant=False)


REFERENCE = ("latitude", "longitude", "height")
ALIGNMENT_ITERATIONS, ALIGNMENT_STEP_RAD = 4, 1e-4  # and the angle of its slopes
OUTPUT_INTERVAL_S = 10.0
MAX_REST_EARTH_RATES, MAX_REST_FORCE_CHANGE_G = 2.0, 5e-3  # of a unit at rest


def unit_navigated(recording: Recording, calibration: Calibration | None, aids: Aids, label: str) -> Navigated:
    """Return the errors of the navigation of a unit, whose readings a calibration corrects if there is one."""
    refuse(recording)
    if (
        recording.instant and calibration is not None
    ):  # nonlinear effects depend on the rate of the instant, not of a mean
        recording, calibration = calibration.apply(recording), None
    intervals = thinned_intervals(recording, MAX_INTERVAL_S)
    return navigate_intervals(
        intervals, intervals.rows if calibration is None else calibration.apply(intervals.rows), aids, label
    )


def navigate_intervals(intervals: Intervals, rows: Recording, aids: Aids, label: str) -> Navigated:
    """Return the errors of the navigation of intervals, with their readings in `rows`."""
    dt, of = intervals.filled()
    force, rate = rows.triad(FORCE)[of], rows.triad(RATE)[of]
    end = np.cumsum(dt)
    first = int(np.searchsorted(end, aids.alignment, side="right"))
    if not 10 <= first < len(dt) - 1:
        raise InputError(
            f"{rows.title!r} lasts {end[-1]:.4g} s and is aligned in the first {aids.alignment:g} s of it; give "
            "--alignment minutes that leave something to navigate, and ten rows or more to align with"
        )
    place = _place_function(intervals)
    base = place(end[:first]).mean(axis=0)
    site = InertialSite(base[0], base[2], rows.site.gravity, 0.0)
    at = np.array([site.latitude, 0.0, site.height])
    C = aligned_attitude(dt[:first], rate[:first], force[:first], site, aids)
    since = end[first:] - end[first - 1]
    every = np.flatnonzero(np.diff(np.floor(since / OUTPUT_INTERVAL_S + 1e-9), prepend=0.0) > 0)
    every = every if len(every) > 2 else np.arange(len(since))
    reference = np.zeros((len(since), 3))
    reference[:, :2], reference[:, 2] = aids.velocity, place(end[first:])[:, 2] + np.asarray(aids.height)
    motion = aided_strapdown(
        dt[first:], rate[first:], force[first:], C, at, every, 2 * aids.damping * schuler_rate(site), aids.height_s,
        site.gravity, reference=reference,
    )  # fmt: skip
    error = np.full((len(every) + 1, len(CHANNELS)), np.nan)
    true = place(np.append(end[first - 1], end[first:][every])) - [0.0, base[1], 0.0]
    error[:, :2] = motion.position[:, :2] - true[:, :2]
    if not has_reference_position(rows):
        error[:, 2:4] = motion.velocity[:, :2]
    if _is_at_rest(intervals):
        error[:, 4:] = rotation_vector(motion.C_bn @ motion.C_bn[0].T)  # about north, east and down, since the start
    return Navigated(
        label, np.append(0.0, since[every]), error, horizontal_distance(error, site), mechanisation="strapdown"
    )


def aligned_attitude(dt: Array, rate: Array, force: Array, site: InertialSite, aids: Aids) -> Array:
    """Return C_bn (3, 3) at the end of intervals in which the unit stayed in its place, whatever it turned through."""
    C = _in_carried_axes(dt, rate, force, site)
    last, damping = np.arange(len(dt)), 0.0
    at = np.array([site.latitude, 0.0, site.height])

    def run(start: Array) -> StrapdownStates:
        return aided_strapdown(dt, rate, force, start, at, last, damping, aids.height_s, site.gravity)

    for _ in range(ALIGNMENT_ITERATIONS):
        motion = run(C)
        slopes = [
            (run(exponential(-ALIGNMENT_STEP_RAD * e) @ C).velocity - motion.velocity)[:, :2] / ALIGNMENT_STEP_RAD
            for e in np.eye(3)
        ]
        A = np.stack(slopes, axis=-1).reshape(-1, 3)
        phi = np.linalg.lstsq(A, -motion.velocity[:, :2].reshape(-1), rcond=None)[0]
        C = exponential(-phi) @ C
        if np.abs(phi).max() < 1e-9:
            break
    return np.asarray(run(C).C_bn[-1])


def _in_carried_axes(dt: Array, rate: Array, force: Array, site: InertialSite) -> Array:
    """Return C_bn (3, 3) at the start from the integrals of force and gravity in axes that do not turn."""
    C = integrated_attitudes(dt, rate)
    velocity = np.cumsum(apply_matrix((C[1:] + C[:-1]) / 2, force) * dt[:, None], axis=0)
    t = np.cumsum(dt)
    earth_turn = (t - dt / 2)[:, None] * rate_at(site.latitude)
    up = exponential(-earth_turn) @ np.array([0.0, 0.0, -site.gravity])  # turned with the Earth
    wanted = np.cumsum(up * dt[:, None], axis=0)
    return rotation_between(velocity, wanted)


def _is_at_rest(intervals: Intervals) -> bool:
    """Return whether a unit is at rest all the time, so that its true attitude is constant."""
    force, rate = intervals.rows.triad(FORCE), intervals.rows.triad(RATE)
    slow = np.linalg.norm(np.average(rate, axis=0, weights=intervals.dt)) < MAX_REST_EARTH_RATES * EARTH_RATE
    flat = np.abs(force - force[0]).max() < MAX_REST_FORCE_CHANGE_G * intervals.rows.site.gravity
    return bool(intervals.steady and slow and flat)


def refuse(recording: Recording) -> None:
    """Raise InputError unless the recording has both triads and a latitude."""
    if recording.platform.axes and not recording.has(RATE):
        raise InputError(f"{recording.title!r} has no angular_rate, without which a strapdown unit does not navigate")
    latitude = recording.site.latitude
    if latitude is None:
        raise InputError(f"{recording.title!r} needs `latitude` in [site] of recording.toml: the Earth turns below it")
    if abs(latitude) > np.deg2rad(89):
        raise InputError(f"{recording.title!r} is at a pole, where longitude is undefined")
    for quantity in (FORCE, RATE):
        if recording.counted(quantity):
            raise InputError(f"{recording.title!r} reads its {quantity} in counts: apply its calibration first")
        recording.triad(quantity)


def has_reference_position(recording: Recording) -> bool:
    """Return whether a reference position is logged at each row."""
    return all(recording.has(quantity) for quantity in REFERENCE)


def _place_function(intervals: Intervals) -> Callable[[Array], Array]:
    """Return a function of time [s]: true latitude, longitude and height (n, 3), of the reference or the site."""
    site, end = intervals.rows.site, np.cumsum(intervals.dt)
    if not has_reference_position(intervals.rows):
        here = np.array([required_latitude(site.latitude), 0.0, site.height])
        return lambda t: np.broadcast_to(here, (len(t), 3))
    reference = [intervals.rows.channels[quantity, ""] for quantity in REFERENCE]
    reference[1] = np.unwrap(reference[1])
    return lambda t: np.stack([np.interp(t, end, column) for column in reference], axis=-1)
