r"""A pointing run as rows: where each star was seen against where it is, across the innermost axis' plane and along it.

.. math:: r = 0 - (y, -z) \, \text{of} \, C_b^p(\text{true angles}) \, v(\text{readouts, effects}),

with v the direction in which the mount with these effects looks: a perfect model sees every star on its target.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.errors import InputError
from gimbalcal.forward import AXES, Rows, linearise
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import Array
from gimbalcal.recording import Recording

STAGES = frozenset({Stage.ENCODER, Stage.AXIS_TILT, Stage.BASE, Stage.LINE_OF_SIGHT})
CHANNELS = tuple(("pointing", axis) for axis in AXES["pointing"])
NIGHT = 6 * 3600.0  # s; a longer pause ends a night


def on_stars(recording: Recording) -> Stimulus:
    """What the mount experienced; every star is a visit of its own.

    Moves are told by where the stars are: readouts of an axis that stands still move by their noise.
    """
    s = stimulus_from_angles(recording)
    n = len(recording.time)
    aimed = recording.platform.angles({a: x for (q, a), x in recording.channels.items() if q == "true_angle"}, (n,))
    moved = np.diff(aimed, axis=0, prepend=aimed[:1])
    return s.at(visit=np.arange(n), position=np.arange(1, n + 1), since_move=0 * s.time, move_angle=moved)


def against_stars(recording: Recording, s: Stimulus, effects: Sequence[Effect]) -> Rows:
    """The rows of a pointing run (n, 2) about the effects; nothing is read but that the star is on target."""
    on_target = np.zeros((len(s.time), len(CHANNELS)))
    return linearise(recording.platform, s, effects, "pointing", CHANNELS, on_target, STAGES)


def read_axes(recording: Recording) -> tuple[str, ...]:
    """The axes of the mount that have a readout and a true angle, innermost first; InputError if they are not two.

    Other axes of the platform belong to its drawing: the fixed tilt of a polar axis.
    """
    names = recording.platform.axis_names
    axes = tuple(a for a in names if ("gimbal_angle", a) in recording.channels)
    missing = [a for a in axes if ("true_angle", a) not in recording.channels]
    if missing:
        raise InputError(
            f"{recording.title!r} does not say where the stars were: it needs a true_angle along "
            f"{' and '.join(missing)}; add the column to [columns] of its recording.toml"
        )
    if len(axes) != 2 or names[: len(axes)] != axes:
        raise InputError(
            f"{recording.title!r} has readouts of {', '.join(axes) or 'no axis'}: a pointing run needs those of the "
            "two innermost axes of its platform"
        )
    return axes


def nights(recording: Recording) -> tuple[Recording, ...]:
    """The recording cut where it pauses for more than `NIGHT`; one that does not is its only night."""
    cuts = [0, *(np.flatnonzero(np.diff(recording.time) > NIGHT) + 1).tolist(), len(recording.time)]
    return tuple(recording.select(slice(a, b)) for a, b in pairwise(cuts))


def starting_zeros(recording: Recording, axes: Sequence[str]) -> Array:
    """Median of true angle minus readout (2,) [rad] of the read axes, within half a turn: where a fit begins."""
    off = [recording.channels["true_angle", a] - recording.channels["gimbal_angle", a] for a in axes]
    middle = [np.angle(np.median(np.cos(d)) + 1j * np.median(np.sin(d))) for d in off]
    return np.array(middle)
