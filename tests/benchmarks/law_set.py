"""The laws of `bench_laws`, written from what engineers report of such rigs and not from what the package can print."""

import numpy as np

from gimbalcal.number import Array
from tests.benchmarks.law_plants import ALIEN, NONE, RIGS, Hidden, parallactic
from tests.diagnose.plant import Bench, came

TURN = 2 * np.pi
STEADY = (("steady", True),)
WARMING = (("warming", True),)
SUPPLY = (("supply", True),)
DOME = (("dome", True),)


def square(x: Array) -> Array:
    """A square wave of period one."""
    return np.where(np.mod(x, 1.0) < 0.5, 1.0, -1.0)


def step(x: Array, at: float, width: float) -> Array:
    """From -1 to 1 within a few widths."""
    return np.asarray(np.tanh((x - at) / width))


def bump(x: Array, at: float, width: float) -> Array:
    """A bell of height one."""
    return np.asarray(np.exp(-(((x - at) / width) ** 2)))


def decays(x: Array, at: float, tau: float) -> Array:
    """An event: nothing before, then what dies away."""
    return np.where(x > at, np.exp(-np.maximum(x - at, 0.0) / tau), 0.0)


def power(x: Array, exponent: float) -> Array:
    """A power of the size with the sign."""
    return np.asarray(np.sign(x) * np.abs(x) ** exponent)


def before(b: Bench, x: Array) -> Array:
    """What x (n,) was in the position before."""
    first = x[np.searchsorted(b.visit, np.arange(b.visit[-1] + 1))]
    return np.asarray(np.concatenate([first[:1], first[:-1]])[b.visit])


def heated(x: Array, t: Array, tau: float) -> Array:
    """What x (n,) has left behind after a first-order lag."""
    y, a = np.zeros(len(x)), np.exp(-np.diff(t, prepend=t[0]) / tau)
    for k in range(1, len(x)):
        y[k] = a[k] * y[k - 1] + (1 - a[k]) * x[k]
    return y


def noisy(sigma: float) -> tuple[tuple[str, float], ...]:
    """The option of a thermometer whose readings scatter."""
    return (("noisy", sigma),)


