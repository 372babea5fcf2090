"""What a log is taken for, one guess at a time: clocks, units, sigmas, places; each known from a few numbers."""

from pathlib import Path

import numpy as np
import pytest

from gimbalcal.guess.clocks import clock_jitter, costs_of_unit, in_unit, single_sensor, unit_of_time
from gimbalcal.guess.column_values import by_order, costs_of_rate, unit_of_force
from gimbalcal.guess.gimbal_chain import unit_of_angle
from gimbalcal.guess.log import Guess, Log
from gimbalcal.guess.merged_logs import on_one_clock, without_duplicates
from gimbalcal.guess.proposal import propose_recording
from gimbalcal.importers.unit_log import unit_log
from tests.golden import golden_text
from tests.guess.test_pointing_run import AZ, EL, OFF, off, write
from tests.recording.test_dwells import turned_by_hand

TIME = Guess("time", "", "s", "its name")


def test_jitter_is_a_share_of_a_step_in_any_unit():
    t = np.cumsum(1.0 + 0.3 * np.random.default_rng(1).uniform(-1, 1, 5000))
    assert clock_jitter(t) == pytest.approx(0.24, abs=0.01)  # half of the middle 80 % of 60 %
    assert clock_jitter(1000 * t) == pytest.approx(clock_jitter(t))


@pytest.mark.parametrize(("step", "unit"), [(0.02, "s"), (20.0, "ms"), (2e4, "us"), (1.0, "s"), (5e6, "ns")])
def test_a_clock_counts_in_the_unit_in_which_sensors_are_logged(step, unit):
    assert unit_of_time(step * np.arange(1000))[0] == unit


@pytest.mark.parametrize(
    ("first", "step", "unit"),
    [
        (132907960342450000, 100_000, "0.1 us"),  # Windows, since 1601
        (738_000.25, 1 / 86400, "d"),  # datenum of MATLAB
        (1.7e9, 10.0, "s"),
        (1.7e12, 10.0, "ms"),
        (1.7e15, 5000.0, "us"),
        (5e4, 10.0, "ms"),  # since power-up
        (5e6, 1e4, "us"),
    ],
)
def test_a_clock_that_states_a_day_of_this_century_shows_its_unit(first, step, unit):
    assert unit_of_time(first + step * np.arange(1000))[0] == unit


