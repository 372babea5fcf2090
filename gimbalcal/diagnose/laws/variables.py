"""What a law that no catalogue holds may follow: the variables of a recording, or of several, by name."""

from __future__ import annotations

import keyword
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.effects import Stimulus
from gimbalcal.effects.history import smoothed_rate
from gimbalcal.number import Array
from gimbalcal.units import from_si

CENTRED_GROUPS = ("time", "logged")  # groups without a natural zero: powers are of the difference from the middle
MIN_VARIATION = {"force": 0.1, "angle": 1e-2, "rate": 1e-2, "move": 0.1}  # SI: what varies less stands still
RESERVED = frozenset(("S", "N", "I", "E", "O", "Q", "pi", "beta", "gamma", "zeta"))  # names that sympy reads otherwise
LETTER = re.compile("([a-z]|tau|x0|phi|level)[0-9]?")  # what coefficients and constants are called


@dataclass(frozen=True, eq=False)
class Variable:
    """What a law may follow: its name and unit in print, values in SI, how law.py takes it from a stimulus `s`.

    x (n p,): at p instants of n rows, those of a row in succession.
    group: force, angle, rate, time, since, logged, temperature rate or move. origin: of which powers are
    taken, SI; reference: from which they are printed.
    """

    name: str
    unit: str
    x: Array
    code: str
    group: str
    origin: float = 0.0
    reference: float = 0.0
    needs: str = ""  # the channel that a recording has to have

    def printed(self, x: Array | float) -> Array | float:
        """Values in SI as they are printed."""
        return from_si(np.asarray(x, dtype=float), self.unit) if self.unit else x


def variables(s: Stimulus, still: bool = False) -> tuple[Variable, ...]:
    """Return what varies in a recording, or stands `still` too, and may be the argument of a law.

    Values are those at p instants of each row (n p,), those of one row after the other.
    """
    every = [_of_instants(own) for own in zip(*map(_every_variable, s.instants()), strict=True)]
    return tuple(v for v in every if still or is_variable(v))


def _of_instants(own: Sequence[Variable]) -> Variable:
    """Return a variable at p instants of n rows as one, (n p,)."""
    x = np.stack([v.x for v in own], axis=1).ravel()
    return replace(own[0], x=x, origin=_middle_of_range(x) if own[0].group == "time" else own[0].origin)


def is_variable(v: Variable) -> bool:
    """Return whether a variable is more than a constant in its rows."""
    return bool(np.ptp(v.x) > MIN_VARIATION.get(v.group, 0.0))


def joined_variables(each: Sequence[Sequence[Variable]]) -> tuple[Variable, ...]:
    """Return the variables that recordings share, rows one after the other; a channel's origin is that of all."""
    by_name = [{v.name: v for v in own} for own in each]
    shared = [[own[name] for own in by_name] for name in by_name[0] if all(name in own for own in by_name)]
    out = []
    for vs in (vs for vs in shared if len({(v.unit, v.group) for v in vs}) == 1):
        x = np.concatenate([v.x for v in vs])
        at = vs[0].reference if len({v.reference for v in vs}) == 1 else float(x.mean())
        out.append(
            replace(vs[0], x=x, origin=_middle_of_range(x) if vs[0].group in CENTRED_GROUPS else 0.0, reference=at)
        )
    return tuple(v for v in out if is_variable(v))


def _middle_of_range(x: Array) -> float:
    return float(x.min() + x.max()) / 2


def _every_variable(s: Stimulus) -> list[Variable]:
    out = list[Variable]()
    if s.true_angle is None:  # of a mount the angles say it
        out += [Variable(f"force_{a}", "g", s.force[:, i], f"s.force[:, {i}]", "force") for i, a in enumerate("xyz")]
    out += [Variable(_symbol_name(name), "rad", s.angle[:, i], f"angle(s, {name!r})", "angle")
            for i, name in enumerate(s.axis_names)]  # fmt: skip
    if s.latitude is not None and set(s.axis_names) == {"azimuth", "elevation"}:
        out.append(Variable("parallactic_angle", "rad", s.parallactic_angle(), "s.parallactic_angle()", "angle"))
    out += [Variable(f"rate_{a}", "deg/s", s.rate[:, i], f"s.rate[:, {i}]", "rate") for i, a in enumerate("xyz")]
    out += [Variable("time", "s", s.time, "s.time", "time", _middle_of_range(s.time))]
    if s.visit[-1] > s.visit[0]:
        out += [Variable("since_move", "s", s.since_move, "s.since_move", "since")]
        out += _of_moves(s)
    if s.temperature is not None:
        needs, code = "temperature", "smoothed_rate(s.temperature, s.time, max(s.time) / 100)"
        T, T_rate = s.temperature, smoothed_rate(s.temperature, s.time, float(np.max(s.time)) / 100)
        at = s.reference_temperature
        out.append(Variable("temperature", "degC", T, "s.temperature", "logged", _middle_of_range(T), at, needs))
        out.append(Variable("temperature_rate", "degC/h", T_rate, code, "temperature rate", needs=needs))
    out += [
        Variable(_symbol_name(name), "", x, f"s.covariates[{name!r}]", "logged", _middle_of_range(x), float(x.mean()),
                 f"covariate:{name}")
        for name, x in s.covariates.items()
    ]  # fmt: skip
    return out


def _of_moves(s: Stimulus) -> list[Variable]:
    """Return what the last move before a dwell was: about each gimbal, and the force before it and its change."""
    out = list[Variable]()
    for i, name in enumerate(s.axis_names):
        angle, code = np.round(s.move_angle[:, i], 6), f"moved(s, {name!r})"
        if len(np.unique(np.sign(angle))) > 1:
            out.append(Variable(f"approach_{_symbol_name(name)}", "", np.sign(angle), f"sign({code})", "move"))
        out.append(Variable(f"{_symbol_name(name)}_change", "rad", s.move_angle[:, i], code, "move"))
    if s.true_angle is None:
        for i, a in enumerate("xyz"):
            change, code = s.move_force[:, i], f"s.move_force[:, {i}]"
            out.append(Variable(f"force_change_{a}", "g", change, code, "move"))
            before = Variable(f"before_force_{a}", "g", s.force[:, i] - change, f"(s.force[:, {i}] - {code})", "move")
            out.append(before)
    return out


def _symbol_name(name: str) -> str:
    """A name that Python and sympy read as a symbol."""
    plain = "".join(c if c.isalnum() else "_" for c in name)
    bad = not plain.isidentifier() or keyword.iskeyword(plain) or plain in RESERVED or LETTER.fullmatch(plain)
    return f"x_{plain}" if bad else plain
