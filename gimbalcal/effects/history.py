"""Memory of the past: states of first order, running integral, slope and direction of a move.

Time is irregular. All are linear recursions written as passes over whole arrays, so they run on floats, complex
numbers and symbols.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.number import Array, exp, sqrt

FORGOTTEN_S = 1e9  # s; thirty years, against hours of the slowest memory


def recursion(a: Array, b: Array) -> Array:
    """Return y_k = a_k y_{k-1} + b_k from y_{-1} = 0, along the first axis; a (n,), b (n, ...).

    A doubling scan (Hillis and Steele): log2 n passes, no loop over samples.
    """
    b = b.astype(np.result_type(a, b), copy=True)
    a = np.reshape(a, (-1,) + (1,) * (b.ndim - 1)).astype(a.dtype, copy=True)
    step = 1
    while step < len(b):
        b[step:] = b[step:] + a[step:] * b[:-step]
        a[step:] = a[step:] * a[:-step]
        step *= 2
    return b


@dataclass(frozen=True, eq=False)
class Dynamics:
    r"""States x of first order that an effect carries from sample to sample, for a filter or a navigator.

    .. math:: \tau \dot x = u - x \quad \text{or, where nothing is forgotten,} \quad \dot x = u; \qquad
              \delta_i = c_i x_i

    with one state for each axis (m = 3) or one for all (m = 1). drive u (n, m), linear between samples; start (m,) or
    (n, m): x at the first sample, and, of states that forget, again at the rows where `anew` (n,) is true; output c
    (3,) or (n, 3), 1 where the states themselves are added; tau [s], None where nothing is forgotten.
    """

    drive: Array
    start: Array
    output: Array | float = 1.0
    tau: float | None = None
    anew: Array | None = None


def steps(time: Array) -> Array:
    """Return steps of a clock (n - 1,) [s]; where it begins anew all is forgotten, for nobody knows how long after."""
    h = np.diff(time)
    return np.asarray(np.where(np.real(h) < 0, FORGOTTEN_S, h))


def relaxation(h: Array, tau: float | Array | None) -> Array:
    """Return the share of a first-order state that is left after h [s]: exp(-h / tau), all of it where tau is None."""
    return np.ones_like(h) if tau is None else exp(-h / tau)


def states(d: Dynamics, time: Array) -> Array:
    r"""Return states (n, m) at the samples, exact for a drive that is linear between them.

    .. math:: x_{k+1} = a x_k + u_{k+1} - a u_k - \frac{\Delta u}{h} \tau (1 - a), \quad a = e^{-h / \tau}; \qquad
              x_{k+1} = x_k + h \frac{u_k + u_{k+1}}{2}
    """
    start = np.broadcast_to(d.start, d.drive.shape)
    if d.tau is None:
        return np.asarray(start[0] + integral(d.drive, time))
    h, u = steps(time), d.drive
    a = relaxation(h, d.tau)
    keep = a[:, None]
    push = u[1:] - keep * u[:-1] - _lag_of_steady_step(np.diff(u, axis=0), h[:, None], d.tau)
    a, push = np.concatenate([np.zeros(1), a]), np.concatenate([start[:1], push])
    if d.anew is not None:
        a, push = np.where(d.anew, 0.0, a), np.where(d.anew[:, None], start, push)
    return recursion(a, push)


def integrated(d: Dynamics, time: Array) -> Array:
    """Return the contribution (n, 3) of an effect with these states."""
    return np.asarray(d.output * states(d, time))


def lagged_states(u: Array, tau: float, output: Array) -> Dynamics:
    """Return states that follow u (n, m) late, in equilibrium with it before the first sample."""
    return Dynamics(u, u[0], output, tau)


def added_up(rate: Array) -> Dynamics:
    """Return angles (n, 3) that add up a rate (n, 3) from the first sample on."""
    return Dynamics(rate, np.zeros(3))


def smoothed_rate(x: Array, time: Array, tau: float) -> Array:
    r"""Return dx/dt (n,) smoothed by a first-order filter of tau run forwards and backwards; exact for a ramp, ends
    included.

    .. math:: \dot x = \frac{x_{lead} - x_{lag}}{t_{lead} - t_{lag}}
    """
    if len(time) < 2:
        return 0.0 * x

    h, goes_on = steps(time), np.real(np.diff(time)) >= 0

    def spread(change: Array) -> Array:
        within = np.where(goes_on, change, 0.0)
        return _first_order_lag(within, h, tau) + _first_order_lag(within[::-1], h[::-1], tau)[::-1]

    lasts = spread(h)
    return np.asarray(spread(np.diff(x)) / np.where(lasts == 0, 1.0, lasts))  # a session of one sample tells no rate


def _first_order_lag(change: Array, h: Array, tau: float) -> Array:
    """Return a quantity that changes by `change` (n - 1,) in steps h, less its first-order lag (n,)."""
    a = exp(-h / tau)
    return recursion(
        np.concatenate([np.zeros(1), a]), np.concatenate([0 * change[:1], _lag_of_steady_step(change, h, tau)])
    )


def _lag_of_steady_step(step: Array, h: Array, tau: float) -> Array:
    """Return step / h tau (1 - e^(-h / tau)): what a state of first order is behind after a steady step; all of it for
    h = 0.

    Rows may be stamped alike where a clock is coarse.
    """
    at_once = h == 0
    return np.where(at_once, step, step / np.where(at_once, 1.0, h) * tau * (1 - exp(-h / tau)))


def integral(x: Array, time: Array) -> Array:
    """Return the integral of x (n, ...) over time from the first sample, trapezoid rule."""
    h = np.reshape(np.diff(time), (-1,) + (1,) * (x.ndim - 1))
    area = np.cumsum((x[1:] + x[:-1]) / 2 * h, axis=0)
    return np.concatenate([0 * x[:1], area])


def slope(x: Array, time: Array, visit: Array) -> Array:
    """Return dx/dt (n, ...) by central differences that do not reach across dwells; zero where a dwell has one time.

    Rows that are stamped alike, as by a coarse clock, have the neighbours of all of them.
    """
    i = np.arange(len(time))
    new = np.concatenate([np.ones(1, dtype=bool), (np.diff(time) != 0) | (np.diff(visit) != 0)])
    last = np.append(i[1:], len(i))[np.append(new[1:], True)]  # of the rows that follow each run of one time
    low = np.maximum(np.maximum.accumulate(np.where(new, i, 0)) - 1, 0)
    high = np.minimum(last[np.cumsum(new) - 1], len(i) - 1)
    low, high = np.where(visit[low] == visit, low, i), np.where(visit[high] == visit, high, i)
    h = np.reshape(time[high] - time[low], (-1,) + (1,) * (x.ndim - 1))
    return np.where(h == 0, 0.0, (x[high] - x[low]) / np.where(h == 0, 1.0, h))


def direction(move: Array, scale: float) -> Array:
    """Return the sign of a move, smooth through zero for moves below about `scale`: m / sqrt(m^2 + scale^2)."""
    return np.asarray(move / sqrt(move**2 + scale**2))
