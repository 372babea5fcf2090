"""Long rests come as means while they are read, what is on the way stays as it is, and an estimate is the same."""

import numpy as np
import polars as pl
import pytest

from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import rests_joined_by_turns
from gimbalcal.methods import calibrate
from gimbalcal.recording import read, write
from gimbalcal.recording.dwell import whole_means
from gimbalcal.recording.memory_limit import rows_in
from gimbalcal.recording.streamed_rows import AllRows
from gimbalcal.views.slews import view_of_slews
from tests.diagnose.rows.test_slews import IDEAL, QUICK, unit
from tests.diagnose.turned_plant import gimballed, turned
from tests.golden import golden_text, refused
from tests.paths import DEVICE
from tests.recording.folders import HEADER, folder, text

REST = [1, 29, 30, 30, 4, 1]  # its first and last row, by which turns begin and end, are as they were


@pytest.fixture(autouse=True)
def _a_tenth(monkeypatch):
    monkeypatch.setattr("gimbalcal.recording.reading.SHARE_KEPT", 0.1)


def turned_twice(seed=0, rest=95, way=7):
    """Position 1, on the way, position 2, on the way, position 1 again; the angle goes through north on its way."""
    rng = np.random.default_rng(seed)
    position = np.concatenate([np.full(rest, 1), np.zeros(way), np.full(rest, 2), np.zeros(way), np.full(rest, 1)])
    angle = np.concatenate([
        np.where(np.arange(rest) % 2, 359.9, 0.1), np.linspace(0, 90, way), np.full(rest, 90.0),
        np.linspace(90, 0, way), np.full(rest, 0.0),
    ])  # fmt: skip
    turn = np.deg2rad(angle)
    force = np.stack([np.sin(turn), 0 * turn, -np.cos(turn)], axis=-1) + 1e-4 * rng.standard_normal((len(turn), 3))
    return np.column_stack([np.arange(len(turn)), position, force, angle, np.full(len(turn), 295.0)])


@pytest.mark.parametrize("batch", [6, 50_000])
def test_rests_are_means_and_the_way_is_not(tmp_path, monkeypatch, batch):
    monkeypatch.setattr("gimbalcal.recording.samples.ROWS", batch)
    table = turned_twice()
    target = folder(tmp_path, samples=text(table))
    r = read(target, most=100)  # 299 rows, of which a tenth of 100 are to be left: means over 30
    assert r.weight.tolist() == [*REST, *[1] * 7, *REST, *[1] * 7, *REST]
    assert r.position.tolist() == [1] * 6 + [0] * 7 + [2] * 6 + [0] * 7 + [1] * 6
    np.testing.assert_allclose(r.time[:7], [0.0, 15.0, 44.5, 74.5, 91.5, 94.0, 95.0])
    whole = read(target)
    np.testing.assert_array_equal(r.triad("specific_force")[5:14], whole.triad("specific_force")[94:103])
    mean = whole.triad("specific_force")[103:132].mean(axis=0)
    np.testing.assert_allclose(r.triad("specific_force")[14], mean, rtol=1e-13)
    assert abs((r.angles()[2, 2] + 1) % (2 * np.pi) - 1) < 1e-12  # 359.9 and 0.1 deg are 0
    assert r.scatter == whole.scatter  # of the rows, not of their means
    golden_text(r.remarks[-1])


def test_rows_that_fit_stay(tmp_path):
    target = folder(tmp_path, samples=text(turned_twice()))
    r = read(target, most=400)
    assert len(r.time) == 299
    assert not any("means over" in remark for remark in r.remarks)


def test_rests_that_are_to_be_found_need_every_row(tmp_path):
    header = HEADER.replace('position = { quantity = "position" }\n', "")
    assert len(read(folder(tmp_path, header, text(turned_twice())), most=100).time) == 299


def test_a_weight_that_is_no_whole_number_leaves_positions_what_they_are(tmp_path):
    table = turned_twice()
    weight = np.random.default_rng(1).uniform(0.1, 3.0, len(table))
    names = ["time_s", "position", "accel_x", "accel_y", "accel_z", "middle", "temp", "n"]
    samples = text(np.column_stack([table, weight]), names)
    r = read(folder(tmp_path, HEADER + 'n = { quantity = "weight" }\n', samples), most=100)
    assert r.position.tolist() == [1] * 6 + [0] * 7 + [2] * 6 + [0] * 7 + [1] * 6
    assert r.weight.sum() == pytest.approx(weight.sum())


def test_rows_of_a_file_are_counted_or_told_by_its_size(tmp_path):
    table = pl.DataFrame({"a": np.random.default_rng(0).standard_normal(200_000)})
    table.write_parquet(tmp_path / "t.parquet")
    table.write_csv(tmp_path / "t.csv")
    assert rows_in(tmp_path / "t.parquet") == 200_000
    assert rows_in(tmp_path / "t.csv") == pytest.approx(200_000, rel=0.01)
    (tmp_path / "no.parquet").write_bytes(b"PAR1 and then nothing")
    assert rows_in(tmp_path / "no.parquet") == rows_in(tmp_path / "none.csv") == 0


