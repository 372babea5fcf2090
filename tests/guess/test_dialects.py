"""One recording written in the dialects of many loggers, and logs of each kind that `new` meets, made up in small.

Whatever the separator, the decimal mark, the names, the preamble, the units and the clock are, the proposal is the
recording that was logged.
"""

import json
from collections.abc import Callable

import numpy as np
import polars as pl
import pytest
import scipy.io
from scipy.spatial.transform import Rotation

from gimbalcal.errors import InputError
from gimbalcal.guess.attitude import quaternions
from gimbalcal.guess.clocks import spread_stamps
from gimbalcal.guess.column_names import by_name, quantity_of_log
from gimbalcal.guess.column_values import attitude_columns, by_order, by_similar_names, quantum
from gimbalcal.guess.log import Log
from gimbalcal.guess.message_log import leaves_of_object
from gimbalcal.guess.proposal import Proposal, propose_recording
from gimbalcal.guess.text_table import table_of, tables_of
from gimbalcal.recording import dwells
from gimbalcal.rotation import exponential
from tests.golden import golden_text, refused
from tests.guess.test_layouts import rows
from tests.guess.test_proposal import D, G, turned

FORCE_UNITS = {"m/s^2": 1.0, "g": 1 / G, "mg": 1e3 / G}
RATE_UNITS = {"rad/s": 1.0, "deg/s": D}
CLOCKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
NAMES = (
    ("t", "ax", "ay", "az", "gx", "gy", "gz"),
    ("timestamp", *(f"accel_{a}" for a in "xyz"), *(f"gyro_{a}" for a in "xyz")),
    ("Zeit", *(f"Beschleunigung {a.upper()}" for a in "xyz"), *(f"Drehrate {a.upper()}" for a in "xyz")),
    ("time", *(f"a_RS_S_{a}" for a in "xyz"), *(f"w_RS_S_{a}" for a in "xyz")),
    ("time", *(f"imu.acc.{a}" for a in "xyz"), *(f"imu.gyro.{a}" for a in "xyz")),
    ("Time", "accl0", "accl1", "accl2", "rot0", "rot1", "rot2"),
    (),
)
PREAMBLES = (
    "",
    "# unit 7\n# Monday\n",
    "// Scenario: 4.9\n// Firmware: 2.5\n",
    "Device;IMU\nSerial;00123\n\nDATA_START\n",
)


@pytest.mark.parametrize(
    ("force", "rate"),
    [
        ("Accelerazione X [m/s^2]", "Giroscopio X [deg/s]"),
        ("aceleración_x", "velocidad angular x"),
        ("Aceleração_X", "velocidade_angular_x"),
        ("Accéléromètre x", "vitesse angulaire x"),
        ("acc_x_g", "giro_x_dps"),
    ],
)
def test_triads_are_known_by_their_names_in_other_languages(force, rate):
    """Gyroscopes called giro were left out beside their accelerometers."""
    assert [(g.quantity, g.axis) for g in (by_name(force), by_name(rate))] == [
        ("specific_force", "x"), ("angular_rate", "x"),
    ]  # fmt: skip
    assert by_name("Tempo [ms]").quantity == "time"
    assert (by_name("temp_h").unit, by_name("temp_f").unit) == ("degC", "degF")  # of a hygrometer, not in hours
    assert (quantity_of_log("acelerometro_1"), quantity_of_log("giroscopio")) == ("specific_force", "angular_rate")


