"""Paths, stores, headers and results that come from elsewhere: one sentence and exit status 2, and nothing written."""

import json
import os
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gimbalcal import atomic
from gimbalcal.cli.options import _as_printed
from gimbalcal.entries import read_json
from gimbalcal.errors import InputError
from gimbalcal.history import StoredResult, keep, kept_entries
from gimbalcal.history.unit_store import WAIT_S, refuse_unusable
from gimbalcal.importers import import_files
from gimbalcal.recording import read
from gimbalcal.simulate.scenario import check_content
from gimbalcal.simulate.turned import schedule_of
from tests.fuzzing import seeds
from tests.history.calibrations import calibration
from tests.paths import DEVICE, ROOT

SCHEDULE = '[platform]\nname = "space-stable"\n[schedule]\n'
TURNS = 'kind = "rotation"\nmoves = [{ axis = "z", angle = { value = 90, unit = "deg" } }]\n'
Command = Callable[..., int]


def refused(command, capsys, *arguments):
    """The one sentence with which a command is refused; nothing new is in its folder."""
    before = {*Path().rglob("*")}
    assert command(*arguments) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("  ")]
    assert len(lines) == 1, lines
    assert {*Path().rglob("*")} == before
    assert "Error" not in lines[0]
    return lines[0]


@pytest.mark.parametrize("arguments", [
    ("calibrate", "loop"), ("diagnose", "loop"), ("new", "loop"), ("noise", "loop"), ("import", "tpoint", "loop"),
    ("simulate", "loop"), ("observe", "loop"), ("navigate", "loop"), ("budget", "loop"), ("campaign", "loop"),
    ("compare", "--store", "loop"), ("calibrate", DEVICE, "--store", "loop"), ("calibrate", DEVICE, "--out", "loop/x"),
    ("export", "csv", "--calibration", "loop"),
])  # fmt: skip
def test_links_in_a_circle(command, capsys, arguments):
    Path("loop").symlink_to("loop")
    assert "links that lead to themselves" in refused(command, capsys, *arguments)


@pytest.mark.parametrize("arguments", [
    ("calibrate", "dev\udcff"), ("new", "log.csv", "--title", "a\udcff"), ("calibrate", DEVICE, "--out", "o\udcff"),
    ("calibrate", DEVICE, "--store", "s.db", "--unit", "a\udcff"),
])  # fmt: skip
def test_words_that_are_not_utf8(command, capsys, arguments):
    assert r"\xff' is not UTF-8" in refused(command, capsys, *arguments)


@pytest.mark.parametrize("store", ["folder", "text.csv", "text.csv/x.db", "fifo", "/dev/null", "/dev/full"])
@pytest.mark.parametrize("name", ["calibrate", "diagnose"])
def test_a_store_is_opened_before_anything_is_written(command, capsys, name, store):
    Path("folder").mkdir()
    Path("text.csv").write_text("a,b\n1,2\n" * 100)
    os.mkfifo("fifo")
    assert "store" in refused(command, capsys, name, DEVICE, "--store", store)


def entry(unit="u"):
    content = calibration(np.full(6, 100.0), 0).to_dict()
    return StoredResult(unit, content["provenance"]["created"], "calibration", content)


@pytest.mark.skipif(os.geteuid() != 0, reason="it takes root to become another user")
def test_a_store_that_cannot_be_written_is_compared():
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "unit.sqlite"
        keep(path, entry())
        path.chmod(0o444)
        Path(name).chmod(0o555)
        os.setresuid(65534, 65534, 0)
        try:
            assert [e.unit for e in kept_entries(path)] == ["u"]
            with pytest.raises(InputError, match="cannot be used as a store"):
                keep(path, entry("v"))
        finally:
            os.setresuid(0, 0, 0)
        assert sorted(p.name for p in Path(name).iterdir()) == ["unit.sqlite"]


