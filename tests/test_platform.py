"""The gimbal chain: Table 1 and Eq. (4) of Wu et al. (2018) are one and the same."""

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from gimbalcal.platform import BENCH, KNOWN, SPACE_STABLE, SPACE_STABLE_INERTIAL, Axis, Platform, known_platform
from gimbalcal.rotation import frame_rotation

angle = st.floats(-4, 4)


def eq4(S, h, q, m=np):
    """C_b^p as printed in Wu et al. (2018), Eq. (4); m is numpy or sympy."""
    s, c = m.sin, m.cos
    return [
        [-c(S) * s(h) * c(q) - s(S) * s(q), c(S) * s(h) * s(q) - s(S) * c(q), -c(S) * c(h)],
        [-s(S) * s(h) * c(q) + c(S) * s(q), s(S) * s(h) * s(q) + c(S) * c(q), -s(S) * c(h)],
        [c(h) * c(q), -c(h) * s(q), -s(h)],
    ]


@given(S=angle, h=angle, q=angle)
def test_both_readouts_are_eq4(S, h, q):
    printed = np.array(eq4(S, h, q))
    np.testing.assert_allclose(SPACE_STABLE_INERTIAL.attitude([S, 0, h, q]), printed, atol=4e-15)
    np.testing.assert_allclose(SPACE_STABLE.attitude([-S, 0, h + np.pi / 2, -q]), printed, atol=4e-15)


def test_eq4_symbolically():
    S, h, q = sympy.symbols("S h q", real=True)
    chain = SPACE_STABLE.attitude(np.array([-S, sympy.Integer(0), h + sympy.pi / 2, -q], dtype=object))
    difference = sympy.Matrix(chain.tolist()) - sympy.Matrix(eq4(S, h, q, sympy))
    assert sympy.simplify(difference) == sympy.zeros(3)


def test_table_1_convention():
    t = np.deg2rad([20.0, 30.0, 40.0])
    expected = frame_rotation("z", t[0]) @ frame_rotation("x", t[1]) @ frame_rotation("y", t[2]) @ [0, 0, 1]
    np.testing.assert_allclose(SPACE_STABLE.attitude([*t, 0.7]) @ [0, 0, 1], expected, atol=1e-15)


def test_tilts_are_inserted_outside_their_axis():
    two = Platform("two", (Axis("inner", "z"), Axis("outer", "x")))
    tilts = np.zeros((2, 3))
    tilts[0, 1] = 1e-3
    expected = frame_rotation("z", 0.3) @ frame_rotation("y", 1e-3) @ frame_rotation("x", -0.2)
    np.testing.assert_allclose(two.attitude([0.3, -0.2], tilts), expected, atol=1e-16)


def test_wrong_number_of_angles_says_what_was_expected():
    with pytest.raises(ValueError, match=r"must have shape \(\.\.\., 4\) for the 4-axis platform 'space-stable'"):
        SPACE_STABLE.attitude(np.zeros((100, 2)))


def test_a_unit_without_gimbals_has_the_identity():
    np.testing.assert_array_equal(BENCH.attitude(np.zeros((5, 0))), np.broadcast_to(np.eye(3), (5, 3, 3)))


def test_known_picks_the_inertial_readout_for_a_static_run():
    assert known_platform("space-stable", "static-run") is SPACE_STABLE_INERTIAL
    assert known_platform("space-stable") is KNOWN["space-stable"]
    assert known_platform("unheard of") is None


def test_axis_refuses_a_direction_it_does_not_know():
    with pytest.raises(ValueError, match="direction x, y or z"):
        Axis("roll", "w")
