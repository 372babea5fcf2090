"""Command line: each command is a few lines around a function of the package.

Exit status: 0 done; 1 done, and the model does not explain the data; 2 bad input, nothing written; 3 a defect of this
program; 130 interrupted.
Heavy packages are imported inside the commands, so that `gimbalcal --help` answers at once.
"""

from __future__ import annotations

import gc
import sys
import traceback

import click

from gimbalcal import __version__
from gimbalcal.atomic import FULL
from gimbalcal.cli.analysis import calibrate, compare, diagnose, navigate, noise
from gimbalcal.cli.catalogue import catalogue
from gimbalcal.cli.conversion import apply, export, import_, new
from gimbalcal.cli.demonstration import demo
from gimbalcal.cli.options import EFFECTS, example
from gimbalcal.cli.plain_characters import print_plain_characters
from gimbalcal.cli.planning import budget, campaign, design, observe, simulate
from gimbalcal.errors import InputError

GC_THRESHOLD = 50_000  # objects between collections, which at the default take a tenth of a short command
CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 110}


def main() -> None:
    """Run the command line; every refusal is one sentence on stderr and exit status 2."""
    gc.set_threshold(GC_THRESHOLD)
    print_plain_characters((sys.stdout, sys.stderr))
    try:
        gimbalcal(standalone_mode=False)
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


def _stop(sentence: str, status: int) -> None:
    print(sentence, file=sys.stderr)
    sys.exit(status)


@click.group(context_settings=CONTEXT, epilog=example("gimbalcal demo", "gimbalcal calibrate --help"))
@click.version_option(__version__, prog_name="gimbalcal")
def gimbalcal() -> None:
    """Calibrate inertial sensors on gimballed platforms, and say what physics the model left out."""


for _command in (
    apply, budget, calibrate, campaign, catalogue, compare, demo, design, diagnose, export, import_, navigate, new,
    noise, observe, simulate,
):  # fmt: skip
    _command.params.append(EFFECTS)
    gimbalcal.add_command(_command)


if __name__ == "__main__":
    main()
