"""Generate the sentences of a diagnosis, which stand under `in_words` in diagnosis.json, from its typed parts.

Misfits are given as reduced chi^2 where the noise is known, and in their own unit where it is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from gimbalcal.earth import NAUTICAL_MILE
from gimbalcal.number import Array
from gimbalcal.words.naming import capitalised, list_in_words, without_underscores

if TYPE_CHECKING:
    from gimbalcal.diagnose.result import DetectionLimit, Finding, FitSummary, Mismatch, RecordingFit, Shape, ViewFit
    from gimbalcal.diagnose.verdict.agreement import ConstantsAgreement
    from gimbalcal.diagnose.verdict.random_walk import RandomWalkFinding
    from gimbalcal.estimate.sharing import Agreement
    from gimbalcal.views.core import View

NO_CAUSE = "The model does not explain these data, and no cause of the catalogue does."
WORSE_HELD_OUT = "rows held out are predicted worse with what is named than without it"
SERIAL_CORRELATION = "a correlation between successive settings"
NOT_AS_READ = "not held where the readouts say"
REORDER_SETTINGS = (
    "visit the same angles again in another order: what depends on the angle comes again, a drift does not"
)
MAX_ALTERNATIVES = 3  # confounded causes up to which each of them may be named
GYROSCOPES_NOT_ANALYSED = "The gyroscopes were not analysed"
MAX_TIMES = 3  # of omitted frames that are named
MAX_EXCESS_SCATTER = 1.5  # of residuals over the standard error from their samples; more has a reason


# --- an effect --------------------------------------------------------------------------------------------------------


def cause_in_words(effect: str, axis: str, twins: Sequence[str] = ()) -> str:
    """Return an effect with its axis, and the effects confounded with it; of many none is preferred.

    >>> cause_in_words("bias_drift", "y", ("warm_up", "bias_step", "self_heating"))
    'one of 4 that fit equally well: bias drift (y), warm up, bias step, self heating'
    """
    every = [
        f"{without_underscores(effect)} ({without_underscores(axis)})" if axis else without_underscores(effect),
        *(without_underscores(t) for t in twins),
    ]
    if len(every) <= MAX_ALTERNATIVES:
        return " or ".join(every)
    return f"one of {len(every)} that fit equally well: {', '.join(every)}"


# --- a verdict --------------------------------------------------------------------------------------------------------


def answer(
    verdict: str, views: Sequence[tuple[View, FitSummary, Sequence[Finding]]], unexplained: Sequence[Shape],
    mismatch: Sequence[Mismatch],
) -> str:  # fmt: skip
    """Return the verdict in a few sentences; each view has its fit and its findings."""
    if verdict == "unexplained":
        return f"{no_cause(unexplained)}{largest_mismatch(mismatch)}"
    fits = [fit_in_words(v, fit, own, len(views) > 1) for v, fit, own in views if own or verdict == "adequate"]
    if verdict == "adequate":
        untested = any(fit.untested for _, fit, _ in views)
        verb = "is not contradicted by" if untested else "explains"
        return " ".join([f"The calibrated model {verb} these data.", *fits])
    findings = [f for _, _, own in views for f in own]
    scale_known, sure = all(v.noise.scale_known for v, _, _ in views), verdict != "not-identifiable"
    instead = scale_known or all(f.probability < 0.5 for f in findings)  # the shape is there in the place of causes
    rest = (
        f"{'Part of' if scale_known else 'The remaining'} misfit {'may have' if scale_known else 'has'} no known cause"
        if (unexplained and (sure or not instead))
        else ""
    )
    named = causes_sentence(verdict, findings, unexplained if instead else ())
    words = [f"{named}.", *fits, f"{rest}: {shape_in_words(unexplained[0])}." if rest else ""]
    return f"{' '.join(filter(None, words))}{largest_mismatch(mismatch)}"


def fit_in_words(v: View, fit: FitSummary, findings: Sequence[Finding], several: bool) -> str:
    """Return what the findings change in the fit of a view, or its residual; `several` views are named."""
    if v.noise.scale_known:
        of = "Reduced chi^2 of the forces" if several else "Reduced chi^2"
        return chi2_reduction(fit, of) if findings else f"{of} is {fit.chi2_reduced_before:.3g}."
    of_view = cast("ViewFit", fit)
    size = misfit_reduction(v, of_view) if findings else residual_sentence(v, of_view)
    return f"{size} But {untested}." if findings and (untested := untested_in_words(v, of_view)) else size


def reservation_sentence(verdict: str, findings: Sequence[Finding], unexplained: Sequence[Shape]) -> str:
    """Return why the calibration of a diagnosis should not be used without care; empty where it can be."""
    if verdict == "unexplained":
        return f"{no_cause(unexplained)} The calibration contains the model without it"
    if verdict != "not-identifiable":
        return ""
    effects = " and ".join(cause_in_words(f.effect, f.axis) for f in findings if f.effect not in DELAYS)
    corrects = f" The calibration includes {effects}, which fits these data as well as the others" if effects else ""
    return f"{causes_sentence(verdict, findings)}.{corrects}"


DELAYS = {  # the channel that is late where the value times the sign is positive
    "time_tag_latency": ("the force", -1.0),
    "gyro_latency": ("the rate", -1.0),
    "readout_latency": ("the gimbal angle", 1.0),
}


def delay_sentences(findings: Sequence[Finding]) -> str:
    """Return which channel is logged how much late or early, and what to do about it; empty for none."""
    parts = []
    for f in findings:
        for p in f.parameters if f.effect in DELAYS else ():
            channel, sense = DELAYS[f.effect]
            late = sense * p.value
            when = ("late", "early") if late > 0 else ("early", "late")
            other = "".join(f", or {DELAYS[t][0]} as much {when[1]}" for t in f.twins if t in DELAYS)
            parts.append(f"{channel} is logged {abs(late):.3g} +- {p.sigma:.2g} ms {when[0]}{other}")
    if not parts:
        return ""
    text = " and ".join(parts)
    return f"{capitalised(text)}: shift the time stamps; no calibration does that."


def motion_not_analysed(why: str) -> str:
    """Return that the motion between positions was not analysed, and why."""
    return f"The motion between positions was not analysed, so a delay between channels would not be detected: {why}."


def rate_not_analysed(why: str) -> str:
    """Return that errors of the gyroscopes in proportion to the rate were not analysed, and why."""
    return f"Errors of the gyroscopes that grow with the rate were not analysed: {why}."


def gyroscopes_not_analysed(why: str) -> str:
    """Return that the gyroscopes were not analysed, and why."""
    return f"{GYROSCOPES_NOT_ANALYSED}: {why}."


COUNTS_WITHOUT_SCALE = "they output counts, and no turn gives the size of a count"


def causes_sentence(verdict: str, findings: Sequence[Finding], unexplained: Sequence[Shape] = ()) -> str:
    """Return the missing effects; where they are not determined, with the shape that may be there instead."""
    effects = " and ".join(cause_in_words(f.effect, f.axis, f.twins) for f in findings)
    if verdict != "not-identifiable":
        return f"Missing physics: {effects}"
    other = f", or none that is known: {shape_in_words(unexplained[0])}" if unexplained else ""
    return f"These data do not determine which effect is missing{': ' * bool(effects)}{effects}{other}"


def no_cause(unexplained: Sequence[Shape]) -> str:
    """Return that no known effect explains the data, and the shape of the misfit."""
    return f"{NO_CAUSE} The misfit is {shape_in_words(unexplained[0])}." if unexplained else NO_CAUSE


def largest_mismatch(mismatch: Sequence[Mismatch]) -> str:
    """Return a further sentence on the largest mismatch."""
    return f" {mismatch[0].in_words}." if mismatch else ""


def shape_in_words(unexplained: Shape) -> str:
    """Return a shape without a cause, with its channel."""
    channel, shape = without_underscores(unexplained.channel), unexplained.shape
    return shape if channel.startswith("gimbal") and "gimbal" in shape else f"{shape} in {channel}"


# --- a fit in a known noise -------------------------------------------------------------------------------------------


def chi2_reduction(fit: FitSummary, of: str) -> str:
    """Return the change of reduced chi^2 by the findings, in one sentence."""
    return (
        f"{of} goes from {fit.chi2_reduced_before:.3g} to {fit.chi2_reduced_after:.3g}, "
        f"on held-out data from {fit.heldout_before:.3g} to {fit.heldout_after:.3g}."
    )


def off_over_scan(channel: str, axis: str, where: str, p_value: float) -> str:
    """Return that a channel differs from the baseline somewhere, with the p-value of the whole scan."""
    p = "p < 1e-6" if p_value < 1e-6 else f"p = {p_value:.1g}"
    return f"{without_underscores(channel).capitalize()} {axis} is off {where} ({p} over the whole scan)"


# --- several recordings -----------------------------------------------------------------------------------------------

CONTRADICTED = "What one recording shows by itself is contradicted by the others."


def in_recording(number: int, in_words: str) -> str:
    """Return what is said of one of several recordings."""
    return f"In recording {number}, {in_words[0].lower()}{in_words[1:]}"


def separate_verdict(
    verdict: str, causes: Sequence[tuple[str, str, Sequence[str]]], walk: RandomWalkFinding | None
) -> str:
    """Return the verdict on one of several recordings by itself: effect, axis and twins of each cause, or a walk."""
    if verdict == "adequate":
        return "nothing is missing" if walk is None else walk_in_words(walk)
    if not causes:
        return "something is missing that no cause of the catalogue explains"
    return " and ".join(cause_in_words(*cause) for cause in causes)


def separate_verdicts(rows: Sequence[RecordingFit]) -> str:
    """Return a sentence on the verdicts on all recordings by themselves."""
    each = "; ".join(f"recording {row.recording}: {row.alone.in_words}" for row in rows)
    return f"With this model each alone would have said: {each}."


def position_outliers_in_words(each: Sequence[Sequence[str]]) -> str:
    """Return sentences on positions of recordings that were not held where the readouts say; empty for none."""
    sentences = [
        f"{capitalised(words.rstrip('.'))} in recording {k + 1}." for k, own in enumerate(each) for words in own
    ]
    return " ".join([*sentences, "`gimbalcal calibrate` leaves such positions out."]) if sentences else ""


# --- a view without a known noise -------------------------------------------------------------------------------------


def three_digits(x: float) -> str:
    """Return a positive number with three digits, without a power of ten while it is readable.

    >>> three_digits(1921.3), three_digits(0.9317)
    ('1921', '0.932')
    """
    return f"{x:.0f}" if 1e3 <= x < 1e5 else f"{x:.3g}"


def channel_of(v: View, axis: str) -> str:
    """Return one channel of a view in words."""
    return v.measurement.channel.format(axis=axis)


def pattern_sentence(v: View, axis: str, size: float, pattern: str) -> str:
    """Return that a channel has a pattern."""
    return f"The misfit of {channel_of(v, axis)} ({three_digits(size)} {v.unit} rms) follows {pattern}"


def follows_sensor(v: View, quantity: str, axis: str, size: float, pattern: str) -> str:
    """Return that the output of a navigator has a pattern that a sensor explains."""
    misfit = f"The misfit of {v.measurement.channels} ({three_digits(size)} {v.unit} rms)"
    return f"{misfit} follows {pattern} in {without_underscores(quantity)} {axis}"


def largest_misfit_sentence(v: View, axis: str, size: float, ratio: float, rows: Array) -> str:
    """Return how large a misfit without a pattern is, and where it is largest."""
    if v.label is None:
        time = v.time[np.sort(rows)]
        where = f"{', '.join(f'{t:.0f}' for t in time[:-1])} and {time[-1]:.0f} s after the start"
    else:
        *most, last = (str(int(k)) for k in v.label[rows])
        where = f"at {v.measurement.rows} {' and '.join([*filter(None, [', '.join(most)]), last])}"
    return (
        f"The misfit of {channel_of(v, axis)} is {three_digits(size)} {v.unit} rms, {ratio:.3g} times the final "
        f"residual, and largest {where}"
    )


def misfit_reduction(v: View, fit: ViewFit) -> str:
    """Return the change of a view's misfit by its findings, in its unit."""
    rows = v.measurement.rows
    out = (
        f"The misfit of {v.measurement.channels} goes from {three_digits(fit.rms_before)} to "
        f"{three_digits(fit.rms_after)} "
        f"{v.unit} rms, and for held-out {rows} from {three_digits(fit.heldout_rms_before)} to "
        f"{three_digits(fit.heldout_rms_after)} {v.unit}."
    )
    if t := fit.turns:
        out += (
            f" Gravity that is propagated through the turns between the positions is off by {t.rms_after:.0f} {t.unit} "
            f"rms instead of {t.rms_before:.0f}."
        )
    return out


