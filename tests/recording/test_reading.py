"""What is read from a recording folder, and what averaging makes of it."""

import hashlib
import re
from pathlib import Path

import numpy as np
import pytest

from gimbalcal.earth import G0, normal_gravity
from gimbalcal.platform import BENCH, SPACE_STABLE, SPACE_STABLE_INERTIAL, Axis, Platform
from gimbalcal.recording import Recording, Site, dwells, read, write
from gimbalcal.recording.lines import EMPTY, characters_below
from gimbalcal.recording.noise_levels import pooled_scatter
from gimbalcal.recording.samples import batches, column
from tests.golden import golden_text, refused
from tests.paths import ROOT
from tests.recording.folders import DWELL, HEADER, folder, refusal, rows, text


def test_everything_comes_out_in_si(tmp_path):
    target = folder(tmp_path)
    recording = read(target)
    table = rows()
    assert recording.kind == "multi-position"
    assert recording.title == "two positions"
    assert recording.platform == SPACE_STABLE
    assert recording.site == Site(np.radians(40.0), 0.0, 9.80146)
    assert recording.noise == {"accelerometer": pytest.approx(100e-6 * G0)}
    np.testing.assert_array_equal(recording.time, table[:, 0])
    np.testing.assert_allclose(recording.triad("specific_force"), table[:, 2:5] * G0, rtol=1e-15)
    np.testing.assert_allclose(recording.angles()[:, 2], np.radians(table[:, 5]), rtol=1e-15)
    np.testing.assert_array_equal(recording.angles()[:, [0, 1, 3]], 0.0)  # axes that were not logged
    np.testing.assert_allclose(recording.channels["temperature", ""], 22.0, rtol=1e-12)
    assert recording.units["specific_force", "x"] == "g"
    assert recording.has("temperature")
    assert not recording.has("angular_rate")
    assert [(d.position, d.start, d.stop) for d in dwells(recording)] == [(1, 0, 40), (2, 40, 80)]
    assert np.all(recording.weight == 1.0)
    assert recording.remarks == ()


def test_a_sensor_that_counts_backwards(tmp_path):
    header = HEADER.replace('axis = "z", unit = "g"', 'axis = "z", unit = "g", sign = -1')
    right = read(folder(tmp_path))
    backwards = read(folder(tmp_path, header))
    z = ("specific_force", "z")
    np.testing.assert_array_equal(backwards.channels[z], -right.channels[z])
    assert backwards.scatter[z] == right.scatter[z]
    for sign in ("2", "true", '"-"'):
        golden_text(refusal(tmp_path, header.replace("sign = -1", f"sign = {sign}")))


@pytest.mark.parametrize("word", EMPTY)
def test_comments_and_words_for_no_value_far_below_the_names(tmp_path, word):
    names, *lines = text(rows()).splitlines()
    lines[60] = ",".join([*lines[60].split(",")[:-1], word])
    plain, marked = (
        read(folder(tmp_path, samples="\n".join([names, *below]) + "\n"))
        for below in (lines[:60] + lines[61:], [*lines[:70], "# a remark, 1, 2", *lines[70:]])
    )
    np.testing.assert_array_equal(marked.time, plain.time)  # the row without a value is left out
    np.testing.assert_array_equal(marked.triad("specific_force"), plain.triad("specific_force"))


def test_only_characters_below_the_names_are_searched_for(tmp_path):
    path = tmp_path / "samples.csv"
    path.write_text("# n\nnone,N\n" + "1,2\n" * 400_000, encoding="utf-8")  # blocks of a megabyte
    assert (characters_below(path, 2, "#nN"), set(characters_below(path, 0, "#nN"))) == ("", {*"#nN"})
    with path.open("a") as file:
        file.write("3,null\n")
    assert characters_below(path, 2, "#nN") == "n"


def test_sources_carry_their_digest(tmp_path):
    target = folder(tmp_path)
    source = {Path(s.path).name: s.sha256 for s in read(target).source}
    for name in ("recording.toml", "samples.csv"):
        assert source[name] == hashlib.sha256((target / name).read_bytes()).hexdigest()


def test_gravity_from_latitude_where_it_is_absent(tmp_path):
    header = re.sub(r"gravity .*\n", 'height = { value = 60.0, unit = "m" }\n', HEADER)
    site = read(folder(tmp_path, header)).site
    assert site.gravity == pytest.approx(float(normal_gravity(np.radians(40.0), 60.0)), rel=1e-15)


