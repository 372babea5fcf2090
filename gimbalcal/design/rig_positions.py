r"""Positions of a rig: its axes and the angles that they may take, and the information of each position.

A position brings whitened, prior-scaled rows of the same forward model that calibrates: one row, the norm of the force,
where no angle is known; three rows, less what a setting error takes, where angles are known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects import CATALOGUE, Parameter, Stage, Stimulus, known_effect, parameters
from gimbalcal.effects.effect import without_gauge
from gimbalcal.errors import InputError
from gimbalcal.forward import linearise
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, Platform, known_platform
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.kinds import MULTI_POSITION
from gimbalcal.recording.record import FORCES
from gimbalcal.rotation import cross_matrix
from gimbalcal.units import to_si
from gimbalcal.views.local import VisitRows, eliminate
from gimbalcal.views.positions import position_parameters

MAX_CANDIDATES = 200_000  # rows of some 18 parameters: 100 MB of work space
SAME_INFORMATION = 1e-9  # of the largest information: separates rounding from a real difference of attitude


@dataclass(frozen=True)
class PositioningRig:
    """A gimbal chain with the angles that each axis may take [rad], and its noise.

    setting [rad] is the one-sigma error of a setting; infinite where no angle is known. accelerometer [m/s^2] is the
    noise of one position's mean.
    """

    platform: Platform
    grid: Mapping[str, Array]
    setting: float = np.inf
    accelerometer: float = 1e-6 * G0
    gravity: float = G0

    def candidates(self) -> Array:
        """Return all settings (c, k) [rad] of the grid in platform axis order; an axis outside the grid stays at 0."""
        return np.array(list(product(*(self.grid.get(name, np.zeros(1)) for name in self.platform.axis_names))))


def angle_grid(low: float, high: float, step: float) -> Array:
    """Return angles [rad] from low through high; a full circle does not repeat its start."""
    n = round((high - low) / step)
    full = np.isclose(high - low, 2 * np.pi)
    return np.asarray(low + step * np.arange(n if full else n + 1))


def stepped_rig(platform: Platform, step: float, **options: Any) -> PositioningRig:
    """Return `free_rig` with steps of `step` [deg]. Raises InputError for one that is too fine or divides no circle."""
    if not 0 < step <= 180 or abs(360 / step - round(360 / step)) > 1e-9:
        raise InputError(f"--step must divide 360 deg into equal parts, got {step:g} deg")
    rig = free_rig(platform, np.deg2rad(step), **options)
    if (360 / step) ** len(rig.grid) > MAX_CANDIDATES:
        raise InputError(f"--step {step:g} deg on {len(rig.grid)} axes makes too many attitudes: take a coarser step")
    return rig


def free_rig(platform: Platform, step: float = np.pi / 4, **options: Any) -> PositioningRig:
    """Return a rig whose axes turn freely in steps of `step` [rad]; a vertical last axis is fixed."""
    turning = platform.axes[:-1] if platform.axes[-1].direction == "z" else platform.axes
    return PositioningRig(platform, {a.name: angle_grid(-np.pi, np.pi, step) for a in turning}, **options)


def rig_of(name: str, step: float, setting: float | None, force: float = 2.0) -> PositioningRig:
    """Return the rig of a known platform in steps of `step` [deg], set to `setting` [arcsec] (None: no angle is known).

    force [ug]: noise of one position's mean. Raises InputError for an unknown platform, a step that does not divide the
    circle, or a noise that is not positive.
    """
    platform = known_platform(name)
    if platform is None or not platform.axes:
        with_axes = ", ".join(n for n, p in KNOWN.items() if p.axes)
        raise InputError(f"no rig is called {name!r}; known are {with_axes}")
    if setting is not None and not 0 <= setting < np.inf:
        raise InputError(f"--angle-sigma must be a finite number of arcsec from 0, got {setting:g}")
    if not 0 < force < np.inf:
        raise InputError(f"--force-sigma must be a finite number of ug above 0, got {force:g}")
    noise = {"setting": np.inf if setting is None else to_si(setting, "arcsec"), "accelerometer": to_si(force, "ug")}
    return stepped_rig(platform, step, **noise)


def design_parameters(rig: PositioningRig, terms: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the parameters of the terms that this rig can observe. Raises InputError for effects that it cannot."""
    terms = tuple(dict.fromkeys(terms))
    for term in terms:
        cls = known_effect(term)
        if cls.channel != "specific_force" or cls.requires:
            need = f" and needs the channel {cls.requires[0]}" if cls.requires else ""
            raise InputError(f"{term} shows in {cls.channel}{need}: positions at rest do not design for it")
    if np.isinf(rig.setting):
        gimbals = [t for t in terms if parameters(CATALOGUE[t], rig.platform.axis_names) != parameters(CATALOGUE[t])]
        if gimbals:
            raise InputError(f"{gimbals[0]} is an angle error, which is not observable where no angle is known")
        return without_gauge([p for t in terms for p in parameters(CATALOGUE[t])])
    return position_parameters(rig.platform, terms)


