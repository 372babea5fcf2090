"""Units whose errors are known, turned on a table that shares no line with the estimator."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.calibration.calibration import from_dict
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.effects.effect import constants
from gimbalcal.estimate.extra_effects import ExtraEffect
from gimbalcal.estimate.systematic import iterate
from gimbalcal.estimate.systematic.calibrate import systematic
from gimbalcal.estimate.systematic.filter_pass import attitude_covariance
from gimbalcal.estimate.systematic.state_lists import FIFTY_ONE, states
from gimbalcal.platform import Axis, Platform
from gimbalcal.rotation import frame_rotation, rotation_vector
from gimbalcal.units import from_si
from gimbalcal.views.segments import segment
from gimbalcal.words.calibration_sentences import calibration_in_words
from tests.estimate.systematic.table import MOVES, START, turning_unit
from tests.golden import golden_text, refused

ANY = turning_unit(moves=MOVES[:2], stop=8.0, rate=10.0)
THIRTY = states("30", ANY.why_not_shown)
SCALE = np.array([p.sigma for p in THIRTY])


def _errors(found, wanted, truth):
    by_label = dict(zip((p.label for p in wanted), truth, strict=True))
    t = np.array([by_label.get(p.label, 0.0) for p in found.parameters])
    return (found.values - t) / found.sigmas


def test_thirty_and_fifty_one_states_are_two_lists():
    assert len(THIRTY) == 30 - 9
    assert len(states("51", ANY.why_not_shown)) == 51 - 9
    assert {p.effect for p in states("51", ANY.why_not_shown)} == set(FIFTY_ONE)
    assert [p.label for p in states("gyro_bias,accelerometer_lever_arm:xy", ANY.why_not_shown)][
        -1
    ] == "accelerometer_lever_arm:xy"


def test_errors_are_what_the_sigmas_say():
    z = []
    for seed in range(6):
        truth = 0.3 * SCALE * np.random.default_rng(100 + seed).standard_normal(len(THIRTY))
        found = systematic(turning_unit((), THIRTY, truth, stop=20.0, seed=seed), "30")
        assert found.outcome == ""
        assert found.unobservable == ()
        z.append(_errors(found, THIRTY, truth))
    rms = float(np.sqrt(np.mean(np.square(z))))
    assert rms == pytest.approx(1.0, abs=0.2)  # 126 numbers, correlated


def test_estimates_over_time_converge_as_their_sigmas_say():
    """In the last third of the turns the deviations from the truth have the sigma of their instant."""
    z = []
    for seed in range(4):
        truth = 0.3 * SCALE * np.random.default_rng(100 + seed).standard_normal(len(THIRTY))
        found = systematic(turning_unit((), THIRTY, truth, stop=20.0, seed=seed), "30")
        n = found.residual.navigation
        time, late = np.array(n["time_s"]), np.array(n["time_s"]) > 2 / 3 * n["time_s"][-1]
        for p, x, value in zip(found.parameters, truth, found.values, strict=True):
            estimate, sigma = (np.array(n[key][p.label]) for key in ("estimate", "sigma"))
            assert len(estimate) == len(sigma) == len(time)
            assert abs(estimate[-1] - from_si(value, p.unit)) < 0.05 * sigma[-1]
            z.append((estimate[late] - from_si(x, p.unit)) / sigma[late])
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.25)


def test_smoothed_attitudes_are_as_good_as_their_sigmas_say():
    """Of the first it is what the filter says of the attitude at the start, a constant; of all, what the errors are."""
    z = []
    for seed in range(8):
        truth = 0.3 * SCALE * np.random.default_rng(100 + seed).standard_normal(len(THIRTY))
        m = iterate.iterate(segment(turning_unit((), THIRTY, truth, stop=20.0, seed=seed)), THIRTY)
        P = m.last.factor @ m.last.factor.T
        covariance = attitude_covariance(m.segments, m.last, m.excluded, P)
        assert np.allclose(covariance[0], m.last.attitude, rtol=1e-6, atol=1e-6 * m.last.attitude.max())
        k = int(m.segments.first.searchsorted(m.segments.of_stop(0).stop))
        error = rotation_vector(m.C[[0, k]] @ np.swapaxes(START[None], -1, -2))  # the first stop: it has not turned yet
        assert np.all(np.diagonal(covariance, axis1=1, axis2=2) > 0)
        z.append(error / np.sqrt(np.diagonal(covariance[[0, k]], axis1=1, axis2=2)))
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.35)  # 24 numbers, twice


def test_sensitivities_that_hardly_change_are_kept(monkeypatch):
    """Passes that only ask where the reference ends now: the estimate is that of passes which do all anew."""
    made = turning_unit((), THIRTY, SCALE * np.random.default_rng(1).standard_normal(len(THIRTY)), stop=20.0)
    kept = systematic(made, "30")
    monkeypatch.setattr(iterate, "FROZEN_STEP_RATIO", 0.0)
    anew = systematic(made, "30")
    assert np.abs((kept.values - anew.values) / anew.sigmas).max() < 0.03 / 3  # a third of what counts as settled
    assert np.abs(kept.sigmas / anew.sigmas - 1).max() < 1e-3


def test_any_effect_can_be_a_state():
    """Late accelerometers, an asymmetry and one lever arm: nothing in the estimator knows their names."""
    asked = ",".join(
        [*dict.fromkeys(p.effect for p in THIRTY), "lever_arm", "time_tag_latency", "gyro_scale_asymmetry"]
    )
    wanted = states(asked, ANY.why_not_shown)
    truth = np.concatenate([0.2 * SCALE, [0.02, -0.01, 0.015], [2e-3], [4e-5, -3e-5, 2e-5]])
    made = turning_unit((), wanted, truth, stop=15.0, rate=50.0, ramp=2.0)
    found = systematic(made, asked)
    z = _errors(found, wanted, truth)
    assert np.abs(z).max() < 5
    arm = [i for i, p in enumerate(found.parameters) if p.effect == "lever_arm"]
    assert np.all(np.abs(truth[arm]) / found.sigmas[arm] > 100)


def test_heading_does_not_take_the_bias_for_the_earth():
    """A bias of 3 deg/h: one stop alone would be 15 deg off in heading."""
    truth = np.array([1.5e-5 if p.label == "gyro_bias:y" else 0.0 for p in THIRTY])
    start = frame_rotation("z", 2.2) @ frame_rotation("x", 0.4) @ START
    found = systematic(turning_unit((), THIRTY, truth, stop=20.0, start=start), "30")
    assert np.abs(_errors(found, THIRTY, truth)).max() < 4
    heading = np.degrees(np.arctan2(start[1, 0], start[0, 0]))
    assert found.residual.navigation["attitude"]["heading_deg"] == pytest.approx(heading, abs=0.5)


def test_what_is_left_out_is_told():
    g = parameters(CATALOGUE["gyro_g_sensitivity_rate"])[2]
    truth = np.append(0.1 * SCALE, 2 * g.sigma)
    found = systematic(turning_unit((), (*THIRTY, g), truth, stop=20.0), "30")
    golden_text(found.outcome)
    explained = systematic(turning_unit((), (*THIRTY, g), truth, stop=20.0), "51")
    assert explained.outcome == ""


def test_what_a_schedule_does_not_turn_is_unobservable_by_name():
    found = systematic(turning_unit(moves=[m for m in MOVES if m[0] == "y"], stop=20.0), "30")
    named = {label for each in found.unobservable for label in each["direction"]}
    assert "gyro_scale_factor:x" in named or "misalignment:xy" in named
    assert all(each["why"] for each in found.unobservable)


@pytest.mark.parametrize("axis", "xyz")
def test_turns_about_one_axis_tell_what_they_tell(axis):
    """What they do not show stays at its prior mean, and carries nothing of what they show along."""
    moves, z = [m for m in MOVES if m[0] == axis], []
    for seed in range(4):
        truth = SCALE * np.random.default_rng(100 + seed).standard_normal(len(THIRTY))
        found = systematic(turning_unit((), THIRTY, truth, moves=moves, stop=20.0, seed=seed), "30")
        assert found.outcome == ""
        assert len(found.unobservable) >= 9
        z.append(_errors(found, THIRTY, truth))
    assert np.sqrt(np.mean(np.square(z))) < 1.2  # was 3.1
    assert np.abs(z).max() < 4  # was 25


def test_a_pause_of_the_clock_in_a_stop_costs_nothing():
    truth = 0.2 * SCALE
    whole = turning_unit((), THIRTY, truth, stop=30.0)
    rows = np.ones(len(whole.time), dtype=bool)
    rows[100:400] = False  # 15 s of the first stop, which lasts 30 s
    found = systematic(whole.select(rows), "30")
    assert found.outcome == ""
    assert np.abs(_errors(found, THIRTY, truth)).max() < 4


def test_a_knock_is_left_out_and_counted():
    truth = 0.2 * SCALE
    knocked = turning_unit(
        (), THIRTY, truth, stop=20.0, drift=lambda t: np.where((t > 60.0) & (t < 60.2), 0.5, 0.0)[:, None]
    )
    found = systematic(knocked, "30")
    assert 1 <= found.residual.navigation["rejected"] <= 3
    assert np.abs(_errors(found, THIRTY, truth)).max() < 5


def test_a_calibration_is_written_and_read_back():
    found = systematic(turning_unit(stop=15.0), "30")
    content = json.loads(json.dumps(found.to_dict()))
    assert content["format"] == 2
    assert {"nis", "nees", "rejected", "whiteness", "sigma"} <= set(content["residual"]["navigation"])
    again = from_dict(content)
    assert np.allclose(again.values, found.values)
    assert again.residual.navigation == content["residual"]["navigation"]


def test_what_is_no_rotation_recording_is_refused_in_a_sentence():
    r = turning_unit(stop=10.0, moves=MOVES[:6])
    cases = [
        replace(r, kind="multi-position"),
        replace(r, site=replace(r.site, latitude=None)),
        r.select(slice(0, 150)),
        r.select(np.abs(r.triad("angular_rate")).max(axis=1) > 0.05),
        r.select(np.abs(r.time - 16.0) > 1.0),
        replace(r, units={("angular_rate", "x"): "count"}),
    ]
    for recording in cases:
        with refused():
            systematic(recording, "30")


@pytest.mark.parametrize(
    ("grade", "settings"),
    [
        ((3e-2, 3e-3, 5e-3, 1.5e-4, 3e-3, 5e-3), {"speed": 60.0, "noise": (5e-3, 3e-4, 1e-3)}),  # tactical
        ((0.3, 2e-2, 2e-2, 9e-3, 2e-2, 2e-2), {"speed": 90.0, "stop": 10.0, "noise": (2e-2, 1e-3, 1e-2)}),  # consumer
    ],
)
def test_low_cost_units_are_calibrated_from_nothing(grade, settings):
    """Two per cent of scale, a degree of misalignment, half a degree per second of bias, and no heading at all."""
    sizes = dict(zip(("bias", "scale_factor", "misalignment", "gyro_bias", "gyro_scale_factor", "gyro_misalignment"),
                     grade, strict=True))  # fmt: skip
    truth = np.array([sizes[p.effect] for p in THIRTY]) * np.random.default_rng(5).standard_normal(len(THIRTY))
    noise = dict(zip(("accelerometer", "gyroscope", "velocity"), settings["noise"], strict=True))
    found = systematic(turning_unit((), THIRTY, truth, rate=50.0, **{**settings, "noise": noise}), "30")
    assert found.outcome == ""
    assert np.abs(_errors(found, THIRTY, truth)).max() < 4


def test_two_samples_a_second_are_enough():
    """Where a ramp begins within half a second is not known; what that costs is in the sigmas, and none is lost."""
    truth = 0.2 * SCALE
    noise = {"accelerometer": 7e-5, "gyroscope": 8e-7, "velocity": 1e-5}
    r = turning_unit((), THIRTY, truth, stop=100.0, rate=2.0, speed=3.0, ramp=4.0, noise=noise)
    found = systematic(r, "30")
    assert found.outcome == ""
    assert found.residual.navigation["rejected"] == 0
    assert np.sqrt(np.mean(_errors(found, THIRTY, truth) ** 2)) < 1.6


def _walked(t, begin, duration, way):
    """Acceleration of a walk that begins and ends at rest."""
    s = (t - begin) / duration
    return np.where((s > 0) & (s < 1), way * 2 * np.pi / duration**2 * np.sin(2 * np.pi * s), 0.0)


@pytest.mark.parametrize("begin", [20.0, 3.0])
def test_a_unit_that_is_carried_away_is_refused(begin):
    """Five metres in ten seconds, while it turns or in a stop."""
    carried = turning_unit(stop=20.0, drift=lambda t: _walked(t, begin, 10.0, 5.0)[:, None] * [0, 1, 0])
    with refused():
        systematic(carried, "30")


def test_one_large_scale_factor_carries_nothing_away():
    """0.4 % of one gyroscope, hardly anything of the others: half a turn about it leaves the level by 0.7 deg."""
    truth = np.array([4e-3 if p.label == "gyro_scale_factor:y" else 0.0 for p in THIRTY])
    found = systematic(turning_unit((), THIRTY, truth, stop=20.0), "30")
    assert found.outcome == ""
    assert np.abs(_errors(found, THIRTY, truth)).max() < 4


def test_another_latitude_is_refused():
    r = turning_unit(stop=15.0)
    with refused():
        systematic(replace(r, site=replace(r.site, latitude=np.radians(45.0))), "30")


def test_a_constant_that_nobody_stated_is_asked_for():
    with refused():
        states(
            "30",
            ANY.why_not_shown,
            [ExtraEffect(next(i for i, c in CATALOGUE.items() if constants(c) and "rotation" in c.kinds))],
        )


@pytest.mark.parametrize(
    "asked", ["31", "gyro_bais", "bias_temperature", "gimbal_zero", "gyro_bias:w", "scale_nonlinearity", ""]
)
def test_states_that_cannot_be_are_refused(asked):
    with refused():
        states(asked, ANY.why_not_shown)


def _by_hand(t, stop=10.0, turn=4.0):
    """Half a metre there and back while the unit is turned, in all directions; at rest in the stops."""
    s = (t % (stop + turn)) - stop
    a = np.where(s > 0, 0.5 * (2 * np.pi / turn) ** 2 * np.cos(2 * np.pi * s / turn), 0.0)
    k = np.floor(t / (stop + turn))
    return a[:, None] * np.stack([np.cos(k), np.sin(k), np.cos(2 * k)], axis=1) / 2


@pytest.mark.parametrize(("moves", "most"), [(0.0, 1e-5), (5e-5, 6e-5), (2e-4, 2.4e-4)])
def test_the_velocity_of_the_place_is_what_the_stops_show(moves, most):
    """One sigma [m/s] from second to second at the stops, and 1 mm/s at least in turns, whose motion no stop shows."""
    r = turning_unit(seed=4)
    update = segment(r).time
    velocity = moves * np.random.default_rng(4).standard_normal((len(update), 3))
    k = np.searchsorted(update, r.time - 1e-6)  # the update that ends the second of each sample
    gained = (velocity[k] - velocity[k - 1]) / np.diff(update)[k - 1, None]
    force = {("specific_force", a): r.channels["specific_force", a] + gained[:, i] for i, a in enumerate("xyz")}
    found = segment(replace(r.with_channels(force), noise={}))
    still = found.velocity[found.stop >= 0]
    assert max(0.8 * moves, 1e-6) <= still[0] <= most
    assert np.all(still == still[0])
    assert np.all(found.velocity[found.stop < 0] == max(1e-3, still[0]))


@pytest.mark.parametrize("frequency", [0.05, 0.2])
def test_a_slow_sway_of_the_place_shows_in_the_sums_of_its_gains(frequency):
    r, w = turning_unit(seed=4), 2 * np.pi * frequency
    sway = np.sqrt(2) * 1e-4 * w * np.cos(w * r.time)  # 0.1 mm/s rms along one of three axes
    found = segment(
        replace(r.with_channels({("specific_force", "x"): r.channels["specific_force", "x"] + sway}), noise={})
    )
    assert found.velocity[found.stop >= 0][0] == pytest.approx(1e-4 / np.sqrt(3), rel=0.2)


def test_stops_that_read_the_same_number_again_and_again_are_as_still_as_their_noise():
    step = 0.01  # m/s^2, far above the noise, so that most stops show none at all
    r = turning_unit(noise={"accelerometer": step / 30, "gyroscope": 3e-6})
    read = {("specific_force", a): np.round(r.channels["specific_force", a] / step) * step for a in "xyz"}
    found = segment(replace(r.with_channels(read), noise={"accelerometer": step / 3.5, "gyroscope": 3e-6}))
    assert 1e-6 < found.velocity[found.stop >= 0][0] < 1e-3


def test_a_hand_that_carries_the_unit_along_is_no_velocity_of_its_place():
    truth = 0.3 * SCALE
    noise = {"accelerometer": 1e-3, "gyroscope": 1e-5}
    moves = [("y", 90)] * 4 + [("z", 90)] + [("x", 90)] * 5 + [("z", 90)] * 2 + [("z", -90)] + [("y", -90)] * 4
    in_the_hand = turning_unit(
        (), THIRTY, truth, moves=moves, stop=10.0, speed=30.0, rate=50.0, noise=noise, carried=_by_hand
    )
    found = systematic(in_the_hand, "30")
    assert found.outcome == ""
    assert np.abs(_errors(found, THIRTY, truth)).max() < 4
    assert found.provenance["limits"][0].startswith("a hand turned the unit and carried it along")
    assert "A hand turned the unit" in calibration_in_words(found)
    little = systematic(
        turning_unit((), THIRTY, truth, moves=moves, stop=10.0, speed=30.0, noise=noise,
                     carried=lambda t: 0.1 * _by_hand(t)), "30",
    )  # fmt: skip
    golden_text(little.outcome)


def test_a_table_is_no_hand():
    alone = turning_unit(stop=10.0, noise={"accelerometer": 1e-3, "gyroscope": 1e-5})
    found = systematic(alone, "30")
    assert found.provenance["limits"] == []
    read = np.cumsum(alone.channels["angular_rate", "z"]) / 20.0  # its readout changes nothing, and that is said
    table = replace(
        alone.with_channels({("gimbal_angle", "table"): read}), platform=Platform("table", (Axis("table", "z"),))
    )
    beside = systematic(table, "30")
    np.testing.assert_array_equal(beside.values, found.values)
    (told,) = beside.provenance["limits"]
    golden_text(told)
