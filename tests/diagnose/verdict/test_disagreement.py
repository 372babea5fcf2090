"""Recordings of two units, or of one that changed, are told from recordings of one."""

from __future__ import annotations

import numpy as np
import pytest

from gimbalcal.diagnose.verdict.disagreement import disagreement
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.inference.information import Information, information
from gimbalcal.units import to_si

WANTED = tuple(p for i in ("scale_factor", "bias") for p in parameters(CATALOGUE[i]))
PPM = 1e-6


def recorded(rng: np.random.Generator, moved: float = 0.0, seen: int = 6) -> Information:
    """Forty rows of noise one about constants of which scale factor y is `moved` [ppm] of a sigma of 10 ppm."""
    scale = np.array([p.sigma for p in WANTED])
    J = rng.standard_normal((40, 6)) / scale * 40 * (np.arange(6) < seen)
    x = 0.3 * scale
    x[1] += moved * PPM
    return information(J, J @ x + rng.standard_normal(40), WANTED)


def test_recordings_of_one_unit_agree_as_often_as_they_should() -> None:
    rng = np.random.default_rng(1)
    chances = [disagreement([recorded(rng), recorded(rng)]).p_value for _ in range(60)]
    assert min(chances) > 1e-4
    assert np.mean(np.array(chances) < 0.2) < 0.4  # one of two tests, both paid for


def test_one_constant_that_moved_is_named_with_its_size() -> None:
    rng = np.random.default_rng(2)
    found = disagreement([recorded(rng), recorded(rng, moved=40.0)])
    assert found.p_value < 1e-4
    assert found.parameters[0].label == "scale_factor:y"
    assert found.difference[0] == pytest.approx(40.0 * PPM, abs=4 * found.sigma[0])
    assert found.difference[0] > 4 * found.sigma[0]
    assert "the second differs, in scale factor y by +" in found.in_words


def test_of_three_the_odd_one_is_named() -> None:
    rng = np.random.default_rng(3)
    found = disagreement([recorded(rng), recorded(rng, moved=60.0), recorded(rng)])
    assert found.odd == 1
    assert "recording 2 differs most from the others" in found.in_words
    assert found.to_dict()["recording"] == 2


def test_what_only_one_of_them_sees_is_no_difference() -> None:
    rng = np.random.default_rng(4)
    found = disagreement([recorded(rng), recorded(rng, moved=float(to_si(80.0, "1")), seen=1)])
    assert found.dof == 1
    assert found.in_words == ""
