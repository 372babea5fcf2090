"""The laws of `bench_laws`, written from what engineers report of such rigs and not from what the package can print."""

import numpy as np

from gimbalcal.number import Array
from tests.benchmarks.law_plants import NONE, Hidden
from tests.diagnose.plant import came

TURN = 2 * np.pi


def square(x: Array) -> Array:
    """A square wave of period one."""
    return np.where(np.mod(x, 1.0) < 0.5, 1.0, -1.0)


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
                                 ("supply_voltage",), options=(("supply", True),)),
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

CLEAN: dict[str, Hidden] = {
    f"clean {rig}{name}": Hidden(rig, NONE.where if rig != "mount" else "azimuth", NONE.value, "", options=options)
    for rig, own in {
        "positions": (("", ()), (", tails", (("tails", 4.0),)), (", walk", (("walk", 60.0),))),
        "static": (("", ()),),
        "hand": (("", ()), (", tails", (("tails", 4.0),))),
        "rotation": (("", ()),),
        "mount": (("", ()), (", tails", (("tails", 4.0),))),
        "rate table": (("", ()),),
    }.items()
    for name, options in own
}
