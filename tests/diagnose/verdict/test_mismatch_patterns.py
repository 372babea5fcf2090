"""Where a baseline fails on a recording without a stated noise: patterns by their F test, or the worst rows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from scipy.stats import f as fisher

from gimbalcal.diagnose.library.assemble import orthonormal_basis
from gimbalcal.diagnose.library.shapes import shapes_of
from gimbalcal.diagnose.search.refit import start_with_baseline
from gimbalcal.diagnose.verdict.mismatch import largest_misfit, misfit_patterns, view_mismatches
from gimbalcal.views.pointing import pointing
from tests.diagnose.plant import ARCSEC
from tests.diagnose.small import telescope


def wavy(size, seed=3):
    """A telescope whose elevation is off by five waves in azimuth, in arcsec."""
    r = telescope(seed)
    A = r.channels["true_angle", "azimuth"]
    read = r.channels["gimbal_angle", "elevation"] + size * ARCSEC * np.sin(5 * A)
    return pointing(replace(r, channels={**r.channels, ("gimbal_angle", "elevation"): read}))


def test_a_pattern_is_told_with_its_f_statistic():
    v = wavy(3.0)
    m = start_with_baseline(v)
    first = misfit_patterns(m)[0]
    assert view_mismatches(m, np.full((80, 2), ARCSEC))[0] == first
    assert (first["channel"], first["axis"]) == ("pointing", "along")
    assert "azimuth" in first["in_words"]
    angle = v.stimulus.readout[:, list(v.stimulus.axis_names).index("azimuth")]
    X = np.zeros((80, 2, 10))
    X[:, 1] = np.stack([g(k * angle) for k in range(2, 7) for g in (np.cos, np.sin)], axis=-1)
    Z, y = m.jacobian.reshape(160, -1), m.residual.ravel()
    Z = Z / (np.linalg.norm(Z, axis=0) + 1e-300)

    def left(A):
        return float(np.sum((y - A @ np.linalg.lstsq(A, y, rcond=1e-7)[0]) ** 2))

    both = np.concatenate([Z, X.reshape(160, -1)], axis=1)
    free = 160 - np.linalg.matrix_rank(both, 1e-7)
    F = (left(Z) - left(both)) / 10 / (left(both) / free)
    assert first["statistic"] == pytest.approx(F, rel=1e-3)
    # Bonferroni's bound: time, slow and fast, each of the two angles in two ranges of harmonics, and both together, in
    # two channels; of one of the fourteen the model leaves nothing
    shapes = shapes_of(v, m.residual, orthonormal_basis(m.jacobian), [], 80)
    assert len({(c.effect, c.axis) for c in shapes}) == len(shapes) == 13
    assert first["p_value"] == pytest.approx(13 * fisher.sf(F, 10, free), rel=1e-2, abs=0.0)
    worst = np.argsort(-np.abs(m.residual[:, 1]))[:3]
    assert first["where"] == {"positions": [int(k) + 1 for k in worst]}
    size = np.sqrt(np.mean(m.residual[:, 1] ** 2)) / ARCSEC
    assert f"({size:.3g} arcsec rms)" in first["in_words"]


def test_chance_is_no_pattern():
    """Clean recordings: all shapes together are odd in one of a thousand."""
    for seed in range(6):
        v = pointing(telescope(seed))
        m = start_with_baseline(v)
        assert misfit_patterns(m) == ()
        assert view_mismatches(m, np.full((80, 2), ARCSEC)) == largest_misfit(m, np.full((80, 2), ARCSEC))


def test_without_a_pattern_the_worst_channel_is_told_against_the_scatter_in_the_end():
    v = pointing(telescope(1))
    m = start_with_baseline(v)
    sigma = np.tile([2.0, 0.9], (80, 1)) * ARCSEC
    (found,) = largest_misfit(m, sigma)
    square = np.mean((m.residual / sigma) ** 2, axis=0)
    assert found["axis"] == ("across", "along")[int(np.argmax(square))] == "along"
    assert found["statistic"] == pytest.approx(square[1], abs=0.01)
    assert found["p_value"] == pytest.approx(min(1.0, 2 * chi2.sf(80 * square[1], 80)), rel=1e-6)
    worst = 1 + np.argsort(-np.abs(m.residual[:, 1]))[:3]
    assert found["where"] == {"positions": worst.tolist()}
    assert found["in_words"].endswith(f"largest at stars {worst[0]}, {worst[1]} and {worst[2]}")
