"""What a diagnosis of recordings without a stated noise says in sentences: misfits in their own unit, not in sigma."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.diagnose import wording
from gimbalcal.diagnose.rows.views import View
from gimbalcal.number import Array

ROWS = {
    "pointing": "stars",
    "norm": "positions",
    "rest rates": "positions",
    "turns": "turns",
    "table": "stretches of ten seconds",
}
QUIET = 1.5  # times the samples' own scatter; beyond it a sentence says what the rest may be


def digits(x: float) -> str:
    """A positive number with three digits, without a power of ten as long as it is readable.

    >>> digits(1921.3), digits(0.9317)
    ('1921', '0.932')
    """
    return f"{x:.0f}" if 1e3 <= x < 1e5 else f"{x:.3g}"


def channel(v: View, axis: str) -> str:
    """One channel of a view as a person says it."""
    if v.name == "pointing":
        return f"pointing {axis} {v.stimulus.axis_names[0].replace('_', ' ')}"
    if v.name == "turns":
        return f"gravity's direction after a turn, {axis}"
    named = {"norm": "the norm of the force", "rest rates": f"the rate about {axis} at rest"}
    return named.get(v.name, f"the force along {axis}")


def whole(v: View) -> str:
    """All channels of a view together."""
    named = {"norm": "the norm of the force", "rest rates": "the rates at rest", "table": "the force",
             "turns": "gravity's direction after the turns"}  # fmt: skip
    return named.get(v.name, "pointing")


def follows(v: View, axis: str, size: float, shape: str) -> str:
    """A pattern found in a channel."""
    return f"The misfit of {channel(v, axis)} ({digits(size)} {v.unit} rms) follows {shape}"


def largest(v: View, axis: str, size: float, ratio: float, rows: Array) -> str:
    """A misfit without a pattern of its own: how large it is and where it is largest."""
    if v.name == "table":
        time = v.recording.time[np.sort(rows)] - v.recording.time[0]
        where = f"{', '.join(f'{t:.0f}' for t in time[:-1])} and {time[-1]:.0f} s after the start"
    else:
        *most, last = (str(int(k)) for k in v.stimulus.position[rows])
        where = f"at {ROWS[v.name]} {' and '.join([*filter(None, [', '.join(most)]), last])}"
    return (
        f"The misfit of {channel(v, axis)} is {digits(size)} {v.unit} rms, {ratio:.3g} times what remains in the end, "
        f"and largest {where}"
    )


def answer(
    verdict: str, views: Sequence[tuple[View, Mapping[str, Any], Sequence[Mapping[str, Any]]]],
    unexplained: Sequence[Mapping[str, Any]], mismatch: Sequence[Mapping[str, Any]],
) -> str:  # fmt: skip
    """The verdict in a few sentences; per view, what its misfit was and is, and the findings in it."""
    found = [f for _, _, fs in views for f in fs]
    where = f" {mismatch[0]['in_words']}." if mismatch else ""
    if verdict == "adequate":
        return "The calibrated model explains these data. " + " ".join(_scatter(v, fit) for v, fit, _ in views)
    if verdict == "unexplained":
        return f"{wording.NO_CAUSE} What is left is {wording.left_over(unexplained[0])}.{where}"
    better = " ".join(_better(v, fit) for v, fit, fs in views if fs)
    rest = f" What is left has no known cause: {wording.left_over(unexplained[0])}." if unexplained else ""
    return f"{wording.causes(verdict, found, by='; ')}. {better}{rest}{where}"


def of_view(v: View, fit: Mapping[str, Any], findings: Sequence[Mapping[str, Any]], verdict: str) -> str:
    """What naming the causes does to the misfit of a view, or how little is left of it."""
    if findings:
        return _better(v, fit)
    return _scatter(v, fit) if verdict == "adequate" else ""


def _better(v: View, fit: Mapping[str, Any]) -> str:
    out = (
        f"The misfit of {whole(v)} goes from {digits(fit['rms_before'])} to {digits(fit['rms_after'])} {v.unit} rms, "
        f"and for {ROWS[v.name]} that the fit has not seen from {digits(fit['heldout_rms_before'])} to "
        f"{digits(fit['heldout_rms_after'])} {v.unit}."
    )
    if "turns" in fit:
        t = fit["turns"]
        out += (
            f" Carried through the turns between the positions, gravity is missed by {t['rms_after']:.0f} {t['unit']} "
            f"rms instead of {t['rms_before']:.0f}."
        )
    return out


def _scatter(v: View, fit: Mapping[str, Any]) -> str:
    start = f"What is left of {whole(v)} is {digits(fit['rms_after'])} {v.unit} rms without a pattern"
    if v.noise is None:
        return f"{start}."
    times = float(np.sqrt(np.mean(list(fit["chi2_of_samples_after"].values()))))
    if times < QUIET:
        return f"{start}, {times:.2g} times what the scatter of the samples makes of a mean."
    return (
        f"{start}, but {times:.2g} times what the scatter of the samples makes of a mean: the outputs wander from one "
        "position to the next."
    )
