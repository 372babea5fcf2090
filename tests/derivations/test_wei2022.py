"""What the derivations find in Wei et al. (2022), that nothing is missing, and that planted misprints are seen."""

import numpy as np
import pytest

from derivations import mechanisation, wei2022
from derivations.verdict import AGREES, MISPRINT, NOT_DETERMINED, WRONG
from derivations.wei2022 import bound, kalman, sensors, static_run, table_1, tables
from derivations.wei2022.symbols import NAMES, dA_a, epsilon

PAPER = wei2022
KEY = {
    **{f"Eq. ({n})": AGREES for n in (*range(1, 9), *range(10, 25))},
    "Eq. (9)": NOT_DETERMINED,
    **{f"Table 1, row {n}": AGREES for n in (*range(1, 22), *range(27, 31))},
    **{f"Table 1, row {n}": NOT_DETERMINED for n in range(22, 27)},
    "Table 1, order 16~30": WRONG,
    "Table 1, rate and stops": NOT_DETERMINED,
    "Section 4.1, initial attitude": AGREES,
    "Section 3.2, 21 errors": AGREES,
    "Table 2, eps_x": NOT_DETERMINED,
    "Table 2, dA_ayz": MISPRINT,
    "Table 3, eps_y, 30-residual": AGREES,
    "Table 3, eps_y, 30-estimate": NOT_DETERMINED,
    "Table 4, dK_gx": NOT_DETERMINED,
    "Section 4.1, level": AGREES,
    "Section 4.1, mostly stronger": AGREES,
    "Section 4.1, residuals": WRONG,
    "Abstract, 21 parameters": AGREES,
    "Section 4.1, 3639 m": NOT_DETERMINED,
}


def test_key_items(found):
    assert {item: found[item].verdict for item in KEY} == KEY


def test_every_equation_and_table_entry_once(found):
    expected = {f"Eq. ({n})" for n in range(1, 25)} | {f"Table 1, row {n}" for n in range(1, 31)}
    expected |= {f"Table {t}, {name}" for t in (2, 4) for name in NAMES}
    expected |= {f"Table 3, {n}, {s}-{what}" for n in NAMES for s in (18, 30) for what in ("estimate", "residual")}
    expected |= {"Table 1, order 16~30", "Table 1, rate and stops", "Section 3.2, 21 errors", "Abstract, 21 parameters"}
    expected |= {f"Section 4.1, {name}" for name in ("initial attitude", "level", "mostly stronger", "residuals")}
    expected |= {f"Section 4.1, {metres} m" for metres in (3639, 865)}
    expected |= {"Eq. (13), rank", "Table 1, gain of 16~30", "Table 3, ideal values", "Table 3, order of dA_a"}
    assert set(found) == expected
    assert [len(t) for t in (NAMES, tables.TABLE_2, tables.TABLE_3, tables.TABLE_4)] == [21] * 4


def test_what_cannot_be_read_says_so(found):
    assert found["Eq. (9)"].why.startswith("unreadable:")
    assert [v.item for v in found.values() if v.why.startswith("unreadable:")] == ["Eq. (9)"]


@pytest.mark.parametrize(
    ("group", "item", "old", "new"),
    [
        (sensors, "Eq. (7)", epsilon[0], -epsilon[0]),
        (sensors, "Eq. (8)", dA_a[5], dA_a[4]),
        (kalman, "Eq. (10)", mechanisation.DV[0], -mechanisation.DV[0]),
        (kalman, "Eq. (11)", mechanisation.DP[2], 0),
        (kalman, "Eq. (19)", kalman.Q, -kalman.Q),
        (kalman, "Eq. (21)", kalman.z, -kalman.z),
        (kalman, "Eq. (22)", kalman.R, 2 * kalman.R),
    ],
)
def test_a_planted_slip_is_found(slipped, group, item, old, new):
    assert slipped(group, item, old, new)


def test_rows_in_which_both_columns_cannot_be_reversed():
    assert table_1.contradicted() == [22, 23, 24, 25, 26]
    assert np.array_equal(table_1.attitudes()[30], table_1.start())
    assert np.array_equal(table_1.by_the_other_column()[-1], table_1.start())


