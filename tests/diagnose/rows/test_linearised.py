"""Linearised about a large cause, the constants of the model do not take it up."""

from typing import Any

import numpy as np

from gimbalcal.diagnose.evidence.stated_noise import scale_to_scatter
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.diagnose.search.relinearise import less_causes, with_causes_back
from gimbalcal.effects import parameters
from gimbalcal.effects.thermal import ScaleTemperature
from gimbalcal.simulate import simulate
from gimbalcal.views.core import absent_effect
from gimbalcal.views.known_attitude import view_at_known_attitude

UG = 9.80665e-6
DAY: dict[str, Any] = {
    "format": 1, "kind": "static-run", "title": "a day at rest", "site": {"latitude": {"value": 40.0, "unit": "deg"}},
    "schedule": {"duration": {"value": 24.0, "unit": "h"}, "rate": {"value": 1 / 120, "unit": "Hz"}},
    "environment": {"temperature": {"shape": "random-walk", "mean": 22.0, "walk": 0.5}, "thermometer_sigma": 0.01},
    "noise": {
        "accelerometer": {"value": 3.0, "unit": "ug"}, "gimbal_angle": {"value": 1.0, "unit": "arcsec"},
        "attitude": {"value": 0.3, "unit": "arcsec"},
    },
    "truth": {"draw": True, "bias_temperature": {"z": 150.0}},
}  # fmt: skip


def misfit(o):
    Z, y = o.reduced(o.Z), o.reduced(o.residual[:, :, None])
    left = y - Z @ np.linalg.lstsq(Z, y, rcond=1e-9)[0]
    return float((left**2).mean())


def test_bias_less_scale_is_no_copy_of_a_scale_factor_in_temperature():
    # z lies along the Earth's axis and feels the same force all day: bias and scale factor differ by the cause alone,
    # which was "adequate" at 4700 sigma
    o = scale_to_scatter(fit_baseline(view_at_known_attitude(simulate(DAY, 1)[0]), steps=0))
    wanted = [p for p in parameters(ScaleTemperature) if p.axis == "z"]
    effect = absent_effect("scale_temperature", o.view.stimulus)
    size = np.array([150 * UG / np.sin(np.radians(40.0)) / 9.80])  # what looks like 150 ug/degC of bias
    Z, y, taken = (
        o.reduced(o.Z),
        *(o.reduced(x[:, :, None]) for x in (o.residual, o.rows.columns(effect, wanted) @ size)),
    )
    shift = np.linalg.lstsq(Z, y - taken, rcond=1e-9)[0][:, 0]
    about = less_causes(o, shift, [(effect, wanted, size)])
    assert misfit(about) < 1.5
    assert misfit(with_causes_back(about, [(effect, wanted, size)])) > 0.5 * misfit(o) > 20
