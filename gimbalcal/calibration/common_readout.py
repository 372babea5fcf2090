r"""Calibrations of units that output counts, brought to one nominal scale and offset.

A calibration states its parameters as errors of a nominal scale k and offset N_0, which often come from the same data:
then they are nearly zero whatever the unit is, and can be compared only about one nominal. With k' and N_0' instead,
:math:`r = k' / k`, and the same counts N,

.. math:: y' = k' (N - N_0') = r y + k' (N_0 - N_0') ,

and so that the same force belongs to the same counts

.. math:: 1 + s' = (1 + s) / r, \qquad b' = r b + k' (N_0 - N_0'), \qquad c' = r^a c ,

for any other parameter c of the output whose unit contains the a-th power of the measured quantity, as K_2 [1/g] with
a = -1. Misalignments precede the scale and do not change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration.calibration import Calibration
from gimbalcal.calibration.readout import Counts, Readout
from gimbalcal.effects import CATALOGUE, Parameter, Stage, with_values
from gimbalcal.effects.effect import TRIAD
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import parse

OUTPUT_STAGES = {Stage.SCALE: FORCE, Stage.ACCELEROMETER: FORCE, Stage.RATE_SCALE: RATE, Stage.GYROSCOPE: RATE}
POWER_OF = {FORCE: "length", RATE: "angle"}  # dimension whose exponent is the power of the quantity
BIASES = ("bias", "gyro_bias")


def common_readout(calibrations: Sequence[Calibration]) -> Readout:
    """Return the median nominal scale and offset of each triad that outputs counts in most of the calibrations."""
    counts = {}
    for quantity in (FORCE, RATE):
        concerned = [c for c in calibrations if any(output_of(p) == quantity for p in c.parameters)]
        stated = [c.readout.counts[quantity] for c in concerned if quantity in c.readout.counts]
        if 2 * len(stated) > len(concerned):
            scale, offset = (np.median([getattr(n, f) for n in stated], axis=0) for f in ("scale", "offset"))
            counts[quantity] = Counts(tuple(map(float, scale)), tuple(map(float, offset)))
    return Readout(counts.get(FORCE), counts.get(RATE))


def output_of(p: Parameter) -> str:
    """Return the quantity in whose readings a parameter is expressed; empty for one that no readout changes."""
    effect = CATALOGUE.get(p.effect)
    return "" if effect is None else OUTPUT_STAGES.get(effect.stage, "")


def is_in_counts(p: Parameter, readout: Readout) -> bool:
    """Return whether a parameter is expressed in readings that are counts, and so is an error of a nominal scale."""
    return output_of(p) in readout.counts


def in_readout(c: Calibration, readout: Readout) -> Calibration:
    """Return the calibration with its parameters about the nominal counts of another readout; see the module.

    Parameters of a triad that outputs counts in one of the two only have no common readout and remain as they are.
    """
    own, wanted = c.readout.counts, readout.counts
    counts = {q: wanted.get(q, n) for q, n in own.items()}
    if counts == own:
        return c
    each = [_nominal_conversion(p, own, counts) for p in c.parameters]
    factor, shift = (np.array(x) for x in zip(*each, strict=True))
    parameters = tuple(
        replace(p, sigma=p.sigma * abs(f), mean=f * p.mean + d) for p, (f, d) in zip(c.parameters, each, strict=True)
    )
    return replace(
        c,
        effects=with_values(c.effects, parameters, factor * c.values + shift, c.readout.gimbals),
        parameters=parameters,
        covariance=c.covariance * np.outer(factor, factor),
        readout=Readout(counts.get(FORCE), counts.get(RATE), c.readout.gimbals),
    )


def _nominal_conversion(p: Parameter, before: dict[str, Counts], after: dict[str, Counts]) -> tuple[float, float]:
    """Return factor and shift that take a parameter from one nominal to another."""
    quantity = output_of(p)
    if quantity not in before:
        return 1.0, 0.0
    axes = [TRIAD.index(p.axis[0])] if p.axis[:1] in TRIAD else [0, 1, 2]
    (k, N0), (k_new, N0_new) = (
        (np.array(n.scale)[axes], np.array(n.offset)[axes]) for n in (before[quantity], after[quantity])
    )
    r = float((k_new / k).mean())
    if CATALOGUE[p.effect].stage in (Stage.SCALE, Stage.RATE_SCALE):
        return 1 / r, 1 / r - 1
    shift = float((k_new * (N0 - N0_new)).mean()) if p.effect in BIASES else 0.0
    return r ** dict(parse(p.unit).dimension).get(POWER_OF[quantity], 0.0), shift