LAWS: dict[str, Hidden] = {
    # 18 positions
    "tanh T": Hidden("positions", "y", lambda b: np.tanh((b.body - 23.2) / 0.6), "temperature"),
    "(T - 25)^3": Hidden("positions", "z", lambda b: (b.body - 25.0) ** 3, "temperature"),
    "T sin 2P": Hidden("positions", "x", lambda b: (b.body - 12.0) * np.sin(2 * b.read[:, 0]), "temperature platform"),
    "log t": Hidden("positions", "z", lambda b: np.log1p(b.t / 60.0), "time"),
    "ringing": Hidden("positions", "x", lambda b: np.exp(-b.t / 700.0) * np.cos(TURN * b.t / 420.0), "time"),
    "bump in t": Hidden("positions", "y", lambda b: np.exp(-(((b.t - 1300.0) / 170.0) ** 2)), "time"),
    "ramp in T": Hidden("positions", "x", lambda b: np.maximum(b.body - 23.6, 0.0), "temperature"),
    "wave in T": Hidden("positions", "z", lambda b: np.sin(TURN * b.body / 1.7), "temperature"),
    "direction of approach times force": Hidden(
        "positions", "y", lambda b: came(b, 1) * b.ideal[:, 0], "approach_inner force_x"
    ),
    # 48 h at rest
    "wave in T, static": Hidden("static", "x", lambda r: np.sin(TURN * r.T / 2.9), "temperature"),
    "force times log t": Hidden("static", "y", lambda r: r.ideal[:, 0] * np.log1p(r.t / 7200.0), "force_x time"),
    "duty cycle": Hidden("static", "z", lambda r: 1.0 * (np.mod(r.t / 25200.0, 1.0) < 0.3), "time"),
    "sawtooth": Hidden("static", "x", lambda r: np.mod(r.t / 31000.0 + 0.2, 1.0), "time"),
    # by hand
    "knee in f": Hidden("hand", "x", lambda h: np.maximum(h.f[:, 0] - 0.35, 0.0), "force_x"),
    "|f|^2.5": Hidden("hand", "y", lambda h: np.abs(h.f[:, 1]) ** 2.5 * np.sign(h.f[:, 1]), "force_y"),
    "supply squared": Hidden("hand", "z", lambda h: (h.supply - 5.03) ** 2, "supply_voltage",
                             options=(("supply", True),)),
    "square wave in t": Hidden("hand", "y", lambda h: square(h.t / h.t[-1] * 5.3), "time"),
    # rotations by hand, and the turns between
    "product of rates": Hidden("rotation", "gyro z", lambda m: m.w[:, 0] * m.w[:, 1], "rate_x rate_y"),
    "rate times force": Hidden("rotation", "gyro x", lambda m: m.w[:, 0] * m.f[:, 1], "force_y rate_x"),
    # stars
    "sin 2az cos el": Hidden("mount", "azimuth", lambda k: np.sin(2 * k.outer) * np.cos(k.inner), "azimuth elevation"),
    "|sin az|": Hidden("mount", "elevation", lambda k: np.abs(np.sin(k.outer - 0.4)), "azimuth"),
    "t cos 3az": Hidden("mount", "azimuth", lambda k: k.t / k.t[-1] * np.cos(3 * k.outer), "azimuth time"),
    "step in az": Hidden("mount", "up", lambda k: np.tanh((k.outer - 0.7) / 0.15), "azimuth"),
    # rate table
    "dead band of a rate": Hidden("rate table", "z", lambda m: np.tanh(m.w[:, 2] / np.radians(30.0)), "rate_z"),
    "rate times T squared": Hidden("rate table", "z", lambda m: m.w[:, 2] * (m.T - 24.0) ** 2, "rate_z temperature"),
    # --- 18 positions, again
    "hinge creeps after the force before": Hidden(  # viscoelastic recovery of a flexure
        "positions", "y", lambda b: before(b, b.ideal[:, 1]) * np.exp(-b.since / 45.0), "before_force_y since_move"),
    "cable springs back": Hidden(  # the harness of the platform drags by the angle it was moved
        "positions", "x", lambda b: (b.read[:, 0] - before(b, b.read[:, 0])) * np.exp(-b.since / 30.0),
        "platform_change since_move"),
    "expansion to the power 1.6": Hidden(  # of a polymer bond above its glass transition
        "positions", "z", lambda b: np.maximum(b.body - 22.0, 0.0) ** 1.6, "temperature"),
    "magnet loses field past a knee": Hidden(  # flux of the torquer's magnet is flat, then falls
        "positions", "x", lambda b: b.ideal[:, 0] * np.maximum(b.body - 23.0, 0.0), "force_x temperature"),
    "converter switches at 23.4 degC": Hidden(  # a thermostat of the electronics, thermometer of 0.1 degC
        "positions", "y", lambda b: step(b.body, 23.4, 0.15), "temperature", options=noisy(0.1)),
    "resonance of the pick-off": Hidden(  # passes the carrier at one temperature, thermometer of 0.1 degC
        "positions", "z", lambda b: bump(b.body, 23.3, 0.6), "temperature", options=noisy(0.1)),
    "relay of the supply": Hidden(  # drops out after 25 minutes, electrical, and comes back
        "positions", "z", lambda b: 1.0 * ((b.t > 1500.0) & (b.t < 1860.0)), "time"),
    "eleven poles of a resolver": Hidden(  # on a grid of 45 deg eleven cycles are three
        "positions", "inner", lambda b: np.sin(11 * b.read[:, 1] + 0.5), "inner", False),
    "thirteen lobes of a bearing": Hidden(  # on a grid of 45 deg thirteen cycles are five
        "positions", "middle", lambda b: np.sin(5 * b.read[:, 1] + 13 * b.read[:, 0]), "inner platform", False),
    # --- 48 h at rest, again
    "bimetal snaps": Hidden("static", "x", lambda r: step(r.T, 22.9, 0.35), "temperature"),
    "oil stiffens": Hidden(  # viscosity of the damping fluid, Arrhenius
        "static", "y", lambda r: r.ideal[:, 1] * np.exp(-0.9 * (r.T - 22.0)), "force_y temperature"),
    "fan behind a rectifier": Hidden(  # half waves of a compressor of 4.3 h
        "static", "z", lambda r: np.maximum(np.sin(TURN * r.t / 15500.0 + 1.0), 0.0), "time"),
    "working hours": Hidden(  # power line loaded from 8 to 17
        "static", "x", lambda r: 1.0 * (np.abs(np.mod(r.t / 3600.0, 24.0) - 12.5) < 4.5), "time|time_of_day"),
    "compressor slows down": Hidden(  # cycles that grow longer as the logarithm of time
        "static", "y", lambda r: np.sin(14.0 * np.log1p(r.t / 30000.0)), "time"),
    "train of an earthquake": Hidden(  # tilt of the pier at hour 31 that settles with 2.5 h
        "static", "z", lambda r: decays(r.t, 111600.0, 9000.0) * np.cos(TURN * (r.t - 111600.0) / 16000.0), "time"),
    "interference in the fibre": Hidden(  # fringes of 1.9 degC, thermometer of 0.15 degC
        "static", "x", lambda r: np.sin(TURN * r.T / 1.9 + 0.7), "temperature", options=noisy(0.15)),
    "battery tails off": Hidden(  # discharge curve of a lithium cell, a power of time
        "static", "y", lambda r: (r.t / 86400.0) ** 2.7, "time"),
    "scale factor above a knee": Hidden(  # adhesive softens above 22.6 degC, thermometer of 0.15 degC
        "static", "y", lambda r: r.ideal[:, 0] * np.maximum(r.T - 22.6, 0.0), "force_x temperature",
        options=noisy(0.15)),
    "cogging of the torquer": Hidden(  # the platform's angle is the Earth's turn, and that is time
        "static", "x", lambda r: np.sin(5 * np.arctan2(r.ideal[:, 1], r.ideal[:, 0]) + 0.6), "platform", False),
    "half-day wave of the Sun": Hidden(  # 12 h of solar and of sidereal time are one in two days
        "static", "z", lambda r: np.sin(TURN * r.t / 43200.0), "time", False),
    # --- by hand, again
    "play of a proof mass": Hidden(  # moves only beyond the friction of its stops
        "hand", "z", lambda h: np.sign(h.f[:, 2]) * np.maximum(np.abs(h.f[:, 2]) - 0.3, 0.0), "force_z"),
    "stiction of a comb": Hidden("hand", "x", lambda h: power(h.f[:, 0], 0.4), "force_x"),
    "elastomer under three forces": Hidden("hand", "y", lambda h: h.f[:, 0] * h.f[:, 1] * h.f[:, 2],
                                           "force_x force_y force_z"),
    "spring softens by T squared": Hidden("hand", "x", lambda h: h.f[:, 0] * (h.felt - 25.0) ** 2,
                                          "force_x temperature"),
    "reference beats with the supply": Hidden(  # switching frequency follows the voltage
        "hand", "z", lambda h: np.sin(TURN * h.supply / 0.27), "supply_voltage", options=SUPPLY),
    "brown-out": Hidden("hand", "y", lambda h: np.maximum(5.05 - h.supply, 0.0), "supply_voltage", options=SUPPLY),
    "rotor unbalance squared": Hidden(  # drift by acceleration in two directions, anisoelastic
        "hand", "gyro y", lambda h: h.f[:, 0] * h.f[:, 2], "force_x force_z"),
    "mode crossing of a ring": Hidden(  # two modes meet at 25.5 degC, thermometer of 0.3 degC
        "hand", "gyro z", lambda h: bump(h.felt, 25.5, 1.0), "temperature", options=noisy(0.3)),
    "bond line gives way": Hidden(  # thermal, a step that is wide, thermometer of 0.3 degC
        "hand", "x", lambda h: h.f[:, 0] * step(h.felt, 25.0, 0.8), "force_x temperature", options=noisy(0.3)),
    "knocked on the bench": Hidden(  # after eleven minutes, recovers in three
        "hand", "gyro x", lambda h: decays(h.t, 660.0, 180.0), "time"),
    "switch in a steady warming": Hidden(  # a step in T is one in time
        "hand", "gyro y", lambda h: step(h.felt, 27.5, 0.3), "temperature", False, STEADY),
    "scale factor in a steady warming": Hidden(
        "hand", "z", lambda h: h.f[:, 2] * step(h.felt, 26.5, 0.5), "force_z temperature", False, STEADY),
    # --- rotations by hand, again
    "windage": Hidden("rotation", "gyro x", lambda m: power(m.w[:, 1], 1.5), "rate_y"),
    "amplifier saturates": Hidden("rotation", "gyro z", lambda m: np.tanh(m.w[:, 2] / 0.6), "rate_z"),
    "lock-in": Hidden(  # of a ring laser, where it turns slowly
        "rotation", "gyro y", lambda m: m.w[:, 1] * bump(m.w[:, 1], 0.0, 0.25), "rate_y"),
    "drive amplitude by T": Hidden("rotation", "gyro x", lambda m: m.w[:, 0] * np.sin(TURN * m.T / 5.0),
                                   "rate_x temperature"),
    "quadrature by T squared": Hidden("rotation", "gyro y", lambda m: m.w[:, 2] * (m.T - 22.0) ** 2,
                                      "rate_z temperature"),
    "scale factor settles": Hidden("rotation", "gyro z", lambda m: m.w[:, 2] * np.exp(-m.t / 45.0), "rate_z time"),
    "vibration rectified": Hidden(  # the motor's ripple shakes the pendulum
        "rotation", "x", lambda m: np.abs(m.w[:, 1]) * m.f[:, 0], "force_x rate_y"),
    "unbalance past a stop": Hidden(  # of a gimbal that rests on one side
        "rotation", "gyro y", lambda m: np.maximum(m.f[:, 0] - 0.3, 0.0), "force_x"),
    "jewel bearing": Hidden(  # friction grows with the load as Hertz has it
        "rotation", "gyro z", lambda m: power(m.f[:, 1], 1.5), "force_y"),
    "laser changes its mode": Hidden(  # thermometer of 0.2 degC
        "rotation", "gyro x", lambda m: step(m.T, 23.5, 0.4), "temperature", options=noisy(0.2)),
    "etalon of a depolariser": Hidden(  # fringes of 3.1 degC, thermometer of 0.2 degC
        "rotation", "gyro z", lambda m: np.sin(TURN * m.T / 3.1), "temperature", options=noisy(0.2)),
    "switch while it warms up": Hidden(  # a step in T is one in time
        "rotation", "gyro y", lambda m: step(m.T, 23.0, 0.3), "temperature", False, WARMING),
    # --- stars, again
    "field rotator": Hidden("mount", "elevation", lambda k: np.sin(2 * parallactic(k)),
                            "azimuth elevation|parallactic_angle"),
    "strange refraction": Hidden(  # beyond the model at low stars, by air mass
        "mount", "up", lambda k: np.sin(k.inner) ** -3.0, "elevation|air_mass"),
    "slack of the azimuth drive": Hidden(
        "mount", "azimuth", lambda k: np.sign(k.moved[:, 0]) * np.sin(k.inner), "approach_azimuth elevation"),
    "wind-up by the last slew": Hidden("mount", "azimuth", lambda k: np.tanh(k.moved[:, 0] / 0.8), "azimuth_change"),
    "cable wrap": Hidden("mount", "azimuth", lambda k: np.maximum(np.abs(k.outer) - 1.9, 0.0), "azimuth"),
    "pinion": Hidden(  # a tooth of 45 deg that climbs and falls
        "mount", "azimuth", lambda k: np.mod(4 * k.outer / np.pi, 1.0), "azimuth"),
    "counterweight touches": Hidden("mount", "elevation", lambda k: np.maximum(k.inner - 0.9, 0.0), "elevation"),
    "lee of the dome": Hidden("mount", "up", lambda k: np.maximum(np.sin(k.outer - 1.0), 0.0), "azimuth"),
    "mirror cell cools": Hidden("mount", "elevation", lambda k: (k.T - 12.0) * np.cos(k.inner),
                                "elevation temperature", options=DOME),
    "pads of the mirror stick": Hidden(  # thermometer of 0.3 degC
        "mount", "elevation", lambda k: step(k.T, 11.5, 0.6), "temperature", options=DOME + noisy(0.3)),
    "air handling": Hidden("mount", "up", lambda k: square(k.t / 2900.0 + 0.1), "time"),
    "rail joint, sky by sectors": Hidden(  # azimuth only grows with time
        "mount", "elevation", lambda k: step(k.outer, 0.4, 0.5), "azimuth", False, (("clustered", True),)),
    "dusk, sky by sectors": Hidden(  # the same the other way about
        "mount", "azimuth", lambda k: bump(k.t, 5200.0, 2200.0), "time", False, (("clustered", True),)),
    # --- rate table, again
    "poles of the motor": Hidden("rate table", "z", lambda m: np.sin(8 * m.table + 0.4), "table"),
    "field of the table": Hidden("rate table", "x", lambda m: np.cos(m.table), "table"),
    "torquer to the power 1.4": Hidden("rate table", "z", lambda m: power(m.w[:, 2], 1.4), "rate_z"),
    "clipping beyond 60 deg/s": Hidden(
        "rate table", "z", lambda m: np.sign(m.w[:, 2]) * np.maximum(np.abs(m.w[:, 2]) - 1.05, 0.0), "rate_z"),
    "cross axis is rectified": Hidden("rate table", "x", lambda m: np.abs(m.w[:, 2]) ** 1.5, "rate_z"),
    "scale factor above 24 degC": Hidden("rate table", "z", lambda m: m.w[:, 2] * np.maximum(m.T - 24.0, 0.0),
                                         "rate_z temperature"),
    "warms itself by turning": Hidden(  # friction of the slip rings, 15 s
        "rate table", "y", lambda m: heated(m.w[:, 2] ** 2, m.t, 15.0), "rate_z|rate_z time"),
    "chopper of the current source": Hidden("rate table", "y", lambda m: square(m.t / 23.0 + 0.3), "time"),
    "loosened screw": Hidden("rate table", "x", lambda m: decays(m.t, 150.0, 40.0), "time"),
    "Faraday rotation in a fringe": Hidden(  # thermometer of 0.2 degC
        "rate table", "x", lambda m: np.sin(TURN * m.T / 2.6), "temperature", options=noisy(0.2)),
    "heater jumps": Hidden(  # thermometer of 0.2 degC
        "rate table", "y", lambda m: step(m.T, 24.2, 0.3), "temperature", options=noisy(0.2)),
    "switch of a table that warms": Hidden(  # a step in T is one in time
        "rate table", "y", lambda m: step(m.T, 23.5, 0.3), "temperature", False, WARMING),
}  # fmt: skip

