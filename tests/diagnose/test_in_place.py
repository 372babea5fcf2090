"""A unit that is turned from stop to stop: what its navigator does wrong names what 30 states leave out."""

import numpy as np
import pytest

from gimbalcal import diagnose
from gimbalcal.diagnose.rows.in_place import turned_in_place
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.units import from_si
from tests.estimate.systematic.table import turning_unit

SHORT = {"stop": 12.0, "speed": 30.0, "ramp": 0.5, "rate": 10.0}  # 4 min


def _hiding(effect, axis, size, **more):
    wanted = [p for p in parameters(CATALOGUE[effect]) if p.axis == axis]
    return turning_unit(parameters=wanted, values=[size], **{**SHORT, **more})


def test_clean():
    d = diagnose([turning_unit(**SHORT)])
    assert d.verdict == "adequate"
    assert d.fit["chi2_reduced_before"] == pytest.approx(1, abs=0.15)
    noise = d.fit["chi2_of_samples_before"]
    assert all(0.6 < x < 1.3 for x in noise.values())


@pytest.mark.parametrize(
    ("effect", "axis", "size"),
    [
        ("gyro_g_sensitivity_rate", "zx", 1e-6),
        ("quadratic_nonlinearity", "x", 1e-5),
        ("cross_coupling", "yz", 3e-5),
        ("lever_arm", "y", 0.02),
        ("accelerometer_lever_arm", "zz", 0.03),
        ("gyro_scale_asymmetry", "y", 3e-4),
    ],
)
def test_what_is_left_out_is_named(effect, axis, size):
    d = diagnose([_hiding(effect, axis, size, seed=3)])
    assert [(f["effect"], f["axis"]) for f in d.findings] == [(effect, axis)]
    assert d.verdict == "missing-physics"
    (told,) = [p for p in d.findings[0]["parameters"] if p["axis"] == axis]
    (unit,) = {p.unit for p in parameters(CATALOGUE[effect]) if p.axis == axis}
    assert abs(told["value"] - from_si(size, unit)) < 4 * told["sigma"]
    assert d.fit["heldout_rms_after"] < d.fit["heldout_rms_before"]


def test_a_law_of_no_catalogue():
    def half_waves(t):
        wave = np.maximum(np.sin(2 * np.pi * t / 60), 0)
        return 3e-3 * np.stack([wave, 0 * t, 0 * t], axis=-1)

    d = diagnose([turning_unit(drift=half_waves, **SHORT)])
    assert d.verdict == "unexplained"
    assert d.unexplained[0]["channel"] == "specific_force x"


def test_a_table_that_goes_on_tilting_is_none():
    assert turned_in_place(turning_unit(**SHORT))
    assert not turned_in_place(turning_unit(**{**SHORT, "stop": 0.0}))
