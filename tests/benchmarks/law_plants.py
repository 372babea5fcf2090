"""Six rigs with a law that no catalogue holds, each at a strength in sigmas, and what a law leaves of a second run.

The recordings come from the plants of the other benchmarks, which share no line with the package. Each rig says what a
law may follow under the name that the package prints, taken from the plant and not from the package.
"""

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimbalcal import calibrate
from gimbalcal.calibration.calibration import Residual
from gimbalcal.calibration.correction import correct
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.benchmarks import unknown_hand, unknown_mount
from tests.diagnose import plant, static_plant, turned_plant
from tests.estimate.gyroscopes import test_rate_table

UG, ARCSEC, DEG, HOUR = plant.UG, plant.ARCSEC, turned_plant.DEG, np.pi / 648000
ROUNDS = 3  # in which a law is evaluated at what is felt
HAND_CONSTANTS = 12  # of a calibration by the norm of the force
SECOND = 5000  # added to a seed for the second recording

Variables = Mapping[str, Array]
Value = Callable[[Any], Array]


@dataclass(frozen=True)
class Hidden:
    """A law: its rig, where it acts ("y", "gyro z", an axis of a gimbal), its value of what the rig goes through.

    follows: sets of variables, separated by |, any of which is right; determined: whether the design of the rig
    determines it; options: of the recording, of which "noisy" [degC, one sigma of a reading of the thermometer] and
    "alien" [a kind of noise, see ALIEN] are known to every rig.
    """

    rig: str
    where: str
    value: Value
    follows: str
    determined: bool = True
    options: tuple[tuple[str, Any], ...] = ()


NONE = Hidden("", "x", lambda b: 0.0, "")
ALIEN = ("tails", "walk", "outliers", "flicker", "loose")
EVERY_RIG = ("noisy", "alien")


def _sensor(where: str) -> tuple[int, bool]:
    return "xyz".index(where[-1]), where.startswith("gyro")


def positions(seed: int, law: Hidden, size: float) -> Recording:
    """18 positions on a space-stable platform, a noisy thermometer; size in ug or arcsec."""
    gimbals = ("platform", "inner", "middle")

    def error(b: plant.Bench) -> dict[str, Array]:
        value = np.broadcast_to(law.value(b), b.t.shape)
        if law.where in gimbals:
            return plant.turned(gimbals.index(law.where), value)
        return {"output": np.outer(value, [float(a in law.where) for a in "xyz"])}

    unit = ARCSEC if law.where in gimbals else UG
    return plant.record(np.random.default_rng(seed), error, size * unit, **{"rows": 120, **_own(law)})


def static(seed: int, law: Hidden, size: float) -> Recording:
    """48 hours at rest in inertial space; size in ug."""
    rng = np.random.default_rng(seed)
    added = lambda r: np.outer(law.value(r), np.eye(3)["xyz".index(law.where)])  # noqa: E731
    return static_plant.record(rng, added, size * UG, **_own(law))


def _own(law: Hidden) -> dict[str, Any]:
    """Options that the plant of the rig takes itself."""
    return {k: x for k, x in law.options if k not in ("dome", "warming", *EVERY_RIG)}


def _of_hand(law: Hidden) -> tuple[unknown_hand.Setup, unknown_hand.Error]:
    i, gyro = _sensor(law.where)
    made = unknown_hand.Setup(**{"thermometer": True, "gyroscopes": gyro, "rests": 44, **_own(law)})
    return made, lambda h: {"rate" if gyro else "force": np.outer(law.value(h), np.eye(3)[i])}


def hand(seed: int, law: Hidden, size: float) -> Recording:
    """44 rests by hand in any attitude, sensors that wander; size in g or rad/s."""
    made, error = _of_hand(law)
    return unknown_hand.record(seed, made, ((error, size),))


@dataclass(frozen=True, eq=False)
class Night(unknown_mount.Sky):
    """Where the stars are, and the temperature [degC] of the dome."""

    T: Array


def _of_mount(law: Hidden) -> tuple[unknown_mount.Setup, unknown_mount.Error]:
    part = {"azimuth": [1.0, 0.0], "elevation": [0.0, 1.0], "up": [0.0, 1.0]}[law.where]
    key = "sky" if law.where == "up" else "readout"
    made = unknown_mount.Setup(**{"stars": 90, **_own(law)})
    return made, lambda k: {key: np.outer(law.value(Night(**vars(k), T=dome(k.t))), part)}


