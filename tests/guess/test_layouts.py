"""Logs as further loggers write them: clocks that wrap or tick, scales in remarks, rigs and skies of any names."""

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.guess.clocks import unwrapped_clock
from gimbalcal.guess.column_names import by_name, plain_name
from gimbalcal.guess.column_values import signed_counts
from gimbalcal.guess.date_formats import in_iso, is_stamp, split_stamps
from gimbalcal.guess.merged_logs import resampled_readings
from gimbalcal.guess.proposal import propose_recording
from gimbalcal.guess.text_table import tables_of
from gimbalcal.guess.unit_candidates import stated_scales
from gimbalcal.number import apply_matrix
from gimbalcal.platform import KNOWN, Axis, Platform
from gimbalcal.recording import dwells, from_frame
from tests.golden import golden_text, refused
from tests.guess.test_proposal import D, G, turned

LATITUDE = 40.0
EARTH = 7.292115e-5


def rows(path, head, *columns, mark=",", cell="{:.7g}"):
    body = [mark.join(x if isinstance(x, str) else cell.format(x) for x in r) for r in zip(*columns, strict=True)]
    path.write_text("\n".join([head, *body]) + "\n", encoding="utf-8")
    return path


def same(found, t, f, w, atol=1e-3):
    """The proposal is the recording that was logged."""
    r = found.recording
    np.testing.assert_allclose(r.time - r.time[0], t - t[0], atol=1e-5)
    np.testing.assert_allclose(r.triad("specific_force"), f, atol=atol)
    np.testing.assert_allclose(r.triad("angular_rate"), w, atol=atol)
    assert len(dwells(r)) == 10


def test_rows_that_the_recorder_held_are_left_out(tmp_path):
    """60 equal rows in a rest and on the way: no sensor is frozen, and the rest goes on after them."""
    t, f, w = turned()
    for row in (100, 700):
        f[row : row + 60], w[row : row + 60] = f[row], w[row]
    found = propose_recording([rows(tmp_path / "held.csv", "time,ax,ay,az,gx,gy,gz", t, *f.T, *w.T)])
    assert found.notes["held"] == "118 rows are left out, 2 stretches in which the recorder held a row"
    assert len(found.recording.time) == len(t) - 118


@pytest.mark.parametrize("every", [True, False])
def test_rows_that_were_lost_are_left_out(tmp_path, every):
    """Packets that a receiver missed are zeros in all sensors, or in those behind a filter that had not begun."""
    t, f, w = turned()
    lost = np.arange(5, len(t), 57) if every else np.arange(20)
    field = np.tile([0.4, 0.1, 0.3], (len(t), 1)) + np.random.default_rng(2).normal(0, 3e-3, f.shape)
    for sensor in (f, w, field) if every else (f,):
        sensor[lost] = 0.0
    found = propose_recording([rows(tmp_path / "lost.csv", "", t, *f.T, *w.T, *field.T)])
    assert found.notes["lost"].startswith(f"{len(lost)} rows are left out")
    kept = np.setdiff1d(np.arange(len(t)), lost)
    same(found, t[kept], f[kept], w[kept])


def test_a_rocket_that_coasts_has_lost_no_rows(tmp_path):
    """Nothing is felt in free fall, and hardly anything before and after it."""
    rng = np.random.default_rng(3)
    f = np.concatenate([rng.normal([0, 0, G], 0.05, (900, 3)), np.round(rng.normal(0, 0.06, (600, 3)), 1)])
    f = np.concatenate([f, rng.normal([0, 0, G], 0.05, (900, 3))])
    found = propose_recording([rows(tmp_path / "coast.csv", "t,ax,ay,az", 0.01 * np.arange(len(f)), *f.T)])
    assert "lost" not in found.notes


@pytest.mark.parametrize("first", [True, False])
def test_a_column_without_a_name_that_numbers_the_rows_leaves_the_others_theirs(tmp_path, first):
    t, f, w = turned()
    names, number = "time_stamp acc_x acc_y acc_z angular_x angular_y angular_z", [str(k + 1) for k in range(len(t))]
    columns = (number, t, *f.T, *w.T) if first else (t, *f.T, *w.T, number)
    found = propose_recording([rows(tmp_path / "log.txt", names, *columns, mark=" ")])
    same(found, t, f, w)
    shorter = rows(tmp_path / "b.txt", "acc_x acc_y acc_z", t, *f.T, mark=" ")  # of which column no name is, is open
    assert "1" in propose_recording([shorter]).guesses


def test_the_same_vector_behind_a_filter_is_no_angular_rate(tmp_path):
    t, f, _ = turned()
    smooth = np.stack([np.convolve(x, np.ones(5) / 5, "same") for x in f.T], axis=1)
    smooth[[0, 1, -2, -1]] = f[[0, 1, -2, -1]]
    found = propose_recording([rows(tmp_path / "filtered.csv", "", t, *f.T, *smooth.T)])
    assert not found.recording.has("angular_rate")


def test_an_angle_that_grows_evenly_is_no_clock(tmp_path):
    angle = np.arange(0.0, 360.0, 10.0)
    f = 16000 * np.stack([np.sin(np.radians(angle)), np.cos(np.radians(angle)), 0.3 + 0 * angle], axis=1) + 200.0
    found = propose_recording([rows(tmp_path / "t.csv", "angle_deg,raw_x,raw_y,raw_z", angle, *f.T)])
    assert "angle_deg" in found.left_out


@pytest.mark.parametrize("n", [150, 3000])
def test_a_column_that_numbers_each_sample_is_no_column_of_positions(tmp_path, n):
    rng = np.random.default_rng(9)
    f, w = rng.normal([0.0, 0.0, G], 0.02, (n, 3)), rng.normal(0, 1e-3, (n, 3))
    path = rows(tmp_path / "rest.csv", "Number,ax,ay,az,wx,wy,wz", np.arange(1.0, n + 1), *f.T, *w.T)
    found = propose_recording([path], rate=100.0)
    assert len(dwells(found.recording)) == 1
    assert "Number" in found.left_out


def test_a_table_of_small_tilts_is_numbered_by_its_positions(tmp_path):
    tilt = np.radians(np.arange(12.0) - 6)
    f = G * np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], axis=-1)
    found = propose_recording([rows(tmp_path / "tilts.csv", "Number,ax,ay,az", np.arange(1.0, 13), *f.T)])
    assert len(dwells(found.recording)) == 12


def test_a_gyroscope_alone_beside_a_thermometer_is_refused_for_what_is_missing(tmp_path):
    t = 0.1 * np.arange(300)
    with refused():
        propose_recording([rows(tmp_path / "gyro.csv", "tstamp,temp,rate", t, 20 + 0 * t, 0.01 * np.sin(t))])


def test_stamps_of_packets_that_overlap_do_not_begin_again(tmp_path):
    """Some packets of four rows are stamped 5 ms too early, in us: 86,400 us are no day."""
    t, f, w = turned()
    us = np.round(1e6 * t)
    us[np.arange(len(us)) % 400 >= 396] += us[1] - us[0] + 5000
    assert 0 < np.count_nonzero(np.diff(us) < 0) < 0.01 * len(us)
    assert unwrapped_clock(us)[1] == ""
    with pytest.raises(InputError, match="the clock jumps back by 5000 us"):
        propose_recording([rows(tmp_path / "a.csv", "timestamp[us],ax,ay,az,gx,gy,gz", us, *f.T, *w.T)])


