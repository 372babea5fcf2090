"""Nothing computed is lost, and nothing of another question is replaced: one rule for every command that computes."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.golden import golden_text
from tests.paths import DEVICE, XSENS

PULSES = "wang2019-accelerometers-3arcmin"

Command = Callable[..., int]

SCHEDULES = [
    (("observe", "wu2018-18"), "wu2018-18-observability", "observability.json"),
    (("observe", "static-24h"), "static-24h-observability", "observability.json"),
    (("budget", "wu2018-18"), "wu2018-18-budget", "budget.json"),
    (("design", "-n", 6, "--step", 90, "--terms", "bias"), "space-stable-schedule", "schedule.toml"),
    (("campaign", PULSES, "-n", 2, "--workers", 1), f"{PULSES}-campaign", "campaign.json"),
]


@pytest.mark.parametrize(("arguments", "folder", "file"), SCHEDULES)
def test_a_result_without_out_is_in_a_folder_that_is_named(command, capsys, arguments, folder, file):
    assert command(*arguments, "--quiet") == 0
    assert capsys.readouterr().out.endswith(f"report: {folder}/report.html\n")
    assert (Path(folder) / file).is_file()
    assert (Path(folder) / "report.html").is_file()
    assert command(*arguments, "--quiet") == 0  # the same question takes the place of its own answer
    assert [p.name for p in Path().iterdir()] == [folder]


def test_a_campaign_is_added_to_and_gives_way_as_every_result_does(command, capsys, tmp_path):
    asked = ("campaign", PULSES, "--workers", 1, "--out", tmp_path / "c")
    assert command(*asked, "-n", 2) == 0
    assert command(*asked, "-n", 3) == 0  # more runs are no other question
    assert json.loads((tmp_path / "c" / "campaign.json").read_text())["runs"] == 3
    capsys.readouterr()
    assert command(*asked, "-n", 2, "--seed", 5) == 2
    told = capsys.readouterr().err
    golden_text(told)
    assert command(*asked, "-n", 2, "--seed", 5, "--overwrite") == 0
    assert json.loads((tmp_path / "c" / "campaign.json").read_text())["identity"]["seed"] == 5
    assert command("campaign", PULSES, "--workers", 1, "-n", 2, "--seed", 6, "--quiet") == 0
    assert command("campaign", PULSES, "--workers", 1, "-n", 2, "--seed", 7, "--quiet") == 0
    assert capsys.readouterr().out.endswith(f"report: {PULSES}-campaign-2/report.html\n")


def test_another_question_takes_another_folder(command, capsys):
    assert command("observe", "wu2018-18", "--quiet") == 0
    first = Path("wu2018-18-observability/report.html").read_bytes()
    assert command("observe", "wu2018-18", "--angle-sigma", 5, "--quiet") == 0
    assert capsys.readouterr().out.endswith("report: wu2018-18-observability-2/report.html\n")
    assert Path("wu2018-18-observability/report.html").read_bytes() == first


def test_the_answer_to_another_question_is_not_written_over(command, capsys, tmp_path):
    assert command("calibrate", DEVICE, "--out", tmp_path, "--quiet") == 0
    kept = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    capsys.readouterr()
    for other in (("calibrate", XSENS), ("diagnose", DEVICE), ("calibrate", DEVICE, "--with", "bias_drift")):
        assert command(*other, "--out", tmp_path, "--quiet") == 2
        told = capsys.readouterr().err
        golden_text(told)
        assert "--overwrite" in told
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == kept
    assert command("calibrate", XSENS, "--out", tmp_path, "--overwrite", "--quiet") == 0
    assert json.loads((tmp_path / "calibration.json").read_text())["method"] == "multiposition"


def test_what_is_no_result_of_ours_is_not_written_over(command, tmp_path):
    (tmp_path / "report.html").write_text("<p>mine</p>")
    assert command("observe", "wu2018-18", "--out", tmp_path, "--quiet") == 2
    assert (tmp_path / "report.html").read_text() == "<p>mine</p>"


def test_json_on_stdout_is_the_result_and_leaves_no_folder(command, capsys):
    assert command("observe", "wu2018-18", "--json", "--quiet") == 0
    assert json.loads(capsys.readouterr().out)["schedule"] == "wu2018-18"
    assert not list(Path().iterdir())


def test_the_console_ends_with_table_answer_and_report(command, capsys):
    assert command("calibrate", DEVICE) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any("bias x" in line and "±" in line and line.rstrip().endswith("µg") for line in lines)
    assert lines[-1] == "report: space_stable_18-calibration/report.html"
