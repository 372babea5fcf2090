"""Run every command of the tutorials again, and insert its output.

    python docs/build_tutorials.py FOLDER [--check] [PAGE ...]

FOLDER holds the real recordings that the pages name, one folder a data set, as for build_real.py. A page's commands are
the lines after `$ ` in its blocks of kind `console`; they run one after the other in an empty folder that sees `data/`
of the project and the files of FOLDER. With --check nothing is written, and the exit status is 1 where a page says
something else.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
BLOCK = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)
FILES = {
    "imu0.log": "mikoff_mpu9150/imu0.log",
    "point_20210821.dat": "mmt_pointing/point_20210821.dat",
    "warp-astron.dat": "gem_mount_pointing/warp-astron.dat",
    "tilt_table_200hz.npz": "tilt_table/tilt_table_200hz.npz",
}


def rerun(text: str, place: Path) -> str:
    """Return the page with the present output of its commands."""

    def block(found: re.Match[str]) -> str:
        lines: list[str] = []
        for command in re.findall(r"^\$ (.*(?:\\\n.*)*)", found[1], re.MULTILINE):
            lines += [f"$ {command}", printed(command, place)]
        return "```console\n" + "".join(f"{line}\n" for line in lines if line) + "```"

    return BLOCK.sub(block, text)


def printed(command: str, place: Path) -> str:
    """Return what a command prints, progress included, and an exit status other than 0. Refusals end the run."""
    programs = place / ".bin"
    environment = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "100"}
    done = subprocess.run(  # noqa: S602  the commands are those of our own pages
        command, shell=True, cwd=place, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        check=False,
    )  # fmt: skip
    if done.returncode > 1:
        raise SystemExit(f"{command}\n{done.stdout}")
    lines = (line.rstrip() for line in done.stdout.strip("\n").splitlines())
    out = "\n".join(line for line in lines if not line.endswith(" s so far"))  # how long it takes is the machine's
    status = "(exit status 1)" if done.returncode else ""
    return "\n".join(filter(None, [out, status]))


def furnish(place: Path, recordings: Path) -> None:
    """Provide the program, the recordings that ship, and the real files in a folder."""
    (place / ".bin").mkdir()
    program = place / ".bin" / "gimbalcal"
    program.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m gimbalcal "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    (place / "data").symlink_to(ROOT / "data")
    for name, path in FILES.items():
        if (recordings / path).exists():
            (place / name).symlink_to((recordings / path).resolve())


def main() -> int:
    """Run the pages; return 1 if --check finds a difference."""
    parser = argparse.ArgumentParser(description="run the tutorials again")
    parser.add_argument("recordings", type=Path)
    parser.add_argument("pages", nargs="*", type=Path)
    parser.add_argument("--check", action="store_true")
    asked = parser.parse_args()
    differ = 0
    for page in asked.pages or sorted((DOCS / "tutorials").glob("*.md")):
        before = page.read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            furnish(Path(folder), asked.recordings)
            after = rerun(before, Path(folder))
        differ |= after != before
        sys.stdout.write(f"{page.name}: {'unchanged' if after == before else 'changed'}\n")
        if not asked.check:
            page.write_text(after, encoding="utf-8")
    return int(asked.check and differ)


if __name__ == "__main__":
    sys.exit(main())