def test_units_that_write_in_turn_are_told_apart_by_their_readings():
    """Six of a board at once, numbered, under a clock of whole seconds; packets of six rows of one unit stay whole."""
    rng, n = np.random.default_rng(0), 6 * 500
    number, turn = np.arange(n) % 6.0, np.arange(n) // 6
    level = rng.standard_normal((6, 3))
    columns = {"1": 1.7e9 + turn // 50, "2": number}
    noise = 0.02 * rng.standard_normal((n, 3))
    for own, sensors in ((level[np.arange(n) % 6], 6), (level[:1], 1)):
        readings = {str(k + 3): x for k, x in enumerate((own + noise).T)}
        log, note = single_sensor(Log(columns | readings, {}))
        assert len(log.columns["1"]) == n / sensors
        assert ("of 6 sensors" in note) == (sensors == 6)


def test_no_log_is_shorter_than_a_second():
    """Rows of 9.6 Hz for three minutes are not rows of 9.6 kHz for 0.2 s."""
    costs = costs_of_unit(104.0 * np.arange(1822))
    assert costs["us"][0] > costs["ms"][0] + 5


@pytest.mark.parametrize("first", [0.0, 1.0, 15456.0])
def test_a_first_column_that_numbers_the_rows_is_no_clock(first):
    """As a table of readings alone is written with the number of each row; a later column that grows may be one."""
    number = first + np.arange(300.0)
    forces = dict(zip("345", np.random.default_rng(1).normal([[0.3], [-0.1], [9.8]], 0.05, (3, 300)), strict=True))
    assert {g.quantity for g in by_order({"1": number, **forces}).values()} == {"specific_force"}
    for clock in (0.02 * number, 20 * number, 1.7e9 + number):
        guesses = by_order({"1": number, "2": clock, **forces})
        assert [n for n, g in guesses.items() if g.quantity == "time"] == ["2"]


def test_thousandths_are_no_counts():
    """Logs of printers are in mm/s^2, with fractions; 9773 whole numbers to a g are counts."""
    f = np.random.default_rng(2).normal([[1690.0], [9624.0], [207.0]], 45.0, (3, 500))
    assert unit_of_force(list(f))[0] == "mm/s^2"
    assert unit_of_force(list(np.rint(f)))[0] == "count"
    assert unit_of_force(list(8192 / 9807 * f))[0] == "count"  # means of counts


def test_another_unit_of_a_clock_is_said_with_its_rate():
    log = in_unit(Log({"t": 2e4 * np.arange(10.0)}, {"t": TIME}), "us")
    assert log.guesses["t"].unit == "us"
    golden_text(log.guesses["t"].why)
    assert log.columns["t"][1] == 2e4


def test_a_gyroscope_turns_as_fast_as_it_leaves_its_level():
    rate = 2.0 * np.sin(np.arange(100.0))
    level, fast = costs_of_rate([rate + 60.5, rate - 60.5, rate], False), costs_of_rate([60 * rate, rate, rate], False)
    assert "hand" not in level["rad/s"][1]
    assert "hand" in fast["rad/s"][1]
    assert fast["deg/s"][0] < fast["rad/s"][0] - 15


def test_a_broken_line_of_the_log_turns_no_gyroscope():
    rate = np.radians(0.1) * np.random.default_rng(3).standard_normal((3, 30_000))
    in_radians = costs_of_rate(rate, False)["rad/s"][0]
    rate[1, 700] = 1106.0
    assert costs_of_rate(rate, False)["rad/s"][0] == pytest.approx(in_radians, abs=1e-3)
    rate[1, 700:703] = 1106.0
    assert costs_of_rate(rate, False)["rad/s"][0] > in_radians + 15


def test_a_bias_that_no_gyroscope_has_and_the_step_of_a_chip_show_the_unit():
    rng = np.random.default_rng(2)
    chip = [np.round(rng.normal(b, 0.2, 5000) * 16.4) / 16.4 for b in (0.1, -2.0, 0.4)]
    for factor, unit in ((1.0, "deg/s"), (np.pi / 180, "rad/s")):
        costs = costs_of_rate([factor * x for x in chip], False)
        assert min(costs, key=lambda u: costs[u][0]) == unit
    counts = costs_of_rate([np.round(131 * x) for x in chip], True)
    assert min(counts, key=lambda u: counts[u][0]) == "count"


def test_sigmas_of_three_axes_are_one_of_all():
    columns = {"t": np.arange(2.0), "sx": np.array([3.0, 1.0]), "sy": np.array([4.0, 1.0]), "sz": np.array([5.0, 1.0])}
    guesses = {"t": TIME, **{f"s{a}": Guess("sigma", a, "mg", "its name") for a in "xyz"}}
    (sigma,) = without_duplicates(Log(columns, guesses)).values("sigma")
    np.testing.assert_allclose(sigma, [np.sqrt(50 / 3), 1.0])


def test_a_second_log_is_brought_to_the_clock_of_the_first_from_a_unit_of_its_own():
    t = 0.01 * np.arange(400)
    force = {f"a{a}": np.sin(t) for a in "xyz"}
    rate = {f"g{a}": np.cos(2 * t) for a in "xyz"}
    forces, rates = (
        {f"{letter}{a}": Guess(quantity, a, unit, "") for a in "xyz"}
        for letter, quantity, unit in (("a", "specific_force", "g"), ("g", "angular_rate", "rad/s"))
    )
    first = Log({"t": t, **force}, {"t": TIME, **forces})
    second = Log({"ms": 1e3 * t, **rate}, {"ms": Guess("time", "", "ms", ""), **rates})
    columns = on_one_clock(Path("gyr.csv"), first, second).columns
    assert len(columns["t"]) == 400
    np.testing.assert_allclose(columns["gy"][10:-10], np.cos(2 * t)[10:-10], atol=1e-4)


@pytest.mark.parametrize(("name", "size", "unit"), [("Drehtisch", 90.0, "deg"), ("Drehtisch", 3.0, "rad"),
                                                    ("A [gon]", 3.0, "gon")])  # fmt: skip
def test_angles_beyond_a_turn_are_degrees_where_no_name_tells(name, size, unit):
    assert unit_of_angle(np.array([0.0, size]), name) == unit


def test_rests_are_where_the_accelerometers_are_quiet_whatever_a_hand_does():
    rng = np.random.default_rng(7)
    time, force, _ = turned_by_hand(rng, 10, 50.0)
    tremor = np.radians(0.3) * np.abs(rng.standard_normal(len(time) // 100 + 1)).repeat(100)[: len(time)]
    channels = {("specific_force", a): 9.8 * f for a, f in force.items()}
    channels |= {("angular_rate", a): tremor * rng.standard_normal(len(time)) for a in "xyz"}
    units = {key: "m/s^2" if key[0] == "specific_force" else "rad/s" for key in channels}
    made = unit_log("", time, channels, units, [Path(__file__)])
    assert made.position.max() == 10


def test_offsets_in_seconds_of_time_and_a_latitude_in_the_south(tmp_path):
    head = "# latitude 33.5 S\nHA [deg],Dec [deg],dHA [s],dDec [arcsec]"
    path = write(tmp_path / "s.csv", head, AZ / 6 - 30, EL - 60, OFF[0] / 15, OFF[1], cell="{:.8f}")
    made = propose_recording([path]).recording
    assert made.site.latitude == pytest.approx(np.radians(-33.5))
    np.testing.assert_allclose(off(made, "hour_angle"), OFF[0], atol=0.01)  # a second of time is 15 arcsec
    np.testing.assert_allclose(off(made, "declination"), OFF[1], atol=0.01)


def test_right_ascensions_in_degrees_are_held_against_a_sidereal_time_in_hours(tmp_path):
    hour, lst = AZ / 6 - 30, np.mod(22 + 0.1 * np.arange(30), 24)
    ascension = [np.mod(15 * lst - h, 360) for h in (hour, hour + OFF[0] / 3600)]
    head = "# latitude 48.0\nLST,RA target [deg],RA mount [deg],Dec target [deg],Dec mount [deg]"
    path = write(tmp_path / "r.csv", head, lst, *ascension, EL - 60, EL - 60 + OFF[1] / 3600, cell="{:.10f}")
    made = propose_recording([path]).recording
    np.testing.assert_allclose(np.degrees(made.channels["true_angle", "hour_angle"]), hour, atol=1e-6)
    np.testing.assert_allclose(off(made, "hour_angle"), OFF[0], atol=0.01)
