"""Plan and simulate: observability and design of schedules, error budgets, recordings and campaigns from truth."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gimbalcal.cli.options import (
    DAMPING,
    GRADE,
    LATITUDE,
    NOISE,
    POSITIVE,
    RECORDINGS,
    RUNS,
    SCHEDULER,
    SEED,
    WORKERS,
    FilePath,
    Number,
    completing,
    example,
    names_option,
)
from gimbalcal.cli.output_folders import Output, output_options
from gimbalcal.errors import InputError, number_of

if TYPE_CHECKING:
    from gimbalcal.design.optimal import PositionsDesign
    from gimbalcal.design.turning_design import TurnsDesign

OBSERVABILITY = "observability.json"


def _schedules() -> list[str]:
    from gimbalcal.schedule import ROTATIONS, SCHEDULES

    return [*SCHEDULES, *ROTATIONS, "static-48h"]


def _scenarios() -> list[str]:
    from gimbalcal.simulate.scenario import shipped

    return shipped()


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
@click.argument("schedule", type=FilePath(str), shell_complete=completing(_schedules))
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
@output_options("observability.json and report.html", "NAME-observability, here")
def observe(
    schedule: str, angle_sigma: float, force_sigma: float, latitude: float, candidates: tuple[str, ...], states: str,
    rate_noise: float, force_noise: float, velocity_sigma: float, output: Output,
) -> None:  # fmt: skip
    """State what SCHEDULE can and cannot show, before anything is recorded.

    SCHEDULE: the name of one that ships (wu2018-18, cai2016-18, wei2022-30), a schedule.toml, or static-48h.
    """
    from gimbalcal.api import observe as run
    from gimbalcal.report.plan_page import schedule_report

    target = output.folder([schedule], "observability", (OBSERVABILITY, "report.html"))
    result = run(
        schedule, angle_sigma, force_sigma, latitude, candidates, states, rate_noise, force_noise, velocity_sigma
    )
    output.deliver(target, OBSERVABILITY, result.to_dict(), partial(schedule_report, result), str(result))


@click.command(
    epilog=example(
        "gimbalcal design -n 12 --step 45 --angle-sigma 5 --out schedule",
        "gimbalcal design --learn temperature --angle-sigma 5 --out warm",
        "gimbalcal design --kind rotation --states 30 --against wei2022-30 --tries 400",
    )
)
@click.option("--kind", type=click.Choice(["positions", "rotation"]), default="positions", show_default=True)
@click.option("--platform", default="space-stable", show_default=True, help="Name of the rig's gimbal chain.")
@click.option(
    "-n", "--positions", type=click.IntRange(1, 1000), default=18, show_default=True, help="How many positions to hold."
)
@click.option("--step", default=45.0, type=POSITIVE, show_default=True, help="Angles of an axis: multiples, deg.")
@click.option("--angle-sigma", type=NOISE, default=None, help="Setting error, arcsec; left out: no angle is known.")
@FORCE_SIGMA
@names_option("--terms", "Effects to estimate (default: the baseline).")
@names_option("--separate", "Effects that the schedule should distinguish.")
@names_option("--learn", "One or two variables of an unknown law that the schedule should show.")
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
@output_options("schedule.toml and report.html", "PLATFORM-schedule, here")
def design(
    kind: str, platform: str, positions: int, step: float, angle_sigma: float | None, force_sigma: float,
    terms: tuple[str, ...], separate: tuple[str, ...], learn: tuple[str, ...], criterion: str | None, states: str,
    total: float, rate: float, ramp: float, limit: float, against: tuple[str, ...], latitude: float,
    rate_noise: float, force_noise: float, velocity_sigma: float, tries: int, seed: int, output: Output,
) -> None:  # fmt: skip
    """Choose the positions, or the sequence of turns, that show most within the limits of a rig."""
    from gimbalcal.atomic import write
    from gimbalcal.report.console import groups_table
    from gimbalcal.report.html import page_with_question
    from gimbalcal.report.plan_page import design_headline, design_report
    from gimbalcal.words.tables import bounds_table

    turning = kind == "rotation"
    if turning and learn:
        raise InputError("--learn plans positions: leave out --kind rotation")
    named = ["turns" if turning else platform]
    plan: PositionsDesign | TurnsDesign
    target = output.folder(named, "schedule", ("schedule.toml", "report.html"))
    if turning:
        from gimbalcal.design.turning_design import design_turning, table_of
        from gimbalcal.schedule.file import rotation_toml

        _refuse_other_criteria(criterion, ("max", "sum"), kind)
        output.progress(f"looking at {number_of(tries, 'sequence')} of turns")
        turns = design_turning(
            table_of(step, limit, rate, ramp, total), latitude, states, against, criterion or "max",
            (rate_noise, force_noise, velocity_sigma), tries, seed, output.progress,
        )  # fmt: skip
        plan, text, table = turns, rotation_toml(turns.schedule), groups_table(turns)
    else:
        from gimbalcal.design.optimal import design as run
        from gimbalcal.design.rig_positions import rig_of
        from gimbalcal.schedule.file import schedule_toml

        _refuse_other_criteria(criterion, ("D", "A", "position"), kind)
        rig = rig_of(platform, step, angle_sigma, force_sigma)
        if learn:
            from gimbalcal.design.learning import design_learning

            if separate or criterion:
                raise InputError("--learn is a goal of its own: leave out --separate and --criterion")
            chosen = design_learning(rig, positions, learn, terms)
        else:
            chosen = run(rig, positions, terms, criterion or "D", separate, latitude=latitude)
        environment = chosen.law.toml if chosen.law else ""
        plan, text, table = chosen, schedule_toml(chosen.schedule) + environment, bounds_table(chosen)
    if target is not None:
        with output.staged(target.folder) as new:
            write(new / "schedule.toml", text)
            write(new / "report.html", page_with_question(design_report(plan), target.question))
        output.wrote(target.folder, "schedule.toml")
    output.table(table)
    output.show(plan.to_dict(), design_headline(plan), target)


def _refuse_other_criteria(criterion: str | None, known: tuple[str, ...], kind: str) -> None:
    if criterion is not None and criterion not in known:
        raise InputError(f"--criterion {criterion} is not for --kind {kind}; write {' or '.join(known)}")


@click.command(
    "next",
    epilog=example(
        "gimbalcal next data/space_stable_18",
        "gimbalcal next data/space_stable_18 --separate cubic_nonlinearity,odd_quadratic --step 15",
        "gimbalcal next data/xsens_positions",
    ),
)
@RECORDINGS
@names_option("--with", "Effects of the catalogue to estimate besides.", "more")
@names_option("--separate", "Effects, EFFECT[:AXIS], that are to be separated from each other.")
@click.option(
    "--reach", default="", metavar="SCHEDULE", shell_complete=completing(_schedules),
    help="A schedule whose sigmas are to be reached: its name or a schedule.toml.",
)  # fmt: skip
@click.option("--step", default=45.0, type=POSITIVE, show_default=True, help="Angles of an axis: multiples, deg.")
@click.option("--most", type=click.IntRange(1, 100), default=5, show_default=True, help="How many steps to name.")
@click.option("--states", default="", metavar="30|51|EFFECT[:AXIS],...", help="Of turns: what is estimated [51].")
@GRADE
@output_options("next.json and report.html", "NAME-next, here")
def next_(
    recordings: tuple[Path, ...], more: tuple[str, ...], separate: tuple[str, ...], reach: str, step: float, most: int,
    states: str, grade: str, output: Output,
) -> None:  # fmt: skip
    """State what to record next: the position, turn, duration or temperature that shrinks the largest unknown most.

    RECORDINGS: the dwells so far, one or more, and static runs of the same rig; or rotation recordings of a unit that
    is turned in its place. The command can be given after every dwell.
    """
    from gimbalcal.api import next_step
    from gimbalcal.report.plan_page import next_report

    target = output.folder(recordings, "next", ("next.json", "report.html"))
    plan = next_step(recordings, more, separate, reach, step, most, grade, output.progress, states)
    title = recordings[-1].resolve().name
    output.deliver(target, "next.json", plan.to_dict(), partial(next_report, plan, title), str(plan))


@click.command(
    epilog=example(
        "gimbalcal budget wu2018-18 wu2018-static --hours 24 --out budget",
        "gimbalcal budget wei2022-30 wei2022-static --states 30 --hours 24 --out budget",
    )
)
@click.argument("scenarios", nargs=-1, required=True, type=FilePath(), shell_complete=completing(_scenarios))
@click.option(
    "--hours", multiple=True, type=Number(min=0.5, max=240), default=(6.0, 24.0, 72.0), show_default=True,
    help="Hours within which the position error is given; as often as needed.",
)  # fmt: skip
@click.option("--with", "more", multiple=True, metavar="EFFECT", help="An effect that the calibration holds too.")
@click.option("--states", default="", help="Of turns: what is calibrated, 30, 51, or EFFECT[:AXIS],... [51].")
@DAMPING
@output_options("budget.json and report.html", "NAME-budget, here")
def budget(
    scenarios: tuple[Path, ...], hours: tuple[float, ...], more: tuple[str, ...], states: str, damping: float | None,
    output: Output,
) -> None:  # fmt: skip
    """Predict the position error that a calibration by SCENARIOS leaves, parameter by parameter.

    SCENARIOS: positions and static runs of a space-stable platform; or turns of a strapdown unit in its place, and a
    rest, which says where and how it stands when it navigates.
    """
    from gimbalcal.design.budget import budget as run
    from gimbalcal.report.navigation_page import budget_report
    from gimbalcal.words.naming import as_sentences

    target = output.folder(scenarios, "budget", ("budget.json", "report.html"))
    result = run(scenarios, hours, more, damping, states)
    page, sentence = partial(budget_report, result), as_sentences(result.in_words)
    output.deliver(target, "budget.json", result.to_list(), page, sentence)


@click.command(epilog=example("gimbalcal simulate wu2018-18 --seed 7 --out my-rig"))
@click.argument("scenario", type=FilePath(), shell_complete=completing(_scenarios))
@click.option("--seed", type=SEED, default=None, help="Instead of the scenario's own.")
@output_options("the recording and its truth.json", "the name of SCENARIO, here")
def simulate(scenario: Path, seed: int | None, output: Output) -> None:
    """Simulate a recording with known truth by SCENARIO: a file, or the name of one that ships."""
    from gimbalcal.simulate import simulate_to

    folder = output.out or Path(scenario.stem)
    with output.staged(folder) as new:
        truth = simulate_to(scenario, new, seed, output.progress)
    output.show(truth, f"wrote a recording and its truth into {folder}")


@click.command(epilog=example("gimbalcal campaign wu2018-18 -n 100 --out campaign"))
@click.argument("scenario", type=FilePath(), shell_complete=completing(_scenarios))
@click.option("-n", "--runs", type=RUNS, default=200, show_default=True, help="How many runs.")
@WORKERS
@SCHEDULER
@click.option("--method", default="three-stage", show_default=True, help="How each simulated recording is calibrated.")
@click.option("--seed", type=SEED, default=None, help="Instead of the scenario's own.")
@output_options("campaign.json, campaign.parquet and report.html", "SCENARIO-campaign, here")
def campaign(
    scenario: Path, runs: int, workers: int | None, scheduler: str, method: str, seed: int | None, output: Output
) -> None:
    """Repeat the simulation and the calibration of SCENARIO many times (Monte Carlo).

    The digits do not depend on the number of workers; an interrupted campaign continues where it stopped.
    """
    from gimbalcal.campaign import run_campaign
    from gimbalcal.report.campaign_page import campaign_report
    from gimbalcal.report.html import page_with_question
    from gimbalcal.words.answers import campaign_answer

    files = ("campaign.json", "campaign.parquet", "report.html")
    kept = replace(output, as_json=False)  # runs are kept on the way, also with --json
    target = kept.folder([scenario], "campaign", files)
    if target is None:
        raise InputError("the current folder cannot be written, where the runs of a campaign are kept; give --out")
    try:
        summary = run_campaign(
            scenario, runs, target.folder, workers, scheduler, output.progress, method, seed,
            lambda result: page_with_question(campaign_report(result), target.question), output.overwrite,
        )  # fmt: skip
    except KeyboardInterrupt:
        output.progress(f"finished runs are kept in {target.folder}; the same command continues from there")
        raise
    output.wrote(target.folder, "campaign.json")
    output.show(summary.to_dict(), campaign_answer(summary), target)