def test_a_rest_of_two_seconds_in_a_flight_is_not_denied(tmp_path):
    """2.5 s on the ground and 97.5 s in the air at 20 Hz: too little to be found, which is not that it never rests."""
    rng, n, still = np.random.default_rng(4), 2000, 50
    swaying, noise = np.cumsum(rng.standard_normal((n, 6)), axis=0), rng.standard_normal((n, 6))
    swaying = np.where(np.arange(n)[:, None] < still, 0, 0.1 * (swaying - swaying[still]))
    f, w = [0, 0, -G] + swaying[:, :3] + 0.005 * noise[:, :3], 0.1 * swaying[:, 3:] + 0.001 * noise[:, 3:]
    with pytest.raises(InputError, match="no rest is found that lasts a second and takes some 3 % of the time;"):
        propose_recording([rows(tmp_path / "a.csv", "time,ax,ay,az,gx,gy,gz", np.arange(n) / 20, *f.T, *w.T)])


@pytest.mark.parametrize("column", range(7))
def test_numbers_that_no_sensor_reads_are_missing(tmp_path, column):
    """A cell of 1e308 in a log without names, be it time, force or rate: its square is not finite."""
    t, f, w = turned()
    columns = [t, *f.T.copy(), *w.T.copy()]
    columns[column][40] = 1e308
    log = rows(tmp_path / "a.csv", "t,ax,ay,az,gx,gy,gz", *columns)
    same(propose_recording([log]), *(np.delete(x, 40, axis=0) for x in (t, f, w)))
    np.save(tmp_path / "a.npy", 1e300 * np.random.default_rng(column).standard_normal((200, 7)))
    with pytest.raises(InputError):
        propose_recording([tmp_path / "a.npy"])


def test_a_rate_at_which_the_log_lasts_a_microsecond_is_answered(tmp_path):
    _, f, w = turned()
    with pytest.raises(InputError, match="this is no rest"):
        propose_recording([rows(tmp_path / "a.csv", "ax,ay,az,gx,gy,gz", *f.T, *w.T)], rate=1e9)


def test_a_scale_that_a_remark_tells_is_taken_where_gravity_and_the_turns_agree(tmp_path):
    t, f, w = turned()
    counts = [np.round(x * 16384 / G) for x in f.T] + [np.round(x * D * 65.5) for x in w.T]
    for said, unit in (("LSB 16384/g, 65.5 LSB/dps", ("g", "deg/s")), ("65.5 LSB/dps", ("count", "deg/s")),
                       ("2048 LSB/g", ("count", "count"))):  # fmt: skip
        path = rows(tmp_path / "a.txt", f"# {said}\n# millis,ax,ay,az,gx,gy,gz", 1000 * t, *counts)
        found = propose_recording([path])
        units = {g.quantity: g.unit for g in found.guesses.values()}
        assert (units["specific_force"], units["angular_rate"]) == unit
    found = propose_recording([rows(tmp_path / "a.txt", "# LSB 16384/g, 65.5 LSB/dps\n# millis,ax,ay,az,gx,gy,gz",
    1000 * t,
                          *counts)])  # fmt: skip
    same(found, t, f, w, atol=2e-3)
    golden_text(found.guesses["ax"].why)
    told = stated_scales(["0.061 mg/digit; 8.75 mdps per LSB", '"acc_1G","2048"'])
    assert [size for size, _ in told["specific_force"]] == pytest.approx([61e-6 * G, G / 2048])
    assert [size for size, _ in told["angular_rate"]] == pytest.approx([8.75e-3 / D])


def test_a_named_clock_comes_before_a_count_and_an_even_one_before_times_of_arrival(tmp_path):
    t, f, w = turned()
    head = 'loopIteration,time,gyroADC[0],gyroADC[1],gyroADC[2],"accSmooth[0]","accSmooth[1]","accSmooth[2]"'
    path = rows(tmp_path / "b.csv", '"firmware","Betaflight"\n' + head, np.arange(len(t)), np.round(1e6 * t), *w.T * D,
                *f.T / G, cell="{:.10g}")  # fmt: skip
    same(propose_recording([path]), t, f, w)
    late = t + 0.005 * np.random.default_rng(2).random(len(t))
    columns = (np.round(1e9 * late), np.round(1e9 * t), *w.T, *f.T)
    head = (
        "%time,field.header.stamp,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,"
        "field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z"
    )
    found = propose_recording([rows(tmp_path / "ros.csv", head, *columns, cell="{:.12g}")])
    assert "field.header.stamp" in found.guesses
    same(found, t, f, w)


def test_ticks_and_minutes_are_told_by_the_turns_and_the_rests(tmp_path):
    t, f, w = turned()
    path = rows(tmp_path / "c.txt", "N\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z", np.arange(len(t)),
                np.round(1e4 * t) + 777, *f.T, *w.T, mark="\t")  # fmt: skip
    found = propose_recording([path])
    same(found, t, f, w)
    assert "0.1 ms" in found.guesses["SampleTimeFine"].why
    assert {g.unit for g in found.guesses.values() if g.quantity == "angular_rate"} == {"rad/s"}
    found = propose_recording([rows(tmp_path / "d.csv", "t,ax,ay,az", t / 60, *f.T, cell="{:.9g}")])
    assert found.guesses["t"].unit == "min"


def test_clocks_go_on_where_they_begin_again(tmp_path):
    t, f, w = turned()
    ms = (86_400_000 - 9000 + np.round(1000 * t).astype(int)) % 86_400_000
    stamp = [f"{x // 3600000:02d}:{x // 60000 % 60:02d}:{x // 1000 % 60:02d}.{x % 1000:03d}" for x in ms]
    head = '"Time [hh:mm:ss.ms]";"A_X [mg]";"A_Y [mg]";"A_Z [mg]";"G_X [mdps]";"G_Y [mdps]";"G_Z [mdps]"'
    found = propose_recording([rows(tmp_path / "e.csv", head, stamp, *f.T / G * 1000, *w.T * D * 1000, mark=";")])
    same(found, t, f, w)
    golden_text(found.guesses["Time [hh:mm:ss.ms]"].why)
    for period in (2.0**16, 2.0**32, 604800.0):
        x = np.arange(0, 5000.0, 10) + period - 2500
        whole, at = unwrapped_clock(np.mod(x, period))
        np.testing.assert_allclose(np.diff(whole), 10.0)
        assert at
    ms = unwrapped_clock(np.mod(19.0 * np.arange(400) + 513, 1000))[0]  # beside a clock of whole seconds
    np.testing.assert_allclose(np.diff(ms), 19.0)
    assert unwrapped_clock(np.array([0.0, 1, 2, 0.5, 1.5, 2.5]))[1] == ""  # no period: a fault


def felt(platform, *angles):
    return -G * apply_matrix(platform.attitude(np.radians(np.stack(angles, axis=-1))), np.array([0.0, 0.0, 1.0]))


FACES = np.array([(a, b) for b in (0, 45, 90, 135, 180, 270) for a in (0, 90, 180, 270)], dtype=float)


def test_a_rig_of_ones_own_names_is_found_by_how_gravity_goes(tmp_path):
    a, b = FACES.T
    f = felt(KNOWN["two-axis-table"], a, b)
    label = [f"P{k + 1:02d}" for k in range(24) for _ in range(8)]
    each = [np.repeat(x, 8) for x in (a, b, *f.T)]
    second = 9 * 3600 + 20 * np.arange(192)
    clock = [f"{s // 3600:02d}:{s // 60 % 60:02d}:{s % 60:02d}.0" for s in second]
    each[2:] = [x / G + 1e-6 * np.random.default_rng(3).standard_normal(192) for x in each[2:]]
    found = propose_recording(
        [rows(tmp_path / "f.dat", "UTC_hms PT ALPHA BETA NX NY NZ", clock, label, *each, mark="  ")]
    )
    r = found.recording
    assert (r.time[1] - r.time[0], len(dwells(r))) == (20.0, 24)
    assert {(g.axis, g.unit) for g in found.guesses.values() if g.quantity == "gimbal_angle"} == {
        ("alpha", "deg"), ("beta", "deg")}  # fmt: skip
    turned_to = apply_matrix(r.platform.attitude(r.angles()), np.array([0.0, 0.0, -G]))
    np.testing.assert_allclose(turned_to, r.triad("specific_force"), atol=1e-3)
    assert "names alike" not in found.guesses["NX"].why
    assert "called alike" in found.guesses["NX"].why


