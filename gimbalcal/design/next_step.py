r"""Sequential design: what to record next, so that the largest unknown shrinks most in the least time.

The dwells and static runs that exist give the information of their attitudes, noise and setting errors,
:math:`F = I + \sum A_i^T A_i` in units of the priors, and :math:`P = F^{-1}`; readings are not needed, so that the
design can be asked after the first dwell. A candidate with whitened rows A (a position of the rig, for a duration, at a
temperature; or some hours more of a static run) changes it by

.. math:: P - P A^T (I + A P A^T)^{-1} A P ,

and its gain is the decrease of :math:`\sum_p P_{pp} / s_p^2` per hour, turning and waiting included. s is the usual
size of a parameter, so that the least known one in terms of it dominates; or the sigma that is to be reached. Of
effects to separate only their own parameters count, all others being estimated too: their expected log Bayes factor
against each other, at usual size b, is :math:`\tfrac12 b^T (P_{ii}^{-1} - I) b`, as in `diagnose.verdict.separation`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.design.position_observability import STATIC_SENSORS, information_at_rest
from gimbalcal.design.rig_positions import rows_at_rest, stepped_rig
from gimbalcal.design.turning import cramer_rao_sigmas
from gimbalcal.display import Displayed, data_frame, panels
from gimbalcal.earth import HOUR
from gimbalcal.effects import CATALOGUE, Parameter, Stimulus, known_effect, parameters
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.effect import without_gauge
from gimbalcal.entries import Entry, Json, plain_json
from gimbalcal.errors import InputError, list_of_alternatives
from gimbalcal.estimate.grade import grade_of_unit
from gimbalcal.kinematics import sidereal_phase, stimulus_from_angles, stimulus_from_readings
from gimbalcal.navigate.stationary_base import ideal_static_run
from gimbalcal.number import Array
from gimbalcal.recording import SENSORS, Recording, dwell_means, with_rests_as_positions
from gimbalcal.recording.noise_levels import SETTING_SIGMA_RAD
from gimbalcal.recording.record import ANGLE, FORCE
from gimbalcal.schedule import Schedule
from gimbalcal.schedule.commands import Hold
from gimbalcal.units import from_si
from gimbalcal.views.norm import determined_terms, scaled_by_gravity
from gimbalcal.views.positions import planned_recording, position_parameters
from gimbalcal.words.rounding import duration_in_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DURATIONS = (1.0, 3.0)  # of the dwells so far
WARMER_K, WARMING_S = 6.0, 7200.0  # a bench without a chamber: two hours for 6 K
STATIC_HOURS = (6.0, 12.0, 24.0)
TURN_BY_HAND_S = 10.0
REACHED_RATIO = 1.01  # times a sigma that is asked for
SETTLED_NATS = 3.0  # nats: a factor 20
SAME_WORTH = 1e-6  # relative difference of what two candidates are worth
MIN_SHARE = 1e-4  # of the criterion; a candidate that brings less changes nothing
DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


@dataclass(frozen=True)
class NextStep(Entry):
    """A step states one thing to record, how long it takes, and what it changes.

    angles: of each axis [deg]; towards: of the vertical in the unit, a vector. parameter: the one that gains most, with
    its sigma now and after in `unit`. reduction: share by which the criterion decreases. separation: expected ln Bayes
    factor of the effects to separate, after.
    """

    words: str
    seconds: float
    parameter: str
    sigma_now: float
    sigma_after: float
    unit: str
    reduction: float
    angles: Mapping[str, float] = field(default_factory=dict)
    towards: tuple[float, ...] = ()
    separation: float | None = None


@dataclass(frozen=True, repr=False)
class NextPlan(Displayed):
    """The plan states what to record next, the best first, how well all is known now, and how far the goal is."""

    steps: tuple[NextStep, ...]
    parameters: tuple[Parameter, ...]
    sigma: Array  # (p,) SI, now
    target: Array | None = None  # (p,) SI, to be reached
    separate: tuple[str, ...] = ()
    separation: float | None = None  # ln Bayes factor that the recordings are expected to bring already

    @property
    def not_reached(self) -> tuple[Parameter, ...]:
        """Return the parameters whose sigma is not yet what is to be reached."""
        if self.target is None:
            return ()
        return tuple(
            p for p, s, t in zip(self.parameters, self.sigma, self.target, strict=True) if s > REACHED_RATIO * t
        )

    @property
    def reached(self) -> bool:
        """Return whether nothing remains to be done for the target, or for the separation."""
        if self.target is not None:
            return not self.not_reached
        return self.separation is not None and self.separation >= SETTLED_NATS

    def __str__(self) -> str:
        """Return the steps and the answer, as the console has them."""
        from gimbalcal.words.answers import next_answer
        from gimbalcal.words.tables import steps_table

        return f"{steps_table(self)}\n\n{next_answer(self)}" if self.steps else next_answer(self)

    def to_dict(self) -> Json:
        """Return the content of next.json."""
        from gimbalcal.words.answers import next_answer

        rows = [
            {"name": p.name, "axis": p.axis, "sigma": float(from_si(s, p.unit)), "unit": p.unit}
            | ({} if self.target is None else {"target": float(from_si(self.target[i], p.unit))})
            for i, (p, s) in enumerate(zip(self.parameters, self.sigma, strict=True))
        ]
        return {
            "format": 1, "in_words": next_answer(self), "reached": self.reached, "steps": plain_json(self.steps),
            "parameters": rows, "separate": list(self.separate), "separation": self.separation,
        }  # fmt: skip

    def to_frame(self, kind: str = "polars") -> Any:
        """Return a row for each step; "polars" or "pandas"."""
        names = ("words", "seconds", "parameter", "sigma_now", "sigma_after", "unit", "reduction")
        text = ("words", "parameter", "unit")
        return data_frame({n: [getattr(s, n) for s in self.steps] for n in names}, kind, text)

    def plot(self) -> Figure:
        """Return a matplotlib figure of the decrease per hour of each step."""
        figure, (ax,) = panels(["decrease of the criterion per hour"], width=8, height=0.6 + 0.25 * len(self.steps))
        ax.barh([s.words for s in self.steps], [s.reduction / s.seconds * HOUR for s in self.steps])
        ax.invert_yaxis()
        return figure


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidates are things to record: words, seconds with turn and wait (c,), rows (c, k, p), and their settings.

    angles: of the axes [deg]; towards: of the vertical in the unit; empty where there are none.
    """

    words: tuple[str, ...]
    seconds: Array
    rows: Array
    angles: tuple[Mapping[str, float], ...]
    towards: tuple[tuple[float, ...], ...]


