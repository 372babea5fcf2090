"""Single mistakes in headers and columns of recordings of every kind, each with the words of the right remedy."""

import shutil
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from gimbalcal.number import Array
from gimbalcal.recording import write
from gimbalcal.simulate import simulate
from gimbalcal.simulate.scenario import find
from tests.bad_input.spoil import Change, both, called, column, header, lines, rows, swapped, times, without
from tests.estimate.pointing.mounts import ALT_AZ, effects, run, sky
from tests.paths import DATA

AXES = "xyz"
DWELL = 5  # whose rows are changed where one is


@dataclass(frozen=True)
class Mistake:
    """One change to a good recording; remedy: patterns that the sentence about it has to match, all of them.

    shown: whether the data can show the mistake at all.
    """

    kind: str
    name: str
    change: Change
    remedy: tuple[str, ...]
    shown: bool = True


def recordings(place: Path) -> None:
    """Write a good recording of every kind into `place`."""
    for name in ("space_stable_18", "space_stable_static"):
        shutil.copytree(DATA / name, place / {"space_stable_18": "gimbals"}.get(name, "static"))
    unit = tomllib.loads(find("turned-unit").read_text(encoding="utf-8"))
    unit["schedule"] |= {"dwell": {"value": 6.0, "unit": "s"}, "rate": {"value": 25.0, "unit": "Hz"}}
    unit["schedule"]["holds"] = unit["schedule"]["holds"][:24]
    del unit["truth"]["gyro_scale_nonlinearity"]  # whose size itself is a question
    _simulated(unit, place / "table")
    shutil.copytree(place / "table", place / "hand")
    both(without("inner", "middle", "outer"), header("three-axis-table", "bench"))(place / "hand")
    turned = tomllib.loads(find("cai2016-18").read_text(encoding="utf-8"))
    turned["schedule"] |= {"rate": {"value": 10.0, "unit": "Hz"}, "sweeps": 1}
    for name in ("cross_coupling", "quadratic_nonlinearity"):  # whose size itself is a question
        del turned["truth"][name]
    _simulated(turned, place / "rotation")
    sizes = {"gimbal_zero__azimuth": 900.0, "gimbal_zero__elevation": -400.0, "axis_collimation": 60.0}
    mount = run(ALT_AZ, sky(ALT_AZ), effects(ALT_AZ, **sizes), noise=5.0)
    write(mount, place / "pointing")


def _simulated(scenario: dict[str, object], folder: Path) -> None:
    write(simulate(scenario, 5)[0], folder)


def _sensor(kind: str, stem: str, unit: str, others: tuple[str, ...], sensor: str) -> Iterator[Mistake]:
    """Mistakes of a triad of columns stem_x, stem_y, stem_z in a unit."""
    names = [f"{stem}_{a}" for a in AXES]
    for a, name in zip(AXES, names, strict=True):
        yield Mistake(kind, f"{name} reversed", times(-1, name), (r"sign|revers", rf"{name}|\b{a}\b"))
        yield Mistake(
            kind, f"{name} stated in {others[0]}", called(others[0], unit, a), (r"unit|\bin \S+ ", rf"{name}|\b{a}\b")
        )
    yield Mistake(kind, f"{stem} reversed", times(-1, *names), ("sign|revers",))
    for a, b in combinations(names, 2):
        yield Mistake(
            kind, f"{a} and {b} exchanged", swapped(a, b), (r"exchang|swap|interchang|order|another axis|axes|axis",)
        )
    yield Mistake(
        kind,
        f"{stem} x y z as y z x",
        both(swapped(names[0], names[1]), swapped(names[1], names[2])),
        (r"exchang|swap|order|axes|axis",),
    )
    for other in others:
        yield Mistake(
            kind, f"{sensor} stated in {other}", called(other, unit, *AXES), (r"unit|\bin \S+ |m/s|rad/s|deg",)
        )
    yield Mistake(
        kind,
        f"{names[1]} frozen",
        column(names[1], lambda v: 0 * v + v[0]),
        (names[1] + "|stands? still|same value|frozen|constant",),
    )


def _gimbals(kind: str, names: tuple[str, ...], unit: str, others: tuple[str, ...], dwell: slice) -> Iterator[Mistake]:
    for name in names:
        yield Mistake(kind, f"{name} reversed", times(-1, name), (r"sign|revers|other way|direction", name))
        yield Mistake(kind, f"{name} stated in {others[0]}", called(others[0], unit, name), (rf"{unit}|unit", name))
        for off in (30.0, 1.0) if dwell.stop else ():
            change = column(name, lambda v, off=off: v + off, dwell.start, dwell.stop)
            yield Mistake(kind, f"{name} of one position off by {off:g} deg", change, (rf"\b{DWELL}\b",))
    for a, b in combinations(names, 2):
        yield Mistake(kind, f"{a} and {b} exchanged", swapped(a, b), (r"exchang|swap|interchang|order|axes|axis",))
    for other in others:
        yield Mistake(kind, f"gimbals stated in {other}", called(other, unit, *names), (rf"\b{unit}\b|unit",))
    by = dwell.stop - dwell.start
    late = rows(partial(_late, names=names, by=by or 50))
    yield Mistake(kind, f"gimbals late by {by or 50} rows", late, (r"position|late|row|gimbal|platform|inner",))


