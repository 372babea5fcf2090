"""Positions are prepared once, and each stage does its own work alone."""

import numpy as np

from gimbalcal import pipeline
from gimbalcal.estimate.accelerometers import position_fit
from gimbalcal.estimate.accelerometers.coarse import coarse
from gimbalcal.estimate.accelerometers.fine import fine
from gimbalcal.estimate.accelerometers.joint import joint
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions
from tests.estimate.device import draw, interchanged, measured


def test_every_stage_leaves_out_the_positions_that_were_found_once(monkeypatch):
    rng = np.random.default_rng(3)
    recording = interchanged(measured(draw(rng), rng), 3, 9)
    positions = trusted_positions(recording)
    monkeypatch.setattr(position_fit, "fit_with_noise", None)  # whoever fits again to find noise or faults fails
    first = coarse(positions)
    second = fine(positions, first)
    third = joint(positions, second)
    assert [c.provenance["left_out"] for c in (first, second, third)] == [[[4, 10]]] * 3
    assert all("positions 4 and 10 are interchanged" in c.outcome.lower() for c in (first, second, third))


def test_the_three_stages_search_for_faults_once(monkeypatch):
    rng = np.random.default_rng(4)
    recording = measured(draw(rng), rng)
    searched = []
    monkeypatch.setattr(pipeline, "trusted_positions", lambda r: searched.append(r) or trusted_positions(r))
    made = pipeline.three_stage([recording])
    assert searched == [recording]
    np.testing.assert_allclose(made.values, joint(trusted_positions(recording)).values, atol=1e-3 * made.sigmas.min())
