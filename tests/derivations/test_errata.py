"""`python -m derivations`: the table, the file, and what happens when it cannot be written."""

import json
from dataclasses import replace

import pytest

from derivations import __main__, errata
from derivations.comparison import Comparison
from derivations.verdict import Verdict

VERDICTS = (
    Verdict("001", "Eq. (1)", "agrees", "a", "a", "0", "Right by (3). And more."),
    Verdict("001", "Table 4, x1", "wrong", "1", "2", "1.0e+00 (1e+06 ug)", "It does not follow. At all."),
)


def test_table_shortens_what_agrees_and_nothing_else():
    text = errata.table(VERDICTS, width=200)
    assert "Right by (3)." in text
    assert "And more" not in text
    assert "It does not follow. At all." in text


def test_papers_are_named_as_a_reader_knows_them():
    other = replace(VERDICTS[0], source="000")
    lines = errata.table((other, *VERDICTS), width=200).splitlines()
    assert lines[2] == "Wang 2019 (source 000 in errata.json)"
    assert lines[4] == "Wu 2018 (source 001 in errata.json)"
    assert "Not right as printed in Wang 2019: none." in errata.summary((other, *VERDICTS))


def test_summary_counts_and_names_faults():
    assert errata.summary(VERDICTS) == "2 items: 1 agrees, 1 wrong.\nNot right as printed in Wu 2018: Table 4, x1."


def test_summary_tells_what_nothing_printed_determines_from_what_is_not_right():
    third = replace(VERDICTS[0], item="Table 5, yaw", verdict="not-determined")
    lines = errata.summary((*VERDICTS, third)).splitlines()
    assert lines[1:] == ["Not right as printed in Wu 2018: Table 4, x1.", "Not determined in Wu 2018: Table 5, yaw."]


def test_summary_counts_the_entries_of_a_table_that_nothing_determines():
    open_ = [replace(VERDICTS[0], item=f"Table 5, {i}", verdict="not-determined") for i in range(20)]
    rest = replace(VERDICTS[0], item="Eq. (9)", verdict="not-determined")
    assert (
        errata.summary((*open_, rest)).splitlines()[-1] == "Not determined in Wu 2018: Table 5 (20 entries); Eq. (9)."
    )


def test_summary_lists_where_the_package_differs():
    same = replace(VERDICTS[0], package=Comparison("forward", 1e-16))
    apart = replace(VERDICTS[1], package=Comparison("fine.norm_rows", 2.0))
    assert errata.summary((same,)).endswith("The package follows the derivation in all 1 items that it computes.")
    lines = errata.summary((same, apart)).splitlines()
    assert lines[-2] == "THE PACKAGE DIFFERS from the derivation in 1 of 2 items that it computes:"
    assert lines[-1] == "  Wu 2018, Table 4, x1: PACKAGE DIFFERS in fine.norm_rows by 2."


def test_file_has_the_nine_fields_and_replaces_the_old_one(tmp_path):
    (tmp_path / "errata.json").write_text("old")
    path = errata.write(VERDICTS, tmp_path)
    assert [sorted(entry) for entry in json.loads(path.read_text())] == [
        sorted(("source", "item", "verdict", "printed", "derived", "size", "why", "package", "assumes"))
    ] * 2
    assert [p.name for p in tmp_path.iterdir()] == ["errata.json"]


def test_file_says_how_the_package_compares_and_what_a_verdict_assumes(tmp_path):
    same = replace(VERDICTS[0], package=Comparison("forward", 1e-16), assumes="a sphere")
    apart = replace(VERDICTS[1], package=Comparison("fine.norm_rows", 2.0))
    entries = json.loads(errata.write((*VERDICTS[:1], same, apart), tmp_path).read_text())
    assert [e["package"] for e in entries] == ["not compared", "same", "differs"]
    assert [e["assumes"] for e in entries] == ["", "a sphere", ""]
    assert "Assumes a sphere." in errata.table((same,), width=200)


def test_one_item_is_shown_in_full(monkeypatch, capsys):
    monkeypatch.setattr(__main__.wu2018, "verdicts", lambda: VERDICTS)
    assert __main__.main(["wu2018", "Table 4"]) == 0
    shown = capsys.readouterr().out
    assert "printed  1" in shown
    assert "derived  2" in shown
    assert "Eq. (1)" not in shown
    assert __main__.main(["wu2018", "Eq. (99)"]) == 2


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    (tmp_path / "errata.json").write_text("old")

    def fail(*args, **kwargs):
        raise OSError("disk full")

    monkeypatch.setattr("pathlib.Path.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        errata.write(VERDICTS, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["errata.json"]
    assert (tmp_path / "errata.json").read_text() == "old"


def test_program_writes_into_out(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(__main__, "PAPERS", (__main__.wu2018,))
    monkeypatch.setattr(__main__.wu2018, "verdicts", lambda: VERDICTS)
    assert __main__.main(["--out", str(tmp_path / "new")]) == 0
    assert len(json.loads((tmp_path / "new" / "errata.json").read_text())) == 2
    assert "Table 4, x1" in capsys.readouterr().out


def test_program_says_what_to_do_when_out_is_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(__main__, "PAPERS", (__main__.wu2018,))
    monkeypatch.setattr(__main__.wu2018, "verdicts", lambda: VERDICTS)
    (tmp_path / "file").write_text("")
    assert __main__.main(["--out", str(tmp_path / "file")]) == 2
    assert "give --out a folder" in capsys.readouterr().err