# written when the search was finished, and run once
FRESH: dict[str, Hidden] = {
    "force dies away in a dwell": Hidden("positions", "x", lambda b: np.exp(-b.since / 35.0) * b.ideal[:, 2],
                                         "force_z since_move"),
    "warming rate squared": Hidden("positions", "y", lambda b: np.gradient(b.body, b.t) ** 2, "temperature_rate"),
    "two forces and T": Hidden("positions", "z", lambda b: b.ideal[:, 0] * b.ideal[:, 1] * (b.body - 24.0),
                               "force_x force_y temperature"),
    # the innermost gimbal turns the triad as a whole, so that misalignments that follow T are the same rows
    "platform turns with T": Hidden("positions", "platform", lambda b: b.body - 22.0, "temperature"),
    "beat of force": Hidden("static", "x", lambda r: r.ideal[:, 1] * np.sin(TURN * r.t / 33500.0), "force_y time"),
    "(T - 22.5)^2 above": Hidden("static", "z", lambda r: np.maximum(r.T - 22.5, 0.0) ** 2, "temperature"),
    "chirp": Hidden("static", "y", lambda r: np.sin(TURN * (r.t / 62000.0) ** 2), "time"),
    "exponential of force": Hidden("hand", "x", lambda h: np.exp(1.5 * h.f[:, 2]), "force_z"),
    "supply times force": Hidden("hand", "y", lambda h: (h.supply - 5.1) * h.f[:, 1], "force_y supply_voltage",
                                 options=(("supply", True),)),
    "sin az cos 3el": Hidden("mount", "elevation", lambda k: np.sin(k.outer) * np.cos(3 * k.inner),
                             "azimuth elevation"),
    "an hour of sun": Hidden("mount", "azimuth", lambda k: np.exp(-(((k.t - 4200.0) / 1100.0) ** 2)), "time"),
    "rate times its size": Hidden("rotation", "gyro x", lambda m: m.w[:, 2] * np.abs(m.w[:, 2]), "rate_z"),
}  # fmt: skip

