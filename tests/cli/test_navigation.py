"""`gimbalcal navigate` as a user meets it: the contract of navigation.json, the page, and refusals."""

import json

import jsonschema
import pytest

from gimbalcal.pipeline import load, three_stage
from tests.paths import DEVICE, ROOT, STATIC


@pytest.fixture(scope="module")
def calibrations(tmp_path_factory):
    folder = tmp_path_factory.mktemp("calibrations")
    (device, run), out = load([DEVICE, STATIC]), []
    for name, recordings in (("two-stage", [device]), ("fused", [device, run])):
        (folder / name).mkdir()
        out.append(folder / name / "calibration.json")
        three_stage(recordings).write(out[-1])
    return out


def test_navigate_writes_the_contract_and_a_page(command, capsys, tmp_path, calibrations):
    out = tmp_path / "out"
    options = ("--samples", 4, "--out", out, "--json", "--quiet")
    assert command("navigate", STATIC, "--calibration", *calibrations, *options) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((out / "navigation.json").read_text())
    assert {len(values) for values in told["series"].values()} == {len(told["series"]["time_s"])}
    largest = max(p["max_nmi"] for p in told["position"] if p["calibration"] == told["position"][-1]["calibration"])
    assert max(told["series"]["position"]) <= largest
    jsonschema.validate(told, json.loads((ROOT / "docs" / "schemas" / "navigation.schema.json").read_text()))
    rows = {(c["calibration"], c["name"]): c for c in told["channels"]}
    assert list(dict.fromkeys(c for c, _ in rows)) == ["none", "two-stage", "fused"]
    assert {c["name"] for c in told["channels"]} == {
        "latitude", "longitude", "north velocity", "east velocity", "roll", "pitch", "yaw",
    }  # fmt: skip
    for (calibration, name), c in rows.items():
        assert 0 < c["rms"] < c["max"], name
        if calibration != "none":
            assert c["improvement_percent"] == pytest.approx(100 * (1 - c["max"] / rows["none", name]["max"]))
            assert c["sigma_linear"] > 0
    assert all(rows["fused", name]["max"] < 0.5 * rows["two-stage", name]["max"] for _, name in rows)
    most = {p["calibration"]: p["max_nmi"] for p in told["position"]}
    assert most["none"] > 1.5 > 0.5 > most["two-stage"] > 10 * most["fused"]
    page = (out / "report.html").read_text()
    assert "<!doctype html>" in page.lower()[:200]
    assert "improved by" in page


def test_budget_writes_the_contract_and_a_page(command, capsys, tmp_path):
    assert command("budget", "wu2018-18", "--hours", 12, "--out", tmp_path / "out", "--json", "--quiet") == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((tmp_path / "out" / "budget.json").read_text())
    *rows, total = told
    assert total["parameter"] == "total"
    parts = [row["position_error_m_after_h"]["12"] for row in rows]
    assert max(parts) < total["position_error_m_after_h"]["12"] < sum(parts)
    assert sum(row["share"] for row in rows) > 0.3  # the rest is covariance between parameters
    for row in rows:
        assert {"parameter", "sigma", "unit", "position_error_m_after_h", "share", "reduce_by"} == set(row)
        assert list(row["position_error_m_after_h"]) == ["12"]
    page = (tmp_path / "out" / "report.html").read_text()
    assert "reduced to, m" in page


def test_a_budget_of_turns_has_the_same_contract_and_says_whose_navigator_it_is(command, capsys, tmp_path):
    options = ("--states", "30", "--hours", 6, "--out", tmp_path / "out", "--json", "--quiet")
    assert command("budget", "wei2022-30", "wei2022-static", *options) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told) == 22
    assert told[-1]["parameter"] == "total"
    for row in told[:-1]:
        assert {"parameter", "sigma", "unit", "position_error_m_after_h", "share", "reduce_by"} == set(row)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "The strapdown navigator of" in page
    assert "platform’s navigator" not in page
