r"""Which platform a log's gimbal angles belong to: the one on which gravity is where the accelerometers felt it.

At rest the force is :math:`f^p = -g \, C_b^p(\text{angles}) (0, 0, 1)`. Platforms that are known by name come first,
then the same with readouts that run backwards, then any chain of the logged axes; the first that agrees with nearly all
rests is proposed. Turns about the vertical are not felt, and stay as the first that agrees has them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise, permutations, product
from math import pi

import numpy as np

from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import KNOWN, Axis, Platform
from gimbalcal.recording.triads import CLOSE, NEARLY_ALL

FEWEST = 4  # rests that tell a platform
TABLES = ("rate-table", "two-axis-table", "three-axis-table", "space-stable")
MOST_AXES = 3  # of a chain that is looked for


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
    for sign in (1.0, -1.0):
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
