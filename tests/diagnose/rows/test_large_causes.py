"""A cause of hundreds of sigmas in every row: its products with itself and with the constants are no further causes."""

from typing import Any

import numpy as np

from gimbalcal.diagnose.evidence.stated_noise import scale_to_scatter
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.diagnose.search.relinearise import less_causes, with_causes_back
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.recording import Recording
from gimbalcal.simulate import simulate
from gimbalcal.views.core import absent_effect
from gimbalcal.views.known_attitude import view_at_known_attitude

SCENARIO: dict[str, Any] = {
    "format": 1, "kind": "static-run", "site": {"latitude": {"value": 52.0, "unit": "deg"}},
    "schedule": {"duration": {"value": 48.0, "unit": "h"}, "rate": {"value": 1 / 600, "unit": "Hz"}},
    "noise": {"accelerometer": {"value": 2.0, "unit": "ug"}, "gimbal_angle": {"value": 0.1, "unit": "arcsec"},
              "attitude": {"value": 0.1, "unit": "arcsec"}},
    "truth": {"draw": True, "factor": 0.3, "gyro_drift": {"equatorial_x": 0.002}},
}  # fmt: skip


def fitted(o, effect):
    """Reduced chi^2 of constants and one effect together, the constants' shift [prior sigmas], and the sizes [SI]."""
    wanted = parameters(CATALOGUE[effect], o.view.stimulus.axis_names)
    scale = np.array([p.sigma for p in wanted])
    X = o.rows.columns(absent_effect(effect, o.view.stimulus), wanted) * scale
    A, y = np.concatenate([o.reduced(o.Z), o.reduced(X)], axis=1), o.reduced(o.residual[:, :, None])[:, 0]
    x = np.linalg.lstsq(A, y, rcond=1e-9)[0]
    q = o.Z.shape[-1]
    left = y - A @ x
    return float(left @ left) / (len(y) - np.linalg.matrix_rank(A)), x[:q], x[q:] * scale


def test_the_rows_about_a_large_cause_are_explained_by_it():
    run: Recording = simulate(SCENARIO, 4)[0]
    dragged = scale_to_scatter(fit_baseline(view_at_known_attitude(run)))
    assert fitted(dragged, "gyro_drift")[0] > 5  # about constants that the cause has dragged away

    o, wanted = (
        fit_baseline(view_at_known_attitude(run), steps=0),
        parameters(CATALOGUE["gyro_drift"], run.platform.axis_names),
    )
    first, shift, size = fitted(o, "gyro_drift")
    assert first > 1.2  # products of 1500 sigmas
    found = [(absent_effect("gyro_drift", o.view.stimulus), wanted, size)]
    about = with_causes_back(scale_to_scatter(less_causes(o, shift, found)), found)
    chi2, _, size = fitted(about, "gyro_drift")
    assert abs(chi2 - 1) < 0.1
    np.testing.assert_allclose(np.rad2deg(size) * 3600, [0.002, 0, 0], atol=5e-6)
    # what can mimic it with more parameters has nothing more to explain
    rows = about.residual.size
    assert (chi2 - fitted(about, "gyro_g_sensitivity")[0]) * rows < 30
