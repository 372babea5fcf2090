"""A refused command says in one sentence on stderr what to write instead, exits with status 2, and writes nothing."""

import os
import re
import shlex
from pathlib import Path

import numpy as np
import polars as pl

from tests.paths import ROOT

# a line each, as typed in the folder of the project; `file` exists, `nowhere` does not
REFUSED = """
calibrate
frobnicate
calibrate nowhere
calibrate data/README.md
calibrate data/space_stable_18/samples.csv
calibrate data
calibrate data/space_stable_18 --frobnicate
calibrate data/space_stable_18 --method magic
calibrate data/space_stable_18 data/space_stable_18
calibrate data/space_stable_18 data/space_stable_static --method multiposition
calibrate data/space_stable_18 --terms nonsense
calibrate data/space_stable_static --method multiposition
calibrate data/space_stable_concealed --with bias_temperatur
diagnose nowhere
diagnose data/README.md
diagnose data/space_stable_18 --calibration nowhere.json
diagnose data/space_stable_18 --calibration data/README.md
diagnose data/space_stable_18 --baseline nonsense
diagnose data/xsens_positions --baseline bias,nonsense
diagnose data/space_stable_18 --seed one
navigate nowhere
navigate data/space_stable_18
navigate data/space_stable_static data/space_stable_18
navigate data/space_stable_static --calibration nowhere.json
navigate data/space_stable_static --calibration no.json --samples 1000000000000
navigate data/space_stable_static --damping -1
compare
compare nowhere.json
compare file --allow bias
compare --store nowhere.db
apply data/space_stable_18 --calibration nowhere.json
export matlab --calibration nowhere.json
import no-such-rig file
import csv file --set unit
simulate nowhere.toml
simulate demo --seed -1
campaign wu2018-18 -n -3
campaign wu2018-18 --workers 1000000
observe nowhere
observe wu2018-18 --candidates bias_temperature
observe wu2018-18 --force-sigma 0
observe wu2018-18 --angle-sigma -1
observe cai2016-18 --states bias_temperature
observe cai2016-18 --states gyro_drift
observe cai2016-18 --candidates bias
observe cai2016-18 --latitude 91
observe wei2022-30 --force-noise 1e-12 --velocity-sigma 1e-12
design -n 0
design --platform moon
design --platform bench
design --platform rate-table
design --step 50
design --step 1
design --angle-sigma -1
design --criterion max
design --terms gyro_bias
design --terms gimbal_zero
design --terms bias_temperature
design --separate bias --criterion position --angle-sigma 1
design --kind rotation --states bias --step 40
design --kind rotation --states bias --limit 90
design --kind rotation --states bias --criterion D
design --kind rotation --states bias --total 30
design --kind rotation --states bias --against nobody
budget nowhere
budget turned-unit
budget wei2022-static
budget wei2022-30 wei2022-static cai2016-static
budget wei2022-30 wang2019-swing
budget wei2022-30 wang2019-drive
budget wang2019-unit
budget wu2018-18 wei2022-30
budget wu2018-18 --with bias_temperature
budget wei2022-30 --with bias_temperature
budget wu2018-18 --states 30
budget wu2018-18 --hours nan
"""


def test_a_refusal_is_one_sentence_with_status_2_and_writes_nothing(command, capsys, golden):
    Path("file").write_text("mine")
    lines = []
    for line in REFUSED.strip().splitlines():
        words = [str(ROOT / word) if word.startswith("data") else word for word in shlex.split(line)]
        options = [] if line in ("calibrate", "frobnicate") else ["--out", "out", "--quiet"]
        assert command(*words, *options) == 2, line
        out, err = capsys.readouterr()
        assert (out, err.count("\n"), err.startswith("gimbalcal: ")) == ("", 1, True), line
        assert [p.name for p in Path().iterdir()] == ["file"], line
        lines.append(f"$ gimbalcal {line}\n{re.sub(f'{re.escape(str(ROOT))}/', '', err)}")
    golden("console/refusals", "\n".join(lines))


def test_a_damaged_archive_of_arrays_is_one_sentence_with_status_2(command, capsys):
    columns = {f"c{i}": np.random.default_rng(i).normal(size=200).round(2) for i in range(7)}
    np.savez_compressed("log.npz", **columns)
    pl.DataFrame(columns).write_parquet("log.parquet")
    for name, first, reason in (("log.npz", 56, "is damaged"), ("log.parquet", 4, "cannot be read as Parquet")):
        damaged = bytearray(Path(name).read_bytes())
        damaged[first : first + 20] = b"\xff" * 20  # where the data of the first column begin: no block of deflate
        Path(name).write_bytes(damaged)
        assert command("new", name, "--out", "out", "--quiet") == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert err.startswith(f"gimbalcal: {name} {reason}")


def test_a_panic_of_the_reader_of_parquet_is_one_sentence_with_status_2(command, capfd, monkeypatch):
    def panic(*_, **__):
        os.write(2, b"thread panicked")
        raise pl.exceptions.PanicException("index out of bounds")

    Path("log.parquet").write_bytes(b"PAR1")
    monkeypatch.setattr(pl, "read_parquet", panic)
    assert command("new", "log.parquet", "--out", "out", "--quiet") == 2
    out, err = capfd.readouterr()
    assert (out, err) == ("", "gimbalcal: log.parquet cannot be read as Parquet: index out of bounds\n")
