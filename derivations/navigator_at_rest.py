"""What surrounds the package's navigators: the Earth, aids, alignment, errors in metres, and the budget of parts.

As in `navigator`, nothing is derived here that the mechanisation does not hold; rates are the odd part of a step
forward and one back.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from derivations import mechanisation as nav
from derivations.navigator import HEIGHT, LATITUDE, LONGER, STEP
from derivations.readings import TURN
from derivations.stimulus import attitude
from derivations.turning import rotation

HEIGHT_S, DAMPING = 100.0, 0.5
G = float(nav.gravity(np.float64(LATITUDE), HEIGHT))


# --- the Earth


def earth_rate() -> float:
    """Return the Earth's rate in north, east, down, over its size."""
    from gimbalcal.earth import rate_at

    return float(np.abs(TURN @ rate_at(LATITUDE) - nav.earth_in_n(np.float64(LATITUDE))).max() / nav.OMEGA)


def earth_radii() -> float:
    """Return the radii of curvature, relative."""
    from gimbalcal.earth import radii

    return float(np.abs(np.array(radii(LATITUDE)) / np.array(nav.radii(LATITUDE)) - 1).max())


def normal_gravity() -> float:
    """Return gravity and how it falls with height, relative."""
    from gimbalcal.earth import normal_gravity as ours

    heights = (0.0, 1000.0)
    derived = np.array([float(nav.gravity(np.float64(LATITUDE), h)) for h in heights])
    return float(np.abs(np.array([ours(LATITUDE, h) for h in heights]) / derived - 1).max())


def rotation_of_samples() -> float:
    """Return the rotation vector from sample to sample of w(t), to second order in w: its integral, and coning.

    phi = int w dt + 1/2 int alpha x w dt, alpha = int w dt; the first for a quadratic w, the second for a linear one.
    """
    from gimbalcal.rotation import mean_rates

    t, h = sp.symbols("t h", real=True)
    a, b, c = (np.array(v) for v in ((0.3, -0.2, 0.5), (-0.4, 0.6, 0.1), (0.2, 0.3, -0.7)))
    time = np.array([0.0, 0.1, 0.2, 0.3])
    level, bend, _ = mean_rates(time, a + b * time[:, None] + c * time[:, None] ** 2)
    first, last = float(time[1]), float(time[2])
    mean = [float(sp.integrate(x + y * t + z * t**2, (t, first, last))) for x, y, z in zip(a, b, c, strict=True)]
    _, _, coning = mean_rates(time, a + b * time[:, None])
    w = sp.Matrix(a) + sp.Matrix(b) * (first + t)
    alpha = w.applyfunc(lambda x: sp.integrate(x, (t, 0, t)))
    half = (alpha.cross(w) / 2).applyfunc(lambda x: sp.integrate(sp.expand(x), (t, 0, h)).subs(h, last - first))
    ours = np.stack([(level + bend)[1], coning[1]]) * (last - first)
    return float(np.abs(ours - np.array([mean, [float(x) for x in half]])).max())


# --- aids


def _loops() -> tuple[float, float, float]:
    """Return damping and both gains of the height's loop: 2 zeta w_S, 2 / T, 1 / T^2 with gravity's slope made up for.

    With off = h - h_ext: off' = v_U - c1 off, v_U' = -(c2 + dg/dh) off must be critically damped with time T.
    """
    R_M, R_N = nav.radii(LATITUDE)
    schuler = np.sqrt(G / np.sqrt((R_M + HEIGHT) * (R_N + HEIGHT)))
    slope = (nav.gravity(np.float64(LATITUDE), HEIGHT + 100) - nav.gravity(np.float64(LATITUDE), HEIGHT - 100)) / 200
    return 2 * DAMPING * float(schuler), 2 / HEIGHT_S, 1 / HEIGHT_S**2 - float(slope)


