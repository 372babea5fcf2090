"""Analyse recordings: calibrate, diagnose, noise, navigate, and compare the calibrations of a unit."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gimbalcal.cli.options import (
    DAMPING,
    DRAWS,
    GRADE,
    RECORDINGS,
    SCHEDULER,
    SEED,
    WORKERS,
    F,
    FilePath,
    Number,
    completing,
    effect_names,
    example,
    named_settings,
    names_option,
)
from gimbalcal.cli.output_folders import Output, output_options, sensor_folders
from gimbalcal.entries import Json
from gimbalcal.errors import InputError
from gimbalcal.method_table import METHODS, NAMED_BY_USERS

if TYPE_CHECKING:
    from gimbalcal.calibration import Calibration
    from gimbalcal.diagnose.answer import Diagnosis

UNIT_NAMES = ("folder", "parent", "title")


def _store(context: click.Context, _option: click.Parameter, store: Path | None) -> Path | None:
    """Return --store. Raises InputError before anything is computed where a result could not be kept in it."""
    if store is not None and context.info_name != "compare":
        from gimbalcal.history import refuse_unusable

        refuse_unusable(store)
    return store


STORE = click.option(
    "--store", type=FilePath(), callback=_store, default=None,
    help="Keep the result in this file too: a unit's history.",
)  # fmt: skip
UNIT = click.option("--unit", default="", help="Which unit it is, in a --store of several.")


def store_options(command: F) -> F:
    """Add the options --store and --unit."""
    return STORE(UNIT(command))


def keep_results(
    store: Path | None, unit: str, calibrations: Sequence[Calibration], diagnoses: Sequence[Diagnosis] = ()
) -> None:
    """Keep results in the store, if one is named; those of one sensor of several under the sensor's name."""
    if store is None:
        return
    from gimbalcal.history import StoredResult, date_in, keep

    results: list[tuple[str, Json]] = [("diagnosis", d.to_dict()) for d in diagnoses]
    entries = []
    for kind, content in (*results, *(("calibration", c.to_dict()) for c in calibrations)):
        origin = content.get("provenance", {})
        sensor = origin.get("options", {}).get("sensor", "")
        date = date_in(origin) or datetime.now(UTC).isoformat(timespec="seconds")
        entries.append(StoredResult(" ".join(filter(None, [unit, sensor])), date, kind, content))
    keep(store, *entries)


@click.command(
    epilog=example(
        "gimbalcal calibrate data/space_stable_18 data/space_stable_static --out results",
        "gimbalcal calibrate data/xsens_positions --method multiposition",
        "gimbalcal calibrate data/space_stable_concealed --with bias_temperature:y",
    )
)
@RECORDINGS
@click.option(
    "--method",
    type=click.Choice(NAMED_BY_USERS),
    default=None,
    help=f"Default: by the kind of recording. "
    f"{'; '.join(f'{name}: {METHODS[name].in_words}' for name in NAMED_BY_USERS)}.",
)
@names_option("--terms", "multiposition, and mounts: terms to estimate (see the report).")
@click.option(
    "--with",
    "more",
    multiple=True,
    metavar="EFFECT[:AXIS][,CONSTANT=VALUE]",
    shell_complete=completing(effect_names),
    help="Add an effect of the catalogue to the fit; a constant that is not stated is fitted.",
)
@names_option("--without", "Mounts: terms to omit, as --terms names them, or as TPOINT does (NPAE).")
@click.option(
    "--states", default="51", show_default=True, metavar="30|51|EFFECT[:AXIS],...",
    help="systematic: the parameters to estimate besides the nine navigation errors, as a list or by their number.",
)  # fmt: skip
@GRADE
@store_options
@output_options("calibration.json and report.html", "NAME-calibration, here")
def calibrate(
    recordings: tuple[Path, ...], method: str | None, terms: tuple[str, ...], more: tuple[str, ...],
    without: tuple[str, ...], states: str, grade: str, store: Path | None, unit: str, output: Output,
) -> None:  # fmt: skip
    """Estimate the errors of the sensors with their uncertainty, and state what the data do not show."""
    from gimbalcal.methods import calibrate_each
    from gimbalcal.report.console import parameters_table
    from gimbalcal.report.files import write_calibrations
    from gimbalcal.words.calibration_sentences import calibration_in_words
    from gimbalcal.words.naming import capitalised

    target = output.folder(recordings, "calibration", ("calibration.json", "report.html"))
    each = calibrate_each(recordings, method or "", terms, output.progress, more, states, grade, without)
    keep = partial(keep_results, store, unit, [calibration for calibration, _ in each])
    if target is None:
        keep()
    else:
        own = sensor_folders([loaded for _, loaded in each])
        write_calibrations(
            [(*one, at) for one, at in zip(each, own, strict=True)], target.folder, target.question, keep
        )
        for at in own:
            output.wrote(target.folder / at, "calibration.json")
    content = each[0][0].to_dict()
    if len(each) > 1:
        content["other_sensors"] = {loaded[0].sensor: c.to_dict() for c, loaded in each[1:]}
    sentences = [(f"{r[0].title}: " if len(each) > 1 else "") + calibration_in_words(c) for c, r in each]
    checks = each[0][0].provenance.options.cross_check or ()
    output.table("\n\n".join(f"{r[0].title}\n{parameters_table(c)}" for c, r in each))
    words = " ".join([*sentences, *(f"{capitalised(check)}." for check in checks)])
    output.show(content, words, target)
    sys.exit(0 if all(c.explained for c, _ in each) else 1)


