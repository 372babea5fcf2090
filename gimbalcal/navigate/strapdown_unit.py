r"""A strapdown unit navigated in its place: at rest, swinging, or turned, so that whatever it says is error.

It starts at the known place, at rest, and finds itself how it stands: level and north come from the first minutes
(`Aids.alignment`), in which its velocity is zero whatever it turns through. First, in axes that the gyroscopes carry
along, the velocity that the force made is gravity's, which turns with the Earth,

.. math:: \min_R \sum_k \left| \int_0^{t_k} f^{i_b} dt - R^T \! \int_0^{t_k} f^{i_n} dt \right|^2 ;

then the three angles are corrected until the navigated velocity is as small as it gets. The attitude takes up what it
can of the sensors' errors, as it does in any navigator: a constant bias east stands against a wrong north, and nothing
moves at first. From there on it navigates alone; the height is held by an external one, and the swing is damped only
where that is asked for. Errors are navigator minus true. True is the site, or of a vehicle its reference, latitude,
longitude and height at each row, which also holds the height; it begins with a rest.

Source: Wu and Pan, IEEE Trans. AES 49 (2013) 1006, for the attitude in carried axes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.earth import EARTH_RATE, rate_at
from gimbalcal.errors import InputError
from gimbalcal.kinematics import required_latitude
from gimbalcal.navigate.mean_intervals import LONGEST, Intervals, thinned
from gimbalcal.navigate.navigation_errors import CHANNELS, Navigated
from gimbalcal.navigate.space_stable import Aids, Site, schuler_rate
from gimbalcal.navigate.static_run import horizontal
from gimbalcal.navigate.strapdown import Motion, aided, carried
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording import Recording
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import exponential, rotation_vector

PLACE = ("latitude", "longitude", "height")
ROUNDS, TURN = 4, 1e-4  # of the alignment, and the angle [rad] of its slopes
LOOKED_AT = 10.0  # s between the rows that are told
SLOW, FLAT = 2.0, 5e-3  # of the Earth's rate and of gravity: what a unit that stands still reads and keeps reading


def unit_navigated(recording: Recording, calibration: Calibration | None, aids: Aids, label: str) -> Navigated:
    """Errors of the navigation of a unit in its place, its readings corrected first where there is a calibration."""
    refuse(recording)
    if recording.instant and calibration is not None:  # what bends with a rate bends with that of the instant
        recording, calibration = calibration.apply(recording), None
    legs = thinned(recording, block_of(recording, LONGEST))
    return legs_navigated(legs, legs.rows if calibration is None else calibration.apply(legs.rows), aids, label)


def legs_navigated(legs: Intervals, rows: Recording, aids: Aids, label: str) -> Navigated:
    """The same from intervals, and `rows` with the readings of these as they are to be navigated."""
    dt, of = legs.filled()
    force, rate = rows.triad(FORCE)[of], rows.triad(RATE)[of]
    end = np.cumsum(dt)
    first = int(np.searchsorted(end, aids.alignment, side="right"))
    if not 10 <= first < len(dt) - 1:
        raise InputError(
            f"{rows.title!r} lasts {end[-1]:.4g} s and is aligned in the first {aids.alignment:g} s of it; give "
            "--alignment minutes that leave something to navigate, and ten rows or more to align with"
        )
    place = _place(legs)
    base = place(end[:first]).mean(axis=0)
    site = Site(base[0], base[2], rows.site.gravity, 0.0)
    at = np.array([site.latitude, 0.0, site.height])
    C = aligned(dt[:first], rate[:first], force[:first], site, aids)
    since = end[first:] - end[first - 1]
    every = np.flatnonzero(np.diff(np.floor(since / LOOKED_AT + 1e-9), prepend=0.0) > 0)
    every = every if len(every) > 2 else np.arange(len(since))
    reference = np.zeros((len(since), 3))
    reference[:, :2], reference[:, 2] = aids.velocity, place(end[first:])[:, 2] + np.asarray(aids.height)
    made = aided(
        dt[first:], rate[first:], force[first:], C, at, every, 2 * aids.damping * schuler_rate(site), aids.height_s,
        site.gravity, reference=reference,
    )  # fmt: skip
    error = np.full((len(every) + 1, len(CHANNELS)), np.nan)
    true = place(np.append(end[first - 1], end[first:][every])) - [0.0, base[1], 0.0]
    error[:, :2] = made.position[:, :2] - true[:, :2]
    if not driven(rows):
        error[:, 2:4] = made.velocity[:, :2]
    if _still(legs):
        error[:, 4:] = rotation_vector(made.C_bn @ made.C_bn[0].T)  # about north, east and down, since the start
    return Navigated(label, np.append(0.0, since[every]), error, horizontal(error, site), mechanisation="strapdown")


def aligned(dt: Array, rate: Array, force: Array, site: Site, aids: Aids) -> Array:
    """C_bn (3, 3) at the end of intervals in which the unit stayed in its place, whatever it turned through."""
    C = _in_carried_axes(dt, rate, force, site)
    last, damping = np.arange(len(dt)), 0.0
    at = np.array([site.latitude, 0.0, site.height])

    def run(start: Array) -> Motion:
        return aided(dt, rate, force, start, at, last, damping, aids.height_s, site.gravity)

    for _ in range(ROUNDS):
        made = run(C)
        slopes = [(run(exponential(-TURN * e) @ C).velocity - made.velocity)[:, :2] / TURN for e in np.eye(3)]
        A = np.stack(slopes, axis=-1).reshape(-1, 3)
        phi = np.linalg.lstsq(A, -made.velocity[:, :2].reshape(-1), rcond=None)[0]
        C = exponential(-phi) @ C
        if np.abs(phi).max() < 1e-9:
            break
    return np.asarray(run(C).C_bn[-1])


def _in_carried_axes(dt: Array, rate: Array, force: Array, site: Site) -> Array:
    """C_bn (3, 3) at the start by the velocities that force and gravity make in axes that do not turn."""
    C = carried(dt, rate)
    made = np.cumsum(apply_matrix((C[1:] + C[:-1]) / 2, force) * dt[:, None], axis=0)
    t = np.cumsum(dt)
    gone = (t - dt / 2)[:, None] * rate_at(site.latitude)
    up = exponential(-gone) @ np.array([0.0, 0.0, -site.gravity])  # turned with the Earth
    wanted = np.cumsum(up * dt[:, None], axis=0)
    U, _, Vt = np.linalg.svd(wanted.T @ made)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


def _still(legs: Intervals) -> bool:
    """Whether a unit stands still all the time, so that its attitude is known to be what it was in the beginning."""
    force, rate = legs.rows.triad(FORCE), legs.rows.triad(RATE)
    slow = np.linalg.norm(np.average(rate, axis=0, weights=legs.dt)) < SLOW * EARTH_RATE
    flat = np.abs(force - force[0]).max() < FLAT * legs.rows.site.gravity
    return bool(legs.steady and slow and flat)


def refuse(recording: Recording) -> None:
    """Raise InputError for what is no strapdown unit with both triads and a latitude."""
    if recording.platform.axes and not recording.has(RATE):
        raise InputError(f"{recording.title!r} has no angular_rate, without which a strapdown unit does not navigate")
    latitude = recording.site.latitude
    if latitude is None:
        raise InputError(f"{recording.title!r} needs `latitude` in [site] of recording.toml: the Earth turns below it")
    if abs(latitude) > np.deg2rad(89):
        raise InputError(f"{recording.title!r} stands at a pole, where there is no longitude")
    for quantity in (FORCE, RATE):
        if recording.counted(quantity):
            raise InputError(f"{recording.title!r} reads its {quantity} in counts: apply its calibration first")
        recording.triad(quantity)


def driven(recording: Recording) -> bool:
    """Whether a reference says where the unit is at each row."""
    return all(recording.has(quantity) for quantity in PLACE)


def block_of(recording: Recording, block: float) -> float:
    """How long means may be [s]: a unit that is driven goes on moving where it does not turn."""
    return 0.0 if driven(recording) else block


def _place(legs: Intervals) -> Callable[[Array], Array]:
    """Latitude, longitude and height (n, 3) at times [s] since the start: those of the reference, or of the site."""
    site, end = legs.rows.site, np.cumsum(legs.dt)
    if not driven(legs.rows):
        here = np.array([required_latitude(site.latitude), 0.0, site.height])
        return lambda t: np.broadcast_to(here, (len(t), 3))
    told = [legs.rows.channels[quantity, ""] for quantity in PLACE]
    told[1] = np.unwrap(told[1])
    return lambda t: np.stack([np.interp(t, end, column) for column in told], axis=-1)