FORCES_NOT_ANALYSED = (
    "The accelerometers were not analysed: gravity has one direction in the unit, which does not calibrate them."
)


def omitted_stars(numbers: Sequence[int], sizes: Sequence[float], unit: str, why: str) -> str:
    """Return that outlying stars were omitted, how far each is off, and why.

    >>> omitted_stars([80], [0.763], "arcsec", "mistaken or not centred")
    'Star 80 is 0.763 arcsec off, unlike the others: mistaken or not centred; it was omitted.'
    """
    stars = " and ".join(f"star {n} is {three_digits(size)} {unit} off" for n, size in zip(numbers, sizes, strict=True))
    which = "it was" if len(numbers) == 1 else "they were"
    return f"S{stars[1:]}, unlike the others: {why}; {which} omitted."


def omitted_frames(times: Array, size: float) -> str:
    """Return that outlying frames of a log were omitted, when the first were recorded, and how far off they are.

    >>> omitted_frames(np.array([12.3]), 58.8)
    'One frame (at 12.3 s) is off its neighbours by 58.8 arcsec, unlike the others; it was omitted.'
    """
    at = list_in_words([f"{t:.6g} s" for t in times[:MAX_TIMES]]) + (", ..." if len(times) > MAX_TIMES else "")
    if len(times) == 1:
        off = f"off its neighbours by {three_digits(size)} arcsec"
        return f"One frame (at {at}) is {off}, unlike the others; it was omitted."
    return (
        f"{len(times)} frames (at {at}) are off their neighbours by up to {three_digits(size)} arcsec, unlike the "
        "others; they were omitted."
    )


