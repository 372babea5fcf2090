"""What a calibration is worth on the way: a static run navigated, and the error budget of a planned calibration."""

from __future__ import annotations

from pathlib import Path

import click

from gimbalcal.cli.options import DRAWS, SEED, Number, example, output_options, progress, show, wrote
from gimbalcal.cli.output_folders import OVERWRITE, place
from gimbalcal.errors import InputError

DAMPED = "Damping of Schuler's swing by the velocity reference, of critical; 0: none"


@click.command(
    epilog=example(
        "gimbalcal navigate data/space_stable_static --calibration results/calibration.json --out navigation"
    )
)
@click.argument("recording", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--calibration", "known", multiple=True, type=click.Path(path_type=Path), metavar="FILE [FILE ...]",
    help="calibration.json, as many as are to be compared, in order.",
)  # fmt: skip
@click.option(
    "--damping", type=Number(min=0, max=5), default=None,
    help=f"{DAMPED} [0.5 of a platform, 0 of a strapdown unit].",
)  # fmt: skip
@click.option(
    "--alignment",
    type=Number(min=0.1, max=1440),
    default=10.0,
    show_default=True,
    help="Minutes at the beginning in which the attitude is found.",
)
@click.option("--samples", type=DRAWS, default=50, show_default=True, help="Draws behind the sampled bands.")
@click.option("--seed", type=SEED, default=1, show_default=True, help="Seed of the draws.")
@OVERWRITE
@output_options("navigation.json and report.html", "NAME-navigation, here")
def navigate(
    recording: tuple[Path, ...], known: tuple[Path, ...], damping: float | None, alignment: float, samples: int,
    seed: int, overwrite: bool, out: Path | None, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Navigate without a calibration and with each: what they are worth in position and attitude.

    RECORDING: a static run of a space-stable platform, or a strapdown unit that stays in its place.
    """
    from gimbalcal.calibration.exchange import read_calibration
    from gimbalcal.navigate.mechanisations import usual
    from gimbalcal.navigate.navigation_errors import labels
    from gimbalcal.navigate.summary import content
    from gimbalcal.navigate.uncertainty import before_and_after
    from gimbalcal.pipeline import load
    from gimbalcal.report.files import write_report
    from gimbalcal.report.navigation_page import headline, navigation_report

    folder, files = _one_recording(recording, known)
    there = place(out, [folder], "navigation", ("navigation.json", "report.html"), overwrite, as_json)
    tell = progress(quiet)
    (run,) = load([folder], tell)
    aids = usual(run, damping, 60 * alignment)
    chosen = list(zip(labels(files), [read_calibration(f) for f in files], strict=True))
    runs = before_and_after(run, chosen, aids, samples, seed, tell)
    provenance = {
        "recordings": run.files,
        "calibrations": [{"name": name, "path": str(f)} for (name, _), f in zip(chosen, files, strict=True)],
        "samples": samples,
        "seed": seed,
    }
    made = content(runs, aids, provenance)
    if there is not None:
        page = navigation_report(made, runs, run.title)
        write_report("navigation.json", made, page, there.folder, there.question)
        wrote(there.folder, "navigation.json", quiet)
    show(made, headline(made), as_json, quiet, there.page if there else None)


@click.command(
    epilog=example(
        "gimbalcal budget wu2018-18 wu2018-static --hours 24 --out budget",
        "gimbalcal budget wei2022-30 wei2022-static --states 30 --hours 24 --out budget",
    )
)
@click.argument("scenarios", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--hours", multiple=True, type=Number(min=0.5, max=240), default=(6.0, 24.0, 72.0), show_default=True,
    help="Within how many hours the position error is told; as often as needed.",
)  # fmt: skip
@click.option("--with", "more", multiple=True, metavar="EFFECT", help="An effect that the calibration holds too.")
@click.option("--states", default="", help="Of turns: what is calibrated, 30, 51, or EFFECT[:AXIS],... [51].")
@click.option(
    "--damping", type=Number(min=0, max=5), default=None,
    help=f"{DAMPED} [0.5 of a platform, 0 of a strapdown unit].",
)  # fmt: skip
@OVERWRITE
@output_options("budget.json and report.html", "NAME-budget, here")
def budget(
    scenarios: tuple[Path, ...], hours: tuple[float, ...], more: tuple[str, ...], states: str, damping: float | None,
    overwrite: bool, out: Path | None, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Say what a calibration by these SCENARIOS leaves of position error, parameter by parameter, before it is made.

    SCENARIOS: positions and static runs of a space-stable platform; or turns of a strapdown unit in its place, and a
    rest, which says where and how it stands when it navigates.
    """
    from gimbalcal.design.budget import budget as run
    from gimbalcal.report.files import write_report
    from gimbalcal.report.naming import answered
    from gimbalcal.report.navigation_page import budget_report

    there = place(out, scenarios, "budget", ("budget.json", "report.html"), overwrite, as_json)
    made = run(scenarios, hours, more, damping, states)
    if there is not None:
        write_report("budget.json", made.to_list(), budget_report(made), there.folder, there.question)
        wrote(there.folder, "budget.json", quiet)
    show(made.to_list(), answered(made.in_words), as_json, quiet, there.page if there else None)


def _one_recording(given: tuple[Path, ...], known: tuple[Path, ...]) -> tuple[Path, list[Path]]:
    """The recording among the arguments, and the calibrations in order: files that follow one belong to it."""
    files = [p for p in given if p.is_file()]
    folders = [p for p in given if not p.is_file()]
    if len(folders) != 1:
        named = ", ".join(map(str, folders)) or "none"
        raise InputError(f"navigate takes one recording folder, got {named}; calibrations come after --calibration")
    return folders[0], [*known, *files]
