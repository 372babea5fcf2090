"""Shapes without a cause in a view: what stands for "none of these" where nobody states the noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.polynomial import legendre

from gimbalcal.diagnose.library.candidates import Candidate, Variant, appended_to
from gimbalcal.diagnose.library.shapes import polynomials, thermal, unit_rms
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.number import Array
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.views.core import View

SLOW, FAST = range(1, 9), range(9, 21)  # half periods of a course in time
CURVE = range(4, 10)  # degrees of a curve: a square and a cube have causes
VAGUE = 0.03  # of a shape, which directions read with noise still tell where the model has taken all that poses tell
MOVES = 1e-2  # rad; a gimbal that moves less stands still
Shape = tuple[str, str, Array]  # name, in words, basis (n, m)


def shapes_of(v: View, misfit: Array, taken: Array, blocks: list[Array], free: int) -> tuple[Candidate, ...]:
    """What is no cause, its columns (n, C, p), per rms of the misfit (n, C), appended to `blocks`.

    Smooth in time, fast in time, along the temperature; smooth in the direction of gravity, or harmonics of the gimbal
    angles. In each channel; the norm of the force shows an accelerometer as far as it lies along the force, the sky
    across a line of sight its outer axis by the cosine of the inner angle. A shape with as many columns as rows fits
    whatever is there, so none has more than half the `free`; and of what the model has `taken` (n C, q) only noise of
    the readings is left, a copy of the misfit where poses come again and again: it is no shape.
    """
    if v.added is not None:
        return _of_sensors(v, misfit, taken, blocks)
    rms = float(np.sqrt(np.mean(misfit**2)))
    n, C = misfit.shape[0], len(v.channels)
    out = []
    for c, (quantity, axis) in enumerate(v.channels):
        for name, words, basis in (*_of_view(v), *(_of_accelerometers(v) if v.name == "norm" else ())):
            seen = _outer_axis(v) if (quantity, axis) == ("pointing", "across") else 1.0
            scaled = rms * unit_rms((seen * basis)[:, : max(1, free // 2)])
            X = np.zeros((n, C, scaled.shape[1]))
            X[:, c] = scaled
            X = _beyond(X / (rms or 1.0), taken) * rms
            if not X.shape[-1]:
                continue
            span = tuple(appended_to(blocks, X))
            out.append(Candidate(f"unknown {name}", axis, (), (Variant((), span),), words, channel=quantity))
    return tuple(out)


def _of_sensors(v: View, misfit: Array, taken: Array, blocks: list[Array]) -> tuple[Candidate, ...]:
    """Shapes added to a sensor, each combination as large as the misfit beside what the model takes of it."""
    assert v.added is not None
    w, out = v.weight, []
    rms = float(np.sqrt(np.mean((misfit * w) ** 2)))
    Q = orthonormal(w.reshape(-1, 1) * taken)
    for quantity, axis in ((q, a) for q in (FORCE, RATE) for a in "xyz"):
        for name, words, basis in _turning(v):
            key = f"{name} in {quantity} {axis}"
            if key not in v.cache:
                v.cache[key] = v.added(quantity, axis, basis)
            A = (v.cache[key] * w[..., None]).reshape(len(taken), -1)
            A = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
            left = A - Q @ (Q.T @ A)
            _, S, Vt = np.linalg.svd(left, full_matrices=False)
            told = S > VAGUE
            X = (left @ Vt[told].T / S[told] * np.sqrt(misfit.size) * rms).reshape(*misfit.shape, -1) / w[..., None]
            if X.shape[-1]:
                span = tuple(appended_to(blocks, X))
                out.append(Candidate(f"unknown {name}", axis, (), (Variant((), span),), words, channel=quantity))
    return tuple(out)


def _turning(v: View) -> Iterator[Shape]:
    """What a sensor of a unit that is turned may follow."""
    s = v.stimulus
    t = s.time / (s.time[-1] or 1.0)
    yield "time", "a smooth function of time", np.cos(np.pi * np.outer(t, SLOW))
    yield "fast time", "a pattern in time", np.cos(np.pi * np.outer(t, FAST))
    yield "orientation", "a smooth function of the direction of gravity", polynomials(_along(v))
    yield "rate", "a smooth function of the rate of turn", _of_rate(s.rate / (np.abs(s.rate).max() or 1.0))
    if _warms(v):
        yield "temperature", "a function of temperature", thermal(s.time, _temperature(v))


def _of_rate(rate: Array) -> Array:
    """Squares, products, sizes and third degrees (g, 12) of the rate (g, 3), the largest being one."""
    x, y, z = rate.T
    third = legendre.legvander(rate, 3)[..., 3].T
    return np.stack([x * x, y * y, z * z, x * y, y * z, z * x, *np.abs(rate.T), *third], axis=-1)


def _beyond(X: Array, Q: Array) -> Array:
    """Combinations (n, C, q) of unit columns X (n, C, p) of which Q (n C, m) leaves more than `VAGUE`."""
    A = X.reshape(len(Q), -1)
    _, S, Vt = np.linalg.svd(A - Q @ (Q.T @ A), full_matrices=False)
    told = S > VAGUE * np.sqrt(len(X))
    left = X if np.all(told) else X @ Vt[told].T
    return unit_rms(left.reshape(len(Q), -1)).reshape(left.shape) / np.sqrt(X.shape[1])  # one channel holds it all


def _outer_axis(v: View) -> Array:
    """What a turn of the outer axis moves across the line of sight (n, 1)."""
    inner = v.stimulus.true_angle
    return np.ones((len(v), 1)) if inner is None else np.cos(inner[:, :1])


def _of_view(v: View) -> Iterator[Shape]:
    """What a channel may follow as it is."""
    yield "time", "a smooth function of time", _course(v, SLOW)
    if v.name in ("rest rates", "pointing"):
        yield "fast time", "a pattern in time", _course(v, FAST)
    if v.name == "pointing":
        yield from _angle_harmonics(v)
    elif v.name not in ("table", "slews"):
        yield "orientation", "a smooth function of the direction of gravity", polynomials(_along(v))
    if v.name == "rest rates" and _warms(v):
        yield "temperature", "a function of temperature", thermal(v.time, _temperature(v))


def _of_accelerometers(v: View) -> Iterator[Shape]:
    """What each accelerometer may follow: a course in time or temperature, or a curve of the force along it."""
    u = _along(v)
    for i, axis in enumerate("xyz"):
        along = u[:, i : i + 1]
        yield f"time {axis}", f"a smooth function of time along {axis}", along * _course(v, SLOW)
        yield f"fast time {axis}", f"a pattern in time along {axis}", along * _course(v, FAST)
        yield (
            f"scale {axis}",
            f"a scale factor that changes in time along {axis}",
            along**2 * _course(v, [*SLOW, *FAST]),
        )
        curve = legendre.legvander(u[:, i], CURVE[-1])[:, CURVE[0] :]
        yield f"curve {axis}", f"a curve of the force along {axis}", along * curve
        if _warms(v):
            hot = thermal(v.time, _temperature(v))
            yield f"temperature {axis}", f"a function of temperature along {axis}", along * hot


def _along(v: View) -> Array:
    """Unit force (n, 3)."""
    force = v.stimulus.force
    return np.asarray(force / np.linalg.norm(force, axis=-1, keepdims=True))


def _course(v: View, orders: Sequence[int]) -> Array:
    """Cosines over the recording (n, m)."""
    t = v.elapsed
    return np.asarray(np.cos(np.pi * np.outer(t / (t.max() or 1.0), orders)))


def _warms(v: View) -> bool:
    return v.stimulus.temperature is not None and bool(np.ptp(v.stimulus.temperature) > 0)


def _temperature(v: View) -> Array:
    return np.asarray(v.stimulus.temperature)


def _angle_harmonics(v: View) -> Iterator[Shape]:
    """The first harmonic, and the harmonics 2 to 6, of each gimbal angle that moves; and of two of them together."""
    moving = [(a, x) for a, x in zip(v.stimulus.axis_names, v.stimulus.readout.T, strict=True) if np.ptp(x) > MOVES]
    said = [axis.replace("_", " ").removesuffix(" angle") + " angle" for axis, _ in moving]
    for words, (_, angle) in zip(said, moving, strict=True):
        for orders, often in ((range(1, 2), "once per turn"), (range(2, 7), "twice per turn and faster")):
            yield f"{words}, {often}", f"a pattern in the {words}, {often}", _waves(angle, orders)
    if len(moving) > 1:
        (_, inner), (_, outer) = moving[:2]
        both = _waves(inner, range(1, 3))[:, :, None] * _waves(outer, range(1, 4))[:, None]
        yield "angles together", f"a pattern in {said[0]} and {said[1]} together", both.reshape(len(inner), -1)


def _waves(angle: Array, orders: range) -> Array:
    return np.stack([f(k * angle) for k in orders for f in (np.cos, np.sin)], axis=-1)
