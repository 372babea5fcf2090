r"""What the gyroscopes say of each turn, against gravity before and after it, before anything is calibrated.

A turn carries the vertical from f_1 to f_2 by C, the product of what the gyroscopes read; errors M of the triad add

.. math:: \delta\phi = \sum_t C_t M \omega_t \, \Delta t ,

seen across f_2 alone. One M of 3 x 3 explains all turns, whatever the unit; a turn that it does not explain lost
samples, went beyond the gyroscopes' range, or was no turn of this unit.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.systematic.course import Course
from gimbalcal.navigate.strapdown import carried
from gimbalcal.number import Array
from gimbalcal.recording.plausible_run import named
from gimbalcal.rotation import cross_matrix

BESIDE = 5  # intervals of a stop, some seconds each side of a turn: in more the Earth turns the vertical
LIKELY = 0.05  # one sigma of an element of M
MISSED = np.radians(1.0)  # what a turn may miss where all others are right
ODD = 8.0  # times what the others miss
FEWEST = 4  # turns, so that one of them can be odd
ROUNDS = 4
GAIN = 0.02  # errors of scale beyond which a navigator is not linear from the start


def gains(course: Course, u: Array) -> Array:
    """What the rates (n, 6 with the forces) have to be multiplied by, less one (3,): zero where it is small.

    Raises InputError where single turns are not what the gyroscopes say, whatever their errors.
    """
    last = int(course.stop.max())
    spans = [(course.of_stop(k), course.of_stop(k + 1)) for k in range(last)]
    spans = [(a, b) for a, b in spans if b.start > a.stop]
    M = np.zeros((3, 3))
    if len(spans) < FEWEST:
        return np.diag(M)
    for _ in range(ROUNDS):
        missed, J = zip(*(_turn(course, u, a, b, M) for a, b in spans), strict=True)
        y, A = np.array(missed), np.array(J)
        dM, left = _robust(y, A, M)
        M = M + dM
        if np.abs(dM).max() < 1e-3:
            break
    off = np.linalg.norm(left, axis=1)
    odd = off > max(MISSED, ODD * float(np.median(off)))
    if odd.any() and np.count_nonzero(odd) <= len(off) / 4:
        a, b = spans[int(np.argmax(off))]
        t = [course.rows.time[a.stop - 1], course.rows.time[b.start]]
        others = amount(len(off) - int(odd.sum()), "other turn")
        raise InputError(
            f"{named(course.rows)}: between {t[0]:.6g} and {t[1]:.6g} s gravity turns by {np.degrees(off.max()):.2g} "
            f"deg more or less than the gyroscopes say, which tell the {others} to {np.degrees(np.median(off)):.2g} "
            "deg; samples were lost there, or wrong; cut the recording there and give the longer part"
        )
    return np.where(np.abs(np.diag(M)) > GAIN, np.diag(M), 0.0)


def _turn(course: Course, u: Array, a: slice, b: slice, M: Array) -> tuple[Array, Array]:
    """Angle (3,) [rad] by which a turn with rates (1 + M) w misses gravity, and its derivative (3, 9) by M."""
    before, after = slice(max(a.start, a.stop - BESIDE), a.stop), slice(b.start, min(b.stop, b.start + BESIDE))
    level = (u[before, 3:].mean(axis=0) + u[after, 3:].mean(axis=0)) / 2
    w = u[a.stop : b.start, 3:] - level
    dt = course.dt[a.stop : b.start]
    C = carried(dt, w + w @ M.T)
    turned = np.swapaxes(C[-1], 0, 1) @ C  # from each moment's axes to those after the turn
    angle = w * dt[:, None]
    J = np.einsum("tij,tk->ijk", (turned[:-1] + turned[1:]) / 2, angle).reshape(3, 9)
    f = [x / np.linalg.norm(x) for x in (u[before, :3].mean(axis=0), u[after, :3].mean(axis=0))]
    told = np.swapaxes(C[-1], 0, 1) @ f[0]
    across = cross_matrix(f[1])
    # the unit turns, the vertical turns the other way: gravity is told too far by f x phi
    return np.cross(f[1], told), -across @ across @ J


def _robust(y: Array, A: Array, M: Array) -> tuple[Array, Array]:
    """Step (3, 3) of M that leaves least of the angles (m, 3), with outliers weighed down, and what is left (m, 3)."""
    step, left = np.zeros(9), y
    for _ in range(20):
        size = np.linalg.norm(left, axis=1)
        scale = max(float(np.median(size)), 1e-6)
        w = np.repeat(1 / np.maximum(size, scale), 3)[:, None] ** 0.5 / scale**0.5
        rows = np.concatenate([A.reshape(-1, 9) * w, np.eye(9) / LIKELY])
        right = np.concatenate([y.reshape(-1) * w[:, 0], -M.reshape(-1) / LIKELY])
        step = np.linalg.lstsq(rows, right, rcond=None)[0]
        left = y - A @ step
    return step.reshape(3, 3), left
