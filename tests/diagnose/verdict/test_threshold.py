"""What clean recordings reach: the fast draws against recordings drawn one by one and sent through the whole search."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from gimbalcal.diagnose.evidence.projection import gather_evidence, project, stacked_rows
from gimbalcal.diagnose.evidence.stated_noise import coloured_row_count, noise_grid
from gimbalcal.diagnose.search.ranking import search
from gimbalcal.diagnose.verdict.threshold import DRAWS, clean_evidence, clean_singles, evidence_of_any
from gimbalcal.inference.algebra import logsumexp
from tests.diagnose.small import at_rest, covariance, few, observed, rows_of, searched

LABELS = ("scale_factor_asymmetry:y", "bias_temperature_lagged:x", "encoder_two_cycle:inner", "cross_coupling:z")
TABLE = searched(observed(1, dwell=6, white=2.0), *LABELS)  # errors of setting outweigh the readings' noise
DRIFTING = at_rest(2)
REST = search(
    DRIFTING, few(DRIFTING, "scale_factor_asymmetry:x", "bias_drift:y", "bias_temperature:z"), noise_grid(DRIFTING)[-1:]
)


def drawn_one_by_one(s, draws, rng):
    """ln Bayes factors (candidates, draws) of data drawn from the dense covariance of the noises that are likely."""
    Z, _ = rows_of(s.fit)
    weight = np.exp(s.null - logsumexp(s.null))
    y = np.empty((len(Z), draws))
    picked = rng.choice(len(weight), size=draws, p=weight / weight.sum())
    for k, p in enumerate(s.projections):
        mine = picked == k
        y[:, mine] = np.linalg.cholesky(covariance(p.node, len(Z))) @ rng.standard_normal((len(Z), mine.sum()))
    rows = stacked_rows(Z, s.library.X, y, coloured_row_count(s.fit))
    made = [project(p.node, rows) for p in s.projections]
    null = np.array([np.log(p.node.prior) + p.log_likelihood() for p in made])  # (nodes, draws)
    out = []
    for j in range(draws):
        one = [replace(p, b=p.b[:, j : j + 1]) for p in made]
        out.append(
            logsumexp(gather_evidence(one, s.library.layout) + null[:, j : j + 1], axis=0) - logsumexp(null[:, j])
        )
    return np.stack(out, axis=-1)


@pytest.mark.parametrize("s", [TABLE, REST], ids=["table", "at rest"])
def test_clean_evidence_is_that_of_recordings_drawn_one_by_one(s):
    rng = np.random.default_rng(3)
    quick = np.concatenate([clean_singles(s, rng) for _ in range(5)], axis=1)
    slow = drawn_one_by_one(s, 600, rng)
    assert quick.shape == (len(s.library.candidates), 5 * DRAWS)
    for mine, theirs in zip(quick, slow, strict=True):
        assert kstest(mine, theirs).pvalue > 1e-3
        # the part that decides about a claim: of 1000 and 600 draws, 5 % either way is five sigmas
        assert np.mean(mine > np.quantile(theirs, 0.9)) == pytest.approx(0.1, abs=0.05)


def test_anything_is_the_mean_over_candidates_by_their_shares():
    ln, share = np.log([[4.0, 1.0], [1.0, 16.0]]), np.log([0.25, 0.5])
    np.testing.assert_allclose(np.exp(evidence_of_any(ln, share)), [0.25 * 4 + 0.5 * 1, 0.25 * 1 + 0.5 * 16])
    whole, (alone,) = clean_evidence(TABLE, np.random.default_rng(6))
    np.testing.assert_array_equal(whole, alone)
    each = clean_singles(TABLE, np.random.default_rng(6))
    np.testing.assert_allclose(np.exp(whole), np.exp(TABLE.share) @ np.exp(each))
