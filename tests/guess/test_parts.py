"""A file for each face or turn of a unit: parts of one run, in plain text and in the lines of a receiver."""

import numpy as np
import pytest
import scipy.io

import gimbalcal
from gimbalcal.guess.proposal import propose_recording
from gimbalcal.recording import dwells
from tests.golden import golden_text, refused

G = 9.80665
FACES = np.concatenate([np.eye(3), -np.eye(3)])
BIAS, SCALE = np.array([0.02, -0.01, 0.03]), np.array([1.002, 0.999, 1.001])
SECONDS, RATE = 10, 50
BIASES = tuple(f"bias:{a}" for a in "xyz")


def forces(face, seed):
    """Readings (n, 3) of one face, set to a degree, by a unit with BIAS [m/s^2] and SCALE."""
    rng = np.random.default_rng(seed)
    up = face + 0.02 * rng.standard_normal(3)
    f = SCALE * G * up / np.linalg.norm(up) + BIAS
    return f + 0.005 * rng.standard_normal((SECONDS * RATE, 3))


def faces(folder, begins, clock="t_s"):
    paths = []
    for k, face in enumerate(FACES):
        t = begins(k) + np.arange(SECONDS * RATE) / RATE
        rows = np.column_stack([t, forces(face, k)])
        path = folder / f"face{k}.csv"
        np.savetxt(path, rows, delimiter=",", header=f"{clock},acc_x,acc_y,acc_z", comments="", fmt="%.6f")
        paths.append(path)
    return paths


def calibrated(found):
    made = gimbalcal.calibrate(found, terms=("bias", "scale_factor")).to_dict()["parameters"]
    return {f"{p['name']}:{p['axis']}": p["value"] for p in made}


@pytest.mark.parametrize("own", [False, True], ids=["one clock", "a clock for each file"])
def test_six_faces_in_six_files(own, tmp_path):
    """The order given does not matter where one clock goes on; each file's own clock is told to mean nothing."""
    paths = faces(tmp_path, (lambda k: 0.0) if own else (lambda k: 100.0 * k))
    found = propose_recording(paths if own else paths[::-1], latitude=45.0)
    r = found.recording
    assert len(dwells(r)) == 6
    assert len(r.time) == 6 * SECONDS * RATE
    assert np.all(np.diff(r.time) > 0)
    assert ("made up" in found.notes["samples"]) is own
    got = calibrated(r)
    np.testing.assert_allclose([got[name] for name in BIASES], BIAS / r.site.gravity * 1e6, atol=250)


def test_rows_of_parts_can_be_counted(tmp_path):
    paths = faces(tmp_path, lambda k: 0.0, clock="frame")
    r = propose_recording(paths, rate=RATE).recording
    assert len(dwells(r)) == 6
    assert np.median(np.diff(r.time)) == pytest.approx(1 / RATE)


def test_two_units_at_once_are_no_parts(tmp_path):
    with refused():
        propose_recording(faces(tmp_path, lambda k: 1000.0 + 0.003 * k))


def rawimu(path, t0, f, w, extended):
    """Counts of increments as the receiver logs them, with another log and a cut line between."""
    lines = ["<OK\n"]
    head, more = ("%RAWIMUSXA", "00,16,") if extended else ("%RAWIMUSA", "")
    for k, (a, r) in enumerate(zip(f, w, strict=True)):
        cells = ",".join(str(round(x)) for x in (a[2], -a[1], a[0], r[2], -r[1], r[0]))
        lines.append(f"{head},2387,{t0 + k / RATE:.3f};{more}2387,{t0 + k / RATE:.9f},00000077,{cells}*9319b0f1\n")
        if k == 3:
            lines.append(f"%INSPVASA,2387,{t0:.3f};2387,{t0:.3f},30.5,114.3,25.1,0,0,0,1,2,3,INS_ALIGNING*01020304\n")
    path.write_text("".join(lines) + lines[-1][:40], encoding="ascii")
    return path