# a last set, from what the literature reports of such rigs, run once when all else was finished
LAST: dict[str, Hidden] = {
    "thermal hysteresis": Hidden("positions", "x", lambda b: np.sign(np.gradient(b.body, b.t)), "temperature_rate"),
    "leakage current": Hidden("positions", "z", lambda b: np.exp(0.35 * (b.body - 23.0)), "temperature"),
    "third-order cross term": Hidden("positions", "y", lambda b: b.ideal[:, 0] ** 2 * b.ideal[:, 1],
                                     "force_x force_y"),
    "scale factor after power-on": Hidden("positions", "z", lambda b: b.ideal[:, 2] * np.exp(-b.t / 500.0),
                                          "force_z time"),
    "all sensors follow a wave of the temperature": Hidden(
        "positions", "x y z", lambda b: np.sin(TURN * b.body / 1.9), "temperature"
    ),
    "tide": Hidden("static", "z", lambda r: np.sin(TURN * r.t / 44712.0), "time"),
    "heater cycle": Hidden("static", "x", lambda r: np.exp(-3 * np.mod(r.t / 21600.0, 1.0)), "time"),
    "cubic temperature of a scale factor": Hidden("static", "y", lambda r: r.ideal[:, 0] * (r.T - 22.0) ** 3,
                                                  "force_x temperature"),
    "ageing": Hidden("static", "y", lambda r: np.sqrt(r.t), "time"),
    "shock that dies away": Hidden("static", "z", lambda r: np.exp(-(r.t - 9e4) / 2e4) * (r.t > 9e4), "time"),
    "arm of a pendulum": Hidden("hand", "y", lambda h: np.sqrt(np.maximum(1 - h.f[:, 1] ** 2, 0.0)), "force_y"),
    "preamplifier": Hidden("hand", "x", lambda h: np.tanh(2 * h.f[:, 0]), "force_x"),
    "cubic supply": Hidden("hand", "z", lambda h: (h.supply - 5.0) ** 3, "supply_voltage",
                           options=(("supply", True),)),
    "sag of a fork": Hidden("mount", "elevation", lambda k: np.cos(k.inner) ** 3, "elevation"),
    "coude mirror": Hidden("mount", "azimuth", lambda k: np.sin(k.outer - k.inner), "azimuth elevation"),
    "azimuth rail": Hidden("mount", "up", lambda k: np.sin(6 * k.outer) + 0.5 * np.cos(12 * k.outer), "azimuth"),
    "sinking pier": Hidden("mount", "elevation", lambda k: k.t / k.t[-1] * np.sin(k.outer), "azimuth time"),
    "scale factor of a gyroscope in force": Hidden("rotation", "gyro z", lambda m: m.w[:, 2] * m.f[:, 2],
                                                   "force_z rate_z"),
    "cube of a rate": Hidden("rotation", "gyro y", lambda m: m.w[:, 1] ** 3, "rate_y"),
    "ripple of a scale factor": Hidden("rate table", "z", lambda m: m.w[:, 2] * np.sin(TURN * m.T / 3.0),
                                       "rate_z temperature"),
}  # fmt: skip

