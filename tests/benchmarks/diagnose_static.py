"""Static runs for the benchmark of the diagnosis, made by `gimbalcal.simulate`.

They share the forward model with the diagnosis: what they show is the search among effects that really are of the
catalogue (an inverse crime), not that the catalogue describes hardware. The device arms do not share a line.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Recording
from gimbalcal.simulate import simulate
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose.law_plants import Law

if TYPE_CHECKING:
    from tests.benchmarks.diagnose_runs import Run

BASE: dict[str, Any] = {
    "format": 1, "kind": "static-run", "title": "static run with something left out",
    "site": {"latitude": {"value": 40.0, "unit": "deg"}},
    "schedule": {"duration": {"value": 48.0, "unit": "h"}, "rate": {"value": 1 / 60, "unit": "Hz"}},
    "environment": {"temperature": {"shape": "random-walk", "mean": 22.0, "walk": 0.5}, "thermometer_sigma": 0.01},
    "noise": {
        "accelerometer": {"value": 3.0, "unit": "ug"}, "gimbal_angle": {"value": 1.0, "unit": "arcsec"},
        "attitude": {"value": 0.3, "unit": "arcsec"},
    },
}  # fmt: skip
AXIS = {  # concealed effect: the axis of its parameter
    "bias_drift": "x", "warm_up": "y", "bias_temperature": "z", "scale_temperature": "x", "cubic_nonlinearity": "y",
    "scale_factor_asymmetry": "x", "cross_coupling": "xy", "bias_step": "y", "base_tilt_drift": "north",
    "gyro_drift": "polar", "encoder_two_cycle": "platform", "schuler_oscillation": "roll",
}  # fmt: skip
CONSTANTS = {"warm_up": {"tau": 5.0}, "bias_step": {"epoch": 1e5}}
TWINS = {
    "cubic_nonlinearity": ("odd_quadratic", "soft_saturation"), "gyro_drift": ("clock_rate",),
    "encoder_two_cycle": ("base_tilt_diurnal",),
}  # fmt: skip
PROBE = 10.0  # printed units


def static_recording(run: Run) -> tuple[Recording, tuple[Law, ...], tuple[float, ...]]:
    """48 h of minute values with an effect of so many sigmas, or with none; its size in printed units."""
    if not run.concealed:
        return _made(run.seed, "", 0.0), (), ()
    (effect,) = run.concealed
    axis = AXIS[effect]
    size = PROBE * run.sigmas / _strength(_made(run.seed, effect, PROBE), _made(run.seed, effect, 0.0))
    parameter = next(p for p in parameters(CATALOGUE[effect], SPACE_STABLE.axis_names) if p.axis == axis)
    named = axis if axis in ("platform", "north", "polar", "roll") else axis[0]
    truth = (((parameter.name, axis), 1.0),)
    return _made(run.seed, effect, size), (Law(_none, (effect, *TWINS.get(effect, ())), named, truth),), (size,)


def _none(_: object) -> dict[str, Array]:
    return {}


def _made(seed: int, effect: str, size: float) -> Recording:
    truth: dict[str, Any] = {"draw": True}
    if effect:
        truth[effect] = {AXIS[effect]: size, **CONSTANTS.get(effect, {})}
    return simulate({**BASE, "truth": truth}, seed)[0]


def _strength(with_it: Recording, without: Recording) -> float:
    """Sigmas above noise after the calibration took what it can."""
    o = fit_baseline(view_at_known_attitude(without))
    d = np.stack([with_it.channels[k] - without.channels[k] for k in o.view.channels], axis=-1)
    angle = np.array([k[0] == "gimbal_angle" for k in o.view.channels])
    d = np.where(angle, (d + np.pi) % (2 * np.pi) - np.pi, d)  # the platform gimbal is read within one turn
    y = o.reduced((d / o.sigma)[:, :, None])[:, 0]
    Q = orthonormal(o.reduced(o.Z))
    return float(np.linalg.norm(y - Q @ (Q.T @ y)))
