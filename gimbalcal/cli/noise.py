"""`gimbalcal noise`: Allan deviation of a unit at rest, and what of it a header or a filter takes."""

from __future__ import annotations

from pathlib import Path

import click

from gimbalcal.cli.options import example, output_options, progress, show, wrote
from gimbalcal.cli.output_folders import OVERWRITE, place


@click.command(epilog=example("gimbalcal noise data/space_stable_static --out noise"))
@click.argument("recording", type=click.Path(path_type=Path))
@OVERWRITE
@output_options("noise.json and report.html", "RECORDING-noise, here")
def noise(recording: Path, overwrite: bool, out: Path | None, quiet: bool, as_json: bool) -> None:
    """White noise, bias instability and random walk of every sensor of RECORDING, from its rests."""
    from gimbalcal.at_rest import content, noise_at_rest
    from gimbalcal.recording import read
    from gimbalcal.report.files import write_report
    from gimbalcal.report.noise_page import headline, noise_report

    there = place(out, [recording], "noise", ("noise.json", "report.html"), overwrite, as_json)
    tell = progress(quiet)
    tell(f"reading {recording.name}")
    r = read(recording)
    for remark in r.remarks:
        tell(f"note: {remark}")
    channels = noise_at_rest(r)
    made = content(r, channels)
    if there is not None:
        write_report("noise.json", made, noise_report(made, r.title), there.folder, there.question)
        wrote(there.folder, "noise.json", quiet)
    stated = [f'{k} = {{ value = {v["value"]:g}, unit = "{v["unit"]}" }}' for k, v in made["header"].items()]
    words = "\n".join([headline(made), *(["[noise]", *stated] if stated else [])])
    show(made, words, as_json, quiet, there.page if there else None)
