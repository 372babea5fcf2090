"""A unit's history on the command line: `--store` of calibrate and diagnose, and `compare`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from gimbalcal.cli.options import F, example, output_options, show, wrote
from gimbalcal.cli.output_folders import OVERWRITE, place
from gimbalcal.errors import InputError

STORE = click.option(
    "--store", type=click.Path(path_type=Path), default=None, help="Keep the result in this file too: a unit's history."
)
UNIT = click.option("--unit", default="", help="Which unit it is, in a --store of several.")


def stored(command: F) -> F:
    """The options --store and --unit."""
    return STORE(UNIT(command))


def remember(store: Path | None, unit: str, kind: str, content: Mapping[str, Any]) -> None:
    """Keep a result in the store, if one is named; of a sensor beside others under its own name."""
    if store is None:
        return
    from gimbalcal.history import Entry, date_in, keep

    origin = content.get("provenance", {})
    sensor = origin.get("options", {}).get("sensor", "")
    date = date_in(origin) or datetime.now(UTC).isoformat(timespec="seconds")
    keep(store, Entry(" ".join(filter(None, [unit, sensor])), date, kind, content))


@click.command(
    epilog=example(
        "gimbalcal compare monday/calibration.json friday/calibration.json --out history",
        'gimbalcal compare --store unit7.sqlite --allow "bias:x=50 ug"',
    )
)
@click.argument("calibrations", nargs=-1, type=click.Path(path_type=Path))
@stored
@click.option(
    "--allow", multiple=True, metavar="NAME='VALUE UNIT'", help="How far a parameter may move until the next."
)
@OVERWRITE
@output_options("compare.json, report.html, and all values as history.csv and history.parquet", "NAME-history, here")
def compare(
    calibrations: tuple[Path, ...], store: Path | None, unit: str, allow: tuple[str, ...],
    overwrite: bool, out: Path | None, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """How the parameters of a unit move from calibration to calibration: CALIBRATIONS, those of a --store, or both."""
    from gimbalcal.history import compare as run
    from gimbalcal.history import dated_file, of_store
    from gimbalcal.report.files import write_comparison
    from gimbalcal.report.naming import answered

    if store is None and not calibrations:
        raise InputError("`compare` takes calibration.json files, or a --store that holds some")
    files = ("compare.json", "history.csv", "history.parquet", "report.html")
    named = [unit] if unit else [store] if store is not None else [c.absolute().parent.name for c in calibrations]
    there = place(out, named, "history", files, overwrite, as_json)
    kept, diagnoses = of_store(store, unit) if store is not None else ((), ())
    made = run([*kept, *(dated_file(c) for c in calibrations)], unit, dict(_allowed(a) for a in allow))
    content = made.to_dict()
    if there is not None:
        write_comparison(content, diagnoses, there.folder, there.question)
        wrote(there.folder, "compare.json", quiet)
    show(content, answered(made.in_words), as_json, quiet, there.page if there else None)
    sys.exit(0 if made.agree else 1)


def _allowed(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise InputError(f"--allow takes NAME='VALUE UNIT', got {text!r}")
    return name.strip(), value
