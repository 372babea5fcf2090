"""Logs as programs write them: remarks behind rows, exponents of Fortran, errors beside offsets, messages, stamps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.importers.delimited import encoding_of
from gimbalcal.importers.log import propose
from gimbalcal.importers.names import by_name
from gimbalcal.importers.undescribed import table_of
from tests.importers.test_new import D, G, turned
from tests.importers.test_new_layouts import rows, same
from tests.importers.test_new_stars import AZ, EL, OFF, agrees, write


def test_a_form_above_and_a_column_of_remarks_that_is_left_empty(tmp_path: Path) -> None:
    t, f, w = turned()
    units = "\t".join(["Y_Unit", *["g"] * 3, *["deg/s"] * 3])
    form = f"Meter\t2\n\nChannels\t6\t\t\t\t\t\t\nSamples{6 * (chr(9) + '2000')}\t\n{units}\t\n"
    head = form + "X_Value\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tComment"
    path = rows(tmp_path / "a.lvm", head, t, *f.T / G, *w.T * D, mark="\t")
    text = path.read_text().replace(".", ",").splitlines()
    text[30] += "\tknocked"  # the only remark
    path.write_text("\n".join(text), encoding="utf-8")
    same(propose([path]), t, f, w)


def test_double_precision_of_fortran(tmp_path: Path) -> None:
    t, f, w = turned()
    cells = [[f"{v:.7E}".replace("E", "D") for v in x] for x in (t, *f.T, *w.T * D)]
    same(propose([rows(tmp_path / "a.dat", "C TUMBLE\n T(SEC) FX(M/S**2) FY(M/S**2) FZ(M/S**2) WX(DEG/S) WY(DEG/S) "
                       "WZ(DEG/S)", *cells, mark="  ")]), t, f, w)  # fmt: skip


def test_seconds_of_arc_have_a_comma_too_and_dashes_of_windows_are_read(tmp_path: Path) -> None:
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
def test_a_unit_stands_before_the_axis_or_behind(name: str, quantity: str, unit: str) -> None:
    found = by_name(name)
    assert found is not None
    assert (found.quantity, found.axis, found.unit) == (quantity, "x", unit)


def test_an_error_beside_an_offset_is_no_offset(tmp_path: Path) -> None:
    sky = OFF[0] * np.cos(np.radians(EL))
    names = "Az,El,xel_off [arcsec],el_off [arcsec],xel_err [arcsec],el_err [arcsec]"
    small = np.full(30, 0.5)
    found = propose([write(tmp_path / "a.csv", names, AZ, EL, sky, OFF[1], small, 2 * small)])
    agrees(found.recording)
    assert {"xel_err [arcsec]", "el_err [arcsec]"} <= set(found.left_out)
    with pytest.raises(InputError, match=r"which of daz and az_corr is what the mount was off by"):
        propose([write(tmp_path / "b.csv", "az,el,daz,del,az_corr", AZ, EL, *OFF, OFF[0] + 9)])


def test_offsets_beside_both_angles_say_the_same_or_are_asked_about(tmp_path: Path) -> None:
    names = "az_cmd,el_cmd,az_act,el_act,az_off [arcsec],el_off [arcsec]"
    read = AZ + OFF[0] / 3600, EL + OFF[1] / 3600
    agrees(propose([write(tmp_path / "a.csv", names, AZ, EL, *read, *OFF, cell="{:.8f}")]).recording)
    servo = AZ + 1e-4, EL - 1e-4
    with pytest.raises(InputError, match="el_act less el_cmd is not what el_off"):
        propose([write(tmp_path / "b.csv", names, AZ, EL, *servo, *OFF)])