def test_standard_gravity_is_remarked(tmp_path):
    header = re.sub(r"(gravity|latitude) .*\n", "", HEADER)
    recording = read(folder(tmp_path, header))
    assert recording.site.gravity == G0
    golden_text(recording.remarks[0])


def test_numpy_scalar_in_the_header_is_read_with_a_remark(tmp_path):
    header = HEADER.replace("value = 100.0, unit", "value = np.float64(1e2), unit")
    recording = read(folder(tmp_path, header))
    assert recording.noise["accelerometer"] == pytest.approx(100e-6 * G0)
    golden_text(recording.remarks[0])


def test_a_static_run_of_the_space_stable_platform_reads_inertial_angles(tmp_path):
    header = HEADER.replace("multi-position", "static-run")
    assert read(folder(tmp_path, header)).platform == SPACE_STABLE_INERTIAL


def test_axes_spelled_out(tmp_path):
    axes = """\
name = "own"
[[platform.axes]]
name = "middle"
direction = "y"
sign = -1
offset = { value = 90.0, unit = "deg" }
"""
    header = HEADER.replace('name = "space-stable"\n', axes)
    assert read(folder(tmp_path, header)).platform == Platform("own", (Axis("middle", "y", -1, np.pi / 2),))


def test_comments_blank_ends_and_other_columns_do_not_matter(tmp_path):
    lines = text(rows()).splitlines()
    noted = ["# logged by hand", lines[0] + ",note", *(line + ",ok" for line in lines[1:]), "", ""]
    np.testing.assert_array_equal(
        read(folder(tmp_path, samples="\n".join(noted))).triad("specific_force"),
        read(folder(tmp_path)).triad("specific_force"),
    )


def test_csv_and_parquet_are_the_same(tmp_path):
    recording = read(folder(tmp_path))
    again = read(write(recording, tmp_path / "parquet", samples="rows.parquet"))
    for key, values in recording.channels.items():
        np.testing.assert_allclose(again.channels[key], values, rtol=4e-16)


def test_sigma_is_the_header_or_else_the_scatter(tmp_path):
    assert read(folder(tmp_path)).sigma("accelerometer") == pytest.approx(100e-6 * G0)
    header = re.sub(r"accelerometer .*\n", "", HEADER)
    seen = read(folder(tmp_path, header)).sigma("accelerometer")
    # 3 axes x 74 third differences; their relative scatter is about sqrt(1/2/222 * 462/200) = 7 %: within 4 sigma
    assert seen == pytest.approx(100e-6 * G0, rel=0.28)
    assert read(folder(tmp_path)).sigma("gimbal_angle") is None


def test_blocks_start_anew_in_each_position(tmp_path):
    recording = read(folder(tmp_path), average_s=25.0)
    assert recording.weight.tolist() == [25, 15, 25, 15]
    assert recording.position.tolist() == [1, 1, 2, 2]
    table = rows()
    np.testing.assert_allclose(recording.time, [12.0, 32.0, 112.0, 132.0], rtol=1e-15)
    np.testing.assert_allclose(recording.triad("specific_force")[0], table[:25, 2:5].mean(axis=0) * G0, rtol=1e-13)


def test_blocks_cross_batches(tmp_path, monkeypatch):
    target = folder(tmp_path)
    whole = read(target, average_s=25.0)
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", 7)
    parts = read(target, average_s=25.0)
    assert parts.weight.tolist() == whole.weight.tolist()
    np.testing.assert_allclose(parts.triad("specific_force"), whole.triad("specific_force"), rtol=1e-14)
    np.testing.assert_array_equal(parts.position, whole.position)


@pytest.mark.parametrize("batch", [3, 1000])
def test_angles_average_across_the_wrap(tmp_path, monkeypatch, batch):
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", batch)
    table = rows()
    table[:DWELL, 5] = np.where(np.arange(DWELL) % 2, 1.0, 359.0)  # a mean of 0, not of 180
    middle = read(folder(tmp_path, samples=text(table)), average_s=1000.0).angles()[:, 2]
    turned = (middle[0] + np.pi) % (2 * np.pi) - np.pi
    assert turned == pytest.approx(0.0, abs=1e-12)
    assert middle[1] == pytest.approx(np.pi / 2, abs=1e-12)


def test_no_block_reaches_across_a_gap(tmp_path):
    header = HEADER.replace("multi-position", "static-run").replace('position = { quantity = "position" }\n', "")
    recording = read(folder(tmp_path, header), average_s=1000.0)
    assert recording.weight.tolist() == [DWELL, DWELL]
    assert recording.position is None


