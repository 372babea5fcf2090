import dataclasses
import re
from base64 import b64encode
from hashlib import sha256

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Counts, Provenance, Readout, Residual, StageResult
from gimbalcal.effects import CATALOGUE, Stage, parameters, with_values
from gimbalcal.forward import accelerometers, linearise
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.platform import BENCH, SPACE_STABLE_INERTIAL
from gimbalcal.report.calibration_page import calibration_report
from gimbalcal.report.parameters import rows, stages
from gimbalcal.report.residuals import by_position, over_time, setting_spread
from tests.report.example import ARCSEC, NOISE, example


@pytest.fixture(scope="module")
def page():
    return calibration_report(*example())


def test_nothing_is_loaded_from_elsewhere(page):
    assert not re.search(r"<[^>]*\s(?:src|srcset|data|poster)=|<link", page)
    assert page.count("<script>") == 1
    script = page[page.index("<script>") + 8 : page.index("</script>")]
    assert f"script-src 'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'" in page
    assert "fetch" not in script
    assert "://" not in script.replace("http://www.w3.org/2000/svg", "")
    assert "@import" not in page
    assert "url(" not in page
    assert "default-src 'none'" in page


def test_every_picture_says_what_it_shows(page):
    alts = re.findall(r'<div role="img" aria-label="([^"]*)"', page)
    assert len(alts) == page.count("<figure") == 6  # residuals, stages, correlations, schedule, two of the static run
    assert all(len(alt) > 30 for alt in alts)


def test_the_page_stays_small(page):
    assert len(page.encode()) < 400_000


def test_what_a_user_wrote_is_escaped():
    calibration, _, _ = example()
    hostile = dataclasses.replace(
        calibration, outcome="<script>alert(1)</script> & so on",
        provenance=calibration.provenance.with_options(in_words='"><img src=x onerror=alert(1)>'),
        unobservable=(dataclasses.replace(calibration.unobservable[0], why="<b>bold</b>"),),
    )  # fmt: skip
    text = calibration_report(hostile)
    assert "<script>alert" not in text
    assert "<img src=x" not in text
    assert "&lt;b&gt;bold&lt;/b&gt;" in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; so on" in text


def test_a_page_needs_neither_recordings_nor_stages():
    calibration, _, _ = example()
    text = calibration_report(dataclasses.replace(calibration, stages=()))
    assert "bias x" in text
    assert "Stage by stage" not in text


def test_residuals_of_the_fit_are_as_large_as_their_sigma():
    calibration, (still, _), _ = example()
    e = by_position(still, calibration.effects, calibration.provenance, calibration.readout)
    # 54 residuals less 17 directions: the mean square of the scaled ones is about 37/54, sigma sqrt(2 x 37)/54 = 0.16,
    # and larger because the example's fit weighs all axes alike
    assert 0.2 < np.mean((e.after / e.sigma) ** 2) < 3
    assert np.sqrt(np.mean(e.before**2)) > 50 * np.sqrt(np.mean(e.after**2))


def test_a_setting_error_moves_a_horizontal_axis_by_g_times_the_angle():
    _, (still, _), _ = example()
    s, channels = stimulus_from_readings(still), [("specific_force", a) for a in "xyz"]
    spread = setting_spread(linearise(still.platform, s, (), channels=channels, stages=[Stage.ENCODER]), ARCSEC)
    # position 1: z down; the inner gimbal (x) moves f_y, the middle one (y) moves f_x, nothing moves f_z
    assert spread[0] == pytest.approx([9.80146 * ARCSEC, 9.80146 * ARCSEC, 0.0], rel=1e-12, abs=1e-15)


def test_a_day_is_drawn_with_few_points_and_their_own_sigma():
    calibration, (_, run), _ = example()
    hours, curves = over_time(run, calibration.effects)
    assert hours.size <= 288
    assert [c.name for c in curves] == ["roll", "pitch", "force along g"]
    five_minutes = NOISE["accelerometer"] / np.sqrt(5 * 60) / 9.80665e-6
    assert curves[2].sigma == pytest.approx(five_minutes, rel=1e-12)


def test_a_unit_without_gimbals_is_judged_by_the_size_of_gravity():

    wanted = [p for i in ("scale_factor", "bias", "misalignment") for p in parameters(CATALOGUE[i])]
    effects = with_values((), wanted, np.random.default_rng(3).normal(0, [10 * p.sigma for p in wanted]))
    _, (still, _), _ = example()
    s = stimulus_from_readings(still)
    turned = {("specific_force", a): f for a, f in zip("xyz", accelerometers(s.force, s, effects).T, strict=True)}
    e = by_position(dataclasses.replace(still, platform=BENCH, channels=turned), effects, Provenance(), Readout())
    assert e.axes == ("|f| − g",)
    assert np.abs(e.before).max() > 1000  # ug: the errors are ten times the prior, 5000 ppm
    assert np.abs(e.after).max() < 1e-6  # ug: what rounding of 9.8 leaves


def against_the_run(effects):
    """The same effects with the gimbal zeros of the run's own sense, S_t and q, in place of Table 1's."""
    sign = np.array(SPACE_STABLE_INERTIAL.sense)
    return tuple(dataclasses.replace(e, theta_0=sign * e.theta_0) if e.id == "gimbal_zero" else e for e in effects)


