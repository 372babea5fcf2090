r"""Which experiment separates causes that this recording confounds: expected log Bayes factor per hour of bench time.

For two causes i and j and the size at which i was found, the recording extended by a manoeuvre separates them by

.. math:: \lambda^2 = \min_a \| X_i \hat\beta - X_j a \|^2_{V^{-1}}, \qquad E[\ln BF] = \lambda^2 / 2 ,

the calibration profiled out of both. Each manoeuvre of the menu is laid out as rows and passed through the same model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.stated_noise import nominal
from gimbalcal.diagnose.library.assemble import columns_at
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.earth import EARTH_RATE
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.views.core import Fit
from gimbalcal.views.known_attitude import fit_baseline, view_at_known_attitude
from gimbalcal.words.diagnosis_sentences import separation_advice
from gimbalcal.words.naming import spaced

TRIED = 12  # variants of the other cause: the grid of its constants
ENOUGH = 720  # rows of a static run that a planned one is laid out with
SETTLED = 3.0  # nats: a factor 20


@dataclass(frozen=True)
class Manoeuvre:
    """One thing to do on the bench: in words, hours it takes, and the recording it would add to."""

    words: str
    hours: float
    apply: Callable[[Recording], Recording]


@dataclass(frozen=True)
class Advice:
    """The best manoeuvre ("" where none helps), the log Bayes factor it is expected to bring, and its hours."""

    words: str
    ln_bayes: float
    hours: float


def advise(o: Fit, found: Candidate, variant: int, size: Array, other: Candidate) -> Advice:
    """The manoeuvre that separates `found`, at its fitted size in prior sigmas, from `other` fastest."""
    return fastest(o, lambda planned: separation(planned, found, variant, size, other))


def fastest(o: Fit, gained: Callable[[Fit], float]) -> Advice:
    """The manoeuvre of the menu that brings most per hour; `gained`: ln Bayes factor of the planned rows."""
    step = max(1, len(o.view.source.time) // ENOUGH) if o.view.kind.stabilised else 1
    thin = o.view.source.select(slice(None, None, step))
    best = Advice("", 0.0, 0.0)
    for m in menu(thin):
        ln_bayes = step * gained(planned_rows(m.apply(thin), o))
        if ln_bayes > SETTLED and (not best.words or ln_bayes / m.hours > best.ln_bayes / best.hours):
            best = Advice(m.words, ln_bayes, m.hours)
    return best


def sentence(a: Advice, found: Candidate, other: Candidate) -> str:
    """Return the advice as one sentence."""
    return separation_advice(a.words, a.hours, a.ln_bayes, spaced(found.effect), spaced(other.effect))


def separation(o: Fit, found: Candidate, variant: int, size: Array, other: Candidate) -> float:
    """Expected log Bayes factor between the two causes in the nominal noise."""
    signal = columns_at(o, found, found.variants[variant].constants) @ size[:, None]
    return apart(o, signal, [columns_at(o, other, v.constants) for v in other.variants[:TRIED]])


def apart(o: Fit, signal: Array, others: Iterable[Array]) -> float:
    """Expected log Bayes factor of a signal (R, 1) against the best of other columns (R, p), in the nominal noise."""
    node = nominal(o)
    Q = orthonormal(node.whiten(o.reduced(o.Z)))
    y = node.whiten(signal)[:, 0]
    y = y - Q @ (Q.T @ y)
    least = float(y @ y)
    for columns in others:
        X = node.whiten(columns)
        X = X - Q @ (Q.T @ X)
        left = y - X @ np.linalg.lstsq(X, y, rcond=1e-9)[0]
        least = min(least, float(left @ left))
    return least / 2


def planned_rows(recording: Recording, o: Fit) -> Fit:
    """Sensitivities of a planned recording; its readings do not matter, only where and when they would be taken."""
    ids = tuple(dict.fromkeys(p.effect for p in o.parameters))
    return fit_baseline(view_at_known_attitude(recording, ids, o.effects), o.effects, steps=0)


def menu(recording: Recording) -> tuple[Manoeuvre, ...]:
    """Manoeuvres for this kind of recording."""
    hours = float(recording.time[-1] - recording.time[0]) / 3600.0
    if recording.kind.stabilised:
        return (Manoeuvre("let the run go on as long again", hours, _extended),)
    out = [
        Manoeuvre("repeat the positions in reversed order", hours, lambda r: repeated(r, reverse=True)),
        Manoeuvre("wait 6 h and repeat the positions", hours + 6, lambda r: repeated(r, pause=6 * 3600.0)),
        Manoeuvre("take the positions with gimbals at 30 and 60 degrees", hours, lambda r: repeated(r, share=2 / 3)),
    ]
    if {"inner", "middle"} <= set(recording.axes("gimbal_angle")):
        words = "repeat the positions with the other gimbal solution"
        out.append(Manoeuvre(words, hours, lambda r: repeated(r, other=True)))
    if recording.has("temperature"):
        out.append(
            Manoeuvre("repeat the positions 6 degC warmer", hours + 2, lambda r: repeated(r, 7200.0, warmer=6.0))
        )
    return tuple(out)


def repeated(
    r: Recording, pause: float = 60.0, *, reverse: bool = False, share: float = 1.0, other: bool = False,
    warmer: float = 0.0,
) -> Recording:  # fmt: skip
    """The recording followed by a second pass: in reverse order, over part of the angles, flipped, or warmer."""
    n = len(r.time)
    step = float(np.median(np.diff(r.time)))
    order = np.arange(n)[::-1] if reverse else np.arange(n)
    channels = {key: np.concatenate([v, v[order]]) for key, v in r.channels.items()}
    for (quantity, axis), v in r.channels.items():
        second = v[order] * (share if quantity == "gimbal_angle" else 1.0)
        second = second + (warmer if quantity == "temperature" else 0.0)
        if other and quantity == "gimbal_angle" and axis in ("inner", "middle"):
            second = second + np.pi if axis == "inner" else np.pi - second
        channels[quantity, axis] = np.concatenate([v, second])
    moved = r.time[-1] - r.time[order] if reverse else r.time - r.time[0]
    time = np.concatenate([r.time, r.time[-1] + step + pause + moved])
    position = None if r.position is None else np.concatenate([r.position, r.position[order]])
    return replace(r, time=time, position=position, channels=channels, weight=np.concatenate([r.weight, r.weight]))


def _extended(r: Recording) -> Recording:
    """A static run of twice the length; readouts go on as the Earth turns."""
    step = float(np.median(np.diff(r.time)))
    shift = float(r.time[-1] - r.time[0]) + step
    channels = {}
    for (quantity, axis), v in r.channels.items():
        turn = EARTH_RATE * shift if (quantity, axis) == ("gimbal_angle", "platform") else 0.0
        channels[quantity, axis] = np.concatenate([v, v + turn])
    position = None if r.position is None else np.concatenate([r.position, r.position])
    return replace(r, time=np.concatenate([r.time, r.time + shift]), position=position, channels=channels,
                   weight=np.concatenate([r.weight, r.weight]))  # fmt: skip