def test_a_wrong_axis_of_table_1_is_found(monkeypatch):
    rows = list(table_1.ROWS)
    rows[6] = ("E", "z", 90)
    monkeypatch.setattr(table_1, "ROWS", tuple(rows))
    assert table_1.judge_row(7, *rows[6]).verdict == NOT_DETERMINED
    assert table_1.judge_row(8, *rows[7]).verdict == NOT_DETERMINED


def test_columns_of_readings_are_the_derivative_of_the_model():
    rng = np.random.default_rng(1)
    w, f = rng.standard_normal((2, 1, 3))
    states = list(wei2022.symbols.STATES)
    at = dict(zip((*sensors.omega, *sensors.f), (*w[0], *f[0]), strict=True))
    both = sensors.rate_error().col_join(sensors.force_error()).jacobian(states).subs(at)
    assert np.allclose(bound.columns(w, f)[0], np.array(both.tolist(), float), atol=1e-15)


def test_bound_is_that_of_an_independent_program():
    """Numbers of a covariance program that shares no line with this one: 10 deg/s, 100 s, 0.002 deg/sqrt(h), 5 ug."""
    sigma = dict(zip(NAMES, np.array(list(bound.found().values())) * bound.PRIOR, strict=True))
    assert sigma["dK_gx"] * 1e6 == pytest.approx(0.48, rel=0.02)
    assert sigma["nabla_x"] / bound.UG == pytest.approx(0.15, rel=0.04)
    assert 0.0024 < min(sigma[f"eps_{a}"] for a in "xyz") / bound.DEG_H
    assert max(sigma[f"eps_{a}"] for a in "xyz") / bound.DEG_H < 0.0029


def test_residuals_larger_with_thirty_positions():
    assert tables.larger_with_thirty() == ["eps_y", "dK_gx", "dK_gy", "dA_ayx", "dA_azx"]
    assert tables.rms("gyro scale factor", 1) > tables.rms("gyro scale factor", 0)


def test_a_wrong_digit_of_a_residual_is_found(monkeypatch):
    rows = list(tables.TABLE_3)
    rows[3] = (*rows[3][:3], "0.458106425", rows[3][4])
    monkeypatch.setattr(tables, "TABLE_3", tuple(rows))
    assert tables.judge_residual(3, 0).verdict == WRONG
    assert tables.judge_residual(3, 1).verdict == AGREES


def test_a_wrong_ideal_value_is_found(monkeypatch):
    rows = [list(row) for row in tables.TABLE_3]
    rows[3][0] = "81"
    monkeypatch.setattr(tables, "TABLE_3", tuple(map(tuple, rows)))
    assert tables.judge_ideals().verdict == WRONG


def test_order_of_rows_without_names_is_open_and_follows_from_residuals_as_small_as_the_degrees(monkeypatch):
    assert tables.judge_order().verdict == NOT_DETERMINED
    degrees = [("1", "1"), ("10", "10"), ("100", "100"), ("1000", "1000"), ("10000", "10000"), ("1", "1")]
    rows = [("0", "0", "0", str(1 / float(d[0])), str(1 / float(d[0]))) for d in degrees]
    monkeypatch.setattr(tables, "TABLE_2", (*tables.TABLE_2[:15], *degrees))
    monkeypatch.setattr(tables, "TABLE_3", (*tables.TABLE_3[:15], *rows))
    tables.orders_as_likely.cache_clear()
    try:
        likely, every = tables.orders_as_likely()
    finally:
        tables.orders_as_likely.cache_clear()
    assert likely <= every / 20


def test_static_run_grows_with_the_polar_part_of_the_gyro_error():
    """After 48 h longitude is off by (eps_N cos L + eps_U sin L) t, give or take the amplitude of the day's swing."""
    for scheme in (0, 1):
        r = tables.residuals(scheme)[:3]
        drift = np.radians(abs(r[1] * np.cos(static_run.LATITUDE) + r[2] * np.sin(static_run.LATITUDE))) * 48
        assert static_run.largest(scheme) == pytest.approx(drift * 6.378e6 * np.cos(static_run.LATITUDE), rel=0.25)