def test_the_day_of_a_date_is_no_clock():
    """The day of a log of three days was taken for seconds: 2880 Hz where a row in 30 s was logged."""
    rng, row = np.random.default_rng(3), np.arange(600.0)
    columns = {"1": np.full(600, 14.0), "2": 26 + row // 240, **{k: rng.standard_normal(600) for k in "345"}}
    assert "2" not in by_order(columns)
    assert by_order(columns | {"2": np.floor(row / 50)})["2"].quantity == "time"  # of whole seconds


def test_accelerometers_of_coarse_steps_are_the_forces_although_one_hardly_changes():
    """Two gyroscopes and the magnetometer x behind them were forces in ft/s^2, 27 % off gravity."""
    rng, row = np.random.default_rng(1), np.arange(180)
    force = [
        np.where(row == 90, -0.01, 0.0),
        *(np.round(x + 6e-3 * rng.standard_normal(180), 2) for x in (-0.055, 1.014)),
    ]
    scatter = (0.13, 0.3, 0.11, 0.48, 0.35, 0.77)  # deg/s, and uT
    others = [np.round(level + s * rng.standard_normal(180), 2)
              for level, s in zip((0.22, -0.03, 0.29, 23.5, 6.05, -51.2), scatter, strict=True)]  # fmt: skip
    others[1] += np.round(8.0 * np.exp(-(((row - 60) / 2) ** 2)), 2)  # a knock
    columns = [1.6e9 + np.floor(row / 13), *force, *others]
    found = by_order({str(i): x for i, x in enumerate(columns, start=1)})
    assert [found[i].quantity for i in "234567"] == 3 * ["specific_force"] + 3 * ["angular_rate"]


def dialect(path, seed, t, f, w):
    """Write a log in a dialect that a seed chooses; return it with the units of forces and rates."""
    rng = np.random.default_rng(seed)

    def one(choices):
        words = list(choices)
        return str(words[rng.integers(len(words))])

    force, rate, clock = one(FORCE_UNITS), one(RATE_UNITS), one(CLOCKS)
    names, mark = NAMES[rng.integers(len(NAMES))], one((",", ";", "\t", "  "))
    preamble = one(PREAMBLES)
    stated = bool(names) and rng.random() < 0.4
    units = [clock, *[force] * 3, *[rate] * 3]
    head = [f"{n} [{u}]" if stated else n for n, u in zip(names, units, strict=True)] if names else []
    if mark == "  ":
        head = [n.replace(" ", "") for n in head]
    start = float(rng.choice([0.0, 12.5, 3600.0]))
    columns = [(t + start) * CLOCKS[clock], *(FORCE_UNITS[force] * f).T, *(RATE_UNITS[rate] * w).T]
    lines = [mark.join(head)] if head else []
    if stated and rng.random() < 0.5:
        lines = [mark.join(names), mark.join(units)] if " " not in "".join(names) or mark != "  " else lines
    comma = mark in (";", "\t") and rng.random() < 0.5
    for r in zip(*columns, strict=True):
        line = mark.join(f"{x:.9g}" if k else f"{x:.15g}" for k, x in enumerate(r))
        lines.append(line.replace(".", ",") if comma else line)
    path.write_text(preamble + "\n".join(lines) + "\n", encoding=one(("utf-8", "utf-8-sig", "utf-16")))
    return path, force, rate


@pytest.mark.parametrize("seed", range(40))
def test_a_recording_in_any_dialect_is_proposed_as_it_was(tmp_path, seed):
    t, f, w = turned(1 + seed % 5)
    path, force, rate = dialect(tmp_path / "log.txt", seed, t, f, w)
    found = propose_recording([path])
    r = found.recording
    assert str(r.kind) == "multi-position"
    assert {g.unit for g in found.guesses.values() if g.quantity == "specific_force"} == {force}
    assert {g.unit for g in found.guesses.values() if g.quantity == "angular_rate"} == {rate}
    assert len(r.time) == len(t)
    np.testing.assert_allclose(r.time - r.time[0], t, atol=1e-4)
    np.testing.assert_allclose(r.triad("specific_force"), f, atol=1e-5)
    np.testing.assert_allclose(r.triad("angular_rate"), w, atol=1e-5)
    assert len(dwells(r)) == 10


def test_names_in_two_lines_and_a_reference_of_the_attitude(tmp_path):
    rng = np.random.default_rng(4)
    n = 3000
    t = 0.01 * np.arange(n)
    w = np.stack([np.sin(0.7 * t), 0.8 * np.cos(0.9 * t), 0.6 * np.sin(1.3 * t + 1)], axis=-1)
    C = np.empty((n, 3, 3))
    C[0] = np.eye(3)
    for k in range(1, n):
        C[k] = exponential(w[k] * 0.01) @ C[k - 1]
    q = np.empty((n, 4))
    q[:, 0] = np.sqrt(np.maximum(1 + C[:, 0, 0] + C[:, 1, 1] + C[:, 2, 2], 1e-12)) / 2
    q[:, 1:] = np.stack([C[:, 1, 2] - C[:, 2, 1], C[:, 2, 0] - C[:, 0, 2], C[:, 0, 1] - C[:, 1, 0]], -1) / (
        4 * q[:, :1]
    )
    f = C @ np.array([0.0, 0.0, G]) + 0.02 * rng.standard_normal((n, 3))
    read = w + 0.003 * rng.standard_normal((n, 3))
    names = "Time (s);{} Orientation;;;;IMU Acceleration;;;IMU Gyroscope;;;\n;W;X;Y;Z;X;Y;Z;X;Y;Z;"
    for reference, kind in (("Vicon", "rotation"), ("Own", "multi-position")):
        path = rows(tmp_path / "a.csv", names.format(reference), t, *q.T, *f.T, *read.T, mark=";")
        if kind == "rotation":
            found = propose_recording([path])
            assert set(found.recording.axes("attitude")) == {"qw", "qx", "qy", "qz"}
            np.testing.assert_allclose(found.recording.triad("angular_rate"), read, atol=1e-5)
        else:  # the unit's own estimate is no reference, and the unit never rests
            with refused():
                propose_recording([path])
    sensors = rows(tmp_path / "run.csv", "t,ax,ay,az,gx,gy,gz", t, *f.T, *read.T)
    (tmp_path / "mocap0").mkdir()
    tracked = rows(  # each as q or as -q
        tmp_path / "mocap0" / "run.csv", "t,q_w,q_x,q_y,q_z", t, *(q * np.where(np.arange(n) % 7 < 3, 1, -1)[:, None]).T
    )
    both = propose_recording([sensors, tracked]).recording
    attitude = np.stack([both.channels["attitude", axis] for axis in ("qw", "qx", "qy", "qz")], axis=-1)
    np.testing.assert_allclose(np.abs(np.sum(attitude * q, axis=1)), 1.0, atol=1e-6)
    assert np.all(np.sum(attitude[1:] * attitude[:-1], axis=1) > 0)
    with refused():  # which of them measured it is not said
        propose_recording([sensors, tracked.rename(tmp_path / "attitude.csv")])


@pytest.mark.parametrize("rows_last", [False, True])
def test_rotation_matrices_beside_the_sensors_are_an_attitude(tmp_path, rows_last):
    t, f, w = turned()
    C = Rotation.from_rotvec(np.outer(np.sin(0.3 * t), [0.4, -0.7, 0.5])).as_matrix()
    scipy.io.savemat(tmp_path / "imu.mat", {"t": t, "acc": f, "gyro": w})
    scipy.io.savemat(tmp_path / "vicon.mat", {"ts": t, "rots": np.moveaxis(C, 0, 2) if rows_last else C})
    both = propose_recording([tmp_path / "imu.mat", tmp_path / "vicon.mat"]).recording
    attitude = np.stack([both.channels["attitude", axis] for axis in ("qx", "qy", "qz", "qw")], axis=-1)
    np.testing.assert_allclose(Rotation.from_quat(attitude).as_matrix(), C, atol=1e-6)
    scipy.io.savemat(tmp_path / "imu.mat", {"t": t, "vals": np.hstack([510 + 10 * f, 370 + 60 * w]).round()})
    with refused():  # what the six are is not said, whatever stands beside them at the same times
        propose_recording([tmp_path / "imu.mat", tmp_path / "vicon.mat"])


def test_a_named_quantity_of_another_kind_is_never_a_sensor(tmp_path):
    t, f, w = turned()
    q = np.column_stack([np.full(len(t), 0.5)] * 4)
    head = "Packet number,M11,M12,M13,Quat_w,Quat_x,Quat_y,Quat_z,lon,lat,height,mag_x [uT],mag_y [uT],mag_z [uT]"
    path = rows(tmp_path / "a.csv", head, np.arange(len(t)), *(f / G).T, *q.T, *[np.full(len(t), 9.8)] * 3, *w.T)
    with refused():
        propose_recording([path], rate=50)
    path = rows(
        tmp_path / "b.csv", f"{head},ax,ay,az", np.arange(len(t)), *(f / G).T, *q.T, *[9.8 + 0 * t] * 3, *w.T, *f.T
    )
    with refused():  # a count of packets is no clock
        propose_recording([path])
    found = propose_recording([path], rate=50)
    np.testing.assert_allclose(found.recording.triad("specific_force"), f, atol=1e-5)
    assert not found.recording.has("angular_rate")


@pytest.mark.parametrize("kind", ["mat", "npz", "npy", "parquet", "json", "records", "h5"])
def test_arrays_are_read_by_what_a_file_begins_with(tmp_path, kind):
    import h5py

    t, f, w = turned()
    table, path = np.column_stack([t, f, w]), tmp_path / "log.dat"
    arrays = {"t": t, "imu_acc": f, "imu_gyr": w}

    def hdf5():
        with h5py.File(path, "w") as file:
            for name, x in arrays.items():
                file[f"imu/{name}"] = x

    def archive():
        with path.open("wb") as file:
            np.savez(file, **arrays)

    def array():
        with path.open("wb") as file:
            np.save(file, table)

    columns = dict(zip(("t", "ax", "ay", "az", "gx", "gy", "gz"), table.T, strict=True))
    write: dict[str, Callable[[], object]] = {
        "mat": lambda: scipy.io.savemat(path, {**arrays, "sampling_rate": 50.0}, appendmat=False),
        "npz": archive, "npy": array, "h5": hdf5, "records": lambda: table.astype("<f8").tofile(path),
        "parquet": lambda: pl.DataFrame(columns).write_parquet(path),
        "json": lambda: path.write_text(json.dumps({"device": "x", "rows": pl.DataFrame(columns).to_dicts()})),
    }  # fmt: skip
    write[kind]()
    r = propose_recording([path]).recording
    np.testing.assert_allclose(r.time - r.time[0], t, atol=1e-6)
    np.testing.assert_allclose(r.triad("specific_force"), f, atol=1e-6)
    np.testing.assert_allclose(r.triad("angular_rate"), w, atol=1e-6)


def test_a_field_of_binary_records_may_never_be_filled_and_their_clock_go_back_once(tmp_path):
    t, f, w = turned()
    path = tmp_path / "log.dat"
    table = np.column_stack([np.full(len(t), np.nan), 1537663359 + t, w, f])
    table.astype("<f8").tofile(path)
    r = propose_recording([path]).recording
    np.testing.assert_allclose(r.triad("specific_force"), f, atol=1e-6)
    np.testing.assert_allclose(r.triad("angular_rate"), w, atol=1e-6)
    table[50, 1] -= 0.09
    table.astype("<f8").tofile(path)
    with refused():
        propose_recording([path])
    np.testing.assert_allclose(propose_recording([path], rate=50).recording.triad("specific_force"), f, atol=1e-6)
    rng = np.random.default_rng(5)
    path.write_bytes(rng.integers(0, 4, 8 * 1200, dtype=np.uint8).tobytes())  # of another kind
    with refused():
        propose_recording([path])


def test_a_stamp_without_a_name_stands_before_numbers_with_names(tmp_path):
    t, f, w = turned()
    path = tmp_path / "log.txt"
    stamps = 1508804597.25 + t
    stamps[20] = stamps[19]
    path.write_text("".join(
        f"{s:.4f} AX: {a:.5f} g AY: {b:.5f} g AZ: {c:.5f} g     GX: {x:.4f} dps GY: {y:.4f} dps GZ: {z:.4f} dps\r\r\n"
        for s, (a, b, c), (x, y, z) in zip(stamps, f / G, w * D, strict=True)
    ))  # fmt: skip
    r = propose_recording([path]).recording
    np.testing.assert_allclose(r.time - r.time[0], t, atol=0.03)
    np.testing.assert_allclose(r.triad("specific_force"), f, atol=1e-3)


def test_a_log_that_is_called_after_the_accelerometer_holds_forces_although_the_unit_is_shaken():
    rng = np.random.default_rng(6)
    f = np.array([[0.0], [0.2], [1.0]]) + rng.normal(0, 0.5, (3, 900))
    columns = {str(k + 1): x for k, x in enumerate((*f, 1478626638.0 + 0.02 * np.arange(900)))}
    forces = [name for name, g in by_order(columns, quantity_of_log("accel")).items() if g.quantity == "specific_force"]
    assert forces == ["1", "2", "3"]
    assert not any(g.quantity == "specific_force" for g in by_order(columns).values())


def test_a_rotation_matrix_and_the_quaternions_of_a_plane_turn_without_names_are_no_sensors(tmp_path):
    rng = np.random.default_rng(8)
    t = 1576131518.0 + 0.015 * np.arange(900)
    angle = 1.5 * np.sin(np.maximum(np.arange(900) - 200, 0) / 80)
    C = Rotation.from_euler("z", angle[:, None])
    rate = np.stack([0 * t, 0 * t, np.gradient(angle, 0.015)], axis=-1) + rng.normal(0, 0.002, (900, 3))
    f = np.array([0.0, 0.0, 10.19]) + rng.normal(0, 0.02, (900, 3))
    matrix = C.as_matrix().reshape(-1, 9)
    imu, mocap, named = (tmp_path / name for name in ("imu.csv", "mocap.csv", "ref.csv"))
    np.savetxt(imu, np.column_stack([1e3 * t, f, rate, matrix]), fmt="%.9f", delimiter=",")
    columns = {str(k + 1): x for k, x in enumerate((*f.T, *rate.T, *matrix.T))}
    assert attitude_columns(columns) == [str(k) for k in range(7, 16)]
    assert attitude_columns({n: columns[n] for n in "123456"}) == []  # at rest and about one axis
    pose = np.column_stack([t, rng.normal([2.02, 0.99, -1.65], 1e-4, (900, 3)), C.as_quat()])
    np.savetxt(mocap, pose, fmt="%.9f", delimiter=",")
    with pytest.raises(InputError, match="their numbers alone do not show what they are"):
        propose_recording([imu, mocap])
    named.write_text("time,px,py,pz,ref_qx,ref_qy,ref_qz,ref_qw\n" + mocap.read_text())
    found = propose_recording([imu, named])
    assert found.recording.kind == "rotation"
    np.testing.assert_allclose(np.diff(found.recording.time), 0.015, atol=1e-3)


@pytest.mark.parametrize("name", ["log.npz", "log.npy"])
def test_an_array_whose_header_is_damaged_is_refused(tmp_path, name):
    t, f, w = turned()
    path = tmp_path / name
    (np.savez if name == "log.npz" else np.save)(path, np.column_stack([t, f, w]))
    path.write_bytes(path.read_bytes().replace(b"'shape': (", b"'shape':((", 1))
    with pytest.raises(InputError, match="is damaged"):
        propose_recording([path])


def test_arrays_of_sensors_make_the_table_whatever_else_is_longer(tmp_path):
    t, f, w = turned()
    longer = np.zeros((len(t) + 1, 4))
    scipy.io.savemat(tmp_path / "log.mat", {"q_reference": longer, "time": t, "Accelerometer": f, "Gyroscope": w})
    made = propose_recording([tmp_path / "log.mat"])
    np.testing.assert_allclose(made.recording.triad("specific_force"), f, atol=1e-6)
    assert f"q_reference of {len(longer)} rows" in made.left_out


def test_the_rates_are_the_other_half_of_a_matrix_of_six_also_where_the_unit_hardly_ever_stands_still():
    t, f, w = turned()
    moving = w + 0.3 * np.sin(np.outer(t, [1.1, 1.7, 2.3]))
    columns = {f"imu_{k + 1}": x for k, x in enumerate(np.hstack([f, moving]).T)}
    guesses = by_similar_names({"gt_x": t, "gt_y": np.sin(t), "gt_z": np.cos(t), **columns})
    assert [n for n, g in guesses.items() if g.quantity == "angular_rate"] == ["imu_4", "imu_5", "imu_6"]


def test_a_magnetometer_beside_the_forces_is_no_gyroscope(tmp_path):
    """It has one length about some centre and points all ways, which nothing that is at rest now and then does."""
    rng, (t, f, w) = np.random.default_rng(9), turned(rests=40)
    field = f @ np.array([[0.0, 0.6, 0.8], [1.0, 0, 0], [0, 0.8, -0.6]]) / G * 0.65 + [0.5, 0.5, 0.3]
    field += 0.01 * rng.standard_normal(f.shape)
    made = propose_recording([_bare(tmp_path, t, field, f)])
    assert not made.recording.has("angular_rate")
    turning = propose_recording([_bare(tmp_path, t, w, f)])
    np.testing.assert_allclose(turning.recording.triad("angular_rate"), w, atol=1e-5)


def _bare(folder, *columns):
    """A table without names."""
    path = folder / "bare.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", fmt="%.8g")
    return path


