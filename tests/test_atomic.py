"""Files and folders appear whole or not at all, and nothing is left behind."""

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from gimbalcal import atomic


class PowerCut(Exception):
    pass


def names(folder):
    return sorted(p.name for p in folder.iterdir())


def test_a_file_whose_writing_fails_stays_as_it_was(tmp_path):
    atomic.write(tmp_path / "new" / "a.txt", "old\n")  # folders on the way are made

    def half():
        with atomic.atomic_file(tmp_path / "new" / "a.txt") as path:
            path.write_text("half")
            assert (tmp_path / "new" / "a.txt").read_text() == "old\n"
            raise PowerCut

    with pytest.raises(PowerCut):
        half()
    assert (tmp_path / "new" / "a.txt").read_text() == "old\n"
    assert names(tmp_path / "new") == ["a.txt"]


def test_text_is_utf_8_and_bytes_are_themselves(tmp_path):
    atomic.write(tmp_path / "a", "µg\r\n")
    assert (tmp_path / "a").read_bytes() == b"\xc2\xb5g\r\n"
    atomic.write(tmp_path / "a", b"\xff")
    assert (tmp_path / "a").read_bytes() == b"\xff"


@pytest.mark.parametrize("there", [False, True])
def test_a_folder_whose_making_fails_is_not_seen(tmp_path, there):
    out = tmp_path / "deep" / "out"
    if there:
        out.mkdir(parents=True)
        (out / "b").write_text("old")

    def half():
        with atomic.atomic_folder(out) as made:
            (made / "b").write_text("new")
            raise PowerCut

    with pytest.raises(PowerCut):
        half()
    assert names(tmp_path) == (["deep"] if there else [])
    assert not there or (names(out) == ["b"] and (out / "b").read_text() == "old")


def test_a_folder_takes_its_files_in_order_and_keeps_strangers(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic, "_exchange_folders", lambda one, other: False)  # a system that has no such step
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("kept")
    moved: list[str] = []
    replace = Path.replace
    monkeypatch.setattr(Path, "replace", lambda self, to: (moved.append(self.name), replace(self, to))[1])
    with atomic.atomic_folder(tmp_path / "out", last="header") as made:
        for name in ("header", "z", "a"):
            (made / name).write_text(name)
    assert moved == ["a", "z", "header"]
    assert names(tmp_path / "out") == ["a", "header", "mine", "z"]


def test_a_full_disk_is_told_with_the_name_of_the_file(tmp_path):
    """Limits of a process stand for a disk: 20 kB, by Python and by the engine that writes Parquet."""
    code = f"""
import resource, numpy as np, polars as pl
from pathlib import Path
from gimbalcal import atomic
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
out = Path({str(tmp_path)!r}) / "out"
def text(new): (new / "report.html").write_text(100_000 * "x")
rows = pl.DataFrame({{"a": np.random.default_rng(1).normal(size=20_000)}})
def table(new): rows.write_parquet(new / "rows.parquet")
def lines(new): rows.write_csv(new / "rows.csv")
def whole(new): atomic.write(new / "page.html", 100_000 * "x")
for name, make in (("report.html", text), ("rows.parquet", table), ("rows.csv", lines), ("page.html", whole)):
    atomic.write(out / "old", "old")
    try:
        with atomic.atomic_folder(out) as new:
            (new / "a.json").write_text("new")
            make(new)
    except OSError as problem:
        assert problem.filename == str(out / name), problem.filename
        assert "large" in problem.strerror, problem
    else:
        raise SystemExit("no error")
    assert [p.name for p in out.iterdir()] == ["old"], list(out.iterdir())
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_nothing_is_replaced_where_one_file_cannot_be(tmp_path):
    (tmp_path / "out" / "z.html").mkdir(parents=True)
    (tmp_path / "out" / "a.json").write_text("old")

    def make():
        with atomic.atomic_folder(tmp_path / "out") as new:
            (new / "a.json").write_text("new")
            (new / "z.html").write_text("new")

    with pytest.raises(IsADirectoryError, match=r"z\.html"):
        make()
    assert (tmp_path / "out" / "a.json").read_text() == "old"


NAMES = ("a.json", "b.csv", "c.html")
WITHIN = ("a.json", "b/a.json", "b/c.html")  # of two sensors


def replaced(out, age, of=NAMES):
    with atomic.atomic_folder(out, last="a.json") as new:
        for name in of:
            atomic.write(new / name, age)


def shown(folder):
    """What one sees in a folder: a kill may leave something hidden."""
    return [name for name in names(folder) if not name.startswith(".")]


def ages(out, of=NAMES):
    return {(out / name).read_text() for name in of}


@contextmanager
def cut_at(n, monkeypatch):
    """After n steps that change what is on the disk the process is dead: no step does anything any more."""
    taken = [0]

    def dying(step):
        def one(*arguments, **named):
            taken[0] += 1
            if taken[0] > n:
                raise PowerCut
            return step(*arguments, **named)

        return one

    with monkeypatch.context() as m:
        for name in ("mkdir", "link", "rename", "replace", "unlink", "rmdir", "utime", "chmod"):
            m.setattr(os, name, dying(getattr(os, name)))
        for name in ("rename", "replace", "mkdir"):
            m.setattr(Path, name, dying(getattr(Path, name)))
        m.setattr(atomic, "_exchange_folders", dying(atomic._exchange_folders))
        m.setattr("shutil.rmtree", dying(atomic.shutil.rmtree))
        yield taken


@pytest.mark.parametrize("of", [NAMES, WITHIN])
def test_a_kill_at_any_step_leaves_all_files_of_one_age(tmp_path, monkeypatch, of):
    out, seen = tmp_path / "out", set()
    others = [out / name for name in (("mine", "b/mine") if of is WITHIN else ("mine",))]
    for n in range(200):
        replaced(out, "old", of)
        for mine in others:
            mine.write_text(str(n))
        try:
            with cut_at(n, monkeypatch) as taken:
                replaced(out, "new", of)
        except PowerCut:
            pass
        assert len(ages(out, of)) == 1, f"step {n}"
        assert shown(out) == sorted({*(name.split("/")[0] for name in of), "mine"}), f"step {n}"
        assert {mine.read_text() for mine in others} == {str(n)}
        seen |= ages(out, of)
        if taken[0] <= n:
            break
    assert seen == {"old", "new"}
    assert n > 10


KILLS = """
import os, random, signal, sys, time
from pathlib import Path
from gimbalcal import atomic
out, names, wait = Path(sys.argv[1]), sys.argv[2:], random.Random(12)
for k in range(60):
    ready, told = os.pipe()
    child = os.fork()
    if not child:
        for age in range(10**9):
            with atomic.atomic_folder(out) as new:
                for name in names:
                    (new / name).parent.mkdir(exist_ok=True)
                    (new / name).write_text(f"{k} {age}")
            os.write(told, b"1")
    os.read(ready, 1)  # it is at work
    time.sleep(wait.uniform(0, 0.01))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    ages = {(out / name).read_text() for name in names}
    assert len(ages) == 1, (k, ages)
    there = {name.split("/")[0] for name in names}
    assert sorted(n for n in os.listdir(out) if n[0] != ".") == sorted([*there, "mine"]), os.listdir(out)
