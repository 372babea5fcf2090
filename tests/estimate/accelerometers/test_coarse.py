"""Coarse calibration: closed form on the faces, honest sigmas, missing faces, and the levelling loop."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.effects import values
from gimbalcal.estimate.accelerometers.coarse import NEGLIGIBLE_ZERO_RAD, coarse, relevel
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions
from gimbalcal.schedule import EIGHTEEN_POSITIONS, FACE_POSITIONS
from tests.estimate.device import ARCSEC, PARAMETERS, SITE, draw, interchanged, measured
from tests.golden import golden_text

KEPT = [i for i, q in enumerate(PARAMETERS) if q.effect != "scale_nonlinearity"]
NO_K = np.array([float(q.effect != "scale_nonlinearity") for q in PARAMETERS])
ZEROS = [[q.label for q in PARAMETERS].index(f"gimbal_zero:{axis}") for axis in ("inner", "middle")]


def quiet(truth):
    """Readings without noise that state some."""
    recording = measured(truth, np.random.default_rng(0), setting=0.0, samples=10**12)
    return replace(recording, noise={"accelerometer": 2e-4, "gimbal_angle": ARCSEC}, weight=np.full(18, 120.0))


def test_without_noise_and_nonlinearity_it_returns_the_truth():
    truth = draw(np.random.default_rng(1)) * NO_K
    c = coarse(trusted_positions(quiet(truth)))
    known = [PARAMETERS[i].label for i in KEPT]
    assert [q.label for q in c.parameters] == known
    null = np.array([float(label in c.unobservable[0]["direction"]) for label in known])
    null[known.index("gimbal_zero:platform")] *= -1
    off = c.values - truth[KEPT]
    off -= null * (null @ off) / (null @ null)
    # 2e-10 m/s^2 of noise in the simulated readings
    np.testing.assert_allclose(off / c.sigmas, 0, atol=1e-4)


def test_faces_alone_give_scale_factor_and_bias_by_the_printed_formula():
    rng = np.random.default_rng(2)
    recording = measured(draw(rng), rng)
    c = coarse(trusted_positions(recording))
    position = recording.position
    up, down = {"x": (11, 5), "y": (9, 3), "z": (7, 1)}, SITE.gravity
    assert sorted(sum(up.values(), ())) == sorted(FACE_POSITIONS)
    found = dict(zip([q.label for q in c.parameters], c.values, strict=True))
    for axis, pair in up.items():
        f = recording.channels["specific_force", axis]
        one, other = (float(f[position == n][0]) for n in pair)
        high, low = max(one, other), min(one, other)
        # cosines of the tilts leave 1e-8 of g; so do the misalignments' products
        assert found[f"scale_factor:{axis}"] == pytest.approx(2 * down / (high - low) - 1, abs=2e-7)
        assert found[f"bias:{axis}"] == pytest.approx((high + low) / 2, abs=2e-6)


def test_stated_sigma_holds_with_a_nonlinearity_of_prior_size():
    runs, squares = 40, []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        truth = draw(rng)
        K = [i for i, q in enumerate(PARAMETERS) if q.effect == "scale_nonlinearity"]
        truth[K] = [PARAMETERS[i].sigma for i in K] * rng.normal(size=3)
        c = coarse(trusted_positions(measured(truth, rng)))
        scale = np.array([q.sigma for q in c.parameters])
        D, V = np.linalg.eigh(c.covariance / np.outer(scale, scale))
        seen = D < 1 - 1e-6
        squares.append(((V[:, seen].T @ ((c.values - truth[KEPT]) / scale)) ** 2 / D[seen]).mean())
    # 14 directions and 40 runs: 6 % a sigma
    assert np.mean(squares) == pytest.approx(1, abs=4 * np.sqrt(2 / (14 * runs)))


@pytest.mark.parametrize("missing", [[5], [1, 3], [7, 9, 11]])
def test_a_missing_face_is_said_and_costs_only_accuracy(missing):
    rng = np.random.default_rng(3)
    truth = draw(rng)
    recording = measured(truth, rng)
    c = coarse(trusted_positions(recording.select(~np.isin(recording.position, missing))))
    assert "lacks a face" in c.provenance["notes"][0]
    assert "missing" in c.provenance["lost"]
    assert len(c.unobservable) == 1
    assert np.all(np.abs(c.values - truth[KEPT])[:6] < 5 * c.sigmas[:6])


def test_interchanged_positions_do_not_spoil_it():
    rng = np.random.default_rng(4)
    truth = draw(rng)
    c = coarse(trusted_positions(interchanged(measured(truth, rng), 3, 9)))
    golden_text(c.outcome)
    assert np.all(np.abs(c.values - truth[KEPT])[:6] < 5 * c.sigmas[:6])


def test_levelling_turns_the_platform_until_its_zeros_are_negligible():
    rng = np.random.default_rng(5)
    truth = draw(rng)
    truth[ZEROS] = np.deg2rad([0.8, -0.5])  # far from level at first
    asked = []

    def measure(readouts):
        asked.append(readouts)
        recording = measured(truth, np.random.default_rng(50), setting=0.0, readouts=readouts, samples=10**6)
        return trusted_positions(recording)

    levelled = relevel(measure, EIGHTEEN_POSITIONS.angles)
    assert len(asked) == len(levelled.leftover) <= 4
    assert np.abs(levelled.leftover[0]).max() == pytest.approx(np.deg2rad(0.8), rel=0.01)
    assert np.abs(levelled.leftover[-1]).max() < NEGLIGIBLE_ZERO_RAD
    # the platform now stands where the schedule wants it: readout + zero = angle, but for what K does (4 arcsec)
    stands = asked[-1][:, 1:3] + truth[ZEROS]
    np.testing.assert_allclose(stands, EIGHTEEN_POSITIONS.angles[:, 1:3], atol=6 * ARCSEC)
    np.testing.assert_allclose(values(levelled.calibration.effects, [PARAMETERS[i] for i in ZEROS]), truth[ZEROS],
                               atol=6 * ARCSEC)  # fmt: skip


def test_a_recorded_set_is_levelled_numerically():
    truth = draw(np.random.default_rng(6)) * NO_K
    truth[ZEROS] = np.deg2rad([0.8, -0.5])
    c = coarse(trusted_positions(quiet(truth)))
    found = values(c.effects, [PARAMETERS[i] for i in ZEROS])
    np.testing.assert_allclose(found, truth[ZEROS], atol=1e-3 * ARCSEC)
