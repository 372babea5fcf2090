"""Units: each factor against an independent value, and each refusal by its text."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gimbalcal.quantities import QUANTITIES, refuse_unit
from gimbalcal.units import ATOMS, celsius, from_si, is_raw, parse, to_si
from tests.golden import refused

# Worked by hand from the definitions: 1 g = 9.80665 m/s^2, 1 h = 3600 s, 360 deg = 2 pi rad.
BY_HAND = [
    ("ug", 9.80665e-6),
    ("mGal", 1e-5),
    ("deg/h", math.pi / 180 / 3600),
    ("deg/sqrt(h)", math.pi / 180 / 60),
    ("ug/sqrt(h)", 9.80665e-6 / 60),
    ("ug/h", 9.80665e-6 / 3600),
    ("ug/g^2", 1e-6 / 9.80665),
    ("ug/g^3", 1e-6 / 9.80665**2),
    ("deg/h/g", math.pi / 180 / 3600 / 9.80665),
    ("deg/h/degC", math.pi / 180 / 3600),
    ("arcsec/g", 4.84813681109536e-6 / 9.80665),
    ("ug/(degC/h)", 9.80665e-6 * 3600),
    ("ug/degC^2", 9.80665e-6),
    ("ug/hPa", 9.80665e-8),
    ("ug/uT", 9.80665),
    ("ppm/V", 1e-6),
    ("arcmin", math.pi / 10800),
]


@pytest.mark.parametrize(("unit", "factor"), BY_HAND)
def test_factor_is_the_one_worked_by_hand(unit, factor):
    assert to_si(1.0, unit) == pytest.approx(factor, rel=4e-16 * 8)  # a few roundings of a product


@pytest.mark.parametrize(
    ("fancy", "plain"),
    [("m/s²", "m/s^2"), ("µg/√h", "ug/sqrt(h)"), ("°/h", "deg/h"), ("m*s^-2", "m/s^2"), ("°C", "degC")],
)
def test_other_spellings_mean_the_same(fancy, plain):
    assert parse(fancy).dimension == parse(plain).dimension
    assert parse(fancy).factor == pytest.approx(parse(plain).factor, rel=1e-15)


def test_random_walk_is_not_a_rate():
    assert parse("deg/sqrt(h)").dimension != parse("deg/h").dimension


@given(st.sampled_from(sorted(ATOMS)), st.floats(-1e9, 1e9))
def test_there_and_back(unit, value):
    assert from_si(to_si(value, unit), unit) == pytest.approx(value, rel=1e-15, abs=1e-300)


def test_arrays_keep_their_shape():
    degrees = np.array([[0.0, 90.0], [180.0, 360.0]])
    np.testing.assert_allclose(to_si(degrees, "deg"), np.pi * np.array([[0, 0.5], [1, 2]]), rtol=1e-15)


def test_thermometers_end_in_celsius():
    assert celsius(300.0, "K") == pytest.approx(26.85)
    assert celsius(68.0, "degF") == pytest.approx(20.0)
    assert celsius(21.5, "degC") == 21.5


def test_counts_are_raw_and_forces_are_not():
    assert is_raw("count")
    assert is_raw("pulse/s")
    assert not is_raw("ug")


@pytest.mark.parametrize("quantity", sorted(QUANTITIES))
def test_every_listed_unit_is_accepted(quantity):
    for unit in QUANTITIES[quantity].units:
        refuse_unit(unit, quantity)


def test_unknown_unit_lists_the_known_ones():
    with refused():
        refuse_unit("mps2", "specific_force")


def test_unit_of_another_quantity_is_refused():
    with refused():
        refuse_unit("deg", "specific_force")


@pytest.mark.parametrize("text", ["", "m//s", "m/", "sqrt(h", "m^", "m^x", "furlong", "deg/h)", "ug^-inf",
                                  "g^nan", "ug^70", "ug^400", "ug^-35*ug^-35"])  # fmt: skip
def test_nonsense_is_refused(text):
    with refused():
        parse(text)


def test_a_covariate_may_have_any_unit_but_a_known_one():
    refuse_unit("V", "covariate")
    with refused():
        refuse_unit("bananas", "covariate")
