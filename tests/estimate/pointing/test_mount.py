"""The terms of a mount come back from made stars, with honest sigmas, in one night or several."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.estimate.pointing.pattern import why_far
from gimbalcal.platform import Axis, Platform
from gimbalcal.views.pointing import split_nights
from gimbalcal.words.calibration_sentences import calibration_in_words
from tests.estimate.pointing.mounts import ALT_AZ, ARCSEC, EQUATORIAL, effects, run, sky
from tests.golden import golden_text, refused

TELESCOPE = {"gimbal_zero__elevation": 300.0, "gimbal_zero__azimuth": -4000.0, "axis_collimation": 60.0,
             "nonorthogonality__elevation": -20.0, "base_tilt__north": 25.0, "base_tilt__east": -10.0,
             "tube_flexure": 15.0}  # fmt: skip
AMATEUR = {"gimbal_zero__declination": -3000.0, "gimbal_zero__hour_angle": 28000.0, "axis_collimation": -1800.0,
           "nonorthogonality__declination": -1100.0, "base_tilt__east": 120.0, "base_tilt__down": 300.0,
           "tube_flexure": 1400.0}  # fmt: skip


def off(made, truth):
    """Errors of the estimates in sigmas."""
    true = np.array([ARCSEC * truth[p.label.replace(":", "__")] for p in made.parameters])
    return np.asarray((made.values - true) / made.sigmas)


@pytest.mark.parametrize(("mount", "truth", "noise"), [(ALT_AZ, TELESCOPE, 1.0), (EQUATORIAL, AMATEUR, 20.0)])
def test_terms_come_back_with_honest_sigmas(mount, truth, noise):
    there, squares = effects(mount, **truth), []
    for seed in range(6):
        made = pointing_calibration([run(mount, sky(mount, 80, seed), there, noise, seed)])
        squares.append(float(off(made, truth) ** 2 @ np.ones(len(truth))))
        assert np.abs(off(made, truth)).max() < 4.5
        assert not made.unobservable
        assert made.outcome == ""
    mean = np.mean(squares) / len(
        truth
    )  # chi^2 of 42, hardly correlated within a run: 1 +- 0.22, fatter by Student's t
    assert 0.4 < mean < 1.9
    assert made.provenance["noise"]["star_arcsec"] == pytest.approx(noise, rel=0.25)


@pytest.mark.parametrize("zero_deg", [0.5, 100.0, -157.0])
@pytest.mark.parametrize("plunged", [0, 2])  # each second star, if any
@pytest.mark.parametrize("mount", [ALT_AZ, EQUATORIAL])
def test_a_far_zero_and_plunged_stars_change_neither_terms_nor_verdict(mount, plunged, zero_deg):
    angle = sky(ALT_AZ, 60)
    if plunged:
        angle[::plunged] = np.pi + np.array([-1.0, 1.0]) * angle[::plunged]
    r = run(mount, angle, effects(mount, axis_collimation=60.0, base_tilt__east=-40.0), 2.0)
    inner, outer = mount.axis_names[:2]
    over = np.cos(r.channels["true_angle", inner]) < 0
    seen = r.with_channels({  # stars as a catalogue gives them, and a readout that counts from elsewhere
        ("true_angle", inner): np.where(over, np.pi - (up := r.channels["true_angle", inner]), up),
        ("true_angle", outer): (r.channels["true_angle", outer] + np.pi * over) % (2 * np.pi),
        ("gimbal_angle", outer): r.channels["gimbal_angle", outer] - np.radians(zero_deg),
    })  # fmt: skip
    made = pointing_calibration([seen])
    value = dict(zip((p.label for p in made.parameters), made.values / ARCSEC, strict=True))
    assert value[f"gimbal_zero:{outer}"] == pytest.approx(3600.0 * zero_deg, abs=20.0)
    assert value["axis_collimation"] == pytest.approx(60.0, abs=10.0)
    assert {f.effect for f in diagnose([seen]).findings} == {"base_tilt"}


def test_exact_stars_give_exact_terms():
    made = pointing_calibration([run(EQUATORIAL, sky(EQUATORIAL), effects(EQUATORIAL, **AMATEUR))])
    np.testing.assert_allclose(made.values / ARCSEC, list(AMATEUR.values()), atol=1e-4)


def test_what_the_stars_do_not_tell_is_named():
    low = sky(ALT_AZ, 40)
    low[:, 0] = 0.7  # one elevation: zero and sag are one, and so are collimation, squareness and zero of azimuth
    made = pointing_calibration([run(ALT_AZ, low, effects(ALT_AZ, **TELESCOPE), 1.0)])
    named = [frozenset(u["direction"]) for u in made.unobservable]
    assert len(named) == 3
    assert frozenset({"gimbal_zero:elevation", "tube_flexure"}) in named
    assert made.residual.dof == 80 - 4


def stated(recording, sigma):
    return replace(recording, noise={"gimbal_angle": sigma * ARCSEC})


def test_a_stated_noise_is_held_against_what_is_left():
    clean = run(ALT_AZ, sky(ALT_AZ), effects(ALT_AZ, **TELESCOPE), 1.0)
    assert pointing_calibration([stated(clean, 1.0)]).outcome == ""
    short = pointing_calibration([stated(clean, 0.5)])
    golden_text(short.outcome)
    more = effects(ALT_AZ, **TELESCOPE, eccentricity_sin__azimuth=8.0)
    bent = run(ALT_AZ, sky(ALT_AZ), more, 1.0)
    golden_text(pointing_calibration([stated(bent, 1.0)]).outcome)
    whole = pointing_calibration([stated(bent, 1.0)], more=("encoder_eccentricity:azimuth",))
    assert whole.outcome == ""
    found = {p.label: v / ARCSEC for p, v in zip(whole.parameters, whole.values, strict=True)}
    assert found["eccentricity_sin:azimuth"] == pytest.approx(8.0, abs=1.5)


def test_a_pattern_of_what_is_left_is_told_where_no_noise_is_stated():
    clean, bent = (
        pointing_calibration([run(ALT_AZ, sky(ALT_AZ, 60), effects(ALT_AZ, **TELESCOPE, **more), 1.0)])
        for more in ({}, {"eccentricity_sin__azimuth": 12.0})
    )
    assert clean.provenance.pattern is None
    assert bent.provenance["pattern"]["axis"] == "azimuth"
    assert bent.outcome == ""  # whose noise nobody states
    words = calibration_in_words(bent)
    golden_text(words)


def test_a_mistaken_star_is_named():
    night = run(ALT_AZ, sky(ALT_AZ, 60), effects(ALT_AZ, **TELESCOPE), 1.0)
    elevation = night.channels["true_angle", "elevation"].copy()
    elevation[16] += 90 * ARCSEC
    made = pointing_calibration([night.with_channels({("true_angle", "elevation"): elevation})])
    (star,) = made.provenance["far_off"]
    assert star["star"] == 17
    assert star["arcsec"] == pytest.approx(90, rel=0.2)
    words = calibration_in_words(made)
    golden_text(words)
    assert pointing_calibration([night]).provenance["far_off"] == []
    later = np.where(np.arange(60) < 10, 0.0, 86400.0)  # a second night in one file, whose rows go on counting
    two = replace(night.with_channels({("true_angle", "elevation"): elevation}), time=night.time + later)
    assert [s["star"] for s in pointing_calibration([two]).provenance["far_off"]] == [17]


def test_noise_alone_makes_no_pattern():
    runs = (run(ALT_AZ, sky(ALT_AZ, 60, seed), effects(ALT_AZ, **TELESCOPE), 1.0, seed) for seed in range(20))
    assert sum(bool(pointing_calibration([r]).provenance.pattern) for r in runs) == 0  # of 20, 0.02 by chance


def test_an_effect_is_added_with_the_constant_that_is_stated_or_fits():
    """Five turns of a wobbling bearing to one of the azimuth."""
    there = effects(ALT_AZ, **TELESCOPE, harmonic_sin__azimuth=15.0, harmonic_cos__azimuth=-10.0)
    there = tuple(replace(e, order=5.0) if e.id == "encoder_harmonic" else e for e in there)
    night = run(ALT_AZ, sky(ALT_AZ, 70), there, 1.0)
    for words in ("encoder_harmonic:azimuth,order=5", "encoder_harmonic:azimuth"):
        made = pointing_calibration([night], more=(words,))
        found = {p.label: (v, s) for p, v, s in zip(made.parameters, made.values, made.sigmas, strict=True)}
        assert found["encoder_harmonic.order"][0] == 5.0
        for label, size in (("harmonic_sin:azimuth", 15.0), ("harmonic_cos:azimuth", -10.0)):
            value, sigma = found[label]
            assert abs(value - size * ARCSEC) < 4 * sigma < 4 * ARCSEC
        assert "harmonic_sin:elevation" not in found
        assert made.provenance["noise"]["star_arcsec"] == pytest.approx(1.0, rel=0.25)


def two(change, seed=3):
    first = effects(ALT_AZ, **TELESCOPE)
    then = effects(ALT_AZ, **{**TELESCOPE, "base_tilt__east": -10.0 + change})
    return (run(ALT_AZ, sky(ALT_AZ, 50, 5), first, 1.0, seed), run(ALT_AZ, sky(ALT_AZ, 50, 6), then, 1.0, seed + 9))


def test_nights_that_share_their_terms_are_one():
    alone, both = (pointing_calibration(r) for r in ([two(0.0)[0]], two(0.0)))
    assert both.outcome == ""
    assert both.provenance["same_terms_every_night"] > 1e-3
    assert both.sigmas[0] < 0.85 * alone.sigmas[0]


def test_a_term_that_moves_between_nights_is_told_with_sigma():
    made = pointing_calibration(two(12.0))
    golden_text(made.outcome)
    change = made.provenance["nights"][1]["terms"]["base_tilt:east"]
    assert abs(change["change"] - 12.0) < 4 * change["change_sigma"]
    assert 0.1 < change["change_sigma"] < 1.0  # noise of 1 arcsec, 50 stars a night
    assert made.provenance["noise"]["star_arcsec"] > 2.0  # one set of terms for both leaves more


def test_a_file_is_cut_where_it_pauses_and_is_judged_as_one_mount():
    first, second = two(0.0)
    joined = {k: np.concatenate([first.channels[k], second.channels[k]]) for k in first.channels}
    time = np.concatenate([first.time, first.time[-1] + 1.8 * 86400 + second.time])
    whole = replace(first, time=time, channels=joined, weight=np.ones(len(time)))
    assert [len(n.time) for n in split_nights(whole)] == [50, 50]
    made = pointing_calibration([whole])
    np.testing.assert_allclose(made.values, pointing_calibration(two(0.0)).values, atol=1e-12)
    assert [n["stars"] for n in made.provenance["nights"]] == [50, 50]


def test_runs_that_do_not_belong_together_are_refused():
    night = run(ALT_AZ, sky(ALT_AZ, 12), ())
    with refused():
        pointing_calibration([night, run(EQUATORIAL, sky(EQUATORIAL, 12), ())])
    with refused():
        pointing_calibration([night, replace(night, kind="rotation")])
    with refused():
        pointing_calibration([night.select(slice(0, 3))])
    with refused():
        pointing_calibration([night], ("bias",))
    with refused():
        pointing_calibration([night], more=("base_tilt:down",))
    with refused():
        pointing_calibration([night], ("gimbal_zero", "base_tilt:down"))
    blind = {k: v for k, v in night.channels.items() if k != ("true_angle", "azimuth")}
    with refused():
        pointing_calibration([replace(night, channels=blind)])


def test_any_two_axis_gimbal_can_be_calibrated():
    """An antenna whose outer axis lies horizontally to the north: a turn about north is its zero."""
    antenna = Platform("x-y", (Axis("inner", "y"), Axis("outer", "x", -1)))
    rng = np.random.default_rng(4)
    at = np.stack([rng.uniform(0.5, 1.1, 60), rng.uniform(-0.9, 0.9, 60)], axis=1)
    truth = {"gimbal_zero__inner": 50.0, "gimbal_zero__outer": -30.0, "base_tilt__down": 40.0, "base_tilt__east": 5.0}
    made = pointing_calibration([run(antenna, at, effects(antenna, **truth), 1.0)])
    found = {p.label: (v - ARCSEC * truth.get(p.label.replace(":", "__"), 0.0)) / s
             for p, v, s in zip(made.parameters, made.values, made.sigmas, strict=True)}  # fmt: skip
    assert set(found) >= {"base_tilt:down", "base_tilt:east"}
    assert "base_tilt:north" not in found
    assert max(map(abs, found.values())) < 4.5
    assert made.provenance["tpoint"] == []


@pytest.mark.parametrize("direction", ["y", "z"])
def test_a_mount_of_a_single_axis_shows_its_zero_and_its_encoder(direction):
    """It moves the line of sight in one direction: along the innermost axis' plane (y), or across it (z)."""
    servo = Platform("servo", (Axis("table", direction),))
    readout = np.radians(np.linspace(-80, 80, 161))[:, None]
    truth = {"gimbal_zero__table": 900.0, "eccentricity_cos__table": 700.0, "eccentricity_sin__table": -400.0}
    there = effects(servo, **truth)
    recording = run(servo, readout, there, noise=100.0)
    made = pointing_calibration([recording], more=("encoder_eccentricity",))
    assert [p.effect for p in made.parameters] == ["gimbal_zero", "encoder_eccentricity", "encoder_eccentricity"]
    assert np.abs(off(made, truth)).max() < 4.0
    assert set(made.residual.rms) == {f"pointing {'along' if direction == 'y' else 'across'}"}


