"""How a unit moved: agreement where nothing does, jumps, drifts and values off the others where something does."""

import json
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from gimbalcal.atomic import as_json
from gimbalcal.earth import YEAR
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.history import DatedCalibration, compare, dated_file
from gimbalcal.report.history_page import history_report
from gimbalcal.words.history_sentences import _parameter_name
from gimbalcal.words.naming import name_in_words
from tests.golden import golden_text, refused
from tests.history.calibrations import LABELS, SIGMA, START, R, calibration, history

QUARTER = 90 * 86400.0 / YEAR


def course(axis, values):
    out = np.zeros((len(values), 6))
    out[:, LABELS.index(axis)] = values
    return out


def test_a_unit_that_stays_as_it_was_agrees_with_itself():
    made = [compare(history(seed)) for seed in range(150)]
    alarms = sum(bool(m.significant) or any(c.jumps or c.outliers for c in m.histories) for m in made)
    assert alarms <= 8  # steps, jumps and outliers are each one in a hundred at most
    assert sum(not m.agree for m in made) <= 9  # 2.5 % of 600 with six calibrations
    p = np.array([s.p_value for m in made for s in m.steps])
    assert np.mean(p < 0.1) == pytest.approx(0.1, abs=0.03)
    z = np.array([c.rate / c.rate_sigma for m in made for c in m.histories])
    assert 0.82 < np.sqrt(np.mean(z**2)) < 1.05  # a scatter that chance makes widens every other sigma


def test_a_jump_is_named_with_its_size_and_date():
    made = compare(history(1, course=course("scale_factor:z", [0, 0, 0, 0, 30, 30, 30])))
    moved = [c for c in made.histories if c.moved]
    assert [c.parameter.label for c in moved] == ["scale_factor:z"]
    assert moved[0].jumps == (4,)
    assert not moved[0].drifts
    assert not made.agree
    size = 30 * SIGMA[5] * 1e6
    golden_text(made.in_words)
    assert float(made.in_words.partition("jumped by +")[2].split()[0]) == pytest.approx(size, abs=3 * SIGMA[5] * 1e6)


def test_a_drift_comes_back_with_its_sigma_and_a_date():
    rate = 10.0  # sigmas a quarter
    fits = [compare(history(seed, course=course("bias:y", [rate * k for k in range(7)]))) for seed in range(40)]
    found = [next(c for c in made.histories if c.parameter.label == "bias:y") for made in fits]
    assert all(c.drifts and not c.jumps and not c.outliers for c in found)
    truth = rate * SIGMA[1] / (QUARTER * YEAR)
    z = np.array([(c.rate - truth) / c.rate_sigma for c in found])
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.3)
    made = compare(history(1, course=course("bias:y", [rate * k for k in range(7)])), allowed={"bias": "500 ug"})
    days = 500e-6 * 9.80665 / truth / 86400
    assert (made.due - START).days == pytest.approx(6 * 90 + days, rel=0.08)
    golden_text(made.in_words)
    row = next(r for r in made.to_dict()["parameters"] if (r["name"], r["axis"]) == ("bias", "y"))
    c = next(c for c in made.histories if c.parameter.label == "bias:y")
    assert row["drift_per_year"] == pytest.approx(1e6 * c.rate * YEAR / 9.80665)
    assert row["drift_sigma"] == pytest.approx(1e6 * c.rate_sigma * YEAR / 9.80665)
    said = made.in_words.partition("bias y drifts by +")[2].partition(" ug a year")[0].split(" +- ")
    assert [float(x) for x in said] == pytest.approx([row["drift_per_year"], row["drift_sigma"]], rel=0.05)


def test_one_value_that_is_off_is_no_jump():
    made = compare(history(2, course=course("bias:x", [0, 0, 40, 0, 0, 0, 0])))
    off = next(c for c in made.histories if c.parameter.label == "bias:x")
    assert (off.outliers, off.jumps, off.drifts) == ((2,), (), False)
    golden_text(made.in_words)


@pytest.mark.parametrize(
    ("shape", "told"),
    [([0, 0, 0, 6, 6, 6], ((3,), (), False)), ([0, 0, 6, 0, 0, 0], ((), (2,), False)),
     ([0, 2, 4, 6, 8, 10], ((), (), True))],
)  # fmt: skip
def test_what_stands_little_clear_is_called_what_it_is(shape, told):
    # half of such steps were told as drifts while a change was held against two values alone
    each = [compare(history(seed, 6, course("bias:y", shape))).histories for seed in range(40)]
    found = [next(c for c in histories if c.parameter.label == "bias:y") for histories in each]
    assert sum((c.jumps, c.outliers, c.drifts) == told for c in found) >= 30
    sizes = np.array([c.sizes[0] for c in found if (c.jumps, c.outliers, c.drifts) == told and c.sizes])
    if len(sizes):
        assert np.mean(sizes[:, 0]) == pytest.approx(6 * SIGMA[1], rel=0.1)
        assert np.mean(((sizes[:, 0] - 6 * SIGMA[1]) / sizes[:, 1]) ** 2) < 1.6