def test_rows_of_a_logger_that_is_faster_than_the_sensors_are_left_out(tmp_path):
    """At rest in coarse steps each sensor repeats by itself, and all of them at once now and then only."""
    t, f, w = turned()
    log = [np.repeat(x, 8, axis=0) for x in (f, w)]
    path = rows(tmp_path / "held.csv", "t,ax,ay,az,gx,gy,gz", np.arange(8 * len(t)) * 0.0025, *log[0].T, *log[1].T)
    found = propose_recording([path])
    np.testing.assert_allclose(found.recording.triad("specific_force"), f, atol=1e-4)
    assert "repeat the one before" in found.notes["repeated"]
    coarse = np.round(np.hstack([f, w]) + 0.01 * np.random.default_rng(5).standard_normal((len(t), 6)), 1)
    same = np.mean(np.all(coarse[1:] == coarse[:-1], axis=1))
    assert same > 0.4
    kept = propose_recording([rows(tmp_path / "coarse.csv", "t,ax,ay,az,gx,gy,gz", t, *coarse.T)])
    assert len(kept.recording.time) == len(t)


def test_lists_in_lists_of_json_hold_rows(tmp_path):
    _, f, w = turned()
    names = ("ax", "ay", "az", "gx", "gy", "gz")
    strokes = [dict(zip(names, map(float, row), strict=True)) for row in np.hstack([f, w])]
    path = tmp_path / "s.json"
    path.write_text(json.dumps({"label": "A", "strokes": [[{"ax": 1.0}], strokes]}))
    np.testing.assert_allclose(propose_recording([path], rate=50.0).recording.triad("angular_rate"), w)


