"""Before anything is recorded: what a schedule sees, and the schedule that sees most."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gimbalcal.cli.options import (
    LATITUDE,
    NOISE,
    POSITIVE,
    RUNS,
    SEED,
    example,
    names_option,
    output_options,
    progress,
    show,
    wrote,
)
from gimbalcal.cli.output_folders import OVERWRITE, place, placed
from gimbalcal.errors import InputError, amount

if TYPE_CHECKING:
    from gimbalcal.schedule import Schedule
    from gimbalcal.schedule.rotation import RotationSchedule

OBSERVABILITY = "observability.json"
TURNING_STATES = click.option(
    "--states", default="51", show_default=True, help="Of turns: what is estimated, 30, 51, or EFFECT[:AXIS],..."
)
RATE_NOISE = click.option(
    "--rate-noise", default=0.002, type=NOISE, show_default=True, help="Of turns: gyroscopes' noise, deg/sqrt(h)."
)
FORCE_NOISE = click.option(
    "--force-noise", default=5.0, type=NOISE, show_default=True, help="Of turns: accelerometers' noise, ug/sqrt(Hz)."
)
VELOCITY = click.option(
    "--velocity-sigma", default=1e-5, type=NOISE, show_default=True, help="Of turns: how still the place is, m/s."
)
FORCE_SIGMA = click.option(
    "--force-sigma", default=2.0, type=NOISE, show_default=True,
    help="Noise of the mean force of one position, or of ten minutes of a static run, ug.",
)  # fmt: skip


@click.command(
    epilog=example(
        "gimbalcal observe wu2018-18 --angle-sigma 5",
        "gimbalcal observe wei2022-30 --states 30 --latitude 34.2 --out turns",
    )
)
@click.argument("schedule")
@click.option("--angle-sigma", default=1.0, type=NOISE, show_default=True, help="Setting error of a position, arcsec.")
@FORCE_SIGMA
@click.option(
    "--latitude", default=40.0, type=LATITUDE, show_default=True, help="Static runs and schedules of turns: where, deg."
)
@names_option("--candidates", "Effects that may be there besides: would they show?")
@TURNING_STATES
@RATE_NOISE
@FORCE_NOISE
@VELOCITY
@OVERWRITE
@output_options("observability.json and report.html", "NAME-observability, here")
def observe(
    schedule: str, angle_sigma: float, force_sigma: float, latitude: float, candidates: tuple[str, ...], states: str,
    rate_noise: float, force_noise: float, velocity_sigma: float, overwrite: bool,
    out: Path | None, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Say what SCHEDULE can and cannot see, before anything is recorded: a name, a schedule.toml, or static-48h."""
    from gimbalcal.report.files import write_report
    from gimbalcal.schedule.file import is_rotation

    there = place(out, [schedule], "observability", (OBSERVABILITY, "report.html"), overwrite, as_json)
    if is_rotation(schedule):
        from gimbalcal.design.turning_observability import observe_turning
        from gimbalcal.report.plan_page import observability_report, turning_headline

        if candidates:
            raise InputError("--candidates is for positions; of a schedule of turns name them among --states")
        turned = observe_turning(schedule, latitude, states, rate_noise, force_noise, velocity_sigma)
        seen = turned.to_dict()
        if there is not None:
            write_report(OBSERVABILITY, seen, observability_report(seen), there.folder, there.question)
            wrote(there.folder, OBSERVABILITY, quiet)
        _table(seen, as_json or quiet)
        show(seen, turning_headline(seen), as_json, quiet, there.page if there else None)
        return
    from gimbalcal.design.observability import observe_any
    from gimbalcal.report.plan_page import headline, plan_report

    seen = observe_any(schedule, angle_sigma, force_sigma, latitude, candidates).to_dict()
    if there is not None:
        write_report(OBSERVABILITY, seen, plan_report(seen), there.folder, there.question)
        wrote(there.folder, OBSERVABILITY, quiet)
    _table(seen, as_json or quiet)
    show(seen, headline(seen), as_json, quiet, there.page if there else None)