def untested_in_words(v: View, fit: ViewFit) -> str:
    """Return why rows do not test their model: held-out ones are off far more, or no effect would show; else empty."""
    if not fit.untested:
        return ""
    rows = v.measurement.rows
    if fit.unseen == ():
        return (
            f"no effect of the catalogue would show at its usual size in {rows} with residuals of "
            f"{three_digits(fit.rms_after)} {v.unit}, so these data do not test the model; find what scatters them"
        )
    return (
        f"held-out {rows} are off by {three_digits(fit.heldout_rms_after)} {v.unit}: parameters depend on one or two "
        f"of them, so these data do not test the model; record more {rows}"
    )


def serial_correlation(v: View, correlation: float, sigma: float) -> str:
    """Return that residuals of successive settings are alike, though nothing is likelier than a noise with a memory."""
    return (
        f"successive residuals of {v.measurement.channels} are correlated by {correlation:.2f} +- {sigma:.2f}, which "
        "the noise of separate settings is not: something depends on the angle or on time, and no cause is likelier "
        "here than a noise with a memory"
    )


def residual_sentence(v: View, fit: ViewFit) -> str:
    """Return the residual of a view that its model explains, relative to the scatter of its samples if known."""
    if v.measurement.timing:
        bounds = {axis: abs(x.value) + 2 * x.sigma for axis, x in (fit.late or {}).items()}
        late = ", ".join(f"that of the {axis} is below {ms:.2g} ms" for axis, ms in bounds.items())
        return f"In {len(v)} slews no delay is significant: {late}."
    start = f"The residual of {v.measurement.channels} is {three_digits(fit.rms_after)} {v.unit} rms without a pattern"
    each = sorted((fit.rms_of_channels or {}).items(), key=lambda one: -one[1])
    if each:
        loose, steady = (f"{three_digits(x)} {v.unit} {axis}" for axis, x in (each[0], each[-1]))
        return f"{start}, {loose} and {steady}: the readout of one axis is noisy, or that axis is set loosely."
    if fit.chi2_of_samples_after is None:
        return f"{start}."
    ratio, _ = fit.excess_scatter
    if ratio < MAX_EXCESS_SCATTER:
        return f"{start}, {ratio:.2g} times the standard error from the scatter of the samples."
    row = "stretch" if v.measurement.rows == "stretches" else "position"
    return (
        f"{start}, but {ratio:.2g} times the standard error from the scatter of the samples: the outputs change from "
        f"one {row} to the next."
    )