@pytest.mark.parametrize(("damage", "sentence"), [(b"\x14", "malformed"), (b"\xe9", "a text in it is damaged")])
def test_a_store_with_damaged_tables_is_refused_before_anything_is_computed(tmp_path, damage, sentence):
    path = tmp_path / "unit.sqlite"
    keep(path, entry())
    with sqlite3.connect(path, timeout=WAIT_S) as base:
        base.execute("pragma wal_checkpoint(truncate)")
    path.write_bytes(path.read_bytes().replace(b"CREATE TABLE entries (", b"CREATE TAB" + damage + b"E entries ("))
    with pytest.raises(InputError, match=f"cannot be used as a store .{sentence}"):
        refuse_unusable(path)


@pytest.mark.parametrize("column", ["unit", "date", "kind"])
def test_a_store_notices_what_stands_outside_the_content(tmp_path, column):
    path = tmp_path / "unit.sqlite"
    assert keep(path, entry())
    assert not keep(path, entry())
    with sqlite3.connect(path, timeout=WAIT_S) as base:
        base.execute(f"update entries set {column} = '2020-01-01'")
    with pytest.raises(InputError, match="is not what was kept"):
        kept_entries(path)


@pytest.mark.parametrize(("text", "sentence"), [
    ("holds = [3]", "must be tables"), ('holds = ["a"]', "must be tables"), ("holds = [[1, 2]]", "must be tables"),
    ('holds = "abc"', "must be tables"), ("holds = 3", "must be tables"), ("holds = [{ platform = [1] }]", "angle"),
])  # fmt: skip
def test_holds(command, capsys, text, sentence):
    Path("schedule.toml").write_text(SCHEDULE + text)
    assert sentence in refused(command, capsys, "observe", "schedule.toml")


@pytest.mark.parametrize("line", [
    'outer = ["x"]', "outer = { a = 1 }", 'inner = ["x"]', 'start = { x = ["a"], y = "north", z = "up" }',
    'title = ["a"]', "moves = [3]", "moves = [[1]]",
])  # fmt: skip
def test_turns(command, capsys, line):
    rest = TURNS if not line.startswith("moves") else 'kind = "rotation"\n'
    Path("turns.toml").write_text(f"{line}\n{rest}")
    refused(command, capsys, "observe", "turns.toml")


@pytest.mark.parametrize("name", ['["a"]', "{ a = 1 }", "3", '""'])
def test_names_of_axes(command, capsys, name):
    Path("schedule.toml").write_text(
        f'[platform]\naxes = [{{ name = {name}, direction = "z" }}]\n[schedule]\nholds = [{{}}]\n'
    )
    assert "the name of an axis must be a word" in refused(command, capsys, "observe", "schedule.toml")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    from gimbalcal.methods import calibrate

    made, _ = calibrate([DEVICE])
    return json.dumps(made.to_dict())


def _shorter(content):
    content["stages"][0]["sigmas"].popitem()


@pytest.mark.parametrize(("change", "sentence"), [
    (_shorter, "there must be a sigma for each of its values"),
    (lambda c: c.pop("unobservable"), "unobservable is missing"),
    (lambda c: c["parameters"][0].pop("sigma"), "parameters / 1 / sigma is missing"),
    (lambda c: c["parameters"][0].update(effect=[]), "parameters / 1 / effect cannot be []: it must be a text"),
    (lambda c: c.update(residual=3), "residual cannot be 3: it must be a table of keys"),
    (lambda c: c.update(readout=[]), "readout cannot be []: it must be a table of keys"),
    (lambda c: c.update(outcome=None), "outcome cannot be None: it must be a text"),
    (lambda c: c.update(outcome="\ud800"), "half of a character"),
])  # fmt: skip
def test_results_of_another_shape(command, capsys, result, change, sentence):
    content = json.loads(result)
    change(content)
    Path("calibration.json").write_text(json.dumps(content))
    assert sentence in refused(command, capsys, "export", "json", "--calibration", "calibration.json", "--out", "made")


