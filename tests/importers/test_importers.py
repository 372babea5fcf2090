"""Other rigs' files: what comes out, and what is refused."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.importers import KINDS, import_files, importer
from gimbalcal.importers.registry import number
from gimbalcal.importers.unit_log import text_matrix, unit_log
from gimbalcal.platform import BENCH
from gimbalcal.recording import dwell_means, dwells, read
from gimbalcal.rotation import exponential
from gimbalcal.units import to_si
from tests.golden import golden_text, refused
from tests.paths import XSENS
from tests.xsens import accelerometers, as_text

COLUMNS = """\
format = 1
kind = "multi-position"
title = "foreign"

[site]
gravity = {{ value = 9.80146, unit = "m/s^2" }}

[columns]
"{time}" = {{ quantity = "time", unit = "s" }}
"{position}" = {{ quantity = "position" }}
"{x}" = {{ quantity = "specific_force", axis = "x", unit = "g" }}
"{y}" = {{ quantity = "specific_force", axis = "y", unit = "g" }}
"{z}" = {{ quantity = "specific_force", axis = "z", unit = "g" }}
"""


def header(path, **names):
    """The option that names a header file for these columns."""
    file = path / "columns.toml"
    file.write_text(COLUMNS.format(**names))
    return {"header": str(file)}


def table(n=60):
    rng = np.random.default_rng(1)
    position = np.repeat([1.0, 2.0], n // 2)
    force = np.where(position[:, None] == 1, [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]) + 1e-4 * rng.standard_normal((n, 3))
    return 0.5 * np.arange(n), position, force


def refusal(kind, files, options=None):
    with pytest.raises(InputError) as caught:
        import_files(kind, files, options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_unknown_kind_lists_the_known_ones(tmp_path):
    assert refusal("xsens", [tmp_path]).endswith(", ".join(sorted(KINDS)))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_has_help_and_refuses_what_is_not_there(tmp_path, kind):
    assert KINDS[kind].summary
    golden_text(refusal(kind, [tmp_path / "none"]))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_refuses_an_unknown_option(tmp_path, kind):
    file = tmp_path / "file"
    file.write_text("")
    golden_text(refusal(kind, [file], {"bananas": "3"}))


def test_a_format_of_another_package_is_listed_and_read(monkeypatch, tmp_path, command, capsys):
    monkeypatch.setattr("gimbalcal.importers.registry.KINDS", kinds := dict(KINDS))
    monkeypatch.setattr("gimbalcal.importers.KINDS", kinds)

    @importer("mine", "shift")
    def import_mine(files, options):
        """One text file: t [s] ax ay az [g] in each line; shift = s.

        More about it.
        """
        table = text_matrix(files[0], 4)
        keys = [("specific_force", axis) for axis in "xyz"]
        channels = {key: table[:, 1 + i] for i, key in enumerate(keys)}
        return unit_log("mine", table[:, 0] + number(options, "shift", 0), channels, dict.fromkeys(keys, "g"), files)

    with pytest.raises(ValueError, match="two importers are called 'mine': import_mine and import_mine"):
        importer("mine")(import_mine)
    file = tmp_path / "log.txt"
    file.write_text("0 0 0 9.8\n1 0 0 9.8\n2 0 0 9.8\n")
    made = import_files("mine", [file], {"shift": "5", "title": "bench"})
    np.testing.assert_array_equal(made.time, [5.0, 6.0, 7.0])
    assert made.title == "bench"
    golden_text(refusal("mine", [file, file]))
    assert command("import", "--help") == 0
    words = " ".join(capsys.readouterr().out.split())
    golden_text(words)


# --- imu_tk ---------------------------------------------------------------------------------------------------------


def test_imu_tk_text(tmp_path):
    recording = import_files("imu-tk", [as_text(tmp_path / "acc.mat")], {"title": "Xsens"})
    time, counts = accelerometers()
    assert (recording.kind, recording.platform, recording.title) == ("multi-position", BENCH, "Xsens")
    np.testing.assert_array_equal(recording.time, time)
    np.testing.assert_array_equal(recording.triad("specific_force"), counts)
    assert set(recording.units.values()) == {"count"}
    assert len(dwells(recording)) == 38
    golden_text(recording.remarks[-1])


def test_the_shipped_positions_are_the_means_of_the_raw_data(tmp_path):
    made = import_files("imu-tk", [as_text(tmp_path / "acc.mat")], {"means": "yes"})
    shipped = read(XSENS)
    np.testing.assert_allclose(made.triad("specific_force"), shipped.triad("specific_force"), rtol=1e-14)
    np.testing.assert_array_equal(made.weight, shipped.weight)
    assert shipped.noise["accelerometer"] == pytest.approx(made.noise["accelerometer"], rel=1e-12)


def test_the_real_positions_have_one_norm_to_a_tenth_of_a_milli_g():
    # Bias, scale and misalignment (9 numbers) leave 0.1 mg; bias and scale alone (6) leave some 3.4 mg.
    from scipy.optimize import least_squares

    counts = read(XSENS).triad("specific_force")

    def norm_error(p):
        T = np.array([[p[3], p[6], p[7]], [0.0, p[4], p[8]], [0.0, 0.0, p[5]]]) / 4100
        return np.asarray(np.linalg.norm((counts - 33000 - 100 * p[:3]) @ T.T, axis=1) - 1)

    def without_misalignment(p):
        return norm_error(np.concatenate([p, np.zeros(3)]))

    full = least_squares(norm_error, np.array([0.0, 0, 0, 1, 1, 1, 0, 0, 0]))
    plain = least_squares(without_misalignment, np.array([0.0, 0, 0, 1, 1, 1]))
    assert 1e3 * np.sqrt(np.mean(full.fun**2)) == pytest.approx(0.0997, abs=0.005)
    assert 1e3 * np.sqrt(np.mean(plain.fun**2)) == pytest.approx(3.4, abs=0.2)


def test_imu_tk_faults(tmp_path):
    good, other, words, short = (tmp_path / name for name in ("good", "other", "words", "short"))
    lines = [f"{0.01 * i:.2f} 1 2 {3 + i % 2}" for i in range(50)]
    good.write_text("\n".join(lines))
    other.write_text("\n".join(lines[:-1]))
    words.write_text("t x y z\n" + "\n".join(lines))
    short.write_text("\n".join([*lines[:3], "0.03 1 2"]))
    golden_text(refusal("imu-tk", [good, other]))
    golden_text(refusal("imu-tk", [words]))
    golden_text(refusal("imu-tk", [short]))
    golden_text(refusal("imu-tk", [good] * 3))
    good.write_text("")
    golden_text(refusal("imu-tk", [good]))
    good.write_text("\n".join([*lines, lines[0]]))
    golden_text(refusal("imu-tk", [good]))


# --- general tables -------------------------------------------------------------------------------------------------


def test_csv_of_a_german_logger(tmp_path):
    time, position, force = table()
    rows = ["Logger 3000", "Messung vom 18.11.2026", "Zeit;Pos;ax;ay;az;Bemerkung"]
    for t, p, f in zip(time, position, force, strict=True):
        rows.append(";".join([*(f"{v:.8f}".replace(".", ",") for v in (t, p, *f)), "ok"]))
    (tmp_path / "log.csv").write_text("\n".join(rows))
    options = header(tmp_path, time="Zeit", position="Pos", x="ax", y="ay", z="az")
    recording = import_files("csv", [tmp_path / "log.csv"], {**options, "separator": "semicolon", "skip": "2"})
    np.testing.assert_allclose(recording.triad("specific_force"), force * 9.80665, atol=1e-7)  # 8 digits of g
    assert [d.position for d in dwells(recording)] == [1, 2]
    assert recording.site.gravity == 9.80146
    faulty = "\n".join(rows).replace("\n1,50000000;", "\n-9,50000000;")
    (tmp_path / "log.csv").write_text(faulty)
    said = refusal("csv", [tmp_path / "log.csv"], {**options, "separator": "semicolon", "skip": "2"})
    golden_text(said)


def test_csv_faults(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("t,p,a,b,c\n0,1,0,0,-1\n1,1,0,x,-1\n")
    options = header(tmp_path, time="t", position="p", x="a", y="b", z="c")
    golden_text(refusal("csv", [file], options))
    golden_text(refusal("csv", [file]))
    golden_text(refusal("csv", [file], {"header": "none.toml"}))
    golden_text(refusal("csv", [file], {**options, "separator": "||"}))
    golden_text(refusal("csv", [file], {**options, "skip": "two"}))
    golden_text(refusal("csv", [file, file], options))
    bad = header(tmp_path, time="t", position="p", x="a", y="b", z="d")
    file.write_text("t,p,a,b,c\n0,1,0,0,-1\n")
    golden_text(refusal("csv", [file], bad))


def test_csv_without_a_clock(tmp_path):
    _, position, force = table()
    rows = ["p,a,b,c", *(f"{p},{x:.9f},{y:.9f},{z:.9f}" for p, (x, y, z) in zip(position, force, strict=True))]
    (tmp_path / "log.csv").write_text("\n".join(rows))
    options = header(tmp_path, time="row", position="p", x="a", y="b", z="c")
    recording = import_files("csv", [tmp_path / "log.csv"], {**options, "rate": "50"})
    np.testing.assert_allclose(recording.time, np.arange(60) / 50, rtol=1e-15)


def test_matlab_up_to_v7(tmp_path):
    from scipy.io import savemat

    time, position, force = table()
    savemat(tmp_path / "rig.mat", {"t": time, "imu": {"acc": force, "pos": position}, "name": "rig"})
    options = header(tmp_path, time="t", position="imu.pos", x="imu.acc[0]", y="imu.acc[1]", z="imu.acc[2]")
    recording = import_files("mat", [tmp_path / "rig.mat"], options)
    np.testing.assert_allclose(recording.triad("specific_force"), force * 9.80665, rtol=1e-15)
    np.testing.assert_array_equal(recording.time, time)
    options = header(tmp_path, time="t", position="imu.pos", x="imu.acc[0]", y="imu.acc[1]", z="imu.acc[3]")
    said = refusal("mat", [tmp_path / "rig.mat"], options)
    golden_text(said)
    options = header(tmp_path, time="time", position="imu.pos", x="imu.acc[0]", y="imu.acc[1]", z="imu.acc[2]")
    golden_text(refusal("mat", [tmp_path / "rig.mat"], options))
    options = header(tmp_path, time="name", position="imu.pos", x="imu.acc[0]", y="imu.acc[1]", z="imu.acc[2]")
    golden_text(refusal("mat", [tmp_path / "rig.mat"], options))


def test_matlab_v73_is_hdf5(tmp_path):
    import h5py

    time, position, force = table()
    with h5py.File(tmp_path / "rig.mat", "w", userblock_size=512) as file:  # as MATLAB writes it, columns first
        file["t"], file["imu/acc"], file["imu/pos"] = time[None], force.T, position[None]
    options = header(tmp_path, time="t", position="imu.pos", x="imu.acc[0]", y="imu.acc[1]", z="imu.acc[2]")
    recording = import_files("mat", [tmp_path / "rig.mat"], options)
    np.testing.assert_allclose(recording.triad("specific_force"), force * 9.80665, rtol=1e-15)


def test_hdf5(tmp_path):
    import h5py

    time, position, force = table()
    with h5py.File(tmp_path / "rig.h5", "w") as file:
        file["clock"], file["imu/acc"], file["imu/pos"] = time, force, position.astype(np.int32)
    options = header(tmp_path, time="/clock", position="/imu/pos", x="/imu/acc[0]", y="/imu/acc[1]", z="/imu/acc[2]")
    recording = import_files("hdf5", [tmp_path / "rig.h5"], options)
    np.testing.assert_allclose(recording.triad("specific_force"), force * 9.80665, rtol=1e-15)
    options = header(tmp_path, time="/time", position="/imu/pos", x="/imu/acc[0]", y="/imu/acc[1]", z="/imu/acc[2]")
    said = refusal("hdf5", [tmp_path / "rig.h5"], options)
    golden_text(said)
    (tmp_path / "rig.h5").write_bytes((tmp_path / "rig.h5").read_bytes()[:700])
    golden_text(refusal("hdf5", [tmp_path / "rig.h5"], options))


def test_text_called_mat_is_sent_elsewhere(tmp_path):
    options = header(tmp_path, time="t", position="p", x="a", y="b", z="c")
    said = refusal("mat", [as_text(tmp_path / "xsens_acc.mat")], options)
    golden_text(said)


def test_columns_of_different_length(tmp_path):
    import h5py

    time, position, force = table()
    with h5py.File(tmp_path / "rig.h5", "w") as file:
        file["t"], file["p"], file["a"] = time, position[:-1], force
    options = header(tmp_path, time="t", position="p", x="a[0]", y="a[1]", z="a[2]")
    golden_text(refusal("hdf5", [tmp_path / "rig.h5"], options))


def test_imported_tables_pass_the_same_checks(tmp_path):
    import h5py

    time, position, force = table()
    force[10:14, 1] = np.nan
    with h5py.File(tmp_path / "rig.h5", "w") as file:
        file["t"], file["p"], file["a"] = time, position, force
    options = header(tmp_path, time="t", position="p", x="a[0]", y="a[1]", z="a[2]")
    made = import_files("hdf5", [tmp_path / "rig.h5"], options)
    assert len(made.time) == 56
    golden_text(made.remarks[0])
    with h5py.File(tmp_path / "rig.h5", "a") as file:
        file["a"][20, 0] = np.inf
    said = refusal("hdf5", [tmp_path / "rig.h5"], options)
    golden_text(said)


def test_the_clock_of_a_rate_is_in_the_unit_of_its_column(tmp_path):
    _, position, force = table()
    rows = ["p,a,b,c", *(f"{p},{x:.9f},{y:.9f},{z:.9f}" for p, (x, y, z) in zip(position, force, strict=True))]
    (tmp_path / "log.csv").write_text("\n".join(rows))
    options = header(tmp_path, time="row", position="p", x="a", y="b", z="c")
    columns = Path(options["header"]).read_text()
    for unit in ("ms", "min"):
        Path(options["header"]).write_text(columns.replace('"time", unit = "s"', f'"time", unit = "{unit}"'))
        recording = import_files("csv", [tmp_path / "log.csv"], {**options, "rate": "50"})
        np.testing.assert_allclose(recording.time, np.arange(60) / 50, rtol=1e-14)
    Path(options["header"]).write_text("\n".join(line for line in columns.splitlines() if '"time"' not in line))
    recording = import_files("csv", [tmp_path / "log.csv"], {**options, "rate": "50"})
    np.testing.assert_allclose(recording.time, np.arange(60) / 50, rtol=1e-14)
    golden_text(refusal("csv", [tmp_path / "log.csv"], options))


@pytest.mark.parametrize(("name", "given"), [("comma", ","), ("blanks", "   "), ("tab", "\t"), ("semicolon", ";")])
def test_a_table_without_names_has_numbered_columns(tmp_path, name, given):
    time, position, force = table()
    lines = [f"{t:g},{p:g},{x:.8f},{y:.8f},{z:.8f}" for t, p, (x, y, z) in zip(time, position, force, strict=True)]
    lines[7] = lines[7].rsplit(",", 1)[0] + ",NaN"
    (tmp_path / "log.txt").write_text("# bench 4\n" + "\n".join(lines).replace(",", given))
    options = header(tmp_path, time="1", position="2", x="3", y="4", z="5")
    recording = import_files("csv", [tmp_path / "log.txt"], options)
    np.testing.assert_allclose(recording.triad("specific_force"), np.delete(force, 7, 0) * 9.80665, atol=1e-7)
    assert recording.remarks[0].endswith("log.txt, row 8: 1 row of 60 is left out, empty in 5")
    missing = header(tmp_path, time="1", position="2", x="3", y="4", z="6")
    assert "log.txt has no column '6'; it has '1', '2', '3', '4', '5'" in refusal(
        "csv", [tmp_path / "log.txt"], missing
    ), name


def test_names_that_stand_in_the_comment_above_the_numbers(tmp_path):
    time, position, force = table()
    lines = [f"{t:g} {p:g} {x:.8f} {y:.8f} {z:.8f} " for t, p, (x, y, z) in zip(time, position, force, strict=True)]
    (tmp_path / "log.txt").write_text("# an odd rig\n# time pos ax ay az\n" + "\n".join(lines))
    options = header(tmp_path, time="time", position="pos", x="ax", y="ay", z="az")
    recording = import_files("csv", [tmp_path / "log.txt"], options)
    np.testing.assert_allclose(recording.triad("specific_force"), force * 9.80665, atol=1e-7)
    unnamed = header(tmp_path, time="t", position="pos", x="ax", y="ay", z="az")
    golden_text(refusal("csv", [tmp_path / "log.txt"], unnamed))
    folder = tmp_path / "rec"  # and in a recording folder
    folder.mkdir()
    header(folder, time="time", position="pos", x="ax", y="ay", z="az")
    (folder / "columns.toml").rename(folder / "recording.toml")
    text = "# time, pos, ax, ay, az\n" + "\n".join(line.strip().replace(" ", ",") for line in lines)
    (folder / "samples.csv").write_text(text)
    np.testing.assert_allclose(read(folder).triad("specific_force"), force * 9.80665, atol=1e-7)
    (folder / "samples.csv").write_text(text.replace(",1,", ",x,", 1))
    with refused():
        read(folder)


def test_two_kinds_of_rows_in_one_table_whose_times_run_into_each_other(tmp_path):
    """A filter's rows between those of the sensors, each stamped with its own time, as MicroStrain units write them."""
    time, position, force = table()
    lines = ["timestamp,pos,ax,ay,az,q"]
    for i, (t, p, (x, y, z)) in enumerate(zip(time, position, force, strict=True)):
        lines.append(f"{1730147632975270720 + int(t * 1e9)},{p:g},{x:.8f},{y:.8f},{z:.8f},")
        if i % 2:
            lines.append(f"{1730147632975270720 + int((t - 0.7) * 1e9)},,,,,0.61")
    (tmp_path / "log.csv").write_text("\n".join(lines))
    options = header(tmp_path, time="timestamp", position="pos", x="ax", y="ay", z="az")
    toml = Path(options["header"])
    toml.write_text(toml.read_text().replace('"time", unit = "s"', '"time", unit = "ns"'))
    recording = import_files("csv", [tmp_path / "log.csv"], options)
    np.testing.assert_allclose(np.diff(recording.time), np.diff(time), atol=1e-6)
    golden_text(recording.remarks[0])


