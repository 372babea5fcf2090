"""The norm fit without angles: recovery, terms declined in words, raw counts, and refusals."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal import calibrate
from gimbalcal.effects import Effect
from gimbalcal.effects.accelerometer import Bias, Misalignment, ScaleFactor, ScaleNonlinearity
from gimbalcal.effects.nonlinearity import CubicNonlinearity
from gimbalcal.estimate.accelerometers.multiposition import LINEAR, multiposition, parameters_of_terms
from gimbalcal.forward import predict
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site
from tests.golden import golden_text, refused

G = 9.8
FORCE = "specific_force"
UG = 9.80665e-6
SAMPLE, COUNT = 2e-4, 400  # m/s^2 and samples per dwell: 1 ug per position

TRUTH: tuple[Effect, ...] = (
    Bias(b=np.array([300, -200, 100]) * UG),
    ScaleFactor(s=np.array([400, -300, 200]) * 1e-6),
    Misalignment(beta=np.array([0, 0, 1e-4, 0, -2e-4, 3e-4])),
)
BENT = ScaleNonlinearity(K_nl=np.array([30, -20, 25]) * 1e-6 / 9.80665)


def rested(effects, directions, noise=1.0, seed=0):
    n = len(directions)
    force = G * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    channels = {("specific_force", a): force[:, i] for i, a in enumerate("xyz")}
    made = Recording("multi-position", "rests", BENCH, Site(gravity=G), {"accelerometer": SAMPLE}, np.arange(n) * 60.0,
                     np.arange(1, n + 1), channels, weight=np.full(n, float(COUNT)))  # fmt: skip
    y = predict(BENCH, stimulus_from_readings(made), effects)["specific_force"]
    y = y + noise * SAMPLE / np.sqrt(COUNT) * np.random.default_rng(seed).standard_normal(y.shape)
    return replace(made, channels={("specific_force", a): y[:, i] for i, a in enumerate("xyz")})


def scattered(n, seed=3):
    return np.random.default_rng(seed).standard_normal((n, 3))


def truth_of(effects, calibration):
    by_id = {e.id: e for e in effects}
    return np.array([np.atleast_1d(getattr(by_id[p.effect], p.field))[p.index] if p.effect in by_id else 0.0
                     for p in calibration.parameters])  # fmt: skip


def test_truth_comes_back_within_its_uncertainty():
    errors = []
    for seed in range(20):
        made = multiposition(rested((*TRUTH, BENT), scattered(40), seed=seed), (*LINEAR, "scale_nonlinearity"))
        errors.append((made.values - truth_of((*TRUTH, BENT), made)) / made.sigmas)
        assert made.outcome == ""
    spread = np.sqrt(np.mean(np.square(errors)))
    assert spread == pytest.approx(1, abs=0.2)  # 240 correlated normal numbers: about 0.06, three sigma


def test_without_noise_the_error_is_that_of_rounding():
    made = multiposition(rested(TRUTH, scattered(20), noise=0), LINEAR)
    assert np.max(np.abs(made.values - truth_of(TRUTH, made)) / made.sigmas) < 1e-3  # Gauss-Newton stops at 1e-3 sigma


def test_terms_that_the_data_support_are_kept_and_others_declined_in_words():
    bent = multiposition(rested((*TRUTH, BENT), scattered(40)))
    assert {p.effect for p in bent.parameters} >= {"scale_nonlinearity"}
    assert len(bent.stages) >= 2
    few = multiposition(rested((*TRUTH, BENT), scattered(11)))
    assert {p.effect for p in few.parameters} == set(LINEAR)
    why = [u["why"] for u in few.unobservable if "is left out" in u["why"]]
    assert any("11 positions are fewer than the parameters it would make" in w for w in why)


def test_six_faces_cannot_see_misalignment_and_say_so():
    faces = np.concatenate([np.eye(3), -np.eye(3)]) + 1e-9
    made = multiposition(rested(TRUTH, np.tile(faces, (2, 1))), LINEAR)
    named = {label for u in made.unobservable for label in u["direction"]}
    assert {"misalignment:yz", "misalignment:zy", "misalignment:zx"} <= named


def test_rotations_of_the_triad_are_named_as_unobservable():
    made = multiposition(rested(TRUTH, scattered(20)), LINEAR)
    whys = [u["why"] for u in made.unobservable]
    assert sum("changes no norm" in w for w in whys) == 3
    assert {p.axis for p in made.parameters if p.effect == "misalignment"} == {"yz", "zy", "zx"}


def test_counts_are_scaled_and_the_scale_is_kept():
    plain = rested(TRUTH, scattered(25))
    scale, offset = np.array([2e-3, -2.1e-3, 2.2e-3]), np.array([32768.0, 100, -50])
    N = plain.triad("specific_force") / scale + offset
    raw = replace(
        plain,
        noise={},
        channels={("specific_force", a): N[:, i] for i, a in enumerate("xyz")},
        units={("specific_force", a): "count" for a in "xyz"},
    )
    made = multiposition(raw, LINEAR)
    nominal = made.provenance["options"]["nominal"]
    # the nominal scale takes scale factor and bias of the truth (400 ppm, 300 ug) into it
    np.testing.assert_allclose(np.abs(nominal["scale"]), np.abs(scale), rtol=1e-3)
    np.testing.assert_allclose(nominal["offset"], offset, atol=3)
    assert made.residual.rms["specific_force"] < 3 * SAMPLE / np.sqrt(COUNT)


def test_positions_that_scatter_more_than_the_stated_noise_are_told():
    made = multiposition(rested(TRUTH, scattered(30), noise=30), LINEAR)
    golden_text(made.outcome)
    error = (made.values - truth_of(TRUTH, made)) / made.sigmas
    assert np.sqrt(np.mean(error**2)) < 2.5  # nine normal numbers of the inflated sigma


@pytest.mark.parametrize(("noise", "told"), [(3, False), (10, True)])
def test_ten_times_the_scatter_of_the_samples_is_told_and_three_is_ordinary(noise, told):
    seen = rested(TRUTH, scattered(30), noise=noise)
    silent = replace(seen, noise={}, scatter={(FORCE, a): SAMPLE for a in "xyz"})
    made = multiposition(silent, LINEAR)
    assert bool(made.outcome) == told
    assert ("times what the scatter of the samples explains" in made.outcome) == told
    assert noise / 1.5 < made.provenance["options"]["excess_over_noise"] < noise * 1.5


def test_means_without_rows_behind_them_have_no_scatter_to_be_judged_by():
    assert multiposition(replace(rested(TRUTH, scattered(30), noise=30), noise={}), LINEAR).outcome == ""


def test_samples_that_all_read_one_step_are_no_finer_than_the_step():
    means = rested(TRUTH, scattered(30))
    step = 2e-2
    force = np.repeat(np.round(means.triad(FORCE) / step) * step, 5, axis=0)
    coarse = replace(
        means, noise={}, scatter={(FORCE, a): 1e-9 for a in "xyz"}, weight=np.ones(150), time=np.arange(150.0),
        position=np.repeat(np.arange(1, 31), 5), channels={(FORCE, a): force[:, i] for i, a in enumerate("xyz")},
    )  # fmt: skip
    assert multiposition(coarse, LINEAR).outcome == ""


def test_an_effect_that_needs_angles_is_refused():
    with refused(choice="dead_zone"):
        multiposition(rested(TRUTH, scattered(20)), ("bias", "gimbal_zero"))


def test_too_few_positions_are_refused_with_the_remedy():
    with refused():
        multiposition(rested(TRUTH, scattered(7)), LINEAR)


def test_the_norm_sees_three_of_six_misalignments():
    assert len(parameters_of_terms(LINEAR)) == 9


def test_a_term_that_a_larger_one_hides_is_asked_once_more():
    """Cubes of 600 ug/g^3, as in Table 4 of Wang et al. (2019), in the scatter of which a square drowns."""
    ug = 9.80665e-6
    square = np.array([60.0, -40.0, 50.0]) * ug / 9.80665**2
    cube = np.array([406.0, 676.0, 667.0]) * ug / 9.80665**3
    truth = (ScaleNonlinearity(square), CubicNonlinearity(cube))
    made = multiposition(rested(truth, scattered(24)))
    assert {"scale_nonlinearity", "cubic_nonlinearity"} <= {p.effect for p in made.parameters}
    assert made.outcome == ""


def test_noise_at_the_rounding_of_numbers_settles():
    made = multiposition(rested(TRUTH, scattered(20), noise=1e-8), LINEAR)
    assert "settle" not in made.outcome
    assert np.abs(made.values - truth_of(TRUTH, made)).max() < 1e-10


def test_what_counts_the_time_begins_with_the_recording():
    """Rests of a minute: from the middle of the first one a warm-up of 150 s would be a fifth too small."""
    force = np.repeat(scattered(24), 60, axis=0)
    force *= G / np.linalg.norm(force, axis=1, keepdims=True)
    channels = {(FORCE, a): force[:, i] for i, a in enumerate("xyz")}
    time, position = np.arange(float(len(force))), np.repeat(np.arange(1, 25), 60)
    noise = {"accelerometer": 1e-6}
    quiet = Recording("multi-position", "warms up", BENCH, Site(gravity=G), noise, time, position, channels)
    warm = quiet.with_channels({(FORCE, "y"): channels[FORCE, "y"] + 3e-3 * G * np.exp(-time / 150.0)})
    made = calibrate([warm], more=["warm_up:y"])
    found = {e.parameter.label: e.value for e in made.estimates}
    assert found["warm_up:y"] == pytest.approx(3000.0 * G / 9.80665, rel=0.02)
    assert found["warm_up.tau"] == pytest.approx(150.0 / 3600, rel=0.02)
    left = made.apply(warm).channels[FORCE, "y"] - quiet.channels[FORCE, "y"]
    assert np.abs(left).max() < 0.02 * 3e-3 * G
