"""Files into files: a recording corrected, a calibration for another program, another rig's recording."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import click

from gimbalcal.cli.options import example, output_options, progress, show
from gimbalcal.cli.output_folders import OVERWRITE, placed
from gimbalcal.errors import InputError, amount

SAMPLES = "samples.csv"

CALIBRATION = click.option(
    "--calibration", "known", required=True, type=click.Path(path_type=Path),
    help="calibration.json, or another program's: Kalibr .yaml, PSINS .mat, TPOINT .mod, .csv.",
)  # fmt: skip


@click.command(
    epilog=example("gimbalcal apply data/space_stable_18 --calibration results/calibration.json --out corrected")
)
@click.argument("recording", type=click.Path(path_type=Path))
@CALIBRATION
@click.option("--inverse", is_flag=True, help="Physics to readings: what the calibrated unit would have read.")
@OVERWRITE
@output_options("the new recording", "RECORDING-corrected, or -corrupted with --inverse, here")
def apply(
    recording: Path, known: Path, inverse: bool, overwrite: bool, out: Path | None, quiet: bool, as_json: bool
) -> None:
    """Correct RECORDING by a calibration: readings to physics, into a recording folder."""
    from gimbalcal.calibration.exchange import read_calibration
    from gimbalcal.recording import read, write

    calibration, there = read_calibration(known), read(recording)
    folder = out or Path(f"{recording.name}-{'corrupted' if inverse else 'corrected'}")
    if folder.resolve() == recording.resolve():
        raise InputError(f"--out {folder} is the recording itself; give another folder")
    named = calibration.provenance.get("options", {}).get("sensor", "")
    there = next((r for r in there.sensors if r.sensor == named), replace(there, beside=()))
    made = calibration.corrupt(there) if inverse else calibration.apply(there)
    samples = "samples.parquet" if (recording / "samples.parquet").is_file() else SAMPLES
    with placed(folder, overwrite) as new:
        write(made, new, samples)
    direction = "physics to readings" if inverse else "readings to physics"
    done = "as the calibrated unit would read it" if inverse else "corrected"
    result = {"rows": len(made.time), "folder": str(folder), "direction": direction,
              "effects": sorted({e.id for e in calibration.effects})}  # fmt: skip
    show(result, f"wrote {made.title!r}, {done}, {amount(len(made.time), 'row')}, into {folder}", as_json, quiet)


@click.command(epilog=example("gimbalcal export csv --calibration results/calibration.json --out exported"))
@click.argument("kind")
@CALIBRATION
@OVERWRITE
@output_options("the file", "the current folder")
def export(kind: str, known: Path, overwrite: bool, out: Path | None, quiet: bool, as_json: bool) -> None:
    """Write a calibration for another program; KIND is kalibr, psins, tpoint, csv or json."""
    from gimbalcal.calibration.exchange import DIRECTION, FILES, read_calibration
    from gimbalcal.calibration.exchange import export as run

    calibration = read_calibration(known)
    path = (out or Path()) / FILES.get(kind, "calibration")
    if path.resolve() == known.resolve():
        raise InputError(f"{path} is the calibration itself; give another --out")
    with placed(path.parent, overwrite) as new:
        lost = run(calibration, kind, new / path.name)
    for words in lost:
        progress(quiet)(f"note: {words}")
    result = {"file": str(path), "direction": DIRECTION[kind], "lost": list(lost)}
    corrects = DIRECTION[kind] == "readings to physics"
    does = "corrects readings" if corrects else "tells what a unit reads of the truth"
    show(result, f"wrote {path}, which {does}", as_json, quiet)


class ImportCommand(click.Command):
    """The command `import`, whose help lists the importers that are installed."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the kinds of files above the options."""
        from gimbalcal.importers import KINDS

        with formatter.section("Kinds"):
            formatter.write_dl([(kind, KINDS[kind].summary) for kind in sorted(KINDS)])
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
@click.argument("kind")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="What the importer of this kind asks for.")
@OVERWRITE
@output_options("the recording", "the name of the first of FILES without its ending, here")
def import_(
    kind: str, files: tuple[Path, ...], settings: tuple[str, ...], overwrite: bool,
    out: Path | None, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Turn another rig's FILES into a recording folder; KIND is the rig or file type.

    All kinds take --set title=... and means=yes (one row for each dwell). docs/recording-format.md describes them;
    `gimbalcal new` guesses what nobody described.
    """
    from gimbalcal.importers import import_files
    from gimbalcal.recording import write

    options = dict(_pair(s) for s in settings)
    folder, tell = out or Path(files[0].stem), progress(quiet)
    if (folder / SAMPLES).resolve() in [file.resolve() for file in files]:
        raise InputError(f"{folder / SAMPLES} is to be read and would be written over; give another --out")
    tell(f"importing {amount(len(files), 'file')} as {kind}")
    recording = import_files(kind, files, options)
    for remark in recording.remarks:
        tell(remark)
    with placed(folder, overwrite) as new:
        write(recording, new, SAMPLES)
    summary = {"kind": recording.kind, "rows": len(recording.time), "folder": str(folder)}
    if as_json:
        print(json.dumps(summary))
    elif not quiet:
        print(f"wrote a {recording.kind} recording of {amount(len(recording.time), 'row')} into {folder}")


def _pair(setting: str) -> tuple[str, str]:
    name, equals, value = setting.partition("=")
    if not equals:
        raise InputError(f"--set takes NAME=VALUE, got {setting!r}")
    return name, value