def test_degrees_minutes_and_seconds_gon_and_a_form_above_the_table(tmp_path):
    psi, theta = FACES.T
    f = felt(Platform("w", (Axis("platform", "z"), Axis("inner", "x"), Axis("middle", "y"))), psi, theta, 0 * psi)
    dms = [[f"{int(x)}°{int(x * 60) % 60:02d}'{0:04.1f}\"" for x in y] for y in (psi, theta, 0 * psi)]
    head = "Institute; no. 7\n\nNo.\tψ\tθ\tφ\tf_x / mGal\tf_y / mGal\tf_z / mGal\tu(f) / mGal"
    found = propose_recording(
        [rows(tmp_path / "g.csv", head, np.arange(1, 25), *dms, *f.T * 1e5, np.full(24, 1.5), mark="\t")]
    )
    r = found.recording
    assert r.platform.name == "space-stable"  # the letters of the paper, one of them never turned
    np.testing.assert_allclose(r.triad("specific_force"), f, atol=1e-5)
    np.testing.assert_allclose(np.degrees(r.channels["gimbal_angle", "inner"]), theta, atol=1e-9)
    f = felt(KNOWN["two-axis-table"], psi, theta)
    head = "Protokoll;B;;;;;\nDatum;7.5.;;;;;\n;;;;;;\nMesszeit;Stellung;Drehtisch;Kipptisch;b_x;b_y;b_z\n"
    head += "[min];[-];[gon];[gon];[m/s²];[m/s²];[m/s²]"
    path = rows(tmp_path / "h.csv", head, np.arange(24) / 3, np.arange(1, 25), psi / 0.9, theta / 0.9, *f.T, mark=";")
    path.write_text(path.read_text(encoding="utf-8").replace(".", ","), encoding="latin-1")
    r = propose_recording([path]).recording
    assert r.time[3] == pytest.approx(60.0)
    turned_to = apply_matrix(r.platform.attitude(r.angles()), np.array([0.0, 0.0, -G]))
    np.testing.assert_allclose(turned_to, r.triad("specific_force"), atol=1e-4)


def test_angles_of_a_second_log_are_those_of_the_rig(tmp_path):
    a, b = (np.repeat(x, 100) for x in FACES.T)
    f = felt(KNOWN["two-axis-table"], a, b) + 1e-4 * np.random.default_rng(5).standard_normal((2400, 3))
    t = 345600 + 0.1 * np.arange(2400)
    daq = rows(tmp_path / "daq.csv", "GPS_SOW [s];K1: AX [mg];K2: AY [mg];K3: AZ [mg]", t, *f.T / G * 1e3, mark=";",
               cell="{:.10g}")  # fmt: skip
    table = rows(tmp_path / "rig.csv", "GPS_SOW [s],Axis1 [deg],Axis2 [deg],status", t[::10], a[::10], b[::10],
                 ["OK"] * 240, cell="{:.10g}")  # fmt: skip
    found = propose_recording([daq, table])
    assert {g.axis for g in found.guesses.values() if g.quantity == "gimbal_angle"} == {"axis1", "axis2"}
    assert len(dwells(found.recording)) == 18  # turns about the vertical are not felt


def test_a_platform_left_alone_among_the_stars_is_a_static_run(tmp_path):
    t = np.arange(0, 43200, 60.0)
    s, la = EARTH * t + 0.7, np.radians(LATITUDE)
    f = G * np.stack([np.cos(la) * np.cos(s), np.cos(la) * np.sin(s), np.sin(la) + 0 * s], axis=-1)
    f += 1e-5 * np.random.default_rng(4).standard_normal(f.shape)
    head = '"t/h","ax (m/s2)","ay (m/s2)","az (m/s2)","platform (deg)","middle (deg)","outer (deg)"'
    path = rows(tmp_path / "i.csv", head, t / 3600, *f.T, np.degrees(s), np.full(len(t), LATITUDE) + 1e-5 * s, 1e-5 * s,
                cell="{:.10g}")  # fmt: skip
    with refused():
        propose_recording([path])
    r = propose_recording([path], latitude=LATITUDE, height=60.0).recording
    assert (r.kind, r.platform.name, set(r.axes("gimbal_angle"))) == (
        "static-run", "space-stable", {"platform", "middle", "outer"})  # fmt: skip


def test_places_on_the_sky_with_sidereal_time_zenith_distances_and_remarks_in_front(tmp_path):
    rng = np.random.default_rng(6)
    hour, dec, off = rng.uniform(-70, 70, 30), rng.uniform(-10, 70, 30), rng.uniform(-300, 300, (2, 30)) / 3600
    lst = np.mod(22 + 0.1 * np.arange(30), 24)
    columns = [lst, *(np.mod(lst - x / 15, 24) for x in (hour, hour + off[0])), dec, dec + off[1]]
    head = "time,SITE.LAT,LST,TARGET.RA,MOUNT.RA,TARGET.DEC,MOUNT.DEC"
    path = rows(tmp_path / "j.csv", head, 1.77e9 + 180 * np.arange(30), np.full(30, 48.0), *columns, cell="{:.12g}")
    r = propose_recording([path]).recording
    assert r.platform.name == "equatorial"
    assert r.site.latitude == pytest.approx(np.radians(48.0))
    read, true = (np.degrees(r.channels[q, "hour_angle"]) for q in ("gimbal_angle", "true_angle"))
    np.testing.assert_allclose(read - true, off[0], atol=1e-7)
    np.testing.assert_allclose(true, hour, atol=1e-7)
    path.write_text(path.read_text().replace("LST", "note"))
    with refused():
        propose_recording([path])
    az, el = rng.uniform(0, 360, 30), rng.uniform(20, 80, 30)
    head = "Nr\tUhrzeit\tAzimut\tZenitdistanz\tAblage Az [']\tAblage ZD [']"
    clock = [f"18:{2 * k % 60:02d}" for k in range(30)]
    r = propose_recording([rows(tmp_path / "k.txt", head, range(30), clock, az, 90 - el, 60 * off[0], -60 * off[1],
    mark="\t",
                      cell="{:.10g}")]).recording  # fmt: skip
    np.testing.assert_allclose(np.degrees(r.channels["true_angle", "elevation"]), el, atol=1e-7)
    np.testing.assert_allclose(np.degrees(r.channels["gimbal_angle", "elevation"]), el + off[1], atol=1e-7)
    assert r.time[1] - r.time[0] == pytest.approx(120.0)
    head = "! 22 GHz, source MJD AZ(deg) EL(deg) XEL_OFF(mdeg) EL_OFF(mdeg)\n! offsets are measured - commanded"
    sky = off[0] * np.cos(np.radians(el)) * 1000
    r = propose_recording([rows(tmp_path / "l.txt", head, ["J0318"] * 30, 61000 + 0.002 * np.arange(30), az, el, sky,
                      off[1] * 1000, mark=" ", cell="{:.12g}")]).recording  # fmt: skip
    np.testing.assert_allclose(np.degrees(r.channels["gimbal_angle", "azimuth"]) - az, off[0], atol=1e-6)