def test_columns_without_names_are_no_attitude_by_their_name():
    q = np.tile([[1.0], [0.0], [0.0], [0.0]], 50)
    assert not [*quaternions(Log(dict(zip(("20", "21", "22", "23"), q, strict=True)), {}))]
    assert [*quaternions(Log(dict(zip(("q0", "q1", "q2", "q3"), q, strict=True)), {}))]


def test_rows_of_a_unit_in_motion_are_no_table_of_positions(tmp_path):
    """A row each second, turned in between; at rest they would lie on an ellipsoid, whatever the sensors are."""
    rng = np.random.default_rng(10)
    u = rng.standard_normal((200, 3))
    force = G * u / np.linalg.norm(u, axis=1, keepdims=True) * [1.03, 0.98, 1.0] + [0.2, -0.1, 0.3]
    still = rows(tmp_path / "still.csv", "ax,ay,az", *(force + 0.02 * rng.standard_normal(force.shape)).T)
    assert len(dwells(propose_recording([still]).recording)) == 200
    with refused():
        propose_recording(
            [rows(tmp_path / "moving.csv", "ax,ay,az", *(force + 0.5 * rng.standard_normal(force.shape)).T)]
        )


def test_what_is_nested_deep_in_json_is_read_with_its_row(tmp_path):
    t, f, w = turned()
    names = ("t", "ax", "ay", "az", "gx", "gy", "gz")
    objects = [dict(zip(names, row, strict=True)) for row in np.column_stack([t, f, w]).tolist()]
    objects[0]["deep"] = json.loads("[" * 600 + "1" + "]" * 600)
    (tmp_path / "rows.json").write_text(json.dumps(objects))
    r = propose_recording([tmp_path / "rows.json"]).recording
    np.testing.assert_allclose(r.triad("specific_force"), f, atol=1e-6)
    np.testing.assert_allclose(r.triad("angular_rate"), w, atol=1e-6)
    assert dict(leaves_of_object({"a": [1, None], "b": {"c": "x", "d": []}})) == {"a_0": 1, "a_1": None, "b_c": "x"}