def test_dates_in_a_text_table(tmp_path):
    time, position, force = table()
    start = datetime(2026, 3, 29, 1, 59, 50)  # noqa: DTZ001  a logger that names no zone
    rows = ["when;p;a;b;c"]
    for t, p, f in zip(time, position, force, strict=True):
        stamp = (start + timedelta(seconds=float(t))).isoformat(sep=" ").replace(".", ",")
        rows.append(";".join([stamp, f"{p:g}", *(f"{v:.8f}".replace(".", ",") for v in f)]))
    (tmp_path / "log.csv").write_text("\n".join(rows))
    options = header(tmp_path, time="when", position="p", x="a", y="b", z="c")
    recording = import_files("csv", [tmp_path / "log.csv"], options)
    np.testing.assert_allclose(recording.time - recording.time[0], time, atol=1e-9)
    golden_text(recording.remarks[0])
    (tmp_path / "log.csv").write_text("\n".join(rows).replace("2026-03-29 01:59:55;", "yesterday;"))
    said = refusal("csv", [tmp_path / "log.csv"], options)
    golden_text(said)


def test_matlab_with_a_file_for_each_channel(tmp_path):
    from scipy.io import savemat

    time, position, force = table()
    files = [tmp_path / f"{name}.mat" for name in ("clock", "pos", "ax", "ay", "az")]
    for path, values in zip(files, (time, position, *force.T), strict=True):
        savemat(path, {"data": values})
    options = header(tmp_path, time="clock", position="pos", x="ax", y="ay.data", z="az")
    recording = import_files("mat", files, options)
    np.testing.assert_allclose(recording.triad("specific_force"), force * 9.80665, rtol=1e-15)
    assert [Path(s.path).name for s in recording.source[1:]] == [path.name for path in files]
    options = header(tmp_path, time="clock", position="pos", x="data", y="ay", z="az")
    golden_text(refusal("mat", files, options))
    options = header(tmp_path, time="clock", position="pos", x="ax", y="ay", z="temperature")
    golden_text(refusal("mat", files, options))