def test_words_and_letters_of_names():
    assert plain_name("ψ [°]") == "psi_deg"
    assert plain_name("Ablage ZD [']") == "ablage_zd_arcmin"
    said = {"G_X [mdps]": ("angular_rate", "x", "mdeg/s"), "gyroADC[1]": ("angular_rate", "y", ""),
            "accSmooth[2]": ("specific_force", "z", ""), "T / °C": ("temperature", "", "degC"),
            "MJD": ("time", "", "d"), "u(f) / mGal": ("sigma", "", "mGal"), "Pose": ("position", "", "")}  # fmt: skip
    for name, wanted in said.items():
        g = by_name(name)
        assert g is not None, name
        assert (g.quantity, g.axis, g.unit) == wanted, name


def test_readings_of_a_second_log_keep_their_noise_and_are_not_made_up(tmp_path):
    """On a line between neighbours half-way noise is 0.71 of what it is, and sigmas of turns with it."""
    rng = np.random.default_rng(8)
    t, x = 0.01 * np.arange(20_000), rng.standard_normal(20_000)
    inner = t[100:-100] + 0.005
    assert np.std(resampled_readings(inner, t, x)) == pytest.approx(1.0, abs=0.05)
    slow = 0.02 * np.arange(1, 9_999)  # two rows in one: white noise is smaller by the root of two
    assert np.std(resampled_readings(slow, t, x)) == pytest.approx(np.sqrt(0.5), abs=0.15)
    smooth = np.sin(2 * np.pi * t)
    np.testing.assert_allclose(resampled_readings(inner, t, smooth), np.sin(2 * np.pi * inner), atol=1e-3)
    np.testing.assert_allclose(resampled_readings(slow, t, smooth), np.sin(2 * np.pi * slow), atol=2e-3)
    t, f, w = turned()
    force = rows(tmp_path / "acc.csv", "t,ax,ay,az", t, *f.T, cell="{:.9g}")
    gyro = rows(tmp_path / "gyr.csv", "t,gx,gy,gz", t[::2], *w[::2].T, cell="{:.9g}")
    r = propose_recording([force, gyro]).recording  # at the times of the slower one
    assert np.median(np.diff(r.time)) == pytest.approx(0.04)
    assert r.title == "acc"


def test_readings_of_a_second_log_with_the_same_stamps_stay_what_they_are():
    """Counts of which one in a hundred thousand is not whole are none."""
    rng = np.random.default_rng(2)
    t = 0.01 * np.arange(300_000) + rng.uniform(-3e-4, 3e-4, 300_000)
    counts = rng.integers(800, 65000, len(t)).astype(float)
    np.testing.assert_array_equal(resampled_readings(t, t, counts), counts)
    np.testing.assert_array_equal(resampled_readings(t[1000:2000] + 1e-12, t, counts), counts[1000:2000])


def test_axes_before_their_sensor_letters_of_gravity_and_clocks_of_days(tmp_path):
    t, f, w = turned()
    counts = [*np.round(f.T / G * 1e3 / 0.061), *np.round(w.T * D / 0.01)]
    names = "% yday\tX_accel\tY_accel\tZ_accel\tX_gyro\tY_gyro\tZ_gyro"
    head = f"% Accel scale: 0.0610 mg/count\n% Gyro scale: 0.01 dps/count\n{names}"
    day = 212.5 + t / 86400
    same(
        propose_recording([rows(tmp_path / "m.log", head, day, *counts, mark="\t", cell="{:.15g}")]), t, f, w, atol=2e-3
    )
    head = head.replace("yday", "t")  # nothing but the turns and rests tells that these are days
    same(
        propose_recording([rows(tmp_path / "n.log", head, day, *counts, mark="\t", cell="{:.15g}")]), t, f, w, atol=2e-3
    )
    a, b = FACES.T
    f = felt(KNOWN["two-axis-table"], a, b)
    head = '"Station","Inclination (deg)","Toolface (deg)","Gx (mG)","Gy (mG)","Gz (mG)"'
    found = propose_recording([rows(tmp_path / "o.csv", head, [f'"S{k}"' for k in range(24)], b, a, *f.T / G * 1e3)])
    assert {g.axis for g in found.guesses.values() if g.quantity == "gimbal_angle"} == {"inclination", "toolface"}
    np.testing.assert_allclose(found.recording.triad("specific_force"), f, atol=1e-5)


@pytest.mark.parametrize(
    ("days", "times", "want"),
    [
        (["14.06.2026", "3.7.2026"], ["8:05", "18:00:01,5"], ["2026-06-14T08:05:00", "2026-07-03T18:00:01,5"]),
        (["6/14/2026", "7/3/2026"], ["8:05:10 PM", "12:00 am"], ["2026-06-14T20:05:10", "2026-07-03T00:00:00"]),
        (["14/06/2026", "03/07/2026"], ["08:05", "08:06"], ["2026-06-14T08:05:00", "2026-07-03T08:06:00"]),
        (["2026/6/14", "-"], ["08:05", "08:06"], ["2026-06-14T08:05:00", ""]),
    ],
)
def test_dates_as_spreadsheets_write_them(days, times, want):
    assert in_iso(days, times) == want
    whole = [f"{day} {time}" for day, time in zip(days, times, strict=True)]
    assert in_iso(*split_stamps(whole)) == want
    assert is_stamp(whole[0])


def test_a_day_and_a_time_apart_are_one_clock(tmp_path):
    t, f, w = turned()
    at = 86390 + t
    day = [f"{14 + int(s // 86400)}.06.2026" for s in at]
    time = [f"{int(s // 3600) % 24:02d}:{int(s // 60) % 60:02d}:{s % 60:05.2f}" for s in at]
    path = rows(tmp_path / "p.csv", "Date;Time UTC;ax;ay;az;gx;gy;gz", day, time, *f.T, *w.T, mark=";")
    same(propose_recording([path]), t, f, w)
    stamp = [f"{d} {x}" for d, x in zip(day, time, strict=True)]
    path = rows(tmp_path / "q.csv", "Zeitpunkt;t;ax;ay;az;gx;gy;gz", ["a"] * len(t), stamp, *f.T, *w.T, mark=";")
    same(propose_recording([path]), t, f, w)


def test_an_attitude_that_a_unit_estimates_is_no_readout_of_a_rig(tmp_path):
    """It follows gravity at every rest because it was made of it; a calibration against it would prove itself."""
    t, f, w = turned()
    roll, pitch = np.degrees(np.arctan2(f[:, 1], f[:, 2])), np.degrees(np.arctan2(-f[:, 0], np.hypot(*f.T[1:])))
    names = "Time\tDevice\tAccX(g)\tAccY(g)\tAccZ(g)\tAsX(°/s)\tAsY(°/s)\tAsZ(°/s)"
    stamp = [f"2026-6-14 10:{int(s // 60):02d}:{s % 60:06.3f}" for s in t]
    for angles in ("AngleX(°)\tAngleY(°)", "Roll\tPitch", "euler_x\teuler_y"):
        path = rows(tmp_path / "wit.txt", f"{names}\t{angles}", stamp, ["WT901"] * len(t), *f.T / G, *w.T * D, roll,
                    pitch, mark="\t")  # fmt: skip
        found = propose_recording([path])
        same(found, t, f, w)
        assert found.recording.platform.name == "bench"
        assert set(angles.split("\t")) <= set(found.left_out)


@pytest.mark.parametrize("form", ["Ax {:.4f} Ay {:.4f} Az {:.4f}", "Ax: {:.4f}, Ay: {:.4f}, Az: {:.4f}",
                                  "Ax={:.4f};Ay={:.4f};Az={:.4f};"])  # fmt: skip
def test_words_before_the_numbers_of_each_line_name_the_columns(form, tmp_path):
    _, f, _ = turned()
    path = tmp_path / "log.txt"
    path.write_text("\n".join(["Calibrating", *(form.format(*row) for row in f)]) + "\n")
    r = propose_recording([path], rate=100.0).recording
    np.testing.assert_allclose(r.triad("specific_force"), f, atol=1e-4)


