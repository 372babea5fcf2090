"""North is carried through the turns: a quiet unit in the hand sees no horizontal rate of the Earth in its laws."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.earth import EARTH_RATE
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import fit_rests, rests_joined_by_turns
from gimbalcal.views.turns import turns_between_rests
from tests.benchmarks.unknown_hand import HOUR, LATITUDE, TACTICAL, Setup, record

QUIET = Setup(replace(TACTICAL, turning=5e-5, turning_wander=0.5 * HOUR), rests=24, gyroscopes=True, minutes=4.0)
G_YY = 5 * HOUR  # rad/s/g


def heavy(h):
    """A g-sensitivity of the gyroscope y to the force along it."""
    return {"rate": np.outer(h.f[:, 1], [0.0, 1.0, 0.0])}


def fitted(recording, carried=True):
    made = multiposition(recording, ("bias", "scale_factor", "misalignment"))
    turns = turns_between_rests(recording, made)
    return fit_rests(rests_joined_by_turns(recording, made, turns if carried else None))


def test_what_is_left_at_rest_is_the_wander_and_not_the_earth():
    recording = record(1, QUIET)
    left, before = (float(np.sqrt(np.mean(fitted(recording, c).residual[0] ** 2))) for c in (True, False))
    horizontal = EARTH_RATE * np.cos(LATITUDE) / np.sqrt(3)  # per axis
    assert before > 0.8 * horizontal
    samples = np.count_nonzero(recording.position == 1)
    assert left < 1.1 * np.hypot(QUIET.grade.turning_wander, QUIET.grade.turning / np.sqrt(samples))  # 0.96 deg/h


def test_a_g_sensitivity_below_the_earth_s_rate_is_found_as_itself():
    d = diagnose([record(3, QUIET, ((heavy, G_YY),))])  # 5 deg/h/g, which was "adequate" beside 11 deg/h of scatter
    (found,) = d.findings
    assert (found["effect"], found["axis"], found["twins"]) == ("gyro_g_sensitivity_rate", "y", [])
    yy = next(p for p in found["parameters"] if p["axis"] == "yy")
    assert abs(yy["value"] * 9.80146 / 9.80665 - 5.0) < 4 * yy["sigma"] < 2.0


@pytest.mark.parametrize("seed", [0, 7])
def test_g_sensitivities_err_as_they_say(seed):
    fits = [fitted(record(10 * seed + i, QUIET)) for i in range(2)]
    off = np.array([f.x[3:] / np.sqrt(np.diag(f.covariance))[3:] for f in fits])
    assert 0.5 < np.sqrt(np.mean(off**2)) < 1.6


def test_where_a_turn_was_not_logged_north_is_unknown_anew():
    recording = record(2, QUIET)
    later = np.arange(len(recording.time)) >= np.argmax(np.asarray(recording.position) == 13)
    time = recording.time + 5.0 * later  # the clock pauses in front of rest 13
    made = multiposition(recording, ("bias", "scale_factor", "misalignment"))
    gap = replace(recording, time=time)
    n = [
        np.asarray(rests_joined_by_turns(r, made, turns_between_rests(r, made)).evaluate(()).nuisance)
        for r in (recording, gap)
    ]
    assert [x.shape[-1] for x in n] == [2, 4]
    assert not np.any(n[1][12:, :, :2])
    assert not np.any(n[1][:12, :, 2:])
