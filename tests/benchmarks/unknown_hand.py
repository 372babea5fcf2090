"""A plant of its own for units turned by hand: rests in any attitude, turns between them, sensors that wander.

It shares no line with the package but the noun `Recording` and the name of the bench: attitudes by scipy, noise with a
covariance that is written down, so that the strength of an effect is computed here too.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.spatial.transform import Rotation

from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site

G = 9.80146
UG = 9.80665e-6  # m/s^2
HOUR = np.pi / 648000  # rad/s of one deg/h
EARTH, LATITUDE = 7.292115e-5, np.radians(40.0)
MEMORY = 0.8  # of the half of a wander that remembers the rest before


@dataclass(frozen=True)
class Grade:
    """What a make of sensors does: one sigma of a sample, wander from rest to rest, one count, and its constants."""

    white: float  # m/s^2
    wander: float
    count: float
    turning: float  # rad/s
    turning_wander: float
    turning_count: float
    rough: float  # of bias [g], scale and misalignment [rad]
    turning_bias: float  # rad/s


MEMS = Grade(0.03, 2.5e-3, 2.4e-3, 1e-3, 60 * HOUR, 2e-4, 1e-2, 1200 * HOUR)
TACTICAL = Grade(2e-3, 2e-4, 1e-5, 2e-4, 3 * HOUR, 1e-6, 1e-3, 60 * HOUR)


@dataclass(frozen=True, eq=False)
class Hand:
    """What the unit goes through, in rows: time, rest (0 while turned), attitude, force [g], rate, temperature.

    felt: temperature of the sensors themselves; T is what the thermometer says.
    """

    t: Array
    rest: Array
    f: Array  # (n, 3) specific force in g of a perfect unit
    w: Array  # (n, 3) rad/s turned by hand
    level: Rotation  # from level axes (north, east, down) into the unit's
    felt: Array
    T: Array
    supply: Array  # V
    rng: np.random.Generator


Error = Callable[[Hand], dict[str, Array]]


@dataclass(frozen=True)
class Setup:
    """How a recording is made."""

    grade: Grade = MEMS
    rests: int = 36
    gyroscopes: bool = False
    thermometer: bool = False
    supply: bool = False
    tails: float = 0.0  # degrees of freedom of Student's t for single samples
    steady: bool = False  # temperature only rises
    poses: int = 0  # of a chamber: so many attitudes again and again; 0 for any
    swing: float = 6.0  # degC over the recording
    minutes: float = 20.0


def course(rng: np.random.Generator, s: Setup) -> Hand:
    """Rests at random attitudes, or the poses of a chamber in turn, and quick turns between them."""
    if s.poses:
        base = (
            Rotation.random(s.poses, random_state=rng)
            if s.poses != 1
            else Rotation.from_euler("xyz", [[3, -2, 40]], degrees=True)
        )
        stays = base[np.arange(s.rests) % s.poses]
    else:
        stays = Rotation.random(s.rests, random_state=rng)
    pause = s.minutes * 60 / s.rests
    still, moving, step = 60, 0, pause / 120  # a rest is every other minute, as it were: nothing is logged between
    if s.gyroscopes and s.poses != 1:
        moving, step = 40, 0.05  # 20 Hz without a gap, two seconds for a turn
        still = max(round(pause / step) - moving, 60)
        pause = (still + moving) * step
    x = (np.arange(moving) + 1) / max(moving, 1)
    t, rest, level, w = [], [], [], []
    for k in range(s.rests):
        if k and moving:
            turn = (stays[k] * stays[k - 1].inv()).as_rotvec()  # of the frame: -turn is how the unit turns
            way = x - np.sin(2 * np.pi * x) / (2 * np.pi)
            level += [*(Rotation.from_rotvec(way[:, None] * turn) * stays[k - 1]).as_matrix()]
            w += [*(-turn * (1 - np.cos(2 * np.pi * x))[:, None] / (moving * step))]
            t += [*(k * pause + step * (np.arange(moving) - moving))]
            rest += [0] * moving
        t += [*(k * pause + step * np.arange(still))]
        level += [*np.repeat(stays[k].as_matrix()[None], still, axis=0)]
        w += [*np.zeros((still, 3))]
        rest += [k + 1] * still
    time, C = np.array(t), np.array(level)
    time = time - time[0]
    part = time / time[-1]
    phase = rng.uniform(0, 2 * np.pi)
    felt = 24 + (
        s.swing * (1 - np.exp(-2 * part)) if s.steady else s.swing * (0.5 * part + 0.6 * np.sin(7 * part + phase))
    )
    T = felt + 0.02 * rng.standard_normal(len(time))
    supply = (
        5 + 0.2 * np.sin(11 * part + rng.uniform(0, 6)) + 0.1 * rng.standard_normal(s.rests)[nearest(np.array(rest))]
    )
    return Hand(time, np.array(rest), -C[:, :, 2], np.array(w), Rotation.from_matrix(C), felt, T, supply, rng)


def nearest(rest: Array) -> Array:
    """Ordinal (n,) of the rest of each row, of the next rest while it is turned."""
    return np.asarray(np.maximum.accumulate(rest) - 1 + (rest == 0))


def wanders(rests: int, sigma: float) -> Array:
    """Covariance (m, m) of what a channel wanders from rest to rest: half of it new each time, half with a memory."""
    apart = np.abs(np.subtract.outer(np.arange(rests), np.arange(rests)))
    return np.asarray(sigma**2 * (0.5 * np.eye(rests) + 0.5 * MEMORY**apart))


def record(seed: int, s: Setup, errors: tuple[tuple[Error, float], ...] = ()) -> Recording:
    """One recording: constants of the unit, what is concealed, noise, counts."""
    rng = np.random.default_rng(seed)
    h = course(rng, s)
    n, k = len(h.t), nearest(h.rest)
    g, extra_f, extra_w = s.grade, np.zeros((n, 3)), np.zeros((n, 3))
    for error, size in errors:
        made = error(h)
        extra_f, extra_w = extra_f + size * made.get("force", 0.0), extra_w + size * made.get("rate", 0.0)
    M, b = np.eye(3) + g.rough * rng.uniform(-1, 1, (3, 3)), g.rough * rng.uniform(-1, 1, 3)
    Mw, bw = np.eye(3) + g.rough * rng.uniform(-1, 1, (3, 3)), g.turning_bias * rng.uniform(-1, 1, 3)
    earth = h.level.apply([EARTH * np.cos(LATITUDE), 0.0, -EARTH * np.sin(LATITUDE)])
    white = (
        rng.standard_t(s.tails, (n, 3)) * np.sqrt((s.tails - 2) / s.tails) if s.tails else rng.standard_normal((n, 3))
    )
    Lf, Lw = (cholesky(wanders(s.rests, x), lower=True) for x in (g.wander, g.turning_wander))
    y = G * (h.f @ M.T + b + extra_f) + g.white * white + (Lf @ rng.standard_normal((s.rests, 3)))[k]
    y = y + np.where(h.rest[:, None] == 0, 0.5 * rng.standard_normal((n, 3)), 0.0)  # the hand
    r = (h.w + earth) @ Mw.T + bw + extra_w + g.turning * rng.standard_normal((n, 3))
    r = r + (Lw @ rng.standard_normal((s.rests, 3)))[k]
    channels = {("specific_force", a): g.count * np.round(y[:, i] / g.count) for i, a in enumerate("xyz")}
    if s.gyroscopes:
        channels |= {
            ("angular_rate", a): g.turning_count * np.round(r[:, i] / g.turning_count) for i, a in enumerate("xyz")
        }
    if s.thermometer:
        channels |= {("temperature", ""): np.round(h.T, 3)}
    if s.supply:
        channels |= {("covariate", "supply_voltage"): np.round(h.supply, 4)}
    return Recording("multi-position", "hand", BENCH, Site(LATITUDE, 0.0, G), {}, h.t, h.rest, channels)


def _left(d: Array, Z: Array, V: Array) -> float:
    """Square of the sigmas of d (n,) above noise of covariance V that columns Z cannot take up."""
    L = cholesky(V, lower=True)
    y, X = solve_triangular(L, d, lower=True), solve_triangular(L, Z / np.linalg.norm(Z, axis=0), lower=True)
    return float(np.sum((y - X @ np.linalg.lstsq(X, y, rcond=1e-9)[0]) ** 2))


def strength(seed: int, s: Setup, error: Error, beside: Error | None = None) -> float:
    """Sigmas of an effect of size one: in the norms at rest, the rates at rest and gravity after the turns together.

    beside: an effect that may take what it can of it, at rest.
    """
    h = course(np.random.default_rng(seed), s)
    made, m, g = error(h), s.rests, s.grade
    other = beside(h) if beside else {}
    rows = [np.flatnonzero(h.rest == k + 1) for k in range(m)]
    f = np.array([h.f[r[0]] for r in rows])
    total = 0.0
    if "force" in made:
        d = G * np.array([h.f[r[0]] @ made["force"][r].mean(0) for r in rows])
        V = (f @ f.T) * wanders(m, g.wander) + np.eye(m) * (g.white**2 + g.count**2 / 12) / len(rows[0])
        Z = np.concatenate([f, (f[:, :, None] * f[:, None, :]).reshape(m, 9)], axis=1)
        if "force" in other:
            Z = np.column_stack([Z, [h.f[r[0]] @ other["force"][r].mean(0) for r in rows]])
        if s.poses != 1:
            total += _left(d, Z, V)
    if "rate" in made:
        level = np.array([made["rate"][r].mean(0) for r in rows])
        V = wanders(m, g.turning_wander) + np.eye(m) * (
            g.turning**2 / len(rows[0]) + (EARTH * np.cos(LATITUDE)) ** 2 / 2
        )
        Z = np.ones((3, m, 1))
        if "rate" in other:
            taken = np.array([other["rate"][r].mean(0) for r in rows]).T[..., None]
            Z = np.concatenate([Z, taken + 1e-30], axis=2)
        total += sum(_left(level[:, i], Z[i], V) for i in range(3))
        if np.any(h.rest == 0):
            total += _after_turns(h, made["rate"], level, g, len(rows[0]))
    return float(np.sqrt(total))


def _after_turns(h: Hand, rate: Array, level: Array, g: Grade, samples: int) -> float:
    """The same in gravity's direction after each turn, clear of scale, misalignment and what the rests around say."""
    C, step = h.level.as_matrix(), float(np.median(np.diff(h.t)))
    d, Z, noise = [], [], []
    for k in range(1, len(level)):
        at = np.flatnonzero((h.rest == 0) & (np.cumsum(np.diff(h.rest, prepend=0) < 0) == k))
        ends = C[at[-1]] @ np.swapaxes(C[at], 1, 2)
        down = C[at[-1]][:, 2]
        across = np.cross(down, np.linalg.svd(down[None])[2][1:])
        off = rate[at] - (level[k - 1] + level[k]) / 2
        d += [*(across @ np.einsum("nij,nj->i", ends, off) * step)]
        Z += [*np.einsum("ai,nij,nk->ajk", across, ends, h.w[at]).reshape(2, 9) * step]
        lasts = len(at) * step
        tilt = (g.wander**2 + g.white**2 / samples) * 2 / G**2
        noise += [tilt + g.turning**2 * step * lasts + (g.turning_wander * lasts) ** 2] * 2
    return _left(np.array(d), np.array(Z), np.diag(noise))