# --- random walks, detection limits, separation and agreement ---------------------------------------------------------

SENSOR_OF_WALK = {"specific_force": "accelerometer", "angular_rate": "gyroscope"}
REPEAT_POSITIONS = "visit the same positions once more: a law of what is logged comes back there, a walk does not"
REPEAT_DWELLS = "take the same rests once more: a law of what is logged comes back there, a walk does not"
CONTINUE_RUN = "let the run go on as long again: a law of what is logged goes on as it began, a walk does not"
MAX_LIMITS = 3  # detection limits that a sentence names


def walk_in_words(walk: RandomWalkFinding) -> str:
    """Return the sensor that walks, or the triad, and the size of its walk."""
    size = f"{three_digits(walk.walk)} +- {three_digits(walk.sigma)} {walk.unit}"
    where = f" in recording {walk.recording}" if walk.recording else ""
    if "," in walk.axis:
        return f"the {SENSOR_OF_WALK[walk.quantity]}s wander{where}, each by a random walk of {size}"
    return f"{SENSOR_OF_WALK[walk.quantity]} {walk.axis} wanders{where}, a random walk of {size}"


def walk_to_state(walk: RandomWalkFinding) -> str:
    """Return that a triad wanders, and how the header states it."""
    return f"{capitalised(walk_in_words(walk))}; state it in [noise] as {SENSOR_OF_WALK[walk.quantity]}_random_walk"


