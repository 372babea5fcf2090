"""What a diagnosis says in plain sentences, written from its numbers.

Where the noise is known misfits are told in sigma, as reduced chi^2; where it is not, in their own unit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.diagnose.result import Finding, FitSummary, Mismatch, Shape, ViewFit
from gimbalcal.number import Array
from gimbalcal.views.core import View

NO_CAUSE = "The model does not explain these data, and no cause of the catalogue does."
ROWS = {
    "pointing": "stars",
    "norm": "positions",
    "rest rates": "positions",
    "turns": "turns",
    "slews": "slews",
    "table": "stretches of ten seconds",
    "navigation": "stops and turns",
}
CHANNELS = {"norm": "the norm of the force", "rest rates": "the rates at rest", "table": "the force",
            "turns": "gravity's direction after the turns", "slews": "the delay of the sensors on the way",
            "navigation": "the velocity of a unit that stays in its place"}  # fmt: skip
NAMED = 3  # causes that stand together up to which their set is a name
QUIET = 1.5  # times the samples' own scatter; beyond it a sentence says what the rest may be


# --- an effect --------------------------------------------------------------------------------------------------------


def spoken(effect: str) -> str:
    """An id in words.

    >>> spoken("base_tilt")
    'base tilt'
    """
    return effect.replace("_", " ")


def named(effect: str, axis: str, twins: Sequence[str] = ()) -> str:
    """An effect with its axis, and the effects that these data do not tell from it; of many no one is named.

    >>> named("bias_drift", "y", ("warm_up", "bias_step", "self_heating"))
    'one of 4 that look alike: bias drift (y), warm up, bias step, self heating'
    """
    every = [f"{spoken(effect)} ({spoken(axis)})" if axis else spoken(effect), *(spoken(t) for t in twins)]
    return " or ".join(every) if len(every) <= NAMED else f"one of {len(every)} that look alike: {', '.join(every)}"


# --- a verdict --------------------------------------------------------------------------------------------------------


def answer(
    verdict: str, findings: Sequence[Finding], unexplained: Sequence[Shape], mismatch: Sequence[Mismatch],
    fit: FitSummary,
) -> str:  # fmt: skip
    """The verdict in two sentences, where the noise is known."""
    if verdict == "adequate":
        return f"The calibrated model explains these data: reduced chi^2 {fit.chi2_reduced_before:.3g}."
    if verdict == "unexplained":
        return f"{no_cause(unexplained)}{off(mismatch)}"
    rest = ""
    if unexplained and verdict != "not-identifiable":
        rest = f" Part of it may have no known cause: {left_over(unexplained[0])}."
    return f"{causes(verdict, findings, unexplained)}. {improved(fit)}{rest}{off(mismatch)}"


MISSED = 5.0  # times what is left, from which rows that took no part say that the fit is not tested


def answer_of_views(
    verdict: str, views: Sequence[tuple[View, ViewFit, Sequence[Finding]]], unexplained: Sequence[Shape],
    mismatch: Sequence[Mismatch],
) -> str:  # fmt: skip
    """The verdict in a few sentences, where the noise is not known; per view its fit, and the findings in it."""
    if verdict == "adequate":
        said = [t for v, fit, _ in views for t in (scatter(v, fit), untested(v, fit)) if t]
        return "The calibrated model explains these data. " + " ".join(said)
    if verdict == "unexplained":
        return f"{no_cause(unexplained)}{off(mismatch)}"
    found = [f for _, _, findings in views for f in findings]
    said = [t for v, fit, own in views if own for t in (misfit_improved(v, fit), untested(v, fit)) if t]
    better = " ".join(said)
    rest = f" What is left has no known cause: {left_over(unexplained[0])}." if unexplained else ""
    return f"{causes(verdict, found, by='; ')}. {better}{rest}{off(mismatch)}"


def reserve(verdict: str, findings: Sequence[Finding], unexplained: Sequence[Shape]) -> str:
    """Why the calibration that a diagnosis ends in should not be used as it is; empty where nothing speaks against."""
    if verdict == "unexplained":
        return f"{no_cause(unexplained)} The calibration holds the model without it"
    if verdict != "not-identifiable":
        return ""
    held = " and ".join(named(f.effect, f.axis) for f in findings if f.effect not in DELAYS)
    corrects = f" The calibration holds {held}, which corrects these data as well as the others" if held else ""
    return f"{causes(verdict, findings)}.{corrects}"


DELAYS = {  # what is read that much later than what it is logged with, where the delay is positive
    "time_tag_latency": ("the force", -1.0),
    "gyro_latency": ("the rate", -1.0),
    "readout_latency": ("the gimbal angle", 1.0),
}


def delayed(findings: Sequence[Finding]) -> str:
    """Which channel comes how much later or earlier than the others, and what to do about it; empty for none."""
    said = []
    for f in findings:
        for p in f.parameters if f.effect in DELAYS else ():
            channel, sense = DELAYS[f.effect]
            late = sense * p.value
            when = ("late", "early") if late > 0 else ("early", "late")
            other = "".join(f", or {DELAYS[t][0]} as much {when[1]}" for t in f.twins if t in DELAYS)
            said.append(f"{channel} is logged {abs(late):.3g} +- {p.sigma:.2g} ms {when[0]}{other}")
    if not said:
        return ""
    text = " and ".join(said)
    return f"{text[0].upper()}{text[1:]}: shift the stamps, as no calibration does."


def unlooked_way(why: str) -> str:
    """That the way between positions was not looked at, and why."""
    return f"The way between positions was not looked at, so a delay between channels would not show: {why}."


def causes(verdict: str, findings: Sequence[Finding], unexplained: Sequence[Shape] = (), by: str = " and ") -> str:
    """What was left out; where that is open, with the shape that may stand in its place."""
    said = by.join(named(f.effect, f.axis, f.twins) for f in findings)
    if verdict != "not-identifiable":
        return f"What was left out: {said}"
    other = f", or none that is known: {left_over(unexplained[0])}" if unexplained else ""
    return f"These data cannot tell which was left out: {said}{other}"


def no_cause(unexplained: Sequence[Shape]) -> str:
    """That nothing known explains the data, and the shape of what is left."""
    return f"{NO_CAUSE} What is left is {left_over(unexplained[0])}." if unexplained else NO_CAUSE


def off(mismatch: Sequence[Mismatch]) -> str:
    """A further sentence: where the model is off by most."""
    return f" {mismatch[0].in_words}." if mismatch else ""


def left_over(unexplained: Shape) -> str:
    """A shape without a cause, and the channel that it is in."""
    channel, shape = spoken(unexplained.channel), unexplained.shape
    return shape if channel.startswith("gimbal") and "gimbal" in shape else f"{shape} in {channel}"


def shape(rival: str, channel: str, axis: str) -> Shape:
    """An entry of `unexplained`: a shape without a cause."""
    return Shape(f"{channel} {axis}".strip(), rival)


# --- a fit in a known noise -------------------------------------------------------------------------------------------


def improved(fit: FitSummary, of: str = "Reduced chi^2") -> str:
    """What naming the causes does to the misfit, in one sentence."""
    return (
        f"{of} goes from {fit.chi2_reduced_before:.3g} to {fit.chi2_reduced_after:.3g}, "
        f"on held-out data from {fit.heldout_before:.3g} to {fit.heldout_after:.3g}."
    )


# --- a view without a known noise -------------------------------------------------------------------------------------


def digits(x: float) -> str:
    """A positive number with three digits, without a power of ten as long as it is readable.

    >>> digits(1921.3), digits(0.9317)
    ('1921', '0.932')
    """
    return f"{x:.0f}" if 1e3 <= x < 1e5 else f"{x:.3g}"


def channel_of(v: View, axis: str) -> str:
    """One channel of a view as a person says it."""
    if v.name == "pointing":
        return f"pointing {axis} {v.stimulus.axis_names[0].replace('_', ' ')}"
    if v.name == "turns":
        return f"gravity's direction after a turn, {axis}"
    if v.name == "slews":
        return f"the delay of the {axis} on the way"
    if v.name == "navigation":
        return f"the velocity {axis} of a unit that stays in its place"
    said = {"norm": "the norm of the force", "rest rates": f"the rate about {axis} at rest"}
    return said.get(v.name, f"the force along {axis}")


def channels_of(v: View) -> str:
    return CHANNELS.get(v.name, "pointing")  # all of them together


def follows(v: View, axis: str, size: float, pattern: str) -> str:
    """A pattern found in a channel."""
    return f"The misfit of {channel_of(v, axis)} ({digits(size)} {v.unit} rms) follows {pattern}"


def follows_sensor(v: View, quantity: str, axis: str, size: float, pattern: str) -> str:
    """A pattern in a sensor, found in what a navigator makes of it."""
    told = f"The misfit of {channels_of(v)} ({digits(size)} {v.unit} rms)"
    return f"{told} follows {pattern} in {spoken(quantity)} {axis}"


def largest(v: View, axis: str, size: float, ratio: float, rows: Array) -> str:
    """A misfit without a pattern of its own: how large it is and where it is largest."""
    if v.label is None:
        time = v.time[np.sort(rows)]
        where = f"{', '.join(f'{t:.0f}' for t in time[:-1])} and {time[-1]:.0f} s after the start"
    else:
        *most, last = (str(int(k)) for k in v.label[rows])
        where = f"at {ROWS[v.name]} {' and '.join([*filter(None, [', '.join(most)]), last])}"
    return (
        f"The misfit of {channel_of(v, axis)} is {digits(size)} {v.unit} rms, {ratio:.3g} times what remains in the "
        f"end, and largest {where}"
    )


def view_in_words(v: View, fit: ViewFit, findings: Sequence[Finding], verdict: str) -> str:
    """What naming the causes does to the misfit of a view, or how little is left of it."""
    if findings:
        return misfit_improved(v, fit)
    return scatter(v, fit) if verdict == "adequate" else ""


def misfit_improved(v: View, fit: ViewFit) -> str:
    """What naming the causes does to the misfit of a view, in its unit."""
    out = (
        f"The misfit of {channels_of(v)} goes from {digits(fit.rms_before)} to {digits(fit.rms_after)} {v.unit} "
        f"rms, and for {ROWS[v.name]} that the fit has not seen from {digits(fit.heldout_rms_before)} to "
        f"{digits(fit.heldout_rms_after)} {v.unit}."
    )
    if t := fit.turns:
        out += (
            f" Carried through the turns between the positions, gravity is missed by {t.rms_after:.0f} {t.unit} "
            f"rms instead of {t.rms_before:.0f}."
        )
    return out


def strayed(numbers: Sequence[int], sizes: Sequence[float], unit: str, why: str) -> str:
    """That stars far off all others were left out, by how much each is off, and why.

    >>> strayed([80], [0.763], "arcsec", "mistaken or not centred")
    'Star 80 is 0.763 arcsec off where the others are not: mistaken or not centred; it was left out.'
    """
    told = " and ".join(f"star {n} is {digits(size)} {unit} off" for n, size in zip(numbers, sizes, strict=True))
    which = "it was" if len(numbers) == 1 else "they were"
    return f"S{told[1:]} where the others are not: {why}; {which} left out."


def untested(v: View, fit: ViewFit) -> str:
    """That rows outside the fit are missed by far more than those in it: too few for what was fitted."""
    if fit.heldout_rms_after < MISSED * fit.rms_after:
        return ""
    return (
        f"But {ROWS[v.name]} left out of the fit are missed by {digits(fit.heldout_rms_after)} {v.unit}: a constant "
        f"rests on one of them alone, so that these data do not test the model; more {ROWS[v.name]} would."
    )


def scatter(v: View, fit: ViewFit) -> str:
    """What is left of a view that its model explains, against the scatter of its samples where that is known."""
    if v.name == "slews":
        most = {axis: abs(x.value) + 2 * x.sigma for axis, x in (fit.late or {}).items()}
        late = ", ".join(f"{axis} by at most {ms:.2g} ms" for axis, ms in most.items())
        return f"On the way ({len(v)} slews) no delay is told: {late}."
    start = f"What is left of {channels_of(v)} is {digits(fit.rms_after)} {v.unit} rms without a pattern"
    if fit.chi2_of_samples_after is None:
        return f"{start}."
    times = float(np.sqrt(np.mean(list(fit.chi2_of_samples_after.values()))))
    if times < QUIET:
        return f"{start}, {times:.2g} times what the scatter of the samples makes of a mean."
    return (
        f"{start}, but {times:.2g} times what the scatter of the samples makes of a mean: the outputs wander from one "
        "position to the next."
    )
