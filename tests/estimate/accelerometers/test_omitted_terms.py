"""A quadratic term of usual size that the positions do not show moves the others by less than their sigmas say."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.earth import G0
from gimbalcal.estimate.accelerometers.multiposition import LINEAR, multiposition
from gimbalcal.platform import BENCH
from gimbalcal.recording import read
from tests.paths import DEVICE

UG = 1e-6 * G0


def unit(rng, positions, noise, square):
    """A unit of random constants at random attitudes, noise of a mean [ug], square [ug/g^2]; and its scales, biases."""
    r = read(DEVICE)
    down = rng.standard_normal((positions, 3))
    f = r.site.gravity * down / np.linalg.norm(down, axis=1, keepdims=True)
    s, b, K = 1e-4 * rng.standard_normal(3), 200 * UG * rng.standard_normal(3), square * rng.standard_normal(3)
    y = f / (1 + s)
    y = y + K * UG / G0**2 * y**2 + b + noise * UG * rng.standard_normal((positions, 3))
    channels = {("specific_force", a): y[:, i] for i, a in enumerate("xyz")}
    made = replace(
        r, platform=BENCH, time=10.0 * np.arange(positions), position=np.arange(1, positions + 1), channels=channels,
        weight=np.full(positions, 60.0), noise={"accelerometer": noise * UG * np.sqrt(60)}, units={}, scatter={},
        remarks=(), source=(),
    )  # fmt: skip
    return made, np.array([*s, *b])


@pytest.mark.parametrize(("positions", "noise"), [(10, 1.0), (18, 5.0)])
def test_errors_are_within_what_the_sigmas_say(positions, noise):
    rng = np.random.default_rng(5)
    off = []
    for _ in range(10):
        r, truth = unit(rng, positions, noise, 30.0)
        made = multiposition(r)
        own = [i for i, p in enumerate(made.parameters) if p.effect in ("scale_factor", "bias")]
        off.append((made.values[own] - truth) / made.sigmas[own])
    assert np.sqrt(np.mean(np.square(off))) < 1.3  # of 60, many of them correlated; it was 3 to 10
    assert np.abs(off).max() < 4.5


def test_what_is_not_asked_for_is_not_reckoned_with_and_what_is_declined_is_told():
    r, _ = unit(np.random.default_rng(1), 10, 1.0, 0.0)
    full, linear = multiposition(r), multiposition(r, LINEAR)
    np.testing.assert_allclose(full.values, linear.values)
    assert np.all(full.sigmas > linear.sigmas)
    assert full.sigmas[3] > 2 * linear.sigmas[3]
    declined = full.provenance["options"]["declined"]["scale_nonlinearity"]
    assert "of usual size it moves an estimate by" in declined