def in_the_hand(rate_unit=1.0):
    """Eight rests of 4 s and quarter turns of 1 s between them, 50 Hz: time, force [m/s^2], rate."""
    rng = np.random.default_rng(4)
    n, C, force, rate = 50, np.eye(3), [], []
    for k in range(8):
        force += [C @ [0, 0, 9.81]] * (4 * n)
        rate += [np.zeros(3)] * (4 * n)
        w = np.pi / 2 * np.eye(3)[k % 3]
        for _ in range(n):
            C = exponential(w / n) @ C
            force.append(C @ [0, 0, 9.81])
            rate.append(w)
    f, w_all = np.array(force), np.array(rate) / rate_unit
    return np.arange(len(f)) / n, f + 0.01 * rng.standard_normal(f.shape), w_all + 1e-3 * rng.standard_normal(f.shape)


@pytest.mark.parametrize(("accel", "gyro"), [("m/s^2", "rad/s"), ("g", "deg/s")])
def test_imu_tk_in_physical_units(tmp_path, accel, gyro):
    time, force, rate = in_the_hand(to_si(1.0, gyro))
    np.savetxt(tmp_path / "acc.mat", np.column_stack([time, force / to_si(1.0, accel)]))
    np.savetxt(tmp_path / "gyro.mat", np.column_stack([time, rate]))
    recording = import_files("imu-tk", [tmp_path / "acc.mat", tmp_path / "gyro.mat"])
    assert {u for (q, _), u in recording.units.items() if q == "specific_force"} == {accel}
    assert {u for (q, _), u in recording.units.items() if q == "angular_rate"} == {gyro}
    np.testing.assert_allclose(recording.triad("specific_force"), force, rtol=1e-12)
    np.testing.assert_allclose(recording.triad("angular_rate"), rate * to_si(1.0, gyro), rtol=1e-12)
    assert recording.scatter["angular_rate", "x"] == pytest.approx(1e-3 * to_si(1.0, gyro), rel=0.1)
    assert recording.scatter["specific_force", "x"] == pytest.approx(0.01, rel=0.1)
    golden_text(recording.remarks[-2])
    golden_text(recording.remarks[-1])
    told = import_files("imu-tk", [tmp_path / "acc.mat"], {"accel": "count"})
    assert set(told.units.values()) == {"count"}
    golden_text(refusal("imu-tk", [tmp_path / "acc.mat"], {"gyro": "deg"}))


