"""Where the mismatch is: the planted place comes first, statistics are chi^2 of a fit, and clean data look clean."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from gimbalcal.diagnose.evidence.projection import ReducedRows
from gimbalcal.diagnose.search.ranking import reduced_rows
from gimbalcal.diagnose.verdict import mismatch
from gimbalcal.diagnose.verdict.mismatch import MAX_CELLS, Cell, Scan, scan_data, scanned_mismatches
from tests.diagnose.plant import known, on
from tests.diagnose.small import at_rest, clean, covariance, few, noises, observed, rows_of
from tests.golden import golden_text

TABLE = observed(1, dwell=6)
REST = at_rest(2)
LIBRARY = few(TABLE, "scale_factor_asymmetry:y")


def prepared(o):
    (node,) = noises(o, 1)
    label = "scale_factor_asymmetry:y" if o.view.kind == "multi-position" else "bias_drift:x"
    return reduced_rows(o, few(o, label).X, [node]), node


def scanned(o, seed=1, explained=None):
    rows, node = prepared(o)
    return scan_data(o, rows, node, np.random.default_rng(seed), explained)


def fall_of_chi2(o, node, columns, beside):
    """Chi^2 that these columns (R, m) take away beside the calibration and others, in one noise."""
    Z, y = rows_of(o)
    root = np.linalg.inv(np.linalg.cholesky(covariance(node, len(y))))

    def left(A):
        A = root @ A
        A = A / (np.linalg.norm(A, axis=0) + 1e-300)
        return float(np.sum((root @ y - A @ np.linalg.lstsq(A, root @ y, rcond=1e-8)[0]) ** 2))

    base = np.concatenate([Z, beside], axis=1)
    return left(base) - left(np.concatenate([base, columns], axis=1))


@pytest.mark.parametrize("beside", [False, True])
def test_a_statistic_is_the_chi2_that_a_place_of_its_own_takes_away(beside):
    o = observed(3, known(1)["asymmetry"][0], 100.0, dwell=6)
    rows, node = prepared(o)
    X = LIBRARY.X if beside else np.zeros((len(LIBRARY.X), 0))
    s = scan_data(o, rows, node, np.random.default_rng(1), X)
    for position, k in ((4, 0), (11, 2)):
        at = next(i for i, c in enumerate(s.cells) if c.where == {"positions": [position]} and c.axis == "xyz"[k])
        column = np.zeros((*o.residual.shape, 1))
        column[o.view.stimulus.position == position, k] = 1.0
        assert s.statistic[at] == pytest.approx(fall_of_chi2(o, node, o.reduced(column), X), rel=1e-4, abs=1e-4)


@pytest.mark.parametrize(("position", "axis"), [(5, 1), (14, 0)])
def test_a_misfit_at_one_position_is_the_first_cell(position, axis):
    o = observed(4, lambda b: on(axis, (b.visit == position - 1).astype(float)), 80.0, dwell=6)
    s = scanned(o)
    assert s.p_value < 1e-4
    first = scanned_mismatches(s)[0]
    assert (first["channel"], first["axis"]) == ("specific_force", "xyz"[axis])
    assert first["where"] == {"positions": [position]}
    tail = chi2.sf(s.statistic.max(), 1)  # of this cell alone, and Bonferroni's bound over all
    assert tail < first["p_value"] < len(s.cells) * tail
    golden_text(first["in_words"])


def test_a_wave_in_a_static_run_is_seen_at_its_period():
    o = at_rest(5, lambda r: np.outer(np.sin(2 * np.pi * r.t / 9600.0), [0.0, 0.0, 1.0]), 3.0)
    first = scanned_mismatches(scanned(o))[0]
    assert (first["axis"], first["where"]) == ("z", {"period_min": 160.0})


def test_a_clean_recording_is_as_bad_somewhere_as_its_p_value_says(monkeypatch):
    """p is uniform over clean recordings of this design, whichever of the many overlapping cells is the worst."""
    monkeypatch.setattr(mismatch, "DRAWS", 100)  # for time
    rng = np.random.default_rng(6)
    design = observed(1, dwell=2)
    rows, node = prepared(design)
    p = []
    for _ in range(80):
        o = clean(design, node, rng)
        y = o.reduced(o.residual[:, :, None])
        y = y - rows.Q @ (rows.Q.T @ y)
        here = ReducedRows(np.concatenate([rows.low[:, :-1], y], axis=1), rows.high, rows.q, rows.P, rows.Q, y)
        p.append(scan_data(o, here, node, rng).p_value)
    assert kstest(p, "uniform").pvalue > 0.01
    assert np.mean(np.array(p) < 0.1) < 0.1 + 3 * np.sqrt(0.09 / 80)


def test_beside_its_cause_nothing_is_off():
    o = observed(7, known(1)["asymmetry"][0], 400.0, dwell=6)
    assert scanned(o).p_value < 1e-3
    assert scanned(o, explained=LIBRARY.X).p_value > 0.05


def cell(axis, position):
    return Cell("specific_force", axis, {"positions": [position]}, f"at position {position}")


def test_positions_of_one_channel_are_told_together():
    cells = (cell("x", 9), cell("x", 2), cell("y", 3), cell("z", 4), cell("z", 5))
    s = Scan(cells, np.array([50.0, 40.0, 30.0, 10.0, 35.0]), np.array([1e-9, 1e-7, 1e-4, 1e-3, 0.2]))
    x, y = scanned_mismatches(s)
    assert x["where"] == {"positions": [2, 9]}
    golden_text(x["in_words"])
    assert (x["statistic"], x["p_value"]) == (50.0, 1e-9)
    golden_text(y["in_words"])
    # z 4 is less than a quarter of the strongest, and z 5 is not significant
    nothing = replace(s, p_values=np.full(5, 0.5))
    assert scanned_mismatches(nothing) == ()
    assert [m["axis"] for m in scanned_mismatches(nothing, at_least=1)] == ["x"]
    many = tuple(Cell("specific_force", "x", {"n": k}, f"there {k}") for k in range(MAX_CELLS + 3))
    assert len(scanned_mismatches(Scan(many, np.ones(len(many)), np.full(len(many), 1e-3)))) == MAX_CELLS