def test_what_moved_most_is_told_first_and_a_slow_drift_is_no_agreement():
    slow = course("bias:y", [0, 2, 4, 6, 8, 10])
    said = compare(history(1, 6, slow + course("scale_factor:z", [0, 0, 0, 60, 60, 60]))).in_words
    golden_text(said)
    assert said.index("jumped") < said.index("bias y drifts by +")
    quiet = [made for made in (compare(history(seed, 6, slow)) for seed in range(4)) if not made.significant]
    assert quiet  # no step by itself is more than chance
    assert not any(made.agree for made in quiet)


def test_each_step_is_from_one_calibration_to_the_next():
    said = [(100.0, "a"), (101.0, "b"), (99.0, "b"), (99.0, "c")]
    each = [calibration(x * np.ones(6), k, 1.0, recording) for k, (x, recording) in enumerate(said)]
    made = compare([DatedCalibration(f"{k}.json", START + timedelta(days=90 * k), c) for k, c in enumerate(each)])
    assert [(s.before, s.after, s.same_recording) for s in made.steps] == [(0, 1, False), (1, 2, True), (2, 3, False)]
    # d'(2 R)^-1 d of six alike: R has the eigenvalue 2.5 along them
    np.testing.assert_allclose([s.chi2 for s in made.steps], [6 / 5, 4 * 6 / 5, 0.0], atol=1e-9)
    assert {s.dof for s in made.steps} == {6}


def test_parameters_may_differ_together_where_none_does_by_itself():
    apart = 2.5 * np.array([1, -1, 1, -1, 1, -1])  # against the correlation: 37.5 / 1.4 of six degrees of freedom
    two = [
        DatedCalibration(f"{k}.json", START + timedelta(days=90 * k), calibration(100 + k * apart, k)) for k in range(2)
    ]
    said = compare(two).in_words
    golden_text(said)


@pytest.mark.parametrize(
    ("shape", "told"),
    [(lambda t: 0.5 * t + 15 * (t >= 20), ((20,), (), True)), (lambda t: 0.5 * t + 15 * (t == 20), ((), (20,), True)),
     (lambda t: 12 * (t >= 10) - 8 * (t >= 30), ((10, 30), (), False))],
)  # fmt: skip
def test_two_things_at_once_are_both_told(shape, told):
    # a jump was told alone beside a drift, a value that is off not at all, and two jumps made a drift
    for seed in range(8):
        made = compare(history(seed, 40, course("bias:x", list(shape(np.arange(40))))))
        c = next(c for c in made.histories if c.parameter.label == "bias:x")
        assert (c.jumps, c.outliers, c.drifts) == told
        assert ("drifts by" in made.in_words) == c.drifts
        assert made.in_words.count("jumped by") == len(c.jumps)
        assert np.isfinite(c.due) == c.drifts


def recorded(d):
    """The calibration with a day of its recordings."""
    origin = replace(d.calibration.provenance, recorded="2024-03-01")
    return replace(d, calibration=replace(d.calibration, provenance=origin))


def test_calibrations_stand_at_the_day_of_their_recordings():
    made = [replace(d, date=START) for d in history(3, 4)]
    golden_text(compare(made).in_words)
    made[1:] = map(recorded, made[1:])
    golden_text(compare(made).in_words)
    made[0] = recorded(made[0])
    assert "write date" not in compare(made).in_words
    assert made[0].calibration.provenance.date == "2024-03-01"


def test_a_parameter_stands_at_the_dates_of_those_that_tell_it():
    made = history(3, 4, course("bias:x", [0, 0, 0, 60]))
    x = made[1].calibration.values / SIGMA
    x[LABELS.index("bias:x")] = 0.0  # held
    compared = compare([made[0], replace(made[1], calibration=calibration(x, 1)), *made[2:]])
    bias = next(c for c in compared.histories if c.parameter.label == "bias:x")
    assert bias.at == (0, 2, 3)
    assert bias.time.tolist() == [0.0, 180 * 86400.0, 270 * 86400.0]
    row = next(r for r in compared.to_dict()["parameters"] if (r["name"], r["axis"]) == ("bias", "x"))
    assert row["jumps"] == [3]


