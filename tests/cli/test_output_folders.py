"""Nothing of a person's is written over: recordings, schedules and exported files are replaced only when told to."""

import os
from collections.abc import Callable

import pytest

from gimbalcal import cli
from gimbalcal.cli.output_folders import staged_folder
from gimbalcal.diagnose.laws.law_file import HEAD
from tests.fuzzing.seeds import LAW
from tests.golden import golden_text, refused
from tests.paths import DEVICE

LOG = "t,ax,ay,az\n" + "".join(f"{i / 10},0.{i % 3},0.0{i % 7},9.8{i % 5}\n" for i in range(40))
HEADER = """format = 1
kind = "multi-position"
title = "rig"
[columns]
t = { quantity = "time", unit = "s" }
""" + "".join(f'a{x} = {{ quantity = "specific_force", axis = "{x}", unit = "m/s^2" }}\n' for x in "xyz")

Command = Callable[..., int]


def contents(folder):
    return {p.name: p.read_bytes() for p in folder.iterdir()}


@pytest.mark.parametrize("edited", ["recording.toml", "samples.csv", "truth.json"])
def test_a_simulated_recording_is_written_again_but_not_over_another(command, capsys, tmp_path, edited):
    out = tmp_path / "far" / "run"
    again = ("simulate", "demo", "--out", out, "--quiet")
    assert command(*again) == 0
    made = contents(out)
    assert command(*again) == 0  # the same command, the same files
    (out / "notes.txt").write_text("mine")
    (out / edited).write_bytes(made[edited] + b"\n")
    kept = contents(out)
    capsys.readouterr()
    assert command(*again) == 2
    golden_text(capsys.readouterr().err)
    assert contents(out) == kept
    assert command(*again, "--overwrite") == 0
    assert contents(out) == made | {"notes.txt": b"mine"}


def test_another_seed_is_another_recording(command, capsys, tmp_path):
    assert command("simulate", "demo", "--out", tmp_path, "--seed", 1) == 0
    made = contents(tmp_path)
    assert command("simulate", "demo", "--out", tmp_path, "--seed", 2) == 2
    golden_text(capsys.readouterr().err)
    assert contents(tmp_path) == made


def test_an_import_keeps_a_header_that_was_edited(command, capsys, tmp_path):
    (tmp_path / "log.csv").write_text(LOG)
    (tmp_path / "header.toml").write_text(HEADER)
    named = f"header={tmp_path / 'header.toml'}"
    again = ("import", "csv", tmp_path / "log.csv", "--set", named, "--out", tmp_path / "rig", "--quiet")
    assert command(*again) == 0
    assert command(*again) == 0
    header = tmp_path / "rig" / "recording.toml"
    header.write_text(header.read_text() + "# measured by me\n")
    assert command(*again) == 2
    golden_text(capsys.readouterr().err)
    assert header.read_text().endswith("# measured by me\n")


def test_an_import_does_not_write_over_what_it_reads(command, capsys, tmp_path):
    (tmp_path / "samples.csv").write_text(LOG)
    own = ("import", "csv", tmp_path / "samples.csv", "--out", tmp_path, "--overwrite", "--quiet")
    assert command(*own) == 2
    assert capsys.readouterr().err.endswith("is to be read and would be written over; give another --out\n")
    assert contents(tmp_path) == {"samples.csv": LOG.encode()}


def test_results_are_replaced_and_leave_the_recording_beside_them(command, tmp_path):
    out = tmp_path / "run"
    assert command("simulate", "wu2018-18", "--out", out, "--quiet") == 0
    made = contents(out)
    for _ in range(2):
        assert command("calibrate", out, "--out", out, "--quiet") == 0
    after = contents(out)
    assert {name: after[name] for name in made} == made
    assert set(after) - set(made) == {"calibration.json", "report.html"}


def test_a_corrected_recording_does_not_go_over_another(command, capsys, tmp_path):
    assert command("calibrate", DEVICE, "--out", tmp_path, "--quiet") == 0
    known = ("--calibration", tmp_path / "calibration.json", "--quiet")
    assert command("simulate", "demo", "--out", tmp_path / "mine") == 0
    made = contents(tmp_path / "mine")
    assert command("apply", DEVICE, "--out", tmp_path / "mine", *known) == 2
    golden_text(capsys.readouterr().err)
    assert contents(tmp_path / "mine") == made