def next_step(
    recordings: Sequence[Recording], more: Sequence[str] = (), separate: Sequence[str] = (),
    reach: Schedule | None = None, step: float = 45.0, most: int = 5, grade: str = "",
    prior: Mapping[str, float] | None = None,
) -> NextPlan:  # fmt: skip
    """Return what to record next, of dwells and static runs of a unit.

    more: effects to estimate with the baseline; separate: effects, EFFECT[:AXIS], to be separated from each other,
    which are then estimated too; reach: a schedule whose sigmas are to be reached, at the noise and duration of these
    dwells; step [deg] of the angles of a rig; most: how many steps; grade: of the unit, for the usual sizes, else that
    of its noise; prior: sigmas [SI] by label in place of usual sizes. Raises InputError for other kinds of recordings.
    """
    complete = [replace(with_rests_as_positions(r), other_sensors=()) for r in recordings]
    recordings = grade_of_unit(complete, grade).of(complete)
    dwelling = [r for r in recordings if r.kind.in_positions]
    at_rest = [r for r in recordings if r.kind.stabilised]
    if reach is not None and separate:
        raise InputError("--reach and --separate are two goals, and each orders the steps otherwise: give one of them")
    if len(dwelling) + len(at_rest) < len(recordings) or not dwelling:
        other = next((r for r in recordings if not (r.kind.in_positions or r.kind.stabilised)), recordings[0])
        raise InputError(
            f"{other.title!r} is a {other.kind} recording; `next` plans dwells in positions, with static runs in "
            "addition, or turns of a unit in its place: give multi-position recordings, or rotation recordings alone"
        )
    bench = _Bench.of(dwelling, at_rest, tuple(dict.fromkeys((*more, *(s.partition(":")[0] for s in separate)))))
    bench = replace(bench, wanted=tuple(replace(p, sigma=(prior or {}).get(p.label, p.sigma)) for p in bench.wanted))
    F = np.eye(len(bench.wanted)) + _squared(bench.recorded_rows)
    for run in at_rest:
        F += _squared(bench.rows_of_run(run))
    refuse_axes(separate, bench.wanted)
    interest = np.array([not separate or is_of_effects(p, separate) for p in bench.wanted])
    target = None if reach is None else bench.sigmas_of(reach)
    candidates = bench.candidates(dwelling[-1].time[-1], step)
    if at_rest:
        candidates = _join_candidates(candidates, bench.longer_runs(at_rest[-1]))
    return plan_of(bench.wanted, np.linalg.inv(F), candidates, interest, target, tuple(separate), most)


