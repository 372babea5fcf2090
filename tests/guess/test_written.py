"""Logs as programs write them: remarks behind rows, exponents of Fortran, errors beside offsets, messages, stamps."""

import json

import numpy as np
import pytest

from gimbalcal.guess.column_names import by_name
from gimbalcal.guess.date_formats import in_iso, is_stamp, split_stamps
from gimbalcal.guess.message_log import tables_in
from gimbalcal.guess.proposal import propose_recording
from gimbalcal.guess.text_table import table_of
from gimbalcal.importers.text_file import encoding_of
from gimbalcal.number import apply_matrix
from gimbalcal.platform import KNOWN
from tests.golden import golden_text, refused
from tests.guess.test_layouts import FACES, felt, rows, same
from tests.guess.test_pointing_run import AZ, EL, OFF, agrees, write
from tests.guess.test_proposal import D, G, turned


def test_a_form_above_and_a_column_of_remarks_that_is_left_empty(tmp_path):
    t, f, w = turned()
    units = "\t".join(["Y_Unit", *["g"] * 3, *["deg/s"] * 3])
    form = f"Meter\t2\n\nChannels\t6\t\t\t\t\t\t\nSamples{6 * (chr(9) + '2000')}\t\n{units}\t\n"
    head = form + "X_Value\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tComment"
    path = rows(tmp_path / "a.lvm", head, t, *f.T / G, *w.T * D, mark="\t")
    text = path.read_text().replace(".", ",").splitlines()
    text[30] += "\tknocked"  # the only remark
    path.write_text("\n".join(text), encoding="utf-8")
    same(propose_recording([path]), t, f, w)


def test_double_precision_of_fortran(tmp_path):
    t, f, w = turned()
    cells = [[f"{v:.7E}".replace("E", "D") for v in x] for x in (t, *f.T, *w.T * D)]
    same(propose_recording([rows(tmp_path / "a.dat",
    "C TUMBLE\n T(SEC) FX(M/S**2) FY(M/S**2) FZ(M/S**2) WX(DEG/S) WY(DEG/S) "
                       "WZ(DEG/S)", *cells, mark="  ")]), t, f, w)  # fmt: skip


def test_seconds_of_arc_have_a_comma_too_and_dashes_of_windows_are_read(tmp_path):
    path = tmp_path / "a.csv"
    body = "\n".join(f"{k};-12°30'36,{k}\";0,5;1,5" for k in range(6))
    path.write_bytes(f"Pos.;Außen;a;b\n–;°;g;g\n{body}\n".encode("cp1252"))
    table = table_of(path)
    assert "Pos. [–]" in table.columns
    np.testing.assert_allclose(table.columns["Außen [°]"], -12.51 - np.arange(6) / 36000)
    path.write_bytes(b"\x81\xdf")
    assert encoding_of(path) == "latin-1"


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [("accelerometer_m_s2[0]", "specific_force", "m/s^2"), ("gyro_rad[0]", "angular_rate", "rad/s"),
     ("acc_g_x", "specific_force", "g"), ("gyro_dps_x", "angular_rate", "deg/s"), ("gx", "angular_rate", ""),
     ("UncalAccelXMps2", "specific_force", "m/s^2"), ("UncalGyroXRadPerSec", "angular_rate", "rad/s"),
     ("gyro_x_raw", "angular_rate", "count")],
)  # fmt: skip
def test_a_unit_stands_before_the_axis_or_behind(name, quantity, unit):
    found = by_name(name)
    assert (found.quantity, found.axis, found.unit) == (quantity, "x", unit)


def test_an_error_beside_an_offset_is_no_offset(tmp_path):
    sky = OFF[0] * np.cos(np.radians(EL))
    names = "Az,El,xel_off [arcsec],el_off [arcsec],xel_err [arcsec],el_err [arcsec]"
    small = np.full(30, 0.5)
    found = propose_recording([write(tmp_path / "a.csv", names, AZ, EL, sky, OFF[1], small, 2 * small)])
    agrees(found.recording)
    assert {"xel_err [arcsec]", "el_err [arcsec]"} <= set(found.left_out)
    with refused():
        propose_recording([write(tmp_path / "b.csv", "az,el,daz,del,az_corr", AZ, EL, *OFF, OFF[0] + 9)])


def test_offsets_beside_both_angles_say_the_same_or_are_asked_about(tmp_path):
    names = "az_cmd,el_cmd,az_act,el_act,az_off [arcsec],el_off [arcsec]"
    read = AZ + OFF[0] / 3600, EL + OFF[1] / 3600
    agrees(propose_recording([write(tmp_path / "a.csv", names, AZ, EL, *read, *OFF, cell="{:.8f}")]).recording)
    servo = AZ + 1e-4, EL - 1e-4
    with refused():
        propose_recording([write(tmp_path / "b.csv", names, AZ, EL, *servo, *OFF)])


