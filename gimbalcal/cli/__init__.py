"""The command line: one command a question, each a few lines around a function of the package.

Exit status: 0 done; 1 done, and the model does not explain the data; 2 bad input, nothing written; 3 a defect of this
program; 130 interrupted.
Heavy packages are imported inside the commands, so that `gimbalcal --help` answers at once.
"""

from __future__ import annotations

import gc
import sys
import traceback
from pathlib import Path

import click

from gimbalcal import __version__
from gimbalcal.atomic import FULL
from gimbalcal.cli.catalogue import catalogue
from gimbalcal.cli.files import apply, export, import_
from gimbalcal.cli.history import compare, remember, stored
from gimbalcal.cli.navigation import budget, navigate
from gimbalcal.cli.new import new
from gimbalcal.cli.noise import noise
from gimbalcal.cli.options import (
    EFFECTS,
    GRADE,
    RECORDINGS,
    RUNS,
    SEED,
    example,
    names_option,
    output_options,
    progress,
    show,
    wrote,
)
from gimbalcal.cli.output_folders import OVERWRITE, place, placed, places
from gimbalcal.cli.planning import design, observe
from gimbalcal.errors import InputError

RARELY = 50_000  # objects between looks for unreachable ones: what is imported stays, and is a tenth of a short command
CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 110}


