"""Batches: the same digits from any number of workers, after a stop and on a cluster; failures stop nothing."""

import json
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import polars as pl
import pytest
from click.testing import CliRunner

from gimbalcal import pipeline
from gimbalcal.campaign.workers import connect
from gimbalcal.cli import gimbalcal
from gimbalcal.errors import InputError
from gimbalcal.fleet import batch, run_batch
from gimbalcal.fleet.fleet_summary import fleet_summary
from gimbalcal.fleet.unit_recording import BatchTask, UnitRecording, entries_of, failure_entry, recordings_of
from gimbalcal.history import StoredResult, kept_entries, of_store
from gimbalcal.history.fleet import fleet_of_store
from gimbalcal.recording import Source, write
from gimbalcal.report.fleet_page import fleet_report
from gimbalcal.words.fleet_sentences import prior_in_words
from tests.campaign.test_campaign import dask_cluster, wait_for
from tests.fleet.deadly import dies_with_the_second
from tests.fleet.units import unit, write_units
from tests.history.calibrations import START, calibration

COUNT, BROKEN, ODD = 7, "rig-003", "rig-006"


@pytest.fixture(scope="module")
def rigs(tmp_path_factory):
    """Seven units, one of them without its samples, one with a bias that no other has."""
    folder = tmp_path_factory.mktemp("fleet") / "rigs"
    write_units(folder, COUNT - 1)
    write(unit(6, bias={"x": 4000.0})[0], folder / ODD)
    (folder / BROKEN / "samples.csv").unlink()
    (folder / "photographs").mkdir()
    return folder


@pytest.fixture(scope="module")
def alone(rigs, tmp_path_factory):
    """The batch in one process: its summary, and the folder of its store and results."""
    folder = tmp_path_factory.mktemp("alone")
    return run(rigs, folder, workers=1), folder


def run(rigs, folder, **options):
    return run_batch(
        [f"{rigs}/*"], folder / "units.sqlite", folder / "out", page=fleet_report, **options,
    )  # fmt: skip


def table(folder):
    return pl.read_parquet(folder / "out" / "fleet.parquet")


def test_a_recording_that_fails_is_listed_and_the_others_are_calibrated(alone):
    summary, folder = alone
    assert (summary.recordings, summary.units, summary.failed) == (COUNT, COUNT, 1)
    (failure,) = [r for r in summary.reports if r.failure]
    assert failure.unit == BROKEN
    assert "does not exist" in failure.failure
    assert {o.unit for o in summary.outside} == {ODD}
    assert not summary.ordinary
    assert json.loads((folder / "out" / "fleet.json").read_text()) == summary.to_dict()
    jsonschema.validate(summary.to_dict(), json.loads(Path("docs/schemas/fleet.schema.json").read_text()))
    rows = table(folder)
    assert rows["unit"].n_unique() == COUNT
    assert rows.filter(pl.col("unit") == BROKEN)["value"].to_list() == [None]
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert failure.failure in page
    assert len(page) < 500_000
    calibrations, diagnoses = of_store(folder / "units.sqlite", "rig-000")
    assert (len(calibrations), len(diagnoses)) == (1, 1)


def digits(store, *units):
    """Unit, kind and content of the entries of some units, without the time of their computation."""
    found = []
    for e in kept_entries(store):
        origin = {k: v for k, v in e.content["provenance"].items() if k != "created"}
        if e.unit in units:
            found.append((e.unit, e.kind, json.dumps({**e.content, "provenance": origin}, sort_keys=True)))
    return sorted(found)


@pytest.mark.slow
def test_workers_and_a_cluster_change_no_digit(rigs, alone, tmp_path):
    expected = digits(alone[1] / "units.sqlite", "rig-000", "rig-001")
    patterns = [str(rigs / "rig-00[01]")]
    run_batch(patterns, tmp_path / "two.sqlite", workers=2)
    assert digits(tmp_path / "two.sqlite", "rig-000", "rig-001") == expected
    with dask_cluster(tmp_path) as (address, _):
        with connect(address) as client:
            client.wait_for_workers(2, timeout=30)
        run_batch(patterns, tmp_path / "cluster.sqlite", scheduler=address)
    assert digits(tmp_path / "cluster.sqlite", "rig-000", "rig-001") == expected


