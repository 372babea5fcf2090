"""Two-position tests: the bias comes out of a reversal, north with it, and what cannot be told is said."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE
from gimbalcal.estimate.gyroscopes.two_position import two_position
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, Axis, Platform
from gimbalcal.recording import Recording, Site, write
from gimbalcal.units import from_si, to_si
from tests.golden import golden_text, refused

LATITUDE, NORTH, NOISE = np.radians(48.0), np.radians(70.0), to_si(5.0, "deg/h")
BIAS = to_si(1.0, "deg/h") * np.array([3.0, -8.0, 5.0])


def rests_at(angles, platform="rate-table", seed=1, rows=400, wrong=0.0):
    """Rests of `rows` samples at these gimbal angles [deg] on a level base, x axis `NORTH` east of north."""
    rng = np.random.default_rng(seed)
    east, down = np.cos(LATITUDE) * np.sin(NORTH), np.sin(LATITUDE)
    earth = EARTH_RATE * np.array([np.cos(LATITUDE) * np.cos(NORTH), -east, -down])
    table = platform if isinstance(platform, Platform) else KNOWN[platform]
    true: list[Array] = [table.attitude(np.radians(a)) @ earth for a in angles]
    true[-1] = true[-1] + wrong
    y = np.repeat(BIAS + np.array(true), rows, axis=0) + NOISE * rng.standard_normal((rows * len(angles), 3))
    position = np.repeat(np.arange(len(angles)) + 1, rows)
    channels = {("angular_rate", a): y[:, i] for i, a in enumerate("xyz")}
    for i, name in enumerate(table.axis_names):
        channels["gimbal_angle", name] = np.repeat(np.radians([a[i] for a in angles]), rows)
    return Recording(
        "multi-position", "reversed", table, Site(LATITUDE), {}, np.arange(len(y)) * 1.0, position, channels
    )


VERTICAL: list[tuple[float, ...]] = [(0.0,), (180.0,)]
EAST: list[tuple[float, ...]] = [(0.0, 0.0), (0.0, 180.0)]  # about x, wherever it points
BOTH = [(0.0, 0.0), (180.0, 0.0), (0.0, 180.0), (180.0, 180.0)]


@pytest.mark.parametrize(("angles", "platform"), [(VERTICAL, "rate-table"), (BOTH, "two-axis-table")])
def test_the_bias_and_north_come_out_of_a_reversal(angles, platform):
    off = []
    for seed in range(12):
        made = two_position(rests_at(angles, platform, seed))
        north = made.provenance["options"]["north"]
        off.append([*((made.values - BIAS) / made.sigmas), (north["east_of_north_deg"] - 70.0) / north["sigma_deg"]])
        assert made.outcome == ""
        assert made.sigmas == pytest.approx(NOISE / np.sqrt(400 * len(angles)), rel=0.6)
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.4  # 48 normal numbers, four of them together


def test_a_reversal_about_the_vertical_leaves_gravity_in_the_bias():
    named = two_position(rests_at(VERTICAL)).unobservable
    assert named[0]["direction"] == {"gyro_bias:x": 1.0, "gyro_g_sensitivity_rate:xz": -1.0}
    assert two_position(rests_at(BOTH, "two-axis-table")).unobservable == ()


def test_a_bias_that_moved_is_an_outcome():
    made = two_position(rests_at(BOTH, "two-axis-table", wrong=to_si(3.0, "deg/h")))
    assert "leave" in made.outcome
    golden_text(made.outcome)


@pytest.mark.parametrize(
    "recording",
    [
        rests_at([(0.0,), (0.0,)]),
        rests_at([(0.0,)]),
        replace(rests_at(VERTICAL), site=Site()),
        replace(rests_at(VERTICAL), units={("angular_rate", a): "count" for a in "xyz"}),
        replace(rests_at(VERTICAL), kind="rotation"),
    ],
)
def test_what_is_no_reversal_is_refused(recording):
    with refused():
        two_position(recording)


def test_the_command(tmp_path, command, capsys):
    write(rests_at(VERTICAL), tmp_path / "rec")
    assert command("calibrate", tmp_path / "rec", "--method", "two-position", "--out", tmp_path / "out") == 0
    golden_text(capsys.readouterr().err)
    assert (tmp_path / "out" / "report.html").is_file()


ABOUT_Y = Platform("turnover", (Axis("pitch", "y"),))


@pytest.mark.parametrize("seed", range(4))
def test_a_mirror_solution_is_reported(seed):
    """Turned over about its y axis a unit keeps that axis where it is: east or west of north fit alike."""
    made = two_position(rests_at([(0.0,), (180.0,)], ABOUT_Y, seed))
    (other,) = made.provenance["other_solutions"]
    assert other["chi2_rise"] == pytest.approx(0.0, abs=1e-6)
    written = float(from_si(made.values[1], "deg/h"))
    true = float(from_si(BIAS[1], "deg/h"))
    sigma = float(from_si(made.sigmas[1], "deg/h"))
    assert min(abs(x - true) for x in (written, other["values"]["gyro_bias:y"])) < 4 * sigma
    assert abs(written) < abs(other["values"]["gyro_bias:y"])
    assert "mirror" in made.outcome
    if not seed:
        golden_text(made.outcome)
    both = two_position(rests_at(BOTH, "two-axis-table", seed))
    assert both.provenance.other_solutions is None
    assert both.outcome == ""
