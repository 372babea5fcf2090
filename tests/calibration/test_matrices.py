"""T, K and b of a triad against the correction of the package and against the cost function of imu_tk."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import gimbalcal
from gimbalcal.calibration import Calibration, Counts, Readout, Residual
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.number import Array
from tests.paths import XSENS

ACCELEROMETERS = ("bias", "scale_factor", "misalignment")
GYROSCOPES = ("gyro_bias", "gyro_scale_factor", "gyro_misalignment")


def made_of(ids, size=30.0, readout=Readout()):  # noqa: B008
    wanted = tuple(p for i in ids for p in parameters(CATALOGUE[i]))
    x = np.array([p.sigma for p in wanted]) * np.random.default_rng(3).uniform(-size, size, len(wanted))
    n = len(wanted)
    return Calibration("test", with_values((), wanted, x), wanted, np.eye(n), (), Residual(0.0, 0, {}), readout=readout)


def test_matrices_correct_as_the_calibration_does():
    counts = Counts((0.002, -0.0021, 0.0019), (33000.0, 32900.0, 100.0))
    c = made_of((*ACCELEROMETERS, *GYROSCOPES), readout=Readout(accelerometers=counts))
    rng = np.random.default_rng(1)
    readings: dict[str, Array] = {
        "specific_force": rng.uniform(25000, 40000, (8, 3)),
        "angular_rate": rng.normal(size=(8, 3)),
    }
    there = c.apply(readings, units={"specific_force": "count", "angular_rate": "rad/s"})
    for triad, quantity in (("accelerometers", "specific_force"), ("gyroscopes", "angular_rate")):
        m = c.matrices[triad]
        x = (m.T * m.K) @ (readings[quantity] - m.b)[..., None]
        np.testing.assert_allclose(x[..., 0], there[quantity], rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(np.diag(m.T), 1.0)
    assert c.to_dict()["matrices"]["accelerometers"]["b"] == c.matrices["accelerometers"].b.tolist()


def test_a_triad_without_its_linear_terms_has_none():
    assert made_of(ACCELEROMETERS[:2]).matrices == {}
    assert list(made_of(GYROSCOPES).matrices) == ["gyroscopes"]
    assert list(made_of(("bias", "gimbal_zero")).matrices) == []


def test_the_norm_alone_gives_what_imu_tk_minimises():
    """g^2 - |T K (X - B)|^2 over nine numbers, T upper triangular: the cost of imu_tk on the same means."""
    recording = gimbalcal.read(XSENS)
    c = gimbalcal.calibrate(recording)
    m, X, g = c.matrices["accelerometers"], recording.triad("specific_force"), recording.site.gravity

    def cost(v):
        T = np.array([[1, -v[0], v[1]], [0, 1, -v[2]], [0, 0, 1]])
        return np.asarray(g**2 - (((T * (v[3:6] / 400)) @ (X - 1e4 * v[6:]).T) ** 2).sum(axis=0))

    fitted = least_squares(cost, [0, 0, 0, 1, 1, 1, 3.3, 3.3, 3.3], xtol=1e-14, ftol=1e-14).x
    own = [-m.T[0, 1], m.T[0, 2], -m.T[1, 2], *(400 * m.K), *(m.b / 1e4)]
    sigma = np.sqrt(np.diag(np.linalg.inv(_gram(cost, fitted))) * (cost(fitted) ** 2).sum() / (len(X) - 9))
    assert np.abs((np.array(own) - fitted) / sigma).max() < 0.3  # unweighted there, weighted by the dwells here
    np.testing.assert_array_equal(np.tril(m.T, -1), 0.0)
    norm = np.linalg.norm((m.T * m.K) @ (X - m.b).T, axis=0)
    np.testing.assert_allclose(norm, np.linalg.norm(c.apply(recording).triad("specific_force"), axis=1), rtol=1e-9)


def _gram(cost, x):
    J = np.array([(cost(x + h) - cost(x - h)) / 2e-6 for h in 1e-6 * np.eye(len(x))])
    return np.asarray(J @ J.T)


@pytest.mark.parametrize(("size", "unit"), [(300.0, "arcsec"), (4400.0, "mrad"), (36000.0, "deg")])
def test_misalignments_are_printed_in_one_unit_of_their_size(size, unit):
    wanted = parameters(CATALOGUE["misalignment"])
    x = np.array([size, 1.0, 0, 0, 0, 0]) * np.pi / 648000
    c = Calibration("test", with_values((), wanted, x), wanted, np.eye(6), (), Residual(0.0, 0, {}))
    assert {p.unit for p in c.in_printed_units.parameters} == {unit}
    np.testing.assert_allclose(c.in_printed_units.values, c.values)
    assert {row["unit"] for row in c.to_dict()["parameters"]} == {"arcsec"}
