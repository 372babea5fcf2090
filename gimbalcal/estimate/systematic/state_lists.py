"""Which parameters the filter carries: 30 and 51 states are two lists of effects, and any other list is a third."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches

from gimbalcal.effects import CATALOGUE, Parameter, parameters
from gimbalcal.effects.baseline import BASELINE
from gimbalcal.effects.effect import constants
from gimbalcal.errors import InputError, alternatives
from gimbalcal.estimate.added import Added, unfit
from gimbalcal.recording import Recording

THIRTY = BASELINE["rotation"]
FIFTY_ONE = (
    *THIRTY,
    "gyro_g_sensitivity_rate",
    "quadratic_nonlinearity",
    "cross_coupling",
    "accelerometer_lever_arm",
)
LISTS: Mapping[str, tuple[str, ...]] = {"30": THIRTY, "51": FIFTY_ONE}
# the block is defined by its gyroscopes: x along theirs, y in the plane of theirs; the others only turn it
KEPT: Mapping[str, tuple[str, ...]] = {
    "gyro_misalignment": ("yz", "zx", "zy"),
    "accelerometer_lever_arm": ("xx", "yy", "zz"),  # along each one's own axis, as Cai et al. (2016), Eqs. (9) to (11)
}
SAME = {"scale_nonlinearity": "quadratic_nonlinearity", "frame_misalignment": "misalignment"}


def states(
    asked: str, recording: Recording, more: Sequence[Added] = (), option: str = "--states"
) -> tuple[Parameter, ...]:
    """The parameters of `--states` 30, 51 or EFFECT[:AXIS],..., and of effects that were added.

    option: by which they were asked for, as refusals say it. Raises InputError for what is no effect, cannot show in a
    rotation recording, or lacks what it needs there.
    """
    named = LISTS.get(asked.strip(), tuple(part.strip() for part in asked.split(",") if part.strip()))
    out: dict[tuple[str, str, str], Parameter] = {}
    for said in named:
        effect, _, axis = said.partition(":")
        for p in _of(f"{option} {said}", effect, axis, recording):
            out[p.effect, p.field, p.axis] = p
    for a in more:
        if a.free:
            raise InputError(
                f"--with {a.effect}: a filter cannot carry its constant {a.free[0].name}; state it, --with "
                f"{a.effect},{a.free[0].name}=VALUE"
            )
        for p in a.parameters(()):
            if p.axis in KEPT.get(p.effect, (p.axis,)) or a.axes:
                out[p.effect, p.field, p.axis] = replace(p, sigma=_sigma(p))
    if not out:
        raise InputError(f"{option} {asked}: no effect is named; write 30, 51 or effects of `gimbalcal catalogue`")
    return tuple(out.values())


def _sigma(p: Parameter) -> float:
    """The catalogue's prior scale."""
    return next(q.sigma for q in parameters(CATALOGUE[p.effect]) if (q.field, q.axis) == (p.field, p.axis))


def _of(said: str, effect: str, axis: str, recording: Recording) -> list[Parameter]:
    if effect not in CATALOGUE:
        near = get_close_matches(effect, CATALOGUE, 1)
        if effect.isdigit():
            raise InputError(f"{said}: no list has {effect} states; write 30 or 51, or name the effects")
        hint = f"did you mean {near[0]}?" if near else "`gimbalcal catalogue` lists them"
        raise InputError(f"{said}: no effect is called {effect!r}; {hint}")
    if effect in SAME:
        raise InputError(f"{said}: {effect} says what {SAME[effect]} says; write {SAME[effect]}")
    cls = CATALOGUE[effect]
    reason = unfit(cls, recording)
    if reason:
        raise InputError(f"{said}: {effect} {reason}")
    free = constants(cls)
    if free:
        names = alternatives([f.name for f in free])
        raise InputError(
            f"{said}: {effect} has a constant that no filter can carry ({names}); add it with --with "
            f"{effect},{free[0].name}=VALUE"
        )
    every = parameters(cls)
    kept = [p for p in every if p.axis == axis] if axis else [p for p in every if p.axis in KEPT.get(effect, (p.axis,))]
    if not kept:
        raise InputError(f"{said}: {effect} has no axis {axis!r}; it has {alternatives([p.axis for p in every])}")
    return kept
