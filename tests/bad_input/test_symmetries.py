"""What a calibration must not depend on: order of rows, origin of time, the way over the disk."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gimbalcal.effects import values
from gimbalcal.methods import calibrate
from gimbalcal.pipeline import load
from gimbalcal.recording import dwells, read, write
from tests.paths import DEVICE


@pytest.fixture(scope="module")
def device():
    return load([DEVICE])[0]


def calibrated(recording, folder):
    """Values and sigmas, in SI, by way of the disk."""
    made = calibrate([write(recording, folder)])[0]
    return values(made.effects, made.parameters), np.sqrt(np.diag(made.covariance))


SLOW = settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@SLOW
@given(seed=st.integers(0, 2**32 - 1))
def test_the_order_of_rows_in_a_dwell_does_not_matter(tmp_path, device, seed):
    rng = np.random.default_rng(seed)
    order = np.concatenate([d.start + rng.permutation(d.stop - d.start) for d in dwells(device)])
    mixed = replace(device, channels={key: v[order] for key, v in device.channels.items()})
    (x, sigma), (y, _) = (calibrated(r, tmp_path / n) for r, n in ((device, "ordered"), (mixed, "mixed")))
    # sums of 60 rows in another order: 1e-15 of 9.8 m/s^2, and the noise, stated, is 1e-4 m/s^2
    np.testing.assert_allclose(y, x, rtol=0, atol=1e-6 * sigma.min())


@SLOW
@given(shift=st.integers(-(10**9), 10**9))
def test_the_origin_of_time_does_not_matter(tmp_path, device, shift):
    later = replace(device, time=device.time + shift)
    (x, sigma), (y, _) = (calibrated(r, tmp_path / n) for r, n in ((device, "now"), (later, "then")))
    np.testing.assert_array_less(np.abs(y - x), 1e-9 * sigma)


@SLOW
@given(samples=st.sampled_from(["samples.csv", "samples.parquet"]), seed=st.integers(0, 2**32 - 1))
def test_written_and_read_again_is_the_same(tmp_path, device, samples, seed):
    rng = np.random.default_rng(seed)
    some = device.select(
        np.sort(rng.choice(len(device.time), 600, replace=False))
    )  # fewer may leave a gap that is refused
    back = read(write(some, tmp_path / f"{seed}", samples))
    assert (back.kind, back.title, back.platform) == (some.kind, some.title, some.platform)
    np.testing.assert_array_equal(back.time, some.time)
    np.testing.assert_array_equal(back.position, some.position)
    assert back.channels.keys() == some.channels.keys()
    for key, held_values in some.channels.items():
        np.testing.assert_allclose(back.channels[key], held_values, rtol=4e-16, atol=0)  # deg and back: two roundings
