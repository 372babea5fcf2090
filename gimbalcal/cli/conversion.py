"""Convert files: correct a recording, export a calibration, import recordings, describe an unknown log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import click

from gimbalcal.atomic import as_json
from gimbalcal.cli.options import HEIGHT, LATITUDE, POSITIVE, FilePath, Number, completing, example, named_settings
from gimbalcal.cli.output_folders import Output, output_options
from gimbalcal.cli.plain_characters import say
from gimbalcal.errors import InputError, number_of

SAMPLES = "samples.csv"

CALIBRATION = click.option(
    "--calibration", "known", required=True, type=FilePath(),
    help="calibration.json, or another program's: Kalibr .yaml, PSINS .mat, TPOINT .mod, .csv.",
)  # fmt: skip


@click.command(
    epilog=example("gimbalcal apply data/space_stable_18 --calibration results/calibration.json --out corrected")
)
@click.argument("recording", type=FilePath())
@CALIBRATION
@click.option("--inverse", is_flag=True, help="Physics to readings: what the calibrated unit would have read.")
@output_options("the new recording", "RECORDING-corrected, or -corrupted with --inverse, here")
def apply(recording: Path, known: Path, inverse: bool, output: Output) -> None:
    """Correct the readings of RECORDING by a calibration, into a new recording."""
    from gimbalcal.calibration.exchange import read_calibration
    from gimbalcal.recording import read, write

    calibration, original = read_calibration(known), read(recording)
    folder = output.out or Path(f"{recording.name}-{'corrupted' if inverse else 'corrected'}")
    if folder.resolve() == recording.resolve():
        raise InputError(f"--out {folder} is the recording itself; give another folder")
    named = calibration.provenance.options.sensor or ""
    original = next((r for r in original.sensors if r.sensor == named), replace(original, other_sensors=()))
    corrected = calibration.corrupt(original) if inverse else calibration.apply(original)
    samples = "samples.parquet" if (recording / "samples.parquet").is_file() else SAMPLES
    with output.staged(folder) as new:
        write(corrected, new, samples)
    for remark in corrected.remarks[len(original.remarks) :]:
        output.progress(f"note: {remark}")
    direction = "physics to readings" if inverse else "readings to physics"
    done = "as the calibrated unit would read it" if inverse else "corrected"
    result = {"rows": len(corrected.time), "folder": str(folder), "direction": direction,
              "effects": sorted({e.id for e in calibration.effects})}  # fmt: skip
    output.show(result, f"wrote {corrected.title!r}, {done}, {number_of(len(corrected.time), 'row')}, into {folder}")


def _export_kinds() -> Iterable[str]:
    from gimbalcal.calibration.exchange import FORMATS

    return FORMATS


def _import_kinds() -> Iterable[str]:
    from gimbalcal.importers import KINDS

    return KINDS


@click.command(epilog=example("gimbalcal export csv --calibration results/calibration.json --out exported"))
@click.argument("kind", shell_complete=completing(_export_kinds))
@CALIBRATION
@output_options("the file", "the current folder")
def export(kind: str, known: Path, output: Output) -> None:
    """Write a calibration for another program; KIND is kalibr, psins, tpoint, csv or json."""
    from gimbalcal.calibration.exchange import TO_PHYSICS, format_of, read_calibration
    from gimbalcal.calibration.exchange import export as run

    calibration, form = read_calibration(known), format_of(kind)
    path = (output.out or Path()) / form.file
    if path.resolve() == known.resolve():
        raise InputError(f"{path} is the calibration itself; give another --out")
    with output.staged(path.parent) as new:
        lost = run(calibration, kind, new / path.name)
    for words in lost:
        output.progress(f"note: {words}")
    result = {"file": str(path), "direction": form.direction, "lost": list(lost)}
    does = "corrects readings" if form.direction == TO_PHYSICS else "gives what a unit reads for true quantities"
    output.show(result, f"wrote {path}, which {does}")


class ImportCommand(click.Command):
    """The command `import`, whose help lists the importers that are installed."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the kinds of files above the options."""
        from gimbalcal.importers import KINDS

        with formatter.section("Kinds"):
            formatter.write_dl([(name, each.summary) for name, each in sorted(KINDS.items())])
        super().format_options(ctx, formatter)


@click.command(
    "import",
    cls=ImportCommand,
    epilog=example(
        "gimbalcal import mikoff imu0.log --set rate=100 --out imu0",
        "gimbalcal import tpoint run.dat --out monday",
        "gimbalcal import csv log.csv --set header=columns.toml --set skip=2",
    ),
)
@click.argument("kind", shell_complete=completing(_import_kinds))
@click.argument("files", nargs=-1, required=True, type=FilePath())
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="What the importer of this kind asks for.")
@output_options("the recording", "the name of the first of FILES without its ending, here")
def import_(kind: str, files: tuple[Path, ...], settings: tuple[str, ...], output: Output) -> None:
    """Convert FILES of another rig or program into a recording; KIND is the rig or the type of file.

    All kinds take --set title=... and means=yes (one row for each dwell). docs/recording-format.md describes them;
    `gimbalcal new` guesses what nobody described.
    """
    from gimbalcal.importers import import_files
    from gimbalcal.recording import write

    options = named_settings("--set NAME=VALUE", settings)
    folder = output.out or Path(files[0].stem)
    if (folder / SAMPLES).resolve() in [file.resolve() for file in files]:
        raise InputError(f"{folder / SAMPLES} is to be read and would be written over; give another --out")
    output.progress(f"importing {number_of(len(files), 'file')} as {kind}")
    recording = import_files(kind, files, options)
    for remark in recording.remarks:
        output.progress(remark)
    with output.staged(folder) as new:
        write(recording, new, SAMPLES)
    summary = {"kind": recording.kind, "rows": len(recording.time), "folder": str(folder)}
    if output.as_json:
        say(as_json(summary))
    else:
        say(f"wrote a {recording.kind} recording of {number_of(len(recording.time), 'row')} into {folder}")


