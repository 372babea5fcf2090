"""A wrong sign or factor in the package must make the run fail and name the item."""

import inspect
import json
import pkgutil
from functools import reduce
from importlib import import_module
from types import SimpleNamespace

import pytest

import gimbalcal
from derivations import __main__, cai2016, comparison, wang2019, wei2022, wu2018  # noqa: F401  (all register)
from derivations.comparison import CHECKS, Comparison, compare
from tests.mutation.rewrite import _code_of, mutants, original

WANG, WU, CAI, WEI = "000", "001", "002", "003"
MODULES = [m.name for m in pkgutil.walk_packages(gimbalcal.__path__, "gimbalcal.")]
# module of the package, function, what it says, what it says instead, source, items that must be named
SLIPS = [
    ("effects.accelerometer", "misalignment_error", "xz * fy - xy * fz", "xz * fy + xy * fz", WU, "5 6 16 17"),
    ("effects.accelerometer", "misalignment_error", "zy * fx - zx * fy", "zy * fx + zx * fy", WU, "5 6 16 17"),
    ("effects.accelerometer", "nonlinearity_error", "asarray(force * (1 - r)", "asarray(2 * force * (1 - r)", WU,
     "6 8 16"),
    ("estimate.accelerometers.fine", "norm_rows", "-(u**3)", "u**3", WU, "10 16 17"),
    ("estimate.accelerometers.fine", "norm_rows", "- 3 * variance", "+ 3 * variance", WU, "8 10"),
    ("estimate.accelerometers.fine", "norm_rows", "K * off**2", "K * off", WU, "8 9"),
    ("estimate.accelerometers.fine", "combinations", "5], [3, 4, 5]] = SF", "5], [3, 4, 5]] = 1", WU, "16 17"),
    ("estimate.accelerometers.fine", "norm_rows", "misalignment_matrix(beta)", "misalignment_matrix(-beta)", WU, "8"),
    ("estimate.static_run.force_filter", "observation_matrix", "-fx, -fy", "-fx, fy", WU, "27"),
    ("estimate.static_run.force_filter", "projection", "/ gravity", "* gravity", WU, "20"),
    ("estimate.pulses.gravity_norm", "Pulses.along_axes", "(K3 * N + K2)", "(K3 * N - K2)", WANG, "2 3 6 7 17 20"),
    ("estimate.pulses.gravity_norm", "unit_lower_triangular", "E[..., 2]", "-E[..., 2]", WANG, "2 5 8 17"),
    ("estimate.pulses.gravity_norm", "_residuals", "back * u**3", "back * u**2", WANG, "23"),
    ("estimate.pulses.gravity_norm", "_residuals", "f[..., 2] * fa[..., 1]", "f[..., 1] * fa[..., 1]", WANG, "25"),
    ("estimate.pulses.gravity_norm", "initial_scale", "2, target**2", "2, 2 * target**2", WANG, "41 42"),
    ("estimate.pulses.whole_turns", "_residuals", "(W**2).sum(-1) - earth**2", "(W**2).sum(-1) + earth**2", WANG, "35"),
    ("estimate.pulses.whole_turns", "_residuals", "JW) / (earth", "JW) / (2 * earth", WANG, "35"),
    ("estimate.pulses.whole_turns", "_residuals", "(length - 4)", "(length - 2)", WANG, "29 30 31"),
    ("estimate.pulses.whole_turns", "_part_across", "S - D * share", "S + D * share", WANG, "27 28"),
    ("estimate.pulses.whole_turns", "_vectors_of_bases", "J[..., 2, 11] = w[..., 0], w[..., 0], w[..., 1]",
     "J[..., 2, 11] = w[..., 0], w[..., 0], w[..., 0]", WANG, "34 35"),
    ("estimate.gyroscopes.revolutions", "as_effects", "-triad.K2 / triad.K1]", "-triad.K2 / triad.K1**3]", WANG, "6 8"),
    ("effects.gyroscope", "of_rate_matrix", "SF[:, None] * M", "M", WU, "5"),
    ("kinematics", "navigation_to_platform", "-ct * sL", "ct * sL", WU, "18"),
    ("inference.levenberg", "_step", "right = -np", "right = np", WANG, "40"),
    ("estimate.gyroscopes.revolutions", "triad_rotation", '"x", a[..., 1]', '"x", -a[..., 1]', WANG, "43"),
    ("effects.gyroscope", "GyroScaleFactor.contribution", "-self.s /", "self.s /", CAI, "1 3 18"),
    ("effects.gyroscope", "GyroScaleFactor.contribution", "-self.s /", "self.s /", WEI, "3 7"),
    ("effects.false_rate", "by_force", "(3, 3)), s.force", "(3, 3)).T, s.force", CAI, "1 2 3 18"),
    ("effects.false_rate", "constant_rate", "(epsilon +", "(-epsilon +", WEI, "1 7"),
    ("effects.accelerometer", "misalignment_error", "yx * fz - yz * fx", "yx * fz + yz * fx", CAI, "3 6 18 20"),
    ("effects.accelerometer", "misalignment_error", "yx * fz - yz * fx", "yx * fz + yz * fx", WEI, "5 6 7 8"),
    ("effects.nonlinearity", "CrossCoupling.contribution", "xz * fz", "xz * fy", CAI, "4 6 12 19"),
    ("effects.motion_errors", "AccelerometerLeverArm.contribution", "), s.rate", "), 2 * s.rate", CAI, "9 10 12"),
    ("inversion", "invert_response", "f = f + step", "f = f - step", CAI, "8"),
    ("estimate.systematic.error_model", "sensitivity", "return -J", "return J", CAI, "18 19"),
]  # fmt: skip


