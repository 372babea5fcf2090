"""A console whose encoding lacks a character of the answer gets the answer all the same."""

import os
import subprocess
import sys

import pytest

from tests.paths import ROOT


@pytest.mark.parametrize(("encoding", "bias"), [("ascii", "+- 1.54   ug"), ("latin-1", "± 1.54   µg")])
def test_an_answer_in_another_encoding(encoding, bias, tmp_path):
    command = [sys.executable, "-m", "gimbalcal", "observe", "wu2018-18", "--angle-sigma", "1", "--out", tmp_path / "o"]
    environment = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, capture_output=True, check=True)
    printed = done.stdout.decode(encoding)
    assert bias in printed
    assert "One sigma at worst" in printed
