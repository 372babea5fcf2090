"""A plant of its own for the diagnosis: exact rotations by scipy, every law written again, no line of the catalogue.

Multi-position recordings in memory: 18 positions of 2 min, temperature as a noisy sine, and any effect.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Recording, Site

G = 9.80146
UG = 9.80665e-6
ARCSEC = np.pi / 180 / 3600
LOGS = ("fan",)
FEW = 24  # readings in a position: a diagnosis of 120 takes three times as long
DRIFTS = {"base_tilt_drift", "base_tilt_diurnal"}
STEPS = np.array([
    (0, 0, 0), (0, 1, 0), (0, 2, 0), (1, 2, 0), (2, 2, 0), (2, 1, 0), (2, 4, 0), (2, 4, -1), (2, 4, -2),
    (3, 4, -2), (4, 4, -2), (4, 4, -1), (4, 5, 0), (3, 6, 0), (2, 7, 0), (2, 0, -1), (1, 0, -2), (0, 0, -3),
]) * np.pi / 4  # fmt: skip


@dataclass
class Bench:
    """What the rig goes through: time, visit, angles that are read, temperature, and what an effect may change."""

    t: Array
    visit: Array
    read: Array  # (n, 3) platform, inner, middle
    since: Array
    T: Array
    rng: np.random.Generator
    body: Array  # (n,) temperature without the thermometer's noise

    @property
    def ideal(self) -> Array:
        """Specific force (n, 3) in g of a perfect rig."""
        return specific_force(self.read, np.zeros((len(self.t), 2)))


Error = Callable[[Bench], dict[str, Array]]


def specific_force(angle: Array, tilt: Array, lean: Array | None = None) -> Array:
    """-g in platform axes (n, 3) [g]; tilt (n, 2) of the base about north and east, lean (n, 3, 3) of each axis."""
    down = Rotation.from_rotvec(np.column_stack([-tilt, np.zeros(len(tilt))])).apply([0.0, 0.0, 1.0])
    return -inwards(down, angle, lean)


def inwards(v: Array, angle: Array, lean: Array | None = None) -> Array:
    """Vectors (n, 3) from level axes into platform axes: rotate the body, not the frame, bearing by bearing."""
    lean = np.zeros((len(angle), 3, 3)) if lean is None else lean
    for name, gimbal in (("y", 2), ("x", 1), ("z", 0)):
        v = Rotation.from_rotvec(-lean[:, gimbal]).apply(v)
        v = Rotation.from_euler(name, -angle[:, gimbal, None]).apply(v)
    return np.asarray(v)


def bench(rng: np.random.Generator, dwell: int = 120, sweeps: int = 1, rows: int = FEW) -> Bench:
    """A timetable of `sweeps` times 18 positions of `dwell` s, a reading a second but no more than `rows` in each."""
    visits, rows = 18 * sweeps, min(rows, dwell)
    visit = np.repeat(np.arange(visits), rows)
    t = np.concatenate([v * (dwell + 15.0) + dwell / rows * np.arange(rows) for v in range(visits)])
    phase, period = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.2) * t[-1]
    body = 23 + rng.uniform(-1, 1) + 2 * np.sin(2 * np.pi * t / period + phase)
    T = body + 0.01 * rng.standard_normal(len(t))
    return Bench(t, visit, STEPS[visit % 18], t - visit * (dwell + 15.0), T, rng, body)


def record(
    rng: np.random.Generator, error: Error | None = None, size: float = 0.0, *, white: float = 20.0, tails: float = 0.0,
    walk: float = 0.0, loose: float = 1.0, dwell: int = 120, sweeps: int = 1, rows: int = FEW,
    hide: tuple[str, ...] = (), unit: np.random.Generator | None = None,
) -> Recording:  # fmt: skip
    """One recording. `white` ug per sample; `tails` degrees of freedom of Student's t (0: normal); `walk` ug over the
    whole test; `loose` times the 1 arcsec setting error that the header states; `unit` draws the constants."""
    unit = rng if unit is None else unit
    b = bench(rng, dwell, sweeps, rows)
    n, visits = len(b.t), int(b.visit.max()) + 1
    extra = error(b) if error else {}
    setting = loose * ARCSEC * rng.standard_normal((visits, 3))[b.visit]
    zero = unit.uniform(-50, 50, 3) * ARCSEC
    angle = b.read + zero + setting + size * extra.get("angle", 0.0)
    bent = size * extra.get("lean", np.zeros((n, 3, 3)))
    f = specific_force(angle, size * extra.get("tilt", np.zeros((n, 2))), bent) * G
    lean = np.eye(3) + unit.uniform(-40, 40, (3, 3)) * ARCSEC * (1 - np.eye(3))
    u = f @ lean.T / (1 + unit.uniform(-4e-4, 4e-4, 3))
    K, bias = unit.uniform(-2e-6, 2e-6, 3), unit.uniform(-300, 300, 3) * UG
    u = u - np.sign(u) * np.minimum(np.abs(u), size * extra.get("dead", 0.0))
    w = u + K * u**2 + 2 * K**2 * u**3
    noise = rng.standard_t(tails, (n, 3)) * np.sqrt((tails - 2) / tails) if tails else rng.standard_normal((n, 3))
    steps = rng.standard_normal((n, 3)) * np.sqrt(np.diff(b.t, prepend=b.t[0]) / b.t[-1])[:, None]
    out = w + bias + white * UG * noise + walk * UG * np.cumsum(steps, axis=0) + size * extra.get("output", 0.0)
    channels = {("specific_force", a): out[:, i] for i, a in enumerate("xyz")}
    channels |= {("gimbal_angle", a): b.read[:, i] for i, a in enumerate(("platform", "inner", "middle"))}
    channels |= {("temperature", ""): b.T}
    channels |= {("covariate", k): v for k, v in extra.items() if k in LOGS}
    channels = {k: v for k, v in channels.items() if k[0] not in hide}
    stated = {"accelerometer": white * UG, "gimbal_angle": ARCSEC}
    return Recording("multi-position", "plant", SPACE_STABLE, Site(None, 0.0, G), stated, b.t,
                     b.visit % 18 + 1, channels)  # fmt: skip


def on(axis: int, values: Array) -> dict[str, Array]:
    """An output error of one accelerometer."""
    out = np.zeros((len(values), 3))
    out[:, axis] = values
    return {"output": out}


def turned(gimbal: int, values: Array) -> dict[str, Array]:
    """An error of one gimbal angle."""
    out = np.zeros((len(values), 3))
    out[:, gimbal] = values
    return {"angle": out}


def cooled(b: Bench, tau: float) -> Array:
    """Temperature behind a first-order lag, step by step."""
    y = np.empty_like(b.T)
    y[0] = b.T[0]
    for k in range(1, len(y)):
        a = np.exp(-(b.t[k] - b.t[k - 1]) / tau)
        y[k] = a * y[k - 1] + (1 - a) * (b.T[k] + b.T[k - 1]) / 2
    return y


def came(b: Bench, gimbal: int) -> Array:
    moves = np.sign(np.diff(STEPS[:, gimbal], prepend=STEPS[0, gimbal]))
    return np.asarray(moves[b.visit % 18])


def known(axis: int) -> dict[str, tuple[Error, set[str]]]:
    """Effects on one accelerometer, gimbal or direction, and the ids that name them (exact twins included)."""
    f = lambda b: b.ideal[:, axis]  # noqa: E731
    j = (axis + 1) % 3
    return {
        "cubic": (lambda b: on(axis, f(b) ** 3), {"cubic_nonlinearity", "odd_quadratic", "soft_saturation"}),
        "asymmetry": (lambda b: on(axis, np.abs(f(b))), {"scale_factor_asymmetry"}),
        "cross": (lambda b: on(axis, f(b) * b.ideal[:, j]), {"cross_coupling"}),
        "bias T": (lambda b: on(axis, b.T - 20), {"bias_temperature"}),
        "scale T": (lambda b: on(axis, f(b) * (b.T - 20)), {"scale_temperature"}),
        "lagged T": (lambda b: on(axis, cooled(b, 1200.0)), {"bias_temperature_lagged"}),
        "warm-up": (lambda b: on(axis, np.exp(-b.t / 700.0)), {"warm_up"}),
        "drift": (lambda b: on(axis, b.t / b.t[-1]), {"bias_drift"}),
        "step": (lambda b: on(axis, (b.visit >= 8).astype(float)), {"bias_step"}),
        "eccentricity": (lambda b: turned(1, np.sin(b.read[:, 1] + axis)), {"encoder_eccentricity", "gimbal_flexure"}),
        "two-cycle": (lambda b: turned(0, np.sin(2 * b.read[:, 0] + axis)), {"encoder_two_cycle"}),
        "friction": (lambda b: turned(1, came(b, 1)), {"gimbal_friction"}),
        "tilt drift": (lambda b: {"tilt": np.outer(b.t, [1.0, 0.5]) / b.t[-1]}, DRIFTS),
        "blunder": (lambda b: turned(2, (b.visit == 4 + axis).astype(float)), {"position_blunder"}),
    }


def strange(axis: int) -> dict[str, Error]:
    """Effects that no catalogue holds."""
    return {
        "mixed angle": lambda b: on(axis, np.sin(5 * b.read[:, 0] + 3 * b.read[:, 1] + 1.0)),
        "cycling": lambda b: on(axis, np.sin(2 * np.pi * b.t / 660.0)),
        "thermal rate cubed": lambda b: on(axis, (np.gradient(cooled(b, 30.0), b.t) * 300) ** 3),
        "scrambled": lambda b: on(axis, np.random.default_rng(7 + axis).standard_normal(18)[b.visit % 18]),
        "beat": lambda b: on(axis, b.ideal[:, (axis + 1) % 3] * np.sin(2 * np.pi * b.t / 900.0)),
    }


def strength(recording_of: Callable[[float], Recording], probe: float) -> float:
    """Sigmas above noise of an effect of size `probe`, after calibration and setting errors took what they can."""
    from gimbalcal.diagnose.evidence.projection import orthonormal
    from gimbalcal.diagnose.evidence.stated_noise import nominal_noise
    from gimbalcal.diagnose.search.refit import fit_baseline
    from gimbalcal.views.known_attitude import view_at_known_attitude

    with_it, without = recording_of(probe), recording_of(0.0)
    o = fit_baseline(view_at_known_attitude(without))
    d = (with_it.triad("specific_force") - without.triad("specific_force")) / o.sigma
    node = nominal_noise(o)
    Q = orthonormal(node.whiten(o.reduced(o.Z)))
    y = node.whiten(o.reduced(d[:, :, None]))[:, 0]
    return float(np.linalg.norm(y - Q @ (Q.T @ y)))


def at_strength(seed: int, error: Error, sigmas: float, rows: int = FEW, **noise: float) -> Recording:
    """A recording in which the effect stands `sigmas` above noise."""
    probe = 3 * UG

    def of(size: float) -> Recording:
        return record(np.random.default_rng(seed), error, size, rows=rows)

    size = probe * sigmas / strength(of, probe)
    return record(np.random.default_rng(seed), error, size, rows=rows, **noise)  # type: ignore[arg-type]
