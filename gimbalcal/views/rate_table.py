r"""Gyroscopes on a rate table: their mean output in stretches of steady turning, less the rate of the table.

The rig's angles give the rate of the unit, omega, by the chain of its axes, and

.. math:: \bar y = h(\omega + [\omega \times]\, \delta + C\, \Omega_b) + \nu, \qquad
          h(\omega) = \varepsilon + (1 + S + M)\, \omega + \dots ,

with delta how the unit is turned on the table, one sigma of `MOUNTING_SIGMA_RAD` and one for each recording; C Omega_b
the Earth's rate, its vertical part known by the latitude where accelerometers tell how the table stands, its horizontal
part unknown in heading; without accelerometers all of it is unknown. A tilt of the mounting shortens the rate along a
sensor's axis by its cosine. These are nuisances of the view.

A calibration takes whole stretches; a diagnosis takes parts of them, which show what follows the angle of the table or
happens within a stretch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Effect
from gimbalcal.effects.baseline_effects import GYROSCOPE_BIAS, GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.effects.history import integral
from gimbalcal.effects.stimulus import instants_about_middle
from gimbalcal.errors import InputError
from gimbalcal.forward import Rows, linearise
from gimbalcal.inference.algebra import nonnegative_least_squares
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording
from gimbalcal.recording.dwell import PAUSE_STEPS, usual_step
from gimbalcal.recording.kinds import ROTATION
from gimbalcal.recording.record import FOLLOWED, FORCE, RATE, RATES, Key
from gimbalcal.rotation import normal_to, rotation_vector
from gimbalcal.units import from_si
from gimbalcal.views.core import Measurement, View, gyroscope_parameters_without, nuisance, recording_fields
from gimbalcal.views.noise import NoiseModel, of_channels
from gimbalcal.views.rest_rates import MIN_RATE_SIGMA, horizontal_sigma

BLOCK_S = 0.5  # s of a mean rate: no lag between readout and gyroscopes matters, and readouts hardly scatter
PART_TURN = np.radians(10.0)  # rad of a part of a stretch, which is no longer than a block
MAX_PARTS = 1000  # of a recording, unless it has more stretches
INSTANTS = 4  # spread over each part, of which effects are averaged: else eight cycles in a turn would be 5 % small
MAX_RATE_CHANGE = 0.005  # of the fastest rate, from one block to the next
MIN_RATE = np.radians(0.1)  # rad/s; a table that never turns faster stands
MOUNTING_SIGMA_RAD = np.radians(0.2)  # one sigma of how the unit is turned on the table: faces square to ten arcmin
MIN_FORCE_SHARE = 0.9  # of the force, in the axes of the base: what a lever arm feels goes round

RATE_TABLE = Measurement(
    "rate table", "deg/h", "stretches", channels="the rates on the table", channel="the rate about {axis} on the table",
    acts_on=(RATE,), patterns=frozenset({"fast time", "temperature"}),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Stretches:
    """Means over m stretches of steady turning of one recording, or over parts of stretches.

    reading: of the gyroscopes less the rate of the table, and its sigma, (m, 3) [rad/s]; rate (m, 3) [rad/s]; attitude
    C_bp (m, 3, 3); time (m, p) [s] of p instants that are spread evenly over each; number (m,) of the stretch, from 1;
    angle (m, p, k) [rad], of the readouts of parts, else None; up (3,): the vertical in the axes of the base, None
    where accelerometers do not determine it; logged: means (m,) of temperature and other channels.
    """

    reading: Array
    sigma: Array
    rate: Array
    attitude: Array
    time: Array
    number: Array
    angle: Array | None
    up: Array | None
    logged: Mapping[Key, Array]


def stretches_of(r: Recording, divided: bool = False) -> Stretches:
    """Return means over stretches of steady turning: blocks of one rate with the blocks before and after, joined.

    divided: over parts of stretches, which show what follows the angle of the table or happens within a stretch; their
    sigma is estimated from how successive parts differ. Raises InputError for a recording that is too short, or in
    which nothing turns, or never steadily.
    """
    step, angles = usual_step(r), r.angles()
    blocks = _blocks(r, step)
    C = r.platform.attitude(angles)
    turn = rotation_vector(C[:-1] @ np.swapaxes(C[1:], -1, -2))
    turned = np.concatenate([0 * turn[:1], np.cumsum(turn, axis=0)])
    read = integral(r.triad(RATE), r.time)

    def means(ends: Array) -> tuple[Array, Array]:
        """Return reading less rate, and rate (m, 3), between first and last rows (m, 2)."""
        first, last = ends.T
        length = (r.time[last] - r.time[first])[:, None]
        rate = (turned[last] - turned[first]) / length
        return (read[last] - read[first]) / length - rate, rate

    of_blocks, rate = means(blocks)
    groups = _steady_stretches(r, blocks, rate, PAUSE_STEPS * step)
    ends = np.array([(blocks[g[0], 0], blocks[g[-1], 1]) for g in groups])
    number = np.arange(1, len(ends) + 1)
    if divided:
        ends, number = _parts(ends, number, r.time, np.linalg.norm(means(ends)[1], axis=1))
    difference, of_table = means(ends)
    length, spans, steady = np.diff(r.time[ends])[:, 0], [slice(*end) for end in ends], [of_blocks[g] for g in groups]
    if divided:
        series = [*np.split(difference, np.flatnonzero(np.diff(number)) + 1), *steady]
        of_series = np.concatenate([length, *(np.diff(r.time[blocks[g]])[:, 0] for g in groups)])
        sigma = _sigma_of_means(series, of_series, length)
    else:
        inside = np.concatenate([x - x.mean(0) for x in steady])
        white = np.sqrt((inside**2).sum(0) / max(len(inside) - len(groups), 1))
        sigma = np.array([white / np.sqrt(len(g)) for g in groups])
    return Stretches(
        difference,
        sigma,
        of_table,
        np.array([C[span].mean(0) for span in spans]),
        _at_instants(r.time[ends].mean(axis=1), length),
        number,
        _at_instants(_mean_angles(angles, spans), _turned(angles, ends)) if divided else None,
        _vertical_in_base(r),
        {key: np.array([x[span].mean() for span in spans]) for key, x in r.channels.items() if key[0] in FOLLOWED},
    )


def _blocks(r: Recording, step: float) -> Array:
    """Return first and last rows (b, 2) of successive blocks of `BLOCK_S`, of rows at a step [s].

    Raises InputError where the recording is shorter than a block.
    """
    n = max(2, round(BLOCK_S / step))
    starts = np.arange(0, len(r.time) - n, n)
    if not len(starts):
        raise InputError(
            f"{r.title!r} is shorter than {BLOCK_S:g} s; turn the table at steady rates for ten seconds each"
        )
    return np.stack([starts, starts + n], axis=-1)


def _steady_stretches(r: Recording, blocks: Array, rate: Array, longest: float) -> list[Array]:
    """Return the ordinals of blocks (b, 2), of rates (b, 3) [rad/s], that make each stretch of steady turning.

    longest: step [s] between rows, beyond which the clock paused.

    Raises InputError where nothing turns, or never steadily.
    """
    dt = np.diff(r.time)
    whole = np.array([dt[first:last].max() <= longest for first, last in blocks])
    fastest = float(np.linalg.norm(rate[whole], axis=1).max(initial=0.0))
    if fastest < MIN_RATE:
        raise InputError(
            f"{r.title!r}: the table stands or turns by {from_si(fastest, 'deg/s'):.2g} deg/s at most; turn it at "
            "steady rates, or calibrate rests with --method multiposition"
        )
    new = np.linalg.norm(np.diff(rate, axis=0), axis=1) > MAX_RATE_CHANGE * fastest
    edge = np.concatenate([[False], new]) | np.concatenate([new, [False]]) | ~whole
    groups = np.split(np.flatnonzero(~edge), np.flatnonzero(np.diff(np.flatnonzero(~edge)) > 1) + 1)
    groups = [
        part for g in groups for part in _constant_rate_blocks(g, rate, MAX_RATE_CHANGE * fastest) if len(part) > 1
    ]
    if not any(np.linalg.norm(rate[g].mean(0)) >= MIN_RATE for g in groups):
        raise InputError(
            f"{r.title!r}: the table never turns steadily for {4 * BLOCK_S:g} s; hold each rate for ten seconds, or "
            "use --method attitude for motion that goes on"
        )
    return groups


def _parts(ends: Array, number: Array, time: Array, rate: Array) -> tuple[Array, Array]:
    """Return first and last rows (m, 2) of equal parts of stretches between `ends` (k, 2), and the stretch of each.

    A part is no longer than a block and turns, at a rate (k,) [rad/s], by no more than `PART_TURN`. Parts of long
    recordings are longer by a common factor, so that there are about `MAX_PARTS`.
    """
    length = time[ends[:, 1]] - time[ends[:, 0]]
    wanted = length * np.maximum(1 / BLOCK_S, rate / PART_TURN)
    count = np.ceil(wanted * min(1.0, MAX_PARTS / wanted.sum())).astype(int)
    count = np.minimum(count, np.diff(ends)[:, 0])  # a row each at the least
    cuts = [np.linspace(a, b, k + 1).astype(int) for (a, b), k in zip(ends.tolist(), count, strict=True)]
    parts = np.concatenate([np.stack([c[:-1], c[1:]], axis=-1) for c in cuts])
    return parts, np.repeat(number, count)


def _sigma_of_means(series: Sequence[Array], lengths: Array, length: Array) -> Array:
    r"""Return one sigma (m, 3) [rad/s] of means of each length (m,) [s], estimated from successive means of series.

    .. math:: \sigma^2(T) = a / T + b / T^2 \geq 0

    with a of white noise of the gyroscopes and b of the readouts, two of which make a mean rate. series: means (k, 3)
    [rad/s] of each stretch; lengths [s]: of the means of all series, one after the other.
    """
    square = np.concatenate([np.diff(x, axis=0) ** 2 / 2 for x in series])
    inner = np.concatenate([np.arange(len(x)) < len(x) - 1 for x in series])
    T = lengths[inner]
    design = np.stack([np.ones(len(T)), 1 / T], axis=-1)  # of sigma^2 T, which is of one size
    found = np.array([nonnegative_least_squares(design, own * T)[0] for own in square.T])
    return np.sqrt(found @ np.stack([1 / length, 1 / length**2])).T


def _mean_angles(angle: Array, spans: Sequence[slice]) -> Array:
    """Return mean angles (m, k) of readouts (n, k) [rad] in spans, in the turn in which the middle row is read."""
    mean = np.array([np.unwrap(angle[span], axis=0).mean(0) for span in spans])
    middle = angle[[(span.start + span.stop) // 2 for span in spans]]
    return np.asarray(mean - 2 * np.pi * np.round((mean - middle) / (2 * np.pi)))


def _turned(angle: Array, ends: Array) -> Array:
    """Return by how much readouts (n, k) [rad] go on between first and last rows (m, 2), (m, k) [rad]."""
    return np.asarray(np.diff(np.unwrap(angle, axis=0)[ends], axis=1)[:, 0])


def _at_instants(mean: Array, change: Array) -> Array:
    """Return what changes steadily by (m, ...) about a mean (m, ...) at `INSTANTS` of each part (m, p, ...)."""
    changes = np.multiply.outer(instants_about_middle(INSTANTS), change).swapaxes(0, 1)
    return np.asarray(mean[:, None] + changes)


def _constant_rate_blocks(group: Array, rate: Array, tolerance: float) -> list[Array]:
    """Blocks that follow each other, cut where a slow change of the rate adds up to more than `tolerance`."""
    out, first = [], 0
    for k in range(1, len(group) + 1):
        if k == len(group) or np.linalg.norm(rate[group[k]] - rate[group[first]]) > 2 * tolerance:
            out.append(group[first:k])
            first = k
    return out


def rate_table(recordings: Sequence[Recording], stretches: Sequence[Stretches], scale: Array, response: Array) -> View:
    """Return the view of all stretches, with readings in units of `scale` (3,) [rad/s].

    response (3, 3): derivative of the readings by the rate, as far as it is known; it says what a mounting does.
    """
    platforms = [r.platform for r in recordings]
    rigs = list(dict.fromkeys(platforms))  # two recordings of one may be of one day, or the unit bolted on anew
    rate = np.concatenate([s.rate for s in stretches])
    N = np.zeros((len(rate), 3, len(recordings) + len(rigs), 5))  # by one sigma of each nuisance
    reading, start = [], 0
    for k, (r, s) in enumerate(zip(recordings, stretches, strict=True)):
        rows, rig = slice(start, start := start + len(s.rate)), len(recordings) + rigs.index(r.platform)
        latitude = r.site.latitude if s.up is not None else None  # else the attitude of the table is unknown
        along = np.eye(3)["xyz".index(r.platform.axes[-1].direction)] if s.up is None else s.up
        vertical, side = s.attitude @ along, normal_to(along)
        N[rows, :, k, :2] = horizontal_sigma(latitude) * s.attitude @ np.stack([side, np.cross(along, side)], axis=-1)
        N[rows, :, k, 2:] = MOUNTING_SIGMA_RAD * response @ np.cross(s.rate[:, None], np.eye(3)).swapaxes(-1, -2)
        N[rows, :, rig, 0] = EARTH_RATE / np.sqrt(3) * vertical * (latitude is None)
        N[rows, :, rig, 1] = _foreshortening(s.rate, response) * s.rate
        N[rows, :, rig, 2:] = N[rows, :, k, 2:] * (platforms.count(r.platform) > 1)
        known = 0.0 if latitude is None else EARTH_RATE * np.sin(latitude) * vertical
        reading.append(scale * (s.reading + s.rate) - known)
    first = replace(recordings[0], kind=ROTATION)
    still = replace(first.select(slice(0, 1)), platform=BENCH, position=None)
    instants = np.concatenate([s.time - r.time[0] for r, s in zip(recordings, stretches, strict=True)])
    time = instants.mean(axis=1)
    count = [len(s.time) for s in stretches]
    number = np.concatenate([s.number + sum(x.number[-1] for x in stretches[:k]) for k, s in enumerate(stretches)])
    session = np.repeat(np.arange(len(count)), count) if len(count) > 1 else None  # nobody knows the time between them
    every = [key for key in stretches[0].logged if all(key in s.logged for s in stretches)]
    logged = {key: np.concatenate([s.logged[key] for s in stretches]) for key in every}
    felt = stimulus_from_truth(still, np.zeros((1, 3)), np.zeros((1, 3))).held(len(rate)).at(rate=rate, time=time)
    felt = felt.at(
        temperature=logged.get(("temperature", "")),
        covariates={name: x for (quantity, name), x in logged.items() if quantity == "covariate"},
    )
    each = felt.select(np.repeat(np.arange(len(rate)), INSTANTS)).at(time=instants.ravel())
    angles = [s.angle for s in stretches if s.angle is not None]
    if len(angles) == len(stretches) and len({p.axis_names for p in platforms}) == 1:
        angle, names = np.concatenate(angles), platforms[0].axis_names
        felt = felt.at(angle=angle.mean(axis=1), readout=angle.mean(axis=1), axis_names=names)
        each = each.at(angle=np.concatenate(angle), readout=np.concatenate(angle), axis_names=names)
    y, names = np.concatenate(reading), ("horizontal rate",) * 2 + ("mounting",) * 3
    of_each = [nuisance(name, str(k + 1), "1", 1.0) for k in range(len(recordings)) for name in names]
    names = ("vertical rate", "foreshortening", *names[2:])
    of_rigs = [nuisance(name, f"rig {k + 1}", "1", 1.0) for k in range(len(rigs)) for name in names]

    turned = felt.at(rate=np.where(np.abs(rate).max(axis=0) > MIN_RATE, rate, 0.0))

    def shown(effect: Effect) -> bool:
        return bool(np.any(effect.contribution(turned) != 0))

    def rows_about(effects: Sequence[Effect]) -> Rows:
        read = np.repeat(y, INSTANTS, axis=0)
        rows = linearise(BENCH, each, effects, channels=RATES, read=read, stages=GYROSCOPE_STAGES).reduced(means)
        return replace(rows, nuisance=N.reshape(len(rate), 3, -1))

    def means(X: Array) -> Array:
        return np.asarray(X.reshape(len(rate), INSTANTS, *X.shape[1:]).mean(axis=1))

    sigma = np.maximum(np.abs(scale) * np.concatenate([s.sigma for s in stretches]), MIN_RATE_SIGMA)
    return View(
        RATE_TABLE, channels=RATES, **{**recording_fields(first), "time": time, "session": session},
        stimulus=felt,
        evaluate=rows_about, stages=GYROSCOPE_STAGES, baseline=(*GYROSCOPE_BIAS, *GYROSCOPE_INPUT_TERMS),
        groups=number - 1, nuisances=(*of_each, *of_rigs),
        gauge=gyroscope_parameters_without(felt, shown), label=number,
        noise=NoiseModel(sigma, sample=sigma, wander=of_channels(len(sigma), 3), of_each_channel=True),
    )  # fmt: skip


def _vertical_in_base(r: Recording) -> Array | None:
    """Return the vertical (3,) in the axes of the base by the accelerometers; None without them, or where it varies."""
    if set(r.axes(FORCE)) != {"x", "y", "z"} or r.counted(FORCE):
        return None
    force = r.triad(FORCE)
    mean = np.einsum("nji,nj->ni", r.platform.attitude(r.angles()), force).mean(0)
    size = float(np.linalg.norm(mean))
    return mean / size if size > MIN_FORCE_SHARE * float(np.linalg.norm(force, axis=1).mean()) else None


def _foreshortening(rate: Array, response: Array) -> float:
    """One sigma of the share by which a tilt of the mounting shortens the rate along a sensor's axis, 1 - cos.

    Of two tilts of `MOUNTING_SIGMA_RAD`, or, where the sensors across the fastest of rate (m, 3) read more, of all that
    they read.
    """
    fastest = rate[np.argmax(np.linalg.norm(rate, axis=1))]
    n = fastest / np.linalg.norm(fastest)
    return float(max(np.sqrt(2) * MOUNTING_SIGMA_RAD**2, np.sum(np.cross(n, response @ n) ** 2) / 2))
