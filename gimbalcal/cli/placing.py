"""Where a command writes what a person may have made by hand: nothing of theirs is replaced unawares."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from filecmp import cmp
from pathlib import Path

import click

from gimbalcal import atomic
from gimbalcal.errors import InputError

OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace files in --out that differ from what is written.")


@contextmanager
def placed(folder: Path, overwrite: bool = False) -> Iterator[Path]:
    """A new folder to write into, whose files then go into `folder`, all of them or none.

    An equal file that is there already does not matter, so that the same command can run again. A different one
    raises InputError unless `overwrite`; files of other names stay as they are.
    """
    from gimbalcal.recording.header import NAME

    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file and cannot be a folder; give another --out")
    with atomic.folder(folder, last=NAME) as new:  # the header last: it is what makes a folder a recording
        yield new
        if not overwrite:
            _refuse_other(sorted(new.iterdir(), key=lambda file: (file.name == NAME, file.name)), folder)


def _refuse_other(files: list[Path], folder: Path) -> None:
    from gimbalcal.report.wording import listed

    there = [file for file in files if (folder / file.name).exists()]
    other = [file.name for file in there if not cmp(file, folder / file.name, shallow=False)]
    if other:
        raise InputError(
            f"{folder} already holds {listed(other)} with other content, which would be lost; give another --out, or "
            "--overwrite to replace"
        )