def walk_as_explanation(walk: RandomWalkFinding, only: bool) -> str:
    """Return that a sensor walks, as the `only` explanation or as another one."""
    words = walk_in_words(walk)
    if not only:
        return f"It may as well be that {words}"
    return f"{capitalised(words)}: no cause and no formula is as likely"


def repeat_advice(stabilised: bool, by_hand: bool = False) -> str:
    """Return what distinguishes a random walk from a deterministic drift."""
    return CONTINUE_RUN if stabilised else REPEAT_DWELLS if by_hand else REPEAT_POSITIONS


def limits_in_words(limits: Sequence[DetectionLimit]) -> str:
    """Return a sentence on the effects that may be present at their usual size, the nearest to showing first; or "".

    >>> from gimbalcal.diagnose.result import DetectionLimit
    >>> limits_in_words([DetectionLimit("bias_drift", "x", 12.34, 3.0, "ug/h")])
    'At their usual size these would not have shown: bias drift (x) below 12.3 ug/h.'
    """
    hidden = sorted((t for t in limits if t.least > t.usual), key=lambda t: t.least / t.usual)
    if not hidden:
        return ""
    each = [f"{cause_in_words(t.effect, t.axis)} below {three_digits(t.least)} {t.unit}" for t in hidden]
    more = f" and {len(each) - MAX_LIMITS} more" if len(each) > MAX_LIMITS else ""
    return f"At their usual size these would not have shown: {', '.join(each[:MAX_LIMITS])}{more}."


