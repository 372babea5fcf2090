r"""Two triads in one place: what they say of the same rests, each by its own calibration, but for how they are mounted.

.. math:: u_k^b = R \, u_k^a + \nu_k , \qquad \nu_k^2 \sim m_a^2 + m_b^2 \text{ per component}

with u the corrected mean force of rest k, R the rotation between the triads (Wahba's problem, solved by singular
values) and m the misfit of the norm that each calibration leaves. No constant of either triad is estimated here, so
what is left is what at least one of the calibrations does not describe.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.effect import SENSOR_STAGES
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import FORCE
from gimbalcal.rotation import small_rotation_vector
from gimbalcal.units import from_si

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
    U, _, Vt = np.linalg.svd(b.T @ a)
    R = U @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(U @ Vt)))]) @ Vt
    g, expected = one[0].site.gravity, ROUNDING_SIGMA**2
    for force, (_, c) in ((a, one), (b, other)):
        taken = sum(CATALOGUE[p.effect].stage in SENSOR_STAGES for p in c.parameters)  # out of one number a rest
        expected += float(np.sum((np.linalg.norm(force, axis=1) - g) ** 2)) / max(len(force) - taken, 1)
    return CrossCheck(names, R, b - a @ R.T, float(np.sqrt(expected)))
