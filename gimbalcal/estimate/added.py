"""Effects of the catalogue that a user adds to a fit by name, `--with EFFECT[:AXIS][,CONSTANT=VALUE]`.

Their linear parameters join the fit under a prior so wide that it holds nothing back. A non-linear constant (a time
constant, an order) takes the value that is stated, in the unit of the catalogue, or else the one of the catalogue's
grid that fits best, refined; its sigma is that of the curvature of chi^2 there.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, absent, parameters
from gimbalcal.effects.effect import Grid, constants, follows, lacking
from gimbalcal.effects.grids import Constant, between, grid, kind, limits
from gimbalcal.errors import InputError
from gimbalcal.recording import Recording
from gimbalcal.units import from_si, to_si

WIDE = 100.0  # times the catalogue's prior: what is asked for is fitted, not held
ROUNDS, FINE = 3, 5  # refinements of a constant, and values in each, before a parabola goes through three


@dataclass(frozen=True)
class Added:
    """One effect to add: its axes (none: all of them), stated constants in SI, and the channel that it follows."""

    effect: str
    axes: tuple[str, ...] = ()
    stated: tuple[tuple[str, float], ...] = ()
    covariate: str = ""

    def parameters(self, gimbals: Sequence[str]) -> tuple[Parameter, ...]:
        """Its linear parameters on a platform with these gimbals, under a wide prior."""
        every = parameters(CATALOGUE[self.effect], gimbals)
        return tuple(replace(p, sigma=WIDE * p.sigma) for p in every if not self.axes or _belongs(p, self.axes))

    def absent(self, gimbals: Sequence[str], values: Mapping[str, float]) -> Effect:
        """The effect with zero parameters and these constants."""
        named: dict[str, Any] = {**values, **({"covariate": self.covariate} if self.covariate else {})}
        return replace(absent(CATALOGUE[self.effect], gimbals), **named)

    @property
    def free(self) -> tuple[Constant, ...]:
        """Constants that nobody stated."""
        said = dict(self.stated)
        return tuple(f for f in constants(CATALOGUE[self.effect]) if f.name not in said)


def added(words: Sequence[str], recordings: Sequence[Recording], held: Sequence[str] = ()) -> tuple[Added, ...]:
    """What these words ask for; `held`: effects that the model has anyway.

    Raises InputError for a misspelt effect, axis or constant, and for an effect that none of the recordings can show.
    """
    out: dict[str, Added] = {}
    for said in words:
        name, *settings = (part.strip() for part in said.split(","))
        effect, _, axis = name.partition(":")
        made = _one(said, effect, axis, dict(_setting(said, s) for s in settings), recordings, held)
        before = out.get(effect)
        if before is not None:
            axes = (*before.axes, *made.axes) if before.axes and made.axes else ()
            made = replace(made, axes=axes, stated=tuple(dict([*before.stated, *made.stated]).items()))
        out[effect] = made
    return tuple(out.values())


def _setting(said: str, setting: str) -> tuple[str, str]:
    constant, equals, value = setting.partition("=")
    if not equals:
        raise InputError(f"--with {said}: {setting!r} is no CONSTANT=VALUE; write EFFECT[:AXIS][,CONSTANT=VALUE]")
    return constant.strip(), value


def _one(
    said: str, effect: str, axis: str, settings: Mapping[str, str], recordings: Sequence[Recording],
    held: Sequence[str],
) -> Added:  # fmt: skip
    if effect not in CATALOGUE:
        near = get_close_matches(effect, CATALOGUE, 1)
        hint = f"did you mean {near[0]}?" if near else "`gimbalcal catalogue` lists them"
        raise InputError(f"--with {said}: no effect is called {effect!r}; {hint}")
    if effect in held:
        raise InputError(f"--with {said}: {effect} is in the model of this method anyway; leave it out")
    cls = CATALOGUE[effect]
    reasons = [unfit(cls, r) for r in recordings]
    if all(reasons):
        raise InputError(f"--with {said}: {effect} {reasons[0]}")
    gimbals = recordings[0].platform.axis_names
    every = parameters(cls, gimbals)
    if not every:
        raise InputError(f"--with {said}: {effect} is of gimbals, and {recordings[0].title!r} has none")
    made = Added(effect, (axis,) if axis else (), _stated(said, cls, settings), _followed(said, cls, recordings))
    if not made.parameters(gimbals):
        axes = ", ".join(dict.fromkeys(p.axis for p in every if p.axis)) or "no axes"
        raise InputError(f"--with {said}: {effect} has no axis {axis!r}; it has {axes}")
    return made


def unfit(cls: type[Effect], recording: Recording) -> str:
    """Why a recording cannot show an effect, to be said after its name; empty where it can."""
    if recording.kind not in cls.kinds:
        kinds = " and ".join(cls.kinds)
        return f"shows in {kinds} recordings, and {recording.title!r} is a {recording.kind} recording"
    missing = lacking(cls, recording.has)
    return f"needs {missing}, and {recording.title!r} has none" if missing else ""


def _stated(said: str, cls: type[Effect], settings: Mapping[str, str]) -> tuple[tuple[str, float], ...]:
    known = {f.name: f for f in constants(cls)}
    out = []
    for name, text in settings.items():
        if name not in known:
            has = ", ".join(f"{f.name} [{f.metadata['unit']}]" for f in known.values()) or "none"
            raise InputError(f"--with {said}: {cls.id} has no constant {name!r}; it has {has}")
        f = known[name]
        try:
            value = float(to_si(float(text), f.metadata["unit"]))
        except ValueError:
            raise InputError(f"--with {said}: {name} must be a number in {f.metadata['unit']}, got {text!r}") from None
        low, high = float(f.metadata["low"]), float(f.metadata["high"])
        if not low <= value <= high:
            least, most = (f"{float(from_si(v, f.metadata['unit'])):g}" for v in (low, high))
            raise InputError(f"--with {said}: {name} lies between {least} and {most} {f.metadata['unit']}")
        out.append((name, value))
    return tuple(out)


def _followed(said: str, cls: type[Effect], recordings: Sequence[Recording]) -> str:
    """The one covariate that is there, for an effect that follows any of them."""
    if follows(cls) != "":
        return ""
    logs = list(dict.fromkeys(a for r in recordings for a in r.axes("covariate")))
    if len(logs) != 1:
        raise InputError(f"--with {said}: {cls.id} follows one covariate, and there are {len(logs)}: keep one column")
    return logs[0]


def _belongs(p: Parameter, axes: Sequence[str]) -> bool:
    """Whether a parameter is of one of these axes: "xy" is x's, "equatorial_x" is equatorial."""
    pair = len(p.axis) == 2 and set(p.axis) <= set("xyz")
    return any(a in (p.axis, p.axis[0] if pair else p.axis.rpartition("_")[0] or p.axis) for a in axes)


