"""Recordings of two units, or of one that changed, are told from recordings of one."""

import numpy as np
import pytest
from scipy.special import chdtrc, ndtr

from gimbalcal.diagnose.verdict.agreement import agreement_on_constants
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.inference.information import information
from gimbalcal.units import from_si, to_si
from tests.golden import golden_text

WANTED = tuple(p for i in ("scale_factor", "bias") for p in parameters(CATALOGUE[i]))
PPM = 1e-6


def recorded(rng, moved=0.0, seen=6):
    """Forty rows of noise one about constants of which scale factor y is `moved` [ppm] of a sigma of 10 ppm."""
    scale = np.array([p.sigma for p in WANTED])
    J = rng.standard_normal((40, 6)) / scale * 40 * (np.arange(6) < seen)
    x = 0.3 * scale
    x[1] += moved * PPM
    return information(J, J @ x + rng.standard_normal(40), WANTED)


def test_recordings_of_one_unit_agree_as_often_as_they_should():
    rng = np.random.default_rng(1)
    chances = [agreement_on_constants([recorded(rng), recorded(rng)]).p_value for _ in range(60)]
    assert min(chances) > 1e-4
    assert np.mean(np.array(chances) < 0.2) < 0.4  # one of two tests, both paid for


def test_one_constant_that_moved_is_named_with_its_size():
    rng = np.random.default_rng(2)
    found = agreement_on_constants([recorded(rng), recorded(rng, moved=40.0)])
    assert found.p_value < 1e-4
    assert found.parameters[0].label == "scale_factor:y"
    assert found.difference[0] == pytest.approx(40.0 * PPM, abs=4 * found.sigma[0])
    assert found.difference[0] > 4 * found.sigma[0]
    golden_text(found.in_words)


@pytest.mark.parametrize("k", range(3))
def test_of_three_the_odd_one_is_named(k):
    rng = np.random.default_rng(3)
    found = agreement_on_constants([recorded(rng, moved=60.0 * (i == k)) for i in range(3)])
    assert found.odd == k
    golden_text(found.in_words)
    assert found.to_dict()["recording"] == k + 1


def exact(apart):
    """Two recordings that know each constant to 1e-3 of its prior and differ by so many sigmas of a difference."""
    sigma = 1e-3 * np.array([p.sigma for p in WANTED])
    x = np.sqrt(2) * np.array(apart) * sigma
    return agreement_on_constants([information(np.diag(1 / sigma), v / sigma, WANTED) for v in (0 * x, x)])


def test_two_that_say_the_same_agree_for_certain():
    found = exact([0, 0, 0, 0, 0, 0])
    assert (found.p_value, found.in_words, found.parameters) == (1.0, "", ())
    told = found.to_dict()
    assert (told["agree"], told["recording"], told["differences"]) == (True, None, [])
    assert told["chi2"] == pytest.approx(0.0, abs=1e-9)


def test_differences_are_counted_in_sigmas_and_told_in_printed_units():
    found = exact([0, 8, 0, -4, 0, 0])
    assert (found.chi2, found.dof) == (pytest.approx(80.0), 6)
    assert found.p_value == pytest.approx(2 * chdtrc(6, 80.0), rel=1e-6, abs=0.0)
    alone = exact([0, 8, 0, 0, 0, 0])  # one of six by itself is rarer than 64 of six degrees of freedom
    assert alone.p_value == pytest.approx(2 * 6 * 2 * ndtr(-8.0), rel=1e-6, abs=0.0)
    first, second = found.to_dict()["differences"]
    assert [f"{d['name']}:{d['axis']}" for d in (first, second)] == ["scale_factor:y", "bias:x"]
    for told, p, apart in ((first, WANTED[1], 8), (second, WANTED[3], -4)):
        assert told["unit"] == p.unit
        assert told["sigma"] == pytest.approx(np.sqrt(2) * 1e-3 * from_si(p.sigma, p.unit))
        assert told["value"] == pytest.approx(apart * told["sigma"])


def test_constants_may_contradict_together_where_none_does_by_itself():
    found = exact([2.5, -2.5, 2.5, 2.5, -2.5, 2.5])
    assert found.p_value == pytest.approx(2 * chdtrc(6, 6 * 2.5**2), rel=1e-6, abs=0.0)
    assert found.parameters == ()
    golden_text(found.in_words)


def test_what_only_one_of_them_sees_is_no_difference():
    rng = np.random.default_rng(4)
    found = agreement_on_constants([recorded(rng), recorded(rng, moved=float(to_si(80.0, "1")), seen=1)])
    assert found.dof == 1
    assert found.in_words == ""
