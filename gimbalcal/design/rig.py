"""A rig: the axes that it turns, the angles that each may take, and how well it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, Platform, known
from gimbalcal.units import to_si

MOST_CANDIDATES = 200_000  # rows of some 18 parameters: 100 MB of work space


@dataclass(frozen=True)
class Rig:
    """What a rig can do: its axes, the angles that each may take [rad], and how well it is read.

    setting [rad] is the one-sigma error of a setting; infinite where no angle is known. accelerometer [m/s^2] is the
    noise of one position's mean.
    """

    platform: Platform
    grid: Mapping[str, Array]
    setting: float = np.inf
    accelerometer: float = 1e-6 * G0
    gravity: float = G0

    def candidates(self) -> Array:
        """All settings (c, k) [rad] of the grid in platform axis order; an axis that is not in the grid stays at 0."""
        return np.array(list(product(*(self.grid.get(name, np.zeros(1)) for name in self.platform.axis_names))))


def grid(low: float, high: float, step: float) -> Array:
    """Angles [rad] from low through high; a full circle does not repeat its start."""
    n = round((high - low) / step)
    full = np.isclose(high - low, 2 * np.pi)
    return np.asarray(low + step * np.arange(n if full else n + 1))


def free_rig(platform: Platform, step: float = np.pi / 4, **options: Any) -> Rig:
    """A rig whose axes turn freely in steps of `step` [rad]; a vertical last axis stays, as it moves no gravity."""
    turning = platform.axes[:-1] if platform.axes[-1].direction == "z" else platform.axes
    return Rig(platform, {a.name: grid(-np.pi, np.pi, step) for a in turning}, **options)


def rig_of(name: str, step: float, setting: float | None, force: float = 2.0) -> Rig:
    """The rig of a known platform in steps of `step` [deg], set to `setting` [arcsec] (None: no angle is known).

    force [ug]: noise of one position's mean. Raises InputError for a platform that is not known, a step that does not
    divide the circle, or a noise that is none.
    """
    platform = known(name)
    if platform is None or not platform.axes:
        with_axes = ", ".join(n for n, p in KNOWN.items() if p.axes)
        raise InputError(f"no rig is called {name!r}; known are {with_axes}")
    if not 0 < step <= 180 or abs(360 / step - round(360 / step)) > 1e-9:
        raise InputError(f"--step must divide 360 deg into equal parts, got {step:g} deg")
    if setting is not None and not 0 <= setting < np.inf:
        raise InputError(f"--angle-sigma must be a finite number of arcsec from 0, got {setting:g}")
    if not 0 < force < np.inf:
        raise InputError(f"--force-sigma must be a finite number of ug above 0, got {force:g}")
    noise = {"setting": np.inf if setting is None else to_si(setting, "arcsec"), "accelerometer": to_si(force, "ug")}
    made = free_rig(platform, np.deg2rad(step), **noise)
    if (360 / step) ** len(made.grid) > MOST_CANDIDATES:
        raise InputError(f"--step {step:g} deg on {len(made.grid)} axes makes too many attitudes: take a coarser step")
    return made
