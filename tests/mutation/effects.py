"""Every effect falsified: does its independent number notice?"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Stimulus, accelerometer, gyroscope, parameters, values, with_values
from gimbalcal.effects.effect import Stage
from gimbalcal.number import Array
from tests.effects.stimulus import GIMBALS, example, given
from tests.effects.test_dynamics import EXACT, REMEMBER, off_its_states
from tests.effects.test_laws import off_its_law
from tests.mutation.rewrite import Mutant, mutants

Contribution = Callable[[Effect, Stimulus], Array]
QUANTITIES = (
    "force", "rate", "angle", "move_force", "earlier_move_force", "move_angle", "temperature", "load", "attitude",
)  # fmt: skip
SHARED = ("accelerometer", "false_rate", "history")  # modules whose functions other modules call
MODULES = sorted({cls.__module__.rsplit(".", 1)[1] for cls in CATALOGUE.values()} | set(SHARED))
NOTICED = 1e-12


def copied(cls: type[Effect], contribution: Contribution) -> type[Effect]:
    """The class with another contribution, beside it: the catalogue and its cards know nothing of it."""
    inside = {k: v for k, v in vars(cls).items() if k not in {"__dict__", "__weakref__"}}
    return type(cls.__name__, cls.__bases__, {**inside, "contribution": contribution})


def falsified(name: str) -> dict[str, type[Effect]]:
    """Mutants of an effect by what was done to it: nothing added, sign, size, axes, and every power it has."""
    cls = CATALOGUE[name]
    out: dict[str, Contribution] = {
        "returns zero": lambda e, s: 0 * cls.contribution(e, s),
        "has the other sign": lambda e, s: -cls.contribution(e, s),
        "is a thousandth larger": lambda e, s: 1.001 * cls.contribution(e, s),
        "has its axes rolled": lambda e, s: np.roll(cls.contribution(e, s), 1, axis=1),
        "has its parameters squared": lambda e, s: cls.contribution(_parameters_squared(e), s),
    }
    if cls.stage is Stage.AXIS_TILT:
        out["has its directions rolled"] = lambda e, s: np.roll(cls.contribution(e, s), 1, axis=-1)
    for what, changed in _powers(name).items():
        out[f"takes {what}"] = lambda e, s, changed=changed: cls.contribution(e, changed(s))  # type: ignore[misc]
    return {what: copied(cls, contribution) for what, contribution in out.items()}


def _parameters_squared(e: Effect) -> Effect:
    wanted = parameters(type(e), GIMBALS)
    x = values([e], wanted)
    sigma = np.array([p.sigma for p in wanted])
    return with_values([e], wanted, x * np.abs(x) / sigma)[0]


def _powers(name: str) -> dict[str, Callable[[Stimulus], Stimulus]]:
    """Changes of the stimulus to which the effect answers: each quantity with another exponent, time too."""
    s, made = given(), example(name)
    clean = made.contribution(s)
    every: dict[str, Callable[[Stimulus], Stimulus]] = {
        f"{field} by another power": lambda s, field=field: s.at(**{field: _bent(getattr(s, field))})  # type: ignore[misc]
        for field in QUANTITIES
    }
    every["time by another power"] = lambda s: s.at(time=s.time**2 / s.time[-1])
    every["time in the dwell by another power"] = lambda s: s.at(since_move=s.since_move**2 / 900.0)
    every["the channels by another power"] = lambda s: s.at(covariates={k: _bent(v) for k, v in s.covariates.items()})
    every["force of another axis"] = lambda s: s.at(force=np.roll(s.force, 1, axis=1))
    every["rate of another axis"] = lambda s: s.at(rate=np.roll(s.rate, 1, axis=1))
    return {what: change for what, change in every.items() if np.abs(made.contribution(change(s)) - clean).max() > 0}


def _bent(x: Array | None) -> Array | None:
    """x |x|, in units of its own size."""
    return None if x is None else np.asarray(x * np.abs(x) / np.abs(x).max())


def survivors(names: Mapping[str, Any] = CATALOGUE, one: bool = False) -> Iterator[str]:
    """Mutants of effects that their independent number does not notice; with `one`, one mutant of each, by turns."""
    for turn, name in enumerate(sorted(names)):
        made = list(falsified(name).items())
        for what, cls in [made[turn % len(made)]] if one else made:
            if not off_its_law(name, cls) > NOTICED:
                yield f"{name} {what}"


def rewritten(terms: int = 1) -> Iterator[Mutant]:
    """So many changed terms, one at a time, in every equation of the effects' modules."""
    for module in MODULES:
        yield from mutants(f"gimbalcal.effects.{module}", terms)


def users(mutant: Mutant) -> list[str]:
    """The effects that can show a change of a module: its own, and all where others use it."""
    shared = mutant.module.rsplit(".", 1)[1] in SHARED
    return [n for n, cls in sorted(CATALOGUE.items()) if shared or cls.__module__ == mutant.module]


def is_noticed(mutant: Mutant) -> bool:
    """Whether any effect's number leaves its law while the mutant is in place, or a matrix of a triad its inverse."""
    before = mutant.install()
    try:
        return any(not _holds(name) for name in users(mutant)) or not _matrices_agree()
    finally:
        before()


def _holds(name: str) -> bool:
    try:
        return off_its_law(name) <= NOTICED and (name not in REMEMBER or off_its_states(name) <= EXACT)
    except Exception:  # noqa: BLE001 - a mutant that cannot even be evaluated is noticed
        return False


def _matrices_agree() -> bool:
    """Whether the matrix of a triad leans as a misalignment does, and its inverse gives the constants back."""
    s, beta, rate = 1e-3 * np.arange(1.0, 4.0), 1e-3 * np.arange(1.0, 7.0), np.array([0.3, -0.5, 0.7])
    try:
        M = gyroscope.rate_matrix(s, beta)
        leans = np.abs((1 + s) * (M @ rate) - rate - accelerometer.misalignment_error(beta, rate)).max() < NOTICED
        return bool(leans and np.abs(np.concatenate(gyroscope.of_rate_matrix(M)) - np.append(s, beta)).max() < NOTICED)
    except Exception:  # noqa: BLE001 - a mutant that cannot even be evaluated is noticed
        return False
