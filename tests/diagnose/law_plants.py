"""Every cause that 18 positions can see, written again from its equation, with the sizes that should come back.

`laws(axis)` extends `plant.known`; `oddities(axis)` extends `plant.strange`. No line of the catalogue is used: where
the two disagree, the benchmark shows it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gimbalcal.number import Array
from gimbalcal.recording import Recording
from tests.diagnose.plant import (
    ARCSEC,
    DRIFTS,
    STEPS,
    UG,
    Bench,
    Error,
    G,
    came,
    cooled,
    inwards,
    known,
    on,
    record,
    strange,
    strength,
    turned,
)

END = 17 * 135 + 119.0  # s, last sample of one sweep
DIP = np.deg2rad(65.0)
GIMBALS = ("platform", "inner", "middle")
ODD = ("cubic_nonlinearity", "odd_quadratic", "soft_saturation")
PROBE = 3 * UG

Truth = dict[tuple[str, str], float]


@dataclass(frozen=True)
class Law:
    """An effect, the ids that say the same (its own first), the axis, and printed values per unit of size."""

    error: Error
    ids: tuple[str, ...]
    axis: str = ""
    truth: tuple[tuple[tuple[str, str], float], ...] = ()
    bent: bool = False  # whether it is not in proportion to its size


def laws(axis: int) -> dict[str, Law]:
    """All effects on one accelerometer, gimbal or direction."""
    return _first(axis) | _memory(axis) | _thermal(axis) | _gimbals(axis)


def _law(error: Error, ids: str | tuple[str, ...], axis: str, truth: Truth | None = None, bent: bool = False) -> Law:
    return Law(error, (ids,) if isinstance(ids, str) else ids, axis, tuple((truth or {}).items()), bent)


def _first(axis: int) -> dict[str, Law]:
    """Those of `known`, with their values; and the rest of the input-output law."""
    made, x, j, k = known(axis), "xyz"[axis], "xyz"[(axis + 1) % 3], (axis + 2) % 3
    ug, ppm, hours = 1 / UG, 1e6 / G, END / 3600
    S, C = np.sin(axis), np.cos(axis)
    about: dict[str, tuple[str, tuple[str, ...], Truth]] = {
        "cubic": (x, ODD, {("K3", x): ug}),
        "asymmetry": (x, ("scale_factor_asymmetry",), {("asymmetry", x): ppm}),
        "cross": (x, ("cross_coupling",), {("K_c", x + j): ug}),
        "bias T": (x, ("bias_temperature",), {("b_T", x): ug}),
        "scale T": (x, ("scale_temperature",), {("s_T", x): ppm}),
        "lagged T": (x, ("bias_temperature_lagged",), {("b_L", x): ug}),
        "warm-up": (x, ("warm_up",), {("warm_up", x): ug}),
        "drift": (x, ("bias_drift",), {("bias_drift", x): ug / hours}),
        "step": (x, ("bias_step",), {("bias_step", x): ug}),
        "eccentricity": ("inner", ("encoder_eccentricity", "gimbal_flexure"), _sines("eccentricity", "inner", C, S)),
        "two-cycle": ("platform", ("encoder_two_cycle",), _sines("two_cycle", "platform", C, S)),
        "friction": ("inner", ("gimbal_friction",), {("friction", "inner"): 1 / ARCSEC}),
        "tilt drift": ("", ("base_tilt_drift", *sorted(DRIFTS - {"base_tilt_drift"})), {
            ("tilt_rate", "north"): 1e6 / hours, ("tilt_rate", "east"): 0.5e6 / hours}),
        "blunder": ("", ("position_blunder",), {}),
    }  # fmt: skip
    f = _force(axis)
    j_, other = (axis + 1) % 3, _force((axis + 1) % 3)
    return {name: _law(made[name][0], ids, a, truth) for name, (a, ids, truth) in about.items()} | {
        "odd": _law(lambda b: on(axis, f(b) * np.abs(f(b))), ("odd_quadratic", *ODD), x, {("K_oq", x): ug}),
        "saturation": _law(lambda b: on(axis, -np.sign(f(b)) * np.maximum(np.abs(f(b)) - 0.8, 0) ** 2 * 25),
                           ("soft_saturation", *ODD), x),
        "dead zone": _law(lambda _: {"dead": np.eye(3)[axis]}, "dead_zone", x, {("dead_zone", x): ug}, bent=True),
        "product": _law(lambda b: on(axis, b.ideal[:, j_] * b.ideal[:, k]), ("cross_axis_product", "block_sag"), x,
                        {("K_po", x): ug}),
        "square": _law(lambda b: on(axis, other(b) ** 2), "cross_axis_product", x, {("K_pp", x): ug}),
    }  # fmt: skip


def _sines(name: str, gimbal: str, S: float, C: float) -> Truth:
    return {(f"{name}_sin", gimbal): S / ARCSEC, (f"{name}_cos", gimbal): C / ARCSEC}


def _force(axis: int) -> Callable[[Bench], Array]:
    return lambda b: b.ideal[:, axis]


def held_before(b: Bench, axis: int, moves: int) -> Array:
    """Force (n,) in g that was held so many moves ago, that of the first position before the first."""
    starts = np.flatnonzero(np.diff(b.visit, prepend=-1))
    return np.asarray(b.ideal[starts, axis][np.maximum(b.visit - moves, 0)])


def _memory(axis: int) -> dict[str, Law]:
    """What depends on the way by which a position was reached."""
    f, x, ug = _force(axis), "xyz"[axis], 1 / UG

    def change(b: Bench) -> Array:
        d = f(b) - held_before(b, axis, 1)
        return np.where(np.abs(d) > 1e-6, d, 0.0)

    def heat(b: Bench) -> Array:
        t = np.arange(b.t[0], b.t[-1] + 1)
        return np.interp(b.t, t, lagged(np.interp(t, b.t, f(b) ** 2), 1.0, 900.0))

    return {
        "hysteresis": _law(lambda b: on(axis, np.sign(change(b))), "accelerometer_hysteresis", x,
                           {("hysteresis", x): ug}),
        "creep": _law(lambda b: on(axis, change(b) * np.exp(-b.since / 200.0)), "post_move_creep", x,
                      {("creep", x): ug}),
        "memory": _law(lambda b: on(axis, held_before(b, axis, 2)), "two_move_memory", x,
                       {("two_move_memory", x): ug}),
        "self-heating": _law(lambda b: on(axis, heat(b)), "self_heating", x, {("self_heating", x): ug}),
    }  # fmt: skip


def lagged(x: Array, step: float, tau: float) -> Array:
    """First-order lag (n,) of evenly sampled x, at rest before."""
    from scipy.signal import lfilter

    a = np.exp(-step / tau)
    return np.asarray(lfilter([1 - a], [1, -a], x, zi=[a * x[0]])[0])


def _thermal(axis: int) -> dict[str, Law]:
    """What follows the temperature, and a logged channel."""
    x, k, ug = "xyz"[axis], "xyz"[(axis + 2) % 3], 1 / UG
    other = _force((axis + 1) % 3)

    def fan(b: Bench) -> dict[str, Any]:
        speed = np.random.default_rng(int(1e6 * b.T[0])).standard_normal(18)[b.visit % 18]
        speed = lagged(speed, 1.0, 60.0)
        return {**on(axis, speed), "fan": speed}

    return {
        "lean T": _law(lambda b: on(axis, other(b) * (b.T - 20)), "misalignment_temperature", x,
                       {("mu_T", x + k): 1e6 / G}),
        "rate T": _law(lambda b: on(axis, np.gradient(b.body, b.t) * 3600), "bias_temperature_rate", x,
                       {("bias_per_rate", x): ug}),
        "T squared": _law(lambda b: on(axis, (b.T - 20) ** 2), "bias_temperature_squared", x, {("b_T2", x): ug}),
        "fan": _law(fan, ("bias_covariate",), x, {("bias_per_covariate", x): ug}),
    }  # fmt: skip


def _gimbals(axis: int) -> dict[str, Law]:
    """Gimbals, bearings, and the field of the Earth."""
    pair = axis % 2
    gimbal = GIMBALS[axis]
    S, C = np.sin(axis + 0.5), np.cos(axis + 0.5)
    x = "xyz"[axis]
    return {
        "skew": _law(lambda b: _leaning(b, pair, np.eye(3)[2 if pair else 1]), "gimbal_nonorthogonality", GIMBALS[pair],
                     {("nonorthogonality", GIMBALS[pair]): 1 / ARCSEC}),
        "eccentricity 2": _law(lambda b: turned(2, np.sin(b.read[:, 2] + axis)),
                               ("encoder_eccentricity", "gimbal_flexure"), "middle",
                               _sines("eccentricity", "middle", np.cos(axis), np.sin(axis))),
        "two-cycle 2": _law(lambda b: turned(1 + pair, np.sin(2 * b.read[:, 1 + pair] + axis)), "encoder_two_cycle",
                            GIMBALS[1 + pair], _sines("two_cycle", GIMBALS[1 + pair], np.cos(axis), np.sin(axis))),
        "friction 2": _law(lambda b: turned(2 * pair, came(b, 2 * pair)), "gimbal_friction", GIMBALS[2 * pair],
                           {("friction", GIMBALS[2 * pair]): 1 / ARCSEC}),
        "wobble": _law(lambda b: _leaning(b, axis, _wobble(b, axis, S, C)), "bearing_wobble", gimbal,
                       {("wobble_cos", gimbal): C / ARCSEC, ("wobble_sin", gimbal): S / ARCSEC}),
        "sag": _law(lambda b: turned(1, np.cos(b.read[:, 2]) * np.sin(b.read[:, 1] + axis)),
                    ("gimbal_flexure", "encoder_eccentricity"), "inner"),
        "magnet": _law(lambda b: on(axis, inwards(_field(b), b.read) @ [0.6, -0.5, 0.6]), "magnetic_field", x),
    }  # fmt: skip


def _leaning(b: Bench, gimbal: int, lean: Array) -> dict[str, Array]:
    out = np.zeros((len(b.t), 3, 3))
    out[:, gimbal] = lean
    return {"lean": out}


def _wobble(b: Bench, gimbal: int, S: float, C: float) -> Array:
    """The axis (n, 3) twice round while its gimbal turns once, in the bearing's housing."""
    around = [(0, 1), (1, 2), (2, 0)][gimbal]  # across z, x, y in turn
    turn = 2 * b.read[:, gimbal]
    out = np.zeros((len(b.t), 3))
    out[:, around[0]] = C * np.cos(turn) - S * np.sin(turn)
    out[:, around[1]] = C * np.sin(turn) + S * np.cos(turn)
    return out