def test_a_second_run_computes_nothing(rigs, alone):
    told: list[str] = []
    before = table(alone[1])
    assert run(rigs, alone[1], progress=told.append).to_dict() == alone[0].to_dict()
    assert told == [f"{COUNT} of {COUNT} recordings are in {alone[1] / 'units.sqlite'} already"]
    assert table(alone[1]).equals(before)


def test_what_was_corrected_is_computed_again_and_nothing_else(rigs, alone, tmp_path):
    store = tmp_path / "units.sqlite"
    store.write_bytes((alone[1] / "units.sqlite").read_bytes())
    samples = rigs / BROKEN / "samples.csv"
    write_units(tmp_path / "again", 1, first=3)
    samples.write_bytes((tmp_path / "again" / BROKEN / "samples.csv").read_bytes())
    try:
        told: list[str] = []
        summary = run(rigs, tmp_path, progress=told.append, workers=1)
    finally:
        samples.unlink()
    assert told[1] == "calibrating and diagnosing 1 recording"
    assert summary.failed == 0


@pytest.mark.slow
def test_a_killed_batch_continues_where_it_was(rigs, alone, tmp_path):
    store, patterns = tmp_path / "units.sqlite", [str(rigs / "rig-00[0-3]")]
    code = (
        "from pathlib import Path\nfrom gimbalcal.fleet import run_batch\n"
        f"run_batch({patterns!r}, Path({str(store)!r}), workers=1)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    wait_for(lambda: store.exists() and _present(store) >= 1, 60.0)
    process.kill()
    process.wait()
    told: list[str] = []
    run_batch(patterns, store, workers=1, progress=told.append)
    assert told[0].startswith(("1 of 4", "2 of 4", "3 of 4"))
    units = ("rig-000", "rig-001", "rig-002")
    assert digits(store, *units) == digits(alone[1] / "units.sqlite", *units)


def _present(store):
    try:
        return len({e.unit for e in kept_entries(store)})
    except InputError:  # its tables are being made
        return 0


def test_a_file_that_cannot_be_read_is_a_failure_of_its_recording_that_is_not_kept(tmp_path, monkeypatch):
    write_units(tmp_path, 2, positions=6)
    store, opened = tmp_path / "units.sqlite", Path.open

    def refusing(path, *arguments, **options):
        if path.name == "samples.csv" and path.parent.name == "rig-001":
            raise PermissionError(13, "Permission denied", str(path))
        return opened(path, *arguments, **options)

    monkeypatch.setattr(Path, "open", refusing)
    summary = run_batch([f"{tmp_path}/rig-*"], store, workers=1)
    assert [(r.unit, bool(r.failure), bool(r.method)) for r in summary.reports] == [
        ("rig-000", False, True), ("rig-001", True, False)
    ]  # fmt: skip
    assert summary.reports[1].failure.endswith("samples.csv cannot be read (Permission denied)")
    assert {e.unit for e in kept_entries(store)} == {"rig-000"}


def test_a_failure_that_may_pass_is_not_kept(tmp_path, monkeypatch):
    def fails(problem):
        def load(_):
            raise problem

        monkeypatch.setattr(pipeline, "load", load)
        told.clear()
        return run_batch([str(tmp_path / "rig-000")], tmp_path / "units.sqlite", workers=1, progress=told.append)

    told: list[str] = []
    write_units(tmp_path, 1, positions=6)
    for problem in (MemoryError(), OSError(24, "Too many open files"), ValueError("surprising")):
        assert fails(problem).failed == 1
        assert not kept_entries(tmp_path / "units.sqlite") if (tmp_path / "units.sqlite").exists() else True
    assert fails(InputError("the clock runs backwards")).reports[0].failure == "the clock runs backwards"
    fails(MemoryError())
    assert told == [f"1 of 1 recording is in {tmp_path / 'units.sqlite'} already"]


def test_failures_are_counted_by_recording_and_units_by_sensor():
    """A recording of two sensors, of which the diagnosis of one fails."""
    recording = UnitRecording("rigs/rig-000", "rig-000", (Source("recording.toml", "same"),))
    made = [StoredResult(f"rig-000 {s}", START.isoformat(), "calibration", calibration(np.zeros(6), k).to_dict())
            for k, s in enumerate("ab")]  # fmt: skip
    why = failure_entry(BatchTask(), recording, "there are too few positions", "b", lasting=True)
    summary, _, _ = fleet_summary({recording.folder: [*made, why]})
    assert (summary.units, summary.failed, summary.recordings) == (2, 1, 1)
    assert [r.failure for r in summary.reports] == ["", "there are too few positions"]
    assert summary.in_words.startswith("1 recording of 2 units: 1 failed.")


def test_every_pattern_must_match(rigs):
    with pytest.raises(InputError, match=r"no folder that matches .*rack.* holds a recording\.toml"):
        recordings_of([f"{rigs}/rig-*", f"{rigs}/rack-*"])


@pytest.mark.slow
def test_a_recording_that_ends_its_workers_is_named_and_tried_again(rigs, tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "entries_of", dies_with_the_second)
    patterns = [str(rigs / f"rig-00{k}") for k in (0, 1)]
    store = tmp_path / "units.sqlite"
    summary = run_batch(patterns, store, workers=2)
    assert [r.failure for r in summary.reports if r.failure] == [
        "computing it ended the worker 3 times, out of memory most likely; give its dwells as means"
    ]
    assert _present(store) == 1


def test_the_units_of_a_store_are_a_prior_and_rest_on_no_prior(alone, tmp_path):
    store = tmp_path / "units.sqlite"
    store.write_bytes((alone[1] / "units.sqlite").read_bytes())
    before = fleet_of_store(store)
    write_units(tmp_path / "new", 1, positions=6, first=50)
    recording = recordings_of([f"{tmp_path}/new/*"])[0]
    entries = entries_of(BatchTask(grade=before), recording)
    (own,) = [e for e in entries if e.is_calibration and e.content["method"] == "three-stage"]
    assert own.content["provenance"]["options"]["grade"]["name"] == "fleet"
    assert "6 units or more" in own.content["provenance"]["options"]["grade"]["from"]
    summary = run_batch([f"{tmp_path}/new/*"], store, grade=f"fleet:{store}", workers=1)
    assert prior_in_words(summary).startswith("The fleet that was the prior of 1 calibration is taken out here")
    assert fleet_of_store(store).identity == before.identity


def test_the_command_ends_with_one_for_a_fleet_to_look_at_and_with_two_for_none(rigs, alone, tmp_path):
    store = alone[1] / "units.sqlite"
    arguments = ["batch", f"{rigs}/*", "--store", str(store), "--out", str(tmp_path / "f")]
    done = CliRunner().invoke(gimbalcal, arguments, catch_exceptions=False)
    assert done.exit_code == 1
    assert "7 recordings of 7 units: 1 failed" in done.output
    again = CliRunner().invoke(gimbalcal, [*arguments, "--json", "--quiet"], catch_exceptions=False)
    assert json.loads(again.stdout)["failed"] == 1
    with pytest.raises(InputError, match="no folder that matches"):
        CliRunner().invoke(gimbalcal, ["batch", f"{tmp_path}/none*", "--store", str(store)], catch_exceptions=False)


def test_units_are_called_after_their_folder_the_one_around_it_or_the_title(rigs):
    named = [recordings_of([str(rigs / "rig-000")], name)[0].unit for name in ("folder", "parent", "title")]
    assert named == ["rig-000", "rigs", "unit 000"]
