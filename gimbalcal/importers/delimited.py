"""CSV and other text tables, with a header file that says what the columns hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from gimbalcal.errors import InputError
from gimbalcal.importers.table import COMMON, header_for, number, one_file, only, recording_of
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording

_SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}


def import_csv(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One text table; header = FILE.toml with [columns], separator, skip = lines before the names, rate = Hz.

    The separator is comma, semicolon, tab or space, or the character itself; with semicolons a decimal comma is
    understood.
    """
    import polars as pl

    only(options, (*COMMON, "separator", "skip"))
    path = one_file(files)
    skip = int(number(options, "skip", 0))
    header = header_for(path, options, skip)
    separator = _SEPARATORS.get(options.get("separator", "comma"), options.get("separator", ","))
    if len(separator) != 1:
        raise InputError(f"the separator {separator!r} is not one character; write comma, semicolon, tab or space")
    try:
        frame = pl.read_csv(
            path, separator=separator, skip_lines=skip, comment_prefix="#", infer_schema=False,
        )  # fmt: skip
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{path} cannot be read as a table: {str(error).splitlines()[0]}") from None

    def fetch(name: str) -> Array:
        if name not in frame.columns:
            raise InputError(f"{path} has no column {name!r}; it has {', '.join(map(repr, frame.columns))}")
        text = frame[name].str.strip_chars()
        text = text.str.replace(",", ".", literal=True) if separator == ";" else text
        values = text.cast(pl.Float64, strict=False)
        bad = (values.is_null() & text.is_not_null() & (text != "")).arg_true()
        if len(bad):
            raise InputError(
                f"{path}, row {bad[0] + 1} below the names, column {name}: {text[bad[0]]!r} is not a number"
            )
        return values.to_numpy()

    return recording_of(header, options, fetch)
