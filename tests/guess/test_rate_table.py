"""Logs of gyroscopes without accelerometers beside what turned them: `new` proposes a rotation on a rate table."""

import numpy as np
import pytest

from gimbalcal.checks.driven_rates import driven_turn
from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import axis_word, by_name
from gimbalcal.guess.proposal import propose_recording
from gimbalcal.platform import KNOWN, Axis, Platform
from gimbalcal.quantities import refuse_unit
from gimbalcal.rotation import rotation_vector
from tests.golden import golden_text, refused

STEP, RATES = 0.02, (5.0, -5.0, 30.0, -30.0, 90.0, -90.0)


def profile():
    """A table's rate [deg/s], three seconds of each with rests between."""
    return np.concatenate([x for w in RATES for x in (np.zeros(50), np.linspace(0, w, 25), np.full(150, w),
                                                      np.linspace(w, 0, 25))])  # fmt: skip


def felt(platform, angles, seed=1):
    """What gyroscopes (n, 3) [deg/s] feel on a platform that goes through angles (n, k) [deg], a per cent off."""
    C = platform.attitude(np.radians(angles))
    turn = np.degrees(rotation_vector(C[:-1] @ C[1:].swapaxes(-1, -2))) / STEP
    noise = np.random.default_rng(seed).normal(0.0, 0.05, (len(angles), 3))
    return np.asarray(np.concatenate([turn[:1], turn]) * [1.01, 0.99, 1.005] + [0.3, -0.2, 0.1] + noise)


def log(path, gyros, **others):
    t = STEP * np.arange(len(gyros))
    names = ",".join(["time", "gyro_x", "gyro_y", "gyro_z", *others])
    np.savetxt(path, np.column_stack([t, gyros, *others.values()]), "%.6f", ",", header=names, comments="")
    return path


def chain(r):
    return [(a.name, a.direction, a.sign) for a in r.platform.axes]


@pytest.mark.parametrize(("direction", "sign"), [("x", 1), ("y", -1), ("z", 1)])
def test_the_gyroscopes_tell_axis_and_sense_of_a_table(tmp_path, direction, sign):
    angle = STEP * np.cumsum(profile())
    g = felt(Platform("own", (Axis("table", direction, sign),)), angle[:, None])
    found = propose_recording([log(tmp_path / "a.csv", g, table_angle_deg=angle % 360)])
    r = found.recording
    assert (r.kind, chain(r)) == ("rotation", [("table", direction, sign)])
    golden_text(found.notes["platform"])
    assert not any("not checked" in remark for remark in r.remarks)


@pytest.mark.parametrize(
    ("name", "factor"),
    [("table_rate", 1.0), ("table_speed_rpm", 1 / 6), ("w_cmd", 1.0), ("table_rate_rad", np.pi / 180)],
)
def test_a_rate_of_the_table_is_added_up(tmp_path, name, factor):
    rate = profile()
    g = felt(Platform("own", (Axis("table", "y"),)), STEP * np.cumsum(rate)[:, None])
    r = propose_recording([log(tmp_path / "a.csv", g, **{name: factor * rate})]).recording
    assert chain(r) == [("table", "y", 1)]
    assert np.ptp(r.channels["gimbal_angle", "table"]) == pytest.approx(
        np.radians(np.ptp(STEP * np.cumsum(rate))), 1e-3
    )


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("winkel", lambda a: a % 360), ("enc", lambda a: np.round(a / 360 * 2**16) % 2**16),
        ("phi", np.radians), ("revolutions", lambda a: a / 360),
    ],
)  # fmt: skip
def test_an_angle_by_any_name_beside_what_is_none(tmp_path, name, shown):
    rate = profile()
    angle = STEP * np.cumsum(rate)
    g = felt(Platform("own", (Axis("table", "x"),)), angle[:, None])
    others = {
        "supply_v": 5 + 0.01 * np.sin(0.01 * angle),
        name: shown(angle),
        "temp_c": 20 + 1e-3 * np.arange(len(rate)),
    }
    found = propose_recording([log(tmp_path / "a.csv", g, **others)])
    assert chain(found.recording) == [("table", "x", 1)]
    assert "supply_v" in found.left_out


