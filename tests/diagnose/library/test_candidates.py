"""Candidates: one for each mechanism and axis of an effect, where the recording has what the effect needs."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.library.assemble import (
    assemble_library,
    available_effects,
    columns_at,
    power_of_harmonics,
    weighted_variants,
)
from gimbalcal.diagnose.library.candidates import (
    Candidate,
    Variant,
    by_mechanism,
    constant_choices,
    covariate_sources,
    is_eligible,
    of_effect,
)
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.effects import CATALOGUE, Effect, Stage, parameters
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import Array
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose.plant import at_strength, on, record

GIMBALS = ("platform", "inner", "middle")
RECORDING = record(np.random.default_rng(2), dwell=20)
S = stimulus_from_angles(RECORDING)


def groups(effect):
    cls = CATALOGUE[effect]
    found = by_mechanism(parameters(cls, GIMBALS), cls)
    return [(mechanism, axis, [f"{p.field}:{p.axis}" for p in ps]) for mechanism, axis, ps in found]


def test_axes_alone_and_together():
    assert groups("bias_drift") == [
        ("", "x", ["d:x"]), ("", "y", ["d:y"]), ("", "z", ["d:z"]), ("", "x, y, z", ["d:x", "d:y", "d:z"]),
    ]  # fmt: skip


def test_a_pair_of_axes_belongs_to_the_first_and_an_equatorial_one_to_the_equator():
    assert groups("cross_coupling")[0] == ("", "x", ["K_c:xy", "K_c:xz"])
    assert [axis for _, axis, _ in groups("gyro_drift")] == ["equatorial", "polar", "equatorial, polar"]


def test_a_second_mechanism_is_a_candidate_of_its_own():
    found = groups("gimbal_flexure")
    assert ("", "inner", ["kappa_1:inner", "kappa_2:inner"]) in found
    assert ("carried", "inner", ["kappa_3:inner", "kappa_4:inner"]) in found
    assert [axis for mechanism, axis, _ in found if mechanism == "carried"] == list(GIMBALS)


def test_terms_of_a_series_are_candidates_with_all_of_lower_order():
    """A worm on one axis: its fundamental alone, and with harmonics up to the second, third, fourth and fifth."""
    cls = CATALOGUE["periodic_worm_error"]
    own = [(m, [p.label for p in ps]) for m, _, ps in by_mechanism(parameters(cls, ("hour",)), cls)]
    assert [m for m, _ in own] == ["", "to order 2", "to order 3", "to order 4", "to order 5"]
    assert [len(labels) for _, labels in own] == [2, 4, 6, 8, 10]
    assert own[1][1] == ["worm_sin:hour", "worm_cos:hour", "worm_2_sin:hour", "worm_2_cos:hour"]


def test_numbers_of_a_scan_stand_for_those_nearest_to_them():
    """Every tenth number was scanned: nine about a peak weigh as the 18 numbers and a half step that they stand for."""
    every = np.arange(30.0, 2000.0, 10.0)
    near = np.linspace(171.0, 189.0, 9)
    variants = [Variant((("teeth", m),), (0,)) for m in near]
    weight = np.array([v.weight for v in weighted_variants(variants, len(every), every)]) * near * np.mean(1 / every)
    assert weight.sum() == pytest.approx((18 + 10) / 10, rel=1e-9)
    assert weight[4] == pytest.approx(0.225, rel=1e-9)


def test_harmonics_are_summed_at_the_multiples_of_a_number():
    every = np.arange(30.0, 1000.0, 6.0)
    power = np.zeros(len(every))
    for k in (1, 2, 3, 4):
        power[round((180 * k - 30) / 6)] = 1.0
    numbers, total = power_of_harmonics(power, every, 5)
    assert numbers[np.argmax(total)] == 180
    assert total.max() == 4


def test_one_vector_is_one_candidate():
    assert groups("position_blunder") == [("", "", ["delta:x", "delta:y", "delta:z"])]


def test_two_mechanisms_of_one_axis_are_two_causes():
    found = [
        c for c in assemble_library(fit_baseline(view_at_known_attitude(RECORDING))).candidates if c.axis == "inner"
    ]
    flexure = [c for c in found if c.effect == "gimbal_flexure"]
    assert len({c.key for c in flexure}) == len(flexure) == 2


def test_what_happens_once_is_told_by_its_constants():
    assert Candidate("bias_step", "x", (), ()).once
    assert Candidate("position_blunder", "", (), ()).once
    assert not Candidate("warm_up", "x", (), ()).once
    assert not Candidate("unknown time", "x", (), (), rival="a smooth function of time").once


def test_columns_stand_where_the_variants_say():
    o = fit_baseline(view_at_known_attitude(RECORDING))
    made = assemble_library(o)
    c = next(c for c in made.candidates if c.label == "warm_up:y")
    for v in c.variants:
        assert np.allclose(made.X[:, list(v.index)], columns_at(o, c, v.constants))
    assert [v.constants for v in c.variants] == constant_choices(CATALOGUE["warm_up"], o.view.stimulus)


EVERYWHERE = frozenset(Stage)


@pytest.mark.parametrize(
    ("effect", "known", "unknown"),
    [
        ("bias_drift", True, True),
        ("readout_curve", False, False),  # says a shape
        ("frame_misalignment", False, False),  # a part of misalignment
        ("slow_bias_drift", False, True),  # what a stated noise holds
        ("dead_zone", True, True),  # bends with its size
        ("base_tilt_diurnal", True, False),  # 40 min of a day
        ("bias_temperature", True, True),
        ("pressure", False, False),  # not logged
        ("lever_arm", False, False),  # nothing turns
        ("refraction", False, False),  # another kind of recording
    ],
)
def test_an_effect_says_where_it_is_a_candidate(effect, known, unknown):
    cls = CATALOGUE[effect]
    assert is_eligible(cls, "multi-position", S, EVERYWHERE, scale_known=True) == known
    assert is_eligible(cls, "multi-position", S, EVERYWHERE, scale_known=False) == unknown
    assert not is_eligible(cls, "multi-position", S, frozenset(), scale_known=True)


def test_what_the_model_holds_is_not_missing_from_it():
    o = fit_baseline(view_at_known_attitude(RECORDING))
    assert "bias_drift" in available_effects(o.view)
    assert "bias_drift" not in available_effects(replace(o.view, baseline=("bias_drift",)))


def test_a_unit_without_gimbals_does_not_say_where_north_is():
    bare = S.at(attitude=None)
    assert is_eligible(CATALOGUE["magnetic_field"], "multi-position", S, EVERYWHERE, scale_known=True)
    assert not is_eligible(CATALOGUE["magnetic_field"], "multi-position", bare, EVERYWHERE, scale_known=True)


def test_finer_constants_are_found_between_those_of_the_grid():
    """A warm-up of 700 s, which is none of the starting values, comes back with its time constant."""
    from gimbalcal.diagnose import diagnose

    r = at_strength(5, lambda b: on(0, np.exp(-b.t / 700.0)), 60.0)
    (found,) = diagnose([r]).findings
    tau = next(p for p in found["parameters"] if p["name"] == "tau")
    assert found["effect"] == "warm_up"
    assert abs(tau["value"] * 3600 - 700.0) < 4 * max(tau["sigma"] * 3600, 10.0)


def test_an_effect_of_any_covariate_is_tried_with_each():
    x = S.time
    logged = S.at(covariates={"fan": x, "pressure": x})
    assert covariate_sources(CATALOGUE["bias_drift"], logged) == ("",)
    assert covariate_sources(CATALOGUE["bias_covariate"], logged) == ("fan",)  # pressure has an effect of its own
    assert covariate_sources(CATALOGUE["bias_covariate"], S) == ()


def test_every_combination_of_constants_is_a_variant_with_columns_of_its_own():
    cls = CATALOGUE["bias_temperature_lagged"]
    wanted, tried = parameters(cls), constant_choices(cls, S)
    blocks: list[Array] = [np.zeros((4, 5))]
    seen: list[Effect] = []

    def columns(made):
        seen.append(made)
        X = np.zeros((4, len(wanted)))
        X[:, :2] = 1.0  # the z axis shows nothing
        return X

    found = of_effect(cls, "", wanted, tried, S, columns, blocks)
    assert [c.axis for c in found] == ["x", "y", "x, y, z"]
    assert [dict(v.constants)["tau"] for v in found[0].variants] == [vars(e)["tau"] for e in seen]
    assert sorted({i for c in found for v in c.variants for i in v.index}) == list(range(5, 5 + 3 * len(tried)))
    assert sum(b.shape[1] for b in blocks) == 5 + 3 * len(tried)
    for c in found:
        for k, v in enumerate(c.variants):
            assert v.index == tuple(5 + 3 * k + wanted.index(p) for p in c.parameters)
