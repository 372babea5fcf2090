"""What a calibration says of a recording, an adequate diagnosis of it says too."""

import re
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.entry import with_caveats
from gimbalcal.estimate.accelerometers.joint import joint
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions
from gimbalcal.estimate.caveats import caveats
from tests.diagnose import static_plant
from tests.diagnose.plant import record
from tests.diagnose.small import FIT
from tests.estimate.accelerometers.test_multiposition import SAMPLE, TRUTH, rested, scattered
from tests.estimate.gyroscopes.test_residual_checks import RATE, turned, with_rates
from tests.golden import golden_text

ADEQUATE = Diagnosis("adequate", (), (), (), FIT, in_words="The calibrated model explains these data.")
OTHER = replace(ADEQUATE, verdict="unexplained")


def table(**noise):
    return record(np.random.default_rng(3), dwell=20, **noise)


@pytest.mark.parametrize("seed", range(12))
def test_what_its_noise_explains_is_adequate_without_reservation(seed):
    clean = record(np.random.default_rng(seed), dwell=20)
    assert caveats(clean) == []
    assert with_caveats(ADEQUATE, [clean], ()) is ADEQUATE


@pytest.mark.parametrize(("seed", "loose"), [(1, 3.0), (2, 3.0), (3, 5.0)])
def test_gimbals_that_repeat_worse_than_stated_are_told_by_both(seed, loose):
    loosened = record(np.random.default_rng(seed), dwell=20, loose=loose)
    made = with_caveats(ADEQUATE, [loosened], ())
    assert made.verdict == "adequate"
    for said in (made.outcome, made.in_words, joint(trusted_positions(loosened)).outcome):
        times = re.search(r"explained only if the setting repeatability is ([\d.]+) times the stated", said)
        assert float(times[1]) == pytest.approx(loose, rel=0.35)  # 38 numbers tell a sigma to 11 %, three sigma


def test_outputs_that_wander_are_told():
    (said,) = caveats(table(walk=40.0))
    golden_text(said)


def test_a_position_that_calibrate_leaves_out_is_told():
    clean = table()
    angle = clean.channels["gimbal_angle", "inner"] + np.radians(2.0) * (clean.position == 7)
    (said,) = caveats(replace(clean, channels={**clean.channels, ("gimbal_angle", "inner"): angle}))
    golden_text(said)


def test_only_an_adequate_verdict_and_the_usual_model_are_spoken_against():
    loosened = table(loose=4.0)
    assert with_caveats(OTHER, [loosened], ()) is OTHER
    assert caveats(loosened, ("bias", "scale_factor")) == []


def test_a_static_run_in_more_noise_than_stated():
    run = static_plant.record(np.random.default_rng(2))
    assert caveats(run) == []
    quiet = replace(run, noise={sensor: 0.8 * sigma for sensor, sigma in run.noise.items()})
    (said,) = caveats(quiet)
    golden_text(said)


@pytest.mark.parametrize(("noise", "told"), [(3.0, 0), (10.0, 1)])
def test_a_unit_in_the_hand_that_scatters_more_than_its_samples(noise, told):
    seen = replace(rested(TRUTH, scattered(30), noise=noise), noise={},
                   scatter={("specific_force", a): SAMPLE for a in "xyz"})  # fmt: skip
    said = caveats(seen)
    assert len(said) == told
    assert all("diagnose" not in s for s in said)  # it is the one that speaks


def test_gyroscopes_that_missed_their_turns():
    clipped = with_rates(np.clip(turned().triad(RATE), -0.6, 0.6))
    assert any("gravity is missed by" in s for s in caveats(clipped))
    assert caveats(clipped, ("bias", "scale_factor", "misalignment")) == []
    assert caveats(turned()) == []
