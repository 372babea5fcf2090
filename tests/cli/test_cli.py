"""The command line as a user meets it: statuses, sentences, files whole or absent."""

import json
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest

from gimbalcal.cli import gimbalcal
from gimbalcal.recording import dwell_means, read
from gimbalcal.simulate import simulate_to
from tests.golden import golden_text
from tests.paths import DEVICE, STATIC, XSENS


def test_help_loads_nothing_heavy():
    heavy = ("numpy", "scipy", "sympy", "matplotlib", "polars")
    code = f"import sys, gimbalcal.cli; print([m for m in {heavy} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_what_a_calibration_and_what_a_diagnosis_load_is_what_they_need():
    """A road of the diagnosis is nothing to `calibrate`; numba, and scipy for a matrix, are nothing to either."""
    heavy = ("numba", "scipy.linalg", "scipy.stats", "scipy.optimize")
    for modules, never in (
        ("gimbalcal.methods, gimbalcal.report.console, gimbalcal.calibration.exchange", ("gimbalcal.diagnose", *heavy)),
        ("gimbalcal.diagnose, gimbalcal.diagnose.cost", heavy),
    ):
        code = f"import sys, {modules}; print([m for m in {never} if m in sys.modules])"
        out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert out.stdout.strip() == "[]"


def test_version(command, capsys):
    assert command("--version") == 0
    assert capsys.readouterr().out.startswith("gimbalcal, version ")


def test_calibrate_writes_the_contract_and_a_page(command, capsys, tmp_path):
    assert command("calibrate", DEVICE, STATIC, "--out", tmp_path / "out", "--quiet", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert content == json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert {"format", "method", "outcome", "parameters", "covariance", "unobservable", "residual", "provenance"} <= set(
        content
    )
    assert content["method"] == "three-stage"
    n = len(content["parameters"])
    assert [len(row) for row in content["covariance"]] == [n] * n
    labels = {(p["name"], p["axis"]) for p in content["parameters"]}
    some = {("scale_factor", "x"), ("misalignment", "zy"), ("gimbal_zero", "middle"), ("scale_nonlinearity", "z")}
    assert some <= labels
    assert {len(r["sha256"]) for r in content["provenance"]["recordings"]} == {64}
    assert (tmp_path / "out" / "report.html").read_text().lstrip().lower().startswith("<!doctype html>")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["calibration.json", "report.html"]


def test_an_interruption_says_so(command, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("gimbalcal.methods.calibrate_each", interrupted)
    assert command("calibrate", DEVICE) == 130
    assert "interrupted" in capsys.readouterr().err


def test_a_recording_is_corrected_and_corrupted_again(command, tmp_path):
    assert command("calibrate", DEVICE, "--out", tmp_path / "made", "--quiet") == 0
    assert command("export", "csv", "--calibration", tmp_path / "made" / "calibration.json", "--out", tmp_path) == 0
    known = ("--calibration", tmp_path / "calibration.csv", "--quiet")
    assert command("apply", DEVICE, "--out", tmp_path / "true", *known) == 0
    assert command("apply", tmp_path / "true", "--inverse", "--out", tmp_path / "read", *known) == 0
    raw, true, back = (read(folder) for folder in (DEVICE, tmp_path / "true", tmp_path / "read"))
    # two files of 17 digits on the way
    np.testing.assert_allclose(back.triad("specific_force"), raw.triad("specific_force"), atol=1e-13)
    norm = np.linalg.norm(dwell_means(true).triad("specific_force"), axis=1)
    # 18 coefficients fitted: what is left of the norm is the noise of a mean, below 10 ug
    np.testing.assert_allclose(norm, true.site.gravity, atol=1e-4)
    assert np.abs(np.linalg.norm(dwell_means(raw).triad("specific_force"), axis=1) - raw.site.gravity).max() > 1e-3


def test_a_recording_is_not_written_over_itself(command, capsys, tmp_path):
    simulate_to("demo", tmp_path / "demo")
    assert command("calibrate", tmp_path / "demo", "--out", tmp_path / "made", "--quiet") == 1  # a concealed effect
    known = tmp_path / "made" / "calibration.json"
    assert command("apply", tmp_path / "demo", "--calibration", known, "--out", tmp_path / "demo") == 2
    golden_text(capsys.readouterr().err)
    assert command("export", "json", "--calibration", known, "--out", tmp_path / "made") == 2
    golden_text(capsys.readouterr().err)
    assert command("export", "matlab", "--calibration", known, "--out", tmp_path / "new") == 2
    golden_text(capsys.readouterr().err)
    assert not (tmp_path / "new").exists()


def test_declined_terms_are_told(command, capsys):
    assert command("calibrate", XSENS, "--method", "multiposition") == 0
    assert "note: these data do not show scale nonlinearity, cubic nonlinearity" in capsys.readouterr().err
    page = Path("xsens_positions-calibration/report.html").read_text()
    for term in ("scale_nonlinearity", "cubic_nonlinearity"):
        assert f"{term} is left out: from these 38 positions its largest coefficient is" in page.replace("&#34;", '"')
    assert "to rule out chance, and positions kept out of the fit are predicted worse with it" in page


def test_a_calibration_brings_its_sensors_along_and_not_how_the_rig_stood(tmp_path, command, capsys):
    """The base tilt of a static run is no tilt of the positions that were taken before it."""
    assert command("calibrate", DEVICE, STATIC, "--out", tmp_path / "cal", "--quiet") == 0
    known = ("--calibration", tmp_path / "cal" / "calibration.json")
    assert command("diagnose", DEVICE, *known, "--quiet") == 0
    assert "explains these data" in capsys.readouterr().out


def test_no_option_takes_nan_or_a_number_without_end():
    """nan passes every range of click's, and a count without end is work without end."""
    for name, each in gimbalcal.commands.items():
        for option in each.params:
            kind, where = option.type, f"{name} {option.name}"
            if isinstance(kind, click.types.FloatParamType):
                for value in ("nan", "inf", "-inf"):
                    with pytest.raises(click.BadParameter):
                        kind.convert(value, option, None)
            elif isinstance(kind, click.types.IntParamType) and option.name not in ("seed", "workers"):
                assert isinstance(kind, click.IntRange), where
                assert kind.max, where


def test_a_defect_does_not_look_like_a_verdict(command, capsys, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("as if")

    monkeypatch.setattr("gimbalcal.pipeline.load", broken)
    assert command("diagnose", DEVICE, "--quiet") == 3
    assert "defect of the program" in capsys.readouterr().err
