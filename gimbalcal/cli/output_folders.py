"""Where results go, and one rule of replacing: what somebody made is replaced when they say so, or by the same again.

Every command has a folder of its own that it names, so that nothing computed is lost. What is there already is

* replaced, where it is this command's own earlier answer to the same question, or equal to what is written;
* left alone otherwise: the command stops before it computes and names --overwrite; where the folder was not given with
  --out, it takes the next name that is free.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from filecmp import cmp
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gimbalcal import atomic
from gimbalcal.cli.options import OWN_EFFECTS
from gimbalcal.errors import InputError

if TYPE_CHECKING:
    from gimbalcal.recording import Recording

OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace files in --out that differ from what is written.")
TELLING = {"out", "quiet", "as_json", "overwrite", "store", "unit", "workers", "scheduler", "runs"}
# options that change no result; runs of a campaign are added to those that are there
PAGE, TRUTH = "report.html", "truth.json"


@dataclass(frozen=True)
class Place:
    """A folder that results may go into, and the question they answer, which marks their page."""

    folder: Path
    question: str

    @property
    def page(self) -> Path:
        """The report."""
        return self.folder / PAGE


def place(
    out: Path | None, names: Sequence[str | Path], noun: str, files: Sequence[str], overwrite: bool, as_json: bool
) -> Place | None:
    """The folder for this command's `files`: --out, or NAME-`noun` here after what it reads.

    None where nothing is to be written: the result goes to stdout as JSON, or the current folder cannot be written.
    Raises InputError where --out holds the answer to another question and `overwrite` is not asked for.
    """
    question = _question()
    if out is not None:
        if read := _effects_files() & {(out / name).resolve() for name in files}:
            raise InputError(f"{read.pop()} is read and would be written over; give another --out")
        other = _others(out, files, question)
        if other and not overwrite:
            from gimbalcal.report.naming import listed

            raise InputError(
                f"{out} already holds {listed(other)} of another question, which would be lost; give another --out, or "
                "--overwrite to replace"
            )
        return Place(out, question)
    if as_json or not os.access(Path(), os.W_OK):
        return None
    folder, k = Path(f"{_name(names)}-{noun}"), 1
    while folder.exists() and (not folder.is_dir() or (_others(folder, files, question) and not overwrite)):
        k += 1
        folder = Path(f"{_name(names)}-{noun}-{k}")
    return Place(folder, question)


def places(each: Sequence[Sequence[Recording]]) -> list[str]:
    """Where the result of each sensor goes: of the first into the folder itself, of others into one within."""
    return [loaded[0].sensor if k else "" for k, loaded in enumerate(each)]


def _question() -> str:
    """What this run of the command line asks, as a name: the command and a digest of everything that decides."""
    context = click.get_current_context()
    asked = {k: _plain(v) for k, v in sorted(context.params.items()) if k not in TELLING}
    if effects := _effects_files():
        asked["effects"] = sorted(map(str, effects))
    digest = hashlib.sha256(json.dumps([context.info_name, asked], sort_keys=True).encode()).hexdigest()
    return f"{context.info_name} {digest[:16]}"


def _effects_files() -> set[Path]:
    """The files of effects of one's own that this run was given."""
    return {file.resolve() for file in click.get_current_context().meta.get(OWN_EFFECTS, ())}


def _plain(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return str(value.absolute()) if isinstance(value, Path) else value


def _others(folder: Path, files: Sequence[str], question: str) -> list[str]:
    """Those of `files` that are in the folder and answer another question than this one."""
    from gimbalcal.report.html import question_of

    there = [name for name in files if (folder / name).exists()]
    return there if there and question_of(folder / PAGE) != question else []


def _name(names: Sequence[str | Path]) -> str:
    """A folder's name after what is read: its first name, and how many others there are."""
    paths = [Path(n).resolve() for n in names]
    paths = [p.parent if p.name == "recording.toml" else p for p in paths]  # the header stands for its folder
    plain = [re.sub(r"[^\w.+-]+", "-", p.stem if p.suffix == ".toml" else p.name) for p in paths]
    first = plain[0].strip("-.") or "result"
    return f"{first}-and-{plain[1] if len(plain) == 2 else f'{len(plain) - 1}-more'}" if len(plain) > 1 else first


@contextmanager
def placed(folder: Path, overwrite: bool = False) -> Iterator[Path]:
    """A new folder to write into, whose files then go into `folder`, all of them or none.

    An equal file that is there already does not matter, so that the same command can run again. A different one
    raises InputError unless `overwrite`; files of other names stay as they are.
    """
    from gimbalcal.recording.header import NAME

    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file and cannot be a folder; give another --out")
    belonging: list[str] = []
    with atomic.folder(folder, NAME, belonging) as new:  # the header last: it is what makes a folder a recording
        yield new
        if overwrite and (new / NAME).is_file():
            belonging.append(TRUTH)  # of the simulation that was there
        if not overwrite:
            _refuse_other(sorted(new.iterdir(), key=lambda file: (file.name == NAME, file.name)), folder)


def _refuse_other(files: list[Path], folder: Path) -> None:
    from gimbalcal.report.naming import listed

    there = [file for file in files if (folder / file.name).exists()]
    other = [file.name for file in there if not cmp(file, folder / file.name, shallow=False)]
    if other:
        raise InputError(
            f"{folder} already holds {listed(other)} with other content, which would be lost; give another --out, or "
            "--overwrite to replace"
        )
