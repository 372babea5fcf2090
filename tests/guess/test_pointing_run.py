"""Pointing runs that nobody described: layouts, units, sexagesimal cells, offsets either way, the words of the file."""

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.guess.proposal import propose_recording
from tests.golden import golden_text, refused

ARCSEC = np.pi / 648000
RNG = np.random.default_rng(7)
AZ, EL = RNG.uniform(0, 360, 30), RNG.uniform(15, 80, 30)
OFF = RNG.normal(0, 60, (2, 30)).round(2)  # arcsec, readout minus truth: azimuth, elevation


def sexagesimal(x):
    total = round(abs(x) * 36000)
    return f"{'-' if x < 0 else '+'}{total // 36000:02d}:{total // 600 % 60:02d}:{total % 600 / 10:04.1f}"


def write(path, head, *columns, mark=",", cell="{:.6f}"):
    rows = [mark.join(x if isinstance(x, str) else cell.format(x) for x in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def off(r, axis):
    """Readout minus truth [arcsec]."""
    return np.asarray((r.channels["gimbal_angle", axis] - r.channels["true_angle", axis]) / ARCSEC)


def agrees(r, sign=1.0, atol=0.02):
    assert (r.kind, r.platform.name, len(r.time)) == ("pointing", "alt-az", 30)
    np.testing.assert_allclose(off(r, "azimuth"), sign * OFF[0], atol=atol)
    np.testing.assert_allclose(off(r, "elevation"), sign * OFF[1], atol=atol)


def test_both_angles_in_degrees_and_in_any_order(tmp_path):
    names = "Az encoder (deg),El encoder (deg),Az target (deg),El target (deg)"
    agrees(
        propose_recording([write(tmp_path / "a.csv", names, AZ + OFF[0] / 3600, EL + OFF[1] / 3600, AZ, EL)]).recording
    )
    wrapped = write(
        tmp_path / "b.csv", "az_cmd,el_cmd,az_meas,el_meas", AZ, EL, (AZ + OFF[0] / 3600) % 360, EL + OFF[1] / 3600
    )
    agrees(propose_recording([wrapped]).recording)


def test_sexagesimal_cells_and_dates(tmp_path):
    time = [f"2026-11-03T{18 + k // 20:02d}:{3 * k % 60:02d}:00" for k in range(30)]
    cells = [[sexagesimal(v) for v in x] for x in (AZ, EL, AZ + OFF[0] / 3600, EL + OFF[1] / 3600)]
    found = propose_recording([write(tmp_path / "c.csv", "UTC;Az soll;El soll;Az ist;El ist", time, *cells, mark=";")])
    agrees(found.recording, atol=0.2)
    assert np.diff(found.recording.time)[0] == pytest.approx(180)


def test_offsets_follow_the_words_of_the_file(tmp_path):
    head = "# antenna\n# offsets: {}, arcsec\n# time[s] az[deg] el[deg] daz[arcsec] del[arcsec]"
    t = 60.0 * np.arange(30)
    for words, sign in (("measured minus commanded", 1.0), ("commanded - measured", -1.0)):
        found = propose_recording([write(tmp_path / "d.txt", head.format(words), t, AZ, EL, *OFF, mark=" ")])
        agrees(found.recording, sign)
        golden_text(found.notes["sign"])
    silent = propose_recording([write(tmp_path / "e.csv", "Az,El,dAz,dEl", AZ, EL, *OFF)])
    agrees(silent.recording)
    golden_text(silent.notes["sign"])
    golden_text(silent.notes["unit"])


def test_two_places_that_do_not_go_together_are_no_star_and_readout(tmp_path):
    """Where the telescope looked stands beside where the Sun was."""
    sun = RNG.uniform(0, 360, 30), RNG.uniform(-40, 60, 30)
    head = "Elevation,Azimuth,Elevation Sun,Azimuth Sun"
    with pytest.raises(InputError, match="Elevation and Elevation Sun do not go together"):
        propose_recording([write(tmp_path / "s.csv", head, EL, AZ, sun[1], sun[0])])
    turned = write(tmp_path / "t.csv", "Elevation,Azimuth,Elevation 2,Azimuth 2", EL, AZ, EL + 0.1, 350 - AZ)
    assert len(propose_recording([turned]).recording.time) == 30


def test_angles_of_a_mount_that_stand_once_are_refused_for_that(tmp_path):
    with refused():
        propose_recording([write(tmp_path / "o.csv", "Az,El,CCDXerror,CCDYerror", AZ, EL, *OFF)], rate=1.0)


def test_rows_that_follow_a_star_are_one_sighting(tmp_path):
    """A mount follows each of 30 stars for 20 rows: what it is off there is one number, not twenty."""
    along = np.tile(0.004 * np.arange(20), 30)
    az, el, daz, de = (np.repeat(x, 20) for x in (AZ, EL, *OFF))
    path = write(tmp_path / "r.csv", "az_obs,el_obs,az_residual [arcsec],el_residual [arcsec]", az + along, el, daz, de)
    found = propose_recording([path])
    agrees(found.recording)
    assert found.recording.weight.tolist() == [1.0] * 30
    golden_text(found.notes["samples"])


def test_offsets_on_the_sky_turn_the_axis_further(tmp_path):
    sky = OFF[0] * np.cos(np.radians(EL))
    found = propose_recording(
        [write(tmp_path / "f.csv", "Az,El,xel_off [arcsec],el_off [arcsec]", AZ, EL, sky, OFF[1])]
    )
    agrees(found.recording)
    golden_text(found.notes["sky"])


def test_an_offset_of_the_axis_is_taken_beside_the_same_on_the_sky(tmp_path):
    sky = OFF[0] * np.cos(np.radians(EL))
    head = "Az,El,az_error [arcsec],az_error_sky [arcsec],el_error [arcsec]"
    agrees(propose_recording([write(tmp_path / "s.csv", head, AZ, EL, OFF[0], sky, OFF[1])]).recording)


def test_an_axis_has_the_clock_of_the_controller_that_exported_it(tmp_path):
    ticks, angle = 132907960342450000 + 100_000 * np.arange(300), np.linspace(0, 300, 300)
    cells = [str(t) for t in ticks]
    path = write(
        tmp_path / "axis.csv", "Name;Position (Counter);Position (Resolver)", cells, angle, angle + 0.1, mark=";"
    )
    found = propose_recording([path]).recording
    np.testing.assert_allclose(found.time - found.time[0], 0.01 * np.arange(300), atol=1e-5)


@pytest.mark.parametrize("head", ["Angle (deg),Voltage [V]", "adc counts,theta"])
def test_a_signal_beside_an_angle_by_name_is_read_along_its_line(tmp_path, head):
    angle = np.linspace(-60.0, 60.0, 61)
    signal = 2.5 + 0.03 * angle + 0.1 * np.sin(np.radians(3 * angle))
    columns = (angle, signal) if head.startswith("Angle") else (signal, angle)
    made = propose_recording([write(tmp_path / "s.csv", head, *columns)])
    run = made.recording
    axis = run.platform.axes[0].name
    np.testing.assert_allclose(np.degrees(run.channels["true_angle", axis]), angle, atol=1e-6)
    line = np.polyval(np.polyfit(signal, angle, 1), signal)
    np.testing.assert_allclose(np.degrees(run.channels["gimbal_angle", axis]), line, atol=1e-3)
    golden_text(next(g.why for g in made.guesses.values() if g.quantity == "gimbal_angle"))


def test_two_columns_without_names_of_other_scales_are_not_both_angles(tmp_path):
    command = np.linspace(-700.0, 700.0, 200)
    with refused():
        propose_recording([write(tmp_path / "t.csv", "-710.0,845.0", command, np.round(2100 + 1.77 * command))])
    path = write(tmp_path / "mm.csv", "", command + 1000, np.round(1.002 * command + 1000))
    with refused():  # a way in mm
        propose_recording([path])
    path = write(tmp_path / "deg.csv", "cmd_deg,meas_deg", command + 1000, np.round(1.002 * command + 1000))
    assert propose_recording([path]).recording.channels["true_angle", "table"].max() > np.radians(1600)
    with refused():  # before a gear and behind it
        propose_recording([write(tmp_path / "g.csv", "imu_pitch_deg,motor_pitch_pos_deg", command / 20, command)])
    with refused():  # a place, in m
        propose_recording([write(tmp_path / "p.csv", "", -532700.0 + command, -6305509.0 - command)])
    with refused():  # the height of a tripod and the pressure of the air, at three stations
        station = np.array([335.0, 374.0, 326.0])[np.arange(80) // 27]
        path = write(tmp_path / "s.csv", "", RNG.normal(0, 1, 80), station, 1000.0 - 0.49 * (station - 335.0))
        propose_recording([path], rate=1)
    run = propose_recording(
        [write(tmp_path / "u.csv", "axis_deg,axis_rad", command, np.radians(command + 1))]
    ).recording
    turned = run.channels["true_angle", "table"] - run.channels["gimbal_angle", "table"]
    np.testing.assert_allclose(np.degrees(turned), 1.0, atol=1e-3)


def test_a_current_beside_a_torque_is_no_angle(tmp_path):
    x = np.linspace(0.0, 1.0, 30)
    with refused():
        propose_recording([write(tmp_path / "m.csv", "current,torque", x, 2 * x + 0.01 * x**2)])


def test_two_of_three_axes_that_go_together_are_no_axis_with_its_measurement(tmp_path):
    """Rates of a unit that is turned about z leak into x: two columns that go together."""
    z = np.repeat(RNG.uniform(0, 90, 20), 30)
    path = write(tmp_path / "log.csv", "X, Y, Z", -0.026 * z, RNG.normal(0, 0.1, 600), z)
    with pytest.raises(InputError, match="no column is a clock"):
        propose_recording([path])


def test_an_equatorial_mount_needs_its_latitude(tmp_path):
    hour, dec = RNG.uniform(-5, 5, 30), RNG.uniform(-10, 70, 30)
    columns = (hour, dec, hour + OFF[0] / 54000, dec + OFF[1] / 3600)
    path = write(tmp_path / "g.csv", "HA,Dec,HA obs,Dec obs", *columns, cell="{:.8f}")
    with refused():
        propose_recording([path])
    found = propose_recording([path], latitude=39.0)
    assert found.recording.platform.name == "equatorial"
    golden_text(found.notes["hours"])
    np.testing.assert_allclose(off(found.recording, "hour_angle"), OFF[0], atol=0.02)
    text = [[sexagesimal(v) for v in x] for x in columns]
    told = propose_recording([write(tmp_path / "h.csv", "# latitude 39.0 deg\nHA;Dec;HA obs;Dec obs", *text, mark=";")])
    np.testing.assert_allclose(off(told.recording, "hour_angle"), OFF[0], atol=1.5)
    assert told.recording.site.latitude == pytest.approx(np.radians(39.0))


def equatorial_run(tmp_path, hour, declination, read_hour, read_declination):
    """The offsets [arcsec] of a mount whose readouts [deg] are off by `OFF` as well."""
    read = read_hour + OFF[0] / 3600, read_declination + OFF[1] / 3600
    names = "ha_cat [deg],dec_cat,ha_mount [deg],dec_mount"
    r = propose_recording(
        [write(tmp_path / "a.csv", names, hour, declination, *read, cell="{:.8f}")], latitude=48.0
    ).recording
    return off(r, "hour_angle"), off(r, "declination")


@pytest.mark.parametrize("turns", [0, -1])
def test_a_readout_of_the_declination_beyond_the_pole_is_the_other_side_of_the_pier(tmp_path, turns):
    """Half of the stars, at h + 180 deg and 180 deg - delta, on an axis that may count from a turn lower."""
    hour, declination, other = np.linspace(-50, 50, 30), np.linspace(20, -60, 30), np.arange(30) % 2 == 0
    beyond = 180 - declination + 360 * turns
    found = equatorial_run(
        tmp_path, hour, declination, np.where(other, hour + 180, hour), np.where(other, beyond, declination)
    )
    np.testing.assert_allclose(found, OFF, atol=0.02)


def test_an_encoder_of_the_declination_with_any_zero_exchanges_no_side(tmp_path):
    hour, declination = np.linspace(-50, 50, 30), np.linspace(-20, 70, 30)
    found = equatorial_run(tmp_path, hour, declination, hour, declination + 60)
    np.testing.assert_allclose(found, [OFF[0], OFF[1] + 60 * 3600], atol=0.02)


def test_a_tpoint_file_is_known_by_its_form_and_a_latitude_may_be_its_whole_site(tmp_path):
    path = tmp_path / "t.dat"
    stars = "\n".join(f"{(180 - a) % 360:.6f} {e:.6f} {(180 - a - x / 3600) % 360:.6f} {e + y / 3600:.6f}"
                      for a, e, x, y in zip(AZ, EL, *OFF, strict=True))  # fmt: skip
    path.write_text(f"caption\n:ALTAZ\n39 00 26\n{stars}\nEND\n")
    found = propose_recording([path])
    agrees(found.recording)
    assert "TPOINT" in found.notes["kind"]
    golden_text(found.recording.remarks[1])


def test_a_tpoint_file_with_a_fault_is_refused_for_that_fault(tmp_path):
    path = tmp_path / "t.dat"
    path.write_text("caption\n: ALTAZ\n39 00 26\n10.1 40.2 10.2 40.3\n....\n20.1 50.2 20.2 50.3\nEND\n")
    with refused():
        propose_recording([path])


def test_a_mount_may_be_logged_into_one_file_for_each_channel(tmp_path):
    columns = {"az_obs": AZ, "el_obs": EL, "az_residual": OFF[0] / 3600, "el_residual": OFF[1] / 3600}
    paths = [tmp_path / f"{name}.csv" for name in columns]
    for path, x in zip(paths, columns.values(), strict=True):
        np.savetxt(path, x)
    agrees(propose_recording(paths).recording)
    paths[0].write_text("az\n" + paths[0].read_text())
    with refused():
        propose_recording(paths)


def test_two_columns_without_names_that_go_together_among_others_are_not_taken_for_an_axis(tmp_path):
    """The heading of a unit by two filters, behind its accelerometers."""
    yaw = np.cumsum(RNG.normal(0, 1, 400))
    path = tmp_path / "log.txt"
    path.write_text("".join(
        f"{a:.2f} {b:.2f} {c:.2f} Quat Yaw: {y:.2f} Yaw: {y + n:.2f}\n"
        for a, b, c, y, n in zip(*RNG.normal(0, 1, (3, 400)), yaw, RNG.normal(0, 0.1, 400), strict=True)
    ))  # fmt: skip
    with refused():
        propose_recording([path])


def test_the_command_writes_a_run_and_its_picture(command, tmp_path):
    path = write(tmp_path / "run.csv", "az_true,el_true,az_enc,el_enc", AZ, EL, AZ + OFF[0] / 3600, EL + OFF[1] / 3600)
    assert command("new", path, "--out", tmp_path / "run", "--quiet") == 0
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["recording.toml", "samples.csv", "stars.html"]
    assert "each twice" in (tmp_path / "run" / "recording.toml").read_text()