def main() -> None:
    """Run the command line; every refusal is one sentence on stderr and exit status 2."""
    gc.set_threshold(RARELY)
    try:
        gimbalcal(standalone_mode=False)
    except InputError as problem:
        _stop(f"gimbalcal: {problem}", 2)
    except click.exceptions.NoArgsIsHelpError as problem:
        problem.show()
        sys.exit(2)
    except click.ClickException as problem:
        context = getattr(problem, "ctx", None)
        command = context.command_path if context else "gimbalcal"
        _stop(f"gimbalcal: {problem.format_message().rstrip('.')}; see `{command} --help`", 2)
    except (KeyboardInterrupt, click.Abort):
        _stop("gimbalcal: interrupted; nothing half-written is left behind", 130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    except OSError as problem:
        name, why = problem.filename or "a file", problem.strerror or problem
        remedy = "make room on the disk" if problem.errno in FULL else "correct its name or its permissions"
        _stop(f"gimbalcal: {name} cannot be read or written ({why}); {remedy}", 2)
    except MemoryError:
        _stop("gimbalcal: there is not enough memory for this input; give it in parts, or as means", 2)
    except SystemExit:
        raise
    except BaseException:  # noqa: BLE001  a panic of an engine is no Exception;  status 1 is a verdict, which a defect must not look like
        traceback.print_exc()
        _stop("gimbalcal: this is a defect of the program, not of your data; please report it with the lines above", 3)


def _stop(sentence: str, status: int) -> None:
    print(sentence, file=sys.stderr)
    sys.exit(status)


@click.group(context_settings=CONTEXT, epilog=example("gimbalcal demo", "gimbalcal calibrate --help"))
@click.version_option(__version__, prog_name="gimbalcal")
def gimbalcal() -> None:
    """Calibrate inertial sensors on gimballed platforms, and say what physics the model left out."""


gimbalcal.add_command(apply)
gimbalcal.add_command(catalogue)
gimbalcal.add_command(compare)
gimbalcal.add_command(design)
gimbalcal.add_command(export)
gimbalcal.add_command(import_)
gimbalcal.add_command(navigate)
gimbalcal.add_command(new)
gimbalcal.add_command(noise)
gimbalcal.add_command(budget)
gimbalcal.add_command(observe)


@gimbalcal.command(
    epilog=example(
        "gimbalcal calibrate data/space_stable_18 data/space_stable_static --out results",
        "gimbalcal calibrate data/xsens_positions --method multiposition",
        "gimbalcal calibrate data/space_stable_concealed --with bias_temperature:y",
    )
)
@RECORDINGS
@click.option(
    "--method",
    type=click.Choice(["three-stage", "multiposition", "systematic", "attitude", "rate-table", "two-position"]),
    default=None,
    help="Left out, the kind of recording says it. three-stage: space-stable platform, angles recorded; "
    "multiposition: no angles needed, gyroscopes too; "
    "systematic: both triads of a unit that is turned in its place, by navigation, no angle trusted; "
    "attitude: moving gyroscopes against an attitude that was logged beside them; "
    "rate-table: gyroscopes against the angles of a table at steady rates, one recording for each mounting; "
    "two-position: gyroscopes that stand still and are reversed, bias against the Earth's rate.",
)
@names_option("--terms", "multiposition, and mounts: terms to estimate (see the report).")
@click.option(
    "--with",
    "more",
    multiple=True,
    metavar="EFFECT[:AXIS][,CONSTANT=VALUE]",
    help="Add an effect of the catalogue to the fit; a constant that is not stated is fitted.",
)
@click.option(
    "--states", default="51", show_default=True, metavar="30|51|EFFECT[:AXIS],...",
    help="systematic: the parameters to estimate beside the nine navigation errors, as a list or by their number.",
)  # fmt: skip
@GRADE
@stored
@OVERWRITE
@output_options("calibration.json and report.html", "NAME-calibration, here")
def calibrate(
    recordings: tuple[Path, ...], method: str | None, terms: tuple[str, ...], more: tuple[str, ...], states: str,
    grade: str, store: Path | None, unit: str, overwrite: bool,
    out: Path | None, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Estimate the sensors' errors, with their uncertainty, and say what the data do not show."""
    from gimbalcal.methods import calibrate_each
    from gimbalcal.report.console import parameters_table
    from gimbalcal.report.files import write_calibrations
    from gimbalcal.report.words import calibration_in_words

    tell = progress(quiet)
    there = place(out, recordings, "calibration", ("calibration.json", "report.html"), overwrite, as_json)
    each = calibrate_each(recordings, method or "", terms, tell, more, states, grade)
    if there is not None:
        own = places([loaded for _, loaded in each])
        write_calibrations([(*one, at) for one, at in zip(each, own, strict=True)], there.folder, there.question)
        for at in own:
            wrote(there.folder / at, "calibration.json", quiet)
    for calibration, _ in each:
        remember(store, unit, "calibration", calibration.to_dict())
    content = each[0][0].to_dict()
    if len(each) > 1:
        content["beside"] = {loaded[0].sensor: c.to_dict() for c, loaded in each[1:]}
    sentences = [(f"{r[0].title}: " if len(each) > 1 else "") + calibration_in_words(c.to_dict()) for c, r in each]
    checks = each[0][0].provenance["options"].get("cross_check", ())
    if not (as_json or quiet):
        print("\n\n".join(f"{r[0].title}\n{parameters_table(c.to_dict())}" for c, r in each), end="\n\n")
    told = " ".join([*sentences, *(f"{words[0].upper()}{words[1:]}." for words in checks)])
    show(content, told, as_json, quiet, there.page if there else None)
    sys.exit(1 if any(c.outcome for c, _ in each) else 0)


@gimbalcal.command(epilog=example("gimbalcal diagnose data/space_stable_concealed --out diagnosis"))
@RECORDINGS
@click.option("--calibration", "known", type=click.Path(path_type=Path), help="A calibration.json to start from.")
@names_option("--baseline", "Effects the model holds; what is left out can be found.")
@GRADE
@click.option("--seed", type=SEED, default=1, show_default=True, help="Seed of the simulated threshold.")
@stored
@OVERWRITE
@output_options("diagnosis.json, calibration.json and report.html", "NAME-diagnosis, here")
def diagnose(
    recordings: tuple[Path, ...], known: Path | None, baseline: tuple[str, ...], grade: str, seed: int,
    store: Path | None, unit: str, overwrite: bool,
    out: Path | None, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Say where the data differ from the model, which physics was left out, and what it changes."""
    from gimbalcal.calibration.exchange import read_calibration
    from gimbalcal.diagnose import diagnose as run
    from gimbalcal.diagnose.cost import with_cost
    from gimbalcal.methods import by_sensor, held_together
    from gimbalcal.pipeline import load
    from gimbalcal.report.console import findings_table, headline_and_numbers
    from gimbalcal.report.files import write_diagnoses

    tell = progress(quiet)
    files = ("diagnosis.json", "calibration.json", "law.py", "report.html")
    there = place(out, recordings, "diagnosis", files, overwrite, as_json)
    start = read_calibration(known) if known else None
    groups = by_sensor(load(recordings, tell))
    told = [run(each, calibration=start, baseline=baseline, seed=seed, tell=tell, grade=grade) for each in groups]
    told = [with_cost(each, d, tell) for each, d in zip(groups, told, strict=True)]
    if there is not None:
        own = places(groups)
        titles = [" and ".join(dict.fromkeys(r.title for r in loaded)) for loaded in groups]
        write_diagnoses(list(zip(told, titles, own, strict=True)), there.folder, there.question)
        for at in own:
            wrote(there.folder / at, "diagnosis.json", quiet)
    for diagnosis in told:
        remember(store, unit, "diagnosis", diagnosis.to_dict())
        if diagnosis.calibration is not None:
            remember(store, unit, "calibration", diagnosis.calibration.to_dict())
    content, sentences, checks = told[0].to_dict(), [headline_and_numbers(told[0])], []
    if len(told) > 1:
        content["beside"] = {group[0].sensor: d.to_dict() for group, d in zip(groups[1:], told[1:], strict=True)}
        sentences = [f"{group[0].title}: {headline_and_numbers(d)}" for group, d in zip(groups, told, strict=True)]
        refits = [(d.calibration, group) for d, group in zip(told, groups, strict=True) if d.calibration]
        checks = held_together(refits, tell) if len(refits) == len(told) else []
        content["cross_check"] = [check.in_words for check in checks]
        sentences += [f"{check.in_words[0].upper()}{check.in_words[1:]}." for check in checks]
    if not (as_json or quiet) and any(d.findings for d in told):
        print("\n\n".join(findings_table(d.to_dict()) for d in told if d.findings), end="\n\n")
    show(content, "\n".join(sentences), as_json, quiet, there.page if there else None)
    explained = all(d.verdict == "adequate" and not d.outcome for d in told)
    sys.exit(0 if explained and all(c.agree for c in checks) else 1)


@gimbalcal.command(epilog=example("gimbalcal simulate wu2018-18 --seed 7 --out my-rig"))
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--seed", type=SEED, default=None, help="Instead of the scenario's own.")
@OVERWRITE
@output_options("the recording and its truth.json", "the name of SCENARIO, here")
def simulate(scenario: Path, seed: int | None, overwrite: bool, out: Path | None, quiet: bool, as_json: bool) -> None:
    """Make a recording from truth: SCENARIO.toml, or the name of one that ships with the package."""
    from gimbalcal.simulate import simulate_to

    folder = out or Path(scenario.stem)
    with placed(folder, overwrite) as new:
        truth = simulate_to(scenario, new, seed, progress(quiet))
    show(truth, f"wrote a recording and its truth into {folder}", as_json, quiet)


@gimbalcal.command(epilog=example("gimbalcal campaign wu2018-18 -n 100 --out campaign"))
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("-n", "--runs", type=RUNS, default=200, show_default=True, help="How many runs.")
@click.option("--workers", type=int, default=None, help="Processes on this machine (default: its cores).")
@click.option("--scheduler", default="", help="Address of a running Dask scheduler, tcp://host:port, instead.")
@click.option("--method", default="three-stage", show_default=True, help="How each simulated recording is calibrated.")
@click.option("--seed", type=SEED, default=None, help="Instead of the scenario's own.")
@OVERWRITE
@output_options("campaign.json, campaign.parquet and report.html", "SCENARIO-campaign, here")
def campaign(
    scenario: Path, runs: int, workers: int | None, scheduler: str, method: str, seed: int | None,
    overwrite: bool, out: Path | None, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Monte Carlo of SCENARIO: the same digits whatever the number of workers; goes on where it was stopped."""
    from gimbalcal.campaign import run_campaign
    from gimbalcal.report.campaign_page import campaign_report, headline
    from gimbalcal.report.html import marked

    files = ("campaign.json", "campaign.parquet", "report.html")
    there = place(out, [scenario], "campaign", files, overwrite, False)  # also with --json: runs are kept on the way
    if there is None:
        raise InputError("the current folder cannot be written, where the runs of a campaign are kept; give --out")
    tell = progress(quiet)
    try:
        summary = run_campaign(
            scenario, runs, there.folder, workers, scheduler, tell, method, seed,
            lambda made: marked(campaign_report(made), there.question), overwrite,
        )  # fmt: skip
    except KeyboardInterrupt:
        tell(f"the runs that are done stay in {there.folder}; the same command goes on from there")
        raise
    wrote(there.folder, "campaign.json", quiet)
    show(summary, headline(summary), as_json, quiet, there.page)


@gimbalcal.command(epilog=example("gimbalcal demo --out out/demo"))
@output_options("the reports", "out/demo")
def demo(out: Path | None, quiet: bool, as_json: bool) -> None:
    """The three stages and the diagnosis on the recordings that ship with the project."""
    from gimbalcal.cli.demonstration import demonstrate

    summary, sentence = demonstrate(out or Path("out/demo"), progress(quiet))
    show(summary, sentence, as_json, quiet)


for _command in gimbalcal.commands.values():
    _command.params.append(EFFECTS)


if __name__ == "__main__":
    main()
