"""A plant of its own for a unit on a table that tilts: gravity leaks in, arms and delays act, the building shakes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site

G = 9.80146
RATE, LASTS = 100.0, 60.0  # Hz, s
WHITE, TURNING = 1e-4, 1e-7  # m/s^2 and rad/s of one sample
BLOCK = 1.0  # s over which strengths are judged


@dataclass(frozen=True, eq=False)
class Table:
    """Time, attitude, rate (n, 3) and its change, and the specific force (n, 3) of an instrument in the pivot."""

    t: Array
    C: Array
    w: Array
    dw: Array
    f: Array


# an effect adds to the force (n, 3) [m/s^2]
Error = Callable[[Table], Array]


def table(rng: np.random.Generator) -> Table:
    """Six smooth tilts to and fro about each of two level axes, and rocking about both."""
    t = np.arange(round(LASTS * RATE)) / RATE
    angle = np.zeros((len(t), 2))
    for axis in range(2):
        for begin in 3 + 9 * np.arange(6) + 3 * axis + rng.uniform(0, 1, 6):
            x = np.clip((t - begin) / rng.uniform(1.0, 2.5), 0, 1)
            angle[:, axis] += (
                rng.choice([-1, 1]) * rng.uniform(0.5e-3, 2e-3) * (x - np.sin(2 * np.pi * x) / (2 * np.pi))
            )
        angle[:, axis] += 1e-4 * np.sin(2 * np.pi * rng.uniform(0.3, 0.6) * t + rng.uniform(0, 6))
    turn = Rotation.from_euler("xy", angle)  # body axes in level ones
    C = turn.as_matrix().transpose(0, 2, 1)
    step = (turn[:-1].inv() * turn[1:]).as_rotvec() * RATE
    w = np.concatenate([step[:1], (step[1:] + step[:-1]) / 2, step[-1:]])
    return Table(t, C, w, np.gradient(w, t, axis=0), C @ [0.0, 0.0, -G])


def record(seed: int, errors: tuple[tuple[Error, float], ...] = ()) -> Recording:
    """One recording, the force about its mean as a seismometer gives it, with what is concealed."""
    rng = np.random.default_rng(seed)
    k = table(rng)
    n = len(k.t)
    f = k.f + sum((size * error(k) for error, size in errors), np.zeros((n, 3)))
    f = f + WHITE * rng.standard_normal((n, 3)) + rng.uniform(-1e-3, 1e-3, 3)
    shaking = 2e-4 * np.sin(2 * np.pi * rng.uniform(8, 20, 3) * k.t[:, None] + rng.uniform(0, 6, 3))
    w = k.w + TURNING * rng.standard_normal((n, 3))
    channels = {("specific_force", a): (f + shaking)[:, i] for i, a in enumerate("xyz")}
    channels |= {("angular_rate", a): w[:, i] for i, a in enumerate("xyz")}
    return Recording("rotation", "table", BENCH, Site(None, 0.0, G), {}, k.t, None, channels)


def strength(seed: int, error: Error) -> float:
    """Sigmas of an effect of size one in means over `BLOCK`, clear of the mean and of the tilt itself."""
    k = table(np.random.default_rng(seed))
    size = round(BLOCK * RATE)

    def rows(x: Array) -> Array:
        means = x.reshape(-1, size, 3).mean(axis=1)
        return np.asarray((means - means.mean(axis=0)).ravel())

    Z = np.column_stack([rows(k.f - k.f.mean(axis=0))])
    d = rows(error(k))
    return float(np.linalg.norm(d - Z @ np.linalg.lstsq(Z, d, rcond=1e-9)[0]) / (WHITE / np.sqrt(size)))
