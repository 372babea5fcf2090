"""The true motion and environment of the hardware, from which effects compute their contributions."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects.history import slope
from gimbalcal.number import Array, arctan2, cos, sin

REFERENCE_TEMPERATURE = 20.0  # degC, T0 of the cards
INSTANTS = 16  # spread over the time of which a row is the mean: what jumps within it is right to a thirtieth


def instants_about_middle(count: int) -> Array:
    """Return so many instants (count,) that are spread evenly over a time, from its middle and in units of it."""
    return np.asarray((np.arange(count) + 0.5) / count - 0.5)


@dataclass(frozen=True)
class Stimulus:
    """The true motion and environment of the hardware at n instants; immutable, SI. Every array has time first.

    What sensors read stands in the recording; `kinematics` says where a reading has to serve for the truth, and the
    readouts of the gimbals stand here because the encoders' errors are a function of them. Temperature and covariates
    are as logged. `force` is the specific force as it arrives at the stage that is being evaluated, `angle` the true
    gimbal angle as far as it is known there. Move quantities describe the last slew before the dwell of each row (zero
    in the first dwell): the changes of ideal platform force and of readout, and the same one slew earlier.
    """

    time: Array  # (n,) s since the first sample, of its session if the time between sessions is unknown
    readout: Array  # (n, k) rad, platform axis order
    angle: Array  # (n, k) rad
    force: Array  # (n, 3) m/s^2
    gravity: float  # m/s^2, magnitude at the site
    visit: Array  # (n,) int, ordinal of the dwell, 0 first
    position: Array  # (n,) int, name of the position held
    since_move: Array  # (n,) s since the dwell began
    move_force: Array  # (n, 3) m/s^2
    move_angle: Array  # (n, k) rad
    earlier_move_force: Array  # (n, 3) m/s^2
    rate: Array  # (n, 3) rad/s, true angular rate of the sensor block against the inertial frame, in its axes
    axis_names: tuple[str, ...]
    latitude: float | None = None  # rad
    target: Array | None = None  # (n, 3) unit vector to the true direction, in north, east, down (pointing only)
    true_angle: Array | None = None  # (n, k) rad, gimbal angles at which a perfect mount would point there
    aimed: Array | None = None  # (n, 3, 2) across and along of that mount, in the frame of its base
    temperature: Array | None = None  # (n,) degC
    reference_temperature: float = REFERENCE_TEMPERATURE  # degC, where temperature coefficients are referred to
    covariates: Mapping[str, Array] = dataclasses.field(default_factory=dict)
    axis_directions: tuple[str, ...] = ()  # "x", "y" or "z" of each gimbal axis
    sense: tuple[int, ...] = ()  # of each readout against the platform's drawing, 1 or -1; all 1 where it is not said
    attitude: Array | None = None  # C_np (n, 3, 3) of the perfect platform
    load: Array | None = None  # (n, k, 3) unit gravity in the frame that turns with gimbal i
    rate_slope: Array | None = None  # (n, 3) rad/s^2, d(rate)/dt where it is known; else the rows' differences tell it
    duration: Array | None = None  # (n,) s over which each row is a mean; None: rows are samples
    running: Array | None = None  # (n,) s, a clock that goes on through all sessions where `time` begins anew in each

    def at(self, **changes: Any) -> Stimulus:
        """Return the same stimulus with some arrays replaced."""
        out = object.__new__(Stimulus)  # what `dataclasses.replace` does, without a look at every field
        vars(out).update(vars(self), **changes)
        return out

    def select(self, rows: NDArray[Any] | slice) -> Stimulus:
        """Return the stimulus at some rows only."""
        n = len(self.time)
        cut = {k: v[rows] for k, v in vars(self).items() if isinstance(v, np.ndarray) and v.ndim and len(v) == n}
        return self.at(**cut, covariates={k: v[rows] for k, v in self.covariates.items()})

    def instants(self) -> tuple[Stimulus, ...]:
        """Return the stimulus at instants that are spread evenly over the time of which each row is a mean.

        Only the clock goes on between them; all else is as in the mean. Of samples it is the stimulus itself.
        """
        if self.duration is None:
            return (self,)
        return tuple(
            self.at(time=self.time + x * self.duration, duration=None) for x in instants_about_middle(INSTANTS)
        )

    def held(self, n: int) -> Stimulus:
        """Return the stimulus of one row for n rows; covariates are those of the one."""
        arrays = {k: v for k, v in vars(self).items() if isinstance(v, np.ndarray) and v.ndim}
        return self.at(**{k: np.broadcast_to(v, (n, *v.shape[1:])) for k, v in arrays.items()})

    @property
    def onwards(self) -> Array:
        """A clock (n,) [s] that never goes back: it orders single events, whatever the time between sessions."""
        return self.time if self.running is None else self.running

    def carries(self, quantity: str) -> bool:
        """Return whether an effect that needs a quantity ("temperature", "covariate:pressure") finds it here."""
        quantity, _, name = quantity.partition(":")
        if quantity == "covariate":
            return name in self.covariates if name else bool(self.covariates)
        if quantity == "angular_rate":
            return bool(np.any(self.rate))
        return getattr(self, quantity) is not None

    def turning_faster(self) -> Array:
        """Return angular acceleration (n, 3) [rad/s^2] of the sensor block."""
        return slope(self.rate, self.time, self.visit) if self.rate_slope is None else self.rate_slope

    def parallactic_angle(self) -> Array:
        r"""Return the angle q (n,) [rad] by which the field of a mount with azimuth A and elevation h turns.

        .. math:: \tan q = \frac{-\sin A \cos L}{\cos h \sin L - \sin h \cos A \cos L}

        with L the latitude; zero on other platforms. Raises ValueError where the latitude is unknown.
        """
        if set(self.axis_names) != {"azimuth", "elevation"}:
            return 0 * self.time
        if self.latitude is None:
            raise ValueError("the parallactic angle needs the latitude of the site")
        A, h = (self.angle[:, self.axis_names.index(name)] for name in ("azimuth", "elevation"))
        sL, cL = np.sin(self.latitude), np.cos(self.latitude)
        return arctan2(-sin(A) * cL, cos(h) * sL - sin(h) * cos(A) * cL)

    def temperature_excess(self) -> Array:
        """Return T - T0 (n,) [degC]. Raises ValueError where temperature was not recorded."""
        if self.temperature is None:
            raise ValueError("this effect needs a temperature channel and the recording has none")
        return np.asarray(self.temperature - self.reference_temperature)
