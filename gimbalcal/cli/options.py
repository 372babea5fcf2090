"""Options shared by several commands, and progress messages."""

from __future__ import annotations

import errno
import re
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from gimbalcal.cli.plain_characters import say
from gimbalcal.errors import InputError, shortened_text
from gimbalcal.progress import Progress

F = TypeVar("F", bound=Callable[..., Any])
OWN_EFFECTS = "gimbalcal.effects"  # under which a run's context has the files of --effects
PROGRESS_INTERVAL_S = 10.0  # without a message, after which long work reports that it continues
SEED = click.IntRange(min=0)
RUNS = click.IntRange(1, 10_000_000)  # of a campaign, trials of a search; more would take too long
DRAWS = click.IntRange(1, 10_000)  # for an estimate of sigma, which 10,000 determine to 0.7 %


class FilePath(click.Path):
    """A path that the system can follow: a link that leads to itself is refused."""

    def __init__(self, path_type: type[Any] = Path) -> None:
        super().__init__(path_type=path_type)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path. Raises InputError for a link in a circle, and for a name that is too long."""
        path = super().convert(value, param, ctx)
        try:
            Path(str(path)).stat()
        except OSError as problem:
            if problem.errno in (errno.ELOOP, errno.ENAMETOOLONG):
                reason = "links that lead to themselves" if problem.errno == errno.ELOOP else "a name that is too long"
                raise InputError(f"{shortened_text(str(path))} goes through {reason}; give the file itself") from None
        return path


class Number(click.FloatRange):
    """A finite number of a range: nan and inf, which click accepts in any range, are refused."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number. Fails for one that is not finite."""
        number = float(super().convert(value, param, ctx))
        if not isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number


POSITIVE, LATITUDE = Number(0, 1e9, min_open=True), Number(-90, 90)
HEIGHT = Number(-12e3, 100e3)  # m, as in [site]
NOISE = Number(1e-12, 1e9)  # beyond, squares of it are lost by cancellation


def example(*commands: str) -> str:
    """Return the last lines of a command's help: examples of its use."""
    return "\b\nFor example:\n" + "\n".join(f"  {command}" for command in commands)


def completing(source: Callable[[], Iterable[str]]) -> Callable[..., list[CompletionItem]]:
    """Return the completion of an argument by the names of `source`, or by files where none of them matches."""

    def complete(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
        names = [CompletionItem(name) for name in sorted(source()) if name.startswith(typed)]
        return names or [CompletionItem(typed, type="file")]

    return complete


def effect_names() -> Iterable[str]:
    """Return the ids of the catalogue, for the completion of an argument."""
    from gimbalcal.effects import CATALOGUE

    return CATALOGUE


def names_option(name: str, help: str, parameter: str = "") -> Callable[[Any], Any]:  # noqa: A002  as click calls it
    """Return an option of comma-separated names, which may be given several times, as a parameter of a command."""

    def listed(_context: object, _option: object, given: Sequence[str]) -> tuple[str, ...]:
        return tuple(w.strip() for w in ",".join(given).split(",") if w.strip())

    declared = (name, parameter) if parameter else (name,)
    return click.option(*declared, multiple=True, callback=listed, metavar="NAME,...", help=help)


def named_settings(usage: str, settings: Sequence[str]) -> dict[str, str]:
    """Return the settings of an option that is used as `usage`, "--set NAME=VALUE", by name.

    Raises InputError for one without an equals sign.
    """
    split = [setting.partition("=") for setting in settings]
    if without := [name for name, equals, _ in split if not equals]:
        option, _, form = usage.partition(" ")
        raise InputError(f"{option} takes {form}, got {shortened_text(without[0])!r}")
    return {name.strip(): value for name, _, value in split}


def progress_on_stderr(quiet: bool) -> Progress:
    """Return a function that prints progress on stderr; during long work it reports regularly that it continues."""
    doing = ["starting", time.monotonic()]

    def show(sentence: str) -> None:
        again = sentence == doing[0]  # the same work once more is no news
        doing[:] = [sentence, time.monotonic()]
        if not (quiet or again):
            say(f"  {_as_printed(sentence)}", sys.stderr)

    context = click.get_current_context(silent=True)
    if not quiet and context is not None and context.meta.setdefault("gimbalcal.progress", doing) is doing:
        done = threading.Event()
        context.call_on_close(done.set)
        threading.Thread(target=_go_on, args=(doing, done), daemon=True).start()
    return show


def _as_printed(sentence: str) -> str:
    """Typeset units and signs, except in quotes, backticks and brackets, which are to be typed."""
    from gimbalcal.words.naming import typeset

    if sentence.startswith(("wrote ", "reading ")):
        return sentence  # names of files
    parts = re.split(r"""(`[^`]*`|"[^"]*"|\[[^][]*\]|\{[^{}]*\}|\b\w+ = \S+)""", sentence)
    return "".join(part if i % 2 else typeset(part) for i, part in enumerate(parts))


def _go_on(doing: list[Any], done: threading.Event, every: float = PROGRESS_INTERVAL_S) -> None:
    """Report the current work and its duration whenever there was no message for `every` seconds."""
    reported = time.monotonic()
    while not done.wait(every / 10):
        sentence, since = doing
        now = time.monotonic()
        if now - max(since, reported) >= every:
            reported = now
            work = _as_printed(sentence.partition(" (")[0])
            say(f"  ... {work}: {now - since:.0f} s so far", sys.stderr)


def _load_effects(context: click.Context, _option: click.Parameter, files: tuple[Path, ...]) -> None:
    """Add a user's effects to the catalogue before anything is read."""
    if files:
        from gimbalcal.effects import load_effects

        context.meta[OWN_EFFECTS] = files
        for file in files:
            if file.is_file() and file.suffix != ".py":
                raise InputError(f"--effects {file}: give a Python file (.py) with classes under @effect")
            load_effects(file)


EFFECTS = click.Option(
    ["--effects"], multiple=True, type=FilePath(), metavar="FILE.py", expose_value=False,
    callback=_load_effects, help="Effects of your own, in addition to those of the catalogue (docs/api.md).",
)  # fmt: skip
RECORDINGS = click.argument("recordings", nargs=-1, required=True, type=FilePath())


GRADE = click.option(
    "--grade", default="", metavar="NAME",
    help="navigation, tactical, industrial or consumer: how large the sensors' errors usually are; fleet:FILE takes "
    "each from the units in the store FILE.  [default: from their noise]",
)  # fmt: skip
WORKERS = click.option("--workers", type=int, default=None, help="Processes on this machine (default: its cores).")
SCHEDULER = click.option(
    "--scheduler", default="", help="Address of a running Dask scheduler, tcp://host:port, instead."
)
DAMPING = click.option(
    "--damping", type=Number(min=0, max=5), default=None,
    help="Damping of Schuler's swing by the velocity reference, of critical; 0: none [0.5 of a platform, 0 of a "
    "strapdown unit].",
)  # fmt: skip
