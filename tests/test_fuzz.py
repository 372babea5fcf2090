"""A few inputs of the fuzzer, in this process: 0, 1, or one sentence and 2. For more: `python -m tests.fuzz`."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal import units
from gimbalcal.calibration.exchange import FORMATS
from gimbalcal.cli import gimbalcal
from gimbalcal.importers import KINDS, imu_tk
from tests.fuzzing import seeds
from tests.fuzzing.documented import CHEAP, FITS, TIERS, fuzzer, input_of
from tests.fuzzing.targets import TARGETS
from tests.fuzzing.worker import run

QUICK = ("csv", "header", "hand", "static", "parquet", "calibration", "schedule", "scenario", "tpoint", "phd2",
         "rig_csv", "hdf5", "npz", "meant_files", "saved", "deep", "store", "history", "mount", "law",
         "texts", "parts", "messages")  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("seeds")
    seeds.make(made)
    return made


@pytest.mark.parametrize("name", QUICK)
def test_what_is_spoilt_is_a_sentence(folder, name):
    assert name in TARGETS
    for number in range(8):
        found = run(name, 11, number, folder)
        assert not found["wrong"], found


# what longer runs found, by target, seed and number
FOUND = [("schedule", 2, 2930), ("csv", 2, 3752), ("scenario", 2, 3781), ("calibration", 2, 2194),
         ("schedule", 1, 564), ("exchange", 1, 877), ("exchange", 1, 1724), ("exchange", 1, 1674),
         ("hdf5", 1, 235), ("csv", 1, 325), ("exchange", 3, 1098),
         ("calibration", 3, 2438), ("parquet", 5002, 7436), ("phd2", 5002, 41), ("exchange", 5002, 2430),
         ("diagnose", 5002, 5909), ("hand", 5002, 8113), ("scenario", 5002, 6764), ("scenario", 77, 12),
         ("deep", 6000, 59), ("deep", 6000, 1366), ("mount", 6000, 978), ("texts", 6000, 98),
         ("hdf5", 8001, 1149), ("store", 8001, 3507), ("mount", 8001, 4360), ("mount", 8001, 7724),
         ("mount", 8001, 8409), ("deep", 8001, 8872), ("deep", 7001, 7073), ("meant_files", 9001, 9028),
         ("planning", 14001, 1637), ("diagnose", 14001, 2119), ("meant_files", 12002, 5621),
         ("arguments", 12001, 4616), ("rough_diagnose", 14004, 130), ("stars", 14002, 1372),
         ("csv", 13004, 1460), ("exchange", 13005, 493), ("parts", 15001, 42)]  # fmt: skip


@pytest.mark.parametrize(("name", "seed", "number"), FOUND)
def test_what_was_wrong_once_is_right(folder, name, seed, number):
    found = run(name, seed, number, folder)
    assert not found["wrong"], found


@pytest.fixture(scope="module")
def documented():
    with fuzzer() as runs:
        yield runs


def test_what_the_documented_fuzzer_damages_is_sound_before(documented):
    for command in (*CHEAP, *FITS):
        assert documented.reference(command)[0].status in (0, 1), command


def test_the_documented_fuzzer_takes_every_command_and_kind():
    taken = {command[:2] for commands, _ in TIERS for command in commands}
    assert {command for command, *_ in taken} == set(gimbalcal.commands)
    assert {kind for command, kind in ((*t, "")[:2] for t in taken) if command == "import"} == set(KINDS)
    assert {kind for command, kind in ((*t, "")[:2] for t in taken) if command == "export"} == {*FORMATS}


def test_inputs_from_the_documents_are_answered_and_nothing_is_wrong_in_silence(documented):
    assert not [find for n in range(60) if (find := documented.one(9, n, TIERS[:1]))]


def test_the_oracle_notices_a_falsified_unit_and_rows_that_go(documented, monkeypatch):
    hand, table = [((("calibrate", "hand"),), 1.0)], [((("import", "imu-tk", "acc.txt", "gyr.txt"),), 1.0)]
    n = next(n for n in range(1000) if '"mg"' in rewritten(documented, n, hand))
    assert documented.one(3, n, hand) is None
    milli_g = units.ATOMS["mg"]
    with monkeypatch.context() as falsified:
        falsified.setattr(units, "ATOMS", {**units.ATOMS, "mg": replace(milli_g, factor=1.0005 * milli_g.factor)})
        units._parse.cache_clear()
        find = documented.one(3, n, hand)
    units._parse.cache_clear()
    assert find is not None
    assert "scale_factor" in find["wrong"]
    documented.reference(table[0][0][0])
    matrix = imu_tk.text_matrix
    monkeypatch.setattr(imu_tk, "text_matrix", lambda *given: matrix(*given)[:-6])
    assert any(documented.one(3, n, table) for n in range(20))


def rewritten(documented, n, commands):
    """The header of the hand-turned recording if input n rewrites it."""
    place = documented.folder / "looked-at"
    given = input_of(np.random.default_rng([3, n]), place, documented.base, documented.recordings, commands)
    text = (place / "hand" / "recording.toml").read_text() if given.what == "rewrite" else ""
    shutil.rmtree(place)
    return text