def loops() -> float:
    """Return the constants of the space-stable navigator's loops, relative."""
    from gimbalcal.navigate.space_stable_navigator import Aids, InertialSite, _loop_constants

    site = InertialSite(LATITUDE, HEIGHT, G, 0.0)
    ours = np.array(_loop_constants(site, Aids(damping=DAMPING, height_s=HEIGHT_S))[1:])
    return float(np.abs(ours / np.array(_loops()) - 1).max())


VELOCITY = np.array([3.0, -2.0, 0.0])  # m/s, east, north, up
ABOVE = 10.0  # m


def _by_aids() -> tuple[Any, float]:
    """Return what the aids add to the rates of velocity (3,) east, north, up and height, at `VELOCITY` and `ABOVE`."""
    damping, c1, c2 = _loops()
    return np.array([-damping * VELOCITY[0], -damping * VELOCITY[1], -c2 * ABOVE]), -c1 * ABOVE


def aided_strapdown() -> float:
    """Return the rates of velocity and height of a level unit that moves above its reference, over their sizes."""
    from gimbalcal.navigate.strapdown import aided_strapdown

    force = np.array([0.1, 0.2, -9.7])
    start = np.array([LATITUDE, 0.0, HEIGHT])
    C = TURN @ attitude()
    reference = np.array([[0.0, 0.0, HEIGHT - ABOVE]])
    damping = _loops()[0]

    def rates(aids: tuple[float, float]) -> Any:
        ends = []
        for h in (STEP, -STEP):
            end = aided_strapdown(np.array([h]), np.zeros((1, 3)), force[None], C, start, np.array([0]), *aids, G,
                        TURN @ VELOCITY, reference)  # fmt: skip
            ends.append(np.r_[TURN @ end.velocity[1], end.position[1, 2]])
        return (ends[0] - ends[1]) / (2 * STEP)

    added = rates((damping, HEIGHT_S)) - rates((0.0, 1e9))
    v, height = _by_aids()
    slope = -1 / HEIGHT_S**2 + _loops()[2]  # what 1e9 s leave: gravity's slope, made up for
    v = v + np.array([0, 0, slope * ABOVE])
    return float(np.abs(added - np.r_[v, height]).max() / abs(height))


def aided_among_the_stars() -> float:
    """Return the same of the space-stable navigator, with its own constants left out and put in."""
    from gimbalcal.navigate.space_stable_navigator import _run_loop

    phase = 0.4
    s, c, S, K = np.sin(LATITUDE), np.cos(LATITUDE), np.sin(phase), np.cos(phase)
    C = np.array([[-S, K, 0], [-s * K, -s * S, c], [c * K, c * S, s]])  # platform to east, north, up
    R_N = nav.radii(LATITUDE)[1]
    r = np.array([(R_N + HEIGHT) * c * K, (R_N + HEIGHT) * c * S, (R_N * (1 - nav.E2) + HEIGHT) * s])
    v = C.T @ VELOCITY + nav.OMEGA * np.array([-r[1], r[0], 0])
    place = np.array([G, LATITUDE, 0.0, HEIGHT, 0.0])

    def rates(loop: tuple[float, float, float]) -> Any:
        ends = []
        for h in (LONGER, -LONGER):
            out = np.empty((1, 5))
            after = _run_loop(np.array([h]), np.zeros((1, 3)), r, v, place, *loop, np.zeros((1, 2)),
                           np.array([HEIGHT - ABOVE]), out)  # fmt: skip
            ends.append(np.r_[C @ np.array(after[3:]), C @ np.array(after[:3])])
        return (ends[0] - ends[1]) / (2 * LONGER)

    added = rates(_loops()) - rates((0.0, 0.0, 0.0))
    v, height = _by_aids()
    return float(np.abs(added - np.r_[v, 0, 0, height]).max() / abs(height))


