"""The way in: every kind of recording reaches the views it has, with what was asked for."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.diagnose import diagnose, entry, of_recording
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.platform import BENCH
from gimbalcal.recording import with_rests_as_positions
from tests.diagnose import static_plant
from tests.diagnose.plant import record
from tests.diagnose.small import FIT, telescope
from tests.golden import refused

TABLE = record(np.random.default_rng(1), dwell=2)
REST = static_plant.record(np.random.default_rng(1))
RATES = {("angular_rate", a): 0 * TABLE.time for a in "xyz"}
PARTS = ("diagnose_known_noise", "of_gimballed_unit", "of_single_view", "of_triads")


@pytest.fixture
def taken(monkeypatch):
    """Names of the functions that a recording reaches, and what they were given, in place of these."""
    out: list[tuple[str, Any]] = []
    nothing = Diagnosis("adequate", (), (), (), FIT)

    def reached(name, answer):
        def called(*given):
            out.append((name, given))
            return answer

        return called

    for name in PARTS:
        monkeypatch.setattr(of_recording, name, reached(name, (["a part"], [])))
    monkeypatch.setattr(of_recording, "joint_diagnosis", lambda *_: nothing)
    monkeypatch.setattr(entry, "diagnose_jointly", reached("diagnose_jointly", nothing))
    return out


@pytest.mark.parametrize(
    ("recordings", "part"),
    [
        ([TABLE], "of_gimballed_unit"),
        ([REST], "diagnose_known_noise"),
        ([TABLE, REST], "diagnose_jointly"),
        ([replace(TABLE, channels={**TABLE.channels, **RATES})], "of_gimballed_unit"),
        ([telescope(1)], "of_single_view"),
        ([replace(TABLE, platform=BENCH)], "of_triads"),
    ],
    ids=["table", "static run", "both", "with gyroscopes", "telescope", "by hand"],
)
def test_each_kind_reaches_its_views(taken, recordings, part):
    recordings = [with_rests_as_positions(r) for r in recordings]  # as they come from a file
    assert diagnose(recordings, baseline=(), seed=7).verdict == "adequate"
    ((name, given),) = taken
    assert name == part
    if part == "diagnose_known_noise":
        assert [(v.title, v.baseline) for v in given[0]] == [(recordings[0].title, BASELINE["static-run"])]
        assert given[1:3] == (None, 7)
        return
    assert list(given[0].recordings) == recordings
    assert (given[0].calibration, given[0].baseline, given[0].seed) == (None, (), 7)


def test_nothing_and_nonsense_are_refused_before_any_view(taken):
    with refused():
        diagnose([])
    with refused():
        diagnose([TABLE], baseline=("bais",))
    broken = TABLE.channels["temperature", ""].copy()
    broken[2] = np.inf
    spoiled = replace(TABLE, channels={**TABLE.channels, ("temperature", ""): broken})
    with refused():
        diagnose([TABLE, spoiled])
    assert taken == []


@pytest.mark.parametrize("count", [1, 3, 6])
def test_a_calibration_of_another_platform_is_one_sentence(count):
    zero = CATALOGUE["gimbal_zero"](theta_0=np.full(count, 1e-4))
    other = Calibration("test", (zero,), (), np.zeros((0, 0)), (), Residual(0.0, 0, {}))
    with refused():
        diagnose([TABLE], other)
