"""What the derivations find in Cai et al. (2016), that nothing is missing, and that planted misprints are seen."""

import numpy as np
import pytest
import sympy as sp

from derivations import cai2016, information, mechanisation, turning
from derivations.cai2016 import bound, error_model, experiments, sensors, smoother, state_matrix, table_1
from derivations.cai2016.symbols import b_a, b_g
from derivations.verdict import AGREES, APPROXIMATION, MISPRINT, NOT_DETERMINED, WRONG

PAPER = cai2016
KEY = {
    **{f"Eq. ({n})": AGREES for n in (1, 4, 7, 9, 10, 11, *range(13, 18), *range(20, 27))},
    **{f"Eq. ({n})": APPROXIMATION for n in (2, 3, 5, 6, 18)},
    "Eq. (8)": MISPRINT,
    **{f"Eq. ({n})": WRONG for n in (12, 19, 27)},
    **{f"Eq. (23), F{n}": AGREES for n in (11, 12, 14, 16, 21, 25, 27, 28, 29, 33)},
    **{f"Eq. (23), F{n}": MISPRINT for n in (13, 22, 23, 32)},
    "Eq. (27), navigation": AGREES,
    **{f"Table 1, row {n}": AGREES for n in range(19)},
    "Section 3.4, 1 h": APPROXIMATION,
    "Section 3.4, former nine": AGREES,
    "Section 3.4, latter nine": AGREES,
    "Section 3.2, smoothing": WRONG,
    "Eq. (22), rank": NOT_DETERMINED,
    "Section 4.1, all parameters": NOT_DETERMINED,
    "Table 2, accelerometer lever arm, before": AGREES,
    "Table 2, accelerometer lever arm, after": NOT_DETERMINED,
    "Table 3, G_xx": NOT_DETERMINED,
    "Section 4.3, about 8 %": APPROXIMATION,
    "Section 4.3, at least 20 %": AGREES,
    "Section 4.1, turntable": NOT_DETERMINED,
}


def test_key_items(found):
    assert {item: found[item].verdict for item in KEY} == KEY


def test_every_equation_and_table_entry_once(found):
    expected = {f"Eq. ({n})" for n in range(1, 28)} | {"Eq. (27), navigation"}
    expected |= {f"Eq. (23), F{n}" for n in (11, 12, 13, 14, 16, 21, 22, 23, 25, 27, 28, 29, 32, 33)}
    expected |= {f"Table 1, row {n}" for n in range(19)}
    expected |= {f"Table 2, {row[0]}, {when}" for row in experiments.TABLE_2 for when in ("before", "after")}
    expected |= {f"Table 3, {name}" for name in experiments.TABLE_3} | {"Table 3, gyro g-sensitivity"}
    expected |= {f"Section {name}" for name in experiments.POSITION}
    expected |= {f"Section 3.4, {name}" for name in ("1 h", "former nine", "latter nine")}
    expected |= {f"Section 4.1, {name}" for name in ("all parameters", "turntable")}
    expected |= {"Section 4.2, 128 h", "Section 4.3, 108 h", "Section 4.3, about 8 %", "Section 4.3, at least 20 %"}
    expected |= {"Section 3.2, smoothing", "Eq. (22), rank"}
    assert set(found) == expected
    assert len(experiments.TABLE_3) == 21


def test_reasons_name_the_slip(found):
    assert "f_(0)" in found["Eq. (8)"].why
    assert "2694 ug after ten" in found["Eq. (8)"].why
    assert "should be multiplied by 2" in found["Eq. (23), F22"].why
    assert "R_N instead of R_M" in found["Eq. (23), F32"].why
    assert "- K_G, + b_g, - G, - K_A, + b_a, + K_a2, + K_cross" in found["Eq. (27)"].why


@pytest.mark.parametrize(
    ("group", "item", "old", "new"),
    [
        (sensors, "Eq. (2)", b_g[0], -b_g[0]),
        (sensors, "Eq. (6)", b_a[1], 0),
        (error_model, "Eq. (18)", error_model.dG[0, 1], -error_model.dG[0, 1]),
        (error_model, "Eq. (17)", mechanisation.PHI[0], -mechanisation.PHI[0]),
        (state_matrix, "Eq. (23), F21", mechanisation.F_N[2], -mechanisation.F_N[2]),
        (smoother, "Eq. (13)", smoother.x_j[0], -smoother.x_j[0]),
    ],
)
def test_a_planted_slip_is_no_approximation(slipped, group, item, old, new):
    assert slipped(group, item, old, new)


