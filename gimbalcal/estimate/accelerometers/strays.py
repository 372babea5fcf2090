r"""Rests that do not belong among the others where no angle is known: a number off by one, a reading wrong, a knock.

A rest k is left out, the others are fitted, and what they say of its norm is held against what they leave, s, and how
well they can tell it at all, h_k being its leverage:

.. math:: \frac{|\,|h^{-1}(y_k)| - g\,| \sqrt{1 - h_k}}{s_{(k)}} > t

(the deleted residual, studentised), t of Student's distribution, and never less than `FAR`.
One that is off by so much tells nothing of the sensors, and would scale every sigma. A misfit that several rests share
is missing physics, and none of them is blamed for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.errors import InputError, alternatives
from gimbalcal.estimate.accelerometers.norm_fit import LINEAR, norm_fit, scaled_by_gravity, unknowns
from gimbalcal.estimate.accelerometers.setting import FORCE
from gimbalcal.forward import accelerometers
from gimbalcal.inversion import invert
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means, dwells
from gimbalcal.units import from_si

FAR = 10.0  # sigmas; heavy tails reach half of it in a hundred recordings
SURPRISE = 1e-6  # probability, rests paid, by which chance is not believed
MOST = 2  # of more, one could not say which rests are the reference
SUSPECTS = 3  # the fit with a stray in it may blame its neighbour
SPARE = 4  # rests beyond the parameters: with fewer, leaving one out tests nothing


@dataclass(frozen=True)
class Stray:
    """A rest: its ordinal among the dwells, its position number, and how far its norm is off [m/s^2]."""

    dwell: int
    position: int
    off: float


def without_strays(recording: Recording) -> tuple[Recording, tuple[Stray, ...]]:
    """The recording without rests whose force is that of no rest, and which these are.

    Their rows are on the way, where rows on the way were logged; else they are gone.
    """
    found = strays(recording)
    if not found or recording.position is None:
        return recording, ()
    visits = dwells(recording)
    rows = np.concatenate([np.arange(visits[s.dwell].start, visits[s.dwell].stop) for s in found])
    if np.any(recording.position == 0):
        position = recording.position.copy()
        position[rows] = 0
        return replace(recording, position=position), found
    return recording.select(np.setdiff1d(np.arange(len(recording.time)), rows)), found


def strays(recording: Recording) -> tuple[Stray, ...]:
    """The rests that are no rests, `MOST` at most; none where the others do not fit each other without them either."""
    every = dwell_means(recording)
    if not np.isfinite(every.triad(FORCE)).all():
        return ()
    left, found = np.arange(len(every.time)), list[Stray]()
    while len(found) <= MOST:
        worst = _worst(every, left)
        if worst is None:
            return tuple(sorted(found, key=lambda s: s.dwell))
        found.append(worst)
        left = left[left != worst.dwell]
    return ()


def _worst(every: Recording, left: Array) -> Stray | None:
    """The rest among those left that is furthest off what the others say; None where none is."""
    if len(left) < len(unknowns(LINEAR)) + SPARE or every.position is None:
        return None
    try:
        fit = norm_fit(scaled_by_gravity(every.select(left))[0], LINEAR)
        order = np.argsort(-np.abs(fit.misfit / fit.slack))[:SUSPECTS]
        tried = [(*_against_others(every, left, int(left[k])), float(fit.slack[k]), int(left[k])) for k in order]
    except InputError:  # nothing to fit here, and the calibration says why
        return None
    off, usual, untied, k = min(tried, key=lambda t: t[1])  # the stray is the one without which the others agree best
    from scipy.special import stdtrit

    least = max(FAR, -float(stdtrit(len(left) - 1 - len(unknowns(LINEAR)), SURPRISE / len(left))))
    return Stray(k, int(every.position[k]), off) if abs(off) * np.sqrt(untied) > least * usual else None


def _against_others(every: Recording, left: Array, k: int) -> tuple[float, float]:
    """Misfit of the norm of rest k to the fit of the others, and what these leave of one another [m/s^2]."""
    scaled, counts = scaled_by_gravity(every.select(left[left != k]))
    fit = norm_fit(scaled, LINEAR)
    one = every.select(np.array([k]))
    y = one.triad(FORCE) if counts is None else counts.to_si(one.triad(FORCE))
    bench = replace(one, platform=BENCH, channels={(FORCE, a): y[:, i] for i, a in enumerate("xyz")})
    s, effects = stimulus_from_readings(bench), fit.effects
    f = invert(lambda f: accelerometers(f, s, effects), y)[0]
    left_over = float(np.sqrt((fit.misfit**2).sum() / max(len(fit.misfit) - len(unknowns(LINEAR)), 1)))
    return float(np.linalg.norm(f)) - every.site.gravity, left_over


def strays_in_words(found: Sequence[Stray]) -> list[str]:
    """One sentence about the rests that were left out, in a list; empty where none was."""
    if not found:
        return []
    worst = max(found, key=lambda s: abs(s.off))
    which = alternatives([str(s.position) for s in found]).replace(" or ", " and ")
    one = len(found) == 1
    size = f"{abs(from_si(worst.off, 'mg')):.3g} mg"
    off = f"off what all others say by {'' if one else 'up to '}{size} of the norm"
    who = f"position {which} is" if one else f"positions {which} are"
    return [f"{who} {off}: no rest, or wrongly numbered or read; left out of the fit"]
