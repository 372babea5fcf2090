"""Telescope pointing runs and the tilt table: geometry and signs, on made files and on the real ones where they are."""

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE
from gimbalcal.errors import InputError
from gimbalcal.importers import import_files
from gimbalcal.importers.pointing_files import SIDEREAL_SECOND_S, sexagesimal
from gimbalcal.importers.tpoint import _joined_sexagesimal, equatorial
from gimbalcal.platform import KNOWN
from tests.golden import golden_text, refused
from tests.paths import REAL


def line_of_sight(declination, hour_angle, latitude):
    """North, east, down of a direction, from spherical astronomy (Smart, Spherical Astronomy, Sec. 33)."""
    d, h, f = declination, hour_angle, latitude
    up = np.sin(d) * np.sin(f) + np.cos(d) * np.cos(f) * np.cos(h)
    north = np.sin(d) * np.cos(f) - np.cos(d) * np.sin(f) * np.cos(h)
    east = -np.cos(d) * np.sin(h)
    return np.array([north, east, -up])


@pytest.mark.parametrize("latitude", [-0.6, 0.3, 1.2])
def test_the_equatorial_chain_is_spherical_astronomy(latitude):
    mount = equatorial(latitude)
    for declination, hour in [(0.2, 0.0), (1.1, 1.3), (-0.4, -2.0), (0.9, 3.0)]:
        sight = mount.attitude(np.array([declination, hour, 0.0]))[0]
        np.testing.assert_allclose(sight, line_of_sight(declination, hour, latitude), atol=1e-15)
        other_side = mount.attitude(np.array([np.pi - declination, hour + np.pi, 0.0]))[0]
        np.testing.assert_allclose(other_side, sight, atol=1e-15)


def test_sexagesimal_keeps_the_sign_of_minus_zero():
    assert sexagesimal(["-00", "30", "36"]) == pytest.approx(-0.51)
    assert sexagesimal(["+12", "15"]) == 12.25
    rows = np.array([[float("-00"), 30.0, 36.0], [float("+00"), 30.0, 36.0], [-12.0, 15.0, 0.0]])
    np.testing.assert_allclose(_joined_sexagesimal(rows), [-0.51, 0.51, -12.25])


def clock(hours):
    return f"{int(hours):02d} {60 * (hours - int(hours)):.5f}"


def hms(value):
    total = round(abs(value) * 3600 * 1e4)
    sign = "-" if value < 0 else "+"
    return f"{sign}{total // 36_000_000:02d} {total // 600_000 % 60:02d} {total % 600_000 / 1e4:.4f}"


def tpoint_file(path):
    """Three stars with encoder zeros of 0.5 deg in hour angle, 0.25 deg in declination; one on the other pier side."""
    lines = ["! made", "ASCOM Mount", ":NODA", ":EQUAT", "+39 00 26 2026 4 21 20.55 761.74 228.00 0.60 0.55 0.0065"]
    for lst, ra, dec, flip in [(23.5, 22.0, 30.0, False), (23.9, 23.0, -10.0, True), (0.2, 2.0, 70.0, False)]:
        mount_ra, mount_dec = ra - 0.5 / 15, dec + 0.25
        if flip:
            mount_ra, mount_dec = (ra + 12 - 0.5 / 15) % 24, 180 - dec + 0.25
        row = f"{hms(ra)[1:]} {hms(dec)} {hms(mount_ra)[1:]} {hms(mount_dec)}  {clock(lst)}"
        lines.append(row)
    path.write_text("\r\n".join([*lines, "END"]) + "\r\n")
    return path


def test_tpoint_both_sides_of_the_pier(tmp_path):
    run = import_files("tpoint", [tpoint_file(tmp_path / "run.dat")])
    assert run.kind == "pointing"
    assert run.site.height == 228.0
    assert np.degrees(run.site.latitude or 0.0) == pytest.approx(39 + 26 / 3600)
    for axis, zero in (("hour_angle", 0.5), ("declination", 0.25)):
        error = np.degrees(run.channels["gimbal_angle", axis] - run.channels["true_angle", axis])
        np.testing.assert_allclose(error, zero, atol=1e-6)  # the file holds 1e-4 s of hour angle and arc
    np.testing.assert_allclose(run.time, 3600 * SIDEREAL_SECOND_S * np.array([0.0, 0.4, 0.7]), atol=1e-6)


