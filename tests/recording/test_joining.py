"""Sessions of one instrument as one recording: clocks that go on, positions numbered on, weights by their noise."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.joining import PAUSE, join


def session(begin, noise=1e-5, scatter=1.0):
    """Three rows, ten seconds apart: a rest, a row on the way, a rest."""
    force = {("specific_force", a): np.arange(3.0) for a in "xyz"}
    return Recording(
        "multi-position", "s", BENCH, Site(), {"accelerometer": noise}, begin + 10.0 * np.arange(3),
        np.array([1, 0, 2]), force, scatter={("specific_force", "x"): scatter},
    )  # fmt: skip


def test_clocks_that_follow_each_other_are_kept_and_others_are_a_day_apart():
    assert join([session(100.0), session(500.0)]).time.tolist() == [100, 110, 120, 500, 510, 520]
    both = [0, 10, 20, 20 + PAUSE, 30 + PAUSE, 40 + PAUSE]
    assert join([session(100.0), session(110.0)]).time.tolist() == both  # the second began before the first ended
    assert join([session(500.0), session(100.0)]).time.tolist() == both


def test_positions_are_numbered_on_and_what_is_on_the_way_stays_so():
    position = join([session(0.0), session(100.0), session(200.0)]).position
    assert position.tolist() == [1, 0, 2, 3, 0, 4, 5, 0, 6]


def test_a_row_weighs_by_its_noise_and_the_whole_has_the_rms_of_both():
    made = join([session(0.0, 3e-5, 3.0), session(100.0, 4e-5, 4.0)])
    common = made.noise["accelerometer"]
    assert common == pytest.approx(np.sqrt((3.0**2 + 4.0**2) / 2) * 1e-5)
    np.testing.assert_allclose(common / np.sqrt(made.weight), np.repeat([3e-5, 4e-5], 3))
    assert made.scatter["specific_force", "x"] == pytest.approx(np.sqrt((3.0**2 + 4.0**2) / 2))
    unsaid = [replace(session(t), noise={}) for t in (0.0, 100.0)]
    assert join(unsaid).weight.tolist() == [1.0] * 6