def plan_of(
    wanted: Sequence[Parameter], P: Array, candidates: Candidates, interest: Array, target: Array | None,
    separate: tuple[str, ...], most: int,
) -> NextPlan:  # fmt: skip
    """Return the plan from the covariance P (p, p) in units of the priors."""
    prior = np.array([p.sigma for p in wanted])
    scale = np.ones(len(wanted)) if target is None else target / prior
    now = np.diag(P)
    weight = interest / scale**2
    if target is not None:
        weight = weight * (now > (REACHED_RATIO * scale) ** 2)  # what is reached does not count
    less = variance_decreases(candidates.rows, P)
    worth = less @ weight
    total = float(now @ weight) or 1.0  # nothing counts any more
    rate = worth / candidates.seconds
    ranked = np.argsort(-np.round(rate / (rate.max() or 1.0), 6), kind="stable")  # not by rounding errors
    order = [i for i in ranked if worth[i] > MIN_SHARE * total]
    labels = tuple(f"{p.name} {p.axis}".strip() for p in wanted)
    steps: list[NextStep] = []
    for i in order:
        if any(abs(s.reduction * total - worth[i]) < SAME_WORTH * worth[i] for s in steps):
            continue  # another attitude of the same information
        k = int(np.argmax(less[i] * weight))
        sigma = [float(from_si(np.sqrt(v) * prior[k], wanted[k].unit)) for v in (now[k], now[k] - less[i, k])]
        after = None
        if separate:
            rows = candidates.rows[i]
            after = separation(np.linalg.inv(np.linalg.inv(P) + rows.T @ rows), wanted, separate)
        steps.append(NextStep(
            candidates.words[i], float(candidates.seconds[i]), labels[k], sigma[0], sigma[1], wanted[k].unit,
            float(worth[i] / total), candidates.angles[i], candidates.towards[i], after,
        ))  # fmt: skip
        if len(steps) == most:
            break
    known = separation(P, wanted, separate) if separate else None
    return NextPlan(tuple(steps), tuple(wanted), np.sqrt(now) * prior, target, separate, known)


def variance_decreases(rows: Array, P: Array) -> Array:
    """Return the decrease (c, p) of each variance by each candidate's rows (c, k, p)."""
    M = rows @ P
    S = np.eye(rows.shape[1]) + M @ np.swapaxes(rows, 1, 2)
    return np.asarray(np.einsum("ckp,ckp->cp", M, np.linalg.solve(S, M)))


def separation(P: Array, wanted: Sequence[Parameter], effects: Sequence[str]) -> float:
    """Return the least expected ln Bayes factor of the effects, EFFECT[:AXIS], at usual size, all others estimated."""
    own = np.flatnonzero([is_of_effects(p, effects) for p in wanted])
    return float(max(((1 / np.diag(P)[own] - 1) / 2).min(), 0.0))


