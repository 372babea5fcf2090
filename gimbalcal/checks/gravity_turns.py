"""Turns between rests: what the gyroscopes read in each, and gravity or the gimbals before and after it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gimbalcal.checks.axes import AXES, CLOSE, without_scale
from gimbalcal.number import Array
from gimbalcal.recording.dwell import PAUSED, dwells, usual_step
from gimbalcal.recording.record import FORCE, RATE, Recording
from gimbalcal.rotation import exponential

MOVED = 0.5  # rad; a turn that moves the reference less cannot fail by `CLOSE` and does not tell signs
FEWEST = 3  # turns that tell
MOST_TURNS = 40  # those that move the reference most: enough to tell 48 readings apart
LONGEST = 4000  # steps of a turn; longer ones are taken in means


@dataclass(frozen=True, eq=False)
class Turns:
    """Readings (n, 3) of each turn less their level at rest, steps (n,) [s], and the reference before and after.

    The reference is a direction (3,) or, from gimbals, an attitude (3, 3) whose columns turn alike.
    """

    reading: list[Array]
    step: list[Array]
    before: Array  # (m, 3, k)
    after: Array  # (m, 3, k)


def turns_of(recording: Recording) -> Turns | None:
    """The turns that move the reference most, gravity's direction or else the gimbals; None where too few do."""
    stays = dwells(recording)
    y = recording.triad(RATE)
    usual = usual_step(recording) if len(recording.time) > 1 else 0.0
    logged = [
        k for k, (a, b) in enumerate(pairwise(stays))
        if b.start > a.stop and np.diff(recording.time[a.stop - 1 : b.start + 1]).max() <= PAUSED * usual
    ]  # fmt: skip
    for reference in _references(recording):
        at_rest = reference()
        if at_rest is None:
            continue
        moved = np.linalg.norm(at_rest[1:] - at_rest[:-1], axis=(1, 2))
        order = sorted((k for k in logged if moved[k] > MOVED), key=lambda k: -moved[k])[:MOST_TURNS]
        if len(order) < FEWEST:
            continue
        level = np.array([y[d.rows].mean(0) for d in stays])
        spans = [slice(stays[k].stop - 1, stays[k + 1].start + 1) for k in order]
        taken = [_means(recording.time[s], y[s] - (level[k] + level[k + 1]) / 2)
                 for k, s in zip(order, spans, strict=True)]  # fmt: skip
        after = [k + 1 for k in order]
        return Turns([r for r, _ in taken], [t for _, t in taken], at_rest[order], at_rest[after])
    return None


def _references(recording: Recording) -> Iterable[Callable[[], Array | None]]:
    return (lambda: down(recording), lambda: _attitude(recording))


def down(recording: Recording) -> Array | None:
    """Direction of the force at each rest (m, 3, 1); counts are centred first, where every axis went both ways."""
    if set(recording.axes(FORCE)) != set(AXES):
        return None
    y = recording.triad(FORCE)
    f = np.array([y[d.rows].mean(0) for d in dwells(recording)]).reshape(-1, 3)
    if recording.counted(FORCE):
        centred = without_scale(f)
        if centred is None:
            return None
        f = centred
    length = np.linalg.norm(f, axis=1, keepdims=True)
    return None if not len(f) or np.any(length == 0) else (f / length)[..., None]


def _attitude(recording: Recording) -> Array | None:
    """C_bp (m, 3, 3) at each rest as the gimbals tell it."""
    if not recording.platform.axes or not recording.has("gimbal_angle"):
        return None
    angles = recording.angles()
    return np.asarray(recording.platform.attitude(np.array([angles[d.start] for d in dwells(recording)])))


def _means(time: Array, y: Array) -> tuple[Array, Array]:
    """Mean rate (n, 3) and step (n,) from row to row, or over several rows of a very long turn."""
    dt, mean = np.diff(time), (y[1:] + y[:-1]) / 2
    size = -(-len(dt) // LONGEST)
    if size > 1:
        starts = np.arange(0, len(dt), size)
        total = np.add.reduceat(dt, starts)
        mean, dt = np.add.reduceat(mean * dt[:, None], starts) / total[:, None], total
    return mean, dt


def rotations(turns: Turns, factor: Array) -> Array:
    """C (m, 3, 3) of every turn for readings times `factor` (3,)."""
    out = np.empty((len(turns.reading), 3, 3))
    for i, (w, dt) in enumerate(zip(turns.reading, turns.step, strict=True)):
        C = exponential(factor * w * dt[:, None])
        while len(C) > 1:  # in pairs: later ones stand on the left
            tail = C[-1:] if len(C) % 2 else C[:0]
            C = np.concatenate([C[1::2] @ C[: len(C) - len(C) % 2 : 2], tail])
        out[i] = C[0]
    return out


def agree(turns: Turns, C: Array) -> int:
    """How many turns end where the reference does."""
    off = np.linalg.norm(C @ turns.before - turns.after, axis=(1, 2)) / np.sqrt(turns.before.shape[-1])
    return int(np.count_nonzero(off < 2 * np.sin(CLOSE / 2)))
