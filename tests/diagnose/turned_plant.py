"""A plant of its own for units that turn from rest to rest, by hand or on gimbals: every row, the turns with them.

Attitudes are exact rotations by scipy, rates their differences over 0.1 ms, and every channel is what was there a while
ago: `late` [s] of force, rate and readout. No line of the package is in it but the recording that is made.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from gimbalcal.number import Array
from gimbalcal.platform import BENCH, KNOWN
from gimbalcal.recording import Recording, Site

G, DEG, ARCSEC = 9.80665, np.pi / 180, np.pi / 648000
EARTH = 7.292115e-5
LATITUDE = 0.8
EIGHTEEN = np.array([
    (0, 0, 0), (0, 1, 0), (0, 2, 0), (1, 2, 0), (2, 2, 0), (2, 1, 0), (2, 4, 0), (2, 4, -1), (2, 4, -2),
    (3, 4, -2), (4, 4, -2), (4, 4, -1), (4, 5, 0), (3, 6, 0), (2, 7, 0), (2, 0, -1), (1, 0, -2), (0, 0, -3),
]) * np.pi / 4  # fmt: skip

Law = Callable[[Array, Array, Array, Array], Array]  # of force, rate, temperature, time (n, ...): what is added


def nothing(f: Array, w: Array, T: Array, t: Array) -> Array:
    """No error beyond the linear ones."""
    return 0 * f


@dataclass
class Unit:
    """What is wrong with a unit beside bias, scale and misalignment of 1 % each (times `linear`), and its noise."""

    force: Law = nothing
    rate: Law = nothing
    late: Mapping[str, float] = field(default_factory=dict)  # s, of "force", "rate", "readout"
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m
    linear: float = 1.0
    noise: tuple[float, float, float] = (1e-4 * G, 3e-3 * DEG, 1 * ARCSEC)  # of a sample of force, rate, readout
    temperature: Callable[[Array], Array] | None = None
    jitter: float = 0.0  # of a step, of the times of arrival
    shakes: float = 0.0  # m/s^2, of the ground, at 7 Hz
    hand: float = 0.3  # m/s^2, by which a hand moves the unit sideways while it turns it


@dataclass
class _Path:
    """Attitudes at rest and how long: readouts of gimbals (m, 3) or rotations of a hand; begin and end of each turn."""

    attitude: Callable[[Array], Rotation]  # of the body against north, east, down, at times (n,)
    readout: Callable[[Array], Array] | None
    begin: Array
    end: Array
    total: float


def part(t: Array, begin: Array, end: Array, ramp: Array | float) -> Array:
    """Share of a turn that is done at t: the rate rises and falls as half a cosine over `ramp` s."""
    T = end - begin
    r = np.minimum(ramp, T / 2)
    x = np.clip(t - begin, 0.0, T)
    up = x / 2 - r / (2 * np.pi) * np.sin(np.pi * np.minimum(x, r) / r)
    down = (T - r) - ((T - x) / 2 - r / (2 * np.pi) * np.sin(np.pi * np.minimum(T - x, r) / r))
    return np.asarray(np.where(x < r, up, np.where(x > T - r, down, x - r / 2)) / (T - r))


def on_gimbals(holds: Array, speed: float, dwell: float, ramp: float) -> _Path:
    """Readouts (m, 3) of platform, inner, middle, all axes at once, at `speed` [rad/s] of the one that goes far."""
    lasts = np.abs(np.diff(holds, axis=0)).max(axis=1) / speed + ramp
    end = np.cumsum(dwell + lasts)
    begin = end - lasts

    def readout(t: Array) -> Array:
        out = np.broadcast_to(holds[0], (len(t), 3)).copy()
        for k, step in enumerate(np.diff(holds, axis=0)):
            out += part(t, begin[k], end[k], ramp)[:, None] * step
        return out

    def attitude(t: Array) -> Rotation:  # g^p = Rz(1) Rx(2) Ry(3) g, frames turned: body to level is the inverse
        return Rotation.from_euler("YXZ", readout(t)[:, ::-1])

    return _Path(attitude, readout, begin, end, float(end[-1] + dwell))


def by_hand(rests: int, rest: float, turn: float, rng: np.random.Generator, cube: bool = False) -> _Path:
    """Rotations about any axis by 50 to 130 deg, or about the unit's own axes by 90."""
    n = rests - 1
    axis = rng.standard_normal((n, 3))
    vector = axis / np.linalg.norm(axis, axis=1, keepdims=True) * rng.uniform(0.8, 2.2, (n, 1))
    if cube:
        vector = np.eye(3)[rng.integers(3, size=n)] * rng.choice([-1, 1], (n, 1)) * np.pi / 2
    lasts = turn * rng.uniform(0.8, 1.3, n)
    end = np.cumsum(rest + lasts)
    begin = end - lasts
    held = [Rotation.identity()]
    for v in vector:
        held.append(held[-1] * Rotation.from_rotvec(v))

    def attitude(t: Array) -> Rotation:
        k = np.minimum(np.searchsorted(end, t), n - 1)
        share = part(t, begin[k], end[k], 0.4 * lasts[k])
        start = Rotation.concatenate(held)[k]
        return start * Rotation.from_rotvec(share[:, None] * vector[k])

    return _Path(attitude, None, begin, end, float(end[-1] + rest))


