"""Write the page of the command line: the help of every command, as it prints it."""

from __future__ import annotations

from click.testing import CliRunner

from gimbalcal.cli import GROUPS, first_sentence, gimbalcal

HEAD = """# Commands and files

`gimbalcal COMMAND --help` prints these texts. Every command that computes takes `--out DIR`, `--quiet` (no progress
on stderr) and `--json` (the result on stdout). Results go to a folder that the console names, `NAME-calibration` or
`NAME-diagnosis` for example, unless `--out` is given; existing results of a different kind are kept unless
`--overwrite` is given. `eval "$(gimbalcal --completion bash)"` completes commands, options and names; `zsh` and `fish`
likewise.

Exit status: 0 success; 1 success, and the model does not explain the data; 2 bad input: one sentence, nothing written;
3 a defect of the program; 130 interrupted."""


def page() -> str:
    """Return the page as text."""
    parts = [HEAD]
    for title, commands in GROUPS.items():
        rows = [f"| [`{c.name}`](#{c.name}) | {first_sentence(c)} |" for c in commands]
        parts.append("\n".join([f"| {title.lower()} | |", "|---|---|", *rows]))
    parts.append("What `calibrate` does with each kind of recording: [methods](methods.md).")
    for name in (str(command.name) for group in GROUPS.values() for command in group):
        text = CliRunner().invoke(gimbalcal, [name, "--help"], prog_name="gimbalcal", terminal_width=92).output
        parts += [f"## {name}", f"```text\n{text.strip()}\n```"]
    return "\n\n".join(parts) + "\n"