def is_of_effects(p: Parameter, effects: Sequence[str]) -> bool:
    """Return whether a parameter is of one of these effects, EFFECT or EFFECT:AXIS."""
    return p.effect in effects or f"{p.effect}:{p.axis}" in effects


def _squared(rows: Array) -> Array:
    A = rows.reshape(-1, rows.shape[-1])
    return np.asarray(A.T @ A)


def _join_candidates(one: Candidates, other: Candidates) -> Candidates:
    """Return the candidates of both, rows filled up with zeros."""
    k = max(one.rows.shape[1], other.rows.shape[1])
    rows = [np.pad(c.rows, ((0, 0), (0, k - c.rows.shape[1]), (0, 0))) for c in (one, other)]
    return Candidates(
        (*one.words, *other.words), np.concatenate([one.seconds, other.seconds]), np.concatenate(rows),
        (*one.angles, *other.angles), (*one.towards, *other.towards),
    )  # fmt: skip


_Settings = tuple[Recording, list[str], tuple[Mapping[str, float], ...], tuple[tuple[float, ...], ...], Array]


@dataclass(frozen=True, eq=False)
class _Bench:
    """What plans need of a unit and its rig: parameters, usual dwells, and the means of the dwells that exist."""

    wanted: tuple[Parameter, ...]
    known: bool  # whether gimbals determine the attitude
    seconds: float  # of a dwell
    weight: float  # samples of a dwell
    means: tuple[Recording, ...]  # of each recording, in SI

    @property
    def like(self) -> Recording:
        """Return the means of the last recording, in whose noise and place more dwells are planned."""
        return self.means[-1]

    @classmethod
    def of(cls, recordings: Sequence[Recording], at_rest: Sequence[Recording], more: Sequence[str]) -> _Bench:
        """Return the bench of recordings in positions, and of static runs on the same platform.

        Raises InputError for recordings that do not go together, and for effects that dwells do not show.
        """
        last = recordings[-1]
        known = bool(last.platform.axes) and last.has(ANGLE)
        _refuse_other_platforms(recordings, at_rest)
        every = tuple(dwell_means(r) if known else scaled_by_gravity(dwell_means(r))[0] for r in recordings)
        means = every[-1]
        for added in map(known_effect, more):
            needs = [need for need in added.requires if need != "temperature" or not means.has("temperature")]
            if added.channel != "specific_force" or needs:
                need = f" and needs {list_of_alternatives(needs)}" if needs else ""
                raise InputError(f"{added.id} shows in {added.channel}{need}: dwells in positions do not show it")
        if known:
            wanted = position_parameters(last.platform, (*BASELINE["multi-position"], *more), last.grade)
        else:
            terms = (*determined_terms(means.triad(FORCE)), *more)
            wanted = without_gauge(
                [last.grade.usual(p) for t in dict.fromkeys(terms) for p in parameters(CATALOGUE[t])]
            )
        weight = float(np.median(means.weight))
        step = last.step if len(last.time) > len(means.time) else 0.0
        lasting = np.median(np.diff(means.time)) if len(means.time) > 1 else 600.0
        seconds = weight * step / float(np.median(last.weight)) if step else float(lasting)
        return cls(wanted, known, max(seconds, 1.0), weight, every)

    def rows(self, dwelling: Recording, like: Recording) -> Array:
        """Return the rows (n, 3, p) of dwells, one row each, whitened by the noise of a recording."""
        sample = like.sigma("accelerometer")
        if not sample:
            raise InputError(f"{like.title!r} states no noise of its accelerometers, and none shows; add it to [noise]")
        setting = like.sigma("gimbal_angle")
        setting = (SETTING_SIGMA_RAD if setting is None else setting) if self.known else np.inf
        s = self.stimulus(dwelling)
        return rows_at_rest(s, self.like.platform, self.wanted, sample, setting, dwelling.weight)

    @property
    def recorded_rows(self) -> Array:
        """Return the rows of the dwells that exist."""
        return np.concatenate([self.rows(m, m) for m in self.means])

    def stimulus(self, means: Recording) -> Stimulus:
        """Return what dwells feel: by their angles, or as they read, as long as gravity."""
        if self.known:
            return stimulus_from_angles(means)
        y = means.triad(FORCE)
        s = stimulus_from_readings(means)
        return s.at(force=means.site.gravity * y / np.linalg.norm(y, axis=1)[:, None], rate=np.zeros_like(y))

    def sigmas_of(self, schedule: Schedule) -> Array:
        """Return the sigmas (p,) of a published schedule in this noise, for dwells as long as these; SI."""
        plan = planned_recording(schedule, self.weight, self.like.site)
        if self.known and schedule.platform.axis_names != self.like.platform.axis_names:
            raise InputError(
                f"{schedule.name} is of the platform {schedule.platform.name} and these dwells are on "
                f"{self.like.platform.name}; give a schedule of the same axes"
            )
        if temperatures := self._temperature():
            plan = plan.with_channels({k: np.full(len(plan.time), v) for k, v in temperatures.items()})
        return cramer_rao_sigmas(self.rows(plan, self.like).reshape(-1, len(self.wanted))) * np.array(
            [p.sigma for p in self.wanted]
        )

    def rows_of_run(self, *parts: Recording) -> Array:
        """Return the rows (q, p) of a static run, in one part or several, about these parameters.

        Its own unknowns, base tilt and polar axis, are the same in all parts, and are eliminated.
        """
        run = parts[0]
        own = [p for i in BASELINE["static-run"] for p in parameters(CATALOGUE[i], run.platform.axis_names)]
        shared = {p.label: i for i, p in enumerate(self.wanted)}
        noise = {k: s for k in STATIC_SENSORS if run.has(SENSORS[k]) and (s := run.sigma(k))}
        if not noise:
            raise InputError(
                f"{run.title!r} states no noise of a sensor that it logs, and none shows; add it to [noise]"
            )
        each = [information_at_rest(part, own, noise) for part in parts]
        whole = each[0] if len(each) == 1 else each[0] + each[1]
        info = whole.without([p for p in own if p.label not in shared])
        at = [shared[p.label] for p in info.parameters]
        rows = np.zeros((len(info.rows), len(self.wanted)))
        prior = np.array([p.sigma for p in info.parameters])
        rows[:, at] = info.rows[:, :-1] / prior * np.array([self.wanted[i].sigma for i in at])
        return rows

    def longer_runs(self, run: Recording) -> Candidates:
        """Return some hours more of a static run: its unknowns and the phase of the platform go on."""
        latitude, sample = run.site.latitude, run.step / float(np.median(run.weight))
        assert latitude is not None  # a static run has one
        now, phase = _squared(self.rows_of_run(run)), sidereal_phase(run, run.angles())[-1]
        rows = []
        for hours in STATIC_HOURS:
            more = ideal_static_run(hours, latitude, sample)
            turned = {(ANGLE, "platform"): more.channels[ANGLE, "platform"] + phase}
            more = replace(more.with_channels(turned), time=more.time + run.time[-1])
            size, direction = np.linalg.eigh(_squared(self.rows_of_run(run, more)) - now)
            rows.append((direction * np.sqrt(np.clip(size, 0.0, None))).T)
        words = tuple(f"let the static run go on for {hours:g} h" for hours in STATIC_HOURS)
        none: tuple[Any, ...] = ((),) * len(words)
        return Candidates(words, HOUR * np.array(STATIC_HOURS), np.array(rows), ({},) * len(words), none)

    def candidates(self, end: float, step: float) -> Candidates:
        """Return the positions of the rig, or attitudes by hand, for each duration and temperature, after `end` [s]."""
        plan, words, angles, towards, turning = self._by_angles(step) if self.known else self._by_hand()
        out: Candidates | None = None
        needed = any("temperature" in CATALOGUE[p.effect].requires for p in self.wanted)
        changes = (0.0, WARMER_K) if needed and self._temperature() else (0.0,)
        for warmer, duration in product(changes, DURATIONS):
            felt = {key: np.full(len(plan.time), value + warmer) for key, value in self._temperature().items()}
            weight = np.full(len(plan.time), self.weight * duration)
            rows = self.rows(replace(plan.with_channels(felt), time=plan.time + end, weight=weight), self.like)
            waiting = WARMING_S if warmer else 0.0
            extra = f" for {duration_in_words(self.seconds * duration)}" + (f", {warmer:+g} K warmer" if warmer else "")
            each = Candidates(
                tuple(w + extra for w in words), turning + waiting + self.seconds * duration, rows, angles, towards
            )
            out = each if out is None else _join_candidates(out, each)
        assert out is not None
        return out

    def _temperature(self) -> dict[tuple[str, str], float]:
        """Return the last temperatures."""
        return {key: float(x[-1]) for key, x in self.like.channels.items() if key[0] == "temperature"}

    def _by_angles(self, step: float) -> _Settings:
        """Return the positions of the rig, one row each, words, angles, and the time of the turn there [s]."""
        platform = self.like.platform
        rig = stepped_rig(platform, step)
        angles = rig.candidates()
        schedule = Schedule("next", platform, tuple(Hold(tuple(map(float, a)), self.seconds) for a in angles))
        plan = planned_recording(schedule, site=self.like.site)
        far = np.abs(np.angle(np.exp(1j * (angles - self.like.angles()[-1])))).max(axis=1)
        named = [
            {n: round(float(np.rad2deg(x)), 6) + 0.0 for n, x in zip(platform.axis_names, a, strict=True)}
            for a in angles
        ]
        words = [", ".join(f"{n} {x:g}°" for n, x in each.items() if n in rig.grid) for each in named]
        return plan, words, tuple(named), ((),) * len(named), far / schedule.slew_rate

    def _by_hand(self) -> _Settings:
        """Return attitudes of a unit in the hand: faces, edges and corners up."""
        up = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1)[:, None]
        n = len(up)
        channels = {(FORCE, a): self.like.site.gravity * up[:, i] for i, a in enumerate("xyz")}
        time, position = 600.0 * np.arange(n), np.arange(1, n + 1)
        like = replace(self.like, duration=None, begin=None)  # a plan has no time of means
        plan = replace(like, time=time, position=position, channels=channels, weight=np.ones(n))
        axes = ([f"{'+' if x > 0 else '−'}{a}" for a, x in zip("xyz", d, strict=True) if x] for d in DIRECTIONS)
        words = [" and ".join(each) + " up" for each in axes]
        return plan, words, ({},) * n, tuple(tuple(map(float, d)) for d in up), np.full(n, TURN_BY_HAND_S)


