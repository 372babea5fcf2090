"""Fine calibration: Eq. (16) against exact derivatives, its fixed point against the engine, and what it cannot see."""

import numpy as np
import pytest

from gimbalcal.effects import values
from gimbalcal.effects.accelerometer import misalignment_matrix
from gimbalcal.estimate.accelerometers.coarse import coarse
from gimbalcal.estimate.accelerometers.fine import COMBINATIONS, FORCE_TERMS, PAIRS, combinations, fine, norm_rows
from gimbalcal.estimate.accelerometers.position_fit import fit_in_noise
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.views.positions import Noise, position_parameters, view_of_positions
from tests.estimate.device import ARCSEC, PARAMETERS, SAMPLE, SITE, draw, measured

WANTED = position_parameters(SPACE_STABLE, FORCE_TERMS)
LABELS = [q.label for q in PARAMETERS]


def twelve(x):
    """The combinations of Eq. (17) out of all parameters."""
    by = dict(zip(LABELS, x, strict=True))
    return np.array(
        [*(by[c] for c in COMBINATIONS[:9]), *(by[f"misalignment:{a}"] - by[f"misalignment:{b}"] for a, b in PAIRS)]
    )


def half_squared_norm(measured_force, x):
    """1/2 |f^p|^2 (m,) by Eq. (8), written once more by hand."""
    SF, b, K = 1 + x[:3], x[3:6], x[6:9]
    off = measured_force - b
    f = np.linalg.inv(np.eye(3) + misalignment_matrix(x[9:])) @ (SF * (off - K * off**2)).T
    return (f**2).sum(axis=0) / 2


def test_equation_16_is_the_derivative_of_half_the_squared_norm():
    rng = np.random.default_rng(1)
    truth = draw(rng)
    y = measured(truth, rng).triad("specific_force")
    x = np.zeros(15)
    info = norm_rows(y, np.ones(18), x, WANTED, SITE.gravity, SAMPLE)
    scale = np.array([q.sigma for q in WANTED])
    exact = np.stack([
        (half_squared_norm(y, x + 1e-30j * unit)).imag / 1e-30 for unit in np.eye(15)
    ], axis=1) / (SITE.gravity * SAMPLE) * scale  # fmt: skip
    # the rows are kept as a triangle: compare J^T J; at zero parameters (16) is exact
    np.testing.assert_allclose(info.rows[:, :15].T @ info.rows[:, :15], exact.T @ exact, rtol=1e-9, atol=1e-6)


def test_there_are_twelve_unknowns_and_three_sums_are_among_none_of_them():
    M = combinations(np.ones(3))
    assert np.linalg.matrix_rank(M) == 12
    for plus, minus in PAIRS:
        both = np.zeros(15)
        both[[i for i, q in enumerate(WANTED) if q.axis in (plus, minus)]] = 1
        assert np.all(M @ both == 0)


def test_the_fixed_point_is_the_fit_of_the_norm():
    rng = np.random.default_rng(2)
    recording = measured(draw(rng), rng)
    c = fine(trusted_positions(recording))
    free = Noise(SAMPLE, np.inf)
    engine = fit_in_noise(view_of_positions(recording, free), free, WANTED).fit
    assert c.residual.dof == engine.solution.dof == 6
    # chi^2 by the squared norm and by the residual along the force differ by the scale factors, 1e-3
    assert c.residual.chi2 == pytest.approx(engine.solution.chi2, rel=5e-3)
    padded = np.concatenate([engine.solution.x, np.zeros(3)])
    np.testing.assert_allclose(twelve(padded) / c.stages[0].sigmas, twelve(c.values) / c.stages[0].sigmas, atol=0.02)


@pytest.mark.parametrize("setting", [ARCSEC, np.deg2rad(3.0)])
def test_covariance_of_the_combinations_holds_whatever_the_gimbals_did(setting):
    runs, squares = 40, []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        truth = draw(rng)
        recording = measured(truth, rng, setting)
        c = fine(trusted_positions(recording))
        D = np.array([twelve(unit) for unit in np.eye(18)]).T
        P = D @ c.covariance @ D.T
        error = D @ c.values - twelve(truth)
        squares.append(error @ np.linalg.solve(P, error) / 12)
    assert np.mean(squares) == pytest.approx(1, abs=4 * np.sqrt(2 / (12 * runs)))


def test_where_it_starts_does_not_matter_for_what_it_sees_and_decides_the_rest():
    rng = np.random.default_rng(3)
    recording = measured(draw(rng), rng)
    positions = trusted_positions(recording)
    first = coarse(positions)
    plain, after = fine(positions), fine(positions, first)
    # other sums of 20 arcsec change the norm by their squares, 1e-8: 0.03 of the smallest sigma, of the scale factors
    np.testing.assert_allclose(after.stages[0].values / plain.stages[0].sigmas,
                               plain.stages[0].values / plain.stages[0].sigmas, atol=0.1)  # fmt: skip
    for plus, minus in PAIRS:
        pair = [q for q in PARAMETERS if q.axis in (plus, minus)]
        assert values(after.effects, pair).sum() == pytest.approx(values(first.effects, pair).sum(), abs=1e-9)
        assert values(plain.effects, pair).sum() == pytest.approx(0, abs=1e-9)
    zeros = [q for q in PARAMETERS if q.effect == "gimbal_zero"]
    np.testing.assert_array_equal(values(after.effects, zeros), values(first.effects, zeros))


def test_the_three_sums_are_named():
    rng = np.random.default_rng(4)
    c = fine(trusted_positions(measured(draw(rng), rng)))
    named = {tuple(sorted(u["direction"])) for u in c.unobservable}
    assert named == {tuple(sorted(f"misalignment:{a}" for a in pair)) for pair in PAIRS}
    assert all(u["direction"][k] == pytest.approx(1, abs=1e-3) for u in c.unobservable for k in u["direction"])
    assert all("norm of the force stays the same" in u["why"] for u in c.unobservable)
    assert c.stages[0].labels == COMBINATIONS


def test_the_square_of_the_noise_is_taken_off_the_squared_norm():
    # E |f + n|^2 = |f|^2 + 3 sigma^2: readings that lie exactly on the sphere have a true norm a little below it
    y = measured(np.zeros(18), np.random.default_rng(5), 0.0, samples=10**14).triad("specific_force")
    sigma = 5e-3  # m/s^2, the paper's
    rows = norm_rows(y, np.ones(18), np.zeros(15), WANTED, SITE.gravity, sigma).rows
    squares, right = rows[:, :15].T @ rows[:, :15], rows[:, :15].T @ rows[:, 15]
    scale = np.array([q.sigma for q in WANTED])
    x = scale * (np.linalg.pinv(squares, rcond=1e-9) @ right)
    # a common scale factor of 3/2 sigma^2 / g^2 accounts for it: 3.9e-7, as the mean of Eq. (20) has it
    np.testing.assert_allclose(x[:3], 1.5 * (sigma / SITE.gravity) ** 2, rtol=1e-3)


def test_a_misfit_is_told():
    rng = np.random.default_rng(6)
    recording = measured(draw(rng), rng)
    z = recording.channels["specific_force", "z"]
    bent = recording.with_channels({("specific_force", "z"): z + 5e-6 * z**3 * np.abs(z)})
    assert "misses something" in fine(trusted_positions(bent)).outcome
    assert fine(trusted_positions(recording)).outcome == ""
