"""The store: what is kept comes back, twice the same is once, two writers lose nothing, and killing harms nothing."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, suppress
from datetime import UTC, datetime
from functools import partial
from threading import Timer

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.history import DatedCalibration, StoredResult, keep, kept_entries, of_store
from gimbalcal.history.unit_store import date_of
from gimbalcal.words.history_sentences import day_in_words
from tests.golden import refused
from tests.history.calibrations import SIGMA, START, calibration, history
from tests.paths import ROOT

WRITER = """
import sys
from pathlib import Path
import numpy as np
from gimbalcal.history import StoredResult, keep
from tests.history.calibrations import calibration
first, count, path = int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
for k in range(first, first + count):
    content = calibration(100 + k * np.ones(6), k).to_dict()
    keep(path, StoredResult("u", content["provenance"]["created"], "calibration", content))
    print(k, flush=True)
"""


def entry(k, unit="u", kind="calibration"):
    content = calibration(100.0 + np.arange(6), k).to_dict()
    return StoredResult(unit, content["provenance"]["created"], kind, content)


def writer(first, count, path):
    command = [sys.executable, "-c", WRITER, str(first), str(count), str(path)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )


def test_what_is_kept_comes_back_in_order(tmp_path):
    path = tmp_path / "new" / "units.db"
    made = [entry(2), entry(0), entry(1, "v"), entry(3, kind="diagnosis")]
    assert all(keep(path, e) for e in made)
    assert not keep(path, made[0])
    again = dict(made[0].content)
    again["provenance"] = {**again["provenance"], "created": "2030-01-01"}
    assert not keep(path, StoredResult("u", "2030-01-01", "calibration", again))
    assert [e.date for e in kept_entries(path)] == sorted(e.date for e in made)
    assert [e.unit for e in kept_entries(path, "v")] == ["v"]
    assert next(e for e in kept_entries(path) if e.kind == "diagnosis").content == made[3].content
    with closing(sqlite3.connect(path)) as base, base:
        rows = base.execute("select name, axis, value, sigma, unit from parameters").fetchall()
        assert base.execute("pragma journal_mode").fetchone() == ("wal",)
    assert len(rows) == 3 * 6
    first = made[0].content["parameters"][0]
    assert rows[0] == tuple(first[k] for k in ("name", "axis", "value", "sigma", "unit"))


def test_of_one_recording_the_last_counts_and_a_diagnosis_only_alone(tmp_path):
    path = tmp_path / "units.db"
    for k, (method, size, recording) in enumerate(
        [("three-stage", 1, "a"), ("three-stage", 2, "a"), ("diagnosis", 3, "a"), ("diagnosis", 4, "b")]
    ):
        content = {**calibration(100.0 + np.arange(6), k, size, recording).to_dict(), "method": method}
        keep(path, StoredResult("u", content["provenance"]["created"], "calibration", content))
    found, told = of_store(path)
    assert [(d.calibration.method, len(d.hashes)) for d in found] == [("three-stage", 1), ("diagnosis", 1)]
    assert [d.date for d in found] == [history(0)[1].date, history(0)[3].date]
    assert told == ()


def test_of_one_recording_what_was_computed_last_counts_whenever_it_was_kept(tmp_path):
    path = tmp_path / "units.db"
    for k in (2, 1):  # computed on days of their own, of a recording of one day
        keep(
            path,
            StoredResult("u", "2024-02-01", "calibration", calibration(100.0 + k * np.ones(6), k, 1.0, "a").to_dict()),
        )
    (found,) = of_store(path)[0]
    np.testing.assert_allclose(found.calibration.values, 102.0 * SIGMA)


def test_a_date_without_a_zone_is_in_utc_and_two_of_a_day_have_their_time(monkeypatch):
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    try:
        morning, evening = (
            DatedCalibration("", date_of(f"2024-02-03T{hour:02d}:00:00"), history(0)[0].calibration) for hour in (9, 20)
        )
    finally:
        monkeypatch.undo()
        time.tzset()
    assert evening.date == datetime(2024, 2, 3, 20, tzinfo=UTC)
    assert day_in_words(evening.date, [evening]) == "2024-02-03"
    assert day_in_words(evening.date, [morning, evening]) == "2024-02-03 20:00:00"


def test_units_and_strange_files_are_told_apart(tmp_path):
    path = tmp_path / "units.db"
    keep(path, entry(0))
    keep(path, entry(1, "v"))
    with refused():
        of_store(path)
    with refused():
        of_store(path, "w")
    with refused():
        kept_entries(tmp_path / "none.db")
    text, other = tmp_path / "text.db", tmp_path / "other.db"
    text.write_text("no database at all, but long enough to be one" * 20)
    with closing(sqlite3.connect(other)) as base, base:
        base.execute("create table mine (x)")
    for bad in (text, other):
        before = bad.read_bytes()
        with refused():
            keep(bad, entry(0))
        assert bad.read_bytes() == before


@pytest.mark.parametrize(
    "damage",
    [
        "content = replace(content, '\"ug\"', '\"mg\"')",
        "content = 'x'",
        "content = '[]'",
        "digest = ''",
        "unit = x'75'",
    ],
)
def test_an_entry_that_is_not_what_was_kept_is_refused(tmp_path, damage):
    path = tmp_path / "units.db"
    keep(path, entry(0))
    keep(path, entry(1))
    with closing(sqlite3.connect(path)) as base, base:
        assert base.execute(f"update entries set {damage} where id = 1").rowcount == 1
    with refused():
        kept_entries(path)


def test_who_makes_a_store_waits_for_another_who_makes_it(tmp_path, monkeypatch):
    path = tmp_path / "units.db"
    other = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    with closing(other):
        other.execute("begin immediate")  # it reads as empty, and nobody else may change its mode
        monkeypatch.setattr("gimbalcal.history.unit_store.WAIT_S", 0.0)
        with refused():
            keep(path, entry(0))
        monkeypatch.setattr("gimbalcal.history.unit_store.WAIT_S", 30.0)
        done = Timer(0.3, other.rollback)
        done.start()
        assert keep(path, entry(0))
        done.join()
    assert len(kept_entries(path)) == 1


def test_a_store_that_another_makes_while_it_is_looked_at_is_no_other_programs(tmp_path, monkeypatch):
    path, connect, others = tmp_path / "units.db", sqlite3.connect, [entry(1)]
    path.touch()  # the other has begun

    class Interrupted(sqlite3.Connection):
        def execute(self, sql, *values):
            if others and "sqlite_master" in sql:
                with suppress(InputError):  # who looks holds a lock, so that the other has to wait
                    keep(path, others.pop())
            return super().execute(sql, *values)

    monkeypatch.setattr("gimbalcal.history.unit_store.WAIT_S", 0.0)
    monkeypatch.setattr(sqlite3, "connect", partial(connect, factory=Interrupted))
    assert keep(path, entry(0))
    assert others == []
    assert entry(0).date in {e.date for e in kept_entries(path)}


def test_two_writers_at_once_lose_nothing(tmp_path):
    path, count = tmp_path / "units.db", 40
    both = [writer(first, count, path) for first in (0, count)]
    told = [len(p.communicate(timeout=120)[0].split()) for p in both]
    assert told == [count, count]
    assert [p.returncode for p in both] == [0, 0]
    assert {e.date for e in kept_entries(path)} == {entry(k).date for k in range(2 * count)}


def test_a_writer_that_is_killed_leaves_what_it_had_kept(tmp_path):
    path = tmp_path / "units.db"
    done: set[int] = set()
    for first, wait in ((0, 0.01), (500, 0.05), (1000, 0.12)):
        p = writer(first, 400, path)
        p.stdout.readline()
        done.add(first)
        time.sleep(wait)
        p.send_signal(signal.SIGKILL)
        done |= {int(line) for line in p.communicate()[0].split()}
        with closing(sqlite3.connect(path)) as base, base:
            assert base.execute("pragma integrity_check").fetchone() == ("ok",)
    there = {round((np.datetime64(e.date[:19]) - np.datetime64(START.replace(tzinfo=None))) / np.timedelta64(90, "D"))
             for e in kept_entries(path)}  # fmt: skip
    assert done <= there
    assert len(there - done) <= 3  # kept, and killed before it said so
    for e in kept_entries(path):
        assert len(e.content["parameters"]) == 6