def _late(held: Array, at: dict[str, int], names: tuple[str, ...], by: int) -> None:
    held[:, [at[n] for n in names]] = np.roll(held[:, [at[n] for n in names]], by, axis=0)


def _site(kind: str, gravity: bool, latitude: float) -> Iterator[Mistake]:
    def value(key: str, new: str) -> Change:
        return header(rf"(?m)^{key} = .*$", f"{key} = {new}")

    if gravity:
        for new, unit in (("980.15", "m/s^2"), ("1.0", "m/s^2"), ("9.83", "m/s^2"), ("9.81", "m/s^2")):
            yield Mistake(
                kind, f"gravity {new} {unit}", value("gravity", f'{{ value = {new}, unit = "{unit}" }}'), ("gravity",)
            )
    yield Mistake(
        kind,
        "latitude in rad stated in deg",
        value("latitude", f'{{ value = {np.radians(latitude):.6f}, unit = "deg" }}'),
        ("latitude|gravity",),
    )
    yield Mistake(
        kind, "latitude stated in rad", value("latitude", f'{{ value = {latitude}, unit = "rad" }}'), ("latitude",)
    )
    yield Mistake(
        kind,
        "latitude off by 10 deg",
        value("latitude", f'{{ value = {latitude + 10}, unit = "deg" }}'),
        ("latitude|gravity",),
    )
    yield Mistake(
        kind,
        "latitude of the other hemisphere",
        value("latitude", f'{{ value = {-latitude}, unit = "deg" }}'),
        ("latitude",),
        kind in ("static", "rotation"),
    )


def _rows(kind: str, force: str, gyro: str = "", gimbal: str = "", dwell: slice = slice(0, 0)) -> Iterator[Mistake]:
    """Mistakes of single rows, of the clock and of the kind."""
    for unit, shown in (("ms", bool(gyro) or kind == "static"), ("min", bool(gyro) or kind == "static")):
        yield Mistake(
            kind,
            f"time stated in {unit}",
            header(r'(quantity = "time", unit = )"s"', f'quantity = "time", unit = "{unit}"'),
            (r"time|clock|unit|\bs\b",),
            shown,
        )
    yield Mistake(
        kind, "a row twice", lines(lambda held: [*held[:40], held[39], *held[40:]]), (r"row|time|clock|line",), False
    )
    yield Mistake(kind, "a row missing", lines(lambda held: [*held[:40], *held[41:]]), (r"row|gap",), False)
    yield Mistake(
        kind,
        "two rows exchanged",
        lines(lambda held: [*held[:40], held[41], held[40], *held[42:]]),
        (r"row|time|clock|back",),
    )
    yield Mistake(
        kind, "the clock set back", column("time_s", lambda v: v - 0.4 * (v[-1] - v[0]), 50), (r"clock|time",)
    )
    for name in filter(None, (force, gyro)):
        yield Mistake(
            kind,
            f"one row of {name} times 10",
            column(name, lambda v: 10 * v + 1e-3, 45, 46),
            (rf"row|{name}|leap|spike",),
            False,
        )
        yield Mistake(
            kind,
            f"{name} scaled by 1000 from the middle on",
            rows(partial(_from_the_middle, name=name)),
            (rf"{name}|row|unit|position|gravity|scal",),
        )
    if gimbal:
        yield Mistake(
            kind,
            f"{gimbal} off by 20 deg from the middle on",
            rows(partial(_shifted, name=gimbal)),
            (rf"{gimbal}|position|row|\d",),
        )
    if dwell.stop:
        yield Mistake(
            kind,
            "a position numbered as the next",
            column("position", lambda v: 0 * v + DWELL + 1, dwell.start, dwell.stop),
            (r"position|\b[56]\b",),
        )
        yield Mistake(
            kind, "positions numbered as one", column("position", lambda v: 0 * v + 1), (r"position|move|turn",)
        )


