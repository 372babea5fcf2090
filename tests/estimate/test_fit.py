"""One fit of views of different units: each kind has a scale of its noise, and priors and stated rows count as such."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.calibration import Residual
from gimbalcal.earth import G0 as G
from gimbalcal.effects import parameters, with_values
from gimbalcal.effects.accelerometer import Bias, ScaleFactor
from gimbalcal.estimate.fit import fit
from gimbalcal.schedule import EIGHTEEN_POSITIONS
from gimbalcal.views.core import nuisance
from gimbalcal.views.known_attitude import readings, view_of_readings
from gimbalcal.views.noise import NoiseModel
from gimbalcal.views.positions import planned_recording

WANTED = (*parameters(Bias), *parameters(ScaleFactor))
TRUE = np.array([3e-3, -2e-3, 1e-3, 2e-4, -1e-4, 3e-4])  # m/s^2, 1
FORCE, ANGLE = 1e-4, 3e-5  # one sigma of a row, m/s^2 and rad


def forces(rng, sigma, noise=None):
    """Eighteen positions, in each of which three accelerometers err alike but for noise."""
    r = planned_recording(EIGHTEEN_POSITIONS)
    read = readings(r)
    true = with_values((), WANTED, TRUE, r.platform.axis_names)
    read = replace(read, value=read.predicted(true) + sigma * rng.standard_normal(read.value.shape))
    return view_of_readings(read, noise or NoiseModel())


def inclinations(rng, sigma):
    """The same force as angles [rad] with noise of their own."""
    v = forces(rng, G * sigma)
    return replace(
        v,
        measurement=replace(v.measurement, name="inclination"),
        evaluate=lambda effects: v.evaluate(effects).over(np.full(3, G)),
    )


def test_views_of_different_units_have_a_scale_each():
    rng, scales, errors = np.random.default_rng(1), [], []
    for _ in range(20):
        found = fit([forces(rng, FORCE), inclinations(rng, ANGLE)], WANTED)
        scales.append([float(e[0]) for e in found.excesses])
        errors.append((found.x - TRUE) / found.sigmas)
    # 54 rows each, so a variance is good to 21 % in a draw and to 4.6 % in the mean of 20
    np.testing.assert_allclose(np.mean(np.square(scales), axis=0), [FORCE**2, ANGLE**2], rtol=0.15)
    assert 0.85 < np.sqrt(np.mean(np.square(errors))) < 1.15


def test_rows_are_weighed_by_the_scale_of_their_own_kind():
    # angles of 1 ug are worth all, forces of 1 mg nothing: the same fit as of the angles alone
    rng = np.random.default_rng(2)
    good, poor = inclinations(rng, 1e-6), forces(rng, 1e-2)
    both, alone = fit([poor, good], WANTED), fit([good], WANTED)
    np.testing.assert_allclose(both.x, alone.x, atol=1e-2 * float(alone.sigmas.min()))
    np.testing.assert_allclose(both.sigmas, alone.sigmas, rtol=0.1)


def test_rows_of_stated_noise_are_no_degrees_of_freedom_of_the_others():
    rng = np.random.default_rng(3)
    stated = NoiseModel(np.full(3, FORCE), scale_known=True)
    found = [fit([forces(rng, FORCE, stated), inclinations(rng, ANGLE)], WANTED) for _ in range(20)]
    assert all(f.excesses[0] == 0 for f in found)
    np.testing.assert_allclose(np.mean([f.excess**2 for f in found]), ANGLE**2, rtol=0.15)
    np.testing.assert_array_equal(found[0].sigma[0], FORCE)


def test_runs_of_one_kind_share_their_scale():
    # the scatter about the common constants
    rng = np.random.default_rng(4)
    runs = [forces(rng, FORCE) for _ in range(2)]
    found = fit(runs, WANTED)
    assert found.excesses[0] == found.excesses[1]
    left = np.concatenate([r.ravel() for r in found.residual])
    assert found.excess == pytest.approx(np.sqrt((left**2).sum() / (left.size - len(WANTED))), rel=1e-9)


@pytest.mark.parametrize("prior", [1e-9, 1e3])
def test_a_nuisance_takes_as_many_degrees_of_freedom_as_the_rows_tell_of_it(prior):
    # of no prior it is one more constant, of a narrow one it is none
    rng = np.random.default_rng(5)
    v = forces(rng, FORCE)
    N = rng.standard_normal((len(v), 3, 1))
    with_one = replace(v, nuisances=(nuisance("heading", "", "1", prior),),
                       evaluate=lambda effects: replace(v.evaluate(effects), nuisance=N))  # fmt: skip
    found = fit([with_one], WANTED)
    free = found.residual[0].size - len(WANTED) - (1 if prior > 1 else 0)
    assert found.excess == pytest.approx(np.sqrt((found.residual[0] ** 2).sum() / free), rel=1e-6)


def test_what_a_nuisance_takes_up_is_a_null_direction_of_the_calibration():
    v = forces(np.random.default_rng(6), FORCE, NoiseModel(np.full(3, FORCE), scale_known=True))
    N = v.evaluate(()).jacobian(WANTED[:1]) * WANTED[0].sigma
    N = np.concatenate([N, 0 * N], axis=-1)
    flat = (nuisance("heading", "", "1", np.inf), nuisance("idle", "", "1", np.inf))
    turned = replace(v, nuisances=flat, evaluate=lambda effects: replace(v.evaluate(effects), nuisance=N))
    made = fit([turned], WANTED).calibration("test", Residual(0.0, 0, {}))
    (null,) = made.null_directions
    assert null["direction"] == {"bias:x": 1.0}
    assert "heading" in null["why"]
    assert fit([v], WANTED).unobservable == ()