def stimulus_of_settings(settings: Array, rig: PositioningRig) -> Stimulus:
    """Return the stimulus of the settings (c, k) [rad] of a rig without errors."""
    n = len(settings)
    channels = {("gimbal_angle", a): settings[:, i] for i, a in enumerate(rig.platform.axis_names)}
    time, position = 600.0 * np.arange(n), np.arange(1, n + 1)
    site = Site(gravity=rig.gravity)
    return stimulus_from_angles(Recording(MULTI_POSITION, "design", rig.platform, site, {}, time, position, channels))


def distinct_settings(settings: Array, rig: PositioningRig, wanted: Sequence[Parameter]) -> tuple[Array, Array]:
    """Return settings (c, k) of different information, one of each, and their whitened, prior-scaled rows (c, 3, p)."""
    rows = whitened_rows(settings, rig, wanted)
    F = np.einsum("cip,ciq->cpq", rows, rows).reshape(len(rows), -1)
    size = np.abs(F).max() or 1.0
    # Along one drawn direction, equal information differs by rounding alone. Values rounded to a grid would not do: two
    # that are equal may lie on both sides of its edge, on one processor and not on another.
    z = F @ np.random.default_rng(0).standard_normal(F.shape[1]) / size
    order = np.argsort(z)
    group = np.cumsum(np.diff(z[order], prepend=z[order[0]]) > SAME_INFORMATION)
    keep = np.full(group[-1] + 1, len(z))
    np.minimum.at(keep, group, order)
    keep.sort()
    return settings[keep], rows[keep]


def whitened_rows(settings: Array, rig: PositioningRig, wanted: Sequence[Parameter]) -> Array:
    """Return the rows (c, 3, p) of each setting, in units of its noise and of the priors, setting errors eliminated."""
    s = stimulus_of_settings(settings, rig)
    return rows_at_rest(s, rig.platform, wanted, rig.accelerometer, rig.setting)


def rows_at_rest(
    s: Stimulus, platform: Platform, wanted: Sequence[Parameter], accelerometer: float, setting: float,
    weight: Array | None = None,
) -> Array:  # fmt: skip
    """Return the rows (n, 3, p) of dwells, whitened and in units of the priors, setting errors eliminated.

    s: stimulus of each dwell (n); accelerometer [m/s^2]: one sigma of a mean of weight one; setting [rad]: of a
    gimbal, infinite where no angle is known. A plan has no order: effects of the last move are absent.
    """
    n = len(s.force)
    s = s.at(move_force=np.zeros((n, 3)), move_angle=np.zeros_like(s.readout), earlier_move_force=np.zeros((n, 3)))
    rows = linearise(platform, s, (), channels=FORCES)
    J = rows.jacobian(wanted)
    # where no angle is known the force may be turned by any angle
    G = cross_matrix(s.force) if np.isinf(setting) else rows.sensitivity(Stage.ENCODER)
    linear = VisitRows(J, 0 * s.force, G, np.ones(n) if weight is None else weight, J[:0], s.force[:0])
    w = eliminate(linear, accelerometer**2, setting**2)
    return np.where(np.isfinite(w.sigma)[..., None], w.J, 0.0) * np.array([p.sigma for p in wanted])
