"""Functions that must run alike on float, complex and symbol."""

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from gimbalcal import number
from gimbalcal.inference.algebra import eigh
from gimbalcal.number import STEP

angles = st.floats(-7, 7, allow_nan=False)


@pytest.mark.parametrize("name", ["sin", "cos", "exp", "sqrt", "absolute", "arcsin"])
@pytest.mark.parametrize("x", [0.3, 0.9])
def test_complex_step_equals_symbolic_derivative(name, x):
    function = getattr(number, name)
    symbol = sympy.Symbol("x", positive=True)
    exact = float(sympy.diff(function(np.array(symbol, dtype=object)).item(), symbol).subs(symbol, x))
    assert function(np.array(x + 1j * STEP)).imag / STEP == pytest.approx(exact, rel=1e-14)  # a few roundings
    assert float(function(np.array(symbol, dtype=object)).item().subs(symbol, x)) == pytest.approx(
        float(function(x)), rel=1e-14
    )


def test_absolute_and_minimum_keep_the_complex_step_where_numpy_drops_it():
    x = np.array([-2.0, 3.0]) + 1j * STEP
    np.testing.assert_array_equal(number.absolute(x).imag, [-STEP, STEP])
    np.testing.assert_array_equal(number.minimum(x, 1.0).imag, [STEP, 0.0])
    np.testing.assert_array_equal(number.maximum(x, 1.0).imag, [0.0, STEP])


@given(y=st.floats(-3, 3), x=st.floats(0.1, 3))
def test_arctan2_derivative(y, x):
    assert number.arctan2(y, x) == np.arctan2(y, x)
    expected = x / (x * x + y * y)
    assert number.arctan2(y + 1j * STEP, x).imag / STEP == pytest.approx(expected, rel=1e-13)


def test_complex_step_by_all_parameters_and_row_by_row():
    A = np.array([[1.0, 2.0], [3.0, 4.0], [-5.0, 6.0]])
    x = np.array([0.3, -0.2])
    np.testing.assert_array_equal(number.complex_step(lambda v: A @ v, x), A)
    rows = np.array([[0.5, 2.0], [-1.0, 3.0]])  # x y and its gradient (y, x) at each row
    np.testing.assert_array_equal(number.complex_step(lambda v: v[:, 0] * v[:, 1], rows), rows[:, ::-1])
    assert number.complex_step(lambda v: A, np.zeros(0)).shape == (3, 2, 0)


def test_eigenvalues_of_a_matrix_on_which_divide_and_conquer_fails(monkeypatch):
    first = iter([True])
    real = np.linalg.eigh

    def once(G):
        if next(first, False):
            raise np.linalg.LinAlgError("Eigenvalues did not converge")
        return real(G)

    x = np.random.default_rng(1).standard_normal((4, 3, 6))
    G = np.swapaxes(x, -1, -2) @ x  # rank 3 of 6
    monkeypatch.setattr(np.linalg, "eigh", once)
    lam, V = eigh(G)
    np.testing.assert_allclose((V * lam[..., None, :]) @ np.swapaxes(V, -1, -2), G, atol=1e-10)