def _cells(t, *columns):
    return [",".join(f"{v:.9g}" for v in row) for row in zip(t, *columns, strict=True)]


def test_messages_of_a_flight_controller_two_units_in_turn(tmp_path):
    t, f, w = turned()
    us = np.round(1e6 * t) + 61e6
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 164, 47, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ",
        "FMT, 151, 43, ATT, Qccc, TimeUS,DesRoll,Roll,DesPitch",
        *(f"PARM, 5{k}, A{k}, {k}" for k in range(300)),
    ]
    for k, (s, a, b) in enumerate(zip(us, w, f, strict=True)):
        lines += [f"IMU, {s:.0f}, {i}, " + ", ".join(f"{v + i:.9g}" for v in (*a, *b)) for i in range(2)]
        lines += [f"ATT, {s:.0f}, 0, 1.5, 0"] if k % 5 == 0 else []
    path = tmp_path / "a.log"
    path.write_text("\n".join(lines), encoding="utf-8")
    found = propose_recording([path])
    same(found, t, f, w)
    golden_text(found.notes["sensor"])


def test_messages_of_a_telephone_named_in_comments_or_in_one_line(tmp_path):
    t, f, w = turned()
    ns = np.round(1e9 * t)
    acc, gyr = _cells(ns, *f.T), _cells(ns, *w.T)
    names = "elapsedRealtimeNanos,{0}XMps2,{0}YMps2,{0}ZMps2"
    head = ["# UncalAccel," + names.format("UncalAccel"), "# ", "# UncalGyro," + names.format("UncalGyro").replace(
        "Mps2", "RadPerSec"), "Fix,GPS,48.1,11.5,545.0,0.1,3"]  # fmt: skip
    path = tmp_path / "gnss.txt"
    body = [f"{tag},{x}" for pair in zip(acc, gyr, strict=True) for tag, x in zip(("UncalAccel", "UncalGyro"), pair,
                                                                                strict=True)]  # fmt: skip
    path.write_text("\n".join([*head, *body]), encoding="utf-8")
    same(propose_recording([path]), t, f, w)
    path.write_text("\n".join(["MessageType,nanos,MeasurementX,MeasurementY,MeasurementZ", *body]), encoding="utf-8")
    same(propose_recording([path]), t, f, w)
    path.write_text("\n".join(["# ATT,time,Roll,Pitch,Yaw", *[f"ATT,{k},1,2,3\nGPS,{k},1,2" for k in range(30)]]))
    with refused():
        propose_recording([path])


def test_labels_of_rows_are_no_messages(tmp_path):
    body = [f"{'M31' if k % 2 else 'Vega'},{k},{k + 1},{k + 2}" for k in range(60)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines := ["Star,Az,El,x", *body]), encoding="utf-8")
    assert tables_in(path, lines) == ({}, 0)


def test_lines_of_a_terminal_with_times_of_arrival_and_checksums(tmp_path):
    t, f, w = turned()
    second = 14 * 3600 + t
    stamp = [f"14:{int(s) // 60 % 60:02d}:{s % 60:06.3f} -> " for s in second]
    raw = np.round(np.column_stack([f / G * 16384, w * D * 131])).astype(int)
    path = tmp_path / "serial.txt"
    lines = [s + "a/g:\t" + "\t".join(map(str, row)) for s, row in zip(stamp, raw, strict=True)]
    path.write_text("\n".join([stamp[0] + "boot", *lines]), encoding="utf-8")
    r = propose_recording([path]).recording
    np.testing.assert_allclose(np.diff(r.time), 0.02, atol=1e-6)
    np.testing.assert_allclose(r.triad("specific_force"), raw[:, :3])
    np.testing.assert_allclose(r.triad("angular_rate"), raw[:, 3:])
    pairs = [f"{s}ax: {a[0]:.6f}, ay={a[1]:.6f} az = {a[2]:.6f} | gx: {b[0]:.6f} gy: {b[1]:.6f} gz: {b[2]:.6f}"
             for s, a, b in zip(stamp, f, w, strict=True)]  # fmt: skip
    path.write_text("\n".join(["ready: 1", *pairs]), encoding="utf-8")
    found = propose_recording([path]).recording
    np.testing.assert_allclose(found.triad("specific_force"), f, atol=1e-6)
    np.testing.assert_allclose(found.time - found.time[0], t, atol=1e-6)
    body = [f"{s:.2f};{','.join(f'{v:.6f}' for v in (*a, *b))}*{k % 256:02x}"
            for k, (s, a, b) in enumerate(zip(t, f, w, strict=True))]  # fmt: skip
    path.write_text("\n".join(f"$PIMU,{line}".replace(";", ",") for line in body), encoding="utf-8")
    np.testing.assert_allclose(propose_recording([path]).recording.triad("angular_rate")[:, 2], w[:, 2], atol=1e-6)


