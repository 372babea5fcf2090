"""Gyroscopes that are held against accelerometers move when these do, and their sigma says so."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.effects import with_values
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.gyroscopes.between_rests import LINEAR, gyroscopes_between_rests
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import LINEAR as LINEAR_PARAMETERS
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import fit_turns
from gimbalcal.views.turns import gravity_after_turns, turns_between_rests
from tests.estimate.gyroscopes.test_between_rests import TRUTH, hand


def test_the_estimate_moves_as_the_accelerometers_do():
    """Half a milli-g of bias, known as the covariance of one combination, moves the fit by what is added to its."""
    recording = hand(TRUTH, 1e-3, count=16)
    accelerometers = multiposition(recording, ("bias",))
    shift = np.array([5e-3, -3e-3, 4e-3])
    moved = replace(accelerometers, effects=with_values(accelerometers.effects, accelerometers.parameters,
                                                        accelerometers.values + shift))  # fmt: skip
    before, after = (fit_turns(turns_between_rests(recording, a), LINEAR_PARAMETERS) for a in (accelerometers, moved))
    known = replace(accelerometers, covariance=np.outer(shift, shift) + 1e-16 * np.eye(3))
    turns = replace(turns_between_rests(recording, accelerometers), accelerometers=known)
    added = before.with_fixed_nuisances([gravity_after_turns(turns, before.effects)]).covariance - before.covariance
    np.testing.assert_allclose(np.sqrt(np.diag(added)), np.abs(after.x - before.x), rtol=0.02, atol=1e-6)
    assert np.linalg.matrix_rank(added, tol=1e-3 * np.trace(added)) == 1


def test_sigma_holds_what_the_accelerometers_do_not_know():
    recording = hand(TRUTH, 1e-3, count=16)
    accelerometers = multiposition(recording, ("bias",))
    vague = replace(accelerometers, covariance=(3e-3) ** 2 * np.eye(3))
    known, unknown = (gyroscopes_between_rests(recording, a, LINEAR) for a in (accelerometers, vague))
    np.testing.assert_array_equal(known.values, unknown.values)
    turning = [p.effect != "gyro_bias" for p in known.parameters]
    assert np.all(unknown.sigmas[turning] > known.sigmas[turning])
    assert np.median(unknown.sigmas[turning]) == pytest.approx(3e-3 / 9.8 / np.sqrt(5), rel=1.0)  # over some turns each
