"""Singles and pairs: evidence against dense densities, shares that make a whole, and the planted pair on top."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gimbalcal.diagnose.evidence.odds import CAUSE_AND_SHAPE, PAIR, SINGLE, UNKNOWN
from gimbalcal.diagnose.evidence.scale import SIZE_PRIOR, SIZES
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.library.candidates import Library
from gimbalcal.diagnose.search.ranking import (
    candidates_overlap,
    evidence_of_sets,
    log_priors,
    projection_given,
    promising_pairs,
    search,
)
from gimbalcal.inference.algebra import logsumexp
from tests.diagnose.plant import known
from tests.diagnose.small import candidate, covariance, few, noises, observed, rows_of, searched

LABELS = ("scale_factor_asymmetry:y", "scale_temperature:z", "cross_coupling:x", "unknown time:x")


def both(b):
    """|f| of y, and a scale of z that follows the temperature."""
    one, two = known(1)["asymmetry"][0](b)["output"], known(2)["scale T"][0](b)["output"]
    return {"output": one + two / 2}


S = searched(observed(3, both, 150.0, dwell=6), *LABELS)
CLEAN = searched(observed(4, dwell=6), *LABELS)


def dense(s, members, sizes, k):
    """ln density of the contrasts free of the calibration, with these columns of these prior sizes, in noise k."""
    Z, y = rows_of(s.fit)
    U, sv, _ = np.linalg.svd(Z)
    free = U[:, int((sv > 1e-4).sum()) :]
    V = free.T @ covariance(s.projections[k].node, len(y)) @ free
    for index, size in zip(members, sizes, strict=True):
        X = free.T @ s.library.X[:, list(index)]
        V = V + size**2 * X @ X.T
    return float(multivariate_normal(cov=V).logpdf(free.T @ y))


def test_a_single_is_the_mean_over_noises_and_sizes():
    for label in ("scale_factor_asymmetry:y", "unknown time:x"):
        i = candidate(CLEAN, label)
        (v,) = CLEAN.library.candidates[i].variants
        priors = [p.node.prior for p in CLEAN.projections]
        nothing = np.array([np.log(q) + dense(CLEAN, [], (), k) for k, q in enumerate(priors)])
        ln = [np.log(q * share) + dense(CLEAN, [v.index], (size,), k)
              for k, q in enumerate(priors) for size, share in zip(SIZES, SIZE_PRIOR, strict=True)]  # fmt: skip
        truth = float(logsumexp(np.array(ln)) - logsumexp(nothing))
        assert CLEAN.singles[i] == pytest.approx(truth, abs=1e-4)
        np.testing.assert_allclose(CLEAN.null - CLEAN.null[0], nothing - nothing[0], atol=1e-6)


def test_a_second_cause_is_judged_with_the_first_in_the_model_at_its_best_size():
    """In one noise: the second's sizes mixed with the first at its likeliest size, and what the first had gained."""
    one = searched(S.fit, *LABELS, count=1)
    i, j = candidate(one, LABELS[0]), candidate(one, LABELS[1])
    first, second = (one.library.candidates[n].variants[0].index for n in (i, j))
    alone = [dense(one, [first], (size,), 0) for size in SIZES]
    best = SIZES[int(np.argmax(np.array(alone) + np.log(SIZE_PRIOR)))]
    pair = logsumexp(np.array([dense(one, [first, second], (best, size), 0) for size in SIZES]) + np.log(SIZE_PRIOR))
    gained = logsumexp(np.array(alone) + np.log(SIZE_PRIOR)) - dense(one, [], (), 0)
    truth = gained + pair - dense(one, [first], (best,), 0)
    found = evidence_of_sets(one, (i,), [j], 1)[0]
    assert found == pytest.approx(float(truth), abs=1e-3)
    assert projection_given(one.projections[0], one.library.candidates[i])[1] == pytest.approx(float(gained), abs=1e-4)


