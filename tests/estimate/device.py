"""Multi-position recordings made from the forward model, one row per dwell, to test and measure estimators on."""

from dataclasses import replace

import numpy as np

from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Recording, Site
from gimbalcal.schedule import EIGHTEEN_POSITIONS, Schedule
from gimbalcal.units import to_si
from gimbalcal.views.core import View
from gimbalcal.views.positions import Noise, planned_recording, position_parameters, view_of_positions

ARCSEC = np.pi / 648000
SAMPLE = 1.96e-4  # m/s^2 of one sample: 20 ug
SAMPLES = 120  # one a second for two minutes
SITE = Site(gravity=9.80146)
PARAMETERS = position_parameters(SPACE_STABLE)
# typical sizes of a navigation platform, half the prior of the catalogue or less
SIZES = {
    "scale_factor": to_si(200.0, "ppm"),
    "bias": to_si(100.0, "ug"),
    "scale_nonlinearity": to_si(10.0, "ug/g^2"),
    "misalignment": 20 * ARCSEC,
    "gimbal_zero": 20 * ARCSEC,
}
NOISE = Noise(SAMPLE, ARCSEC)
STATED = {"accelerometer": SAMPLE, "gimbal_angle": 1.0 * ARCSEC}


def draw(rng: np.random.Generator, wanted: tuple[Parameter, ...] = PARAMETERS) -> np.ndarray:
    """A truth (p,) of typical size, SI."""
    return np.array([SIZES[q.effect] for q in wanted]) * rng.normal(size=len(wanted))


def measured(
    truth: np.ndarray,
    rng: np.random.Generator,
    setting: float = ARCSEC,
    schedule: Schedule = EIGHTEEN_POSITIONS,
    readouts: np.ndarray | None = None,
    samples: int = SAMPLES,
) -> Recording:
    """Dwell means at `readouts` (the schedule's if None) [rad], with setting errors and white noise, both stated."""
    plan = replace(planned_recording(schedule, samples, SITE), noise={**STATED, "gimbal_angle": setting})
    if readouts is not None:
        names = schedule.platform.axis_names
        plan = plan.with_channels({("gimbal_angle", a): readouts[:, i] for i, a in enumerate(names)})
    view = view_of_positions(plan, NOISE)
    e = setting * rng.normal(size=view.local.zero_values.shape)
    force = outputs(view, effects(truth), e) + SAMPLE / np.sqrt(samples) * rng.normal(size=(len(e), 3))
    return plan.with_channels({("specific_force", a): force[:, i] for i, a in enumerate("xyz")})


def outputs(view: View, effects: tuple[Effect, ...], e: np.ndarray | None = None) -> np.ndarray:
    """Outputs (n, 3) [m/s^2] of a unit whose gimbals stand off their readouts by e (m, k) [rad] at each visit."""
    return (
        view.source.triad("specific_force")
        - view.local.evaluate(effects, view.local.zero_values if e is None else e).residual
    )


def effects(truth: np.ndarray) -> tuple:
    """The truth as effects."""
    return with_values((), PARAMETERS, truth, SPACE_STABLE.axis_names)


def interchanged(recording: Recording, i: int, j: int) -> Recording:
    """The recording with the readings of rows i and j in each other's place."""
    order = np.arange(len(recording.time))
    order[[i, j]] = j, i
    force = {k: v[order] for k, v in recording.channels.items() if k[0] == "specific_force"}
    return recording.with_channels(force)


def misread(recording: Recording, row: int, axis: str, angle: float) -> Recording:
    """The recording with one gimbal readout off by `angle` [rad]."""
    readout = recording.channels["gimbal_angle", axis].copy()
    readout[row] += angle
    return recording.with_channels({("gimbal_angle", axis): readout})
