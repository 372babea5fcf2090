"""The noise of a recording: weights leave what was measured as it is."""

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.evidence.noise import settle
from gimbalcal.diagnose.rows.observations import observe
from tests.diagnose.laws import held_before
from tests.diagnose.plant import UG, on, record

TAILS = 4.0  # degrees of freedom of Student's t


def creep(b):
    """What a change of load leaves behind; it dies away in half a minute of a dwell's two."""
    f = b.ideal[:, 1]
    change = (f - held_before(b, 1, 1)) * (b.visit > 0)
    return on(1, change * np.exp(-b.since / 30.0))


def with_creep(size, seed=3):
    return record(np.random.default_rng(seed), creep, size * UG, tails=TAILS)


def test_rows_stay_as_measured_where_tails_are_heavy():
    o = observe(with_creep(150.0))
    settled = settle(o)
    assert settled.heavy > 0.6
    np.testing.assert_allclose(settled.y * settled.sigma, o.y * o.sigma, rtol=1e-12)
    assert settled.weight is not None
    np.testing.assert_allclose(settled.weight.mean(axis=0), 1.0, rtol=1e-12)


def test_an_effect_inside_dwells_costs_no_row_its_weight():
    without, with_it = (settle(observe(with_creep(size))).weight for size in (0.0, 150.0))
    # the effect falls by 7 sigma of a row over the first minute, which a median of each block does not follow
    moved = np.abs(with_it - without)
    assert np.mean(moved > 0.25) < 0.02
    assert moved.mean() < 0.02


def test_outliers_lose_their_weight_and_their_pull():
    clean = record(np.random.default_rng(8), tails=TAILS)
    channels = dict(clean.channels)
    hit = channels["specific_force", "x"].copy()
    hit[100::180] += 2000 * UG
    channels["specific_force", "x"] = hit
    o = settle(observe(clean))
    spoiled = settle(observe(type(clean)(**{**vars(clean), "channels": channels})))
    assert spoiled.weight[100::180, 0].max() < 0.05
    # twelve of 2160 rows, each worth 100 sigma of a row, in plain means 22 sigma of a block of 20
    moved = (spoiled.reduce(spoiled.y[:, :, None]) - o.reduce(o.y[:, :, None]))[::3, 0]
    assert np.abs(moved - np.median(moved)).max() < 2.0


@pytest.mark.parametrize("tails", [0.0, 3.0, 5.0])
def test_weighted_rows_have_unit_variance(tails):
    chi2, dof = 0.0, 0
    for seed in range(4):
        o = settle(observe(record(np.random.default_rng(seed), tails=tails, loose=0.0)))
        y, Z = o.reduce(o.y[:, :, None])[:, 0], o.reduce(o.Z)
        left = y - Z @ np.linalg.lstsq(Z, y, rcond=1e-10)[0]
        chi2, dof = chi2 + left @ left, dof + len(y) - 17
    assert chi2 / dof == pytest.approx(1.0, abs=4 * np.sqrt(2 / dof))


def test_a_cause_inside_dwells_is_found_in_heavy_tails():
    d = diagnose([with_creep(40.0)])
    assert [f["effect"] for f in d.findings] == ["post_move_creep"]
    assert d.findings[0]["parameters"][0]["value"] == pytest.approx(40.0, rel=0.25)
