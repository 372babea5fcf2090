"""One physics under two ids: the same law, read by a strapdown unit and integrated by a platform that is held."""

from dataclasses import fields

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE, Stage, parameters
from gimbalcal.effects.history import integral
from gimbalcal.forward import predict
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.units import parse
from tests.effects.stimulus import example, given
from tests.stimuli import G, static

PAIRS = [
    ("gyro_drift", "gyro_bias"),
    ("gyro_g_sensitivity", "gyro_g_sensitivity_rate"),
    ("quadratic_nonlinearity", "scale_nonlinearity"),
]
HELD = [(a, b) for a, b in PAIRS if CATALOGUE[a].stage is Stage.PLATFORM]


def with_coefficients(name, x):
    """The effect with the values x in its only field."""
    (field,) = fields(CATALOGUE[name])
    return CATALOGUE[name](**{field.name: x})


def coefficients(effect):
    (field,) = fields(effect)
    return np.asarray(getattr(effect, field.name))


@pytest.mark.parametrize(("name", "other"), PAIRS)
def test_a_pair_has_the_same_coefficients_in_the_same_unit(name, other):
    mine, theirs = (parameters(CATALOGUE[i]) for i in (name, other))
    assert [parse(p.unit) for p in mine] == [parse(p.unit) for p in theirs]


@pytest.mark.parametrize(("name", "other"), [p for p in PAIRS if p not in HELD])
def test_two_names_of_one_law_add_the_same(name, other):
    made, s = example(name), given()
    np.testing.assert_array_equal(made.contribution(s), with_coefficients(other, coefficients(made)).contribution(s))


@pytest.mark.parametrize(("name", "other"), HELD)
def test_a_platform_adds_up_what_the_strapdown_law_reads(name, other):
    made, s = example(name), given()
    read = with_coefficients(other, coefficients(made)).contribution(s)
    assert CATALOGUE[other].stage is Stage.GYROSCOPE
    expected = integral(read, s.time)
    np.testing.assert_allclose(made.contribution(s), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(("name", "other"), HELD)
def test_a_held_platform_turns_so_that_its_gyroscopes_read_nothing(name, other):
    """On a platform that turns as `predict` says, gyroscopes with the negatives of its coefficients read zero.

    Axes that have turned by phi see a force f as f - phi x f.
    """
    s = static(6.0, 300.0)
    drift = with_coefficients(name, 2e-9 * np.arange(1.0, 1 + len(parameters(CATALOGUE[name]))))
    misread = with_coefficients(other, -coefficients(drift)).contribution(s)
    phi = integral(-misread, s.time)  # 0 = omega + what is misread
    f, f0 = (predict(SPACE_STABLE_INERTIAL, s, e, "static-run")["specific_force"] for e in ((drift,), ()))
    largest = np.abs(phi).max()
    assert 1e-5 < largest < 1e-2
    # products of two angles
    np.testing.assert_allclose(f - f0, -np.cross(phi, f0), rtol=0, atol=3 * largest**2 * G)