@click.command(epilog=example("gimbalcal diagnose data/space_stable_concealed --out diagnosis"))
@RECORDINGS
@click.option("--calibration", "known", type=FilePath(), help="A calibration.json to start from.")
@names_option("--baseline", "Effects the model holds; what is left out can be found.")
@GRADE
@click.option("--seed", type=SEED, default=1, show_default=True, help="Seed of the simulated threshold.")
@store_options
@output_options("diagnosis.json, calibration.json and report.html", "NAME-diagnosis, here")
def diagnose(
    recordings: tuple[Path, ...], known: Path | None, baseline: tuple[str, ...], grade: str, seed: int,
    store: Path | None, unit: str, output: Output,
) -> None:  # fmt: skip
    """Find where the data differ from the model, which physics was omitted, and what it changes."""
    from gimbalcal.calibration.exchange import read_calibration
    from gimbalcal.diagnose import diagnose as run
    from gimbalcal.methods import by_sensor, cross_checks
    from gimbalcal.pipeline import load
    from gimbalcal.report.console import findings_table, headline_and_numbers
    from gimbalcal.report.files import write_diagnoses
    from gimbalcal.words.naming import capitalised

    files = ("diagnosis.json", "calibration.json", "law.py", "report.html")
    target = output.folder(recordings, "diagnosis", files)
    start = read_calibration(known) if known else None
    progress, groups = output.progress, by_sensor(load(recordings, output.progress))
    diagnoses = [
        run(each, calibration=start, baseline=baseline, seed=seed, progress=progress, grade=grade) for each in groups
    ]
    calibrations = [d.calibration for d in diagnoses if d.calibration is not None]
    keep = partial(keep_results, store, unit, calibrations, diagnoses)
    if target is None:
        keep()
    else:
        own = sensor_folders(groups)
        titles = [" and ".join(dict.fromkeys(r.title for r in loaded)) for loaded in groups]
        write_diagnoses(list(zip(diagnoses, titles, own, strict=True)), target.folder, target.question, keep)
        for at in own:
            output.wrote(target.folder / at, "diagnosis.json")
    content, sentences, checks = diagnoses[0].to_dict(), [headline_and_numbers(diagnoses[0])], []
    if len(diagnoses) > 1:
        others = zip(groups[1:], diagnoses[1:], strict=True)
        content["other_sensors"] = {group[0].sensor: d.to_dict() for group, d in others}
        sentences = [f"{group[0].title}: {headline_and_numbers(d)}" for group, d in zip(groups, diagnoses, strict=True)]
        refits = [(d.calibration, group) for d, group in zip(diagnoses, groups, strict=True) if d.calibration]
        checks = cross_checks(refits, progress) if len(refits) == len(diagnoses) else []
        content["cross_check"] = [check.in_words for check in checks]
        sentences += [f"{capitalised(check.in_words)}." for check in checks]
    if any(d.findings for d in diagnoses):
        output.table("\n\n".join(findings_table(d.findings) for d in diagnoses if d.findings))
    output.show(content, "\n".join(sentences), target)
    explained = all(d.verdict == "adequate" and not d.outcome for d in diagnoses)
    sys.exit(0 if explained and all(c.agree for c in checks) else 1)


