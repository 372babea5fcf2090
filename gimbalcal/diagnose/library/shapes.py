"""Shapes without a known cause: the alternative hypothesis with which the known causes are compared.

They are free per position, smooth in orientation, time or temperature, harmonics of a gimbal angle, or simple laws that
are not in the catalogue. Their prior size is a few sigmas of a row if the noise is known, else that of the misfit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.polynomial import legendre

from gimbalcal.diagnose.library.candidates import Candidate, Variant, appended_to
from gimbalcal.effects import Stage
from gimbalcal.effects.history import smoothed_rate
from gimbalcal.inference.algebra import beyond, orthonormal
from gimbalcal.number import Array
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.views.core import Fit, View

ROUNDING = 1e-14  # of functions of order one: sines of half turns are 1e-16, cubes of a millidegree more
PLACES = 150  # with more of them, a smooth function of the direction of gravity is used
SETTINGS = 16  # of a gimbal; with more of them, harmonics are used
MIN_CORRELATION = 0.97  # correlation from which a simple law is one that the catalogue has
MAX_JUDGED_ROWS = 2000  # reduced rows on which that is judged: all of 18 positions, the slowest of a static run
RIVAL_SIGMA = 3.0  # prior size of one shape, in sigmas of a row: mixed over 0.1 to 100 like every other
SLOW, FAST = range(1, 9), range(9, 21)  # half periods of a time history
CURVE = range(4, 10)  # degrees of a curve: a square and a cube have causes
# of a shape, which directions read with noise still tell where the model has taken all that poses tell
MIN_SHAPE_SHARE = 0.03
MIN_TRAVEL_RAD = 1e-2  # a gimbal that moves less stands still
Shape = tuple[str, str, Array]  # name, in words, basis (n, m)


def unknown_shape(
    blocks: list[Array], name: str, axis: str, words: str, columns: Sequence[Array], channel: str = FORCE
) -> Candidate:
    """Return a shape of no cause, any one of the sets of columns (..., p), which are appended to `blocks`."""
    variants = tuple(Variant((), tuple(appended_to(blocks, X))) for X in columns)
    return Candidate(f"unknown {name}", axis, (), variants, words, channel=channel)


def shapes_in_outputs(o: Fit, blocks: list[Array]) -> list[Candidate]:
    """Return what outputs and gimbals may follow where the scale of the noise is known, per `RIVAL_SIGMA` of a row.

    Free per position, smooth in orientation, in time, in temperature, gimbal harmonics; and simple laws.
    """
    out: list[Candidate] = []
    axes = _accelerometer_responses(o)
    for name, (words, basis) in shapes(o).items():
        scaled = unit_rms(basis)
        every: list[int] = []
        for axis, along in axes:
            X = np.stack([along * b[:, None] for b in scaled.T], axis=-1)
            out.append(unknown_shape(blocks, name, axis, words, [o.reduced(X) * RIVAL_SIGMA]))
            every += out[-1].variants[0].index
        if len(axes) > 1:
            together = ", ".join(axis for axis, _ in axes)
            out.append(Candidate(f"unknown {name}", together, (), (Variant((), tuple(every)),), rival=words))
    return out + gimbal_harmonics(o, blocks) + _simple_laws(o, blocks)


def _simple_laws(o: Fit, blocks: list[Array]) -> list[Candidate]:
    """Products and powers of what was recorded, as outputs of one accelerometer, less those that have a cause."""
    Q = orthonormal(o.reduced(o.Z)[:MAX_JUDGED_ROWS])

    def normalised(X: Array) -> Array:
        """Return columns of length one, less what the calibration constants take up of them."""
        X = X[:MAX_JUDGED_ROWS]
        remainder = beyond(Q, X)
        size = np.sqrt((remainder**2).sum(axis=0))
        return remainder / np.where(size > 1e-3 * np.sqrt((X**2).sum(axis=0)) + 1e-300, size, np.inf)

    known = normalised(np.concatenate([b[:MAX_JUDGED_ROWS] for b in blocks], axis=1))
    out = []
    for name, (words, bases) in product_laws(o).items():
        for axis, along in _accelerometer_responses(o):
            each = (o.reduced(along[:, :, None] * unit_rms(basis)[:, None, :]) for basis in bases)
            new = [X * RIVAL_SIGMA for X in each
                   if X.any() and np.abs(known.T @ normalised(X)).max(axis=0).min() < MIN_CORRELATION]  # fmt: skip
            if new:
                out.append(unknown_shape(blocks, name, axis, words, new))
    return out


def _accelerometer_responses(o: Fit) -> list[tuple[str, Array]]:
    """Return the response (n, C) of all channels to one sigma of a row added to each logged accelerometer."""
    S = o.rows.sensitivity(Stage.ACCELEROMETER)
    out = []
    for k, (quantity, axis) in enumerate(o.view.channels):
        if quantity == "specific_force":
            along = S[:, :, "xyz".index(axis)]
            out.append((axis, along / np.abs(along[:, k]).max()))
    return out


def gimbal_harmonics(o: Fit, blocks: list[Array]) -> list[Candidate]:
    """Return errors of moving gimbals unlike those of bearings or encoders: high harmonics, a value at each setting."""
    out, names = list[Candidate](), o.view.stimulus.axis_names
    for i, axis in enumerate(names):
        harmonics = high_harmonics(o.rows.seen[Stage.ENCODER].angle[:, i])
        settings = settings_basis(o.view.stimulus.readout[:, i])
        for name, words, bases in (
            ("gimbal angle", f"a third or higher harmonic of the {axis} gimbal angle", harmonics),
            ("gimbal setting", f"a value of its own at each setting of the {axis} gimbal", settings),
        ):
            each = (o.rows.added(Stage.ENCODER, i, basis) for basis in bases)
            shown = [o.reduced(X / np.abs(X).max()) * RIVAL_SIGMA for X in each if X.any()]
            if shown:
                out.append(unknown_shape(blocks, name, axis, words, shown, "gimbal_angle"))
    return out


def shapes_of(v: View, misfit: Array, taken: Array, blocks: list[Array], free: int) -> tuple[Candidate, ...]:
    """Return shapes of no cause; their columns (n, C, p), per rms of the misfit (n, C), are appended to `blocks`.

    Smooth in time, fast in time, along the temperature; smooth in the direction of gravity, or harmonics of the gimbal
    angles. They act in each channel; on the norm of the force an accelerometer acts by its component along the force,
    on the sky an outer axis by the cosine of the inner angle. A shape with as many columns as rows would fit any data,
    so that none has more than half the `free`. Columns that the model has `taken` (n C, q) up to the noise of the
    readings are no shape: for recurring poses they would be a copy of the misfit.
    """
    if v.added is not None:
        return _of_sensors(v, misfit, taken, blocks)
    rms = float(np.sqrt(np.mean(misfit**2)))
    n, C = misfit.shape[0], len(v.channels)
    out = []
    for c, (quantity, axis) in enumerate(v.channels):
        for name, words, basis in (
            *_of_view(v),
            *(_of_accelerometers(v) if "sensors" in v.measurement.patterns else ()),
        ):
            response = _outer_axis(v) if (quantity, axis) == ("pointing", "across") else 1.0
            scaled = rms * unit_rms((response * basis)[:, : max(1, free // 2)])
            X = np.zeros((n, C, scaled.shape[1]))
            X[:, c] = scaled
            X = _combinations_beyond(X / (rms or 1.0), taken) * rms
            if X.shape[-1]:
                out.append(unknown_shape(blocks, name, axis, words, [X], quantity))
    return tuple(out)


def _of_sensors(v: View, misfit: Array, taken: Array, blocks: list[Array]) -> tuple[Candidate, ...]:
    """Return shapes added to a sensor; of each combination the part beyond the model has the rms of the misfit."""
    assert v.added is not None
    w, out = v.weight, []
    rms = float(np.sqrt(np.mean((misfit * w) ** 2)))
    Q = orthonormal(w.reshape(-1, 1) * taken)
    for quantity, axis in ((q, a) for q in (FORCE, RATE) for a in "xyz"):
        for name, words, columns in _shapes_of_turned_unit(v, quantity, axis):
            A = (columns * w[..., None]).reshape(len(taken), -1)
            A = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
            remainder = beyond(Q, A)
            _, S, Vt = np.linalg.svd(remainder, full_matrices=False)
            clear = S > MIN_SHAPE_SHARE
            X = remainder @ Vt[clear].T / S[clear] * np.sqrt(misfit.size) * rms
            X = X.reshape(*misfit.shape, -1) / w[..., None]
            if X.shape[-1]:
                out.append(unknown_shape(blocks, name, axis, words, [X], quantity))
    return tuple(out)


def _shapes_of_turned_unit(v: View, quantity: str, axis: str) -> Iterator[Shape]:
    """Yield what a sensor of a unit that is turned may follow, as columns (n, C, m)."""
    s = v.stimulus

    def added(name: str, basis: Array) -> Array:
        return v.of_sensor(name, quantity, axis, basis)

    history = v.time_history_of_sensor(quantity, axis)
    yield "time", "a smooth function of time", history[..., : len(SLOW)]
    yield "fast time", "a pattern in time", history[..., len(SLOW) : len(SLOW) + len(FAST)]
    yield (
        "orientation",
        "a smooth function of the direction of gravity",
        added("orientation", polynomials(_unit_force(v))),
    )
    rate = _of_rate(s.rate / (np.abs(s.rate).max() or 1.0))
    yield "rate", "a smooth function of the rate of turn", added("rate", rate)
    if _warms_up(v):
        yield (
            "temperature",
            "a function of temperature",
            added("temperature", thermal_polynomials(s.time, _temperature(v))),
        )


def _of_rate(rate: Array) -> Array:
    """Squares, products, sizes and third degrees (g, 12) of the rate (g, 3), the largest being one."""
    x, y, z = rate.T
    third = legendre.legvander(rate, 3)[..., 3].T
    return np.stack([x * x, y * y, z * z, x * y, y * z, z * x, *np.abs(rate.T), *third], axis=-1)


def _combinations_beyond(X: Array, Q: Array) -> Array:
    """Combinations (n, C, q) of unit columns X (n, C, p) of which Q (n C, m) leaves more than `MIN_SHAPE_SHARE`."""
    A = X.reshape(len(Q), -1)
    _, S, Vt = np.linalg.svd(beyond(Q, A), full_matrices=False)
    clear = S > MIN_SHAPE_SHARE * np.sqrt(len(X))
    remainder = X if np.all(clear) else X @ Vt[clear].T
    unit = unit_rms(remainder.reshape(len(Q), -1)).reshape(remainder.shape)
    return unit / np.sqrt(X.shape[1])  # one channel holds it all


def _outer_axis(v: View) -> Array:
    """Return the motion across the line of sight (n, 1) by a turn of the outer axis."""
    inner = v.stimulus.true_angle
    return np.ones((len(v), 1)) if inner is None else np.cos(inner[:, :1])


def _of_view(v: View) -> Iterator[Shape]:
    """Yield what a channel may follow as it is."""
    follows = v.measurement.patterns
    yield "time", "a smooth function of time", _time_cosines(v, SLOW)
    if "fast time" in follows:
        yield "fast time", "a pattern in time", _time_cosines(v, FAST)
    if "angles" in follows:
        yield from _angle_harmonics(v)
    if "orientation" in follows:
        yield "orientation", "a smooth function of the direction of gravity", polynomials(_unit_force(v))
    if "temperature" in follows and _warms_up(v):
        yield "temperature", "a function of temperature", thermal_polynomials(v.time, _temperature(v))


def _of_accelerometers(v: View) -> Iterator[Shape]:
    """Yield what each accelerometer may follow: time, temperature, or a curve of the force along it."""
    u = _unit_force(v)
    for i, axis in enumerate("xyz"):
        along = u[:, i : i + 1]
        yield f"time {axis}", f"a smooth function of time along {axis}", along * _time_cosines(v, SLOW)
        yield f"fast time {axis}", f"a pattern in time along {axis}", along * _time_cosines(v, FAST)
        yield (
            f"scale {axis}",
            f"a scale factor that changes in time along {axis}",
            along**2 * _time_cosines(v, [*SLOW, *FAST]),
        )
        curve = legendre.legvander(u[:, i], CURVE[-1])[:, CURVE[0] :]
        yield f"curve {axis}", f"a curve of the force along {axis}", along * curve
        if _warms_up(v):
            hot = thermal_polynomials(v.time, _temperature(v))
            yield f"temperature {axis}", f"a function of temperature along {axis}", along * hot


def _angle_harmonics(v: View) -> Iterator[Shape]:
    """The first harmonic, and the harmonics 2 to 6, of each gimbal angle that moves; and of two of them together."""
    every = zip(v.stimulus.axis_names, v.stimulus.readout.T, strict=True)
    moving = [(a, x) for a, x in every if np.ptp(x) > MIN_TRAVEL_RAD]
    names = [axis.replace("_", " ").removesuffix(" angle") + " angle" for axis, _ in moving]
    for words, (_, angle) in zip(names, moving, strict=True):
        for orders, often in ((range(1, 2), "once per turn"), (range(2, 7), "twice per turn and faster")):
            yield f"{words}, {often}", f"a pattern in the {words}, {often}", _waves(angle, orders)
    if len(moving) > 1:
        (_, inner), (_, outer) = moving[:2]
        both = _waves(inner, range(1, 3))[:, :, None] * _waves(outer, range(1, 4))[:, None]
        yield "angles together", f"a pattern in {names[0]} and {names[1]} together", both.reshape(len(inner), -1)


def shapes(o: Fit) -> dict[str, tuple[str, Array]]:
    """Bases (n, m) of the rivals that act on each accelerometer output."""
    v, s = o.view, o.view.stimulus
    orders = range(1, 11) if v.kind.in_positions else range(1, 21)
    out = {"time": ("a smooth function of time", _time_cosines(v, orders))}
    if o.view.kind.in_positions:
        places = np.unique(s.position)
        if len(places) <= PLACES:
            out["position"] = ("a value of its own at each position", (s.position[:, None] == places).astype(float))
        out["orientation"] = ("a smooth function of the direction of gravity", polynomials(_unit_force(v)))
        if s.since_move.max() > 0:
            out["settling"] = ("a transient after each move", _settling_basis(o))
    else:
        phase = np.arctan2(s.force[:, 1], s.force[:, 0])
        out["orientation"] = ("harmonics of the sidereal angle", _waves(phase, range(2, 7)))
    if _warms_up(v):
        out["temperature"] = ("a function of temperature", thermal_polynomials(s.time, _temperature(v)))
    return out


def _settling_basis(o: Fit) -> Array:
    """Forces, and their changes at the last move, dying away at three speeds within a dwell: a basis (n, up to 18)."""
    s = o.view.stimulus
    longest = float(s.since_move.max())
    fades = [np.exp(-s.since_move / (longest * part))[:, None] for part in (0.05, 0.2, 0.8)]
    basis = np.concatenate([fade * f / s.gravity for fade in fades for f in (s.force, s.move_force)], axis=1)
    U, S, _ = np.linalg.svd(basis, full_matrices=False)
    return np.asarray(U[:, S > 1e-2 * S[0]])


def unit_rms(basis: Array) -> Array:
    """Return columns (n, m) scaled to rms one; rounding errors, as of x y with one axis up or down, become zero."""
    rms = np.sqrt((basis**2).mean(axis=0))
    return np.where(rms > ROUNDING, basis / np.where(rms > ROUNDING, rms, 1.0), 0.0)


def polynomials(u: Array) -> Array:
    """Return polynomials (n, 15) of degree two and three of the unit force (n, 3), without z^2 = 1 - x^2 - y^2."""
    x, y, z = u.T
    second = [x * y, y * z, z * x, x * x, y * y]
    third = [x**3, y**3, z**3, x * x * y, x * x * z, y * y * x, y * y * z, z * z * x, z * z * y, x * y * z]
    return np.stack(second + third, axis=-1)


def thermal_polynomials(time: Array, temperature: Array) -> Array:
    """Legendre polynomials 2 to 5 of temperature, its smoothed rate, square and cube (n, 7)."""
    centred = temperature - temperature.mean()
    x = centred / (np.abs(centred).max() + 1e-12)
    poly = legendre.legvander(x, 5)[:, 2:]
    width = max(2.0, len(time) / 200)
    rate = np.gradient(_gaussian_smoothed(temperature, width), time)
    rate = rate / (np.abs(rate).max() + 1e-300)
    return np.concatenate([poly, np.stack([rate, rate**2, rate**3], axis=-1)], axis=1)


def _gaussian_smoothed(x: Array, width: float) -> Array:
    """x (n,) through a Gaussian of so many rows, mirrored at its ends."""
    reach = int(4 * width + 0.5)
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    return np.convolve(np.pad(x, reach, mode="symmetric"), bell / bell.sum(), mode="valid")


def product_laws(o: Fit) -> dict[str, tuple[str, list[Array]]]:
    """Return simple laws that are not in the catalogue, by family: words, and bases (n, 1 or 2), one of which applies.

    A flexible shape cannot compete with a known cause that closely resembles the true law; the true law itself can.
    """
    s = o.view.stimulus
    t = s.time / s.time[-1] - 0.5
    angles = [a for a in s.angle.T if np.ptp(a) > 1e-2]
    where = [f[:, None] for f in (s.force / s.gravity).T if np.std(f) > 1e-3]
    where += [np.stack([np.cos(a), np.sin(a)], axis=-1) for a in angles]
    follows = {"time": t}
    if s.temperature is not None and np.ptp(s.temperature) > 0:
        follows["temperature"] = s.temperature - s.temperature.mean()
        rate = smoothed_rate(s.temperature, s.time, float(s.time[-1]) / 100)
        follows["the rate of temperature"] = rate / (np.abs(rate).max() + 1e-300)
    out = {f"with {name}": (f"a force or gimbal angle times {name}", [x[:, None] * w for w in where])
           for name, x in follows.items()}  # fmt: skip
    powers = [(x**n)[:, None] for x in follows.values() for n in (2, 3)]
    out["power"] = ("a square or cube of " + ", ".join(follows), powers)
    if o.view.kind.in_positions:
        every = np.where(s.visit % 2, 1.0, -1.0)[:, None]
        words = "something that alternates from one position to the next"
        out["alternating"] = (words, [every, *(every * w for w in where)])
    return out


def high_harmonics(angle: Array) -> list[Array]:
    """Return bases (n, m) of an error that repeats three to eight times a turn: all of these together, and each alone.

    In a few positions a harmonic is partly confounded with the first and second; that part is removed from the first
    basis, and kept in those of the single harmonics.
    """
    beyond = _above_second(angle)
    if np.ptp(angle) < 1e-2 or not beyond.shape[1]:
        return []
    out = [beyond]
    for n in range(3, 9):
        pair = _waves(angle, [n])
        if np.linalg.norm(beyond.T @ pair) > 0.1 * len(angle):
            out.append(pair)
    return out


def settings_basis(angle: Array) -> list[Array]:
    """Basis (n, m) of an error that has a value of its own at each setting of a gimbal, if it has few settings."""
    angles, at = np.unique(np.round(np.mod(angle, 2 * np.pi), 3), return_inverse=True)
    return [np.eye(len(angles))[at]] if 3 <= len(angles) <= SETTINGS else []


def _above_second(angle: Array) -> Array:
    """Harmonics 3 to 8 (n, m) cleared of what constant, first and second say at these angles, and of each other."""
    low = _waves(angle, range(3))
    high = _waves(angle, range(3, 9))
    Q = np.linalg.svd(low, full_matrices=False)
    base = Q[0][:, Q[1] > 1e-6 * Q[1][0]]
    U, S, _ = np.linalg.svd(beyond(base, high), full_matrices=False)
    return np.asarray(U[:, S > 1e-2 * np.sqrt(len(angle))] * np.sqrt(len(angle)))


def _unit_force(v: View) -> Array:
    """Unit force (n, 3)."""
    force = v.stimulus.force
    return np.asarray(force / np.linalg.norm(force, axis=-1, keepdims=True))


def _time_cosines(v: View, orders: Sequence[int]) -> Array:
    """Cosines over the recording (n, m)."""
    t = v.elapsed
    return np.asarray(np.cos(np.pi * np.outer(t / (t.max() or 1.0), orders)))


def _waves(angle: Array, orders: Sequence[int]) -> Array:
    """Cosine and sine (n, 2 m) of multiples of an angle."""
    return np.stack([f(k * angle) for k in orders for f in (np.cos, np.sin)], axis=-1)


def _warms_up(v: View) -> bool:
    return v.stimulus.temperature is not None and bool(np.ptp(v.stimulus.temperature) > 0)


def _temperature(v: View) -> Array:
    return np.asarray(v.stimulus.temperature)