Beside = tuple[tuple[Parameter, ...], tuple[Effect, ...]]
"""Parameters of added effects, and these effects, absent, with their constants."""

Cost = Callable[[Sequence[Effect]], float]
"""Chi^2 of the best fit with these absent effects' parameters free."""


def with_constants(
    more: Sequence[Added], s: Stimulus, cost: Cost
) -> tuple[tuple[Effect, ...], dict[Parameter, tuple[float, float]]]:
    """The absent effects with the constants that fit best, and each constant's value and sigma in SI.

    One effect after the other, the others at what they have: constants of two effects are rarely confounded.
    """
    chosen: dict[str, dict[str, float]] = {a.effect: {**_first(a, s), **dict(a.stated)} for a in more}

    def made(trial: Mapping[str, Mapping[str, float]]) -> tuple[Effect, ...]:
        return tuple(a.absent(s.axis_names, trial[a.effect]) for a in more)

    sigma: dict[tuple[str, str], float] = {}
    for a in (a for a in more if a.free):

        def missed(values: Mapping[str, float], effect: str = a.effect) -> float:
            return cost(made({**chosen, effect: {**chosen[effect], **values}}))

        each = [_tried(f, s) for f in a.free]
        tried = [dict(zip((f.name for f in a.free), v, strict=True)) for v in itertools.product(*each)]
        misfits = [missed(t) for t in tried]
        chosen[a.effect] |= tried[int(np.argmin(misfits))]
        for f, values in zip(a.free, each, strict=True):
            if not (kind(f).counts or kind(f).once):
                chosen[a.effect][f.name], sigma[a.effect, f.name] = _refined(f, values, chosen[a.effect], s, missed)
    told = {}
    for a in more:
        every = {p.field: p for p in parameters(CATALOGUE[a.effect], s.axis_names, constants=True)}
        for f in constants(CATALOGUE[a.effect]):
            told[every[f.name]] = (chosen[a.effect][f.name], sigma.get((a.effect, f.name), 0.0))
    return made(chosen), told


def _tried(f: Constant, s: Stimulus) -> list[float]:
    """Values of a constant that are held against each other: every whole number, as nothing lies between two."""
    if kind(f) is Grid.WHOLE:
        low, high = limits(f, s)
        return np.arange(low, high + 0.5).tolist()
    return grid(f, s).tolist()


def _first(a: Added, s: Stimulus) -> dict[str, float]:
    return {f.name: float(np.median(grid(f, s))) for f in a.free}


def _refined(
    f: Constant, values: Sequence[float], here: Mapping[str, float], s: Stimulus,
    missed: Callable[[Mapping[str, float]], float],
) -> tuple[float, float]:  # fmt: skip
    """A constant between its neighbours on the grid, and one sigma from three values of chi^2 about the best."""
    best = here[f.name]
    at = values.index(best)
    low, high = values[max(at - 1, 0)], values[min(at + 1, len(values) - 1)]
    bounds = limits(f, s)
    for _ in range(ROUNDS):
        fine = np.clip(between(f, low, high, FINE), *bounds)
        costs = [missed({f.name: float(v)}) for v in fine]
        k = int(np.argmin(costs))
        best, low, high = float(fine[k]), float(fine[max(k - 1, 0)]), float(fine[min(k + 1, len(fine) - 1)])
    step = 0.05 * (abs(best) or bounds[1] - bounds[0])
    below, middle, above = (missed({f.name: best + k * step}) for k in (-1, 0, 1))
    bend = below - 2 * middle + above
    if bend <= 0:  # at the end of its range
        return best, 0.0
    shift = float(np.clip((below - above) / 2 / bend, -1, 1)) * step
    return float(np.clip(best + shift, *bounds)), float(np.sqrt(2 * step**2 / bend))


def with_told(made: Calibration, told: Mapping[Parameter, tuple[float, float]]) -> Calibration:
    """The calibration with the constants of its effects among its parameters."""
    n, sigma = len(made.parameters), [e for _, e in told.values()]
    P = np.zeros((n + len(told), n + len(told)))
    P[:n, :n] = made.covariance
    P[range(n, len(P)), range(n, len(P))] = np.square(sigma)
    return replace(made, parameters=(*made.parameters, *told), covariance=P)
