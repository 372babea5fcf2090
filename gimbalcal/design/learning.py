r"""Positions, hours and temperatures that let a law in given variables be distinguished from what could imitate it.

An unknown law is represented by flexible functions of its variables, added to each accelerometer: harmonics of
a gimbal angle, Legendre polynomials of a force, of time and of temperature, or products of those of two variables. Its
confounders are the calibration and the same functions of everything else that varies: time, temperature, the other
gimbals and forces, each factor of a product by itself, and with time in the place of temperature. With information F of
all of them, the positions maximise the joint information on calibration and law given the others,
:math:`-\ln\det P_{cl}` with P the inverse of F, and

.. math:: \mathrm{share} = \left( \det P^0_{ll} / \det P_{ll} \right)^{1 / q}, \quad
    P^0 : \text{without confounders} ,

of its q functions in the geometric mean, is what the confounders do not imitate. The temperature goes up and down as a
sine during the positions, as slowly as a bench chamber does, in as few cycles as bring nearly the best share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial import legendre

from gimbalcal.design.optimal import (
    LawPlan,
    PositionsDesign,
    assessed_design,
    criterion_value,
    default_terms,
    optimise,
    published,
)
from gimbalcal.design.rig_positions import PositioningRig, design_parameters, stimulus_of_settings, whitened_rows
from gimbalcal.earth import HOUR
from gimbalcal.effects import Parameter
from gimbalcal.errors import InputError, list_of_alternatives
from gimbalcal.number import Array
from gimbalcal.schedule import Hold, Schedule

RANGE_C = (15.0, 35.0)  # temperatures of the plan
CHAMBER_K_PER_H = 10.0  # at which a bench chamber follows with the unit in it
CYCLES = (1, 2, 3)  # of temperature during the positions
MIN_RELATIVE_SHARE = 0.8  # of the best share, from which the fewest cycles are taken
DEGREE, HARMONICS = 4, 3  # of flexible functions of one variable
FACTOR_ORDERS = 2  # of these, in products and of confounders
SIZE = 30.0  # sigmas of a position's mean: prior of each function
STARTS = 3  # of the exchange, one greedy
DWELL_S = 600.0  # where no temperature has to follow
TIME, TEMPERATURE = "time", "temperature"


def design_learning(
    rig: PositioningRig, count: int, learn: Sequence[str], terms: Sequence[str] = ()
) -> PositionsDesign:
    """Return `count` positions in order, and the temperatures, by which a law in one or two variables is distinguished.

    learn: of time, temperature, force_x, force_y, force_z and the gimbals of the rig; two are the factors of a product.
    Raises InputError for other variables, and for a gimbal that no position turns.
    """
    known = (TIME, TEMPERATURE, "force_x", "force_y", "force_z", *rig.platform.axis_names)
    for name in learn:
        if name not in known:
            raise InputError(f"--learn {name}: a plan has no such variable; write {list_of_alternatives(known)}")
    if not 0 < len(set(learn)) == len(learn) <= 2:
        raise InputError("--learn takes one variable, or two different ones whose product a law may follow")
    wanted = design_parameters(rig, terms or default_terms(rig))
    settings = rig.candidates()
    still = {name for name, x in zip(rig.platform.axis_names, settings.T, strict=True) if np.ptp(x) == 0}
    if idle := still & set(learn):
        raise InputError(
            f"--learn {min(idle)}: positions do not turn this gimbal, as about the vertical it changes no force; name "
            "another variable"
        )
    plans = {}
    warm = TEMPERATURE in learn
    for cycles in CYCLES if warm else (0,):
        T = np.sin(2 * np.pi * cycles * (np.arange(count) + 0.5) / count) if warm else np.zeros(count)
        rows, _, confounders = _rows(rig, settings, T, learn, wanted)
        chosen = optimise(rows, count, "D", ~confounders, 0, STARTS)
        plans[cycles] = settings[chosen], _law_share(rig, settings[chosen], T, learn, wanted)
    best = max(share for _, share in plans.values())
    cycles = next(k for k, (_, share) in plans.items() if share >= MIN_RELATIVE_SHARE * best)
    angles, share = plans[cycles]
    span = RANGE_C[1] - RANGE_C[0]
    hours = cycles * 2 * span / CHAMBER_K_PER_H if warm else count * DWELL_S / HOUR
    holds = tuple(Hold(tuple(map(float, a)), hours * HOUR / count) for a in angles)
    schedule = Schedule(f"learn-{'-'.join(learn)}-{count}", rig.platform, holds)
    usual = {
        s.name: _law_share(replace(rig, platform=s.platform), s.angles, np.linspace(-1, 1, len(s.holds)), learn, wanted)
        for s in published(rig)
        if s.platform == rig.platform or not set(learn) & set(rig.platform.axis_names)
    }
    sine = (sum(RANGE_C) / 2, span / 2, hours * HOUR / cycles) if warm else (0.0, 0.0, 0.0)
    plan = assessed_design(schedule, rig, wanted, "D", published(rig), len(settings))
    return replace(plan, law=LawPlan(tuple(learn), share, usual, hours, *sine))


def _law_share(
    rig: PositioningRig, angles: Array, T: Array, learn: Sequence[str], wanted: Sequence[Parameter]
) -> float:
    """Return the share of a law that no confounder imitates in positions of these angles (n, k), in order."""
    rows, law, confounders = _rows(rig, angles, T, learn, wanted)
    own = rows[np.arange(len(angles)), np.arange(len(angles))]
    joint, alone = (criterion_value(own[..., kept], "D", law[kept]) for kept in (np.ones_like(law), ~confounders))
    return float(np.exp((joint - alone) / law.sum()))


def _rows(
    rig: PositioningRig, settings: Array, T: Array, learn: Sequence[str], wanted: Sequence[Parameter]
) -> tuple[Array, Array, Array]:
    """Return rows (n, c, 3, p) of c settings at each of n instants, and which of p columns are law and confounders.

    T (n,): temperature at the instants, from -1 to 1. The first columns are those of the calibration.
    """
    n, c, gimbals, single = len(T), len(settings), rig.platform.axis_names, len(learn) == 1
    s, bias = stimulus_of_settings(settings, rig), design_parameters(rig, ("bias",))
    unit = whitened_rows(settings, rig, bias) / np.array([p.sigma for p in bias]) * SIZE * rig.accelerometer
    x = {TIME: np.linspace(-1, 1, n)[:, None], TEMPERATURE: T[:, None]}
    x |= {f"force_{a}": s.force[None, :, i] / s.gravity for i, a in enumerate("xyz")}
    x |= {name: s.angle[None, :, i] for i, name in enumerate(gimbals)}
    moving = [name for name in x if name not in (TIME, TEMPERATURE) and np.ptp(x[name]) > 0]

    def functions(name: str, few: bool = False) -> Array:
        if name in gimbals:
            waves = x[name][..., None] * np.arange(1, (FACTOR_ORDERS if few else HARMONICS) + 1)
            out = np.concatenate([np.cos(waves), np.sin(waves)], axis=-1)
        else:
            out = legendre.legvander(x[name], FACTOR_ORDERS if few else DEGREE)[..., 1:]
        return np.broadcast_to(out, (n, c, out.shape[-1]))

    def products(one: str, other: str) -> Array:
        A, B = functions(one, few=True), functions(other, few=True)
        return np.asarray((A[..., :, None] * B[..., None, :]).reshape(n, c, -1))

    law = functions(learn[0]) if single else products(*learn)
    confounders = [functions(name) for name in dict.fromkeys([TIME, *learn]) if not (single and name in learn)]
    confounders += [functions(name, few=True) for name in moving if name not in learn]
    if not single and TIME not in learn:
        confounders += [products(TIME, name) for name in learn if name in moving]
    added = np.einsum("cij,ncf->ncifj", unit, np.concatenate([law, *confounders], axis=-1)).reshape(n, c, 3, -1)
    calibration = np.broadcast_to(whitened_rows(settings, rig, wanted), (n, c, 3, len(wanted)))
    ordinal = np.arange(len(wanted) + added.shape[-1]) - len(wanted)
    of_law = (ordinal >= 0) & (ordinal < 3 * law.shape[-1])
    return np.concatenate([calibration, added], axis=-1), of_law, (ordinal >= 0) & ~of_law
