"""How sure a verdict is of a cause: less where it leaves more than the stated noise."""

import numpy as np
import pytest

from gimbalcal.diagnose.evidence.odds import CLAIM, UNSURE_FACTOR
from gimbalcal.diagnose.evidence.stated_noise import noise_grid, scale_to_scatter
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.search.ranking import search
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.diagnose.verdict.decide import decide, noise_gain
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose.law_plants import Law, at_size, laws, unforeseen


def searched(law, seed, sigmas, **options):
    recording, _ = at_size(seed, law, sigmas, **options)
    o = scale_to_scatter(fit_baseline(view_at_known_attitude(recording)))
    return search(o, assemble_library(o), noise_grid(o))


def test_a_cause_that_leaves_more_than_the_stated_noise_is_not_sure():
    s = searched(Law(unforeseen(1)["pier"], ()), 9821, 25.0, rows=120)
    d = decide(s)
    assert noise_gain(s, d.hypothesis.members) > CLAIM
    assert max(j.probability for j in d.judgements) <= UNSURE_FACTOR


@pytest.mark.parametrize("name", ["asymmetry", "two-cycle"])
def test_a_cause_that_leaves_the_stated_noise_is_sure(name):
    s = searched(laws(1)[name], 5, 25.0)
    d = decide(s)
    assert noise_gain(s, d.hypothesis.members) < CLAIM
    assert min(j.probability for j in d.judgements) > UNSURE_FACTOR


def test_nothing_named_has_nothing_to_be_sure_of():
    s = searched(laws(1)["asymmetry"], 5, 0.0)
    d = decide(s, threshold=float(np.inf))
    assert (d.hypothesis, d.judgements) == (None, ())