def _field(b: Bench) -> Array:
    """Direction of the magnetic field in level axes: dip 65 deg, declination 0.3 rad."""
    return np.tile([np.cos(DIP) * np.cos(0.3), np.cos(DIP) * np.sin(0.3), np.sin(DIP)], (len(b.t), 1))


def oddities(axis: int) -> dict[str, Error]:
    """Effects that no catalogue holds: those the diagnosis was built with in view, and those it never saw."""
    second = STEPS[:, (axis + 1) % 3]
    seen: dict[str, Error] = {
        "third harmonic": lambda b: turned(1, np.sin(3 * b.read[:, 1] + axis + 0.4)),
        "alternating": lambda b: on(axis, np.where(b.visit % 2, 1.0, -1.0)),
        "angle times T": lambda b: on(axis, np.sin(second[b.visit % 18] + 0.5) * (cooled(b, 600.0) - 20)),
    }
    return strange(axis) | seen | unforeseen(axis)


def unforeseen(axis: int) -> dict[str, Error]:
    """Oddities that are no single product or power of what is recorded: the honest half of the test."""
    f = _force(axis)
    return {
        "thermal onset": lambda b: on(axis, np.expm1(np.maximum(b.body - np.quantile(b.body, 0.6), 0) / 0.4)),
        "thermostat": lambda b: on(axis, np.where(b.body > np.median(b.body), 1.0, -1.0) * f(b)),
        "thermal loop": lambda b: on(axis, np.tanh(2 * (b.body - _slack(b.body, 1.0)))),
        "sawtooth": lambda b: on(axis, (b.t / 780.0 + 0.3 * axis) % 1.0),
        "sticking": lambda b: turned(1, _stuck(b, 1) * (np.cos(b.read[:, 1]) < -0.1)),
        "settling": lambda b: on(axis, f(b) * np.exp(-b.since / (10 + 200 * f(b) ** 2))),
        "half turns": lambda b: turned(axis % 2, np.sign(np.cos(b.read[:, axis % 2] + axis // 2) + 0.3)),
        "jumps": lambda b: on(axis, np.random.default_rng(21 + axis).standard_normal(18)[b.visit // 2]),
        "pier": lambda b: {"tilt": _pier(b, axis)},
        "two stops": lambda b: on(axis, np.sign(b.ideal[:, (axis + 1) % 3] + 0.2) * b.ideal[:, (axis + 2) % 3]),
    }


def _slack(x: Array, width: float) -> Array:
    """What a load with so much play follows of x (n,): it moves only when it is pushed."""
    y = np.empty_like(x)
    y[0] = x[0]
    for k in range(1, len(x)):
        y[k] = np.clip(y[k - 1], x[k] - width / 2, x[k] + width / 2)
    return y


def _stuck(b: Bench, gimbal: int) -> Array:
    """Direction (n,) of the last turn of a gimbal, zero before the first."""
    moves = came(b, gimbal)
    last = np.maximum.accumulate(np.where(moves != 0, np.arange(len(moves)), 0))
    return np.asarray(moves[last])


def _pier(b: Bench, axis: int) -> Array:
    """Tilt (n, 2) of a pier that gives way to one side only, by the direction of a load on the turning platform."""
    load = b.read[:, 0] + 2 * b.read[:, 1] + axis
    return np.column_stack([np.maximum(np.cos(load), 0), np.maximum(np.sin(load), 0)])


def at_size(seed: int, law: Law, sigmas: float, **options: Any) -> tuple[Recording, float]:
    """A recording in which the effect stands `sigmas` above noise, and its size [m/s^2 or rad]."""

    def of(size: float) -> Recording:
        return record(np.random.default_rng(seed), law.error, size, **options)

    size = PROBE * sigmas / strength(of, PROBE)
    for _ in range(4 if law.bent else 0):
        size *= sigmas / strength(of, size)
    return of(size), size