"""


@pytest.mark.parametrize("of", [NAMES, WITHIN])
def test_kills_while_replacing_leave_all_files_of_one_age(tmp_path, of):
    """60 of them by the system itself."""
    out = tmp_path / "out"
    replaced(out, "0", of)
    (out / "mine").write_text("mine")
    subprocess.run([sys.executable, "-c", KILLS, str(out), *of], check=True)
    assert ages(out, of) != {"0"}


@pytest.mark.parametrize("why", ["folders within", "where we stand", "one file", "a link"])
def test_what_is_exchanged_and_what_not(tmp_path, monkeypatch, why):
    out = tmp_path / "out"
    replaced(out, "old")
    before, exchanged = out.stat(), why == "a link"
    if why == "folders within":
        (out / "sub").mkdir()
    elif why == "where we stand":
        monkeypatch.chdir(out)
    elif why == "one file":
        with atomic.atomic_folder(out) as new:
            (new / "a.json").write_text("one")
        assert (out / "a.json").read_text() == "one"
    elif why == "a link":
        (tmp_path / "short").symlink_to(out)
    out.chmod(0o751)
    if why != "one file":
        replaced(Path() if why == "where we stand" else tmp_path / "short" if exchanged else out, "new")
        assert ages(out) == {"new"}
    assert (out.stat().st_ino != before.st_ino) == exchanged
    assert out.stat().st_mode & 0o777 == 0o751
    assert names(tmp_path) == ["out", *(["short"] if exchanged else [])]
    assert [n for n in names(out) if n != "sub"] == list(NAMES)


@pytest.mark.parametrize("as_one", [True, False])
def test_what_belongs_to_earlier_files_goes_with_them(tmp_path, monkeypatch, as_one):
    if not as_one:
        monkeypatch.setattr(atomic, "_exchange_folders", lambda one, other: False)
    for name in (*NAMES, "law.py", "mine"):
        atomic.write(tmp_path / "out" / name, "old")
    with atomic.atomic_folder(tmp_path / "out", belonging=("law.py", "c.html", "never")) as new:
        for name in NAMES:
            (new / name).write_text("new")
    assert names(tmp_path / "out") == [*NAMES, "mine"]
    assert ages(tmp_path / "out") == {"new"}


TWO = """
import sys
from pathlib import Path
from gimbalcal import atomic
for n in range(100):
    with atomic.atomic_folder(Path(sys.argv[1])) as new:
        for name in sys.argv[3:]:
            (new / name).write_text(f"{sys.argv[2]} {n}")
"""


def test_two_that_replace_at_once_are_never_mixed(tmp_path):
    out = tmp_path / "out"
    replaced(out, "0")
    both = [subprocess.Popen([sys.executable, "-c", TWO, str(out), who, *NAMES]) for who in "AB"]
    while any(process.poll() is None for process in both):
        assert len(at_a_look(out)) <= 1
    assert [process.returncode for process in both] == [0, 0]
    assert names(tmp_path) == ["out"]


def at_a_look(out):
    """Ages in a folder that is held open; none where it was exchanged and removed meanwhile."""
    folder, found = os.open(out, os.O_RDONLY), set[str]()
    try:
        for name in NAMES:
            with open(name, opener=lambda each, flags: os.open(each, flags, dir_fd=folder)) as file:
                found.add(file.read())
    except FileNotFoundError:
        return set()
    finally:
        os.close(folder)
    return found


def test_what_another_saves_meanwhile_stays(tmp_path, monkeypatch):
    out = tmp_path / "out"
    replaced(out, "old")
    (out / "mine").write_text("draft")
    exchange = atomic._exchange_folders

    def slow(one, other):
        atomic.write(out / "mine", "saved")
        (out / "more").write_text("more")
        return exchange(one, other)

    monkeypatch.setattr(atomic, "_exchange_folders", slow)
    replaced(out, "new")
    assert ages(out) == {"new"}
    assert (out / "mine").read_text() == "saved"
    assert (out / "more").read_text() == "more"
