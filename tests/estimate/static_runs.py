"""Static runs made by the forward model, for tests of the system level."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, with_values
from gimbalcal.estimate.fit import fit, information_of
from gimbalcal.estimate.static_run.system import static_parameters, static_readings, static_view
from gimbalcal.forward import predict
from gimbalcal.inference.information import Information
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording, Site
from tests.stimuli import LATITUDE, G, static

ARCSEC = np.deg2rad(1 / 3600)
NOISE = {"accelerometer": 6.5e-5, "gimbal_angle": 0.5 * ARCSEC, "attitude": 0.5 * ARCSEC}

# Wu et al. (2018), Tables 2 and 3: errors of the estimate, so true parameters are their negatives
TABLE_2_3: tuple[Effect, ...] = (
    CATALOGUE["scale_factor"](s=-np.array([1e-4, 2e-4, -1e-4])),  # type: ignore[call-arg]
    CATALOGUE["bias"](b=-np.array([-1e-3, 5e-4, 1e-3])),  # type: ignore[call-arg]
    CATALOGUE["misalignment"](beta=-ARCSEC * np.array([-10.0, 5, 10, 5, -5, -5])),  # type: ignore[call-arg]
)


def draw(rng: np.random.Generator, ids: tuple[str, ...], share: float = 0.3) -> tuple[Effect, ...]:
    """Effects with parameters drawn from a part of their prior; a gimbal that is never read has no zero."""
    names = SPACE_STABLE_INERTIAL.axis_names
    wanted = [p for i in ids for p in parameters(CATALOGUE[i], names)]
    x = [0.0 if p.axis == "inner" else rng.normal() * p.sigma * share for p in wanted]
    return with_values((), wanted, np.array(x), names)


def run(
    truth: tuple[Effect, ...] = (),
    rng: np.random.Generator | None = None,
    hours: float = 48.0,
    step: float = 600.0,
    noise: Mapping[str, float] = NOISE,
) -> Recording:
    """A static run at 40 deg N with all nine channels; without rng free of noise."""
    s = static(hours, step)
    names = SPACE_STABLE_INERTIAL.axis_names
    blank = Recording(
        kind="static-run", title="made up", platform=SPACE_STABLE_INERTIAL, site=Site(LATITUDE, 0.0, G),
        noise=noise, time=s.time, position=None,
        channels={("gimbal_angle", a): s.readout[:, i] for i, a in enumerate(names)},
    )  # fmt: skip
    out = predict(blank.platform, stimulus_from_angles(blank), truth, "static-run")
    axes = {"specific_force": ("x", "y", "z"), "gimbal_angle": names, "attitude_error": ("roll", "pitch", "yaw")}
    sensor = {"specific_force": "accelerometer", "gimbal_angle": "gimbal_angle", "attitude_error": "attitude"}
    channels = {}
    for q, values in out.items():
        for i, axis in enumerate(axes[q]):
            if axis != "inner":
                e = rng.normal(size=len(values)) * noise[sensor[q]] if rng is not None else 0.0
                channels[q, axis] = values[:, i] + e
    return dataclasses.replace(blank, channels=channels)


def static_information(
    recording: Recording, effects: Sequence[Effect] = (), wanted: Sequence[Parameter] | None = None
) -> Information:
    """Return the information of a static run about the wanted parameters, linearised at its own estimate."""
    readings = static_readings(recording)
    wanted = static_parameters(readings) if wanted is None else wanted
    found = fit([static_view(readings)], wanted, effects)
    return information_of(found.views, found.effects, wanted)
