"""What the derivations find in Wang et al. (2019), that nothing is missing, and that planted misprints are seen."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from derivations import wang2019
from derivations.verdict import AGREES, APPROXIMATION, MISPRINT, NOT_DETERMINED, VERDICTS, WRONG
from derivations.wang2019 import accelerometer, frames, gyroscope, models, navigation, optimisation, package, tables
from derivations.wang2019.symbols import K1, E_yx, fa, fp

KEY = {
    **{f"Eq. ({n})": AGREES for n in (1, 2, 3, 4, 6, 7, 9, 10, 11, 17, 18, 19, 25, *range(26, 32), 34, 35, 36)},
    **{f"Eq. ({n})": AGREES for n in (38, 39, 40, 41, 42, 43)},
    **{f"Eq. ({n})": APPROXIMATION for n in (5, 8, 12, 13, 14, 15, 20, 21, 22, 23, 24, 32, 33)},
    **{f"Eq. ({n})": WRONG for n in (16, 44, 45)},
    "Eq. (37)": MISPRINT,
    "Eq. (30), K_g2": NOT_DETERMINED,
    "Figure 2, the rule": NOT_DETERMINED,
    "Table 3, eps_y": WRONG,
    "Table 3, eps_x": AGREES,
    "Table 3, K_g2z": NOT_DETERMINED,
    "Table 2, K_a3x": AGREES,
    "Table 4, nabla_x": AGREES,
    "Section 5.1, misalignment error": MISPRINT,
    "Section 5.1, turntable": WRONG,
}


@pytest.fixture(scope="module")
def found():
    return {v.item: v for v in wang2019.verdicts()}


def test_key_items(found):
    assert {item: found[item].verdict for item in KEY} == KEY


def test_every_equation_and_table_entry_once(found):
    items = Counter(v for v in found)
    expected = {f"Eq. ({n})" for n in range(1, 46)} | {"Eq. (30), K_g2", "Figure 2, the rule"}
    expected |= {f"Table {row.table}, {row.name}" for row in tables.ROWS}
    expected |= {f"Table 4, {name}" for name in ("nabla_x", "nabla_y", "nabla_z", "alpha_1", "beta_1", "gamma_1")}
    expected |= {f"Table 6, experiment {i}" for i in (1, 2, 3)}
    expected |= {"Tables 4 and 5, K_g2"}
    expected |= {"Section 5.1, misalignment error", "Section 5.1, turntable"}
    assert set(items) == expected
    assert len(tables.ROWS) == 27


def test_every_verdict_is_one_of_five_and_says_why(found):
    for v in found.values():
        assert v.verdict in VERDICTS
        assert v.source == "000"
        assert v.printed
        assert v.derived
        assert len(v.why) > 10
        assert not re.search(r"\{\w+\}", v.why), v.item
        assert (v.size == "0") == (v.verdict == AGREES), v.item


def test_the_package_computes_the_derived_forms(found):
    assert not [v.item for v in found.values() if "PACKAGE DIFFERS" in v.why]
    same = {v.item for v in found.values() if "Package: same to" in v.why}
    assert same == {f"Eq. ({n})" for n in (2, 6, 20, 25, 34, 41, 43)}


def test_a_wrong_sign_in_the_package_is_seen(monkeypatch):
    from gimbalcal.estimate.gyroscopes import inter_triad

    right = inter_triad.triad_rotation
    monkeypatch.setattr(inter_triad, "triad_rotation", lambda a: np.swapaxes(right(a), -1, -2))
    assert package.euler_matrix() > 0.1


# One slip planted in a formula that is right as printed: the verdict must change to misprint.
PLANTED = [
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
    assert gyroscope.rank_of_differences() == 6
