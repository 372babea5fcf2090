"""What the past leaves behind: lagged response, running integral, slope and direction of a move, on irregular time.

All are linear recursions written as passes over whole arrays, so they run on floats, complex numbers and symbols.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.number import Array, exp, sqrt


def recursion(a: Array, b: Array) -> Array:
    """y_k = a_k y_{k-1} + b_k from y_{-1} = 0, along the first axis; a (n,), b (n, ...).

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


def lagged(x: Array, time: Array, tau: float) -> Array:
    r"""First-order lag of x (n, ...), exact for x linear between samples, in equilibrium with x[0] before the first.

    .. math:: \tau \dot y = x - y, \quad y_{k+1} = a y_k + x_{k+1} - a x_k - \frac{\Delta x}{h} \tau (1 - a), \quad
              a = e^{-h / \tau}
    """
    h = np.diff(time)
    a = exp(-h / tau)
    column = (-1,) + (1,) * (x.ndim - 1)
    decay, slope = np.reshape(a, column), np.diff(x, axis=0) / np.reshape(h, column)
    b = x[1:] - decay * x[:-1] - slope * tau * (1 - decay)
    return recursion(np.concatenate([np.zeros(1), a]), np.concatenate([x[:1], b]))


def smoothed_rate(x: Array, time: Array, tau: float) -> Array:
    r"""dx/dt (n,) smoothed by a first-order filter of tau run forwards and backwards; exact for a ramp, ends included.

    .. math:: \dot x = \frac{x_{lead} - x_{lag}}{t_{lead} - t_{lag}}
    """
    if len(time) < 2:
        return 0.0 * x

    def spread(v: Array) -> Array:
        h = np.diff(time)
        return _behind(v, h, tau) - _behind(v[::-1], h[::-1], tau)[::-1]

    return np.asarray(spread(x) / spread(time))


def _behind(x: Array, h: Array, tau: float) -> Array:
    """x (n,) less its first-order lag, without the difference of two large numbers."""
    a = exp(-h / tau)
    return recursion(np.concatenate([np.zeros(1), a]), np.concatenate([0 * x[:1], np.diff(x) / h * tau * (1 - a)]))


def integral(x: Array, time: Array) -> Array:
    """Integral of x (n, ...) over time from the first sample, trapezoid rule."""
    h = np.reshape(np.diff(time), (-1,) + (1,) * (x.ndim - 1))
    area = np.cumsum((x[1:] + x[:-1]) / 2 * h, axis=0)
    return np.concatenate([0 * x[:1], area])


def slope(x: Array, time: Array, visit: Array) -> Array:
    """dx/dt (n, ...) by central differences that do not reach across dwells; zero where a dwell has one sample."""
    i = np.arange(len(time))
    low, high = np.maximum(i - 1, 0), np.minimum(i + 1, len(i) - 1)
    low, high = np.where(visit[low] == visit, low, i), np.where(visit[high] == visit, high, i)
    h = np.where(high > low, time[high] - time[low], 1.0)
    return np.asarray((x[high] - x[low]) / np.reshape(h, (-1,) + (1,) * (x.ndim - 1)))


def direction(move: Array, scale: float) -> Array:
    """Sign of a move, passing smoothly through zero for moves below about `scale`: m / sqrt(m^2 + scale^2)."""
    return np.asarray(move / sqrt(move**2 + scale**2))


def columns(s_force: Array) -> tuple[Array, Array]:
    """For each axis the next and the one after it, cyclic: (f_j, f_k) with f_j of x is f_y; each (..., 3)."""
    return s_force[..., [1, 2, 0]], s_force[..., [2, 0, 1]]
