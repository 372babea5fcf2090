"""Diagnosis without a stated noise on made recordings: telescopes by spherical trigonometry, units turned by hand."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.estimated_noise import serial_correlation
from gimbalcal.diagnose.result import Shape
from gimbalcal.diagnose.search.refit import start_with_baseline
from gimbalcal.diagnose.search.stepwise import stepwise
from gimbalcal.diagnose.verdict.verify import held_out_misfit, view_shifts
from gimbalcal.effects import values
from gimbalcal.platform import BENCH, KNOWN
from gimbalcal.recording import Recording, Site
from gimbalcal.views.pointing import pointing
from gimbalcal.words import diagnosis_sentences
from tests.benchmarks import unknown_hand
from tests.benchmarks.unknown_runs import answer, runs
from tests.diagnose.small import G, telescope, turned

ARCSEC = np.pi / 648000
N = 80  # stars, as in a real run


def size(d, effect, axis):
    p = next(p for f in d.findings if f["effect"] == effect for p in f["parameters"] if p["axis"] == axis)
    return p["value"], p["sigma"]


@pytest.mark.parametrize("seed", range(6))
def test_a_telescope_that_lacks_nothing(seed):
    d = diagnose([telescope(seed)])
    assert d.verdict == "adequate"
    assert d.findings == ()
    assert d.fit["rms_after"] == pytest.approx(np.sqrt(2), rel=0.2)  # two components of an arcsecond, 155 degrees


@pytest.mark.parametrize("seed", [0, 3, 7, 12, 13, 14])
def test_a_readout_that_is_set_loosely_is_neither_a_cause_nor_a_formula(seed):
    """Azimuth scatters thirty times as much as elevation, so that a scale common to both halves its variance."""
    r, azimuth = telescope(seed), ("gimbal_angle", "azimuth")
    scatter = 30 * ARCSEC * np.random.default_rng(seed + 500).standard_normal(len(r.time))
    d = diagnose([r.with_channels({azimuth: r.channels[azimuth] + scatter})])
    assert (d.verdict, d.findings, d.laws) == ("adequate", (), ())


@pytest.mark.parametrize("seed", [6, 8])
def test_a_tube_that_bends_is_found_beside_a_readout_that_is_set_loosely(seed):
    """In one scale of both channels the second has no cause at all, and the first a worm beside it."""
    r, azimuth = telescope(seed, bend=40.0), ("gimbal_angle", "azimuth")
    scatter = 30 * ARCSEC * np.random.default_rng(seed).standard_normal(len(r.time))
    (found,) = diagnose([r.with_channels({azimuth: r.channels[azimuth] + scatter})]).findings
    assert (found["effect"], found["probability"]) == ("tube_flexure", 0.9)


def test_settings_whose_residuals_resemble_the_next_are_not_without_a_pattern():
    """A noise with a memory is no noise of separate settings; white ones are not correlated by five sigma."""
    m = start_with_baseline(pointing(telescope(1)))
    white, sigma = np.random.default_rng(1).standard_normal(m.residual.shape), np.ones(m.residual.shape)
    assert serial_correlation(replace(m, residual=white), sigma) == {}
    alike = white.copy()
    for k in range(1, len(alike)):
        alike[k] = 0.8 * alike[k - 1] + 0.6 * white[k]
    found = serial_correlation(replace(m, residual=alike), sigma)
    (correlation,) = found.values()
    assert 0.5 < correlation < 0.95
    one = replace(m, residual=alike * [0.0, 1.0])  # a channel without any residual hides no other
    assert serial_correlation(one, sigma) == found == {"pointing along": correlation}
    words = diagnosis_sentences.serial_correlation(m.view, correlation, N**-0.5)
    assert words.startswith("successive residuals of pointing are correlated by 0.")


def test_a_correlation_of_settings_without_a_cause_is_a_misfit_that_nothing_explains():
    """A slow error of the elevation with a memory of five settings, which neither angles nor the clock describe."""
    r, white = telescope(7), np.random.default_rng(7).standard_normal(N)
    slow = white.copy()
    for k in range(1, N):
        slow[k] = 0.8 * slow[k - 1] + 0.6 * white[k]
    up = r.channels["gimbal_angle", "elevation"] + 5 * ARCSEC * slow
    d = diagnose([replace(r, channels={**r.channels, ("gimbal_angle", "elevation"): up})])
    assert (d.verdict, d.findings, d.laws) == ("unexplained", (), ())
    assert d.unexplained == (Shape("pointing along", "a correlation between successive settings"),)
    assert d.outcome.startswith("Successive residuals of pointing are correlated by 0.")
    assert "another order" in d.recommend
    assert not d.fit.unseen  # limits of detection hold where the noise is white


@pytest.mark.parametrize("seed", [1, 2])
def test_tilt_and_flexure_come_back(seed):
    d = diagnose([telescope(seed, 12.0, -7.0, 15.0)])
    assert d.verdict == "missing-physics"
    assert "base_tilt" in {f["effect"] for f in d.findings}
    assert any("tube_flexure" in (f["effect"], *f["twins"]) for f in d.findings)
    for axis, truth in (("north", 12.0), ("east", -7.0)):
        value, sigma = size(d, "base_tilt", axis)
        assert abs(value - truth) < 3.5 * sigma  # the larger of four, once in five hundred
        assert sigma < 0.5
    assert d.fit["heldout_rms_after"] < 0.2 * d.fit["heldout_rms_before"]


def test_a_mistaken_star_is_left_out_and_hides_nothing():
    """One star a minute of arc off is seven arcsec of scatter, in which a tilt of two does not show."""
    r = telescope(3, 2.0, -2.0)
    off = r.channels["gimbal_angle", "elevation"] + 60 * ARCSEC * (np.arange(N) == 16)
    d = diagnose([replace(r, channels={**r.channels, ("gimbal_angle", "elevation"): off})])
    assert {f["effect"] for f in d.findings} == {"base_tilt"}
    assert d.fit["rms_after"] == pytest.approx(np.sqrt(2), rel=0.15)
    (note,) = d.provenance["notes"]
    assert note.startswith("Star 17 is ")
    assert note in d.in_words
    assert 17 not in d.curves.position  # the others keep theirs
    assert d.curves.position[-1] == N


def test_what_no_catalogue_holds_is_a_shape():
    d = diagnose([telescope(3, lifted=lambda _, A: 20.0 * np.sin(5 * A))])
    assert d.verdict == "unexplained"
    assert d.findings == ()
    assert "azimuth angle" in d.unexplained[0]["shape"]


@pytest.mark.parametrize("seed", range(6))
def test_a_unit_turned_by_hand_that_lacks_nothing(seed):
    d = diagnose([turned(seed)])
    assert d.verdict == "adequate"
    assert d.findings == ()


def test_rates_that_follow_the_pose():
    truth = np.array([[0.0, 100.0, -50.0], [200.0, 0.0, 0.0], [0.0, -150.0, 0.0]])
    d = diagnose([turned(7, truth)], baseline=("gyro_bias",))
    assert [f["effect"] for f in d.findings] == ["gyro_g_sensitivity_rate"]
    pulls = []
    for i, a in enumerate("xyz"):
        for j, b in enumerate("xyz"):
            value, sigma = size(d, "gyro_g_sensitivity_rate", a + b)
            pulls.append((value - truth[i, j]) / sigma)
    assert np.max(np.abs(pulls)) < 3.5  # nine normal numbers exceed it once in 240
    assert d.fit["heldout_after"] < 0.2 * d.fit["heldout_before"]


def test_biases_that_drift_are_seen_in_the_order_of_visits():
    d = diagnose([turned(8, drift=1.0)], baseline=("bias", "scale_factor", "misalignment"))
    assert [f["effect"] for f in d.findings] == ["slow_bias_drift"]
    assert d.fit["rms_after"] < 0.7 * d.fit["rms_before"]


def test_rows_left_out_are_predicted_as_a_fit_without_them_predicts_them():
    """The misfit of a star about a fit to the other 79, each fit made anew; in sigma."""
    v = pointing(telescope(4, 12.0, -7.0))
    m = start_with_baseline(v)
    sigma = np.full((N, 2), 3 * ARCSEC)
    left = held_out_misfit(m, sigma)
    J, r = m.jacobian / sigma[..., None], m.residual / sigma
    J = J / (np.linalg.norm(J, axis=(0, 1)) + 1e-300)
    for k in (0, 17, 50, 79):
        others = np.arange(N) != k
        x = np.linalg.lstsq(J[others].reshape(2 * N - 2, -1), r[others].ravel(), rcond=1e-7)[0]
        np.testing.assert_allclose(left[k], r[k] - J[k] @ x, rtol=1e-6, atol=1e-9)
    assert (left**2).sum() > (r**2).sum()


def test_constants_move_as_what_was_found_moves_them():
    """A bent tube that the model lacks is taken up in part by the zero of the elevation encoder."""
    v = pointing(telescope(5, bend=30.0))
    c = stepwise(v, lambda _: None)
    assert {s.cause[0].effect for s in c.steps} == {"tube_flexure"}
    rows = view_shifts(c.start, c.end)
    zero = next(r for r in rows if (r["name"], r["axis"]) == ("gimbal_zero", "elevation"))
    before, after = (values(m.effects, m.parameters) for m in (c.start, c.end))
    at = next(k for k, p in enumerate(c.start.parameters) if (p.name, p.axis) == ("gimbal_zero", "elevation"))
    there = next(k for k, p in enumerate(c.end.parameters) if (p.name, p.axis) == ("gimbal_zero", "elevation"))
    assert zero["unit"] == "arcsec"
    assert zero["moved"] == pytest.approx((after[there] - before[at]) / ARCSEC)
    assert zero["in_sigmas"] == pytest.approx(zero["moved"] / zero["sigma"], abs=0.006)
    assert abs(zero["in_sigmas"]) == max(abs(r["in_sigmas"]) for r in rows)
    assert rows[0] == zero


@pytest.mark.parametrize("seed", [1, 2])
def test_a_bias_that_drifts_with_the_clock_is_no_other_drift_alone(seed):
    """3 mg in ten minutes on one axis: a straight line, and warm_up with a long time constant beside it at most."""
    r = turned(seed)
    ramp = 3e-3 * G * r.time / r.time[-1]
    y = r.channels["specific_force", "y"] + ramp
    (found,) = diagnose([replace(r, channels={**r.channels, ("specific_force", "y"): y})]).findings
    assert "bias_drift" in {found["effect"], *found["twins"]}
    assert found["axis"] == "y"


def test_gyroscopes_that_follow_the_temperature_are_named_with_their_size():
    r = turned(3)
    warm = 20 + 8 * np.sin(2 * np.pi * r.time / 380.0)
    x = r.channels["angular_rate", "x"] + 40 * np.pi / 648000 * (warm - warm.mean())
    channels = {**r.channels, ("angular_rate", "x"): x, ("temperature", ""): warm}
    (found,) = diagnose([replace(r, channels=channels)]).findings
    assert (found["effect"], found["axis"], found["twins"]) == ("gyro_bias_temperature", "x", [])
    (size,) = found["parameters"]
    assert abs(size["value"] - 40.0) < 4 * size["sigma"] < 8.0


def test_gyroscopes_of_a_unit_in_one_attitude_are_compared_in_blocks():
    """Nine long rests, over each of which the temperature goes round; two gyroscopes follow it."""
    rng = np.random.default_rng(4)
    t = 2.0 * np.arange(900)
    position = np.repeat(np.arange(1, 10), 100)
    warm = 20 + 10 * np.sin(2 * np.pi * t / 200)
    drift = np.outer(warm, [0.0, -100.0, 60.0]) * np.pi / 648000
    f = np.array([0.0, 0.0, G]) + 1e-3 * rng.standard_normal((900, 3))
    w = 1e-3 + drift + 2e-4 * rng.standard_normal((900, 3))
    channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
    channels |= {("angular_rate", a): w[:, i] for i, a in enumerate("xyz")} | {("temperature", ""): warm}
    r = Recording("multi-position", "cooled", BENCH, Site(None, 0.0, G), {}, t, position, channels)
    (found,) = diagnose([r]).findings
    assert "gyro_bias_temperature" in {found["effect"], *found["twins"]}
    assert {p["axis"] for p in found["parameters"]} >= {"y", "z"}


def test_a_worm_is_found_by_the_number_of_its_teeth():
    """Tracking over 25 degrees at the sidereal rate, an error of 6 arcsec once per tooth, 1 arcsec of noise."""
    rng = np.random.default_rng(144)
    n = 240
    t = 25.0 * np.arange(n)
    E, A = np.full(n, 0.3), t * 2 * np.pi / 86164.0 - 0.8
    worm = 6 * ARCSEC * np.sin(144 * A + 0.4)
    channels = {
        ("gimbal_angle", "elevation"): E + ARCSEC * rng.standard_normal(n),
        ("gimbal_angle", "azimuth"): A + worm + ARCSEC * rng.standard_normal(n),
        ("true_angle", "elevation"): E,
        ("true_angle", "azimuth"): A,
    }
    r = Recording("pointing", "worm", KNOWN["alt-az"], Site(0.9, 0.0, G), {}, t, None, channels)
    d = diagnose([r], baseline=("gimbal_zero", "gimbal_zero_drift"))
    (found,) = d.findings
    assert "periodic_worm_error" in {found["effect"], *found["twins"]}
    assert "azimuth" in found["axis"]
    (number,) = (p for p in found["parameters"] if p["name"] in ("teeth", "lines"))
    assert abs(number["value"] - 144) < 4 * number["sigma"] + 1e-6 < 4
    assert d.fit["rms_after"] < 1.1 * np.sqrt(2) < d.fit["rms_before"]


def test_a_weak_worm_shows_by_the_harmonics_of_one_tooth():
    """Each line is hardly above noise with memory; together they are a worm of 180 teeth, not of 540."""
    rng = np.random.default_rng(5)
    n = 300
    t = 9.0 * np.arange(n)
    E, A = np.full(n, 0.3), t * 2 * np.pi / 86164.0 - 0.8
    slow = np.zeros((n, 2))
    for k in range(1, n):
        slow[k] = 0.85 * slow[k - 1] + 0.5 * rng.standard_normal(2)
    lines = ((1, 1.2, 0.4), (3, 0.8, 1.0), (4, 0.7, 2.0), (5, 0.5, 0.1))
    worm = sum(a * np.sin(180 * k * A + phase) for k, a, phase in lines)
    noise = slow + 0.3 * rng.standard_normal((n, 2))
    channels = {
        ("gimbal_angle", "elevation"): E,
        ("gimbal_angle", "azimuth"): A,
        ("true_angle", "elevation"): E + ARCSEC * 3 * noise[:, 1],
        ("true_angle", "azimuth"): A + ARCSEC * (worm + noise[:, 0]),
    }
    r = Recording("pointing", "worm", KNOWN["alt-az"], Site(0.9, 0.0, G), {}, t, None, channels)
    d = diagnose([r], baseline=("gimbal_zero", "gimbal_zero_drift"))
    (found,) = d.findings
    assert (found["effect"], found["axis"]) == ("periodic_worm_error", "azimuth")
    (number,) = (p for p in found["parameters"] if p["name"] == "teeth")
    assert abs(number["value"] - 180) <= 3 * number["sigma"] < 12
    sizes = {p["name"]: p["value"] for p in found["parameters"]}
    assert np.hypot(sizes["worm_3_sin"], sizes["worm_3_cos"]) == pytest.approx(0.8, abs=0.3)


def test_turns_during_which_the_clock_pauses_are_left_out_and_not_refused():
    """A logger that is switched off after each rest and on again for the turn."""
    r = unknown_hand.record(3, unknown_hand.Setup(rests=12, gyroscopes=True, minutes=1.0))
    assert r.position is not None
    begun = np.cumsum(np.diff(r.position, prepend=1) != 0)  # every stretch of rows
    d = diagnose([replace(r, time=r.time + 60.0 * begun)])
    assert set(d.provenance["views"]) == {"norm", "rest rates"}


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("cycling", "specific_force norm: a pattern in time along z"),  # of one accelerometer, wherever it points
        ("ripple", "specific_force norm: a curve of the force along y"),
        ("breathing", "specific_force norm: a scale factor that changes in time along z"),
        ("hours apart", "pointing across: a pattern in time"),
        ("harmonic", "pointing across: a pattern in the azimuth angle, twice per turn and faster"),
    ],
)
def test_laws_of_no_catalogue_are_told_by_their_shape(name, shape):
    run = next(r for r in runs() if r.concealed == (name,) and r.sigmas == 40)
    a = answer(run)
    assert a["shapes"][0] == shape
    assert all(true for *_, true in a["claims"])  # what every mount has besides


@pytest.mark.parametrize("name", ["slipped", "backlash", "worm 359"])
def test_what_happens_to_the_drives_of_a_mount_is_named(name):
    run = next(r for r in runs() if r.concealed == (name,) and r.sigmas == 12)
    assert answer(run)["judged"] == ["right"]


def test_a_voltage_that_was_logged_is_a_cause_of_its_own():
    """What an effect of its own says of a channel a generic one need not say as well: it has no channel left."""
    run = next(r for r in runs() if r.concealed == ("supply",) and r.sigmas == 40)
    assert answer(run)["judged"] == ["right"]


def test_poses_that_come_again_and_again_leave_no_shape_of_their_own():
    """Twelve poses five times over: what they tell the model has taken, and the rest of a pattern in them is noise."""
    run = next(r for r in runs() if r.concealed == ("chamber scale T",) and r.sigmas == 40)
    assert answer(run)["judged"] == ["right"]


@pytest.mark.parametrize("tau", [60.0, 180.0])  # s; a step of the bias, with certainty, where a minute was not sought
def test_a_unit_that_warms_up_within_minutes_is_told_as_that(tau):
    def warming(h):
        return {"force": np.outer(np.exp(-h.t / tau), [0.0, 1.0, 0.0])}

    setup = unknown_hand.Setup(unknown_hand.MEMS, rests=32, minutes=30.0)
    d = diagnose([unknown_hand.record(1, setup, ((warming, 40 / unknown_hand.strength(1, setup, warming)),))])
    assert d.findings[0]["effect"] == "warm_up"
    assert len(d.findings) == 1


def test_rests_that_no_cause_explains_are_left_out_before_formulas_are_sought():
    """A formula would follow three wrong readings; what the others show is a law of the catalogue."""

    def thermal(h):
        return {"force": np.outer(h.felt - 20, [0.0, 1.0, 0.0])}

    setup = unknown_hand.Setup(unknown_hand.MEMS, rests=120, minutes=60.0, thermometer=True)
    good = unknown_hand.record(1, setup, ((thermal, 30 / unknown_hand.strength(1, setup, thermal)),))
    force, wrong = good.triad("specific_force").copy(), np.isin(good.position, (20, 57, 93))
    force[wrong] *= 1.08
    changed = {("specific_force", a): force[:, i] for i, a in enumerate("xyz")}
    d = diagnose([replace(good, channels={**good.channels, **changed})])
    assert [f["effect"] for f in d.findings][:1] == ["bias_temperature"]
    assert "20, 57 and 93 are off" in d.in_words, d.in_words


@pytest.mark.parametrize("step", [0.0, 0.5])
def test_readings_without_noise_or_of_few_levels_lack_nothing(step):
    """Rounding of numbers is no pattern, and samples that do not scatter are no noise of zero."""
    u = np.random.default_rng(3).standard_normal((20, 3))
    f = np.repeat(G * u / np.linalg.norm(u, axis=1, keepdims=True) * [1.001, 0.998, 1.003] + [0.02, -0.01, 0.03], 5, 0)
    f = np.round(f / step) * step if step else f
    n = len(f)
    channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
    r = Recording("multi-position", "made", BENCH, Site(None, 0.0, G), {}, np.arange(n) * 0.1,
                  np.repeat(np.arange(1, 21), 5), channels)  # fmt: skip
    found = diagnose([r])
    assert found.verdict == "adequate"
    assert not found.findings
