"""Constants far outside of what a unit can be: a question to who made the recording, with the likeliest slip tried.

An estimator takes any size as it comes, so a wrong unit, sign, latitude or clock leaves it as constants that no unit
has, with small sigmas. Each constant is held against the grade of the unit, `Grade.most`. Where one is beyond, the
slips that would make such a constant are undone one by one and the recording is calibrated again: those without which
every constant is usual are named. The result stands, and its outcome says so.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.checks.sidereal import latitude_seen
from gimbalcal.effects import CATALOGUE, Parameter
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.effects.grade import hurried
from gimbalcal.errors import InputError, alternatives
from gimbalcal.estimate.grade import Graded
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording
from gimbalcal.units import from_si, to_si

SURE = 3.0  # sigmas by which a constant has to be beyond
MOST_TRIED, TOLD = 6, 2
ALIKE = 0.2  # relative, of a scale factor and a ratio of units
SLOWER = 1e-3  # rad of latitude: less is no slip
SCALED = {"scale_factor": ("specific_force", "accelerometer"), "gyro_scale_factor": ("angular_rate", "gyroscope")}
UNITS = {"specific_force": ("m/s^2", "g", "mg", "ug"), "angular_rate": ("rad/s", "deg/s", "deg/h", "mdeg/s", "rad/h")}
CLOCKS = {60.0: "min", 3600.0: "h", 1e-3: "ms", 1e-6: "us"}  # seconds that one of the stated seconds really is
Again = Callable[[Sequence[Recording]], Calibration]
Limit = Callable[[Parameter], float]


@dataclass(frozen=True)
class Slip:
    """Something that may have gone wrong when the recording was described, and the recording without it."""

    words: str
    undone: Callable[[Recording], Recording]


def questioned(
    made: Calibration, recordings: Sequence[Recording], unit: Graded, again: Again, found: Container[str] = ()
) -> Calibration:
    """The calibration, whose outcome asks where a constant is none of a unit of this grade; `again` calibrates.

    found: effects that a diagnosis tells with their size and evidence, which are no question.
    """
    lasted = max(float(np.ptp(r.time)) for r in recordings)

    counted = made.readout.gyroscopes is not None  # where zero is and what a count is, and so of which grade, is open

    def limit(p: Parameter) -> float:
        open_size = p.effect in found or (counted and CATALOGUE[p.effect].stage in GYROSCOPE_STAGES)
        return np.inf if open_size else most(unit, lasted, p)

    beyond = far(made, limit)
    if not beyond:
        return made
    cause = likeliest(made, recordings, limit, again)
    question = in_words(made, beyond, limit, cause, f"{unit.grade.name} grade: {unit.source}")
    options = {**made.provenance.get("options", {}), "question": question}
    outcome = "; ".join(filter(None, [question, made.outcome]))
    return replace(made, outcome=outcome, provenance={**made.provenance, "options": options})


def most(unit: Graded, lasted: float, p: Parameter) -> float:
    """The size [SI] beyond which a constant is hardly one of this unit, recorded for so many seconds."""
    return hurried(CATALOGUE[p.effect], lasted) * unit.grade.most(p)


def far(made: Calibration, limit: Limit) -> tuple[int, ...]:
    """Which parameters are beyond what a unit of this grade has, the farthest first."""
    over = (np.abs(made.values) - SURE * made.sigmas) / np.array([limit(p) for p in made.parameters])
    return tuple(int(i) for i in np.argsort(-over) if over[i] > 1)


def in_words(made: Calibration, beyond: Sequence[int], limit: Limit, cause: str, grade: str) -> str:
    """What is far, what would be usual, and what would explain it."""
    told = []
    for i in beyond[:TOLD]:
        p = made.parameters[i]
        size, sigma, usual = (from_si(x, p.unit) for x in (made.values[i], made.sigmas[i], limit(p)))
        told.append(
            f"{p.name.replace('_', ' ')} {p.axis} is {size:.4g} +- {sigma:.2g} {p.unit}, usual is below {usual:.3g}"
        )
    rest = len(beyond) - TOLD
    others = "one more constant is" if rest == 1 else f"{rest} more constants are"
    more = f", and {others} as far off" if rest > 0 else ""
    end = cause or "is that so? No slip of unit, sign or place explains it; look at these sensors"
    return f"{', '.join(told)}{more} ({grade}): {end}"


def likeliest(made: Calibration, recordings: Sequence[Recording], limit: Limit, again: Again) -> str:
    """In words, the slips without which every constant is usual; empty for none."""
    found = []
    for slip in islice(slips(made, recordings, limit), MOST_TRIED):
        try:
            other = again([slip.undone(r) for r in recordings])
        except InputError:
            continue
        if not far(other, limit) and not (other.outcome and not made.outcome):
            found.append(slip.words)
    return f"every constant is usual if {alternatives(found)}; correct recording.toml" if found else ""


def slips(made: Calibration, recordings: Sequence[Recording], limit: Limit) -> Iterator[Slip]:
    """What may have gone wrong for these constants, the likeliest first."""
    yield from _place(recordings)
    for effect, (quantity, sensor) in SCALED.items():
        sizes = {p.axis: 1 + v for p, v in zip(made.parameters, made.values, strict=True) if p.effect == effect}
        wrong = [p.axis for p in (made.parameters[i] for i in far(made, limit)) if p.effect == effect]
        if not wrong:
            continue
        if quantity == "angular_rate" and len(wrong) == len(sizes):
            yield from _clock(sizes)
        yield from _sensors(sizes, wrong, quantity, sensor, recordings)


def _place(recordings: Sequence[Recording]) -> Iterator[Slip]:
    for r in recordings:
        if not r.kind.stabilised or r.platform != SPACE_STABLE_INERTIAL or r.site.latitude is None:
            continue
        if any(("specific_force", a) not in r.channels for a in "xyz"):
            continue
        seen = latitude_seen(r.triad("specific_force"))
        if abs(seen - r.site.latitude) > SLOWER:
            said, there = np.degrees([r.site.latitude, seen])
            yield Slip(f"the latitude is {there:.4g} deg, not {said:.4g} deg", partial(_moved, latitude=seen))


def _moved(r: Recording, latitude: float) -> Recording:
    return replace(r, site=replace(r.site, latitude=latitude))


def _clock(sizes: dict[str, float]) -> Iterator[Slip]:
    for factor, name in CLOCKS.items():
        if all(abs(size / factor - 1) < ALIKE for size in sizes.values()):
            yield Slip(f"the time is in {name}", partial(_timed, factor=factor))


def _timed(r: Recording, factor: float) -> Recording:
    return replace(r, time=factor * r.time)


def _sensors(
    sizes: dict[str, float], wrong: Sequence[str], quantity: str, sensor: str, recordings: Sequence[Recording]
) -> Iterator[Slip]:
    """Other units and signs of the sensors whose scale is wrong, all of them together."""
    which = f"the {sensor}{'s' if len(wrong) > 1 else ''} {' and '.join(wrong)}"
    is_are = "are" if len(wrong) > 1 else "is"
    stated = recordings[0].units.get((quantity, wrong[0]), UNITS[quantity][0])
    if all(sizes[a] < 0 for a in wrong):
        yield Slip(
            f"{which} {is_are} of the opposite sign", partial(_scaled, quantity=quantity, axes=wrong, factor=-1.0)
        )
    for name in UNITS[quantity] if stated in UNITS[quantity] else ():
        factor = float(to_si(1.0, name) / to_si(1.0, stated))
        if factor != 1.0 and all(abs(abs(sizes[a]) / factor - 1) < ALIKE for a in wrong):
            words = f"{which} {is_are} in {name}, not in {stated}"
            yield Slip(words, partial(_scaled, quantity=quantity, axes=wrong, factor=factor))


def _scaled(r: Recording, quantity: str, axes: Sequence[str], factor: float) -> Recording:
    own = {(quantity, a): factor * r.channels[quantity, a] for a in axes if (quantity, a) in r.channels}
    seen = {key: abs(factor) * r.scatter[key] for key in own if key in r.scatter}  # what rows show is as they are
    return replace(r, channels={**r.channels, **own}, scatter={**r.scatter, **seen})
