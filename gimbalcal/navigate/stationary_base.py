"""Perfect recordings of a base at rest, to plan with and to navigate: the output of a navigator is its error."""

from __future__ import annotations

import numpy as np

from gimbalcal.earth import EARTH_RATE, normal_gravity, rate_at
from gimbalcal.forward.angles import ideal_angles
from gimbalcal.kinematics import ideal_force, required_latitude
from gimbalcal.number import Array
from gimbalcal.platform import BENCH, SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.kinds import ROTATION, STATIC_RUN

ROW = 600.0  # s between the rows at which the position error is evaluated; the navigator has its own steps
STATIC_ROWS = 289  # every 10 min over 48 h: thinning, with the weight kept, leaves the information of slow signals


def still_base(hours: float, site: Site) -> Recording:
    """Return a perfect static run, a row every ten minutes."""
    plan = ideal_static_run(hours, float(site.latitude or 0.0), ROW, rows=round(3600 * hours / ROW) + 1)
    plan = Recording(STATIC_RUN, "still base", plan.platform, site, {}, plan.time, None, plan.channels)
    force = ideal_force(plan, plan.angles())
    felt = {("specific_force", a): force[:, i] for i, a in enumerate("xyz")}
    return Recording(STATIC_RUN, "still base", plan.platform, site, {}, plan.time, None, {**plan.channels, **felt})


def still_unit(hours: float, site: Site, C_bn: Array) -> Recording:
    """Return a perfect strapdown unit at rest with attitude C_bn (3, 3), a row every ten minutes."""
    time = ROW * np.arange(1, round(hours * 3600 / ROW) + 1)
    felt = {
        "specific_force": C_bn.T @ [0.0, 0.0, -site.gravity],
        "angular_rate": C_bn.T @ rate_at(required_latitude(site.latitude)),
    }
    channels = {(q, a): np.full(len(time), v[i]) for q, v in felt.items() for i, a in enumerate("xyz")}
    return Recording(ROTATION, "still base", BENCH, site, {}, time, None, channels)


def ideal_static_run(hours: float, latitude: float, sample_s: float, rows: int = STATIC_ROWS) -> Recording:
    """Return ideal gimbal readouts of a static run, thinned to `rows` that carry the weight of all samples."""
    platform, time = SPACE_STABLE_INERTIAL, np.linspace(0.0, hours * 3600, rows)
    angles = ideal_angles(platform, EARTH_RATE * time, latitude)
    channels = {("gimbal_angle", a): angles[:, i] for i, a in enumerate(platform.axis_names)}
    weight = np.full(len(time), max(hours * 3600 / sample_s / len(time), 1.0))
    site = Site(latitude=latitude, gravity=float(normal_gravity(latitude)))
    return Recording(STATIC_RUN, "plan", platform, site, {}, time, None, channels, weight=weight)
