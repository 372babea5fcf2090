"""Inputs that look odd and are not wrong, and positions that are wrong and are named."""

import json
from datetime import datetime, timedelta, timezone

import numpy as np
import polars as pl
import pytest

from gimbalcal.methods import calibrate
from tests.bad_input.spoil import (
    FORCE,
    GIMBALS,
    TURN,
    Change,
    G,
    both,
    called,
    column,
    copy,
    data,
    header,
    held,
    interchanged,
    lines,
    lost,
    mis_set,
    parquet,
    put,
    rows,
    table,
    times,
    without,
)
from tests.golden import golden_text
from tests.paths import DEVICE


def backwards(held, at):
    """The positions visited from 18 down to 1."""
    parts, begin = [], 0.0
    for position in range(18, 0, -1):
        part = held[held[:, at["position"]] == position]
        part[:, at["time_s"]] += begin - part[0, at["time_s"]]
        begin = part[-1, at["time_s"]] + 40.0
        parts.append(part)
    return np.concatenate(parts)


def again(held, at):
    """Position 4 once more at the end."""
    part = held[held[:, at["position"]] == 4]
    part[:, at["time_s"]] += held[-1, at["time_s"]] + 60.0 - part[0, at["time_s"]]
    return np.concatenate([held, part])


def with_moves(held, at):
    """Three hundred rows of motion, position 0, between the dwells, logged faster than at rest."""
    rng = np.random.default_rng(1)
    parts = []
    for position in range(1, 19):
        parts.append(held[held[:, at["position"]] == position])
        after = held[held[:, at["position"]] == position + 1]
        if len(after):
            moving = np.linspace(parts[-1][-1], after[0], 302)[1:-1]
            moving[:, at["position"]] = 0
            moving[:, [at[name] for name in FORCE]] += 0.5 * rng.standard_normal((300, 3))
            parts.append(moving)
    return np.concatenate(parts)


def as_text(form):
    return lambda folder: put(folder, *table(folder), form)


def whole(value):
    return str(int(value)) if value == int(value) else repr(value)


def integers(frame):
    """Column types as a logger has them."""
    angles = [pl.col(name).round().cast(pl.Int32) for name in GIMBALS]
    return frame.with_columns(pl.col("position").cast(pl.UInt8), pl.col("time_s").cast(pl.Int64), *angles)


def dated(text):
    """The clock as a logger in another zone writes it, whole seconds without a fraction."""
    at = text[0].split(",").index("time_s")
    zero = datetime(2026, 11, 18, 23, 59, 50, tzinfo=timezone(timedelta(hours=-9.5)))
    cells = [line.split(",") for line in text[1:]]
    for row in cells:
        row[at] = (zero + timedelta(seconds=float(row[at]))).isoformat()
    return [text[0], *(",".join(row) for row in cells)]


def by_number(folder):
    """`recording.toml` calls the columns by number."""
    names = (DEVICE / "samples.csv").read_text().partition("\n")[0].split(",")
    for i, name in enumerate(names, start=1):
        header(rf"(?m)^{name}\s*=", f"{i} =")(folder)


def windows(folder):
    for name in ("recording.toml", "samples.csv"):
        data(lambda b: b"\xef\xbb\xbf" + b.replace(b"\n", b"\r\n"), name)(folder)


SAME: dict[str, Change] = {
    "byte order mark and CRLF": windows,
    "integers where they are whole": as_text(whole),
    "scientific notation": as_text(lambda value: f"{value:.16E}"),
    "quoted numbers": lines(lambda v: [v[0], *(",".join(f'"{c}"' for c in line.split(",")) for line in v[1:])]),
    "an unknown column of text": lines(lambda v: [v[0] + ",remark", *(line + ",all is well" for line in v[1:])]),
    "blank lines at the end": lines(lambda v: [*v, "", ""]),
    "a clock from 1970 on": column("time_s", lambda t: t + 1.7e9),
    "a clock before zero": column("time_s", lambda t: t - 1e6),
    "moves between the dwells": rows(with_moves),
    "positions backwards": rows(backwards),
    "blanks around names and numbers": lines(lambda v: [w.replace(",", " , ") for w in v]),
    "a row without a value": lines(lambda v: [*v[:40], ",".join([*v[40].split(",")[:3], ""]), *v[40:]]),
    "dates for a clock": lines(dated),
    "a line of numbers for the names": both(data(lambda b: b.partition(b"\n")[2]), by_number),
    "a pause of three days": column("time_s", lambda t: t + 259200, 540),
    "Parquet of dates": parquet(lambda f: f.with_columns(time_s=pl.from_epoch(pl.col("time_s").cast(pl.Int64)))),
    "Parquet": parquet(),
    "Parquet of integers": parquet(integers),
    "no temperature": without("temperature"),
    "no latitude": header(r"latitude = .*\n", ""),
    "angles in radians": both(times(TURN, *GIMBALS), called("rad", "deg", *GIMBALS)),
    "force in g": both(times(1 / G, *FORCE), called("g", "m/s^2", *"xyz")),
}