@pytest.mark.parametrize(
    ("kind", "name"),
    [("kalibr", "imu.yaml"), ("psins", "clbt.mat"), ("csv", "calibration.csv"), ("json", "calibration.json")],
)
def test_an_exported_file_is_written_again_but_not_over_another(command, tmp_path, kind, name):
    (tmp_path / "made").mkdir()
    assert command("calibrate", DEVICE, "--out", tmp_path / "made", "--quiet") == 0
    again = ("export", kind, "--calibration", tmp_path / "made" / "calibration.json", "--out", tmp_path, "--quiet")
    assert command(*again) == 0
    assert command(*again) == 0
    (tmp_path / name).write_text("mine")
    assert command(*again) == 2
    assert (tmp_path / name).read_text() == "mine"
    assert command(*again, "--overwrite") == 0
    assert (tmp_path / name).read_text(errors="replace") != "mine"


def test_a_schedule_that_was_written_by_hand_stays(command, tmp_path):
    (tmp_path / "schedule.toml").write_text("# mine\n")
    again = ("design", "-n", 6, "--step", 90, "--terms", "bias", "--out", tmp_path, "--quiet")
    assert command(*again) == 2
    assert contents(tmp_path) == {"schedule.toml": b"# mine\n"}
    assert command(*again, "--overwrite") == 0
    assert b"holds" in contents(tmp_path)["schedule.toml"]


def interrupted(folder):
    with staged_folder(folder) as new:
        (new / "samples.csv").write_text("half")
        raise KeyboardInterrupt


def test_nothing_is_left_of_a_command_that_fails(tmp_path):
    for folder in (tmp_path / "a" / "b", tmp_path):
        with pytest.raises(KeyboardInterrupt):
            interrupted(folder)
    assert not list(tmp_path.iterdir())


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("mine")
    with refused():  # noqa: SIM117
        with staged_folder(tmp_path / "file"):
            pass


def test_a_new_folder_can_be_read_by_those_whom_the_mask_lets(tmp_path):
    before = os.umask(0o027)
    try:
        with staged_folder(tmp_path / "new") as new:
            (new / "a").write_text("a")
    finally:
        os.umask(before)
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o750


def test_the_help_of_each_command_says_where_results_go(command, capsys):
    for name, given in cli.gimbalcal.commands.items():
        if any(p.name == "out" for p in given.params):
            assert command(name, "--help") == 0
            text = " ".join(capsys.readouterr().out.split())
            assert "[default: " in text[text.index("--out PATH Folder for") : text.index("--quiet")], name


def test_the_truth_of_a_simulation_goes_with_it(command, tmp_path):
    """Beside another recording it would be taken for the truth of that one."""
    assert command("calibrate", DEVICE, "--out", tmp_path, "--quiet") == 0
    known, out = ("--calibration", tmp_path / "calibration.json", "--quiet"), tmp_path / "rec"
    assert command("simulate", "demo", "--out", out, "--quiet") == 0
    assert command("export", "csv", *known, "--out", out, "--overwrite") == 0
    assert set(contents(out)) == {"recording.toml", "samples.csv", "truth.json", "calibration.csv"}
    assert command("apply", DEVICE, *known, "--out", out, "--overwrite") == 0
    assert set(contents(out)) == {"recording.toml", "samples.csv", "calibration.csv"}


def test_an_earlier_law_goes_with_its_diagnosis_and_one_of_ones_own_stays(command, capsys, tmp_path):
    out, asked = tmp_path / "out", ("diagnose", DEVICE, "--quiet")
    out.mkdir()
    (out / "law.py").write_text("mine")
    assert command(*asked, "--out", out) == 2
    golden_text(capsys.readouterr().err)
    assert contents(out) == {"law.py": b"mine"}
    assert command(*asked, "--out", out, "--overwrite") == 0
    assert command(*asked, "--out", out) == 0
    assert (out / "law.py").read_text() == "mine"  # none was found that would take its place
    (out / "law.py").write_text(HEAD + "earlier")
    assert command(*asked, "--out", out) == 0
    assert set(contents(out)) == {"diagnosis.json", "calibration.json", "report.html"}


@pytest.mark.usefixtures("own_catalogue")
def test_effects_of_ones_own_are_another_question_and_are_not_written_over(command, capsys, tmp_path):
    law = tmp_path / "law.py"
    law.write_text(LAW)
    asked, with_it = ("noise", DEVICE, "--quiet", "--out", tmp_path / "noise"), ("--effects", law)
    assert command(*asked) == 0
    assert command(*asked, *with_it) == 2
    golden_text(capsys.readouterr().err)
    assert command("diagnose", DEVICE, *with_it, "--out", tmp_path, "--overwrite") == 2
    golden_text(capsys.readouterr().err)
    assert law.read_text() == LAW
