"""Tables of rests and logs of rigs that nobody described: rows that are rests, gimbal angles, German names."""

import numpy as np
import pytest

from gimbalcal.guess.column_names import by_name
from gimbalcal.guess.gimbal_chain import gimbal_chain
from gimbalcal.guess.proposal import propose_recording
from gimbalcal.number import apply_matrix
from gimbalcal.platform import KNOWN, Axis, Platform
from gimbalcal.recording import dwells
from tests.golden import golden_text, refused

G = 9.80665
FACES = [(i, o) for o in (0, 90, 180, 270) for i in (0, 90, 180, 270)] + [(45, 45), (30, 200), (300, 120), (10, 250)]


def felt(platform, angles):
    """Force (n, 3) [m/s^2] on a platform set to angles (n, k) [deg]."""
    return -G * apply_matrix(platform.attitude(np.radians(angles)), np.array([0.0, 0.0, 1.0]))


def german(x, digits=6):
    return f"{x:.{digits}f}".replace(".", ",")


def laboratory(path, platform, encoding="latin-1"):
    """A table of means with a caption, semicolons, decimal commas, no clock; returns the forces."""
    angles = np.array(FACES, dtype=float)
    force = felt(platform, angles) + 1e-5 * np.random.default_rng(1).standard_normal((len(angles), 3))
    lines = [
        "Prüfstand 3;Bediener: Müller",
        "",
        "Nr;Datum;Innen [°];Außen [°];fx [m/s²];fy [m/s²];fz [m/s²];s_fx;s_fy;s_fz;N",
    ]
    for k, ((inner, outer), f) in enumerate(zip(angles, force, strict=True)):
        numbers = [german(inner % 360, 4), german(outer % 360, 4), *(german(x, 7) for x in f), *["0,0002"] * 3, "600"]
        lines.append(";".join([str(k + 1), "03.11.2026", *numbers]))
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    return force


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-16"])
def test_a_table_of_means_is_a_rest_in_each_row(tmp_path, encoding):
    force = laboratory(tmp_path / "m.csv", KNOWN["two-axis-table"], encoding)
    found = propose_recording([tmp_path / "m.csv"], latitude=52.3)
    r = found.recording
    assert (r.platform.name, len(dwells(r)), r.site.latitude) == ("two-axis-table", len(FACES), np.radians(52.3))
    np.testing.assert_allclose(r.triad("specific_force"), force, atol=1e-7)
    assert r.noise["accelerometer"] == pytest.approx(2e-4)
    assert np.all(r.weight == 600)
    assert "Datum" in found.left_out
    golden_text(found.notes["platform"])


def test_readouts_that_run_backwards_and_axes_of_ones_own(tmp_path):
    table = KNOWN["two-axis-table"]
    backwards = Platform("table", (Axis("inner", "z", -1), Axis("outer", "x")))
    laboratory(tmp_path / "b.csv", backwards)
    r = propose_recording([tmp_path / "b.csv"]).recording
    angles = np.array(FACES, dtype=float)
    turned = apply_matrix(r.platform.attitude(r.angles()), np.array([0.0, 0.0, -G]))
    np.testing.assert_allclose(turned, felt(backwards, angles), atol=1e-6)
    assert r.platform == table
    lying = Platform("table", (Axis("inner", "x", 1, np.pi / 2), Axis("outer", "y")))
    laboratory(tmp_path / "c.csv", lying)
    r = propose_recording([tmp_path / "c.csv"]).recording
    turned = apply_matrix(r.platform.attitude(r.angles()), np.array([0.0, 0.0, -G]))
    np.testing.assert_allclose(turned, felt(lying, angles), atol=1e-6)


def test_a_log_of_gravity_and_a_table_called_after_its_turns(tmp_path):
    force = laboratory(tmp_path / "g.csv", KNOWN["two-axis-table"], "utf-8")
    text = (tmp_path / "g.csv").read_text().splitlines()
    rows = [line.split(";") for line in text[3:]]
    turned = [";".join(str(c).replace("--", "") for c in [*r[:4], *("-" + v for v in r[4:7]), *r[7:]]) for r in rows]
    (tmp_path / "g.csv").write_text("\n".join([*text[:3], *turned]))
    found = propose_recording([tmp_path / "g.csv"])
    golden_text(found.notes["platform"])
    np.testing.assert_allclose(found.recording.triad("specific_force"), force, atol=1e-7)
    chain = Platform("three", (Axis("roll", "x"), Axis("pitch", "y"), Axis("yaw", "z")))
    angles = np.array([(r, p, y) for r in (0, 90, 180, 270) for p in (0, 60, -90) for y in (0, 120)], dtype=float)
    columns = [np.arange(1.0, len(angles) + 1), *angles.T, *(felt(chain, angles) / G).T]
    lines = ["Position\tRoll angle\tPitch angle\tYaw angle\tAcc_X\tAcc_Y\tAcc_Z", "-\tdeg\tdeg\tdeg\tg\tg\tg"]
    lines += ["\t".join(german(x) for x in row) for row in zip(*columns, strict=True)]
    (tmp_path / "rpy.txt").write_text("\n".join(lines))
    r = propose_recording([tmp_path / "rpy.txt"]).recording
    again = apply_matrix(r.platform.attitude(r.angles()), np.array([0.0, 0.0, -G]))
    np.testing.assert_allclose(again, r.triad("specific_force"), atol=1e-4)
    assert set(r.platform.axis_names) == {"roll", "pitch", "yaw"}