def test_two_causes_are_found_as_a_pair():
    best = max(S.hypotheses, key=lambda h: h.ln_weight)
    assert {S.library.candidates[m].label for m in best.members} == set(LABELS[:2])
    assert S.hypotheses[0] is best
    p = S.posterior()
    assert p.sum() == pytest.approx(1.0)
    assert p[0] > 0.8
    assert S.ln_total == pytest.approx(float(logsumexp(np.array([h.ln_weight for h in S.hypotheses]))))
    for h in S.hypotheses:
        if len(h.members) == 1:
            assert h.ln_weight - h.ln_bayes == pytest.approx(S.share[h.members[0]])


def test_shares_of_the_prior_make_a_whole():
    o = S.fit
    whole = assemble_library(o)
    prior = log_priors(whole.candidates)
    rival = np.array([bool(c.rival) for c in whole.candidates])
    assert np.exp(prior[rival]).sum() == pytest.approx(1.0)
    assert np.exp(prior[~rival]).sum() == pytest.approx(1.0)
    shares = {c.label: float(p) for c, p in zip(whole.candidates, np.exp(prior), strict=True)}
    together, alone = shares["bias_drift:x, y, z"], sum(shares[f"bias_drift:{a}"] for a in "xyz")
    assert together == pytest.approx(alone)  # sensors are of one make: all axes together weigh half
    by_effect: dict[str, float] = {}
    for c, p in zip(whole.candidates, np.exp(prior), strict=True):
        if not c.rival:
            by_effect[c.effect] = by_effect.get(c.effect, 0.0) + float(p)
    np.testing.assert_allclose(list(by_effect.values()), 1 / len(by_effect))


def test_pairs_share_what_is_theirs():
    """Every pair of two known causes once, all together `PAIR`; with a shape beside, `CAUSE_AND_SHAPE`."""
    c = S.library.candidates[:3]
    everything = (*c, S.library.candidates[3])
    prior = log_priors(everything)

    def gained(members, seconds, keep):
        return np.zeros(len(everything))[list(seconds)]

    found = promising_pairs(everything, np.array([100.0, 1.0, 1.0, 1.0]), prior, 1e9, gained)
    known_pairs = {h.members: np.exp(h.ln_weight - h.ln_bayes) for h in found if not h.unknown(everything)}
    assert set(known_pairs) == {(0, 1), (0, 2), (1, 2)}
    np.testing.assert_allclose(list(known_pairs.values()), 2 * PAIR / 9)
    odd = {h.members: np.exp(h.ln_weight - h.ln_bayes) for h in found if h.unknown(everything)}
    np.testing.assert_allclose(list(odd.values()), CAUSE_AND_SHAPE / 3)
    assert all(h.members[-1] == 3 for h in found if h.unknown(everything))
    assert SINGLE + UNKNOWN + PAIR + CAUSE_AND_SHAPE == pytest.approx(1.0)


def test_an_effect_on_all_axes_is_no_second_beside_one_of_them():
    o = observed(1, dwell=2)
    c = few(o, "bias_drift:x", "bias_drift:y", "bias_drift:x, y, z", "warm_up:x").candidates
    assert candidates_overlap(c, 0, 2)
    assert candidates_overlap(c, 2, 1)
    assert not candidates_overlap(c, 0, 1)
    assert not candidates_overlap(c, 0, 3)


def test_what_the_recording_cannot_show_is_not_asked():
    """Columns a thousandth as large: less than a twentieth of a sigma at the expected size."""
    o = observed(1, dwell=2)
    made = few(o, "scale_factor_asymmetry:y", "bias_drift:x")
    faint = made.X.copy()
    faint[:, list(made.candidates[1].variants[0].index)] *= 1e-6
    s = search(o, Library(made.candidates, faint), noises(o))
    assert [c.label for c in s.library.candidates] == ["scale_factor_asymmetry:y"]