def test_tpoint_faults(tmp_path):
    text = tpoint_file(tmp_path / "run.dat").read_text()
    bad = tmp_path / "bad.dat"
    for old, new in [
        ("+30 00", "+3O 00"), ("23 30.00000", ""), ("+30 00", "+30.5 00"), ("+30 00", "+30 70"),
        ("23 30.00000", "233 30.00000"), ("23 54.00000", "22 54.00000"),
    ]:  # fmt: skip
        assert old in text
        bad.write_text(text.replace(old, new, 1))
        with refused():
            import_files("tpoint", [bad])
    bad.write_text("nothing\n")
    with refused():
        import_files("tpoint", [bad])


def test_stars_below_the_end_of_a_tpoint_file_are_not_passed_over(tmp_path):
    lines = tpoint_file(tmp_path / "run.dat").read_text().splitlines()
    (tmp_path / "bad.dat").write_text("\n".join([*lines[:6], "END", *lines[6:]]))
    with pytest.raises(InputError, match="line 8: a star stands below the END of line 7"):
        import_files("tpoint", [tmp_path / "bad.dat"])


JCMT = """\
JCMT Pointing Test - 2009/01/28
: ALTAZ
! a remark
+19 49 22.30  2009 01 29    -2.25  621.00   4120.00   0.827   866.963
{stars}
"""


def ra_dec(elevation, azimuth, latitude, lst):
    """Right ascension [h] and declination [deg] of a direction [deg], by the axes of the horizon and of the pole."""
    E, A, L = np.radians([elevation, azimuth, latitude])
    sight = np.array([np.cos(E) * np.cos(A), np.cos(E) * np.sin(A), np.sin(E)])  # north, east, up
    pole = np.array([np.cos(L), 0, np.sin(L)])
    meridian = np.array([-np.sin(L), 0, np.cos(L)])
    hour = np.degrees(np.arctan2(-sight[1], sight @ meridian))
    return (lst - hour / 15) % 24, float(np.degrees(np.arcsin(sight @ pole)))


def test_tpoint_alt_az_by_catalogue_places_with_names_behind_them(tmp_path):
    latitude, lines = 19 + 49 / 60 + 22.3 / 3600, []
    sky = [(40.0, 100.0, 8.2), (65.0, 220.0, 8.2), (30.0, 355.0, 9.5)]  # two stars of one stamp
    for elevation, azimuth, lst in sky:
        places = [ra_dec(elevation + off, azimuth - 2 * off, latitude, lst) for off in (0.0, 0.02)]
        words = [f"{hms(ra)[1:]} {hms(dec)}" for ra, dec in places]
        lines.append(f"{words[0]}  {words[1]}  {clock(lst)}  4.760  108.775 HARPB 0.00")
    (tmp_path / "run.pnt").write_text(JCMT.format(stars="\n".join(lines)))
    run = import_files("tpoint", [tmp_path / "run.pnt"])
    assert run.platform == KNOWN["alt-az"]
    assert run.site.height == 4120.0
    true = np.degrees(np.stack([run.channels["true_angle", a] for a in ("elevation", "azimuth")], axis=1))
    np.testing.assert_allclose(true % 360, [s[:2] for s in sky], atol=1e-6)
    error = np.degrees(run.angles()) - true
    np.testing.assert_allclose(error, np.tile([0.02, -0.04], (3, 1)), atol=1e-6)
    assert run.time[1] == run.time[0]


