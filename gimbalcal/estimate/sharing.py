r"""Which parameters recordings share, and whether the recordings agree in them.

What an effect is a constant of, its scope, decides who shares its parameters: sensors, encoders and the axes of gimbals
are of the unit; bases, platforms, attitudes and gravity are of the installation, which nights of a mount share and a
rig that was moved does not; what happens once is of its recording; a rate bias is another after every switching on.

Information about shared parameters is added (`Information.__add__`, which unites equal parameters). What chi^2 rises by
when K recordings share them tells whether they may,

.. math:: \Delta = \chi^2_{shared} - \sum_k \chi^2_k \sim s^2 \chi^2(q), \qquad q = \nu_{shared} - \sum_k \nu_k ,

q being the number of combinations that more than one recording determines and s^2 a factor of the noise, which is one
where it is stated. Where s^2 is estimated from nu degrees of freedom, Delta / (q s^2) is an F variate of q and nu.
Of two estimates x_1, x_2 of the same p constants with covariances C_1, C_2 it is

.. math:: \Delta = (x_1 - x_2)^T (C_1 + C_2)^{-1} (x_1 - x_2), \qquad q = p .

Two triads that were logged side by side are compared at the same rests, each by its own calibration,

.. math:: u_k^b = R \, u_k^a + \nu_k , \qquad \nu_k^2 \sim m_a^2 + m_b^2 \text{ per component}

with u the corrected mean force of rest k, R the rotation between the triads (Wahba's problem, solved by singular
values) and m the misfit of the norm that each calibration leaves. No constant of either triad is estimated here, so
what is left is what at least one of the calibrations does not describe.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from math import nan

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.provenance import Session
from gimbalcal.effects import CATALOGUE, Parameter, Stage
from gimbalcal.effects.baseline_effects import GYROSCOPE_BIAS
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES, happens_once
from gimbalcal.errors import InputError
from gimbalcal.inference.information import Solution
from gimbalcal.number import Array
from gimbalcal.p_value import probability
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import FORCE
from gimbalcal.rotation import rotation_between, small_rotation_vector
from gimbalcal.units import from_si

UNIT_STAGES = SENSOR_STAGES | GYROSCOPE_STAGES | {Stage.ENCODER, Stage.AXIS_TILT}
AGREEMENT_SIGNIFICANCE = 0.01  # chance that any of several recordings of a unit is said not to agree where all do


class Scope(Enum):
    """Of what the parameters of an effect are constants."""

    UNIT = "unit"
    INSTALLATION = "installation"
    RECORDING = "recording"
    POWER_UP = "power-up"


def scope_of(effect_id: str) -> Scope:
    """Return of what the parameters of an effect of the catalogue are constants.

    >>> scope_of("scale_factor").value, scope_of("gyro_bias").value, scope_of("base_tilt").value
    ('unit', 'power-up', 'installation')
    """
    cls = CATALOGUE[effect_id]
    if happens_once(cls):
        return Scope.RECORDING
    if effect_id in GYROSCOPE_BIAS:
        return Scope.POWER_UP
    return Scope.UNIT if cls.stage in UNIT_STAGES else Scope.INSTALLATION


def with_widest_priors(parameters: Iterable[Parameter]) -> tuple[Parameter, ...]:
    """Return the parameters of several recordings or views once each, with the widest prior that one of them has."""
    widest: dict[str, Parameter] = {}
    for p in parameters:
        widest[p.label] = max(widest.get(p.label, p), p, key=lambda q: q.sigma)
    return tuple(widest.values())


@dataclass(frozen=True)
class Agreement:
    """Rise of chi^2, in units of the noise, by sharing parameters, and how many combinations are shared."""

    rise: float
    combinations: int
    p_value: float


def agreement_test(
    shared: Solution, alone: Sequence[Solution], variance: float = 1.0, dof: float = np.inf
) -> Agreement:
    """Test whether recordings agree; variance: factor of their stated noise, estimated from `dof` (inf: known)."""
    rise = max(shared.chi2 - sum(s.chi2 for s in alone), 0.0)
    rise = rise / variance if variance > 0 else 0.0
    combinations = shared.dof - sum(s.dof for s in alone)
    return Agreement(rise, combinations, probability(rise, combinations, dof) if combinations > 0 else 1.0)


@dataclass(frozen=True)
class Comparison:
    """One recording against all others: p-value, the largest difference in words, and what keeps it from being judged.

    It does not agree where the p-value is below `AGREEMENT_SIGNIFICANCE` over the number of recordings.
    """

    title: str
    recordings: int
    p_value: float = 1.0
    largest: str = ""
    obstacle: str = ""

    @property
    def agrees(self) -> bool:
        """Return whether the recording agrees with the others, or cannot be judged."""
        return bool(self.obstacle) or self.p_value >= AGREEMENT_SIGNIFICANCE / self.recordings

    @property
    def in_words(self) -> str:
        """Describe the agreement with the others."""
        if self.obstacle:
            return f"it cannot be judged alone: {self.obstacle}"
        agrees = "agrees" if self.agrees else "does not agree"
        return f"{agrees} with the others (p = {self.p_value:.2g}; {self.largest})"

    def session(self, rests: int | None = None, stops: int | None = None) -> Session:
        """Return the entry of the provenance, with the number of rests or stops of the recording."""
        return Session(self.title, self.in_words, nan if self.obstacle else self.p_value, rests, stops)


def disagreeing_recordings(comparisons: Sequence[Comparison]) -> list[int]:
    """Return the ordinals of recordings that do not agree; of two, one is as far off as the other."""
    off = [k for k, c in enumerate(comparisons) if not c.agrees]
    return off[:1] if len(comparisons) == 2 else off


def compare_calibrations(own: Calibration, others: Calibration) -> tuple[float, str]:
    """Return the p-value of the difference in the parameters of both, and the largest difference in words.

    Their sigmas are scaled to their scatter.
    """
    shared = [p for p in own.parameters if p in others.parameters]
    mine, theirs = ([c.parameters.index(p) for p in shared] for c in (own, others))
    difference = own.values[mine] - others.values[theirs]
    C = own.covariance[np.ix_(mine, mine)] + others.covariance[np.ix_(theirs, theirs)]
    sigma = np.sqrt(np.diag(C))
    root = np.linalg.cholesky(C / np.outer(sigma, sigma))
    rise = float(np.sum(np.linalg.solve(root, difference / sigma) ** 2))
    dof = max(1, min(own.residual.dof, others.residual.dof))
    return probability(rise, len(shared), dof), largest_difference(shared, difference, sigma)


def largest_difference(parameters: Sequence[Parameter], difference: Array, sigma: Array) -> str:
    """Describe the largest of differences (p,), SI, over their sigma (p,)."""
    i = int(np.argmax(np.abs(difference) / sigma))
    p = parameters[i]
    size, one = (float(f"{from_si(float(v), p.unit):.3g}") for v in (difference[i], sigma[i]))
    return f"most in {p.label}, by {size:+g} +- {one:g} {p.unit}"


MAX_EXPECTED_RATIO = 3.0  # times what both misfits lead to expect: beyond, one of the calibrations is wrong
MIN_DWELLS = 4  # rests
ROUNDING_SIGMA = 1e-8  # m/s^2; two triads without noise differ by rounding


@dataclass(frozen=True, eq=False)
class CrossCheck:
    """Rotation (3, 3) from one triad to the other, what it leaves at each rest (m, 3), and what is expected [m/s^2]."""

    names: tuple[str, str]
    rotation: Array
    misfit: Array
    expected: float

    @property
    def rms(self) -> float:
        """Root mean square of what is left, per component [m/s^2]."""
        return float(np.sqrt((self.misfit**2).sum() / (3 * len(self.misfit) - 3)))

    @property
    def agree(self) -> bool:
        """Return whether the triads agree as well as each agrees with gravity."""
        return self.rms <= MAX_EXPECTED_RATIO * self.expected

    @property
    def in_words(self) -> str:
        """One sentence."""
        a, b = (name or "the first" for name in self.names)
        angle = float(np.degrees(np.arccos(np.clip((np.trace(self.rotation) - 1) / 2, -1, 1))))
        x, y, z = (float(from_si(v, "deg")) for v in small_rotation_vector(self.rotation))
        mounted = f"({x:.3g}, {y:.3g}, {z:.3g}) deg" if angle < 20 else f"{angle:.3g} deg"
        rms, expected, worst = (float(from_si(v, "mg")) for v in (self.rms, self.expected, np.abs(self.misfit).max()))
        at = int(np.argmax(np.abs(self.misfit).max(axis=1))) + 1
        says = "agree" if self.agree else "do not agree"
        return (
            f"the triads {a} and {b}, turned by {mounted} to each other, {says}: at rest they differ by {rms:.3g} mg "
            f"rms where the misfit of each leads to expect {expected:.3g} (most at rest {at}, {worst:.3g} mg)"
        )


def cross_check(
    one: tuple[Recording, Calibration], other: tuple[Recording, Calibration], names: tuple[str, str]
) -> CrossCheck:
    """Hold two calibrated triads of one recording against each other. Raises InputError for too few rests."""
    a, b = (dwell_means(c.apply(r)).triad(FORCE) for r, c in (one, other))
    if len(a) < MIN_DWELLS:
        raise InputError(f"{len(a)} rests are too few to hold one triad against the other; hold at least {MIN_DWELLS}")
    R = rotation_between(a, b)
    g, expected = one[0].site.gravity, ROUNDING_SIGMA**2
    for force, (_, c) in ((a, one), (b, other)):
        taken = sum(CATALOGUE[p.effect].stage in SENSOR_STAGES for p in c.parameters)  # out of one number a rest
        expected += float(np.sum((np.linalg.norm(force, axis=1) - g) ** 2)) / max(len(force) - taken, 1)
    return CrossCheck(names, R, b - a @ R.T, float(np.sqrt(expected)))