def test_a_measured_angle_comes_before_a_command(tmp_path):
    rate = profile()
    angle = STEP * np.cumsum(rate)
    g = felt(Platform("own", (Axis("table", "z", -1),)), angle[:, None])
    late = np.round(np.roll(angle, 5) * 10) / 10 % 360
    found = propose_recording([log(tmp_path / "a.csv", g, table_speed_cmd=rate, encoder=late)])
    assert found.guesses["encoder"].quantity == "gimbal_angle"
    assert "table_speed_cmd" in found.left_out


def test_an_inner_axis_that_spins_at_several_outer_angles(tmp_path):
    rate = profile()
    inner, outer = STEP * np.cumsum(np.tile(np.append(rate, np.zeros(200)), 3)), np.zeros(3 * (len(rate) + 200))
    for k in range(3):
        end = (k + 1) * (len(rate) + 200)
        outer[end - 200 : end] = 45 * k + np.linspace(0, 45, 200)
        outer[end:] = 45 * (k + 1)
    g = felt(KNOWN["two-axis-table"], np.stack([inner, outer], axis=-1))
    made = propose_recording([log(tmp_path / "a.csv", g, inner_deg=inner % 360, outer_deg=outer)]).recording
    assert made.platform == KNOWN["two-axis-table"]
    assert set(made.axes("gimbal_angle")) == {"inner", "outer"}


def test_rates_in_rad_and_in_counts(tmp_path):
    angle = STEP * np.cumsum(profile())
    g = felt(Platform("own", (Axis("table", "z"),)), angle[:, None])
    r = propose_recording([log(tmp_path / "a.csv", np.radians(g), table=angle % 360)]).recording
    assert (r.units["angular_rate", "x"], r.platform) == ("rad/s", KNOWN["rate-table"])
    r = propose_recording([log(tmp_path / "b.csv", np.round(131 * g), table=angle % 360)]).recording
    assert (r.units["angular_rate", "x"], r.platform.axes[0].direction) == ("count", "z")


def test_about_the_vertical_gravity_tells_nothing_and_the_gyroscopes_do(tmp_path):
    rate = profile()
    g = felt(Platform("own", (Axis("table", "x", -1),)), STEP * np.cumsum(rate)[:, None])
    rng = np.random.default_rng(4)
    force = {f"acc_{a}": f + rng.normal(0, 0.002, len(rate)) for a, f in zip("xyz", (9.81, 0.02, -0.03), strict=True)}
    found = propose_recording([log(tmp_path / "a.csv", g, **force, table_rate_dps=rate)])
    assert (found.recording.kind, chain(found.recording)) == ("rotation", [("table", "x", -1)])
    assert found.recording.has("specific_force")
    assert "--method rate-table" in found.notes["kind"]
    assert not any("gyroscopes were not checked" in remark for remark in found.recording.remarks)


def test_a_hinge_that_swings_all_the_time_is_a_table_about_a_level_axis(tmp_path):
    """No rest is found, and gravity turns with the unit; the encoder is the angle that its gyroscopes felt."""
    angle = np.abs((50 * STEP * np.arange(3000) + 90) % 360 - 180)
    platform = Platform("own", (Axis("table", "x"),))
    f = platform.attitude(np.radians(angle)[:, None]) @ [0.0, 0.0, 9.81]
    f = f + np.random.default_rng(6).normal(0, 0.05, f.shape)
    force = {f"acc_{a}": f[:, i] for i, a in enumerate("xyz")}
    found = propose_recording([log(tmp_path / "a.csv", felt(platform, angle[:, None]), **force, encoder=angle)])
    assert (found.recording.kind, chain(found.recording)) == ("rotation", [("table", "x", 1)])
    golden_text(found.notes["kind"])
    force["acc_x"], force["acc_z"] = force["acc_z"], force["acc_x"]  # gravity turns about another axis
    with pytest.raises(InputError, match="no rest is found"):
        propose_recording([log(tmp_path / "b.csv", felt(platform, angle[:, None]), **force, encoder=angle)])


