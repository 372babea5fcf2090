"""What a command does with its answer: its options, output folders, and when existing files are replaced.

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
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from filecmp import cmp
from functools import cached_property, reduce, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gimbalcal import atomic
from gimbalcal.cli.options import OWN_EFFECTS, FilePath, progress_on_stderr
from gimbalcal.cli.plain_characters import say
from gimbalcal.errors import InputError
from gimbalcal.progress import Progress

if TYPE_CHECKING:
    from gimbalcal.recording import Recording

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


@dataclass(frozen=True)
class Output:
    """What a command does with its answer, by --out, --overwrite, --quiet and --json."""

    out: Path | None
    overwrite: bool
    quiet: bool
    as_json: bool

    @cached_property
    def progress(self) -> Progress:
        """Return the function that prints progress on stderr."""
        return progress_on_stderr(self.quiet)

    def folder(self, names: Sequence[str | Path], noun: str, files: Sequence[str]) -> OutputFolder | None:
        """Return the folder for a command's `files`: --out, or NAME-`noun` in the current folder after its inputs.

        None where nothing is written: the result goes to stdout as JSON, or the current folder cannot be written.
        Raises InputError where --out holds the answer to another question and --overwrite is not given.
        """
        question = _question_digest()
        if self.out is not None:
            if read := _effects_files() & {(self.out / name).resolve() for name in files}:
                raise InputError(f"{read.pop()} is read and would be written over; give another --out")
            other = _other_answers(self.out, files, question)
            if other and not self.overwrite:
                from gimbalcal.words.naming import list_in_words

                raise InputError(
                    f"{self.out} already holds {list_in_words(other)} of another question, which would be lost; give "
                    "another --out, or --overwrite to replace"
                )
            return OutputFolder(self.out, question)
        if self.as_json or not os.access(Path(), os.W_OK):
            return None
        folder, k = Path(f"{_name(names)}-{noun}"), 1
        while folder.exists() and (
            not folder.is_dir() or (_other_answers(folder, files, question) and not self.overwrite)
        ):
            k += 1
            folder = Path(f"{_name(names)}-{noun}-{k}")
        return OutputFolder(folder, question)

    def staged(self, folder: Path) -> AbstractContextManager[Path]:
        """Return a new folder whose files are moved into `folder`, see `staged_folder`."""
        return staged_folder(folder, self.overwrite)

    def table(self, text: str) -> None:
        """Print a table above the answer, unless the answer is JSON."""
        if not self.as_json:
            say(text, end="\n\n")

    def wrote(self, folder: Path, first: str) -> None:
        """Report the files that were written."""
        self.progress(f"wrote {folder / first} and {folder / PAGE}")

    def show(self, result: Any, sentence: str, folder: OutputFolder | None = None) -> None:
        """Print the answer on stdout: the sentence and the path of its page, or the result as JSON."""
        lines = [sentence, *([] if folder is None else [f"report: {folder.page}"])]
        if self.as_json:
            say(atomic.as_json(result))
            self.progress("\n  ".join(lines))
        else:
            say("\n".join(lines))

    def deliver(
        self, folder: OutputFolder | None, file: str, content: Any, page: Callable[[], str], sentence: str
    ) -> None:
        """Write a result and its page where there is a folder, and print the answer."""
        if folder is not None:
            from gimbalcal.report.files import write_report

            write_report(file, content, page(), folder.folder, folder.question)
            self.wrote(folder.folder, file)
        self.show(content, sentence, folder)


def output_options(
    what: str, default: str, replaces: bool = True
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that adds --out, --quiet, --json and, if it `replaces` files, --overwrite to a command.

    The command takes an `Output` in place of them. `what` is written into --out, else `default`.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def run(out: Path | None, quiet: bool, as_json: bool, overwrite: bool = False, **options: Any) -> None:
            command(output=Output(out, overwrite, quiet, as_json), **options)

        described = f"Folder for {what}.  [default: {default}]"
        options = [
            click.option("--json", "as_json", is_flag=True, help="Print the result on stdout as JSON."),
            click.option(
                "--quiet", is_flag=True, help="Print no progress on stderr; the result on stdout is the same."
            ),
            click.option("--out", type=FilePath(), callback=_refuse_unwritable, default=None, help=described),
        ]
        if replaces:
            differ = "Replace files in --out that differ from what is written."
            options.append(click.option("--overwrite", is_flag=True, help=differ))
        return reduce(lambda function, option: option(function), options, run)

    return decorate


def _refuse_unwritable(_context: click.Context, _option: click.Parameter, out: Path | None) -> Path | None:
    """Return --out. Raises InputError before anything is computed where it cannot be a folder."""
    if out is None:
        return None
    existing = next(p for p in (out, *out.absolute().parents) if p.exists() or p.is_symlink())
    if not existing.is_dir():
        raise InputError(f"--out {out} cannot be a folder, because {existing} is a file; give another name")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError(f"--out {out} cannot be written, {existing} does not permit it; give another folder")
    return out


def sensor_folders(each: Sequence[Sequence[Recording]]) -> list[str]:
    """Return the subfolder of each sensor: the folder itself for the first, one of its name for others."""
    return [loaded[0].sensor if k else "" for k, loaded in enumerate(each)]


def _question_digest() -> str:
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
    with atomic.atomic_folder(folder, NAME, belonging) as new:  # the header last: it is what makes a folder a recording
        yield new
        if overwrite and (new / NAME).is_file():
            belonging.append(TRUTH)  # of the simulation that was there
        if not overwrite:
            _refuse_different(sorted(new.iterdir(), key=lambda file: (file.name == NAME, file.name)), folder)


def _refuse_different(files: list[Path], folder: Path) -> None:
    """Raise InputError where `folder` holds one of these files with other content."""
    from gimbalcal.words.naming import list_in_words

    existing = [file for file in files if (folder / file.name).exists()]
    other = [file.name for file in existing if not cmp(file, folder / file.name, shallow=False)]
    if other:
        raise InputError(
            f"{folder} already holds {list_in_words(other)} with other content, which would be lost; give another "
            "--out, or --overwrite to replace"
        )