def test_angles_that_no_platform_explains_are_left_out_and_said(tmp_path):
    rng = np.random.default_rng(3)
    laboratory(tmp_path / "d.csv", Platform("odd", (Axis("inner", "z", 1, 0.6), Axis("outer", "x", 1, 0.5))))
    found = propose_recording([tmp_path / "d.csv"])
    assert found.recording.platform.name == "bench"
    golden_text(found.notes["platform"])
    assert {"Innen [°]", "Außen [°]"} <= set(found.left_out)
    force = rng.standard_normal((8, 3))
    assert gimbal_chain({"inner": rng.uniform(0, 6, 8)}, force).platform is None
    assert gimbal_chain({"inner": np.zeros(3)}, force[:3]).platform == KNOWN["two-axis-table"]


def test_one_rest_is_a_recording_for_its_noise(tmp_path):
    rng = np.random.default_rng(2)
    for rate in (1, 100):  # of few samples to a window a still run is one rest too
        t, f = np.arange(3000) / rate, [0, 0, G] + 1e-3 * rng.standard_normal((3000, 3))
        np.savetxt(
            tmp_path / "still.csv", np.column_stack([t, f]), delimiter=",", header="Zeit [s],ax,ay,az", comments=""
        )
        found = propose_recording([tmp_path / "still.csv"])
        assert len(dwells(found.recording)) == 1
        golden_text(found.notes["kind"])


@pytest.mark.parametrize("inclinations", [0, 3])
def test_a_unit_that_stays_in_one_attitude_is_for_noise_and_its_inclinations_are_no_gimbals(tmp_path, inclinations):
    """Four rests within 2 deg, with inclinations in whole degrees that the unit computed from its forces."""
    rng, n = np.random.default_rng(2), 800
    tilt = np.radians(np.repeat([0.0, 0.0, 0.3, 1.8], n // 4))
    force = 1e3 * np.stack([np.zeros(n), np.sin(tilt), np.cos(tilt)], axis=-1) + rng.standard_normal((n, 3))
    for moved in range(n // 4, n, n // 4):
        force[moved - 15 : moved + 15] += 300 * rng.standard_normal((30, 3))
    degrees = np.round(np.degrees(np.stack([0 * tilt, tilt, np.pi / 2 - tilt], axis=-1)))
    rows = [",".join(f"{x:.6g}" for x in row) for row in np.column_stack([np.arange(n) / 20, force, degrees])]
    head = "time [s],A_X [mg],A_Y [mg],A_Z [mg],A_X [deg],A_Y [deg],A_Z [deg]"
    lines = [",".join(line.split(",")[: 4 + inclinations]) for line in (head, *rows)]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = propose_recording([tmp_path / "a.csv"])
    assert len(dwells(found.recording)) == 4
    assert not found.recording.has("gimbal_angle")
    assert "enough for `gimbalcal noise`" in found.notes["kind"]


def test_names_of_laboratories_topics_and_telephones():
    said = {
        "Beschleunigung X [g]": ("specific_force", "x", "g"), "Drehrate_z (°/s)": ("angular_rate", "z", "deg/s"),
        "field.angular_velocity.y": ("angular_rate", "y", ""), "imu1/ax (ft/s²)": ("specific_force", "x", "ft/s^2"),
        "accelerometerAccelerationX(G)": ("specific_force", "x", "g"), "TimeUS": ("time", "", "us"),
        "Messzeit [ms]": ("time", "", "ms"), "header.stamp": ("time", "", ""),
        "Winkel Außenrahmen außen [°]": ("gimbal_angle", "outer", "deg"),
        "s_fx [mg]": ("sigma", "x", "mg"), "acc_y_std": ("sigma", "y", ""), "N": ("weight", "", ""),
        "Temperatur [°C]": ("temperature", "", "degC"), "Table angle (deg)": ("gimbal_angle", "table", "deg"),
    }  # fmt: skip
    for name, wanted in said.items():
        g = by_name(name)
        assert g is not None, name
        assert (g.quantity, g.axis, g.unit) == wanted, name
    no = (
        "field.orientation.x",
        "angular_velocity_covariance0",
        "gyro_x_std",
        "s_y",
        "mag_field_z",
        "Bediener",
        "quality_x",
    )
    assert [name for name in no if by_name(name) is not None] == []


def test_units_below_the_names_feet_and_body_rates(tmp_path):
    rng = np.random.default_rng(4)
    lines = ["t;ax;ay;az;p;q;r", "s;ft/s²;ft/s²;ft/s²;°/s;°/s;°/s"]
    rows = np.column_stack(
        [np.arange(500) / 50, [0, 0, 32.174] + 0.01 * rng.standard_normal((500, 3)), rng.standard_normal((500, 3))]
    )
    lines += [";".join(german(v) for v in row) for row in rows]
    (tmp_path / "u.csv").write_text("\n".join(lines), encoding="utf-8")
    found = propose_recording([tmp_path / "u.csv"])
    assert {g.unit for g in found.guesses.values()} - {""} == {"s", "ft/s^2", "deg/s"}
    assert np.median(found.recording.triad("specific_force")[:, 2]) == pytest.approx(G, rel=1e-3)
    assert found.recording.has("angular_rate")


def test_a_clock_that_jumps_back_can_be_counted(tmp_path):
    t = np.r_[np.arange(500), np.arange(300, 800)] / 50
    f = [0, 0, G] + 1e-3 * np.random.default_rng(5).standard_normal((1000, 3))
    np.savetxt(tmp_path / "j.csv", np.column_stack([t, f]), delimiter=",", header="t,ax,ay,az", comments="")
    with refused():
        propose_recording([tmp_path / "j.csv"])
    assert propose_recording([tmp_path / "j.csv"], rate=50).recording.time[-1] == pytest.approx(999 / 50)
