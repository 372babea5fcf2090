"""Rests that do not belong among the others are named and left out; physics that is missing blames none."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.checks.table import refuse_implausible
from gimbalcal.diagnose import diagnose
from gimbalcal.estimate.accelerometers.multiposition import LINEAR
from gimbalcal.estimate.accelerometers.norm_outliers import norm_outliers
from gimbalcal.estimate.unit import inertial_unit
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site, read
from gimbalcal.recording.dwell import without_dwells
from gimbalcal.views.norm import scaled_by_gravity
from tests.paths import XSENS

G = 9.8
SIGMA = 2e-3  # m/s^2 of the mean of a rest


def turned(seed, n=30, cubic=0.0, tails=False):
    """n rests in any direction, one row each: errors of a low-cost unit."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((n, 3))
    f = G * u / np.linalg.norm(u, axis=1, keepdims=True)
    M = np.eye(3) + 0.02 * rng.standard_normal((3, 3))
    noise = rng.standard_t(6, (n, 3)) if tails else rng.standard_normal((n, 3))
    y = f @ M.T + 0.3 * rng.standard_normal(3) + cubic * f**3 + SIGMA * noise
    return table(y)


def table(y):
    n = len(y)
    channels = {("specific_force", a): y[:, i] for i, a in enumerate("xyz")}
    return Recording("multi-position", "t", BENCH, Site(gravity=G), {"accelerometer": SIGMA}, 10.0 * np.arange(n),
                     np.arange(1, n + 1), channels, weight=np.ones(n))  # fmt: skip


def damaged(r, row, how):
    y = r.triad("specific_force").copy()
    y[row] = {"reading": y[row] * [1.1, 1, 1], "mean of two": (y[row] + y[row - 1]) / 2, "in g": y[row] / G}[how]
    return table(y)


@pytest.mark.parametrize("how", ["reading", "mean of two", "in g"])
def test_one_wrong_rest_is_named_and_changes_nothing_else(how):
    for seed in range(2):
        r = turned(seed)
        k = int(np.argmax(np.abs(r.triad("specific_force")[:, 0]))) if how == "reading" else 3 + seed
        bad = damaged(r, k, how)
        assert [s.position for s in norm_outliers(bad)] == [k + 1]
        made = inertial_unit(bad, LINEAR)
        without = inertial_unit(r.select(np.arange(30) != k), LINEAR)
        np.testing.assert_allclose(made.values, without.values, rtol=1e-6, atol=1e-12)
        assert f"position {k + 1} is off what all others say by" in made.outcome.lower()
        assert made.provenance["options"]["left_out"] == [k + 1]


def test_clean_units_blame_no_rest():
    alarms = sum(bool(norm_outliers(turned(seed, tails=seed % 2 == 0))) for seed in range(50))
    assert alarms == 0


def test_missing_physics_blames_no_rest():
    assert not any(norm_outliers(turned(seed, cubic=5e-4)) for seed in range(8))


def test_of_many_wrong_rests_none_is_the_reference():
    r = turned(1)
    for k in (2, 7, 11, 19, 23):
        r = damaged(r, k, "in g")
    assert norm_outliers(r) == ()


def test_as_many_wrong_rests_as_their_number_allows_are_named_by_calibration_and_diagnosis():
    """Three of ninety would hide any misalignment."""
    r, wrong = turned(4, n=90), (20, 50, 80)
    y = r.triad("specific_force").copy()
    y[list(wrong)] *= 0.93
    bad = table(y)
    assert [s.position for s in norm_outliers(bad)] == [k + 1 for k in wrong]
    found = diagnose([bad], baseline=["bias", "scale_factor"])
    assert [f.effect for f in found.findings] == ["misalignment"]
    assert "Positions 21, 51 and 81 are off what all others say by" in found.in_words
    made = inertial_unit(r.select(np.setdiff1d(np.arange(90), wrong)), LINEAR)
    without = {e.parameter.label: e.value for e in made.estimates}
    assert all(abs(e.value - without[e.parameter.label]) < 3 * e.sigma for e in found.calibration.estimates)


def test_a_rest_that_alone_shows_a_direction_is_kept():
    y = np.array([[G, 0, 0], [-G, 0, 0], [0, G, 0], [0, -G, 0], [0, 0, G]] + [[0.0, 0, -G]] * 12)
    y[5:] += 1e-3 * np.random.default_rng(2).standard_normal((12, 3))
    y[4] += [0, 0, 0.3]
    assert norm_outliers(table(y)) == ()


