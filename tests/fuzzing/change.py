"""Ways to spoil a file: bytes, lines, cells, words of TOML and JSON, tables of numbers; drawn from one generator."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import polars as pl
import scipy.io

Rng = np.random.Generator
NUMBERS = ("0", "-0.0", "1e-320", "1e308", "-1e16", "1e16", "1e400", "nan", "inf", "-inf", "NaN", "1e5", "9" * 40, "-1",
           "0.5", "3", "1_000", "0x10", "1,5", "", " ", "7e-9", "-273.16", "180", "360", "1e-12", "2147483648",
           "9223372036854775808", "-9223372036854775809", "true", "٣")  # fmt: skip
WORDS = ('""', '"a"', '"deg"', '"rad"', '"m/s^2"', '"g"', '"ug"', '"s"', '"min"', '"count"', '"x"', '"y"', '"time"',
         '"specific_force"', '"angular_rate"', '"gimbal_angle"', '"temperature"', '"position"', '"covariate"', "[]",
         "{}", "[1, 2]", "{ a = 1 }", "true", "1979-05-27", '"$x^$"', '"<b>"', '"../x"', '"static-run"', '"rotation"',
         '"pointing"', '"bench"', '"space-stable"', '"alt-az"', '"instant"',
         '"multi-position"', '"\\u0000"')  # fmt: skip
ODD_BYTES = (b"\x00", b"\xff", b"\n", b"\r", b"#", b'"', b"'", b",", b";", b"\t", b"-", b"[", b"]", b"{", b"=", b"\xc3")
VALUES = (0.0, np.nan, np.inf, -np.inf, 1e16, -1e16, 1e-300, 1e300, 1.0, -1.0, 9.8, 1e3, np.pi)


def one_of(rng: Rng, things: Any) -> Any:
    """One of a sequence."""
    return things[int(rng.integers(len(things)))]


def spoil_bytes(rng: Rng, path: Path) -> None:
    """A few bytes changed, cut, doubled or moved."""
    data = bytearray(path.read_bytes())
    for _ in range(int(rng.integers(1, 4))):
        i = int(rng.integers(len(data) + 1))
        j = min(len(data), i + int(rng.integers(1, 40)))
        way = int(rng.integers(6))
        if way == 0 and i < len(data):
            data[i] ^= 1 << int(rng.integers(8))
        elif way == 1:
            data[i:i] = one_of(rng, ODD_BYTES)
        elif way == 2:
            del data[i:j]
        elif way == 3:
            data[j:j] = data[i:j]
        elif way == 4 and i < len(data):
            data[i] = int(rng.integers(256))
        elif way == 5 and rng.random() < 0.3:
            del data[i:]
    path.write_bytes(bytes(data))


def spoil_lines(rng: Rng, path: Path) -> None:
    """Lines left out, doubled, exchanged, or cut."""
    lines = path.read_text(errors="replace").split("\n")
    for _ in range(int(rng.integers(1, 3))):
        i, j = (int(k) for k in rng.integers(len(lines), size=2))
        way = int(rng.integers(5))
        if way == 0 and len(lines) > 1:
            del lines[i]
        elif way == 1:
            lines.insert(j, lines[i])
        elif way == 2:
            lines[i], lines[j] = lines[j], lines[i]
        elif way == 3:
            lines[i] = lines[i][: int(rng.integers(len(lines[i]) + 1))]
        elif len(lines) > 1:
            lines = lines[: i + 1]
        lines = lines or [""]
    path.write_text("\n".join(lines))


def spoil_words(rng: Rng, path: Path) -> None:
    """Numbers and quoted words of a text exchanged for odd ones."""
    text = path.read_text(errors="replace")
    for _ in range(int(rng.integers(1, 4))):
        numbers = [m.span() for m in re.finditer(r"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", text)]
        words = [m.span() for m in re.finditer(r'"[^"\n]*"', text)]
        spans, odd = (words, WORDS) if words and rng.random() < 0.5 else (numbers, NUMBERS)
        if not spans:
            return
        start, stop = one_of(rng, spans)
        text = text[:start] + str(one_of(rng, odd)) + text[stop:]
    path.write_text(text)


def spoil_columns(rng: Rng, path: Path) -> None:
    """Whole columns or single cells of a CSV or Parquet with other numbers: NaN, huge, constant, scaled, exchanged."""
    if path.suffix == ".parquet":
        frame = pl.read_parquet(path)
    else:
        text = path.read_text(errors="replace")
        frame = pl.read_csv(text.encode(), truncate_ragged_lines=True, ignore_errors=True)
    for _ in range(int(rng.integers(1, 3))):
        frame = _other_column(rng, frame)
    if path.suffix == ".parquet":
        frame.write_parquet(path)
    else:
        path.write_text(frame.write_csv(null_value=""))


def _other_column(rng: Rng, frame: pl.DataFrame) -> pl.DataFrame:
    names = frame.columns
    name, way = one_of(rng, names), int(rng.integers(9))
    if way == 0:
        return frame.select([c for c in names if c != name]) if len(names) > 1 else frame
    if way == 1 and path_free(frame[name]):
        return frame.with_columns(pl.col(name).cast(pl.String))
    if not frame[name].dtype.is_numeric() or not frame.height:
        return frame
    x = np.array(frame[name].cast(pl.Float64).fill_null(np.nan).to_numpy(), dtype=float)
    i = int(rng.integers(len(x)))
    if way == 2:
        x[i] = one_of(rng, VALUES)
    elif way == 3:
        x[:] = one_of(rng, VALUES)
    elif way == 4:
        x *= one_of(rng, (-1.0, 0.0, 9.80665, 1e3, 1e-3, 57.29578, 3600.0, 60.0, 1e9, 1.1, 1e-9))
    elif way == 5:
        other = frame[one_of(rng, names)]
        return frame.with_columns(other.alias(name))
    elif way == 6:
        x = np.round(x, int(rng.integers(-2, 4)))
    elif way == 7:
        x = x[::-1].copy()
    else:
        x[i:] = x[i]
    return frame.with_columns(pl.Series(name, x))


def path_free(column: pl.Series) -> bool:
    """Whether a column can be written as text."""
    return not column.dtype.is_nested()


def spoil_json(rng: Rng, path: Path) -> None:
    """One value of a JSON exchanged, left out or doubled."""
    content = json.loads(path.read_text())
    places = list(_places(content))
    for _ in range(int(rng.integers(1, 3))):
        parent, key = one_of(rng, places)
        odd = one_of(rng, (None, True, 0, -1, 1e400, float("nan"), "", "x", [], {}, [1], "ppm", 1e30, 2**70, [[1.0]]))
        try:
            if rng.random() < 0.25:
                del parent[key]
            else:
                parent[key] = odd
        except (KeyError, IndexError):
            continue
    path.write_text(json.dumps(content))


def _places(content: Any) -> Any:
    for key, value in content.items() if isinstance(content, dict) else enumerate(content):
        yield content, key
        if isinstance(value, (dict, list)):
            yield from _places(value)


def spoil_hdf5(rng: Rng, path: Path) -> None:
    """A data set of another type, shape or content."""
    with h5py.File(path, "a") as file:
        name = one_of(rng, ("t", "a"))
        x = np.array(file[name])
        del file[name]
        way = int(rng.integers(8))
        if way == 0:
            x = np.full(x.shape, one_of(rng, VALUES))
        elif way == 1:
            x = x[: int(rng.integers(len(x)))]
        elif way == 2:
            x = x.astype(one_of(rng, ("i1", "u8", "f2", "f4", "c16", "S4", "?")))
        elif way == 3:
            x = np.array(x.tolist()[0])
        elif way == 4:
            x = x.reshape(x.shape + (1,) * int(rng.integers(1, 4)))
        elif way == 5:
            file.create_group(name)
            return
        elif way == 6:
            file[name] = h5py.SoftLink(one_of(rng, ("/", "/t", "/a", "/nowhere")))
            return
        if way < 7:
            file[name] = x


def spoil_mat(rng: Rng, path: Path) -> None:
    """A variable of another type, shape or content."""
    t = np.arange(50.0)
    odd = (t, t[:, None], "text", {"b": t}, np.array([{"a": 1}], dtype=object), t + 1j, np.zeros((0, 3)), t > 3,
           np.full(50, np.nan), np.zeros((50, 3, 2)), 7)  # fmt: skip
    scipy.io.savemat(path, {"t": one_of(rng, odd), "a": one_of(rng, odd)})


Spoil = Callable[[Rng, Path], None]
TEXT: tuple[Spoil, ...] = (spoil_bytes, spoil_lines, spoil_words)
TABLE: tuple[Spoil, ...] = (*TEXT, spoil_columns)
JSON: tuple[Spoil, ...] = (spoil_bytes, spoil_words, spoil_json, spoil_json)
BINARY: tuple[Spoil, ...] = (spoil_bytes,)
