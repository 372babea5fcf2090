"""Units of several grades at rest in many attitudes, simulated without a line of the package's physics.

A unit lies still in one attitude after the other for a few seconds each. What its sensors do is drawn from data
sheets: navigation (Honeywell QA2000), tactical (Sensonor STIM300, Northrop LN-200), consumer (InvenSense MPU-9150).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from gimbalcal.number import Array
from gimbalcal.platform import BENCH, SPACE_STABLE
from gimbalcal.recording import Recording, Site
from tests.diagnose.plant import ARCSEC, STEPS, specific_force

G = 9.80665
UG = 1e-6 * G
DEG_H = np.pi / 648000  # rad/s of a degree an hour
SAMPLES, RATE = 40, 10.0  # of each rest, and a second


@dataclass(frozen=True)
class Sheet:
    """What a data sheet says: noise densities, and spreads (one sigma) of the constants of a unit."""

    force_noise: float  # ug/sqrt(Hz)
    rate_noise: float  # deg/h/sqrt(Hz)
    bias: float  # ug
    scale: float  # 1
    lean: float  # rad
    gyro_bias: float  # deg/h


SHEETS = {
    "navigation": Sheet(8.0, 0.3, 200.0, 2e-4, 1e-4, 0.05),
    "tactical": Sheet(60.0, 9.0, 2000.0, 5e-4, 1e-3, 10.0),
    "consumer": Sheet(300.0, 25.0, 40000.0, 1.5e-2, 1e-2, 3000.0),
}


@dataclass
class Rests:
    """Time (n,) s, rest (n,), unit force (n, 3) in g, temperature (n,) degC."""

    t: Array
    rest: Array
    f: Array
    T: Array
    rng: np.random.Generator


Law = Callable[[Rests], tuple[Array, Array]]
"""What an effect of size one adds to forces [ug] and to rates [deg/h], (n, 3) each."""


def rests(rng: np.random.Generator, count: int = 36, minutes: float = 30.0) -> Rests:
    """Attitudes near the faces and edges of a cube, in a random order, over so many minutes."""
    every = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)])
    chosen = every[np.concatenate([rng.permutation(len(every)) for _ in range(-(-count // len(every)))])[:count]]
    unit = chosen / np.linalg.norm(chosen, axis=1, keepdims=True)
    unit = Rotation.from_rotvec(0.1 * rng.standard_normal((count, 3))).apply(unit)
    rest = np.repeat(np.arange(count), SAMPLES)
    start = 60 * minutes / count * np.arange(count)
    t = start[rest] + np.tile(np.arange(SAMPLES), count) / RATE
    return Rests(t, rest, unit[rest], _weather(rng, t), rng)


def _weather(rng: np.random.Generator, t: Array) -> Array:
    """A unit that warms by some degrees in a room whose air goes to and fro."""
    warm = rng.uniform(4, 9) * -np.expm1(-t / (rng.uniform(0.3, 0.8) * t[-1]))
    return np.asarray(24 + warm + 0.8 * np.sin(2 * np.pi * t / t[-1] * rng.uniform(1.2, 2.0) + rng.uniform(0, 6)))


def record(
    seed: int, grade: str, law: Law | None = None, size: float = 0.0, *, thermometer: bool = True, gyros: bool = True,
    minutes: float = 30.0, stated: bool = False,
) -> Recording:  # fmt: skip
    """A unit of this grade turned by hand, with one more law of this size; its noise is in the header if stated."""
    rng = np.random.default_rng(seed)
    r = rests(rng, minutes=minutes)
    force, rate = read(r, SHEETS[grade], law, size)
    channels = {("specific_force", k): force[:, i] * UG for i, k in enumerate("xyz")}
    if gyros:
        channels |= {("angular_rate", k): rate[:, i] * DEG_H for i, k in enumerate("xyz")}
    return _recording(f"{grade} {seed}", r, channels, grade, thermometer, stated)


def on_gimbals(
    seed: int, grade: str, law: Law | None = None, size: float = 0.0, *, thermometer: bool = True, setting: float = 10.0
) -> Recording:
    """The accelerometers of such a unit in 18 positions of a table that sets its angles to so many arcsec."""
    rng = np.random.default_rng(seed)
    visit = np.repeat(np.arange(18), 60)
    t = visit * 90.0 + np.tile(np.arange(60.0), 18)
    angle = STEPS[visit]
    true = angle + ARCSEC * (60 * rng.standard_normal(3) + setting * rng.standard_normal((18, 3))[visit])
    r = Rests(t, visit, specific_force(true, np.zeros((len(t), 2))), _weather(rng, t), rng)
    force, _ = read(r, SHEETS[grade], law, size, 1.0)
    channels = {("specific_force", k): force[:, i] * UG for i, k in enumerate("xyz")}
    channels |= {("gimbal_angle", k): angle[:, i] for i, k in enumerate(("platform", "inner", "middle"))}
    made = _recording(f"{grade} {seed}", r, channels, grade, thermometer, False)
    return replace(made, platform=SPACE_STABLE, noise={"gimbal_angle": setting * ARCSEC})


def read(r: Rests, sheet: Sheet, law: Law | None, size: float, rate: float = RATE) -> tuple[Array, Array]:
    """What the sensors of such a unit read, (n, 3) in ug and in deg/h."""
    n = len(r.t)
    force, turning = law(r) if law else (np.zeros((n, 3)), np.zeros((n, 3)))
    M = np.diag(1 + sheet.scale * r.rng.standard_normal(3))
    M = M + sheet.lean * r.rng.standard_normal((3, 3)) * (1 - np.eye(3))
    white = np.sqrt(rate / 2)  # from a one-sided density to one sigma of a sample
    a = r.f @ M.T * 1e6 + sheet.bias * r.rng.standard_normal(3) + size * force
    a = a + white * sheet.force_noise * r.rng.standard_normal((n, 3))
    w = sheet.gyro_bias * r.rng.standard_normal(3) + size * turning
    return a, w + white * sheet.rate_noise * r.rng.standard_normal((n, 3))


def _recording(
    title: str, r: Rests, channels: dict[tuple[str, str], Array], grade: str, thermometer: bool, stated: bool
) -> Recording:
    if thermometer:
        channels["temperature", ""] = np.round(r.T + 0.05 * r.rng.standard_normal(len(r.t)), 2)
    sheet, white = SHEETS[grade], np.sqrt(RATE / 2)
    noise = {"accelerometer": white * sheet.force_noise * UG, "gyroscope": white * sheet.rate_noise * DEG_H}
    return Recording(
        "multi-position", title, BENCH, Site(None, 0.0, G), noise if stated else {}, r.t, r.rest + 1, channels
    )  # fmt: skip


def of_force(axis: int, course: Callable[[Rests], Array]) -> Law:
    """A law of one accelerometer."""

    def law(r: Rests) -> tuple[Array, Array]:
        out = np.zeros((len(r.t), 3))
        out[:, axis] = course(r)
        return out, np.zeros((len(r.t), 3))

    return law


def of_rate(axis: int, course: Callable[[Rests], Array]) -> Law:
    """A law of one gyroscope."""

    def law(r: Rests) -> tuple[Array, Array]:
        added = of_force(axis, course)(r)
        return added[1], added[0]

    return law


def late(r: Rests, tau: float) -> Array:
    """The temperature of something that follows the thermometer, in equilibrium at first."""
    out = np.empty_like(r.T)
    out[0] = r.T[0]
    for k in range(1, len(r.t)):
        share = -np.expm1(-(r.t[k] - r.t[k - 1]) / tau)
        out[k] = out[k - 1] + share * ((r.T[k] + r.T[k - 1]) / 2 - out[k - 1])
    return out


def walk(r: Rests) -> Array:
    """A random walk that is of order one at the end."""
    return np.cumsum(r.rng.standard_normal(len(r.t)) * np.sqrt(np.diff(r.t, prepend=r.t[0]) / r.t[-1]))


DRIFTS: dict[str, Callable[[Rests], Array]] = {
    "bias_drift": lambda r: r.t / r.t[-1],
    "warm_up short": lambda r: np.exp(-r.t / (0.1 * r.t[-1])),
    "warm_up middle": lambda r: np.exp(-r.t / (0.4 * r.t[-1])),
    "warm_up long": lambda r: np.exp(-r.t / (1.5 * r.t[-1])),
    "bias_temperature": lambda r: (r.T - 24) / 8,
    "bias_temperature_lagged": lambda r: (late(r, 0.15 * r.t[-1]) - 24) / 8,
    "slow_bias_drift": walk,
}
"""Courses of a bias that reach about one within the recording."""

PATTERNS: dict[str, Callable[[Rests, int], Array]] = {
    "quadratic_nonlinearity": lambda r, i: r.f[:, i] ** 2,
    "cubic_nonlinearity": lambda r, i: r.f[:, i] ** 3,
    "scale_asymmetry": lambda r, i: np.abs(r.f[:, i]),
    "cross_coupling": lambda r, i: r.f[:, i] * r.f[:, (i + 1) % 3],
    "bias_step": lambda r, i: np.asarray(r.rest > np.max(r.rest) / 2, dtype=float),
    "scale_temperature": lambda r, i: r.f[:, i] * (r.T - 24) / 8,
    "bias_temperature_squared": lambda r, i: (r.T - 24) ** 2 / 64,
}
"""Other laws of one accelerometer i, of order one."""

RATES: dict[str, Callable[[Rests, int], Array]] = {
    "gyro_g_sensitivity_rate": lambda r, i: r.f[:, (i + 1) % 3],
    "gyro_bias_drift": lambda r, i: r.t / r.t[-1],
    "gyro_bias_temperature": lambda r, i: (r.T - 24) / 8,
}
"""Laws of one gyroscope i, of order one."""

SIZES = {  # ug and deg/h within one recording, from data sheets, as ranges
    "navigation": {"drift": (10, 60), "pattern": (20, 80), "rate": (0.5, 3.0)},
    "tactical": {"drift": (60, 500), "pattern": (60, 500), "rate": (10, 60)},
    "consumer": {"drift": (1000, 8000), "pattern": (800, 6000), "rate": (40, 400)},
}
