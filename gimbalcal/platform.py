r"""The drawing of a gimballed platform: its chain of axes, without errors.

A platform is a tuple of axes from the stabilised platform outwards to the base. Each axis is a frame rotation about
one body direction by ``sign * readout + offset``, and the attitude is their product,

.. math:: C_b^p = R_1(\theta_1) \, T_1 \, R_2(\theta_2) \, T_2 \cdots R_k(\theta_k) \, T_k ,

with :math:`T_i` the small tilt of the next axis out (identity on the drawing). So a rate table, a 2-, 3- or 4-axis
platform or a telescope mount is a literal.

The space-stable platform of Wu et al. (2018) appears with two readout conventions in the paper: Table 1 counts the
calibration angles from the level platform, Eq. (4) the inertial angles S_t, h, q. They are one chain,

.. math:: C_b^p = R_z(-S_t) \, R_x(0) \, R_y(h + \pi/2) \, R_z(-q) ,

so the readouts of the platform and of the outer gimbal run the other way in a static run. An error of an encoder's
zero is counted once, in the sense of the drawing that the platform is known by (Table 1); `Platform.sense` says how
the readouts of a recording run against it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from gimbalcal.number import Array
from gimbalcal.rotation import frame_rotation, tilt_rotation, within_half_turn


@dataclass(frozen=True)
class Axis:
    """One gimbal axis: its name, body direction, sense of its readout and angle [rad] at zero readout."""

    name: str
    direction: str
    sign: int = 1
    offset: float = 0.0

    def __post_init__(self) -> None:
        if not self.name or not isinstance(self.name, str):
            raise ValueError(f"the name of an axis must be a word, got {self.name!r}")
        if self.direction not in ("x", "y", "z") or self.sign not in (1, -1):
            raise ValueError(
                f"axis `{self.name}` must have direction x, y or z and sign 1 or -1, "
                f"got {self.direction!r} and {self.sign!r}"
            )

    def rotation(self, readout: Array) -> Array:
        """Return the direction cosine matrix (..., 3, 3) of this axis alone at its readouts (...) [rad]."""
        return frame_rotation(self.direction, self.sign * readout + self.offset)


@dataclass(frozen=True)
class Platform:
    """A gimbal chain, from the platform outwards to the base."""

    name: str
    axes: tuple[Axis, ...]

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the axes, platform first."""
        return tuple(axis.name for axis in self.axes)

    @property
    def sense(self) -> tuple[int, ...]:
        """Return for each axis 1 where its readout grows as on the drawing of this name, -1 where it falls.

        A platform that is not known by name is its own drawing.
        """
        drawing = KNOWN.get(self.name, self)
        if [(a.name, a.direction) for a in drawing.axes] != [(a.name, a.direction) for a in self.axes]:
            drawing = self
        return tuple(own.sign * drawn.sign for own, drawn in zip(self.axes, drawing.axes, strict=True))

    def attitude(self, angles: ArrayLike, tilts: ArrayLike | None = None) -> Array:
        """Return the direction cosine matrix from base to platform.

        Parameters: angles (..., k) gimbal angles [rad] in the order of `axes`; tilts (..., k, 3) small rotation
        [rad] between axis i and the next one out. Returns C_bp (..., 3, 3). Raises ValueError for a wrong k.
        """
        angles = np.asarray(angles)
        if angles.shape[-1] != len(self.axes):
            raise ValueError(
                f"`angles` must have shape (..., {len(self.axes)}) for the {len(self.axes)}-axis platform "
                f"{self.name!r}, got {angles.shape}"
            )
        chain = None
        for i, axis in enumerate(self.axes):
            link = axis.rotation(angles[..., i])
            tilt = None if tilts is None else np.asarray(tilts)[..., i, :]
            if tilt is not None and (tilt.dtype == object or tilt.any()):  # most axes of most chains are not tilted
                link = link @ tilt_rotation(tilt)
            chain = link if chain is None else chain @ link
        if chain is None:
            return np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
        return chain

    def attitudes(self, angles: Array) -> list[Array]:
        """Return the direction cosine matrix (..., 3, 3) from the base to each axis, the platform first.

        angles (..., k): as in `attitude`, without tilts of the axes.
        """
        links = [axis.rotation(angles[..., i]) for i, axis in enumerate(self.axes)]
        return [reduce(np.matmul, links[i:]) for i in range(len(links))]

    def angles(self, readings: Mapping[str, ArrayLike], shape: tuple[int, ...]) -> Array:
        """Stack named readings (n,) into (n, k) in axis order; an axis that was not recorded stays at zero."""
        columns = [np.broadcast_to(readings.get(name, 0.0), shape) for name in self.axis_names]
        return np.stack([np.asarray(c) for c in columns], axis=-1) if columns else np.zeros((*shape, 0))


# Wu et al. (2018), Table 1: g^p = Rz(theta_1) Rx(theta_2) Ry(theta_3) (0, 0, g)
SPACE_STABLE = Platform(
    "space-stable", (Axis("platform", "z"), Axis("inner", "x"), Axis("middle", "y"), Axis("outer", "z"))
)
# Wu et al. (2018), Eq. (4): readouts S_t, 0, h, q while the platform is stable in inertial space
SPACE_STABLE_INERTIAL = Platform(
    "space-stable",
    (Axis("platform", "z", -1), Axis("inner", "x"), Axis("middle", "y", 1, pi / 2), Axis("outer", "z", -1)),
)
BENCH = Platform("bench", ())  # a unit turned by hand: no axes, attitude unknown

KNOWN: dict[str, Platform] = {
    "space-stable": SPACE_STABLE,
    "bench": BENCH,
    "rate-table": Platform("rate-table", (Axis("table", "z"),)),
    "two-axis-table": Platform("two-axis-table", (Axis("inner", "z"), Axis("outer", "x"))),
    "three-axis-table": Platform("three-axis-table", (Axis("inner", "z"), Axis("middle", "x"), Axis("outer", "z"))),
    "alt-az": Platform("alt-az", (Axis("elevation", "y"), Axis("azimuth", "z"))),
}
STABILISED = KNOWN | {"space-stable": SPACE_STABLE_INERTIAL}


def known_platform(name: str, stabilised: bool = False) -> Platform | None:
    """Return the known platform of that name; one that is stable in inertial space reads inertial angles (Eq. (4))."""
    return (STABILISED if stabilised else KNOWN).get(name)


def zeros_of_axes(readout: Array, star: Array) -> Array:
    r"""Return zeros (k,) [rad] that bring readouts (n, k) of a mount near its stars (n, k): median misses of each axis.

    A mount of two axes, innermost first, sees one direction at two pairs of angles,

    .. math:: (\theta_1, \theta_2) \quad\text{and}\quad (\pi - \theta_1, \; \theta_2 + \pi) ;

    that of each star whose inner angle is nearer to the readout is taken, as half of the stars may be seen plunged.
    """
    if readout.shape[1] == 2:
        other = np.pi + np.array([-1.0, 1.0]) * star
        miss, plunged = (np.abs(within_half_turn((x - readout)[:, :1])) for x in (star, other))
        star = np.where(plunged < miss, other, star)
    off = star - readout
    return np.asarray(np.angle(np.median(np.cos(off), axis=0) + 1j * np.median(np.sin(off), axis=0)))
