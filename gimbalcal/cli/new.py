"""`gimbalcal new`: a first recording from a log that nobody described yet."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gimbalcal.cli.options import example, output_options, progress, show
from gimbalcal.cli.placing import OVERWRITE, placed
from gimbalcal.errors import amount

if TYPE_CHECKING:
    from gimbalcal.importers.guess import Guess


@click.command(
    epilog=example("gimbalcal new imu.csv --out imu", "gimbalcal new accelerometers.csv gyroscopes.csv --out unit")
)
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--rate",
    type=click.FloatRange(min=0, min_open=True),
    default=None,
    help="Rows in a second, where no column is a clock.",
)
@click.option("--title", default="", help="What the recording is called.  [default: the name of the first of LOGS]")
@OVERWRITE
@output_options("the recording and a page with its rests", "the name of the first of LOGS without its ending, here")
def new(
    logs: tuple[Path, ...],
    rate: float | None,
    title: str,
    overwrite: bool,
    out: Path | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Look at LOGS of a unit, one or several with one clock, and propose a recording: columns, units, rests."""
    from gimbalcal.atomic import write as write_text
    from gimbalcal.importers.log import propose
    from gimbalcal.recording import dwells, write
    from gimbalcal.report.new_page import commented, proposal_page

    tell = progress(quiet)
    tell(f"reading {amount(len(logs), 'log')}")
    found = propose(logs, title, rate or 0.0)
    r, folder = found.recording, out or Path(logs[0].stem)
    with placed(folder, overwrite) as made:
        write(r, made, "samples.parquet" if len(r.time) > 1_000_000 else "samples.csv")
        header = made / "recording.toml"
        write_text(header, commented(header.read_text(encoding="utf-8"), found))
        write_text(made / "rests.html", proposal_page(found))
    for name, g in found.guesses.items():
        tell(f"{name.strip()}: {_held(g)}, by {g.why}")
    for remark in r.remarks:
        tell(f"note: {remark}")
    rests = len(dwells(r))
    what = f"a {r.kind} recording of {amount(rests, 'rest')} and {amount(len(r.time), 'row')}"
    correct = f"look at {folder / 'rests.html'} and correct {folder / 'recording.toml'} where a guess is wrong"
    columns = {n: {"quantity": g.quantity, "axis": g.axis, "unit": g.unit, "why": g.why}
               for n, g in found.guesses.items()}  # fmt: skip
    result = {"folder": str(folder), "kind": r.kind, "rests": rests, "rows": len(r.time), "columns": columns,
              "left_out": list(found.left_out)}  # fmt: skip
    words = f"wrote {folder}, {what}; {correct}, then: gimbalcal calibrate {folder}"
    show(result, words, as_json, quiet)


def _held(g: Guess) -> str:
    """What a column is taken for, in a few words."""
    return " ".join(filter(None, [g.quantity.replace("_", " "), g.axis, f"[{g.unit}]" if g.unit else ""]))
