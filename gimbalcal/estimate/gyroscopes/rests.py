r"""Gyroscopes at rest: bias, and what gravity does to them, from the mean outputs of dwells.

Dwells may scatter beyond the noise of their means, as a wandering bias does; how far is estimated with the effects, for
each axis. See `views.rest_rates` for the rows, and what of the Earth's rate is a nuisance of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Parameter, parameters, with_values
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension
from gimbalcal.estimate.fit import LEAST_SIGNAL, ViewsFit, fit
from gimbalcal.estimate.gyroscopes.turn_fit import linear_effects
from gimbalcal.estimate.term_selection import coefficients, needed, refusal
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.views.core import View
from gimbalcal.views.rest_rates import rest_rates
from gimbalcal.views.swept_rotations import swept
from gimbalcal.views.turns import Turns, logged_turns

BIAS, G_SENSITIVITY = "gyro_bias", "gyro_g_sensitivity_rate"
MIN_DWELLS = 6  # four unknowns an axis, and something to test them on


def rests(recording: Recording, accelerometers: Calibration, scale: float = 1.0, turns: Turns | None = None) -> View:
    """Return the dwells of a recording, joined by turns that were logged as their linear model carries the heading."""
    carried: dict[int, Array] = {}
    if turns is not None and not recording.platform.axes and logged_turns(recording):
        carried = dict(zip(turns.ends.tolist(), swept(turns, linear_effects(turns)), strict=True))
    return rest_rates(recording, accelerometers, scale, carried)


def fit_rests(
    still: View, terms: Sequence[str] = (BIAS, G_SENSITIVITY), extra: Extension = NO_EXTENSION
) -> ViewsFit:  # fmt: skip
    """Fit gyroscope effects to dwells, with a scatter of each axis beyond the samples'."""
    wanted = (*(p for t in terms for p in parameters(CATALOGUE[t])), *extra.parameters)
    return fit([still], wanted, extra.effects, min_signal=LEAST_SIGNAL, significance=0.0)


def level_of(still: View, g_sensitivity: bool, tried: int = 0, extra: Extension = NO_EXTENSION) -> tuple[ViewsFit, str]:
    """Bias, and g-sensitivity if the dwells support it; the second value says why not, if they do not.

    tried: coefficients that were asked for in all, those of the g-sensitivity with them (left out: these alone); extra:
    effects that are fitted in any case.
    """
    plain = fit_rests(still, (BIAS,), extra)
    if not g_sensitivity:
        return plain, ""
    data = f"{len(still)} rests"
    if len(still) < MIN_DWELLS:
        return plain, f"{G_SENSITIVITY} is left out: {data} are too few for it"
    full = fit_rests(still, (BIAS, G_SENSITIVITY), extra)
    clear_of = needed(tried or coefficients([G_SENSITIVITY]), full.dof_of_scatter)
    why = refusal(G_SENSITIVITY, data, full.parameters, full.x, full.sigmas, (plain.left_out_rms, full.left_out_rms),
                  "rad/s", (plain.condition, full.condition), clear_of)  # fmt: skip
    return (plain, why) if why else (full, "")


def by_motion(extra: Extension, still: View) -> tuple[Extension, Extension]:
    """The part of extra effects that shows in what a unit at rest reads, and the part that only turning shows.

    A constant belongs to the rests where its effect has a size that shows there.
    """
    by_id = {e.id: e for e in extra.effects}

    def shows(p: Parameter) -> bool:
        (probe,) = with_values([by_id[p.effect]], (p,), np.array([p.sigma]))
        return bool(np.any(probe.contribution(still.stimulus) != 0))

    sizes = [p for p in extra.parameters if p not in extra.constants]
    at_rest = {p for p in sizes if shows(p)}
    at_rest |= {c for c in extra.constants if any(p.effect == c.effect for p in at_rest)}
    rest, moving = (tuple(p for p in extra.parameters if (p in at_rest) is still) for still in (True, False))
    return Extension(extra.effects, rest), Extension(extra.effects, moving)
