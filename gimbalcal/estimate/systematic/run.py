r"""Systematic calibration: 30, 51 or any other states, by navigation in place (Cai et al. 2016, Wei et al. 2022).

A unit that stays in its place and is turned there is a navigator whose true velocity is known: zero. What it computes
instead is a linear function of the attitude it started with and of its sensors' errors, and no angle of the table is
asked for. Filter and smoother (`smoothing`) run about a reference; the reference takes over what they found (the
feedback of Cai's Eq. (27)), until nothing moves by 3 % of its sigma.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.calibration import Residual
from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.estimate.added import Added
from gimbalcal.estimate.systematic.alignment import Alignment, align, attitudes
from gimbalcal.estimate.systematic.course import Course, course
from gimbalcal.estimate.systematic.evidence import doubtful, outcome, told
from gimbalcal.estimate.systematic.place import refuse_carried
from gimbalcal.estimate.systematic.sensors import truth
from gimbalcal.estimate.systematic.slips import likely, questions
from gimbalcal.estimate.systematic.smoothing import WIDE, Pass, one_pass, turned
from gimbalcal.estimate.systematic.states import states
from gimbalcal.estimate.systematic.turns import gains
from gimbalcal.inference.information import Information, Solution, solve
from gimbalcal.number import Array
from gimbalcal.recording import Recording

PASSES = 12
SETTLED = 0.03  # sigma
NEAR = 0.01  # of the step before: a step that shrank by so much shows how little the sensitivities still change
AWAY = 1e4  # times the catalogue's size, five times what a sensor reads: passes that come there do not come back


def systematic(
    recording: Recording, asked: str = "51", more: Sequence[Added] = (), tell: Callable[[str], None] = lambda _: None
) -> Calibration:
    """Calibrate both triads of a unit that was turned in its place, with these states (`states`).

    Raises InputError where the recording is none that a navigator can take: see `course` and `alignment`.
    """
    m = settle(recording, states(asked, recording, more), tuple(a.absent((), dict(a.stated)) for a in more), tell)
    found = calibrated(m)
    return replace(found, provenance={**found.provenance, "options": {"states": asked, **found.provenance["options"]}})


def calibrated(m: Settled) -> Calibration:
    """The calibration that passes ended in, with what the innovations say of it."""
    legs, wanted, theta, before = m.course, m.wanted, m.theta, m.before
    found = _solved(wanted, m.last, theta - before)
    navigation = told(legs, wanted, m.last, m.C, m.passes)
    words = outcome(navigation, 9 + len(wanted), m.settled, len(found.unobservable), lambda: likely(m))
    rms = {f"velocity {axis}": float(v) for axis, v in navigation.pop("velocity_rms").items()}
    return Calibration(
        method="systematic",
        effects=with_values(m.base, wanted, before + found.x),
        parameters=wanted,
        covariance=found.covariance,
        unobservable=tuple(each.to_dict() for each in found.unobservable),
        residual=Residual(navigation["nis"]["sum"], navigation["nis"]["dof"], rms, navigation),
        outcome=words,
        provenance={
            "options": {"velocity_m_per_s": legs.velocity, "stops": int(legs.stop.max()) + 1},
            "questions": questions(legs, wanted, before + found.x),
        },
    )


@dataclass(frozen=True, eq=False)
class Settled:
    """Where the passes ended: states with their values (p,), attitudes C (K + 1, 3, 3), what was there u (n, 6).

    base: effects that are there whatever the states say; before (p,): the states' values at the start; left_out (K,):
    updates that are not believed.
    """

    course: Course
    wanted: tuple[Parameter, ...]
    base: tuple[Effect, ...]
    start: Alignment
    before: Array
    theta: Array
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
    wanted = _biased(wanted, start)
    before = np.array([start.bias["xyz".index(p.axis)] if p.effect == "gyro_bias" else 0.0 for p in wanted])
    before = before + gained
    theta, settled, done, left_out = before, False, 0, np.zeros(len(legs.stop), dtype=bool)
    near, usual = None, np.inf
    while not settled and done < PASSES:
        effects = with_values(base, wanted, theta)
        u = truth(legs, effects, u)
        last = one_pass(legs, wanted, effects, u, C, start, before - theta, left_out, near)
        if not done:
            refuse_carried(legs, last.drift)
        if not np.all(np.abs(theta + last.step - before) < AWAY * np.array([p.sigma for p in wanted])):  # or no number
            break
        C = turned(C, last.smoothed[:, :3])
        theta, done = theta + last.step, done + 1
        moved = float(np.max(np.abs(last.step) / (_sigma(last) * np.array([p.sigma for p in wanted]))))
        tell(f"filter and smoother, pass {done}: the estimates moved by up to {moved:.2g} of their sigma")
        near, usual = last.about if done > 1 and moved < NEAR * usual else None, moved
        told_off, left_out = left_out, doubtful(last, left_out) if moved < 1.0 else left_out
        settled = moved < SETTLED and done > 1 and np.array_equal(told_off, left_out)
    return Settled(legs, wanted, base, start, before, theta, u, C, left_out, last, done, settled)


def _biased(wanted: Sequence[Parameter], start: Alignment) -> tuple[Parameter, ...]:
    """Parameters of a triad whose bias is far beyond the catalogue's scale (MEMS): its own size is the scale then."""
    size = float(np.abs(start.bias).max())
    return tuple(replace(p, sigma=max(p.sigma, size / 10)) if p.effect == "gyro_bias" else p for p in wanted)


def _sigma(last: Pass) -> Array:
    return np.asarray(np.linalg.norm(last.factor, axis=1))


def _solved(wanted: Sequence[Parameter], last: Pass, x: Array) -> Solution:
    """The estimate as the house tells it: what the data alone say, and the directions that they do not see.

    P = S S^T holds the prior of width `WIDE`, so S^-1 has the data's singular values s^2 - 1 / WIDE^2.
    """
    from scipy.linalg import solve_triangular

    scale = np.array([p.sigma for p in wanted])
    root = solve_triangular(last.factor, np.eye(len(wanted)), lower=True)
    _, s, Vt = np.linalg.svd(root)
    s = np.sqrt(np.maximum(s**2 - WIDE**-2, 0.0))
    rows = np.concatenate([s[:, None] * Vt, (s * (Vt @ (x / scale)))[:, None]], axis=1)
    return solve(Information(tuple(wanted), rows, len(wanted)))
