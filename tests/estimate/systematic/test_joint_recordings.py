"""Several recordings of one unit, turned in its place at different times: constants in common."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal import methods
from gimbalcal.estimate.systematic.calibrate import calibrate_jointly, systematic
from gimbalcal.estimate.systematic.state_lists import states
from gimbalcal.recording import Source
from gimbalcal.rotation import frame_rotation
from tests.estimate.systematic.table import MOVES, START, turning_unit
from tests.golden import golden_text, refused

THIRTY = states("30", turning_unit(moves=MOVES[:2], stop=8.0, rate=10.0).why_not_shown)
SCALE = np.array([p.sigma for p in THIRTY])
TRUTH = 0.5 * SCALE * np.random.default_rng(3).standard_normal(len(THIRTY))
SHORT = {"stop": 12.0, "speed": 30.0, "ramp": 0.5, "rate": 10.0}
HALVES = ([m for m in MOVES if m[0] == "y"], [m for m in MOVES if m[0] != "y"])


def _z(found):
    return (found.values - TRUTH) / found.sigmas


def test_two_recordings_are_one_of_twice_the_length():
    each = [turning_unit((), THIRTY, TRUTH, **SHORT, seed=seed) for seed in (1, 2)]
    both = calibrate_jointly(each, "30")
    alone = [systematic(r, "30") for r in each]
    inverse = sum(np.linalg.inv(c.covariance) for c in alone)
    assert both.outcome == ""
    assert both.sigmas == pytest.approx(np.sqrt(np.diag(np.linalg.inv(inverse))), rel=1e-2)
    mean = np.linalg.solve(inverse, sum(np.linalg.inv(c.covariance) @ c.values for c in alone))
    assert np.abs((both.values - mean) / both.sigmas).max() < 0.05
    assert np.abs(_z(both)).max() < 4
    assert [s["p_value"] > 0.005 for s in both.provenance["options"]["sessions"]] == [True, True]
    assert both.residual.dof == sum(c.residual.dof for c in alone)


def test_what_one_does_not_turn_the_other_shows():
    """Turns about y in one, about x and z in the other: neither sees everything, both together do."""
    start = frame_rotation("z", 0.7) @ START
    each = [turning_unit((), THIRTY, TRUTH, moves=m, **SHORT, seed=5, start=start) for m in HALVES]
    assert all(systematic(r, "30").unobservable for r in each)
    both = calibrate_jointly(each, "30")
    assert both.unobservable == ()
    assert both.outcome == ""
    assert np.abs(_z(both)).max() < 4


def test_a_unit_that_has_changed_is_told():
    moved = TRUTH + np.array([2e-5 if p.label == "scale_factor:y" else 0.0 for p in THIRTY])
    each = [turning_unit((), THIRTY, x, **SHORT, seed=k) for k, x in enumerate((TRUTH, moved))]
    each[1] = replace(each[1], title="in spring")
    both, _ = methods.calibrate(each, "systematic", states="30")
    golden_text(both.outcome)


def test_the_same_twice_and_terms_are_refused():
    r = replace(turning_unit(moves=MOVES[:6], stop=8.0), source=(Source("a.csv", "f" * 64),))
    with refused():
        calibrate_jointly([r, r], "30")
    with refused():
        methods.calibrate([r], "systematic", ["bias"])