def separation_advice(manoeuvre: str, hours: float, ln_bayes: float, one: str, other: str) -> str:
    """Return which manoeuvre distinguishes one thing from another, and how well; that none does where it is empty."""
    if manoeuvre:
        expected = f"{hours:.2g} h, with an expected log Bayes factor of {ln_bayes:.0f}"
        return f"To distinguish {one} from {other}: {manoeuvre}, {expected}."
    return (
        f"No manoeuvre of the menu would distinguish {one} from {other} at this size: it takes another kind of input."
    )


def size_disagreement(name: str, agreement: Agreement) -> str:
    """Return that recordings do not agree on the size of `name`."""
    return (
        f"The recordings do not agree on the size of {name}: it differs between them "
        f"(chi^2 {agreement.rise:.3g} on {agreement.combinations}, p = {agreement.p_value:.1g}); the mean stands for "
        "none of them."
    )


def constants_disagreement(agreement: ConstantsAgreement) -> str:
    """Return that recordings do not agree on the constants of the unit, and which differ most."""
    each = [
        f"{without_underscores(f'{e.name} {e.axis}')} by {e.value:+.4g} ± {e.sigma:.2g} {e.unit}"
        for e in agreement.differences
    ]
    odd = agreement.odd
    which = f"recording {odd + 1} differs most from the others" if odd >= 0 else "the second differs"
    most = f"; {which}, in {', '.join(each)}" if each else ""
    return (
        f"The recordings do not agree on the constants of the unit (chi² of {agreement.chi2:.0f} for the "
        f"{agreement.dof} combinations that several see, p = {agreement.p_value:.1g}){most}. They are of two units, or "
        "it changed in between: calibrate each by itself."
    )


# --- what a cause costs -----------------------------------------------------------------------------------------------

MIN_SHARE = 0.1  # of the error that remains with the cause in the calibration; less is not noticeable
SHORT_NMI = 0.01  # n miles below which a distance is given in metres


def cost_in_words(hours: float, known: float, left_out: float, raw: float | None = None) -> str:
    """One line of a report, from n miles; below a tenth of what is there anyway it is nothing.

    raw: without any calibration; none on a made-up base, where `known` is one sigma of what the calibration does not
    know.

    >>> cost_in_words(72.0, 0.0211, 1.34, 3.5)
    'in 72 h the position is off by up to 1.3 n mile if it is left out, 0.021 n mile with it in the calibration, 3.5 n mile without any calibration'
    >>> cost_in_words(72.0, 0.0304, 0.0312, 3.5)
    'nothing of position, off by up to 0.03 n mile in 72 h with it or without'
    >>> cost_in_words(24.0, 4.88, 199.5)
    'in 24 h at rest the position is off by up to 200 n mile if it is left out; with it in the calibration 4.9 n mile (one sigma) stay open'
    >>> cost_in_words(24.0, 0.5, 0.003)
    'next to nothing of position, 5.6 m in 24 h at rest; with it in the calibration 0.5 n mile (one sigma) stay open'
    """  # noqa: E501
    off, least, rest = _distance_in_words(left_out), _distance_in_words(known), "with it in the calibration"
    if raw is None:
        if left_out < MIN_SHARE * known:
            return f"next to nothing of position, {off} in {hours:.3g} h at rest; {rest} {least} (one sigma) stay open"
        sentence = f"in {hours:.3g} h at rest the position is off by up to {off} if it is left out"
        if left_out < known:
            return f"{sentence}, less than the {least} (one sigma) that stay open {rest}"
        return f"{sentence}; {rest} {least} (one sigma) stay open"
    if left_out < (1 + MIN_SHARE) * known:
        return f"nothing of position, off by up to {least} in {hours:.3g} h with it or without"
    return (
        f"in {hours:.3g} h the position is off by up to {off} if it is left out, {least} {rest}, "
        f"{'only ' if raw < left_out else ''}{_distance_in_words(raw)} without any calibration"
    )


def _distance_in_words(miles: float) -> str:
    """Two digits, in metres where n miles have too many zeros."""
    if miles < SHORT_NMI:
        return f"{miles * NAUTICAL_MILE:.2g} m"
    return f"{miles:.0f} n mile" if miles >= 10 else f"{miles:.2g} n mile"
