"""Parameters that the filter estimates: lists of effects for 30 and 51 states, or any other list."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from gimbalcal.effects import CATALOGUE, Parameter, known_effect, parameters
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.effect import constants
from gimbalcal.errors import InputError, list_of_alternatives
from gimbalcal.estimate.extra_effects import PRIOR_FACTOR, ExtraEffect, WhyNotShown

THIRTY = BASELINE["rotation"]
FIFTY_ONE = (*THIRTY, "gyro_g_sensitivity_rate", "quadratic_nonlinearity", "cross_coupling", "accelerometer_lever_arm")
LISTS: Mapping[str, tuple[str, ...]] = {"30": THIRTY, "51": FIFTY_ONE}
# the axes of the unit are defined by its gyroscopes, x along theirs, y in the plane of theirs
KEPT: Mapping[str, tuple[str, ...]] = {
    "gyro_misalignment": ("yz", "zx", "zy"),
    "accelerometer_lever_arm": ("xx", "yy", "zz"),  # along each one's own axis, as Cai et al. (2016), Eqs. (9) to (11)
}
SAME = {"scale_nonlinearity": "quadratic_nonlinearity", "frame_misalignment": "misalignment"}
UNESTIMATED = frozenset(
    (i, p.axis) for i in (*KEPT, *SAME) for p in parameters(CATALOGUE[i]) if p.axis not in KEPT.get(i, ())
)
"""(Effect, axis) that no filter estimates: the axes are defined so, or another effect is the same."""


def states(
    asked: str, why_not: WhyNotShown, more: Sequence[ExtraEffect] = (), option: str = "--states"
) -> tuple[Parameter, ...]:
    """Return the parameters of `--states` 30, 51 or EFFECT[:AXIS],..., and of effects of `--with`.

    option: the name of the option for messages. Raises InputError for unknown effects, and for effects that a rotation
    recording, or this one, does not show.
    """
    named = LISTS.get(asked.strip(), tuple(part.strip() for part in asked.split(",") if part.strip()))
    out: dict[str, Parameter] = {}
    for name in named:
        effect, _, axis = name.partition(":")
        for p in _parameters_of(f"{option} {name}", effect, axis, why_not):
            out[p.label] = p
    for a in more:
        if a.free:
            raise InputError(
                f"--with {a.effect}: a filter cannot carry its constant {a.free[0].name}; state it, --with "
                f"{a.effect},{a.free[0].name}=VALUE"
            )
        for p in a.parameters(()):
            if p.axis in KEPT.get(p.effect, (p.axis,)) or a.axes:
                out[p.label] = replace(p, sigma=p.sigma / PRIOR_FACTOR)  # the catalogue's
    if not out:
        raise InputError(f"{option} {asked}: no effect is named; write 30, 51 or effects of `gimbalcal catalogue`")
    return tuple(out.values())


def _parameters_of(option: str, effect: str, axis: str, why_not: WhyNotShown) -> list[Parameter]:
    if effect.isdigit():
        raise InputError(f"{option}: no list has {effect} states; write 30 or 51, or name the effects")
    cls = known_effect(effect, option)
    if effect in SAME:
        raise InputError(f"{option}: {effect} says what {SAME[effect]} says; write {SAME[effect]}")
    if reason := why_not(cls):
        raise InputError(f"{option}: {effect} {reason}")
    free = constants(cls)
    if free:
        names = list_of_alternatives([f.name for f in free])
        raise InputError(
            f"{option}: {effect} has a constant that no filter can carry ({names}); add it with --with "
            f"{effect},{free[0].name}=VALUE"
        )
    every = parameters(cls)
    kept = [p for p in every if p.axis == axis] if axis else [p for p in every if p.axis in KEPT.get(effect, (p.axis,))]
    if not kept:
        raise InputError(
            f"{option}: {effect} has no axis {axis!r}; it has {list_of_alternatives([p.axis for p in every])}"
        )
    return kept
