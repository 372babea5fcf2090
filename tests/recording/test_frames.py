"""Recordings from arrays and data frames pass the checks of files and give what files give."""

import numpy as np
import polars as pl
import pytest

from gimbalcal.earth import G0
from gimbalcal.recording import from_arrays, from_frame, read
from tests.golden import refused
from tests.paths import XSENS

COLUMNS = {
    "time_s": "time [s]", "position": "position", "weight": "weight",
    **{f"accel_{a}": f"specific_force {a} [count]" for a in "xyz"},
    **{f"gyro_{a}": f"angular_rate {a} [count]" for a in "xyz"},
}  # fmt: skip
NOISE = {"accelerometer": (2.9084672461633825, "count"), "gyroscope": (25.291780960687827, "count")}


class Pandas:
    """What is used of a pandas frame: columns, and a column by its name."""

    def __init__(self, frame):
        self.frame, self.columns = frame, frame.columns

    def __getitem__(self, name):
        return self.frame[name].to_numpy()


def same(a, b):
    np.testing.assert_array_equal(a.time, b.time)
    np.testing.assert_array_equal(a.position, b.position)
    assert a.channels.keys() == b.channels.keys()
    for key in a.channels:
        np.testing.assert_array_equal(a.channels[key], b.channels[key])
    assert a.noise == b.noise
    assert a.scatter == b.scatter
    assert a.units == b.units


@pytest.mark.parametrize("unit", ["m/s^2", "g"])
@pytest.mark.parametrize("position", [True, False])
def test_a_recording_has_arrays_of_its_own(unit, position):
    rng = np.random.default_rng(1)
    frame = {"t": np.arange(400.0), "w": np.ones(400), "p": np.repeat([1.0, 2.0], 200)}
    frame |= {a: (a == "z") + 1e-3 * rng.standard_normal(400) for a in "xyz"}
    before = {name: x.copy() for name, x in frame.items()}
    columns = {"t": "time [s]", "w": "weight", **({"p": "position"} if position else {})}
    made = from_frame(frame, columns | {a: f"specific_force {a} [{unit}]" for a in "xyz"})
    for x in (made.time, made.weight, made.position, *made.channels.values()):
        assert not any(np.shares_memory(x, each) for each in frame.values())
        x[:] = 7
    for name, x in frame.items():
        np.testing.assert_array_equal(x, before[name])


@pytest.mark.parametrize("kind", ["polars", "dictionary", "pandas"])
def test_a_frame_is_the_file(kind):
    frame = pl.read_csv(XSENS / "samples.csv")
    given = {"polars": frame, "dictionary": frame.to_dict(as_series=False), "pandas": Pandas(frame)}[kind]
    made = from_frame(given, COLUMNS, title="Xsens", noise=NOISE)
    same(made, read(XSENS))
    assert len(made.source[0].sha256) == 64
    assert made.source == from_frame(frame, COLUMNS, noise=NOISE).source


def test_arrays_are_the_file_and_stay_as_they_were():
    r = read(XSENS)
    f, w = r.triad("specific_force"), r.triad("angular_rate")
    before = f.copy()
    made = from_arrays(
        r.time, specific_force=f, angular_rate=w, position=r.position, weight=r.weight, noise=NOISE,
        units={"specific_force": "count", "angular_rate": "count"},
    )  # fmt: skip
    same(made, r)
    in_g = from_arrays(r.time, specific_force=f / 3e4, position=r.position, units={"specific_force": "g"})
    np.testing.assert_allclose(in_g.triad("specific_force"), f / 3e4 * 9.80665, rtol=1e-15)
    np.testing.assert_array_equal(f, before)


def test_angles_and_covariates_by_axis_and_dates():
    n = 200
    rng = np.random.default_rng(1)
    f = rng.standard_normal((n, 3)) * 1e-3 + [0, 0, -9.8]
    made = from_arrays(
        np.datetime64("2026-11-22T10:00:00") + np.arange(n).astype("m8[s]"), specific_force=f,
        gimbal_angle={"inner": np.zeros(n), "middle": 1e-6 * rng.standard_normal(n)}, platform="space-stable",
        position=np.ones(n), temperature=20 + 0.1 * rng.standard_normal(n), covariate={"fan": rng.standard_normal(n)},
        units={"gimbal_angle": "deg", "covariate": "V"}, site={"latitude": (40.0, "deg")},
    )  # fmt: skip
    np.testing.assert_allclose(np.diff(made.time), 1.0)
    assert made.axes("gimbal_angle") == ("inner", "middle")
    assert made.axes("covariate") == ("fan",)
    assert made.site.latitude == pytest.approx(np.radians(40))
    assert "2026-11-22" in made.remarks[-1]


def test_rests_are_found_as_in_a_file():
    rng = np.random.default_rng(2)
    still = np.eye(3) * 9.8
    f = np.concatenate([np.r_[np.tile(u, (300, 1)), rng.standard_normal((60, 3)) * 4 + u] for u in still])
    made = from_arrays(np.arange(len(f)) / 100, specific_force=f + 1e-3 * rng.standard_normal(f.shape))
    assert made.position.max() == 3


@pytest.mark.parametrize(
    "change",
    [
        {"specific_force": np.zeros((5, 2))},
        {"specific_force": np.zeros((4, 3))},
        {"specific_force": np.array([[1.0, 1, np.inf]] * 5)},
        {"units": {"specific_force": "deg"}},
        {"units": {"angular_rate": "deg/s"}},
        {"drag": np.zeros(5)},
        {"temperature": np.zeros((5, 2))},
        {"time": np.array([0.0, 1, 1, 2, 3])},
        {"noise": {"accelerometer": 3.0}},
        {"platform": "raft"},
    ],
)
def test_what_a_file_is_refused_for(change):
    given: dict[str, object] = {"time": np.arange(5.0), "specific_force": np.ones((5, 3)), "position": np.ones(5)}
    with refused():
        from_arrays(**{**given, **change})


def test_columns_that_are_not_there_and_words_that_say_nothing():
    with refused():
        from_frame({"t": [0.0]}, {"tt": "time [s]"})
    with refused():
        from_frame({"t": [0.0]}, {"t": "time in s"})
    with refused():
        from_frame({"t": [0.0], "a": ["x"]}, {"t": "time [s]", "a": "specific_force x [g]"})


def test_arrays_may_say_when_they_were_recorded():
    t = np.arange(100) / 10
    force = np.tile([0.0, 0.0, G0], (100, 1)) + 1e-3 * np.random.default_rng(1).standard_normal((100, 3))
    assert from_arrays(t, specific_force=force, date="2026-11-18").date == "2026-11-18"
    with refused():
        from_arrays(t, specific_force=force, date="soon")