def test_lines_behind_a_stamp_in_brackets_are_text(tmp_path):
    t, f, w = turned()
    each = [" ".join(f"{x:.5f}" for x in row) for row in np.column_stack([f, w])]
    lines = [f"[{1000 * a:.0f} ms] imu: {row}" for a, row in zip(t, each, strict=True)]
    (tmp_path / "log.txt").write_text("\n".join(lines))
    r = propose_recording([tmp_path / "log.txt"]).recording
    np.testing.assert_allclose(r.triad("specific_force"), f, atol=1e-3)
    np.testing.assert_allclose(r.time, t, atol=1e-3)
    (tmp_path / "log.json").write_text("[1, 2\n")
    with refused():
        propose_recording([tmp_path / "log.json"])


@pytest.mark.parametrize("start", [b"PK\x03\x04junk", b"\x1f\x8b\x08", b"#ROSBAG V2.0\n", b"\x01\x00\x02\x00" * 99])
def test_what_only_another_program_reads_is_one_sentence(tmp_path, start):
    path = tmp_path / "log.bin"
    path.write_bytes(start)
    with refused():
        propose_recording([path])


def test_counts_of_a_resting_unit_and_the_rate_that_the_log_states(tmp_path):
    rng = np.random.default_rng(3)
    f = np.round(rng.normal([-260, 14700, 300], 60, (4000, 3)))
    w = np.round(rng.normal([-435, 140, -60], 8, (4000, 3)))
    found = propose_recording([rows(tmp_path / "a.csv", "Fs,100\nLogging Type,1\nax,ay,az,gx,gy,gz", *f.T, *w.T)])
    assert {g.unit for g in found.guesses.values() if g.quantity != "time"} == {"count"}
    assert np.diff(found.recording.time[:2]) == pytest.approx(0.01)


