"""What the derivations find in Wu et al. (2018), that nothing is missing, and that planted misprints are seen."""

import runpy
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from derivations import comparison, errata, wu2018
from derivations.verdict import AGREES, APPROXIMATION, MISPRINT, NOT_DETERMINED, WRONG, Verdict, judge
from derivations.wu2018 import (
    attitude_error,
    fine_norm,
    frames,
    positions,
    sensor,
    separation,
    static_force,
    table1,
    table4,
    table5,
)
from derivations.wu2018.symbols import (
    BETA,
    G_NORMAL,
    LATITUDE,
    NUMBERS,
    RESIDUALS,
    TABLE_2,
    TABLE_3,
    L,
    S_t,
    beta_yx,
    beta_zy,
    g,
    harmonics,
    nabla_x,
    nabla_z,
    sigma_x,
)
from tests.paths import ROOT

KEY = {
    "Eq. (4)": AGREES,
    "Eq. (6)": NOT_DETERMINED,
    "Eq. (7)": AGREES,
    "Eq. (8)": AGREES,
    "Eq. (10)": APPROXIMATION,
    "Eq. (11)": APPROXIMATION,
    "Eq. (13)": MISPRINT,
    "Eq. (14)": MISPRINT,
    "Eq. (17)": AGREES,
    "Eq. (20)": APPROXIMATION,
    **{f"Eq. ({n})": AGREES for n in (18, 19, *range(21, 41))},
    "Eq. (41)": NOT_DETERMINED,
    "Table 1, row 1, g_z": AGREES,
    "Table 1, row 2, g_y": APPROXIMATION,
    "Table 1, row 6, theta_2": AGREES,
    "Table 1, row 7, g_y": NOT_DETERMINED,
    "Table 5, yaw, three-stage improvement": AGREES,
    "Table 5, yaw, three-stage": NOT_DETERMINED,
    "Section 6.2, over 45 %": APPROXIMATION,
    "Section 6.2, over 22 %": AGREES,
    "Table 1, row 11, g_y": AGREES,
    "Table 1, row 14, g_z": MISPRINT,
    "Table 1, row 15, g_y": WRONG,
    **{f"Table 4, {name}": AGREES for name in ("x2", "x3", "x4", "x5", "delta_phi_2s", "delta_theta_2c")},
    **{f"Table 4, {name}": WRONG for name in ("x1", "delta_phi_1s", "delta_theta_1s", "delta_theta_1c")},
}


@pytest.mark.parametrize("item", KEY)
def test_key_items(wu2018_verdicts, item):
    assert wu2018_verdicts[item].verdict == KEY[item]


def test_every_equation_and_table_entry_once(wu2018_list):
    count = Counter(v.item for v in wu2018_list)
    expected = {f"Eq. ({n})" for n in range(1, 42)}
    expected |= {f"Table 1, row {r}, g_{c}" for r in range(1, 19) for c in "xyz"}
    expected |= {f"Table 1, row {r}, theta_{i}" for r in range(1, 19) for i in (1, 2, 3)}
    expected |= {f"Table 4, {row.name}" for row in table4.ROWS}
    expected |= {f"Table 5, {row}, {stage}" for row in table5.ROWS for stage in table5.STAGES}
    expected |= {f"Table 5, {row}, {stage} improvement" for row in table5.ROWS for stage in table5.STAGES[1:]}
    expected |= {f"Section 6.2, over {n} %" for n in (10, 22, 30, 45)}
    expected |= {f"Table 2, {symbol}" for symbol in TABLE_2} | {f"Table 3, {symbol}" for symbol in TABLE_3}
    expected |= {f"Section 6.1, {name}" for name in ("10 arcsec", "1e-6 rad", "noise")}
    expected |= {f"Section 3, {name}" for name in (
        "18 coefficients", "18 equations", "six positions", "coarse estimates", "45 deg", "twelve positions",
        "levelling",
    )}  # fmt: skip
    assert (len(table4.ROWS), len(table5.ROWS)) == (13, 7)
    assert set(count) == expected
    assert set(count.values()) == {1}