def test_imu_tk_rates_are_looked_at_less_what_they_read_at_rest(tmp_path):
    time, force, rate = in_the_hand(to_si(1.0, "deg/s"))
    np.savetxt(tmp_path / "acc.mat", np.column_stack([time, force]))
    np.savetxt(tmp_path / "gyro.mat", np.column_stack([time, rate + np.array([40.0, -30.0, 35.0])]))  # deg/s
    recording = import_files("imu-tk", [tmp_path / "acc.mat", tmp_path / "gyro.mat"])
    assert recording.units["angular_rate", "x"] == "deg/s"


def test_text_of_a_logger_that_missed_some_values(tmp_path):
    time, force, rate = in_the_hand()
    force[30:33, 1] = np.nan
    np.savetxt(tmp_path / "acc.mat", np.column_stack([time, force]))
    np.savetxt(tmp_path / "gyro.mat", np.column_stack([time, rate]), delimiter=",")
    recording = import_files("imu-tk", [tmp_path / "acc.mat", tmp_path / "gyro.mat"])
    assert len(recording.time) == len(time) - 3
    golden_text(recording.remarks[1])


@pytest.mark.parametrize("mark", ["", "\ufeff"])  # Windows writes one in front of UTF-8
def test_mikoff_log(tmp_path, mark):
    rng = np.random.default_rng(3)
    rows = np.column_stack([rng.normal([0, 0, -9.8], 0.05, (400, 3)), rng.normal(0, 1e-3, (400, 3))])
    rows[180:220, :3] += rng.standard_normal((40, 3))
    np.savetxt(tmp_path / "imu0.log", rows, fmt="%.5f")
    (tmp_path / "imu0.log").write_text(mark + (tmp_path / "imu0.log").read_text(), encoding="utf-8")
    recording = import_files("mikoff", [tmp_path / "imu0.log"])
    assert recording.time[1] == 0.01
    assert recording.units["angular_rate", "x"] == "rad/s"
    np.testing.assert_allclose(recording.triad("angular_rate"), rows[:, 3:], atol=5.1e-6)  # five decimals
    assert len(dwells(recording)) == len(dwell_means(recording).time)


def test_stars_and_means_need_no_clock_and_samples_do(tmp_path):
    header = tmp_path / "h.toml"
    header.write_text(
        'format = 1\nkind = "multi-position"\n[columns]\nNr = { quantity = "position" }\n'
        + "".join(f'f{a} = {{ quantity = "specific_force", axis = "{a}", unit = "g" }}\n' for a in "xyz")
    )
    (tmp_path / "means.csv").write_text("Nr,fx,fy,fz\n1,0,0,1\n2,0,1,0\n3,1,0,0\n")
    made = import_files("csv", [tmp_path / "means.csv"], {"header": str(header)})
    assert made.title == "means"
    assert np.all(np.diff(made.time) == 60)
    assert any("no clock" in remark for remark in made.remarks)
    (tmp_path / "log.csv").write_text("Nr,fx,fy,fz\n1,0,0,1\n1,0,0,1.001\n2,1,0,0\n")
    with refused():
        import_files("csv", [tmp_path / "log.csv"], {"header": str(header)})
