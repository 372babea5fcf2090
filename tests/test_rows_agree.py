"""One set of rows and four ways to them agree: fit of positions, static run, diagnosis, forward model."""

import numpy as np

from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.estimate.static_run.system import static_readings
from gimbalcal.forward import jacobian, predict
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.pipeline import load
from gimbalcal.recording import dwell_means
from gimbalcal.views.known_attitude import view_at_known_attitude
from gimbalcal.views.positions import Noise, by_visit, view_of_positions
from tests.paths import DEVICE, STATIC

ROUNDING = 1e-12  # of the largest: products of the same numbers in another order


def same(one, other):
    np.testing.assert_allclose(one, other, rtol=0, atol=ROUNDING * np.abs(other).max())


def test_positions():
    (recording,) = load([DEVICE])
    means = dwell_means(recording)
    o = fit_baseline(view_at_known_attitude(means), steps=0)
    view = view_of_positions(means, Noise(1e-4, 5e-6), [q.effect for q in o.parameters])
    mine = by_visit(view, (), o.parameters, np.zeros(len(o.parameters)))
    scale = np.array([q.sigma for q in o.parameters])
    s = stimulus_from_readings(means)
    J = jacobian(means.platform, s, (), o.parameters)["specific_force"]
    same(mine.J, J)
    same(o.Z * o.sigma[:, None] / scale, J)
    same(o.residual * o.sigma, means.triad("specific_force") - predict(means.platform, s, ())["specific_force"])
    same(mine.r, o.residual * o.sigma)


def test_static_run():
    (recording,) = load([STATIC])
    run = static_readings(recording)
    o = fit_baseline(view_at_known_attitude(recording), steps=0)
    scale = np.array([q.sigma for q in o.parameters])
    assert run.channels == o.view.channels
    same(run.residual(), o.residual * o.sigma)
    same(run.rows().jacobian(o.parameters), o.Z * o.sigma[:, None] / scale)
    by_quantity = jacobian(recording.platform, run.stimulus, (), o.parameters, "static-run")
    forces = run.columns("specific_force")
    same(run.rows().jacobian(o.parameters)[:, forces], by_quantity["specific_force"])
