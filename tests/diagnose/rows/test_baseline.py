"""Which effects a model can hold, and the sentence that says why not."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.entry import check_baseline, check_finite
from gimbalcal.diagnose.of_recording import why_not_in_model
from gimbalcal.effects import CATALOGUE, known_effect
from gimbalcal.platform import BENCH
from gimbalcal.views.core import by_triad
from tests.diagnose import static_plant
from tests.diagnose.plant import record
from tests.diagnose.small import telescope
from tests.golden import refused

TABLE = record(np.random.default_rng(1), dwell=2)
REST = static_plant.record(np.random.default_rng(1))
BARE = replace(TABLE, channels={k: v for k, v in TABLE.channels.items() if k[0] != "temperature"})
LOGS = replace(TABLE, channels={**TABLE.channels, ("covariate", "fan"): TABLE.time, ("covariate", "hum"): TABLE.time})
ONE = replace(TABLE, channels={**TABLE.channels, ("covariate", "fan"): TABLE.time})


@pytest.mark.parametrize(
    ("effect", "recording", "why"),
    [
        ("bias_temperature", TABLE, ""),
        ("bias_temperature", BARE, "needs temperature, and 'plant' has none"),
        ("bias_covariate", TABLE, "needs covariate, and 'plant' has none"),
        ("bias_covariate", LOGS, "follows one covariate, and 'plant' has 2 of them"),
        ("bias_covariate", ONE, ""),
        ("refraction", TABLE, "shows in pointing recordings, and 'plant' is a multi-position recording"),
        ("refraction", telescope(1), ""),
        ("magnetic_field", TABLE, ""),
        ("magnetic_field", replace(TABLE, platform=BENCH), "needs gimbals, which say where north is, and 'plant' has"),
    ],
)
def test_a_sentence_says_why_not(effect, recording, why):
    said = why_not_in_model(effect, recording)
    assert said.startswith(why)
    assert bool(said) is bool(why)


def test_a_baseline_is_refused_only_where_no_recording_can_hold_it():
    check_baseline(["bias_temperature"], [BARE, TABLE])
    check_baseline([], [BARE])
    with refused():
        check_baseline(["bias", "bias_temperature"], [BARE])
    with refused():
        known_effect("bais", "baseline")
    assert known_effect("bias") is CATALOGUE["bias"]


def test_effects_belong_to_the_triad_that_they_act_on():
    """A drift of the platform has a gyroscope's name and is none of a sensor's outputs."""
    forces, rates = by_triad(["bias", "gyro_bias", "misalignment", "gyro_g_sensitivity_rate", "gyro_drift"])
    assert rates == ["gyro_bias", "gyro_g_sensitivity_rate"]
    assert forces == ["bias", "misalignment", "gyro_drift"]


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_no_number_is_named_by_row_and_channel(value):
    check_finite(TABLE)
    y = TABLE.channels["specific_force", "y"].copy()
    y[[4, 7]] = value
    with refused():
        check_finite(replace(TABLE, channels={**TABLE.channels, ("specific_force", "y"): y}))
