"""Interchanged and mis-set positions are named; missing physics is not blamed on a position."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE
from gimbalcal.estimate.accelerometers.position_fit import noise_of_positions
from gimbalcal.estimate.accelerometers.position_outliers import (
    fit_without_outliers,
    probability,
)
from gimbalcal.p_value import is_explained_by_chance
from gimbalcal.views.positions import view_of_positions
from tests.estimate.device import (
    ARCSEC,
    NOISE,
    PARAMETERS,
    SAMPLE,
    draw,
    effects,
    interchanged,
    measured,
    misread,
    outputs,
)
from tests.golden import golden_text


@pytest.fixture(scope="module")
def clean():
    rng = np.random.default_rng(11)
    return measured(draw(rng), rng)


def trusted(recording):
    return fit_without_outliers(view_of_positions(recording, NOISE), noise_of_positions(recording), PARAMETERS)


def faults_of(recording):
    return [f.positions for f in trusted(recording).faults]


def without_noise(recording):
    return replace(recording, noise={"accelerometer": SAMPLE})


def test_nothing_is_named_on_clean_recordings():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        recording = measured(draw(rng), rng)
        assert faults_of(recording) == []


@pytest.mark.parametrize(("i", "j"), [(0, 1), (3, 9), (5, 16), (6, 10)])
def test_interchanged_positions_are_named_with_and_without_a_stated_setting_error(clean, i, j):
    swapped = interchanged(clean, i, j)
    assert faults_of(swapped) == [(i + 1, j + 1)]
    assert faults_of(without_noise(swapped)) == [(i + 1, j + 1)]


def test_two_pairs_are_found(clean):
    assert sorted(faults_of(interchanged(interchanged(clean, 3, 9), 5, 16))) == [(4, 10), (6, 17)]


@pytest.mark.parametrize("angle", [20 * ARCSEC, 1e-3, 0.1, np.pi / 4 + 0.01])
def test_a_mis_set_position_is_named_with_its_angle(clean, angle):
    recording = misread(clean, 6, "inner", angle)
    p = trusted(recording)
    fit, (fault,) = p.fit, p.faults
    assert fault.positions == (7,)
    golden_text(fault.in_words)
    said, unit = fault.in_words.split("its force is ")[1].split()[:2]
    # position 7 hangs from the inner gimbal at right angles, so the force turns by the same angle; 4 arcsec of noise
    assert float(said) * {"arcsec": ARCSEC, "deg": np.pi / 180}[unit] == pytest.approx(angle, abs=4 * ARCSEC, rel=6e-3)
    assert is_explained_by_chance(fit.solution.chi2, fit.solution.dof)


@pytest.mark.parametrize(("i", "of"), [(1, 5), (8, 14), (3, 9), (0, 12), (16, 2)])
def test_the_angles_of_another_position_written_down_for_one_are_no_interchange(clean, i, of):
    channels = dict(clean.channels)
    for axis in clean.axes("gimbal_angle"):
        angles = channels["gimbal_angle", axis].copy()
        angles[clean.position == i + 1] = angles[clean.position == of + 1][0]
        channels["gimbal_angle", axis] = angles
    wrong = replace(clean, channels=channels)
    assert faults_of(wrong) == [(i + 1,)]
    assert faults_of(without_noise(wrong)) == [(i + 1,)]


@pytest.mark.parametrize(("pair", "i"), [((9, 11), 5), ((10, 17), 8), ((1, 11), 14), ((2, 16), 7)])
def test_an_interchange_is_found_beside_a_third_position_that_is_wrong(clean, pair, i):
    wrong = misread(interchanged(clean, *pair), i, "middle", np.pi / 5)
    assert sorted(faults_of(wrong)) == sorted([(pair[0] + 1, pair[1] + 1), (i + 1,)])


def test_two_positions_far_off_are_two_faults(clean):
    wrong = misread(misread(clean, 6, "inner", np.pi / 4), 14, "middle", -np.pi / 3)
    assert sorted(faults_of(wrong)) == [(7,), (15,)]


def test_what_is_left_is_the_calibration_without_that_position(clean):
    spoiled = misread(clean, 6, "inner", 1e-3)
    rest = trusted(spoiled)
    fair = clean.select(np.arange(18) != 6)
    fit, expected = rest.fit, trusted(fair).fit
    assert rest.numbers.tolist() == fair.position.tolist()
    np.testing.assert_allclose(fit.solution.x, expected.solution.x, atol=1e-6 * expected.solution.sigma.min())


@pytest.mark.parametrize("effect", ["scale_factor_asymmetry", "cubic_nonlinearity", "cross_coupling", "base_tilt"])
def test_missing_physics_is_no_fault_of_a_position(clean, effect):
    kind = CATALOGUE[effect]
    field = next(f for f in kind.__dataclass_fields__.values() if "sigma" in f.metadata)
    size = np.zeros(len(field.metadata["axes"]))
    size[0] = 3e-4 if effect in ("scale_factor_asymmetry", "base_tilt") else 3e-6
    view, truth = view_of_positions(clean, NOISE), effects(draw(np.random.default_rng(11)))
    more = outputs(view, (*truth, kind(**{field.name: size}))) - outputs(view, truth)
    bent = {**clean.channels, **{("specific_force", a): clean.channels["specific_force", a] + more[:, i]
                                 for i, a in enumerate("xyz")}}  # fmt: skip
    recording = replace(clean, channels=bent)
    p = trusted(recording)
    fit = p.fit
    assert p.faults == ()
    assert not is_explained_by_chance(fit.solution.chi2, fit.solution.dof)


def test_a_repeated_position_is_named_with_its_visit(clean):
    rng = np.random.default_rng(5)
    truth = draw(rng)
    twice = [measured(truth, rng) for _ in range(2)]
    both = replace(
        twice[0],
        time=np.arange(36.0),
        position=np.concatenate([r.position for r in twice]),
        channels={k: np.concatenate([r.channels[k] for r in twice]) for k in twice[0].channels},
        weight=np.concatenate([r.weight for r in twice]),
    )
    assert faults_of(both) == []
    recording = misread(both, 25, "middle", 60 * ARCSEC)
    (fault,) = trusted(recording).faults
    assert fault.visits == (25,)
    golden_text(fault.in_words)


def test_probability_is_the_chi_squared_tail():
    from scipy.stats import chi2

    for dof in (1, 6, 37):
        assert probability(1.7 * dof, dof) == pytest.approx(chi2.sf(1.7 * dof, dof), rel=1e-12)
    assert probability(5.0, 0) == 1.0
