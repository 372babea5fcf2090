"""Telescopes: the 6.5 m MMT, and two amateur mounts of which one slips."""

import json
import resource
import subprocess
import sys

import pytest

from tests.paths import REAL
from tests.real.recordings import FILES, diagnosed, finding, names, recording, size


def test_mmt_tilt_flexure_and_a_cotangent():
    d = diagnosed("mmt")
    assert d.verdict == "missing-physics"
    assert names(d) == {"base_tilt", "tube_flexure", "refraction"}
    assert not finding(d, "base_tilt")["twins"]
    # reference 10.5 -> 0.94 arcsec; collimation and squareness are in the model from the start here, hence 9.8
    assert d.fit["rms_before"] == pytest.approx(9.77, rel=0.02)
    assert d.fit["rms_after"] == pytest.approx(0.94, rel=0.02)
    assert d.fit["heldout_rms_after"] < 1.1 * d.fit["rms_after"]
    tilt, sigma = size(d, "base_tilt", "north")
    assert abs(tilt) > 50 * sigma


def test_mmt_through_the_command_line(tmp_path):
    recording("mmt")
    run = [sys.executable, "-m", "gimbalcal"]
    kind, file = FILES["mmt"]
    subprocess.run([*run, "import", kind, str(REAL / file), "--out", str(tmp_path / "mmt"), "--quiet"], check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    options = ["--baseline", "gimbal_zero", "--out", str(tmp_path / "out"), "--quiet"]
    done = subprocess.run([*run, "diagnose", str(tmp_path / "mmt"), *options], check=False)
    assert done.returncode == 1  # done, and the model does not explain the data
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - used < 30  # s of processor, the limit that was set
    content = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert content["fit"]["rms_before"] == pytest.approx(10.5, rel=0.01)
    assert content["fit"]["rms_after"] < 1.0
    found = {f["effect"] for f in content["findings"]}
    assert {"base_tilt", "tube_flexure", "refraction"} <= found
    assert found <= {"base_tilt", "tube_flexure", "refraction", "gimbal_nonorthogonality", "axis_collimation"}
    page = (tmp_path / "out" / "report.html").read_text()
    assert "base tilt" in page
    assert "Traceback" not in page


def test_cgx_l_cone_polar_axis_and_eccentricity():
    d = diagnosed("cgx-l", "gimbal_zero")
    assert d.verdict == "missing-physics"
    core = {"axis_collimation", "base_tilt", "gimbal_nonorthogonality", "encoder_eccentricity"}
    # without six of 148 stars, 290 to 420 arcsec off, a step of the declination's zero stands alone beside them; a
    # friction and a sag had taken up these stars, and told those that took no part to 121 arcsec instead of 90
    assert names(d) == core | {"gimbal_zero_step"}
    assert all(f"tar {star} is" in d.in_words for star in (47, 52, 14, 136, 15, 22))
    step, sigma = size(d, "gimbal_zero_step", "declination")
    assert abs(step) > 5 * sigma
    assert d.fit["heldout_rms_after"] < 95
    assert d.fit["rms_after"] < 0.05 * d.fit["rms_before"]
    assert d.fit["heldout_rms_after"] < 0.05 * d.fit["heldout_rms_before"]
    assert "declination" in d.unexplained[0]["shape"]  # 73 arcsec stay, with a pattern: it is told, not hidden


def test_warp_astron_slips_in_the_course_of_the_night():
    d = diagnosed("warp-astron")
    assert d.verdict == "missing-physics"
    assert {"encoder_eccentricity", "gimbal_zero_drift"} <= names(d)
    assert d.fit["rms_after"] < 28  # reference: 28 arcsec with the drift, 55 without
    assert d.fit["heldout_rms_after"] < 0.2 * d.fit["heldout_rms_before"]
    rate, sigma = size(d, "gimbal_zero_drift", "declination")
    assert abs(rate) > 10 * sigma
