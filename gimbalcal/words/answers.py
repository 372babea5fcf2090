"""The answers of plans, campaigns, noise at rest and navigations: a few sentences from the result of each."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, sqrt
from typing import TYPE_CHECKING

from gimbalcal.earth import HOUR
from gimbalcal.errors import number_of
from gimbalcal.words.calibration_sentences import MAX_RELATIVE_EXCESS, MIN_P_VALUE
from gimbalcal.words.naming import (
    as_sentence,
    as_sentences,
    capitalised,
    label_in_words,
    least_precise_sentence,
    list_in_words,
    number_and_noun,
    sentence,
    typeset,
    unit_in_print,
    unobservable_leading,
    without_underscores,
)
from gimbalcal.words.rounding import duration_in_words, significant

if TYPE_CHECKING:
    from gimbalcal.at_rest import RestNoise
    from gimbalcal.campaign.campaign_folder import CampaignSummary, ParameterErrors
    from gimbalcal.design.next_step import NextPlan, NextStep
    from gimbalcal.design.optimal import PositionsDesign
    from gimbalcal.design.position_observability import Observability, PredictedSigma
    from gimbalcal.design.turning_design import TurnsDesign
    from gimbalcal.design.turning_observability import TurningObservability
    from gimbalcal.inference.information import Unobservable
    from gimbalcal.navigate.summary import NavigationSummary

MAX_STATES = 4  # that a headline names
MAX_NAMED = 3  # parameters that a headline names
RECORD_IT = "Next: turn the rig through schedule.toml while it logs."


# --- plans ------------------------------------------------------------------------------------------------------------


def plan_answer(o: Observability) -> str:
    """Return which parameters positions or a static run determine, how well, and what to do next."""
    unseen = o.unobservable
    text = as_sentence(f"{o.schedule} determines {_determined_count(len(o.rows), len(unseen))} of the parameters")
    text += _precision_sentence(o.rows, unseen)
    if unseen:
        text += (
            f" {capitalised(number_and_noun(len(unseen), 'combination'))} cannot be observed, and a longer recording "
            "does not help; another attitude or another instrument does."
        )
    return text


def _precision_sentence(rows: Sequence[PredictedSigma], unobservable: Sequence[Unobservable]) -> str:
    undetermined = unobservable_leading(unobservable)
    determined = [r for r in rows if r.parameter.label not in undetermined]
    return least_precise_sentence((r.parameter.name, r.sigma, r.parameter.unit) for r in determined)


def _determined_count(total: int, unobservable: int) -> str:
    return (
        f"{total - unobservable} of {total} combinations"
        if unobservable
        else f"all {number_and_noun(total, 'combination')}"
    )


def positions_answer(d: PositionsDesign) -> str:
    """Return which parameters designed positions determine, how well, compared with which, and what to do next."""
    share = _determined_count(len(d.parameters), len(d.unobservable))
    text = sentence(f"{d.origin}, determine {share} of the parameters")
    text += _precision_sentence(d.rows, d.unobservable)
    text += f" {sentence(d.position_error)}" if d.position_error else ""
    text += f" {sentence(d.law.in_words)}" if d.law else ""
    what, which = ("that error", "") if d.position_error else ("σ", ", on average")
    ratios = {n: a.criterion_ratio if d.position_error else a.sigma_ratio for n, a in d.against.items()}
    compared = [
        as_sentences(f"In the time that {n} takes, {what} is {x:.2f} times that of {n}{which}")
        for n, x in ratios.items()
    ]
    return " ".join([text, *compared, RECORD_IT])


def turns_answer(d: TurnsDesign) -> str:
    """Return how well designed turns determine the unit, compared with which, and what to do next."""
    turns = capitalised(number_and_noun(len(d.schedule.moves), "turn"))
    text = f"{turns} with stops of {d.schedule.stop:.3g} s take {duration_in_words(d.duration)}."
    text += least_precise_sentence((g.group, g.sigma, g.unit) for g in d.groups)
    compared = [as_sentences(d.comparison)] if d.comparison else []
    return " ".join([text, *compared, RECORD_IT])


def turning_answer(o: TurningObservability) -> str:
    """Return which errors a schedule of turns determines, how well, and what to do next."""
    total, unobservable = len(o.curves), o.bounds.unobservable
    undetermined, unseen = unobservable_leading(unobservable), len(unobservable)
    determined = [c for c in o.curves if c.parameter not in undetermined]
    low = [label_in_words(c.parameter) for c in determined if c.word != "high"]
    share = f"{total - unseen} of {total} combinations" if unseen else f"all {number_and_noun(total, 'error')}"
    text = f"{o.bounds.schedule} determines {share} of the unit in {duration_in_words(float(o.time[-1]))}."
    text += least_precise_sentence((c.parameter.partition(":")[0], float(c.printed[-1]), c.unit) for c in determined)
    if unseen:
        text += (
            f" {capitalised(number_and_noun(unseen, 'combination'))} cannot be observed: turn about another axis, too."
        )
    if low:
        text += f" Hardly better known than before: {list_in_words(low, MAX_STATES)}."
    return text if unseen or low else f"{text} Next: record it, then `gimbalcal calibrate` the recording."


def next_answer(plan: NextPlan) -> str:
    """Return what to record next, what it gains in which time, and how far away the goal is."""
    goal = _distance_to_goal(plan)
    if plan.reached or not plan.steps:
        return goal if plan.reached else f"{goal} No position, duration or temperature of this rig changes that."
    best = plan.steps[0]
    unit = unit_in_print(best.unit)
    text = (
        f"Next: {best.words}{_with_turn(best)}. It reduces σ of {without_underscores(best.parameter)} from "
        f"{significant(best.sigma_now, 3)} to {significant(best.sigma_after, 3)} {unit}; of all parameters together no "
        "other step gains more in its time."
    )
    return f"{text} {goal}".strip()


def _with_turn(step: NextStep) -> str:
    """Return how long a step takes with its turn; empty of a static run that goes on, whose words say how long."""
    return f", {duration_in_words(step.seconds)} with the turn" if step.angles or step.towards else ""


def _distance_to_goal(plan: NextPlan) -> str:
    """Return how far it is to what is to be reached or separated; empty without a goal."""
    if plan.target is not None:
        short = [f"{p.name} {p.axis}".strip() for p in plan.not_reached]
        if not short:
            return f"All {number_and_noun(len(plan.parameters), 'parameter')} reach the σ that was asked for."
        named = list_in_words([without_underscores(name) for name in short], MAX_NAMED)
        verb = "has" if len(short) == 1 else "have"
        total = number_of(len(plan.parameters), "parameter")
        return f"{len(short)} of {total} {verb} not reached the σ that was asked for: {named}."
    if plan.separation is None:
        return ""
    verb = "separate" if len(plan.separate) > 1 else "show"
    named = list_in_words([without_underscores(name.replace(":", " ")) for name in plan.separate])
    size = f"ln Bayes factor {significant(plan.separation, 2)} expected at usual size"
    if plan.reached:
        return f"These recordings {verb} {named} ({size}): `gimbalcal diagnose` them."
    return f"So far they do not {verb} {named} ({size}; 3 is a factor of 20)."


# --- campaigns --------------------------------------------------------------------------------------------------------


def campaign_answer(c: CampaignSummary) -> str:
    """Return whether errors and sigmas agree, which parameters have an offset, and what to do next."""
    rows = with_estimate(c)
    runs = number_of(c.runs, "run")
    if not rows:
        return f"{runs} without an estimate: {_reasons_in_words(c)}. Next: check the scenario."
    low, high = ratio_interval_by_chance(min(r.runs for r in rows), len(rows))
    ratios = [r.ratio for r in rows]
    large, off = larger_errors(rows), with_offset(rows)
    size = f"{min(ratios):.2f} to {max(ratios):.2f} times their σ over {number_of(len(rows), 'parameter')}"
    text = f"In {runs} errors are {size}; chance alone gives {low:.2f} to {high:.2f}."
    if large:
        errors, exceed = ("errors", "exceed their") if len(large) > 1 else ("error", "exceeds its")
        text += f" The {errors} of {_names_of_rows(large)} {exceed} σ."
    if off:
        text += f" The mean error of {_names_of_rows(off)} is not zero."
    if c.failed:
        text += f" {number_of(c.failed, 'run')} ended with a reservation: {_reasons_in_words(c)}."
    if large or off:
        return f"{text} Next: `gimbalcal diagnose` a simulated recording of this scenario."
    small = min(r.runs for r in rows) < 50
    return f"{text} The σ are honest" + (" as far as so few runs show. Next: more of them, -n 200." if small else ".")


def ratio_interval_by_chance(runs: int, parameters: int) -> tuple[float, float]:
    """Return the interval of the ratio of RMS error to sigma by chance, over all parameters jointly.

    n ratio^2 is chi^2 with n degrees of freedom.

    >>> tuple(round(x, 2) for x in ratio_interval_by_chance(200, 18))
    (0.8, 1.21)
    """
    from scipy.special import chdtri

    tail = MIN_P_VALUE / parameters / 2
    return sqrt(float(chdtri(runs, 1 - tail)) / runs), sqrt(float(chdtri(runs, tail)) / runs)


def with_estimate(c: CampaignSummary) -> list[ParameterErrors]:
    return [r for r in c.parameters if isfinite(r.ratio)]


def larger_errors(rows: Sequence[ParameterErrors]) -> list[ParameterErrors]:
    """Return parameters whose errors exceed their sigmas significantly and by a relevant amount, worst first."""
    over = [r for r in rows if r.ratio > max(ratio_interval_by_chance(r.runs, len(rows))[1], 1 + MAX_RELATIVE_EXCESS)]
    return sorted(over, key=lambda r: -r.ratio)


def with_offset(rows: Sequence[ParameterErrors]) -> list[ParameterErrors]:
    """Return parameters whose mean error is significant."""
    return [r for r in rows if abs(offset_sigmas(r)) > _max_mean_sigmas(len(rows))]


def offset_sigmas(r: ParameterErrors) -> float:
    """Return the mean error in its own sigmas."""
    return r.mean / r.sigma * sqrt(r.runs)


def _max_mean_sigmas(parameters: int) -> float:
    """Return the sigmas that a mean exceeds by chance in none of so many parameters."""
    from scipy.special import ndtri

    return float(-ndtri(MIN_P_VALUE / parameters / 2))


def _names_of_rows(rows: Sequence[ParameterErrors]) -> str:
    return list_in_words([label_in_words(r.parameter) for r in rows], MAX_NAMED)


def _reasons_in_words(c: CampaignSummary) -> str:
    worst = next(iter(c.outcomes), "")
    return typeset(worst.rstrip(".")) or "no reason is stated"


# --- noise and navigation ---------------------------------------------------------------------------------------------


def noise_answer(noise: RestNoise) -> str:
    """Return how large the noise is, and what to do next."""
    sentences = [as_sentence(part) for part in noise.in_words.split("; ")]
    short = noise.longest_s < HOUR and "below" in noise.in_words
    steps = ["copy the lines of [noise] below into recording.toml"] if noise.header else []
    steps += ["record it undisturbed for some hours to determine what is only bounded here"] if short else []
    return " ".join([*sentences, *([f"Next: {', or '.join(steps)}."] if steps else [])])


def navigation_answer(s: NavigationSummary) -> str:
    """Return the largest error of position without and with each calibration."""
    text = as_sentences(s.in_words)
    if not s.increased:
        return text
    return f"{text} A calibration increases it: does it belong to this unit and to this time? See `gimbalcal compare`."