def still_among_the_stars() -> float:
    """Return where a still base is in platform axes, and its velocity Omega x r, relative."""
    from gimbalcal.navigate.space_stable_navigator import InertialSite, _at_rest

    R_N, phase = nav.radii(LATITUDE)[1], 0.4
    across = (R_N + HEIGHT) * np.cos(LATITUDE)
    r = np.array([across * np.cos(phase), across * np.sin(phase), (R_N * (1 - nav.E2) + HEIGHT) * np.sin(LATITUDE)])
    v = np.cross([0, 0, nav.OMEGA], r)
    ours = _at_rest(InertialSite(LATITUDE, HEIGHT, G, 0.0), phase)
    return float(max(np.abs(ours[0] - r).max() / across, np.abs(ours[1] - v).max() / (across * nav.OMEGA)))


# --- alignment, errors, budget


def _ten_minutes_at_rest() -> tuple[Any, tuple[Any, ...]]:
    """Return C_b^n (3, 3) of a unit at rest, and its intervals [s], rates, forces, and site."""
    from gimbalcal.navigate.space_stable_navigator import InertialSite

    C, n = TURN @ attitude(), 60
    rate = C.T @ TURN @ nav.earth_in_n(np.float64(LATITUDE))
    readings = np.full(n, 10.0), np.tile(rate, (n, 1)), np.tile(C.T @ [0, 0, -G], (n, 1))
    return C, (*readings, InertialSite(LATITUDE, HEIGHT, G, 0.0))


def coarse_alignment() -> float:
    """Return the attitude from the integrals of force and gravity in axes that do not turn."""
    from gimbalcal.navigate.strapdown_unit import _in_carried_axes

    C, readings = _ten_minutes_at_rest()
    return float(np.abs(_in_carried_axes(*readings) - C).max())


def alignment() -> float:
    """Return the attitude at the end where the search starts 2e-3 rad off."""
    from gimbalcal.navigate import strapdown_unit
    from gimbalcal.navigate.space_stable_navigator import Aids

    C, (dt, rates, forces, site) = _ten_minutes_at_rest()
    integrals, off = strapdown_unit._in_carried_axes, rotation((0.0, 0.6, 0.8), 2e-3)
    strapdown_unit._in_carried_axes = lambda *_: off @ C
    try:
        found = strapdown_unit.aligned_attitude(dt, rates, forces, site, Aids())
    finally:
        strapdown_unit._in_carried_axes = integrals
    return float(np.abs(found - C).max())


def metres() -> float:
    """Return the distance of an error of latitude and longitude, relative."""
    from gimbalcal.navigate.space_stable_navigator import InertialSite
    from gimbalcal.navigate.static_run import horizontal_distance

    R_M, R_N = nav.radii(LATITUDE)
    derived = np.hypot(1e-5 * (R_M + HEIGHT), 2e-5 * (R_N + HEIGHT) * np.cos(LATITUDE))
    ours = horizontal_distance(np.array([[1e-5, -2e-5, 0, 0, 0, 0, 0]]), InertialSite(LATITUDE, HEIGHT, G, 0.0))[0]
    return float(abs(ours / derived - 1))


def parts_of_budget() -> float:
    """Return whole and parts of a position error from D, P: a part is what knowing a parameter exactly takes away.

    Conditioned on parameter i, P becomes P - P e e^T P / P_ii.
    """
    from gimbalcal.design.budget import _Parts
    from gimbalcal.effects import CATALOGUE, parameters
    from gimbalcal.inference.information import information

    wanted = parameters(CATALOGUE["bias"])
    J = np.array([[3.0, 1.0, 0.5], [0.2, 2.0, -1.0], [1.0, -0.5, 4.0]]) * 1e7
    P = np.linalg.inv(J.T @ J)
    D = np.array([[[1.0, -2.0, 0.5], [0.3, 0.7, -1.0]]]) * 1e6  # m per m/s^2
    known = [P - np.outer(P[:, i], P[i]) / P[i, i] for i in range(3)]
    whole = np.trace(D[0] @ P @ D[0].T)
    derived = np.sqrt([whole, *(whole - np.trace(D[0] @ K @ D[0].T) for K in known)])
    by_parameter = {p: D[..., i] for i, p in enumerate(wanted)}
    found = _Parts.of(information(J, np.zeros(3), wanted), by_parameter, np.zeros(1), [1.0])
    return float(np.abs(np.r_[found.whole, found.parts[0]] / derived - 1).max())


