"""Several recordings of one unit: what neither shows alone, what only one shows, and what they do not agree on."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.evidence.odds import SINGLE, UNKNOWN
from gimbalcal.diagnose.known_noise import compare_causes
from gimbalcal.diagnose.of_recording import baseline_of
from gimbalcal.diagnose.search.combine import combine_rankings, matched_candidates
from gimbalcal.diagnose.search.ranking import Ranking
from gimbalcal.platform import KNOWN
from gimbalcal.recording import Source
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose import static_plant
from tests.diagnose.plant import UG, G, at_strength, known, on, record, strange, strength
from tests.golden import golden_text, refused

CLAIMED = 4.0  # sigmas in each of two sweeps: 5.7 together
CLEAR = 20.0


def asymmetry(axis):
    """|f| of one accelerometer, on the table and at rest."""

    def at_rest(r):
        out = np.zeros_like(r.ideal)
        out[:, axis] = np.abs(r.ideal[:, axis])
        return out

    return (lambda b: on(axis, np.abs(b.ideal[:, axis]))), at_rest


@cache
def sweep(name, seed, sigmas, **options):
    error = {**{k: v[0] for k, v in known(1).items()}, **strange(1)}[name]
    return at_strength(seed, error, sigmas, **options)


@cache
def pair(name, sigmas, **options):
    return diagnose([sweep(name, seed, sigmas, **options) for seed in (50, 51)])


def test_what_neither_recording_shows_alone_is_claimed_and_named_together():
    d = pair("asymmetry", CLAIMED, rows=120)
    alone = [r["alone"] for r in d.fit["recordings"]]
    assert [a["verdict"] for a in alone] == ["adequate", "adequate"]
    assert d.verdict == "missing-physics"
    (found,) = d.findings
    assert (found["effect"], found["axis"]) == ("scale_factor_asymmetry", "y")
    assert found["probability"] == 0.9  # the most that is ever stated
    # the plant draws other noise in each: two numbers of unit spread added in squares
    assert found["sigma"] == pytest.approx(CLAIMED * np.sqrt(2), abs=3)
    assert d.provenance["ln_bayes_factor"] > d.provenance["ln_bayes_factor_needed"]
    assert max(a["ln_bayes_factor"] for a in alone) < d.provenance["ln_bayes_factor_needed"]
    golden_text(d.in_words)


def test_the_size_is_the_weighted_mean_of_both():
    (found,) = pair("asymmetry", CLAIMED, rows=120).findings
    x, s = (np.array([r["parameters"][0][k] for r in found["recordings"]]) for k in ("value", "sigma"))
    mean = found["parameters"][0]
    assert mean["value"] == pytest.approx(np.sum(x / s**2) / np.sum(1 / s**2), rel=1e-6)
    assert mean["sigma"] == pytest.approx(1 / np.sqrt(np.sum(1 / s**2)), rel=1e-6)
    assert found["agreement"]["dof"] == 1
    assert found["agreement"]["chi2"] == pytest.approx(np.sum((x - mean["value"]) ** 2 / s**2), abs=1e-3)
    assert found["agreement"]["in_words"] == ""


@pytest.mark.parametrize("seeds", [(1, 2), (3, 4)])
def test_clean_recordings_are_adequate_together(seeds):
    d = diagnose([record(np.random.default_rng(seed), unit=np.random.default_rng(9)) for seed in seeds])
    assert d.verdict == "adequate"
    assert d.mismatch == d.findings == ()
    assert d.provenance["false_alarm_rate_simulated"] <= 0.02
    assert d.fit["chi2_reduced_before"] == pytest.approx(1.0, abs=0.25)  # 540 degrees of freedom: 4 sigma


@cache
def device_and_rest(axis):
    """12 sigma on the table, and as large an effect at rest."""
    table, at_rest = asymmetry(axis)

    def of(size):
        return record(np.random.default_rng(21), table, size)

    size = 3 * UG * 12 / strength(of, 3 * UG)
    return diagnose([of(size), static_plant.record(np.random.default_rng(22), at_rest, size)]), size


def test_table_and_static_run_see_one_effect():
    d, size = device_and_rest(1)
    (found,) = d.findings
    assert (found["effect"], found["axis"]) == ("scale_factor_asymmetry", "y")
    assert [r["recording"] for r in found["recordings"]] == [1, 2]
    x = found["parameters"][0]
    assert x["value"] == pytest.approx(size / UG * 9.80665 / G, abs=3.5 * x["sigma"])  # missed once in 2000
    assert x["sigma"] < min(r["parameters"][0]["sigma"] for r in found["recordings"])
    assert found["agreement"]["p_value"] > 1e-3
    assert d.fit["heldout_after"] < d.fit["heldout_before"]


def test_what_only_the_table_shows_is_its_own():
    """At rest the vertical accelerometer feels the same all day: asymmetry is a part of its bias there."""
    d, _ = device_and_rest(2)
    (found,) = d.findings
    assert (found["effect"], found["axis"]) == ("scale_factor_asymmetry", "z")
    assert [r["recording"] for r in found["recordings"]] == [1]
    assert found["agreement"] == {"chi2": 0.0, "dof": 0, "p_value": 1.0, "in_words": ""}
    assert {m["recording"] for m in d.mismatch} == {1}


def test_a_size_that_differs_is_said():
    d = diagnose([sweep("asymmetry", seed, size, rows=120) for seed, size in ((31, CLEAR), (32, -CLEAR))])
    (found,) = d.findings
    assert found["effect"] == "scale_factor_asymmetry"
    assert found["agreement"]["p_value"] < 1e-6
    golden_text(d.in_words)


def test_what_happens_once_belongs_to_one_recording():
    d = diagnose([sweep("asymmetry", 41, 0.0), sweep("blunder", 42, CLEAR)])
    (found,) = d.findings
    assert found["effect"] == "position_blunder"
    assert [r["recording"] for r in found["recordings"]] == [2]
    assert next(p["value"] for p in found["parameters"] if p["name"] == "position") == 6
    golden_text(d.fit["recordings"][0]["alone"]["in_words"])


def test_a_lag_is_common_to_the_recordings():
    d = pair("lagged T", CLEAR)
    (found,) = d.findings
    tau = next(p for p in found["parameters"] if p["name"] == "tau")
    assert found["effect"] == "bias_temperature_lagged"
    assert tau["unit"] == "h"
    assert tau["value"] == pytest.approx(1200 / 3600, abs=3.5 * tau["sigma"])
    assert 0 < tau["sigma"] < 0.15


def test_what_no_catalogue_holds_stays_unnamed_although_likenesses_add_up():
    d = pair("scrambled", 15.0)
    assert d.verdict == "unexplained"
    assert d.findings == ()
    assert d.unexplained[0]["recordings"] == [1, 2]
    assert "every recording" in d.unexplained[0]["channel"]


def of_candidates(*told):
    """A search over candidates (key, once, rival)."""
    every = tuple(SimpleNamespace(key=(key,), once=once, rival=rival) for key, once, rival in told)
    return SimpleNamespace(library=SimpleNamespace(candidates=every))


def test_what_happens_once_is_of_one_recording_and_a_shape_of_one_or_of_all_that_show_it():
    drift, step, sine = ("drift", False, ""), ("step", True, ""), ("sine", False, "sine")
    candidates, place = matched_candidates(
        [of_candidates(step, drift, sine), of_candidates(drift, step), of_candidates(sine)]
    )
    found = sorted((c.key[0], *map(int, at)) for c, at in zip(candidates, place, strict=True))
    assert found == [("drift", 1, 0, -1), ("sine", -1, -1, 0), ("sine", 2, -1, -1), ("sine", 2, -1, 0),
                     ("step", -1, 1, -1), ("step", 0, -1, -1)]  # fmt: skip


def test_a_recording_that_does_not_see_a_cause_says_what_it_does_without():
    place = np.array([[0, 0], [1, -1]])
    both = Ranking(None, (), np.zeros(2), places=place)
    values = [np.array([1.0, 2.0]), np.array([10.0])]
    np.testing.assert_array_equal(both.summed(values), [11.0, 2.0])
    np.testing.assert_array_equal(both.summed(values, [np.array(100.0), np.array(7.0)]), [11.0, 9.0])


def test_order_does_not_matter_and_singles_add_up():
    with threadpool_limits(limits=1):
        made = (record(np.random.default_rng(seed)) for seed in (1, 2))
        a, b = (compare_causes(view_at_known_attitude(r), None, str) for r in made)
        one, other = combine_rankings([a, b]), combine_rankings([b, a])
    assert one.ln_total == pytest.approx(other.ln_total, abs=1e-9)
    label = "scale_factor_asymmetry:y"
    alone = [s.singles[[c.label for c in s.library.candidates].index(label)] for s in (a, b)]
    both = next(h for h in one.hypotheses if [one.library.candidates[m].label for m in h.members] == [label])
    assert both.ln_bayes == pytest.approx(sum(alone), abs=1e-12)
    rival = np.array([bool(c.rival) for c in one.library.candidates])
    assert np.exp(one.share[~rival]).sum() == pytest.approx(SINGLE)
    assert np.exp(one.share[rival]).sum() == pytest.approx(UNKNOWN)


def test_a_constant_that_one_recording_calibrates_is_in_the_model_of_all():
    table, rest = record(np.random.default_rng(1)), static_plant.record(np.random.default_rng(1))
    for others in ([table, rest], [rest, rest]):
        assert "scale_nonlinearity" in baseline_of(rest, others, ())
    assert "base_tilt" not in baseline_of(table, [table, rest], ())


def test_recordings_that_do_not_belong_together_are_refused():
    r = record(np.random.default_rng(1))
    with refused():
        diagnose([r, r])
    file = (Source("a/recording.toml", "0" * 64), Source("a/samples.csv", "1" * 64))
    with refused():
        diagnose([replace(r, source=file), replace(r, source=file)])
    with refused():
        diagnose([r, replace(r, platform=KNOWN["three-axis-table"])])
    with refused():
        diagnose([r, replace(r, kind="pointing", platform=KNOWN["alt-az"])])
