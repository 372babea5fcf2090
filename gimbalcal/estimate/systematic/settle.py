"""Passes of filter and smoother about a reference that takes over what they found, until nothing moves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.estimate.systematic.alignment import Alignment, align, attitudes
from gimbalcal.estimate.systematic.course import Course, course
from gimbalcal.estimate.systematic.error_model import turned
from gimbalcal.estimate.systematic.evidence import doubtful
from gimbalcal.estimate.systematic.place import refuse_carried
from gimbalcal.estimate.systematic.sensors import truth
from gimbalcal.estimate.systematic.smoothing import Pass, one_pass
from gimbalcal.estimate.systematic.turns import gains
from gimbalcal.number import Array
from gimbalcal.recording import Recording

PASSES = 12
SETTLED = 0.03  # sigma
NEAR = 0.01  # of the step before: a step that shrank by so much shows how little the sensitivities still change
UNUSUAL = 5.0  # sigma of a bias
AWAY = 1e4  # times the catalogue's size, five times what a sensor reads: passes that come there do not come back


@dataclass(frozen=True, eq=False)
class Settled:
    """Where the passes ended: states with their values (p,), attitudes C (K + 1, 3, 3), what was there u (n, 6).

    base: effects that are there whatever the states say; before (p,): the states' values at the start; said (p,): what
    the data alone say, whatever that is of what they do not see; left_out (K,): updates that are not believed.
    """

    course: Course
    wanted: tuple[Parameter, ...]
    base: tuple[Effect, ...]
    start: Alignment
    before: Array
    theta: Array
    said: Array
    u: Array
    C: Array
    left_out: NDArray[np.bool_]
    last: Pass
    passes: int
    settled: bool

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects with these values."""
        return with_values(self.base, self.wanted, self.theta)


def settle(
    recording: Recording, wanted: Sequence[Parameter], base: tuple[Effect, ...] = (),
    tell: Callable[[str], None] = lambda _: None,
) -> Settled:  # fmt: skip
    """Passes of filter and smoother until nothing moves. Raises InputError where a navigator cannot take it."""
    legs = course(recording)
    u = truth(legs, ())
    first = gains(legs, u)
    gained = np.array([first["xyz".index(p.axis)] if p.effect == "gyro_scale_factor" else 0.0 for p in wanted])
    if gained.any():
        u = truth(legs, with_values(base, wanted, gained), u)
    start = align(legs, u)
    C = attitudes(legs, u, start)
    wanted = _usual(wanted, legs, start)
    bias = np.array([start.bias["xyz".index(p.axis)] if p.effect == "gyro_bias" else 0.0 for p in wanted])
    # what no turn shows of a bias is nothing, not what the alignment made of it; one as large as this is not nothing
    large = np.any(np.abs(bias) > UNUSUAL * np.array([p.sigma for p in wanted]))
    before = bias + gained if large else gained
    theta = said = bias + gained
    settled, done, left_out = False, 0, np.zeros(len(legs.stop), dtype=bool)
    near, usual, last, went = None, np.inf, None, np.zeros(len(wanted))
    while not settled and done < PASSES:
        effects = with_values(base, wanted, theta)
        last = None  # of a day it is half a gigabyte
        u = truth(legs, effects, u)
        last = one_pass(legs, wanted, effects, u, C, start, before - theta, left_out, near)
        if not done:
            refuse_carried(legs, last.drift)
        if not np.all(np.abs(theta + last.held - before) < AWAY * np.array([p.sigma for p in wanted])):  # or no number
            break
        # about a bend of the model, as of a heading that one axis hardly tells, whole steps go to and fro
        part = 0.5 if done > 2 and float(last.held / last.sigma**2 @ went) < 0 else 1.0
        went = part * last.held
        C = turned(C, part * last.smoothed[:, :3])
        theta, said, done = theta + went, theta + last.step, done + 1
        moved = float(np.max(np.abs(last.held) / last.sigma))
        tell(f"filter and smoother, pass {done}: the estimates moved by up to {moved:.2g} of their sigma")
        near, usual = last.about if done > 1 and moved < NEAR * usual else None, moved
        told_off, left_out = left_out, doubtful(last, left_out) if moved < 1.0 else left_out
        settled = moved < SETTLED and done > 1 and np.array_equal(told_off, left_out)
    assert last is not None  # there is always a first pass
    return Settled(legs, wanted, base, start, before, theta, said, u, C, left_out, last, done, settled)


def _usual(wanted: Sequence[Parameter], course: Course, start: Alignment) -> tuple[Parameter, ...]:
    """Parameters as large as they usually are in a unit that scatters so; a bias is as large as it is."""
    grade, size = course.grade, float(np.abs(start.bias).max())
    sizes = [max(p.sigma, grade.usual(p).sigma, size / 10 * (p.effect == "gyro_bias")) for p in wanted]
    return tuple(replace(p, sigma=s) for p, s in zip(wanted, sizes, strict=True))
