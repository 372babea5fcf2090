"""Gyroscopes at rest: bias and g-sensitivity come back, the Earth is taken for neither, what is absent is declined."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import parameters
from gimbalcal.effects.gyroscope import GyroBias, GyroGSensitivityRate
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import (
    G_SENSITIVITY,
    fit_rests,
    level_of,
    rests_joined_by_turns,
    view_at_rest,
)
from gimbalcal.forward import gyroscopes
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import apply_matrix
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site

G0, LATITUDE = 9.8, 0.6
UNIT = np.deg2rad(1) / 3600
G = GyroGSensitivityRate(G=UNIT * np.array([5.0, -3.0, 2.0, 1.0, 0.0, -4.0, 2.0, 6.0, -1.0]))
BIAS = GyroBias(epsilon=UNIT * np.array([100.0, -50.0, 20.0]))


def attitudes(g, wander=0.0, seed=0, latitude=LATITUDE):
    """Forty attitudes at random on the turning Earth, 200 samples of 10 deg/h each."""
    rng = np.random.default_rng(seed)
    Q, R = np.linalg.qr(rng.standard_normal((40, 3, 3)))
    Q = Q * np.sign(np.diagonal(R, axis1=1, axis2=2))[:, None, :]  # uniform: the signs of QR are not
    up = apply_matrix(Q, np.array([0.0, 0.0, -1.0]))
    earth = apply_matrix(Q, EARTH_RATE * np.array([np.cos(LATITUDE), 0.0, -np.sin(LATITUDE)]))
    force, rate = (np.repeat(v, 200, axis=0) for v in (G0 * up, earth + wander * rng.standard_normal((40, 3))))
    n = len(rate)
    channels = {("specific_force", a): force[:, i] for i, a in enumerate("xyz")}
    made = Recording("multi-position", "attitudes", BENCH, Site(latitude, 0.0, G0), {}, 0.1 * np.arange(n),
                     np.repeat(np.arange(1, 41), 200), channels)  # fmt: skip
    y = gyroscopes(rate, stimulus_from_readings(made), (BIAS, g)) + 10 * UNIT * rng.standard_normal((n, 3))
    return replace(made, channels=channels | {("angular_rate", a): y[:, i] for i, a in enumerate("xyz")})


def seen(recording):
    return rests_joined_by_turns(recording, multiposition(recording, ("bias",)))


def errors(g, wander, seed):
    fit = fit_rests(seen(attitudes(g, wander, seed)))
    return np.asarray((fit.x - np.concatenate([BIAS.epsilon, g.G])) / np.sqrt(np.diag(fit.covariance)))


@pytest.mark.parametrize("wander", [0.0, 5 * UNIT])
def test_truth_comes_back_within_its_uncertainty(wander):
    # 60 numbers of 5 recordings; the Earth's horizontal rate, up to 12 deg/h, is scatter that the fit must find
    assert 0.7 < np.sqrt(np.mean([errors(G, wander, seed) ** 2 for seed in range(5)])) < 1.4


def test_the_vertical_rate_of_the_earth_is_no_g_sensitivity():
    none = GyroGSensitivityRate(G=np.zeros(9))
    known, unknown = (fit_rests(seen(attitudes(none, latitude=lat))) for lat in (LATITUDE, None))
    diagonal = [3, 7, 11]
    # left in, it is EARTH_RATE sin L / g on the diagonal
    apparent = EARTH_RATE * np.sin(LATITUDE) / G0
    np.testing.assert_allclose(unknown.x[diagonal] - known.x[diagonal], apparent, rtol=1e-6)
    sigma = np.sqrt(np.diag(known.covariance))
    assert np.all(np.abs(known.x[diagonal]) < 4 * sigma[diagonal])


def test_what_is_there_is_taken_up_and_what_is_not_is_declined():
    taken, why = level_of(seen(attitudes(G)), True)
    assert why == ""
    assert {p.effect for p in taken.parameters} == {"gyro_bias", G_SENSITIVITY}
    plain, why = level_of(seen(attitudes(GyroGSensitivityRate(G=np.zeros(9)))), True)
    assert plain.parameters == parameters(GyroBias)
    assert why.startswith("gyro_g_sensitivity_rate is left out: from these 40 rests its largest coefficient is")
    assert level_of(seen(attitudes(G)), False)[0].parameters == parameters(GyroBias)


def test_without_a_latitude_the_common_part_is_uncertain_by_the_earth():
    taken, _ = level_of(seen(attitudes(G, latitude=None)), True)
    sigma = np.sqrt(np.diag(taken.covariance))
    assert np.all(sigma[[3, 7, 11]] > EARTH_RATE / np.sqrt(3) / G0)
    assert np.all(sigma[[4, 5, 6]] < EARTH_RATE / np.sqrt(3) / G0)


def test_an_unknown_vertical_rate_is_eliminated_in_the_scatter_of_the_dwells():
    recording = attitudes(G, wander=20 * UNIT, latitude=None)
    still = seen(recording)
    found = fit_rests(still)
    cleared = still.without_nuisances(found.sigma[0])
    rows, sigma = cleared.evaluate(()), found.sigma[0]
    J, r = rows.jacobian(found.parameters) / sigma[..., None], rows.residual / sigma
    x = np.linalg.lstsq(J.reshape(-1, len(found.x)), r.ravel(), rcond=None)[0]
    np.testing.assert_allclose(x, found.x, atol=1e-3 * found.sigmas.min())
    scatter = fit_rests(still, still.baseline).sigma[0]
    diagnosed = view_at_rest(recording)
    np.testing.assert_allclose(
        diagnosed.evaluate(()).residual, still.without_nuisances(scatter).evaluate(()).residual, atol=1e-9 * UNIT
    )
