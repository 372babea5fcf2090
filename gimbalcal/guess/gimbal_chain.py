r"""The platform to which a log's gimbal angles belong: the one on which gravity is where the accelerometers felt it.

At rest the force is :math:`f^p = -g \, C_b^p(\text{angles}) (0, 0, 1)`. Platforms that are known by name come first,
then the same with readouts that run backwards, then any chain of the logged axes; the first that agrees with nearly all
dwells is proposed. Turns about the vertical are not felt, and stay as the first that agrees has them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, pairwise, permutations, product
from math import pi

import numpy as np

from gimbalcal.checks.forces import as_predicted
from gimbalcal.checks.input_errors import MAX_DEVIATION_RAD, MIN_AGREEMENT, Correction, Trial, successful_trials
from gimbalcal.effects.effect import TRIAD
from gimbalcal.guess.column_names import ANGLES, plain_name, unit_written
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, Axis, Platform
from gimbalcal.recording.record import ANGLE, FORCE
from gimbalcal.units import to_si

MIN_DWELLS = 4  # that determine a platform
TABLES = ("rate-table", "two-axis-table", "three-axis-table", "space-stable")
MAX_AXES = 3  # of a chain that is looked for
MAX_COLUMNS = 6  # that may be its angles
AXIS_OF_LETTER = {"psi": "platform", "theta": "inner", "phi": "middle"}  # Table 1 of Wu et al. (2018)
ENCODER_BITS = range(12, 25)
QUARTER_TURNS = (0.0, pi / 2, pi, -pi / 2)
KNOWN_CHAIN = "these axes turn it"
CHAIN = "this chain turns it, found among all chains of its axes"


def usual_platform(names: frozenset[str]) -> Platform | None:
    """Return the known platform that has all these axes and the fewest others."""
    fitting = [KNOWN[name] for name in TABLES if names <= set(KNOWN[name].axis_names)]
    return min(fitting, key=lambda p: len(p.axes), default=None)


def gimbal_chain(angles: Mapping[str, Array], force: Array) -> Correction:
    """Return the platform of gimbal angles (m,) [rad] by name at m dwells, and force (m, 3) there in any unit.

    The correction also reverses readouts that run against the platform, and forces where the log holds gravity. Where
    no platform agrees it has none; its words say why.
    """
    m, names = len(force), tuple(angles)
    first = usual_platform(frozenset(names))
    if m < MIN_DWELLS and first is not None:
        return Correction(f"by the names of its axes; {m} rests do not show whether gravity agrees", platform=first)
    unit = force / np.linalg.norm(force, axis=1, keepdims=True)
    varied = np.linalg.norm(unit - unit[0], axis=1).max() > MAX_DEVIATION_RAD  # else z up may be taken for a reversal
    read = np.stack([angles[name] for name in names], axis=-1)

    def misfit(c: Correction) -> int:
        platform = c.platform or Platform("own", ())
        readouts = dict(zip(names, c.of(ANGLE, read).T, strict=True))
        return m - as_predicted(platform, platform.angles(readouts, (m,)), c.of(FORCE, force))

    sufficient = m - MIN_AGREEMENT * m
    best = next(
        iter(successful_trials(_candidates(names, first, varied), misfit, sufficient)), Trial(m, Correction(""))
    )
    if best.misfit <= sufficient:
        words = f"gravity at {m - int(best.misfit)} of {m} rests is where {best.candidate.words}"
        return replace(best.candidate, words=words)
    why = f"no chain of these axes turns gravity as it was felt (the best at {m - int(best.misfit)} of {m} rests)"
    return Correction(f"gimbal angles are left out: {why}")


def chain_among(
    columns: Mapping[str, Array], dwells: Sequence[slice], force: Array
) -> tuple[Correction, dict[str, tuple[str, str]]] | None:
    """Return the chain whose angles are among columns (n,) of unknown content, with axis and unit of each of these.

    They stand still in each dwell, and gravity goes as they say; axes are called by the `plain_name` of a column.
    None where no chain of them turns gravity as it was felt.
    """
    if len(force) < MIN_DWELLS:
        return None
    at_rest: dict[str, tuple[Array, str]] = {}
    for name, x in columns.items():
        low, median, high = np.array([np.quantile(x[s], [0.25, 0.5, 0.75]) for s in dwells]).T
        scatter = high - low  # of the inner rows: a second log may be late at both ends
        span = float(np.ptp(median))
        if not np.all(np.isfinite(median)) or not span > 0 or np.median(scatter) > 1e-3 * span:
            continue
        unit = unit_of_angle(x, name)
        at_rest[name] = np.asarray(to_si(median, unit)), unit
    letters = {plain_name(re.sub(r"[\[(/].*", "", n)): n for n in columns}
    if set(AXIS_OF_LETTER) <= set(letters):  # one that is never turned belongs to them too
        named = {axis: letters[letter] for letter, axis in AXIS_OF_LETTER.items()}
        unit = unit_of_angle(np.concatenate([columns[n] for n in named.values()]), next(iter(named.values())))
        angles_at_rest = {
            a: to_si(np.array([np.median(columns[n][s]) for s in dwells]), unit) for a, n in named.items()
        }
        chain = gimbal_chain(angles_at_rest, force)
        if chain.platform == KNOWN["space-stable"]:
            return chain, {n: (axis, unit) for axis, n in named.items()}
    names = list(at_rest)[:MAX_COLUMNS]
    axes = {n: _without_unit(plain_name(re.sub(r"[\[(/].*", "", n))) or f"axis{i + 1}" for i, n in enumerate(names)}
    if len(set(axes.values())) < len(axes):
        axes = {n: plain_name(n) or f"axis{i + 1}" for i, n in enumerate(names)}
    for count in range(1, MAX_AXES + 1):
        for group in combinations(names, count):
            chain = gimbal_chain({axes[n]: at_rest[n][0] for n in group}, force)
            if chain.platform is not None:
                return chain, {n: (axes[n], at_rest[n][1]) for n in group}
    return None


def encoder_angles(columns: Mapping[str, Array]) -> tuple[dict[str, Array], dict[str, int]]:
    """Return the columns with those of resolvers and encoders in degrees, unwrapped, and their counts of a turn.

    Such a column has whole numbers from 0 up to a power of two, of which more than half occurs; whether it is an angle
    of the rig, gravity decides.
    """
    out, counts = dict(columns), dict[str, int]()
    for name, x in columns.items():
        largest = float(np.max(x, initial=0.0))
        bits = int(np.ceil(np.log2(largest + 1))) if largest > 0 else 0
        if bits in ENCODER_BITS and np.min(x) >= 0 and np.all(x == np.round(x)):
            counts[name] = 2**bits
            out[name] = np.degrees(np.unwrap(2 * pi * x / counts[name]))
    return out, counts


def unit_of_angle(x: Array, name: str) -> str:
    """Return the unit of an angle (n,) as its name states it, else by its range."""
    written = unit_written(plain_name(name))
    return written if written in ANGLES else "deg" if float(np.ptp(x)) > 2 * pi else "rad"


def _without_unit(words: str) -> str:
    first, _, last = words.rpartition("_")
    return first if first and unit_written(last) else words


def _candidates(names: tuple[str, ...], first: Platform | None, varied: bool) -> Iterator[Correction]:
    """Yield platforms that are known by name, with readouts or all forces reversed, then chains of the axes.

    varied: the forces differ, so that a reversal of all three would show.
    """
    known = [KNOWN[name] for name in TABLES if set(names) <= set(KNOWN[name].axis_names)]
    known = sorted(known, key=lambda p: p is not first)
    for of_gravity, signs in product((False, True) if varied else (False,), _readout_signs(len(names))):
        backwards = [n for n, sign in zip(names, signs, strict=True) if sign < 0]
        words = f"{KNOWN_CHAIN}, the {' and the '.join(backwards)} readout backwards" if backwards else KNOWN_CHAIN
        words += ", all three accelerometers reversed (the log holds gravity)" * of_gravity
        matrices = {ANGLE: (names, np.diag(signs)), **({FORCE: (TRIAD, -np.eye(3))} if of_gravity else {})}
        yield from (Correction(words, matrices=matrices, platform=p) for p in known)
    several = len(names) == MAX_AXES
    offsets = [(0.0, pi) if several else QUARTER_TURNS] * len(names)
    for p in (
        chains((names, names[::-1]) if several else permutations(names), offsets) if len(names) <= MAX_AXES else ()
    ):
        yield Correction(CHAIN, platform=p)
        if len(names) == 1:  # what it stands on is fixed, and may be upright, lie, or be turned over
            bases = (Axis("base", direction, 1, z) for direction in "xy" for z in QUARTER_TURNS[1:])
            yield from (Correction(CHAIN, platform=Platform("own", (*p.axes, base))) for base in bases)


def _readout_signs(count: int) -> list[tuple[float, ...]]:
    """Return the signs of so many readouts, those with the fewest negative ones first."""
    return sorted(product((1.0, -1.0), repeat=count), key=lambda signs: sum(sign < 0 for sign in signs))


def chains(orders: Iterable[Sequence[str]], offsets: Sequence[Sequence[float]]) -> Iterator[Platform]:
    """Yield chains of axes in these orders, each about another direction than the next, upright ones first.

    offsets [rad]: those that are tried, for each place in the chain.
    """
    for order, directions in product(orders, product("zxy", repeat=len(offsets))):
        if any(a == b for a, b in pairwise(directions)):
            continue
        for signs, zeros in product(product((1, -1), repeat=len(offsets)), product(*offsets)):
            yield Platform("own", tuple(map(Axis, order, directions, signs, zeros)))