@click.command(epilog=example("gimbalcal noise data/space_stable_static --out noise"))
@click.argument("recording", type=FilePath())
@output_options("noise.json and report.html", "RECORDING-noise, here")
def noise(recording: Path, output: Output) -> None:
    """Estimate white noise, bias instability and random walk of every sensor of RECORDING from its dwells."""
    from gimbalcal.at_rest import rest_noise
    from gimbalcal.recording import read
    from gimbalcal.report.noise_page import noise_report

    target = output.folder([recording], "noise", ("noise.json", "report.html"))
    output.progress(f"reading {recording.name}")
    r = read(recording)
    for remark in r.remarks:
        output.progress(f"note: {remark}")
    result = rest_noise(r)
    output.deliver(target, "noise.json", result.to_dict(), lambda: noise_report(result, r.title), str(result))


@click.command(
    epilog=example(
        "gimbalcal navigate data/space_stable_static --calibration results/calibration.json --out navigation"
    )
)
@click.argument("recording", nargs=-1, required=True, type=FilePath())
@click.option(
    "--calibration", "known", multiple=True, type=FilePath(), metavar="FILE [FILE ...]",
    help="calibration.json, as many as are to be compared, in order.",
)  # fmt: skip
@DAMPING
@click.option(
    "--alignment",
    type=Number(min=0.1, max=1440),
    default=10.0,
    show_default=True,
    help="Minutes at the beginning in which the attitude is found.",
)
@click.option("--samples", type=DRAWS, default=50, show_default=True, help="Draws behind the sampled bands.")
@click.option("--seed", type=SEED, default=1, show_default=True, help="Seed of the draws.")
@output_options("navigation.json and report.html", "NAME-navigation, here")
def navigate(
    recording: tuple[Path, ...], known: tuple[Path, ...], damping: float | None, alignment: float, samples: int,
    seed: int, output: Output,
) -> None:  # fmt: skip
    """Navigate RECORDING without a calibration and with each, and compare the errors of position and attitude.

    RECORDING: a static run of a space-stable platform, or a strapdown unit that stays in its place.
    """
    from gimbalcal.api import navigate as run
    from gimbalcal.report.navigation_page import navigation_report

    folder, files = _one_recording(recording, known)
    target = output.folder([folder], "navigation", ("navigation.json", "report.html"))
    result = run(folder, files, damping, alignment, samples, seed, output.progress)
    output.deliver(target, "navigation.json", result.to_dict(), partial(navigation_report, result), str(result))


def _one_recording(given: tuple[Path, ...], known: tuple[Path, ...]) -> tuple[Path, list[Path]]:
    """Return the recording among the arguments, and the calibrations in order, with the files that follow them."""
    files = [p for p in given if p.is_file()]
    folders = [p for p in given if not p.is_file()]
    if len(folders) != 1:
        named = ", ".join(map(str, folders)) or "none"
        raise InputError(f"navigate takes one recording folder, got {named}; calibrations come after --calibration")
    return folders[0], [*known, *files]