def test_a_rest_logged_in_seconds_is_not_in_minutes(tmp_path):
    rng = np.random.default_rng(5)
    t = 0.0055 * np.arange(8000)
    f = rng.normal([0.1, 0.06, 0.98], 0.002, (8000, 3))
    found = propose_recording([rows(tmp_path / "a.csv", "A level surface. Z up.\ntime (s)x (g),y (g),z (g)", t, *f.T)])
    assert found.recording.time[-1] == pytest.approx(44, abs=0.1)
    found = propose_recording([rows(tmp_path / "b.csv", "Time,ax,ay,az", t, *f.T)])
    assert found.guesses["Time"].unit == "s"


def test_stamps_of_whole_seconds_and_packets_are_spread():
    t = 0.2 * np.arange(500)
    even, note = spread_stamps(np.floor(t))
    np.testing.assert_allclose(np.diff(even), 0.2, atol=0.002)
    assert "evenly spaced" in note
    packets, note = spread_stamps(np.array([0.0, 1.0, 2.0, 2.0, 3.0, 4.0]))
    np.testing.assert_allclose(packets, [0, 1, 2, 2.5, 3, 4])
    assert note.startswith("1 rows repeat")
    assert spread_stamps(t)[1] == ""


def test_gyroscopes_alone_are_a_recording_for_their_noise(tmp_path):
    rng = np.random.default_rng(6)
    w = rng.normal(0, 0.01, (3000, 3))
    found = propose_recording([rows(tmp_path / "a.csv", "gyro_x,gyro_y,gyro_z", *w.T)], rate=100)
    assert not found.recording.has("specific_force")
    golden_text(found.notes["kind"])
    table = {str(k): x for k, x in enumerate(w.T, start=1)}
    assert by_order(table) == {}
    assert {g.quantity for g in by_order(table, "angular_rate").values()} == {"angular_rate"}


def test_gyroscopes_alone_that_never_rest_are_asked_for_what_noise_takes(tmp_path):
    w = np.random.default_rng(6).normal(0, 0.01, (3000, 3)) + np.sin(0.02 * np.arange(3000))[:, None] ** 3
    with refused():
        propose_recording([rows(tmp_path / "a.csv", "gyro_x,gyro_y,gyro_z", *w.T)], rate=100)


