"""The noises over which the diagnosis of a view integrates: of a known scale, or of any."""

from __future__ import annotations

import numpy as np

from gimbalcal.diagnose.evidence.correlated_noise import (
    noises_of_channels,
    noises_of_unknown_scale,
    single_walks,
    walks_of_triads,
)
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.stated_noise import noise_grid
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, View


def possible_noises(fit: Fit, memory: bool = True) -> tuple[Node, ...]:
    """Return the possible noises of a fit's rows with their prior probabilities; without `memory` white noise alone."""
    if fit.view.noise.scale_known:
        return noise_grid(fit)
    every = _of_any_scale(fit.view)
    return every if memory else every[:1]


def _of_any_scale(v: View) -> tuple[Node, ...]:
    """Return the noises of a view of unknown scale: the same for every model of it."""
    if "noises" not in v.cache:
        n, C = len(v), len(v.channels)
        if v.noise.own_memories:
            every = noises_of_channels(n, C)
        else:
            every = noises_of_unknown_scale(n, C, v.noise.wander, v.groups)
        if v.noise.triad_walks:
            courses = {quantity: _sensor_courses(v, quantity) for quantity in v.measurement.acts_on}
            every += walks_of_triads(courses, C, float(np.ptp(v.stimulus.time)), v.noise.triad_walks)
        if v.noise.single_walks and v.noise.wander is not None:
            weight, walks = v.of_scales().weight, v.noise.single_walks
            every += single_walks(v.noise.wander, weight, v.stimulus.time, v.channels[0][0], walks)
        v.cache["noises"] = every
    return v.cache["noises"]


def _sensor_courses(v: View, quantity: str) -> Array:
    """Return the reduced rows (R, 3, m) of the courses in time of the sensors of a triad."""
    each = [v.noise.reduced(v.course_of_sensor(quantity, axis)) for axis in "xyz"]
    return np.stack(each, axis=1)