@click.command(
    epilog=example(
        "gimbalcal new imu.csv --out imu",
        "gimbalcal new imu.csv --unit angular_rate=deg/s --out imu",
        "gimbalcal new accelerometers.csv gyroscopes.csv --out unit",
        "gimbalcal new stars.csv --latitude 48.1",
    )
)
@click.argument("logs", nargs=-1, required=True, type=FilePath())
@click.option(
    "--rate", type=POSITIVE, default=None, help="Rows in a second: they are counted, and no column is the clock."
)
@click.option(
    "--latitude",
    type=LATITUDE,
    default=None,
    metavar="DEG",
    help="Of the place: gravity is known by it, and the pole of an equatorial mount.",
)
@click.option("--height", type=HEIGHT, default=None, metavar="M", help="Of the place, above the sea.")
@click.option(
    "--longitude",
    type=Number(-360, 360),
    default=None,
    metavar="DEG",
    help="Of the place, east is positive: right ascensions with UTC need it.",
)
@click.option(
    "--unit",
    "units",
    multiple=True,
    metavar="QUANTITY=UNIT",
    help="Of time, specific_force or angular_rate, where no name states it and the numbers are not clear.",
)
@click.option("--title", default="", help="What the recording is called.  [default: the name of the first of LOGS]")
@output_options("the recording and a page with its rests", "the name of the first of LOGS without its ending, here")
def new(
    logs: tuple[Path, ...], rate: float | None, latitude: float | None, height: float | None, longitude: float | None,
    units: tuple[str, ...], title: str, output: Output,
) -> None:  # fmt: skip
    """Propose a recording from LOGS of a unit, a rig or a mount: columns, units, dwells, platform.

    LOGS are text tables of any layout, messages and JSON lines, MATLAB, HDF5, NumPy, Parquet and JSON files, records of
    doubles, guide logs of PHD2, files of TPOINT and of the MMT. The reason for each choice is printed and
    written next to it in recording.toml.
    """
    from gimbalcal.atomic import write as write_text
    from gimbalcal.guess.proposal import propose_recording
    from gimbalcal.recording import dwells, write
    from gimbalcal.recording.dwell import UP_AND_DOWN, in_several_attitudes
    from gimbalcal.report.new_page import commented_header, duration_and_rate, proposal_page

    output.progress(f"reading {number_of(len(logs), 'log')}")
    proposal = propose_recording(
        logs, title, rate or 0.0, latitude, height, longitude, named_settings("--unit QUANTITY=UNIT", units)
    )
    r, folder = proposal.recording, output.out or Path(logs[0].stem)
    page = "stars.html" if r.kind.sighting else "rests.html"
    with output.staged(folder) as staged:
        write(r, staged, "samples.parquet" if len(r.time) > 1_000_000 else "samples.csv")
        header = staged / "recording.toml"
        write_text(header, commented_header(header.read_text(encoding="utf-8"), proposal))
        write_text(staged / page, proposal_page(proposal))
    for name, g in proposal.guesses.items():
        output.progress(f"{name.strip()}: {g.in_words}, by {g.why}")
    for what, note in proposal.notes.items():
        output.progress(f"{what}: {note}")
    if proposal.left_out:
        output.progress(f"left out: {', '.join(name.strip() for name in proposal.left_out)}")
    for remark in r.remarks:
        output.progress(f"note: {remark}")
    stars, turned = r.kind.sighting, r.kind.rotating
    intervals = 0 if stars or turned else len(dwells(r))
    size = (
        number_of(len(r.time), "star")
        if stars
        else f"{number_of(intervals, 'rest')} and {number_of(len(r.time), 'row')}"
    )
    size = number_of(len(r.time), "row") if turned or r.kind.stabilised else size
    if len(r.time) > max(intervals, 1) and not stars:  # a clock in another unit is seen at once
        size += f" over {duration_and_rate(r)}"
    description = f"a {r.kind} recording of {size}"
    correct = f"look at {folder / page} and correct {folder / 'recording.toml'} where a guess is wrong"
    columns = {
        n: {"quantity": g.quantity, "axis": g.axis, "unit": g.unit, "why": g.why} for n, g in proposal.guesses.items()
    }
    result = {"folder": str(folder), "kind": r.kind, "rests": intervals, "rows": len(r.time), "columns": columns,
              "left_out": list(proposal.left_out), "notes": dict(proposal.notes)}  # fmt: skip
    after = "calibrate" if stars or turned or r.kind.stabilised or in_several_attitudes(r, UP_AND_DOWN) else "noise"
    how = " --method rate-table" if turned and r.has("specific_force") else ""
    how = " --method attitude" if turned and r.axes("attitude") else how
    words = f"wrote {folder}, {description}; {correct}, then: gimbalcal {after} {folder}{how}"
    output.show(result, words)
