"""A channel concealed: without the thermometer its effect is a shape in time, and nothing is named by force."""

from dataclasses import replace

import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.result import Shape
from gimbalcal.recording import read
from tests.paths import CONCEALED


def without(recording, quantity):
    return replace(recording, channels={k: c for k, c in recording.channels.items() if k[0] != quantity})


def test_the_thermometer_hidden_and_given_back():
    recording = read(CONCEALED)
    blind, seen = diagnose([without(recording, "temperature")]), diagnose([recording])
    assert blind.verdict == "unexplained"
    assert blind.findings == ()
    assert blind.unexplained[0] == Shape("specific_force y", "a smooth function of time")
    assert "time" in blind.mismatch[0]["in_words"]
    assert seen.verdict == "missing-physics"
    assert [(f["effect"], f["axis"]) for f in seen.findings] == [("bias_temperature", "y")]
    assert seen.fit["chi2_reduced_before"] == pytest.approx(blind.fit["chi2_reduced_before"], rel=1e-6)
    assert seen.fit["heldout_after"] < 0.2 * seen.fit["heldout_before"]
