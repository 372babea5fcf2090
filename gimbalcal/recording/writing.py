"""Write a recording as a folder, all of it or nothing."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gimbalcal import atomic
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import Platform, known_platform
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording.header import NAME
from gimbalcal.recording.record import COLOURED, SENSORS, UNKNOWN_SITE, Key, Recording, Site
from gimbalcal.units import from_si, is_raw

PACKING = 1  # level of Zstandard: noise packs hardly better at higher ones, which take twice the time
_SHORT = {"specific_force": "accel", "angular_rate": "gyro", "gimbal_angle": "", "attitude_error": "", "covariate": ""}


def write(recording: Recording, folder: str | Path, samples: str = "samples.csv", comment: Iterable[str] = ()) -> Path:
    """Write `recording` into `folder`, with its rows in `samples` (.csv or .parquet); returns the folder.

    Channels are written in the unit that they were logged in, else in SI; `comment` lines head `recording.toml`.
    The folder is made under another name and then renamed, so that half a recording is never seen; files that are
    already in it are replaced, others stay.
    """
    folder = Path(folder)
    if Path(samples).name != samples or Path(samples).suffix not in (".csv", ".parquet"):
        raise InputError(f"samples = {samples!r} must be a plain file name that ends in .csv or .parquet")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file: a recording is a folder, give another name")
    with atomic.atomic_folder(folder, last=NAME) as new:  # the header last: it is what makes the folder a recording
        names = _columns(recording)
        text = "\n".join([*(f"# {line}".rstrip() for line in comment), *_header(recording, samples, names), ""])
        (new / NAME).write_text(text, encoding="utf-8")
        _write_rows(recording, names, new / samples)
    return folder


@dataclass(frozen=True)
class _Written:
    """A channel of one of the sensors, which `sensor` names unless all share it."""

    recording: Recording
    key: Key
    sensor: str


def _columns(recording: Recording) -> dict[str, _Written]:
    """Return every column but time, position and weight, by its name: those of all sensors, what they share once."""
    out = {}
    for key, name in _names(recording).items():
        shared = all(_is_same_column(recording, other, key) for other in recording.other_sensors)
        out[name] = _Written(recording, key, "" if shared else recording.sensor)
    for other in recording.other_sensors:
        for key, name in _names(other).items():
            if not _is_same_column(recording, other, key):
                out[f"{name}_{other.sensor}"] = _Written(other, key, other.sensor)
    return out


def _is_same_column(one: Recording, other: Recording, key: Key) -> bool:
    return all(key in r.channels for r in (one, other)) and np.array_equal(one.channels[key], other.channels[key])


def _names(recording: Recording) -> dict[Key, str]:
    """Return a column name for each channel: the axis where it is a gimbal's, else quantity and axis."""
    names: dict[Key, str] = {}
    for quantity, axis in recording.channels:
        short = "_".join(part for part in (_SHORT.get(quantity, quantity), axis) if part)
        taken = short in names.values() or short in ("time_s", "position", "weight")
        names[quantity, axis] = f"{quantity}_{axis}" if taken else short
    return names


def _unit(recording: Recording, key: Key) -> str:
    si = "1" if key[0] == "covariate" else QUANTITIES[key[0]].si
    unit = recording.units.get(key, si)
    return si if key[0] == "temperature" else unit