def test_a_clock_of_whole_seconds_and_nanoseconds_and_rates_with_a_bias(tmp_path):
    t, f, w = turned()
    w += 0.02  # a constant length at rest, as gravity has
    whole = 1_772_000_000 + np.floor(t + 0.9)
    rest = np.round(1e9 * np.mod(t + 0.9, 1.0)) % 1_000_000_000
    lines = [f"{a:.0f},{b:.0f},imu_link,0.0,0.0,0.0,1.0,-1.0," + ",".join(f"{v:.9g}" for v in (*c, 4e-6, 0.0, *d))
             for a, b, c, d in zip(whole, rest, w, f, strict=True)]  # fmt: skip
    path = tmp_path / "imu.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    found = propose_recording([path])
    same(found, t, f, w)
    assert not {"1", "2"} & set(found.left_out)


def test_dates_with_the_name_of_a_month_and_axes_counted_from_one(tmp_path):
    t, f, w = turned()
    stamp = [f"{'11-Mär-2026' if s < 90 else '12-Mär-2026'} {int(23 * 3600 + 3510 + s) // 3600 % 24:02d}:"
             f"{int(3510 + s) // 60 % 60:02d}:{(3510 + s) % 60:06.3f}" for s in t]  # fmt: skip
    head = (
        "Time,Acceleration_1,Acceleration_2,Acceleration_3,AngVel_1,AngVel_2,AngVel_3,MagneticField_1,MagneticField_2"
    )
    found = propose_recording([rows(tmp_path / "a.csv", head, stamp, *f.T, *w.T, *f.T[:2])])
    same(found, t, f, w)
    assert found.left_out == ("MagneticField_1", "MagneticField_2")
    for day, iso in (("14 June 2026", "2026-06-14"), ("2026-Oct-03", "2026-10-03"), ("1-dez-2026", "2026-12-01")):
        assert is_stamp(f"{day} 08:05:10")
        assert in_iso(*split_stamps([f"{day} 08:05:10"])) == [f"{iso}T08:05:10"]


def test_marks_of_thousands(tmp_path):
    t, f, w = turned()
    cells = [[f"{v:,.3f}" for v in x] for x in (*f.T / G * 1000, *w.T * D)]
    clock = [f"{s:.2f}" for s in t]
    head = "time [s];ax [mg];ay [mg];az [mg];gx [deg/s];gy [deg/s];gz [deg/s]"
    path = rows(tmp_path / "a.csv", head, clock, *cells, mark=";")
    same(propose_recording([path]), t, f, w)
    path.write_text(path.read_text().translate(str.maketrans(".,", ",.")), encoding="utf-8")
    same(propose_recording([path]), t, f, w)


def test_what_an_offset_is_known_to_stands_behind_a_plus_and_minus(tmp_path):
    sky = OFF[0] * np.cos(np.radians(EL))
    head = "! Scan   Az   El  dAzcosEl  +-  dEl  +-  Tau"
    path = write(
        tmp_path / "a.dat", head, np.arange(30.0), AZ, EL, sky, 0 * AZ + 0.4, OFF[1], 0 * AZ + 0.5, AZ, mark="  "
    )
    found = propose_recording([path])
    agrees(found.recording)
    assert {"dAzcosEl sigma", "dEl sigma"} <= set(found.left_out)


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("slow", [1, 100])
def test_times_of_day_are_a_clock_without_a_name_and_past_midnight(tmp_path, decimal, slow):
    t, f, _ = turned()
    ms = np.round(1000 * slow * t).astype(int) + 86_395_000
    stamp = [f"{x // 3600000 % 24:02d}:{x // 60000 % 60:02d}:{x // 1000 % 60:02d}{decimal}{x % 1000:03d}" for x in ms]
    r = propose_recording([rows(tmp_path / "a.txt", "# hand", stamp, *f.T, mark="\t")]).recording
    np.testing.assert_allclose(r.time - r.time[0], slow * t, atol=1e-6)