def mount(seed: int, law: Hidden, size: float) -> Recording:
    """90 stars on an alt-azimuth mount, where "dome" is among the options with a thermometer; size in arcsec."""
    made, error = _of_mount(law)
    r = unknown_mount.record(seed, made, ((error, size * ARCSEC),))
    if "dome" not in dict(law.options):
        return r
    T = dome(r.time) + 0.05 * np.random.default_rng(seed + 31).standard_normal(len(r.time))
    return r.with_channels({("temperature", ""): T})


def dome(t: Array) -> Array:
    """Temperature of a dome [degC] that cools in the night, with gusts."""
    return np.asarray(9 + 6 * np.exp(-t / 5000.0) + 1.5 * np.sin(t / 700.0))


def parallactic(k: unknown_mount.Sky) -> Array:
    """Angle between the vertical and the hour circle of each star, azimuth from north through east."""
    return _parallactic(k.outer, k.inner)


def _parallactic(azimuth: Array, elevation: Array) -> Array:
    north = np.tan(unknown_mount.LATITUDE) * np.cos(elevation) - np.sin(elevation) * np.cos(azimuth)
    return np.asarray(np.arctan2(-np.sin(azimuth), north))


@dataclass(frozen=True, eq=False)
class Moving:
    """Force [g], rate [rad/s], temperature and time of a unit that is turned, and the angle of a table."""

    f: Array
    w: Array
    T: Array
    t: Array
    table: Array


def _temperature(t: Array) -> Array:
    return np.asarray(23 + 4 * np.sin(2 * np.pi * t / (0.8 * t[-1]) + 0.4))


def _warming(t: Array) -> Array:
    return np.asarray(19 + 9 * (1 - np.exp(-1.3 * t / t[-1])))


def _course(law: Hidden) -> Callable[[Array], Array]:
    return _warming if dict(law.options).get("warming") else _temperature


def rotation(seed: int, law: Hidden, size: float) -> Recording:
    """40 rests by hand and the turns between them at 30 Hz; size in g or rad/s."""
    i, gyro = _sensor(law.where)
    unit = 1.0 if gyro else turned_plant.G

    def error(f: Array, w: Array, T: Array, t: Array) -> Array:
        return np.outer(unit * size * law.value(Moving(f / turned_plant.G, w, T, t, 0 * t)), np.eye(3)[i])

    made = turned_plant.Unit(**{"rate" if gyro else "force": error, "temperature": _course(law)})
    return turned_plant.turned(seed, made, rests=40)


def table(seed: int, law: Hidden, size: float) -> Recording:
    """Ten seconds at each of eight rates about z, up and down, twice; size in rad/s."""
    r, again = (test_rate_table.run("z", seed + 7000 * k) for k in range(2))
    both = {key: np.concatenate([x, again.channels[key] + (x[-1] if key[1] == "table" else 0.0)])
            for key, x in r.channels.items()}  # fmt: skip
    time = np.arange(2 * len(r.time)) * r.time[1]
    r = replace(r, time=time, channels=both, weight=np.ones(len(time)))
    w = np.gradient(r.channels["gimbal_angle", "table"], r.time)
    felt = np.outer(w, [0.0, 0.0, 1.0])
    T = _course(law)(r.time)
    i, _ = _sensor(law.where)
    added = size * law.value(Moving(0 * felt, felt, T, r.time, r.channels["gimbal_angle", "table"]))
    key = ("angular_rate", "xyz"[i])
    still = np.abs(w) < 1e-6
    number = np.cumsum(np.diff(still.astype(int), prepend=0) > 0) * still
    channels = {**r.channels, key: r.channels[key] + added, ("temperature", ""): T}
    return replace(r, channels=channels, position=number, instant=True)


RIGS: dict[str, Callable[[int, Hidden, float], Recording]] = {
    "positions": positions, "static": static, "hand": hand, "rotation": rotation, "mount": mount, "rate table": table,
}  # fmt: skip