@pytest.mark.parametrize("method", ["three-stage", "multiposition"])
def test_a_calibration_of_means_is_that_of_every_row(monkeypatch, method):
    whole, _ = calibrate([DEVICE], method)
    monkeypatch.setattr("gimbalcal.pipeline.MOST_ROWS", 1000)
    made, _ = calibrate([DEVICE], method)
    np.testing.assert_allclose((made.values - whole.values) / whole.sigmas, 0, atol=1e-6)
    np.testing.assert_allclose(made.sigmas, whole.sigmas, rtol=1e-6)


def test_gyroscopes_at_rest_know_what_their_rows_are_means_of(tmp_path):
    r = gimballed(3, unit(), **QUICK)
    target = write(r, tmp_path / "rec")
    whole, means = read(target), read(target, most=len(r.time) // 2)
    every, fewer = rests_joined_by_turns(whole, IDEAL), rests_joined_by_turns(means, IDEAL)
    np.testing.assert_allclose(fewer.evaluate(()).residual, every.evaluate(()).residual, atol=1e-12)
    sigma = [np.median(np.asarray(v.noise.sigma)) for v in (fewer, every)]
    np.testing.assert_allclose(sigma[0], sigma[1], rtol=0.15)


def test_a_delay_is_not_looked_for_beside_means(tmp_path):
    def seen(recording):
        return view_of_slews(recording, IDEAL)

    target = write(gimballed(6, unit(), **QUICK), tmp_path / "rec")
    assert not isinstance(seen(read(target)), str)
    assert "come as means" in str(seen(read(target, most=2000)))


@pytest.mark.parametrize("expected", [0, 7, 1000])
def test_rows_are_kept_however_many_were_expected(expected):
    rng = np.random.default_rng(expected)
    kept, parts = AllRows(expected), [rng.standard_normal((n, 2)) for n in (3, 1, 400, 0, 50)]
    for part in parts:
        kept.add({"a": part[:, 0], "b": part[:, 1]}, np.zeros(len(part), dtype=bool))
    table, whole = kept.table(), np.concatenate(parts)
    np.testing.assert_array_equal(table["a"], whole[:, 0])
    np.testing.assert_array_equal(table["b"], whole[:, 1])


@pytest.mark.parametrize("piece", [25, 10_000_000])
def test_a_frozen_channel_is_named_by_its_line_in_whatever_piece(tmp_path, monkeypatch, piece):
    monkeypatch.setattr("gimbalcal.checks.column_checks.PIECE", piece)
    table = turned_twice()
    table[125:150, 3] = table[125, 3]
    with refused():
        read(folder(tmp_path, samples=text(table)))


def test_readings_in_coarse_steps_are_not_frozen_in_any_piece(tmp_path, monkeypatch):
    monkeypatch.setattr("gimbalcal.checks.column_checks.PIECE", 40)
    table = turned_twice()
    table[:, 3] += 0.004 * (table[:, 1] == 2)  # it stands still in each rest, and is alive
    table[:, 2:5] = np.round(table[:, 2:5] * 500) / 500
    assert len(read(folder(tmp_path, samples=text(table))).time) == len(table)


def test_a_unit_turned_by_hand_is_the_same_from_means(tmp_path, monkeypatch):
    """Turns go from the last row of a rest to the first of the next, and the noise of its grade is that of samples."""
    r = turned(6, unit())
    target = write(r, tmp_path / "rec")
    whole, _ = calibrate([target], "multiposition")
    monkeypatch.setattr("gimbalcal.pipeline.MOST_ROWS", len(r.time) // 2)
    made, (means,) = calibrate([target], "multiposition")
    assert len(means.time) < 0.8 * len(r.time)
    assert [p.label for p in made.parameters] == [p.label for p in whole.parameters]
    assert any(p.effect == "gyro_scale_factor" for p in made.parameters)
    np.testing.assert_allclose((made.values - whole.values) / whole.sigmas, 0, atol=0.2)
    np.testing.assert_allclose(made.sigmas, whole.sigmas, rtol=0.15)


def test_rows_that_are_to_weigh_alike_are_those_of_whole_means(tmp_path):
    """The ends of a rest, of one sample each, would pass for noise many times what a mean over a thousand has."""
    kept = whole_means(read(folder(tmp_path, samples=text(turned_twice())), most=100))
    assert kept.weight.tolist() == [29, 30, 30] * 3
    assert kept.position.tolist() == [1, 1, 1, 2, 2, 2, 1, 1, 1]


@pytest.mark.parametrize("piece", [40, 10_000_000])
def test_all_frozen_stretches_are_listed_at_once(tmp_path, monkeypatch, piece):
    monkeypatch.setattr("gimbalcal.checks.column_checks.PIECE", piece)
    table = turned_twice()
    for start, stop in ((5, 30), (125, 155), (230, 256)):
        table[start:stop, 3] = table[start, 3]
    with refused():
        read(folder(tmp_path, samples=text(table)))