def _header(recording: Recording, samples: str, names: dict[str, _Written]) -> list[str]:
    title = recording.title.removesuffix(f" ({recording.sensor})") if recording.other_sensors else recording.title
    lines = ["format = 1", f"kind = {toml_text(recording.kind)}", f"title = {toml_text(title)}"]
    lines += [f"date = {toml_text(recording.date)}"] if recording.date else []
    lines += [f"corrected = [{', '.join(map(toml_text, recording.corrected))}]"] if recording.corrected else []
    lines += [*([] if recording.instant else [f"samples = {toml_text(samples)}"]), "", *_site(recording.site), ""]
    lines += [*platform_toml(recording.platform, recording.kind.stabilised), "", "[noise]", *_noise(recording)]
    named = [r for r in recording.sensors if r.sensor and r.noise and recording.other_sensors]
    for r in named:
        lines += ["", f"[noise.{r.sensor}]", *_noise(r)]
    if recording.instant:
        lines += ["", "[samples]", f"file = {toml_text(samples)}", 'rates = "instant"']
    lines += ["", "[columns]", 'time_s = { quantity = "time", unit = "s" }']
    if recording.position is not None:
        lines.append('position = { quantity = "position" }')
    for name, each in names.items():
        quantity, axis = each.key
        where = f", axis = {toml_text(axis)}" if axis else ""
        where += f", sensor = {toml_text(each.sensor)}" if each.sensor and recording.other_sensors else ""
        unit = toml_text(_unit(each.recording, each.key))
        lines.append(f"{_toml_key(name)} = {{ quantity = {toml_text(quantity)}{where}, unit = {unit} }}")
    if _is_averaged(recording):
        lines.append('weight = { quantity = "weight" }')
    return lines


def _noise(recording: Recording) -> list[str]:
    lines = []
    for sensor, sigma in recording.noise.items():
        quantity = COLOURED[sensor][1] if sensor in COLOURED else SENSORS[sensor]
        unit = next((_unit(recording, k) for k in recording.channels if k[0] == quantity), "")
        unit = unit or QUANTITIES[quantity].si
        lines.append(f"{sensor} = {_toml_number(from_si(sigma, unit), unit)}")
    return lines


def _site(site: Site) -> list[str]:
    lines = ["[site]"]
    if site.latitude is not None:
        lines.append(f"latitude = {_with_sigma(site.latitude, site.latitude_sigma, 'deg')}")
    if site != UNKNOWN_SITE:  # nobody has said where it is: better to say so again on reading
        g = _with_sigma(site.gravity, site.gravity_sigma or None, "m/s^2")
        lines += [f"height = {_toml_number(site.height, 'm')}", f"gravity = {g}"]
    return lines


def _with_sigma(value: float, sigma: float | None, unit: str) -> str:
    """Return a number in SI in this unit, and its sigma where one is stated."""
    stated = "" if sigma is None else f", sigma = {float(from_si(sigma, unit))!r}"
    return _toml_number(from_si(value, unit), unit).replace(", unit", f"{stated}, unit")


def platform_toml(platform: Platform, stabilised: bool = False) -> list[str]:
    """Return the lines of [platform]: a name, and its axes where it is not known by that name."""
    if known_platform(platform.name, stabilised) == platform:
        return ["[platform]", f"name = {toml_text(platform.name)}"]
    lines = ["[platform]", f"name = {toml_text(platform.name)}"]
    for axis in platform.axes:
        lines += ["", "[[platform.axes]]", f"name = {toml_text(axis.name)}", f"direction = {toml_text(axis.direction)}"]
        lines += [f"sign = {axis.sign}", f"offset = {_toml_number(axis.offset, 'rad')}"]
    return lines


def _toml_key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_text(name)


def toml_text(text: str) -> str:
    """Return a text as TOML has it, in quotes."""
    # A JSON string is a TOML basic string, but for surrogate pairs (so not in ASCII) and DEL (to be escaped).
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _toml_number(value: float, unit: str) -> str:
    return f"{{ value = {float(value)!r}, unit = {toml_text(unit)} }}"


def _is_averaged(recording: Recording) -> bool:
    return bool(np.any(recording.weight != 1.0))


def _write_rows(recording: Recording, names: dict[str, _Written], path: Path) -> None:
    import polars as pl

    columns: dict[str, Array] = {"time_s": recording.time}
    if recording.position is not None:
        columns["position"] = recording.position
    for name, each in names.items():
        values, unit = each.recording.channels[each.key], _unit(each.recording, each.key)
        columns[name] = values if is_raw(unit) or each.key[0] == "temperature" else from_si(values, unit)
    if _is_averaged(recording):
        columns["weight"] = recording.weight
    frame = pl.DataFrame({name: np.ascontiguousarray(values) for name, values in columns.items()})
    if path.suffix == ".parquet":
        frame.write_parquet(path, compression_level=PACKING)
    else:
        frame.write_csv(path)
