"""Effects added to a fit by name: fitted with their constants, by every method, or refused in one sentence."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal import calibrate
from gimbalcal.calibration import from_dict
from gimbalcal.estimate.extra_effects import extra_effects
from gimbalcal.estimate.unit import inertial_unit
from gimbalcal.pipeline import load, three_stage
from gimbalcal.platform import BENCH
from gimbalcal.recording import block_means
from gimbalcal.simulate import simulate
from tests.benchmarks import unknown_hand
from tests.diagnose.plant import ARCSEC, UG, known, record
from tests.golden import golden_text, refused
from tests.paths import STATIC, XSENS


def positions(kind="bias T", size=30 * UG, **options):
    return record(np.random.default_rng(4), known(1)[kind][0], size, **options)


def estimate(made, label):
    again = from_dict(json.loads(json.dumps(made.to_dict())))
    at = [p.label for p in again.parameters].index(label)
    return float(again.values[at]), float(again.sigmas[at])


def test_an_effect_that_is_added_takes_up_what_was_left():
    r = positions(dwell=12)
    without, made = three_stage([r]), three_stage([r], more=extra_effects(["bias_temperature:y"], [r]))
    golden_text(without.outcome)
    assert made.outcome == ""
    value, sigma = estimate(made, "b_T:y")
    assert value == pytest.approx(30 * UG, abs=4 * sigma)
    assert sigma < 3 * UG
    assert not {"b_T:x", "b_T:z"} & {p.label for p in made.parameters}
    assert three_stage([made.apply(r)]).outcome == ""


def test_a_constant_is_the_one_that_fits_best_or_the_one_that_is_stated():
    r = positions("warm-up", 3000 * UG, dwell=12)
    made = three_stage([r], more=extra_effects(["warm_up:y"], [r]))
    value, sigma = estimate(made, "warm_up.tau")
    assert value == pytest.approx(700, abs=4 * sigma)
    assert 0 < sigma < 200
    told = three_stage([r], more=extra_effects(["warm_up:y,tau=0.25"], [r]))
    assert estimate(told, "warm_up.tau") == (pytest.approx(900.0), 0.0)
    assert made.residual.chi2 < told.residual.chi2


def test_a_position_that_was_not_set_is_found_among_all():
    r = positions("blunder", 40 * ARCSEC, dwell=12)
    assert "mis-set" in three_stage([r]).outcome
    made = three_stage([r], more=extra_effects(["position_blunder"], [r]))
    assert made.outcome == ""
    assert estimate(made, "position_blunder.position")[0] == 6  # counted from one
    assert not made.provenance["left_out"]


def test_a_static_run_and_both_together_take_it_too():
    (run,) = load([STATIC])
    table, run = positions(size=0.0, dwell=6), block_means(run, 20)
    alone = three_stage([run], more=extra_effects(["gyro_drift:equatorial"], [run]))
    assert {p.axis for p in alone.parameters if p.effect == "gyro_drift"} == {"equatorial_x", "equatorial_y"}
    both = three_stage([table, run], more=extra_effects(["cross_coupling:z"], [table, run]))
    singly = [three_stage([r], more=extra_effects(["cross_coupling:z"], [r])) for r in (table, run)]
    sigma = [estimate(made, "K_c:zx")[1] for made in (both, *singly)]
    assert sigma[0] < min(sigma[1:])
    golden_text(both.outcome)  # they are of two units


def test_units_turned_by_hand_take_it_at_rest_and_on_the_way():
    r, truth = simulate("turned-unit")
    r = replace(r, platform=BENCH, channels={k: v for k, v in r.channels.items() if k[0] != "gimbal_angle"})
    asked = extra_effects(["gyro_g_sensitivity_rate:z", "gyro_scale_nonlinearity", "scale_factor_asymmetry:x"], [r])
    linear = ("bias", "scale_factor", "misalignment", "gyro_scale_factor", "gyro_misalignment")
    made = inertial_unit(r, linear, asked)
    of = {e.id: e for e in truth}
    wanted = [p for p in made.parameters if p.effect in ("gyro_g_sensitivity_rate", "gyro_scale_nonlinearity")]
    assert {p.label for p in wanted if p.effect == "gyro_g_sensitivity_rate"} == {
        f"gyro_g_sensitivity_rate:z{a}" for a in "xyz"
    }
    for p in wanted:
        value, sigma = estimate(made, p.label)
        assert value == pytest.approx(getattr(of[p.effect], p.field)[p.index], abs=4.5 * sigma), p.label
    value, sigma = estimate(made, "asymmetry:x")  # which nobody put in
    assert abs(value) < 4 * sigma


@pytest.mark.parametrize(
    "words",
    [
        "bias_temperture:y",
        "bias_temperature:q",
        "warm_up,tau",
        "warm_up,lag=1",
        "warm_up,tau=soon",
        "warm_up,tau=1e9",
        "gyro_drift",
        "pressure",
        "bias",
    ],
)
def test_what_cannot_be_added_is_one_sentence(words):
    with refused():
        extra_effects([words], [positions(dwell=4)], ("bias",))


def test_what_needs_an_angle_is_refused_where_none_is_known():
    (r,) = load([XSENS])
    with refused():
        extra_effects(["gimbal_flexure"], [r])
    with refused(choice="lever_arm"):
        inertial_unit(r, (), extra_effects(["base_tilt_drift"], [r]))


def test_an_effect_of_the_size_of_a_consumer_unit_is_fitted_and_not_held():
    """The usual sizes of the catalogue are those of a navigation unit, and of a channel per unit as it was logged."""

    def squared(h):
        return {"force": np.outer((h.supply - h.supply.mean()) ** 2, [0, 0, 1.0])}

    r = unknown_hand.record(7, unknown_hand.Setup(supply=True, rests=44), ((squared, 0.15),))
    made = calibrate(r, more=["bias_covariate_squared:z"])
    (k,) = [p for p in made.to_dict()["parameters"] if p["name"] == "bias_per_squared_covariate"]
    assert abs(k["value"] - 150000) < 4 * k["sigma"] < 40000