def test_lines_of_json(tmp_path):
    t, f, w = turned()
    path = tmp_path / "a.jsonl"
    lines = [json.dumps({"ts": round(1000 * s), "ok": True, "acc": dict(zip("xyz", a, strict=True)), "gyro": list(b)})
             for s, a, b in zip(t, f, w, strict=True)]  # fmt: skip
    path.write_text("\n".join(lines), encoding="utf-8")
    same(propose_recording([path]), t, f, w)


def test_lines_of_dictionaries_as_python_prints_them(tmp_path):
    t, f, w = turned()
    printed = [{"t": s, "acc": dict(zip("xyz", map(float, a), strict=True)), "gyro": tuple(map(float, b)), "ok": None}
               for s, a, b in zip(map(float, t), f, w, strict=True)]  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(map(str, printed)), encoding="utf-8")
    same(propose_recording([tmp_path / "a.csv"]), t, f, w)


def test_remarks_behind_the_first_row_need_no_name(tmp_path):
    head = "Number,Az target (deg),El target (deg),Az encoder (deg),El encoder (deg),"
    remarks = [*["by eye"] * 20, *[""] * 10]
    number = [str(k) for k in range(30)]
    path = write(tmp_path / "a.csv", head, number, AZ, EL, AZ + OFF[0] / 3600, EL + OFF[1] / 3600, remarks)
    agrees(propose_recording([path]).recording)


def test_a_row_without_a_time_is_left_out_and_told(tmp_path):
    t, f, w = turned()
    text = rows(tmp_path / "a.csv", "time,ax,ay,az,gx,gy,gz", t, *f.T, *w.T).read_text().splitlines()
    text.insert(1, "scale:,1,1,1,1,1,1")  # a line of settings above the rows, and one among them
    text.insert(9, "scale:,1,1,1,1,1,1")
    (tmp_path / "a.csv").write_text("\n".join(text), encoding="utf-8")
    found = propose_recording([tmp_path / "a.csv"])
    same(found, t, f, w)
    golden_text(found.notes["time"])


def test_a_magnetometer_beside_the_forces_is_no_gyroscope_and_what_does_not_turn_is_told(tmp_path):
    t, f, w = turned()
    field = f @ np.array([[0.0, 0.2, 0.1], [0.1, 0.0, -0.2], [0.2, 0.1, 0.0]])
    path = tmp_path / "a.txt"
    np.savetxt(path, np.column_stack([t, field, f, w]), fmt="%.6f")
    found = propose_recording([path])
    np.testing.assert_allclose(found.recording.triad("angular_rate"), w, atol=1e-5)
    path = rows(tmp_path / "b.csv", "time,ax,ay,az,gx,gy,gz", t, *f.T, *np.roll(w, 137, axis=0).T)
    told = propose_recording([path]).notes["gyroscopes"]
    golden_text(told)


def test_where_a_plate_was_solved_is_where_the_mount_looked(tmp_path):
    read = AZ + OFF[0] / 3600, EL + OFF[1] / 3600
    agrees(
        propose_recording(
            [write(tmp_path / "a.csv", "target_az,target_el,solved_az,solved_el", *read, AZ, EL)]
        ).recording
    )
    agrees(propose_recording([write(tmp_path / "b.csv", "AZ(enc),EL(enc),AZ(true),EL(true)", *read, AZ, EL)]).recording)


def test_resolvers_that_count_a_turn_in_a_power_of_two_are_angles(tmp_path):
    platform = KNOWN["two-axis-table"]
    a, b = FACES.T
    each = [np.repeat(x, 20) for x in (a, b, *felt(platform, a, b).T)]
    counts = [np.round(x / 360 * 65536 + np.tile([-0.4, 0.6], 240)) % 65536 for x in each[:2]]  # to and fro over zero
    path = rows(
        tmp_path / "a.txt", "time\tRES_A\tRES_B\tNx\tNy\tNz", 0.5 * np.arange(480), *counts, *each[2:], mark="\t"
    )
    found = propose_recording([path])
    r = found.recording
    assert found.guesses["RES_A"].why.startswith("65536 counts a turn")
    turned_to = apply_matrix(r.platform.attitude(r.angles()), np.array([0.0, 0.0, -G]))
    np.testing.assert_allclose(turned_to, r.triad("specific_force"), atol=2e-3)


def test_rows_of_several_kinds_and_no_table_at_all_are_told_with_a_line(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("12;3;4.5\n12;3;4.5;6;7\n1;2;3", encoding="utf-8")
    with refused():
        propose_recording([path])
    path.write_text(":pt10:10:34.8,+1,E#\n" * 9, encoding="utf-8")
    with refused():
        propose_recording([path])
