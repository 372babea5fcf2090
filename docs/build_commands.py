"""The page of the command line: the help of every command, as it prints it."""

from __future__ import annotations

from click.testing import CliRunner

from gimbalcal.cli import gimbalcal

HEAD = """# Commands

`gimbalcal COMMAND --help` prints what stands here. Every command that computes takes `--out DIR`, `--quiet` (no
progress on stderr) and `--json` (the result on stdout).

Exit status: 0 done; 1 done, and the model does not explain the data; 2 bad input, one sentence, nothing written; 3 a
defect of the program; 130 interrupted."""


def page() -> str:
    """The page as text."""
    parts = [HEAD]
    for name in sorted(gimbalcal.commands):
        told = CliRunner().invoke(gimbalcal, [name, "--help"], prog_name="gimbalcal", terminal_width=92).output
        parts += [f"## {name}", f"```text\n{told.strip()}\n```"]
    return "\n\n".join(parts) + "\n"