def _refuse_other_platforms(recordings: Sequence[Recording], at_rest: Sequence[Recording]) -> None:
    """Raise InputError for recordings on different platforms, and where angles are known of some of them only."""
    last = recordings[-1]
    chain = [(a.name, a.direction) for a in last.platform.axes]  # a static run may count its angles in another sense
    other = [r for r in recordings if r.platform != last.platform]
    other += [r for r in at_rest if [(a.name, a.direction) for a in r.platform.axes] != chain]
    if other:
        raise InputError(f"{other[0].title!r} and {last.title!r} are on different platforms; give those of one")
    without = next((r for r in recordings if not r.has(ANGLE)), None)
    others = [*at_rest, *(r for r in recordings if r.has(ANGLE))]
    if without is not None and others:
        raise InputError(
            f"{without.title!r} has no gimbal angles, so that {others[0].title!r} cannot be combined with it; leave "
            "one of them out"
        )


def refuse_axes(separate: Sequence[str], wanted: Sequence[Parameter]) -> None:
    """Raise InputError for effects to separate of which no parameter is estimated, as of an axis that they lack."""
    for name in separate:
        if not any(is_of_effects(p, [name]) for p in wanted):
            effect = name.partition(":")[0]
            axes = list_of_alternatives([f"{effect}:{p.axis}" for p in wanted if p.effect == effect and p.axis])
            raise InputError(f"--separate {name}: no such axis is estimated; write {axes or effect}")