@pytest.mark.parametrize("form", ["{}x: {:.4f} {}y: {:.4f} {}z: {:.4f}", "{}x {:.4f} {}y {:.4f} {}z {:.4f}"])
def test_labelled_lines_of_every_kind_make_a_table(form, tmp_path):
    _, f, w = turned()
    lines = []
    for k, (a, g) in enumerate(zip(f, w, strict=True)):
        lines += [form.format("A", a[0], "A", a[1], "A", a[2])] + ["Battery low"] * (k == 50)
        lines += [form.format("G", g[0], "G", g[1], "G", g[2])] * (k % 2)
    path = tmp_path / "log.txt"
    path.write_text("\n".join(lines) + "\n")
    forces, rates = tables_of(path).values()
    np.testing.assert_allclose(np.stack([*forces.columns.values()], axis=1), f, atol=1e-4)
    np.testing.assert_allclose(np.stack([*rates.columns.values()], axis=1), w[1::2], atol=1e-4)
    assert forces.skipped + rates.skipped == 1


@pytest.mark.parametrize(
    "form",
    [
        "I (82) boot 0x68: t_ms={:.0f} accel=({:.7g}, {:.7g}, {:.7g}) temp_raw=4046 gyro=[{:.7g} {:.7g} {:.7g}]",
        "millis: {:.0f},EULER(deg): R=1.70,P=9,Y=9,ACC: X={:.7g},Y={:.7g},Z={:.7g},GYRO: x:{:.7g} y:{:.7g} z:{:.7g}",
    ],
)
def test_the_numbers_of_a_vector_are_called_after_it(form, tmp_path):
    t, f, w = turned()
    lines = [form.format(1000 * s, *a, *b) for s, a, b in zip(t, f, w, strict=True)]
    (tmp_path / "v.log").write_text("\n".join(["ESP-ROM: esp32", "# ready", *lines]), encoding="utf-8")
    same(propose_recording([tmp_path / "v.log"]), t, f, w, 1e-5)


def test_a_unit_that_never_rests_is_not_logged_in_minutes(tmp_path):
    """What pauses for a fifth of a second rests for twelve seconds then."""
    t = 0.0025 * np.arange(6000)
    moving = np.sin(np.outer(t, [1.1, 1.7, 2.3])) * (np.mod(t, 2.0) > 0.2)[:, None]
    w = moving + 0.002 * np.random.default_rng(2).standard_normal((6000, 3))
    with refused():
        propose_recording([rows(tmp_path / "m.csv", "time,Gyr_X,Gyr_Y,Gyr_Z", t, *w.T)])


@pytest.mark.parametrize("separator", ["", " ", ": ", " = "])
def test_names_of_labelled_lines_end_where_the_number_begins(separator, tmp_path):
    """Values of any size and sign, and NaN where there is a separator, stay in the row; lines without one are counted.

    A digit belongs to a name where a separator follows.
    """
    _, f, _ = turned()
    absent = separator and f" T{separator}NaN"
    body = [absent + " " + " ".join(f"{n}{separator}{x:.4f}" for n, x in zip(("Ax", "Ay", "Az"), row, strict=True))
            for row in f / G]  # fmt: skip
    path = tmp_path / "log.txt"
    path.write_text("\n".join([*body[:100], "Ax Ay", *body[100:]]) + "\n")
    (table,) = tables_of(path).values()
    np.testing.assert_allclose(np.stack([table.columns[n] for n in ("Ax", "Ay", "Az")], axis=1), f / G, atol=1e-4)
    assert table.skipped == 1
    if separator:
        path.write_text("\n".join(line.replace("Ax", "A1").replace("Ay", "A2") for line in body) + "\n")
        (table,) = tables_of(path).values()
        assert [n for n in table.columns if n != "T"] == ["A1", "A2", "Az"]
        assert len(table.columns["A1"]) == len(f)


def test_counts_of_two_s_complement_get_their_signs_back(tmp_path):
    """The clock is a counter of 16 bits that starts again, and stays one."""
    t, f, w = turned()
    counts = [np.round(x) for x in np.vstack([f.T * 2048 / G, w.T * D * 16.4])]
    body = [(np.round(1000 * t) % 2**16), *(x % 2**16 for x in counts)]
    found = propose_recording([rows(tmp_path / "log.csv", "millis,ax,ay,az,gx,gy,gz", *body)])
    r = found.recording
    assert "two's complement" in found.notes["counts"]
    assert "millis" not in found.notes["counts"]
    np.testing.assert_allclose(r.time - r.time[0], t - t[0], atol=1e-3)
    scale = G / 2048 if r.counted("specific_force") else 1.0
    np.testing.assert_allclose(scale * r.triad("specific_force"), f, atol=0.01)
    np.testing.assert_array_equal(signed_counts({"a": body[1], "b": np.arange(5.0)})[0]["a"], counts[0])
    assert signed_counts({"t": np.arange(0.0, 2e5, 7) % 2**16})[1] == ()


def test_one_column_of_two_s_complement_shows_nothing_about_unrelated_ones():
    """An encoder passes zero; accelerometers in offset binary, a temperature and clocks have no signs."""
    k = np.arange(4000.0)
    encoder = np.round(3000 * np.sin(k / 300)) % 2**16
    offset = {f"acc_{a}": np.round(2**15 + 9000 * np.sin(k / 200 + p)) for a, p in zip("xyz", (0, 2, 4), strict=True)}
    others = {**offset, "temp_raw": 40000 + np.round(k / 100), "millis": 10 * k, "tick": (63000 + k) % 2**16}
    columns, signed = signed_counts({"encoder": encoder, **others})
    assert signed == ("encoder",)
    assert all(np.array_equal(columns[n], x) for n, x in others.items())


def test_the_triad_of_a_column_of_two_s_complement_has_signs():
    """Gravity leaves one axis negative throughout; none has signs where they would break an axis."""
    k = np.arange(4000.0)
    true = {"gx": 3000 * np.sin(k / 300), "gy": 2000 * np.cos(k / 300), "gz": -5000 + 20 * np.sin(k)}
    logged = {n: np.round(x) % 2**16 for n, x in true.items()}
    columns, signed = signed_counts(logged)
    assert signed == ("gx", "gy", "gz")
    np.testing.assert_array_equal(columns["gz"], np.round(true["gz"]))
    centred = {**logged, "gz": 2**15 + np.round(9000 * np.sin(k / 200))}
    assert signed_counts(centred)[1] == ()


@pytest.mark.parametrize("names", ["dWb_{}", "delta_theta_{} [rad]", "dAng{}", "delAng_{}", "angle_increment_{}"])
def test_increments_of_angle_and_velocity_are_divided_by_their_time(names, tmp_path):
    t, f, w = turned()
    step = float(np.median(np.diff(t)))
    head = ",".join(["time", *(f"dVel_{a}" for a in "xyz"), *(names.format(a) for a in "XYZ")])
    found = propose_recording([rows(tmp_path / "log.csv", head, t, *(f * step).T, *(w * step).T)])
    same(found, t, f, w)


