"""Telescope pointing runs and the tilt table: geometry and signs, on made files and on the real ones where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.importers import import_files
from gimbalcal.importers.pointing import SIDEREAL_SECOND, sexagesimal
from gimbalcal.importers.tpoint import equatorial
from gimbalcal.number import Array

REAL = Path(__file__).parents[3] / "shared" / "data"


def line_of_sight(declination: float, hour_angle: float, latitude: float) -> Array:
    """North, east, down of a direction, from spherical astronomy (Smart, Spherical Astronomy, Sec. 33)."""
    d, h, f = declination, hour_angle, latitude
    up = np.sin(d) * np.sin(f) + np.cos(d) * np.cos(f) * np.cos(h)
    north = np.sin(d) * np.cos(f) - np.cos(d) * np.sin(f) * np.cos(h)
    east = -np.cos(d) * np.sin(h)
    return np.array([north, east, -up])


@pytest.mark.parametrize("latitude", [-0.6, 0.3, 1.2])
def test_the_equatorial_chain_is_spherical_astronomy(latitude: float) -> None:
    mount = equatorial(latitude)
    for declination, hour in [(0.2, 0.0), (1.1, 1.3), (-0.4, -2.0), (0.9, 3.0)]:
        sight = mount.attitude(np.array([declination, hour, 0.0]))[0]
        np.testing.assert_allclose(sight, line_of_sight(declination, hour, latitude), atol=1e-15)
        other_side = mount.attitude(np.array([np.pi - declination, hour + np.pi, 0.0]))[0]
        np.testing.assert_allclose(other_side, sight, atol=1e-15)


def test_sexagesimal_keeps_the_sign_of_minus_zero() -> None:
    assert sexagesimal(["-00", "30", "36"]) == pytest.approx(-0.51)
    assert sexagesimal(["+12", "15"]) == 12.25


def clock(hours: float) -> str:
    return f"{int(hours):02d} {60 * (hours - int(hours)):.5f}"


def hms(value: float) -> str:
    total = round(abs(value) * 3600 * 1e4)
    sign = "-" if value < 0 else "+"
    return f"{sign}{total // 36_000_000:02d} {total // 600_000 % 60:02d} {total % 600_000 / 1e4:.4f}"


def tpoint_file(path: Path) -> Path:
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


def test_tpoint_both_sides_of_the_pier(tmp_path: Path) -> None:
    run = import_files("tpoint", [tpoint_file(tmp_path / "run.dat")])
    assert run.kind == "pointing"
    assert run.site.height == 228.0
    assert np.degrees(run.site.latitude or 0.0) == pytest.approx(39 + 26 / 3600)
    for axis, zero in (("hour_angle", 0.5), ("declination", 0.25)):
        error = np.degrees(run.channels["gimbal_angle", axis] - run.channels["true_angle", axis])
        np.testing.assert_allclose(error, zero, atol=1e-6)  # the file holds 1e-4 s of hour angle and arc
    np.testing.assert_allclose(run.time, 3600 * SIDEREAL_SECOND * np.array([0.0, 0.4, 0.7]), atol=1e-6)


def test_tpoint_faults(tmp_path: Path) -> None:
    text = tpoint_file(tmp_path / "run.dat").read_text()
    bad = tmp_path / "bad.dat"
    for old, new, sentence in [
        ("+30 00", "+3O 00", "bad.dat, line 6: '22 00 0.0000 +3O 00 0.0000"),
        ("23 30.00000", "", "bad.dat, line 6: an observation has 14 numbers, got 12"),
        (
            "23 54.00000",
            "23 30.00000",
            "bad.dat, observation 2: the sidereal time does not grow; put the rows in order",
        ),
    ]:
        assert old in text
        bad.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError) as caught:
            import_files("tpoint", [bad])
        assert sentence in str(caught.value)
    bad.write_text("nothing\n")
    with pytest.raises(InputError, match="is not a TPOINT file: a line of latitude, date and weather and then stars"):
        import_files("tpoint", [bad])


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


def test_mmt(tmp_path: Path) -> None:
    (tmp_path / "run.dat").write_text(MMT)
    run = import_files("mmt", [tmp_path / "run.dat"])
    assert run.platform.axis_names == ("elevation", "azimuth")
    np.testing.assert_allclose(np.degrees(run.angles()), [[77.25, 347.25], [17.5, 200.0]], rtol=1e-14)
    error = {
        a: np.degrees(run.channels["gimbal_angle", a] - run.channels["true_angle", a]) for a in run.axes("true_angle")
    }
    np.testing.assert_allclose(error["elevation"], 0.25, atol=1e-12)
    np.testing.assert_allclose(error["azimuth"], -0.75, atol=1e-12)
    np.testing.assert_allclose(run.time, [0.0, 3600 * SIDEREAL_SECOND], rtol=1e-15)


def test_mmt_faults(tmp_path: Path) -> None:
    path = tmp_path / "run.dat"
    path.write_text(MMT.replace("TAA:   17.25 -159.25\n", ""))
    with pytest.raises(InputError, match="each star needs RAA, TAA and LST, there are 2 RAA, 1 TAA, 2 LST"):
        import_files("mmt", [path])
    path.write_text(MMT.replace("17.50", "----"))
    with pytest.raises(InputError, match=r"run\.dat, line 7: 'RAA:   ----  200\.00' does not hold numbers"):
        import_files("mmt", [path])


def test_tilt_table_sees_gravity_with_the_right_sign(tmp_path: Path) -> None:
    rate = 200.0
    time = np.arange(4000) / rate
    tilt = 1e-3 * np.sin(0.5 * time)  # about east, rad
    silent = np.zeros_like(time)
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
    np.testing.assert_allclose(run.channels["angular_rate", "z"], -1e-3, rtol=1e-15)
    (tmp_path / "t.npz").write_bytes(b"PK not really")
    with pytest.raises(InputError, match="is not the archive of a tilt table, it must hold vel_HHN, rate_HJN"):
        import_files("tilt-table", [tmp_path / "t.npz"])


# --- the real files ---------------------------------------------------------------------------------------------------


def real(name: str) -> Path:
    path = REAL / name
    if not path.is_file():
        pytest.skip(f"{path} is not on this machine")
    return path


def test_real_mmt_run() -> None:
    run = import_files("mmt", [real("mmt_pointing/point_20210821.dat")])
    assert len(run.time) == 80
    for axis, largest in (("elevation", 0.5), ("azimuth", 4.0)):  # arcmin about the encoder's zero
        error = np.degrees(run.channels["gimbal_angle", axis] - run.channels["true_angle", axis]) * 60
        assert np.abs(error - np.median(error)).max() < largest


@pytest.mark.parametrize(("name", "stars"), [("cgx-l-data.dat", 148), ("warp-astron.dat", 98)])
def test_real_amateur_mounts(name: str, stars: int) -> None:
    run = import_files("tpoint", [real(f"gem_mount_pointing/{name}")])
    assert len(run.time) == stars
    up = -run.platform.attitude(run.angles())[:, 0, 2]
    assert np.degrees(np.arcsin(up)).min() > 15.0  # nobody observes below the trees
    assert np.abs(run.channels["gimbal_angle", "declination"] - run.channels["true_angle", "declination"]).max() < 0.04


def test_real_tilt_table_tilts_north_about_east() -> None:
    run = import_files("tilt-table", [real("tilt_table/tilt_table_200hz.npz")])
    angle = np.cumsum(run.channels["angular_rate", "y"]) / 200.0
    slope = np.polyfit(angle, run.channels["specific_force", "x"], 1)[0]
    assert slope == pytest.approx(9.81, rel=0.05)  # m/s^2 per rad: gravity leaks in; the lever arm is the rest


def test_real_mikoff_rests() -> None:
    run = import_files("mikoff", [real("mikoff_mpu9150/imu0.log")])
    assert run.position is not None
    assert 18 <= run.position.max() <= 23  # 18 poses are meant; some are left and taken up again
