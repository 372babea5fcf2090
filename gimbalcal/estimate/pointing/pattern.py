r"""Patterns in the residuals of stars: they follow an angle of the mount, or a star is far off the others.

Neighbours along an angle are alike where something follows it,

.. math:: V = \frac{\sum_i (r_{i+1} - r_i)^2}{\sum_i r_i^2}, \qquad
          z = \frac{2 - V}{\sqrt{4 / n}} \sim N(0, 1) \text{ of noise, } r \text{ in the order of the angle}

Both directions on the sky against both axes are four trials. Source: von Neumann, Annals of Mathematical Statistics 12
(1941) 367.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.calibration.provenance import FarStar, ResidualPattern
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.estimate.pointing.fit import weighted_residual
from gimbalcal.number import Array
from gimbalcal.p_value import SIGNIFICANCE
from gimbalcal.units import from_si
from gimbalcal.views.core import View
from gimbalcal.views.pointing import CHANNELS

MIN_TRAVEL_RAD = 1e-3  # rad; an axis that travels less stood still
MIN_STARS = 20  # stars in which a pattern can be distinguished from chance
MIN_OUTLIER_SIGMAS = 7.0  # robust sigmas; a star further off is another star, or was not centred
MISTAKEN = "mistaken or not centred"
MIN_COMMON_STARS = 3  # such stars, of which something in common can be stated
MAX_CROSS_SHARE = 0.2  # of the distance, off in the other direction, where one axis of the mount does it
COMMON_SIGNIFICANCE = 0.01  # probability below which such stars do not have it in common by chance
MEDIAN_LENGTH = (0.6745, 1.1774)  # of a number, and of a vector of two (Rayleigh), of normal noise with sigma 1


def far_off(fitted: ViewsFit, before: Sequence[int]) -> tuple[FarStar, ...]:
    """Return the stars far off the others, worst first.

    before: how many stars of the same recording come before each run, which is one night of it.
    """
    parts, axes = weighted_residual(fitted), fitted.views[0].stimulus.axis_names
    runs = zip(fitted.views, before, parts, strict=True)
    every = [(v.title, k + n, d) for v, k, r in runs for n, d in enumerate(np.linalg.norm(r, axis=1).tolist(), 1)]
    residual = np.concatenate(parts)
    at = np.concatenate([_true_angles(v)[:, : residual.shape[1]] for v in fitted.views])
    far = outlying_stars(residual)
    why = why_far(residual, at, far, axes[0])
    return tuple(FarStar(title, n, float(from_si(d, "arcsec")), why) for title, n, d in (every[k] for k in far))


def outlying_stars(residual: Array) -> list[int]:
    """Ordinals of stars far off the others by what is left of them (n, C), worst first."""
    length = np.linalg.norm(residual, axis=1)
    if len(length) < MIN_STARS:
        return []
    far = np.flatnonzero(length > MIN_OUTLIER_SIGMAS * float(np.median(length)) / MEDIAN_LENGTH[residual.shape[1] - 1])
    return sorted(far.tolist(), key=lambda k: -float(length[k]))


def why_far(residual: Array, angles: Array, far: Sequence[int], axis: str) -> str:
    """Explain why stars are far off the others: mistakes, unless they have more in common than chance gives them.

    residual (n, 2): of every star; angles (n, 2) [rad]: where it is, inner and outer; far: ordinals of those;
    axis: the inner one. A mistaken star is off any way, and anywhere; a gear that plays, or an axis that slips, moves
    one axis alone. A mount of a single axis, (n, 1), cannot show the difference.
    """
    if angles.shape[1] == 1:
        return MISTAKEN
    inner, outer = angles.T
    every = np.stack([np.cos(inner) * np.cos(outer), np.cos(inner) * np.sin(outer), np.sin(inner)], axis=-1)
    residual, star = residual[far], every[far]
    if len(residual) < MIN_COMMON_STARS:
        return MISTAKEN
    other = np.abs(residual) / np.linalg.norm(residual, axis=1, keepdims=True)
    chance = len(CHANNELS) * (2 / np.pi * np.arcsin(MAX_CROSS_SHARE)) ** len(residual)
    for (_, way), off in zip(CHANNELS, other[:, ::-1].T, strict=True):
        if np.all(off < MAX_CROSS_SHARE) and chance < COMMON_SIGNIFICANCE:
            plain = axis.replace("_", " ")
            return f"all {way} {plain}, so rather play in a gear, or a slip of the axis, than mistakes"
    closeness = (star @ star.T).min(axis=1)  # cosine of the furthest of them from each
    share = float(np.mean(every @ star[int(np.argmax(closeness))] >= closeness.max()))
    together = len(star) * share ** (len(star) - 1) < COMMON_SIGNIFICANCE
    return "all in one part of the sky, so rather what the model lacks there than mistakes" if together else MISTAKEN


def clearest_pattern(fitted: ViewsFit, axes: Sequence[str]) -> ResidualPattern | None:
    """The clearest pattern of what a fit leaves over the true angles of its axes; None where noise may look so."""
    from scipy.special import ndtr

    residual = np.concatenate(weighted_residual(fitted))
    if len(residual) < MIN_STARS:
        return None
    trials = []
    for axis in axes:
        k = fitted.views[0].stimulus.axis_names.index(axis)
        angle = np.concatenate([_true_angles(v)[:, k] for v in fitted.views])
        if np.ptp(angle) < MIN_TRAVEL_RAD:
            continue
        order = np.argsort(angle, kind="stable")
        for (_, channel), r in zip(fitted.views[0].channels, residual[order].T, strict=True):
            alike = 2 - (np.diff(r) ** 2).sum() / max(float((r**2).sum()), 1e-300)
            trials.append(ResidualPattern(channel, axis, float(ndtr(-alike / np.sqrt(4 / len(r))))))
    if not trials:
        return None
    best = min(trials, key=lambda t: t.probability)
    p = min(1.0, len(trials) * best.probability)
    return ResidualPattern(best.channel, best.axis, p) if p < SIGNIFICANCE else None


def _true_angles(v: View) -> Array:
    """Return the angles (n, k) [rad] at which an ideal mount is on its stars."""
    assert v.stimulus.true_angle is not None
    return v.stimulus.true_angle
