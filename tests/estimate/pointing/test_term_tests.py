"""Tests of the terms of a mount against fits without and with them, and against noise alone."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.words.calibration_sentences import sky_rms
from tests.estimate.pointing.mounts import ALT_AZ, ARCSEC, EQUATORIAL, effects, run, sky
from tests.golden import golden_text

TRUTH = {
    "gimbal_zero__azimuth": 300.0, "base_tilt__north": 25.0, "tube_flexure": 15.0, "eccentricity_sin__azimuth": 4.0,
}  # fmt: skip
TRUTH_EQUATORIAL = {"gimbal_zero__hour_angle": 300.0, "base_tilt__north": 25.0, "tube_flexure": 15.0}
OUTSIDE = ("eccentricity_sin:azimuth", "refraction", "two_cycle_cos:elevation", "encoder_scale_factor:elevation")


def night(seed=1, noise=1.0):
    return run(ALT_AZ, sky(ALT_AZ, 60, seed), effects(ALT_AZ, **TRUTH), noise, seed)


def by_term(c):
    return {t.term: t for t in c.provenance.term_tests or ()}


def test_a_term_of_the_model_is_tested_as_a_fit_without_it_does():
    r = night()
    whole = pointing_calibration([r], more=("TX",))
    for p in whole.parameters:
        test, without = by_term(whole)[p.label], pointing_calibration([r], more=("TX",), without=(p.label,))
        assert test.in_model
        assert test.rms_without_arcsec == pytest.approx(sky_rms(without), rel=0.02)  # the zeros are not quite linear
        assert test.rms_with_arcsec == pytest.approx(sky_rms(whole), rel=1e-6)
        x, sigma = whole.values[whole.parameters.index(p)], whole.sigmas[whole.parameters.index(p)]
        assert test.F == pytest.approx((x / sigma) ** 2, rel=1e-3)
        assert test.dof == (1, whole.residual.dof)


def test_a_term_outside_the_model_is_tested_as_a_fit_with_it_does():
    r = night()
    usual = pointing_calibration([r])
    for label in OUTSIDE:
        test, more = by_term(usual)[label], pointing_calibration([r], more=(label,))
        same = by_term(more)[label]
        assert (test.in_model, same.in_model) == (False, True)
        assert test.rms_with_arcsec == pytest.approx(sky_rms(more), rel=1e-3)
        assert test.value == pytest.approx(same.value, rel=0.01, abs=0.01 * (same.sigma or 0.0))
        # a thousandth of the residual is a tenth of an e-fold in the likelihood of its memory
        assert test.sigma == pytest.approx(same.sigma, rel=0.02)
        assert test.F == pytest.approx(same.F, rel=0.05)
        assert test.p_value == pytest.approx(same.p_value, rel=0.1)
        assert test.correlations == pytest.approx(same.correlations, abs=0.01)
    outside = [t for t in by_term(usual).values() if not t.in_model]
    assert outside[0].term == "eccentricity_sin:azimuth"
    assert outside[0].p_value < 1e-6
    assert [t.rms_with_arcsec for t in outside] == sorted(t.rms_with_arcsec for t in outside)


def test_a_term_that_no_star_shows_is_no_obstacle():
    r = run(EQUATORIAL, sky(EQUATORIAL, 60, 1), effects(EQUATORIAL, **TRUTH_EQUATORIAL), 1.0, 1)
    made = pointing_calibration([r], more=("gimbal_flexure",))
    assert {t.rms_without_arcsec > 0 for t in by_term(made).values()} == {True}
    assert made.null_directions  # what carries the bend of a gimbal does not turn here


def test_noise_alone_has_uniform_p_values():
    there = effects(ALT_AZ, **{k: v for k, v in TRUTH.items() if "eccentricity" not in k})
    p: list[float] = []
    for seed in range(12):
        r = run(ALT_AZ, sky(ALT_AZ, 50, seed), there, 1.0, seed)
        for stated in (r, replace(r, noise={"gimbal_angle": ARCSEC})):
            tests = (pointing_calibration([stated]).provenance.term_tests or ())[7:]
            p += [t.p_value for t in tests]
    share = np.mean(np.array(p) < 0.1)
    assert len(p) > 400
    assert 0.05 < share < 0.16  # 0.1, of terms that are correlated within a run


def test_a_constant_belongs_to_its_effect():
    there = effects(ALT_AZ, **TRUTH, harmonic_sin__azimuth=15.0, harmonic_cos__azimuth=-10.0)
    there = tuple(replace(e, order=5.0) if e.id == "encoder_harmonic" else e for e in there)
    r = run(ALT_AZ, sky(ALT_AZ, 70), there, 1.0)
    test = by_term(pointing_calibration([r], more=("encoder_harmonic:azimuth,order=5",)))["encoder_harmonic"]
    assert test.dof[0] == 2
    assert test.value is None
    gain = (test.rms_without_arcsec / test.rms_with_arcsec) ** 2 - 1
    assert test.F == pytest.approx(gain / 2 * (test.dof[1] or 0), rel=0.01)  # rows that hardly remember each other
    assert test.rms_without_arcsec == pytest.approx(sky_rms(pointing_calibration([r])), rel=0.01)


def test_terms_are_named_as_tpoint_does():
    r = night()
    made = pointing_calibration([r], more=("TX", "ACES"), without=("NPAE", "base_tilt:east"))
    labels = {p.label for p in made.parameters}
    assert {"refraction", "eccentricity_sin:azimuth"} <= labels
    assert not {"nonorthogonality:elevation", "base_tilt:east", "eccentricity_cos:azimuth"} & labels
    named = {t.term: t for t in made.provenance.tpoint or ()}
    before = {t.term: t for t in pointing_calibration([r]).provenance.tpoint or ()}
    assert list(named) == ["IA", "IE", "CA", "AW", "TF", "TX", "ACES"]
    for name, term in named.items():
        old = before[name].value if name in before else 0.0
        assert term.change == pytest.approx(term.value - old, abs=1e-9)
    assert before["AW"].change == before["AW"].value
    n, k = len(r.time), len(made.parameters)
    assert made.provenance.population_sd_arcsec == pytest.approx(sky_rms(made) * np.sqrt(n / (n - k)))
    equatorial = run(EQUATORIAL, sky(EQUATORIAL), effects(EQUATORIAL, base_tilt__down=20.0), 1.0)
    assert "base_tilt:down" not in {p.label for p in pointing_calibration([equatorial], without=("MA",)).parameters}


@pytest.mark.parametrize(
    ("more", "without"),
    [((), ("TX",)), (("AN",), ()), ((), ("bias",)), (("eccentricity_sin:azimut",), ()),
     ((), ("gimbal_zero", "axis_collimation", "gimbal_nonorthogonality", "base_tilt", "tube_flexure"))],
)  # fmt: skip
def test_what_cannot_be_added_or_omitted_is_refused(more, without):
    with pytest.raises(InputError) as problem:
        pointing_calibration([night()], more=more, without=without)
    golden_text(problem.value)