def test_tpoint_raises_catalogue_places_by_refraction_where_it_is_asked(tmp_path):
    latitude, lst = 19 + 49 / 60 + 22.3 / 3600, 8.2
    seen, lines = np.array([[45.0, 100.0], [20.0, 300.0]]), []
    for elevation, azimuth in seen:
        words = [f"{hms(ra)[1:]} {hms(dec)}" for ra, dec in [ra_dec(elevation, azimuth, latitude, lst)] * 2]
        lines.append(f"{words[0]}  {words[1]}  {clock(lst)}")
    path = tmp_path / "run.pnt"
    path.write_text(JCMT.format(stars="\n".join(lines)))
    lifted = []
    for name in ("altaz", "equat"):
        plain, raised = (import_files("tpoint", [path], {"refraction": r}) for r in ("no", "yes"))
        towards = [r.platform.attitude(np.column_stack([r.channels["true_angle", a] for a in r.axes("true_angle")]
                   + [np.zeros(2)] * (name == "equat")))[:, 0] for r in (plain, raised)]  # fmt: skip
        up = [np.degrees(np.arcsin(-t[:, 2])) for t in towards]
        lifted.append(3600 * (up[1] - up[0]))
        np.testing.assert_allclose(up[0], seen[:, 0], atol=1e-5)
        path.write_text(path.read_text().replace(": ALTAZ", ": EQUAT"))
    air = 621 / 1010 * 283 / (273 - 2.25)
    np.testing.assert_allclose(lifted[0], 60.0 * air * np.array([1.0127, 2.7413]), rtol=1e-3)  # arcmin
    np.testing.assert_allclose(lifted[1], lifted[0], atol=1e-6)
    with refused():
        import_files("tpoint", [path], {"refraction": "maybe"})
    path.write_text(FORMAT_4)
    with refused():
        import_files("tpoint", [path], {"refraction": "yes"})


FORMAT_4 = """\
! made
MMT Pointing Data
: ALTAZ
+31 41 19.6 2021 8 21 13.0 741 2608.0 0.75
192.4 77.3 -167.3 77.5
-20.0 30.0 -19.5 30.1
END
"""


def test_tpoint_lines_of_angles_count_azimuth_from_south_through_east_and_have_no_clock(tmp_path):
    path = tmp_path / "run.dat"
    path.write_text(FORMAT_4)
    run = import_files("tpoint", [path])
    azimuth = np.degrees(run.channels["true_angle", "azimuth"])
    np.testing.assert_allclose(azimuth, [-12.4, -160.0], atol=1e-9)  # beside north, and beyond south
    np.testing.assert_allclose(
        np.degrees(run.channels["gimbal_angle", "azimuth"] - azimuth * np.pi / 180), [-0.3, -0.5]
    )
    np.testing.assert_allclose(np.degrees(run.channels["gimbal_angle", "elevation"]), [77.5, 30.1])
    golden_text(run.remarks[0])
    north = import_files("tpoint", [path], {"azimuth": "north"})
    np.testing.assert_allclose(np.degrees(north.channels["true_angle", "azimuth"]) % 360, [192.4, 340.0])
    with refused():
        import_files("tpoint", [path], {"azimuth": "west"})
    path.write_text(FORMAT_4.replace(": ALTAZ\n", ""))
    with_hours = import_files("tpoint", [path])
    assert with_hours.platform.name == "equatorial"
    path.write_text(FORMAT_4.replace("-20.0 30.0 -19.5 30.1", "22 00 00.0 +30 00 00.0 22 00 01.0 +30 00 00.0 12 00.0"))
    with refused():
        import_files("tpoint", [path])


def test_a_sidereal_time_that_falls_back_by_hours_is_the_night_after(tmp_path):
    path = tpoint_file(tmp_path / "run.dat")
    path.write_text(path.read_text().replace(clock(0.2), clock(20.5)))  # after 23.5, 23.9
    run = import_files("tpoint", [path])
    np.testing.assert_allclose(run.time, 3600 * SIDEREAL_SECOND_S * np.array([0.0, 0.4, 21.0]), atol=1e-6)
    golden_text(run.remarks[0])


COLUMNS = (
    "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration,"
    "RADirection,DECDuration,DECDirection"
)


def guided(path, error, off, tail=""):
    """A PHD2 log at 1 Hz of a mount that errs by `error` in hour angle and `off` in declination [arcsec], guided."""
    scale, rate, dec = 2.0, 3.0, 60.0  # arcsec/px, px/s of sky
    head = ["PHD2 version 2.6", "", "Guiding Begins at 2022-12-01 20:00:00", f"Pixel scale = {scale:.2f} arc-sec/px",
            f"Mount = m, connected, xAngle = 1.0, xRate = {rate:.3f}, yAngle = 2.0, yRate = {rate:.3f}",
            "Norm rates RA = 7.2\"/s @ dec 0, Dec = 7.4\"/s; ortho.err. = 0.4 deg",
            "Cal Dec = 0.0, Dec Guide Speed = 7.5",
            f"RA = 5.5 hr, Dec = {dec:.1f} deg, Hour angle = -2.00 hr, Pier side = East, Alt = N/A deg",
            COLUMNS]  # fmt: skip
    rows, west, north = [], 0.0, 0.0  # what pulses have moved so far, px
    for k, (e, o) in enumerate(zip(error, off, strict=True)):
        d, n = -(e * np.cos(np.radians(dec)) / scale + west), o / scale + north
        p, q = (round(1000 * min(abs(x) / rate, 0.5)) for x in (d, n))
        to, up = ("W" if d > 0 else "E"), ("S" if n > 0 else "N")
        rows.append(f'{k + 1},{float(k):.3f},"Mount",0,0,{d:.6f},{n:.6f},{d:.3f},{n:.3f},{p},{to},{q},{up}')
        west += rate * p / 1000 * (1 if to == "W" else -1)
        north += rate * q / 1000 * (1 if up == "N" else -1)
    path.write_text("\n".join([*head, *rows, 'x,"DROP",,,,', tail, "Guiding Ends at 2022-12-01 21:00:00"]) + "\n")
    return path


