"""Terms of a mount that are estimated: those of the textbooks by default, for the axes that the mount has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.effects import CATALOGUE, Parameter, parameters
from gimbalcal.effects.effect import GIMBALS
from gimbalcal.errors import InputError
from gimbalcal.platform import Platform
from gimbalcal.views.pointing import STAGES

USUAL_TERMS = ("gimbal_zero", "axis_collimation", "gimbal_nonorthogonality", "base_tilt", "tube_flexure")
"""Zeros, collimation, squareness, the tilt of the mount and the sag of the tube: seven terms of a two-axis mount."""


def wanted_parameters(platform: Platform, axes: Sequence[str], terms: Sequence[str]) -> tuple[Parameter, ...]:
    """The unknowns of effects named by id, or of one axis as in "encoder_eccentricity:azimuth", in that order.

    An axis that is not read has no zero and no squareness of its own, and a turn of the base about the outermost read
    axis is the zero of that axis. Raises InputError for what is no effect of a pointing run.
    """
    out: list[Parameter] = []
    for term in terms:
        effect, _, axis = term.partition(":")
        every = _of_effect(platform, axes, effect)
        chosen = [p for p in every if axis in ("", p.axis)]
        if not chosen:
            has = ", ".join(dict.fromkeys(p.axis for p in every if p.axis)) or "no axis"
            raise InputError(f"{effect} has no axis {axis!r} on this mount; it has {has}")
        out += [p for p in chosen if p not in out]
    return tuple(out)


def _of_effect(platform: Platform, axes: Sequence[str], effect: str) -> list[Parameter]:
    cls = CATALOGUE.get(effect)
    if cls is None or "pointing" not in cls.kinds or cls.stage not in STAGES:
        known = ", ".join(sorted(i for i, c in CATALOGUE.items() if "pointing" in c.kinds and c.stage in STAGES))
        raise InputError(f"{effect!r} is no effect of a pointing run; there are {known}")
    every = parameters(cls, platform.axis_names)
    if all(f.metadata.get("axes") == GIMBALS for f in cls.__dataclass_fields__.values() if "sigma" in f.metadata):
        last = axes[-1] if effect == "gimbal_nonorthogonality" else None  # nothing that is read stands outside it
        return [p for p in every if p.axis in axes and p.axis != last]
    if effect == "base_tilt":
        return [p for p in every if p.axis != _about_outer_axis(platform, axes)]
    return list(every)


def _about_outer_axis(platform: Platform, axes: Sequence[str]) -> str:
    """Return which of north, east, down is nearest to the outermost read axis: a turn about it is that axis' zero."""
    i = platform.axis_names.index(axes[-1])
    outside = Platform(platform.name, platform.axes[i + 1 :]).attitude(np.zeros(len(platform.axes) - i - 1))
    along = outside["xyz".index(platform.axes[i].direction)]
    return ("north", "east", "down")[int(np.argmax(np.abs(along)))]
