"""Ways to spoil a file that still reads well: sound words in the wrong place, other encodings, depth, whole tables."""

import contextlib
import gzip
import re
import sqlite3
from pathlib import Path

import numpy as np
import polars as pl

from tests.fuzzing.change import VALUES, Rng, Spoil, one_of, spoil_bytes

FACTORS = (-1.0, 0.0, 0.01, 0.1, 0.5, 0.9, 0.99, 1.01, 1.1, 2.0, 10.0, 57.29577951308232, 60.0, 1e3, 9.80665, 1e6)
UNITS = ("m/s^2", "g", "mg", "ug", "Gal", "count", "count/s", "rad/s", "deg/s", "deg/h", "rad", "deg", "arcmin",
         "arcsec", "rev", "s", "ms", "min", "h", "m/s", "m", "km", "degC", "K", "V", "ppm", "ug/g^2", "1")  # fmt: skip
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?![\w.])")
WORD = re.compile(r'"[^"\n]*"')


def spoil_meaning(rng: Rng, path: Path) -> None:
    """Numbers scaled or exchanged, quoted words for others of the file or other units: all as it could be meant."""
    text = path.read_text(errors="replace")
    for _ in range(int(rng.integers(1, 3))):
        words, numbers = ([m.span() for m in each.finditer(text)] for each in (WORD, NUMBER))
        way = int(rng.integers(4))
        if way < 2 and numbers:
            start, stop = one_of(rng, numbers)
            other = one_of(rng, numbers)
            scaled = float(text[start:stop]) * one_of(rng, FACTORS)
            new = text[slice(*other)] if way else f"{scaled:.12g}"
        elif words:
            start, stop = one_of(rng, words)
            new = text[slice(*one_of(rng, words))] if way == 2 else f'"{one_of(rng, UNITS)}"'
        else:
            continue
        text = text[:start] + new + text[stop:]
    path.write_text(text)


def spoil_readings(rng: Rng, path: Path) -> None:
    """Readings as a worse rig, sensor or logger would have made them: sound rows all, so that all is computed."""
    frame = pl.read_csv(path)
    for _ in range(int(rng.integers(1, 4))):
        frame = _worse(rng, frame)
    frame.write_csv(path)


