"""The fifteen combined coefficients: printed formulas (with derived signs) = forward model; two roads agree."""

import numpy as np
import pytest
from scipy.stats import chi2

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import CATALOGUE, parameters, values, with_values
from gimbalcal.estimate.fit import information_of
from gimbalcal.estimate.static_run.combined_coefficients import (
    MEANS,
    NAMES,
    channel_operators,
    coefficient_matrix,
    fit_combined,
    separate_parameters,
)
from gimbalcal.estimate.static_run.force_filter import PRIOR_SIGMA
from gimbalcal.estimate.static_run.system import static_parameters, static_readings, static_view
from gimbalcal.inference.information import solve
from tests.estimate.static_runs import TABLE_2_3, draw, run
from tests.stimuli import LATITUDE, G

TWELVE = tuple(p for i in ("scale_factor", "bias", "misalignment") for p in parameters(CATALOGUE[i]))


def by_operators(r, wanted):
    """Sensitivities (15, p) of the coefficients by the forward model's Jacobian and the estimators."""
    J = r.rows().jacobian(wanted)
    return np.concatenate([p.apply(J[:, p.channels]) for p in channel_operators(r, (), drift=0, noise="white")])


def test_formulas_equal_the_forward_models_jacobian():
    # one whole sidereal day, evenly: harmonics are orthogonal, so K's third one does not leak
    day = 2 * np.pi / EARTH_RATE
    r = static_readings(run(hours=day / 3600 * (1 - 1e-9), step=day / 144))
    wanted = tuple(p for p in static_parameters(r) if p.effect != "polar_axis_misalignment")
    G_model, G_formula = by_operators(r, wanted), coefficient_matrix(LATITUDE, G, wanted)
    scale = np.array([p.sigma for p in wanted])
    # the prior of 1e-2 on x shrinks it by (sigma / prior)^2 / rows = 1e-9 at most
    assert np.abs((G_model - G_formula) * scale).max() < 1e-8 * np.abs(G_formula * scale).max()
    assert PRIOR_SIGMA == 1e-2


def test_polar_axis_and_azimuth_of_the_platform_leave_the_coefficients_alone():
    r = static_readings(run(hours=24, step=600))
    polar = tuple(p for p in static_parameters(r) if p.effect == "polar_axis_misalignment")
    assert np.abs(by_operators(r, polar)).max() < 1e-9  # against 1 for what they do to a gimbal


@pytest.mark.parametrize(("means", "rank"), [(True, 9), (False, 7)])
def test_rank_and_null_directions_of_the_coefficients(means, rank):
    rows = [i for i, name in enumerate(NAMES) if means or name not in MEANS]
    A = coefficient_matrix(LATITUDE, G, TWELVE)[rows] * np.array([p.sigma for p in TWELVE])
    assert np.linalg.matrix_rank(A, tol=1e-12) == rank
    S, C = np.sin(LATITUDE), np.cos(LATITUDE)
    null = [{"bias:x": S * G, "misalignment:xy": 1}, {"bias:y": -S * G, "misalignment:yx": 1},
            {"bias:z": S * G, "scale_factor:z": 1}]  # fmt: skip
    if not means:
        null += [{"misalignment:xz": 1, "misalignment:yz": 1},
                 {"scale_factor:x": S, "scale_factor:y": S, "bias:z": C**2 * G}]  # fmt: skip
    labels = [p.label for p in TWELVE]
    for direction in null:
        x = np.array([direction.get(label, 0.0) for label in labels])
        assert np.abs(coefficient_matrix(LATITUDE, G, TWELVE)[rows] @ x).max() < 1e-15


def both_roads(seed, drift=1):
    """Coefficients of a noisy run, the sigma of the joint fit's, and the truth through the same operators."""
    ids = ("scale_factor", "bias", "misalignment", "gimbal_zero", "base_tilt", "polar_axis_misalignment")
    truth = draw(np.random.default_rng(seed), ids)
    r = static_readings(run(truth, np.random.default_rng(seed + 1000), hours=37.0, step=1200.0))
    wanted = tuple(p for p in static_parameters(r) if p.effect in ids)
    J = r.rows(truth).jacobian(wanted)
    x = solve(information_of([static_view(r)], truth, wanted))
    fitted = with_values((), wanted, x.x, r.recording.platform.axis_names)
    table = fit_combined(r, (), fitted, drift, "white")
    exact = r.residual() - r.residual(truth)
    parts = channel_operators(r, (), drift, "white")
    L = np.concatenate([p.apply(J[:, p.channels]) for p in parts])
    sigma = np.sqrt(np.diag(L @ x.covariance @ L.T))
    return table, sigma, np.concatenate([p.apply(exact[:, p.channels, None])[:, 0] for p in parts])


def test_two_roads_are_consistent_and_as_uncertain_as_claimed():
    runs, own, fit, between = 25, 0.0, 0.0, 0.0
    for seed in range(runs):
        table, fit_sigma, truth = both_roads(seed)
        assert table.names == NAMES
        assert np.all(fit_sigma < table.sigma * 1.2)  # the joint fit knows more; sigma of 111 rows is +-7 %
        e = table.value - truth
        own += e @ np.linalg.solve(table.covariance, e)
        # the joint fit has nine sensor combinations and two means among fifteen coefficients
        fit += float(np.sum(((table.fit - truth) / fit_sigma) ** 2)) / 15
        # an efficient estimate is uncorrelated with its difference to any other (Hausman 1978)
        d, variance = table.value - table.fit, table.sigma**2 - fit_sigma**2
        clear = variance > 0.2 * table.sigma**2
        between += float(np.mean(d[clear] ** 2 / variance[clear]))
    assert chi2.ppf(0.0005, runs * 15) < own * (103 / 105) < chi2.ppf(0.9995, runs * 15)
    assert 0.7 < fit / runs < 1.3  # mean of 25 x about 9 independent squares: 1 +- 0.095, 3 sigma
    assert 0.6 < between / runs < 1.5


