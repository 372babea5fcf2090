r"""Input errors that a systematic calibration can suspect: noise, clock, lever arm, latitude; and limits of the data.

A latitude that is off by dL adds to the rates, in the axes of the unit,

.. math:: \delta\omega = C_n^b \, \frac{d\omega_{ie}}{dL} \, dL, \qquad
          \frac{d\omega_{ie}}{dL} = \Omega \, (-\sin L, \; 0, \; -\cos L)

so it is one more parameter, and least squares on the innovations shows whether it explains the misfit.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.estimate.systematic.bias_processes import bias_processes
from gimbalcal.estimate.systematic.error_model import in_body
from gimbalcal.estimate.systematic.filter_pass import GATE_NIS
from gimbalcal.estimate.systematic.innovation_rows import innovation_rows
from gimbalcal.estimate.systematic.iterate import SystematicFit
from gimbalcal.estimate.systematic.turn_consistency import NONLINEAR_SCALE_ERROR
from gimbalcal.number import Array
from gimbalcal.views.segments import Segments

MAX_DIFFERENCE = 0.1  # of the scale errors of a triad that have one cause
MIN_SHARE = 0.8  # of the misfit, that an input error has to explain
MIN_SIGNIFICANCE = 10.0  # sigma
MAX_HEADING_SIGMA_DEG = 10.0
MIN_SIGMA_RATIO = 0.5  # posterior over prior sigma: beyond, the recording has not determined the parameter
MAX_NOISE_RATIO = 3.0  # scatter at the stops over stated noise


def limitations(m: SystematicFit, sigmas: Array) -> list[str]:
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
    """Return the likeliest input error behind a lack of fit as a clause; empty where none is likely."""
    return _noise(m.segments) or _clock(m) or _lever_arm(m) or _latitude(m) or _bias_instability(m.segments)


def _noise(segments: Segments) -> str:
    """Suspect a stated noise that is below the scatter at the stops."""
    for k, (sensor, unit) in ((0, ("accelerometer", "m/s^2")), (3, ("gyroscope", "rad/s"))):
        stated, shown = float(segments.sigma[k]), float(np.sqrt(np.mean(segments.shown[k : k + 3] ** 2)))
        if segments.stated and shown > MAX_NOISE_RATIO * stated:
            return (
                f"[noise] says {stated:.2g} {unit} a sample of the {sensor}, and the stops scatter by {shown:.2g} "
                f"{unit}: correct it, or leave it out to have it taken from the stops"
            )
    return ""


def _clock(m: SystematicFit) -> str:
    """Suspect rates, or a clock, in another unit: all three gyroscopes are off by the same."""
    sizes = np.array([x for p, x in zip(m.wanted, m.theta, strict=True) if p.effect == "gyro_scale_factor"])
    if (
        len(sizes) != 3
        or np.abs(sizes).min() <= NONLINEAR_SCALE_ERROR
        or np.ptp(sizes) > MAX_DIFFERENCE * np.abs(sizes).max()
    ):
        return ""
    off = 100 * (1 / (1 + float(np.mean(sizes))) - 1)  # of what they read, where the scale factor is of what was there
    return (
        f"all three gyroscopes read {abs(off):.3g} % too {'much' if off > 0 else 'little'} alike: is the unit of the "
        "rates, or of the time, another?"
    )


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


def _latitude(m: SystematicFit) -> str:
    """Suspect the latitude, where another one explains the misfit."""
    w = innovation_rows(m)
    stated = m.segments.rows.site.latitude
    assert stated is not None
    slope = EARTH_RATE * np.array([-np.sin(stated), 0.0, -np.cos(stated)])
    D = np.zeros((len(w.felt.rate), 6, 1))
    D[:, 3:, 0] = in_body(m.segments, m.u, m.C, slope)
    columns = [D]
    for effect_id in dict.fromkeys(p.effect for p in m.wanted):
        effect = next(e for e in m.effects if e.id == effect_id)
        columns.append(w.addition(effect, [p for p in m.wanted if p.effect == effect_id]))
    scale = np.array([1.0, *(p.sigma for p in m.wanted)])
    sigma = np.broadcast_to(w.sigma[..., None], (*w.sigma.shape, len(scale)))
    A = (w.response(np.concatenate(columns, axis=2)) * scale / sigma).reshape(-1, len(scale))
    y = (w.residual / w.sigma).reshape(-1)
    fits = [np.linalg.lstsq(B, y, rcond=None)[0] for B in (A[:, 1:], A)]
    without, with_it = (float(np.sum((y - B @ x) ** 2)) for B, x in zip((A[:, 1:], A), fits, strict=True))
    off = float(fits[1][0])
    excess = without - (len(y) - len(scale))
    if without - with_it < max(MIN_SHARE * excess, MIN_SIGNIFICANCE**2):
        return ""
    return (
        f"a latitude of some {np.degrees(stated + off):.1f} deg instead of {np.degrees(stated):.4g} deg would nearly "
        "explain it: correct [site]"
    )
