r"""Grades of inertial sensors: how large the usual imperfections of a unit are, against those of the catalogue.

The catalogue's prior sizes are those of navigation accelerometers (quartz flexure) and, for rates, near those of
tactical gyroscopes. A consumer unit has the same physics a hundred times larger. One factor for each quantity,

.. math:: \sigma_{unit} = k_{grade, quantity} \, \sigma_{catalogue}

so that with bias 500 ug, bias in temperature 10 ug/degC, drift 3 ug/h, scale factor 500 ppm, K2 30 ug/g^2 of the
catalogue and g-sensitivity 1 deg/h/g a unit of each grade usually has

=============================  ==========  ========  ==========  ========
usual size                     navigation  tactical  industrial  consumer
=============================  ==========  ========  ==========  ========
accelerometer bias [mg]               0.5         5          15        50
bias in temperature [ug/degC]          10       100         300      1000
warm-up [mg]                         0.05       0.5         1.5         5
bias instability [ug]                   3        30          90       300
scale factor [ppm]                    500      1500        5000     20000
misalignment [arcsec]                 120       240         720      3600
K2 [ug/g^2]                            30        90         600      3000
gyroscope bias [deg/h/degC]           0.1         3          30       200
g-sensitivity [deg/h/g]               0.1         3          30       200
gyroscope scale factor [ppm]          100      1000       10000     30000
=============================  ==========  ========  ==========  ========

Sources: Groves (2013), tables 4.1 and 4.2, for biases of the grades; data sheets for the rest: Honeywell QA2000 and
QA3000 (navigation); Northrop Grumman LN-200, Sensonor STIM300, Honeywell HG1930 (tactical); Analog Devices ADIS16448
and ADIS16488, Xsens MTi (industrial); InvenSense MPU-9150, Bosch BMI055, Analog Devices ADXL345 (consumer).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType

import numpy as np

from gimbalcal.earth import G0, HOUR
from gimbalcal.effects.effect import CATALOGUE, GYROSCOPE_STAGES, SENSOR_STAGES, Effect, Parameter
from gimbalcal.errors import InputError, list_of_alternatives
from gimbalcal.units import to_si

UG = 1e-6 * G0  # m/s^2
DEG_ROOT_H = np.pi / 180 / 60  # rad/sqrt(s) of one deg/sqrt(h)

MAX_SIZE_RATIO = 10.0  # usual sizes: rigs and raw units differ by some, a slip makes it hundreds
MAX_MISALIGNMENT_BY_HAND_RAD = np.radians(3.0)  # how far mounts of raw triads lie; a real one by Xsens is 1.2 deg off
MAX_SCALE_FACTOR_ERROR = 0.08  # data sheets of the cheapest units promise 3 %, and a tenth is a slip or a fault
DEG_H = np.pi / 180 / 3600
TURN_ON_GYRO_BIAS: Mapping[str, float] = MappingProxyType({  # rad/s, which noise does not show
    "navigation": 30 * DEG_H, "tactical": 1000 * DEG_H, "industrial": 1e4 * DEG_H, "consumer": 2e5 * DEG_H,
})  # fmt: skip

QUANTITY_OF_UNIT: Mapping[str, str] = MappingProxyType({
    **dict.fromkeys(("ug", "ug/h", "ug/degC", "ug/(degC/h)", "ug/V", "ug/hPa"), "offset"),
    **dict.fromkeys(("deg/h", "deg/h/h", "deg/h/g", "deg/h/degC", "deg/h/degC^2", "deg/h/degC^3"), "offset"),
    **dict.fromkeys(("ppm", "ppm/V"), "scale"),
    "ppm/degC": "scale in temperature",
    **dict.fromkeys(("arcsec", "urad/degC", "urad/g"), "angle"),
    **dict.fromkeys(("ug/g", "ug/g^2", "ug/g^3", "mg/g^2", "ug/degC^2", "ppm/(rad/s)"), "curvature"),
    **dict.fromkeys(("mm", "ms", "1"), "placing"),  # of the mounting and of the logger, not of the sensors
})  # fmt: skip
"""What the number of a sensor's parameter is, by its unit."""


