"""Run a scenario: truth through the forward model, plus noise, in blocks of rows so that a long run fits in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.earth import EARTH_RATE, G0, normal_gravity, radii
from gimbalcal.effects import Effect, Stimulus
from gimbalcal.effects.process import Quantisation
from gimbalcal.errors import InputError
from gimbalcal.forward import angular_rate, predict
from gimbalcal.forward.angles import ideal_angles
from gimbalcal.inference.noise_processes import one_sigma
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import Array
from gimbalcal.platform import BENCH, Platform
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.record import Key
from gimbalcal.schedule.drive import Drive
from gimbalcal.schedule.trajectory import Motion
from gimbalcal.simulate.scenario import QuantityHistory, Scenario, check_content, load
from gimbalcal.simulate.sensor_noise import coloured_noise, noise_processes, of_rates, stated_noise
from gimbalcal.simulate.timetable import Timetable, planned_schedule, platform_of, row_times, timetable, turned_times
from gimbalcal.simulate.truth import check_shown, true_effects
from gimbalcal.simulate.turned import nodes, quivering_force, stimulus, true_trajectory

BLOCK_ROWS = (
    1 << 17
)  # rows made at once: some 100 MB of work space; fixed, so that a seed means the same rows everywhere
HISTORY_STEP_S = 60.0  # s between the earlier rows that effects with a memory are given; the lag and integral are exact
KNOT_STEP_S = 60.0  # s between the knots of a random temperature
ATTITUDE = ("roll", "pitch", "yaw")
PLACE = ("latitude", "longitude", "height")


@dataclass(frozen=True)
class Run:
    """A scenario made ready: drawn truth, row times, and the random streams of each kind of noise."""

    scenario: Scenario
    platform: Platform
    site: Site
    effects: tuple[Effect, ...]
    table: Timetable | None
    time: Array
    setting: Array
    environment: dict[Key, Callable[[Array], Array]]
    read: tuple[str, ...]
    seed: int
    path: Motion | None = None  # of a unit that a schedule turns


def prepare(scenario: Scenario, seed: int | None = None) -> Run:
    """Draw the truth and lay out the rows; `seed` instead of the scenario's own."""
    seed = scenario.seed if seed is None else seed
    truth_rng, setting_rng, weather_rng = np.random.default_rng([seed, 0]).spawn(3)
    site, turns = _site(scenario), scenario.schedule.turns
    platform = BENCH if turns else platform_of(scenario)
    sigma = one_sigma(noise_processes(scenario)["gimbal_angle"])
    table = path = None
    read: tuple[str, ...] = ()
    if turns:
        path = true_trajectory(scenario.schedule, sigma, setting_rng, site)
    elif not scenario.recording_kind.stabilised:
        table = timetable(planned_schedule(scenario), scenario.schedule, scenario.faults, scenario.ramp)
        read = tuple(
            name for name, column in zip(platform.axis_names, table.commanded.T, strict=True) if np.any(column)
        )
    else:
        read = tuple(name for name in platform.axis_names if name != "inner")  # redundant, held at zero
    effects = true_effects(scenario.truth, scenario.kind, platform.axis_names, read, truth_rng)
    visits = (0 if table is None else len(table.start), len(platform.axes))
    setting = sigma * setting_rng.standard_normal(visits)
    time = row_times(scenario, table) if path is None else turned_times(scenario, path)
    around = {("covariate", name): history for name, history in scenario.environment.covariates.items()}
    if scenario.environment.temperature is not None:
        around["temperature", ""] = scenario.environment.temperature
    environment = {key: sample_path(history, float(time[-1]), weather_rng) for key, history in around.items()}
    check_shown(effects, scenario, environment)
    return Run(scenario, platform, site, effects, table, time, setting, environment, read, seed, path)


def simulate(
    scenario: Scenario | Mapping[str, Any] | str | Path, seed: int | None = None
) -> tuple[Recording, tuple[Effect, ...]]:
    """Return a recording from truth, and that truth, from a scenario, its content, its file or its name in the package.

    Raises InputError, naming the field, where the scenario cannot be run.
    """
    if isinstance(scenario, Mapping):
        scenario = check_content(dict(scenario))
    run = prepare(scenario if isinstance(scenario, Scenario) else load(scenario), seed)
    return join_blocks(blocks(run)), run.effects


def join_blocks(parts: Iterable[Recording]) -> Recording:
    """Return the blocks of rows as one recording."""
    parts = list(parts)
    channels = {key: np.concatenate([p.channels[key] for p in parts]) for key in parts[0].channels}
    positions = [p.position for p in parts if p.position is not None]
    position = np.concatenate(positions) if positions else None
    time = np.concatenate([p.time for p in parts])
    return replace(parts[0], time=time, position=position, channels=channels, weight=np.ones(len(time)))


