"""Command line: each command is a few lines around a function of the package.

Exit status: 0 done; 1 done, and the model does not explain the data; 2 bad input, nothing written; 3 a defect of this
program; 130 interrupted.
Heavy packages are imported inside the commands, so that `gimbalcal --help` answers at once.
"""

from __future__ import annotations

import io
import os
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from click.shell_completion import get_completion_class

from gimbalcal import __version__
from gimbalcal.atomic import FULL
from gimbalcal.cli.analysis import batch, calibrate, compare, diagnose, navigate, noise
from gimbalcal.cli.catalogue import catalogue
from gimbalcal.cli.conversion import apply, export, import_, new
from gimbalcal.cli.demonstration import demo
from gimbalcal.cli.options import EFFECTS, example
from gimbalcal.cli.plain_characters import print_plain_characters, say
from gimbalcal.cli.planning import budget, campaign, design, next_, observe, simulate
from gimbalcal.errors import InputError, shortened_text
from gimbalcal.memory_reuse import reuse_freed_memory

CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 110}


def main() -> None:
    """Run the command line; every refusal is one sentence on stderr and exit status 2."""
    reuse_freed_memory()
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    print_plain_characters((sys.stdout, sys.stderr))
    try:
        with _own_messages_only():
            _refuse_undecodable([str(Path.cwd()), *sys.argv[1:]])
            gimbalcal(standalone_mode=False, prog_name="gimbalcal")
    except InputError as problem:
        _stop(f"gimbalcal: {problem}", 2)
    except click.exceptions.NoArgsIsHelpError as problem:
        problem.show()
        sys.exit(2)
    except click.ClickException as problem:
        context = getattr(problem, "ctx", None)
        command = context.command_path if context else "gimbalcal"
        _stop(f"gimbalcal: {problem.format_message().rstrip('.')}; see `{command} --help`", 2)
    except (KeyboardInterrupt, click.Abort):
        _stop("gimbalcal: interrupted; nothing half-written is left behind", 130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    except OSError as problem:
        name, why = problem.filename or "a file", problem.strerror or problem
        remedy = "make room on the disk" if problem.errno in FULL else "correct its name or its permissions"
        _stop(f"gimbalcal: {name} cannot be read or written ({why}); {remedy}", 2)
    except MemoryError:
        _stop("gimbalcal: there is not enough memory for this input; give it in parts, or as means", 2)
    except SystemExit:
        raise
    except BaseException:  # noqa: BLE001  a panic of an engine is no Exception;  status 1 is a verdict, which a defect must not look like
        traceback.print_exc()
        _stop("gimbalcal: this is a defect of the program, not of your data; please report it with the lines above", 3)


@contextmanager
def _own_messages_only() -> Iterator[None]:
    """Keep from the user what libraries warn of, and what compiled code writes to stderr by itself.

    Every refusal is one sentence, so that the panic of an engine or an overflow before it says nothing more. Python's
    own option -W shows warnings again.
    """
    shown, stream = warnings.showwarning, sys.stderr
    kept = os.dup(2)
    if not sys.warnoptions:
        warnings.showwarning = lambda *_, **__: None
    stream.flush()
    if isinstance(stream, io.TextIOWrapper) and stream is sys.__stderr__:
        sys.stderr = open(kept, "w", encoding=stream.encoding, errors=stream.errors, buffering=1, closefd=False)  # noqa: SIM115
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    os.close(nowhere)
    try:
        yield
    finally:
        sys.stderr.flush()
        os.dup2(kept, 2)
        os.close(kept)
        sys.stderr, warnings.showwarning = stream, shown


def _refuse_undecodable(words: list[str]) -> None:
    """Raise InputError for an argument, or a working folder, whose bytes are no UTF-8: no result file can name it."""
    for word in words:
        try:
            word.encode()
        except UnicodeEncodeError:
            name = shortened_text(os.fsencode(word).decode(errors="backslashreplace"))
            raise InputError(f"'{name}' is not UTF-8; rename the file or folder, or type it again") from None


def _stop(sentence: str, status: int) -> None:
    say(sentence, sys.stderr)
    sys.exit(status)


GROUPS: dict[str, tuple[click.Command, ...]] = {
    "Start, in this order": (new, calibrate, diagnose, apply, export, compare),
    "Plan": (observe, design, simulate, budget, next_),
    "Other commands": (batch, import_, noise, navigate, campaign, catalogue, demo),
}


class Commands(click.Group):
    """The commands of the program, in groups."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002  as click calls it
        """Write the first sentence of every command, whole."""
        for title, commands in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(str(c.name), first_sentence(c)) for c in commands])


def first_sentence(command: click.Command) -> str:
    """Return what a command does."""
    return command.get_short_help_str(limit=200)


def _print_completion(context: click.Context, _option: click.Parameter, shell: str | None) -> None:
    """Print the code by which a shell completes commands, options and names."""
    if shell is not None:
        kind = get_completion_class(shell)
        assert kind is not None
        say(kind(gimbalcal, {}, "gimbalcal", "_GIMBALCAL_COMPLETE").source())
        context.exit()


@click.group(
    cls=Commands,
    context_settings=CONTEXT,
    epilog=example("gimbalcal demo", "gimbalcal calibrate --help", 'eval "$(gimbalcal --completion bash)"'),
)
@click.version_option(__version__, prog_name="gimbalcal")
@click.option(
    "--completion", type=click.Choice(["bash", "zsh", "fish"]), is_eager=True, expose_value=False,
    callback=_print_completion, help="Print the code that completes commands, options and names in this shell.",
)  # fmt: skip
def gimbalcal() -> None:
    """Calibrate inertial sensors on gimballed platforms, and state what physics the model omits."""


for _command in (command for group in GROUPS.values() for command in group):
    _command.params.append(EFFECTS)
    gimbalcal.add_command(_command)


if __name__ == "__main__":
    main()
