"""A fleet: spread of a parameter over its units, units outside it, and what it is worth as a prior."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.calibration.calibration import from_dict
from gimbalcal.calibration.gravity_uncertainty import scale_factor_direction
from gimbalcal.effects import values
from gimbalcal.errors import InputError
from gimbalcal.history import DatedCalibration, StoredResult, keep
from gimbalcal.history.fleet import (
    MIN_UNITS,
    fleet,
    fleet_of_store,
    own_estimate,
    posterior_of_spread,
    rests_on_fleet,
    tail_of_others,
    with_fleet,
)
from gimbalcal.inference.information import Unobservable
from gimbalcal.methods import calibrate
from tests.fleet.units import SPREAD, unit
from tests.history.calibrations import LABELS, SIGMA, START, WANTED, calibration


def units(seed, count, spread=5.0):
    """Calibrations whose true values (6,) have this spread about 100, all in sigmas of one calibration."""
    rng = np.random.default_rng(seed)
    x = 100 + np.hypot(spread, 1.0) * rng.standard_normal((count, len(WANTED)))
    return {f"u{k}": DatedCalibration(f"u{k}", START, calibration(x[k], k)) for k in range(count)}


@pytest.mark.parametrize("spread", [0.0, 0.3, 3.0])
def test_a_further_unit_lies_in_the_distribution_as_often_as_it_says(spread):
    """Tails of all but one unit are uniform over many fleets, whether the spread shows beneath the sigmas or not."""
    rng = np.random.default_rng(1)
    tails = []
    for _ in range(400):
        sigma = rng.uniform(0.5, 2.0, 12)
        x = 7 + np.hypot(spread, sigma) * rng.standard_normal(12)
        tails.append(tail_of_others(x, sigma, np.ones(12, dtype=bool)))
    rate = np.mean(np.concatenate(tails) < 0.05)
    assert 0.02 < rate < 0.06  # a spread that does not show is not taken for zero, so it is rather too small


def test_the_spread_is_found_and_few_units_leave_it_wide():
    rng = np.random.default_rng(2)
    x, sigma = 3 + 2 * rng.standard_normal(400), np.full(400, 0.5)
    posterior, _, _, tau = posterior_of_spread(x, sigma)
    assert posterior @ tau == pytest.approx(np.sqrt(x.var() - 0.25), rel=0.02)
    few, _, _, tau = posterior_of_spread(x[:5], sigma[:5])
    assert np.sqrt(few @ tau**2) > 1.5 * x[:5].std()
    alike, _, _, tau = posterior_of_spread(np.full(5, 3.0), sigma[:5])
    assert alike @ tau > 0.05  # equal values do not show that the units are equal


def test_units_outside_are_named_and_take_no_part():
    made = units(3, 40)
    for name in ("u7", "u9"):
        odd = values(made[name].calibration.effects, WANTED) / SIGMA + 60 * np.eye(len(WANTED))[2]
        made[name] = replace(made[name], calibration=calibration(odd, 7))
    found = fleet(made).distributions
    outside = {(label, d.units[i]) for label, d in found.items() for i in np.flatnonzero(~d.inside)}
    assert outside == {(LABELS[2], "u7"), (LABELS[2], "u9")}
    assert found[LABELS[2]].spread == pytest.approx(5 * SIGMA[2], rel=0.3)
    assert found[LABELS[2]].mean == pytest.approx(100 * SIGMA[2], abs=3 * SIGMA[2])


def test_where_more_than_a_quarter_lie_elsewhere_they_are_no_exceptions():
    """Eight of twenty at ever larger distances, of which each is far off those before it."""
    made = units(4, 20, spread=0.5)
    for k in range(8):
        made[f"u{k}"] = replace(made[f"u{k}"], calibration=calibration(100 + np.full(6, 30.0 * 4**k), k))
    assert all(d.inside.all() for d in fleet(made).distributions.values())


def test_the_spread_is_integrated_over_with_the_mean():
    """Expectations by sums over a plain grid of mean and spread."""
    x, sigma = np.array([1.0, 2.5, 0.3, 4.0, 2.2]), np.array([0.5, 0.8, 0.4, 1.0, 0.6])
    posterior, mean, variance, tau = posterior_of_spread(x, sigma)
    mu, spread = np.meshgrid(np.linspace(-30, 34, 1601), np.linspace(0, 60, 3001))
    log = np.zeros_like(mu)
    for value, own in zip(x, sigma, strict=True):
        log -= np.log(spread**2 + own**2) / 2 + (value - mu) ** 2 / 2 / (spread**2 + own**2)
    density = np.exp(log - log.max())
    expected = [float((density * f).sum() / density.sum()) for f in (mu, spread, (mu - 2) ** 2)]
    assert posterior @ mean == pytest.approx(expected[0], abs=0.01)
    assert posterior @ tau == pytest.approx(expected[1], rel=0.02)
    assert posterior @ (variance + (mean - 2) ** 2) == pytest.approx(expected[2], rel=0.05)


def test_the_prior_is_that_of_the_joint_normal_distribution():
    """Along a null direction the fleet says all; elsewhere both count by their information."""
    known = fleet(units(5, 30))
    c = calibration(np.full(6, 101.0))
    scale = np.array([p.sigma for p in WANTED])
    v = np.array([1.0, 0, 0, 1.0, 0, 0]) / np.sqrt(2)  # bias and scale factor of x together
    keep_others = np.eye(6) - np.outer(v, v)
    C = keep_others @ (c.covariance / np.outer(scale, scale)) @ keep_others + np.outer(v, v)
    x = scale * (keep_others @ (values(c.effects, WANTED) / scale))
    unseen = (Unobservable({LABELS[0]: 1.0, LABELS[3]: 1.0}, "made so"),)
    c = replace(calibration(x / SIGMA), covariance=C * np.outer(scale, scale), unobservable=unseen)
    found = with_fleet(c, known)
    mean = np.array([known.distributions[label].mean for label in LABELS])
    size = np.array([known.distributions[label].sigma for label in LABELS])
    W = np.linalg.svd(keep_others)[0][:, :5].T / scale  # five rows that the data determine
    R = W @ c.covariance @ W.T
    gain = np.diag(size**2) @ W.T @ np.linalg.inv(W @ np.diag(size**2) @ W.T + R)
    assert found.values == pytest.approx(mean + gain @ (W @ (c.values - mean)), rel=1e-6)
    P = np.diag(size**2) - gain @ W @ np.diag(size**2)
    assert np.diag(found.covariance) == pytest.approx(np.diag(P), rel=1e-4)  # the rank-one part of R is not exact
    assert rests_on_fleet(found)
    assert [p.sigma for p in found.parameters] == pytest.approx(size)


def test_an_unusual_parameter_keeps_its_own_estimate_and_is_named():
    known = fleet(units(6, 30))
    x = np.full(6, 100.0)
    x[1] += 50
    found = with_fleet(calibration(x), known)
    assert "unusual for the fleet" in found.outcome
    assert "bias y is" in found.outcome
    assert found.values[1] == pytest.approx(150 * SIGMA[1], rel=0.02)
    assert not with_fleet(calibration(np.full(6, 101.0)), known).outcome


def test_no_number_of_units_averages_the_error_of_gravity_away():
    gravity = 5e-4

    def at_a_site(c):
        u = scale_factor_direction(c)
        origin = c.provenance.with_options(gravity=9.8, gravity_sigma_ppm=1e6 * gravity)
        return replace(c, covariance=c.covariance + gravity**2 * np.outer(u, u), provenance=origin)

    made = {name: replace(d, calibration=at_a_site(d.calibration)) for name, d in units(7, 50).items()}
    found = with_fleet(at_a_site(calibration(np.full(6, 100.0))), fleet(made))
    assert np.all(found.sigmas[3:] > gravity)


def test_a_store_is_a_fleet_of_units_that_speak_for_themselves(tmp_path):
    store = tmp_path / "units.sqlite"
    made = units(8, 8)
    for name, d in list(made.items())[: MIN_UNITS - 1]:
        keep(store, StoredResult(name, d.date.isoformat(), "calibration", d.calibration.to_dict()))
    with pytest.raises(InputError, match="holds calibrations of 4 units, and a fleet takes 5 or more"):
        fleet_of_store(store)
    for name, d in made.items():
        keep(store, StoredResult(name, d.date.isoformat(), "calibration", d.calibration.to_dict()))
    known = fleet_of_store(store)
    assert known.units == 8
    for name, own in (("pulled", calibration(np.full(6, 100.0))), ("u3", made["u3"].calibration)):
        pulled = with_fleet(own, known)
        assert rests_on_fleet(pulled)
        pulled = replace(pulled, provenance=replace(pulled.provenance, created="2030-01-01T00:00:00+00:00"))
        keep(store, StoredResult(name, START.isoformat(), "calibration", pulled.to_dict()))
        assert fleet_of_store(store).identity == known.identity  # also of a unit that is in the fleet


def test_a_unit_is_not_its_own_prior():
    made = units(9, MIN_UNITS + 1)
    known, others = fleet(made), fleet({name: d for name, d in made.items() if name != "u2"})
    own = made["u2"].calibration
    recording = replace(unit(0)[0], source=own.provenance.recordings)
    found, expected = with_fleet(own, known, [recording]), with_fleet(own, others)
    assert found.values == pytest.approx(expected.values, rel=1e-9)
    assert found.sigmas == pytest.approx(expected.sigmas, rel=1e-9)
    assert known.without([recording]).units == MIN_UNITS
    assert with_fleet(own, others, [replace(recording, source=made["u1"].calibration.provenance.recordings)]) is own


def test_a_unit_that_is_unusual_in_every_parameter_takes_nothing_from_the_fleet():
    own = calibration(np.full(6, 1000.0))
    alone = with_fleet(own, fleet(units(6, 30)))
    assert not rests_on_fleet(alone)
    assert "unusual for the fleet" in alone.outcome
    assert np.array_equal(alone.values, own.values)
    assert np.array_equal(alone.covariance, own.covariance)


@pytest.fixture(scope="module")
def eighteen():
    """Twenty units in all 18 positions."""
    return fleet({f"u{k}": DatedCalibration(f"u{k}", START, calibrate([unit(k)[0]])[0]) for k in range(20)})


@pytest.mark.parametrize(("positions", "least"), [(6, 1.4), (12, 1.1)])
def test_a_unit_of_the_fleet_needs_fewer_positions(eighteen, positions, least):
    """Sigmas shrink, and the errors with them: they stay as large as their sigmas."""
    gain, z = [], []
    for k in range(100, 108):
        recording, effects = unit(k, positions)
        alone, _ = calibrate([recording])
        together, _ = calibrate([recording], grade=eighteen)
        gain.append(alone.sigmas / together.sigmas)
        z.append((together.values - values(effects, together.parameters)) / together.sigmas)
        assert not together.outcome
    assert np.exp(np.mean(np.log(gain))) > least
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.2


def test_the_spread_of_simulated_units_is_the_drawn_one(eighteen):
    ratio = [d.spread / d.parameter.sigma / SPREAD for d in eighteen.distributions.values()]
    assert 0.9 < np.sqrt(np.mean(np.square(ratio))) < 1.15  # 15 parameters of 20 units: 4 % in the rms
    assert all(d.inside.all() for d in eighteen.distributions.values())


def test_the_prior_is_taken_out_again():
    """Also after a calibration went through its file."""
    given = calibrate([unit(2000, 6)[0]])[0]
    members = {str(k): DatedCalibration(str(k), START, calibrate([unit(k)[0]])[0]) for k in range(MIN_UNITS)}
    graded = with_fleet(given, fleet(members, "units"))
    own = own_estimate(from_dict(json.loads(json.dumps(graded.to_dict()))))
    assert rests_on_fleet(graded)
    assert not rests_on_fleet(own)
    assert np.allclose(own.values, given.values, rtol=1e-9)
    assert np.allclose(own.sigmas, given.sigmas, rtol=1e-9)
    assert np.any(np.abs(graded.values - given.values) > 0.1 * given.sigmas)
