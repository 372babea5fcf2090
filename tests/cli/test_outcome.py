"""A diagnosis on the command line ends in a calibration that the other commands take."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from gimbalcal.cli import gimbalcal
from gimbalcal.recording import write
from tests.diagnose.plant import UG, known, record
from tests.golden import golden_text, refused
from tests.paths import CONCEALED


def run(*arguments):
    found = CliRunner().invoke(gimbalcal, [str(a) for a in arguments])
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    return found.exit_code, found.output


def test_diagnosed_corrected_and_diagnosed_again(tmp_path):
    concealed = tmp_path / "concealed"
    concealed.mkdir()
    write(record(np.random.default_rng(5), known(1)["bias T"][0], 60 * UG, dwell=6), concealed, "samples.csv")
    status, _ = run("diagnose", concealed, "--out", tmp_path / "first", "--quiet")
    assert status == 1
    found = json.loads((tmp_path / "first" / "diagnosis.json").read_text())["findings"][0]
    assert found["T0_degC"] == 20.0
    made = json.loads((tmp_path / "first" / "calibration.json").read_text())
    assert made["format"] == 2
    (cause,) = (row for row in made["parameters"] if row["effect"] == found["effect"])
    assert cause["value"] == pytest.approx(found["parameters"][0]["value"])
    assert cause["sigma"] == pytest.approx(found["parameters"][0]["sigma"])
    assert {"effect": "bias_temperature", "T0_degC": 20.0}.items() <= made["model"][-1].items()
    scale = next(row for row in made["parameters"] if row["name"] == "scale_factor")
    assert scale["in_words"].endswith("too little" if scale["value"] > 0 else "too much")

    calibration = tmp_path / "first" / "calibration.json"
    assert run("apply", concealed, "--calibration", calibration, "--out", tmp_path / "corrected", "--quiet")[0] == 0
    status, words = run("diagnose", tmp_path / "corrected", "--quiet")
    assert status == 0
    golden_text(words)
    assert run("export", "csv", "--calibration", calibration, "--out", tmp_path / "csv", "--quiet")[0] == 0


def test_an_effect_is_added_by_name(tmp_path):
    assert run("calibrate", CONCEALED, "--quiet")[0] == 1
    status, _ = run("calibrate", CONCEALED, "--with", "bias_temperature:y", "--out", tmp_path, "--quiet")
    assert status == 0
    made = json.loads((tmp_path / "calibration.json").read_text())
    assert made["provenance"]["options"]["with"] == ["bias_temperature:y"]
    page = (tmp_path / "report.html").read_text()
    assert "<mn>20</mn>" in page[page.index("<mi>T</mi><mn>0</mn>") :][:400]
    assert "°C" in page
    assert " % too " in page
    with refused():
        run("calibrate", CONCEALED, "--with", "bias_temperatur")