# a second last set; nobody runs it before all else is finished
LAST_2: dict[str, Hidden] = {
    "glue remembers the attitude": Hidden(
        "positions", "z", lambda b: before(b, b.ideal[:, 2]) * np.exp(-b.since / 80.0), "before_force_z since_move"),
    "eutectic": Hidden("positions", "y", lambda b: np.maximum(23.2 - b.body, 0.0) ** 0.7, "temperature"),
    "slip ring by T": Hidden("positions", "x", lambda b: (b.body - 24.0) * np.cos(3 * b.read[:, 1]),
                             "inner temperature"),
    "solder joint opens": Hidden("positions", "x", lambda b: step(b.body, 22.7, 0.12), "temperature",
                                 options=noisy(0.1)),
    "pumps take turns": Hidden("static", "x", lambda r: np.abs(np.mod(r.t / 27500.0, 1.0) - 0.5), "time"),
    "dew point": Hidden("static", "z", lambda r: np.maximum(21.4 - r.T, 0.0) ** 1.5, "temperature"),
    "bellows": Hidden("static", "y", lambda r: r.ideal[:, 1] * np.tanh((r.T - 22.3) / 0.7), "force_y temperature"),
    "leak of the float": Hidden("static", "x", lambda r: np.log1p(r.t / 20000.0) * r.ideal[:, 0], "force_x time"),
    "levitation gap": Hidden("hand", "y", lambda h: h.f[:, 1] / (1.6 - h.f[:, 1]), "force_y"),
    "regulator drops out": Hidden("hand", "x", lambda h: step(h.supply, 4.9, 0.05) * h.f[:, 0],
                                  "force_x supply_voltage", options=SUPPLY),
    "Q of a resonator": Hidden("hand", "gyro z", lambda h: np.exp(-0.45 * (h.felt - 25.0)), "temperature"),
    "vortex in the gas": Hidden("rotation", "gyro y", lambda m: m.w[:, 0] * np.abs(m.w[:, 2]), "rate_x rate_z"),
    "anisoelastic by T": Hidden("rotation", "gyro x", lambda m: m.f[:, 0] * m.f[:, 1] * (m.T - 24.0),
                                "force_x force_y temperature"),
    "carriage of the gyroscope slips": Hidden("rotation", "gyro z", lambda m: m.w[:, 2] * step(m.t, 95.0, 6.0),
                                              "rate_z time"),
    "spider vanes": Hidden("mount", "azimuth", lambda k: np.cos(4 * k.outer) * np.sin(2 * k.inner),
                           "azimuth elevation"),
    "hydrostatic pads": Hidden("mount", "up", lambda k: bump(k.outer, 0.9, 0.5), "azimuth"),
    "oil film after a slew": Hidden("mount", "elevation", lambda k: power(k.moved[:, 1], 0.5), "elevation_change"),
    "truss in the night": Hidden("mount", "up", lambda k: (k.T - 11.0) ** 2, "temperature", options=DOME),
    "commutation": Hidden("rate table", "z", lambda m: m.w[:, 2] * np.cos(6 * m.table), "rate_z table"),
    "cable twists": Hidden("rate table", "y", lambda m: np.maximum(m.table - 6.0, 0.0), "table"),
}  # fmt: skip