def test_the_package_computes_every_derived_form(wu2018_verdicts):
    compared = {v.item for v in wu2018_verdicts.values() if v.package}
    assert len(compared) > 150  # 108 entries of Table 1, 13 of Table 4, and the equations the package holds
    assert {item for source, item in comparison.CHECKS if source == "001"} == compared


def test_unreadable_formulas_are_one_class(wu2018_verdicts):
    unreadable = {v.item for v in wu2018_verdicts.values() if v.why.startswith("unreadable: ")}
    assert unreadable == {"Eq. (6)", "Table 1, row 7, g_y"}


def test_a_planted_percentage_in_table_5_is_seen(monkeypatch):
    assert table5.judge_improvement("roll", "two-stage").verdict == AGREES
    monkeypatch.setitem(table5.ROWS, "roll", (0.89, 0.50, 43.28, 0.38, 57.30))
    assert table5.judge_improvement("roll", "two-stage").verdict == WRONG


@pytest.mark.parametrize(("group", "item", "alone"), [(sensor, "Eq. (7)", AGREES), (fine_norm, "Eq. (13)", MISPRINT)])
def test_a_repair_does_not_repair_another_slip(wu2018_verdicts, group, item, alone):
    """One slip more than the one that is told, or than a convention explains: what is printed is then wrong."""
    printed = group.PRINTED[item]
    worse = replace(printed, formula=2 * printed.formula, carried="")
    assert judge(worse, group.cases()[item])[0] == WRONG
    assert judge(replace(printed, carried=""), group.cases()[item])[0] == alone


def test_a_wrong_sign_in_the_package_is_seen(monkeypatch):
    from derivations.wu2018 import package_static
    from gimbalcal.estimate.static_run import combined_coefficients as combined

    right = combined.coefficient_matrix

    def wrong(latitude, gravity, wanted):
        made = right(latitude, gravity, wanted)
        made[combined.NAMES.index("x2"), 6] *= -1  # beta_xy
        return made

    assert package_static.coefficient_matrix() < 1e-12  # roundings of numbers of order one
    monkeypatch.setattr(combined, "coefficient_matrix", wrong)
    assert package_static.coefficient_matrix() == pytest.approx(2 * np.sin(LATITUDE))
    assert "PACKAGE DIFFERS" in str(comparison.compare("001", "Eq. (39)"))


def test_sensor_law_planted_bias_sign(wu2018_verdicts):
    printed = sensor.PRINTED["Eq. (8)"]
    planted = replace(printed, formula=printed.formula.subs({x: -x for x in sensor.b}, simultaneous=True))
    (found,) = [v for v in wu2018.judge_group(sensor, {"Eq. (8)": planted}) if v.item == "Eq. (8)"]
    assert found.verdict == WRONG
    assert wu2018_verdicts["Eq. (8)"].verdict == AGREES


# One slip planted in a formula that is right as printed: the verdict must change to misprint.
PLANTED = [
    (frames, "Eq. (4)", lambda f: _with_entry(f, (2, 2), -f[2, 2])),
    (frames, "Eq. (5)", lambda f: _with_entry(f, (0, 1), -f[0, 1])),
    (static_force, "Eq. (19)", lambda f: _with_entry(f, (1, 0), sp.cos(S_t) * sp.cos(L))),
    (static_force, "Eq. (21)", lambda f: f.subs(nabla_z, -nabla_z)),
    (static_force, "Eq. (22)", lambda f: f.subs(beta_zy, -beta_zy)),
    (static_force, "Eq. (24)", lambda f: f.subs(sigma_x, 2 * sigma_x)),
    (attitude_error, "Eq. (30)", lambda f: f.subs(nabla_x, nabla_x / sp.sin(L))),
    (attitude_error, "Eq. (31)", lambda f: f.subs(beta_yx, -beta_yx)),
    (attitude_error, "Eq. (36)", lambda f: -f),
    (separation, "Eq. (39)", lambda f: f.subs(separation.phi_N2s, separation.phi_N2c)),
    (separation, "Eq. (40)", lambda f: f.subs(separation.phi_E2s, separation.phi_E2s * sp.sin(L))),
    (table1, "Table 1, row 5, g_y", lambda f: -f),
    (table1, "Table 1, row 13, g_x", lambda f: f.subs(table1.t3, table1.t2)),
]


