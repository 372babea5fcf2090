"""One size from several recordings: the joint least squares of their rows, and whether they agree on it."""

from functools import cache

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import chi2

from gimbalcal.diagnose.search.combine import combine
from gimbalcal.diagnose.search.fitted_causes import constant_value, fit_causes
from gimbalcal.diagnose.verdict.agreement import inverse_of
from gimbalcal.diagnose.verdict.pooled_sizes import agreement_on_size, causes_by_recording, common_sizes, pooled
from gimbalcal.inference.algebra import orthonormal
from tests.diagnose.plant import cooled, known, on
from tests.diagnose.small import candidate, covariance, gls, observed, rows_of, searched

LABELS = ("scale_factor_asymmetry:y", "cross_coupling:y")


@cache
def two(sizes):
    made = [observed(seed, known(1)["asymmetry"][0], x, dwell=6) for seed, x in zip((1, 2), sizes, strict=True)]
    return combine([searched(o, *LABELS, count=1) for o in made])


SI = np.array([1e-6, 100.0])  # of a size and a lag
ALIKE = two((150.0, 150.0))


def joint(c, labels):
    """Rows of both recordings stacked: a calibration of its own for each, and sizes common to both."""
    Z, X, y, V = [], [], [], []
    for s in c.searches:
        calibration, data = rows_of(s.fit)
        index = [i for label in labels for i in s.library.candidates[candidate(s, label)].variants[0].index]
        Z.append(orthonormal(calibration))
        X.append(s.library.X[:, index])
        y.append(data)
        V.append(covariance(s.projections[0].node, len(data)))
    A = np.concatenate([block_diag(*Z), np.concatenate(X)], axis=1)
    x, C = gls(A, np.concatenate(y), block_diag(*V))
    p = X[0].shape[1]
    return x[-p:], C[-p:, -p:]


def members(c, labels):
    found = [x.label for x in c.library.candidates]
    return tuple(found.index(label) for label in labels)


@pytest.mark.parametrize("labels", [LABELS[:1], LABELS])
def test_the_pooled_size_is_that_of_one_fit_to_both(labels):
    m = members(ALIKE, labels)
    made = causes_by_recording(ALIKE, m)
    counts = [len(ALIKE.library.candidates[i].parameters) for i in m]
    x, C = pooled(made, counts)
    x_joint, C_joint = joint(ALIKE, labels)
    np.testing.assert_allclose(x, x_joint, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(C, C_joint, rtol=1e-5, atol=1e-9)
    assert [p.ordinals for p in made] == [tuple(range(len(m)))] * 2
    assert made[0].span(len(m) - 1) == slice(sum(counts[:-1]), sum(counts))


@pytest.mark.parametrize(("sizes", "alike"), [((150.0, 150.0), True), ((150.0, -150.0), False)])
def test_agreement_is_chi2_of_the_difference(sizes, alike):
    c = two(sizes)
    made = causes_by_recording(c, members(c, LABELS[:1]))
    (x1, x2), (v1, v2) = [p.fit.x[0] for p in made], [p.fit.covariance[0, 0] for p in made]
    a = agreement_on_size(made, 0)
    assert a.combinations == 1
    assert a.rise == pytest.approx((x1 - x2) ** 2 / (v1 + v2), rel=1e-9)
    assert a.p_value == pytest.approx(chi2.sf(a.rise, 1), rel=1e-9)
    assert (a.p_value > 1e-3) is alike


def test_one_recording_has_nobody_to_disagree_with():
    c = two((150.0, 150.0))
    only = causes_by_recording(c, members(c, LABELS[:1]))[:1]
    assert (agreement_on_size(only, 0).combinations, agreement_on_size(only, 0).p_value) == (0, 1.0)
    x, C = pooled(only, [1])
    assert (x[0], C[0, 0]) == pytest.approx((only[0].fit.x[0], only[0].fit.covariance[0, 0]))


def test_without_members_each_part_is_the_fit_of_nothing():
    for part, s in zip(causes_by_recording(ALIKE, ()), ALIKE.searches, strict=True):
        assert part.search is s
        assert (part.ordinals, part.fit.index) == ((), ())


def test_a_direction_without_information_stays_without():
    C = np.array([[4.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(inverse_of(C), [[0.25, 0.0], [0.0, 0.0]])
    assert inverse_of(np.zeros((0, 0))).shape == (0, 0)


def test_a_lag_is_common_and_surer_together():
    """Each recording tries values of its own; the common one has the least chi^2 of both together."""
    label = "bias_temperature_lagged:x"
    made = [observed(seed, lambda b: on(0, cooled(b, 750.0)), 200.0, dwell=30) for seed in (3, 4)]
    c = combine([searched(o, label, count=1) for o in made])
    both = causes_by_recording(c, (0,))
    (common,) = {p.search.library.candidates[0].variants[0].constants for p in both}
    sizes = common_sizes(both, c.library.candidates[:1])
    (((name, value, sigma),),) = sizes.constants
    assert (name, value) == common[0]
    assert abs(value - 750.0) < 3.5 * sigma
    alone = [constant_value(s, fit_causes(s, (0,)), 0)[0] for s in c.searches]
    each = [np.linalg.inv(p.joint.covariance / np.outer(SI, SI)) for p in both]  # of size and lag: both add up
    assert sigma == pytest.approx(np.sqrt(np.linalg.inv(sum(each))[1, 1]) * SI[1], rel=1e-6)
    # by the values that were tried, which are a grid
    assert sigma == pytest.approx(1 / np.sqrt(sum(1 / s**2 for _, _, s in alone)), rel=0.3)
    assert min(x for _, x, _ in alone) <= value <= max(x for _, x, _ in alone)
