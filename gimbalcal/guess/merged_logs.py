"""Several logs of one unit as one: sensors on a common clock, parts of a run one after the other.

Columns of one log that hold the same are reduced to one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.attitude import of_another_log
from gimbalcal.guess.clocks import best_clock, clock_jitter
from gimbalcal.guess.log import Guess, Log
from gimbalcal.number import Array
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import from_si

SINC_LOBES = 8  # of the interpolating kernel, on either side
SAME_TIME = 1e-6  # of a step
MIN_RATE_RATIO = 1.5  # of two logs, from which rows of the faster one are averaged
MAX_JITTER = 0.1  # of a step, up to which rows are evenly spaced
DWELL_ROWS = "the rows: the force turns from each to the next"  # why they are numbered as positions


def without_duplicates(log: Log) -> Log:
    """Return the log with the first column of each quantity and axis, the best clock, and one sigma for a triad."""
    kept: dict[str, Guess] = {}
    clock, known = best_clock(log), set[tuple[str, str]]()
    for name, g in log.guesses.items():
        key = (g.quantity, "" if g.quantity in ("time", "sigma") else g.axis)
        if key in known or (g.quantity == "time" and name != clock):
            continue
        known.add(key)
        kept[name] = g
    reduced, sigmas = Log(log.columns, kept), log.names("sigma")
    if len(sigmas) < 2:
        return reduced
    why = f"the root of the mean square of {', '.join(sigmas)}"
    mean = np.sqrt(np.mean([log.columns[n] ** 2 for n in sigmas], axis=0))
    common = "sigma of the force"
    return reduced.without("sigma").including({common: replace(log.guesses[sigmas[0]], why=why)}, {common: mean})


def on_one_clock(path: Path, first: Log, other: Log) -> Log:
    """Return both logs at the times of the first one, where they overlap; `path` names the other.

    Readings of a triad keep their noise, see `resampled_readings`; other columns are interpolated linearly.
    """
    t = first.columns[first.clock]
    t2 = np.asarray(from_si(other.seconds, first.guesses[first.clock].unit))
    inside = (t >= t2[0]) & (t <= t2[-1])
    if np.count_nonzero(inside) < 2:
        raise InputError(f"{path} and the first log do not overlap in time; give logs of one run, with one clock")
    t = t[inside]
    known = {(g.quantity, g.axis) for g in first.guesses.values()}
    merged = first.rows(inside)
    angles = {**other.unknown, **of_another_log(path, other)}
    merged = merged.including({}, {n: np.interp(t, t2, x) for n, x in angles.items() if n not in merged.columns})
    for name, g in other.guesses.items():
        if g.quantity != "time" and (g.quantity, g.axis) not in known:
            own = name if name not in merged.columns else f"{path.stem}_{name}"
            interpolated = resampled_readings if g.quantity in (FORCE, RATE) else np.interp
            why = f"{g.why}; {path.name}, at the times of the other log"
            merged = merged.including({own: replace(g, why=why)}, {own: interpolated(t, t2, other.columns[name])})
    return merged


def slowest_first(logs: Sequence[tuple[Path, Log]]) -> list[tuple[Path, Log]]:
    """Return the logs with the slowest of those that hold a triad in front: its readings need no interpolation."""
    steps = [(float(np.median(np.diff(log.seconds))), i) for i, (_, log) in enumerate(logs) if log.has(FORCE, RATE)]
    if len(steps) < 2 or max(steps)[0] < MIN_RATE_RATIO * steps[0][0]:
        return list(logs)
    slow = max(steps, key=lambda step: step[0])[1]
    return [logs[slow], *(log for i, log in enumerate(logs) if i != slow)]


def resampled_readings(t: Array, t2: Array, x: Array) -> Array:
    """Return readings x (m,) at t2 (m,) as they are at t (n,), with their noise density.

    Linear interpolation makes white noise up to sqrt(2) smaller, and sigma with it. So rows of one rate are
    interpolated by a sinc under a Lanczos window, and those of a faster log are averaged over a step of the slower
    one about each of its times. Uneven rows are interpolated linearly, and those at the same times are taken as they
    are.
    """
    ratio = float(np.median(np.diff(t)) / np.median(np.diff(t2)))
    if ratio > MIN_RATE_RATIO:
        total = np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2 * np.diff(t2))])
        edges = np.clip(
            np.concatenate([[1.5 * t[0] - 0.5 * t[1]], (t[1:] + t[:-1]) / 2, [1.5 * t[-1] - 0.5 * t[-2]]]), *t2[[0, -1]]
        )
        width = np.diff(edges)
        mean = np.diff(np.interp(edges, t2, total)) / np.where(width > 0, width, 1.0)
        return np.asarray(np.where(width > 0, mean, np.interp(t, t2, x)))
    at = np.interp(t, t2, np.arange(len(t2), dtype=float))
    row = np.rint(at).astype(int)
    if np.all(np.abs(at - row) < SAME_TIME):  # rows of one stamp are copied, so that counts stay whole
        return x[row]
    if clock_jitter(t2) > MAX_JITTER or not np.all(np.isfinite(x)) or len(t2) < 2 * SINC_LOBES:
        return np.interp(t, t2, x)
    base = np.floor(at).astype(int)
    out, weight = np.zeros(len(t)), np.zeros(len(t))
    for k in range(1 - SINC_LOBES, SINC_LOBES + 1):
        offset = at - (base + k)
        w = np.sinc(offset) * np.sinc(offset / SINC_LOBES)
        out += w * x[np.clip(base + k, 0, len(x) - 1)]
        weight += w
    return np.asarray(out / weight)


def are_parts(logs: Sequence[Log]) -> bool:
    """Return whether logs hold the same by the same names, so that each is a part and none is another sensor."""
    contents = [{name: (g.quantity, g.axis) for name, g in log.guesses.items()} for log in logs]
    alike = len(contents) > 1 and all(each == contents[0] for each in contents)
    return alike and any(quantity != "time" for quantity, _ in contents[0].values())


def concatenated_logs(logs: Mapping[Path, Log]) -> tuple[Log, str]:
    """Return parts of a run as one log, and a sentence on their order.

    Where clocks go on from part to part these stand in its order. Where each begins anew, as where rows are counted,
    parts stand in the order given, with as long a pause between two as the one before it lasted: nobody logged how the
    unit turned meanwhile, and drifts with time mean nothing. Raises InputError where clocks overlap and none begins
    near zero: then these are two units at once.
    """
    many, first = f"{len(logs)} logs of the same columns are parts of one run", next(iter(logs.values()))
    clock = first.clock
    spans = {p: (float(np.nanmin(l.columns[clock])), float(np.nanmax(l.columns[clock]))) for p, l in logs.items()}
    order = sorted(logs, key=lambda path: spans[path])
    neighbours = list(pairwise(order))
    if all(spans[b][0] > spans[a][1] for a, b in neighbours):
        return _stacked([logs[path] for path in order]), f"{many}, in the order of their clock"
    for a, b in neighbours:
        if spans[b][0] <= spans[a][1] and spans[a][0] > spans[a][1] - spans[a][0]:
            raise InputError(
                f"{a} and {b} hold the same columns at the same times, as two units do; give each its own "
                "recording, or --rate HZ where they are parts of one run whose clocks mean nothing"
            )
    end, parts = 0.0, []
    for path, log in logs.items():
        begin, last = spans[path]
        parts.append(log.including({}, {clock: log.columns[clock] - begin + end}))
        end += 2 * (last - begin)
    return _stacked(parts), (
        f"{many}, in the order given; each has its own clock, so the pauses between them are made up and "
        "rates of drift mean nothing"
    )


def _stacked(logs: Sequence[Log]) -> Log:
    common = [n for n in logs[0].columns if all(n in log.columns for log in logs)]
    columns = {n: np.concatenate([log.columns[n] for log in logs]) for n in common}
    counted = [n for n in logs[0].names("position") if logs[0].guesses[n].why == DWELL_ROWS]
    return replace(logs[0], columns=columns | {n: np.arange(1.0, len(columns[n]) + 1) for n in counted})