def test_phd2_undoes_the_guiding(tmp_path):
    t = np.arange(300.0)
    error, off = 6 * np.sin(2 * np.pi * t / 120), 0.02 * t
    run = import_files("phd2", [guided(tmp_path / "log.txt", error, off)], {"latitude": "51"})
    left = {a: run.channels["true_angle", a] - run.channels["gimbal_angle", a] for a in ("hour_angle", "declination")}
    np.testing.assert_allclose(np.degrees(left["hour_angle"]) * 3600, error, atol=1e-4)  # the log has 1e-6 px
    np.testing.assert_allclose(np.degrees(left["declination"]) * 3600, off, atol=1e-4)
    assert np.degrees(run.channels["gimbal_angle", "hour_angle"][0]) == pytest.approx(-30.0)
    np.testing.assert_allclose(np.diff(run.channels["gimbal_angle", "hour_angle"]), 7.292115e-5)
    golden_text(run.remarks[0])


def test_phd2_latitude_is_that_of_the_directions_in_the_log(tmp_path):
    """The declination of a calibration and of the guide rates stand in the header, too, and are no directions."""
    log = guided(tmp_path / "log.txt", np.zeros(30), np.ones(30))
    for latitude in (35.14, -33.0):
        north, east, down = line_of_sight(np.radians(60.0), np.radians(-30.0), np.radians(latitude))
        elevation, around = np.degrees(np.arcsin(-down)), np.degrees(np.arctan2(east, north)) % 360
        text = log.read_text().partition("Alt = ")[0] + f"Alt = {elevation:.1f} deg, Az = {around:.1f} deg\n"
        both = tmp_path / "both.txt"
        both.write_text(text + log.read_text().partition("Alt = N/A deg\n")[2])
        run = import_files("phd2", [both])
        assert run.site.latitude is not None
        assert np.degrees(run.site.latitude) == pytest.approx(latitude, abs=0.15)
        assert "latitude of" in run.remarks[0]


@pytest.mark.parametrize(
    "direction",
    [
        "Dec = 80.0 deg, Hour angle = 0.00 hr, Alt = 60.0 deg, Az = 180.0 deg",  # beyond the pole
        "Dec = 0.0 deg, Hour angle = 0.00 hr, Alt = 0.0 deg, Az = 0.0 deg",  # a mount that knows none
        "Dec = 0.0 deg, Hour angle = 5.95 hr, Alt = 0.5 deg, Az = 269.4 deg",  # off the meridian by nearly 90 deg
        "Dec = 60.0 deg, Hour angle = -2.00 hr, Alt = 71.0 deg, Az = 62.0 deg",  # off by an angle in azimuth only
        "Dec = 20.0 deg, Hour angle = -3.00 hr, Alt = 43.2 deg, Az = 294.4 deg",  # azimuth from south, at 51 deg
        "Dec = 20.0 deg, Hour angle = 0.00 hr, Alt = 59.0 deg, Az = 180.0 deg",  # at 51 deg, or at -11 from south
    ],
)
def test_phd2_directions_that_show_no_latitude_are_not_taken_for_one(tmp_path, direction):
    log = guided(tmp_path / "log.txt", np.zeros(30), np.ones(30))
    log.write_text("".join(
        f"RA = 5.5 hr, {direction}\n" if line.startswith("RA = ") else line
        for line in log.read_text().splitlines(keepends=True)
    ))  # fmt: skip
    with pytest.raises(InputError, match=r"say where the mount stood.*new LOG --latitude"):
        import_files("phd2", [log])
    run = import_files("phd2", [log], {"latitude": "51"})
    assert run.site.latitude == pytest.approx(np.radians(51.0))