def test_tables_2_and_3_of_the_paper_give_the_derived_reference_values():
    S, C = np.sin(LATITUDE), np.cos(LATITUDE)
    c = dict(zip(NAMES, coefficient_matrix(LATITUDE, G, TWELVE) @ values(TABLE_2_3, TWELVE), strict=True))
    arcsec = np.deg2rad(1 / 3600)
    # in estimate minus true, Eqs. (21)-(38) as printed, with Tables 2 and 3
    assert c["x1"] == pytest.approx(1.5e-4 * C**2 - (1e-3 / G + 1e-4 * S) * S, rel=1e-12)
    assert c["x2"] == pytest.approx(-1e-3 / G + 10 * arcsec * S - 5 * arcsec * S, rel=1e-12)
    assert c["x3"] == pytest.approx(5e-4 / G + 5 * arcsec * S + 5 * arcsec * S, rel=1e-12)
    assert c["x4"] == pytest.approx(-5e-5, rel=1e-12)
    assert c["x5"] == pytest.approx(2.5 * arcsec, rel=1e-12)
    # these entries of Table 4's reference column follow from Tables 2 and 3 with g = 9.8017; see `derivations`
    assert c["x2"] == pytest.approx(-8.645e-5, abs=2e-8)
    assert c["x3"] == pytest.approx(8.217e-5, abs=2e-8)
    assert c["phi_2s"] == pytest.approx(3.830e-5, abs=1e-8)
    assert c["theta_2c"] == pytest.approx(-2.462e-5, abs=1e-8)


def test_closure_relations_hold_for_any_parameters():
    x = np.random.default_rng(5).normal(size=12) * [p.sigma for p in TWELVE]
    c = dict(zip(NAMES, coefficient_matrix(LATITUDE, G, TWELVE) @ x, strict=True))
    S, C = np.sin(LATITUDE), np.cos(LATITUDE)
    assert c["phi_2s"] == pytest.approx(-c["x4"] * C, rel=1e-12)
    assert c["theta_2c"] == pytest.approx(c["x4"] * S * C, rel=1e-12)
    assert c["phi_2c"] == pytest.approx(c["x5"] * C, rel=1e-12)
    assert c["theta_2s"] == pytest.approx(c["x5"] * S * C, rel=1e-12)
    assert c["theta_1c"] == pytest.approx(-S * c["phi_1s"] + C**2 / S * (c["x2"] - c["phi_1s"]), rel=1e-9)
    assert c["theta_1s"] == pytest.approx(S * c["phi_1c"] + C**2 / S * (c["x3"] + c["phi_1c"]), rel=1e-9)


def test_separation_finds_what_is_determined_and_names_the_rest():
    x = values(TABLE_2_3, TWELVE)
    # what white noise of 1e-7 rad a mean leaves on each coefficient of whole days
    C = np.cos(LATITUDE)
    size = dict.fromkeys(NAMES, np.sqrt(2)) | {"x1": 1.0, "x2": np.sqrt(2) / C, "x3": np.sqrt(2) / C}
    size |= {"x4": np.sqrt(2) / C**2, "x5": np.sqrt(2) / C**2}
    names = tuple(n for n in NAMES if n not in MEANS)
    variance = np.diag([(1e-7 * size[n]) ** 2 for n in names])
    rows = [NAMES.index(n) for n in names]
    A = coefficient_matrix(LATITUDE, G, TWELVE)[rows]
    s = separate_parameters(names, A @ x, variance, LATITUDE, G, TWELVE)
    assert len(s.unobservable) == 5
    assert any(set(u.direction) == {"bias:x", "misalignment:xy"} for u in s.unobservable)
    labels = [p.label for p in TWELVE]
    S = np.sin(LATITUDE)
    determined = (
        {"bias:x": 1 / G, "misalignment:xy": -S},
        {"misalignment:zy": 1.0},
        {"misalignment:zx": 1.0},
        {"scale_factor:x": 1.0, "scale_factor:y": -1.0},
        {"misalignment:yz": 1.0, "misalignment:xz": -1.0},
    )
    for seen in determined:
        w = np.array([seen.get(label, 0.0) for label in labels])
        assert w @ s.x == pytest.approx(w @ x, abs=1e-12)
        assert np.sqrt(w @ s.covariance @ w) < 2e-6
    # the printed equal weights of Eq. (39) are worse than these
    w = np.array([{"scale_factor:x": 0.5, "scale_factor:y": -0.5}.get(label, 0.0) for label in labels])
    equal = np.array([{"x4": -1 / 3, "phi_2s": 1 / 3 / C, "theta_2c": -1 / 3 / (S * C)}.get(n, 0.0) for n in names])
    assert equal @ A == pytest.approx(w, abs=1e-15)
    assert w @ s.covariance @ w < 0.9 * (equal @ variance @ equal)