def _with_entry(matrix, place, value):
    changed = matrix.copy()
    changed[place] = value
    return changed


@pytest.mark.parametrize(("group", "item", "slip"), PLANTED, ids=[p[1] for p in PLANTED])
def test_planted_misprint(group, item, slip):
    case, printed = group.cases()[item], group.PRINTED[item]
    assert judge(printed, case)[0] == AGREES
    planted = replace(printed, formula=slip(printed.formula))
    verdict, words = judge(planted, case)
    assert verdict == (MISPRINT if words else WRONG)
    if item != "Eq. (19)":  # a cosine for a sine is no slip of a sign, a factor or a symbol
        assert verdict == MISPRINT


def test_planted_angle_in_table_1():
    item = "Table 1, row 6, theta_2"
    printed = table1.PRINTED[item]
    planted = replace(printed, formula=printed.formula + sp.pi / 2)
    (found,) = [v for v in wu2018.judge_group(table1, {item: planted}) if v.item == item]
    assert found.verdict == WRONG


def test_planted_number_in_table_4():
    row = table4.ROWS[3]
    right, wrong = table4.judge_row(row), table4.judge_row(replace(row, reference="-5.100e-5"))
    assert right.verdict == AGREES
    assert wrong.verdict == WRONG
    assert wrong.why.startswith("No reversal of signs")
    assert "Its error column should be" in wrong.why


def test_a_slip_of_the_pen_in_table_4_is_told_from_a_wrong_simulation():
    """A reversed sign that the estimate does not share is a misprint; one that it shares is wrong."""
    row = next(r for r in table4.ROWS if r.name == "delta_phi_2s")
    lonely = replace(row, reference="-3.830e-5")
    shared = replace(row, reference="-3.830e-5", estimated="-3.848e-5")
    assert table4.judge_row(lonely).verdict == MISPRINT
    assert table4.judge_row(shared).verdict == WRONG


# --- independent routes to the derived forms ---


def test_z_of_the_platform_stands_h_above_the_horizon():
    z_p = frames.base_to_platform().T * sp.Matrix([0, 0, 1])
    h, q = sp.symbols("h q", real=True)
    assert z_p == sp.Matrix([sp.cos(h) * sp.cos(q), -sp.cos(h) * sp.sin(q), -sp.sin(h)])


def test_fifteen_coefficients_by_finite_differences_of_an_exact_simulation():
    """Fourier coefficients of an exact, noise-free day against the derived ones, for a generic set of residuals."""
    rng = np.random.default_rng(5)
    scale = 1e-6  # second order then is 1e-12, well below the 1e-9 relative to which 1e-3 is resolved
    values = dict(zip(RESIDUALS, scale * rng.standard_normal(12), strict=True))
    values |= {nabla: values[nabla] * G_NORMAL for nabla in RESIDUALS[3:6]} | {L: LATITUDE, g: G_NORMAL}
    phases = 2 * np.pi * np.arange(16) / 16
    z, roll, pitch = _exact_day(values, phases)
    for name, derived in separation.coefficients().items():
        series = z if name.startswith("x_") else roll if name.startswith("dphi") else pitch
        expected = float(derived.subs(values).evalf())
        assert _coefficient(name, series, phases) == pytest.approx(expected, abs=2e-11)  # ten squares of 1e-6


