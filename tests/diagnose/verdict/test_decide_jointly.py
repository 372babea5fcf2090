"""The verdict of several recordings: one size for all, and a bar that clean ones set together."""

import numpy as np
import pytest

from gimbalcal.diagnose.evidence.projection import log_bayes
from gimbalcal.diagnose.evidence.scale import ANY_SIZE
from gimbalcal.diagnose.search.combine import combine_rankings
from gimbalcal.diagnose.verdict.decide import decide
from gimbalcal.diagnose.verdict.judgement import best_evidence
from gimbalcal.diagnose.verdict.threshold import clean_evidence, clean_singles, evidence_of_any
from gimbalcal.inference.algebra import logsumexp
from tests.diagnose.plant import known
from tests.diagnose.small import candidate, observed, searched

LABELS = ("scale_factor_asymmetry:y", "cross_coupling:x", "bias_drift:z", "position_blunder", "unknown time:x")


def together(*sizes):
    made = [observed(seed + 1, known(1)["asymmetry"][0], x, dwell=6) for seed, x in enumerate(sizes)]
    return combine_rankings([searched(o, *LABELS) for o in made])


ALIKE, UNLIKE, ONE = together(150.0, 150.0), together(150.0, 0.0), together(150.0)


def place(c, label):
    return [x.label for x in c.library.candidates].index(label)


@pytest.mark.parametrize("c", [ALIKE, UNLIKE], ids=["alike", "unlike"])
def test_a_cause_has_one_size_in_all_recordings(c):
    """The largest over sizes of the sum over recordings, each in its own noise: never more than the sum of the best."""
    label = "scale_factor_asymmetry:y"
    by_size = np.zeros(len(ANY_SIZE))
    best = 0.0
    for s in c.searches:
        i = candidate(s, label)
        index = list(s.library.candidates[i].variants[0].index)
        each = np.stack([log_bayes(p, np.array(index), ANY_SIZE) for p in s.projections])
        ln = logsumexp(each + s.null[:, None], axis=0) - logsumexp(s.null)
        by_size += ln
        best += float(ln.max())
        assert best_evidence(s)[i] == pytest.approx(logsumexp(s.null + each.max(axis=1)) - logsumexp(s.null))
    found = best_evidence(c, ())[place(c, label)]
    assert found == pytest.approx(by_size.max())
    assert found <= best + 1e-9


def test_a_cause_that_one_recording_lacks_is_not_excused():
    """As strong in both is likelier than strong in one: what the second does not show counts against it."""
    at = place(UNLIKE, "scale_factor_asymmetry:y")
    alone = best_evidence(UNLIKE.searches[0])[candidate(UNLIKE.searches[0], "scale_factor_asymmetry:y")]
    assert best_evidence(UNLIKE, ())[at] < alone
    assert best_evidence(ALIKE, ())[at] > alone


def test_shapes_have_no_size_to_compare():
    ln = best_evidence(ALIKE, ())
    rival = [bool(c.rival) for c in ALIKE.library.candidates]
    assert np.all(np.isneginf(ln[rival]))
    assert np.all(np.isfinite(ln[~np.array(rival)]))


def test_one_recording_together_is_that_recording():
    (s,) = ONE.searches
    mine, theirs = decide(ONE, 3.0), decide(s, 3.0)
    assert mine.verdict == theirs.verdict == "missing-physics"
    found = [ONE.library.candidates[m].label for m in mine.hypothesis.members]
    assert found == [s.library.candidates[m].label for m in theirs.hypothesis.members] == [LABELS[0]]
    assert mine.judgements[0].probability == pytest.approx(theirs.judgements[0].probability, abs=1e-6)


def test_the_bar_is_set_by_clean_recordings_of_all_designs():
    """Draws of each recording by itself, with the same random numbers, added up candidate by candidate."""
    bar, alone = clean_evidence(ALIKE, np.random.default_rng(1))
    rng = np.random.default_rng(1)
    drawn = [clean_singles(s, rng) for s in ALIKE.searches]
    for mine, d, s in zip(alone, drawn, ALIKE.searches, strict=True):
        np.testing.assert_allclose(mine, evidence_of_any(d, s.share))
    summed = np.zeros((len(ALIKE.library.candidates), drawn[0].shape[1]))
    for i in range(len(ALIKE.library.candidates)):
        for k, d in enumerate(drawn):
            if ALIKE.place[i, k] >= 0:
                summed[i] += d[ALIKE.place[i, k]]
    np.testing.assert_allclose(bar, logsumexp(summed + ALIKE.share[:, None], axis=0))
    assert decide(ALIKE, float(np.quantile(bar, 0.99))).verdict == "missing-physics"
    assert decide(ALIKE, 1e9).verdict == "adequate"