def test_a_place_that_a_robot_logs_is_no_force(tmp_path):
    """A place in mm on a circle, of constant length, that turns as a force does when a unit is turned over."""
    t = 0.1 * np.arange(600)
    place = 800 * np.stack([np.cos(t // 6), np.sin(t // 6), 0 * t], axis=-1)
    with pytest.raises(InputError, match="no three columns are a triad"):
        propose_recording(
            [rows(tmp_path / "a.csv", "time,Robotposition_x,Robotposition_y,Robotposition_z", t, *place.T)]
        )


def test_faces_in_logs_that_begin_with_a_line_cut_off_are_parts_of_one_run(tmp_path):
    rng, paths = np.random.default_rng(11), []
    for k, face in enumerate(np.eye(3)):
        f = np.round(rng.normal(face, 0.01, (300, 3)), 2)
        paths.append(rows(tmp_path / f"{k}.csv", ",-0.06\n", 52 * np.arange(300), *f.T))
    r = propose_recording(paths, rate=19.0).recording
    assert len(r.time) > 890
    assert [d.position for d in dwells(r)] == [1, 2, 3]


def test_zero_bytes_that_a_logger_left_do_not_make_a_text_binary(tmp_path):
    """As a port sends while it is opened: in front of the names, which stand twice, and in the middle of a log."""
    rng, paths, names = np.random.default_rng(12), [], b"timestamp_us,ax,ay,az"
    for k, face in enumerate(np.eye(3)):
        f = np.rint(16384 * rng.normal(face, 0.005, (300, 3)))
        lines = [b",".join(b"%d" % v for v in (20_000 * i, *row)) for i, row in enumerate(f)]
        lines[150] = bytes(100 + k)
        paths.append(tmp_path / f"{k}.csv")
        paths[-1].write_bytes(b"\n".join([names, bytes(443 + k) + names, *lines]))
    r = propose_recording(paths).recording
    assert len(r.time) > 890
    assert [d.position for d in dwells(r)] == [1, 2, 3]


@pytest.mark.parametrize("length", [1.0, 2.0**14])
def test_a_quaternion_without_names_is_no_force(length):
    """A unit in the hand logs its attitude, its force in counts and its rates: four columns have one length."""
    rng, n = np.random.default_rng(13), 600
    turned = np.cumsum(rng.normal(0.0, 0.02, (4, n)), axis=1) + np.array([[0.7], [0.1], [-0.3], [-0.6]])
    q = length * turned / np.linalg.norm(turned, axis=0)
    f = 2048 * rng.normal([[0.1], [0.3], [0.9]], 0.05, (3, n))
    columns = (0.02 * np.arange(n), *(q if length == 1 else np.rint(q)), *np.rint(f), *rng.normal(0, 100, (3, n)))
    guesses = by_order({str(k + 1): x for k, x in enumerate(columns)})
    assert [name for name, g in guesses.items() if g.quantity == "specific_force"] == ["6", "7", "8"]
    assert [name for name, g in guesses.items() if g.quantity == "angular_rate"] == ["9", "10", "11"]


def test_a_vehicle_that_never_stops_has_no_rests(tmp_path):
    rng = np.random.default_rng(7)
    t = 0.01 * np.arange(6000)
    sway = 0.1 * np.stack([np.sin(1.1 * t), np.cos(1.7 * t), np.sin(0.6 * t)], axis=-1)
    f = rng.normal([0.0, 0.0, G], 0.05, (6000, 3))
    with refused():
        propose_recording([rows(tmp_path / "a.csv", "t,ax,ay,az,wx [rad/s],wy [rad/s],wz [rad/s]", t, *f.T, *sway.T)])


def test_a_unit_that_the_numbers_do_not_show_is_said_and_can_be_stated(tmp_path):
    rng = np.random.default_rng(8)
    t, f, w = 0.01 * np.arange(3000), rng.normal([0, 0, G], 0.02, (3000, 3)), rng.normal(0, 0.005, (3000, 3))
    path = rows(tmp_path / "a.csv", "t,ax,ay,az,gx,gy,gz", t, *f.T, *w.T)
    found = propose_recording([path])
    golden_text(found.notes["unit"])
    stated = propose_recording([path], units={"angular_rate": "deg/s", "time": "s"})
    assert stated.guesses["gx"].unit == "deg/s"
    assert "unit" not in stated.notes
    with refused():
        propose_recording([path], units={"temperature": "K"})


def test_gyroscopes_that_are_cut_off_at_the_full_scale_of_a_chip_tell_their_unit(tmp_path):
    rng = np.random.default_rng(9)
    t, walk = 0.04 * np.arange(3000), 3.0 * rng.standard_normal((3000, 3)).cumsum(axis=0) / 9
    moves = (np.arange(3000) > 1000)[:, None]
    w = np.round(np.clip(moves * walk, -np.radians(250), np.radians(250)) + 0.001 * rng.standard_normal((3000, 3)), 3)
    w = np.clip(w, -4.363, 4.363)
    f = np.array([0.0, -G, 1.0]) + (0.02 + moves) * rng.standard_normal((3000, 3))
    names = "GPST,Ax,Ay,Az,rotate_x,rotate_y,rotate_z"
    found = propose_recording([rows(tmp_path / "imu.csv", names, t, *f.T, *w.T)])
    assert {found.guesses[f"rotate_{a}"].unit for a in "xyz"} == {"rad/s"}
    assert "unit" not in found.notes


def test_gyroscopes_that_read_half_of_what_turned_are_said_with_the_factor(tmp_path):
    t, f, w = turned()
    found = propose_recording([rows(tmp_path / "a.csv", "t,ax,ay,az,gx,gy,gz", t, *f.T, *(w * D / 2).T)])
    assert found.guesses["gx"].unit == "deg/s"
    golden_text(found.notes["gyroscopes"])


def test_lines_of_other_kinds_are_skipped_and_counted(tmp_path):
    t, f, w = turned()
    lines = rows(tmp_path / "a.csv", "t,ax,ay,az,gx,gy,gz", t, *f.T, *w.T).read_text().splitlines()
    lines[40:40] = ["", "INFO: filter settled, all is well, a, b, c, d, e, f", "  ", "% battery low"]
    (tmp_path / "a.csv").write_text("\n".join(lines), encoding="utf-8")
    found: Proposal = propose_recording([tmp_path / "a.csv"])
    assert len(found.recording.time) == len(t)
    golden_text(found.notes["lines"])


def test_names_between_dashes_are_those_of_the_columns(tmp_path):
    above = "/\tCG-5 SURVEY\nLine\t   0.000S\n/------LINE-----STATION-----GRAV.---SD.--TILTX-TEMP"
    path = rows(tmp_path / "a.txt", above, np.zeros(9), np.ones(9), 2639.2 + 0.001 * np.arange(9), *np.ones((3, 9)))
    assert list(table_of(path).columns) == ["LINE", "STATION", "GRAV.", "SD.", "TILTX", "TEMP"]


def test_names_with_empty_cells_behind_them_are_not_repeated(tmp_path):
    above = "GRAPH,3,,,,,,,\n-1,321,MX-106,Goal,#000000,0,,-10,8\nTime[ms],Tick,Present,Goal,,,,,"
    cells = [[""] * 9] * 5
    path = rows(tmp_path / "a.csv", above, 100 * np.arange(9), 28 * np.arange(9), *np.ones((2, 9)), *cells)
    assert list(table_of(path).columns) == ["Time[ms]", "Tick", "Present", "Goal"]


def test_columns_below_a_block_of_settings_are_one_axis(tmp_path):
    a = np.concatenate([np.arange(0.0, 360, 2), np.arange(360.0, 0, -2)])
    head = "Name;run 2;\n\nName;position (Counter);velocity;position (Resolver)\nSampleTime;10;10;10\nUnit;(None);-;-"
    stamp = [str(132900081483250000 + 100000 * k) for k in range(len(a))]
    path = rows(tmp_path / "a.csv", head, stamp, a, np.gradient(a), a + 3 * np.sin(np.radians(4 * a)), mark=";")
    assert next(iter(table_of(path).columns)) == "Name"
    r = propose_recording([path]).recording
    assert str(r.kind) == "pointing"
    np.testing.assert_allclose(np.degrees(r.channels["gimbal_angle", "table"]), a, atol=1e-9)
    with_none = rows(tmp_path / "b.csv", "0,0.5", np.arange(1.0, 90), 0.5 + 0.9 * np.arange(1.0, 90))
    assert str(propose_recording([with_none]).recording.kind) == "pointing"
    stamp = [f"2020-12-08 16:17:{33 + k // 100:02d}.{10 * (k % 100):03d}" for k in range(500)]
    with refused():  # a time of day that grows as a position does is no angle
        propose_recording([rows(tmp_path / "c.log", "", stamp, np.arange(500) * 0.01 + 1, mark=" ")])


def test_an_encoder_goes_round_beside_the_angle_of_its_axis(tmp_path):
    """The last of eleven angles, 355 deg, is read behind the 14 bits of a turn, as 134."""
    angle = np.array([0.0, 33, 66, 100, 133, 185, 220, 253, 290, 315, 355])
    counts = np.round((angle + 7.5 + np.sin(angle)) * 16384 / 360) % 16384
    found = propose_recording([rows(tmp_path / "calibration.csv", "Raw Data,Angle", counts, angle)])
    read, true = (np.degrees(found.recording.channels[q, "table"]) for q in ("gimbal_angle", "true_angle"))
    np.testing.assert_allclose(true, angle, atol=1e-9)
    np.testing.assert_allclose(read - true, 7.5 + np.sin(angle), atol=0.02)
    assert found.guesses["Raw Data"].why == "16384 counts a turn"


def test_places_on_the_sky_that_stand_once_are_refused_for_that(tmp_path):
    text = "HIP     RA(hh mm ss)    DEC(dd mm ss)   LST(hh mm ss)\n" + "".join(
        f"{54872 + k}   11 {k:02d} 06        +20 26 08       12 {k:02d} 06\n" for k in range(9)
    )
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    (table,) = tables_of(tmp_path / "a.txt").values()
    assert len(table.sexagesimal) == 3
    with refused():
        propose_recording([tmp_path / "a.txt"], latitude=49.0)


def test_the_step_of_a_quantised_column_is_known_in_spite_of_rounding():
    x = np.round(np.random.default_rng(9).normal(3.4, 0.05, 4000) / 0.0012217) * 0.0012217
    assert quantum(np.round(x, 6)) == pytest.approx(0.0012217, rel=1e-3)
    assert quantum(np.random.default_rng(9).normal(size=4000)) == 0.0


def test_neither_the_difference_of_two_clocks_is_a_clock_nor_a_place_an_accelerometer(tmp_path):
    rng = np.random.default_rng(9)
    angle = np.linspace(0, 4, 400)
    place = 0.4854 * np.stack([np.cos(angle), np.sin(angle), 0 * angle]) + rng.normal(0, 0.001, (3, 400))
    names = "timestamp_diff_ms,raw_fp_x,raw_fp_y,raw_fp_z"
    path = rows(tmp_path / "poses.csv", names, rng.integers(0, 50, 400), *place)
    with pytest.raises(InputError, match="no column is a clock"):
        propose_recording([path])
    with pytest.raises(InputError, match="no three columns are a triad"):
        propose_recording([path], rate=10)