@pytest.mark.parametrize(("content", "sentence"), [
    (b"[1, 2", "line 1, column 6: no JSON"), (b"\xc3", "not text in UTF-8"), (b"9" * 5000, "too many digits"),
    (b"[" * 100_000, "too many brackets"),
])  # fmt: skip
def test_json_that_is_none(tmp_path, content, sentence):
    path = tmp_path / "x.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=sentence):
        read_json(path, "another")


@pytest.mark.parametrize(
    "spoil", [lambda b: b[: len(b) // 2] + b"\xc3", lambda b: b.replace(b"1.0", b'"' + b"x" * 140_000 + b'"', 1)]
)
def test_logs_cut_inside_a_character_and_cells_without_end(command, capsys, spoil):
    rows = "".join(f"{i},{i % 7}.0,1.0,9.8\n" for i in range(50))
    Path("log.csv").write_bytes(spoil(f"t [s],ax [µg],ay,az\n{rows}".encode()))
    assert command("new", "log.csv") in (0, 2)
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("text", ["x" * 3_000_000, "[" * 200_000, "{" * 200_000, '"' * 200_001, "a = " * 200_000])
def test_printing_is_linear_in_the_length(text):
    began = time.process_time()
    _as_printed(text)
    assert time.process_time() - began < 2.0


def test_escape_sequences_are_shown_not_obeyed(command, capsys):
    for word in ("\x1b[31mred", "\x9b31mred", "\u202egnp.exe"):
        command("calibrate", f"no-{word}")
        err = capsys.readouterr().err
        assert word not in err
        assert "\\x" in err or "\\u" in err


def test_warnings_and_panics_stay_inside():
    code = (
        "import os, warnings, click, gimbalcal.cli as cli\n"
        "def noisy(**_):\n"
        "    warnings.warn('overflow', RuntimeWarning)\n"
        "    os.write(2, b'thread panicked')\n"
        "    raise cli.InputError('one sentence')\n"
        "cli.gimbalcal.commands['noise'].callback = noisy\n"
        "cli.main()"
    )
    done = subprocess.run([sys.executable, "-c", code, "noise", "x"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr, done.stdout) == (2, "gimbalcal: one sentence\n", "")


def test_closed_streams():
    program = f"{sys.executable} -m gimbalcal calibrate nowhere 2>&-"
    done = subprocess.run(["sh", "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")


KILLED = """
import os, signal
from pathlib import Path
from gimbalcal import atomic
with atomic.atomic_folder(Path("made")) as new:
    (new / "a").write_text("b")
    with atomic.atomic_folder(new) as inner:
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_process_left_goes_with_the_next_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    own = Path(".made-12345678")  # of the same pattern, with a file that nobody here wrote
    own.mkdir()
    (own / "mine").touch()
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for _ in range(2):
        subprocess.run([sys.executable, "-c", KILLED], check=False, env=environment)
        assert len(list(tmp_path.iterdir())) > 1
        with atomic.atomic_folder(Path("made")) as new:
            (new / "c").write_text("d")
            with atomic.atomic_folder(Path("made")) as other:  # at work: its folder is no litter
                (other / "e").touch()
        assert sorted(p.name for p in tmp_path.iterdir()) == [".made-12345678", "made"]
        assert sorted(p.name for p in Path("made").iterdir()) == ["c", "e"]
        shutil.rmtree("made")


def test_a_second_correction_is_reported(command, capsys, result):
    Path("calibration.json").write_text(result)
    known = ("--calibration", "calibration.json")
    assert command("apply", DEVICE, *known, "--out", "once") == 0
    assert "already" not in capsys.readouterr().err
    assert command("apply", "once", *known, "--out", "twice") == 0
    assert "corrected by this calibration already" in capsys.readouterr().err
    assert len(read("twice").corrected) == 2
    assert command("apply", "twice", *known, "--inverse", "--out", "back") == 0
    assert read("back").corrected == read("once").corrected
    assert not read(DEVICE).corrected


def test_sweeps_of_a_named_schedule_of_turns(tmp_path):
    content = {"format": 1, "kind": "rotation", "site": {"latitude": {"value": 40.0, "unit": "deg"}},
               "platform": {"name": "bench"}, "schedule": {"name": "cai2016-18", "sweeps": 3}}  # fmt: skip
    once = schedule_of(check_content({**content, "schedule": {"name": "cai2016-18"}}).schedule)
    assert len(schedule_of(check_content(content).schedule).moves) == 3 * len(once.moves)
    for name in ("settle", "duration"):
        stated = {"name": "cai2016-18", name: {"value": 1.0, "unit": "s"}}
        with pytest.raises(InputError, match=f"schedule.{name} has no effect"):
            check_content({**content, "schedule": stated})


STARS = "a caption\n:{}\n35 0 0 2024 1 1 10 900 1000\n" + "".join(
    f"{10.5 * i:.5f} {20 + i:.5f} {10.5 * i:.5f} {20 + i:.5f}\n" for i in range(30)
)


@pytest.mark.parametrize("option", ["ALTZA", "ALTAX", "ALTA", "EQAUT"])
def test_options_of_tpoint_that_are_nearly_one(tmp_path, option):
    path = tmp_path / "stars.dat"
    path.write_text(STARS.format(option))
    with pytest.raises(InputError, match=r"is no option of TPOINT; write :(ALTAZ|EQUAT)"):
        import_files("tpoint", [path])
    for sound, axis in (("ALTAZ", "azimuth"), ("NODA", "hour_angle"), ("EQUAT", "hour_angle")):
        path.write_text(STARS.format(sound))
        assert ("gimbal_angle", axis) in import_files("tpoint", [path]).channels


@pytest.mark.parametrize("cell", ["1e308", "1e99", "-1e12"])
def test_values_that_nothing_measures(tmp_path, cell):
    (tmp_path / "h.toml").write_text(
        'format = 1\nkind = "multi-position"\n[platform]\nname = "bench"\n[columns]\n'
        't = { quantity = "time", unit = "s" }\n'
        + "".join(f'{a} = {{ quantity = "specific_force", axis = "{a}", unit = "m/s^2" }}\n' for a in "xyz")
    )
    rows = [[str(i), "0.1", "0.2", f"9.8{i % 10}"] for i in range(60)]
    rows[30][2] = cell
    (tmp_path / "r.csv").write_text("t,x,y,z\n" + "\n".join(map(",".join, rows)))
    with pytest.raises(InputError, match=r"r.csv, line 32, column y: .* is beyond"):
        import_files("csv", [tmp_path / "r.csv"], {"header": str(tmp_path / "h.toml")})


def test_a_guide_pulse_of_fifty_days(tmp_path):
    text = seeds._guide()
    path = tmp_path / "guide.txt"
    path.write_text(text.replace(",0.1,0.1,20,W,", ",0.1,0.1,4320000000,W,", 1))
    with pytest.raises(InputError, match="a pulse of 4320000000 ms"):
        import_files("phd2", [path], {"latitude": "51"})


@pytest.mark.parametrize("name", ["calibrate", "diagnose"])
def test_what_the_store_does_not_take_is_not_written_either(command, capsys, monkeypatch, name):
    def full(*_):
        raise InputError("units.db cannot be used as a store (database or disk is full); give another --store")

    monkeypatch.setattr("gimbalcal.history.keep", full)
    assert "disk is full" in refused(command, capsys, name, DEVICE, "--store", "units.db", "--out", "results")


def test_a_store_on_a_disk_that_fails_is_refused_at_once(tmp_path, monkeypatch):
    class Failing(sqlite3.Connection):
        def execute(self, statement, *values):
            if "journal_mode" in statement:
                problem = sqlite3.OperationalError("disk I/O error")
                problem.sqlite_errorcode = sqlite3.SQLITE_IOERR
                raise problem
            return super().execute(statement, *values)

    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda *a, **k: connect(*a, factory=Failing, **k))
    start = time.monotonic()
    with pytest.raises(InputError, match="disk I/O error"):
        keep(tmp_path / "units.db", entry())
    assert time.monotonic() - start < WAIT_S / 4
