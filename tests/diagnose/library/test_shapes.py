"""Shapes without a cause: harmonics of a gimbal angle that is seen at few places."""

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.library.shapes import high_harmonics, polynomials, unit_rms
from tests.diagnose.law_plants import oddities
from tests.diagnose.plant import STEPS, at_strength, specific_force

PLATFORM, INNER, MIDDLE = STEPS.T


def test_rounding_is_no_shape():
    """Six faces by half turns: sines of pi are 1e-16, and products of two forces are nothing else."""
    faces = specific_force(
        np.array([(0, 0, k) for k in range(4)] + [(0, 1, 0), (0, 3, 0)]) * np.pi / 2, np.zeros((6, 2))
    )
    basis = unit_rms(polynomials(faces))
    rms = np.sqrt((basis**2).mean(axis=0))
    assert set(np.round(rms, 12)) == {0.0, 1.0}
    assert rms[:5].tolist() == pytest.approx([0, 0, 0, 1, 1])  # xy, yz, zx, xx, yy


def left(y, basis):
    return np.linalg.norm(y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0])


def test_one_basis_holds_a_whole_third_harmonic_and_another_nothing_of_the_first_two():
    beyond, *single = high_harmonics(INNER)
    low = np.stack([f(n * INNER) for n in range(3) for f in (np.cos, np.sin)], axis=-1)
    assert np.abs(low.T @ beyond).max() < 1e-10
    assert min(left(np.sin(3 * INNER + 0.7), b) for b in single) < 1e-10
    assert left(np.sin(3 * INNER + 0.7), beyond) > 0.1


@pytest.mark.parametrize("angle", [PLATFORM, MIDDLE])
def test_where_first_and_second_say_everything_there_is_no_third(angle):
    assert high_harmonics(angle) == []


def test_a_strong_third_harmonic_is_not_made_of_three_known_causes():
    d = diagnose([at_strength(6500, oddities(0)["third harmonic"], 40.0)])
    assert d.verdict == "unexplained"
    assert "harmonic of the inner gimbal angle" in d.unexplained[0]["shape"]