# a third last set, from what engineers report of such rigs; nobody runs it before all else is finished
LAST_3: dict[str, Hidden] = {
    "rubber mounts swing in every dwell": Hidden(
        "positions", "z", lambda b: np.exp(-b.since / 40.0) * np.cos(TURN * b.since / 55.0), "since_move"),
    "epoxy creeps as a logarithm": Hidden(
        "positions", "y", lambda b: b.ideal[:, 1] * np.log1p(b.since / 15.0), "force_y since_move"),
    "gradient across the magnet": Hidden(  # a rate that is smooth in time, of a thermometer that scatters
        "positions", "x", lambda b: np.gradient(b.body, b.t) * b.ideal[:, 0], "force_x temperature_rate", False),
    "excitation of the resolver warms": Hidden(  # its two phases fall out of balance
        "positions", "inner", lambda b: (b.body - 23.0) * np.sin(2 * b.read[:, 1]), "inner temperature"),
    "cooler changes its sense": Hidden("static", "x", lambda r: np.abs(r.T - 22.2), "temperature"),
    "sun in the window": Hidden(  # some hours of every day, of which two are two turns of the platform
        "static", "z", lambda r: np.exp(4 * np.cos(TURN * (r.t / 86400.0 - 0.6)) - 4), "time|time_of_day", False),
    "polymer relaxes": Hidden(  # a stretched exponential, as Kohlrausch has it
        "static", "y", lambda r: np.exp(-np.sqrt(r.t / 9000.0)), "time"),
    "squeezed film": Hidden("hand", "y", lambda h: h.f[:, 1] * np.abs(h.f[:, 2]), "force_y force_z"),
    "comparator of the coarse range": Hidden("hand", "z", lambda h: step(h.f[:, 2], 0.4, 0.08), "force_z"),
    "reference by supply and T": Hidden("hand", "gyro x", lambda h: (h.supply - 5.0) * (h.felt - 25.0),
                                        "supply_voltage temperature", options=SUPPLY),
    "unbalance softens": Hidden("hand", "gyro z", lambda h: h.f[:, 1] * (h.felt - 25.0), "force_y temperature"),
    "current of all three loops": Hidden(  # one supply droops by the whole of the rate
        "rotation", "gyro z", lambda m: np.linalg.norm(m.w, axis=1), "rate_x rate_y rate_z"),
    "cross rate detunes": Hidden(  # the frequencies of a tuning fork part by the square
        "rotation", "gyro x", lambda m: m.w[:, 0] * m.w[:, 2] ** 2, "rate_x rate_z"),
    "electrode gap under load": Hidden("rotation", "gyro y", lambda m: m.w[:, 1] * np.abs(m.f[:, 0]),
                                       "force_x rate_y"),
    "friction wheel": Hidden(  # no whole number of its turns to one of the axis
        "mount", "azimuth", lambda k: np.sin(4.6 * k.outer + 0.5), "azimuth"),
    "mirror slides in its cell": Hidden("mount", "elevation", lambda k: step(k.inner, 0.85, 0.08),
                                       "elevation|air_mass"),
    "warm wall of the dome": Hidden("mount", "up", lambda k: (k.T - 12.0) * np.sin(k.outer - 0.5),
                                    "azimuth temperature", options=DOME),
    "voltage of the counter swings": Hidden("rate table", "z", lambda m: m.w[:, 2] * np.sin(TURN * m.t / 73.0),
                                            "rate_z time"),
    "brushes rectify": Hidden("rate table", "y", lambda m: np.abs(np.sin(1.5 * m.table + 0.3)), "table"),
    "resonance of the fixture": Hidden(  # at one speed of the motor, either way about
        "rate table", "x", lambda m: bump(np.abs(m.w[:, 2]), 0.9, 0.3), "rate_z"),
}  # fmt: skip

EVERY_LAW = {**LAWS, **FRESH, **LAST, **LAST_2, **LAST_3}

# a hundred in the noise of the plants, a hundred with an alien one; three quarters of an hour on one core
CLEAN: dict[str, Hidden] = {
    f"clean {k}{kind and ', ' + kind}": Hidden(
        rig, "azimuth" if rig == "mount" else NONE.where, NONE.value, "", options=(("alien", kind),) if kind else ()
    )
    for k, rig in enumerate(tuple(RIGS) * 17)
    for kind in ("", ALIEN[(k + k // 6) % 5])
    if k < 100
}