def _exact_day(values, phases):
    s, c, one = np.sin(phases), np.cos(phases), np.ones_like(phases)
    sin, cos = np.sin(LATITUDE), np.cos(LATITUDE)
    f = np.stack([c * cos, s * cos, sin * one], axis=-1)
    xy, xz, yz, yx, zx, zy = (values[b] for b in BETA)
    C_pa = np.array([[1, xz, -xy], [-yz, 1, yx], [zy, -zx, 1]])
    bias = np.array([values[b] / G_NORMAL for b in RESIDUALS[3:6]])
    sf = 1 + np.array([values[b] for b in RESIDUALS[:3]])
    f_hat = ((f - bias) * sf) @ np.linalg.inv(C_pa).T
    e = np.stack([c * f_hat[:, 0] + s * f_hat[:, 1], -s * f_hat[:, 0] + c * f_hat[:, 1], f_hat[:, 2]], axis=-1)
    down = -e / np.linalg.norm(e, axis=-1, keepdims=True)
    east = np.cross(down, [0.0, 0.0, 1.0])
    east /= np.linalg.norm(east, axis=-1, keepdims=True)
    C_nb = np.array([[-sin, 0, -cos], [0, 1, 0], [cos, 0, -sin]]).T @ np.stack([np.cross(east, down), east, down], -1)
    z = 0.5 * ((f_hat**2).sum(axis=-1) - 1)
    return z, -np.arctan2(C_nb[:, 1, 2], C_nb[:, 2, 2]), np.arcsin(C_nb[:, 0, 2])


def _coefficient(name, series, phases):
    harmonic = name.split("_")[1]
    cos = np.cos(LATITUDE)
    weights = {
        "mean": 0.5 + 0 * phases,
        "1c": np.cos(phases),
        "1s": np.sin(phases),
        "2c": np.cos(2 * phases),
        "2s": np.sin(2 * phases),
    }
    states = dict(zip("12345", zip(weights, (1, -1 / cos, -1 / cos, 1 / cos**2, 1 / cos**2), strict=True), strict=True))
    key, factor = states[harmonic] if name.startswith("x_") else (harmonic, 1.0)
    return factor * 2 * float(np.mean(series * weights[key]))


def test_noise_biases_x1_by_the_mean_of_its_square():
    """Eq. (20): 3/2 (sigma/g)^2, from samples; four standard errors."""
    rng = np.random.default_rng(7)
    sigma = static_force.SIGMA_NOISE / G_NORMAL
    f = np.array([0.3, -0.4, np.sqrt(0.75)])
    z = 0.5 * (((f + sigma * rng.standard_normal((400_000, 3))) ** 2).sum(axis=1) - 1)
    z -= (f * 0).sum()
    error = z.std() / np.sqrt(len(z))
    assert abs(z.mean() - static_force.noise_mean()) < 4 * error


def test_rank_and_null_directions():
    assert separation.ranks() == {"all": 9, "tilted": 7, "norm": 5, "attitude": 8}
    names = list(separation.coefficients())
    tilted = [n for n in names if n not in separation.MEANS]
    assert separation.unobservable(separation.NULL_LEVEL, names)
    assert separation.unobservable(separation.NULL_LEVEL | separation.NULL_TILTED, tilted)
    assert not separation.unobservable(separation.NULL_TILTED, names)
    assert len(separation.NULL_LEVEL) + 9 == len(RESIDUALS)
    assert len(separation.NULL_LEVEL | separation.NULL_TILTED) + 7 == len(RESIDUALS)


def test_positions_leave_one_direction_free_whatever_is_asked_of_them():
    """The platform zero and a common turn beta_xz = beta_yz; with one of the two left out nothing is free."""
    for rows, unknowns, seen in (
        (positions.EVERY, positions.EIGHTEEN, 17), (positions.EVERY, positions.FIFTEEN, 14),
        (positions.BETWEEN, positions.NINE, 8),
    ):  # fmt: skip
        assert positions.rank(rows, unknowns) == seen == len(unknowns) - 1
        assert positions.rank(rows, tuple(u for u in unknowns if u is not table1.ZEROS[0])) == seen
    assert positions.rank(positions.FACES, positions.FIFTEEN[:6]) == 6


def test_faces_of_table_1_and_what_their_sums_and_differences_are():
    assert {positions.vertical(row) for row in positions.FACES} == {(a, s) for a in range(3) for s in (-1, 1)}
    assert not any(positions.slanted(row) for row in positions.FACES)
    bias, scale = (positions.first_order(m) for m in positions.of_faces())
    assert list(bias) == list(sensor.K)
    assert not any(scale)