def test_parameters_are_compared_by_name_whatever_was_usual_of_them():
    first, second = history(1, 2)
    wider = tuple(replace(p, sigma=3 * p.sigma) for p in second.calibration.parameters)
    other = replace(second, calibration=replace(second.calibration, parameters=wider))
    assert compare([first, other]).to_dict()["steps"] == compare([first, second]).to_dict()["steps"]


def test_scatter_beyond_the_sigmas_is_told_and_makes_no_drift():
    rng = np.random.default_rng(4)
    drifts, scatter = 0, []
    for seed in range(60):
        made = compare(history(seed, 8, course("bias:z", list(20 * rng.standard_normal(8)))))
        c = next(c for c in made.histories if c.parameter.label == "bias:z")
        scatter.append(c.scatter / SIGMA[2])
        assert c.moved
        assert not c.jumps or len(c.jumps) <= 2
        drifts += c.drifts
    assert np.median(scatter) == pytest.approx(20, rel=0.25)
    assert drifts <= 6  # three sigmas of Student's t with six degrees of freedom are 2.4 %
    golden_text(made.in_words)


def test_calibrations_of_the_same_recording_are_not_held_against_each_other():
    made = compare(history(1, 3, course("bias:x", [0, 50, 100]), recording="one"))
    assert all(s.same_recording for s in made.steps)
    assert not any(c.jumps for c in made.histories)
    golden_text(made.in_words)
    assert all(s["p_value"] is None for s in json.loads(as_json(made.to_dict()))["steps"])


def test_what_cannot_be_compared_is_refused():
    one = history(1)
    with refused():
        compare(one[:1])
    nothing = DatedCalibration("n", START + timedelta(days=1), calibration(np.zeros(6)))
    with refused():
        compare([one[0], nothing])
    for allowed in ({"drag": "1"}, {"bias": "many"}, {"bias": "5 ppm"}, {"bias:x": "-5 ug"}):
        with refused():
            compare(one, allowed=allowed)


def test_files_and_the_page(tmp_path):
    paths = [tmp_path / f"{k}.json" for k in range(3)]
    for k, path in enumerate(paths):
        path.write_text(json.dumps(calibration(100 + 20.0 * k * np.eye(6)[0], k).to_dict()))
    made = compare([dated_file(p) for p in paths[::-1]], "bench 4")
    assert [d.name for d in made.calibrations] == [str(p) for p in paths]
    content = made.printed
    page = history_report(content, [("2024-05-01T10:00", "Missing physics: warm up")])
    assert "History: bench 4" in page
    assert page.count('<div class="tiles">') == 1
    assert "Missing physics: warm up" in page
    rows = content.columns
    assert len(rows["value"]) == 18
    assert rows["value"][:3] == list(content.parameters[0].values)


def placed(k, moved, gravity=9.8, seed=3, last=3):
    """A calibration in a place whose gravity is known to 500 ppm; scale factors up to `last` moved by some sigmas."""
    rng = np.random.default_rng(seed + k)
    x = 100 + np.linalg.cholesky(R) @ rng.standard_normal(6) + moved * np.isin(np.arange(6), range(3, last + 1))
    made = calibration(x, k)
    u = np.where(np.arange(6) < 3, 0.0, 1 + made.values)
    P = made.covariance + 5e-4**2 * np.outer(u, u)
    made = replace(
        made, covariance=P, provenance=made.provenance.with_options(gravity=gravity, gravity_sigma_ppm=500.0)
    )
    return DatedCalibration(f"{k}.json", START + timedelta(days=90 * k), made)


def test_the_gravity_of_one_place_is_in_no_difference():
    made = compare([placed(0, 0.0), placed(1, 30.0)])
    golden_text(made.in_words)
    assert compare([placed(0, 0.0), placed(1, 0.0)]).agree
    p = [compare([placed(0, 0.0, seed=s), placed(1, 0.0, seed=s)]).steps[0].p_value for s in range(0, 200, 2)]
    assert np.mean(np.array(p) < 0.2) == pytest.approx(0.2, abs=0.1)


def test_gravities_of_two_places_are_not_in_common():
    made = compare([placed(0, 0.0), placed(1, 30.0, gravity=9.81, last=5)])
    assert made.agree
    assert "gravity" not in made.in_words
    assert made.to_dict()["common_gravity_sigma_ppm"] == 0.0


def test_the_console_calls_a_parameter_as_the_page_does():
    every = [p for effect in CATALOGUE.values() for p in parameters(effect, ("inner",))]
    assert [p for p in every if _parameter_name(p) not in name_in_words(p.name, p.axis).replace("_", " ")] == []
    told = {_parameter_name(p) for p in every}
    assert {"bias temperature y", "cubic nonlinearity z", "misalignment xy"} <= told
    assert not told & {"b T y", "K3 z"}
