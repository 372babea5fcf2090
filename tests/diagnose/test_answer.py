"""The answer as a file: keys of interfaces.md section 4, in plain types."""

from __future__ import annotations

import json
from dataclasses import replace

from gimbalcal.diagnose.answer import VERDICTS, Diagnosis
from gimbalcal.recording import Source
from tests.diagnose.small import telescope

ANSWER = Diagnosis(
    "missing-physics", ({"axis": "y"},), ({"effect": "cubic_nonlinearity"},), (), {"chi2_reduced_before": 3.0},
    {"seed": 1}, "In words.",
)  # fmt: skip


def test_the_content_of_the_file() -> None:
    content = ANSWER.to_dict()
    assert list(content) == [
        "format", "verdict", "in_words", "outcome", "mismatch", "findings", "unexplained", "fit", "provenance"
    ]  # fmt: skip
    assert json.loads(json.dumps(content)) == content
    assert content["findings"] == [{"effect": "cubic_nonlinearity"}]
    assert (content["format"], content["verdict"], content["unexplained"]) == (1, "missing-physics", [])
    content["fit"]["chi2_reduced_before"] = 0.0
    assert ANSWER.fit["chi2_reduced_before"] == 3.0  # a copy


def test_of_two_views_the_one_that_names_a_cause_is_told() -> None:
    assert max(("adequate", "unexplained"), key=VERDICTS.index) == "unexplained"
    assert max(("not-identifiable", "missing-physics", "unexplained"), key=VERDICTS.index) == "missing-physics"
    assert sorted(VERDICTS) == ["adequate", "missing-physics", "not-identifiable", "unexplained"]


def test_the_files_behind_a_recording() -> None:
    r = replace(telescope(1), source=(Source("a/recording.toml", "0" * 64), Source("a/samples.csv", "1" * 64)))
    assert r.files == [
        {"path": "a/recording.toml", "sha256": "0" * 64}, {"path": "a/samples.csv", "sha256": "1" * 64}
    ]  # fmt: skip