def rate_of(path: _Path, t: Array, h: float = 1e-4) -> Array:
    """Angular rate (n, 3) in the body, against the Earth."""
    turned = (path.attitude(t - h).inv() * path.attitude(t + h)).as_rotvec()
    return np.asarray(turned / (2 * h))


def logged(
    path: _Path, unit: Unit, hz: float, rng: np.random.Generator, latitude: float | None = LATITUDE
) -> Recording:
    """Every row of a path, turns with position 0; the noise is not stated but for the readout's."""
    t = np.arange(int(path.total * hz)) / hz
    stamp = t + unit.jitter / hz * rng.standard_normal(len(t))
    T = np.full(len(t), 20.0) if unit.temperature is None else unit.temperature(t)

    def there(t: Array) -> tuple[Array, Array]:
        C, w = path.attitude(t), rate_of(path, t)
        turning = (rate_of(path, t + 1e-3) - rate_of(path, t - 1e-3)) / 2e-3
        up = np.tile([0.0, 0.0, -G], (len(t), 1)) + unit.shakes * np.sin(2 * np.pi * 7 * t)[:, None] * [1, 0.5, 0.3]
        if path.readout is None:
            for k, (a, b) in enumerate(zip(path.begin, path.end, strict=True)):
                x = np.clip((t - a) / (b - a), 0, 1)
                up += unit.hand * np.sin(2 * np.pi * x)[:, None] * np.random.default_rng(k).standard_normal(3)
        r = np.asarray(unit.lever) + 0 * w
        felt = C.inv().apply(up) + np.cross(turning, r) + np.cross(w, np.cross(w, r))
        return felt, w + C.inv().apply(EARTH * np.array([np.cos(LATITUDE), 0, -np.sin(LATITUDE)]))

    late = {"force": 0.0, "rate": 0.0, "readout": 0.0, **unit.late}
    f, w = there(t - late["force"])[0], there(t - late["rate"])[1]
    M = np.eye(3) + 0.01 * unit.linear * rng.standard_normal((3, 3))
    N = np.eye(3) + 0.01 * unit.linear * rng.standard_normal((3, 3))
    y = f @ M.T + 0.2 * unit.linear * rng.standard_normal(3) + unit.force(f, w, T, t)
    z = w @ N.T + 0.3 * DEG * unit.linear * rng.standard_normal(3) + unit.rate(f, w, T, t)
    y += unit.noise[0] * rng.standard_normal(y.shape)
    z += unit.noise[1] * rng.standard_normal(z.shape)
    channels = {("specific_force", a): y[:, i] for i, a in enumerate("xyz")}
    channels |= {("angular_rate", a): z[:, i] for i, a in enumerate("xyz")}
    noise = {}
    if path.readout is not None:
        angle = path.readout(t - late["readout"]) + unit.noise[2] * rng.standard_normal((len(t), 3))
        channels |= {("gimbal_angle", a): angle[:, i] for i, a in enumerate(("platform", "inner", "middle"))}
        noise = {"gimbal_angle": 1 * ARCSEC}
    if unit.temperature is not None:
        channels["temperature", ""] = T
    k = np.searchsorted(path.end, t, side="right")
    moving = (k < len(path.begin)) & (t >= np.append(path.begin, np.inf)[k])
    platform = BENCH if path.readout is None else KNOWN["space-stable"]
    position = np.where(moving, 0, k + 1)
    return Recording("multi-position", "plant", platform, Site(latitude, 0.0, G), noise, stamp, position, channels)


def turned(
    seed: int, unit: Unit, rests: int = 26, latitude: float | None = LATITUDE, cube: bool = False, hz: float = 30.0
) -> Recording:
    """A unit turned by hand: rests of 3 s, turns of 1.2 to 2 s."""
    rng = np.random.default_rng(seed)
    return logged(by_hand(rests, 3.0, 1.5, rng, cube), unit, hz, rng, latitude)


def gimballed(
    seed: int, unit: Unit, speed: float = 6 * DEG, dwell: float = 10.0, hz: float = 20.0, ramp: float = 1.0
) -> Recording:
    """Eighteen positions on a space-stable platform with everything logged; the slews too."""
    rng = np.random.default_rng(seed)
    return logged(on_gimbals(EIGHTEEN, speed, dwell, ramp), unit, hz, rng)
