"""Of the listed errors anywhere between a recording and a budget the derivations let at most three pass."""

import os
import subprocess
import sys

import pytest

from tests.mutation.of_derivations import ERRORS, outdated


def test_every_listed_error_can_still_be_made():
    assert not outdated()
    assert len(set(ERRORS)) == len(ERRORS) == 65


@pytest.mark.slow
def test_at_most_three_of_the_listed_errors_go_undetected():
    program = [sys.executable, "-m", "tests.mutation.of_derivations"]
    ended = subprocess.run(
        program, env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
