"""Columns of a log that say the same, and several logs of one unit on one clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.clocks import best_clock, jitter
from gimbalcal.guess.column_names import FORCE, RATE, Guess
from gimbalcal.number import Array
from gimbalcal.units import from_si, to_si

Columns = tuple[dict[str, Array], dict[str, Guess]]
LOBES = 8  # of the interpolating sinc, on either side
FASTER, EVEN = 1.5, 0.1  # times the rate from which rows are averaged; and scatter of steps up to which rows are even


def one_each(columns: Mapping[str, Array], guesses: Mapping[str, Guess]) -> tuple[dict[str, Array], dict[str, Guess]]:
    """The first of columns that say the same; of clocks the best; one sigma for three."""
    out, kept = dict(columns), {}
    clock = best_clock(columns, guesses)
    sigmas = [n for n, g in guesses.items() if g.quantity == "sigma"]
    seen: set[tuple[str, str]] = set()
    for name, g in guesses.items():
        key = (g.quantity, "" if g.quantity in ("time", "sigma") else g.axis)
        if key in seen or (g.quantity == "time" and name != clock):
            continue
        seen.add(key)
        kept[name] = g
    if len(sigmas) > 1:
        del kept[next(n for n in sigmas if n in kept)]
        together = "sigma of the force"
        out[together] = np.sqrt(np.mean([columns[n] ** 2 for n in sigmas], axis=0))
        kept[together] = replace(guesses[sigmas[0]], why=f"the root of the mean square of {', '.join(sigmas)}")
    return out, kept


def on_one_clock(path: Path, first: Columns, other: Columns) -> Columns:
    """Both logs at the first one's times, where they overlap.

    Readings of a triad keep the noise that they have, see `resampled`; others lie on a line between their neighbours.
    """
    (columns, guesses), (more, theirs) = first, other
    clock, clock2 = (next(n for n, g in each.items() if g.quantity == "time") for each in (guesses, theirs))
    t = np.asarray(columns[clock])
    t2 = np.asarray(from_si(to_si(more[clock2], theirs[clock2].unit), guesses[clock].unit))
    inside = (t >= t2[0]) & (t <= t2[-1])
    if np.count_nonzero(inside) < 2:
        raise InputError(f"{path} and the first log do not overlap in time; give logs of one run, with one clock")
    known = {(g.quantity, g.axis) for g in guesses.values()}
    out, said = {n: x[inside] for n, x in columns.items()}, dict(guesses)
    for name in (n for n in more if n not in theirs and n not in out):  # what nobody knows yet: angles of a rig
        out[name] = np.interp(t[inside], t2, more[name])
    for name, g in theirs.items():
        if g.quantity != "time" and (g.quantity, g.axis) not in known:
            mine = name if name not in out else f"{path.stem}_{name}"
            triad = g.quantity in (FORCE, RATE)
            out[mine] = resampled(t[inside], t2, more[name]) if triad else np.interp(t[inside], t2, more[name])
            said[mine] = replace(g, why=f"{g.why}; {path.name}, at the times of the other log")
    return out, said


def slowest_first(logs: Sequence[tuple[Path, Columns]]) -> list[tuple[Path, Columns]]:
    """Logs in the order given, but before them the slowest of those with a triad: nothing has to be made up for it."""
    steps = []
    for i, (_, (columns, guesses)) in enumerate(logs):
        if any(g.quantity in (FORCE, RATE) for g in guesses.values()):
            clock = next(n for n, g in guesses.items() if g.quantity == "time")
            steps.append((float(to_si(np.median(np.diff(columns[clock])), guesses[clock].unit)), i))
    if len(steps) < 2 or max(steps)[0] < FASTER * steps[0][0]:
        return list(logs)
    slow = max(steps, key=lambda each: each[0])[1]
    return [logs[slow], *(log for i, log in enumerate(logs) if i != slow)]


def resampled(t: Array, t2: Array, x: Array) -> Array:
    """Readings x (m,) at t2 (m,) as they are at t (n,), with the noise density that they have.

    On a line between two neighbours white noise is up to sqrt(2) smaller than it is in a turn, and sigma with it. So
    rows of one rate are interpolated by a sinc under a Lanczos window, and those of a faster log are averaged over
    a step of the slower one about each of its times. Uneven rows lie on a line.
    """
    many = float(np.median(np.diff(t)) / np.median(np.diff(t2)))
    if many > FASTER:
        total = np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2 * np.diff(t2))])
        edges = np.clip(
            np.concatenate([[1.5 * t[0] - 0.5 * t[1]], (t[1:] + t[:-1]) / 2, [1.5 * t[-1] - 0.5 * t[-2]]]), *t2[[0, -1]]
        )
        width = np.diff(edges)
        mean = np.diff(np.interp(edges, t2, total)) / np.where(width > 0, width, 1.0)
        return np.asarray(np.where(width > 0, mean, np.interp(t, t2, x)))
    if jitter(t2) > EVEN or not np.all(np.isfinite(x)) or len(t2) < 2 * LOBES:
        return np.interp(t, t2, x)
    at = np.interp(t, t2, np.arange(len(t2), dtype=float))
    base = np.floor(at).astype(int)
    out, weight = np.zeros(len(t)), np.zeros(len(t))
    for k in range(1 - LOBES, LOBES + 1):
        off = at - (base + k)
        w = np.sinc(off) * np.sinc(off / LOBES)
        out += w * x[np.clip(base + k, 0, len(x) - 1)]
        weight += w
    return np.asarray(out / weight)