class _Drawn:
    """A generator whose draws have exactly the unit covariance: plus and minus each unit vector, times sqrt(n)."""

    def __init__(self, *_: Any) -> None:
        self.count = 0

    def standard_normal(self, n: int) -> Any:
        """Return the next."""
        k, self.count = self.count, self.count + 1
        return np.sqrt(n) * (1 if k % 2 else -1) * np.eye(n)[k // 2 % n]


def sampled_sigma() -> float:
    """Return sigma of a linear error J x by draws with exactly their covariance, over the root of diag(J P J^T)."""
    from gimbalcal.calibration import Calibration, Residual
    from gimbalcal.effects import CATALOGUE, parameters, values, with_values
    from gimbalcal.navigate import uncertainty
    from gimbalcal.navigate.space_stable_navigator import USUAL
    from gimbalcal.platform import BENCH

    wanted = parameters(CATALOGUE["bias"])
    half = np.array([[3.0, 0, 0], [1.0, 2.0, 0], [-1.0, 0.5, 1.5]]) * 1e-4
    P, J = half @ half.T, np.array([[1.0, -2.0, 0.5], [0.3, 0.7, -1.0], [0.2, 0.1, 2.0]])

    class Applied:
        """A recording that is what a calibration makes of it: its values."""

        platform = BENCH

    class Thin:
        rows: Any = Applied()

        def error(self, x: Any, _: Any) -> Any:
            """Return an object that holds the error."""
            return type("Error", (), {"error": J @ x})()

    class Linear(Calibration):
        """A calibration that corrects to its own values."""

        def apply(self, _: Any) -> Any:  # type: ignore[override]
            return values(self.effects, self.parameters)

    made = Linear("any", with_values((), wanted, np.zeros(3)), wanted, P, (), Residual(1.0, 1, {}))
    generator = np.random.default_rng
    np.random.default_rng = _Drawn  # type: ignore[assignment]
    try:
        found = uncertainty._sampled_sigma(Thin(), made, USUAL, 6, 1, lambda _: None)  # type: ignore[arg-type]
    finally:
        np.random.default_rng = generator
    return float(np.abs(found / np.sqrt(np.diag(J @ P @ J.T)) - 1).max())


# --- increments


def increments() -> float:
    """Return velocity and angle increments over their interval, relative to the means that they are sums of."""
    from pathlib import Path

    from gimbalcal.checks.dropouts import Dropouts
    from gimbalcal.recording.header import header_of
    from gimbalcal.recording.increments import Increments
    from gimbalcal.units import to_si

    columns: dict[str, dict[str, str]] = {"t": {"quantity": "time", "unit": "s"}}
    columns |= {f"v{a}": {"quantity": "velocity_increment", "axis": a, "unit": "m/s"} for a in "xyz"}
    columns |= {f"w{a}": {"quantity": "angle_increment", "axis": a, "unit": "arcsec"} for a in "xyz"}
    content = {"format": 1, "kind": "rotation", "title": "increments", "samples": "samples.csv", "columns": columns,
               "site": {"latitude": {"value": 40.0, "unit": "deg"}}}  # fmt: skip
    header = header_of(content, Path("recording.toml"))
    n, dt, names = 40, 0.25, [f"{q}{a}" for q in "vw" for a in "xyz"]
    true = np.sin(np.arange(n)[:, None] * 0.7 + np.arange(6)) * np.repeat([9.8, 0.1], 3)
    unit = np.repeat([1.0, np.pi / 648000], 3)
    batch = {"t": dt * np.arange(n)} | dict(zip(names, (true * dt / unit).T, strict=True))
    found = Increments(header, Dropouts(header))
    means = next(found.rates([batch]))
    units = {c.name: c.unit for c in found.header.columns}
    ours = np.stack([to_si(means[name], units[name]) for name in names], axis=-1)
    return float(np.abs((ours - true) / np.repeat([9.8, 0.1], 3)).max())
