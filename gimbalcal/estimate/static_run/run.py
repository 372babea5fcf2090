r"""A static run as whitened rows: what was read, less what the forward model expects, channel by channel.

Rows may be means over blocks of time. Gimbal angles and attitude errors are as good as linear over a minute; the
specific force turns with the Earth, and what the mean of a turning vector loses is put back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, parameters, values
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.noise import HEADER, SAMPLES
from gimbalcal.estimate.accelerometers.setting import select
from gimbalcal.forward import jacobian, predict
from gimbalcal.inference.information import Information, information
from gimbalcal.kinematics import lost_to_averaging, refuse_other_platform, stimulus_from_angles
from gimbalcal.number import Array
from gimbalcal.recording import Recording

Key = tuple[str, str]
BASELINE = (
    "scale_factor",
    "bias",
    "scale_nonlinearity",
    "misalignment",
    "gimbal_zero",
    "base_tilt",
    "polar_axis_misalignment",
)
SENSORS = (("specific_force", "accelerometer"), ("gimbal_angle", "gimbal_angle"), ("attitude_error", "attitude"))
ATTITUDE = ("roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class StaticRun:
    """The n rows of a static run that was prepared for fits: c channels, one sigma for each row of each."""

    recording: Recording
    stimulus: Stimulus
    channels: tuple[Key, ...]
    observed: Array  # (n, c) SI
    sigma: Array  # (n, c)

    @property
    def phase(self) -> Array:
        """Sidereal angle S_t (n,) [rad]."""
        return np.arctan2(self.stimulus.force[:, 1], self.stimulus.force[:, 0])

    @property
    def direction(self) -> Array:
        """Ideal specific force in units of gravity (n, 3)."""
        return np.asarray(self.stimulus.force / self.stimulus.gravity)

    def departures(self, effects: Sequence[Effect] = ()) -> Array:
        """Observed minus predicted (n, c); angles within half a turn."""
        out = predict(self.recording.platform, self.stimulus, effects, "static-run")
        d = self.observed - self.pick(out)
        angle = [quantity != "specific_force" for quantity, _ in self.channels]
        d[:, angle] = (d[:, angle] + np.pi) % (2 * np.pi) - np.pi
        return d

    def jacobian(self, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> Array:
        """Derivative of the predictions (n, c, p)."""
        return self.pick(jacobian(self.recording.platform, self.stimulus, effects, wanted, "static-run"))

    def pick(self, outputs: dict[str, Array]) -> Array:
        """The channels of this run (n, c, ...) out of what the forward model returns."""
        order: dict[str, tuple[str, ...]] = {"specific_force": ("x", "y", "z"), "attitude_error": ATTITUDE}
        order["gimbal_angle"] = self.recording.platform.axis_names
        return np.stack([outputs[q][:, order[q].index(axis)] for q, axis in self.channels], axis=1)

    def thinned(self, rows: int) -> StaticRun:
        """About so many rows, evenly spread."""
        every = np.arange(0, len(self.observed), max(1, len(self.observed) // rows))
        few = select(self.stimulus, every)
        return StaticRun(self.recording.select(every), few, self.channels, self.observed[every], self.sigma[every])

    def columns(self, quantity: str) -> list[int]:
        """Indices of the channels of one quantity."""
        return [i for i, (q, _) in enumerate(self.channels) if q == quantity]


def prepare(recording: Recording) -> StaticRun:
    """Channels, noise and the sidereal phase of a static run. Raises InputError where there is nothing to fit.

    Sigma is that of the header over the root of a row's weight; where the header is silent, what the rows scatter
    about the model. Without a readout of the platform gimbal the force itself tells the phase.
    """
    if recording.kind != "static-run":
        raise InputError(f"{recording.title!r} is a {recording.kind} recording where a static run is needed")
    refuse_other_platform(recording)
    axes = {
        "specific_force": ("x", "y", "z"),
        "gimbal_angle": recording.platform.axis_names,
        "attitude_error": ATTITUDE,
    }
    channels = tuple((q, a) for q, _ in SENSORS for a in axes[q] if (q, a) in recording.channels)
    if ("gimbal_angle", "platform") not in channels:
        recording = with_phase_of_force(recording)
    s = stimulus_from_angles(recording)
    observed = np.stack([recording.channels[key] for key in channels], axis=1)
    run = StaticRun(recording, s, channels, observed, np.ones(observed.shape))
    force = run.columns("specific_force")
    if force:
        lost = lost_to_averaging(recording, s.force)
        observed[:, force] += lost[:, ["xyz".index(channels[i][1]) for i in force]]
    return replace(run, sigma=_sigmas(run))


def with_phase_of_force(recording: Recording) -> Recording:
    """The recording with a platform gimbal made from the direction of the force in the equatorial plane."""
    f = recording.triad("specific_force")
    angle = np.arctan2(f[:, 1], f[:, 0])
    return replace(recording, channels={**recording.channels, ("gimbal_angle", "platform"): angle})


def noise_from(run: StaticRun) -> str:
    """Whether the header tells the noise of every channel, or the samples had to."""
    sensor = dict(SENSORS)
    return HEADER if all(sensor[q] in run.recording.noise for q, _ in run.channels) else SAMPLES


def _sigmas(run: StaticRun) -> Array:
    """One sigma (n, c) of every row and channel."""
    sensor = dict(SENSORS)
    stated = [run.recording.noise.get(sensor[q]) for q, _ in run.channels]
    seen = scatter(run.departures() * np.sqrt(run.recording.weight)[:, None])
    one = np.array([s if s is not None else seen[i] for i, s in enumerate(stated)])
    if not np.all(one > 0):
        quantity, axis = run.channels[int(np.argmin(one))]
        raise InputError(
            f"the channel {quantity} {axis} of {run.recording.title!r} does not scatter at all: state its noise"
        )
    return one / np.sqrt(run.recording.weight)[:, None]


def scatter(d: Array) -> Array:
    """White sigma (c,) of rows d (n, c) from third differences, as `recording.scatter` does for raw samples."""
    third = np.diff(d, 3, axis=0)
    return np.asarray(np.sqrt(np.mean(third**2, axis=0) / 20) if len(third) else np.zeros(d.shape[1]))


def baseline(run: StaticRun, ids: Sequence[str] = BASELINE) -> tuple[Parameter, ...]:
    """Parameters of the named effects; a gimbal that was not read has no zero, but the inner one is servoed to its."""
    wanted = [p for i in ids for p in parameters(CATALOGUE[i], run.recording.platform.axis_names)]
    zeros = {axis for quantity, axis in run.channels if quantity == "gimbal_angle"} | {"inner"}
    return tuple(p for p in wanted if p.effect != "gimbal_zero" or p.axis in zeros)


def information_of_rows(
    run: StaticRun, effects: Sequence[Effect], wanted: Sequence[Parameter], J: Array | None = None
) -> Information:
    """Information of every row about the wanted parameters, linearised at the effects; values are full ones.

    J (n, c, p): the Jacobian there, where it is known already.
    """
    J = run.jacobian(effects, wanted) if J is None else J
    r = run.departures(effects) + J @ values(effects, wanted)
    return information(J / run.sigma[..., None], r / run.sigma, wanted)
