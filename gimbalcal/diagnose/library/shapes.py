"""Shapes without a cause: what stands for "none of these" when the known causes are compared with it."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre

from gimbalcal.number import Array
from gimbalcal.views.core import Fit

ROUNDING = 1e-14  # of functions of order one: sines of half turns are 1e-16, cubes of a millidegree more
PLACES = 150  # with more of them, a smooth function of the direction of gravity says it better
SETTINGS = 16  # of a gimbal; with more of them, harmonics say it better


def shapes(o: Fit) -> dict[str, tuple[str, Array]]:
    """Bases (n, m) of the rivals that act on each accelerometer output."""
    s = o.view.stimulus
    t = s.time / s.time[-1]
    m = 10 if o.view.kind.in_positions else 20
    out = {"time": ("a smooth function of time", np.cos(np.pi * np.outer(t, np.arange(1, m + 1))))}
    if o.view.kind.in_positions:
        places = np.unique(s.position)
        if len(places) <= PLACES:
            out["position"] = ("a value of its own at each position", (s.position[:, None] == places).astype(float))
        out["orientation"] = ("a smooth function of the direction of gravity", polynomials(s.force / s.gravity))
        if s.since_move.max() > 0:
            out["settling"] = ("a course of its own after each move", _settling(o))
    else:
        phase = np.arctan2(s.force[:, 1], s.force[:, 0])
        n = np.arange(2, 7)
        basis = np.concatenate([np.cos(np.outer(phase, n)), np.sin(np.outer(phase, n))], axis=1)
        out["orientation"] = ("harmonics of the sidereal angle", basis)
    if s.temperature is not None and np.ptp(s.temperature) > 0:
        out["temperature"] = ("a function of temperature", thermal(s.time, s.temperature))
    return out


def _settling(o: Fit) -> Array:
    """Forces, and their changes at the last move, dying away at three speeds within a dwell: a basis (n, up to 18)."""
    s = o.view.stimulus
    longest = float(s.since_move.max())
    fades = [np.exp(-s.since_move / (longest * part))[:, None] for part in (0.05, 0.2, 0.8)]
    basis = np.concatenate([fade * f / s.gravity for fade in fades for f in (s.force, s.move_force)], axis=1)
    U, S, _ = np.linalg.svd(basis, full_matrices=False)
    return np.asarray(U[:, S > 1e-2 * S[0]])


def unit_rms(basis: Array) -> Array:
    """Columns (n, m) scaled to rms one; what is nothing but rounding, as x y with one axis up or down, becomes zero."""
    rms = np.sqrt((basis**2).mean(axis=0))
    return np.where(rms > ROUNDING, basis / np.where(rms > ROUNDING, rms, 1.0), 0.0)


def polynomials(u: Array) -> Array:
    """Second- and third-degree polynomials (n, 15) of the unit force (n, 3), z^2 left out: it is 1 - x^2 - y^2."""
    x, y, z = u.T
    second = [x * y, y * z, z * x, x * x, y * y]
    third = [x**3, y**3, z**3, x * x * y, x * x * z, y * y * x, y * y * z, z * z * x, z * z * y, x * y * z]
    return np.stack(second + third, axis=-1)


def thermal(time: Array, temperature: Array) -> Array:
    """Legendre polynomials 2 to 5 of temperature, its smoothed rate, square and cube (n, 7)."""
    centred = temperature - temperature.mean()
    x = centred / (np.abs(centred).max() + 1e-12)
    poly = legendre.legvander(x, 5)[:, 2:]
    width = max(2.0, len(time) / 200)
    rate = np.gradient(_smoothed(temperature, width), time)
    rate = rate / (np.abs(rate).max() + 1e-300)
    return np.concatenate([poly, np.stack([rate, rate**2, rate**3], axis=-1)], axis=1)


def _smoothed(x: Array, width: float) -> Array:
    """x (n,) through a Gaussian of so many rows, mirrored at its ends."""
    reach = int(4 * width + 0.5)
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    return np.convolve(np.pad(x, reach, mode="symmetric"), bell / bell.sum(), mode="valid")


def products(o: Fit) -> dict[str, tuple[str, list[Array]]]:
    """Simple laws that nobody has written down yet, by family: words, and bases (n, 1 or 2), any one of which it is.

    A flexible shape cannot compete with a known cause that happens to look much like the truth; the truth itself can.
    """
    from gimbalcal.effects.history import smoothed_rate

    s = o.view.stimulus
    t = s.time / s.time[-1] - 0.5
    angles = [a for a in s.angle.T if np.ptp(a) > 1e-2]
    where = [f[:, None] for f in (s.force / s.gravity).T if np.std(f) > 1e-3]
    where += [np.stack([np.cos(a), np.sin(a)], axis=-1) for a in angles]
    follows = {"time": t}
    if s.temperature is not None and np.ptp(s.temperature) > 0:
        follows["temperature"] = s.temperature - s.temperature.mean()
        rate = smoothed_rate(s.temperature, s.time, float(s.time[-1]) / 100)
        follows["the rate of temperature"] = rate / (np.abs(rate).max() + 1e-300)
    out = {f"with {name}": (f"a force or gimbal angle times {name}", [x[:, None] * w for w in where])
           for name, x in follows.items()}  # fmt: skip
    powers = [(x**n)[:, None] for x in follows.values() for n in (2, 3)]
    out["power"] = ("a square or cube of " + ", ".join(follows), powers)
    if o.view.kind.in_positions:
        every = np.where(s.visit % 2, 1.0, -1.0)[:, None]
        words = "something that alternates from one position to the next"
        out["alternating"] = (words, [every, *(every * w for w in where)])
    return out


def high_harmonics(angle: Array) -> list[Array]:
    """Bases (n, m) of an error that repeats three to eight times a turn: all beyond the second, and each as it is.

    What positions show of a harmonic is in part what first and second show: the first basis is cleared of that, so
    that it takes nothing from them; each harmonic as it is needs nothing beside it.
    """
    beyond = _above_second(angle)
    if np.ptp(angle) < 1e-2 or not beyond.shape[1]:
        return []
    out = [beyond]
    for n in range(3, 9):
        pair = np.stack([np.cos(n * angle), np.sin(n * angle)], axis=-1)
        if np.linalg.norm(beyond.T @ pair) > 0.1 * len(angle):
            out.append(pair)
    return out


def settings(angle: Array) -> list[Array]:
    """Basis (n, m) of an error that has a value of its own at each setting of a gimbal, if it has few settings."""
    held, at = np.unique(np.round(np.mod(angle, 2 * np.pi), 3), return_inverse=True)
    return [np.eye(len(held))[at]] if 3 <= len(held) <= SETTINGS else []


def _above_second(angle: Array) -> Array:
    """Harmonics 3 to 8 (n, m) cleared of what constant, first and second say at these angles, and of each other."""
    low = np.stack([f(n * angle) for n in range(3) for f in (np.cos, np.sin)], axis=-1)
    high = np.stack([f(n * angle) for n in range(3, 9) for f in (np.cos, np.sin)], axis=-1)
    Q = np.linalg.svd(low, full_matrices=False)
    base = Q[0][:, Q[1] > 1e-6 * Q[1][0]]
    U, S, _ = np.linalg.svd(high - base @ (base.T @ high), full_matrices=False)
    return np.asarray(U[:, S > 1e-2 * np.sqrt(len(angle))] * np.sqrt(len(angle)))