@dataclass(frozen=True)
class Grade:
    """A grade: factors on the catalogue's sizes by quantity, and the noise up to which a unit is taken for it.

    Noise as a random walk, what the mean over one second scatters by: force_noise in m/s^2 sqrt(s), rate_noise in
    rad/s sqrt(s).
    """

    name: str
    force_noise: float
    rate_noise: float
    accelerometer: Mapping[str, float]
    gyroscope: Mapping[str, float]

    def factor(self, p: Parameter) -> float:
        """Return the ratio of the usual size to that of the catalogue; one for what is not of the sensors."""
        stage = CATALOGUE[p.effect].stage
        if stage not in GYROSCOPE_STAGES | SENSOR_STAGES:
            return 1.0
        sizes = self.gyroscope if stage in GYROSCOPE_STAGES else self.accelerometer
        return sizes.get(QUANTITY_OF_UNIT.get(p.unit, "offset"), 1.0)

    def most(self, p: Parameter) -> float:
        """Return the size [SI] beyond which a parameter is implausible in this grade; infinite if not of a sensor."""
        cls = CATALOGUE[p.effect]
        stated = next(f.metadata for f in fields(cls) if f.name == p.field)
        of_sensors = cls.stage in GYROSCOPE_STAGES | SENSOR_STAGES and QUANTITY_OF_UNIT.get(p.unit) != "placing"
        if not of_sensors or "sigma" not in stated:
            return np.inf
        least = {
            "arcsec": MAX_MISALIGNMENT_BY_HAND_RAD,
            "deg/h": TURN_ON_GYRO_BIAS[self.name] if p.effect == "gyro_bias" else 0.0,
        }
        size = max(MAX_SIZE_RATIO * self.factor(p) * float(to_si(stated["sigma"], p.unit)), least.get(p.unit, 0.0))
        return min(size, MAX_SCALE_FACTOR_ERROR) if QUANTITY_OF_UNIT.get(p.unit) == "scale" else size

    def usual(self, p: Parameter) -> Parameter:
        """Return the parameter with the prior sigma that it has in a unit of this grade."""
        return replace(p, sigma=self.factor(p) * p.sigma)

    def at_power_on(self, p: Parameter) -> Parameter:
        """Return the parameter with the prior sigma of a raw unit, whose gyroscope bias changes with power-on."""
        least = TURN_ON_GYRO_BIAS[self.name] / MAX_SIZE_RATIO if p.effect == "gyro_bias" else 0.0
        return replace(p, sigma=max(self.usual(p).sigma, least))


def drift_rate_factor(cls: type[Effect], duration_s: float) -> float:
    """Return by how much the usual and the largest rate per hour of an effect are multiplied in a recording.

    The factor is one, except for drifts in time in recordings of less than an hour: what a unit does in its first
    minutes it does not do for an hour.
    """
    return max(1.0, HOUR / max(duration_s, 1.0)) if cls.role.time_drift else 1.0


def _grade(
    name: str, force_noise: float, rate_noise: float, accelerometer: tuple[float, ...], gyroscope: tuple[float, ...]
) -> Grade:
    of = ("offset", "scale", "scale in temperature", "angle", "curvature")
    force, rate = (MappingProxyType(dict(zip(of, sizes, strict=True))) for sizes in (accelerometer, gyroscope))
    return Grade(name, force_noise * UG, rate_noise * DEG_ROOT_H, force, rate)


GRADES: Mapping[str, Grade] = MappingProxyType({
    g.name: g for g in (
        # noise up to ug/sqrt(Hz), deg/sqrt(h); then offset, scale, scale in temperature, angle, curvature
        _grade("navigation", 30, 0.02, (1, 1, 1, 1, 1), (0.1, 0.1, 0.1, 0.1, 0.1)),
        _grade("tactical", 100, 0.2, (10, 3, 1, 2, 3), (3, 1, 1, 1, 0.3)),
        _grade("industrial", 200, 1.0, (30, 10, 2, 6, 20), (30, 10, 2, 3, 1)),
        _grade("consumer", np.inf, np.inf, (100, 40, 4, 30, 100), (200, 30, 6, 12, 3)),
    )
})  # fmt: skip
"""By name, the best first."""


def most_of_any_unit(p: Parameter, duration_s: float) -> float:
    """Return the largest limit [SI] of a parameter among all grades, in a recording of this duration."""
    return drift_rate_factor(CATALOGUE[p.effect], duration_s) * max(grade.most(p) for grade in GRADES.values())


def grade_named(name: str) -> Grade:
    """Return the grade of this name. Raises InputError, with the names, where there is none."""
    if name not in GRADES:
        raise InputError(f"no grade is called {name!r}: choose {list_of_alternatives(list(GRADES))}")
    return GRADES[name]


def grade_of_noise(force: float | None, rate: float | None) -> Grade:
    """Return the grade of a unit whose accelerometers and gyroscopes scatter so, in m/s^2 sqrt(s) and rad/s sqrt(s).

    Of the two that the triads say the lower one: gyroscopes of consumer units are as quiet as tactical ones, and a
    prior that is too wide costs little, while one that is too narrow hides what is there.
    """
    enough = (g for g in GRADES.values() if (force or 0.0) <= g.force_noise and (rate or 0.0) <= g.rate_noise)
    return next(enough)
