"""Write the page of the command line: the help of every command, as it prints it."""

from __future__ import annotations

from click.testing import CliRunner

from gimbalcal.cli import gimbalcal

HEAD = """# Commands and files

`gimbalcal COMMAND --help` prints these texts. Every command that computes takes `--out DIR`, `--quiet` (no progress
on stderr) and `--json` (the result on stdout).

Exit status: 0 success; 1 success, and the model does not explain the data; 2 bad input: one sentence, nothing written;
3 a defect of the program; 130 interrupted."""


def page() -> str:
    """Return the page as text."""
    parts = [HEAD]
    for name in sorted(gimbalcal.commands):
        text = CliRunner().invoke(gimbalcal, [name, "--help"], prog_name="gimbalcal", terminal_width=92).output
        parts += [f"## {name}", f"```text\n{text.strip()}\n```"]
    return "\n\n".join(parts) + "\n"
