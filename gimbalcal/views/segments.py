"""Segments of a rotation recording for a navigator: stops as means of a second, turns sample by sample.

At rest only the noise changes, so a mean over a second holds the information of its samples, and the model is evaluated
a hundred times less often; while the unit turns every sample counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects.sensor_grades import Grade, grade_of_noise
from gimbalcal.errors import InputError, number_of
from gimbalcal.inference.white_noise import white_sigma
from gimbalcal.kinematics import required_latitude
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Dwell, Recording, dwells
from gimbalcal.recording.detection import with_rests
from gimbalcal.recording.dwell import MISSED_ROW_STEPS
from gimbalcal.recording.record import FORCE, FORCES, RATE, RATES, SENSOR_OF
from gimbalcal.rotation import mean_rates

AVERAGED_QUANTITIES = (FORCE, RATE, "temperature", "covariate")
CHANNELS = (*FORCES, *RATES)
UPDATE_INTERVAL_S = 1.0  # between two updates of the velocity
GROUP_LENGTH_S = 0.05  # of a turn, over which sensitivities hardly change: half a degree
PAUSE_EDGE_ROWS = 100  # on either side of a pause
MAX_PAUSE_SHIFT_G = 2e-3  # of the force over a pause in which the unit was not moved
MAX_DWELL_TURN_G = 0.1  # change of the force over a stop; the Earth turns it by less in 20 min
MIN_STOPS = 2  # of a unit that is turned in its place
HAND_FORCE_RMS_G = 0.02  # of gravity, rms, which no lever arm on a table makes
HAND_FORCE_RATIO = 2.0  # times what sensors make of rests
SWAY_ROWS = 60  # whose gains of velocity are added up; a slower sway is a change of the bias
SWAY_SIGMAS = 3.0  # beyond what white noise adds up to
DEFAULT_VELOCITY_SIGMA_M_S = 1e-3  # of the place while the unit turns, where it is not stated


@dataclass(frozen=True, eq=False)
class Segments:
    """n intervals of mean readings, in K stretches with an update of the velocity at the end of each.

    rows: the recording of the means, without gimbals, time in the middle of each interval; dt (n,) s; joined (n,): the
    interval continues the one before; first (K + 1,): index of the first interval of each stretch; a stretch without
    intervals is a pause of the clock in a stop. stop (K,): ordinal of the stop, -1 while turning; time (K + 1,) s of
    the updates, the first at the start. group (n,): group of each interval, for which the model is linearised once;
    groups: their means. sigma (6,): one sample of each channel, stated or estimated; shown (6,): estimated from the
    stops; velocity (K,): one sigma of that of the place [m/s]; stated: whether the header states the noise of both
    triads; source: the recording as it was read; handled: whether a hand turned the unit, and so moved it.
    """

    rows: Recording
    dt: Array
    joined: NDArray[np.bool_]
    first: NDArray[np.int64]
    stop: NDArray[np.int64]
    time: Array
    group: NDArray[np.int64]
    groups: Recording
    sigma: Array
    shown: Array
    velocity: Array
    stated: bool
    source: Recording
    handled: bool = False

    @property
    def readings(self) -> Array:
        """Mean forces and rates (n, 6)."""
        return np.stack([self.rows.channels[key] for key in CHANNELS], axis=1)

    @property
    def latitude(self) -> float:
        """Latitude of the place [rad], which `segment` requires."""
        return required_latitude(self.rows.site.latitude)

    @property
    def pauses(self) -> NDArray[np.bool_]:
        """Stretches (K,) in which the clock paused."""
        return np.diff(self.first) == 0

    @property
    def believed(self) -> NDArray[np.bool_]:
        """Stretches (K,) at whose end the velocity is known: all, or those of the stops if a hand turned the unit."""
        return ~((self.stop < 0) & self.handled)

    @property
    def grade(self) -> Grade:
        """Grade of the unit, from its noise."""
        step = float(np.median(self.dt / self.rows.weight))
        force, rate = (float(self.sigma[k : k + 3].max()) * np.sqrt(step) for k in (0, 3))
        return grade_of_noise(force, rate)

    def of_stop(self, k: int) -> slice:
        """Return the intervals of one stop."""
        mine = np.flatnonzero(self.stop == k)
        return slice(int(self.first[mine[0]]), int(self.first[mine[-1] + 1]))


def segment(recording: Recording) -> Segments:
    """Divide a recording into stops, turns and pauses. Raises InputError where it cannot be navigated."""
    _refuse_other_kinds(recording)
    source = recording
    if recording.instant:
        recording = _as_means(recording)
    step = recording.step
    dt = np.diff(recording.time, prepend=recording.time[0] - step)
    paused = dt > MISSED_ROW_STEPS * step
    stop_dwells = stop_rows(recording)
    if len(stop_dwells) < 2:
        raise InputError(
            f"{recording.label} has {'one' if stop_dwells else 'no'} stop: systematic calibration compares what the "
            "unit reads at rest before and after it was turned; turn it through a dozen stops or more, each axis up "
            "and down"
        )
    _refuse_lost_turns(recording, stop_dwells, paused)
    sigma, shown, stated = _noise(recording, stop_dwells)
    begins, first, stop = [0], [0], []  # rows at which intervals begin; intervals at which stretches begin
    group: list[int] = []
    several = max(1, round(GROUP_LENGTH_S / step))
    for a, b, k in _stretches(stop_dwells, paused, max(1, round(UPDATE_INTERVAL_S / step))):
        if b > a:
            begins += [b] if k >= 0 else range(a + 1, b + 1)
            after = group[-1] + 1 if group else 0
            group += [after] if k >= 0 else [after + i // several for i in range(b - a)]
        first.append(len(begins) - 1)
        stop.append(k)
    edge = np.array(begins)
    # a pause belongs to no interval: the reading after it is the mean of its own step
    length = np.add.reduceat(np.where(paused, step, dt), edge[:-1])
    count = np.diff(edge)
    rows = _means(recording, edge[:-1], count, recording.time[edge[1:] - 1] - length / 2)
    of = np.array(group)
    begin = np.flatnonzero(np.diff(of, prepend=-1))
    fewer = np.diff(begin, append=len(of))
    groups = _means(rows, begin, fewer, np.add.reduceat(rows.time, begin) / fewer)
    at = edge[np.array(first)]
    time = np.where(at > 0, recording.time[np.maximum(at - 1, 0)], recording.time[0] - step)
    for j in np.flatnonzero(np.diff(first) == 0):  # what begins after a pause begins one step before its first row
        time[j + 1] = recording.time[at[j + 1]] - step
    joined = ~paused[edge[:-1]] & (edge[:-1] > 0)
    density = float(np.maximum(sigma, shown)[:3].max()) * step**0.5
    if "velocity" in recording.noise:
        velocity = np.full(len(stop), recording.noise["velocity"])
    else:
        still = velocity_at_stops(rows, length, np.array(first), np.array(stop), density)
        velocity = np.where(np.array(stop) < 0, max(still, DEFAULT_VELOCITY_SIGMA_M_S), still)
    handled = "velocity" not in recording.noise and _is_hand_turned(recording, stop_dwells)
    return Segments(
        rows, length, joined, np.array(first), np.array(stop), time, of, groups, sigma, shown, velocity, stated,
        source, handled,
    )  # fmt: skip


def velocity_at_stops(
    rows: Recording, length: Array, first: NDArray[np.int64], stop: NDArray[np.int64], density: float
) -> float:
    r"""Return one sigma [m/s] of the velocity of the place by the means of the force over the seconds of each stop.

    The gain of velocity from one second to the next is :math:`u_k = w_k + \nu_k - \nu_{k-1}` about a line, as the
    Earth turns: w white noise of the accelerometers of this density [m/s^2/sqrt(Hz)], :math:`\nu` the velocity of the
    place at the updates. If that is white, second differences z of u show
    :math:`s^2 = (6 \operatorname{cov}(z_k, z_{k+2}) - \operatorname{var} z) / 16`; a slow sway shows in the sums of
    u, where these are larger than w makes them. It is at least what chance leaves, and the default where no stop lasts
    for some seconds.
    """
    each_stretch, of = first[:-1][np.diff(first) > 0], stop[np.diff(first) > 0]
    second = float(np.median(length[each_stretch[of >= 0]]))
    gained = [rows.triad(FORCE)[each_stretch][of == k] * second for k in range(stop.max() + 1)]
    z = [np.diff(u, 2, axis=0) for u in gained]
    late, early = (np.concatenate([each[s] for each in z]) for s in (slice(2, None), slice(-2)))
    if not late.size:
        return DEFAULT_VELOCITY_SIGMA_M_S
    variance, covariance = float(np.mean(late**2)), float(np.mean(late * early))
    white = density**2 * second
    chance = max(variance / 6, white) / np.sqrt(late.size)
    return float(
        np.sqrt(max((6 * covariance - variance) / 16, chance, _sway_variance([u for u in gained if len(u) > 4], white)))
    )


def _sway_variance(gained: Sequence[Array], white: float) -> float:
    """Return the mean square of velocities that gains (n, 3) of stops add up to, less that of noise of this variance.

    It is zero where they add up to no more than white noise does by chance.
    """
    total, expected, spread, count = 0.0, 0.0, 0.0, 0
    for u in (piece for each in gained for piece in np.array_split(each, -(-len(each) // SWAY_ROWS))):
        n = len(u)
        line = np.linalg.qr(np.vander(np.arange(float(n)), 2))[0]
        summed = np.tril(np.ones((n, n))) @ (np.eye(n) - line @ line.T)
        summed -= summed.mean(axis=0)
        total += float(((summed @ u) ** 2).sum())
        product = summed.T @ summed
        expected += 3 * white * float(np.trace(product))
        spread += 6 * white**2 * float((product**2).sum())
        count += 3 * n
    beyond = total - expected
    return beyond / count if beyond > SWAY_SIGMAS * spread**0.5 else 0.0


def turned_in_place(recording: Recording) -> bool:
    """Return whether a unit was turned from stop to stop at a known latitude; a tilting table goes on tilting."""
    if not recording.kind.rotating or recording.platform.axes or recording.site.latitude is None:
        return False
    if any(not recording.has(q) or recording.counted(q) for q in (FORCE, RATE)):
        return False
    return len(stop_rows(recording)) >= MIN_STOPS


def stop_rows(recording: Recording) -> list[Dwell]:
    """Return the stops, from `position` or else from force and rate.

    A pause of the clock does not end a stop in which the unit was not moved.
    """
    step = recording.step
    paused = np.diff(recording.time, prepend=recording.time[0] - step) > MISSED_ROW_STEPS * step
    force = recording.triad(FORCE)
    out: list[Dwell] = []
    for d in dwells(with_rests(recording)):
        ends = (
            force[d.rows][:PAUSE_EDGE_ROWS].mean(axis=0),
            force[d.rows][-PAUSE_EDGE_ROWS:].mean(axis=0),
        )
        if float(np.linalg.norm(ends[1] - ends[0])) > MAX_DWELL_TURN_G * recording.site.gravity:
            continue  # a steady turn
        if out and out[-1].stop == d.start and paused[d.start]:
            before, after = (
                force[max(out[-1].start, d.start - PAUSE_EDGE_ROWS) : d.start],
                force[d.start : d.start + PAUSE_EDGE_ROWS],
            )
            moved = float(np.linalg.norm(after.mean(axis=0) - before.mean(axis=0)))
            scatter = float(np.linalg.norm(after.std(axis=0) + before.std(axis=0)))
            if moved < MAX_PAUSE_SHIFT_G * recording.site.gravity + scatter:
                out[-1] = replace(out[-1], stop=d.stop)
                continue
        out.append(d)
    return out


def _is_hand_turned(recording: Recording, stop_dwells: Sequence[Dwell]) -> bool:
    """Return whether forces other than gravity act while the unit turns, as by a hand and not by a table."""
    size = np.linalg.norm(recording.triad(FORCE), axis=1)
    still = np.zeros(len(size), dtype=bool)
    for d in stop_dwells:
        still[d.rows] = True
    if still.all():
        return False
    rest, turning = (float(np.sqrt(np.mean((x - np.median(size[still])) ** 2))) for x in (size[still], size[~still]))
    return turning > max(HAND_FORCE_RMS_G * recording.site.gravity, HAND_FORCE_RATIO * rest)


def _means(recording: Recording, begin: NDArray[np.int64], count: NDArray[np.int64], time: Array) -> Recording:
    """Return a recording whose rows at `time` are means over `count` rows from each of `begin`."""
    channels = {
        key: np.add.reduceat(x, begin) / count for key, x in recording.channels.items() if key[0] in AVERAGED_QUANTITIES
    }
    weight = np.add.reduceat(recording.weight, begin)
    return replace(
        recording, platform=BENCH, time=time, position=None, channels=channels, weight=weight, other_sensors=()
    )


def _stretches(stop_dwells: Sequence[Dwell], paused: NDArray[np.bool_], block: int) -> Iterator[tuple[int, int, int]]:
    """Yield first row, end and ordinal of the stop (-1: a turn) of each stretch in order; a pause has no rows."""
    ends = [0, *(row for d in stop_dwells for row in (d.start, d.stop)), len(paused)]
    for i, (start, end) in enumerate(pairwise(ends)):
        k = i // 2 if i % 2 else -1
        cuts = [start, *(int(row) for row in np.flatnonzero(paused[start:end]) + start if row > start), end]
        for j, (a, b) in enumerate(pairwise(cuts)):
            if j:
                yield a, a, k
            if b > a:
                for low, high in pairwise(np.linspace(a, b, max(1, round((b - a) / block)) + 1).astype(int).tolist()):
                    yield low, high, k


def _refuse_other_kinds(recording: Recording) -> None:
    if not recording.kind.rotating:
        raise InputError(
            f"{recording.title!r} is a {recording.kind} recording; --method systematic takes a rotation recording, of "
            'a unit that is turned through stops with every sample logged (kind = "rotation")'
        )
    for q in (FORCE, RATE):
        recording.triad(q)
        if recording.counted(q):
            raise InputError(
                f"{recording.label}: {q} is in counts, and a navigator needs physical units; state what a count is, "
                "as nominal as it may be, with a unit in [columns]"
            )
    if recording.site.latitude is None:
        raise InputError(
            f"{recording.label}: systematic calibration needs the latitude, because gyroscopes see the Earth turn; "
            'write latitude = { value = ..., unit = "deg" } in [site] of recording.toml'
        )


def _refuse_lost_turns(recording: Recording, stop_dwells: Sequence[Dwell], paused: NDArray[np.bool_]) -> None:
    """Raise InputError for a pause of the clock in a turn, whose angle is then unknown."""
    inside = np.zeros(len(paused), dtype=bool)
    for d in stop_dwells:
        inside[d.start : d.stop] = True
    inside[0] = True
    lost = np.flatnonzero(paused & ~inside)
    lost = np.union1d(lost, [d.start for d in stop_dwells if d.start and paused[d.start]]).astype(int)
    if len(lost):
        t = recording.time[[lost[0] - 1, lost[0]]]
        raise InputError(
            f"{recording.label}: the clock pauses from {t[0]:.10g} to {t[1]:.10g} s while the unit turns"
            f"{f' (one of {len(lost)} such pauses)' if len(lost) > 1 else ''}, and nobody knows how far it turned "
            "there; log every sample of a turn, or cut the recording there and give the longer part"
        )


def _noise(recording: Recording, stop_dwells: Sequence[Dwell]) -> tuple[Array, Array, bool]:
    """Return one sigma (6,) of a sample of each channel, stated or else estimated; the estimates; whether stated."""
    sigma, shown = np.empty(6), np.empty(6)
    stated = all(SENSOR_OF[q] in recording.noise for q in (FORCE, RATE))
    for i, key in enumerate(CHANNELS):
        each = [_scatter(recording.channels[key][d.rows]) for d in stop_dwells]
        shown[i] = np.sqrt(np.mean(np.square(each)))
        sigma[i] = recording.noise.get(SENSOR_OF[key[0]], shown[i])
    if not np.all(sigma > 0):
        bad = [" ".join(key) for key, s in zip(CHANNELS, sigma, strict=True) if not s > 0]
        raise InputError(
            f"{recording.label}: {bad[0]} has no noise, stated or seen, and a filter cannot weigh it; state it in "
            f"[noise] ({number_of(len(bad), 'channel')} like this)"
        )
    return sigma, shown, stated


def _scatter(x: Array) -> float:
    begins = np.zeros(len(x), dtype=bool)
    return float(white_sigma(x[:, None], begins, np.ones(len(x)))[0])


def _as_means(recording: Recording) -> Recording:
    """Convert instantaneous readings to means over the interval before, by cubics through neighbouring samples."""
    channels = {key: values[1:] for key, values in recording.channels.items()}
    for q in (FORCE, RATE):
        level, bend, _ = mean_rates(recording.time, recording.triad(q))
        channels |= {(q, a): (level + bend)[:, i] for i, a in enumerate("xyz")}
    position = None if recording.position is None else recording.position[1:]
    return replace(
        recording, time=recording.time[1:], position=position, channels=channels, weight=recording.weight[1:],
        instant=False, other_sensors=(),
    )  # fmt: skip
