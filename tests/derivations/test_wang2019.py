"""What the derivations find in Wang et al. (2019), that nothing is missing, and that planted misprints are seen."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from derivations import comparison, wang2019
from derivations.verdict import AGREES, APPROXIMATION, MISPRINT, NOT_DETERMINED, WRONG, judge
from derivations.wang2019 import (
    accelerometer,
    dead_reckoning,
    differences,
    experiments,
    frames,
    gyroscope,
    models,
    monte_carlo,
    navigation,
    optimisation,
    package,
    table_4,
)
from derivations.wang2019.symbols import K1, E_yx, fa, fp

PAPER = wang2019
KEY = {
    **{f"Eq. ({n})": AGREES for n in (1, 2, 3, 4, 6, 7, 9, 10, 11, 17, 19, 25, *range(26, 32), 34, 35, 36)},
    **{f"Eq. ({n})": AGREES for n in (38, 39, 40, 41, 42, 43)},
    **{f"Eq. ({n})": APPROXIMATION for n in (5, 8, 12, 13, 14, 15, 16, 20, 21, 22, 23, 24, 32, 33)},
    **{f"Eq. ({n})": WRONG for n in (44, 45)},
    "Eq. (18)": NOT_DETERMINED,
    "Eq. (37)": NOT_DETERMINED,
    "Eq. (30), K_g2": AGREES,
    "Section 4.1, own axis": AGREES,
    "Section 4.1, misalignment": AGREES,
    "Table 3, eps_y": APPROXIMATION,
    "Table 3, eps_x": AGREES,
    "Table 3, K_g2z": NOT_DETERMINED,
    "Table 4, K_g1x": NOT_DETERMINED,
    "Table 4, E_azy": NOT_DETERMINED,
    "Table 2, K_a3x": AGREES,
    "Table 4, nabla_x": AGREES,
    "Table 4, K_a2x": NOT_DETERMINED,
    "Table 4, alpha_1": NOT_DETERMINED,
    "Table 5, roll": AGREES,
    "Table 6, experiment 1": AGREES,
    "Table 6, experiment 1, method 1": NOT_DETERMINED,
    "Section 5.2.3, average": AGREES,
    "Section 5.1, misalignment error": MISPRINT,
    "Section 5.1, turntable": WRONG,
}


def test_key_items(found):
    assert {item: found[item].verdict for item in KEY} == KEY


def test_every_equation_and_table_entry_once(found):
    items = Counter(v for v in found)
    expected = {f"Eq. ({n})" for n in range(1, 46)} | {"Eq. (30), K_g2"}
    expected |= {f"Section 4.1, {name}" for name in ("own axis", "misalignment")}
    expected |= {f"Table {row.table}, {row.name}" for row in monte_carlo.ROWS}
    expected |= {f"Table 4, {name}" for name in table_4.ENTRIES}
    expected |= {f"Table 5, {name}" for name in ("heading", "pitch", "roll")}
    expected |= {f"Table 6, experiment {i}" for i in (1, 2, 3)}
    expected |= {f"Table 6, experiment {i}, method {j}" for i in (1, 2, 3) for j in (1, 2, 3)}
    expected |= {"Tables 4 and 5, K_g2", "Tables 4 and 6, K_g2", "Section 5.2.3, average", "Abstract, 17 %"}
    expected |= {f"Section 5.1, {name}" for name in ("misalignment error", "turntable", "ranges")}
    expected |= {f"Section 5.1, maximum of {start}" for _, start in monte_carlo.LARGEST}
    expected |= {"Section 5.2.2, 5.19 % and 17.89 %"}
    assert set(items) == expected
    assert (len(monte_carlo.ROWS), len(table_4.ENTRIES)) == (27, 36)


def test_the_package_computes_the_derived_forms(found):
    same = {v.item for v in found.values() if v.package}
    # two rotations that are none; navigation: navigate.error_growth and navigate.strapdown are compared with the
    # equations of Cai et al.
    without = (9, 10, 12, 13, 14, 15, 16, 44, 45)
    assert same == {f"Eq. ({n})" for n in range(1, 46) if n not in without} | {"Eq. (30), K_g2"}
    assert {item for source, item in comparison.CHECKS if source == "000"} == same


def test_unreadable_formulas_are_one_class(found):
    assert {v.item for v in found.values() if v.why.startswith("unreadable: ")} == {"Eq. (18)", "Eq. (37)"}


def test_definitions_are_called_definitions(found):
    named = {v.item for v in found.values() if v.why.startswith("A definition: nothing to derive.")}
    assert named == {*(f"Eq. ({n})" for n in (1, 2, 6, 36)), *(f"Table 5, {a}" for a in ("heading", "pitch", "roll"))}
    assert named == {v.item for v in found.values() if v.derived == "a definition"}


def test_a_wrong_sign_in_the_package_is_seen(monkeypatch):
    from gimbalcal.estimate.gyroscopes import revolutions

    right = revolutions.triad_rotation
    monkeypatch.setattr(revolutions, "triad_rotation", lambda a: np.swapaxes(right(a), -1, -2))
    assert package.euler_matrix() > 0.1


# One slip planted in a formula that is right as printed: the verdict must change to misprint.
PLANTED = [
    (models, "Eq. (7)", lambda f: _entry(f, 1, -f[1])),
    (models, "Eq. (4)", lambda f: _entry(f, 0, -f[0])),
    (accelerometer, "Eq. (17)", lambda f: f - 2 * accelerometer.G[0] ** 2),
    (gyroscope, "Eq. (26)", lambda f: _entry(f, 0, f[0] - 2 * gyroscope.w_r[0])),
    (gyroscope, "Eq. (28)", lambda f: _entry(f, 1, f[1] - 2 * gyroscope.theta[1])),
    (gyroscope, "Eq. (29)", lambda f: _entry(f, 2, f[2] + 4 * gyroscope.theta[2])),
    (models, "Eq. (3)", lambda f: _entry(f, 1, -f[1])),
    (accelerometer, "Eq. (25)", lambda f: _entry(f, 0, -f[0])),
    (gyroscope, "Eq. (34)", lambda f: _entry(f, 2, -f[2])),
    (navigation, "Eq. (9)", lambda f: -f),
    (navigation, "Eq. (11)", lambda f: _entry(f, 2, -f[2])),
    (frames, "Eq. (43)", lambda f: _entry(f, 5, -f[5])),
    (optimisation, "Eq. (40)", lambda f: -f),
]


def _entry(matrix, place, value):
    changed = matrix.copy()
    changed[place] = value
    return changed


@pytest.mark.parametrize(("group", "item", "slip"), PLANTED, ids=[p[1] for p in PLANTED])
def test_planted_misprint(group, item, slip):
    printed = group.PRINTED[item]
    planted = {item: replace(printed, formula=slip(printed.formula))}
    (v,) = [v for v in wang2019.judge_group(group, planted) if v.item == item]
    assert v.verdict == MISPRINT


def test_planted_loss_of_a_term_is_not_called_an_approximation():
    printed = navigation.PRINTED["Eq. (9)"]
    planted = {"Eq. (9)": replace(printed, formula=printed.formula - navigation.df)}
    (v,) = [v for v in wang2019.judge_group(navigation, planted) if v.item == "Eq. (9)"]
    assert v.verdict == WRONG


def test_sensitivities_are_the_derivatives_at_a_point():
    """Third route: a central difference of F by K_a1x and E_ayx at generic numbers."""
    at = package.GENERIC | {accelerometer.g: 1.0}
    F = accelerometer.F()
    along = package.numbers(models.polynomial(3), at)[:, 0]
    force = package.numbers(models.triangle() * models.polynomial(3), at)[:, 0]
    known = at | dict(zip(fa, along, strict=True)) | dict(zip(fp, force, strict=True))
    for symbol in (K1[0], E_yx):
        h = 1e-6
        up, down = (float(F.subs(at | {symbol: at[symbol] + s * h})) for s in (1, -1))
        exact = float(accelerometer.exact(symbol)[0].subs(known))
        assert exact == pytest.approx((up - down) / (2 * h), abs=1e-9)  # h^2 and rounding over h


def test_without_feedback_the_error_grows_too_fast():
    assert navigation.growth(0.02) == pytest.approx(1, abs=1e-3)  # a minute: before Schuler acts, w t = 0.09
    assert 30 < navigation.growth(3.2) < 40


def test_ranks_count_all_choices():
    ranks = accelerometer.ranks()
    assert sum(ranks.values()) == 220
    assert ranks[15] == 128


@pytest.mark.parametrize("item", ["Eq. (30)", "Eq. (35)", "Eq. (41)", "Eq. (42)"])
def test_a_cost_with_a_wrong_term_is_not_called_right(item):
    """Not one function compared with itself: a term taken from what is printed changes the verdict."""
    group = gyroscope if item in gyroscope.PRINTED else optimisation
    printed = group.PRINTED[item]
    wrong = replace(printed, formula=printed.formula.subs(K1[0], 2 * K1[0]))
    assert judge(wrong, group.cases()[item])[0] == WRONG


@pytest.mark.parametrize("item", ["Eq. (38)", "Eq. (39)"])
def test_a_list_of_unknowns_that_lacks_one_is_not_called_right(item):
    printed = optimisation.PRINTED[item]
    short = replace(printed, formula=sp.Matrix(printed.formula[:-1]))
    assert judge(short, optimisation.cases()[item])[0] == WRONG


def test_the_nine_unknowns_of_30_are_determined_with_earth_and_bias_and_not_without():
    assert differences.ranks() == (9, 6)


def test_columns_of_30_are_derivatives():
    """Central differences of the norm of (29) for one draw, by K1, K2 and E."""
    K1_, K2_, bias, E_ = differences.draws(1, 7)
    J = differences.columns(K1_, K2_, bias, E_)[0]
    C = np.eye(3)
    C[1, 0], C[2, 0], C[2, 1] = E_[0]
    turns = differences.SPEED * np.array([1, -1]) + differences.EARTH
    rate = turns[:, None, None] * (differences.AXES @ np.linalg.inv(C).T) - bias
    N = 2 * rate / (K1_ + np.sqrt(K1_**2 + 4 * K2_ * rate))
    S, Q = N[0] - N[1], N[0] ** 2 - N[1] ** 2

    def norm(k1, k2, e):
        M = np.eye(3)
        M[1, 0], M[2, 0], M[2, 1] = e
        return (((S * k1 + Q * k2) @ M.T) ** 2).sum(1) / (2 * differences.SPEED) ** 2

    h = 1e-5
    for i, d in enumerate(np.eye(3)):
        by = (
            norm(K1_[0] * (1 + h * d), K2_[0], E_[0]) - norm(K1_[0] * (1 - h * d), K2_[0], E_[0]),
            norm(K1_[0], K2_[0] + h * d * differences.RANGE_K2, E_[0])
            - norm(K1_[0], K2_[0] - h * d * differences.RANGE_K2, E_[0]),
            norm(K1_[0], K2_[0], E_[0] + h * d) - norm(K1_[0], K2_[0], E_[0] - h * d),
        )
        for k, change in enumerate(by):
            assert J[:, 3 * k + i] == pytest.approx(change / (2 * h), abs=1e-9)  # rounding of 1e-16 over h


def test_three_rms_of_500_draws_of_30_differ_by_chance_as_much_as_printed():
    printed = {r.name: [rms for _, rms in r.entries] for r in monte_carlo.ROWS if r.name in monte_carlo.OF_30}
    assert len(printed) == 9
    for (name, rms), chance in zip(printed.items(), differences.chance(), strict=True):
        assert max(rms) / min(rms) < chance, name


def test_a_row_of_table_3_far_beyond_chance_is_seen():
    row = next(r for r in monte_carlo.ROWS if r.name == "K_g1y")
    worse = replace(row, entries=((row.entries[0][0], 1e-5), *row.entries[1:]))
    assert monte_carlo.judge_row(worse).verdict == WRONG


def test_a_planted_number_in_table_4_is_seen(monkeypatch):
    for name, two in (("nabla_x", "-1.25e-2"), ("E_azx", "3.24e-4"), ("K_a1z", "2.20e-6"), ("eps_x", "-3.47e-6")):
        right = table_4.ENTRIES[name]
        monkeypatch.setitem(table_4.ENTRIES, name, (right[0], two, right[2]))
        assert table_4.judge_step(name).verdict == WRONG, name
        monkeypatch.setitem(table_4.ENTRIES, name, right)
        # what eps_x prints would round so only at the edge of both roundings
        assert table_4.judge_step(name).verdict == (NOT_DETERMINED if name == "eps_x" else AGREES), name


def test_a_planted_percentage_in_table_6_is_seen():
    assert experiments.judge_experiment(1, 1.452, 1.275, 12.91).verdict == WRONG


def test_navigation_in_full_goes_over_into_schulers_formulas():
    """Small errors for a short time: one axis. An error ten times larger is ten times as far, but for 1e-3."""
    none, eps, a = (0.0, 0.0, 0.0), 4.848e-8, 9.8e-5
    one = experiments.drift(0.01, 1e-5)
    assert dead_reckoning.largest((0.0, eps, 0.0), none, 3.2) / 1852 == pytest.approx(one[0], rel=0.02)
    assert dead_reckoning.largest(none, (a, 0.0, 0.0), 3.2) / 1852 == pytest.approx(one[1], rel=0.01)
    assert dead_reckoning.largest((0.0, 10 * eps, 0.0), none, 3.2) == pytest.approx(
        10 * dead_reckoning.largest((0.0, eps, 0.0), none, 3.2), rel=1e-3
    )


def test_no_three_angles_hold_the_leaning_of_axes():
    assert frames.out_of_reach((1e-3, -2e-3, 3e-3), (0.0, 0.0, 0.0)) < 1e-15
    assert frames.out_of_reach((0.0, 0.0, 0.0), (1e-3, 0.0, 0.0)) == pytest.approx(5e-4, rel=1e-3)