def blocks(run: Run) -> Iterator[Recording]:
    """Return the rows of a run, block by block."""
    rng, place = np.random.default_rng([run.seed, 1]), np.random.default_rng([run.seed, 2])
    states: dict[tuple[str, str], Array] = {}
    for start in range(0, len(run.time), BLOCK_ROWS):
        yield _block(run, start, min(start + BLOCK_ROWS, len(run.time)), rng, place, states)


def _block(
    run: Run,
    start: int,
    stop: int,
    rng: np.random.Generator,
    place: np.random.Generator,
    states: dict[tuple[str, str], Array],
) -> Recording:
    past, time = _past_rows(run, start), run.time[start:stop]
    nominal = _nominal_motion(run, np.concatenate([run.time[past], time]))
    if run.path is None:
        s = _as_it_was(run, nominal)
        out = {k: v[past.size :] for k, v in predict(run.platform, s, run.effects, run.scenario.kind).items()}
    else:
        out = _readings_of_turned_unit(run, run.path, time, run.time[past])
        still = run.scenario.noise.velocity
        out["specific_force"] += quivering_force(run.path, time, 1 / run.scenario.schedule.rate, still, place, states)
    noise = noise_processes(run.scenario)
    channels: dict[Key, Array] = {}
    for i, axis in enumerate("xyz"):
        y = out["specific_force"][:, i] + coloured_noise(noise["specific_force"], axis, time, rng, states)
        q = run.scenario.faults.quantisation
        channels["specific_force", axis] = Quantisation(q).rounded(y) if q else y
    channels |= _angles(run, out, time, rng)
    if run.scenario.turning:
        noisy = out["angular_rate"] + of_rates(noise["angular_rate"], time, rng, states)
        channels |= {("angular_rate", axis): noisy[:, i] for i, axis in enumerate("xyz")}
    for key, history in run.environment.items():
        sigma = run.scenario.environment.thermometer_sigma if key[0] == "temperature" else 0.0
        channels[key] = history(time) + sigma * rng.standard_normal(len(time))
    for (quantity, axis), y in channels.items():
        if not np.isfinite(y).all():
            raise InputError(f"truth: {quantity} {axis} comes out as no number; a value of it is far beyond any sensor")
    position = None if nominal.position is None else nominal.position[past.size :]
    return replace(
        nominal, time=time, position=position, channels=channels, weight=np.ones(len(time)), units=_units(channels)
    )


def _readings_of_turned_unit(run: Run, path: Motion, time: Array, past: Array) -> dict[str, Array]:
    """Return the readings of a turned unit, means over the intervals that end at `time` (n,) [s] or of the instant."""
    motion = run.scenario.schedule
    at = nodes(path, time, 1 / motion.rate, motion.rates == "instant")
    instants = np.concatenate([past, at.time])
    like = _nominal_motion(run, instants)
    s = stimulus(path, like, instants).at(time=instants - run.time[0])
    out = predict(run.platform, s, run.effects, run.scenario.kind)
    return {quantity: at.means(values[len(past) :]) for quantity, values in out.items()}


def _past_rows(run: Run, start: int) -> Array:
    """Return indices of earlier rows that represent the history of a block: one a minute and the first of dwells."""
    if start == 0:
        return np.zeros(0, dtype=int)
    grid = np.arange(run.time[0], run.time[start], HISTORY_STEP_S)
    marks = [grid] if run.table is None else [grid, run.table.start[run.table.start < run.time[start]]]
    rows = np.unique(np.searchsorted(run.time, np.concatenate(marks)))
    return rows[rows < start]


def _nominal_motion(run: Run, time: Array) -> Recording:
    """Return the true motion of the platform at these times, as a recording without sensor errors."""
    position: Array | None
    if run.path is not None:
        angle, position = np.zeros((len(time), 0)), None
    elif run.table is None:
        motion = run.scenario.schedule
        assert run.site.latitude is not None  # checked by the scenario
        phase = motion.start_angle + EARTH_RATE * time
        angle, position = ideal_angles(run.platform, phase, run.site.latitude), None
    else:
        angle = run.table.angles(time, run.table.true)
        position = np.where(run.table.moving(time), 0, run.table.position[run.table.visit(time)])
    channels: dict[Key, Array] = {("gimbal_angle", name): angle[:, i] for i, name in enumerate(run.platform.axis_names)}
    if not run.platform.axes and run.path is None:
        raise InputError(f"platform.name: {run.platform.name!r} has no gimbals, so no angle can be commanded")
    channels |= {key: history(time) for key, history in run.environment.items()}
    at_table_holds = (
        run.path is None and run.scenario.recording_kind.rotating
    )  # a table's holds are evaluated at the rows
    return Recording(
        run.scenario.recording_kind,
        run.scenario.title,
        run.platform,
        run.site,
        stated_noise(run.scenario),
        time,
        position,
        channels,
        instant=at_table_holds or run.scenario.schedule.rates == "instant",
    )


