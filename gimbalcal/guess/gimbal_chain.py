r"""Which platform a log's gimbal angles belong to: the one on which gravity is where the accelerometers felt it.

At rest the force is :math:`f^p = -g \, C_b^p(\text{angles}) (0, 0, 1)`. Platforms that are known by name come first,
then the same with readouts that run backwards, then any chain of the logged axes; the first that agrees with nearly all
rests is proposed. Turns about the vertical are not felt, and stay as the first that agrees has them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise, permutations, product
from math import pi

import numpy as np

from gimbalcal.checks.axes import CLOSE, NEARLY_ALL
from gimbalcal.guess.column_names import ANGLES, plain, unit_written
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import KNOWN, Axis, Platform
from gimbalcal.units import to_si

FEWEST = 4  # rests that tell a platform
TABLES = ("rate-table", "two-axis-table", "three-axis-table", "space-stable")
MOST_AXES = 3  # of a chain that is looked for
LETTERS = {"psi": "platform", "theta": "inner", "phi": "middle"}  # Table 1 of Wu et al. (2018)
BITS = range(12, 25)  # of resolvers and encoders
MOST_COLUMNS = 6  # that may be its angles


@dataclass(frozen=True)
class Rig:
    """A platform, the readouts that run against it, and why it is proposed; no platform where none agrees."""

    platform: Platform | None
    backwards: tuple[str, ...]
    why: str
    reversed: bool = False  # whether the forces are: the log holds gravity


def usual(names: frozenset[str]) -> Platform | None:
    """The known platform that has all these axes and the fewest others."""
    fitting = [KNOWN[name] for name in TABLES if names <= set(KNOWN[name].axis_names)]
    return min(fitting, key=lambda p: len(p.axes), default=None)


def rig_of(angles: Mapping[str, Array], force: Array) -> Rig:
    """The platform of gimbal angles (m,) [rad] by name at m rests, and force (m, 3) there in any unit."""
    m = len(force)
    first = usual(frozenset(angles))
    if m < FEWEST and first is not None:
        return Rig(first, (), f"by the names of its axes; {m} rests do not tell whether gravity agrees")
    best, told = 0, ""
    unit = force / np.linalg.norm(force, axis=1, keepdims=True)
    for sign in (1.0, -1.0) if np.linalg.norm(unit - unit[0], axis=1).max() > CLOSE else (1.0,):  # z up is no reversal
        for platform, backwards in _known(tuple(angles), first):
            agreeing = _agreeing(platform, backwards, angles, sign * force)
            best = max(best, agreeing if sign > 0 else 0)
            if agreeing >= NEARLY_ALL * m:
                told = f", the {' and the '.join(backwards)} readout backwards" if backwards else ""
                told += "" if sign > 0 else ", all three accelerometers reversed (the log holds gravity)"
                why = f"gravity at {agreeing} of {m} rests is where these axes turn it{told}"
                return Rig(platform, backwards, why, sign < 0)
    for platform in _chains(tuple(angles)):
        agreeing = _agreeing(platform, (), angles, force)
        best = max(best, agreeing)
        if agreeing >= NEARLY_ALL * m:
            why = f"gravity at {agreeing} of {m} rests is where this chain turns it, found among all chains of its axes"
            return Rig(platform, (), why)
    why = f"no chain of these axes turns gravity as it was felt (the best at {best} of {m} rests)"
    return Rig(None, (), f"gimbal angles are left out: {why}")


def rig_among(columns: Mapping[str, Array], rests: Sequence[slice], force: Array
              ) -> tuple[Rig, dict[str, tuple[str, str]]] | None:  # fmt: skip
    """The rig whose angles are among columns (n,) that nobody named so: still at rests, and gravity goes as they say.

    Returns it with axis and unit of each of its columns; axes are called as `plain` has the columns' names. None where
    no chain of them turns gravity as it was felt.
    """
    at_rest: dict[str, tuple[Array, str]] = {}
    for name, x in columns.items():
        still = np.array([np.std(x[s]) for s in rests])
        mean = np.array([np.mean(x[s]) for s in rests])
        moved = float(np.ptp(mean))
        if not np.all(np.isfinite(mean)) or not moved > 0 or np.median(still) > 1e-3 * moved:
            continue
        unit = _unit(x, name)
        at_rest[name] = np.asarray(to_si(mean, unit)), unit
    letters = {plain(re.sub(r"[\[(/].*", "", n)): n for n in columns}
    if set(LETTERS) <= set(letters):  # one that is never turned belongs to them too
        three = {LETTERS[word]: letters[word] for word in LETTERS}
        whole = _unit(np.concatenate([columns[n] for n in three.values()]), next(iter(three.values())))
        level = {a: np.array([np.mean(columns[n][s]) for s in rests]) for a, n in three.items()}
        found = rig_of({a: np.asarray(to_si(x, whole)) for a, x in level.items()}, force)
        if found.platform == KNOWN["space-stable"] and len(force) >= FEWEST:
            return found, {n: (axis, whole) for axis, n in three.items()}
    names = list(at_rest)[:MOST_COLUMNS]
    called = {n: _without_unit(plain(re.sub(r"[\[(/].*", "", n))) or f"axis{i + 1}" for i, n in enumerate(names)}
    if len(set(called.values())) < len(called):
        called = {n: plain(n) or f"axis{i + 1}" for i, n in enumerate(names)}
    for several in range(1, MOST_AXES + 1):
        for group in combinations(names, several):
            found = rig_of({called[n]: at_rest[n][0] for n in group}, force)
            if found.platform is not None and len(force) >= FEWEST:
                return found, {n: (called[n], at_rest[n][1]) for n in group}
    return None


def turned_counts(columns: Mapping[str, Array]) -> tuple[dict[str, Array], dict[str, int]]:
    """Columns of resolvers and encoders in degrees, without a jump at the full turn, and the counts of a turn.

    Such a column has whole numbers from 0 up to a power of two, of which more than half is seen; whether it is an angle
    of the rig, gravity tells.
    """
    out, counts = dict(columns), dict[str, int]()
    for name, x in columns.items():
        most = float(np.max(x, initial=0.0))
        bits = int(np.ceil(np.log2(most + 1))) if most > 0 else 0
        if bits in BITS and np.min(x) >= 0 and np.all(x == np.round(x)):
            counts[name] = 2**bits
            out[name] = np.degrees(np.unwrap(2 * pi * x / counts[name]))
    return out, counts


def _unit(x: Array, name: str) -> str:
    """The unit of an angle as its name tells it, else by how far it goes."""
    written = unit_written(plain(name))
    return written if written in ANGLES else "deg" if float(np.ptp(x)) > 2 * pi else "rad"


def _without_unit(words: str) -> str:
    first, _, last = words.rpartition("_")
    return first if first and unit_written(last) else words


def _known(names: tuple[str, ...], first: Platform | None) -> Iterator[tuple[Platform, tuple[str, ...]]]:
    """Platforms that are known by name, and readouts that run backwards, the likeliest first."""
    known = [KNOWN[name] for name in TABLES if set(names) <= set(KNOWN[name].axis_names)]
    known = sorted(known, key=lambda p: p is not first)
    flips = [tuple(n for n, f in zip(names, each, strict=True) if f) for each in product((0, 1), repeat=len(names))]
    for backwards in sorted(flips, key=len):
        yield from ((p, backwards) for p in known)


def _chains(names: tuple[str, ...]) -> Iterator[Platform]:
    """Any chain of a few axes, each about another direction than the next."""
    if len(names) > MOST_AXES:
        return
    offsets = (0.0, pi / 2, pi, -pi / 2) if len(names) < MOST_AXES else (0.0, pi)
    orders = permutations(names) if len(names) < MOST_AXES else (names, names[::-1])
    for order, directions in product(orders, product("zxy", repeat=len(names))):
        if any(a == b for a, b in pairwise(directions)):
            continue
        for signs, zeros in product(product((1, -1), repeat=len(names)), product(offsets, repeat=len(names))):
            axes = tuple(Axis(n, d, s, z) for n, d, s, z in zip(order, directions, signs, zeros, strict=True))
            yield Platform("own", axes)
            if len(axes) == 1:  # what it stands on is fixed, and may be upright, lie, or be turned over
                yield from (Platform("own", (*axes, Axis("base", t, 1, z))) for t in "xy" for z in offsets[1:])


def _agreeing(platform: Platform, backwards: tuple[str, ...], angles: Mapping[str, Array], force: Array) -> int:
    """At how many rests the force points where the platform would have it."""
    read = {name: -x if name in backwards else x for name, x in angles.items()}
    ideal = -apply_matrix(platform.attitude(platform.angles(read, (len(force),))), np.array([0.0, 0.0, 1.0]))
    cosine = np.sum(force * ideal, axis=1) / np.linalg.norm(force, axis=1)
    return int(np.count_nonzero(cosine > np.cos(CLOSE)))