@pytest.mark.parametrize("extended", [False, True])
def test_counts_of_a_receiver_face_by_face(extended, tmp_path):
    """A turn about the vertical is no rest, though no accelerometer sees it and nobody knows what a count is."""
    count, still = 1.5e-4 * RATE, np.zeros((SECONDS * RATE, 3))
    rng = np.random.default_rng(1)
    paths = []
    for k, face in enumerate(FACES):
        w = 3 * rng.standard_normal(still.shape)
        w[150:350] += 9000 * face  # ten degrees a second for four seconds
        paths.append(rawimu(tmp_path / f"{k}.ASC", 5e5 + 60 * k, forces(face, k) / count, w, extended))
    found = propose_recording(paths, latitude=45.0).recording
    assert found.counted("specific_force")
    assert found.counted("angular_rate")
    stays = dwells(found)
    assert len(stays) == 12
    for d in stays:
        assert np.abs(found.triad("angular_rate")[d.rows].mean(0)).max() < 5
    made = gimbalcal.calibrate(found, terms=("bias", "scale_factor")).to_dict()["parameters"]
    scales = [p["value"] for p in made if "scale" in p["name"]]
    assert len(scales) == 3


def test_a_damaged_line_of_a_receiver_is_named(tmp_path):
    f = np.ones((30, 3)) * [0, 0, 60000]
    path = rawimu(tmp_path / "a.ASC", 5e5, f, 0 * f, False)
    text = path.read_text().replace("*9319b0f1", "", 3)
    path.write_text(text)
    with refused():
        propose_recording([path])


def test_the_fine_clock_of_xsens_counts_tenths_of_a_millisecond(tmp_path):
    n = SECONDS * RATE
    rows = np.column_stack([np.arange(n), 9475426 + 200 * np.arange(n), forces(FACES[0], 1)])
    path = tmp_path / "a.txt"
    names = "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z"
    np.savetxt(path, rows, delimiter="\t", header=names, comments="// Firmware 1.4\n", fmt="%.6f")
    assert np.median(np.diff(propose_recording([path]).recording.time)) == pytest.approx(1 / RATE)


def test_a_folder_is_answered_with_what_to_write(tmp_path):
    faces(tmp_path, lambda k: 100.0 * k)
    with refused():
        propose_recording([tmp_path])


def test_a_row_that_any_part_loses_is_noted(tmp_path):
    paths = faces(tmp_path, lambda k: 100.0 * k)
    lines = paths[3].read_text().splitlines(keepends=True)
    paths[3].write_text("".join([*lines[:80], "," + lines[80].partition(",")[2], *lines[81:]]))
    assert propose_recording(paths).notes["time"] == "face3.csv: 1 of 500 rows have no time and are left out"


def test_six_faces_in_one_file_of_arrays(tmp_path):
    """An array of one triad for each face, of as many rows as it was held: parts of one run, not the longest alone."""
    path = tmp_path / "faces.mat"
    arrays = {f"face_{k}_accel": forces(face, k)[: SECONDS * RATE - k] for k, face in enumerate(FACES)}
    scipy.io.savemat(path, arrays)
    found = propose_recording([path], latitude=45.0, rate=RATE)
    assert len(dwells(found.recording)) == 6
    assert len(found.recording.time) == sum(map(len, arrays.values()))
    got = calibrated(found.recording)
    np.testing.assert_allclose([got[name] for name in BIASES], BIAS / found.recording.site.gravity * 1e6, atol=250)


def test_turns_of_a_table_in_one_file_of_arrays_are_said_to_be_turns(tmp_path):
    """60 deg/s about each axis there and back: nothing is at rest although the mean of all of them is none."""
    rng = np.random.default_rng(2)
    arrays = {
        f"turn_{k}_gyro": np.radians(60 * face) + 0.001 * rng.standard_normal((400 + 10 * k, 3))
        for k, face in enumerate(FACES)
    }
    scipy.io.savemat(tmp_path / "turns.mat", arrays)
    found = propose_recording([tmp_path / "turns.mat"], rate=RATE)
    assert len(found.recording.time) == sum(map(len, arrays.values()))
    golden_text(found.notes["kind"])
    still = {**arrays, "still_gyro": 0.001 * rng.standard_normal((2000, 3))}
    scipy.io.savemat(tmp_path / "turns_and_rest.mat", still)
    golden_text(propose_recording([tmp_path / "turns_and_rest.mat"], rate=RATE).notes["kind"])
