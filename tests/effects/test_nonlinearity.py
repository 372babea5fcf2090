"""Curves of an accelerometer: what they add at one g and on the edges, and what polynomials cannot tell apart."""

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.units import from_si, to_si
from tests.effects.stimulus import given, made

LEVELS = np.array([-1.0, -np.sqrt(0.5), 0.0, np.sqrt(0.5), 1.0])  # g, inputs of the 18 positions


def curve(name, inputs=LEVELS, **values):
    """What the x axis adds (m,) [ug] at these inputs [g]."""
    n = len(inputs)
    s = given()
    force = np.zeros((n, 3))
    force[:, 0] = inputs * G0
    return np.asarray(from_si(made(name, **values).contribution(s.at(force=force, time=np.arange(n)))[:, 0], "ug"))


def test_k2_adds_alike_on_both_faces_and_half_of_it_on_the_edges():
    K = to_si(30.0, "ug/g^2")
    # 4 K^2 g: 0.002 ug of the second order
    np.testing.assert_allclose(curve("quadratic_nonlinearity", K2=[K, 0, 0]), [30, 15, 0, 15, 30], atol=0.004)
    np.testing.assert_allclose(curve("scale_nonlinearity", K_nl=[K, 0, 0]), [30, 15, 0, 15, 30], atol=0.004)


def test_k2_solves_the_implicit_equation_of_the_sensor():
    K, u = to_si(3000.0, "ug/g^2"), np.linspace(-G0, G0, 9)
    w = u + to_si(curve("quadratic_nonlinearity", u / G0, K2=[K, 0, 0]), "ug")
    np.testing.assert_allclose(w, u + K * w**2, atol=1e-12)


def test_odd_curves_change_their_sign_with_the_force_and_even_ones_do_not():
    x = np.linspace(-1.2, 1.2, 13)
    knee = {"c": [to_si(1.0, "mg/g^2"), 0, 0]}
    for name, values in {"cubic_nonlinearity": {"K3": [1.0, 0, 0]}, "odd_quadratic": {"K_oq": [1.0, 0, 0]},
                         "dead_zone": {"d": [1e-4, 0, 0]}, "soft_saturation": knee}.items():  # fmt: skip
        y = curve(name, x, **values)
        np.testing.assert_allclose(y, -y[::-1], rtol=1e-12)
        assert np.abs(y).max() > 0
    y = curve("scale_factor_asymmetry", x, S=[1e-5, 0, 0])
    np.testing.assert_allclose(y, 10 * np.abs(x), atol=1e-12)  # 10 ppm


def test_the_curve_of_the_readout_holds_nothing_that_a_cubic_would_take_up():
    x, weight = np.polynomial.legendre.leggauss(12)
    coefficients = {f"c_{n}": [to_si(3.0, "ug"), 0, 0] for n in (4, 5, 6, 7)}
    y = curve("readout_curve", x, **coefficients)
    for power in range(4):
        assert abs((weight * y * x**power).sum()) < 1e-12
    np.testing.assert_allclose(curve("readout_curve", **coefficients)[[0, -1]], [0, 12], atol=1e-12)  # P_n(-1) = (-1)^n


def test_at_five_levels_the_readout_shows_one_even_and_one_odd_shape_beyond_the_line():
    shapes = [curve("readout_curve", **{f"c_{n}": [1e-5, 0, 0]}) for n in (4, 5, 6, 7)]
    line, bends = [np.ones(5), LEVELS], [LEVELS**2, LEVELS**3]
    assert np.linalg.matrix_rank(np.stack([*line, *shapes])) == 4 + 1  # four even or odd shapes, and a bias in the even
    assert np.linalg.matrix_rank(np.stack([*line, *bends, *shapes])) == 5


def test_a_dead_zone_swallows_what_is_below_it():
    x = np.array([-20.0, -4.0, 0.0, 4.0, 20.0])  # ug
    y = curve("dead_zone", x * 1e-6, d=[to_si(5.0, "ug"), 0, 0])
    np.testing.assert_allclose(x + y, [-15, 0, 0, 0, 15], atol=1e-9)