def test_a_wrong_face_a_wrong_slant_and_a_levelling_that_does_not_end_are_noticed(monkeypatch):
    with monkeypatch.context() as m:
        m.setattr(positions, "FACES", (1, 3, 5, 7, 9, 12))
        assert positions.judge_faces().verdict == WRONG
    with monkeypatch.context() as m:
        m.setattr(positions, "BETWEEN", (2, 3))
        assert positions.judge_slanted().derived == "not at 3"
    with monkeypatch.context() as m:
        m.setattr(positions, "levelled", lambda: [1e-2, 5e-3, 2e-3, 1e-3])
        assert positions.judge_levelling().verdict == WRONG
    with monkeypatch.context() as m:
        m.setattr(positions, "of_faces", lambda: (sp.Matrix(sensor.b), sp.zeros(3, 1)))
        assert positions.judge_coarse().verdict == WRONG


def test_one_turn_back_leaves_the_square_of_the_zeros():
    first, second, third, _ = positions.levelled()
    assert second < first**2
    assert third < second**2


def test_tables_2_and_3_are_confirmed_where_a_reference_follows_from_them(monkeypatch):
    open_ = [v.item for v in table4.inputs() if v.verdict == NOT_DETERMINED]
    assert open_ == ["Table 2, sigma_z", "Table 2, nabla_z"]
    assert "With its sign reversed x1 could." in table4.judge_input(nabla_z, 1e-3).why
    monkeypatch.setattr(table4, "ROWS", table4.ROWS[:1])  # x1, which follows from no table as printed
    assert all(v.verdict == NOT_DETERMINED for v in table4.inputs())


def test_sentences_of_section_6_1_follow_from_the_tables(monkeypatch):
    limit, accuracy, noise = table4.sentences()
    assert limit.why == "beta_yz, beta_xy have just 10 arcsec."
    assert accuracy.verdict == AGREES
    assert "8.2e+06 samples" in noise.derived
    worse = replace(table4.ROWS[0], estimated="1.1336e-4")
    monkeypatch.setattr(table4, "ROWS", (worse, *table4.ROWS[1:]))
    assert table4.sentences()[1].verdict == WRONG
    monkeypatch.setattr(table4, "TABLE_3", {nabla_z: 11 * 4.85e-6})
    assert table4.sentences()[0].verdict == WRONG


def test_samples_of_a_day_by_draws():
    """White noise on z of the specific force of (19), its five states by least squares: the number comes back."""
    rng, n = np.random.default_rng(3), 4000
    S = 2 * np.pi * np.arange(n) / n
    C = np.cos(LATITUDE)
    H = np.stack([np.ones(n), -C * np.cos(S), -C * np.sin(S), C**2 * np.cos(2 * S), C**2 * np.sin(2 * S)], axis=1)
    noise = table4.NOISE / G_NORMAL * rng.standard_normal((200, n))
    found = np.linalg.lstsq(H, noise.T, rcond=None)[0].std(axis=1)
    variance = np.array([1, 2 / C**2, 2 / C**2, 2 / C**4, 2 / C**4])
    assert found == pytest.approx(table4.NOISE / G_NORMAL * np.sqrt(variance / n), rel=0.15)


def test_matrix_41_lacks_what_22_and_23_have():
    printed, derived = separation.PRINTED["Eq. (41)"].formula, separation.matrix_41()
    assert printed[:4, :] == derived[:4, :] or (printed - derived)[:4, :].applyfunc(sp.simplify).is_zero_matrix
    assert separation.rank_at_a_latitude(printed) == 6
    assert separation.rank_at_a_latitude(derived) == 4


def test_damage_of_inverting_41_as_printed():
    """With the printed rows 5 and 6 the biases are x_2 and x_3 themselves: the lost betas times sin 40 deg."""
    bias, _ = separation.damage()
    lost = abs(np.sin(LATITUDE) * (NUMBERS[beta_yx] - NUMBERS[BETA[4]]))
    assert bias == pytest.approx(lost * 1e6, rel=1e-9)