@click.command(
    epilog=example(
        "gimbalcal design -n 12 --step 45 --angle-sigma 5 --out schedule",
        "gimbalcal design --kind rotation --states 30 --against wei2022-30 --tries 400",
    )
)
@click.option("--kind", type=click.Choice(["positions", "rotation"]), default="positions", show_default=True)
@click.option("--platform", default="space-stable", show_default=True, help="Name of the rig's gimbal chain.")
@click.option(
    "-n",
    "--positions",
    type=click.IntRange(1, 1000),
    default=18,
    show_default=True,
    help="How many positions to hold.",
)
@click.option("--step", default=45.0, type=POSITIVE, show_default=True, help="Angles of an axis: multiples, deg.")
@click.option("--angle-sigma", type=NOISE, default=None, help="Setting error, arcsec; left out: no angle is known.")
@FORCE_SIGMA
@names_option("--terms", "Effects to estimate (default: the baseline).")
@names_option("--separate", "Effects that the schedule should tell apart.")
@click.option(
    "--criterion",
    type=click.Choice(["D", "A", "position", "max", "sum"]),
    default=None,
    help="D, A or position (error of a day's navigation) of positions [D]; max or sum of the relative sigmas of turns "
    "[max].",
)
@TURNING_STATES
@click.option("--total", default=3870.0, type=POSITIVE, show_default=True, help="Of turns: all the time, s.")
@click.option("--rate", default=10.0, type=POSITIVE, show_default=True, help="Of turns: how fast, deg/s.")
@click.option("--ramp", default=1.0, type=POSITIVE, show_default=True, help="Of turns: to come to that, s.")
@click.option("--limit", default=720.0, type=POSITIVE, show_default=True, help="Of turns: of either axis, +- deg.")
@names_option("--against", "Schedules of turns that it should beat in every group.")
@click.option(
    "--latitude",
    default=40.0,
    type=LATITUDE,
    show_default=True,
    help="Of turns and of --criterion position: where, deg.",
)
@RATE_NOISE
@FORCE_NOISE
@VELOCITY
@click.option("--tries", default=4000, type=RUNS, show_default=True, help="Of turns: candidates to look at.")
@click.option("--seed", type=SEED, default=1, show_default=True, help="Of turns: of the search.")
@OVERWRITE
@output_options("schedule.toml and report.html", "PLATFORM-schedule, here")
def design(
    kind: str, platform: str, positions: int, step: float, angle_sigma: float | None, force_sigma: float,
    terms: tuple[str, ...], separate: tuple[str, ...], criterion: str | None, states: str, total: float, rate: float,
    ramp: float, limit: float, against: tuple[str, ...], latitude: float, rate_noise: float, force_noise: float,
    velocity_sigma: float, tries: int, seed: int, overwrite: bool, out: Path | None, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Choose what sees most under a rig's limits: positions that separate effects, or a sequence of turns."""
    from gimbalcal.atomic import write
    from gimbalcal.report.html import marked
    from gimbalcal.report.plan_page import design_headline, design_report

    named = [platform if kind == "positions" else "turns"]
    drawn: Schedule | RotationSchedule
    there = place(out, named, "schedule", ("schedule.toml", "report.html"), overwrite, as_json)
    if kind == "rotation":
        from gimbalcal.design.turning_design import design_turning, table_of
        from gimbalcal.schedule.file import rotation_toml

        _only(criterion, ("max", "sum"), kind)
        tell = progress(quiet)
        tell(f"looking at {amount(tries, 'sequence')} of turns")
        turned, seen = design_turning(
            table_of(step, limit, rate, ramp, total), latitude, states, against, criterion or "max",
            (rate_noise, force_noise, velocity_sigma), tries, seed, tell,
        )  # fmt: skip
        text, drawn = rotation_toml(turned), turned
    else:
        from gimbalcal.design.optimal import design as run
        from gimbalcal.design.positions import rig_of
        from gimbalcal.schedule.file import schedule_toml

        _only(criterion, ("D", "A", "position"), kind)
        rig = rig_of(platform, step, angle_sigma, force_sigma)
        schedule, seen = run(rig, positions, terms, criterion or "D", separate, latitude=latitude)
        text, drawn = schedule_toml(schedule), schedule
    if there is not None:
        with placed(there.folder, overwrite) as new:
            write(new / "schedule.toml", text)
            write(new / "report.html", marked(design_report(seen, drawn), there.question))
        wrote(there.folder, "schedule.toml", quiet)
    _table(seen, as_json or quiet)
    show(seen, design_headline(seen), as_json, quiet, there.page if there else None)


def _table(seen: Mapping[str, Any], silent: bool) -> None:
    """What would be known how well, above the answer."""
    from gimbalcal.report.console import bounds_table

    if not silent:
        print(bounds_table(seen), end="\n\n")


def _only(criterion: str | None, known: tuple[str, ...], kind: str) -> None:
    if criterion is not None and criterion not in known:
        raise InputError(f"--criterion {criterion} is not for --kind {kind}; write {' or '.join(known)}")
