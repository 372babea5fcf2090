"""`gimbalcal new`: a first recording from a log that nobody described yet."""

from __future__ import annotations

from pathlib import Path

import click

from gimbalcal.cli.options import LATITUDE, POSITIVE, Number, example, output_options, progress, show
from gimbalcal.cli.output_folders import OVERWRITE, placed
from gimbalcal.errors import amount


@click.command(
    epilog=example(
        "gimbalcal new imu.csv --out imu",
        "gimbalcal new accelerometers.csv gyroscopes.csv --out unit",
        "gimbalcal new stars.csv --latitude 48.1",
    )
)
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--rate",
    type=POSITIVE,
    default=None,
    help="Rows in a second: they are counted, and no column is the clock.",
)
@click.option(
    "--latitude",
    type=LATITUDE,
    default=None,
    metavar="DEG",
    help="Of the place: gravity is known by it, and the pole of an equatorial mount.",
)
@click.option("--height", type=Number(), default=None, metavar="M", help="Of the place, above the sea.")
@click.option(
    "--longitude",
    type=Number(-360, 360),
    default=None,
    metavar="DEG",
    help="Of the place, east is positive: right ascensions with UTC need it.",
)
@click.option("--title", default="", help="What the recording is called.  [default: the name of the first of LOGS]")
@OVERWRITE
@output_options("the recording and a page with its rests", "the name of the first of LOGS without its ending, here")
def new(
    logs: tuple[Path, ...],
    rate: float | None,
    latitude: float | None,
    height: float | None,
    longitude: float | None,
    title: str,
    overwrite: bool,
    out: Path | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Look at LOGS of a unit, a rig or a mount and propose a recording: columns, units, rests, platform."""
    from gimbalcal.atomic import write as write_text
    from gimbalcal.guess.proposal import propose
    from gimbalcal.recording import dwells, write
    from gimbalcal.report.new_page import clocked, commented, proposal_page

    tell = progress(quiet)
    tell(f"reading {amount(len(logs), 'log')}")
    found = propose(logs, title, rate or 0.0, latitude, height, longitude)
    r, folder = found.recording, out or Path(logs[0].stem)
    page = "stars.html" if r.kind == "pointing" else "rests.html"
    with placed(folder, overwrite) as made:
        write(r, made, "samples.parquet" if len(r.time) > 1_000_000 else "samples.csv")
        header = made / "recording.toml"
        write_text(header, commented(header.read_text(encoding="utf-8"), found))
        write_text(made / page, proposal_page(found))
    for name, g in found.guesses.items():
        tell(f"{name.strip()}: {g.in_words}, by {g.why}")
    for what, note in found.notes.items():
        tell(f"{what}: {note}")
    if found.left_out:
        tell(f"left out: {', '.join(name.strip() for name in found.left_out)}")
    for remark in r.remarks:
        tell(f"note: {remark}")
    stars, turned = r.kind == "pointing", r.kind == "rotation"
    rests = 0 if stars or turned else len(dwells(r))
    size = amount(len(r.time), "star") if stars else f"{amount(rests, 'rest')} and {amount(len(r.time), 'row')}"
    size = amount(len(r.time), "row") if turned or r.kind == "static-run" else size
    if len(r.time) > max(rests, 1) and not stars:  # a clock in another unit is seen at once
        size += f" over {clocked(r)}"
    made_of = f"a {r.kind} recording of {size}"
    correct = f"look at {folder / page} and correct {folder / 'recording.toml'} where a guess is wrong"
    columns = {n: {"quantity": g.quantity, "axis": g.axis, "unit": g.unit, "why": g.why}
               for n, g in found.guesses.items()}  # fmt: skip
    result = {"folder": str(folder), "kind": r.kind, "rests": rests, "rows": len(r.time), "columns": columns,
              "left_out": list(found.left_out), "notes": dict(found.notes)}  # fmt: skip
    after = "calibrate" if stars or turned or rests > 1 or r.kind == "static-run" else "noise"
    how = " --method rate-table" if turned and r.has("specific_force") else ""
    words = f"wrote {folder}, {made_of}; {correct}, then: gimbalcal {after} {folder}{how}"
    show(result, words, as_json, quiet)
