"""Output folders, and when existing files are replaced.

Every command names a folder of its own, so that no result is lost. Existing files are

* replaced where they are this command's earlier answer to the same question, or equal to what is written;
* kept otherwise, unless --overwrite is given: the command stops before it computes; where the folder was not given with
  --out, it takes the next free name.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from filecmp import cmp
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gimbalcal import atomic
from gimbalcal.cli.options import OWN_EFFECTS, show, wrote
from gimbalcal.errors import InputError

if TYPE_CHECKING:
    from gimbalcal.recording import Recording

OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace files in --out that differ from what is written.")
# options that change no result; runs of a campaign are added to those that are there
WITHOUT_EFFECT = {"out", "quiet", "as_json", "overwrite", "store", "unit", "workers", "scheduler", "runs"}
PAGE, TRUTH = "report.html", "truth.json"


@dataclass(frozen=True)
class OutputFolder:
    """A folder for results, and the question they answer, which marks their page."""

    folder: Path
    question: str

    @property
    def page(self) -> Path:
        """The report."""
        return self.folder / PAGE


def output_folder(
    out: Path | None, names: Sequence[str | Path], noun: str, files: Sequence[str], overwrite: bool, as_json: bool
) -> OutputFolder | None:
    """Return the folder for this command's `files`: --out, or NAME-`noun` in the current folder after its inputs.

    None where nothing is written: the result goes to stdout as JSON, or the current folder cannot be written. Raises
    InputError where --out holds the answer to another question and `overwrite` is not given.
    """
    question = _question()
    if out is not None:
        if read := _effects_files() & {(out / name).resolve() for name in files}:
            raise InputError(f"{read.pop()} is read and would be written over; give another --out")
        other = _other_answers(out, files, question)
        if other and not overwrite:
            from gimbalcal.words.naming import listed

            raise InputError(
                f"{out} already holds {listed(other)} of another question, which would be lost; give another --out, or "
                "--overwrite to replace"
            )
        return OutputFolder(out, question)
    if as_json or not os.access(Path(), os.W_OK):
        return None
    folder, k = Path(f"{_name(names)}-{noun}"), 1
    while folder.exists() and (not folder.is_dir() or (_other_answers(folder, files, question) and not overwrite)):
        k += 1
        folder = Path(f"{_name(names)}-{noun}-{k}")
    return OutputFolder(folder, question)


def deliver(
    folder: OutputFolder | None, file: str, content: Any, page: Callable[[], str], sentence: str, as_json: bool,
    quiet: bool,
) -> None:  # fmt: skip
    """Write a result and its page where there is a folder, and print the answer."""
    if folder is not None:
        from gimbalcal.report.files import write_report

        write_report(file, content, page(), folder.folder, folder.question)
        wrote(folder.folder, file, quiet)
    show(content, sentence, as_json, quiet, folder.page if folder else None)


def sensor_folders(each: Sequence[Sequence[Recording]]) -> list[str]:
    """Return the subfolder of each sensor: the folder itself for the first, one of its name for others."""
    return [loaded[0].sensor if k else "" for k, loaded in enumerate(each)]


def _question() -> str:
    """Return an identifier of the question: the command and a digest of all options with an effect on the result."""
    context = click.get_current_context()
    parameters = {k: _plain(v) for k, v in sorted(context.params.items()) if k not in WITHOUT_EFFECT}
    if effects := _effects_files():
        parameters["effects"] = sorted(map(str, effects))
    digest = hashlib.sha256(json.dumps([context.info_name, parameters], sort_keys=True).encode()).hexdigest()
    return f"{context.info_name} {digest[:16]}"


def _effects_files() -> set[Path]:
    """Return the files given with --effects."""
    return {file.resolve() for file in click.get_current_context().meta.get(OWN_EFFECTS, ())}


def _plain(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return str(value.absolute()) if isinstance(value, Path) else value


def _other_answers(folder: Path, files: Sequence[str], question: str) -> list[str]:
    """Return those of `files` that exist in the folder and answer another question."""
    from gimbalcal.report.html import question_of

    existing = [name for name in files if (folder / name).exists()]
    return existing if existing and question_of(folder / PAGE) != question else []


def _name(names: Sequence[str | Path]) -> str:
    """Return a folder's name after its inputs: the first name, and the number of others."""
    paths = [Path(n).resolve() for n in names]
    paths = [p.parent if p.name == "recording.toml" else p for p in paths]  # the header stands for its folder
    plain = [re.sub(r"[^\w.+-]+", "-", p.stem if p.suffix == ".toml" else p.name) for p in paths]
    first = plain[0].strip("-.") or "result"
    return f"{first}-and-{plain[1] if len(plain) == 2 else f'{len(plain) - 1}-more'}" if len(plain) > 1 else first


@contextmanager
def staged_folder(folder: Path, overwrite: bool = False) -> Iterator[Path]:
    """Yield a new folder to write into, whose files are then moved into `folder`, all of them or none.

    Equal files may exist already, so that the same command can run again. A different one raises InputError unless
    `overwrite`; files of other names are kept.
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
            _refuse_different(sorted(new.iterdir(), key=lambda file: (file.name == NAME, file.name)), folder)


def _refuse_different(files: list[Path], folder: Path) -> None:
    """Raise InputError where `folder` holds one of these files with other content."""
    from gimbalcal.words.naming import listed

    existing = [file for file in files if (folder / file.name).exists()]
    other = [file.name for file in existing if not cmp(file, folder / file.name, shallow=False)]
    if other:
        raise InputError(
            f"{folder} already holds {listed(other)} with other content, which would be lost; give another --out, or "
            "--overwrite to replace"
        )