def test_averaging_twice_is_averaging_once(tmp_path):
    target = folder(tmp_path)
    tens = write(read(target, average_s=10.0), tmp_path / "tens")
    twice, once = read(tens, average_s=40.0), read(target, average_s=40.0)
    assert twice.weight.tolist() == once.weight.tolist() == [40, 40]
    np.testing.assert_allclose(twice.triad("specific_force"), once.triad("specific_force"), rtol=1e-14)


def test_scatter_sees_noise_and_not_the_sidereal_wave():
    rng = np.random.default_rng(3)
    time = 60.0 * np.arange(2880)
    sigma = 6e-5  # m/s^2, under a wave of 7.5 m/s^2
    force = 7.5 * np.cos(7.292115e-5 * time) + sigma * rng.standard_normal(2880)
    seen = pooled_scatter(time, None, {("specific_force", "x"): force})["specific_force", "x"]
    assert seen == pytest.approx(sigma, rel=0.08)  # 4 sigma of 2877 overlapping third differences (2 % each)


def test_the_example_of_the_documentation_is_a_recording(tmp_path):
    page = (ROOT / "docs" / "recording-format.md").read_text(encoding="utf-8")
    example, own, numbered = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    table = rows()[:, [0, 1, 2, 3, 4, 5, 5, 5]]
    recording = read(folder(tmp_path, example, text(table, ["t", "pos", "ax", "ay", "az", "psi", "theta", "phi"])))
    assert recording.axes("gimbal_angle") == ("platform", "inner", "middle")
    header = re.sub(r"(\[platform\]\n.*?\n)\n", own + "\n", HEADER, flags=re.DOTALL).replace(
        '"middle", u', '"pitch", u'
    )
    assert read(folder(tmp_path, header)).platform.axes == (Axis("roll", "x"), Axis("pitch", "y", -1, np.pi / 2))
    header = 'format = 1\nkind = "rotation"\n' + numbered
    dated = "".join(f"2026-11-18T05:33:{i:02d},{f}\n" for i, f in enumerate(rows()[:30, 2]))
    np.testing.assert_allclose(
        read(folder(tmp_path, header, dated)).channels["specific_force", "x"], G0 * rows()[:30, 2]
    )


def test_a_missing_axis_is_named(tmp_path):
    header = re.sub(r"accel_y .*\n", "", HEADER)
    with refused():
        read(folder(tmp_path, header)).triad("specific_force")


def test_unequal_lengths_are_refused():
    with pytest.raises(ValueError, match=r"`specific_force x` must have one value per row of `time` \(3\), got 2"):
        Recording("pointing", "", BENCH, Site(), {}, np.arange(3.0), None, {("specific_force", "x"): np.zeros(2)})


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("name", ["bench [4]", "run*", "~", "a?b", "{x,y}"])
def test_a_path_is_a_path(tmp_path, monkeypatch, name, ending):
    monkeypatch.chdir(tmp_path)
    neighbour, wanted = Path("run2"), Path(name)
    for at, seed in ((neighbour, 1), (wanted, 2)):
        write(read(folder(tmp_path, samples=text(rows(seed)))), at, f"samples{ending}")
    made = read(wanted)
    assert len(made.time) == 2 * DWELL
    assert not np.array_equal(made.triad("specific_force"), read(neighbour).triad("specific_force"))


@pytest.mark.parametrize("batch", [3, 1000])
def test_a_column_alone_keeps_its_place_where_it_is_empty(tmp_path, monkeypatch, batch):
    """At the end of a batch, or of the file, an empty cell of one column is no blank line."""
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", batch)
    path = tmp_path / "samples.csv"
    path.write_text("t,x\n0,0\n1,1\n2,\n3,3\n4,4\n5,\n6,6\n7,\n,\n,\n")
    empty = [2, 5, 7, 8, 9]
    assert np.flatnonzero(np.isnan(column(path, "x"))).tolist() == empty
    assert len(column(path, "x")) == 10
    both = list(batches(path, ["t", "x"]))
    assert np.concatenate([b["t"] for b in both]).tolist() == list(range(8))


def test_a_channel_that_is_cut_short_is_looked_at_again(tmp_path):
    lines = text(rows()).splitlines()
    lines[40:] = [re.sub(r"^([^,]*,[^,]*),[^,]*", r"\1,0.5", line) for line in lines[40:]]
    lines[-1] = ",".join(lines[-1].split(",")[:2] + [""] * 5)
    assert "accel_x" in refusal(tmp_path, samples="\n".join(lines) + "\n")
