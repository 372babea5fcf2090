"""Writing loses nothing, leaves nothing behind when it fails, and keeps to its folder."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gimbalcal.platform import BENCH, SPACE_STABLE, SPACE_STABLE_INERTIAL, Axis, Platform
from gimbalcal.recording import Recording, Site, join, read, write
from gimbalcal.recording.record import UNKNOWN_SITE
from tests.golden import refused
from tests.recording.folders import HEADER, folder

FINITE = st.floats(-1e6, 1e6)


@st.composite
def recordings(draw):
    """Any recording that the format can hold, short enough not to be called frozen."""
    n = draw(st.integers(1, 12))
    column = st.lists(FINITE, min_size=n, max_size=n).map(np.array)
    kind, platform = draw(st.sampled_from([("multi-position", SPACE_STABLE), ("static-run", SPACE_STABLE_INERTIAL)]))
    own = Platform("own", (Axis("platform", "z", -1, 0.25), Axis("tilt", "x")))
    platform = draw(st.sampled_from([platform, own, BENCH]))
    unit = draw(st.sampled_from(["m/s^2", "ug", "count"]))
    keys = {("specific_force", a): unit for a in "xyz"} | {("temperature", ""): "K", ("temperature", "lid"): "degC"}
    keys |= {("covariate", "coil (north)"): "V"} | {("gimbal_angle", a): "deg" for a in platform.axis_names}
    angle = st.lists(st.floats(-6.0, 6.0), min_size=n, max_size=n).map(np.array)
    force = st.lists(st.floats(-90.0, 90.0), min_size=n, max_size=n).map(np.array)  # what a unit at rest may read
    warmth = st.lists(st.floats(-270.0, 1900.0), min_size=n, max_size=n).map(np.array)
    of = {"gimbal_angle": angle, "specific_force": force, "temperature": warmth}
    channels = {key: draw(of.get(key[0], column)) for key in keys}
    steps = draw(st.lists(st.floats(10.0, 90.0), min_size=n, max_size=n))  # no pause that would be a jump of the clock
    weight = draw(st.lists(st.integers(1, 500), min_size=n, max_size=n))
    visits = draw(st.lists(st.integers(0, 30), min_size=n, max_size=n))
    return Recording(
        kind=kind,
        title=draw(st.text(st.characters(codec="utf-8"), max_size=20)),
        platform=platform,
        site=Site(draw(st.floats(-1.5, 1.5)), draw(st.floats(-400, 9000)), draw(st.floats(9.76, 9.84))),
        noise={"accelerometer": draw(st.floats(0.0, 1.0))},
        time=np.cumsum(steps),
        position=None if kind == "static-run" else np.array(visits, dtype=np.int64),
        channels=channels,
        weight=np.array(weight, dtype=float),
        units=keys,
    )


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(recording=recordings(), samples=st.sampled_from(["samples.csv", "a b.parquet"]))
def test_what_is_written_is_read(tmp_path, recording, samples):
    again = read(write(recording, tmp_path / "round", samples=samples))
    assert (again.kind, again.title, again.platform) == (recording.kind, recording.title, recording.platform)

    # Values pass through their unit and back: two roundings each way.
    def close(got, expected):
        np.testing.assert_allclose(np.asarray(got, dtype=float), np.asarray(expected, dtype=float), rtol=1e-15)

    assert again.site.gravity == recording.site.gravity
    assert again.site.height == recording.site.height
    close(again.site.latitude, recording.site.latitude)
    close(again.noise["accelerometer"], recording.noise["accelerometer"])
    np.testing.assert_array_equal(again.time, recording.time)
    np.testing.assert_array_equal(again.weight, recording.weight)
    assert (again.position is None) == (recording.position is None)
    if again.position is not None:
        np.testing.assert_array_equal(again.position, recording.position)
    assert set(again.channels) == set(recording.channels)
    for key, values in recording.channels.items():
        close(again.channels[key], values)


@pytest.mark.parametrize("site", [Site(), UNKNOWN_SITE], ids=["stated", "anywhere"])
def test_gravity_that_was_stated_stays_exact_and_that_of_anywhere_uncertain(tmp_path, site):
    rest = Recording("multi-position", "rests", BENCH, site, {}, np.arange(3.0), np.arange(3) + 1, {
        ("specific_force", axis): np.full(3, 5.0) for axis in "xyz"
    })  # fmt: skip
    again = read(write(rest, tmp_path / "round")).site
    assert (again.gravity, again.gravity_sigma) == (site.gravity, pytest.approx(site.gravity_sigma, abs=1e-12))


def test_nothing_is_left_when_writing_fails(tmp_path, monkeypatch):
    recording = read(folder(tmp_path))

    def full(*_):
        raise OSError("no space left on device")

    monkeypatch.setattr("gimbalcal.recording.writing._write_rows", full)
    with pytest.raises(OSError, match="no space left"):
        write(recording, tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rec"]


def test_writing_keeps_strangers_in_the_folder(tmp_path):
    recording = read(folder(tmp_path))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "truth.json").write_text("{}")
    write(recording, tmp_path / "out")
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"truth.json", "recording.toml", "samples.csv"}


def test_writing_refuses_a_name_outside(tmp_path):
    recording = read(folder(tmp_path))
    with refused():
        write(recording, tmp_path / "out", samples="../x.csv")


def test_when_it_was_recorded_goes_with_it(tmp_path):
    for said, told in (("2024-03-01", "2024-03-01"), ('"2024-03-01"', "2024-03-01"),
                       ("2024-03-01T05:00:00+01:00", "2024-03-01T05:00:00+01:00"), ('""', "")):  # fmt: skip
        made = read(folder(tmp_path, HEADER.replace("format = 1", f"format = 1\ndate = {said}")))
        assert made.date == told
        assert read(write(made, tmp_path / "again")).date == told
    assert read(folder(tmp_path)).date == ""
    assert join([made, replace(made, date="2025-01-01", source=())]).date == "2025-01-01"