def test_the_truth_leaves_of_a_day_what_the_noise_is():
    calibration, (_, run), truth = example()
    x = np.array([truth[p.label] for p in calibration.parameters])
    effects = with_values((), calibration.parameters, x, calibration.readout.gimbals)
    _, curves = over_time(run, effects)
    _, wrong = over_time(run, against_the_run(effects))
    for curve in (curves[1], curves[2]):  # roll also holds what the phase of the run cannot be told from
        assert curve.sigma is not None
        scatter = np.std(curve.measured - curve.fitted)
        # of 288 blocks the scatter is known to 1/sqrt(576) = 4 %; four of those
        assert scatter == pytest.approx(curve.sigma, rel=0.16)
    zero = truth["gimbal_zero:platform"]
    assert abs(zero) > 10 * ARCSEC  # else the next line proves nothing
    assert not np.allclose(wrong[0].fitted, curves[0].fitted, atol=1.0)  # 1 arcsec


def test_readings_in_counts_are_judged_in_si():
    calibration, (still, _), _ = example()
    effects = calibration.effects
    scale, offset = np.array([0.002, 0.003, 0.004]), np.array([100.0, -50.0, 7.0])
    counts = still.triad("specific_force") / scale + offset
    channels = dict(still.channels) | {("specific_force", a): counts[:, i] for i, a in enumerate("xyz")}
    noise = dict(still.noise) | {"accelerometer": NOISE["accelerometer"] / 0.003}
    units = {("specific_force", a): "count" for a in "xyz"}
    raw = dataclasses.replace(still, channels=channels, noise=noise, units=units)
    readout = Readout(Counts(tuple(scale), tuple(offset)))
    e, expected = by_position(raw, effects, Provenance(), readout), by_position(still, effects, Provenance(), Readout())
    assert e.after == pytest.approx(expected.after, abs=1e-6)  # ug: rounding of 9.8 m/s^2 in counts
    assert e.sigma == pytest.approx(expected.sigma, rel=1e-12)
    text = calibration_report(dataclasses.replace(calibration, readout=readout))
    assert "a nominal 0.002, 0.003, 0.004 m/s² per count from 100, -50, 7 counts" in text


def test_what_counts_mean_is_what_the_calibration_makes_of_them():
    """The printed scale and offset of an axis against `Calibration.apply` on readings in counts."""
    wanted = [p for i in ("scale_factor", "bias") for p in parameters(CATALOGUE[i])]
    x = np.array([0.02, -0.03, 0.01, 0.5, -0.4, 0.3])
    readout = Readout(Counts((0.002, 0.003, 0.004), (100.0, -50.0, 7.0)))
    made = Calibration("multiposition", with_values((), wanted, x), tuple(wanted), np.diag(np.full(6, 1e-8)), (),
                       Residual(0.0, 0, {}), readout=readout)  # fmt: skip
    channels = {("specific_force", a): np.array([0.0, 1000.0]) for a in "xyz"}
    _, (still, _), _ = example()
    raw = dataclasses.replace(
        still, platform=BENCH, channels=channels, time=np.arange(2.0), position=np.array([1, 2]), weight=np.ones(2),
        units=dict.fromkeys(channels, "count"),
    )  # fmt: skip
    force = made.apply(raw).triad("specific_force")
    shown = [float(row["value"].replace("−", "-")) for row in rows(made, None)]
    scale, zero = np.array(shown[:3]) * 1e-6, np.array(shown[3:])
    # the sigma of 1e-4 leaves six digits of the scale (2e-7 m/s^2 a count) and two decimals of an offset of hundreds
    np.testing.assert_allclose(scale, (force[1] - force[0]) / 1000, rtol=5e-5)
    np.testing.assert_allclose(zero, -force[0] / scale, atol=0.02)
    assert {row["unit"] for row in rows(made, None)} == {"µm/s²/count", "counts"}
    assert [row["sigma"] for row in rows(made, None)] == ["0.20", "0.30", "0.4", "0.05", "0.033", "0.025"]


def test_parameters_that_are_not_determined_one_by_one_are_below_the_others(page):
    table = rows(example()[0], None)
    below = [row["unobservable"] for row in table]
    assert below == sorted(below)
    assert [row["words"] for row in table if row["unobservable"]] == [
        "misalignment xz",
        "misalignment yz",
        "gimbal zero platform",
    ]
    assert [row["words"] for row in table if row["below"]] == ["misalignment xz"]
    assert page.index('class="group below"') < page.index("misalignment xz</th>") < page.index('id="stages"')


def test_a_parameter_that_no_stage_lists_is_named_instead_of_dashes():
    calibration, _, _ = example()

    def without_biases(s):
        keep = [i for i, label in enumerate(s.labels) if not label.startswith("bias")]
        return dataclasses.replace(
            s, labels=tuple(s.labels[i] for i in keep), values=s.values[keep], sigmas=s.sigmas[keep]
        )

    told = stages(dataclasses.replace(calibration, stages=tuple(map(without_biases, calibration.stages))), None)
    assert not any(row["words"].startswith("bias") for row in told["stage_rows"])
    assert all(set(row["cells"]) != {"–"} for row in told["stage_rows"])
    assert told["stage_rest"].endswith(": bias.")
    assert stages(calibration, None)["stage_rest"] == ""


def test_a_stage_that_leaves_angles_says_so():
    (scale, *_) = parameters(CATALOGUE["gyro_scale_factor"])
    stage = StageResult("gyro_scale_factor", (scale.label,), np.array([1e-6]), np.array([1e-6]), ARCSEC, "turns")
    c = Calibration("turns", (), (scale,), np.eye(1) * 1e-12, (), Residual(0.0, 0, {}), stages=(stage,))
    assert stages(c, None)["stages"][0]["rms"] == "1.00 arcsec"
    assert stages(dataclasses.replace(c, method="two-position"), None)["stages"][0]["rms"] == "1.00 °/h"
