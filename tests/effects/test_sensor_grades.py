"""Grades: what the table says is what the factors make of the catalogue, and no quantity is forgotten."""

import re

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE, parameters, sensor_grades
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES
from gimbalcal.effects.sensor_grades import GRADES, QUANTITY_OF_UNIT, grade_named, grade_of_noise
from gimbalcal.units import from_si
from tests.golden import refused

G0 = 9.80665
TABLE = {
    "accelerometer bias [mg]": ("bias", "mg"),
    "bias in temperature [ug/degC]": ("bias_temperature", "ug/degC"),
    "warm-up [mg]": ("warm_up", "mg"),
    "bias instability [ug]": ("slow_bias_drift", "ug"),
    "scale factor [ppm]": ("scale_factor", "ppm"),
    "misalignment [arcsec]": ("misalignment", "arcsec"),
    "K2 [ug/g^2]": ("quadratic_nonlinearity", "ug/g^2"),
    "gyroscope bias [deg/h/degC]": ("gyro_bias_temperature", "deg/h/degC"),
    "g-sensitivity [deg/h/g]": ("gyro_g_sensitivity_rate", "deg/h/g"),
    "gyroscope scale factor [ppm]": ("gyro_scale_factor", "ppm"),
}


def test_the_table_is_what_the_factors_make_of_the_catalogue():
    rows = dict(re.findall(r"^(\S[^\n]*\]) +((?:[\d.]+ *){4})$", sensor_grades.__doc__ or "", re.MULTILINE))
    assert set(rows) == set(TABLE)
    for words, (effect, unit) in TABLE.items():
        p = parameters(CATALOGUE[effect])[0]
        made = [from_si(g.usual(p).sigma, unit) for g in GRADES.values()]
        np.testing.assert_allclose([float(x) for x in rows[words].split()], made, rtol=1e-9)


def test_every_number_of_a_sensor_has_a_quantity():
    of_sensors = [c for c in CATALOGUE.values() if c.stage in SENSOR_STAGES | GYROSCOPE_STAGES]
    assert {p.unit for c in of_sensors for p in parameters(c)} <= set(QUANTITY_OF_UNIT)


def test_navigation_accelerometers_and_mounts_are_as_the_catalogue_says():
    for cls in CATALOGUE.values():
        for p in parameters(cls, ("elevation", "azimuth")):
            if cls.stage not in GYROSCOPE_STAGES:
                assert GRADES["navigation"].usual(p) == p
            if cls.stage not in GYROSCOPE_STAGES | SENSOR_STAGES or p.unit in ("mm", "ms"):
                assert GRADES["consumer"].usual(p) == p


def test_each_grade_is_no_better_than_the_one_before():
    every = [p for c in CATALOGUE.values() for p in parameters(c)]
    factors = np.array([[g.factor(p) for p in every] for g in GRADES.values()])
    assert np.all(np.diff(factors, axis=0) >= 0)
    assert factors[-1].max() > 99


@pytest.mark.parametrize(
    ("force", "rate", "name"),
    [  # of a mean over 1 s, ug, and deg/sqrt(h), as data sheets print them
        (5, 0.003, "navigation"),  # QA2000 and a ring laser
        (35, 0.07, "tactical"),  # LN-200
        (60, 0.15, "tactical"),  # STIM300
        (187, 0.66, "industrial"),  # ADIS16448
        (280, 0.21, "consumer"),  # MPU-9150
        (280, None, "consumer"),
        (None, 0.003, "navigation"),
        (5, 0.3, "industrial"),  # of the two triads the lower one
    ],
)
def test_units_of_the_trade_find_their_grade(force, rate, name):
    f = None if force is None else force * 1e-6 * G0
    w = None if rate is None else np.deg2rad(rate) / 60
    assert grade_of_noise(f, w).name == name


def test_a_grade_that_is_none_is_refused_with_the_names():
    with refused():
        grade_named("space")