def _from_the_middle(held: Array, at: dict[str, int], name: str) -> None:
    held[len(held) // 2 :, at[name]] *= 1000


def _shifted(held: Array, at: dict[str, int], name: str) -> None:
    held[len(held) // 2 :, at[name]] += 20.0


def mistakes() -> tuple[Mistake, ...]:
    """Return all mistakes."""
    forces, rates = ("g", "mg", "ft/s^2"), ("deg/s", "deg/h", "rad/h")
    fifth, three = slice(240, 300), ("platform", "inner", "middle")
    out = [
        *_sensor("gimbals", "accel", "m/s^2", forces, "accelerometers"),
        *_gimbals("gimbals", three, "deg", ("rad", "gon", "rev"), fifth),
        *_site("gimbals", True, 40.0),
        *_rows("gimbals", "accel_z", gimbal="middle", dwell=fifth),
        Mistake("gimbals", "kind static-run", header("multi-position", "static-run"), ("static|kind|column|attitude",)),
        Mistake("gimbals", "platform of two axes", header("space-stable", "two-axis-table"), ("axis|platform|axes",)),
        Mistake(
            "gimbals", "platform of three axes", header("space-stable", "three-axis-table"), ("axis|platform|axes",)
        ),
        Mistake(
            "gimbals",
            "noise a thousandth",
            header("accelerometer = .*", 'accelerometer = { value = 0.01, unit = "ug" }'),
            ("noise|scatter",),
        ),
        Mistake(
            "gimbals",
            "setting error a thousandth",
            header("gimbal_angle = .*", 'gimbal_angle = { value = 0.001, unit = "arcsec" }'),
            ("gimbal|setting|noise|scatter",),
        ),
        Mistake("gimbals", "temperature stated in K", header('unit = "degC"', 'unit = "K"'), ("temperature",), False),
        *_sensor("static", "accel", "m/s^2", forces, "accelerometers"),
        *_gimbals_of_static(),
        *_site("static", True, 40.0),
        *_rows("static", "accel_x"),
        *_sensor("table", "accel", "m/s^2", forces, "accelerometers"),
        *_sensor("table", "gyro", "rad/s", rates, "gyroscopes"),
        *_gimbals("table", ("inner", "middle", "outer"), "deg", ("rad", "gon"), slice(0, 0)),
        *_site("table", True, 32.0),
        *_rows("table", "accel_z", "gyro_z", "outer"),
        *_sensor("hand", "accel", "m/s^2", forces, "accelerometers"),
        *_sensor("hand", "gyro", "rad/s", rates, "gyroscopes"),
        *_rows("hand", "accel_z", "gyro_z"),
        *_sensor("rotation", "accel", "m/s^2", ("g", "mg"), "accelerometers"),
        *_sensor("rotation", "gyro", "rad/s", ("deg/s", "deg/h"), "gyroscopes"),
        *_site("rotation", False, 34.2),
        *_rows("rotation", "accel_z", "gyro_z"),
        *_of_pointing(),
    ]
    return tuple(
        m
        for m in out
        if not (
            (m.kind == "table" and "of one position" in m.name)
            or (m.name == "gimbals late by a position" and m.kind == "table")
        )
    )


def _gimbals_of_static() -> Iterator[Mistake]:
    for name in ("platform", "middle", "outer"):
        yield Mistake(
            "static", f"{name} reversed", times(-1, name), (r"sign|revers|other way|direction", name), name != "outer"
        )
        yield Mistake(
            "static", f"{name} stated in rad", called("rad", "deg", name), (r"deg|unit", name), name != "outer"
        )
    yield Mistake(
        "static",
        "platform and middle exchanged",
        swapped("platform", "middle"),
        (r"exchang|swap|order|axes|axis|platform",),
    )
    for name in ("roll", "pitch", "yaw"):
        yield Mistake("static", f"{name} reversed", times(-1, name), (name,), False)
    yield Mistake(
        "static", "attitudes stated in deg", called("deg", "arcsec", "roll", "pitch", "yaw"), (r"arcsec|unit|attitude",)
    )


def _of_pointing() -> Iterator[Mistake]:
    true = [f"true_angle_{a}" for a in ("elevation", "azimuth")]
    for name in ("elevation", "azimuth", *true):
        yield Mistake(
            "pointing",
            f"{name} reversed",
            times(-1, name),
            (r"sign|revers|other way|direction", name.removeprefix("true_angle_")),
        )
        yield Mistake(
            "pointing",
            f"{name} in rad instead of deg",
            times(np.pi / 180, name),
            (r"rad|deg|unit", name.removeprefix("true_angle_")),
        )
        yield Mistake(
            "pointing",
            f"{name} of one row off by 1 deg",
            column(name, lambda v: v + np.pi / 180, 7, 8),
            (r"row|star|sighting|\b[78]\b|outlier",),
        )
    yield Mistake(
        "pointing", "readouts exchanged", swapped("elevation", "azimuth"), (r"exchang|swap|interchang|order|axes|axis",)
    )
    yield Mistake("pointing", "stars exchanged", swapped(*true), (r"exchang|swap|interchang|order|axes|axis",))
    yield Mistake(
        "pointing",
        "readouts late by a star",
        rows(partial(_late, names=("elevation", "azimuth"), by=1)),
        (r"row|star|order",),
    )
    yield Mistake("pointing", "azimuth in hours", times(1 / 15, "azimuth"), (r"hour|\bh\b|unit|15",))