def test_the_encoder_of_a_single_axis_is_found_and_noise_alone_is_not():
    """The axis is vertical: of a horizontal one the sag of the tube looks like the cosine of an eccentric encoder."""
    servo, zero = Platform("servo", (Axis("table", "z"),)), {"gimbal_zero__table": 900.0}
    readout = np.radians(np.linspace(-80, 80, 161))[:, None]
    there = effects(servo, **zero, eccentricity_cos__table=700.0, eccentricity_sin__table=-400.0)
    assert [c.effect for c in diagnose([run(servo, readout, there, noise=100.0)]).findings] == ["encoder_eccentricity"]
    assert diagnose([run(servo, readout, effects(servo, **zero), noise=100.0)]).verdict == "adequate"


def test_an_axis_along_the_line_of_sight_is_refused():
    night = run(Platform("servo", (Axis("table", "z"),)), np.radians(np.linspace(0, 50, 20))[:, None], ())
    with refused():
        pointing_calibration([replace(night, platform=Platform("roll", (Axis("table", "x"),)))])


@pytest.mark.parametrize(
    ("far", "off", "words"),
    [
        ([3, 30, 50], [[0, 9], [1, -8], [0.5, 7]], "all along elevation, so rather play in a gear"),
        ([3, 30, 50], [[9, 0], [8, 1], [-8, 0]], "all across elevation, so rather play in a gear"),
        ([3, 30, 50], [[5, 7], [-8, 4], [0, 9]], "mistaken or not centred"),
        ([3, 30], [[0, 9], [0, -8]], "mistaken or not centred"),  # two are so by chance
        ([0, 1, 2], [[5, 7], [-8, 4], [0, 9]], "all in one part of the sky, so rather what the model lacks there"),
    ],
)
def test_why_stars_are_far_off_the_others(far, off, words):
    at = np.random.default_rng(3).uniform([0.3, -3.0], [1.3, 3.0], (60, 2))
    at[:3] = [[0.8, 1.0], [0.82, 1.02], [0.79, 0.97]]
    at[3:] = at[3:][np.abs(at[3:, 1] - 1.0).argsort()[::-1]]  # no other star is near these
    left = np.zeros((60, 2))
    left[far] = off
    assert why_far(left, at, far, "elevation").startswith(words)
