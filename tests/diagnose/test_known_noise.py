"""Verdicts on an independent plant: clean, one cause, twins, none of the known ones, and how honest the sizes are."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose, known_noise
from gimbalcal.diagnose.verdict.verify import verify
from gimbalcal.errors import InputError
from tests.diagnose.plant import UG, at_strength, known, on, record, strange, strength
from tests.golden import golden_text, refused

SIGMAS = 20.0


@cache
def diagnosed(name, axis=0, seed=11, **options):
    error = {**{k: v[0] for k, v in known(axis).items()}, **strange(axis)}[name]
    return diagnose([at_strength(seed, error, SIGMAS, **options)])


def test_a_clean_recording_is_adequate():
    d = diagnose([record(np.random.default_rng(2))])
    assert d.verdict == "adequate"
    assert d.findings == ()
    assert d.mismatch == ()
    assert d.fit["chi2_reduced_before"] == pytest.approx(1.0, abs=0.3)  # 270 degrees of freedom: 3.5 sigma
    assert d.provenance["false_alarm_rate_simulated"] <= 0.02


def test_a_stated_noise_of_zero_tells_none():
    made = record(np.random.default_rng(2))
    with pytest.raises(InputError, match="are stated to have no noise, and without a noise nothing can be weighed"):
        diagnose([replace(made, noise={**made.noise, "accelerometer": 0.0})])


@pytest.mark.parametrize(("name", "axis"), [("asymmetry", 1), ("scale T", 2), ("two-cycle", 0), ("friction", 0)])
def test_one_cause_is_named(name, axis):
    d = diagnosed(name, axis)
    (found,) = d.findings
    assert found["effect"] in known(axis)[name][1]
    assert found["probability"] == 0.9  # the most that is ever stated
    assert found["sigma"] == pytest.approx(SIGMAS, abs=4.5)  # its own noise of one sigma, and the noise that was fitted
    assert d.fit["chi2_reduced_after"] == pytest.approx(1.0, abs=0.3)
    assert d.fit["heldout_after"] == pytest.approx(1.0, abs=0.35)
    assert d.fit["heldout_before"] > 1.3 * d.fit["heldout_after"]
    assert d.fit["scan_p_after"] > 0.01
    assert d.mismatch[0]["p_value"] < 1e-3


def test_a_cause_with_which_rows_held_out_are_predicted_worse_is_doubtful(monkeypatch):
    def worse(*args):
        fit = verify(*args)
        return replace(fit, heldout_before=fit.heldout_after, heldout_after=fit.heldout_before)

    monkeypatch.setattr(known_noise, "verify", worse)
    d = diagnose([at_strength(11, known(1)["asymmetry"][0], SIGMAS)])
    assert d.verdict == "not-identifiable"
    assert [f.probability < 0.5 for f in d.findings] == [True]


def test_twins_stand_together_with_the_experiment_that_separates_them():
    d = diagnosed("cubic", rows=120)  # so that a cubic of so many sigmas is small
    (found,) = d.findings
    assert d.verdict == "not-identifiable"
    assert {found["effect"], *found["twins"]} == {"cubic_nonlinearity", "odd_quadratic", "soft_saturation"}
    assert "30 and 60 degrees" in found["separate_by"]


@pytest.mark.parametrize("name", ["scrambled", "mixed angle"])
def test_what_no_catalogue_holds_is_not_named_by_force(name):
    d = diagnosed(name, 1)
    assert d.verdict == "unexplained"
    assert d.findings == ()
    assert "y" in d.unexplained[0]["channel"]


def test_without_the_thermometer_its_effect_is_a_shape_in_time():
    error, _ = known(0)["bias T"]
    seed = 4
    seen = diagnose([at_strength(seed, error, SIGMAS)])
    blind = diagnose([at_strength(seed, error, SIGMAS, hide=("temperature",))])
    assert seen.findings[0]["effect"] == "bias_temperature"
    assert blind.verdict == "unexplained"
    assert "time" in blind.unexplained[0]["shape"]


def test_two_causes_at_once():
    def both(b):
        a = known(0)["scale T"][0](b)["output"] * 2.0
        return {"output": a + known(2)["asymmetry"][0](b)["output"] * 30 * a.std() / a.std()}

    d = diagnose([at_strength(8, both, 40.0)])
    assert {f["effect"] for f in d.findings} == {"scale_temperature", "scale_factor_asymmetry"}


def test_sizes_lie_within_their_sigmas():
    """An effect of known size on eight recordings: errors over stated sigmas have spread one."""

    def error(b):
        return on(1, np.abs(b.ideal[:, 1]))

    def of(size):
        return record(np.random.default_rng(0), error, size)

    size = 3 * UG * SIGMAS / strength(of, 3 * UG)
    pulls = []
    for seed in range(8):
        found = diagnose([record(np.random.default_rng(seed), error, size)]).findings[0]
        p = found["parameters"][0]
        pulls.append((p["value"] * 1e-6 * 9.80146 - size) / (p["sigma"] * 1e-6 * 9.80146))
    assert np.max(np.abs(pulls)) < 3.2  # the largest of eight normal numbers exceeds it once in 100
    assert 0.35 < np.std(pulls) < 1.8  # 0.1 % tails of the spread of eight


def test_the_answer_is_json_and_the_same_again():
    d = diagnosed("asymmetry", 1)
    again = json.loads(json.dumps(d.to_dict()))
    assert set(again) >= {"format", "verdict", "mismatch", "findings", "unexplained", "fit", "provenance"}
    assert again["format"] == 1


def test_nothing_to_diagnose_is_refused():
    with refused():
        diagnose([])


def interchanged(r):
    """Return a recording in which the angles of positions 4 and 10 stand at each other's rows."""
    channels = dict(r.channels)
    for axis in ("platform", "inner", "middle"):
        angle = channels["gimbal_angle", axis].copy()
        four, ten = angle[r.position == 4][0], angle[r.position == 10][0]
        angle[r.position == 4], angle[r.position == 10] = ten, four
        channels["gimbal_angle", axis] = angle
    return replace(r, channels=channels)