def test_increments_are_divided_as_a_recording_of_them_is(tmp_path):
    """Over steps that jitter and a pause: what `new` reads is what a header that states the increments reads."""
    t, f, w = turned()
    rng = np.random.default_rng(35)
    t = t + rng.uniform(-0.2, 0.2, len(t)) * np.median(np.diff(t))
    step = np.diff(t, prepend=2 * t[0] - t[1])
    t = t + 3.0 * (np.arange(len(t)) > len(t) // 2)  # what was summed meanwhile is lost
    names = [*(f"dVel_{a}" for a in "xyz"), *(f"dTheta_{a}" for a in "xyz")]
    columns = dict(zip(names, np.vstack([f.T, w.T]) * step, strict=True))
    path = rows(tmp_path / "log.csv", ",".join(["t", *names]), t, *columns.values(), cell="{:.17g}")
    found = propose_recording([path])
    header = {"t": {"quantity": "time", "unit": "s"}}
    for name in names:
        quantity, unit = ("velocity_increment", "m/s") if "Vel" in name else ("angle_increment", "rad")
        header[name] = {"quantity": quantity, "axis": name[-1], "unit": unit}
    stated = from_frame({"t": t, **columns}, header, kind="multi-position", platform="bench", title="stated")
    for quantity in ("specific_force", "angular_rate"):
        np.testing.assert_allclose(found.recording.triad(quantity), stated.triad(quantity), rtol=1e-12)


def test_counts_of_increments_stay_counts(tmp_path):
    t, f, w = turned()
    head = "time,acc_x,acc_y,acc_z,dtheta_x,dtheta_y,dtheta_z"
    found = propose_recording([rows(tmp_path / "log.csv", head, t, *f.T, *np.round(3e4 * w).T, cell="{:.9g}")])
    assert found.recording.counted("angular_rate")


def test_a_second_triad_of_accelerometers_is_named(tmp_path):
    t, f, w = turned()
    head = "time,imu1_acc_x,imu1_acc_y,imu1_acc_z,gyro_x,gyro_y,gyro_z,imu2_acc_x,imu2_acc_y,imu2_acc_z"
    found = propose_recording([rows(tmp_path / "log.csv", head, t, *f.T, *w.T, *(1.01 * f).T)])
    same(found, t, f, w)
    assert "imu2_acc_x, imu2_acc_y, imu2_acc_z are of another unit" in found.notes["further"]
    other = rows(tmp_path / "other.csv", "time,ax,ay,az", t, *(1.01 * f).T)
    first = rows(tmp_path / "one.csv", head.partition(",imu2")[0], t, *f.T, *w.T)
    found = propose_recording([first, other])
    assert "other.csv: ax, ay, az are of another unit" in found.notes["further"]


def test_a_table_that_is_sorted_by_temperature_has_no_clock(tmp_path):
    """Thirty bins of some two degrees each were taken for rows a row every 2.3 s."""
    rng = np.random.default_rng(0)
    warm = np.cumsum(rng.uniform(1.5, 3.0, 30))
    force = np.array([0.13, -0.11, G]) + 0.002 * rng.standard_normal((30, 3))
    path = rows(tmp_path / "bins.csv", "", np.arange(9.0, 39), warm, *force.T, *(0.003 * rng.standard_normal((3, 30))))
    with pytest.raises(InputError, match="give --rate HZ"):
        propose_recording([path])


def test_rows_of_a_fast_clock_are_no_positions(tmp_path):
    """Of a unit that a hand turns all the time each row was taken for a position of its own."""
    t = 3450 + 52.0 * np.arange(60)
    a = np.linspace(0, 6, 60)
    rng = np.random.default_rng(0)
    force = np.array([np.sin(a), np.cos(a), 0.05 * np.sin(5 * a)]) + 0.005 * rng.standard_normal((3, 60))
    with pytest.raises(InputError, match="the force moves by"):
        propose_recording([rows(tmp_path / "pos_x.csv", "", t, *force)])


def test_where_a_clock_without_a_name_begins_again_is_told(tmp_path):
    """A board that restarts counts ms from one again; 59231 was taken for -6305 in two's complement."""
    t = np.r_[59022 + 52 * np.arange(5), 1 + 52 * np.arange(200)]
    f = np.array([1.0, 0, 0])[:, None] + 0.01 * np.random.default_rng(0).standard_normal((3, 205))
    with pytest.raises(InputError, match="1 grows as one and goes back at row 6; give --rate HZ"):
        propose_recording([rows(tmp_path / "log.csv", "", t, *f)])


def test_places_of_stations_are_no_accelerometers(tmp_path):
    """The latitude of a gravimeter's stations, 35.14 deg, is as large as gravity in ft/s^2."""
    rng = np.random.default_rng(0)
    at = np.repeat(rng.integers(0, 12, 40), 15)
    latitude, longitude = 35.14 + 0.01 * rng.random(12), -0.67 + 0.01 * rng.random(12)
    n = len(at)
    columns = [np.arange(n) * 6.1, 0.01 * rng.standard_normal(n), latitude[at], longitude[at]]
    with pytest.raises(InputError, match="no three columns are a triad"):
        propose_recording([rows(tmp_path / "B44.txt", "", *columns, cell="{:.9g}")])


@pytest.mark.parametrize("second", ["quaternion", "gyroscopes"])
def test_what_a_second_sensor_reads_of_a_turn_is_no_table(tmp_path, second):
    """A quaternion in counts, or gyroscopes of another unit, turn as those of the unit do."""
    t = np.arange(4000) * 0.01
    rng = np.random.default_rng(0)
    rate = 0.2 * np.sin(2 * np.pi * t / 20)
    yaw = np.cumsum(rate) * 0.01
    force = np.array([0.0, 0.0, 1000.0])[:, None] + rng.standard_normal((3, 4000))
    gyro = 1e3 * (1e-3 * rng.standard_normal((2, 3, 4000)) + np.array([0, 0, 1.0])[:, None] * rate)
    q = np.round(2**14 * np.array([np.cos(yaw / 2), 0 * yaw, 0 * yaw, np.sin(yaw / 2)]))
    names, more = {
        "quaternion": ("Q_w,Q_x,Q_y,Q_z", q),
        "gyroscopes": ("imu2 gyro_x,imu2 gyro_y,imu2 gyro_z", np.round(gyro[1])),
    }[second]
    head = f"time,acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z,{names}"
    found = propose_recording([rows(tmp_path / "log.csv", head, t, *force, *np.round(gyro[0]), *more)])
    assert not found.recording.platform.axes


def test_a_column_that_explains_next_to_nothing_of_gyroscopes_at_rest_is_no_table(tmp_path):
    """A magnetometer was one although 99 % of what the gyroscopes read was left."""
    t = np.arange(20000) * 0.01
    rng = np.random.default_rng(0)
    force = np.array([0.0, 0.0, 1000.0])[:, None] + rng.standard_normal((3, 20000))
    gyro = np.round(3 * rng.standard_normal((3, 20000)))
    wander = np.cumsum(rng.standard_normal((12, 20000)), axis=1)
    head = "time,acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z," + ",".join(f"m{k}" for k in range(12))
    found = propose_recording([rows(tmp_path / "log.csv", head, t, *force, *gyro, *wander)])
    assert not found.recording.platform.axes


def at_rest(n, noise=0.02):
    rng = np.random.default_rng(31)
    return rng.normal([0.0, 0.0, G], noise, (n, 3)), rng.normal([0.02, 0.0, -0.01], 1e-3, (n, 3))


def test_arrays_of_a_clock_and_a_triad_are_joined(tmp_path):
    """Matrices of four rows, of which the first is a clock, and one of a clock and a temperature: no quaternions."""
    f, w = at_rest(3000)
    t = np.arange(3000) / 100
    for name, x in (("accelBuffer", f.T), ("gyroBuffer", w.T), ("temperatureBuffer", np.full((1, 3000), 25.5))):
        np.savez(tmp_path / f"{name}.npz", **{name: np.vstack([t, x])})
    found = propose_recording(sorted(tmp_path.glob("*.npz"))).recording
    np.testing.assert_allclose(found.triad("specific_force"), f, atol=1e-6)
    np.testing.assert_allclose(found.triad("angular_rate"), w, atol=1e-6)
    np.testing.assert_allclose(found.channels["temperature", ""], 25.5)


def test_logs_of_which_no_column_is_known_are_refused_by_what_is_missing(tmp_path):
    paths = [rows(tmp_path / f"{a}.csv", f"{a}_u,{a}_v,{a}_q", *np.ones((3, 9))) for a in ("first", "second")]
    with pytest.raises(InputError, match=r"no three columns are a triad .* \(first_u, first_v, first_q\)"):
        propose_recording(paths, rate=50.0)


def test_rows_that_are_stamped_as_their_packets_arrive_are_evenly_spaced(tmp_path):
    """Five rows arrive within 8 ms, and packets 40 to 60 ms apart: 100 Hz, not 500."""
    n = 4000
    f, w = at_rest(n)
    late = np.repeat(np.random.default_rng(32).uniform(0, 0.02, n // 5), 5)
    t = 0.05 * (np.arange(n) // 5) + late + 0.002 * (np.arange(n) % 5)
    found = propose_recording([rows(tmp_path / "log.csv", "time [s],ax,ay,az,gx,gy,gz", t, *f.T, *w.T)])
    np.testing.assert_allclose(np.diff(found.recording.time), 0.01, rtol=1e-3)
    assert found.notes["clock"] == "stamps stand at 5 rows each, which are taken to be evenly spaced"


def test_readings_at_places_are_no_packets(tmp_path):
    """Five readings at each of 24 places, 2 s apart, and a minute on the way: their times stay."""
    rng = np.random.default_rng(36)
    f = G * np.repeat(rng.normal(size=(24, 3)), 5, axis=0)
    f /= np.linalg.norm(f, axis=1, keepdims=True) / G
    t = 60.0 * (np.arange(120) // 5) + 2.0 * (np.arange(120) % 5)
    place = np.arange(120) // 5 + 1.0
    found = propose_recording([rows(tmp_path / "log.csv", "time [s],position,ax,ay,az", t, place, *f.T)])
    np.testing.assert_allclose(found.recording.time, t)


def test_a_pause_makes_no_packets_of_what_was_logged_before_and_after_it(tmp_path):
    f, w = at_rest(600)
    t = np.arange(600) / 100 + 900.0 * (np.arange(600) >= 300)
    found = propose_recording([rows(tmp_path / "log.csv", "time [s],ax,ay,az,gx,gy,gz", t, *f.T, *w.T)])
    np.testing.assert_allclose(found.recording.time - found.recording.time[0], t, atol=1e-6)
    assert "clock" not in found.notes


def test_whole_seconds_and_nanoseconds_are_a_clock_where_another_log_follows(tmp_path):
    """What was exported after it is of an earlier time: the row at which the clock goes back is named."""
    f, w = at_rest(500)
    t = 1574069785.6 + np.arange(500) / 10 - 1700.0 * (np.arange(500) > 480)
    seconds = np.floor(t)
    head = "rosbagTimestamp,seq,secs,nsecs,gx,gy,gz,ax,ay,az"
    stamps = (np.full(500, 1.57407e18), np.arange(500.0), seconds, np.round(1e9 * (t - seconds)))
    path = rows(tmp_path / "raw.csv", head, *stamps, *w.T, *f.T, cell="{:.12g}")
    with pytest.raises(InputError, match=r"row 482, column time of two columns: the clock jumps back by 1699.9 s"):
        propose_recording([path])


def test_a_second_log_of_which_nothing_is_known_is_not_dropped(tmp_path):
    """An optical tracker's places and quaternions, without names."""
    f, w = at_rest(500)
    t = np.arange(500) / 100
    first = rows(tmp_path / "imu.csv", "time [s],ax,ay,az,gx,gy,gz", t, *f.T, *w.T)
    place = np.random.default_rng(37).normal([-0.7, 1.0, -0.75, 0.0, 0.815, 0.22, 0.536], 1e-3, (500, 7))
    second = rows(tmp_path / "mocap.csv", "-0.01,-0.7,1.0,-0.75,0,0.815,0.22,0.536", t, *place.T)
    with pytest.raises(
        InputError,
        match=r"mocap.csv: its columns have no names, .* name them \(gyro_x, gyro_y, gyro_z, temperature, ref_qw",
    ):
        propose_recording([first, second])


def test_gyroscopes_without_names_are_the_triad_about_zero(tmp_path):
    """Those of a unit at rest read nothing beside their noise; a magnetometer before them reads the field."""
    f = at_rest(900)[0]
    rng = np.random.default_rng(33)
    field = np.round(rng.normal([-529.0, -29.0, -794.0], 10.0, (900, 3)))
    rates = np.round(rng.normal([-22.0, -12.0, 4.0], 17.0, (900, 3)))
    body = (np.round(f.T / G * 1000), field.T, rates.T)
    path = rows(tmp_path / "raw.csv", "-16, -53, 982, -523, -18, -837, -19, 9, 4", *np.vstack(body), cell="{:.0f}")
    found = propose_recording([path], rate=50.0)
    assert [n for n, g in found.guesses.items() if g.quantity == "angular_rate"] == ["7", "8", "9"]


def test_a_name_that_states_another_unit_than_the_length_of_gravity_is_not_believed(tmp_path):
    t, f, w = turned()
    found = propose_recording([rows(tmp_path / "log.csv", "time,aX (g),aY (g),aZ (g),gx,gy,gz", t, *f.T, *w.T)])
    same(found, t, f, w)
    assert "gravity is 9.807 m/s^2" in found.guesses["aX (g)"].why


def test_a_boat_that_is_rowed_without_gravity_is_refused_for_its_motion(tmp_path):
    """Nothing shows whether gravity was taken off: the force is 0.4 g in most rows."""
    t, w = np.arange(3000) / 100, at_rest(3000)[1]
    f = 2.5 * np.random.default_rng(38).normal(size=(3000, 3))
    head = "time [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]"
    with pytest.raises(InputError, match="no rest is found"):
        propose_recording([rows(tmp_path / "log.csv", head, t, *f.T, *w.T)])


def test_forces_without_gravity_keep_the_unit_of_their_names_and_are_refused(tmp_path):
    """A telephone on a robot that drives now and then: the rest of the force happens to be some 1 m/s^2."""
    f, w = at_rest(4000)
    rng = np.random.default_rng(34)
    f = (f - [0, 0, G]) + rng.normal(0, 1.0, (4000, 3)) * (np.arange(4000) % 1000 > 600)[:, None]
    t = np.arange(4000) / 100
    head = "time [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]"
    w = w + rng.normal(0, 0.5, (4000, 3))
    with pytest.raises(InputError, match=r"in most rows the specific force is .* gravity was taken off"):
        propose_recording([rows(tmp_path / "log.csv", head, t, *f.T, *w.T)])


def test_a_clock_that_never_changes_is_none(tmp_path):
    """The time of a receiver without satellites is zero in each row: the rate of the rows is asked for, as without."""
    f, _ = at_rest(400)
    path = rows(tmp_path / "station.csv", "UTC,accelX,accelY,accelZ,payBay", np.zeros(400), *f.T, np.ones(400))
    with refused():
        propose_recording([path])
    found = propose_recording([path], rate=20.0)
    assert "UTC" in found.left_out
    assert found.recording.step == pytest.approx(0.05)


def test_a_fraction_of_a_second_may_stand_behind_a_third_colon(tmp_path):
    f, _ = at_rest(1200)
    t = np.arange(1200) / 200.0
    stamps = [f"14:45:{28 + int(s):02d}:{int(10 * (s % 1) + 1e-9)}" for s in t]
    found = propose_recording([rows(tmp_path / "watch.csv", "time,x,y,z", stamps, *f.T)])
    np.testing.assert_allclose(np.diff(found.recording.time), 1 / 200, rtol=1e-3)
    assert found.guesses["time"].unit == "s"


def test_an_axis_may_stand_between_other_words_and_its_sensor(tmp_path):
    """The gyroscopes of a receiver, logged z x y, were left out beside its accelerometers."""
    t, f, w = turned()
    head = "iTOW,EKF Raw Z Gyro,EKF Raw X Gyro,EKF Raw Y Gyro,EKF Raw X Accel,EKF Raw Y Accel,EKF Raw Z Accel"
    found = propose_recording([rows(tmp_path / "ekf.csv", head, t, *(w.T[[2, 0, 1]] * D), *f.T)])
    same(found, t, f, w)


def test_four_voltages_at_rest_are_no_accelerometers(tmp_path):
    """Three of the channels of a tilt meter are 0.71 V together, which was taken for 1 g."""
    rng = np.random.default_rng(4)
    volts = np.array([-0.028, -0.707, -0.103, -0.300]) + 1e-3 * rng.standard_normal((2000, 4))
    path = rows(tmp_path / "tilts.txt", "", np.arange(2000.0), *volts.T, mark=" ")
    with refused():
        propose_recording([path], rate=10.0)


@pytest.mark.parametrize(
    ("name", "guess"),
    [
        ("all_accel_2_x", ("specific_force", "x", "")),
        ("acc68Z", ("specific_force", "z", "")),
        ("gyro_1_y", ("angular_rate", "y", "")),
        ("bmi160_g_x[mDeg]", ("angular_rate", "x", "mdeg/s")),
        ("Gyro Z (deg)", ("angular_rate", "z", "deg/s")),
    ],
)
def test_the_number_of_a_unit_and_a_rate_without_its_seconds(name, guess):
    found = by_name(name)
    assert found is not None
    assert (found.quantity, found.axis, found.unit) == guess


def test_the_second_of_two_units_that_are_numbered_is_named(tmp_path):
    t, f, w = turned()
    head = "time,gyro_2_x,gyro_2_y,gyro_2_z,acc_2_x,acc_2_y,acc_2_z,acc_1_x,acc_1_y,acc_1_z"
    found = propose_recording([rows(tmp_path / "two.csv", head, t, *(w.T * D), *f.T, *f.T)])
    same(found, t, f, w)
    assert found.notes["further"].startswith("acc_1_x, acc_1_y, acc_1_z are of another unit")


def test_places_of_markers_that_are_lost_now_and_then_are_no_accelerometers(tmp_path):
    """An optical tracker writes zeros where it sees no marker, which is no direction that the marker turned to."""
    t = np.arange(900) / 300
    turned_by = np.radians(20 * np.sin(2 * np.pi * t))
    xyz = np.stack([-600 + 50 * np.cos(turned_by), -150 + 50 * np.sin(turned_by), np.full_like(t, 1726.0)])
    xyz = xyz + np.random.default_rng(2).normal(0, 0.02, (3, 900))
    lost = np.where(t < 0.5, 0.0, xyz)
    head = "Frame,Time,Arm - 1 X,Arm - 1 Y,Arm - 1 Z,Arm - 2 X,Arm - 2 Y,Arm - 2 Z"
    with refused():
        propose_recording([rows(tmp_path / "tracker.csv", head, np.arange(1.0, 901), t, *lost, *(xyz + 40.0))])


def test_motion_without_gravity_is_of_no_unit(tmp_path):
    """What a telephone calls its linear acceleration is 0.9 m/s^2 in most rows, and of no one length as gravity is."""
    rng = np.random.default_rng(5)
    f = 0.57 * rng.normal(size=(5000, 3)) * (1 + np.sin(np.arange(5000) / 300))[:, None]
    head = ",".join(f"Linear Acceleration {axis} (m/s^2)" for axis in "xyz")
    with refused():
        propose_recording([rows(tmp_path / "Accelerometer.csv", f"Time (s),{head}", np.arange(5000) / 220, *f.T)])


def test_seconds_since_1970_that_go_back_once_are_seconds(tmp_path):
    t = 1387624660.0 + 4 * np.arange(500)
    t[400:] -= 1500
    f, _ = at_rest(500)
    with refused():
        propose_recording([rows(tmp_path / "accel.csv", "UNIX_TIMESTAMP(ts),x,y,z", t, *f.T, cell="{:.12g}")])


def test_the_unit_of_a_clock_is_not_asked_for_where_the_rate_was_given(tmp_path):
    f, w = at_rest(160)
    found = propose_recording([rows(tmp_path / "short.csv", "ax,ay,az,gx,gy,gz", *f.T, *w.T)], rate=40.0)
    assert "time" not in found.notes.get("unit", "")


def test_the_index_of_a_data_frame_is_named_below_the_names_of_its_columns(tmp_path):
    t, f, w = turned()
    head = ",accel,accel,accel,gyro,gyro,gyro\n,x,y,z,x,y,z\ntime,,,,,,"
    found = propose_recording([rows(tmp_path / "frame.csv", head, t, *f.T, *w.T)])
    same(found, t, f, w)
    assert found.guesses["time"].why.startswith("its name")


def test_messages_of_ros_that_were_printed_are_a_table(tmp_path):
    t, f, w = turned()
    axes = "\n".join(f"  {a}: {{:.7g}}" for a in "xyz")
    message = (
        "header: \n  seq: {:.0f}\n  stamp: \n    secs: {:.0f}\n    nsecs: {:.0f}\n  frame_id: imu\n"
        f"angular_velocity: \n{axes}\nlinear_acceleration: \n{axes}\n"
        "linear_acceleration_covariance: [0.0, 0.0, 0.0]\n---\n"
    )
    whole, rest = np.divmod(np.round(1e9 * t), 1e9)
    each = zip(range(len(t)), 1.7e9 + whole, rest, *w.T, *f.T, strict=True)
    path = tmp_path / "echo.txt"
    path.write_text("".join(message.format(*row) for row in each), encoding="utf-8")
    same(propose_recording([path]), t, f, w)


def test_a_covariance_is_no_attitude(tmp_path):
    t, f, w = turned()
    head = "time,ax,ay,az,gx,gy,gz,orientation_covariance0,orientation_covariance1,orientation_covariance2"
    unit = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    found = propose_recording([rows(tmp_path / "ros.csv", f"{head},orientation_covariance3", t, *f.T, *w.T, *unit.T)])
    assert "attitude" not in found.notes


def test_a_magnetometer_without_names_is_no_table_that_turns_the_unit(tmp_path):
    """It turned by 9 deg where the gyroscopes felt 11, and one of its columns reads so in rad."""
    rng, t = np.random.default_rng(8), 0.01 * np.arange(4000)
    rate = np.where(t > 38, 0.15 * np.sin(np.pi * (t - 38) / 2), 0.0)
    heading = np.cumsum(rate) * 0.01
    force = rng.normal([0, 0, G], np.where(t > 38, 0.2, 0.02)[:, None], (len(t), 3))
    gyro = rng.normal(0, 0.01, (len(t), 3))
    gyro[:, 2] += rate
    field = 0.8 * np.stack([np.cos(heading), np.sin(heading), -0.7 + 0 * t], axis=1) + rng.normal(0, 1e-3, force.shape)
    made = rows(tmp_path / "mag.csv", "", t, *force.T, *gyro.T, *field.T)
    assert not propose_recording([made], units={"angular_rate": "rad/s"}).recording.platform.axes
    table = rows(tmp_path / "table.csv", "", t, *force.T, *gyro.T, heading + 1e-5 * rng.normal(0, 1, len(t)))
    assert propose_recording([table], units={"angular_rate": "rad/s"}).recording.platform.axes