@pytest.fixture
def slip(monkeypatch):
    """Change one piece of a function of the package, wherever it is used."""

    def change(module, function, old, new):
        found = import_module(f"gimbalcal.{module}")
        source, own = inspect.getsource(found), inspect.getsource(original(found.__name__, function))
        assert own.count(old) == 1, f"{function} no longer says {old!r} once"
        changed = compile(source.replace(own, own.replace(old, new)), found.__name__, "exec")
        monkeypatch.setattr(original(found.__name__, function), "__code__", _code_of(changed, function.split(".")))
        comparison.forget()

    yield change
    monkeypatch.undo()
    comparison.forget()


@pytest.mark.parametrize(("module", "function", "old", "new", "source", "items"), SLIPS)
def test_a_slip_in_the_package_is_named(slip, module, function, old, new, source, items):
    slip(module, function, old, new)
    for number in items.split():
        assert not compare(source, f"Eq. ({number})").same, number


def test_the_run_fails_and_lists_the_items(slip, monkeypatch, capsys, tmp_path):
    papers = (SimpleNamespace(verdicts=lambda: wang2019.judge_group(wang2019.models)),)
    monkeypatch.setattr(__main__, "PAPERS", papers)
    assert __main__.main(["--out", str(tmp_path)]) == 0
    assert "The package follows the derivation in all 8 items" in capsys.readouterr().out
    slip("estimate.pulses.gravity_norm", "unit_lower_triangular", "E[..., 2]", "-E[..., 2]")
    assert __main__.main(["--out", str(tmp_path)]) == 1
    last = capsys.readouterr().out.split("THE PACKAGE DIFFERS")[1]
    assert "in 4 of 8 items" in last
    assert "Wang 2019, Eq. (5): PACKAGE DIFFERS in estimate.pulses.gravity_norm.unit_lower_triangular by" in last
    assert "Eq. (3)" not in last
    told = {v["item"]: v["why"] for v in json.loads((tmp_path / "errata.json").read_text())}
    assert "PACKAGE DIFFERS" in told["Eq. (5)"]


# compiled loops: file of the package, what it says, what it says instead, the function that the checks call, the item
COMPILED = [
    (
        "navigate.error_growth",
        "rb = h * (wn * c - wd * a",
        "rb = h * (wn * c + wd * a",
        "transitions",
        CAI,
        "Eq. (23), F11",
    ),
    ("navigate.error_growth", "by_n * x[3]) + e[1]", "by_e * x[3]) + e[1]", "transitions", CAI, "Eq. (23), F12"),
    ("navigate.error_growth", "wd * by_n * x[6], -wn", "-wd * by_n * x[6], -wn", "transitions", CAI, "Eq. (23), F13"),
    ("navigate.error_growth", "va = -(f[1] * mc", "va = (f[1] * mc", "transitions", CAI, "Eq. (23), F21"),
    ("navigate.error_growth", "h * 2 * wd * x[4]", "h * wd * x[4]", "transitions", CAI, "Eq. (23), F22"),
    ("navigate.error_growth", "- g_h * x[8]", "+ g_h * x[8]", "transitions", CAI, "Eq. (23), F23"),
    ("navigate.error_growth", "x[7] += h * (x[4]", "x[7] += h * (x[3]", "transitions", CAI, "Eq. (23), F32"),
    ("navigate.error_growth", "return turn[0, c - 3]", "return turn[2, c - 3]", "transitions", CAI, "Eq. (23), F16"),
    ("navigate.error_growth", "N[i, l] += q[j, c]", "N[i, l] += q[j, 0]", "transitions", CAI, "Eq. (24)"),
    ("navigate.strapdown", "- (kd * vn - kn * vd)", "- (kd * vn + kn * vd)", "strapdown", CAI, "Eq. (17)"),
    ("navigate.strapdown", "-ve * sL / (cL * RN)", "ve * sL / (cL * RN)", "strapdown", CAI, "Eq. (17)"),
    ("inference.adjoint", "total -= cross", "total += cross", "smooth", CAI, "Eq. (13)"),
    ("navigate.space_stable_navigator", "cL * sS - spin * y", "cL * sS + spin * y", "_run_loop", WU, "Eq. (28)"),
    (
        "navigate.space_stable_navigator",
        "ax * h / 2 + EARTH_RATE * y",
        "ax * h / 2 - EARTH_RATE * y",
        "_run_loop",
        WU,
        "Eq. (28)",
    ),
    ("navigate.space_stable_navigator", "L = atan2(z + E2 / (1 - E2)", "L = atan2(z + E2", "_run_loop", WU, "Eq. (28)"),
]