def test_rows_on_the_way_stay_on_the_way():
    r = turned(3)
    moving = np.repeat(r.position, 2)
    moving[1::2] = 0
    doubled = r.select(np.repeat(np.arange(30), 2))
    both = replace(doubled, position=moving, time=np.arange(60.0))
    y = both.triad("specific_force").copy()
    y[20] *= 1.2
    bad = replace(both, channels={("specific_force", a): y[:, i] for i, a in enumerate("xyz")})
    found = norm_outliers(bad)
    kept = without_dwells(bad, [s.dwell for s in found])
    assert [s.position for s in found] == [11]
    assert len(kept.time) == 60
    assert kept.position[20] == 0


def changed(row, axis, factor):
    r = read(XSENS)
    y = r.channels["specific_force", axis].copy()
    y[row] *= factor
    return r.with_channels({("specific_force", axis): y})


@pytest.mark.parametrize("axis", "xyz")
def test_any_reading_that_is_off_by_a_tenth_is_named(axis):
    """Beside many of them no ellipsoid fits the rests of the Xsens at all."""
    for row in range(38):
        assert [s.position for s in norm_outliers(changed(row, axis, 1.1))] == [row + 1]


def test_a_rest_that_got_the_number_of_the_next_is_named():
    r = read(XSENS)
    for row in range(37):
        numbered = replace(r, position=np.where(np.arange(38) == row, r.position + 1, r.position))
        assert [s.position for s in norm_outliers(numbered)] == [row + 2]


def test_two_strays_that_hide_each_other_are_both_named():
    r = read(XSENS)
    x = r.channels["specific_force", "x"].copy()
    x[[14, 15]] = x[[15, 14]]
    assert [s.position for s in norm_outliers(r.with_channels({("specific_force", "x"): x}))] == [
        15,
        16,
    ]


@pytest.mark.parametrize("tilt", [0.0, 0.02])
def test_six_faces_name_their_stray(tilt):
    """No turn of theirs shows a misalignment."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        u = np.concatenate([np.eye(3), -np.eye(3)] * 4) + tilt * rng.standard_normal((24, 3))
        y = G * u / np.linalg.norm(u, axis=1, keepdims=True) @ (np.eye(3) + 0.02 * rng.standard_normal((3, 3))).T
        y += 0.3 * rng.standard_normal(3) + SIGMA * rng.standard_normal(y.shape)
        assert norm_outliers(table(y)) == ()
        y[seed, seed % 3] *= 1.1
        assert [s.position for s in norm_outliers(table(y))] == [seed + 1]


def test_a_row_of_a_table_that_is_marked_0_is_told_and_no_turn():
    r = read(XSENS)
    assert r.position is not None
    marked = replace(r, position=np.where(r.position == 19, 0, r.position))
    (remark,) = [w for w in refuse_implausible(marked) if "marked 0" in w]
    assert "at 258.369 s" in remark
    assert not any("marked 0" in w for w in refuse_implausible(r))
    assert "gyroscopes" not in inertial_unit(marked, LINEAR).outcome


def test_a_rest_that_a_row_marked_0_cuts_in_two_is_one():
    r = turned(4)
    several = r.select(np.repeat(np.arange(30), 3))
    position = several.position.copy()
    position[16] = 0  # the middle row of the sixth rest
    cut = inertial_unit(replace(several, time=np.arange(90.0), position=position), LINEAR)
    np.testing.assert_allclose(cut.values, inertial_unit(r, LINEAR).values, rtol=0.1, atol=1e-4)
    assert cut.outcome == ""


def test_counts_of_faces_have_their_scale_from_these():
    """An ellipsoid through them is any of a wide choice: one was a fifth as large along x."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u = np.concatenate([np.eye(3), -np.eye(3), np.tile([0.0, 0.0, -1.0], (30, 1))])
        u += 0.01 * rng.standard_normal(u.shape)
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        y = 16384 * (u * [1.01, 0.99, 1.0] + [0.02, -0.01, 0.04] + 0.004 * rng.standard_normal(u.shape))
        counts = scaled_by_gravity(replace(table(y), units={("specific_force", a): "count" for a in "xyz"}))[1]
        np.testing.assert_allclose(np.array(counts.scale) * 16384 / G, [0.99, 1.01, 1.0], atol=0.015)
