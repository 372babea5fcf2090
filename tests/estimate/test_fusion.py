"""Fusion: one stage supplies what the other cannot see, nothing is seen that neither sees, contradiction is told."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.effects import CATALOGUE, parameters, values, with_values
from gimbalcal.estimate.static_run.system import fuse_stages
from gimbalcal.forward import jacobian, predict
from gimbalcal.inference.information import information, solve
from gimbalcal.platform import SPACE_STABLE, SPACE_STABLE_INERTIAL
from tests.estimate.static_runs import ARCSEC, run, static_information
from tests.golden import golden_text
from tests.stimuli import eighteen

SENSORS = ("scale_factor", "bias", "scale_nonlinearity", "misalignment")
NAMES = SPACE_STABLE.axis_names


def eighteen_coefficients():
    wanted = [p for i in (*SENSORS, "gimbal_zero") for p in parameters(CATALOGUE[i], NAMES)]
    return tuple(p for p in wanted if p.axis != "outer")


def truth(seed):
    """Eighteen coefficients in the sense of Table 1."""
    wanted = eighteen_coefficients()
    x = np.random.default_rng(seed).normal(size=len(wanted)) * [0.3 * p.sigma for p in wanted]
    return with_values((), wanted, x, NAMES)


def device(effects, rng, sigma=1e-5):
    """Eighteen positions at exact angles, white noise of each position's mean."""
    s, wanted = eighteen(), eighteen_coefficients()
    J = jacobian(SPACE_STABLE, s, effects, wanted)["specific_force"]
    y = predict(SPACE_STABLE, s, effects)["specific_force"]
    y = y + (rng.normal(size=y.shape) * sigma if rng is not None else 0.0)
    r = y - predict(SPACE_STABLE, s, effects)["specific_force"] + J @ values(effects, wanted)
    return information(J / sigma, r / sigma, wanted)


def before(info):
    s = solve(info)
    residual = Residual(s.chi2, s.dof, {"specific_force:x": 1e-5})
    return Calibration("joint", with_values((), s.parameters, s.x, NAMES), s.parameters, s.covariance, (), residual)


def sigma_of(c, direction):
    w = np.array([direction.get(p.label, 0.0) for p in c.parameters])
    return float(np.sqrt(w @ c.covariance @ w))


def fused_levels(device, level, first):
    return fuse_stages(first, solve(device + level), solve(device), solve(level))


def fused(seed, noisy=True):
    rng = np.random.default_rng(seed + 100) if noisy else None
    true = truth(seed)
    d = device(true, rng)
    recording = run(true, rng)
    first = before(d)
    return first, fused_levels(d, static_information(recording, true), first), true


def test_the_stage_says_what_the_static_run_gains():
    first, both, _ = fused(0)
    own = dict(zip((p.label for p in first.parameters), first.sigmas, strict=True))
    gain = [own[p.label] / s for p, s in zip(both.parameters, both.sigmas, strict=True) if p.label in own]
    smaller = f"sigma of {sum(g > 1 / 0.9 for g in gain)} of {len(gain)} parameters smaller by more than a tenth"
    assert f"{smaller}, the best by a factor of {max(gain):.1f};" in both.stages[0].in_words


def test_readouts_of_platform_and_outer_gimbal_run_the_other_way():
    assert SPACE_STABLE.sense == (1, 1, 1, 1)
    assert SPACE_STABLE_INERTIAL.sense == (-1, 1, 1, -1)
    angles, sign = np.array([0.3, 0.1, -0.2, 0.7]), np.array(SPACE_STABLE_INERTIAL.sense)
    offset = np.array([0.0, 0.0, np.pi / 2, 0.0])
    np.testing.assert_allclose(
        SPACE_STABLE.attitude(angles), SPACE_STABLE_INERTIAL.attitude(sign * (angles - offset)), atol=1e-15
    )


def test_fusion_is_within_its_claims_and_no_worse_than_either():
    runs, nees, size = 12, 0.0, 0
    for seed in range(runs):
        first, both, true = fused(seed)
        assert both.outcome == ""
        old = dict(zip(first.parameters, first.sigmas, strict=True))
        assert all(s <= old[p] * (1 + 1e-6) for p, s in zip(both.parameters, both.sigmas, strict=True) if p in old)
        e = both.values - values(true, both.parameters)
        common = [i for i, p in enumerate(both.parameters) if p.effect in SENSORS and p.axis not in ("xz", "yz")]
        C = both.covariance[np.ix_(common, common)]
        nees, size = nees + e[common] @ np.linalg.solve(C, e[common]), size + len(common)
    from scipy.stats import chi2

    assert chi2.ppf(0.0005, size) < nees < chi2.ppf(0.9995, size)


def test_the_static_run_sharpens_what_the_positions_know_less_well():
    first, both, _ = fused(3)
    difference = {"scale_factor:x": 0.5, "scale_factor:y": -0.5}
    assert sigma_of(both, difference) < 0.6 * sigma_of(first, difference)
    square = {"misalignment:yz": 0.5, "misalignment:xz": -0.5}
    assert sigma_of(both, square) < 0.6 * sigma_of(first, square)
    # and the positions supply what the run is blind to
    assert sigma_of(both, {"bias:x": 1.0}) <= sigma_of(first, {"bias:x": 1.0})
    assert "sigma of" in both.stages[0].in_words


def test_what_neither_sees_is_named_and_only_with_the_right_sense_of_the_zeros():
    true = truth(4)
    d = device(true, None)
    recording = run(true)
    level = static_information(recording, true)
    # a base known to be level and north: the static run then sees the platform zero against the triad's turn
    tilt = tuple(p for p in level.parameters if p.effect == "base_tilt")
    level = level + information(np.eye(3) / (0.01 * ARCSEC), np.zeros(3), tilt)
    triad = {"gimbal_zero:platform", "misalignment:xz", "misalignment:yz"}
    right = solve(d + level).unobservable
    assert any(triad <= set(u.direction) for u in right)
    other_way = [-1 if p.label == "gimbal_zero:platform" else 1 for p in level.parameters]
    wrong = solve(d + replace(level, rows=level.rows * np.array([*other_way, 1]))).unobservable
    assert not any(triad <= set(u.direction) for u in wrong)  # it would claim to see what no data show


def test_contradicting_stages_are_told():
    true = truth(5)
    rng = np.random.default_rng(6)
    d = device(true, rng)
    x = values(true, eighteen_coefficients())
    x[0] += 20e-6  # the scale factor of x moved by 20 ppm between the stages
    moved = with_values((), eighteen_coefficients(), x, NAMES)
    both = fused_levels(d, static_information(run(moved, rng), moved), before(d))
    golden_text(both.outcome)


@pytest.mark.parametrize("seed", [7, 8])
def test_without_noise_the_truth_comes_back(seed):
    _, both, true = fused(seed, noisy=False)
    seen = {"bias:x": 1.0}, {"scale_factor:z": 1.0}, {"misalignment:zx": 1.0}
    for direction in seen:
        w = np.array([direction.get(p.label, 0.0) for p in both.parameters])
        # directions below a signal-to-noise ratio of one are held at zero, and a little of them is in every parameter;
        # the zero of the inner gimbal, which a static run does not read, enters in second order
        assert w @ both.values == pytest.approx(w @ values(true, both.parameters), abs=0.3 * sigma_of(both, direction))
