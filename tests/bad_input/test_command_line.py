"""Slips on the command line, results that cannot be written, and an interruption."""

import os
import signal
import subprocess
import sys
import time

import pytest

from tests.bad_input.spoil import cell, copy
from tests.golden import golden_text, without_choices
from tests.paths import DEVICE, STATIC


def test_unknown_terms_are_refused_with_the_known_ones(run, tmp_path):
    status, _, err = run(
        "calibrate", DEVICE, "--method", "multiposition", "--terms", "nonsense", "--out", tmp_path / "o", "--quiet"
    )
    assert (status, err.count("\n")) == (2, 1)
    golden_text(without_choices(err, "dead_zone"))
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("below", ["", "below", "far/below"])
def test_results_do_not_go_into_a_file(run, tmp_path, below):
    (tmp_path / "file").write_text("mine")
    status, _, err = run("calibrate", DEVICE, "--out", tmp_path / "file" / below)
    assert status == 2
    golden_text(err)
    assert (tmp_path / "file").read_text() == "mine"


def test_results_do_not_go_where_nobody_may_write(run, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)  # root, who runs tests in containers, may write anywhere
    status, _, err = run("calibrate", DEVICE, "--out", tmp_path / "out")
    assert (status, err.count("\n")) == (2, 1)
    golden_text(err)


def test_a_disk_that_fails_is_a_sentence(run, tmp_path):
    (tmp_path / "out" / "calibration.json").mkdir(parents=True)
    status, _, err = run("calibrate", DEVICE, "--out", tmp_path / "out", "--overwrite", "--quiet")
    assert status == 2
    assert "calibration.json" in err
    golden_text(err)
    assert err.count("\n") == 1
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["calibration.json"]  # no temporary file either


def test_an_earlier_result_outlives_a_failed_run(run, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "calibration.json").write_text("earlier")
    folder = copy(DEVICE, tmp_path / "rec", cell(500, "accel_z", "off"))
    assert run("calibrate", folder, "--out", out)[0] == 2
    assert [(p.name, p.read_text()) for p in out.iterdir()] == [("calibration.json", "earlier")]


def test_ctrl_c_in_the_middle_leaves_nothing(tmp_path):
    """A real process, a real signal, sent once the first stage has been announced."""
    program = [sys.executable, "-m", "gimbalcal", "calibrate", str(DEVICE), str(STATIC), "--out", str(tmp_path / "out")]
    with subprocess.Popen(program, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        said: list[str] = []
        while "stage 1" not in "".join(said):
            said.append(process.stderr.readline())
            assert said[-1], "".join(said)
        time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        rest = process.stderr.read()
        # struck while a module is being made, the interpreter ends itself by the signal; a shell calls both 130
        assert process.wait(timeout=30) in (130, -signal.SIGINT)
    assert rest.splitlines()[-1] == "gimbalcal: interrupted; nothing half-written is left behind"
    assert "Traceback" not in rest
    assert not list(tmp_path.iterdir())
