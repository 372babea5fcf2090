"""Square-root information: fusion, estimate, and the names of what was not seen."""

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.forward import jacobian
from gimbalcal.inference.information import information, name_directions, solve
from gimbalcal.platform import SPACE_STABLE
from tests.golden import golden_text
from tests.stimuli import eighteen

TRIADS = parameters(CATALOGUE["scale_factor"]) + parameters(CATALOGUE["bias"])
SIGMAS = np.array([p.sigma for p in TRIADS])


def test_equals_weighted_least_squares_where_everything_is_seen():
    rng = np.random.default_rng(2)
    J, r = rng.normal(size=(40, 6)) * 30 / SIGMAS, rng.normal(size=40)
    s = solve(information(J, r, TRIADS))
    np.testing.assert_allclose(s.x, np.linalg.lstsq(J, r, rcond=None)[0], rtol=1e-10)
    np.testing.assert_allclose(s.covariance, np.linalg.inv(J.T @ J), rtol=1e-9)
    assert s.dof == 34
    assert s.chi2 == pytest.approx(np.sum((r - J @ s.x) ** 2))
    assert s.unobservable == ()


def test_stages_add_in_any_order_and_over_different_parameters():
    rng = np.random.default_rng(3)
    J, r = rng.normal(size=(60, 6)) * 30 / SIGMAS, rng.normal(size=60)
    J[:20, 3:] = 0
    first = information(J[:20, :3], r[:20], TRIADS[:3])
    second = information(J[20:], r[20:], TRIADS)
    whole = solve(information(J, r, TRIADS))
    for together in (solve(first + second), solve(second + first)):
        np.testing.assert_allclose(together.x, whole.x, rtol=1e-9)
        np.testing.assert_allclose(together.covariance, whole.covariance, rtol=1e-9)
        assert together.dof == whole.dof
        assert together.chi2 == pytest.approx(whole.chi2)


def test_what_18_positions_cannot_see_is_the_platform_zero_against_the_triad_turned_about_z():
    s = eighteen()
    ids = ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero")
    wanted = [p for i in ids for p in parameters(CATALOGUE[i], s.axis_names) if p.axis != "outer"]
    J = jacobian(SPACE_STABLE, s, (), wanted)["specific_force"] / 1e-5
    found = solve(information(J, np.zeros(54), wanted))
    assert len(wanted) == 18
    assert len(found.unobservable) == 1
    direction = found.unobservable[0].direction
    assert set(direction) == {"gimbal_zero:platform", "misalignment:xz", "misalignment:yz"}
    # turning the platform readout by +d about z is undone by turning both input axes by -d
    ratio = direction["misalignment:xz"] / direction["gimbal_zero:platform"]
    assert ratio == pytest.approx(-1, abs=1e-5)
    assert direction["misalignment:yz"] == pytest.approx(direction["misalignment:xz"], abs=1e-5)
    golden_text(found.unobservable[0].why)


def test_an_unobservable_direction_keeps_the_prior_and_says_so():
    J = np.zeros((10, 6))
    J[:, 0] = 1 / SIGMAS[0] * 100
    J[:, 1] = J[:, 2] = 1 / SIGMAS[1] * 100
    s = solve(information(J, np.ones(10), TRIADS))
    names = {tuple(u.direction) for u in s.unobservable}
    assert ("scale_factor:y", "scale_factor:z") in names
    assert ("bias:x",) in names
    assert s.sigma[3] == pytest.approx(SIGMAS[3])
    assert s.x[3] == 0
    assert s.x[1] == pytest.approx(s.x[2])  # smallest prior-scaled norm among equals


def test_named_directions_depend_on_the_space_and_not_on_the_vectors_that_span_it():
    """The vectors of equal singular values, and their signs, differ from processor to processor."""
    wanted = parameters(CATALOGUE["bias"]) + parameters(CATALOGUE["misalignment"])
    spanned = np.array([[1, 0, 0, 0, 1, 0, 0, 0, 0], [0, 1, 0, 0, 0, -1, 0, 0, 0], [0, 0, 1, 1, 0, 0, 0.5, 0, 0.0]]).T
    rng = np.random.default_rng(0)
    named = []
    for _ in range(5):
        null = np.linalg.qr(spanned @ rng.standard_normal((3, 3)))[0]
        named.append([u.direction for u in name_directions(null, wanted, np.zeros((1, 9)))])
    assert all(other == named[0] for other in named)
    assert sorted(len(direction) for direction in named[0]) == [2, 2, 3]