def test_a_magnetometer_that_turns_with_the_unit_is_no_angle_of_a_table(tmp_path):
    """Sixteen degrees about the vertical: one of its axes changes nearly as the angle does."""
    angle = 8 * np.sin(2 * np.pi * 0.3 * STEP * np.arange(600))
    g = felt(Platform("own", (Axis("table", "z"),)), angle[:, None])
    field = np.stack([np.cos(np.radians(angle)), -np.sin(np.radians(angle)), 0 * angle + 2], axis=-1) * 20
    field += np.random.default_rng(2).normal(0.0, 0.3, field.shape)
    found = propose_recording([log(tmp_path / "a.csv", g, angle=angle)])
    assert found.recording.platform.axis_names == ("table",)
    vector = {f"Mag{a}_uT": x for a, x in zip("XYZ", field.T, strict=True)}
    with refused():
        propose_recording([log(tmp_path / "b.csv", g, **vector)])


def test_encoders_by_number_are_angles(tmp_path):
    """Three encoders that are counted, of which one turns: names of a vector end in x, y and z."""
    angle = STEP * np.cumsum(profile())
    g = felt(Platform("own", (Axis("table", "z"),)), angle[:, None])
    rng = np.random.default_rng(3)
    encoders = {f"enc{k}": x + rng.normal(0, 1e-3, len(angle)) for k, x in enumerate((0 * angle, angle, 0 * angle), 1)}
    found = propose_recording([log(tmp_path / "a.csv", g, **encoders)])
    assert found.guesses["enc2"].quantity == "gimbal_angle"


def test_what_no_column_explains_is_said(tmp_path):
    angle = STEP * np.cumsum(profile())
    oblique = felt(
        Platform("own", (Axis("tilt", "x", 1, 0.6), Axis("table", "z"))), np.stack([0 * angle, angle], axis=-1)
    )
    with refused():
        propose_recording([log(tmp_path / "a.csv", oblique, table_deg=angle)])
    logs = [log(tmp_path / f"{a}.csv", felt(Platform("own", (Axis("table", a),)), angle[:, None]), table_deg=angle)
            for a in "xy"]  # fmt: skip
    with refused():
        propose_recording(logs)


def test_a_rate_of_a_table_is_no_angle_of_it():
    assert by_name("table_rate_dps") is None
    assert axis_word("table_rate_dps") == "table"
    assert by_name("table_deg").quantity == "gimbal_angle"


def test_a_header_that_calls_a_rate_an_angle_is_told_what_adds_it_up():
    with refused():
        refuse_unit("deg/s", "gimbal_angle")


def test_the_chain_s_rate_is_that_of_its_attitude():
    rng = np.random.default_rng(3)
    platform = Platform("own", (Axis("a", "x", -1, 0.4), Axis("b", "z", 1, 1.0), Axis("c", "y")))
    angles = np.cumsum(rng.normal(0, 1e-3, (400, 3)), axis=0)
    angles = np.cumsum(angles, axis=0) / 20
    y = np.radians(felt(platform, np.degrees(angles)))
    T = driven_turn(STEP * np.arange(400), y, angles, platform.axis_names)
    assert T.misfit(platform) < 0.05
    assert T.misfit(Platform("own", platform.axes[::-1])) > 0.3


def test_a_log_shorter_than_a_span_is_one_span_and_shows_nothing():
    time = 1e-4 * np.arange(50)
    turn = driven_turn(time, np.ones((50, 3)), time[:, None], ("table",))
    assert len(turn.read) == 1
    assert turn.residual(KNOWN["rate-table"]) == turn.misfit(KNOWN["rate-table"]) == 1.0
