"""The true effects of a scenario: fixed values in the units that people read, or drawn from the prior."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values, with_values
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.effect import constants, lacking_quantity
from gimbalcal.effects.grids import range_beyond
from gimbalcal.errors import InputError
from gimbalcal.recording.document import MAX_STATED_NUMBER
from gimbalcal.recording.record import Key
from gimbalcal.simulate.scenario import Scenario
from gimbalcal.units import from_si, to_si

RESERVED = ("draw", "factor")


def true_effects(
    section: Mapping[str, Any], kind: str, gimbals: Sequence[str], read: Sequence[str], rng: np.random.Generator
) -> tuple[Effect, ...]:
    """Return effects of a scenario's [truth].

    `gimbals` are all axes of the platform, `read` those with a readout: only these get a drawn error. Drawing follows
    the order of the baseline and of the file, so a seed means the same truth everywhere.
    """
    factor = _number(section.get("factor", 1.0), "truth.factor")
    wanted: dict[Parameter, float] = {}
    if section.get("draw", False):
        for name in BASELINE[kind]:
            wanted |= _drawn_values(name, gimbals, read, factor, None, rng)
    for name, given in section.items():
        if name not in RESERVED:
            wanted |= _effect(name, given, gimbals, read, factor, rng)
    return with_values((), list(wanted), np.array(list(wanted.values())), gimbals)


def check_shown(effects: Sequence[Effect], scenario: Scenario, environment: Mapping[Key, object]) -> None:
    """Raise InputError for a true effect that a recording of this scenario cannot show."""
    kind, logged = scenario.kind, set() if scenario.schedule.turns else {"position", "attitude"}
    logged |= {"temperature"} if ("temperature", "") in environment else set()
    logged |= {"angular_rate"} if scenario.turning else set()
    names = {name for quantity, name in environment if quantity == "covariate"}
    logged |= {f"covariate:{name}" for name in names} | ({"covariate"} if names else set())
    for each in effects:
        if not each.shows_in(kind):
            raise InputError(f"truth.{each.id}: it shows in {' and '.join(each.kinds)} recordings, not in a {kind}")
        need = lacking_quantity(type(each), logged.__contains__)
        if "angular_rate" in (need, each.channel) and "angular_rate" not in logged:
            raise InputError(f"truth.{each.id}: it shows in angular_rate; write gyroscopes = true")
        if need:
            quantity, _, name = need.partition(":")
            where = f"[environment.covariates.{name or '...'}]" if quantity == "covariate" else f"[environment] {need}"
            raise InputError(f"truth.{each.id}: it needs {need} to act on; give {where}")


def described_truth(effects: Sequence[Effect], gimbals: Sequence[str]) -> list[dict[str, Any]]:
    """Return the truth in the form of calibration.json: name, axis, value in the printed unit, unit; and the effect."""
    out = []
    for each in effects:
        wanted = parameters(type(each), gimbals, constants=True)
        for p, value in zip(wanted, values(effects, wanted), strict=True):
            row = {"name": p.name, "axis": p.axis, "value": float(from_si(float(value), p.unit)), "unit": p.unit}
            out.append(row | {"effect": p.effect})
    return out


def _effect(
    name: str, given: Any, gimbals: Sequence[str], read: Sequence[str], factor: float, rng: np.random.Generator
) -> dict[Parameter, float]:
    where = f"truth.{name}"
    if name not in CATALOGUE:
        raise InputError(f"{where}: no effect has this id; gimbalcal.CATALOGUE lists them")
    if not isinstance(given, Mapping):
        raise InputError(f"{where}: give a table, as in {name} = {{ x = 1.0 }}, got {given!r}")
    given = dict(given)
    out: dict[Parameter, float] = {}
    if given.pop("draw", False):
        sigma = given.pop("sigma", None)
        size = None if sigma is None else _number(sigma, f"{where}.sigma")
        out = _drawn_values(name, gimbals, read, _number(given.pop("factor", factor), f"{where}.factor"), size, rng)
    known = parameters(CATALOGUE[name], gimbals, constants=True)
    return out | dict(_fixed_values(known, given, where))


def _drawn_values(
    name: str, gimbals: Sequence[str], read: Sequence[str], factor: float, sigma: float | None, rng: np.random.Generator
) -> dict[Parameter, float]:
    out = {}
    for p in parameters(CATALOGUE[name], gimbals):
        scale = factor * p.sigma if sigma is None else float(to_si(sigma, p.unit))
        value = scale * float(rng.standard_normal())
        if p.axis not in gimbals or p.axis in read:
            out[p] = value
    return out


def _fixed_values(
    known: Sequence[Parameter], given: Mapping[str, Any], where: str
) -> Iterator[tuple[Parameter, float]]:
    """Return values by axis (of the first parameter), or by parameter: a number for a scalar, a table for axes."""
    first = known[0].field
    for key, value in given.items():
        by_field = [p for p in known if key in (p.field, p.name)]
        if isinstance(value, Mapping) and by_field:
            for axis, number in value.items():
                yield _single_value([p for p in by_field if p.axis == axis], by_field, number, f"{where}.{key}.{axis}")
        elif len(by_field) == 1:
            yield _single_value(by_field, known, value, f"{where}.{key}")
        else:
            yield _single_value(
                [p for p in known if p.axis == key and p.field == first], known, value, f"{where}.{key}"
            )


def _single_value(
    match: Sequence[Parameter], known: Sequence[Parameter], value: Any, where: str
) -> tuple[Parameter, float]:
    if not match:
        choices = dict.fromkeys([p.axis for p in known if p.axis] + [p.field for p in known])
        raise InputError(f"{where}: neither an axis nor a parameter of this effect; it has {', '.join(choices)}")
    p, x = match[0], float(to_si(_number(value, where), match[0].unit))
    for f in constants(CATALOGUE[p.effect]):
        if f.name == p.field and (ends := range_beyond(f, x)):
            raise InputError(f"{where}: {value:g} is outside its range; give {' to '.join(ends)} {p.unit}".rstrip())
    return p, x


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < MAX_STATED_NUMBER:
        raise InputError(f"{where}: must be a finite number, got {value!r:.40}")
    return float(value)
