"""`gimbalcal noise`: units, rests, what a header takes, and what is refused."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from gimbalcal import from_arrays
from gimbalcal.at_rest import StatedNoise, in_words, noise_at_rest, noise_header, rest_noise
from gimbalcal.earth import G0
from gimbalcal.recording import write
from tests.golden import golden_text, refused
from tests.paths import ROOT, STATIC

UG, DEG = 1e-6 * G0, np.pi / 180


FORCE_X = ("specific_force", "x")


def unit(n=6000, rate=50.0, seed=1, turns=1, **more):
    """A unit at rest in `turns` attitudes: 100 ug/sqrt(Hz) and 0.3 deg/sqrt(h)."""
    rng, step = np.random.default_rng(seed), 1 / rate
    down = np.repeat(np.eye(3)[np.arange(turns) % 3], n // turns, axis=0)
    force = G0 * down + 100 * UG / np.sqrt(step) * rng.standard_normal((n, 3))
    turn = 0.3 * DEG / 60 / np.sqrt(step) * rng.standard_normal((n, 3)) + [0.01, 0, -0.02]
    position = 1 + np.arange(n) // (n // turns)
    return from_arrays(np.arange(n) * step, specific_force=force, angular_rate=turn, position=position,
                       units={"specific_force": "m/s^2", "angular_rate": "rad/s"}, **more)  # fmt: skip


@pytest.mark.parametrize("turns", [1, 12])
def test_density_is_found_in_one_rest_and_in_many(turns):
    channels = noise_at_rest(unit(turns=turns))
    assert len(channels) == 6
    for c in channels:
        white, size = c.coefficient(0), 100 if c.key[0] == "specific_force" else 0.3
        assert white.unit == ("ug/sqrt(Hz)" if c.key[0] == "specific_force" else "deg/sqrt(h)")
        assert abs(white.value - size) < 4 * white.sigma < 0.1 * size
        assert not c.coefficient(1).significant
        assert c.coefficient(1).below > 0
    stated = noise_header(channels)
    assert stated["accelerometer"] == StatedNoise(pytest.approx(100 * UG * np.sqrt(50), rel=0.03), "m/s^2")
    assert stated["gyroscope"] == StatedNoise(pytest.approx(0.3 * DEG / 60 * np.sqrt(50), rel=0.03), "rad/s")


def test_rests_in_which_a_sensor_is_shaken_say_nothing_of_its_noise():
    r = unit(turns=12)
    rate = r.channels["angular_rate", "z"].copy()
    rate[500:1500] += np.radians(0.3) * np.random.default_rng(3).standard_normal(1000)
    noise = rest_noise(r.with_channels({("angular_rate", "z"): rate}))
    assert noise.rests == 10
    assert noise.channels[5].white_noise.value == pytest.approx(0.3, rel=0.03)
    golden_text(noise.in_words)
    coarse = np.round(r.channels["angular_rate", "z"] / np.radians(0.3)) * np.radians(0.3)
    coarse[::100] += np.radians(0.3)  # a step now and then is all that such a channel shows
    assert rest_noise(r.with_channels({("angular_rate", "z"): coarse})).rests == 12


def test_stamps_of_rows_that_waited_to_be_read_leave_a_rest_whole():
    """A fourth of the rows is stamped 17 ms after the row before, where most are 10 ms after it: none is missing."""
    r = unit(rate=80.0)
    late = np.cumsum(np.tile([10, 10, 17, 13], 1500)) / 1e3
    white = noise_at_rest(replace(r, time=late))[0].coefficient(0)
    assert white.value == pytest.approx(100, rel=0.03)
    with refused():
        noise_at_rest(replace(r, time=late + 5.0 * (np.arange(6000) // 20)))


def test_the_first_point_of_a_curve_is_as_uncertain_as_its_degrees_of_freedom_leave_it():
    """White noise of N samples: two thirds of N, so that the deviation is known to sqrt(3 / N) / 2 of itself."""
    for c in noise_at_rest(unit()):
        assert c.result.sigma[0] / c.result.deviation[0] == pytest.approx(np.sqrt(3 / 6000) / 2, rel=0.1)


def test_command_writes_what_its_schema_says_and_a_page(command, tmp_path, capsys):
    write(unit(title="bench"), tmp_path / "rec", "samples.csv")
    assert command("noise", tmp_path / "rec", "--out", tmp_path / "out") == 0
    written = json.loads((tmp_path / "out" / "noise.json").read_text())
    jsonschema.validate(written, json.loads((ROOT / "docs" / "schemas" / "noise.schema.json").read_text()))
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Allan deviation" in page
    assert "accelerometer = {" in page
    told = capsys.readouterr().out
    golden_text(told)
    assert "[noise]\naccelerometer = { value = 0.006" in told


def test_a_platform_that_stands_still_does_not_wander_with_the_earth():
    from gimbalcal.recording import read

    for c in noise_at_rest(read(STATIC)):
        assert not c.coefficient(1).significant
        assert not c.coefficient(2).significant
    stated = noise_header(noise_at_rest(read(STATIC)))
    assert stated["accelerometer"].value == pytest.approx(4 * UG, rel=0.03)  # its scenario says 4 ug


def test_rests_that_are_too_short_are_refused():
    with refused():
        noise_at_rest(unit(n=240, turns=12))


def test_a_header_states_nothing_of_a_curve_that_is_no_white_noise():
    r = unit()
    hum = 0.05 * np.sin(2 * np.pi * 0.7 * r.time)  # a table that swings
    swings = {key: x + hum if key[0] == "specific_force" else x for key, x in r.channels.items()}
    channels = noise_at_rest(replace(r, channels=swings))
    assert list(noise_header(channels)) == ["gyroscope"]
    assert "accelerometer x, accelerometer y, accelerometer z follow no such law" in in_words(channels)
    channels = noise_at_rest(r.with_channels({FORCE_X: swings[FORCE_X]}))
    words = in_words(channels)
    golden_text(words)
    assert "(x)" not in words.partition("accelerometers: ")[2].partition(";")[0]  # its numbers are of no law


def test_the_random_walk_of_a_unit_in_the_hand_is_motion():
    """That of a sensor exceeds its white noise after many seconds; a hand changes by more from the first on."""
    r, rng = unit(), np.random.default_rng(11)

    def walking(size):
        walk = size * UG * np.sqrt(0.02) * np.cumsum(rng.standard_normal(len(r.time)))
        return in_words(noise_at_rest(r.with_channels({FORCE_X: r.channels[FORCE_X] + walk})))

    golden_text(walking(1000.0).rpartition("; ")[2])  # ug/sqrt(s), which is 173 ug/sqrt(Hz) after a second
    assert "motion" not in walking(30.0)