def simulated(seed: int, law: Hidden, size: float) -> Recording:
    """A recording of a rig, with what is wrong with its thermometer or its noise."""
    options = dict(law.options)
    if law.rig == "positions" and options.get("alien") == "loose":  # three times the setting error of the header
        law = replace(law, options=(*law.options, ("loose", 3.0)))
    r, rng = RIGS[law.rig](seed, law, size), np.random.default_rng(seed + 97)
    if "noisy" in options:
        T = r.channels["temperature", ""]
        r = r.with_channels({("temperature", ""): T + options["noisy"] * rng.standard_normal(len(T))})
    return alien(r, options["alien"], rng) if "alien" in options else r


def alien(r: Recording, kind: str, rng: np.random.Generator) -> Recording:
    """Noise of a kind on every channel of the sensors (mounts: of the readouts), in units of its scatter from row to
    row: Student's t of 3 degrees of freedom, a random walk, an outlier in about 300 rows, 1/f, or offsets of each stay.
    """
    n, channels = len(r.time), dict(r.channels)
    stays = r.position if r.position is not None else np.arange(n) if n < 200 else np.arange(n) * 20 // n
    number = np.cumsum(np.diff(stays, prepend=stays[0]) != 0)
    for key, x in r.channels.items():
        if key[0] not in (("gimbal_angle",) if r.kind.sighting else ("specific_force", "angular_rate")):
            continue
        true = r.channels.get(("true_angle", key[1]), 0.0)
        scatter = 1.48 * float(np.median(np.abs(np.diff(x - true)))) / np.sqrt(2)
        z = rng.standard_normal(n)
        if kind == "tails":
            z = rng.standard_t(3, n)
        elif kind == "walk":
            z = 3 * np.cumsum(z) / n
        elif kind == "outliers":
            off = np.isin(np.arange(n), rng.choice(n, 1 + n // 300, replace=False))
            z = off * rng.choice([-1, 1], n) * rng.uniform(6, 20, n)
        elif kind == "flicker":
            z = np.fft.irfft(np.fft.rfft(z) / np.sqrt(np.maximum(np.arange(n // 2 + 1), 1.0)), n)
            z *= 0.2 / np.std(z)
        elif r.title == "plant" and "gimbal_angle" in r.noise:
            continue  # its settings are loose already
        else:
            rows = np.bincount(number)[number]
            z = 2 * rng.standard_normal(number.max() + 1)[number] / np.sqrt(rows)
        channels[key] = x + scatter * z
    return replace(r, channels=channels)


def misfit(r: Recording) -> tuple[float, float]:
    """Square of the misfit in sigmas of the noise that the header states, and its degrees of freedom."""
    from gimbalcal.diagnose.evidence.stated_noise import nominal_noise
    from gimbalcal.inference.algebra import orthonormal

    o = fit_baseline(view_at_known_attitude(r))
    node = nominal_noise(o)
    Q, y = orthonormal(node.whiten(o.reduced(o.Z))), node.whiten(o.reduced(o.residual[:, :, None]))[:, 0]
    y = y - Q @ (Q.T @ y)
    return float(y @ y), float(len(y) - Q.shape[1])


def excess(r: Recording, clean: Recording, with_: tuple[str, ...] = ()) -> float:
    """Sigmas by which a recording is worse than the same noise without a law."""
    if clean.title == "hand" and not with_:
        return _of_norms(r, clean)
    if clean.title == "z up" and not with_:
        return _of_rates(r, clean)
    if clean.noise and not clean.kind.sighting:
        return float(np.sqrt(max(misfit(r)[0] - misfit(clean)[0], 0.0)))
    return _worse(*(calibrate(x, more=list(with_)).residual for x in (r, clean)))


def degrees(clean: Recording) -> float:
    """Degrees of freedom of the rows in which an excess is counted."""
    if clean.title == "hand":
        return float(len(np.unique(clean.position[clean.position > 0])) - HAND_CONSTANTS)
    if clean.noise and not clean.kind.sighting:
        return misfit(clean)[1]
    left = calibrate(clean).residual
    return float(max(left.dof, 1) * len(_kinds(left)))


def left_by_causes(r: Recording, clean: Recording, names: tuple[str, ...]) -> float:
    """Sigmas by which a recording is worse than the same noise without a law, known causes fitted in both."""
    a, b = (calibrate(x, more=list(names)).residual for x in (r, clean))
    if clean.noise and not clean.kind.sighting:
        return float(np.sqrt(max(a.chi2 - b.chi2, 0.0)))
    return _worse(a, b)


def _kinds(left: Residual) -> Counter[str]:
    """Kinds of rows, of each of which a fit counts its degrees of freedom, and of how many channels each is."""
    return Counter(re.split("[: ]", key)[0] for key in left.rms)


def _worse(a: Residual, b: Residual) -> float:
    """Sigmas by which one fit is worse than another in the same noise, which is what the other leaves of each channel.

    Each kind of row counts for itself: where rates at rest and turns are added in one unit, the noisier hide the law.
    """
    channels = _kinds(b)
    square = sum(((a.rms[k] / x) ** 2 - 1) / channels[re.split("[: ]", k)[0]] for k, x in b.rms.items())
    return float(np.sqrt(max(square, 0.0) * max(b.dof, 1)))


def _of_rates(r: Recording, clean: Recording) -> float:
    """Sigmas by which the rates on a table differ, bias and scale factor removed, in the white noise of the plant."""
    w = np.gradient(clean.channels["gimbal_angle", "table"], clean.time)
    Z = np.column_stack([np.ones(len(w)), w])
    d = r.triad("angular_rate") - clean.triad("angular_rate")
    return float(np.linalg.norm(d - Z @ np.linalg.lstsq(Z, d, rcond=None)[0]) / (0.02 * DEG))


def _of_norms(r: Recording, clean: Recording) -> float:
    """Sigmas by which norms of the force and rates at rest differ, calibration removed, in the noise of the plant."""
    rest = np.asarray(clean.position)
    at = [np.flatnonzero(rest == k) for k in np.unique(rest[rest > 0])]
    grade, m = unknown_hand.MEMS, len(at)

    def means(r: Recording, quantity: str) -> Array:
        return np.array([[r.channels[quantity, a][i].mean() for a in "xyz"] for i in at])

    total = 0.0
    if clean.has("angular_rate"):
        level = means(r, "angular_rate") - means(clean, "angular_rate")
        earth = (unknown_hand.EARTH * np.cos(unknown_hand.LATITUDE)) ** 2 / 2
        V = unknown_hand.wanders(m, grade.turning_wander) + np.eye(m) * (grade.turning**2 / len(at[0]) + earth)
        total = sum(unknown_hand._left(level[:, i], np.ones((m, 1)), V) for i in range(3))
    f, x = (means(y, "specific_force") / unknown_hand.G for y in (clean, r))
    d = unknown_hand.G * ((x - f) * f).sum(axis=1)
    V = (f @ f.T) * unknown_hand.wanders(m, grade.wander) + np.eye(m) * grade.white**2 / len(at[0])
    Z = np.concatenate([f, (f[:, :, None] * f[:, None, :]).reshape(m, 9)], axis=1)
    return float(np.sqrt(total + unknown_hand._left(d, Z, V)))


def size_of(seed: int, law: Hidden, sigmas: float) -> float:
    """The size at which a law stands so many sigmas above the noise after the calibration."""
    if law.rig == "hand":
        made, error = _of_hand(law)
        return sigmas / unknown_hand.strength(seed, made, error)
    if law.rig == "mount":
        sky, error = _of_mount(law)
        return sigmas / unknown_mount.strength(seed, sky, error)
    clean, size = simulated(seed, law, 0.0), {"rotation": 1e-3, "rate table": 1e-3}.get(law.rig, 10.0)
    for _ in range(2):  # a probe well above the noise
        size *= 100.0 / max(excess(simulated(seed, law, size), clean), 1e-3)
    return size * sigmas / 100.0


def left_by_itself(seed: int, law: Hidden, size: float) -> float:
    """Sigmas that a law leaves where it is taken at what the thermometer says: no formula of the readings leaves less.

    Its parameters and origins are the true ones.
    """
    if "temperature" not in law.follows.split("|")[0].split():
        return 0.0
    clean = simulated(seed, law, 0.0)
    read, name = clean.channels["temperature", ""], {"positions": "body", "hand": "felt"}.get(law.rig, "T")
    error = replace(law, value=lambda s: law.value(s) - law.value(replace(s, **{name: read})))
    return excess(simulated(seed, error, size), clean)


def variables(r: Recording) -> Variables:
    """What a law may follow in a recording, by the names and in the units that the package prints."""
    out: dict[str, Array] = {"time": r.time, "time_of_day": np.mod(r.time, 86400.0)}
    for a in "xyz":
        if r.has("specific_force"):
            out[f"force_{a}"] = r.channels["specific_force", a] / 9.80665
        if r.has("angular_rate"):
            out[f"rate_{a}"] = r.channels["angular_rate", a] / DEG
    for (quantity, axis), x in r.channels.items():
        if quantity in ("gimbal_angle", "covariate"):
            out[axis] = x
        if quantity == "temperature":
            out["temperature"] = x
            out["temperature_rate"] = np.gradient(x, r.time) * 3600
    if r.position is not None:
        starts = np.flatnonzero(np.diff(r.position, prepend=-1))
        dwell = np.searchsorted(starts, np.arange(len(r.time)), side="right") - 1
        out["since_move"] = r.time - r.time[starts][dwell]
        for name, x in list(out.items()):
            if name in ("platform", "inner", "middle") or name.startswith("force"):
                held = np.array([x[i : i + 10].mean() for i in starts])
                out |= _before(name, np.diff(held, prepend=held[0])[dwell], x)
    elif r.kind.sighting:
        for name in ("azimuth", "elevation"):
            out |= _before(name, np.diff(out[name], prepend=out[name][0]), out[name])
        angle = _parallactic(out["azimuth"], out["elevation"])
        out |= {"parallactic_angle": angle, "air_mass": 1 / np.sin(out["elevation"])}
    return out


def _before(name: str, change: Array, x: Array) -> dict[str, Array]:
    """How a stay was come to: the direction of the approach, the change and the value before the move."""
    quantity, _, axis = name.partition("_")
    by = f"{quantity}_change_{axis}" if axis else f"{quantity}_change"
    return {f"approach_{name}": np.sign(np.round(change, 6)), by: change, f"before_{name}": x - change}


PRINTED = {"specific_force": 9.80665e-6, "angular_rate": HOUR, "gimbal_angle": ARCSEC}


class UnknownVariable(Exception):
    """A law follows what `variables` does not know by that name, and can not be judged."""


def felt(r: Recording) -> Recording:
    """The recording with the forces and rates that its own calibration makes of the readings, biases removed."""
    sensors = [key for key in r.channels if key[0] in ("specific_force", "angular_rate")]
    made = correct(calibrate(r), r) if sensors else r
    return r.with_channels({key: made.channels[key] for key in sensors})


def _added(law: dict[str, Any], x: Mapping[str, Array]) -> Array:
    """What a law of diagnosis.json adds at variables in its units: by its table, or by its expression."""
    import sympy

    if law["expression"] == "table":
        (values,) = x.values()
        return np.interp(values, law["parameters"]["knots"], law["parameters"]["values"])
    symbols = {name: sympy.Symbol(name, real=True) for name in x}
    f = sympy.lambdify(list(symbols.values()), sympy.sympify(law["expression"], locals=symbols), "numpy")
    return np.asarray(f(*x.values()), dtype=float)


def corrected(r: Recording, laws: list[dict[str, Any]]) -> Recording:
    """The recording with what laws of a diagnosis say taken away: of what is felt, and so in a few rounds.

    What is read holds the law too: a law of a twentieth of the rate, at that rate, would be a twentieth too large.
    """
    now = r
    for _ in range(ROUNDS):
        values, channels = variables(felt(now)), dict(r.channels)
        for law in laws:
            key = (law["channel"], law["axis"])
            if missing := set(law["variables"]) - set(values):
                raise UnknownVariable(", ".join(sorted(missing)))
            x = {name: values[name] for name in law["variables"]}
            added = np.broadcast_to(np.asarray(_added(law, x), dtype=float), r.time.shape)
            sign = -1 if law["channel"] == "gimbal_angle" else 1  # the true angle is the readout plus its error
            channels[key] = channels[key] - sign * PRINTED[law["channel"]] * added
        now = replace(r, channels=channels)
    return now
