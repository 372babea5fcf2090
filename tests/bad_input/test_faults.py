"""What a hostile or unlucky user hands to the command line: each fault is one sentence, status 2, nothing written.

Every case is a copy of a recording that ships with the project, with one thing wrong. The sentence says what, where
(file, line or row, column) and what to do instead.
"""

import re

import pytest

from tests.bad_input.files import FILES
from tests.bad_input.rows import ROWS
from tests.bad_input.spoil import copy
from tests.golden import golden_text

THEIRS = re.compile(r"(?<=damaged )\(|Unescaped")  # what follows are words of polars, or of the reader of TOML


@pytest.mark.parametrize("fault", [*ROWS, *FILES])
def test_a_fault_is_one_sentence_and_nothing_is_written(run, tmp_path, fault):
    source, change = (ROWS | FILES)[fault]
    folder = copy(source, tmp_path / "rec", change)
    before = sorted(tmp_path.rglob("*"))
    status, out, err = run("calibrate", folder, "--out", tmp_path / "out", "--quiet", "--json")
    assert status == 2, err
    assert err.startswith("gimbalcal: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    assert len(err.replace(f"{tmp_path}/", "")) < 700  # a screen, not a dump of the file
    assert out == ""
    theirs = THEIRS.search(err)
    golden_text(err[: theirs.start()] if theirs else err)
    assert sorted(tmp_path.rglob("*")) == before
