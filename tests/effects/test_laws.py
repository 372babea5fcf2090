"""Every effect adds what its source says: an independent number for each, and the formula of its card, read."""

from collections.abc import Mapping

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE
from tests.effects.formula import card_formula, evaluated
from tests.effects.mount_laws import MOUNT_LAWS
from tests.effects.sensor_laws import SENSOR_LAWS
from tests.effects.stimulus import example, given

NAMES: Mapping[str, Mapping[str, str]] = {  # where a formula and the code spell a parameter differently
    "base_tilt_drift": {"dot psi": "psi"},
    "bias_step": {"t_0": "epoch"},
    "gimbal_zero_step": {"t_0": "epoch"},
    "case_rotation_residue": {"P": "period"},
    "cross_coupling": {"K": "K_c"},
    "encoder_cyclic_error": {"N": "lines"},
    "encoder_harmonic": {"n": "order"},
    "gimbal_zero_drift": {"dot theta_0": "rate"},
    "gravity_tide": {"P": "period"},
    "gyro_bias_drift": {"dot epsilon": "rate"},
    "magnetic_field": {"D": "declination"},
    "periodic_worm_error": {"N": "teeth"},
    "plumb_line_tide": {"P": "period"},
    "position_blunder": {"p_0": "position"},
    "schuler_oscillation": {"P": "period", "lambda": "damping"},
    "servo_limit_cycle": {"P": "period"},
    "slow_bias_drift": {"T": "span"},
    "time_tag_latency": {"delta t": "latency"},
    "gyro_latency": {"delta t": "latency"},
    "readout_latency": {"delta t": "latency"},
}
NOT_PARSED: Mapping[str, str] = {}  # id: reason; may only shrink, and has
SMOOTHED = {  # a sign that passes zero smoothly: 1 mg of a move of 0.05 g, 1 mrad of one of 0.3 rad
    "accelerometer_hysteresis": 1e-3,
    "gimbal_friction": 1e-5,
}
LAWS = {**SENSOR_LAWS, **MOUNT_LAWS}
ALL = sorted(CATALOGUE)
SEEDS = (1, 2)


def off_its_law(name, cls=None):
    """Largest difference from the independent number, as a share of the largest number, over random stimuli."""
    worst = 0.0
    for seed in SEEDS:
        s, made = given(seed), example(name, cls)
        expected, found = LAWS[name][1](s, made), made.contribution(s)
        assert found.shape == expected.shape, f"{name} returns {found.shape}, its law {expected.shape}"
        off = float(np.abs(found - expected).max() / np.abs(expected).max())
        worst = max(worst, off if np.isfinite(off) else np.inf)
    return worst


def test_every_effect_has_a_law_of_its_own():
    missing = sorted(set(CATALOGUE) - set(LAWS))
    assert not missing, (
        f"{missing}: write the law again from its source, in plain numpy, in tests/effects/sensor_laws.py or "
        "tests/effects/mount_laws.py: an entry `id: (source, lambda s, p: ...)` with the stimulus s and the fields of p"
    )
    assert sorted(LAWS) == ALL, f"{sorted(set(LAWS) - set(CATALOGUE))} left the catalogue: delete the law too"


@pytest.mark.parametrize("name", ALL)
def test_contribution_is_the_independent_number(name):
    assert off_its_law(name) < 1e-12


@pytest.mark.parametrize("name", [n for n in ALL if n not in NOT_PARSED])
def test_the_card_s_formula_is_what_the_code_computes(name):
    for seed in SEEDS:
        s, made = given(seed).at(sense=()), example(name)  # readouts counted as the drawing counts them
        found = made.contribution(s)
        printed = np.zeros_like(found)
        formula = evaluated(card_formula(CATALOGUE[name]), made, s, NAMES.get(name, {}))
        printed[..., : formula.shape[-1]] = formula  # a formula of two components leaves the third at zero
        assert np.abs(printed - found).max() < SMOOTHED.get(name, 1e-12) * np.abs(found).max()


def test_every_card_is_read():
    assert len(NOT_PARSED) == 0, "a card that cannot be parsed is rewritten; this list may only shrink"