def test_phd2_faults(tmp_path):
    log = guided(tmp_path / "log.txt", np.zeros(30), np.ones(30))
    with refused():
        import_files("phd2", [log])
    with refused():
        import_files("phd2", [log], {"latitude": "51", "stretch": "2"})
    told = log.read_text().replace("Hour angle = -2.00 hr", "Hour angle = N/A hr")
    log.write_text(told)
    with refused():
        import_files("phd2", [log], {"latitude": "51"})
    north, east, down = line_of_sight(np.radians(60.0), np.radians(-30.0), np.radians(51.0))
    elevation, around = np.degrees(np.arcsin(-down)), np.degrees(np.arctan2(east, north))
    log.write_text(told.replace("Alt = N/A deg", f"Alt = {elevation:.9f} deg, Az = {around:.9f} deg"))
    made = import_files("phd2", [log], {"latitude": "51"})
    assert np.degrees(made.channels["gimbal_angle", "hour_angle"][0]) == pytest.approx(-30.0, abs=1e-6)
    log.write_text(log.read_text().replace("Pixel scale", "Scale"))
    with refused():
        import_files("phd2", [log], {"latitude": "51"})
    log.write_text("nothing\n")
    with refused():
        import_files("phd2", [log], {"latitude": "51"})


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('3,2.000,"Mount",0,0,', '3,2.000,"Mount",0,0,nan'),
        ('3,2.000,"Mount"', '3,2.000,"Moumt"'),
        ('3,2.000,"Mount"', 'e,2.000,"Mount"'),
        ("3,2.000,", "3,0.500,"),
        (",E,", ",Q,"),
        ("Pixel scale = 2.00", "Pixel scale = 2,00"),
        ("Dec = 60.0 deg", "Dec = 160.0 deg"),
    ],
)
def test_a_slip_in_a_phd2_log_drops_no_frame_and_no_pulse(tmp_path, old, new):
    log = guided(tmp_path / "log.txt", np.zeros(30), np.ones(30))
    assert old in log.read_text()
    log.write_text(log.read_text().replace(old, new, 1))
    with refused():
        import_files("phd2", [log], {"latitude": "51"})


def test_frames_missing_from_a_phd2_log_are_told(tmp_path):
    log = guided(tmp_path / "log.txt", np.zeros(30), np.ones(30))
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(line for line in lines if not line.startswith("7,")))
    run = import_files("phd2", [log], {"latitude": "51"})
    assert len(run.time) == 29
    golden_text(run.remarks[1])


def test_phd2_ends_a_stretch_where_the_lock_position_is_moved(tmp_path):
    row = '{},{}.0,"Mount",0,0,0.1,0.2,0,0,0,,0,'
    tail = "\n".join(["INFO: DITHER by 1.0, -2.0, new lock pos = 3, 4", *(row.format(k, k) for k in range(40, 60))])
    log = guided(tmp_path / "log.txt", np.zeros(15), np.zeros(15), tail)
    run = import_files("phd2", [log], {"latitude": "51", "stretch": "2"})
    assert len(run.time) == 20
    golden_text(run.remarks[0])
    both = import_files("phd2", [log], {"latitude": "51"})
    assert both.position.tolist() == [1] * 15 + [2] * 20
    np.testing.assert_allclose(both.time[15:] - both.time[15], run.time, atol=1e-12)
    np.testing.assert_allclose(np.diff(both.angles()[:, 1]), EARTH_RATE * np.diff(both.time), rtol=1e-9)
    golden_text(both.remarks[0])


MMT = """\
CAT: FK5-0711        18:55:20.111 +43:56:45.99 +00.214 +008.25  3.9  M3  J2000.0
RAA:   77.25  347.25
AA:   77.3415298  347.6316356
TAA:   77.00  -12.00
ABS_AA:   77.3485761  -12.3859689
LST: 23:30:00.000
RAA:   17.50  200.00
TAA:   17.25 -159.25
LST: 00:30:00.000
"""


