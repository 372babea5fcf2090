"""Turns between rests as a view: gravity carried by the gyroscopes from one rest to the next, and where it is found.

What the gyroscopes read at rest is taken off, by the neighbouring rests or by a g-sensitivity that the rests support;
so effects that show there are not for this view, and what grows with the rate is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.views import RATE, View
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, parameters, with_values
from gimbalcal.errors import InputError
from gimbalcal.estimate.multiposition import WIDE, multiposition
from gimbalcal.estimate.poses import LINEAR, linear
from gimbalcal.estimate.rest_rates import BIAS, level_of, rests
from gimbalcal.estimate.turned import turns
from gimbalcal.kinematics import stimulus
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwell_means

FEWEST = 12  # turns: twice as many numbers, for nine parameters of the linear model and what is asked beyond


def turned_rates(recording: Recording, accelerometers: Calibration | None = None) -> View | None:
    """The turns of a recording, across gravity; None where there are too few or nothing was logged on the way."""
    if recording.position is None or not np.any(recording.position == 0):
        return None
    made = accelerometers or multiposition(recording, ("bias", "scale_factor", "misalignment"))
    try:
        turned, _, scale = turns(recording, made)
        still = rests(recording, made, scale)
        level = level_of(still, recording.site.latitude, recording.site.gravity, True)[0]
        if len(level.parameters) > len(parameters(CATALOGUE[BIAS])):
            turned = turns(recording, made, level.effects)[0]
    except InputError:
        return None
    if len(turned.before) < FEWEST:
        return None
    sideways = _across(turned.after)

    def rows(effects: Sequence[Effect], wanted: Sequence[Parameter]) -> tuple[Array, Array]:
        r, J = linear(turned, effects, wanted)
        return np.einsum("mci,mi->mc", sideways, r), np.einsum("mci,mip->mcp", sideways, J)

    ends = dwell_means(recording).select(slice(1, None))
    s = stimulus(ends)
    return View(
        "turns", ends, s, ((RATE, "level"), (RATE, "tilted")), "arcsec", None, frozenset({Stage.GYROSCOPE}),
        LINEAR, rows, _at_rest(turned.stimulus), WIDE,
    )  # fmt: skip


def _across(down: Array) -> Array:
    """Two unit vectors (m, 2, 3) across each of `down` (m, 3)."""
    least = np.eye(3)[np.argmin(np.abs(down), axis=-1)]
    first = np.cross(down, least)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(down, first)], axis=1)


def _at_rest(s: Stimulus) -> frozenset[tuple[str, str]]:
    """Parameters of gyroscopes that show where nothing turns: the rests before and after have taken them off."""
    still = s.at(rate=0 * s.rate)
    out = set()
    for cls in CATALOGUE.values():
        if cls.stage is Stage.GYROSCOPE and (s.temperature is not None or "temperature" not in cls.requires):
            for p in parameters(cls):
                effect = with_values((), (p,), np.array([p.sigma]))[0]
                if np.any(effect.contribution(still) != 0):
                    out.add((p.effect, p.axis))
    return frozenset(out)