def test_eighteen_positions_have_full_norm_rank():
    twelve, fifteen, condition = fine_norm.ranks()
    assert (twelve, fifteen) == (12, 12)
    assert condition < 20  # of order one: no near-null direction in the unit-norm columns


def test_table_4_closures_hold_for_the_derived_column_and_break_for_the_printed():
    derived = {row.coefficient: table4.evaluate(row.coefficient) for row in table4.ROWS}
    assert max(map(abs, table4.closures(derived).values())) < 1e-17  # rounding of numbers of 1e-4
    assert set(table4.broken_closures()) == {
        "dphi_2c - x5 C",
        "dtheta_2s - x5 S C",
        "dtheta_1c + S dphi_1s - C^2/S (x2 - dphi_1s)",
        "dtheta_1s - S dphi_1c - C^2/S (x3 + dphi_1c)",
    }


def test_every_wrong_value_of_table_4_has_one_shortest_explanation():
    """No second combination of slips, however long, reproduces a value that does not follow."""
    for row in table4.ROWS:
        found = list(table4.explanations(row))
        if found[0] != ((), False):
            assert len(found) == 1, row.name


def test_gravity_of_table_4_is_normal_gravity():
    from gimbalcal.earth import normal_gravity

    assert float(normal_gravity(LATITUDE)) == pytest.approx(G_NORMAL, abs=1e-5)  # five decimals typed in
    assert abs(table4.best_gravity() - G_NORMAL) < 1e-3  # the printed digits resolve about 1e-4 of g


@pytest.mark.parametrize("power", [1, 2, 3])
def test_harmonics_by_eight_angles_are_the_integral(power):
    expr = (sp.cos(S_t) + 2 * sp.sin(S_t) + sp.sin(L)) ** power
    weights = {
        "mean": sp.Rational(1, 2),
        "1c": sp.cos(S_t),
        "1s": sp.sin(S_t),
        "2c": sp.cos(2 * S_t),
        "2s": sp.sin(2 * S_t),
    }
    for name, found in harmonics(expr).items():
        exact = sp.integrate(sp.expand(expr * weights[name]), (S_t, 0, 2 * sp.pi)) / sp.pi
        assert sp.simplify(found - exact) == 0


def test_the_page_of_errata_says_what_is_derived(wu2018_list):
    docs = ROOT / "docs"
    section = runpy.run_path(str(docs / "build_errata.py"))["section"]
    stated = section("001", [errata.entry(v) for v in wu2018_list])
    assert stated in (docs / "errata.md").read_text(), "run `make docs`"


def test_the_page_of_the_paper_has_every_item_with_its_formulas(wu2018_list):
    builder = runpy.run_path(str(ROOT / "docs" / "build_errata.py"))
    page = builder["paper_page"]("001", wu2018_list)
    escaped = builder["text"]
    for v in wu2018_list:
        whole = f"## {escaped(v.item)}: {v.verdict}" if v.formulas != (None, None) else f"| {escaped(v.item)} |"
        assert page.count(whole) == 1, v.item
    assert r"\beta_{yz}" in page
    assert page.count("$$") % 2 == 0


def test_a_formula_too_long_for_the_page_is_named_and_the_other_is_labelled():
    builder = runpy.run_path(str(ROOT / "docs" / "build_errata.py"))
    long = sum(sp.Symbol(f"x_{i}") ** i for i in range(400))
    v = Verdict("001", "Eq. (99)", WRONG, "x", "long", "1", "Because.", formulas=(sp.Symbol("x"), long))
    shown = builder["of_formula"](v)
    assert "printed:\n\n$$x$$" in shown
    assert 'In full with `python -m derivations wu2018 "Eq. (99)"`.' in shown
    definition = builder["of_formula"](replace(v, formulas=(sp.Symbol("x"), None)))
    assert "$$x$$" in definition
    assert "printed:" not in definition