@pytest.mark.parametrize(("module", "old", "new", "called", "paper", "item"), COMPILED)
def test_a_slip_in_a_compiled_loop_is_named(monkeypatch, module, old, new, called, paper, item):
    found = import_module(f"gimbalcal.{module}")
    source = inspect.getsource(found)
    assert source.count(old) == 1
    plain = source.replace("from gimbalcal.compiled import compiled", "compiled = lambda loop: loop")
    plain = plain.replace(
        "from gimbalcal.compiled import interpreted_first", "interpreted_first = lambda rows: lambda loop: loop"
    )
    names = {"__name__": found.__name__}
    for text, same in ((plain, True), (plain.replace(old, new), False)):
        exec(compile(text, found.__name__, "exec"), names)
        monkeypatch.setattr(found, called, names[called])
        comparison.forget()
        own = [comparison._run(where, check) for where, check in CHECKS[paper, item] if where.startswith(module)]
        assert own
        assert all(c.same for c in own) == same
    monkeypatch.undo()
    comparison.forget()


@pytest.mark.parametrize(("source", "row"), [(CAI, 5), (WEI, 2), (WEI, 24)])
def test_a_schedule_that_turns_the_other_way_is_named(slip, source, row):
    assert compare(source, f"Table 1, row {row}").same
    slip("schedule.commands", "RotationSchedule.attitudes", "-move.angle", "move.angle / 2")
    assert not compare(source, f"Table 1, row {row}").same


def test_a_formula_that_breaks_differs(slip):
    slip("estimate.accelerometers.fine", "norm_rows", "[3, 6, 9]", "[3, 6, 8]")
    found = compare(WU, "Eq. (8)")
    assert not found.same
    assert "ValueError" in str(found)


def _is_in_the_package(place):
    """Return whether "effects.accelerometer.Misalignment, its matrix" names a module, or a name in one."""
    names = place.split()[0].rstrip(",").split(".")
    for length in range(len(names), 0, -1):
        tail = "." + ".".join(names[:length])
        for module in (m for m in MODULES if m.endswith(tail)):
            if reduce(lambda x, name: getattr(x, name, None), names[length:], import_module(module)) is not None:
                return True
    return False


def test_every_place_that_a_comparison_names_is_in_the_package():
    places = {place for found in CHECKS.values() for place, _ in found}
    assert len(places) > 90
    assert [place for place in places if not _is_in_the_package(place)] == []


def test_a_difference_that_is_no_number_differs():
    assert not Comparison("x", float("nan")).same


@pytest.mark.parametrize(
    ("module", "functions", "where"),
    [
        ("estimate.accelerometers.fine", {"norm_rows", "combinations"}, "estimate.accelerometers.fine"),
        ("estimate.pulses.whole_turns", {"_vectors_of_bases", "_part_across"}, "estimate.pulses.whole_turns"),
        ("estimate.static_run.force_filter", {"observation_matrix", "projection"}, "estimate.static_run.force_filter"),
    ],
)
def test_no_changed_term_of_a_row_goes_unnoticed(module, functions, where):
    """Two changes to every statement of these functions, one at a time: signs, operators, exponents, factors."""
    checks = {check for places in CHECKS.values() for place, check in places if place.startswith(where)}
    chosen = [m for m in mutants(f"gimbalcal.{module}", 2) if m.function in functions]
    assert {m.function for m in chosen} == functions
    survivors = []
    for mutant in chosen:
        restore = mutant.install()
        comparison.forget()
        try:
            noticed = any(not comparison._run(where, check).same for check in checks)
        finally:
            restore()
        if not noticed:
            survivors.append(str(mutant))
    comparison.forget()
    assert not survivors