def _worse(rng: Rng, frame: pl.DataFrame) -> pl.DataFrame:
    n, way = frame.height, int(rng.integers(12))
    name = one_of(rng, [c for c in frame.columns if c not in ("t", "time", "time_s", "position")])
    x = frame[name].cast(pl.Float64).to_numpy().copy()
    size = float(one_of(rng, (1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 0.1, 0.5))) * (float(np.ptp(x)) or 1.0)
    i, k = int(rng.integers(n)), int(rng.integers(1, max(2, n // 4)))
    if way == 0:
        x += size * rng.standard_normal()
    elif way == 1:
        x *= 1 + size
    elif way == 2:
        x += size * rng.standard_normal(n)
    elif way == 3:
        return frame.filter(pl.Series(rng.random(n) < one_of(rng, (0.2, 0.5, 0.9, 0.99))))
    elif way == 4:
        return pl.concat([frame[:i], frame[i + k :]])
    elif way == 5:
        return frame[:i] if rng.random() < 0.5 else frame[i:]
    elif way == 6:
        x = np.round(x / size) * size
    elif way == 7:
        x[i : i + k] += size
    elif way == 8:
        x = np.clip(x, x.min() + size, x.max() - size / 2)
    elif way == 9:
        x += size * np.sin(np.arange(n) * 10.0 ** rng.uniform(-4, 0))
    elif way == 10:
        x[i : i + k] *= -1
    else:
        x = np.roll(x, int(rng.integers(-3, 4)))
    return frame.with_columns(pl.Series(name, x))


def spoil_encoding(rng: Rng, path: Path) -> None:
    """The same text as another program, country or system would have saved it."""
    text = path.read_text(errors="replace")
    other = text.replace("-", "−") if rng.random() < 0.3 else text.replace("a", "ä", 1)
    saved: tuple[bytes, ...] = (
        text.encode("utf-16"), text.encode("utf-16-le"), text.encode("utf-32"), text.encode("utf-8-sig"),
        other.encode("latin-1", "replace"), other.encode("cp1252", "replace"), other.encode(), other.encode("utf-16"),
        text.replace("\n", "\r\n").encode(), text.replace("\n", "\r").encode(), text.replace("\n", "\u2028").encode(),
        text.replace(" ", "\u00a0").encode(), text.replace(".", ",").encode(),
        text.replace(",", ";").replace(".", ",").encode(), text.replace(",", "\t").encode(), text.encode() + b"\x1a",
        text.encode("utf-7"), gzip.compress(text.encode()), b"", b"\n", b"\xef\xbb\xbf", text.upper().encode(),
        text.encode().replace(b"\n", b"\x00\n", 1), text.replace(" ", "").encode(), text.replace('"', "'").encode(),
        text.replace('"', "“").encode(),
    )  # fmt: skip
    path.write_bytes(one_of(rng, saved))


def spoil_depth(rng: Rng, path: Path) -> None:
    """A value nested deep, a number of thousands of digits, a key of many dots, a line of a megabyte."""
    text = path.read_text(errors="replace")
    spans = [m.span() for m in (*NUMBER.finditer(text), *WORD.finditer(text))]
    if not spans:
        return
    start, stop = one_of(rng, spans)
    n, value = int(one_of(rng, (3, 60, 500, 3000, 50_000))), text[start:stop]
    odd = ("[" * n + value + "]" * n, "{ a = " * n + value + " }" * n, '{"a": ' * n + value + "}" * n, "9" * n,
           "-" + "9" * n, "0." + "0" * n + "1", "1e" + "9" * n, '"' + "x" * n + '"', "[" + f"{value}, " * n + "]",
           value + "\n" + ".".join(["k"] * n) + " = 1", "[" * n, "{" * n, "1_" * n + "1", "0x" + "f" * n,
           "." + value, "+" + value, "\\u0041" * n)  # fmt: skip
    path.write_text(text[:start] + str(one_of(rng, odd)) + text[stop:])


def spoil_base(rng: Rng, path: Path) -> None:
    """A cell of an SQLite file exchanged, a row doubled or left out, a table gone, another version; or its bytes."""
    if rng.random() < 0.4:
        return spoil_bytes(rng, path)
    with contextlib.closing(sqlite3.connect(path)) as base:
        tables = [row[0] for row in base.execute("select name from sqlite_master where type = 'table'")]
        table = one_of(rng, [t for t in tables if not t.startswith("sqlite_")])
        columns = [row[1] for row in base.execute(f"pragma table_info({table})")]
        column, way = one_of(rng, columns), int(rng.integers(6))
        text = base.execute(f"select {column} from {table} limit 1").fetchone()[0]
        if way == 0:
            base.execute(f"drop table {table}")
        elif way == 1:
            base.execute(f"delete from {table}")
        elif way == 2:
            base.execute(f"pragma user_version = {int(rng.integers(-3, 90))}")
        elif way == 3 and isinstance(text, str) and text:
            i = int(rng.integers(len(text)))
            base.execute(f"update {table} set {column} = ?", (text[:i] + text[i + 1 + int(rng.integers(9)) :],))
        elif way == 4:
            base.execute(f"alter table {table} rename column {column} to other")
        else:
            odd = (None, "", "x", -1, 2**62, 1e300, b"\x00\xff", "2026-13-45", "[]", "{}", "null", *VALUES)
            base.execute(f"update {table} set {column} = ?", (one_of(rng, odd),))
        base.commit()
    return None


MEANT: tuple[Spoil, ...] = (spoil_meaning,)
ROUGH: tuple[Spoil, ...] = (spoil_readings,)
SAVED: tuple[Spoil, ...] = (spoil_encoding,)
DEEP: tuple[Spoil, ...] = (spoil_depth,)