def test_feedback_follows_the_signs_of_f():
    derived = state_matrix.derived_sensors()
    assert list(state_matrix.feedback(derived)) == [-1] * 7
    turned = {name: -block for name, block in derived.items()}
    assert list(state_matrix.feedback(turned)) == [1] * 7


def test_blocks_equal_complex_steps_of_the_mechanisation_anywhere():
    for at in ([70.0, -40.0, 5.0, 0.6, 1.1, 300.0], [-3.0, 200.0, -8.0, -1.1, 0.2, 9e3]):
        assert state_matrix.numerically(at, [0.4, -0.7, 9.7]) < 1e-12


def test_linearisation_follows_finite_differences_with_everything_moving():
    at, force = np.array([70.0, -40.0, 5.0, 0.6, 1.1, 300.0]), np.array([0.4, -0.7, 9.7])
    F = mechanisation.linearised(at, force, held=False)
    step = np.array([1e-4] * 3 + [1e-2] * 3 + [1e-5, 1e-5, 10.0])
    for j, d in enumerate(step):
        e = np.zeros(15)
        e[j] = d
        slope = (mechanisation._rates(e, at, force, False) - mechanisation._rates(-e, at, force, False)) / (2 * d)
        assert np.allclose(slope, F[:, j], rtol=1e-6, atol=1e-7 * np.abs(F[:, j]).max()), j


def test_smoother_equals_the_joint_solution_of_all_data():
    assert smoother.against_all_data() == 0


def test_iteration_converges_only_from_the_first_force():
    assert sensors.left_over(False, 6) < 1e-15
    assert sensors.left_over(True, 6) > 1e-3


def test_a_wrong_row_of_table_1_is_found():
    row = list(table_1.ROWS[4])
    row[2], row[3] = row[3], row[2]
    assert table_1.judge_row(5, tuple(row)).verdict == WRONG
    assert table_1.judge_row(5, ("inner", -90, *table_1.ROWS[4][2:])).verdict == WRONG


def test_path_turns_at_the_rate_it_says():
    path = table_1.motion()
    turned = np.degrees(np.abs(path.rate).sum() * path.dt)  # the middle of a step is exact where the rate is linear
    assert turned == pytest.approx(sum(row[1] for row in table_1.ROWS), abs=1e-9)
    k = 2 * 180 + 15  # within the first turn, at full speed
    between = path.C[k].T @ path.C[k + 1]
    assert np.allclose(path.rate[k], (np.radians(5.0), 0, 0))
    assert np.allclose(between, turning.rotation((1, 0, 0), np.radians(5.0) * path.dt), atol=1e-12)
    assert np.allclose(path.C[-1], turning.attitude(*table_1.START), atol=1e-12)


def test_bound_is_that_of_an_independent_program():
    """Numbers of a covariance program that shares no line with this one: 51 states, seed's noise, velocity at 1 Hz."""
    sigma = {n: s * p for (n, s), p in zip(bound.found().items(), bound.PRIOR, strict=True)}
    ug = bound.UG / bound.G0**2
    assert sigma["K_axx"] / ug == pytest.approx(0.0047, rel=0.02)
    assert sigma["K_axz"] / ug == pytest.approx(0.038, rel=0.02)
    assert sigma["r_x"] * 1e3 == pytest.approx(0.0118, rel=0.02)
    assert sigma["G_yy"] / bound.DEG_H * bound.G0 == pytest.approx(1.2e-4, rel=0.03)
    assert sigma["b_gx"] / bound.DEG_H == pytest.approx(6.9e-6, rel=0.02)


def test_bound_grows_with_the_noise():
    path = turning.path(np.eye(3), (turning.Turn((1, 0, 0), 90),), 10.0, 20.0)
    both = [information.sigmas(path, 0.6, bound.columns, bound.PRIOR, information.Noise(k * 1e-8, k * 1e-5))
            for k in (1, 30)]  # fmt: skip
    assert np.all(both[1] >= both[0] - 1e-12)
    assert np.any(both[1] > 2 * both[0])


def test_number_of_states():
    assert error_model.number_of_states() == 51
    assert sp.Matrix(state_matrix.WIDTHS).shape == (9, 1)
    assert sum(state_matrix.WIDTHS) == 51
