"""Both triads are one model: what an accelerometer does is not told as a fault of the gyroscopes, by a plant apart."""

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from tests.diagnose.turned_plant import DEG, G, Unit, turned


def asymmetric(f, w, T, t):
    return np.abs(f) * [3e-3, -2e-3, 2.5e-3]


def one_sided(f, w, T, t):
    return np.abs(w) * [3e-3, -4e-3, 2.5e-3]


def warm(f, w, T, t):
    return (T - 20)[:, None] * np.array([1e-3, -3e-4, -7e-4]) * G


def effects(d):
    return [f["effect"] for f in d.findings]


@pytest.mark.parametrize(
    ("name", "law", "more", "latitude"),
    [
        ("scale_factor_asymmetry", asymmetric, {}, None),
        ("bias_temperature", warm, {"temperature": lambda t: 20 + 15 * np.sin(t / 40)}, 0.8),
    ],
)
def test_a_fault_of_the_accelerometers_is_theirs_alone(name, law, more, latitude):
    d = diagnose([turned(3, Unit(force=law, **more), latitude=latitude)])
    assert name in effects(d)
    assert not any(e.startswith("gyro") for e in effects(d))


def test_a_corrected_unit_lacks_nothing_more():
    """Asymmetries in both triads are named, and a recording corrected by them is adequate in all views."""
    r = turned(2, Unit(force=asymmetric, rate=one_sided))
    d = diagnose([r])
    assert effects(d) == ["scale_factor_asymmetry", "gyro_scale_asymmetry"]
    rows = {p["axis"]: (p["value"], p["sigma"]) for p in d.findings[1]["parameters"]}
    for a, truth in zip("xyz", (3e3, -4e3, 2.5e3), strict=True):
        assert abs(rows[a][0] - truth) < 4 * rows[a][1] + 0.02 * abs(truth)
    again = diagnose([d.calibration.apply(r)])
    assert again.verdict == "adequate", again.in_words


def test_without_a_latitude_the_earth_is_no_g_sensitivity():
    """Gyroscopes of 3e-3 deg/s a sample see 10.8 deg/h about the vertical: as a g-sensitivity of all axes would be."""
    assert diagnose([turned(1, Unit(noise=(1e-4 * G, 3e-3 * DEG, 0.0)), latitude=None)]).verdict == "adequate"


def test_forces_that_nothing_explains_say_nothing_of_the_turns():
    """A law of no catalogue: where down is before and after a turn is not known to better than it."""
    bent = Unit(force=lambda f, w, T, t: 0.02 * np.sin(3 * f + [0.4, 1.0, 2.0]))
    d = diagnose([turned(4, bent, rests=40)])
    assert not any(e.startswith("gyro") for e in effects(d))
    assert d.verdict == "unexplained" or d.outcome  # a misfit of 200 times the noise of the samples is told
