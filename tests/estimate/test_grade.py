"""The grade of a unit from the scatter of its readings at rest, however they were sampled, filtered or counted."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from gimbalcal.effects.sensor_grades import DEG_ROOT_H, UG
from gimbalcal.estimate.grade import grade_of_unit, random_walk_size
from gimbalcal.platform import BENCH, SPACE_STABLE
from gimbalcal.recording import Recording, Site, dwell_means, with_rests_as_positions

G = 9.80665
UP = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)])
RESTS = UP / np.linalg.norm(UP, axis=1, keepdims=True)


def unit(force, rate=0.0, hertz=20.0, seconds=8.0, smooth=1):
    """A unit in 26 attitudes whose means over 1 s scatter by `force` ug and `rate` deg/sqrt(h), filtered or not."""
    rng = np.random.default_rng(3)
    n = round(seconds * hertz)
    rest = np.repeat(np.arange(len(RESTS)), n)
    white = rng.standard_normal((6, len(RESTS), n)) * np.sqrt(hertz)
    white = uniform_filter1d(white, smooth, axis=-1).reshape(6, -1).T if smooth > 1 else white.reshape(6, -1).T
    f = G * RESTS[rest] + force * UG * white[:, :3] + [0.3, -0.2, 0.1]
    channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
    if rate:
        channels |= {("angular_rate", a): rate * DEG_ROOT_H * white[:, 3 + i] for i, a in enumerate("xyz")}
    t = np.tile(np.arange(n) / hertz, len(RESTS)) + rest * (seconds + 5.0)
    return with_rests_as_positions(
        Recording("multi-position", "unit", BENCH, Site(None, 0.0, G), {}, t, rest + 1, channels)
    )


@pytest.mark.parametrize(("hertz", "smooth"), [(20.0, 1), (200.0, 1), (200.0, 40), (1.0, 1)])
def test_the_noise_is_that_of_a_second_whatever_the_rate_and_the_filter(hertz, smooth):
    r = unit(150.0, 0.5, hertz, 8.0 if hertz > 1 else 40.0, smooth)
    assert random_walk_size(r, "accelerometer") == pytest.approx(150 * UG, rel=0.2)
    assert random_walk_size(r, "gyroscope") == pytest.approx(0.5 * DEG_ROOT_H, rel=0.2)
    found = grade_of_unit([r])
    assert found.grade.name == "industrial"
    assert re.fullmatch(r"accelerometers scatter by 1\d0 ug in a mean over 1 s and gyroscopes by 0\.\d+ deg/sqrt\(h\)",
                        found.source)  # fmt: skip


def test_counts_have_gravity_for_a_scale_and_rates_in_counts_say_nothing():
    r = unit(300.0, 0.1)
    counted = {k: np.round(x / (G / 2000 if k[0] == "specific_force" else 1e-4)) + 77 for k, x in r.channels.items()}
    r = with_rests_as_positions(replace(r, channels=counted, units=dict.fromkeys(counted, "count"), scatter={}))
    assert random_walk_size(r, "accelerometer") == pytest.approx(300 * UG, rel=0.2)
    assert random_walk_size(r, "gyroscope") is None
    assert grade_of_unit([r]).grade.name == "consumer"


def test_a_converter_that_is_too_coarse_to_show_noise_is_not_a_quiet_sensor():
    r = unit(1.0)
    step = 4e-3 * G
    coarse = with_rests_as_positions(
        replace(r, channels={k: step * np.round(x / step) for k, x in r.channels.items()}, scatter={})
    )
    found = random_walk_size(coarse, "accelerometer")
    assert found > 200 * UG
    assert grade_of_unit([r]).grade.name == "navigation"


def test_stated_noise_counts_before_what_is_seen():
    r = replace(unit(300.0), noise={"accelerometer": 60 * UG * np.sqrt(20.0)})
    assert random_walk_size(r, "accelerometer") == pytest.approx(60 * UG)
    assert grade_of_unit([r]).grade.name == "tactical"


def test_rows_that_are_means_say_as_much_as_their_samples():
    means = dwell_means(unit(60.0))
    assert random_walk_size(means, "accelerometer") == pytest.approx(
        60 * UG * np.sqrt(13 / 8), rel=0.2
    )  # 5 s of 13 in motion


def bare(f, **changes):
    channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
    r = Recording("multi-position", "bare", BENCH, Site(None, 0.0, G), {}, 60.0 * np.arange(len(f)),
                  np.arange(1, len(f) + 1), channels)  # fmt: skip
    return replace(r, **changes)


def test_where_nothing_tells_the_noise_it_is_said_what_was_assumed():
    for platform, name in ((BENCH, "consumer"), (SPACE_STABLE, "navigation")):
        found = grade_of_unit([bare(G * RESTS, platform=platform)])
        assert found.grade.name == name
        assert "assumed" in found.source
        assert "no noise" in found.in_words


def test_what_holds_itself_still_in_inertial_space_is_of_navigation_grade():
    run = bare(G * RESTS, kind="static-run", platform=SPACE_STABLE, position=None, noise={"accelerometer": 5e-3})
    assert grade_of_unit([run]).grade.name == "navigation"
    assert grade_of_unit([run, unit(300.0)]).grade.name == "consumer"  # the positions of the same unit tell more


def test_a_name_overrules_the_noise():
    found = grade_of_unit([unit(300.0)], "navigation")
    assert (found.grade.name, found.source) == ("navigation", "--grade says so")
