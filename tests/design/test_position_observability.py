"""What schedules see: bounds against simulation, null directions against theory, the confounded against made cases."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.design.position_observability import observe, observe_static
from gimbalcal.effects import CATALOGUE
from gimbalcal.estimate.accelerometers.joint import joint
from gimbalcal.estimate.accelerometers.position_fit import fit_in_noise
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.schedule import EIGHTEEN_POSITIONS, FACE_POSITIONS, Schedule
from gimbalcal.schedule.file import schedule_toml
from gimbalcal.units import from_si, to_si
from gimbalcal.views.positions import Noise, view_of_positions
from tests.estimate.device import ARCSEC, PARAMETERS, SAMPLE, SAMPLES, draw, measured, outputs
from tests.golden import golden_text, refused

LATITUDE = np.deg2rad(40.0)
FORCE_ONLY = {"accelerometer": 5e-3}
SENSORS = {"accelerometer": 6.5e-5, "gimbal_angle": 0.5 * ARCSEC, "attitude": 0.5 * ARCSEC}


def directions(seen):
    return [u.direction for u in seen.solution.unobservable]


def pairs(seen):
    return {frozenset((t.one, t.other)) for t in seen.confounded}


def test_predicted_sigmas_are_those_of_a_fit():
    rng = np.random.default_rng(1)
    force = float(from_si(SAMPLE / np.sqrt(SAMPLES), "ug"))
    seen = observe("wu2018-18", angle_sigma=1.0, force_sigma=force)
    c = joint(trusted_positions(measured(draw(rng), rng)))
    # the plan is at nominal parameters and standard gravity, the fit at true ones: 1e-3
    np.testing.assert_allclose(seen.sigma, c.sigmas, rtol=3e-3)
    assert [q.label for q in seen.solution.parameters] == [q.label for q in c.parameters]


def test_eighteen_positions_see_all_but_the_turn_about_z():
    seen = observe(EIGHTEEN_POSITIONS)
    (null,) = directions(seen)
    sign = np.sign(null["misalignment:xz"])
    assert {k: sign * v for k, v in null.items()} == pytest.approx(
        {"misalignment:xz": 1, "misalignment:yz": 1, "gimbal_zero:platform": -1}, abs=1e-4
    )
    assert seen.confounded == ()
    golden_text(seen.in_words)


def test_unknown_angles_leave_the_twelve_combinations_of_the_norm():
    seen = observe("wu2018-18", angle_sigma=np.inf)
    assert len(directions(seen)) == 6
    assert {frozenset(d) for d in directions(seen)} == {
        frozenset({"misalignment:xz", "misalignment:yz"}),
        frozenset({"misalignment:xy", "misalignment:zy"}),
        frozenset({"misalignment:yx", "misalignment:zx"}),
        frozenset({"gimbal_zero:platform"}),
        frozenset({"gimbal_zero:inner"}),
        frozenset({"gimbal_zero:middle"}),
    }


def test_faces_alone_see_nonlinearity_less_well():
    faces = Schedule("faces", SPACE_STABLE, tuple(EIGHTEEN_POSITIONS.holds[i - 1] for i in FACE_POSITIONS))
    seen = observe(faces, angle_sigma=1.0, force_sigma=2.0)
    # an axis feels only +-g and 0 there; the edges add 0.71 g
    better = observe(EIGHTEEN_POSITIONS)
    K = [i for i, q in enumerate(seen.solution.parameters) if q.effect == "scale_nonlinearity"]
    assert np.all(seen.sigma[K] > better.sigma[K])


def test_force_of_a_static_run_sees_nine_combinations_at_any_length():
    S = np.sin(LATITUDE)
    for hours in (24.0, 48.0):
        seen = observe_static(hours, LATITUDE, FORCE_ONLY, ("scale_factor", "bias", "misalignment"), sample_s=0.01)
        named = {frozenset(d) for d in directions(seen)}
        assert named == {
            frozenset({"bias:x", "misalignment:xy"}),
            frozenset({"bias:y", "misalignment:yx"}),
            frozenset({"bias:z", "scale_factor:z"}),
        }
        assert pairs(seen) == named
        (x,) = [d for d in directions(seen) if "bias:x" in d]
        # b_x = S g beta_xy, in ug and arcsec
        ratio = x["bias:x"] / x["misalignment:xy"]
        g_ratio = 9.8017 / 9.80665
        assert ratio == pytest.approx(S * g_ratio * 1e6 * ARCSEC, rel=1e-3)


def test_gimbals_and_attitude_add_nothing_about_the_accelerometers():
    effects = ("scale_factor", "bias", "misalignment")
    force = observe_static(48.0, LATITUDE, {"accelerometer": 6.5e-5}, effects)
    whole = observe_static(48.0, LATITUDE, SENSORS, effects)
    assert len(directions(force)) == len(directions(whole)) == 3


def test_longer_runs_see_better_as_the_root_of_time():
    effects = ("scale_factor", "bias", "misalignment")
    day, four = (observe_static(h, LATITUDE, FORCE_ONLY, effects, sample_s=1.0) for h in (23.9345 * 3, 23.9345 * 12))
    at = [q.label for q in day.solution.parameters].index("misalignment:zy")
    # 289 rows over whole turns: the last one counts the first phase twice
    assert day.sigma[at] / four.sigma[at] == pytest.approx(2, rel=0.02)


def test_confounded_effects_outside_the_calibration_are_named_and_others_are_not():
    seen = observe("wu2018-18", candidates=["cubic_nonlinearity", "odd_quadratic", "cross_coupling"])
    # at 0, 0.71 and 1 g an odd square and a cube differ only by a scale factor
    assert pairs(seen) == {frozenset({"cubic_nonlinearity", "odd_quadratic"})}
    by = {c.effect: c for c in seen.candidates}
    assert by["cubic_nonlinearity"].absorbed > by["cross_coupling"].absorbed


def test_what_the_calibration_swallows_is_said():
    seen = observe("wu2018-18", candidates=["gravity_error", "cross_coupling"])
    by = {c.effect: c for c in seen.candidates}
    # gravity is a common scale factor
    assert by["gravity_error"].strength < 1e-6
    assert by["gravity_error"].absorbed == pytest.approx(1, abs=1e-9)
    golden_text(seen.in_words)


def test_strength_is_what_a_fit_leaves_as_chi_squared():
    seen = observe("wu2018-18", force_sigma=2.0, candidates=["cross_coupling"])
    kind = CATALOGUE["cross_coupling"]
    r, noise = measured(np.zeros(18), np.random.default_rng(0), 0.0, samples=10**12), Noise(to_si(2.0, "ug"), ARCSEC)
    # all coefficients at prior size, signs drawn: chi^2 has the mean strength^2
    field = kind.__dataclass_fields__["K_c"]
    sigma, n = to_si(field.metadata["sigma"], field.metadata["unit"]), len(field.metadata["axes"])
    total = 0.0
    for i in range(n):
        size = np.zeros(n)
        size[i] = sigma
        read = outputs(view_of_positions(r, noise), (kind(K_c=size),))
        force = {("specific_force", a): f for a, f in zip("xyz", read.T, strict=True)}
        bent = replace(r.with_channels(force), weight=np.ones(18))
        total += fit_in_noise(view_of_positions(bent, noise), noise, PARAMETERS).fit.solution.chi2
    (candidate,) = seen.candidates
    # gravity 9.80146 against 9.80665, and the square of the effect
    assert np.sqrt(total) == pytest.approx(candidate.strength, rel=5e-3)


def test_a_schedule_file_is_read(tmp_path):
    path = tmp_path / "schedule.toml"
    path.write_text(schedule_toml(EIGHTEEN_POSITIONS))
    np.testing.assert_allclose(observe(path).sigma, observe("wu2018-18").sigma, rtol=1e-6)


def test_it_can_be_written_as_json():
    content = observe("wu2018-18", candidates=["cross_coupling"]).to_dict()
    again = json.loads(json.dumps(content))
    assert again["unobservable"][0]["why"].startswith("changing")
    by = {(row["name"], row["axis"]): row for row in again["parameters"]}
    assert by["bias", "x"]["unit"] == "ug"
    assert 0 < by["bias", "x"]["sigma"] < by["bias", "x"]["prior_sigma"] == 500


def test_bad_questions_are_answered_with_what_can_be_asked():
    with refused():
        observe("wu2018-18", effects=["spin"])
    with refused():
        observe_static(48.0, LATITUDE, {"gyroscope": 1e-7})
