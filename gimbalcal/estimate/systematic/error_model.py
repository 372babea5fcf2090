r"""The linear error model of each stretch, from one update to the next, about a reference that starts there at rest.

The reference of stretch k starts from the attitude C_k, not moving; where it ends, less where the next one starts, is a
known defect d_k of the model,

.. math:: x_{k+1} = \Phi_k x_k + \Psi_k \, \delta\theta + d_k + w_k .
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from gimbalcal.earth import rate_at
from gimbalcal.effects import Effect, Parameter
from gimbalcal.estimate.systematic.course import Course
from gimbalcal.estimate.systematic.sensors import sensitivity
from gimbalcal.estimate.systematic.wander import beside, chains
from gimbalcal.navigate.error_growth import NAV, transitions
from gimbalcal.navigate.strapdown import carried
from gimbalcal.number import Array
from gimbalcal.rotation import cross_matrix, exponential, rotation_vector

ROWS = 20_000  # intervals at a time: what a column of them takes stays below 50 MB
STATE = np.repeat([1e-3, 1e-3, 1e-3], 3)  # rad, m/s, m: scale of the navigation states
UNMOVED = np.radians(0.5 / 3600)  # rad, what the attitude may change while the clock pauses in a stop


class Linear(NamedTuple):
    """The error model of K stretches in units of `STATE` and of the prior sigmas.

    Phi (K, m, m), Psi (K, m, p), Q (K, m, m) and defects d (K, m) of the nine navigation states and the chains of
    biases that wander.
    """

    Phi: Array
    Psi: Array
    Q: Array
    d: Array


def linear(course: Course, wanted: Sequence[Parameter], effects: Sequence[Effect], u: Array, C: Array) -> Linear:
    """The error model about the effects, what was there (n, 6) and the attitudes C (K + 1, 3, 3).

    The attitude at the start is a constant too, so that its covariance is known in the end: three more, the last ones.
    """
    scale, p = np.array([p.sigma for p in wanted]), len(wanted) + 3
    expected, wander = felt(course, u, C), chains(course)

    def answer(groups: slice) -> Array:
        D = sensitivity(course.groups, effects, wanted, expected, groups) * scale
        return np.concatenate([D, np.zeros((len(D), 6, 3)), added(len(D), len(wander))], axis=2)

    Phi, Psi, Q, d = answering(course, u, C, answer, p + added(0, len(wander)).shape[2])
    return Linear(*beside(Phi, Psi[:, :, :p], Q, d, Psi[:, :, p:], wander))


def added(n: int, chains: int) -> Array:
    """What a unit added to each of the six readings takes from force and rate (n, 6, 6); nothing asked, (n, 6, 0)."""
    return np.tile(-np.eye(6), (n, 1, 1))[:, :, : 6 if chains else 0]


def defects(course: Course, u: Array, C: Array, near: Linear) -> Array:
    """Where the reference of each stretch ends, less where the next one starts (K, m), in units of `STATE`."""
    d = np.zeros_like(near.d)
    d[:, :NAV] = answering(course, u, C, lambda groups: np.zeros((groups.stop - groups.start, 6, 0)), 0)[3]
    return d


def felt(course: Course, u: Array, C: Array) -> Array:
    """Force and rate (g, 6) of each group of intervals, without the noise of what was read: see `_expected`."""
    begin = np.flatnonzero(np.diff(course.group, prepend=-1))
    return np.add.reduceat(_expected(course, u, C), begin) / np.diff(begin, append=len(u))[:, None]


def answering(
    course: Course, u: Array, C: Array, answer: Callable[[slice], Array], p: int
) -> tuple[Array, Array, Array, Array]:
    """Phi, Psi (K, 9, p), Q and defects d, in units of `STATE`; `answer` gives D (m, 6, p) of a slice of groups."""
    K = len(course.stop)
    Phi, Psi, Q = np.empty((K, NAV, NAV)), np.empty((K, NAV, p)), np.empty((K, NAV, NAV))
    d = np.empty((K, NAV))
    site = course.rows.site
    assert site.latitude is not None
    q = course.sigma**2 / course.rows.weight[:, None]
    q[:, :3] += _unseen(course, u)[:, None] ** 2
    at = 0
    while at < K:
        end = int(np.searchsorted(course.first, course.first[at] + ROWS, side="right")) - 1
        end = min(max(end, at + 1), K)
        rows = slice(int(course.first[at]), int(course.first[end]))
        before = max(rows.start - 1, 0)  # coning looks at the interval before
        few = slice(before, rows.stop)
        groups = slice(int(course.group[before]), int(course.group[rows.stop - 1]) + 1)
        made = transitions(
            course.first[at : end + 1] - before, course.joined[few], course.dt[few], u[few, 3:], u[few, :3],
            answer(groups), q[few], C[at:end], site.latitude,
            site.height, site.gravity, course.group[few] - groups.start,
        )  # fmt: skip
        F = made.Phi.copy()  # attitude to velocity and place by what gravity did: noise would seem to show the heading
        F[:, 3:6, :3] += cross_matrix(made.velocity)
        F[:, 6:, :3] += cross_matrix(made.displacement)
        Phi[at:end], Q[at:end] = F * STATE / STATE[:, None], made.Q / STATE / STATE[:, None]
        Psi[at:end] = made.Psi / STATE[:, None]
        d[at:end, :3] = rotation_vector(made.C_bn @ np.swapaxes(C[at + 1 : end + 1], -1, -2))
        d[at:end, 3:6], d[at:end, 6:] = made.velocity, made.displacement
        at = end
    for k in np.flatnonzero(course.pauses):
        Phi[k, 3:6, 3:6] = 0.0
        Q[k, :3, :3] = (UNMOVED / STATE[0]) ** 2 * np.eye(3)
        Q[k, 3:6, 3:6] = (course.velocity / STATE[3]) ** 2 * np.eye(3)
    return Phi, Psi, Q, d / STATE


def _unseen(course: Course, u: Array) -> Array:
    """What the mean force (n,) [m/s^2] of an interval may be off, in the axes of its beginning, where a ramp begins.

    Sculling takes the rate to be linear over two intervals. Where it bends within one, by the second difference b of
    its means, the tilt that the force is turned by is off by b dt / 24 to b dt / 12, on the mean.
    """
    bend = np.zeros(len(u))
    bend[1:-1] = np.linalg.norm(np.diff(u[:, 3:], 2, axis=0), axis=1)
    bend = np.maximum(bend, np.maximum(np.roll(bend, 1), 0.0))  # the interval after it goes by the same slope
    turning = (course.stop < 0)[np.repeat(np.arange(len(course.stop)), np.diff(course.first))]
    return np.where(turning, course.rows.site.gravity * bend * course.dt / 12, 0.0)


def _expected(course: Course, u: Array, C: Array) -> Array:
    """Force and rate (n, 6) of a unit in its place with attitudes C at the updates, without the noise of what was read.

    Sensitivities at noisy readings would let a scale factor explain the noise: of an axis that has not yet been loaded
    it has nothing else to go by. Turning, the rates stand as they are.
    """
    site = course.rows.site
    assert site.latitude is not None
    earth = rate_at(site.latitude)
    force, rate = _in_body(course, u, C, np.array([[0.0, 0.0, -site.gravity], earth]))
    at_rest = (course.stop >= 0)[np.repeat(np.arange(len(course.stop)), np.diff(course.first))]
    return np.concatenate([force, np.where(at_rest[:, None], rate, u[:, 3:])], axis=1)


def in_body(course: Course, u: Array, C: Array, v: Array) -> Array:
    """A vector v (3,) in north, east, down as the axes of the unit see it in each group of intervals (g, 3)."""
    begin = np.flatnonzero(np.diff(course.group, prepend=-1))
    return np.asarray(
        np.add.reduceat(_in_body(course, u, C, v[None])[0], begin) / np.diff(begin, append=len(u))[:, None]
    )


def _in_body(course: Course, u: Array, C: Array, v: Array) -> Array:
    """Vectors v (m, 3) in north, east, down in the axes of the unit, in the middle of each interval (m, n, 3)."""
    stretch = np.repeat(np.arange(len(course.stop)), np.diff(course.first))
    went = carried(course.dt, u[:, 3:])
    begun = C[:-1] @ np.swapaxes(went[course.first[:-1]], -1, -2)
    went[:-1] += went[1:]
    went *= 0.5
    return np.stack([np.einsum("ni,nij->nj", (x @ begun)[stretch], went[:-1]) for x in v])


def turned(C: Array, phi: Array) -> Array:
    """exp([phi x]) C for attitudes C (K, 3, 3) and errors phi (K, 3) [rad]."""
    return np.asarray(exponential(-phi) @ C)