def test_mmt(tmp_path):
    (tmp_path / "run.dat").write_text(MMT)
    run = import_files("mmt", [tmp_path / "run.dat"])
    assert run.platform.axis_names == ("elevation", "azimuth")
    np.testing.assert_allclose(np.degrees(run.angles()), [[77.25, 347.25], [17.5, 200.0]], rtol=1e-14)
    error = {
        a: np.degrees(run.channels["gimbal_angle", a] - run.channels["true_angle", a]) for a in run.axes("true_angle")
    }
    np.testing.assert_allclose(error["elevation"], 0.25, atol=1e-12)
    np.testing.assert_allclose(error["azimuth"], -0.75, atol=1e-12)
    np.testing.assert_allclose(run.time, [0.0, 3600 * SIDEREAL_SECOND_S], rtol=1e-15)


def test_mmt_faults(tmp_path):
    path = tmp_path / "run.dat"
    path.write_text(MMT.replace("TAA:   17.25 -159.25\n", ""))
    with refused():
        import_files("mmt", [path])
    path.write_text(MMT.replace("17.50", "----"))
    with refused():
        import_files("mmt", [path])
    path.write_text(MMT.replace("-159.25", ""))
    with refused():
        import_files("mmt", [path])


def test_tilt_table_sees_gravity_with_the_right_sign(tmp_path):
    rate = 200.0
    time = np.arange(4000) / rate
    tilt = 1e-3 * np.sin(0.5 * time)  # about east, rad
    silent = 1e-9 * np.random.default_rng(1).standard_normal(len(time))
    velocity = np.cumsum(9.81 * tilt) / rate
    np.savez(
        tmp_path / "t.npz", fs=[rate], vel_HHN=velocity, vel_HHE=silent, vel_HHZ=velocity, rate_HJN=silent,
        rate_HJE=np.gradient(tilt, time), rate_HJZ=silent + 1e-3,
    )  # fmt: skip
    run = import_files("tilt-table", [tmp_path / "t.npz"])
    assert run.kind == "rotation"
    # f = a - g: the x axis that rises by a turn about y reads +g times the angle; z is down, the seismometer's is up.
    np.testing.assert_allclose(run.channels["specific_force", "x"][2:-2], 9.81 * tilt[2:-2], atol=1e-4)
    np.testing.assert_allclose(run.channels["specific_force", "z"], -run.channels["specific_force", "x"], rtol=1e-15)
    np.testing.assert_allclose(run.channels["angular_rate", "z"], -silent - 1e-3, rtol=1e-15)
    (tmp_path / "t.npz").write_bytes(b"PK not really")
    with refused():
        import_files("tilt-table", [tmp_path / "t.npz"])


# --- the real files ---------------------------------------------------------------------------------------------------


def real(name):
    path = REAL / name
    if not path.is_file():
        pytest.skip(f"{path} is not on this machine")
    return path


def test_real_mmt_run():
    run = import_files("mmt", [real("mmt_pointing/point_20210821.dat")])
    assert len(run.time) == 80
    for axis, largest in (("elevation", 0.5), ("azimuth", 4.0)):  # arcmin about the encoder's zero
        error = np.degrees(run.channels["gimbal_angle", axis] - run.channels["true_angle", axis]) * 60
        assert np.abs(error - np.median(error)).max() < largest


@pytest.mark.parametrize(("name", "stars"), [("cgx-l-data.dat", 148), ("warp-astron.dat", 98)])
def test_real_amateur_mounts(name, stars):
    run = import_files("tpoint", [real(f"gem_mount_pointing/{name}")])
    assert len(run.time) == stars
    up = -run.platform.attitude(run.angles())[:, 0, 2]
    assert np.degrees(np.arcsin(up)).min() > 15.0  # nobody observes below the trees
    assert np.abs(run.channels["gimbal_angle", "declination"] - run.channels["true_angle", "declination"]).max() < 0.04


def test_real_tilt_table_tilts_north_about_east():
    run = import_files("tilt-table", [real("tilt_table/tilt_table_200hz.npz")])
    angle = np.cumsum(run.channels["angular_rate", "y"]) / 200.0
    slope = np.polyfit(angle, run.channels["specific_force", "x"], 1)[0]
    assert slope == pytest.approx(9.81, rel=0.05)  # m/s^2 per rad: gravity leaks in; the lever arm is the rest


def test_real_mikoff_rests():
    run = import_files("mikoff", [real("mikoff_mpu9150/imu0.log")])
    assert 18 <= run.position.max() <= 23  # 18 poses are meant; some are left and taken up again
