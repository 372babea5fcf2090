"""A clean case: five low-cost units on a board, of the first of which the accelerometers lack nothing."""

import pytest

from tests.golden import golden_text
from tests.real.recordings import diagnosed, names


def test_accelerometers_lack_nothing():
    d = diagnosed("mikoff", "bias", "scale_factor", "misalignment")
    assert d.verdict == "adequate"
    assert d.findings == ()
    assert d.mismatch == ()
    # 13 degrees of freedom: chi^2 / dof scatters by 0.4
    assert d.fit["chi2_of_samples_before"]["norm"] == pytest.approx(1.0, abs=0.8)
    golden_text(d.in_words)


def test_misalignment_left_out_is_found_again_and_nothing_else():
    d = diagnosed("mikoff", "bias", "scale_factor")
    assert names(d) == {"misalignment"}
    assert d.fit["chi2_of_samples_before"]["norm"] > 20
    assert d.fit["chi2_of_samples_after"]["norm"] == pytest.approx(1.0, abs=0.8)
    assert d.fit["heldout_rms_after"] < 0.3 * d.fit["heldout_rms_before"]
