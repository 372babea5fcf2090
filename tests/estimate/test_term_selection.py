"""What a further term must reach: paid for by what was tried, so that terms which are not there stay out."""

import numpy as np
import pytest

from gimbalcal.estimate.accelerometers.multiposition import LINEAR, TERMS, multiposition
from gimbalcal.estimate.gyroscopes.between_rests import FURTHER_TERMS, gyroscopes_between_rests
from gimbalcal.estimate.term_selection import FALSE_TERM_RATE, TRIADS, needed_significance
from tests.estimate.accelerometers.test_multiposition import TRUTH as FORCES
from tests.estimate.accelerometers.test_multiposition import rested, scattered
from tests.estimate.gyroscopes.test_between_rests import TRUTH as RATES
from tests.estimate.gyroscopes.test_between_rests import hand

SEEDS = 40
FEW = 2  # of 40 at 0.5 % each: more than two in one of 1000 sets of seeds; a fixed 3 sigma would pass 4 % of runs


@pytest.mark.parametrize(("tried", "dof"), [(6, np.inf), (15, 30.0), (18, 6.0)])
def test_the_largest_of_what_was_tried_exceeds_it_as_rarely_as_promised(tried, dof):
    rng, runs = np.random.default_rng(1), 100_000
    scale = 1.0 if np.isinf(dof) else np.sqrt(rng.chisquare(dof, (runs, tried)) / dof)
    largest = np.abs(rng.standard_normal((runs, tried)) / scale).max(axis=1)
    # independent numbers use up the bound but for its square; 500 +- 22 of them, 4 sigma
    assert np.mean(largest > needed_significance(tried, dof)) == pytest.approx(FALSE_TERM_RATE / TRIADS, abs=9e-4)


def test_forces_without_further_terms_stay_without():
    further = set(TERMS) - set(LINEAR)
    taken = 0
    for seed in range(SEEDS):
        made = multiposition(rested(FORCES, scattered(30, seed), seed=seed))
        taken += bool(further & {p.effect for p in made.parameters})
    assert taken <= FEW


def test_gyroscopes_without_further_terms_stay_without():
    taken = 0
    for seed in range(SEEDS):
        recording = hand(RATES, 2e-3, count=20, seed=200 + seed)
        made = gyroscopes_between_rests(recording, multiposition(recording, ("bias",)))
        taken += bool(set(FURTHER_TERMS) & {p.effect for p in made.parameters})
    assert taken <= FEW
