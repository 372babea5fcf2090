r"""Sequential design of turns: which session of a unit that is turned in its place to record next.

The recordings so far are navigated (`estimate.systematic`), which gives their information about the states, F. A
candidate is a session of its own: a stop, one turn about an axis of the unit, and a stop, from each attitude in which
the axes of the unit point north, east and down. Its information is that of the error model of a planned calibration
(`turning`), at the noise, the rate and the stops of the recordings; the attitude at its start is not known. What
counts is as in `next_step`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from gimbalcal.design.next_step import Candidates, NextPlan, is_of_effects, plan_of, refuse_axes
from gimbalcal.design.turning import UNKNOWN_VELOCITY_M_S, TurningExperiment, TurningNoise, rotation_at_place
from gimbalcal.effects import Parameter
from gimbalcal.errors import InputError
from gimbalcal.estimate.extra_effects import extra_effects
from gimbalcal.estimate.systematic.filter_pass import data_information
from gimbalcal.estimate.systematic.iterate import SystematicFit, iterate
from gimbalcal.estimate.systematic.state_lists import states
from gimbalcal.number import Array
from gimbalcal.progress import Progress, no_progress
from gimbalcal.recording import Recording
from gimbalcal.recording.record import RATE
from gimbalcal.rotation import exponential
from gimbalcal.schedule import RotationSchedule
from gimbalcal.schedule.commands import DIRECTIONS
from gimbalcal.schedule.trajectory import Trajectory
from gimbalcal.views.segments import segment

TURNS_DEG = (90.0, -90.0, 180.0, 360.0)
RAMP_S = 1.0
MAX_STOP_S = 600.0
HORIZONTAL = ("north", "east")


def next_turn(
    recordings: Sequence[Recording], state_list: str = "51", more: Sequence[str] = (), separate: Sequence[str] = (),
    reach: RotationSchedule | None = None, most: int = 5, prior: Mapping[str, float] | None = None,
    progress: Progress = no_progress,
) -> NextPlan:  # fmt: skip
    """Return which turn to record next, of recordings of a unit that was turned in its place.

    state_list: `state_lists.states`; more: effects to estimate in addition; separate: effects, EFFECT[:AXIS], to be
    separated from each other; reach: a schedule of turns whose sigmas are to be reached, at the noise of the last
    recording; most: how many turns; prior: sigmas [SI] by label of a parameter, else those of the grade of the unit.
    Raises InputError for recordings that cannot be navigated, or whose estimates do not converge.
    """
    listed = {p.effect for p in states(state_list, recordings[0].why_not_shown)}
    wished = [*more, *(w for s in separate if (w := s.partition(":")[0]) not in {*listed, *more})]
    also = extra_effects(wished, recordings, tuple(listed))
    base = tuple(a.absent() for a in also)
    fits = [iterate(segment(r), states(state_list, r.why_not_shown, also), base, progress) for r in recordings]
    for m in fits:
        if not m.converged:
            raise InputError(
                f"{m.segments.rows.label}: the estimates do not settle, so its information is not known; see "
                "`gimbalcal calibrate --method systematic`"
            )
    wanted = tuple(replace(p, sigma=(prior or {}).get(p.label, p.sigma)) for p in fits[-1].wanted)
    refuse_axes(separate, wanted)
    F = np.eye(len(wanted))
    for m in fits:
        scale = [p.sigma for p in m.wanted]
        R = data_information(wanted, m.last.factor, np.zeros(len(wanted)), scale).rows[:, :-1]
        F += R.T @ R
    experiment, sessions = _experiment_at_the_place(fits[-1], wanted), _sessions(fits[-1])
    target = None if reach is None else experiment.sigma(reach) * np.array([p.sigma for p in wanted])
    interest = np.array([not separate or is_of_effects(p, separate) for p in wanted])
    candidates = _candidates(experiment, sessions)
    return plan_of(wanted, np.linalg.inv(F), candidates, interest, target, tuple(separate), most)


def _experiment_at_the_place(m: SystematicFit, wanted: tuple[Parameter, ...]) -> TurningExperiment:
    """Return the experiment at the place and with the noise of a recording."""
    segments = m.segments
    site, step = segments.rows.site, float(np.median(segments.dt / segments.rows.weight))
    force, rate = (float(segments.sigma[k : k + 3].max() * np.sqrt(step)) for k in (0, 3))
    there = rotation_at_place(segments.latitude, site.height)
    in_turns = UNKNOWN_VELOCITY_M_S if segments.handled else float(segments.velocity.max())
    noise = TurningNoise(force, rate, float(segments.velocity.min()), in_turns)
    return TurningExperiment(replace(there, site=site), wanted, noise)


Session = tuple[str, str, float, Trajectory]  # which axis is down and which is level, axis, angle [deg], the motion


def _sessions(m: SystematicFit) -> list[Session]:
    """Return the sessions to try, at the usual rate and stops of a recording."""
    segments = m.segments
    still = segments.stop >= 0
    stops = np.bincount(segments.stop[still], weights=np.diff(segments.time)[still])
    stop = float(min(np.median(stops), MAX_STOP_S))
    turning = np.repeat(~still, np.diff(segments.first))
    rate = np.linalg.norm(segments.rows.triad(RATE)[turning], axis=1)
    usual = float(np.median(rate[rate > rate.max() / 2])) if rate.size else np.radians(10.0)
    out = []
    for (down, sign), level in product(product("xyz", (1, -1)), HORIZONTAL):
        attitude, words = _attitude_of_vertical_axis(down, sign, level)
        for axis, angle in product("xyz", TURNS_DEG):
            out.append((words, axis, angle, _motion(attitude, axis, angle, usual, stop)))
    return out


def _attitude_of_vertical_axis(down: str, sign: int, level: str) -> tuple[Array, str]:
    """Return C_bn (3, 3) with an axis of the unit down (sign 1) or up, and the next one in a level direction."""
    names = "xyz"
    i = names.index(down)
    C = np.zeros((3, 3))
    C[:, i] = sign * np.array([0.0, 0.0, 1.0])
    C[:, (i + 1) % 3] = DIRECTIONS[level]
    C[:, (i + 2) % 3] = np.cross(C[:, i], C[:, (i + 1) % 3])
    return C, f"{down} {'down' if sign > 0 else 'up'}, {names[(i + 1) % 3]} {level}"


def _motion(attitude: Array, axis: str, angle_deg: float, rate: float, stop: float) -> Trajectory:
    """Return a stop, a turn about an axis of the unit, and a stop."""
    angle, n = np.radians(angle_deg), np.eye(3)["xyz".index(axis)]
    length = abs(angle) / rate + RAMP_S
    stands = np.stack([attitude, attitude @ exponential(-angle * n)])
    return Trajectory(
        n[None], np.array([angle]), np.array([stop]), np.array([length]), np.array([RAMP_S]), stands, 2 * stop + length
    )


def _candidates(experiment: TurningExperiment, sessions: Sequence[Session]) -> Candidates:
    """Return the sessions with their rows."""
    words, rows = [], []
    for start, axis, angle, motion in sessions:
        model = experiment.stretches(motion)
        moving = motion.moving(np.concatenate([[0.0], model.time[:-1]]), model.time)
        innovation_rows = model.innovations(experiment.noise, moving).rows.reshape(-1, len(experiment.wanted))
        rows.append(np.linalg.qr(innovation_rows, mode="r"))
        turn = f"turn {angle:+g}° about {axis}".replace("-", "−")
        words.append(f"{start}; {turn}, stops of {motion.begin[0]:.3g} s")
    most = max(map(len, rows))
    padded = np.array([np.pad(R, ((0, most - len(R)), (0, 0))) for R in rows])
    up = tuple(tuple((-motion.attitude[0][2]).tolist()) for *_, motion in sessions)
    angles = tuple({axis: angle} for _, axis, angle, _ in sessions)
    return Candidates(tuple(words), np.array([motion.duration for *_, motion in sessions]), padded, angles, up)
