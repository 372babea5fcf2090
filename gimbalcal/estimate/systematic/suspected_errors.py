"""Input errors that a systematic calibration can suspect: noise, clock, latitude, lever arm; and limits of the data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gimbalcal.checks.input_errors import Correction, successful_trials
from gimbalcal.errors import InputError
from gimbalcal.estimate.systematic.alignment import of_the_clock
from gimbalcal.estimate.systematic.error_model import bias_processes
from gimbalcal.estimate.systematic.filter_pass import GATE_NIS
from gimbalcal.estimate.systematic.iterate import SystematicFit, iterate
from gimbalcal.number import Array
from gimbalcal.views.segments import Segments, segment

MAX_SHARE = 0.2  # of the misfit, that a correction may leave
MIN_SHARE = 0.8  # of the updates without use, that are in turns where the unit does not turn about its accelerometers
MIN_EXCESS = 100.0  # chi^2 beyond its degrees of freedom, of which a cause can be named
MIN_LATITUDE_SIGMAS = 3.0  # by which the latitude that the turns show is another than the stated one
MAX_HEADING_SIGMA_DEG = 10.0
MIN_SIGMA_RATIO = 0.5  # posterior over prior sigma: beyond, the recording has not determined the parameter
MAX_NOISE_RATIO = 3.0  # scatter at the stops over stated noise


def limitation_sentences(m: SystematicFit, sigmas: Array) -> list[str]:
    """Return sentences on what the noise and the motion do not allow; sigmas (p,) of the states."""
    out = []
    if m.segments.handled:
        out.append("a hand turned the unit and carried it along, so its velocity is taken as zero at the stops alone")
    heading = float(np.degrees(np.sqrt(m.last.attitude[2, 2])))
    if heading > MAX_HEADING_SIGMA_DEG:
        out.append(f"north is known to {heading:.2g} deg: these gyroscopes hardly see the Earth turn")
    undetermined = [
        effect.replace("_", " ")
        for effect in dict.fromkeys(p.effect for p in m.wanted)
        if all(s > MIN_SIGMA_RATIO * p.sigma for p, s in zip(m.wanted, sigmas, strict=True) if p.effect == effect)
    ]
    if undetermined:
        is_are = "is" if len(undetermined) == 1 else "are"
        out.append(
            f"{' and '.join(undetermined)} {is_are} known no better than from the grade of the unit: at this noise the "
            "turns do not determine them"
        )
    return out


def suspected_error(m: SystematicFit) -> str:
    """Return the likeliest input error behind a lack of fit as a clause; empty where none is likely.

    A noise below the scatter at the stops is a fact, and is said whether or not it explains the misfit.
    """
    noise = _without_small_noise(m.segments)

    def excess(correction: Correction) -> float:
        try:
            again = iterate(segment(correction.corrected(m.segments.source)), m.wanted, m.base_effects)
        except InputError:
            return np.inf
        return _chi2_excess(again) if again.converged else np.inf

    stated = min(_chi2_excess(m), excess(noise) if noise.unstated else np.inf)
    candidates = _corrections(m) if stated > MIN_EXCESS else ()
    tried = successful_trials(candidates, lambda c: excess(replace(c, unstated=noise.unstated)), MAX_SHARE * stated)
    explaining = [t.candidate.words for t in tried if t.misfit <= MAX_SHARE * stated]
    return "; ".join(filter(None, (noise.words, *explaining))) or _lever_arm(m) or _bias_instability(m.segments)


def _without_small_noise(segments: Segments) -> Correction:
    """Return the correction that leaves stated noises out that are below the scatter at the stops."""
    small = dict[str, str]()
    for k, (sensor, unit) in ((0, ("accelerometer", "m/s^2")), (3, ("gyroscope", "rad/s"))):
        stated, shown = float(segments.sigma[k]), float(np.sqrt(np.mean(segments.shown[k : k + 3] ** 2)))
        if segments.stated and shown > MAX_NOISE_RATIO * stated:
            small[sensor] = (
                f"[noise] says {stated:.2g} {unit} a sample of the {sensor}, and the stops scatter by {shown:.2g} "
                f"{unit}: correct it, or leave it out to have it taken from the stops"
            )
    return Correction("; ".join(small.values()), unstated=tuple(small))


def _chi2_excess(m: SystematicFit) -> float:
    """Return by how much chi^2 of all innovations is above its degrees of freedom."""
    used = m.segments.believed
    return float(max(m.last.calibrated.distance[used].sum() - 3 * np.count_nonzero(used), 0.0))


def _corrections(m: SystematicFit) -> Iterator[Correction]:
    """Yield the clock with which scale errors that all gyroscopes share are none, and the latitude of the turns."""
    sizes = np.array([x for p, x in zip(m.wanted, m.theta, strict=True) if p.effect == "gyro_scale_factor"])
    if len(sizes) == 3 and of_the_clock(sizes):
        second = 1 + float(np.mean(sizes))
        off = 100 * (1 / second - 1)  # of what they read, where the scale factor is of what was there
        words = (
            f"all three gyroscopes read {abs(off):.3g} % too {'much' if off > 0 else 'little'} alike, and a clock "
            f"whose second is {second:.4g} s explains it: correct the unit of the time, or the rate of the samples"
        )
        yield Correction(words, clock=second)
    stated, observed = m.segments.latitude, m.start  # before the constants were fitted to the stated latitude
    if abs(observed.latitude - stated) > MIN_LATITUDE_SIGMAS * observed.latitude_sigma:
        words = (
            f"a latitude of some {np.degrees(observed.latitude):.1f} deg instead of {np.degrees(stated):.4g} deg "
            "would nearly explain it: correct [site]"
        )
        yield Correction(words, latitude=observed.latitude)


def _bias_instability(segments: Segments) -> str:
    """Suspect the bias instability of a unit below navigation grade, where none is stated."""
    grade = segments.grade.name
    if grade == "navigation" or len(bias_processes(segments)):
        return ""
    return (
        f"biases of a unit as noisy as this one ({grade} grade) wander, so state accelerometer_flicker and "
        "gyroscope_flicker (the bias instability of a data sheet) in [noise]; and `gimbalcal diagnose` looks for what "
        "else is left out"
    )


def _lever_arm(m: SystematicFit) -> str:
    """Suspect a lever arm, or a hand: velocities that are zero at the stops and not in the turns."""
    bad = m.last.calibrated.distance > GATE_NIS
    turning = m.segments.stop < 0
    turns = np.cumsum(np.diff(turning, prepend=False) & turning)
    struck = len(np.unique(turns[bad & turning]))
    if not bad.any() or np.mean(turning[bad]) < MIN_SHARE or struck < turns[-1] / 2:
        return ""
    return (
        f"its velocity is zero at the stops and not in {struck} of {turns[-1]} turns, so it does not turn about its "
        "accelerometers, or a hand carried it along: add lever_arm to --states, or state velocity = { value = ..., "
        'unit = "m/s" } of its place in [noise]'
    )