@click.command(
    epilog=example(
        "gimbalcal compare monday/calibration.json friday/calibration.json --out history",
        'gimbalcal compare --store unit7.sqlite --allow "bias:x=50 ug"',
    )
)
@click.argument("calibrations", nargs=-1, type=FilePath())
@store_options
@click.option(
    "--allow", multiple=True, metavar="NAME='VALUE UNIT'", help="How far a parameter may move until the next."
)
@output_options("compare.json, report.html, and all values as history.csv and history.parquet", "NAME-history, here")
def compare(
    calibrations: tuple[Path, ...], store: Path | None, unit: str, allow: tuple[str, ...], output: Output
) -> None:
    """Compare the parameters of a unit over time: CALIBRATIONS in files, those of a --store, or both."""
    from gimbalcal.history import compare as run
    from gimbalcal.history import dated_file, of_store
    from gimbalcal.report.files import write_comparison
    from gimbalcal.words.naming import as_sentences

    if store is None and not calibrations:
        raise InputError("`compare` takes calibration.json files, or a --store that holds some")
    files = ("compare.json", "history.csv", "history.parquet", "report.html")
    named = [unit] if unit else [store] if store is not None else [c.absolute().parent.name for c in calibrations]
    target = output.folder(named, "history", files)
    stored, diagnoses = of_store(store, unit) if store is not None else ((), ())
    comparison = run(
        [*stored, *(dated_file(c) for c in calibrations)], unit, named_settings("--allow NAME='VALUE UNIT'", allow)
    )
    if target is not None:
        write_comparison(comparison.printed, diagnoses, target.folder, target.question)
        output.wrote(target.folder, "compare.json")
    output.show(comparison.printed.to_dict(), as_sentences(comparison.in_words), target)
    sys.exit(0 if comparison.agree else 1)


@click.command(
    epilog=example(
        "gimbalcal batch 'rigs/*' --store units.sqlite --out fleet",
        "gimbalcal batch 'new/*' --store units.sqlite --grade fleet:units.sqlite --out new-units",
    )
)
@click.argument("patterns", nargs=-1, required=True, metavar="PATTERN...")
@click.option("--store", type=FilePath(), callback=_store, required=True,
              help="The results of all units are kept in this file; what it holds is not computed again.")  # fmt: skip
@click.option(
    "--unit-name", type=click.Choice(UNIT_NAMES), default="folder", show_default=True,
    help="What a unit is called after: the folder of its recording, the folder around that, or the title.",
)  # fmt: skip
@click.option("--method", type=click.Choice(NAMED_BY_USERS), default=None, help="As of calibrate, for all recordings.")
@click.option("--with", "more", multiple=True, metavar="EFFECT[:AXIS][,CONSTANT=VALUE]", help="As of calibrate.")
@GRADE
@click.option("--seed", type=SEED, default=1, show_default=True, help="Seed of the simulated thresholds.")
@WORKERS
@SCHEDULER
@output_options("fleet.json, fleet.parquet and report.html", "PATTERN-fleet, here")
def batch(
    patterns: tuple[str, ...], store: Path, unit_name: str, method: str | None, more: tuple[str, ...], grade: str,
    seed: int, workers: int | None, scheduler: str, output: Output,
) -> None:  # fmt: skip
    """Calibrate and diagnose the recordings of many units, and compare the units.

    PATTERN, such as 'rigs/*', matches the folders of the recordings. A recording that fails does not stop the others,
    and an interrupted batch continues where it stopped. The digits do not depend on the number of workers.
    """
    from gimbalcal.fleet import run_batch
    from gimbalcal.report.fleet_page import fleet_report
    from gimbalcal.report.html import page_with_question
    from gimbalcal.words.naming import as_sentences

    named = Path(patterns[0]).parent if "*" in patterns[0] else patterns[0]
    target = output.folder([named], "fleet", ("fleet.json", "fleet.parquet", "report.html"))
    question = target.question if target else ""
    try:
        summary = run_batch(
            patterns, store, target.folder if target else None, workers=workers, scheduler=scheduler,
            method=method or "", more=more, grade=grade, seed=seed, unit_name=unit_name, progress=output.progress,
            page=lambda result, known: page_with_question(fleet_report(result, known), question),
        )  # fmt: skip
    except KeyboardInterrupt:
        output.progress(f"finished recordings are kept in {store}; the same command continues from there")
        raise
    if target:
        output.wrote(target.folder, "fleet.json")
    output.show(summary.to_dict(), as_sentences(summary.in_words), target)
    sys.exit(0 if summary.ordinary else 1)
