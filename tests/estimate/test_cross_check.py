"""Two triads in one recording: read apart, written together, calibrated each, held against each other."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.sharing import cross_check
from gimbalcal.methods import by_sensor, calibrate_each
from gimbalcal.recording import dwell_means, read, write
from gimbalcal.rotation import frame_rotation
from gimbalcal.units import to_si
from tests.estimate.test_sessions import session
from tests.golden import golden_text, refused

MOUNTED = frame_rotation("z", np.radians(30.0)) @ frame_rotation("x", np.radians(-4.0))


def two(seed, error=lambda f: f, moving=False, rests=20):
    """One unit with a second triad, of half the noise, turned by `MOUNTED`; `error` is added to what that one reads."""
    a = session(seed, moving=moving, rests=rests)
    rng = np.random.default_rng(100 + seed)
    clean = session(seed, bias=np.zeros(3), moving=moving, rests=rests, noise=0.0).triad("specific_force")
    f = error(clean @ MOUNTED.T) + to_si(1.0, "mg") * rng.standard_normal(clean.shape)
    own = {("specific_force", axis): f[:, i] for i, axis in enumerate("xyz")}
    b = replace(a.with_channels(own), sensor="b", noise={"accelerometer": 0.01}, title=f"{a.title} (b)")
    return replace(a, sensor="a", title=f"{a.title} (a)", other_sensors=(b,))


def test_two_triads_go_into_a_folder_and_come_back(tmp_path):
    made = two(1, moving=True)
    write(made, tmp_path / "rec")
    header = (tmp_path / "rec" / "recording.toml").read_text()
    assert 'accel_x_b = { quantity = "specific_force", axis = "x", sensor = "b"' in header
    assert header.count('quantity = "angular_rate", axis = "x"') == 1  # of one gyroscope triad, which both share
    back = read(tmp_path / "rec")
    assert [r.sensor for r in back.sensors] == ["a", "b"]
    for one, other in zip(made.sensors, back.sensors, strict=True):
        assert other.title == one.title
        assert other.noise == pytest.approx(one.noise)
        for quantity in ("specific_force", "angular_rate"):
            np.testing.assert_allclose(other.triad(quantity), one.triad(quantity), rtol=1e-12)


def test_unnamed_columns_are_a_sensor_of_their_own(tmp_path):
    write(replace(two(1), sensor=""), tmp_path / "rec")
    assert [r.sensor for r in read(tmp_path / "rec").sensors] == ["", "b"]


def test_rests_and_means_are_those_of_all():
    means = dwell_means(two(2))
    assert [len(r.time) for r in means.sensors] == [20, 20]
    assert not np.allclose(means.triad("specific_force"), means.other_sensors[0].triad("specific_force"))


@pytest.mark.parametrize("seed", range(3))
def test_triads_agree_but_for_how_they_are_mounted(seed):
    a, b = two(10 + seed).sensors
    check = cross_check((a, multiposition(a)), (b, multiposition(b)), ("a", "b"))
    np.testing.assert_allclose(check.rotation, MOUNTED, atol=3e-3)  # the second frame is that of its own input axes
    assert check.agree
    assert 0.3 < check.rms / check.expected < 2.0
    golden_text(check.in_words)


def test_a_law_that_one_triad_follows_alone_shows_in_the_other():
    """A gravity that is wrong in one attitude leaves the norm as it is and the direction not."""

    def leaning(f):
        tilt = 0.02 * (f[:, :1] > 5.0) * np.array([0.0, 1.0, 0.0])  # the sensor leans in its mount, x up
        return f + np.cross(tilt, f)

    a, b = two(20, leaning).sensors
    check = cross_check((a, multiposition(a)), (b, multiposition(b)), ("a", "b"))
    assert not check.agree
    golden_text(check.in_words)
    few = a.select((a.position > 0) & (a.position <= 3))
    with refused():
        cross_check((few, multiposition(a)), (few, multiposition(a)), ("a", "b"))


def test_each_is_calibrated_and_the_command_writes_both(tmp_path, command, capsys):
    write(two(3), tmp_path / "rec")
    (a, _), (b, _) = calibrate_each([tmp_path / "rec"], "multiposition")
    assert a.provenance["options"]["sensor"] == "a"
    assert b.sigmas.sum() < a.sigmas.sum()
    assert "agree" in a.provenance["options"]["cross_check"][0]
    out = tmp_path / "out"
    assert command("calibrate", tmp_path / "rec", "--method", "multiposition", "--out", out, "--quiet") == 0
    assert "The triads a and b" in capsys.readouterr().out
    values = [json.loads((out / sub / "calibration.json").read_text())["parameters"] for sub in (".", "b")]
    assert values[0] != values[1]
    args = ("--calibration", out / "b" / "calibration.json", "--out", tmp_path / "corrected", "--quiet")
    assert command("apply", tmp_path / "rec", *args) == 0
    corrected = dwell_means(read(tmp_path / "corrected")).triad("specific_force")
    assert np.linalg.norm(corrected, axis=1) == pytest.approx(9.80665, abs=8e-3)


@pytest.mark.parametrize("asked", ["calibrate", "diagnose"])
def test_both_results_are_of_one_age_where_the_second_fails(tmp_path, monkeypatch, command, asked):
    """The page of the second sensor cannot be made: nothing of the first is replaced."""
    out = tmp_path / "out"
    for folder in (out, out / "b"):
        folder.mkdir()
        (folder / "report.html").write_text("old")
    write(two(7, rests=8), tmp_path / "rec")
    module = "gimbalcal.report.calibration_page.calibration_report"
    if asked == "diagnose":
        module = "gimbalcal.report.diagnosis_page.diagnosis_report"
    made: list[int] = []

    def page(*_):
        made.append(1)
        if len(made) == 2:
            raise KeyboardInterrupt
        return "<html><body>new</body></html>"

    monkeypatch.setattr(module, page)
    run = (asked, tmp_path / "rec", "--out", out, "--overwrite", "--quiet")
    assert command(*run) == 130
    assert len(made) == 2
    assert [p.relative_to(out).as_posix() for p in sorted(out.rglob("*"))] == ["b", "b/report.html", "report.html"]
    assert {p.read_text() for p in out.rglob("*.html")} == {"old"}
    monkeypatch.setattr(module, lambda *_: "<html><body>new</body></html>")
    assert command(*run) in (0, 1)
    assert all("new" in p.read_text() for p in out.rglob("*.html"))
    assert len(list(out.rglob("calibration.json"))) == 2


def test_recordings_with_other_sensors_do_not_go_together():
    with refused():
        by_sensor([two(4), session(5)])


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('sensor = "b"', 'sensor = "b c"'),
        ('quantity = "position"', 'quantity = "position", sensor = "b"'),
        (', sensor = "b"', ""),
    ],
)
def test_slips_in_naming_sensors(tmp_path, old, new):
    write(replace(two(6), sensor=""), tmp_path / "rec")
    path = tmp_path / "rec" / "recording.toml"
    path.write_text(path.read_text().replace(old, new))
    with refused():
        read(tmp_path / "rec")
