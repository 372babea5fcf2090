"""A table of its own: attitude in closed form, mean readings by quadrature, then the laws of the sensors."""

import numpy as np

from gimbalcal.earth import EARTH_RATE, normal_gravity
from gimbalcal.effects import with_values
from gimbalcal.forward import predict
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site

LATITUDE = np.radians(34.2)
AXIS = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, 1.0])}
# Wei et al. (2022), Table 1, first half: twelve attitudes, each axis up and down
MOVES = (
    ("y", 90), ("y", 90), ("y", 90), ("y", -180), ("y", -90), ("z", 90), ("x", 90), ("x", 90), ("x", 90), ("x", -180),
    ("x", -90), ("z", 90), ("z", 90), ("z", -180), ("z", -90),
)  # fmt: skip
START = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])  # x down: every turn is about a level axis
NOISE = {"accelerometer": 2e-4, "gyroscope": 2.6e-6, "velocity": 1e-5}  # of one sample at 20 Hz


def turning_unit(
    truth=(), parameters=(), values=(), moves=MOVES, stop=30.0, speed=10.0, ramp=1.0, rate=20.0, noise=NOISE, seed=0,
    start=START, drift=None, carried=None,
) -> Recording:  # fmt: skip
    """A rotation recording; speed [deg/s], stop and ramp [s], rate [Hz]; start C_bn (3, 3);
    drift: what is added to the forces (n, 3) at time (n,) [s]; carried: acceleration (n, 3) [m/s^2] of the place."""
    h = 1 / rate
    C = np.asarray(start, dtype=float)
    gravity = float(normal_gravity(LATITUDE))
    earth, g = EARTH_RATE * np.array([np.cos(LATITUDE), 0, -np.sin(LATITUDE)]), np.array([0, 0, gravity])
    nodes, weights = np.polynomial.legendre.leggauss(5)
    force, turn = [], []
    for name, degrees in (("x", 0), *moves):
        size, top = np.radians(abs(degrees)), np.radians(speed)
        edges = h * np.arange(round(((size / top + ramp if size else 0) + stop) / h) + 1)
        at = edges[:-1, None] + h * (nodes + 1) / 2
        a, sense = AXIS[name], np.sign(degrees)
        mean = np.einsum("q,nqij->nij", weights / 2, C @ _about(a, sense * _gone(at, size, top, ramp)))
        since = h * sum(len(f) for f in force)
        a_n = carried(since + at.mean(axis=1)) if carried else np.zeros((len(at), 3))
        force.append(np.einsum("ni,nij->nj", a_n - g, mean))
        gone = sense * _gone(edges, size, top, ramp)
        turn.append(a * (np.diff(gone) / h)[:, None] + earth @ mean)
        C = C @ _about(a, gone[-1])
    f, w = np.concatenate(force), np.concatenate(turn)
    n = len(f)
    time = h * np.arange(1, n + 1)
    made = _recording(time, f, w, noise)
    effects = (*truth, *with_values((), parameters, np.asarray(values, dtype=float)))
    if effects:
        out = predict(BENCH, stimulus_from_truth(made, f, w), effects, "rotation")
        f, w = out["specific_force"], out["angular_rate"]
    rng = np.random.default_rng(seed)
    f = f + noise["accelerometer"] * rng.standard_normal((n, 3))
    w = w + noise["gyroscope"] * rng.standard_normal((n, 3))
    return _recording(time, f if drift is None else f + drift(time), w, noise)


def _recording(time: Array, f: Array, w: Array, noise) -> Recording:
    channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
    channels |= {("angular_rate", a): w[:, i] for i, a in enumerate("xyz")}
    site = Site(LATITUDE, 0.0, float(normal_gravity(LATITUDE)))
    return Recording("rotation", "a table", BENCH, site, dict(noise), time, None, channels)


def _gone(t, size, top, ramp):
    """Angle of a move after t [s]: ramp up, turn at `top`, ramp down, stay."""
    end = size / top + ramp
    t = np.clip(t, 0, end if size else 0)
    p = np.where(t < ramp, top * t**2 / (2 * ramp), top * (t - ramp / 2))
    return np.where(t > end - ramp, size - top * (end - t) ** 2 / (2 * ramp), p) if size else 0 * t


def _about(a, theta):
    """exp([a theta x]) (..., 3, 3)."""
    K = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    s, c = np.sin(theta)[..., None, None], np.cos(theta)[..., None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)
