"""Files made to harm: links to other files, bombs, names that are code. Each is one sentence."""

import contextlib
import json
import shutil
import zipfile

import h5py
import numpy as np
import polars as pl
import pytest
import scipy.io

from gimbalcal.errors import InputError
from gimbalcal.guess.proposal import propose_recording
from gimbalcal.importers import import_files
from gimbalcal.importers.sandboxed_reader import matlab_variables
from gimbalcal.pipeline import load
from gimbalcal.recording import memory_limit
from tests.paths import DEVICE, XSENS

HEADER = """
format = 1
kind = "multi-position"
[platform]
name = "bench"
[columns]
t = { quantity = "time", unit = "s" }
"a[0]" = { quantity = "specific_force", axis = "x", unit = "m/s^2" }
"a[1]" = { quantity = "specific_force", axis = "y", unit = "m/s^2" }
"a[2]" = { quantity = "specific_force", axis = "z", unit = "m/s^2" }
"""
SECRET = b"0123456789abcdef" * 30


def hdf5(folder, make):
    (folder / "header.toml").write_text(HEADER)
    (folder / "secret").write_bytes(SECRET)
    with h5py.File(folder / "other.h5", "w") as file:
        file["t"] = np.arange(20.0)
    with h5py.File(folder / "rig.h5", "w") as file:
        file["a"] = np.ones((20, 3))
        make(file)
    return folder / "rig.h5", {"header": str(folder / "header.toml")}


def virtual(file):
    layout = h5py.VirtualLayout(shape=(20,), dtype="f8")
    layout[:] = h5py.VirtualSource("other.h5", "t", shape=(20,))
    file.create_virtual_dataset("t", layout)


def softly(file):
    file["deep"] = h5py.SoftLink("/links")
    file.create_group("links")["t"] = h5py.ExternalLink("other.h5", "t")
    file["t"] = h5py.SoftLink("/deep/t")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda f: f.create_dataset("t", (20,), "f8", external=[("secret", 0, 160)]), "lie in another file"),
        (lambda f: f.__setitem__("t", h5py.ExternalLink("other.h5", "t")), "is a link to another file"),
        (softly, "is a link to another file"),
        (virtual, "lie in another file"),
        (
            lambda f: f.create_dataset("t", (10**10,), "f8", chunks=(10**6,), compression="gzip"),
            "GB when it is unpacked",
        ),
        (lambda f: f.__setitem__("t", h5py.SoftLink("/t")), "cut short or damaged"),
    ],
    ids=["external storage", "external link", "by soft links", "virtual", "bomb", "a link to itself"],
)
def test_an_hdf5_file_shows_itself_alone(tmp_path, make, words):
    path, options = hdf5(tmp_path, make)
    with pytest.raises(InputError, match=words):
        import_files("hdf5", [path], options)


def test_soft_links_inside_a_file_are_followed(tmp_path):
    def make(file):
        file["clock/s"] = np.arange(20.0)
        file["t"] = h5py.SoftLink("/clock/s")

    path, options = hdf5(tmp_path, make)
    made = import_files("hdf5", [path], options)
    assert made.time.tolist() == list(range(20))


def test_what_unpacks_to_half_a_gigabyte_and_fifty_times_its_size_is_refused(tmp_path):
    (tmp_path / "packed").write_bytes(bytes(1_000_000))
    memory_limit.refuse_bomb(tmp_path / "packed", 499_000_000, streamed=True)
    with pytest.raises(InputError, match=r"packed has 1 MB and would take 0\.501 GB"):
        memory_limit.refuse_bomb(tmp_path / "packed", 501_000_000, streamed=True)
    (tmp_path / "packed").write_bytes(bytes(11_000_000))
    memory_limit.refuse_bomb(tmp_path / "packed", 501_000_000, streamed=True)


def test_archives_and_parquet_that_unpack_to_gigabytes(tmp_path, monkeypatch):
    """A hundredth of what is refused, so that the test takes a second."""
    monkeypatch.setattr(memory_limit, "LARGE", memory_limit.LARGE // 100)
    with (
        zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as packed,
        packed.open("vel_HHN.npy", "w", force_zip64=True) as file,
    ):
        file.write(bytes(6_000_000))
    with pytest.raises(InputError, match=r"would take 0\.006 GB"):
        import_files("tilt-table", [tmp_path / "bomb.npz"])
    with pytest.raises(InputError, match=r"would take 0\.006 GB"):
        propose_recording([tmp_path / "bomb.npz"])
    folder = tmp_path / "r"
    shutil.copytree(DEVICE, folder)
    header = folder / "recording.toml"
    header.write_text(header.read_text().replace("samples.csv", "samples.parquet"))
    few = pl.read_csv(folder / "samples.csv").head(1)
    pl.concat([few] * 80_000).write_parquet(folder / "samples.parquet")
    with pytest.raises(InputError, match=r"samples\.parquet has .* and would take 0\.0057"):
        load([folder])


def test_a_matlab_file_that_crashes_its_reader_harms_nobody(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"clbt": {"Ka": np.eye(3)}, "t": np.arange(5.0), "name": "x"})
    sound = path.read_bytes()
    assert set(matlab_variables(path)) == {"clbt.Ka", "t", "name"}
    rng = np.random.default_rng(1)
    for _ in range(2):
        spoilt = bytearray(sound)
        spoilt[int(rng.integers(128, len(sound)))] ^= 0xFF
        path.write_bytes(bytes(spoilt))
        with contextlib.suppress(InputError):  # any other end of this process would be a failure
            matlab_variables(path)


def test_a_title_is_no_code(command, tmp_path):
    folder = tmp_path / "r"
    shutil.copytree(XSENS, folder)
    header = folder / "recording.toml"
    odd = "<script>alert(1)</script> $x^$ \\\\frac{ & 'quoted'"
    header.write_text(header.read_text().replace("Xsens MTi, turned by hand", odd))
    assert command("calibrate", folder, "--out", tmp_path / "out", "--quiet") == 0
    page = (tmp_path / "out" / "report.html").read_text()
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page


def test_devices_are_no_files(command, capsys):
    zero = "/dev/zero"
    for arguments in (
        ("export", "csv", "--calibration", zero), ("observe", zero), ("compare", zero, zero),
        ("simulate", zero), ("import", "csv", zero), ("calibrate", zero), ("new", zero),
    ):  # fmt: skip
        assert command(*arguments) == 2, arguments
        assert "Traceback" not in capsys.readouterr().err, arguments


def test_json_has_no_word_for_what_is_no_number(tmp_path):
    from gimbalcal.atomic import as_json

    assert json.loads(as_json({"a": [1.0, float("nan")], "b": (float("inf"),)})) == {"a": [1.0, None], "b": [None]}
