"""A schedule of turns made to measure: the search, what it found, and how it compares with published ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gimbalcal.design.turning import Noise, plan, stretches
from gimbalcal.design.turning_search import Search, Table, allowed, anneal, as_tour, stretched
from gimbalcal.effects import Parameter
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.systematic.state_lists import states
from gimbalcal.number import Array
from gimbalcal.schedule import ROTATIONS, RotationSchedule
from gimbalcal.schedule.file import read_rotation
from gimbalcal.schedule.trajectory import trajectory
from gimbalcal.units import from_si, to_si


def table_of(step: float, limit: float, rate: float, ramp: float, total: float) -> Table:
    """A two-axis table from step, limit [deg], rate [deg/s], ramp and total [s]. Raises InputError where it is none."""
    if not np.isclose(90 / step, round(90 / step)) or step > 90:
        raise InputError(f"--step {step:g} deg must divide 90 deg, so that each axis of the unit can point up and down")
    if limit < 180:
        raise InputError(
            f"--limit {limit:g} deg: with less than half a turn either way not every axis comes to point up"
        )
    return Table(np.deg2rad(step), np.deg2rad(limit), np.deg2rad(rate), ramp, total)


def design_turning(
    table: Table,
    latitude: float,
    asked: str = "51",
    against: Sequence[str] = (),
    criterion: str = "max",
    noise: tuple[float, float, float] = (0.002, 5.0, 1e-5),
    tries: int = 4000,
    seed: int = 1,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[RotationSchedule, dict[str, Any]]:
    """The schedule of turns that sees most of the states `asked` at `latitude` [deg], and how it compares.

    against: schedules that it is measured by, in as much time, each with its own rate and with the table's, the better
    of the two; none: the usual size of each error. noise: deg/sqrt(h), ug/sqrt(Hz), m/s.
    """
    if not abs(latitude) < 90:
        raise InputError(f"--latitude must be between -90 and 90 deg, got {latitude:g}")
    white = Noise(to_si(noise[1], "ug/sqrt(Hz)"), to_si(noise[0], "deg/sqrt(h)"), noise[2])
    like = plan(np.deg2rad(latitude))
    wanted = states(asked, like)
    search = Search(table, like, wanted, white)
    others = {name: _best_of(search, read_rotation(name)) for name in against}
    reference = (
        np.min([_largest(search, s) for s in others.values()], axis=0) if others else np.ones(len(search.groups))
    )
    known = [as_tour(schedule, table) for schedule in (*ROTATIONS.values(), *map(read_rotation, against))]
    first = [tour for tour in known if tour is not None and allowed(table, tour) and search.stop(tour) > 0]
    if not first:
        raise InputError(f"--total {table.total:g} s is too short for a schedule of turns at this rate; give it more")
    tour, _ = anneal(search, first, reference, criterion, tries, seed, tell)
    made = search.schedule(tour)
    sigma = exact(search, made)
    return made, _compared(search, made, sigma, others, reference)


def exact(search: Search, schedule: RotationSchedule) -> Array:
    """Cramer-Rao sigmas (p,) in prior sigmas of a schedule, the velocity known every second."""
    found = stretches(trajectory(schedule), search.like, search.wanted, search.noise).innovations(search.noise)
    rows = found.rows.reshape(-1, len(search.wanted))
    return np.sqrt(np.diag(np.linalg.inv(np.eye(len(search.wanted)) + rows.T @ rows)))


def _best_of(search: Search, schedule: RotationSchedule) -> Array:
    """Sigmas of a schedule in the whole of the time: with its own rate, or with the table's where that is better."""
    both = [exact(search, stretched(schedule, search.table.total, table)) for table in (None, search.table)]
    return np.minimum(*both)


def _largest(search: Search, sigma: Array) -> Array:
    return np.array([sigma[i].max() for i in search.groups.values()])


def _compared(
    search: Search, made: RotationSchedule, sigma: Array, others: dict[str, Array], reference: Array
) -> dict[str, Any]:
    rows: list[dict[str, Any]] = []
    for (name, members), mine, ref in zip(search.groups.items(), _largest(search, sigma), reference, strict=True):
        p: Parameter = search.wanted[members[0]]
        unit = float(from_si(p.sigma, p.unit))
        theirs = {other: float(s[members].max() * unit) for other, s in others.items()}
        rows.append({
            "group": name, "sigma": float(mine * unit), "unit": p.unit, "against": theirs, "ratio": float(mine / ref),
        })  # fmt: skip
    worst = max(rows, key=lambda r: float(r["ratio"]))
    words = [
        f"{amount(len(made.moves), 'turn')} with stops of {made.stop:.1f} s take {trajectory(made).duration:.0f} s"
    ]
    for r in rows:
        beside = ", ".join(f"{other} {value:.3g}" for other, value in r["against"].items())
        words.append(f"{r['group']}: {r['sigma']:.3g} {r['unit']}{f' ({beside})' if beside else ''}")
    if others:
        verdict = "better in every group" if worst["ratio"] < 1 else f"not better in {worst['group']}"
        words.append(f"{verdict} than {' and '.join(others)} in as much time: {worst['ratio']:.3f} of theirs at worst")
    return {
        "format": 1,
        "schedule": made.name,
        "turns": len(made.moves),
        "stop_s": made.stop,
        "total_s": trajectory(made).duration,
        "groups": rows,
        "in_words": "\n".join(words),
    }