def _as_it_was(run: Run, nominal: Recording) -> Stimulus:
    """Return the stimulus with each position's setting error, which no readout shows."""
    s = stimulus_from_angles(nominal)
    if run.table is None:
        return s
    angle = s.readout + run.table.angles(nominal.time, run.setting)
    s = s.at(readout=angle, angle=angle)
    if not run.scenario.turning:
        return s
    return s.at(
        rate=angular_rate(run.platform, s, run.effects, run.table.rates(nominal.time, run.table.true + run.setting))
    )


def _angles(run: Run, out: Mapping[str, Array], time: Array, rng: np.random.Generator) -> dict[Key, Array]:
    """Return gimbal readouts, and in a static run the navigator's attitude error, as they are logged."""
    channels: dict[Key, Array] = {}
    names, noise = run.platform.axis_names, noise_processes(run.scenario)
    if run.path is not None:
        return _reference(run.path, run.scenario, time, rng)
    if run.table is not None:
        commanded = run.table.angles(time, run.table.commanded)
        return {("gimbal_angle", name): commanded[:, names.index(name)] for name in run.read}
    angle, attitude = one_sigma(noise["gimbal_angle"]), one_sigma(noise["attitude_error"])
    for name in run.read:
        reading = out["gimbal_angle"][:, names.index(name)] + angle * rng.standard_normal(len(time))
        channels["gimbal_angle", name] = reading % (2 * np.pi) if name == "platform" else reading
    for i, name in enumerate(ATTITUDE):
        channels["attitude_error", name] = out["attitude_error"][:, i] + attitude * rng.standard_normal(len(time))
    return channels


def _reference(path: Motion, scenario: Scenario, time: Array, rng: np.random.Generator) -> dict[Key, Array]:
    """Return the position of a vehicle as a satellite receiver reports it; nothing of a unit in its place."""
    if not isinstance(path, Drive):
        return {}
    place, sigma = path.place(time), scenario.noise.place * rng.standard_normal((len(time), 3))
    M, N = radii(place[:, 0])
    metres = np.stack([M, N * np.cos(place[:, 0]), np.ones(len(time))], axis=-1)
    return {(name, ""): column for name, column in zip(PLACE, (place + sigma / metres).T, strict=True)}


def _site(scenario: Scenario) -> Site:
    place = scenario.site
    gravity = place.gravity
    if gravity is None:
        gravity = G0 if place.latitude is None else float(normal_gravity(place.latitude, place.height))
    exact = 0.0 if scenario.recording_kind.stabilised else None  # of other kinds nothing takes a sigma into account
    return Site(place.latitude, place.height, gravity, latitude_sigma=exact)


def _units(channels: Mapping[Key, Array]) -> dict[Key, str]:
    unit = {
        "specific_force": "m/s^2",
        "gimbal_angle": "deg",
        "attitude_error": "arcsec",
        "temperature": "degC",
        "angular_rate": "rad/s",
        "latitude": "deg",
        "longitude": "deg",
        "height": "m",
    }
    return {key: unit[key[0]] for key in channels if key[0] in unit}


def sample_path(weather: QuantityHistory, last: float, rng: np.random.Generator) -> Callable[[Array], Array]:
    """Return a quantity of the environment as a function of time [s]."""
    knots = np.arange(0.0, last + 2 * KNOT_STEP_S, KNOT_STEP_S)
    if weather.shape == "random-walk":
        steps = weather.walk * np.sqrt(KNOT_STEP_S / 3600) * rng.standard_normal(len(knots))
        path = np.cumsum(steps) - steps[0] + weather.mean
        return lambda time: np.interp(time, knots, path)
    if weather.shape == "table":
        return lambda time: np.interp(time, 3600 * np.array(weather.time_h), weather.value)
    if weather.shape == "sinusoid":
        omega = 2 * np.pi / weather.period
        return lambda time: weather.mean + weather.amplitude * np.sin(omega * time + weather.phase)
    return lambda time: weather.mean + weather.rate * time / 3600
