"""Turns between rests as a view: gravity carried by the gyroscopes from one rest to the next, and where it is found.

What the gyroscopes read at rest is taken off, by the neighbouring rests or by a g-sensitivity that the rests support;
so effects that show there are not for this view, and what grows with the rate is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.rows.observations import absent_effect
from gimbalcal.diagnose.rows.views import RATE, View
from gimbalcal.effects import CATALOGUE, Effect, Stimulus, parameters, with_values
from gimbalcal.effects.baseline import BASELINE
from gimbalcal.effects.effect import GYROSCOPE_STAGES, follows, lacking
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.multiposition import WIDE, multiposition
from gimbalcal.estimate.gyroscopes.between_rests import rows_of_turns
from gimbalcal.estimate.gyroscopes.rests import BIAS, level_of, rests
from gimbalcal.estimate.gyroscopes.turns import Turns, turns_between_rests
from gimbalcal.forward import Rows
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwell_means, dwells
from gimbalcal.rotation import normal_to

BACK = 0.01  # of the attitude's elements: gimbals that stand where they stood
FEWEST = 12  # turns: twice as many numbers, for nine parameters of the linear model and what is asked beyond


def view_of_turns(recording: Recording, accelerometers: Calibration | None = None) -> View | None:
    """The turns of a recording, across gravity; None where there are too few or nothing was logged on the way."""
    if recording.position is None or not np.any(recording.position == 0):
        return None
    made = accelerometers or multiposition(recording, BASELINE["norm"])
    try:
        turns, _, scale = turns_between_rests(recording, made)
        still = rests(recording, made, scale)
        level = level_of(still, recording.site.latitude, recording.site.gravity, True)[0]
        if len(level.parameters) > len(parameters(CATALOGUE[BIAS])):
            turns = turns_between_rests(recording, made, level.effects)[0]
    except InputError:
        return None
    if len(turns.before) < FEWEST:
        return None
    turns = _with_headings(turns, made.apply(recording))
    sideways = _across(turns.after)

    def rows(effects: Sequence[Effect]) -> Rows:
        return rows_of_turns(turns, effects).reduced(lambda X: np.einsum("mci,mip->mcp", sideways, X))

    ends = dwell_means(recording).select(turns.ends)
    s = stimulus_from_readings(ends)
    return View(
        "turns", ends, s, ((RATE, "level"), (RATE, "tilted")), "arcsec", None, GYROSCOPE_STAGES,
        BASELINE["turns"], rows, _at_rest(turns.stimulus), WIDE,
    )  # fmt: skip


def _with_headings(turns: Turns, recording: Recording) -> Turns:
    """Whole revolutions as gimbals tell them: gravity says nothing of a turn about it, so north stands for it there.

    The gimbals came back, so a constant error of theirs cancels.
    """
    if not recording.platform.axes:
        return turns
    stays = dwells(recording)
    C_np = recording.platform.attitude(np.array([recording.angles()[d.rows].mean(0) for d in stays]))
    start, end = C_np[turns.ends - 1], C_np[turns.ends]
    back = np.linalg.norm(end - start, axis=(1, 2)) < BACK
    turn = np.linalg.norm((turns.reading * turns.step[..., None]).sum(1), axis=1)
    whole = (back & (turn > np.pi))[:, None]
    return replace(
        turns, before=np.where(whole, start[:, :, 0], turns.before),
        after=np.where(whole, end[:, :, 0], turns.after),
    )  # fmt: skip


def _across(down: Array) -> Array:
    """Two unit vectors (m, 2, 3) across each of `down` (m, 3)."""
    first = normal_to(down)
    return np.stack([first, np.cross(down, first)], axis=1)


def _at_rest(s: Stimulus) -> frozenset[tuple[str, str]]:
    """Parameters of gyroscopes that show where nothing turns: the rests before and after have taken them off."""
    still = s.at(rate=0 * s.rate)
    out = set()
    for cls in CATALOGUE.values():
        if cls.stage in GYROSCOPE_STAGES and not lacking(cls, s.carries):
            followed = next(iter(s.covariates)) if follows(cls) == "" else ""
            none = absent_effect(cls.id, s, followed)
            for p in parameters(cls, s.axis_names):
                effect = with_values([none], (p,), np.array([p.sigma]), s.axis_names)[0]
                if np.any(effect.contribution(still) != 0):
                    out.add((p.effect, p.axis))
    return frozenset(out)