def test_interchanged_positions_are_told_from_physics():
    """They are a fault of the recording; the others calibrate the unit, and nothing else is missing."""
    d = diagnose([interchanged(record(np.random.default_rng(3)))])
    assert d.verdict == "unexplained"
    assert [u.channel for u in d.unexplained] == ["position 4", "position 10"]
    assert d.fit["chi2_reduced_after"] < 1.3
    golden_text(d.in_words)


def test_what_is_missing_besides_interchanged_positions_is_found():
    error, ids = known(1)["asymmetry"]
    d = diagnose([interchanged(at_strength(11, error, SIGMAS))])
    assert {f["effect"] for f in d.findings} == ids
    assert "interchanged" in d.outcome


def test_a_bearing_of_the_third_order_is_named_with_its_order():
    """Three lobes: at steps of 45 degrees the third order is the last below that of Nyquist."""

    def error(b):
        phase = 3 * b.read[:, 1] + 0.4
        lean = np.zeros((len(b.t), 3, 3))
        lean[:, 1] = np.stack([0 * phase, np.cos(phase), np.sin(phase)], axis=-1)  # across the inner axis, x
        return {"lean": lean}

    (found,) = diagnose([at_strength(11, error, SIGMAS)]).findings
    assert (found["effect"], found["axis"]) == ("bearing_wobble", "inner")
    sizes = {p["name"]: p["value"] for p in found["parameters"]}
    assert sizes["m"] == 3.0
    assert np.arctan2(sizes["wobble_sin"], sizes["wobble_cos"]) == pytest.approx(0.4, abs=0.15)  # 3 of 25 sigma
