"""Right ascensions without sidereal time: UTC or a Julian date and the longitude make it; remarks that tell a place."""

from datetime import date, datetime, timedelta

import numpy as np
import pytest

from gimbalcal.guess.celestial import angle_stated, axis_angles
from gimbalcal.guess.proposal import propose_recording
from gimbalcal.guess.text_table import table_of
from tests.golden import refused
from tests.guess.test_pointing_run import OFF, off, sexagesimal, write

N, LATITUDE, LONGITUDE = 30, -33.5, -70.75
RNG = np.random.default_rng(5)
HOUR, DEC = RNG.uniform(-45, 45, N), RNG.uniform(-70, 10, N)  # deg
START = datetime(2026, 4, 3, 23, 50)  # noqa: DTZ001


def ascensions():
    """UTC, Julian date, and the right ascensions [deg] of the sky and the mount, by the formula of the USNO."""
    utc = [START + timedelta(minutes=7 * k) for k in range(N)]
    midnight = np.array([float((t.date() - date(2000, 1, 1)).days) - 0.5 for t in utc])
    hour = np.array([t.hour + t.minute / 60 for t in utc])
    greenwich = 6.697374558 + 0.06570982441908 * midnight + 1.00273790935 * hour
    lst = 15 * greenwich + LONGITUDE
    return utc, 2451545.0 + midnight + hour / 24, (lst - HOUR) % 360, (lst - HOUR - OFF[0] / 3600) % 360


def test_the_formula_is_that_of_the_almanac(tmp_path):
    """Meeus, Astronomical Algorithms, examples 12.a and 12.b: 13 h 10 m 46.3668 s, 8 h 34 m 57.0896 s."""
    cells = [["1987-04-10T00:00:00", "1987-04-10T19:21:00"], ["0", "0"], ["0", "0"], ["0", "0"], ["0", "0"]]
    path = write(tmp_path / "a.csv", "utc,ra_cat,dec_cat,ra_tel,dec_tel", *map(np.array, cells))
    table, notes = axis_angles(table_of(path), 0.0)
    hours = np.mod(table.columns["hour angle from ra_cat [deg]"] / 15, 24)
    np.testing.assert_allclose(hours, [13 + 10 / 60 + 46.3668 / 3600, 8 + 34 / 60 + 57.0896 / 3600], atol=1e-7)
    assert "taken for UTC, and the longitude 0 deg" in notes["sidereal"]
    assert "one equinox" in notes["equinox"]


def test_utc_or_a_julian_date_and_the_place_make_hour_angles(tmp_path):
    utc, jd, sky, mount = ascensions()
    place = f"# Las Campanas, lat -33:30:00, lon={LONGITUDE} (east)\n"
    stamps = np.array([t.isoformat() for t in utc])
    for clock, cells in (("UTC", stamps), ("JD", np.array([f"{x:.9f}" for x in jd])),
                         ("MJD", np.array([f"{x - 2400000.5:.9f}" for x in jd]))):  # fmt: skip
        path = write(tmp_path / "a.csv", f"{place}{clock},ra_cat,dec_cat,ra_tel [deg],dec_tel", cells, sky, DEC, mount,
                     DEC + OFF[1] / 3600, cell="{:.8f}")  # fmt: skip
        r = propose_recording([path]).recording
        assert r.site.latitude == pytest.approx(np.radians(LATITUDE))
        np.testing.assert_allclose(np.degrees(r.channels["true_angle", "hour_angle"]), HOUR, atol=2e-4)
        np.testing.assert_allclose(off(r, "hour_angle"), OFF[0], atol=0.02)
        np.testing.assert_allclose(off(r, "declination"), OFF[1], atol=0.02)


def test_keywords_of_fits_files_tell_mount_plate_and_place(tmp_path):
    utc, _, sky, mount = ascensions()
    cells = [[sexagesimal(x).replace(":", " ") for x in y] for y in (mount / 15, DEC + OFF[1] / 3600)]
    path = write(tmp_path / "a.csv", "file,DATE-OBS,OBJCTRA,OBJCTDEC,CRVAL1,CRVAL2,SITELAT,SITELONG",
                 np.array(["a.fits"] * N), np.array([t.isoformat() for t in utc]), *map(np.array, cells), sky, DEC,
                 np.array(["-33 30 00"] * N), np.array(["-70 45 00"] * N))  # fmt: skip
    r = propose_recording([path]).recording
    np.testing.assert_allclose(off(r, "hour_angle"), OFF[0], atol=1.0)
    assert r.site.latitude == pytest.approx(np.radians(LATITUDE))


def test_what_is_missing_or_puts_stars_below_the_horizon_is_asked(tmp_path):
    utc, _, sky, mount = ascensions()
    names = "utc,ra_cat,dec_cat,ra_tel,dec_tel"
    columns = (np.array([t.isoformat() for t in utc]), sky, DEC, mount, DEC)
    path = write(tmp_path / "a.csv", names, *columns)
    with refused():
        propose_recording([path], latitude=LATITUDE)
    with refused():
        propose_recording([path], latitude=LATITUDE, longitude=-LONGITUDE)
    assert propose_recording([path], latitude=LATITUDE, longitude=LONGITUDE).recording.kind == "pointing"
    with refused():
        propose_recording([write(tmp_path / "b.csv", names[4:], *columns[1:])], latitude=LATITUDE, longitude=LONGITUDE)


@pytest.mark.parametrize(
    ("line", "told"),
    [("site lat=-33.5 h=2400", -33.5), ("latitude 39.0 deg N", 39.0), ("Lat: 33 30 00 S", -33.5),
     ("lat 48:08:00.0", 48 + 8 / 60),
     ("LATITUDE = 51d28m38s", 51 + 28 / 60 + 38 / 3600), ("plate of 2026", None), ("lat: 12", 12.0),
     ("latitude 39.0 deg S", -39.0)],
)  # fmt: skip
def test_a_remark_tells_the_latitude_with_its_sign(line, told):
    assert angle_stated(line, "lat(?:itude)?", "N", "S") == (pytest.approx(told) if told is not None else None)
