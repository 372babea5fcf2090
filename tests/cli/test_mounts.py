"""A telescope from its observation file to a TPOINT model and back, on the command line."""

import json
from collections.abc import Callable

import numpy as np
import pytest

from gimbalcal.recording import write
from tests.estimate.pointing.mounts import ALT_AZ, effects, run, sky
from tests.golden import golden_text
from tests.paths import XSENS

Command = Callable[..., int]
TRUTH = {"gimbal_zero__azimuth": -500.0, "base_tilt__north": 25.0, "tube_flexure": 15.0}


@pytest.fixture
def night(tmp_path):
    """A run of 60 stars."""
    return write(run(ALT_AZ, sky(ALT_AZ), effects(ALT_AZ, **TRUTH), 1.0), tmp_path / "night")


def test_a_mount_is_calibrated_exported_and_explained(command, capsys, night, tmp_path):
    assert command("calibrate", night, "--out", tmp_path / "out", "--quiet") == 0
    assert "arcsec rms on the sky" in capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "calibration.json").read_text())
    terms = {t["term"]: (t["value"], t["sigma"]) for t in content["provenance"]["tpoint"]}
    assert list(terms) == ["IA", "IE", "CA", "NPAE", "AN", "AW", "TF"]
    for term, size in (("AW", -25.0), ("TF", 15.0), ("IA", 500.0)):
        assert abs(terms[term][0] - size) < 4.5 * terms[term][1]
    page = (tmp_path / "out" / "report.html").read_text()
    assert 'id="tpoint"' in page
    assert "NPAE" in page
    assert "Night by night" not in page
    model = tmp_path / "tpoint.mod"
    known = tmp_path / "out" / "calibration.json"
    assert command("export", "tpoint", "--calibration", known, "--out", tmp_path / "x", "--quiet") == 0
    model = tmp_path / "x" / "tpoint.mod"
    assert "  AW  " in model.read_text()
    assert command("diagnose", night, "--calibration", model, "--quiet") == 0
    assert command("apply", night, "--calibration", model, "--out", tmp_path / "corrected", "--quiet") == 0
    assert command("calibrate", tmp_path / "corrected", "--quiet", "--json") == 0
    again = json.loads(capsys.readouterr().out.splitlines()[-1])
    sizes = [p["value"] / p["sigma"] for p in again["parameters"]]
    np.testing.assert_allclose(sizes, 0, atol=0.01)


def test_terms_are_added_and_omitted(command, capsys, night, tmp_path):
    out = tmp_path / "out"
    assert command("calibrate", night, "--with", "TX", "--without", "NPAE,CA", "--out", out, "--quiet") == 0
    golden_text(capsys.readouterr().out.replace(str(out), "OUT"))
    content = json.loads((out / "calibration.json").read_text())
    assert content["provenance"]["options"]["without"] == ["NPAE", "CA"]
    assert [t["term"] for t in content["provenance"]["tpoint"]] == ["IA", "IE", "AN", "AW", "TF", "TX"]
    assert 'id="terms"' in (out / "report.html").read_text()
    assert command("calibrate", night, "--without", "TX", "--quiet") == 2
    assert command("calibrate", XSENS, "--without", "bias", "--quiet") == 2
    golden_text(capsys.readouterr().err)


def test_nights_that_differ_are_told_with_status_1(command, capsys, night, tmp_path):
    other = effects(ALT_AZ, **{**TRUTH, "base_tilt__north": 40.0})
    later = write(run(ALT_AZ, sky(ALT_AZ, 60, 8), other, 1.0, 9), tmp_path / "later")
    assert command("calibrate", night, later, "--out", tmp_path / "out", "--quiet") == 1
    assert "The terms differ between 2 nights: base tilt north by 1" in capsys.readouterr().out
    assert "Night by night" in (tmp_path / "out" / "report.html").read_text()
    assert command("calibrate", night, "--method", "multiposition", "--quiet") == 2
    golden_text(capsys.readouterr().err)
