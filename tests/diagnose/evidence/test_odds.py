"""The prior odds and the bars, as numbers that hang together."""

import numpy as np
import pytest

from gimbalcal.diagnose.evidence import odds


def test_the_shares_of_what_may_be_missing_make_a_whole():
    assert odds.SINGLE + odds.PAIR + odds.UNKNOWN + odds.CAUSE_AND_SHAPE == pytest.approx(1.0)


def test_a_claim_holds_its_false_alarms_by_markov():
    """P(BF >= x) <= 1 / x for any e-value: a claim is wrong in at most one clean recording of twenty."""
    assert np.exp(-odds.CLAIM) == pytest.approx(0.05)
    assert (
        odds.DETECTION_EVIDENCE > odds.CLAIM
    )  # what is looked at beside others is looked at sooner than it is claimed
    assert odds.SEPARATION_EVIDENCE == odds.CLAIM


def test_no_probability_that_is_told_is_above_what_is_kept_for_the_unknown():
    assert max(odds.SURE_PROBABILITY, odds.UNSURE_FACTOR, odds.MIN_SHARE_WITH_REST) <= 1 - odds.UNKNOWN_LAW_SHARE
    assert odds.MIN_WIDENING_PROBABILITY < odds.UNKNOWN_LAW_SHARE