@pytest.fixture(scope="module")
def reference():
    """The parameters of the untouched recording."""
    return by_label(calibrate([DEVICE])[0].to_dict())


def by_label(content):
    return {(p["name"], p["axis"]): p for p in content["parameters"]}


@pytest.mark.parametrize("oddity", SAME)
def test_what_looks_odd_changes_nothing(run, tmp_path, reference, oddity):
    status, out, err = run("calibrate", copy(DEVICE, tmp_path / "rec", SAME[oddity]), "--quiet", "--json")
    assert (status, err) == (0, ""), err
    made = by_label(json.loads(out))
    assert made.keys() == reference.keys()
    for label, parameter in reference.items():
        # rounding only: 1e-9 m/s^2 of 1e-4 m/s^2 noise; integers and sums over other blocks keep far within
        assert made[label]["value"] == pytest.approx(parameter["value"], abs=1e-4 * parameter["sigma"]), label
        assert made[label]["sigma"] == pytest.approx(parameter["sigma"], rel=1e-4), label


@pytest.mark.parametrize(
    ("change", "seen"),
    [(lost(4), 17), (lost(4, 10, 15), 17), (lost(1, 2), 17), (rows(again), 17), (held(1, 2, 3, 4, 5, 6), 15)],
)
def test_what_positions_are_left_still_calibrates(run, tmp_path, reference, change, seen):
    status, out, _ = run("calibrate", copy(DEVICE, tmp_path / "rec", change), "--quiet", "--json")
    content = json.loads(out)
    assert (status, content["outcome"]) == (0, "")
    golden_text(content["provenance"].get("lost", "every position is there"))
    made = by_label(content)
    assert len(made) - len(content["unobservable"]) == seen
    for label, parameter in reference.items():
        # the same noise less some rows: five sigma of the poorer result is generous for the correlated difference
        sigma = max(made[label]["sigma"], parameter["sigma"])
        assert abs(made[label]["value"] - parameter["value"]) < 5 * sigma, label


@pytest.mark.parametrize(
    "change", [interchanged(4, 10), mis_set(7, "inner", 3 / 60), mis_set(7, "inner", 2.0), mis_set(12, "middle", -2.0)]
)
def test_a_wrong_position_is_named_and_left_out(run, tmp_path, reference, change):
    status, out, err = run("calibrate", copy(DEVICE, tmp_path / "rec", change), "--quiet", "--json")
    content = json.loads(out)
    assert (status, err) == (1, "")
    golden_text(content["outcome"])
    made = by_label(content)
    for label, parameter in reference.items():
        # nothing of the fault has leaked in: 2 deg are 7200 sigma of a setting
        sigma = max(made[label]["sigma"], parameter["sigma"])
        assert abs(made[label]["value"] - parameter["value"]) < 5 * sigma, label


def test_an_odd_gravity_is_remarked(run, tmp_path):
    folder = copy(DEVICE, tmp_path / "rec", header("value = 9.8015", "value = 9.7515"))
    status, out, _ = run("calibrate", folder, "--quiet", "--json")
    assert status == 0
    content = json.loads(out)
    (remark,) = content["provenance"]["remarks"]
    golden_text(remark)
    sigmas = [p["sigma"] for p in content["parameters"] if p["name"] == "scale_factor"]
    assert min(sigmas) == pytest.approx(5101, rel=1e-3)  # nobody says that it was measured
