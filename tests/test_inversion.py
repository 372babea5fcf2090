"""A sensor law inverted: exact, quick, and honest where nothing can be told back."""

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.forward import accelerometers
from gimbalcal.inversion import MAX_STEPS, invert_response
from gimbalcal.number import absolute
from tests.stimuli import eighteen


def test_a_bent_and_crossed_triad_is_solved_to_rounding_in_few_steps():
    ids = ("scale_factor", "bias", "misalignment", "scale_nonlinearity", "cubic_nonlinearity")
    wanted = [p for i in ids for p in parameters(CATALOGUE[i])]
    effects = with_values((), wanted, np.random.default_rng(3).normal(0, [10 * p.sigma for p in wanted]))
    s, calls = eighteen(), 0

    def law(f):
        nonlocal calls
        calls += 1
        return accelerometers(f, s, effects)

    f, H, flat = invert_response(law, accelerometers(s.force, s, effects))
    np.testing.assert_allclose(f, s.force, rtol=0, atol=1e-14)  # roundings of 9.8
    # errors of 5e-3: each step squares what is left, and takes four evaluations
    assert calls <= 5 * 4
    assert not flat.any()
    step = 1e-3 * np.array([1.0, -2.0, 3.0])
    np.testing.assert_allclose((law(f + step) - law(f - step)) / 2, H @ step, atol=1e-12)


def test_a_large_bend_still_closes():
    f = np.linspace(-1.0, 1.0, 30).reshape(10, 3)
    found = invert_response(
        lambda x: x + 0.3 * x**3 + 0.1 * np.roll(x, 1, axis=-1), f + 0.3 * f**3 + 0.1 * np.roll(f, 1, axis=-1)
    )
    np.testing.assert_allclose(found[0], f, atol=4e-16)


def test_rows_where_the_law_is_flat_stay_and_are_told():
    """A dead zone of 0.1: what it swallows is left as it was read, the other rows are right."""

    def law(x):
        return np.where(absolute(x).real < 0.1, 0.0 * x, x)

    y = np.array([[0.0, 1.0, 1.0], [1.0, 2.0, 3.0]])
    f, _, flat = invert_response(law, y)
    assert flat.tolist() == [True, False]
    np.testing.assert_array_equal(f, y)


def test_an_axis_in_its_dead_zone_does_not_keep_the_others_from_being_told():
    """All three stayed as they were read, with their biases."""
    width, others = 1e-3, ("scale_factor", "bias", "misalignment")
    zone = CATALOGUE["dead_zone"](d=np.array([width, 0.0, 0.0]))
    wanted = [p for i in others for p in parameters(CATALOGUE[i]) if p.axis not in ("x", "xy", "xz")]
    effects = (zone, *with_values((), wanted, np.full(len(wanted), 3e-3)))
    s = eighteen()
    s = s.at(force=np.column_stack([np.full(18, 5e-4), s.force[:, 1:]]))
    y = accelerometers(s.force, s, effects)
    y[:, 0] = 1e-5  # noise: in the zone nothing is read
    f, _, flat = invert_response(lambda f: accelerometers(f, s, effects), y)
    assert flat.all()
    assert np.all(np.abs(f[:, 0]) < width)
    np.testing.assert_allclose(f[:, 1:], s.force[:, 1:], atol=width * 2 * 3e-3)  # what is not known leans over


def test_readings_of_nothing_come_back_as_what_makes_them_vanish():
    f, _, _ = invert_response(lambda x: 1.1 * x + 2e-3, np.zeros((2, 3)))
    assert f == pytest.approx(-2e-3 / 1.1, rel=1e-15)
    assert MAX_STEPS >= 6
