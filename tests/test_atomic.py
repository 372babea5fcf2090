"""Files and folders appear whole or not at all, and nothing is left behind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from gimbalcal import atomic


class PowerCut(Exception):
    pass


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_a_file_whose_writing_fails_stays_as_it_was(tmp_path: Path) -> None:
    atomic.write(tmp_path / "new" / "a.txt", "old\n")  # folders on the way are made

    def half() -> None:
        with atomic.file(tmp_path / "new" / "a.txt") as path:
            path.write_text("half")
            assert (tmp_path / "new" / "a.txt").read_text() == "old\n"
            raise PowerCut

    with pytest.raises(PowerCut):
        half()
    assert (tmp_path / "new" / "a.txt").read_text() == "old\n"
    assert names(tmp_path / "new") == ["a.txt"]


def test_text_is_utf_8_and_bytes_are_themselves(tmp_path: Path) -> None:
    atomic.write(tmp_path / "a", "µg\r\n")
    assert (tmp_path / "a").read_bytes() == b"\xc2\xb5g\r\n"
    atomic.write(tmp_path / "a", b"\xff")
    assert (tmp_path / "a").read_bytes() == b"\xff"


@pytest.mark.parametrize("there", [False, True])
def test_a_folder_whose_making_fails_is_not_seen(tmp_path: Path, there: bool) -> None:
    out = tmp_path / "deep" / "out"
    if there:
        out.mkdir(parents=True)
        (out / "b").write_text("old")

    def half() -> None:
        with atomic.folder(out) as made:
            (made / "b").write_text("new")
            raise PowerCut

    with pytest.raises(PowerCut):
        half()
    assert names(tmp_path) == (["deep"] if there else [])
    assert not there or (names(out) == ["b"] and (out / "b").read_text() == "old")


def test_a_folder_takes_its_files_in_order_and_keeps_strangers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("kept")
    moved: list[str] = []
    replace = Path.replace
    monkeypatch.setattr(Path, "replace", lambda self, to: (moved.append(self.name), replace(self, to))[1])
    with atomic.folder(tmp_path / "out", last="header") as made:
        for name in ("header", "z", "a"):
            (made / name).write_text(name)
    assert moved == ["a", "z", "header"]
    assert names(tmp_path / "out") == ["a", "header", "mine", "z"]


def test_a_full_disk_is_told_with_the_name_of_the_file(tmp_path: Path) -> None:
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
for name, make in (("report.html", text), ("rows.parquet", table), ("rows.csv", lines)):
    atomic.write(out / "old", "old")
    try:
        with atomic.folder(out) as new:
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


def test_nothing_is_replaced_where_one_file_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "out" / "z.html").mkdir(parents=True)
    (tmp_path / "out" / "a.json").write_text("old")

    def make() -> None:
        with atomic.folder(tmp_path / "out") as new:
            (new / "a.json").write_text("new")
            (new / "z.html").write_text("new")

    with pytest.raises(IsADirectoryError, match=r"z\.html"):
        make()
    assert (tmp_path / "out" / "a.json").read_text() == "old"
