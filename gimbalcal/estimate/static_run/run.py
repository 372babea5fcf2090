"""A static run prepared for fits: its readings with their noise, and its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.effects import CATALOGUE, Parameter, parameters
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.noise import HEADER, SAMPLES
from gimbalcal.number import Array
from gimbalcal.readings import Readings, readings
from gimbalcal.recording import Recording
from gimbalcal.recording.noise_levels import sample_sigma, stated
from gimbalcal.views.core import View
from gimbalcal.views.known_attitude import view_of_readings
from gimbalcal.views.noise import NoiseModel

PHASE, PHASE_SIGMA_RAD = "phi_0:polar", np.radians(1.0)  # many times what zeros and tilts make of it


def static_view(run: Readings, wanted: Sequence[Parameter]) -> View:
    """Return the view of the readings of a static run, in the noise of each row, for fits of the wanted parameters."""
    stages = dict.fromkeys(CATALOGUE[p.effect].stage for p in wanted)
    return view_of_readings(run, NoiseModel(run.sigma, stated=True), stages=stages)


def static_readings(recording: Recording) -> Readings:
    """The readings of a static run with their noise. Raises InputError where there is nothing to fit.

    Sigma is that of the header over the root of a row's weight; where the header is silent, what the rows scatter
    about the model.
    """
    if not recording.kind.stabilised:
        raise InputError(f"{recording.title!r} is a {recording.kind} recording where a static run is needed")
    run = readings(recording)
    return replace(run, sigma=_sigmas(run))


def noise_from(run: Readings) -> str:
    """Return whether the header tells the noise of every channel, or the samples had to."""
    return HEADER if set(dict(run.channels)) <= set(stated(run.recording)) else SAMPLES


def _sigmas(run: Readings) -> Array:
    """One sigma (n, c) of every row and channel."""
    one = sample_sigma(run.recording, run.channels, run.residual())
    if not np.all(one > 0):
        quantity, axis = run.channels[int(np.argmin(one))]
        raise InputError(
            f"the channel {quantity} {axis} of {run.recording.title!r} does not scatter at all: state its noise"
        )
    return np.asarray(one / np.sqrt(run.recording.weight)[:, None])


def static_parameters(run: Readings, ids: Sequence[str] = BASELINE["static-run"]) -> tuple[Parameter, ...]:
    """Parameters of the named effects; a gimbal that was not read has no zero, but the inner one is servoed to its.

    Of the platform's turn about the pole nothing is known beforehand: it is counted from S_t, whose constant is what
    the platform gimbal reads on average, zero and tilts included. Its size tells nothing of these.
    """
    r = run.recording
    wanted = [_free(r.grade.usual(p)) for i in ids for p in parameters(CATALOGUE[i], r.platform.axis_names)]
    zeros = {axis for quantity, axis in run.channels if quantity == "gimbal_angle"} | {"inner"}
    return tuple(p for p in wanted if p.effect != "gimbal_zero" or p.axis in zeros)


def _free(p: Parameter) -> Parameter:
    return replace(p, sigma=PHASE_SIGMA_RAD) if p.label == PHASE else p
