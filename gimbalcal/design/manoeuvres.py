"""What could be recorded in addition at known attitude: manoeuvres, and the recordings that they would make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.recording import Recording


@dataclass(frozen=True)
class Manoeuvre:
    """One thing to do on the bench: in words, hours it takes, and the recording it would add to."""

    words: str
    hours: float
    apply: Callable[[Recording], Recording]


def available_manoeuvres(recording: Recording) -> tuple[Manoeuvre, ...]:
    """Manoeuvres for this kind of recording; none where it makes a view of its own, whose attitude no gimbal states."""
    if recording.kind.view:
        return ()
    hours = float(recording.time[-1] - recording.time[0]) / 3600.0
    if recording.kind.stabilised:
        return (Manoeuvre("let the run go on as long again", hours, _twice_as_long),)
    out = [
        Manoeuvre("repeat the positions in reversed order", hours, lambda r: second_pass(r, reverse=True)),
        Manoeuvre("wait 6 h and repeat the positions", hours + 6, lambda r: second_pass(r, pause=6 * 3600.0)),
        Manoeuvre("take the positions with gimbals at 30 and 60 degrees", hours, lambda r: second_pass(r, share=2 / 3)),
    ]
    if {"inner", "middle"} <= set(recording.axes("gimbal_angle")):
        words = "repeat the positions with the other gimbal solution"
        out.append(Manoeuvre(words, hours, lambda r: second_pass(r, other=True)))
    if recording.has("temperature"):
        out.append(
            Manoeuvre("repeat the positions 6 degC warmer", hours + 2, lambda r: second_pass(r, 7200.0, warmer=6.0))
        )
    return tuple(out)


def second_pass(
    r: Recording, pause: float = 60.0, *, reverse: bool = False, share: float = 1.0, other: bool = False,
    warmer: float = 0.0,
) -> Recording:  # fmt: skip
    """The recording followed by a second pass: in reverse order, over part of the angles, flipped, or warmer."""
    order = np.arange(len(r.time))[:: -1 if reverse else 1]
    channels = {}
    for (quantity, axis), v in r.channels.items():
        second = v[order] * (share if quantity == "gimbal_angle" else 1.0)
        second = second + (warmer if quantity == "temperature" else 0.0)
        if other and quantity == "gimbal_angle" and axis in ("inner", "middle"):
            second = second + np.pi if axis == "inner" else np.pi - second
        channels[quantity, axis] = np.concatenate([v, second])
    moved = r.time[-1] - r.time[order] if reverse else r.time - r.time[0]
    time = np.concatenate([r.time, r.time[-1] + r.step + pause + moved])
    position = None if r.position is None else np.concatenate([r.position, r.position[order]])
    return replace(
        r, time=time, position=position, channels=channels, weight=np.concatenate([r.weight, r.weight]), duration=None
    )


def _twice_as_long(r: Recording) -> Recording:
    """A static run of twice the length; readouts go on as the Earth turns."""
    twice, platform = second_pass(r, pause=0.0), ("gimbal_angle", "platform")
    if platform not in r.channels:
        return twice
    turn = EARTH_RATE * (twice.time[len(r.time)] - r.time[0])
    return twice.with_channels(
        {platform: twice.channels[platform] + turn * (np.arange(len(twice.time)) >= len(r.time))}
    )
