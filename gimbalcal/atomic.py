"""Files and folders that are written whole or not at all: made under another name on the same disk, then renamed."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def file(path: Path) -> Iterator[Path]:
    """A name to write to, beside `path`, that takes its place when the block ends; nothing is left where it fails."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write(path: Path, content: str | bytes) -> None:
    """Write a text (as UTF-8) or bytes, so that an interruption leaves the old file or none."""
    with file(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


def write_json(path: Path, content: Mapping[str, Any] | Sequence[Any]) -> None:
    """Write JSON, so that an interruption leaves the old file or none."""
    write(path, json.dumps(content, indent=1))


@contextmanager
def folder(path: Path, last: str = "") -> Iterator[Path]:
    """A new folder to write files into, which becomes `path` when the block ends; nothing is left where it fails.

    Where `path` is a folder already its files of the same names are replaced, the one called `last` after all others,
    and other files stay.
    """
    # on the same disk, so that moving is renaming; no folder is left behind by what fails
    near = next(p for p in (path, *path.absolute().parents) if p.is_dir())
    private = Path(tempfile.mkdtemp(prefix=f".{path.name or 'gimbalcal'}-", dir=near))
    try:
        made = private / "new"
        made.mkdir()  # as the mask lets others read it, which mkdtemp does not
        yield made
        if path.is_dir():
            for each in sorted(made.iterdir(), key=lambda f: (f.name == last, f.name)):
                each.replace(path / each.name)
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            made.rename(path)
    finally:
        shutil.rmtree(private, ignore_errors=True)
